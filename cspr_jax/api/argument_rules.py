"""Rules of arguments: functions that refuse what an argument may not be."""

import os
import sys
from collections.abc import Callable, Collection, Mapping
from typing import Any

from cspr_jax.errors import InputError
from cspr_jax.schema.given_numbers import Numbers, whole

# A rule refuses what an argument, named in errors, may not be.
Rule = Callable[[str, Any], None]
NESTED = 4  # lists in a list are searched so deep for what jax traces


def real(
    allowed: str, *shapes: tuple[int | None, ...], traced: bool = False, none: bool = False, **bounds: Any
) -> Rule:
    """Rule of real numbers of one of some shapes, or of any.

    Args:
        allowed: in words.
        shapes: any where there are none; `ANY` stands for any size.
        traced: whether what jax traces passes.
        none: whether None does.
        bounds: those of `Numbers`.

    Returns:
        the rule.
    """
    kind = Numbers(allowed, shapes or None, **bounds)

    def check(key: str, value: Any) -> None:
        if not ((none and value is None) or (traced and _is_traced(value, NESTED))):
            kind.array(key, value)

    return check


def integer(least: int, largest: int, *, none: bool = False) -> Rule:
    """Rule of whole numbers.

    Returns:
        the rule.
    """

    def check(key: str, value: Any) -> None:
        if not (none and value is None):
            whole(key, value, least, largest)

    return check


def kind_of(allowed: str, *kinds: type, none: bool = False, has: tuple[str, ...] = ()) -> Rule:
    """Rule of some types, or of a further one that need not be imported for this.

    Args:
        allowed: in words.
        none: whether None passes.
        has: attributes of the further type.

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
    """Rule that lets some strings, or None, pass besides.

    Returns:
        the rule.
    """

    def check(key: str, value: Any) -> None:
        if not (value is None or isinstance(value, str)) or value not in others:
            rule(key, value)

    return check


def many(rule: Rule, allowed: str) -> Rule:
    """Rule of collections.

    Args:
        rule: of each element.
        allowed: in words.

    Returns:
        the rule.
    """

    def check(key: str, value: Any) -> None:
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Collection):
            raise InputError(key, value, allowed)
        for i, one in enumerate(value):
            rule(f"{key}[{i}]", one)

    return check


def _is_traced(value: Any, depth: int) -> bool:
    jax = sys.modules.get("jax")
    if jax is None or not depth:
        return False
    if isinstance(value, list | tuple):
        return any(_is_traced(part, depth - 1) for part in value)
    return isinstance(value, jax.core.Tracer)


def word(*words: str) -> Rule:
    """Rule of one of some words, or None.

    Returns:
        the rule.
    """
    allowed = " or ".join(f'"{each}"' for each in words) + ", or None"

    def check(key: str, value: Any) -> None:
        if value is not None and not (isinstance(value, str) and value in words):
            raise InputError(key, value, allowed)

    return check
