"""Smallest numbers of arcs between many pairs of poses, over values of beta-hat at their ends."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.families.platforms.motion_checker import MotionChecker, PlatformChecks
from cspr_jax.families.platforms.platform_segment import PlatformSegment, pose_segment, take_segments
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Bool, Float, Num
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.runtime.stages import stage
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.fewest_limits import FewestLimits, Refused

BATCH = 2048
# Number of candidates in memory at a time.
CANDIDATES = 262_144
# Times of the screen, in arcs before the end. The first ones are those at which most motions fail, in descending order
# of how many they refute; the others are those at which most remaining motions fail, and one beside the start, where
# the second derivative of the amplitude function may be largest. They were chosen one by one on motions of the MSSM
# with three amplitude functions; other times would also be correct, but slower.
FIRST_TIMES = np.array([1, 2, 25, 11, 16, 5, 13, 17, 8, 4, 10, 48, 27, 6, 24, 49]) / 16.0
OTHER_TIMES = np.array([338, 192, 260, 3, 74, 63, 32, 330, 1, 49, 134, 56, 436, 168, 8]) / 96.0
BESIDE_START = 6.0 / 96.0
# Number of samples per arc in the search for the best of infeasible candidates.
COARSEST = 4


class Candidates(NamedTuple):
    """Motions whose smallest numbers of arcs are searched for, with values of beta-hat to try.

    Fields:
        start: positions (m, 3), m, and quaternions (m, 4) of the motions.
        end: positions and quaternions likewise.
        z0: (m,) depth of P0, m.
        motion: (n,) index of the motion of each candidate, in any order; candidates of one motion are in the order in
            which they are tried.
        beta_hats: beta-hat at the start (n,) and at the end (n,).
    """

    start: tuple[np.ndarray, np.ndarray]
    end: tuple[np.ndarray, np.ndarray]
    z0: np.ndarray
    motion: np.ndarray
    beta_hats: tuple[np.ndarray, np.ndarray]

    def take(self, index: np.ndarray) -> "Candidates":
        """Candidates selected by indices, or by a mask (n,)."""
        return self._replace(motion=self.motion[index], beta_hats=(self.beta_hats[0][index], self.beta_hats[1][index]))

    def motions(self, index: np.ndarray) -> "Candidates":
        """Motions of one candidate each, selected by indices."""
        start, end, beta_hats = ((a[index], b[index]) for a, b in (self.start, self.end, self.beta_hats))
        return Candidates(start, end, self.z0[index], np.arange(len(index)), beta_hats)


class FewestArcs(NamedTuple):
    """Smallest numbers of arcs.

    Fields:
        arcs: (n,) smallest number; 0 where none passes all tests, or another candidate of the motion has one already;
            several candidates of a motion may have a number.
        undecided: (n,) smallest number that stayed undecided; 0 for none.
        checks: checks of the motions; valid only for candidates with a number of arcs.
    """

    arcs: np.ndarray
    undecided: np.ndarray
    checks: PlatformChecks


@persistent_jit
def _motions(robot: PlatformRobot, odd, motions) -> PlatformSegment:
    def one(start, end, z0):
        return pose_segment(robot, start, end, z0, (jnp.zeros_like(z0), jnp.zeros_like(z0)), odd=odd)

    return jax.vmap(one)(*motions)


class _Segments:
    # Segments of candidates. All but beta-hat is a property of the motion, and is computed once for each parity of the
    # number of arcs.

    def __init__(self, robot: PlatformRobot, candidates: Candidates) -> None:
        self._candidates = candidates
        self._of_motions = [
            in_batches(partial(_motions, robot, np.asarray(odd)), candidates[:3], batch_size=BATCH)
            for odd in (False, True)
        ]

    def __call__(self, arcs: int, indices: np.ndarray) -> PlatformSegment:
        # The indices (k,) are those of candidates.
        motion, (first, last) = self._candidates.motion[indices], self._candidates.beta_hats
        segments = take_segments(self._of_motions[arcs % 2], motion)
        return dataclasses.replace(
            segments, slerp=segments.slerp._replace(start_beta_hat=first[indices], end_beta_hat=last[indices])
        )


def smallest_arcs(
    checker: MotionChecker,
    candidates: Candidates,
    *,
    max_arcs: int,
    fixed: Num[np.ndarray, "m"] | None = None,
    beyond: int = -1,
    margins: bool = True,
) -> FewestArcs:
    """Smallest number of arcs that passes all tests, of each candidate.

    A few samples refute most motions before they are checked in full.
    """
    motion, count = candidates.motion, len(candidates.motion)
    smallest, undecided, checks = np.zeros(count, int), np.zeros(count, int), checker.nothing(count)
    if not count:
        return FewestArcs(smallest, undecided, checks)
    last = np.full(len(candidates.z0), max_arcs)
    only = np.zeros(len(last), int) if fixed is None else fixed
    segments = _Segments(checker.problem.robot, candidates)
    for arcs in range(1, max_arcs + 1):
        if not (last >= arcs).any():
            break
        stage(f"arcs {arcs} of {max_arcs}")
        is_open = (last >= arcs) & _is_tried(arcs, only)
        alive = np.flatnonzero((smallest == 0) & is_open[motion])
        alive = _screened(checker, segments, arcs, alive, _times_before_end(arcs, FIRST_TIMES))
        first = np.unique(motion[alive], return_index=True)[1] if beyond < 0 else slice(None)
        # Try first one candidate of each motion, then all others of motions where it fails: few and large batches.
        for group in (alive[first], np.delete(alive, first)):
            group = group[last[motion[group]] >= arcs]
            group = _screened(
                checker, segments, arcs, group, np.append(BESIDE_START / arcs, _times_before_end(arcs, OTHER_TIMES))
            )
            if not len(group):
                continue
            got = checker.check(segments(arcs, group), np.full(len(group), arcs), full=False, margins=margins)
            checks.put(group, got)
            passed, unsure = (group[got.verdict == verdict] for verdict in (0, Verdict.UNDECIDED))
            smallest[passed] = arcs
            undecided[unsure] = np.where(undecided[unsure] > 0, undecided[unsure], arcs)
            last[motion[passed]] = np.minimum(last[motion[passed]], arcs + beyond)
    return FewestArcs(smallest, undecided, checks)


def _is_tried(arcs: int, only: np.ndarray) -> np.ndarray:
    return np.where(only > 0, only == arcs, arcs >= -only)


def _times_before_end(arcs: int, before: np.ndarray) -> np.ndarray:
    # Return times this many arcs before the end; if the motion is shorter, the start, where nothing fails.
    return np.maximum(1.0 - before / arcs, 0.0)


def _screened(
    checker: MotionChecker,
    segments: _Segments,
    arcs: int,
    alive: np.ndarray,
    tau: np.ndarray,
    *,
    limits: bool = True,
) -> np.ndarray:
    # Keep the candidates that no sample refutes.
    if not len(alive):
        return alive
    return alive[~checker.screen.refuted(segments(arcs, alive), arcs, tau, limits=limits)]


def refused_by_limits(
    checker: MotionChecker, candidates: Candidates, *, max_arcs: int, fixed: np.ndarray | None = None
) -> Refused:
    """Smallest numbers of arcs at which only limits refuse candidates, for motions without a feasible candidate."""
    motion, count = candidates.motion, len(candidates.motion)
    fewest, is_limit = FewestLimits(count, checker.flags), checker.is_limit
    if not count or not is_limit.any():
        return fewest.refused()
    only = np.zeros(len(candidates.z0), int) if fixed is None else fixed
    segments = _Segments(checker.problem.robot, candidates)
    for arcs in range(1, max_arcs + 1):
        stage(f"why not, arcs {arcs} of {max_arcs}")
        alive = np.flatnonzero(~fewest.is_best & _is_tried(arcs, only)[motion])
        for tau in (FIRST_TIMES, OTHER_TIMES):
            alive = _screened(checker, segments, arcs, alive, _times_before_end(arcs, tau), limits=False)
        if len(alive):
            is_proved, broken = _but_for_limits(checker, segments(arcs, alive), arcs)
            fewest.take(alive[is_proved], np.full(is_proved.sum(), arcs), broken[is_proved])
    return fewest.refused()


def _but_for_limits(checker: MotionChecker, segments: PlatformSegment, arcs: int) -> tuple[np.ndarray, np.ndarray]:
    # Tell which motions are proved but for limits that they break, (n,), and return these limits, (n, n_criteria).
    each, is_limit = np.full(len(segments.rate), arcs), checker.is_limit
    first = checker.check(segments, each, full=False, margins=False, ignored=is_limit)
    is_proved, broken = first.verdict == 0, checker.breaks(first.slack) & is_limit
    unclear = np.flatnonzero(is_proved & ~(broken == is_limit).all(1))
    for _ in range(int(is_limit.sum())):
        if not len(unclear):
            break
        left = []
        for ignored in np.unique(broken[unclear], axis=0):
            alike = unclear[(broken[unclear] == ignored).all(1)]
            again = checker.check(take_segments(segments, alike), each[alike], margins=False, ignored=ignored)
            is_proved[alike] = again.verdict == 0
            more = checker.breaks(again.slack) & is_limit & ~ignored & (again.verdict != 0)[:, None]
            broken[alike] |= more
            left.append(alike[more.any(1)])
        unclear = np.concatenate(left)
        is_proved[unclear] = True  # but for more limits
    is_proved[unclear] &= (broken[unclear] == is_limit).all(1)
    return is_proved, broken


def unavoidable(
    checker: MotionChecker,
    candidates: Candidates,
    suspects: Bool[np.ndarray, "n n_criteria"],
    *,
    max_arcs: int,
    fixed: np.ndarray | None,
) -> Bool[np.ndarray, "n n_criteria"]:
    """Criteria that every number of arcs breaks."""
    if not suspects.any():
        return suspects
    only = np.zeros(len(suspects), int) if fixed is None else fixed
    segments, ends = _Segments(checker.problem.robot, candidates), np.array([0.0, 1.0])
    # A criterion that is broken at an end of a motion is broken for every number of arcs.
    certain = suspects & checker.breaks(checker.sampled(segments(2, np.arange(len(only))), 2, ends))
    suspects = suspects & ~certain
    for arcs in range(1, max_arcs + 1):
        alive = np.flatnonzero(suspects.any(1) & _is_tried(arcs, only))
        if len(alive):
            tau = np.linspace(0.0, 1.0, COARSEST * arcs + 1)
            suspects[alive] &= checker.breaks(checker.sampled(segments(arcs, alive), arcs, tau))
    return suspects | certain


def best_candidates(checker: MotionChecker, candidates: Candidates, *, max_arcs: int) -> Float[np.ndarray, "n"]:
    """Number of arcs whose smallest sampled tension is the largest, for motions without a feasible number."""
    indices = np.arange(len(candidates.motion))
    best, highest = np.ones(len(indices), int), np.full(len(indices), -np.inf)
    if not len(best):
        return best
    segments = _Segments(checker.problem.robot, candidates)
    for arcs in range(1, max_arcs + 1):
        stage(f"best of what fails, arcs {arcs} of {max_arcs}")
        tau = np.linspace(0.0, 1.0, COARSEST * arcs + 1)
        lowest = checker.screen.lowest(segments(arcs, indices), arcs, tau)
        best, highest = np.where(lowest > highest, arcs, best), np.maximum(lowest, highest)
    return best


def segments_with(robot: PlatformRobot, candidates: Candidates, arcs: Float[np.ndarray, "n"]) -> PlatformSegment:
    """The segments of candidates with given numbers of arcs."""
    segments, indices = _Segments(robot, candidates), np.arange(len(arcs))
    even, odd = (segments(k, indices) for k in (0, 1))
    return jax.tree.map(lambda a, b: np.where((arcs % 2 == 1).reshape(-1, *[1] * (a.ndim - 1)), b, a), even, odd)
