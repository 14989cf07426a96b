"""Accessible orientations of a platform at a position, thesis section 3.10.2, by three definitions.

"grid": multiples of the step of tilt and torsion that chains of neighbours connect with the reference orientation.
"scan": Bonev's scan as in the thesis, along rays from a moving centre. "equal-volume": like "grid", on cells of equal
volume of SO(3); only then is the number of orientations proportional to a volume.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from cspr_jax.families.platforms.orientations.orientation_steps import OrientationSteps
from cspr_jax.numerics.batches import in_threads
from cspr_jax.numerics.linear.rotations import cylindrical_frames, from_tilt_torsion
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.orientation_grids import OrientationGrid, equal_volume_grid, tilt_torsion_grid
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.runtime.stages import stage

DEFINITIONS = ("grid", "scan", "equal-volume")
# Number of steps along a ray tried at a time: few rays are longer, and with the usual number of rays these steps fill
# three batches of `OrientationSteps`.
RAY_STEPS = 23
SO3_VOLUME = 8.0 * math.pi**2  # volume of SO(3), in the measure sin(theta) d phi d theta d sigma


class Accessible(NamedTuple):
    """Accessible orientations at one position.

    Fields:
        angles: (n, 3) tilt and torsion in the cylindrical frame of the position, rad.
        volume: (n,) fraction of SO(3) that each orientation represents.
        of_points: fraction of all grid points that are accessible; NaN for a scan, which has no grid.
    """

    angles: np.ndarray
    volume: np.ndarray
    of_points: float


@functools.lru_cache(maxsize=8)
def _grid(definition: str, divisions: int) -> OrientationGrid:
    return (tilt_torsion_grid if definition == "grid" else equal_volume_grid)(divisions)


def accessible(robot: PlatformRobot, position: Float[np.ndarray, "3"], definition: str, divisions: int) -> Accessible:
    """The accessible orientations at a position."""
    stage("accessible orientations")
    steps = OrientationSteps(robot, position)
    towards = cylindrical_frames(np.asarray(position, float))
    if definition == "scan":
        parts = list(_scan(steps, towards, divisions))
        angles, volume = (np.concatenate(x) for x in zip(*parts, strict=True))
        return Accessible(angles, volume, np.nan)
    grid = _grid(definition, divisions)
    samples = steps.at(from_tilt_torsion(grid.angles + towards))
    first, last = grid.neighbours[steps.passable(samples, *grid.neighbours.T)].T
    count = len(grid.angles)
    links = coo_matrix((np.ones(len(first), bool), (first, last)), shape=(count, count))
    part = connected_components(links, directed=False)[1]
    inside = (part == part[grid.start]) & steps.regular(samples)
    return Accessible(grid.angles[inside], grid.volume[inside], float(inside.mean()))


def accessible_sets(robot: PlatformRobot, grids: Sequence[tuple[np.ndarray, int]], definition: str) -> list[Accessible]:
    """The accessible orientations at many positions, by two threads."""
    return in_threads(lambda grid: accessible(robot, grid[0], definition, grid[1]), grids)


def _scan(steps: OrientationSteps, towards: np.ndarray, divisions: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    # Scan sections of constant torsion upwards and downwards from 0; each starts at the centre of the previous section.
    step = math.pi / divisions
    part, first = _section(steps, towards, np.zeros(2), 0.0, divisions)
    yield part
    for sign in (1.0, -1.0):
        centre = first
        for k in range(1, divisions + 1):
            torsion = sign * k * step
            there = _angles(np.stack([centre, centre]), np.array([torsion - sign * step, torsion]))
            samples = steps.at(from_tilt_torsion(there + towards))
            if not steps.passable(samples, np.array([0]), np.array([1]))[0]:
                break
            part, centre = _section(steps, towards, centre, torsion, divisions)
            yield part


def _section(
    steps: OrientationSteps, towards: np.ndarray, centre: np.ndarray, torsion: float, divisions: int
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    # Follow rays in the polar plane (theta cos phi, theta sin phi) up to the first impossible step.
    step, count = math.pi / divisions, 2 * divisions
    azimuth = np.arange(count) * step
    rays = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    far = np.arange(count + 1) * step
    made, going = np.zeros(count, int), np.arange(count)
    for start in range(0, count, RAY_STEPS):
        radii = far[start : start + RAY_STEPS + 1]
        free = _free(steps, towards, _angles(centre + radii[:, None] * rays[going, None], np.asarray(torsion)))
        made[going] += free.sum(1)
        going = going[free.all(1)]
        if not len(going):
            break
    ends = centre + (made * step)[:, None] * rays
    ray, last = np.nonzero(np.arange(count) < made[:, None])
    reached = _angles(centre + far[last + 1, None] * rays[ray], np.asarray(torsion))
    # Each orientation represents a sector of the plane, where the measure is sin(theta) / theta.
    volume = far[last + 1] * np.sinc(reached[:, 1] / math.pi) * step**3 / SO3_VOLUME
    return (reached, volume), ends.mean(0)


def _free(steps: OrientationSteps, towards: np.ndarray, angles: np.ndarray) -> np.ndarray:
    # Take orientations along rays, (n, m + 1, 3); return the mask (n, m) of steps that are possible with all earlier
    # steps.
    samples = steps.at(from_tilt_torsion(angles.reshape(-1, 3) + towards))
    index = np.arange(angles[..., 0].size).reshape(len(angles), -1)
    free = steps.passable(samples, index[:, :-1].ravel(), index[:, 1:].ravel()).reshape(len(angles), -1)
    free &= angles[:, 1:, 1] < math.pi
    return np.cumprod(free, axis=1).astype(bool)


def _angles(points: np.ndarray, torsion: np.ndarray) -> np.ndarray:
    # Convert points of the polar plane, and the torsion, to angles of tilt and torsion.
    tilt = np.hypot(points[..., 0], points[..., 1])
    return np.stack([np.arctan2(points[..., 1], points[..., 0]), tilt, np.broadcast_to(torsion, tilt.shape)], axis=-1)
