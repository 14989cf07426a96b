"""Bounds of margins of poses, which allow for rounding, one facet normal after the other.

Where both bounds differ too much, `workspaces.poses.exact` computes the margin by singular values.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.linear.lanes import largest
from cspr_jax.numerics.shapes import Float
from cspr_jax.workspaces.poses.facet_normals import Column, product

# Errors, in units of rounding, of a product of unit columns, and of the numbers of a block of six cables. They are
# estimates, not proofs; in all tests margins by singular values lie between the bounds.
EPSILONS = 64.0
BLOCK_EPSILONS = 8.0


class Wrenches(NamedTuple):
    """Wrenches that cables must supply: all sums of a wrench of a finite set, one of a box and one of each ellipsoid.

    Fields:
        points: the finite set, dof components each, for all poses () or one for each, moments over a length, N.
        box: (dof,) half widths of a box about zero, N; None: there is none.
        ellipsoids: (dof,) semi-axes of each ellipsoid about zero, N.
    """

    points: Sequence[Column]
    box: Array | None = None
    ellipsoids: Sequence[Array] = ()


class FacetLimits(NamedTuple):
    """A facet normal, given by its products with the cables, and the limits of these cables.

    Fields:
        entries: components that can be nonzero, up to a common factor.
        low: smallest tensions of these cables, () each, N.
        high: largest tensions, () each, N; inf where there is none.
        divisor: divisor of the margin: the sum of the absolute components for tensions, the length of the normal for
            the capacity margin.
        noises: errors of the components.
        error: error of the difference between tensions and wrenches along the facet normal, N times the divisor.
    """

    entries: Sequence[Array]
    low: Sequence[Array]
    high: Sequence[Array]
    divisor: Array
    noises: Sequence[Array]
    error: Array


Bounds = tuple[Array, Array]


def one_norm(entries: Sequence[Array]) -> Float[Array, "..."]:
    """Sum of the absolute values of components."""
    parts = [jnp.abs(entry) for entry in entries]
    return sum(parts[1:], parts[0])


def length(vector: Sequence[Array]) -> Float[Array, "..."]:
    """Length of a vector."""
    return jnp.sqrt(product(vector, vector))


def supports(normal: Column, wrenches: Wrenches) -> tuple[Array, Array]:
    """Largest products of a normal, and of its negative, with the wrenches of a set."""
    products = [product(normal, point) for point in wrenches.points]
    maximum, minimum = largest(products), largest([-value for value in products])
    spreads = list[Array]()
    if wrenches.box is not None:
        spreads.append(product([jnp.abs(x) for x in normal], list(wrenches.box)))
    spreads += [length([x * axis for x, axis in zip(normal, axes, strict=True)]) for axes in wrenches.ellipsoids]
    for spread in spreads:
        maximum, minimum = maximum + spread, minimum + spread
    return maximum, minimum


def bounded_margin(facet: FacetLimits, support: Array, opposite: Array) -> Bounds:
    """Bounds of the margin of one facet normal whose cables all have a largest tension."""
    limits = list(zip(facet.entries, facet.low, facet.high, strict=True))
    ranges = [(0.5 * (high - low)) * jnp.abs(y) for y, low, high in limits]
    middles = [(0.5 * (high + low)) * y for y, low, high in limits]
    middle = sum(middles[1:], middles[0])
    slack = sum(ranges[1:], ranges[0]) - jnp.maximum(support - middle, opposite + middle)
    return _between(facet, slack, slack)


def _between(facet: FacetLimits, sure: Array, possible: Array) -> Bounds:
    # The divisor has an error as well.
    inverse = 1.0 / facet.divisor
    lower, upper, loss = sure * inverse, possible * inverse, sum(facet.noises[1:], facet.noises[0])
    less, more = (jnp.where(jnp.isinf(x), 0.0, loss * jnp.abs(x)) for x in (lower, upper))
    return lower - (facet.error + less) * inverse, upper + (facet.error + more) * inverse


def free_margin(facet: FacetLimits, support: Array, opposite: Array) -> Bounds:
    """Bounds of the margin of one facet normal; any of its cables may have no largest tension.

    A component that may be zero except for rounding makes the upper bound infinite, but not the lower one.
    """
    lower, upper = list[Array](), list[Array]()
    for sign, demand in ((1.0, support), (-1.0, opposite)):
        sure = possible = -demand
        for entry, noise, low, high in zip(facet.entries, facet.noises, facet.low, facet.high, strict=True):
            y = sign * entry
            sure = sure + jnp.where(y > noise, y * high, y * low)
            possible = possible + jnp.where(y > -noise, (y + 2.0 * noise) * high, y * low)
        lower.append(sure)
        upper.append(possible)
    return _between(facet, jnp.minimum(*lower), jnp.minimum(*upper))


def closure_margin(facet: FacetLimits) -> Bounds:
    """Bounds of the margin of wrench closure of one facet normal."""
    fewest = jnp.minimum(largest(facet.entries), largest([-entry for entry in facet.entries]))
    inverse = 1.0 / largest([jnp.abs(entry) for entry in facet.entries])
    error = 2.0 * largest(facet.noises) * inverse
    return fewest * inverse - error, fewest * inverse + error
