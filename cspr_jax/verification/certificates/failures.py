"""Failures of a certificate of an infeasible motion: times at which criteria are not met, and what shows it."""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import Any, NamedTuple

import flint
import numpy as np

from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.certificates.blocks import CONTACTS
from cspr_jax.verification.certificates.statement import NoCertificateError, texts
from cspr_jax.verification.criteria import Criterion
from cspr_jax.verification.exact.contacts import BodyPair, contact_bodies
from cspr_jax.verification.exact.decisions import blocks_of, components_of
from cspr_jax.verification.exact.kinematics import Kinematics, balls
from cspr_jax.verification.exact.minimum import Components, Minimum, attained, minimum
from cspr_jax.verification.exact.series import SeriesPiece, SeriesPieces, ball, cross, dot
from cspr_jax.verification.exact.slacks import SlackFunction

BESIDE = 1e-6  # s; times this near to the worst one are searched where floating-point numbers are too coarse
MOST_BLOCKS = 2_000
FLAT = 1e-12  # a cable that pulls less along a normal, over what it could, spans the facet
CROSSING = (-32, -2)  # exponents of 2 s before and after the crossing of bodies without thickness
SEGMENTS = 4  # differences of the ends of two segments
LEANING = 1e-11  # normals lean this much away from cables without a largest tension


class NamedSlack(NamedTuple):
    """Criterion, its name in certificates, and its slack; None: it has no formula."""

    row: Criterion
    name: str
    function: SlackFunction | None


def failure(
    problem: Problem, scene: Scene | None, pieces: SeriesPieces, slack: NamedSlack, near: float
) -> dict[str, Any]:
    """Failure of a criterion near a time, in the form of the file.

    Raises:
        NoCertificateError: the failure cannot be shown, as that of a cable that just loses its tension.
    """
    row, name, function = slack
    if function is None:
        raise NoCertificateError(f"a certificate cannot show {row.flag.text.replace('_', ' ')}")
    level, components = ball(Fraction(-row.allowance)), components_of(problem, function)
    time = Fraction(near)
    piece = _failing_piece(components, pieces, time, level)
    if piece is None:
        around = np.clip(np.array([[near - BESIDE, near + BESIDE]]), 0.0, float(pieces.formulas[-1].end))

        def is_enough(answer: Minimum) -> bool:
            return bool(answer.high < level or answer.low > level)

        time = minimum(components, blocks_of(pieces, around), is_enough, MOST_BLOCKS).when
        piece = _failing_piece(components, pieces, time, level)
    pair = contact_bodies(problem.robot, scene)[int(name.partition(":")[2])] if row.flag in CONTACTS and scene else None
    if piece is None and pair is not None:
        return {"criterion": name} | _crossing(problem, pieces, pair, near)
    if piece is None:
        raise NoCertificateError(f"a certificate cannot show {row.flag.text.replace('_', ' ')} at a single time")
    content: dict[str, Any] = {"criterion": name, "time": str(time)}
    at = Kinematics(problem.robot, piece.state(ball(time - piece.start)))
    if row.flag == Verdict.WRENCH_INFEASIBLE:
        content["wrench"] = texts(_separating_wrench(problem, at, row.allowance))
    return content if pair is None else content | {"points": _weights(at, pair)}


def _crossing(problem: Problem, pieces: SeriesPieces, pair: BodyPair, near: float) -> dict[str, str]:
    # Times between which bodies without thickness pass through each other, as near to each other as that shows.
    time, robot = Fraction(near), problem.robot
    in_plane = PATTERNS[robot.pattern].is_planar
    for piece, exponent in itertools.product(pieces.around(time), range(*CROSSING)):
        away = Fraction(2) ** exponent
        start, end = max(time - away, piece.start), min(time + away, piece.end)
        middle, radius = (start + end) / 2 - piece.start, (end - start) / 2
        over = _crossings(pair, Kinematics(robot, piece.state(ball(middle), ball(radius)), is_point=False))
        first, last = (_crossings(pair, Kinematics(robot, piece.state(ball(t - piece.start)))) for t in (start, end))
        for one, two, between in zip(first, last, over, strict=True):
            if between.is_within and (in_plane or one.volume * two.volume < 0):
                return {"time": str(start), "until": str(end)}
    raise NoCertificateError("a certificate cannot show bodies that touch at a single time without crossing")


class Crossing(NamedTuple):
    """Volume that two bodies without thickness span, zero where they meet if they are within each other's reach."""

    volume: flint.arb
    is_within: bool


def _crossings(pair: BodyPair, at: Kinematics) -> list[Crossing]:
    # One of two segments; of a sector and a spool one for each two vectors of the sector.
    rows = [[x[0] for x in row] for row in pair.differences(at)]
    if pair.sector is not None:
        cones = itertools.combinations(balls(pair.sector), 2)
        return [_crossing_of(rows[0], first, second, is_cone=True) for first, second in cones]
    if len(rows) != SEGMENTS or pair.in_platform_axes:
        return []
    across, beyond, back, _ = rows  # start to start, start to end, end to start
    first, second = ([x - y for x, y in zip(*ends, strict=True)] for ends in ((across, back), (beyond, across)))
    return [_crossing_of(across, first, second, is_cone=False)]


def _crossing_of(across: list[flint.arb], first: Any, second: Any, *, is_cone: bool) -> Crossing:
    normal = cross(first, second)
    parts = [dot(cross(across, second), normal), dot(cross(across, first), normal) * (-1 if is_cone else 1)]
    square = flint.arb("inf") if is_cone else dot(normal, normal)
    return Crossing(dot(across, normal), all(part > 0 and part < square for part in parts))


def _failing_piece(
    components: Components, pieces: SeriesPieces, time: Fraction, level: flint.arb
) -> SeriesPiece | None:
    # The piece that holds a time and on which the slack is below its level then; accelerations may jump between pieces.
    return next(
        (piece for piece in pieces.around(time) if attained(components(piece, ball(time - piece.start), None)) < level),
        None,
    )


def _separating_wrench(problem: Problem, at: Kinematics, allowance: float) -> Float[np.ndarray, "d"]:
    # Wrench along which the required one is farther than all that tensions reach: the normal of the facet it is beyond.
    columns = np.array([[float(x[0].mid()) for x in column] for column in at.columns])
    wrench = np.array([float(x[0].mid()) for x in at.wrench])
    count, dof = columns.shape
    low, high = (np.broadcast_to(side, count) for side in tension_range(problem.robot, problem.limits))
    low, high = low - allowance, high + allowance
    chosen = columns[np.array(list(itertools.combinations(range(count), dof - 1)))]
    units = np.linalg.svd(chosen)[2][:, -1] if dof > 1 else np.ones((1, 1))
    normals = np.concatenate([units, -units])
    products = normals @ columns.T
    products[np.abs(products) < FLAT * np.linalg.norm(columns, axis=1)] = 0.0
    with np.errstate(invalid="ignore"):
        largest = np.where(products > 0.0, products * high, products * low)
    beyond = normals @ wrench - np.where(products == 0.0, 0.0, largest).sum(1)
    return normals[beyond.argmax()] + _leaning(columns[np.isinf(high)])


def _leaning(columns: Float[np.ndarray, "m d"]) -> Float[np.ndarray, "d"]:
    # A small wrench against which each of some cables pulls, so that rounding leaves none pulling along the normal.
    from scipy.optimize import linprog  # few checks need it

    if not len(columns):
        return np.zeros(columns.shape[1])
    dof = columns.shape[1]
    answer = linprog(np.zeros(dof), A_ub=columns, b_ub=-np.linalg.norm(columns, axis=1), bounds=[(None, None)] * dof)
    if not answer.success:
        raise NoCertificateError("cables without a largest tension pull along every wrench")
    return LEANING * answer.x / np.linalg.norm(answer.x)


def _weights(at: Kinematics, pair: BodyPair) -> list[list[str]]:
    # Weights of the points of both bodies at their nearest points.
    table = pair.direction(at).weights.reshape(len(pair.first(at)), len(pair.second(at)))
    return [_normalised(table.sum(1)), _normalised(table.sum(0))]


def _normalised(weights: np.ndarray) -> list[str]:
    # Rational numbers that sum to 1 exactly.
    exact = [Fraction(float(weight)) for weight in np.maximum(weights, 0.0)]
    exact[int(np.argmax(weights))] += 1 - sum(exact)
    return [str(weight) for weight in exact]
