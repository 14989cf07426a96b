"""Which accessible orientations of a place a horizontal transition from rest attains, thesis section 3.12.3."""

import math

import numpy as np

from cspr_jax.feasibility.endpoints import AT_REST
from cspr_jax.feasibility.pose_checks import PoseChecker
from cspr_jax.maps.minimum_pose_arcs import Candidates
from cspr_jax.maps.pose_answers import PoseAnswers, reached
from cspr_jax.maps.pose_ends import end_options
from cspr_jax.orientations import quaternions

# Values of beta-hat tried at the target.
VALUES = 20


def attainable(
    checker: PoseChecker, place: np.ndarray, angles: np.ndarray, z0: float, *, max_arcs: int, values: int = VALUES
) -> PoseAnswers:
    """Smallest numbers of arcs from rest to orientations of one place.

    Args:
        checker: of motions from rest.
        place: (3,) m.
        angles: (n, 3) tilt and torsion in the cylindrical frame of the place, rad; n >= 1.
        z0: m.
        max_arcs: largest number tried.
        values: of beta-hat, the preferred one first.

    Returns:
        the answers.
    """
    robot, count = checker.shared.robot, len(angles)
    centre = np.asarray(robot.base_points).mean(0)
    towards = np.array([math.atan2(*(place - centre)[1::-1]), 0.0, 0.0])
    places, depths = np.tile(np.asarray(place, float), (count, 1)), np.full(count, float(z0))
    ends = (places, quaternions(angles + towards))
    bends, can_end = end_options(robot, *ends, depths, values)
    hub = np.tile(centre + np.array([0.0, 0.0, z0]), (count, 1))
    start = (hub, np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)))
    rest = np.full(count, AT_REST)
    motions = Candidates(start, ends, depths, (rest, rest), np.arange(count))
    return reached(checker, motions, np.where(can_end[:, None], bends, np.nan), max_arcs=max_arcs)
