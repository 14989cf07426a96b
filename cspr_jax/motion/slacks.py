"""Slacks of any motion: functions of its state at one time that are positive exactly while a criterion is met.

They serve every robot and family, and can be differentiated; searches use faster forms of the same criteria. With n
the number of cables, kappa_k the tension of cable k over its length, and values at rest in P0, their order is:

    taut       kappa_k over its value at rest; for a point mass without pulleys, the pseudotension over its value at
               rest; for a platform, n z0 mu_k / g
    regular    of a platform: normalised determinant of the structure matrix over its value at rest
    below      depth of the mass centre below the spool plane over z0
    limits     for each limit that is set, one slack per cable, and one for the floor: `motion.limits.slack`
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.motion.limits import limits_set, scales, slack, values
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots import cables
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot, plane_normal, rest_point
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics import force_balance, wrench_balance
from cspr_jax.schema.verdicts import Verdict


def slacks(problem: Problem, motion: Motion, tau: Float[Array, ""]) -> Float[Array, "n_slacks"]:
    """Slacks of all criteria at one time of a motion."""
    robot, state, z0 = problem.robot, motion.state(tau), motion.z0
    balance = _of_platform if isinstance(robot, PlatformRobot) else _of_point_mass
    terms = [*balance(robot, state, z0), jnp.atleast_1d(plane_normal(robot) @ state.position / z0)]
    rows = limits_set(problem.limits)
    if rows:
        quantities, scale = values(robot, state), scales(robot.n_cables, robot.mass * robot.gravity, z0)
        for row in rows:
            limit = jnp.asarray(getattr(problem.limits, row.name))
            terms.append(jnp.atleast_1d(slack(row, limit, getattr(quantities, row.quantity), scale)))
    return jnp.concatenate(terms)


def flags(problem: Problem) -> tuple[Verdict, ...]:
    """Flag of the criterion of each slack."""
    robot, verdicts = problem.robot, [Verdict.SLACK_CABLE] * problem.robot.n_cables
    if isinstance(robot, PlatformRobot):
        verdicts.append(Verdict.SINGULAR)
    verdicts.append(Verdict.ABOVE_SPOOLS)
    for row in limits_set(problem.limits):
        verdicts += [row.flag] * (robot.n_cables if row.per_cable else 1)
    return tuple(verdicts)


def _of_point_mass(robot: PointMassRobot, state: State, z0: Array) -> list[Array]:
    center = rest_point(z0)
    if robot.pulleys is not None:
        return [
            _per_length(robot, state)
            / _per_length(robot, State(center, jnp.zeros_like(center), jnp.zeros_like(center)))
        ]
    at_rest = force_balance.pseudotensions(robot, center, jnp.zeros_like(center))
    return [force_balance.pseudotensions(robot, state.position, state.acceleration) / at_rest]


def _of_platform(robot: PlatformRobot, state: State, z0: Array) -> list[Array]:
    center = rest_point(z0)
    at_rest = wrench_balance.normalised_determinant(robot, center, jnp.eye(3))
    determinant = wrench_balance.normalised_determinant(robot, state.position, state.rotation)
    with_pulleys = robot.pulleys is not None
    per_length = _per_length(robot, state) if with_pulleys else wrench_balance.tensions_per_length(robot, state)
    return [robot.n_cables * z0 / robot.gravity * per_length, jnp.atleast_1d(determinant / at_rest)]


def sampled_margin(problem: Problem, motion: Motion, samples: int = 64) -> Float[Array, ""]:
    """Smallest slack at equidistant times of a motion."""
    tau = jnp.linspace(0.0, 1.0, samples + 1)
    return minimum_of(jax.vmap(lambda t: slacks(problem, motion, t))(tau))


def _per_length(robot: AnyRobot, state: State) -> Array:
    # Tensions of cables behind pulleys, per mass and length, 1/s^2.
    return cables.tensions(robot, state) / cables.cable_motion(robot, state)[0] / robot.mass
