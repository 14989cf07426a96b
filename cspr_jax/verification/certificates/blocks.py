"""Blocks of a certificate of a feasible motion: bounds of slacks, and what shows them (docs/certificates.md).

Where tensions follow from the motion, a block needs nothing more: a checker cuts it as it needs. Tensions of redundant
cables, and directions that separate bodies, are given for each block; blocks are halved until these serve.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import flint
import numpy as np

from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.certificates.statement import NoCertificateError, texts
from cspr_jax.verification.criteria import Criterion
from cspr_jax.verification.exact.components import Component
from cspr_jax.verification.exact.contacts import BodyPair, contact_bodies, direction_components
from cspr_jax.verification.exact.kinematics import Kinematics, balls, solved
from cspr_jax.verification.exact.minimum import lowest
from cspr_jax.verification.exact.series import SeriesPieces, ball, dot

FRACTION = 0.9  # bounds are this fraction of what is proved, so that another way of bounding reaches them
DIGITS = 3  # digits of bounds
TENSION_DIGITS = 8  # digits of tensions
MOST_BLOCKS = 20_000  # largest number of blocks of a certificate


def stated_bounds(rows: Sequence[Criterion], low: Float[np.ndarray, "n"], largest: float) -> list[Fraction]:
    """Bounds of slacks that a certificate states: shortly written numbers below what is proved."""
    return [_bound(min(value, largest), row.allowance) for row, value in zip(rows, low.tolist(), strict=True)]


def _bound(low: float, allowance: float) -> Fraction:
    if low <= 0.0:  # between minus the allowance, but for its rounding, and what is proved
        exact = (Fraction(low) - Fraction(allowance)) / 2
        short = Fraction(f"{float(exact):.{DIGITS - 1}e}")
        return short if -Fraction(allowance) < short < Fraction(low) else exact
    return min(Fraction(f"{low * FRACTION:.{DIGITS - 1}e}"), Fraction(low) * Fraction(19, 20))


def rounded(numbers: Float[np.ndarray, "n"], digits: int) -> list[str]:
    """Numbers with few digits, which serve as well where a checker makes up for the rest."""
    return [f"{number:.{digits}g}" for number in numbers.tolist()]


class Witness(NamedTuple):
    """Witness of bounds within a block: its fields in the file, and components that must exceed bounds."""

    fields: dict[str, Any]
    components: Callable[[Kinematics], list[tuple[Component, flint.arb]]]


def witnessed_blocks(
    problem: Problem,
    scene: Scene | None,
    pieces: SeriesPieces,
    rows: Sequence[Criterion],
    bounds: list[Fraction],
) -> list[dict[str, Any]]:
    """Blocks in the form of the file.

    Raises:
        NoCertificateError: more blocks would be needed than a certificate holds.
    """
    robot = problem.robot
    stated = dict(zip((row.flag for row in rows), bounds, strict=True))
    contacts = contact_bodies(robot, scene) if scene is not None else []
    first = next((i for i, row in enumerate(rows) if row.flag in CONTACTS), 0)
    clearances = bounds[first : first + len(contacts)]
    is_redundant = robot.n_cables > robot.dof
    blocks, pending = [], [(piece, Fraction(0), piece.end - piece.start) for piece in reversed(list(pieces))]
    while pending:
        piece, start, end = pending.pop()
        middle, radius = (start + end) / 2, (end - start) / 2
        at = Kinematics(robot, piece.state(ball(middle)))
        witnesses = [_tensions(problem, at, ball(middle), stated[Verdict.WRENCH_INFEASIBLE])] if is_redundant else []
        witnesses += [_directions(at, contacts, clearances)] if contacts else []
        over = Kinematics(robot, piece.state(ball(middle), ball(radius)), is_point=False)
        if all(_holds(witness, at, over, ball(radius)) for witness in witnesses):
            fields = {name: value for witness in witnesses for name, value in witness.fields.items()}
            blocks.append({"start": str(piece.start + start), "end": str(piece.start + end)} | fields)
        elif len(blocks) + len(pending) >= MOST_BLOCKS:
            raise NoCertificateError(f"a certificate would need more than {MOST_BLOCKS} blocks")
        else:
            pending += [(piece, middle, end), (piece, start, middle)]
    return blocks


CONTACTS = (Verdict.CABLE_CABLE, Verdict.CABLE_PLATFORM, Verdict.OBSTACLE)


def _holds(witness: Witness, at: Kinematics, over: Kinematics, radius: flint.arb) -> bool:
    pairs = zip(witness.components(at), witness.components(over), strict=True)
    return all(lowest(x.value, y.value, radius)[0] > bound for (x, bound), (y, _) in pairs)


def _tensions(problem: Problem, at: Kinematics, middle: flint.arb, bound: Fraction) -> Witness:
    # Tensions that are most central in the middle, and change so that the wrench stays balanced to first order.
    low, high = (np.broadcast_to(side, problem.robot.n_cables) for side in tension_range(problem.robot, problem.limits))
    matrix, change = (_middle(zip(*at.columns, strict=True), order) for order in (0, 1))
    (wrench, wrench_change) = (_middle([at.wrench], order)[0] for order in (0, 1))
    tensions = central_tensions(matrix, wrench, low, high)
    rates_of_tensions = np.linalg.lstsq(matrix, wrench_change - change @ tensions, rcond=None)[0]
    stated = rounded(tensions, TENSION_DIGITS), rounded(rates_of_tensions, TENSION_DIGITS)
    exact, rates, transposed = [ball(x) for x in stated[0]], [ball(x) for x in stated[1]], balls(matrix.T)
    limit, lower, upper = ball(bound), balls(low), balls(high)

    def components(on: Kinematics) -> list[tuple[Component, flint.arb]]:
        u = on.state.time - middle
        affine = [f + u * rate for f, rate in zip(exact, rates, strict=True)]
        rows = list(zip(*on.columns, strict=True))
        left = [w - dot(row, affine) for w, row in zip(on.wrench, rows, strict=True)]
        columns = list(zip(*transposed, strict=True))
        square = [[dot(row, column) for column in columns] for row in rows]
        factors, _ = solved(square, left)
        full = [f + dot(row, factors) for f, row in zip(affine, transposed, strict=True)]
        sides = [f - side for f, side in zip(full, lower, strict=True)]
        sides += [side - f for f, side in zip(full, upper, strict=True) if side.is_finite()]
        return [(Component(side), limit) for side in sides]

    return Witness({"tensions": list(stated)}, components)


def _middle(rows: Any, order: int) -> np.ndarray:
    return np.array([[float(x[order].mid()) for x in row] for row in rows])


def central_tensions(
    matrix: Float[np.ndarray, "d n"], wrench: Float[np.ndarray, "d"], low: np.ndarray, high: np.ndarray
) -> Float[np.ndarray, "n"]:
    """Tensions with the largest distance from their limits, but no larger than the largest force of the wrench.

    Raises:
        NoCertificateError: there are none.
    """
    from scipy.optimize import linprog  # few checks need it

    count = matrix.shape[1]
    is_limited = np.isfinite(high)
    above = np.column_stack([np.eye(count)[is_limited], np.ones(is_limited.sum())])
    below = np.column_stack([-np.eye(count), np.ones(count)])
    answer = linprog(
        np.append(np.zeros(count), -1.0),
        A_ub=np.vstack([above, below]),
        b_ub=np.concatenate([high[is_limited], -low]),
        A_eq=np.column_stack([matrix, np.zeros(len(matrix))]),
        b_eq=wrench,
        bounds=[(None, None)] * count + [(None, float(np.abs(wrench).max()) + 1.0)],
    )
    if not answer.success:
        raise NoCertificateError("no tensions balance the wrench in the middle of a block")
    return answer.x[:-1]


def _directions(at: Kinematics, pairs: Sequence[BodyPair], bounds: Sequence[Fraction]) -> Witness:
    directions = [np.array([float(x) for x in pair.direction(at).axis]) for pair in pairs]

    def components(on: Kinematics) -> list[tuple[Component, flint.arb]]:
        return [
            (component, ball(bound))
            for pair, direction, bound in zip(pairs, directions, bounds, strict=True)
            for component in direction_components(on, pair, balls(direction))
        ]

    return Witness({"directions": [texts(direction) for direction in directions]}, components)
