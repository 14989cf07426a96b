"""Limits on a platform's motion as analytic functions on blocks, one row for each quantity.

    tension         |x_k| kappa_k / z0 over D, compared with the limit over the weight that a cable carries
    speed           (|x_k|^2 - (x_k . x_k')^2 / limit^2) / z0^2
    acceleration    (|x_k|^3 -+ ((x_k'^2 + x_k . x_k'') |x_k|^2 - (x_k . x_k')^2) / limit) / z0^3

    mass centre     1 - |p'|^2 / limit^2,   1 - |p''|^2 / limit^2

with x_k the vector of cable k, and primes for derivatives in time. All but the first are positive exactly if the limit
is met.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.families.platforms.platform_segment_lanes import StateLanes
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.linear.lanes import dot
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.statics.wrench_lanes import CABLES, CableLanes, cable_rates

# The length of a ray is analytic if the ray changes by less than this fraction of it: sqrt(2) - 1.
STRAIGHT = 0.414
Pair = tuple[Array, Array]


class Node(NamedTuple):
    """One node in each of n blocks.

    Fields:
        state: state of the platform.
        cables: arms and rays of the cables.
        kappa: numerators of the slacks of taut cables, (n,) each; see `tension_blocks`.
        squared: T^2, s^2.
        z0: depth of P0, m.
    """

    state: StateLanes
    cables: CableLanes
    kappa: Sequence[Array]
    squared: Array
    z0: Array


class CableEllipseBounds(NamedTuple):
    """Bounds on an ellipse of complex time, one (n,) for each cable.

    Fields:
        kappa: bounds of the numerators of the slacks of taut cables.
        rays: bounds of the lengths of rays, m.
        ray_rates: bounds of the derivative of rays in normalised time, m.
        ray_accelerations: bounds of the second derivative of rays, m.
        is_straight: whether the lengths are analytic.
        squared: (n,) T^2, s^2.
        z0: (n,) depth of P0, m.
        speed: (n,) bound of |p'| of the mass centre in normalised time, m.
        second_derivative: (n,) bound of |p''| of the mass centre in normalised time, m.
    """

    kappa: Sequence[Array]
    rays: Sequence[Array]
    ray_rates: Sequence[Array]
    ray_accelerations: Sequence[Array]
    is_straight: Sequence[Array]
    squared: Array
    z0: Array
    speed: Array
    second_derivative: Array


class Enclosed(NamedTuple):
    """Lower and upper bounds of a quantity on n blocks and at their nodes, (m, n_cables, n); those of D are (m, 1, n).

    Fields:
        coefficients: bounds of Bernstein coefficients, widened by the remainders of the polynomials.
        nodes: bounds of the values at the nodes, widened by rounding.
        regular: bounds for D, as `coefficients`.
        fraction: bounds for D, as `nodes`.
    """

    coefficients: Pair
    nodes: Pair
    regular: Pair
    fraction: Pair


class LimitOnBlocks(NamedTuple):
    """A limited quantity of the motion.

    Fields:
        width: number of values that represent the quantity.
        values: function of a node and the limit (n_cables,); gives the values in pairs of (n,).
        bounds: function of `CableEllipseBounds` and the limit; gives a bound of the magnitude of each value.
        slacks: function of the enclosed values, the limit over the scale of slacks, and whether the limit is a lower
            one; gives upper bounds of the smallest slacks at the nodes (m, n), and a lower bound of all slacks (n,).
    """

    width: int
    values: Callable[[Node, Array], list[Pair]]
    bounds: Callable[[CableEllipseBounds, Array], list[Array]]
    slacks: Callable[[Enclosed, Array, bool], Pair]


def ratio(top: Float[Array, "..."], regular: Pair) -> Float[Array, "..."]:
    """Lower bounds of quotients of polynomials: the smallest quotient that their coefficients allow."""
    low, high = regular
    bottom = jnp.where(top > 0.0, high, low)
    return jnp.where(bottom > 0.0, top / jnp.where(bottom > 0.0, bottom, 1.0), -jnp.inf)


def at_most(top: Float[Array, "..."], regular: Pair) -> Float[Array, "..."]:
    """Upper bounds of quotients with a positive denominator."""
    return -ratio(-top, regular)


def _paired(values: Sequence[Array]) -> list[Pair]:
    return list(zip(values[::2], values[1::2], strict=True))


def _tensions(node: Node, _: Array) -> list[Pair]:
    lengths = [jnp.sqrt(dot(ray, ray)) / node.z0 for ray in node.cables.rays]
    return _paired([x * length for x, length in zip(node.kappa, lengths, strict=True)])


def _tension_bounds(cable: CableEllipseBounds, _: Array) -> list[Array]:
    each = zip(cable.kappa, cable.rays, cable.is_straight, strict=True)
    return [jnp.where(is_straight, kappa * ray / cable.z0, jnp.inf) for kappa, ray, is_straight in each]


def _tension_slacks(enclosed: Enclosed, limit: Array, is_lower: bool) -> Pair:
    limit, (low, high), (under, over) = limit[None, :, None], enclosed.coefficients, enclosed.nodes
    if is_lower:
        attained, bound = at_most(over, enclosed.fraction) - limit, ratio(low, enclosed.regular) - limit
    else:
        attained, bound = limit + at_most(-under, enclosed.fraction), limit + ratio(-high, enclosed.regular)
    return minimum_of(attained, axis=1), minimum_of(bound, axis=(0, 1))


def _rates(node: Node) -> list[tuple[Array, Array, Array]]:
    state = node.state
    columns = cable_rates(node.cables, state.velocity, state.acceleration, state.omega, state.angular_acceleration)
    return list(zip(*columns, strict=True))


def _speeds(node: Node, limit: Array) -> list[Pair]:
    values = []
    for k, (length, rate, _) in enumerate(_rates(node)):
        fraction = rate * rate / (node.squared * limit[k] ** 2)
        values.append((length / node.z0) ** 2 * (1.0 - fraction))
    return _paired(values)


def _speed_bounds(cable: CableEllipseBounds, limit: Array) -> list[Array]:
    return [
        (ray / cable.z0) ** 2 * (1.0 + rate**2 / (cable.squared * limit[k] ** 2))
        for k, (ray, rate) in enumerate(zip(cable.rays, cable.ray_rates, strict=True))
    ]


def _speed_slacks(enclosed: Enclosed, _: Array, __: bool) -> Pair:
    return minimum_of(enclosed.nodes[1], axis=1), minimum_of(enclosed.coefficients[0], axis=(0, 1))


def _of_mass_centre(vector, largest: Array) -> list[Pair]:
    # Values must come in pairs.
    value = 1.0 - dot(vector, vector) / largest**2
    return [(value, value)]


def _mass_centre_bounds(norm: Array, largest: Array) -> list[Array]:
    return [1.0 + (norm / largest) ** 2] * 2


def _accelerations(node: Node, limit: Array) -> list[Pair]:
    pairs = []
    for k, (length, _, second_derivative) in enumerate(_rates(node)):
        cubed = (length / node.z0) ** 3
        pairs.append((cubed, cubed * second_derivative / (node.squared * limit[k])))
    return pairs


def _acceleration_bounds(cable: CableEllipseBounds, limit: Array) -> list[Array]:
    bounds = []
    for k, (ray, rate, acceleration) in enumerate(
        zip(cable.rays, cable.ray_rates, cable.ray_accelerations, strict=True)
    ):
        second_derivative = ray**2 * (2.0 * rate**2 + ray * acceleration) / (cable.squared * cable.z0**3 * limit[k])
        bounds += [jnp.where(cable.is_straight[k], (ray / cable.z0) ** 3, jnp.inf), second_derivative]
    return bounds


def _acceleration_slacks(enclosed: Enclosed, _: Array, __: bool) -> Pair:
    (low, high), (under, over) = enclosed.coefficients, enclosed.nodes
    worst = jnp.maximum(jnp.abs(low[:, 1::2]), jnp.abs(high[:, 1::2]))
    # Take accelerations as close to zero as rounding allows.
    accelerations = jnp.maximum(jnp.maximum(under[:, 1::2], -over[:, 1::2]), 0.0)
    return minimum_of(over[:, ::2] - accelerations, axis=1), minimum_of(low[:, ::2] - worst, axis=(0, 1))


# Keys are the names of quantities in the rows of `schema.limits`.
QUANTITIES = {
    "tension": LimitOnBlocks(CABLES, _tensions, _tension_bounds, _tension_slacks),
    "speed": LimitOnBlocks(CABLES, _speeds, _speed_bounds, _speed_slacks),
    "acceleration": LimitOnBlocks(2 * CABLES, _accelerations, _acceleration_bounds, _acceleration_slacks),
    "mass_centre_speed": LimitOnBlocks(
        2,
        lambda node, limit: _of_mass_centre(node.state.velocity, jnp.sqrt(node.squared) * limit),
        lambda cable, limit: _mass_centre_bounds(cable.speed, jnp.sqrt(cable.squared) * limit),
        _speed_slacks,
    ),
    "mass_centre_acceleration": LimitOnBlocks(
        2,
        lambda node, limit: _of_mass_centre(node.state.acceleration, node.squared * limit),
        lambda cable, limit: _mass_centre_bounds(cable.second_derivative, cable.squared * limit),
        _speed_slacks,
    ),
}
