"""Clearance of robots at rest among obstacles, for maps of workspaces. Arrays in, answers out."""

from typing import get_args

import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.clearance import Clearances, Kind, Scene, clearances
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.workspaces import geometry

BATCH = 4096
# Numbers of `schema.meanings.NEAREST_BODIES`; a pose with no body that could be met takes 0.
KINDS = dict(zip(get_args(Kind), range(1, 5), strict=True))


def at_rest(robot: AnyRobot, around: Scene, positions: np.ndarray, quaternions: np.ndarray) -> Clearances:
    """Clearances of poses.

    Args:
        robot: centred, z down.
        around: of `build.surroundings`.
        positions: (n, 3) of the mass centre, or of the joint, m.
        quaternions: (n, 4) unit quaternions, scalar first.

    Returns:
        the clearances.
    """
    body_quaternions, ends = quaternions if PATTERNS[robot.pattern].is_body else None, None
    pulleys = robot.pulleys
    if pulleys is not None:
        ends = in_batches(lambda x: geometry.exit_points(robot, pulleys, *x), (positions, quaternions), size=BATCH)
    return clearances(around, positions, body_quaternions, ends=ends)


def flags(distances: Clearances) -> np.ndarray:
    """Flags of the reasons why poses are not free of interference.

    Args:
        distances: of `at_rest`.

    Returns:
        (n,) flags of `Verdict`.
    """
    verdict = np.zeros(len(distances.clearance), FLAGS)
    for values, flag in (
        (distances.cables, Verdict.CABLE_CABLE),
        (distances.obstacles, Verdict.OBSTACLE),
        (distances.platform, Verdict.CABLE_PLATFORM),
    ):
        # NaN compares as false: such poses stay open.
        verdict |= np.where(values <= 0.0, flag, 0).astype(FLAGS)
    return np.where(distances.is_open, Verdict.UNDECIDED, verdict).astype(FLAGS)


def nearest_bodies(around: Scene, distances: Clearances) -> np.ndarray:
    """Kind of the nearest bodies at each pose.

    Args:
        around: of `build.surroundings`.
        distances: of `at_rest`.

    Returns:
        (n,) numbers of `schema.meanings.NEAREST_BODIES`.
    """
    numbers = np.array([*(KINDS[meeting.kind] for meeting in around.meetings), 0], np.int16)
    return numbers[distances.nearest]
