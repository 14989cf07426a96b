"""The slacks of `pose_slacks` for many platforms, one lane a case, and what the first look needs of them."""

import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.lanes import dot, smallest
from cspr_jax.feasibility.limits import given
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import plane_normal
from cspr_jax.robots.wrench_lanes import (
    CABLES,
    Balance,
    Cables,
    balance,
    cable_rates,
    cables,
    conditioning,
    inertial_wrench,
)
from cspr_jax.trajectories.platform_lanes import Instant, State, squared_duration, state
from cspr_jax.trajectories.platform_segment import Kind, PoseSegment

# Limits on what depends on the motion, beside the tensions, and on the pose alone, beside regularity and depth.
MOVING = ("tension_min", "tension_max", "cable_speed_max", "cable_acceleration_max")
STILL = ("floor", "cable_length_max")
# Where three of the cables are nearly in one plane the fast balance has no digits, whatever the platform does.
FLAT = 1e-7


def _balanced(robot: PlatformRobot, now: State, wires: Cables, squared: Array) -> Balance:
    def slowed(vector):
        return tuple(x / squared for x in vector)

    # The moment is of second order in time like the force: omega enters squared.
    force, moment = inertial_wrench(robot, slowed(now.acceleration), now.turn, now.omega, now.spin)
    return balance(wires, force, slowed(moment))


def _is_flat(wires: Cables, found: Balance) -> Array:
    # Where three of the cables are nearly in one plane.
    a, b, c = (dot(wires.rays[k], wires.rays[k]) for k in range(0, CABLES, 2))
    return found.volume * found.volume < FLAT**2 * a * b * c


def _smallest_tension(rate: Array, found: Balance) -> Array:
    # Over its value at rest in P0 if all were equal.
    share = CABLES / (rate * found.denominator)
    return smallest([x * share for x in found.numerators])


def certain_tension(rate: Array, regular: Array, wires: Cables, found: Balance) -> Array:
    """The smallest tension, where the fast balance gives one.

    Args:
        rate: (n,) lambda of (3.50), 1/s^2.
        regular: (n,) determinant at rest in P0, whose sign must not change.
        wires: the cables.
        found: the tensions.

    Returns:
        (n,) over its value at rest in P0 if all were equal; -inf where the determinant has changed its sign, infinite
        where the fast balance has no digits.
    """
    lowest = jnp.where(found.signed * regular > 0.0, _smallest_tension(rate, found), -jnp.inf)
    return jnp.where(_is_flat(wires, found), jnp.inf, lowest)


def lowest_tension(robot: PlatformRobot, segment: PoseSegment, arcs: Array, now: Instant, kind: Kind) -> Array:
    """The smallest tension at one instant of many segments.

    Args:
        robot: in its reference axes.
        segment: leaves (n, ...), of the parity of `arcs`.
        arcs: () or (n,) number of arcs, a float.
        now: of these arcs.
        kind: of the motions.

    Returns:
        (n,) of `certain_tension`.
    """
    here = state(segment, arcs, now, kind)
    wires = cables(robot, here.position, here.turn)
    found = _balanced(robot, here, wires, squared_duration(segment, arcs))
    return certain_tension(segment.rate, segment.regular, wires, found)


def moving_slacks(problem: Problem, segment: PoseSegment, arcs: Array, now: Instant, kind: Kind) -> list[Array]:
    """Smallest slacks of the criteria that depend on the motion, at one instant of many segments.

    Args:
        problem: robot, limits.
        segment: leaves (n, ...), of the parity of `arcs`.
        arcs: () or (n,) number of arcs, a float.
        now: of these arcs.
        kind: of the motions.

    Returns:
        (n,) each, in the order of `MOVING`; infinite where the fast balance has no digits.
    """
    robot, limits = problem.robot, problem.limits
    here, squared = state(segment, arcs, now, kind), squared_duration(segment, arcs)
    wires = cables(robot, here.position, here.turn)
    found = _balanced(robot, here, wires, squared)
    is_flat = _is_flat(wires, found)
    values = [jnp.where(is_flat, jnp.inf, _smallest_tension(segment.rate, found))]
    names = _given(limits, MOVING)
    if not names:
        return values
    lengths, rates, bends = cable_rates(wires, here.velocity, here.acceleration, here.omega, here.spin)
    pace, weight = jnp.sqrt(squared), robot.mass * robot.gravity
    force = [robot.mass * x / found.denominator * y for x, y in zip(found.numerators, lengths, strict=True)]
    slacks = {
        "tension_min": lambda x, k: (force[k] - x) * CABLES / weight,
        "tension_max": lambda x, k: (x - force[k]) * CABLES / weight,
        "cable_speed_max": lambda x, k: 1.0 - jnp.abs(rates[k]) / pace / x,
        "cable_acceleration_max": lambda x, k: 1.0 - jnp.abs(bends[k]) / squared / x,
    }
    for name in names:
        least = smallest([slacks[name](getattr(limits, name)[k], k) for k in range(CABLES)])
        values.append(jnp.where(is_flat, jnp.inf, least) if name.startswith("tension") else least)
    return values


def still_slacks(problem: Problem, segment: PoseSegment, here: State, wires: Cables) -> list[Array]:
    """Smallest slacks of the criteria that depend on the pose alone, at one instant of many segments.

    Args:
        problem: robot, limits.
        segment: leaves (n, ...).
        here: the state.
        wires: the cables there.

    Returns:
        (n,) each, in the order of `STILL`.
    """
    robot, limits, z0 = problem.robot, problem.limits, problem.robot.gravity / segment.rate
    normal = plane_normal(robot)
    below = dot([normal[i] for i in range(3)], here.position) / z0
    values = [conditioning(robot, wires) / segment.regular, below]
    if limits.floor is not None:
        values.append((limits.floor - here.position[2]) / z0)
    if limits.cable_length_max is not None:
        lengths = [jnp.sqrt(dot(ray, ray)) for ray in wires.rays]
        values.append(smallest([1.0 - length / limits.cable_length_max[k] for k, length in enumerate(lengths)]))
    return values


def _given(limits: Limits, names: tuple[str, ...]) -> list[str]:
    return [name for name in given(limits) if name in names]


def order(limits: Limits) -> list[int]:
    """Where the criteria of `pose_slacks.flags` stand among moving slacks and still ones, one after the other.

    Args:
        limits: which limits are given.

    Returns:
        n_criteria indices.
    """
    names = ["taut", *_given(limits, MOVING), "regular", "below", *_given(limits, STILL)]
    return [names.index(name) for name in ("taut", "regular", "below", *given(limits))]
