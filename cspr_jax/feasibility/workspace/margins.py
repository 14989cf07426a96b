"""Margins from cocircuits: how far tensions can keep from their limits, and how far every wrench can be resisted.

A component that rounding may have made of a zero decides nothing: where it would, the pose is open, and
`feasibility.workspace.exact` answers it by singular values.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

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


def tension_margin(cocircuits: Iterable[Cocircuit], limits: Tensions) -> Margin:
    """Largest s such that tensions between low + s and high - s give each of some wrenches.

    Args:
        cocircuits: of the wrench matrix, with their products with the wrenches.
        limits: of the tensions; a margin counts against those that are finite.

    Returns:
        the margin, N.
    """
    # Twice: what may be a zero is one, and then it is not.
    least, other, sizes = None, None, []
    for row in cocircuits:
        size, largest = _sizes(row.entries)
        tiny = NOISE * jnp.finfo(size.dtype).eps * largest
        sizes.append(size)
        for sign in (1.0, -1.0):
            slack = _slack(row, sign, limits) / jnp.where(size > 0.0, size, 1.0)
            no_wall = [sign * row.entries[k] > tiny for k in row.entries if limits.unbounded[k]]
            perhaps = [sign * row.entries[k] > 0.0 for k in row.entries if limits.unbounded[k]]
            least = _lower(least, slack, [*no_wall, size == 0.0])
            other = _lower(other, slack, [*perhaps, size == 0.0])
    value = jnp.minimum(least, _half_range(limits, least))
    is_open = (least != other) | _has_short(sizes) | ~(value == value)
    return Margin(value, is_open)


def _sizes(entries: Mapping[int, Array]) -> tuple[Array, Array]:
    size = largest = None
    for entry in entries.values():
        one = jnp.abs(entry)
        size = one if size is None else size + one
        largest = one if largest is None else jnp.maximum(largest, one)
    return size, largest


def _slack(row: Cocircuit, sign: float, limits: Tensions) -> Array:
    # The largest product that tensions within their limits give, above the largest that a wrench asks for.
    total = None
    for k, entry in row.entries.items():
        y = sign * entry
        most = y * limits.low[k] if limits.unbounded[k] else jnp.maximum(y * limits.low[k], y * limits.high[k])
        total = most if total is None else total + most
    worst = sign * row.products[0]
    for product in row.products[1:]:
        worst = jnp.maximum(worst, sign * product)
    return total - worst


def _lower(least: Array | None, value: Array, without: Sequence[Array]) -> Array:
    is_free = without[0]
    for one in without[1:]:
        is_free = is_free | one
    value = jnp.where(is_free, jnp.inf, value)
    return value if least is None else jnp.minimum(least, value)


def _half_range(limits: Tensions, like: Array) -> Array:
    # No margin is larger than half of what a cable has.
    halves = [
        0.5 * (high - low)
        for low, high, unbounded in zip(limits.low, limits.high, limits.unbounded, strict=True)
        if not unbounded
    ]
    least = jnp.full_like(like, jnp.inf)
    for half in halves:
        least = jnp.minimum(least, half)
    return least


def _has_short(sizes: Sequence[Array]) -> Array:
    longest, shortest = sizes[0], sizes[0]
    for size in sizes[1:]:
        longest, shortest = jnp.maximum(longest, size), jnp.minimum(shortest, size)
    return ~(shortest > SHORT * jnp.finfo(longest.dtype).eps * longest)


def closure_margin(cocircuits: Iterable[Cocircuit]) -> Margin:
    """Margin of wrench closure: whether cables that are pulled hard enough resist every wrench.

    Args:
        cocircuits: of the wrench matrix.

    Returns:
        the margin, a pure number in [-1, 1]: of every cocircuit the largest component of the rarer sign, over the
        largest of all; positive where there is closure.
    """
    least, sizes = None, []
    for row in cocircuits:
        size, largest = _sizes(row.entries)
        most = fewest = None
        for entry in row.entries.values():
            most = entry if most is None else jnp.maximum(most, entry)
            fewest = entry if fewest is None else jnp.minimum(fewest, entry)
        rarer = jnp.minimum(most, -fewest) / jnp.where(largest > 0.0, largest, 1.0)
        sizes.append(size)
        least = rarer if least is None else jnp.minimum(least, rarer)
    near_zero = jnp.abs(least) < NOISE * jnp.finfo(least.dtype).eps
    return Margin(least, near_zero | _has_short(sizes) | ~(least == least))
