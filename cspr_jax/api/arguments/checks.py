"""Checks of the arguments of public functions, by the types in their signatures, before anything runs.

`errors.arguments` has the rules of numbers, words and paths, this module those of objects of the package. Conditions on
several arguments, a robot or a file are checked by the function itself.
"""

import functools
import inspect
import os
import types
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import ANY, NUMBER, PATH, TEXT, Choice, Integer, Kind, Rule, or_none
from cspr_jax.errors.arguments import times as rule_of_times
from cspr_jax.errors.given_numbers import Numbers, refuse_tracers
from cspr_jax.errors.suggestions import ask_about_keywords
from cspr_jax.schema.limits import LARGEST_GRID, LARGEST_MAX_ARCS, LIMITS, UNCERTAINTIES

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import xarray

    from cspr_jax.motion.amplitudes import Amplitude
    from cspr_jax.robots.cables import AnyRobot
    from cspr_jax.robots.model.limits import Limits
    from cspr_jax.store.reading.result import Result

Function = TypeVar("Function", bound=Callable[..., Any])


def checked(
    *,
    traced: bool = False,
    motion: str = "",
    instead: str = "single motions with slacks, sampled_margin and tensions",
    name: str = "",
    module: str = "",
) -> Callable[[Function], Function]:
    """Make a function check its arguments first.

    Args:
        traced: whether jax may trace the arguments of the function.
        motion: function of a single motion that jax can differentiate, which errors recommend; "" without one.
        instead: what errors recommend without such a function.
        name: public name, if the function has another one.
        module: public module, if the function is in another one.

    Returns:
        a decorator.
    """
    instead = f"{motion} with sampled_margin, for single motions" if motion else instead

    def decorator(function: Function) -> Function:
        signature, own_name = inspect.signature(function), name or function.__qualname__
        rules = functools.cache(lambda: rules_of(function))

        @functools.wraps(function)
        def with_checks(*arguments: Any, **keywords: Any) -> Any:
            try:
                bound = signature.bind(*arguments, **keywords).arguments
            except TypeError:
                ask_about_keywords(_name_for(own_name, arguments), keywords, signature.parameters)
                return function(*arguments, **keywords)  # raises the usual TypeError, with the function's own name
            for key, rule in rules().items():
                if key not in bound:
                    continue
                if not traced:
                    refuse_tracers(key, bound[key], f"jax differentiates {instead}")
                try:
                    rule(key, bound[key])
                except InputError:
                    refuse_tracers(key, bound[key], "jax may trace other arguments of this function alone")
                    raise
            return function(*arguments, **keywords)

        if name:
            with_checks.__name__, with_checks.__qualname__, with_checks.__module__ = name, name, module
        return with_checks  # type: ignore[return-value]

    return decorator


def _name_for(name: str, arguments: tuple[Any, ...]) -> str:
    # Users know an inherited method by the class of their object.
    return f"{type(arguments[0]).__name__}.{name.rpartition('.')[2]}" if "." in name and arguments else name


def rules_of(function: Callable[..., Any]) -> dict[str, Rule]:
    """Rules of the arguments of a function."""
    # Evaluate only the types of arguments: types of results may exist for type checkers alone.
    hints = {key: kind for key, kind in inspect.get_annotations(function).items() if key != "return"}
    scope = inspect.unwrap(function).__globals__
    return {key: rule_of(eval(kind, scope) if isinstance(kind, str) else kind) for key, kind in hints.items()}


def rule_of(kind: Any) -> Rule:
    """Rule of a type: that in `Annotated`, else of the last member of a union, else by the name of the type."""
    if get_origin(kind) in (Union, types.UnionType):
        parts = [part for part in get_args(kind) if part is not type(None)]
        return or_none(rule_of(parts[-1])) if len(parts) < len(get_args(kind)) else rule_of(parts[-1])
    if get_origin(kind) is Annotated:
        return kind.__metadata__[0]
    if get_origin(kind) is Literal:
        return Choice(Kind(" or ".join(f'"{word}"' for word in get_args(kind))), get_args(kind))
    return rule_of(kind.__bound__) if isinstance(kind, TypeVar) else OF_TYPES[(get_origin(kind) or kind).__name__]


def _record(kind: Kind, names: Iterable[str]) -> Rule:
    # Return a rule for objects whose attributes of these names are real numbers.
    field = Choice(Numbers("real numbers", None, infinite=True, traced=True), (None,))

    def check(key: str, value: Any) -> None:
        kind(key, value)
        for name in names:
            field(f"{key}.{name}", getattr(value, name))

    return check


def _limits(key: str, value: Any) -> None:
    _record(Kind("Limits(...), or None", has=_LIMITS), _LIMITS)(key, value)
    if value.uncertainty is not None:
        kind = Kind("Uncertainty(...), or None", has=_UNCERTAINTIES)
        _record(kind, _UNCERTAINTIES)(f"{key}.uncertainty", value.uncertainty)


def _limits_or_spec(key: str, value: Any) -> None:
    if value is not None and not isinstance(value, Mapping):
        _limits(key, value)


def _result(key: str, value: Any) -> None:
    if not hasattr(value, "data_vars"):  # not a Dataset of xarray
        _RESULT(key, value)


def _results(key: str, value: Any) -> None:
    if isinstance(value, list | tuple):
        for i, one in enumerate(value):
            _RESULT(f"{key}[{i}]", one)
    else:
        _RESULT(key, value)


def _source(key: str, value: Any) -> None:
    # Accept times, or something with a motion in itself: a file, a spline, a function.
    if not (isinstance(value, str | os.PathLike) or callable(value) or hasattr(value, "state")):
        rule_of_times("(n,) in s, a path, a spline of SciPy, or a motion", (ANY,))(key, value)


_LIMITS, _UNCERTAINTIES = tuple(row.name for row in LIMITS), tuple(row.name for row in UNCERTAINTIES)
_PATHS = (str, os.PathLike)
_RESULT = Kind("a result, or the path of one", _PATHS, ("data", "axes"))
_ROBOT = Kind(
    "a point mass or a platform, as load_robot, point_mass or platform gives it",
    has=("base_points", "n_cables", "limits", "pattern"),
)
_IN_ROBOTS = ("base_points", "limits")
AMPLITUDE = Kind("the name of an amplitude function, or one of amplitude(...)", (str,), ("coefficients", "knots"))

# Rules by names of types, so that none of the types is imported for this.
OF_TYPES: dict[str, Rule] = {
    "Amplitude": AMPLITUDE,
    "Callable": Kind("a function", has=("__call__",)),
    "LaunchErrors": Kind("LaunchErrors(...)", has=("throws", "encoder", "seed")),
    "Limits": _limits,
    "Motion": Kind("a motion, as hypocycloid, a plan or answers give it", has=("state", "duration")),
    "Path": PATH,
    "PlatformRobot": _ROBOT,
    "PointMassRobot": _ROBOT,
    "Problem": Kind("a problem, as make_problem gives it", has=("robot", "limits", "amplitude")),
    "State": _record(
        Kind("a state, as a motion gives it", has=("position", "velocity", "acceleration")),
        ("position", "velocity", "acceleration"),
    ),
    "bool": Kind("True or False", (bool, np.bool_)),
    "float": NUMBER,
    "str": TEXT,
}

RobotOrFile = Annotated["AnyRobot | str | Path", Kind("a robot, the name of one, or its file", _PATHS, _IN_ROBOTS)]
RobotOrFileOrNone = Annotated[
    "AnyRobot | str | Path | None", or_none(Kind("a robot, the name of one, its file, or None", _PATHS, _IN_ROBOTS))
]
LimitsOrSpec = Annotated["Limits | Mapping[str, Any] | None", _limits_or_spec]
AmplitudeOrNone = Annotated["str | Amplitude | None", Choice(AMPLITUDE, (None,))]
MotionSource = Annotated[Any, _source]
ResultOrPath = Annotated["Result | xarray.Dataset | str | Path", _result]
ResultOrResults = Annotated["str | Path | Result | Sequence[str | Path | Result]", _results]
GridSize = Annotated[int, Integer(2, LARGEST_GRID)]
MaxArcs = Annotated[int, Integer(1, LARGEST_MAX_ARCS)]
