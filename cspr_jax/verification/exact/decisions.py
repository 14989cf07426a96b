"""Decisions of what a proof by bounds leaves open, or decides within its own rounding: signs of slacks, exactly.

Only times at which such a slack may be on either side of its level are looked at, so that nothing is slower where
nothing is in doubt.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import flint
import numpy as np

from cspr_jax.motion.formulas import MotionPiece
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.bounds.intervals import united
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.criteria import Criterion, levels
from cspr_jax.verification.exact.algebra import ROOT_BITS, decided_sign
from cspr_jax.verification.exact.components import Component
from cspr_jax.verification.exact.kinematics import Kinematics
from cspr_jax.verification.exact.minimum import Components, Minimum, PiecePart, minimum
from cspr_jax.verification.exact.series import SeriesPiece, SeriesPieces, ball, precision
from cspr_jax.verification.exact.slacks import SlackFunction, slack_functions
from cspr_jax.verification.proved_answers import MotionProof
from cspr_jax.verification.time_proof import TimeProof

BITS = 256  # precision of balls, of which bounds of slacks lose some dozens
MET = 1e-30  # a slack nearer to its level than this, over its scale, is left to algebra
FEW_BLOCKS = 400  # number of blocks before algebra is asked
MOST_BLOCKS = 20_000  # largest number of blocks for one criterion, some ten seconds
BODY = 5  # a block of a body that turns costs as many of a point mass
FACETS = 8  # so many facets of redundant cables cost as much as all else


def decided(problem: Problem, motion: Any, case: MotionProof, scene: Scene | None = None) -> MotionProof:
    """The proof with criteria that are open, or within rounding of their levels, decided as far as formulas allow."""
    functions = slack_functions(problem, scene, case.parts, case.feeds)
    with precision(BITS):
        pieces = SeriesPieces(motion.formulas())
        for k in np.flatnonzero(case.doubtful[: len(functions)]).tolist():
            function = functions[k]
            intervals = _intervals(case, k)
            if function is not None and len(intervals):
                doubt = Doubt(k, float(levels(case.criteria)[k]), MET * float(case.scales[k]), intervals)
                case = case._replace(proof=_decided(problem, case, doubt, function, pieces))
    return case


class Doubt(NamedTuple):
    """A criterion to be decided.

    Fields:
        column: index of the criterion.
        level: slack above which it is met.
        met: distance from the level within which algebra decides.
        intervals: (m, 2) times at which it is not decided, s.
    """

    column: int
    level: float
    met: float
    intervals: np.ndarray

    def is_near(self, answer: Minimum) -> bool:
        """Tell whether the smallest slack is enclosed so near to its level that only algebra can decide."""
        return bool(answer.low > self.level - self.met and answer.high < self.level + self.met)


def _intervals(case: MotionProof, k: int) -> Float[np.ndarray, "m 2"]:
    # Times at which a criterion may be met or broken: those that are open or fail, and blocks within rounding.
    lows, near = _lows(case.proof, k), case.proof.near
    parts = [case.proof.open[k], case.proof.failing[k]]
    if near is not None and len(lows):
        chosen = lows < float(levels(case.criteria)[k]) + case.rounding[k]
        parts.append(np.stack([near.start[chosen], near.end[chosen]], axis=1))
    return united(np.concatenate(parts))


def _lows(proof: TimeProof, k: int) -> Float[np.ndarray, "n"]:
    # Lower bounds over the blocks that a proof leaves; none for feeds, whose proof has blocks of its own.
    if proof.near is None or k >= proof.near.slacks.low.shape[1]:
        return np.empty(0)
    return proof.near.slacks.low[:, k]


def _decided(
    problem: Problem, case: MotionProof, doubt: Doubt, function: SlackFunction, pieces: SeriesPieces
) -> TimeProof:
    # A few blocks, then algebra, then as many blocks as are allowed. Determinants of bodies are polynomials of such
    # degrees that algebra comes last, and only where the slack is very near to its level.
    row = case.criteria[doubt.column]
    is_costly = PATTERNS[problem.robot.pattern].is_body and row.flag in (Verdict.SLACK_CABLE, Verdict.OVER_TENSION)
    for count in (FEW_BLOCKS, largest_count(problem.robot)):
        answer = sign(problem, function, pieces, doubt, count)
        if answer.high < doubt.level or answer.low > doubt.level:
            return _with(case.proof, doubt, answer)
        is_near = doubt.is_near(answer)
        if is_near or not is_costly:
            proof = _met_exactly(problem, row, pieces.formulas, case.proof, doubt)
            if proof is not None or is_near:
                return proof or case.proof
    return case.proof


def _met_exactly(
    problem: Problem, row: Criterion, formulas: Sequence[MotionPiece], proof: TimeProof, doubt: Doubt
) -> TimeProof | None:
    # The proof with one criterion decided by algebra: touched limits are met, cables that just lose tension are not.
    k, low, high, times = doubt.column, proof.low.copy(), proof.high.copy(), proof.when.copy()
    with precision(ROOT_BITS):
        for index, first, last in _overlaps(formulas, doubt.intervals):
            piece = formulas[index]
            answer = decided_sign(problem, row, piece, (first - piece.start, last - piece.start))
            if answer.is_met is None:
                return None
            if not answer.is_met:
                times[k] = float(answer.time + ball(piece.start))
                failing = [*proof.failing[:k], np.array([[times[k], times[k]]]), *proof.failing[k + 1 :]]
                high[k] = min(high[k], doubt.level)
                return dataclasses.replace(proof, high=high, when=times, failing=failing, open=_without(proof.open, k))
    low[k] = np.nextafter(doubt.level, np.inf)
    return _met(dataclasses.replace(proof, low=low), doubt)


def _without(intervals: list[np.ndarray], k: int) -> list[np.ndarray]:
    return [*intervals[:k], np.empty((0, 2)), *intervals[k + 1 :]]


def _met(proof: TimeProof, doubt: Doubt) -> TimeProof:
    # The proof without the times at which a criterion that is met seemed open or broken.
    high = proof.high.copy()
    high[doubt.column] = max(high[doubt.column], doubt.level)
    sides: dict[str, Any] = {
        "failing": _without(proof.failing, doubt.column),
        "open": _without(proof.open, doubt.column),
    }
    return dataclasses.replace(proof, high=high, **sides)


def _with(proof: TimeProof, doubt: Doubt, answer: Minimum) -> TimeProof:
    # The proof with what is known of one criterion. The number next to the level stands for one too close for floats.
    k, level = doubt.column, doubt.level
    low, high, when = proof.low.copy(), proof.high.copy(), proof.when.copy()
    if answer.high < level:
        high[k], when[k] = min(float(answer.value), np.nextafter(level, -np.inf)), float(answer.when)
        return dataclasses.replace(proof, high=high, when=when, open=_without(proof.open, k))
    bounds = [float(answer.low), *_lows(proof, k)]
    low[k] = max(min((bound for bound in bounds if bound > level), default=level), np.nextafter(level, np.inf))
    return _met(dataclasses.replace(proof, low=low), doubt)


def sign(problem: Problem, function: SlackFunction, pieces: SeriesPieces, doubt: Doubt, count: int) -> Minimum:
    """Enclose the smallest slack within intervals until it is above its level or below it, or too near to it."""

    def is_enough(answer: Minimum) -> bool:
        return bool(answer.low > doubt.level or answer.high < doubt.level) or doubt.is_near(answer)

    return minimum(components_of(problem, function), blocks_of(pieces, doubt.intervals), is_enough, count)


def largest_count(robot: AnyRobot) -> int:
    """Largest number of blocks for one criterion of a robot, so that a decision takes no more than some minutes."""
    facets = math.comb(robot.n_cables, robot.dof - 1) if robot.n_cables > robot.dof else 0
    bodies = BODY if PATTERNS[robot.pattern].is_body else 1
    return MOST_BLOCKS // max(1 + facets // FACETS, bodies)


def components_of(problem: Problem, function: SlackFunction) -> Components:
    """Components of a slack on a piece around a time."""
    latest: tuple[flint.arb, dict[int, Any]] = flint.arb(0), {}

    def components(piece: SeriesPiece, middle: flint.arb, radius: flint.arb | None) -> list[Component]:
        nonlocal latest
        if radius is None or middle != latest[0]:
            latest = middle, {}
        return function(Kinematics(problem.robot, piece.state(middle, radius), latest[1], is_point=radius is None))

    return components


def blocks_of(pieces: SeriesPieces, intervals: Float[np.ndarray, "m 2"]) -> Iterator[PiecePart]:
    """Parts of pieces that overlap intervals."""
    for index, low, high in _overlaps(pieces.formulas, intervals):
        piece = pieces[index]
        yield PiecePart(piece, low - piece.start, high - piece.start)


def _overlaps(
    pieces: Sequence[MotionPiece], intervals: Float[np.ndarray, "m 2"]
) -> Iterator[tuple[int, Fraction, Fraction]]:
    # Indices of pieces, with the start and the end of what they share with intervals.
    ends = [float(piece.end) for piece in pieces]
    for first, last in intervals.tolist():
        index = max(bisect.bisect_left(ends, first) - 1, 0)
        while index < len(pieces) and pieces[index].start < last:
            low, high = max(Fraction(first), pieces[index].start), min(Fraction(last), pieces[index].end)
            if low < high:
                yield index, low, high
            index += 1
