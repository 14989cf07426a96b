"""Cables at poses of a platform at rest, and on steps between neighbouring poses, thesis section 3.10.2.

On more than six cables the wrench matrix has no determinant whose sign could change along a path: a pose is regular if
the rank is full, on either side of the spools, and cables can touch the platform only if its attachment points lie in a
plane.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import solved
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.linear.lanes import materialized, rotation_matrix
from cspr_jax.numerics.shapes import Bool, Float, Int
from cspr_jax.robots.cables import wrench_units
from cspr_jax.robots.contacts import interference_lanes
from cspr_jax.robots.contacts.contact_bodies import default_scene, has_sectors
from cspr_jax.robots.contacts.interference import Contacts, cables_cross, contacts, platform_hit
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.statics import wrench_lanes
from cspr_jax.robots.statics.wrench_balance import at_rest, determinant_ratio, is_regular, normalised_determinant
from cspr_jax.robots.statics.wrench_lanes import cable_lanes

BATCH = 512
# Distances between cables below this fraction of the platform's radius count as zero. A cable at a smaller angle to
# the platform lies in it, and counts as on the same side as in the reference orientation.
TOUCHING = 1e-9
# Number of steps between neighbours in memory at a time.
STEPS = 65536


class OrientationSamples(NamedTuple):
    """Determinants, and vectors of cables, of n poses.

    Fields:
        fraction: (n,) determinant over that of the reference orientation at the same position; NaN if the reference
            orientation itself is singular, or the position is not below the spools. On more than six cables, the root
            of the determinant of the matrix times its transpose.
        gaps: (n, n_pairs, 3) shortest vectors between cables, m.
        cable_directions: (n, n_cables, 3) vectors of the cables in platform axes, m.
    """

    fraction: np.ndarray
    gaps: np.ndarray
    cable_directions: np.ndarray


@partial(jax.jit, static_argnames="pairs")
def _sampled(robot: PlatformRobot, poses: tuple[Array, Array], *, pairs: tuple) -> tuple[Array, Array, Array]:
    positions, quaternions = poses
    one = jnp.where(robot.mass > 0.0, 1.0, 2.0)
    rotation = materialized(rotation_matrix([quaternions[:, i] for i in range(4)]), one)
    cables = cable_lanes(robot, [positions[:, i] for i in range(3)], rotation)
    cables = cables._replace(rays=materialized(cables.rays, one))
    cable_gaps, directions = (
        interference_lanes.gaps(robot.base_points, pairs, cables),
        interference_lanes.cable_directions(cables, rotation),
    )
    is_determined = robot.n_cables == robot.dof
    determinant = (
        wrench_lanes.normalised_determinant(robot, cables) if is_determined else _volumes(robot, positions, quaternions)
    )
    return determinant, *interference_lanes.as_arrays(cable_gaps, directions)


def _volumes(robot: PlatformRobot, positions: Array, quaternions: Array) -> Array:
    def one(position: Array, quaternion: Array) -> Array:
        matrix = robot.wrench_matrix(at_rest(position, rotations.matrix(quaternion))) / wrench_units(robot)[:, None]
        return jnp.sqrt(jnp.maximum(solved(matrix @ matrix.T, jnp.zeros((robot.dof, 0)))[1], 0.0))

    return jax.vmap(one)(positions, quaternions)


def reference_determinant(robot: PlatformRobot, position: Float[np.ndarray, "3"]) -> float:
    """Determinant of the reference orientation at a position; NaN beyond a singularity, or not below the spools."""
    if robot.n_cables > robot.dof:
        return 1.0
    current, depth, fraction = _upright(robot, np.asarray(position, float))
    return float(current) if float(depth) > 0.0 and bool(is_regular(fraction)) else np.nan


@jax.jit
def _upright(robot: PlatformRobot, position: Array) -> tuple[Array, Array, Array]:
    upright = jnp.eye(3)
    fraction = determinant_ratio(robot, position, upright)
    return normalised_determinant(robot, position, upright), plane_normal(robot) @ position, fraction


class OrientationSteps:
    """Steps between orientations of a platform at one position.

    Args:
        robot: robot in its reference axes.
        position: (3,) position of the mass centre, m.
    """

    def __init__(self, robot: PlatformRobot, position: np.ndarray) -> None:
        """Find which cables can touch each other or the platform."""
        self._robot, self._position = robot, np.asarray(position, float)
        self._contacts: Contacts = contacts(robot)
        self._is_flat = robot.n_cables == robot.dof or has_sectors(robot, default_scene(robot))
        self._pairs = tuple((int(i), int(j)) for i, j in self._contacts.pairs)
        self._reference = reference_determinant(robot, self._position)
        self._radius = float(np.linalg.norm(np.asarray(robot.platform_points), axis=1).max())
        self._side = np.zeros(
            robot.n_cables
        )  # side of each cable in the reference orientation; 0 until it is computed below
        self._side = np.sign(self.at(np.array([IDENTITY])).cable_directions[0] @ self._contacts.normal)

    def at(self, quaternions: Float[np.ndarray, "n 4"]) -> OrientationSamples:
        """Determinants and vectors of cables for orientations."""
        positions = np.broadcast_to(self._position, (len(quaternions), 3))
        sampled = in_batches(
            partial(_sampled, self._robot, pairs=self._pairs), (positions, np.asarray(quaternions)), batch_size=BATCH
        )
        fraction, gaps, directions = sampled
        # The distance of cables that touch is a rounding error, whose direction has no meaning.
        gaps[_squares(gaps) < (TOUCHING * self._radius) ** 2] = 0.0
        # Neither has the sign of the height of cables that lie in the platform: put them all on one side.
        height, minimum = directions @ self._contacts.normal, TOUCHING * np.sqrt(_squares(directions))
        height = np.where(np.abs(height) < minimum, 2.0 * minimum * self._side - height, 0.0)
        return OrientationSamples(
            fraction / self._reference, gaps, directions + height[..., None] * self._contacts.normal
        )

    def regular(self, samples: OrientationSamples) -> Bool[np.ndarray, "n"]:
        """Orientations that are not beyond a singularity."""
        return is_regular(samples.fraction)

    def passable(
        self, samples: OrientationSamples, first: Int[np.ndarray, "n"], last: Int[np.ndarray, "n"]
    ) -> Bool[np.ndarray, "n"]:
        """Tell which steps from orientations to neighbouring ones are possible."""
        is_regular = self.regular(samples)
        open_steps = np.flatnonzero(is_regular[first] & is_regular[last])
        free = np.zeros(len(first), bool)
        for chunk in np.array_split(open_steps, max(1, -(-len(open_steps) // STEPS))):
            one, two = first[chunk], last[chunk]
            free[chunk] = ~cables_cross(samples.gaps[one], samples.gaps[two]).any(1)
            if self._is_flat:
                directions = samples.cable_directions[one], samples.cable_directions[two]
                free[chunk] &= ~platform_hit(self._contacts.sides, self._contacts.normal, *directions).any(1)
        return free


def _squares(vectors: np.ndarray) -> np.ndarray:
    # Return squared lengths of vectors; with only three components, a reduction along the last axis would be slow.
    return np.einsum("...k,...k->...", vectors, vectors)
