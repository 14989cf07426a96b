"""Smallest numbers of arcs between many pairs of poses, over values of beta-hat at their ends."""

from functools import partial
from typing import NamedTuple

import jax
import numpy as np

from cspr_jax.feasibility.pose_checks import TOLERANCE, PoseChecker, PoseChecks, rows
from cspr_jax.feasibility.verdicts import Verdict
from cspr_jax.grids import in_batches
from cspr_jax.platforms import PlatformRobot
from cspr_jax.trajectories.pose_segment import PoseSegment, pose_segment

BATCH = 2048
# So many candidates are held at a time.
CANDIDATES = 131_072
# Instants of the first look: in arcs before the end, those at which most motions fail, the most telling ones first;
# then so many an arc, late ones first; and so many where only the best of bad candidates is looked for.
TELLING = np.array([1, 2, 25, 11, 16, 5, 13, 17, 8, 4, 10, 48, 27, 6, 24, 49]) / 16.0
COARSE, COARSEST = 12, 4


class Candidates(NamedTuple):
    """Motions whose smallest number of arcs is asked for; those of one group are alternatives.

    Fields:
        start: position (n, 3) m and quaternion (n, 4).
        end: likewise.
        z0: (n,) m.
        bends: beta-hat at the start (n,) and at the end (n,).
        group: (n,) from 0 on, in any order; within a group those tried first come first.
    """

    start: tuple[np.ndarray, np.ndarray]
    end: tuple[np.ndarray, np.ndarray]
    z0: np.ndarray
    bends: tuple[np.ndarray, np.ndarray]
    group: np.ndarray

    def rows(self, which: np.ndarray) -> "Candidates":
        """Some of them: indices, or (n,) a mask."""
        return jax.tree.map(lambda x: x[which], self)


class Found(NamedTuple):
    """Smallest numbers of arcs.

    Fields:
        arcs: (n,) 0 where none passes all tests, or none was asked for any more; several of a group may have one.
        undecided: (n,) the smallest number that stayed undecided; 0: none did.
        checks: of the motions with `arcs`; all else is to be ignored.
    """

    arcs: np.ndarray
    undecided: np.ndarray
    checks: PoseChecks


@jax.jit
def _segments(robot: PlatformRobot, odd, candidates: Candidates) -> PoseSegment:
    def one(start, end, z0, bends):
        return pose_segment(robot, start, end, z0, bends, odd=odd)

    return jax.vmap(one)(*candidates[:-1])


def segments_of(robot: PlatformRobot, candidates: Candidates, arcs: int) -> PoseSegment:
    """The segments for a number of arcs.

    Args:
        robot: the robot.
        candidates: n motions.
        arcs: their number.

    Returns:
        leaves (n, ...).
    """
    return in_batches(partial(_segments, robot, np.asarray(arcs % 2 == 1)), candidates, size=BATCH)


def smallest_arcs(
    checker: PoseChecker, candidates: Candidates, *, max_arcs: int, fixed: np.ndarray | None = None, beyond: int = -1
) -> Found:
    """The smallest number of arcs that passes all tests.

    A few instants refute most motions before they are checked in full.

    Args:
        checker: of the robot.
        candidates: n motions in groups.
        max_arcs: largest number tried.
        fixed: (n_groups,) a fixed number of arcs, 0 where free; None: all free.
        beyond: how many arcs beyond the smallest one of a group are tried for its others; -1: the first motion of a
            group that passes is enough.

    Returns:
        what was found.
    """
    group = candidates.group
    found, undecided, checks = np.zeros(len(group), int), np.zeros(len(group), int), checker.nothing(len(group))
    last = np.full(int(group.max(initial=-1)) + 1, max_arcs)
    only = np.zeros(len(last), int) if fixed is None else fixed
    # Both parities, of those still open when half of them had been closed.
    kept, parities = np.arange(len(group)), {k: segments_of(checker.shared.robot, candidates, k) for k in (0, 1)}
    for arcs in range(1, max_arcs + 1):
        if not (last >= arcs).any():
            break
        is_open = (found[kept] == 0) & (last[group[kept]] >= arcs)
        if is_open.sum() < 0.5 * len(kept):
            kept, parities = kept[is_open], {k: rows(x, is_open) for k, x in parities.items()}
            is_open = np.ones(len(kept), bool)
        is_open &= (only[group[kept]] == 0) | (only[group[kept]] == arcs)
        segments = parities[arcs % 2]
        alive = _sieved(checker, segments, arcs, np.flatnonzero(is_open))
        first = np.unique(group[kept[alive]], return_index=True)[1] if beyond < 0 else slice(None)
        # The first motion of each group, then all others of groups where it fails: few and large batches.
        for turn in (alive[first], np.delete(alive, first)):
            turn = turn[last[group[kept[turn]]] >= arcs]
            got = checker.check(rows(segments, turn), np.full(len(turn), arcs), whole=False)
            verdict = got.verdict
            checks.put(kept[turn], got)
            passed = kept[turn[verdict == 0]]
            found[passed] = arcs
            unsure = kept[turn[verdict == Verdict.UNDECIDED]]
            undecided[unsure] = np.where(undecided[unsure] > 0, undecided[unsure], arcs)
            last[group[passed]] = np.minimum(last[group[passed]], arcs + beyond)
    return Found(found, undecided, checks)


def _sieved(checker: PoseChecker, segments: PoseSegment, arcs: int, alive: np.ndarray) -> np.ndarray:
    for tau in (np.maximum(1.0 - TELLING / arcs, 0.0), np.linspace(1.0, 0.0, COARSE * arcs + 1)):
        if len(alive):
            some = segments if len(alive) == len(segments.rate) else rows(segments, alive)
            alive = alive[checker.first_look(some, arcs, tau) > -TOLERANCE]
    return alive


def best_candidates(checker: PoseChecker, candidates: Candidates, *, max_arcs: int) -> np.ndarray:
    """The number of arcs with the largest smallest tension over some samples, where none is feasible.

    Args:
        checker: of the robot.
        candidates: n motions.
        max_arcs: largest number tried.

    Returns:
        (n,).
    """
    best, highest = np.ones(len(candidates.z0), int), np.full(len(candidates.z0), -np.inf)
    if not len(best):
        return best
    parities = {k: segments_of(checker.shared.robot, candidates, k) for k in (0, 1)}
    for arcs in range(1, max_arcs + 1):
        tau = np.linspace(0.0, 1.0, COARSEST * arcs + 1)
        lowest = checker.first_look(parities[arcs % 2], arcs, tau, whole=True)
        best, highest = np.where(lowest > highest, arcs, best), np.maximum(lowest, highest)
    return best


def segments_with(robot: PlatformRobot, candidates: Candidates, arcs: np.ndarray) -> PoseSegment:
    """The segments for given numbers of arcs.

    Args:
        robot: the robot.
        candidates: n motions.
        arcs: (n,).

    Returns:
        leaves (n, ...), each of the parity of its number of arcs.
    """
    even, odd = (segments_of(robot, candidates, k) for k in (0, 1))
    return jax.tree.map(lambda a, b: np.where((arcs % 2 == 1).reshape(-1, *[1] * (a.ndim - 1)), b, a), even, odd)
