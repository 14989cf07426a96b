"""Criteria of a platform's motion as slacks at one time: taut cables, regular poses, below the spools, limits.

With n the number of cables, f the tensions, m the mass:

    taut           n z0 mu / g, tensions over that of equal cables at rest in P0
    regular        determinant (`robots.statics.wrench_balance.normalised_determinant`) over its value at rest in P0
    below          depth of the mass centre below the spool plane, over z0
    tension        (f - f_min) n / (m g),  (f_max - f) n / (m g)
    floor          (floor - z) / z0
    length, speed, acceleration    1 - value / largest

After the readable form follow functions of many platforms, one lane a case; the screen uses those of tensions.
"""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from cspr_jax.families.platforms.platform_segment import PlatformSegment
from cspr_jax.families.platforms.platform_segment_lanes import PhaseLanes, StateLanes, squared_duration, state
from cspr_jax.motion.limits import limits_set, scales, slack, values
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.linear.lanes import dot, largest, smallest
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics import wrench_balance
from cspr_jax.robots.statics.wrench_lanes import (
    CABLES,
    Balance,
    CableLanes,
    balance,
    cable_lanes,
    cable_rates,
    inertial_wrench,
    normalised_determinant,
)
from cspr_jax.schema.limits import Limit
from cspr_jax.schema.verdicts import Verdict


def flags(limits: Limits) -> tuple[Verdict, ...]:
    """Flag of each criterion, raised if it is broken."""
    return (Verdict.SLACK_CABLE, Verdict.SINGULAR, Verdict.ABOVE_SPOOLS, *(row.flag for row in limits_set(limits)))


def pose_slacks(
    problem: Problem, state: State, z0: Float[Array, ""], regular: Float[Array, ""]
) -> Float[Array, "n_criteria"]:
    """The smallest slack of each criterion at one time."""
    robot, limits = problem.robot, problem.limits
    per_length = wrench_balance.tensions_per_length(robot, state)
    basic = [
        robot.n_cables * z0 / robot.gravity * minimum_of(per_length),
        wrench_balance.normalised_determinant(robot, state.position, state.rotation) / regular,
        plane_normal(robot) @ state.position / z0,
    ]
    limit_rows = limits_set(limits)
    if not limit_rows:
        return jnp.stack(basic)
    quantities, scale = values(robot, state), scales(robot.n_cables, robot.mass * robot.gravity, z0)
    slacks = (slack(row, getattr(limits, row.name), getattr(quantities, row.quantity), scale) for row in limit_rows)
    return jnp.stack([*basic, *(minimum_of(x) for x in slacks)])


# If the volume of three of the cables over the product of their lengths is below this, they lie nearly in one plane.
# Rounding of the fast balance grows with the third power of the inverse volume: then it gives no tension, and refutes
# nothing.
FLAT = 1e-3


def _balanced(robot: PlatformRobot, current: StateLanes, cables: CableLanes, squared: Array) -> Balance:
    def slowed(vector):
        return tuple(x / squared for x in vector)

    # Like the force, the moment is of second order in time: omega enters squared.
    force, moment = inertial_wrench(
        robot, slowed(current.acceleration), current.rotation, current.omega, current.angular_acceleration
    )
    return balance(cables, force, slowed(moment))


def _is_flat(cables: CableLanes, balance: Balance) -> Array:
    # Tell where three of the cables are nearly in one plane.
    a, b, c = (dot(cables.rays[k], cables.rays[k]) for k in range(0, CABLES, 2))
    return balance.volume * balance.volume < FLAT**2 * a * b * c


def _smallest_tension(rate: Array, balance: Balance) -> Array:
    # Return the smallest tension over that of equal cables at rest in P0.
    fraction = CABLES / (rate * balance.denominator)
    return smallest([x * fraction for x in balance.numerators])


def certain_tension(
    rate: Float[Array, "n"], regular: Float[Array, "n"], cables: CableLanes, balance: Balance
) -> Float[Array, "n"]:
    """The smallest tension where the fast balance gives one."""
    lowest = jnp.where(balance.signed * regular > 0.0, _smallest_tension(rate, balance), -jnp.inf)
    return jnp.where(_is_flat(cables, balance), jnp.inf, lowest)


def lowest_tension(
    robot: PlatformRobot, segment: PlatformSegment, arcs: Array, phase: PhaseLanes, kind: PlatformMotionKind
) -> Float[Array, "n"]:
    """The smallest tension of many segments at one time."""
    current = state(segment, arcs, phase, kind)
    cables = cable_lanes(robot, current.position, current.rotation)
    balance = _balanced(robot, current, cables, squared_duration(segment, arcs))
    return certain_tension(segment.rate, segment.regular, cables, balance)


def moving_slacks(
    problem: Problem, segment: PlatformSegment, arcs: Array, phase: PhaseLanes, kind: PlatformMotionKind
) -> list[Array]:
    """Smallest slacks of the criteria that depend on the motion, of many segments at one time."""
    robot, limits = problem.robot, problem.limits
    current, squared = state(segment, arcs, phase, kind), squared_duration(segment, arcs)
    cables = cable_lanes(robot, current.position, current.rotation)
    balance = _balanced(robot, current, cables, squared)
    is_flat = _is_flat(cables, balance)
    values = [jnp.where(is_flat, jnp.inf, _smallest_tension(segment.rate, balance))]
    limit_rows = _limit_rows(limits, of_motion=True)
    if not limit_rows:
        return values
    lengths, rates, second_derivatives = cable_rates(
        cables, current.velocity, current.acceleration, current.omega, current.angular_acceleration
    )
    duration, scale = jnp.sqrt(squared), scales(CABLES, robot.mass * robot.gravity, robot.gravity / segment.rate)
    each = {
        "tension": [robot.mass * x / balance.denominator * y for x, y in zip(balance.numerators, lengths, strict=True)],
        "speed": [jnp.abs(rate) / duration for rate in rates],
        "acceleration": [jnp.abs(second_derivative) / squared for second_derivative in second_derivatives],
        "mass_centre_speed": [jnp.sqrt(dot(current.velocity, current.velocity)) / duration],
        "mass_centre_acceleration": [jnp.sqrt(dot(current.acceleration, current.acceleration)) / squared],
    }
    for row in limit_rows:
        minimum = _smallest_slack(row, limits, each[row.quantity], scale)
        values.append(jnp.where(is_flat, jnp.inf, minimum) if row.quantity == "tension" else minimum)
    return values


def static_slacks(problem: Problem, segment: PlatformSegment, current: StateLanes, cables: CableLanes) -> list[Array]:
    """Smallest slacks of the criteria that depend on the pose alone, of many segments at one time."""
    robot, limits, z0 = problem.robot, problem.limits, problem.robot.gravity / segment.rate
    normal = plane_normal(robot)
    below = dot([normal[i] for i in range(3)], current.position) / z0
    values = [normalised_determinant(robot, cables) / segment.regular, below]
    scale = scales(CABLES, robot.mass * robot.gravity, z0)
    attached = [ray[2] + robot.base_points[k, 2] for k, ray in enumerate(cables.rays)]
    each = {
        "depth": [largest([current.position[2], *attached])],
        "length": [jnp.sqrt(dot(ray, ray)) for ray in cables.rays],
    }
    return values + [
        _smallest_slack(row, limits, each[row.quantity], scale) for row in _limit_rows(limits, of_motion=False)
    ]


def _limit_rows(limits: Limits, *, of_motion: bool) -> list[Limit]:
    return [row for row in limits_set(limits) if row.of_motion == of_motion]


def _smallest_slack(row: Limit, limits: Limits, each: list[Array], scale) -> Array:
    # Return the smallest slack of a limit on a quantity of each cable, or on a single quantity.
    limit = getattr(limits, row.name)
    bounds = [limit[k] for k in range(len(each))] if row.per_cable else [limit]
    return smallest([slack(row, x, value, scale) for x, value in zip(bounds, each, strict=True)])


def order(limits: Limits) -> list[int]:
    """Index of each criterion of `slacks.flags` among moving slacks followed by static ones."""
    moving, static = _limit_rows(limits, of_motion=True), _limit_rows(limits, of_motion=False)
    criteria = ["taut", *moving, "regular", "below", *static]
    return [criteria.index(criterion) for criterion in ("taut", "regular", "below", *limits_set(limits))]
