"""Limits on a platform's motion as analytic functions on blocks, one row a quantity.

    tension         |x_k| kappa_k / z0 over D, compared with the limit over the weight that a cable carries
    speed           (|x_k|^2 - (x_k . x_k')^2 / limit^2) / z0^2
    acceleration    (|x_k|^3 -+ ((x_k'^2 + x_k . x_k'') |x_k|^2 - (x_k . x_k')^2) / limit) / z0^3

    mass centre     1 - |p'|^2 / limit^2,   1 - |p''|^2 / limit^2

with x_k cable k as a vector and primes for derivatives in time. All but the first are positive exactly while the limit
is met.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.families.platforms.platform_segment_lanes import StateLanes
from cspr_jax.numerics.linear.lanes import dot
from cspr_jax.robots.statics.wrench_lanes import CABLES, CableLanes, cable_rates

if TYPE_CHECKING:
    from jaxtyping import Float

# The length of a ray is analytic where the ray changes by less than this part of it: sqrt(2) - 1.
STRAIGHT = 0.414
Pair = tuple[Array, Array]


class Here(NamedTuple):
    """One instant of each of n blocks.

    Fields:
        state: of the platform.
        cables: arms and rays.
        kappa: numerators of the slacks of taut cables, (n,) each; see `tension_blocks`.
        squared: T^2, s^2.
        z0: depth of P0, m.
    """

    state: StateLanes
    cables: CableLanes
    kappa: Sequence[Array]
    squared: Array
    z0: Array


class Sizes(NamedTuple):
    """Bounds on an ellipse of complex time, one (n,) a cable.

    Fields:
        kappa: bounds of the numerators of the slacks of taut cables.
        rays: bounds of lengths, m.
        paces: bounds of the derivative of rays in normalised time, m.
        pulls: bounds of the second derivative of rays, m.
        is_straight: whether lengths are analytic.
        squared: (n,) T^2, s^2.
        z0: (n,) depth of P0, m.
        speed: (n,) bound of |p'| of the mass centre in normalised time, m.
        second_derivative: (n,) likewise of |p''|.
    """

    kappa: Sequence[Array]
    rays: Sequence[Array]
    paces: Sequence[Array]
    pulls: Sequence[Array]
    is_straight: Sequence[Array]
    squared: Array
    z0: Array
    speed: Array
    second_derivative: Array


class Enclosed(NamedTuple):
    """Lower and upper bounds of a quantity on n blocks and at their nodes, (m, n_cables, n); of D (m, 1, n).

    Fields:
        coefficients: bounds of Bernstein coefficients, which allow for what the polynomials leave out.
        nodes: bounds of the values at the nodes, which allow for rounding.
        regular: as `coefficients`, of D.
        fraction: as `nodes`, of D.
    """

    coefficients: Pair
    nodes: Pair
    regular: Pair
    fraction: Pair


class LimitOnBlocks(NamedTuple):
    """A quantity of the motion that limits bound.

    Fields:
        width: number of values that stand for the quantity.
        values: takes an instant and the limit (n_cables,); gives the values in pairs of (n,).
        sizes: takes `Sizes` and the limit; gives a bound of the size of each value.
        slacks: takes the enclosed values, the limit over the scale of slacks, and whether the limit is a least value;
            gives upper bounds of the smallest slacks at the nodes (m, n), and a lower bound of all slacks (n,).
    """

    width: int
    values: Callable[[Here, Array], list[Pair]]
    sizes: Callable[[Sizes, Array], list[Array]]
    slacks: Callable[[Enclosed, Array, bool], Pair]


def ratio(top: Float[Array, "..."], regular: Pair) -> Float[Array, "..."]:
    """Lower bounds of quotients of polynomials: the smallest one that their coefficients allow."""
    low, high = regular
    bottom = jnp.where(top > 0.0, high, low)
    return jnp.where(bottom > 0.0, top / jnp.where(bottom > 0.0, bottom, 1.0), -jnp.inf)


def at_most(top: Float[Array, "..."], regular: Pair) -> Float[Array, "..."]:
    """Upper bounds of quotients where the denominator is positive."""
    return -ratio(-top, regular)


def _paired(values: Sequence[Array]) -> list[Pair]:
    return list(zip(values[::2], values[1::2], strict=True))


def _tensions(here: Here, _: Array) -> list[Pair]:
    lengths = [jnp.sqrt(dot(ray, ray)) / here.z0 for ray in here.cables.rays]
    return _paired([x * length for x, length in zip(here.kappa, lengths, strict=True)])


def _tension_sizes(sizes: Sizes, _: Array) -> list[Array]:
    each = zip(sizes.kappa, sizes.rays, sizes.is_straight, strict=True)
    return [jnp.where(is_straight, kappa * ray / sizes.z0, jnp.inf) for kappa, ray, is_straight in each]


def _tension_slacks(enclosed: Enclosed, limit: Array, is_least: bool) -> Pair:
    limit, (low, high), (under, over) = limit[None, :, None], enclosed.coefficients, enclosed.nodes
    if is_least:
        current, bound = at_most(over, enclosed.fraction) - limit, ratio(low, enclosed.regular) - limit
    else:
        current, bound = limit + at_most(-under, enclosed.fraction), limit + ratio(-high, enclosed.regular)
    return jnp.min(current, axis=1), jnp.min(bound, axis=(0, 1))


def _rates(here: Here) -> list[tuple[Array, Array, Array]]:
    state = here.state
    rows = cable_rates(here.cables, state.velocity, state.acceleration, state.omega, state.angular_acceleration)
    return list(zip(*rows, strict=True))


def _speeds(here: Here, limit: Array) -> list[Pair]:
    values = []
    for k, (length, rate, _) in enumerate(_rates(here)):
        fraction = rate * rate / (here.squared * limit[k] ** 2)
        values.append((length / here.z0) ** 2 * (1.0 - fraction))
    return _paired(values)


def _speed_sizes(sizes: Sizes, limit: Array) -> list[Array]:
    return [
        (ray / sizes.z0) ** 2 * (1.0 + pace**2 / (sizes.squared * limit[k] ** 2))
        for k, (ray, pace) in enumerate(zip(sizes.rays, sizes.paces, strict=True))
    ]


def _speed_slacks(enclosed: Enclosed, _: Array, __: bool) -> Pair:
    return jnp.min(enclosed.nodes[1], axis=1), jnp.min(enclosed.coefficients[0], axis=(0, 1))


def _of_mass_centre(vector, largest: Array) -> list[Pair]:
    # Values come in pairs.
    value = 1.0 - dot(vector, vector) / largest**2
    return [(value, value)]


def _mass_centre_sizes(size: Array, largest: Array) -> list[Array]:
    return [1.0 + (size / largest) ** 2] * 2


def _accelerations(here: Here, limit: Array) -> list[Pair]:
    pairs = []
    for k, (length, _, second_derivative) in enumerate(_rates(here)):
        cubed = (length / here.z0) ** 3
        pairs.append((cubed, cubed * second_derivative / (here.squared * limit[k])))
    return pairs


def _acceleration_sizes(sizes: Sizes, limit: Array) -> list[Array]:
    bounds = []
    for k, (ray, pace, pull) in enumerate(zip(sizes.rays, sizes.paces, sizes.pulls, strict=True)):
        second_derivative = ray**2 * (2.0 * pace**2 + ray * pull) / (sizes.squared * sizes.z0**3 * limit[k])
        bounds += [jnp.where(sizes.is_straight[k], (ray / sizes.z0) ** 3, jnp.inf), second_derivative]
    return bounds


def _acceleration_slacks(enclosed: Enclosed, _: Array, __: bool) -> Pair:
    (low, high), (under, over) = enclosed.coefficients, enclosed.nodes
    worst = jnp.maximum(jnp.abs(low[:, 1::2]), jnp.abs(high[:, 1::2]))
    # Take accelerations as near to zero as rounding lets them be.
    bends = jnp.maximum(jnp.maximum(under[:, 1::2], -over[:, 1::2]), 0.0)
    return jnp.min(over[:, ::2] - bends, axis=1), jnp.min(low[:, ::2] - worst, axis=(0, 1))


# The keys are the names of the quantities in the rows of `schema.limits`.
QUANTITIES = {
    "tension": LimitOnBlocks(CABLES, _tensions, _tension_sizes, _tension_slacks),
    "speed": LimitOnBlocks(CABLES, _speeds, _speed_sizes, _speed_slacks),
    "acceleration": LimitOnBlocks(2 * CABLES, _accelerations, _acceleration_sizes, _acceleration_slacks),
    "mass_centre_speed": LimitOnBlocks(
        2,
        lambda here, limit: _of_mass_centre(here.state.velocity, jnp.sqrt(here.squared) * limit),
        lambda sizes, limit: _mass_centre_sizes(sizes.speed, jnp.sqrt(sizes.squared) * limit),
        _speed_slacks,
    ),
    "mass_centre_acceleration": LimitOnBlocks(
        2,
        lambda here, limit: _of_mass_centre(here.state.acceleration, here.squared * limit),
        lambda sizes, limit: _mass_centre_sizes(sizes.second_derivative, sizes.squared * limit),
        _speed_slacks,
    ),
}
