"""What a segment asks of the robot: tensions, heights, cable lengths and speeds, at their extremes."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from cspr_jax.feasibility.point_mass.blocks import INTERVALS, blocks
from cspr_jax.feasibility.point_mass.margins import Functions, smallest_values
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots import force_balance
from cspr_jax.runtime.stages import stage
from cspr_jax.trajectories import hypocycloid
from cspr_jax.trajectories.hypocycloid import Segment

# Plans have few segments, but may ask for a million samples of each.
BATCH = 16


@dataclasses.dataclass(frozen=True)
class Extremes:
    """What a segment asks of the robot, refined between samples; (n,) each.

    Fields:
        tension_min: N.
        tension_max: N.
        mu_min: smallest tension per mass and length, 1/s^2.
        depth_ratio_min: depth below the spools over z0.
        lowest: largest z, z down, m.
        length_max: m.
        speed_max: of a cable, m/s.
        acceleration_max: of a cable, m/s^2.
        samples: number of instants looked at.
    """

    tension_min: np.ndarray
    tension_max: np.ndarray
    mu_min: np.ndarray
    depth_ratio_min: np.ndarray
    lowest: np.ndarray
    length_max: np.ndarray
    speed_max: np.ndarray
    acceleration_max: np.ndarray
    samples: np.ndarray


# Largest values are smallest ones of the negative.
SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0])


def _demands(robot, limits, amplitude, segment, arcs, tau):
    # Smooth functions of one instant, in the order of `Extremes`.
    del limits
    position, velocity, acceleration = hypocycloid.motion(segment, amplitude, arcs, tau)
    force = force_balance.tensions(robot, position, acceleration)
    length, rate, rate_slope = force_balance.cable_motion(robot, position, velocity, acceleration)
    depth = 1.0 + segment.tilt @ (segment.plane.T @ (position - segment.hub))
    heights = jnp.stack([depth, -position[2]])
    every = (force, -force, force / length / robot.mass, heights, -length, rate, -rate, rate_slope, -rate_slope)
    return tuple(jnp.concatenate(every))


def _groups(n_cables: int) -> tuple[int, ...]:
    return (n_cables, n_cables, n_cables, 1, 1, n_cables, 2 * n_cables, 2 * n_cables)


def extremes(problem: Problem, segments: Segment, arcs: np.ndarray, least_samples: int) -> Extremes:
    """What segments ask of the robot: at least 64 samples an arc, refined where a value is extreme.

    Args:
        problem: robot, limits and amplitude.
        segments: leaves (n, ...), of the parity of `arcs`.
        arcs: (n,).
        least_samples: smallest number of samples of a segment.

    Returns:
        the extremes.
    """
    stage("extremes along the motion")
    table = blocks(problem.amplitude, int(arcs.max()), density=4, least=-(-least_samples // INTERVALS))
    functions = Functions(_demands, _groups(len(problem.robot.base_points)))
    found = smallest_values(functions, problem, segments, arcs, table, batch=BATCH)
    columns = (found * SIGNS + 0.0).T  # no -0
    names = [field.name for field in dataclasses.fields(Extremes)][:-1]
    return Extremes(**dict(zip(names, columns, strict=True)), samples=table[1][arcs] * INTERVALS + 1)
