"""Rules of arguments: functions that refuse what an argument may not be."""

import dataclasses
import os
import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import one_of
from cspr_jax.schema.given_numbers import Numbers, whole

# A rule refuses what an argument, named in errors, may not be.
Rule = Callable[[str, Any], None]
# Functions whose arguments jax may trace, and for the others, which of these to differentiate instead.
DIFFERENTIABLE = (
    *("hypocycloid", "transition", "platform_motion", "straight_line", "bezier", "ellipse", "spline", "make_problem"),
    *("point_mass_robot", "point_mass", "platform", "parallel_pair_robot", "with_cables", "three_cable_equivalent"),
    *("slacks", "sampled_margin", "tensions"),
)
INSTEAD = {
    name: f"jax differentiates {motion} with sampled_margin, for single motions"
    for motion, names in {
        "bezier": ("bezier_durations", "bezier_verdicts", "launch_range"),
        "ellipse": ("ellipse_frequencies", "ellipse_margins", "swing_range"),
        "hypocycloid": ("minimum_arcs",),
        "platform_motion": ("minimum_pose_arcs", "attainable", "accessible"),
        "spline": ("check", "check_many", "least_time_paths", "retime"),
        "straight_line": ("least_time",),
        "transition": ("minimum_oscillations",),
    }.items()
    for name in names
} | dict.fromkeys(
    ("available_accelerations", "sensitivity", "workspace"), "jax differentiates tensions of a state of motion"
)
LARGEST_TIME = 1e12  # s
NESTED = 4  # what is in a list or a dictionary is searched so deep for what jax traces


def real(
    allowed: str, *shapes: tuple[int | None, ...], traced: bool = False, none: bool = False, **bounds: Any
) -> Rule:
    """Rule of real numbers of one of some shapes, or of any."""
    kind = Numbers(allowed, shapes or None, **bounds)

    def check(key: str, value: Any) -> None:
        if not ((none and value is None) or (traced and _traced_place(value) is not None)):
            kind.array(key, value)

    return check


def instants(allowed: str, *shapes: tuple[int | None, ...]) -> Rule:
    """Rule of times, whose powers must not overflow."""
    words = f"instants {allowed}, at most {LARGEST_TIME:.0e} s"
    return real(words, *shapes, least=-LARGEST_TIME, largest=LARGEST_TIME)


def integer(least: int, largest: int, *, none: bool = False) -> Rule:
    """Rule of whole numbers."""

    def check(key: str, value: Any) -> None:
        if not (none and value is None):
            whole(key, value, least, largest)

    return check


def kind_of(allowed: str, *kinds: type, none: bool = False, has: tuple[str, ...] = ()) -> Rule:
    """Rule of some types, or of a further one that need not be imported for this."""

    def check(key: str, value: Any) -> None:
        is_kind = isinstance(value, kinds) or (bool(has) and all(hasattr(value, name) for name in has))
        if not (is_kind or (none and value is None)):
            raise InputError(key, value, allowed)
        if isinstance(value, str | os.PathLike) and "\0" in str(value):
            raise InputError(key, value, f"{allowed}, without a NUL character")

    return check


def choice(rule: Rule, *others: Any) -> Rule:
    """Rule that lets some strings, or None, pass besides."""

    def check(key: str, value: Any) -> None:
        if (value is None or isinstance(value, str)) and value in others:
            return
        try:
            rule(key, value)
        except InputError as error:
            if not isinstance(value, str) or error.fault:
                raise
            raise InputError(key, value, one_of(value, filter(None, others), error.allowed)) from None

    return check


def many(rule: Rule, allowed: str) -> Rule:
    """Rule of collections."""

    def check(key: str, value: Any) -> None:
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Collection):
            raise InputError(key, value, allowed)
        for i, one in enumerate(value):
            rule(f"{key}[{i}]", one)

    return check


def _traced_place(value: Any, depth: int = NESTED) -> str | None:
    # Return where a value holds what jax traces, as Python writes it; None: nowhere.
    jax = sys.modules.get("jax")
    if jax is None or isinstance(value, jax.core.Tracer):
        return None if jax is None else ""
    parts: Iterable[tuple[str, Any]] = ()
    if isinstance(value, Mapping):
        parts = ((f"[{key!r}]", part) for key, part in value.items())
    elif isinstance(value, list | tuple):
        parts = ((f"[{i}]", part) for i, part in enumerate(value))
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = ((f".{field.name}", getattr(value, field.name)) for field in dataclasses.fields(value))
    inner = ((name, _traced_place(part, depth - 1)) for name, part in parts) if depth else ()
    return next((name + place for name, place in inner if place is not None), None)


def refuse_tracers(key: str, value: Any, instead: str) -> None:
    """Refuse what jax traces, anywhere in an argument of a function that computes with NumPy."""
    place = _traced_place(value)
    if place is not None:
        error = "a tracer of jax, as grad, jit and vmap pass"
        raise InputError(key + place, None, f"must be numbers: {instead}", fault=error)


def word(*words: str) -> Rule:
    """Rule of one of some words, or None."""
    allowed = " or ".join(f'"{each}"' for each in words) + ", or None"

    def check(key: str, value: Any) -> None:
        if value is not None and not (isinstance(value, str) and value in words):
            raise InputError(key, value, one_of(value, words, allowed))

    return check
