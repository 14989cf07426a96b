"""Smallest numbers of arcs between poses, for all pairs of values of beta-hat at both ends."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.feasibility.pose_checks import TOLERANCE, PoseChecker
from cspr_jax.feasibility.verdicts import Verdict
from cspr_jax.maps.bends import BEYOND
from cspr_jax.platforms import PlatformRobot
from cspr_jax.trajectories.pose_segment import PoseSegment, pose_segment

# Instants of the first look: late ones first, since there most motions fail; then so many an arc.
LATE = np.linspace(0.7, 1.0, 32)
COARSE = 12


class Ends(NamedTuple):
    """Both ends of a segment.

    Fields:
        start: position (3,) and quaternion (4,).
        end: likewise.
        start_bends: values of beta-hat to try at the start.
        end_bends: at the end.
    """

    start: tuple[np.ndarray, np.ndarray]
    end: tuple[np.ndarray, np.ndarray]
    start_bends: np.ndarray
    end_bends: np.ndarray


class Found(NamedTuple):
    """Smallest numbers of arcs for every pair of values of beta-hat.

    Fields:
        arcs: 0 where none passes all tests.
        doubtful: whether a smaller number, or any where there is none, stayed undecided.
    """

    arcs: np.ndarray
    doubtful: np.ndarray


@jax.jit
def _segments(robot: PlatformRobot, start, end, z0, bends, odd) -> PoseSegment:
    return jax.vmap(lambda a, b: pose_segment(robot, start, end, z0, (a, b), odd=odd))(*bends)


def segments_between(robot: PlatformRobot, ends: Ends, z0: float, arcs: int) -> PoseSegment:
    """The segments for every pair of values of beta-hat.

    Args:
        robot: the robot.
        ends: both ends.
        z0: m.
        arcs: their number.

    Returns:
        leaves (n_start_bends * n_end_bends, ...), the end's values fastest.
    """
    pairs = np.meshgrid(ends.start_bends, ends.end_bends, indexing="ij")
    bends = tuple(jnp.asarray(x.ravel()) for x in pairs)
    found = _segments(robot, ends.start, ends.end, jnp.asarray(z0), bends, jnp.asarray(arcs % 2 == 1))
    return jax.tree.map(np.asarray, found)


def smallest_arcs(checker: PoseChecker, ends: Ends, z0: float, *, max_arcs: int, fixed: int = 0) -> Found:
    """The smallest number of arcs that passes all tests, for every pair of values of beta-hat.

    A few instants refuse most motions before they are checked in full. Some arcs beyond the first number that
    any pair allows are tried, no more.

    Args:
        checker: of the robot.
        ends: both ends.
        z0: m.
        max_arcs: largest number tried.
        fixed: a fixed number of arcs; 0: free.

    Returns:
        what was found, (n_start_bends, n_end_bends) each.
    """
    count = len(ends.start_bends) * len(ends.end_bends)
    found, doubtful, last = np.zeros(count, int), np.zeros(count, bool), max_arcs
    for arcs in [fixed] if fixed else range(1, max_arcs + 1):
        if arcs > last:
            break
        segments = segments_between(checker.shared.robot, ends, z0, arcs)
        open_ones = np.flatnonzero(found == 0)
        for tau in (LATE, np.linspace(0.0, 1.0, COARSE * arcs + 1)):
            if len(open_ones):
                open_ones = open_ones[checker.first_look(_rows(segments, open_ones), arcs, tau) > -TOLERANCE]
        if not len(open_ones):
            continue
        verdict = checker.check(_rows(segments, open_ones), np.full(len(open_ones), arcs)).verdict
        passed = verdict == 0
        found[open_ones[passed]] = arcs
        doubtful[open_ones[verdict == Verdict.UNDECIDED]] = True
        if passed.any():
            last = min(last, arcs + BEYOND)
    shape = len(ends.start_bends), len(ends.end_bends)
    return Found(found.reshape(shape), doubtful.reshape(shape))


def _rows(segments: PoseSegment, rows: np.ndarray) -> PoseSegment:
    return jax.tree.map(lambda x: x[rows], segments)


def best_candidate(checker: PoseChecker, ends: Ends, z0: float, *, max_arcs: int) -> int:
    """The number of arcs with the largest smallest slack, where none is feasible.

    Args:
        checker: of the robot.
        ends: both ends, with one value of beta-hat each.
        z0: m.
        max_arcs: largest number tried.

    Returns:
        the number.
    """
    slack = [
        checker.first_look(
            segments_between(checker.shared.robot, ends, z0, arcs),
            arcs,
            np.linspace(0.0, 1.0, COARSE * arcs + 1),
        )[0]
        for arcs in range(1, max_arcs + 1)
    ]
    return int(np.argmax(slack)) + 1
