"""Criteria of a platform's motion as slacks at one instant: taut cables, no singularity, below the spools, limits.

With n the number of cables, f the tensions, m the mass:

    taut           n z0 mu / g, the tension over its value at rest in P0 if all were equal
    regular        determinant (`robots.statics.wrench_balance.normalised_determinant`) over its value at rest in P0
    below          depth of the mass centre below the spool plane, over z0
    tension        (f - f_min) n / (m g),  (f_max - f) n / (m g)
    floor          (floor - z) / z0
    length, speed, acceleration    1 - value / largest
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp
from jax import Array

from cspr_jax.motion.limits import limits_set, scales, slack, values
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics import wrench_balance
from cspr_jax.schema.verdicts import Verdict

if TYPE_CHECKING:
    from jaxtyping import Float


def flags(limits: Limits) -> tuple[Verdict, ...]:
    """Flags that say which criterion is broken, one a criterion."""
    return (Verdict.SLACK_CABLE, Verdict.SINGULAR, Verdict.ABOVE_SPOOLS, *(row.flag for row in limits_set(limits)))


def pose_slacks(
    problem: Problem, state: State, z0: Float[Array, ""], regular: Float[Array, ""]
) -> Float[Array, "n_criteria"]:
    """The smallest slack of each criterion at one instant."""
    robot, limits = problem.robot, problem.limits
    per_length = wrench_balance.tensions_per_length(robot, state)
    basic = [
        robot.n_cables * z0 / robot.gravity * jnp.min(per_length),
        wrench_balance.normalised_determinant(robot, state.position, state.rotation) / regular,
        plane_normal(robot) @ state.position / z0,
    ]
    rows = limits_set(limits)
    if not rows:
        return jnp.stack(basic)
    quantities, scale = values(robot, state), scales(robot.n_cables, robot.mass * robot.gravity, z0)
    slacks = (slack(row, getattr(limits, row.name), getattr(quantities, row.quantity), scale) for row in rows)
    return jnp.stack([*basic, *(jnp.min(x) for x in slacks)])
