"""Margins from cocircuits: how far tensions can keep from their limits, and how far every wrench can be resisted.

A component that rounding may have made of a zero decides nothing: where it would, the pose is open, and
`feasibility.workspace.exact` answers it by singular values.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.lanes import largest, smallest
from cspr_jax.feasibility.workspace.cocircuits import Cocircuit

# Of the largest component of a cocircuit, in units of rounding: what is smaller may be zero.
NOISE = 1e3
# Of the longest cocircuit of a pose, in units of rounding: what is shorter has lost its direction.
SHORT = 1e5


class Tensions(NamedTuple):
    """Limits of the tensions.

    Fields:
        low: n_cables arrays (), N.
        high: n_cables arrays (), N; of a cable without a largest tension any number.
        unbounded: by cable, whether it has no largest tension; known when a function is compiled.
    """

    low: Sequence[Array]
    high: Sequence[Array]
    unbounded: Sequence[bool]


class Margin(NamedTuple):
    """Margin of a pose.

    Fields:
        value: (...) inf where nothing bounds it.
        is_open: (...) whether rounding may have decided.
    """

    value: Array
    is_open: Array


def tension_margin(cocircuits: Iterable[Cocircuit], limits: Tensions, unit: float) -> Margin:
    """Largest s such that tensions between low + s and high - s give each of some wrenches.

    Args:
        cocircuits: of the wrench matrix, with their products with the wrenches.
        limits: of the tensions; a margin counts against those that are finite.
        unit: length that a cocircuit of columns far from parallel has; 0: none is known.

    Returns:
        the margin, N.
    """
    # Twice: what may be a zero is one, and then it is not.
    least, other, sizes = [], [], []
    for row in cocircuits:
        size, most = _sizes(row.entries)
        tiny = NOISE * jnp.finfo(size.dtype).eps * most
        sizes.append(size)
        for sign in (1.0, -1.0):
            slack = _slack(row, sign, limits) / jnp.where(size > 0.0, size, 1.0)
            free = [sign * row.entries[k] for k in row.entries if limits.unbounded[k]]
            least.append(_without(slack, [*(entry > tiny for entry in free), size == 0.0]))
            other.append(_without(slack, [*(entry > 0.0 for entry in free), size == 0.0]))
    value, as_given = smallest(least), smallest(other)
    is_open = (value != as_given) | _has_short(sizes, unit) | jnp.isnan(value)
    return Margin(smallest([value, *_half_ranges(limits, value)]), is_open)


def _sizes(entries: Mapping[int, Array]) -> tuple[Array, Array]:
    parts = [jnp.abs(entry) for entry in entries.values()]
    return sum(parts[1:], parts[0]), largest(parts)


def _slack(row: Cocircuit, sign: float, limits: Tensions) -> Array:
    # The largest product that tensions within their limits give, above the largest that a wrench asks for.
    parts = []
    for k, entry in row.entries.items():
        low, y = limits.low[k], sign * entry
        parts.append(y * low if limits.unbounded[k] else jnp.maximum(y * low, y * limits.high[k]))
    return sum(parts[1:], parts[0]) - largest([sign * product for product in row.products])


def _without(value: Array, free: Sequence[Array]) -> Array:
    # What a cable without a largest tension frees bounds nothing.
    is_free = free[0]
    for one in free[1:]:
        is_free = is_free | one
    return jnp.where(is_free, jnp.inf, value)


def _half_ranges(limits: Tensions, like: Array) -> list[Array]:
    # No margin is larger than half of what a cable has.
    every = zip(limits.low, limits.high, limits.unbounded, strict=True)
    return [jnp.broadcast_to(0.5 * (high - low), like.shape) for low, high, unbounded in every if not unbounded]


def _has_short(sizes: Sequence[Array], unit: float) -> Array:
    longest = jnp.maximum(largest(sizes), unit)
    return ~(smallest(sizes) > SHORT * jnp.finfo(longest.dtype).eps * longest)


def closure_margin(cocircuits: Iterable[Cocircuit], unit: float) -> Margin:
    """Margin of wrench closure: whether cables that are pulled hard enough resist every wrench.

    Args:
        cocircuits: of the wrench matrix.
        unit: as for `tension_margin`.

    Returns:
        the margin, a pure number in [-1, 1]: of every cocircuit the largest component of the rarer sign, over the
        largest of all; positive where there is closure.
    """
    rarer, sizes = [], []
    for row in cocircuits:
        size, most = _sizes(row.entries)
        entries = list(row.entries.values())
        fewest = jnp.minimum(largest(entries), -smallest(entries))
        rarer.append(fewest / jnp.where(most > 0.0, most, 1.0))
        sizes.append(size)
    least = smallest(rarer)
    near_zero = jnp.abs(least) < NOISE * jnp.finfo(least.dtype).eps
    return Margin(least, near_zero | _has_short(sizes, unit) | jnp.isnan(least))
