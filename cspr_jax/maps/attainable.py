"""Which accessible orientations of a place a horizontal transition from rest attains, thesis section 3.12.3."""

import numpy as np

from cspr_jax.feasibility.endpoints import AT_REST
from cspr_jax.feasibility.pose_checks import PoseChecker
from cspr_jax.maps.answers import in_parts
from cspr_jax.maps.minimum_pose_arcs import CANDIDATES, Candidates
from cspr_jax.maps.pose_answers import PoseAnswers, reached
from cspr_jax.maps.pose_ends import end_options
from cspr_jax.rotations import from_tilt_torsion
from cspr_jax.symmetries import NONE, Symmetries, alike

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
    found: Symmetries = NONE,
) -> PoseAnswers:
    """Smallest numbers of arcs from rest to orientations of places.

    Args:
        checker: of motions from rest.
        places: (n, 3) m.
        angles: (n, 3) tilt and torsion in the cylindrical frame of each place, rad; n >= 1.
        z0: (n,) m.
        max_arcs: largest number tried.
        values: of beta-hat, the preferred one first.
        found: symmetries of the robot; orientations that they join are computed once.

    Returns:
        the answers.
    """
    centre = np.asarray(checker.shared.robot.base_points).mean(0)
    some, own = np.unique(alike(found, np.c_[places - centre, z0], angles), return_inverse=True)

    def part(which):
        which = some[which]
        return _part(checker, centre, places[which], angles[which], z0[which], max_arcs, values)

    return in_parts(part, len(some), CANDIDATES // values).rows(own.ravel())


def _part(
    checker: PoseChecker,
    centre: np.ndarray,
    places: np.ndarray,
    angles: np.ndarray,
    z0: np.ndarray,
    max_arcs: int,
    values: int,
) -> PoseAnswers:
    robot, count = checker.shared.robot, len(angles)
    towards = np.arctan2(*(places - centre).T[1::-1])  # (3.98)
    ends = (places, from_tilt_torsion(angles + towards[:, None] * np.array([1.0, 0.0, 0.0])))
    bends, can_end = end_options(robot, *ends, z0, values)
    hub = centre + z0[:, None] * np.array([0.0, 0.0, 1.0])
    start = (hub, np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)))
    rest = np.full(count, AT_REST)
    motions = Candidates(start, ends, z0, np.arange(count), (rest, rest))
    return reached(checker, motions, np.where(can_end[:, None], bends, np.nan), max_arcs=max_arcs)
