"""What is said of motions between poses, once their numbers of arcs are known."""

import dataclasses
import math

import numpy as np

from cspr_jax.feasibility.pose_checks import PoseChecker, rows
from cspr_jax.feasibility.verdicts import Verdict
from cspr_jax.maps.answers import Answers
from cspr_jax.maps.minimum_pose_arcs import Candidates, Found, segments_with


@dataclasses.dataclass(frozen=True)
class PoseAnswers(Answers):
    """One answer a segment between poses.

    Fields:
        beta_hat: (n, 2) at both ends.
        det_margin: (n,) smallest determinant over its value at rest in P0.
        cable_distance: (n,) smallest distance between cables that can meet, m.
    """

    beta_hat: np.ndarray
    det_margin: np.ndarray
    cable_distance: np.ndarray


def settled(checker: PoseChecker, candidates: Candidates, found: Found, tried: np.ndarray) -> PoseAnswers:
    """Answers with all margins.

    Args:
        checker: of the robot.
        candidates: n motions.
        found: of these; its checks are completed.
        tried: (n,) the numbers of arcs found, else those of the best candidates.

    Returns:
        the answers; nothing is proved, and (2.55) does not apply: NaN.
    """
    segments, checks = segments_with(checker.shared.robot, candidates, tried), found.checks
    others = np.flatnonzero(found.arcs == 0)
    checks.put(others, checker.check(rows(segments, others), tried[others]))
    duration = checker.durations(segments, tried)
    bends = np.stack(candidates.bends, axis=1)
    if checker.kind.plain:  # (3.66) has the one that its cosine has
        bends = np.tile(-((math.pi * tried / duration) ** 2 / segments.rate)[:, None], 2)
    doubtful = (found.undecided > 0) & ((found.arcs == 0) | (found.undecided < found.arcs))
    none = np.where(doubtful, Verdict.UNDECIDED.value, checks.verdict | Verdict.NO_ARCS.value)
    less = np.where(doubtful, Verdict.FEWER_ARCS_UNDECIDED.value, 0)
    nothing = np.full(len(tried), np.nan)
    return PoseAnswers(
        arcs=found.arcs,
        tried_arcs=tried,
        verdict=np.where(found.arcs > 0, less, none).astype(np.uint16),
        duration=duration,
        margin=np.minimum(checks.slack[:, 0], checks.slack[:, 2]),
        margin_bound=nothing,
        limit_margin=checks.slack[:, 3:].min(1, initial=np.inf),
        feasible_at_infinity=nothing,
        beta_hat=bends,
        det_margin=checks.slack[:, 1],
        cable_distance=checks.gap,
    )
