"""Arguments of all public functions: what no function can use is one line that names the argument, before it runs."""

import copy
import dataclasses
import inspect
import pickle
import re
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Literal, get_origin

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import cspr_jax
from cspr_jax.api import calibration, plans, workspaces
from cspr_jax.api.arguments.checks import rule_of, rules_of
from cspr_jax.api.files import imports, replays
from cspr_jax.errors import CsprError, InputError
from cspr_jax.errors.arguments import Positive
from cspr_jax.errors.given_numbers import numbers

PUBLIC = {name: getattr(cspr_jax, name) for name in cspr_jax.__all__}
METHODS = {
    "AvailableAccelerations.margin": workspaces.AvailableAccelerations.margin,
    "AvailableAccelerations.verdict": workspaces.AvailableAccelerations.verdict,
    "Calibration.save": calibration.Calibration.save,
    "ImportedRobot.save": imports.ImportedRobot.save,
    "Plan.animate": plans.Plan.animate,
    "Plan.rows": plans.Plan.rows,
    "Plan.save": plans.Plan.save,
    "Plan.save_mjcf": plans.Plan.save_mjcf,
    "Plan.scatter": plans.Plan.scatter,
    "Plan.to_xarray": plans.Plan.to_xarray,
    "Replay.plot": replays.Replay.plot,
    "Sensitivity.errors": workspaces.Sensitivity.errors,
}
FUNCTIONS = {name: one for name, one in PUBLIC.items() if not inspect.isclass(one)} | METHODS
TAKING = {name: one for name, one in FUNCTIONS.items() if set(inspect.signature(one).parameters) - {"self"}}

LOOP: list = [0.5]
LOOP.append(LOOP)
DEEP: dict = {}
DEEP["robot"] = DEEP
BAD = {
    "no number": object(),
    "bytes": b"1.0",
    "very large": 10**400,
    "in itself": LOOP,
    "complex": 1.0 + 2.0j,
    "complex array": np.array([[0.4, 0.1, 1.5 + 0.1j]]),
    "ragged": [[0.4, 0.1, 1.5], [0.4, 0.1]],
    "strings": [["0.4", "0.1", "1.5"]],
    "none inside": [None, 0.1, 1.5],
    "shape": np.zeros((2, 3, 2)),
    "string": "0.5",
    "None": None,
    "a set": {0.5},
}
TEXTS = {
    "best",
    "preset",
    "amplitude",
    "cable_set",
    "condition",
    "definition",
    "family",
    "law",
    "like",
    "lines",
    "map",
    "name",
    "names",
}
TEXTS |= {"pattern", "precision", "quantity", "rule", "scheduler", "size", "what", "z_axis"}
PATHS = {"log", "plan", "directory", "folder", "given", "kernels", "output", "path", "reference", "result", "results"}
PATHS |= {"source"}
# Whole numbers, which are bounded: what would take all memory.
WHOLE = {"divisions", "max_arcs", "population", "samples", "trajectories", "workers"}

# Where None has a meaning without being the default.
NONE = (
    ("hypocycloid", "start"),
    ("platform_motion", "start"),
    ("run", "workers"),
    ("table", "workers"),
    ("table", "name"),
)


def is_good(function: str, key: str, kind: str) -> bool:
    """Whether a value of `BAD` is one that the argument takes, or one that the function refuses by itself."""
    parameter = inspect.signature(TAKING[function]).parameters[key]
    if kind == "None":
        return parameter.default is None or (function, key) in NONE
    if kind == "string" and function in ("check", "check_many", "least_time_paths"):
        return key == "robot" or (function, key) == ("check", "times")
    if kind == "string" and function == "calibrate":
        return key in ("robot", "lengths", "distances", "free")
    if kind == "string" and function in ("plot", "report") and key in ("robot", "z_axis"):
        return key == "robot"
    return kind == "string" and key in TEXTS | PATHS


@pytest.fixture(scope="module")
def good():
    """Values that functions take, by the name of the argument."""
    robot = cspr_jax.load_robot("prototype")
    point, many = [0.4, 0.1, 1.5], [[0.4, 0.1, 1.5]]
    motion = cspr_jax.hypocycloid(robot, None, point, z0=1.7, arcs=8)
    state = jax.eval_shape(motion.state, jnp.asarray(0.5))
    zeros = type(state)(*(None if part is None else np.zeros(part.shape) for part in state))
    values = {"robot": robot, "problem": cspr_jax.make_problem(robot), "motion": motion, "state": zeros, "tau": 0.5}
    values |= dict.fromkeys(("start", "end", "control_point", "target", "place", "centre", "a", "b"), point)
    values |= dict.fromkeys(("targets", "positions", "starts", "ends", "control_points", "accelerations"), many)
    values |= {"centres": many, "frequencies": 2.0, "position": point, "frequency": 2.0}
    values |= dict.fromkeys(("mass", "gravity", "duration", "z0", "arcs", "oscillations", "max_acceleration"), 1.0)
    values |= dict.fromkeys(("spool_radius", "platform_radius", "drum_radius", "pulses", "cable_error"), 1.0)
    values |= {"base_points": robot.base_points, "platform_points": robot.base_points, "inertia": np.eye(3)}
    values |= dict.fromkeys(
        ("given", "source", "log", "path", "output", "results", "result", "directory", "names", "reference"), "a"
    )
    values |= {"times": [0.0, 1.0], "paths": [[[0.4, 0.1, 1.5], [0.3, 0.1, 1.5]]]}
    places = [{"position": [0.1, 0.0, 1.5]}, {"position": [0.1, 0.1, 1.5]}]
    values |= {"plan": cspr_jax.plan({"schema": 1, "robot": "prototype", "family": "quintic", "pose": places})}
    values |= {
        "durations": [1.0],
        "lengths": [[1.5, 1.5, 1.5]],
        "name": "quintic",
        "what": "robot",
        "errors": cspr_jax.LaunchErrors(),
    }
    return values


@pytest.mark.parametrize("function", TAKING)
def test_bad_arguments(function, good, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    parameters = inspect.signature(TAKING[function]).parameters
    needed = {key: None for key, one in parameters.items() if one.default is inspect.Parameter.empty}
    count = 0
    for key in parameters:
        bad = BAD | ({"memory": 10**10, "none at all": -(10**10)} if key in WHOLE else {})
        for kind, value in bad.items():
            if key == "self" or is_good(function, key, kind):
                continue
            given = {name: None if name == "self" else good[name] for name in needed} | {key: value}
            if function == "merge" and key != "paths":
                given["paths"] = ["a", "b"]
            if function == "check_many" and key != "positions":
                given["positions"] = [[[0.4, 0.1, 1.5]] * 2]
            if function == "merge" and key != "paths":
                given["paths"] = ["first", "second"]
            with pytest.raises(InputError) as raised:
                TAKING[function](**given)
            line = str(raised.value)
            assert line.startswith(key) and len(line.splitlines()) == 1 and len(line) < 400, (key, kind, line)
            count += 1
    assert count >= 10 and not list(tmp_path.iterdir())


def test_every_argument_has_a_rule():
    """By its type, which help and editors show by its name."""
    for name, function in TAKING.items():
        parameters = inspect.signature(function).parameters
        assert set(rules_of(function)) == set(parameters) - {"self"}, name
        kinds = [one.annotation for key, one in parameters.items() if key != "self"]
        assert all(isinstance(kind, str) for kind in kinds if get_origin(kind) is Annotated), name


@pytest.mark.parametrize(
    ("kind", "value", "allowed"),
    [
        (Positive, 0.0, "a finite number > 0"),
        (Positive | None, 0.0, "a finite number > 0, or None"),
        (Literal["a", "b"], None, '"a" or "b"'),
        (Literal["a", "b"] | None, "c", '"a" or "b", or None'),
        (str | Path, 1, "a path"),
        (str | Path | None, 1, "a path, or None"),
        (bool, 1, "True or False"),
    ],
)
def test_unions_say_what_they_allow(kind, value, allowed):
    rule = rule_of(kind)
    with pytest.raises(InputError, match=f"^x = .*: must be {re.escape(allowed)}$"):
        rule("x", value)
    if "None" in allowed:
        rule("x", None)


def test_collections_without_dimensions_are_refused():
    scalar = np.array(1.0)
    for call in (cspr_jax.list_robots, cspr_jax.copy_examples, lambda one: cspr_jax.merge(one, "a")):
        with pytest.raises(InputError, match=r"^(names|paths) = array\(1\.\): must be"):
            call(scalar)


def test_one_robot_is_listed_by_its_name():
    assert cspr_jax.list_robots("prototype") == cspr_jax.list_robots(["prototype"])
    with pytest.raises(InputError, match=r"^names = "):
        cspr_jax.list_robots("a\0b")


@pytest.mark.parametrize("function", ["plan", "run", "compute_sweep", "replay"])
def test_dictionaries_that_hold_themselves(function):
    with pytest.raises(CsprError, match=r"given: nested too deep|mujoco") as raised:
        TAKING[function](DEEP)
    assert len(str(raised.value).splitlines()) == 1


@pytest.mark.parametrize(
    "value",
    [10**400, LOOP, 1.0 + 2.0j, np.array([1j]), "1.7\n", float("nan"), object(), {1, 2}],
    ids=["very large", "in itself", "complex", "complex array", "text", "nan", "no number", "set"],
)
def test_values_of_files_from_python(value):
    """The schema of the file refuses them, in one line."""
    keys = {"schema": 1, "robot": "prototype", "pose": [{"rest": True}, {"position": [0.4, 0.1, 1.5]}], "z0": value}
    with pytest.raises(CsprError) as raised:
        cspr_jax.plan(keys)
    assert len(str(raised.value).splitlines()) == 1


@pytest.mark.parametrize(
    "bad", [value for kind, value in BAD.items() if kind != "None"], ids=[kind for kind in BAD if kind != "None"]
)
@pytest.mark.parametrize("field", ["tension_min", "floor", "cable_speed_max", "uncertainty"])
def test_bad_limits(field, bad, good):
    limits = cspr_jax.Limits(**{field: bad})
    for function in ("minimum_arcs", "make_problem", "least_time"):
        given = {name: good[name] for name in ("robot", "targets", "start", "z0")}
        known = inspect.signature(TAKING[function]).parameters
        with pytest.raises(InputError, match=rf"^limits\.{field}") as raised:
            TAKING[function](**{name: value for name, value in given.items() if name in known}, limits=limits)
        assert len(str(raised.value).splitlines()) == 1


@pytest.mark.parametrize("field", ["release", "cable_length", "cable_speed", "encoder", "throws", "seed"])
@pytest.mark.parametrize(
    "bad", [value for kind, value in BAD.items() if kind != "shape"], ids=[kind for kind in BAD if kind != "shape"]
)
def test_bad_errors_of_launches(field, bad):
    with pytest.raises(InputError, match=f"^{field}") as raised:
        cspr_jax.LaunchErrors(**{field: bad})
    assert len(str(raised.value).splitlines()) == 1


def test_unknown_names_name_their_argument(good):
    for function, key in (("minimum_arcs", "amplitude"), ("hypocycloid", "amplitude"), ("workspace", "condition")):
        given = {name: good[name] for name in ("robot", "targets", "positions", "end", "start", "z0", "arcs")}
        known = inspect.signature(TAKING[function]).parameters
        with pytest.raises(InputError, match=f'^{key} = "nothing": must be'):
            TAKING[function](**{name: one for name, one in given.items() if name in known} | {key: "nothing"})


def test_numbers_of_all_kinds():
    """What counts as a real number, exactly as its value."""
    good = [1, 1.5, np.float32(1.5), np.int8(3), Fraction(3, 2), [1, 2.5], (1, 2), jnp.arange(3), 10**30, [Fraction(1)]]
    for value in [*good, jnp.ones(2, jnp.bfloat16), np.array([1, Fraction(1, 4)], object)]:
        np.testing.assert_array_equal(numbers("x", value, ""), np.asarray(value, float))
    for value in (
        True,
        [True, 1.0] * 0 + [True],
        np.bool_(True),
        "1",
        ["1"],
        1j,
        np.datetime64(1, "s"),
        None,
        [[1], 2],
    ):
        with pytest.raises(InputError, match=r"^x = .*: must be a number"):
            numbers("x", value, "a number")


def test_traced_arguments_pass(good):
    """Gradients and maps of jax go through the check of one motion."""
    robot = good["robot"]

    def margin(target, z0):
        motion = cspr_jax.hypocycloid(robot, None, jnp.stack([target[0], target[1], target[2]]), z0=z0, arcs=8)
        return motion.state(0.5).position[2]

    shapes = jax.eval_shape(jax.grad(margin, argnums=(0, 1)), jnp.array([0.4, 0.1, 1.5]), 1.7)
    assert [shape.shape for shape in shapes] == [(3,), ()]
    targets = jnp.ones((5, 3))
    assert jax.eval_shape(jax.vmap(lambda target: margin(target, 1.7)), targets).shape == (5,)


def test_tracers_are_refused_where_nothing_is_differentiated(good):
    """One line names the argument, or the key in it, and the function that jax differentiates instead."""
    robot, times = good["robot"], np.array([0.0, 1.0])
    points = jnp.array([[0.4, 0.1, 1.5], [0.3, 0.1, 1.4]])
    cases = {
        "targets: .*hypocycloid": lambda x: cspr_jax.minimum_arcs(robot, points * x, z0=1.7),
        "z0: .*transition": lambda x: cspr_jax.minimum_oscillations(robot, points, z0=x),
        "positions: .*spline": lambda x: cspr_jax.check(robot, times, points * x),
        r"given\['z0'\]: .*single motions": lambda x: cspr_jax.plan({"schema": 1, "z0": x}),
        "positions: .*tensions": lambda x: cspr_jax.workspace(robot, points * x, condition="static"),
        "times: .*other arguments": lambda x: cspr_jax.spline(robot, times * x, points),
        "inertia: .*other arguments": lambda x: cspr_jax.platform(
            robot.base_points, robot.base_points, mass=1.0, inertia=np.eye(3) * x
        ),
        "quaternions: .*other arguments": lambda x: cspr_jax.spline(robot, times, points, jnp.eye(4)[:2] * x),
    }
    for words, function in cases.items():
        with pytest.raises(InputError, match=f"^{words}"):
            jax.grad(function)(1.0)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_can_be_pickled(name):
    """Processes that are given one find it again under its name."""
    assert pickle.loads(pickle.dumps(FUNCTIONS[name])) is FUNCTIONS[name]
    assert FUNCTIONS[name].__doc__


def test_too_few_arguments_are_pythons_own_error():
    with pytest.raises(TypeError, match=r"minimum_arcs\(\) missing"):
        cspr_jax.minimum_arcs()


def test_names_that_nearly_fit_are_asked_about(good, tmp_path):
    """Words, keys of mappings, keywords and public names."""
    robot, times, points = good["robot"], [0.0, 1.0], [[0.4, 0.1, 1.5], [0.3, 0.1, 1.4]]
    cases = {
        r"limits\['max_tension'\]: unknown key: did you mean tension_max\? must be a key": lambda: cspr_jax.check(
            robot, times, points, limits={"max_tension": 3.0}
        ),
        r"did you mean cubic\? must be .*, or None": lambda: cspr_jax.check(robot, times, points, interpolation="cubc"),
        r"did you mean fastest\? must be a number": lambda: cspr_jax.ellipse(
            robot, points[0], [0.1, 0, 0], [0, 0.1, 0], frequency="fastst"
        ),
        r"did you mean centred\? must be one of": lambda: cspr_jax.tensions(
            robot, cspr_jax.spline(robot, times, points).state(0.5), rule="centered"
        ),
        r"did you mean wrench-feasible\? must": lambda: cspr_jax.workspace(robot, points, condition="wrench-feasble"),
        r"did you mean quintic\? must be one of .*; those": lambda: cspr_jax.make_problem(robot, amplitude="quintc"),
        r"did you mean quintic\? must be one of A1": lambda: cspr_jax.amplitude("quintc"),
        r'did you mean up\? must be "down" or "up"': lambda: cspr_jax.point_mass(np.eye(3), mass=1.0, z_axis="Up"),
        r"did you mean 3\.2\? must be one of 1\.1": lambda: cspr_jax.table("3.22"),
        r"did you mean sweep\? must be one of robot": lambda: cspr_jax.new_file("sweeep", tmp_path / "a.toml"),
        r"did you mean minimum-arcs\? must": lambda: cspr_jax.new_file("sweep", tmp_path / "a.toml", map="minimum_arc"),
    }
    for words, call in cases.items():
        with pytest.raises(CsprError, match=words):
            call()
    with pytest.raises(TypeError, match=r"check\(\) takes no limit: did you mean limits\?"):
        cspr_jax.check(robot, times, points, limit={})
    with pytest.raises(AttributeError) as caught:
        cspr_jax.minimum_arc  # noqa: B018
    assert caught.value.obj is cspr_jax and caught.value.name == "minimum_arc"  # by which Python asks


MAKING = {name: one for name, one in PUBLIC.items() if dataclasses.is_dataclass(one)}


@pytest.mark.parametrize(
    ("keyword", "meant", "kind"),
    [
        ("max_tension", "tension_max", "Limits"),
        ("maximum_cable_speed", "cable_speed_max", "Limits"),
        ("mass_center", "mass_centre", "Uncertainty"),
        ("cable_lenght", "cable_length", "LaunchErrors"),
    ],
)
def test_keywords_of_classes_that_nearly_fit_are_asked_about(keyword, meant, kind):
    with pytest.raises(TypeError, match=rf"^{kind}\(\) takes no {keyword}: did you mean {meant}\?$"):
        PUBLIC[kind](**{keyword: 1.0})


def test_every_keyword_that_nearly_fits_is_asked_about():
    """Of all public functions, methods and classes, with a letter twice; signatures stay those of the plain ones."""
    assert {"Limits", "LaunchErrors", "Uncertainty"} <= set(MAKING)
    for one in (TAKING | MAKING).values():
        for parameter in inspect.signature(one).parameters.values():
            if parameter.name == "self" or len(parameter.name) < 4:
                continue
            # A method of several classes has the name of the class in which it stands.
            with pytest.raises(TypeError, match=rf"^{one.__qualname__}\(\) takes no .*: did you mean \w+\?$"):
                one(**{parameter.name + parameter.name[-1]: None})
    for one in MAKING.values():
        fields = [field.name for field in dataclasses.fields(one) if field.init]
        assert list(inspect.signature(one).parameters) == fields
    with pytest.raises(TypeError, match=r"Limits.__init__\(\) got an unexpected keyword argument 'xyz'"):
        cspr_jax.Limits(xyz=1.0)


def test_inherited_methods_have_the_name_of_the_object():
    with pytest.raises(TypeError, match=r"^Replay\.plot\(\) takes no sizee: did you mean size\?$"):
        cspr_jax.Replay.plot(object.__new__(cspr_jax.Replay), sizee=(16, 10))


def test_public_names_are_listed():
    assert set(cspr_jax.__all__) <= set(dir(cspr_jax))


def answers(kind, robot):
    """Answers of a search, with what their motions begin at."""
    targets, options = [[0.4, 0.1, 1.5], [-0.3, 0.5, 2.0]], {"z0": 1.7, "max_arcs": 8}
    if kind == "oscillations":
        return cspr_jax.minimum_oscillations(robot, targets, **options)
    if kind == "arcs":
        return cspr_jax.minimum_arcs(robot, targets, start=[0.2, 0.1, 1.6], **options)
    platform = cspr_jax.load_robot("laval-mssm")
    return cspr_jax.minimum_pose_arcs(platform, [[0.3, 0.2, 1.4]], z0=1.4, beta_hat="preferred", max_arcs=4)


@pytest.mark.parametrize(
    "kind", ["arcs", *(pytest.param(kind, marks=pytest.mark.thorough) for kind in ("oscillations", "poses"))]
)
def test_answers_can_be_pickled_and_copied(kind, good):
    first = answers(kind, good["robot"])
    motions = jax.tree.leaves(first.motions())
    for again in (pickle.loads(pickle.dumps(first)), copy.deepcopy(first), copy.copy(first)):
        np.testing.assert_array_equal(again.arcs, first.arcs)
        for one, other in zip(jax.tree.leaves(again.motions()), motions, strict=True):
            np.testing.assert_array_equal(one, other)
