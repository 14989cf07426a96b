"""Which accessible orientations of a place a horizontal transition from rest attains, thesis section 3.12.3."""

import numpy as np

from cspr_jax.feasibility.endpoints import AT_REST
from cspr_jax.feasibility.pose_checks import PoseChecker
from cspr_jax.maps.minimum_pose_arcs import CANDIDATES, Candidates
from cspr_jax.maps.pose_answers import PoseAnswers, joined, reached
from cspr_jax.maps.pose_ends import end_options
from cspr_jax.rotations import from_tilt_torsion

# Values of beta-hat tried at the target.
VALUES = 20


def attainable(
    checker: PoseChecker,
    places: np.ndarray,
    angles: np.ndarray,
    z0: np.ndarray,
    *,
    max_arcs: int,
    values: int = VALUES,
) -> PoseAnswers:
    """Smallest numbers of arcs from rest to orientations of places.

    Args:
        checker: of motions from rest.
        places: (n, 3) m.
        angles: (n, 3) tilt and torsion in the cylindrical frame of each place, rad; n >= 1.
        z0: (n,) m.
        max_arcs: largest number tried.
        values: of beta-hat, the preferred one first.

    Returns:
        the answers.
    """
    size = CANDIDATES // values
    parts = [slice(i, i + size) for i in range(0, len(z0), size)]
    return joined([_part(checker, places[k], angles[k], z0[k], max_arcs, values) for k in parts])


def _part(
    checker: PoseChecker, places: np.ndarray, angles: np.ndarray, z0: np.ndarray, max_arcs: int, values: int
) -> PoseAnswers:
    robot, count = checker.shared.robot, len(angles)
    centre = np.asarray(robot.base_points).mean(0)
    towards = np.arctan2(*(places - centre).T[1::-1])  # (3.98)
    ends = (places, from_tilt_torsion(angles + towards[:, None] * np.array([1.0, 0.0, 0.0])))
    bends, can_end = end_options(robot, *ends, z0, values)
    hub = centre + z0[:, None] * np.array([0.0, 0.0, 1.0])
    start = (hub, np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)))
    rest = np.full(count, AT_REST)
    motions = Candidates(start, ends, z0, np.arange(count), (rest, rest))
    return reached(checker, motions, np.where(can_end[:, None], bends, np.nan), max_arcs=max_arcs)
