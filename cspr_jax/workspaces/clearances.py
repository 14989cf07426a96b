"""Clearance of robots at rest among obstacles, for maps of workspaces. Arrays in, answers out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

import numpy as np

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import unit_vectors
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Clearances, Kind, Scene, clearances
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.workspaces.poses import geometry

BATCH = 4096
# Step of finite differences, over the extent of the robot.
STEP = 1e-7
# Numbers of `schema.meanings.NEAREST_BODIES`; 0 for a pose where no bodies can meet.
KINDS = dict(zip(get_args(Kind), range(1, 5), strict=True))


def at_rest(
    robot: AnyRobot,
    around: Scene,
    positions: Float[np.ndarray, "n 3"],
    quaternions: Float[np.ndarray, "n 4"],
    exits: Float[np.ndarray, "n n_cables 3"] | None = None,
) -> Clearances:
    """Clearances of poses."""
    body_quaternions, pulleys = quaternions if PATTERNS[robot.pattern].is_body else None, robot.pulleys
    if exits is None and pulleys is not None:
        exits = in_batches(
            lambda x: geometry.exit_points(robot, pulleys, *x), (positions, quaternions), batch_size=BATCH
        )
    return clearances(around, positions, body_quaternions, ends=exits)


def nearer_exits(
    robot: AnyRobot,
    around: Scene,
    positions: np.ndarray,
    quaternions: np.ndarray,
    exits: Float[np.ndarray, "n n_cables 3"],
    distance: float,
) -> Iterator[np.ndarray]:
    """Exits with the displacements that, to first order, reduce clearances most."""
    step = STEP * float(np.ptp(exits, axis=(0, 1)).max())

    def at(exits: np.ndarray) -> np.ndarray:
        distances = at_rest(robot, around, positions, quaternions, exits)
        return np.stack([distances.cables, distances.obstacles, distances.platform])

    middle, gradients = at(exits), np.zeros((3, *exits.shape))
    for i, k in np.ndindex(exits.shape[1:]):
        moved = exits.copy()
        moved[:, i, k] += step
        with np.errstate(invalid="ignore"):  # infinite where nothing can meet
            gradients[:, :, i, k] = np.nan_to_num(at(moved) - middle, posinf=0.0, neginf=0.0)
    yield from exits - distance * unit_vectors(gradients)


def flags(distances: Clearances) -> Int[np.ndarray, "n"]:
    """Flags of the reasons why poses are not free of interference."""
    verdict = np.zeros(len(distances.clearance), FLAGS)
    for values, flag in (
        (distances.cables, Verdict.CABLE_CABLE),
        (distances.obstacles, Verdict.OBSTACLE),
        (distances.platform, Verdict.CABLE_PLATFORM),
    ):
        # Comparisons with NaN are false, so that such poses stay open.
        verdict |= np.where(values <= 0.0, flag, 0).astype(FLAGS)
    return np.where(distances.is_open, Verdict.UNDECIDED, verdict).astype(FLAGS)


def nearest_bodies(around: Scene, distances: Clearances) -> Int[np.ndarray, "n"]:
    """Kind of the nearest bodies at each pose."""
    numbers = np.array([*(KINDS[meeting.kind] for meeting in around.contact_pairs), 0], np.int16)
    return numbers[distances.nearest]
