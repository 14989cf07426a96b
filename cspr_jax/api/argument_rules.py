"""Rules of arguments: what a kind of argument may be, as functions that refuse everything else."""

import os
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any

from cspr_jax.errors import InputError
from cspr_jax.schema.given_numbers import Numbers, whole
from cspr_jax.schema.limits import LIMITS, UNCERTAINTIES

Rule = Callable[[str, Any], None]

NESTED = 4  # lists in a list are searched so deep for what jax traces


def real(
    allowed: str, *shapes: tuple[int | None, ...], traced: bool = False, none: bool = False, **bounds: Any
) -> Rule:
    """Rule of an argument of real numbers.

    Args:
        *shapes: that it may have; none: all.
        traced: whether jax may trace it.
        none: whether None is taken.
        **bounds: of `Numbers`.

    Returns:
        the rule.
    """
    kind = Numbers(allowed, shapes or None, **bounds)

    def check(key: str, value: Any) -> None:
        if not ((none and value is None) or (traced and _is_traced(value, NESTED))):
            kind.array(key, value)

    return check


def integer(least: int, largest: int, *, none: bool = False) -> Rule:
    """Rule of an integer.

    Args:
        least: smallest.
        none: whether None is taken.

    Returns:
        the rule.
    """

    def check(key: str, value: Any) -> None:
        if not (none and value is None):
            whole(key, value, least, largest)

    return check


def kind_of(allowed: str, *kinds: type, none: bool = False, has: tuple[str, ...] = ()) -> Rule:
    """Rule of an argument that is one of some kinds.

    Args:
        *kinds: types.
        none: whether None is taken.
        has: names of attributes of a further kind, which need not be imported for this.

    Returns:
        the rule.
    """

    def check(key: str, value: Any) -> None:
        is_kind = isinstance(value, kinds) or (bool(has) and all(hasattr(value, name) for name in has))
        if not (is_kind or (none and value is None)):
            raise InputError(key, value, allowed)
        if isinstance(value, str | os.PathLike) and "\0" in str(value):
            raise InputError(key, value, f"{allowed}, without a NUL character")

    return check


def choice(rule: Rule, *others: Any) -> Rule:
    """Rule of an argument that may be one of some values, too.

    Args:
        *others: strings, or None.

    Returns:
        the rule.
    """

    def check(key: str, value: Any) -> None:
        if not (value is None or isinstance(value, str)) or value not in others:
            rule(key, value)

    return check


def _is_traced(value: Any, depth: int) -> bool:
    jax = sys.modules.get("jax")
    if jax is None or not depth:
        return False
    if isinstance(value, list | tuple):
        return any(_is_traced(part, depth - 1) for part in value)
    return isinstance(value, jax.core.Tracer)


def robot(key: str, value: Any) -> None:
    """Refuse what is no robot.

    Args:
        key: named in errors.

    Raises:
        InputError: it is none.
    """
    if not all(hasattr(value, name) for name in ("base_points", "n_cables", "limits", "pattern")):
        raise InputError(key, value, "a point mass or a platform, as load_robot, point_mass or platform gives it")


def limits(key: str, value: Any) -> None:
    """Refuse what are no limits, and fields of them that are no real numbers.

    Args:
        key: named in errors.

    Raises:
        InputError: it is none.
    """
    if value is None:
        return
    if not all(hasattr(value, row.name) for row in LIMITS):
        raise InputError(key, value, "Limits(...), or None")
    _fields(key, value, [row.name for row in LIMITS])
    if value.uncertainty is not None:
        names = [row.name for row in UNCERTAINTIES]
        if not all(hasattr(value.uncertainty, name) for name in names):
            raise InputError(f"{key}.uncertainty", value.uncertainty, "Uncertainty(...), or None")
        _fields(f"{key}.uncertainty", value.uncertainty, names)


def _fields(key: str, value: Any, names: Iterable[str]) -> None:
    for name in names:
        real("real numbers", traced=True, none=True, infinite=True)(f"{key}.{name}", getattr(value, name))


def state(key: str, value: Any) -> None:
    """Refuse what is no state of an effector.

    Args:
        key: named in errors.

    Raises:
        InputError: it is none.
    """
    if not all(hasattr(value, name) for name in ("position", "velocity", "acceleration")):
        raise InputError(key, value, "a state, as a motion gives it")
    _fields(key, value, ("position", "velocity", "acceleration"))


def pose(key: str, value: Any) -> None:
    """Refuse what is no position with a quaternion.

    Args:
        key: named in errors.

    Raises:
        InputError: it is none.
    """
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise InputError(key, value, "a position (3,) in m, and a unit quaternion (4,), scalar first")
    real("a position: three finite numbers, m", (3,))(key, value[0])
    real("a unit quaternion: four numbers, scalar first", (4,))(key, value[1])


def coordinates(key: str, value: Any) -> None:
    """Refuse what are no numbers by the names of axes.

    Args:
        key: named in errors.

    Raises:
        InputError: it is none.
    """
    if value is None:
        return
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise InputError(key, value, "a number by the name of each axis")
    for name, number in value.items():
        real("a finite number", ())(f"{key}[{name!r}]", number)


def many(rule: Rule, allowed: str) -> Rule:
    """Rule of a sequence.

    Returns:
        the rule.
    """

    def check(key: str, value: Any) -> None:
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Collection):
            raise InputError(key, value, allowed)
        for i, one in enumerate(value):
            rule(f"{key}[{i}]", one)

    return check


one_result = kind_of("a result, or the path of one", str, os.PathLike, has=("data", "axes"))


def results(key: str, value: Any) -> None:
    """Refuse what is neither a result, or its path, nor a sequence of these.

    Args:
        key: named in errors.

    Raises:
        InputError: it is none.
    """
    if isinstance(value, list | tuple):
        for i, one in enumerate(value):
            one_result(f"{key}[{i}]", one)
    else:
        one_result(key, value)


def result(key: str, value: Any) -> None:
    """Refuse what is neither a result, of xarray or ours, nor its path.

    Args:
        key: named in errors.

    Raises:
        InputError: it is none.
    """
    if not hasattr(value, "data_vars"):  # of xarray
        one_result(key, value)


def size(key: str, value: Any) -> None:
    """Refuse what is no size of a picture.

    Args:
        key: named in errors.

    Raises:
        InputError: it is none.
    """
    if value is not None and not isinstance(value, str):
        real('a width and a height in cm, as (16, 10) or "16x10"', (2,))(key, value)


def names(key: str, value: Any) -> None:
    """Refuse what is neither a name nor several.

    Args:
        key: named in errors.

    Raises:
        InputError: it is none.
    """
    # An iterator can be read only once: the function that reads it looks at its names.
    if not isinstance(value, str | Iterator):
        many(kind_of("a string", str), "a name, or several")(key, value)
