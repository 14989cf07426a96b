"""Decisions of what a proof by bounds leaves open: the sign of a slack within its open intervals, by balls and algebra.

Only open intervals of criteria that are neither met nor broken are looked at, so that nothing is slower where nothing
is open.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

import flint
import numpy as np

from cspr_jax.motion.formulas import MotionPiece
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Scene
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
MOST_BLOCKS = 20_000  # largest number of blocks for one criterion, some ten seconds
FACETS = 8  # so many facets of redundant cables cost as much as all else


def decided(problem: Problem, motion: Any, case: MotionProof, scene: Scene | None = None) -> MotionProof:
    """The proof with its open criteria decided, as far as formulas and the largest number of blocks allow."""
    level = levels(case.criteria)
    functions = slack_functions(problem, scene, case.parts, case.feeds)
    is_open = ~((case.proof.low > level) | case.broken)[: len(functions)]
    with precision(BITS):
        formulas = motion.formulas()
        pieces = SeriesPieces(formulas)
        for k in np.flatnonzero(is_open).tolist():
            function = functions[k]
            if function is None:
                continue
            answer = sign(problem, function, pieces, case.proof.open[k], float(level[k]), MET * float(case.scales[k]))
            proof = _with(case.proof, k, float(level[k]), answer)
            if len(proof.open[k]):
                proof = _met_exactly(problem, case.criteria[k], formulas, proof, k, float(level[k]))
            case = case._replace(proof=proof)
    return case


def _met_exactly(
    problem: Problem, row: Criterion, formulas: list[MotionPiece], proof: TimeProof, k: int, level: float
) -> TimeProof:
    # The proof with one criterion decided by algebra: touched limits are met, cables that just lose tension are not.
    with precision(ROOT_BITS):
        for index, first, last in _overlaps(formulas, proof.open[k]):
            piece = formulas[index]
            answer = decided_sign(problem, row, piece, (first - piece.start, last - piece.start))
            if answer.is_met is None:
                return proof
            if not answer.is_met:
                when = float(answer.time + ball(piece.start))
                failing = [*proof.failing[:k], np.array([[when, when]]), *proof.failing[k + 1 :]]
                high, times = proof.high.copy(), proof.when.copy()
                high[k], times[k] = min(high[k], level), when
                return dataclasses.replace(proof, high=high, when=times, failing=failing, open=_without(proof.open, k))
    low = proof.low.copy()
    low[k] = np.nextafter(level, np.inf)
    return dataclasses.replace(proof, low=low, open=_without(proof.open, k))


def _without(intervals: list[np.ndarray], k: int) -> list[np.ndarray]:
    return [*intervals[:k], np.empty((0, 2)), *intervals[k + 1 :]]


def _with(proof: TimeProof, k: int, level: float, answer: Minimum) -> TimeProof:
    # The proof with what is known of one criterion. The number next to the level stands for one too close for floats.
    low, high, when, left = proof.low.copy(), proof.high.copy(), proof.when.copy(), proof.open
    if answer.high < level:
        high[k], when[k] = min(float(answer.value), np.nextafter(level, -np.inf)), float(answer.when)
        left = _without(left, k)
    elif answer.low > level:
        bounds = [float(answer.low)] if proof.near is None else [float(answer.low), *proof.near.slacks.low[:, k]]
        low[k] = max(min((bound for bound in bounds if bound > level), default=level), np.nextafter(level, np.inf))
        left = _without(left, k)
    return dataclasses.replace(proof, low=low, high=high, when=when, open=left)


def sign(
    problem: Problem,
    function: SlackFunction,
    pieces: SeriesPieces,
    intervals: Float[np.ndarray, "m 2"],
    level: float,
    met: float,
) -> Minimum:
    """Enclose the smallest slack within intervals until it is above a level or below it, or nearer than `met`."""

    def is_enough(answer: Minimum) -> bool:
        is_near = answer.low > level - met and answer.high < level + met
        return bool(answer.low > level or answer.high < level or is_near)

    return minimum(
        components_of(problem, function), blocks_of(pieces, intervals), is_enough, largest_count(problem.robot)
    )


def largest_count(robot: AnyRobot) -> int:
    """Largest number of blocks for one criterion of a robot, so that a decision takes no more than some minutes."""
    facets = math.comb(robot.n_cables, robot.dof - 1) if robot.n_cables > robot.dof else 0
    return MOST_BLOCKS // (1 + facets // FACETS)


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
