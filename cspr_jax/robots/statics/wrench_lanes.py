"""The wrench balance of many platforms, one lane a case: the fast form of `wrench_balance`, one division at the end.

(3.11) is solved by adjugates, with the cables in two groups of three; the same products give the determinant.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.linear.lanes import Matrix, Vector, combined, cross, dot, rotated, rotated_back
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.platform import PlatformRobot, platform_radius

CABLES = 6  # the only number of cables that the formulas of this module are written for


class CableLanes(NamedTuple):
    """Positions of the cables, one entry a cable.

    Fields:
        arms: vectors from the mass centre to the attachment points, fixed axes, m.
        rays: vectors from the spools to the attachment points, m.
    """

    arms: Sequence[Vector]
    rays: Sequence[Vector]


class Balance(NamedTuple):
    """Tensions per mass and length as fractions.

    Fields:
        numerators: six numerators of mu.
        denominator: common denominator.
        signed: a number with the sign of det J.
        volume: volume of the first, third and fifth ray, m^3.
    """

    numerators: Sequence[Array]
    denominator: Array
    signed: Array
    volume: Array


def cable_lanes(robot: PlatformRobot, position: Vector, rotation: Matrix) -> CableLanes:
    """Arms and rays of the cables, (3.1)."""
    each = {k: rotated(rotation, [robot.platform_points[k, j] for j in range(3)]) for k in set(robot.joints)}
    arms = [each[k] for k in robot.joints]
    rays = [tuple(position[i] + arm[i] - robot.base_points[k, i] for i in range(3)) for k, arm in enumerate(arms)]
    return CableLanes(arms, rays)


def inertial_wrench(
    robot: PlatformRobot, acceleration: Vector, rotation: Matrix, omega: Vector, angular_acceleration: Vector
) -> tuple[Vector, Vector]:
    """Right-hand side of (3.11), per mass."""
    inertia = robot.inertia / robot.mass

    def weighted(vector):
        own_axes = rotated_back(rotation, vector)
        return rotated(rotation, [dot([inertia[i, j] for j in range(3)], own_axes) for i in range(3)])

    x, y = weighted(angular_acceleration), cross(omega, weighted(omega))
    force = (acceleration[0], acceleration[1], acceleration[2] - robot.gravity)
    return force, tuple(a + b for a, b in zip(x, y, strict=True))


def balance(cables: CableLanes, force: Vector, moment: Vector) -> Balance:
    """The tensions that give a wrench, (3.11)."""
    forces = [tuple(-x for x in ray) for ray in cables.rays]
    moments = [cross(arm, unit) for arm, unit in zip(cables.arms, forces, strict=True)]
    first, second = range(0, CABLES, 2), range(1, CABLES, 2)
    a, b = [forces[k] for k in first], [forces[k] for k in second]
    adjugate = (cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1]))
    d = dot(a[0], adjugate[0])
    g = [[dot(row, column) for column in b] for row in adjugate]  # adj(A) B
    top = [dot(row, force) for row in adjugate]
    c = [moments[k] for k in first]
    e = [
        tuple(d * moments[k][i] - sum(c[j][i] * g[j][n] for j in range(3)) for i in range(3))
        for n, k in enumerate(second)
    ]
    rest = tuple(d * moment[i] - sum(c[j][i] * top[j] for j in range(3)) for i in range(3))
    inner = (cross(e[1], e[2]), cross(e[2], e[0]), cross(e[0], e[1]))
    determinant = dot(e[0], inner[0])
    odd = [dot(row, rest) for row in inner]
    even = [top[j] * determinant - sum(g[j][n] * odd[n] for n in range(3)) for j in range(3)]
    numerators = [x for pair in zip(even, [d * x for x in odd], strict=True) for x in pair]
    # Sorting the cables into two groups is an odd permutation, which changes the sign.
    return Balance(numerators, d * determinant, -determinant, d)


def determinant(cables: CableLanes) -> Float[Array, "..."]:
    """Determinant of J, (3.5), as a sum of volumes of three rays times volumes of the other three moments."""
    moments = [cross(arm, ray) for arm, ray in zip(cables.arms, cables.rays, strict=True)]
    total = jnp.zeros(())
    for three in itertools.combinations(range(CABLES), 3):
        others = [k for k in range(CABLES) if k not in three]
        a, b, c = (cables.rays[k] for k in three)
        d, e, f = (moments[k] for k in others)
        # Sign of the term in Laplace's expansion by the first three columns.
        sign = -1.0 if (sum(three) - 3) % 2 else 1.0
        total = total + sign * dot(a, cross(b, c)) * dot(d, cross(e, f))
    return total


def normalised_determinant(robot: PlatformRobot, cables: CableLanes) -> Float[Array, "..."]:
    """Determinant of J with unit cables, the platform's radius as unit; see `wrench_balance.normalised_determinant`."""
    lengths = [jnp.sqrt(dot(ray, ray)) for ray in cables.rays]
    radius = platform_radius(robot)
    return determinant(cables) / (radius**3 * math.prod(lengths[1:], start=lengths[0]))


def cable_rates(
    cables: CableLanes, velocity: Vector, acceleration: Vector, omega: Vector, angular_acceleration: Vector
) -> list[list[Array]]:
    """Lengths of the cables and their first two derivatives, (3.2) and (3.3)."""
    entries = []
    for arm, ray in zip(cables.arms, cables.rays, strict=True):
        swing = cross(omega, arm)
        point_velocity = combined([(jnp.ones(()), velocity), (jnp.ones(()), swing)])
        across, inward = cross(angular_acceleration, arm), cross(omega, swing)
        point_acceleration = tuple(acceleration[i] + across[i] + inward[i] for i in range(3))
        length = jnp.sqrt(dot(ray, ray))
        rate = dot(ray, point_velocity) / length
        entries.append(
            (length, rate, (dot(point_velocity, point_velocity) + dot(ray, point_acceleration) - rate * rate) / length)
        )
    return [list(column) for column in zip(*entries, strict=True)]
