"""Shapes in docstrings are true: kernels are traced with arguments of the shapes that they name, and asked for theirs.

A name in a shape, n or n_cables, is one size throughout a docstring, and letters differ in size. Left out are functions
that take callables, or vectors as tuples of arrays, one lane a case: these have one shape throughout.
"""

import dataclasses
import importlib
import inspect
import pkgutil
import re
import types
import typing
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import cspr_jax
from cspr_jax.arithmetic.bounds import Bounds
from cspr_jax.motions.amplitudes import Amplitude, named
from cspr_jax.motions.platform_kind import PlatformMotionKind
from cspr_jax.motions.problem import Problem
from cspr_jax.platforms import oscillating_slerp, platform_segment
from cspr_jax.platforms.oscillating_slerp import Slerp
from cspr_jax.platforms.platform_segment import PlatformSegment
from cspr_jax.robots import force_balance, wrench_balance
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.platform import PlatformRobot, pairs_apart
from cspr_jax.robots.point_mass import PointMassRobot, planar_robot
from cspr_jax.robots.robot import Robot
from cspr_jax.robots.state import State
from cspr_jax.robots.wrench_sets import Faces, acceleration_faces
from cspr_jax.swings import hypocycloid, slacks
from cspr_jax.swings.hypocycloid import Segment

ROOMS = ("robots", "motions", "swings", "lines", "beziers", "platforms", "workspaces")
# Of "..." in arguments, and of letters. What else is named has the size that it is met with first.
ANY, LETTERS = (2, 4), {"n": 7, "m": 5}
DIM = r"(?:\.\.\.|[a-z]\w*(?: [+-] 1)?|[1-9]\d*)"
SHAPE = re.compile(rf"(?:leaves (?=\(.*\.\.\.\)))?\((?:|\.\.\.|{DIM},|{DIM}(?:, {DIM})+)\)")
ENTRY = re.compile(r"^    (\w+): (.*(?:\n     .*)*)", re.MULTILINE)
AT_LEAST = 50  # functions that are checked


class Sizes(dict):
    """Sizes of the names in a docstring; of "..." several."""

    def agrees(self, text: str, shape: tuple[int, ...]) -> bool:
        """Whether a shape is what a text such as "(n, 3)" says; a name that is new gets its size."""
        dims = dims_of(text)
        if "..." in dims:
            place = dims.index("...")
            end = len(shape) - (len(dims) - 1 - place)
            self.setdefault("...", shape[place:end])
            shape, dims = (*shape[:place], shape[place:end], *shape[max(end, place) :]), dims
        if len(dims) != len(shape):
            return False
        for dim, size in zip(dims, shape, strict=True):
            name, more = parts(dim)
            if not name.isdigit() and name != "...":
                self.setdefault(name, size - more)
        return all(self.size(dim) == size for dim, size in zip(dims, shape, strict=True))

    def size(self, dim: str):
        name, more = parts(dim)
        return self[dim] if dim == "..." else int(name) if name.isdigit() else self[name] + more

    def shape(self, text: str) -> tuple[int, ...]:
        """The shape that an argument gets."""
        self.setdefault("...", ANY)
        found: tuple[int, ...] = ()
        for dim in dims_of(text):
            found += self[dim] if dim == "..." else (self.size(dim),)
        return found


def dims_of(text: str) -> list[str]:
    return [dim.strip() for dim in text.removeprefix("leaves ").strip("()").split(",") if dim.strip()]


def parts(dim: str) -> tuple[str, int]:
    """Name and what is added, of "n - 1"."""
    name, *more = dim.split(" ", 1)
    return name, int(more[0].replace(" ", "")) if more else 0


def array(*shape: int) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct(shape, jnp.float64)


def entries(node: object, section: str) -> dict[str, str]:
    """What a docstring says of each argument or field."""
    body = re.search(rf"^{section}:\n((?:    .*\n?|\n)*)", inspect.getdoc(node) or "", re.MULTILINE)
    return dict(ENTRY.findall(body[1])) if body else {}


def functions():
    """Public functions of the kernels, by name."""
    for room in ROOMS:
        package = importlib.import_module(f"cspr_jax.{room}")
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            module = importlib.import_module(found.name)
            for name, function in vars(module).items():
                is_function = inspect.isfunction(inspect.unwrap(function)) if callable(function) else False
                if is_function and function.__module__ == found.name and name[0] != "_":
                    yield f"{found.name.removeprefix('cspr_jax.')}.{name}", function


def leaves_of(kind) -> set:
    """Types that an annotation is made of."""
    inner = typing.get_args(kind)
    if typing.get_origin(kind) in (Problem, Callable, Sequence) or not inner:
        return {typing.get_origin(kind) or kind}
    return set().union(*map(leaves_of, inner)) - {..., types.NoneType}


def is_kernel(function) -> bool:
    """Whether it computes arrays of jax from what there is an example of."""
    hints = typing.get_type_hints(function)
    found = leaves_of(hints.pop("return", None))
    given = set().union(*map(leaves_of, hints.values()))
    computes = jax.Array in found or any("Array" in str(getattr(kind, "__annotations__", "")) for kind in found)
    return computes and np.ndarray not in found and given <= KNOWN


KNOWN = {
    PointMassRobot,
    PlatformRobot,
    Robot,
    Amplitude,
    Segment,
    PlatformSegment,
    Slerp,
    PlatformMotionKind,
    State,
    Bounds,
    Limits,
}
KNOWN |= {Problem, Faces, slacks.Instant, slacks.Stretch, jax.Array, int, bool, tuple}
FUNCTIONS = {name: function for name, function in functions() if is_kernel(function)}


def test_most_are_checked():
    assert len(FUNCTIONS) >= AT_LEAST


@pytest.fixture(scope="module", params=[3, 2], ids=["three cables", "two cables"])
def examples(request):
    """One of everything that a kernel takes beside arrays, by its type, for a point mass on so many cables."""
    planar = planar_robot([[0.3, 0.0, 0.0], [-0.3, 0.0, 0.0]], mass=1.0)
    robot = cspr_jax.load_robot("prototype") if request.param == 3 else planar
    amplitude, platform, pose = named("effective", 0.2), cspr_jax.load_robot("laval-mssm"), (array(3), array(4))
    robot, platform = (dataclasses.replace(r, limits=Limits()) for r in (robot, platform))
    of_point = jax.eval_shape(
        lambda start, end, z0: hypocycloid.segment(robot, start, end, z0, odd=jnp.asarray(True)),
        *(array(3), array(3), array()),
    )
    of_poses = jax.eval_shape(
        lambda *given: platform_segment.pose_segment(platform, *given, odd=jnp.asarray(True)),
        *(pose, pose, array(), (array(), array())),
    )
    return {
        PointMassRobot: robot,
        Robot: robot,
        PlatformRobot: platform,
        Amplitude: amplitude,
        Segment: of_point,
        PlatformSegment: of_poses,
        Slerp: of_poses.slerp,
        PlatformMotionKind: PlatformMotionKind(),
        "pairs": pairs_apart(platform),
        State: State(*[array(3)] * 3, array(3, 3), *[array(3)] * 2, array(4)),
        Bounds: Bounds(*[array(request.param)] * 3),
        Faces: jax.eval_shape(acceleration_faces, robot, array(3), *[array(request.param)] * 2),
        slacks.Instant: jax.eval_shape(slacks.instant, of_point, amplitude, array(), array()),
        slacks.Stretch: jax.eval_shape(slacks.stretch, of_point, amplitude, *[array()] * 3),
    }


def with_problem(examples: dict, function) -> dict:
    """The examples, with robot and limits of the kind that a function is of."""
    is_platform = ".platform" in function.__module__ or PlatformRobot in typing.get_type_hints(function).values()
    robot = examples[PlatformRobot if is_platform else PointMassRobot]
    each = array(len(robot.base_points))
    names = [f.name for f in dataclasses.fields(Limits) if f.name not in ("speed_max", "acceleration_max")]
    limits = Limits(**{name: array() if name == "floor" else each for name in names})
    return examples | {Limits: limits, Problem: Problem(robot, limits, examples[Amplitude])}


def argument(kind, text: str, parameter: inspect.Parameter, examples: dict, sizes: Sizes):
    """An argument of a type, of the shapes in its text."""
    union = typing.get_origin(kind) in (typing.Union, types.UnionType)
    kind = typing.get_args(kind)[0] if union else kind
    origin, shapes = typing.get_origin(kind), SHAPE.findall(text)

    def one(shape: str):
        if not shape.startswith("leaves"):
            return array(*sizes.shape(shape))
        more = sizes.shape("(n)" if "n" in shape else "(...)")
        return jax.tree.map(
            lambda leaf: array(*more, *np.shape(leaf)), examples[kind if kind in examples else PlatformSegment]
        )

    if parameter.name == "pairs":
        return np.array(examples["pairs"]) if kind is jax.Array else examples["pairs"]
    if kind in examples or origin in examples:
        return (
            one(shapes[0])
            if shapes and shapes[0].startswith("leaves")
            else examples[kind if kind in examples else origin]
        )
    if kind in (int, bool, float):
        return 2 if parameter.default is inspect.Parameter.empty else parameter.default
    if kind is jax.Array:
        return one(shapes[-1] if " or (" in text else shapes[0])
    found = tuple(one(shape) for shape in shapes)
    count = 3 if kind == tuple[jax.Array, ...] else len(typing.get_args(kind)) or 1
    return found * count if len(found) == 1 else found


def is_static(value) -> bool:
    """Whether a function is compiled for it."""
    return isinstance(value, (int, bool, float, PlatformMotionKind)) or (
        isinstance(value, tuple) and isinstance(value[0], tuple)
    )


def check_fields(value, sizes: Sizes, where: str) -> None:
    """What a class says of its fields is so in an object."""
    sizes.pop("...", None)  # of any shape, but all of the same
    for name, text in entries(type(value), "Fields").items():
        own, shape = getattr(value, name), SHAPE.match(text)
        if entries(type(own), "Fields"):
            check_fields(own, sizes, f"{where}.{name}")
        elif shape and own is not None:
            assert sizes.agrees(shape[0], np.shape(own)), f"{where}.{name}: {text} is of {np.shape(own)}"


def traced(function, examples: dict, sizes: Sizes):
    """What a function returns of arguments as its docstring describes them."""
    texts, kinds, given = entries(function, "Args"), typing.get_type_hints(function), {}
    for name, parameter in inspect.signature(function).parameters.items():
        given[name] = argument(kinds.get(name, parameter.empty), texts.get(name, ""), parameter, examples, sizes)
    static = {name: value for name, value in given.items() if is_static(value)}
    rest = {name: value for name, value in given.items() if name not in static}
    return jax.eval_shape(lambda rest: function(**static, **rest), rest)


def check(function, examples: dict) -> None:
    known = with_problem(examples, function)
    robot = known[Problem].robot
    sizes = Sizes(LETTERS, n_cables=len(robot.base_points), dof=robot.dof, n_pairs=len(known["pairs"]))
    found = traced(function, known, sizes)
    text = inspect.getdoc(function).partition("Returns:")[2].partition("Raises:")[0]
    leaves, shapes = jax.tree.leaves(found), SHAPE.findall(text)
    if entries(type(found), "Fields"):
        check_fields(found, Sizes(sizes), function.__name__)
    else:
        # What comes in a dictionary is told by its keys.
        fits = isinstance(found, dict) or len(shapes) in (1, len(leaves))
        assert fits, f"{function.__name__}: shapes {shapes} for {len(leaves)} arrays"
    for shape, leaf in zip(shapes * len(leaves) if len(shapes) == 1 else shapes, leaves, strict=False):
        assert sizes.agrees(shape, leaf.shape), f"{function.__name__}: {shape} is of {leaf.shape}"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_shapes(name, examples):
    check(FUNCTIONS[name], examples)


@pytest.mark.parametrize(
    ("function", "old", "new"),
    [
        (wrench_balance.jacobian, "(n_cables, 6) one row", "(n_cables, 3) one row"),
        (wrench_balance.jacobian, "rotation: (3, 3)", "rotation: (3, 4)"),
        (force_balance.tensions, "(n_cables,)", "(n,)"),
        (hypocycloid.swing, "d: (2,)", "d: (3,)"),
        (oscillating_slerp.beat, "() each", "(n,) each"),
    ],
)
def test_a_wrong_shape_is_found(examples, monkeypatch, function, old, new):
    assert function.__doc__.count(old) == 1
    monkeypatch.setattr(function, "__doc__", function.__doc__.replace(old, new))
    with pytest.raises((AssertionError, TypeError, ValueError)):
        check(function, examples)


def test_a_wrong_field_is_found(examples, monkeypatch):
    monkeypatch.setattr(Segment, "__doc__", Segment.__doc__.replace("pull: (n_cables, 2)", "pull: (n_cables, 3)"))
    with pytest.raises(AssertionError, match="pull"):
        check(hypocycloid.segment, examples)
