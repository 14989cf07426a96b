"""Lower bounds of the time of any motion between two poses at zero velocity, along any path.

A length that changes by D from rest to rest, with accelerations up to a when speeding up and up to b when slowing down,
and a speed up to v, takes at least sqrt(2 D (1/a + 1/b)), or D / v + v (1/a + 1/b) / 2 if it reaches v. This holds for
the length of each cable, and for the displacement of the mass centre along every direction e: tensions accelerate it by
at most e . g + s sum(t_max) / m, where s is the largest e . u of a cable's direction u. Below level spools u points
upwards.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.curves.spline import Spline
from cspr_jax.motion.motion import common_shape
from cspr_jax.motion.problem import Problem, bounding_problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot, cable_motion
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.criteria import pose_conditions

ANGLES = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 181)  # of directions in the vertical plane of both positions
SAFE = 1e-9  # bounds are lowered by this fraction, which exceeds rounding errors
LEVEL = 1e-12  # spools are level if their heights differ by less, over the robot's radius
SLANTED = 1e-5  # largest increase of a component of a cable's direction by such a difference
Numbers = np.ndarray | float


def least_time(
    distance: Float[np.ndarray, "..."], speeding: Numbers, slowing: Numbers, speed: Numbers
) -> Float[np.ndarray, "..."]:
    """Least time in which a distance is covered from rest to rest."""
    slowness = 1.0 / np.asarray(speeding) + 1.0 / np.asarray(slowing)
    with np.errstate(invalid="ignore", divide="ignore"):  # without a cap, a largest acceleration, or a distance
        is_capped = np.sqrt(2.0 * distance / slowness) > speed
        capped = distance / speed + 0.5 * speed * slowness
        return np.where(distance > 0.0, np.where(is_capped, capped, np.sqrt(2.0 * distance * slowness)), 0.0)


def time_bounds(problem: Problem, motions: list[Spline]) -> Float[np.ndarray, "n"]:
    """Lower bounds of the time of all motions with the same ends."""
    problem = bounding_problem(problem)
    return np.array([(1.0 - SAFE) * _time_bound(problem, motion) for motion in motions])


def _time_bound(problem: Problem, motion: Spline) -> float:
    robot, limits = problem.robot, problem.limits
    positions, lengths = map(np.asarray, _ends(robot, common_shape(motion)))
    displacement = positions[1] - positions[0]
    bounds = [_of_mass_centre(problem, displacement)]
    speed, rise = (
        np.inf if maximum is None else np.asarray(maximum)
        for maximum in (limits.cable_speed_max, limits.cable_acceleration_max)
    )
    paid = np.abs(lengths[1] - lengths[0])
    bounds.append(float(np.max(least_time(paid, rise, rise, speed))))
    return max(bounds)


@persistent_jit
def _ends(robot: AnyRobot, motion: Spline) -> tuple[Array, Array]:
    # Return positions (2, 3) and cable lengths (2, n_cables) at the start and the end of a motion.
    states = jax.vmap(motion.state)(jnp.array([0.0, 1.0]))
    return states.position, jax.vmap(lambda state: cable_motion(robot, state)[0])(states)


def _of_mass_centre(problem: Problem, displacement: np.ndarray) -> float:
    robot, limits = problem.robot, problem.limits
    level = np.linalg.norm(displacement[:2])
    # Directions in the vertical plane of the displacement, by their horizontal and downward components.
    directions = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
    along = directions @ np.array([level, displacement[2]])
    directions = directions * np.where(along < 0.0, -1.0, 1.0)[:, None]
    cable_acceleration = float(np.sum(np.asarray(tension_range(robot, limits)[1]))) / float(robot.mass)
    maximum = np.inf if limits.acceleration_max is None else float(limits.acceleration_max)
    heights, is_point = np.asarray(robot.base_points)[:, 2], not isinstance(robot, PlatformRobot)
    is_level = float(np.ptp(heights)) <= LEVEL * float(spool_radius(robot)) and robot.pulleys is None
    are_upward = is_point and is_level and pose_conditions(robot)[1]

    def largest(down: np.ndarray) -> np.ndarray:
        fraction = np.sqrt(np.clip(1.0 - np.maximum(down, 0.0) ** 2, 0.0, 1.0)) if are_upward else np.ones_like(down)
        return np.clip(
            np.minimum(fraction + SLANTED, 1.0) * cable_acceleration + float(robot.gravity) * down, 0.0, maximum
        )

    speed = np.inf if limits.speed_max is None else float(limits.speed_max)
    with np.errstate(divide="ignore"):  # division by zero where nothing moves
        return float(np.max(least_time(np.abs(along), largest(directions[:, 1]), largest(-directions[:, 1]), speed)))
