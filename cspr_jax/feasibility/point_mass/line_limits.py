"""Limits along motions on straight lines of any number of cables: slacks at samples."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.feasibility.accelerations import faces_at
from cspr_jax.feasibility.limits import given, scales, slack
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots.cables import cable_motion
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.point_mass import spool_radius
from cspr_jax.schema.limits import Limit
from cspr_jax.trajectories.timed_lines import TimedLine

SAMPLES = 1000
# What is largest or smallest at an end of a line, so that its samples prove it.
AT_ENDS = ("floor", "cable_length_max")


def open_limits(limits: Limits) -> list[Limit]:
    """Limits that samples can refute along a line, and not prove.

    Args:
        limits: NumPy leaves.

    Returns:
        their rows. A smallest tension of zero is what taut cables ask for anyway.
    """
    rows = [row for row in given(limits) if row.name not in AT_ENDS]
    return [row for row in rows if row.name != "tension_min" or np.asarray(limits.tension_min).any()]


def limit_slacks(problem: Problem, motion: TimedLine) -> Array:
    """Smallest slack of each limit at samples of a motion, the ends among them.

    Args:
        problem: robot, and limits, some of them given.
        motion: along a line.

    Returns:
        (n_limits,) without a unit, in the order of `limits.given`; that of the floor over the size of the robot, those
        of tensions the distance of the acceleration from those that keep the limits up to this one, over gravity.
    """
    robot, limits = problem.robot, problem.limits
    rows = given(limits)

    def at(tau):
        state = motion.state(tau)
        length, rate, bend = cable_motion(robot, state)
        each = {"depth": state.position[2], "length": length, "speed": jnp.abs(rate), "acceleration": jnp.abs(bend)}
        scale = scales(robot.n_cables, robot.mass * robot.gravity, spool_radius(robot))

        def least(row: Limit) -> Array:
            if row.quantity == "tension":
                known = Limits(tension_min=limits.tension_min)
                if row.name == "tension_max":
                    known = dataclasses.replace(known, tension_max=limits.tension_max)
                return faces_at(robot, known, state.position).margin(state.acceleration) / robot.gravity
            return jnp.min(slack(row, jnp.asarray(getattr(limits, row.name)), each[row.quantity], scale))

        return jnp.stack([least(row) for row in rows])

    return jnp.min(jax.vmap(at)(jnp.linspace(0.0, 1.0, SAMPLES + 1)), axis=0)
