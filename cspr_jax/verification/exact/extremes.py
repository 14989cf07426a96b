"""Extremes along motions to as many digits as are asked for: smallest slacks of a proof, and peaks of quantities.

Each is enclosed by balls. The time that is stated is a floating-point number, and the value is that at this time.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import flint
import numpy as np

from cspr_jax.motion.peaks import EXTREMES, Peaks
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.model.winches import MotorDemands
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.verification.exact.components import Component
from cspr_jax.verification.exact.decisions import BITS, blocks_of, components_of, largest_count
from cspr_jax.verification.exact.kinematics import Kinematics, balls
from cspr_jax.verification.exact.minimum import Components, Minimum, PiecePart, attained, minimum
from cspr_jax.verification.exact.series import SeriesPieces, ball, dot, number, precision, quotient
from cspr_jax.verification.exact.slacks import (
    QUANTITIES,
    SlackFunction,
    has_motor_formulas,
    motor_values,
    slack_functions,
)
from cspr_jax.verification.proved_answers import MotionProof

NEWTON, NEAR = 6, Fraction(1, 1000)  # steps that find a time, at most this part of a piece from the first one
SMALL = 1e-3  # quantities below this fraction of their scale get digits relative to that fraction


def with_extremes(problem: Problem, motion: Any, case: MotionProof, scene: Scene | None, digits: int) -> MotionProof:
    """The proof with the smallest slacks of all flags, and their times, to a number of digits of the quantities."""
    low, high, when = (side.copy() for side in (case.proof.low, case.proof.high, case.proof.when))
    with precision(BITS):
        pieces = SeriesPieces(motion.formulas())
        functions = slack_functions(problem, scene, case.parts, case.feeds)
        for k in np.flatnonzero(case.nearest).tolist():
            function = functions[k]
            if function is None:
                continue
            offset = case.criteria[k].allowed * (1.0 if case.criteria[k].sense == "least" else -1.0)
            goal = Accuracy(digits, offset, SMALL * float(case.scales[k]), largest_count(problem.robot))
            answer = _enclosed(components_of(problem, function), _near(pieces, case, k), goal)
            if answer is not None:
                low[k], high[k], when[k] = answer
    return case._replace(proof=dataclasses.replace(case.proof, low=low, high=high, when=when))


def _near(pieces: SeriesPieces, case: MotionProof, k: int) -> Iterable[PiecePart]:
    # Blocks that may hold the smallest slack of a criterion.
    near = case.proof.near
    if near is None or k >= near.slacks.low.shape[1]:
        return _all(pieces)
    chosen = near.slacks.low[:, k] <= case.proof.high[k]
    return blocks_of(pieces, np.stack([near.start[chosen], near.end[chosen]], axis=1))


def _all(pieces: SeriesPieces) -> list[PiecePart]:
    return [PiecePart(piece, Fraction(0), piece.end - piece.start) for piece in pieces]


class Accuracy(NamedTuple):
    """Accuracy that is asked for.

    Fields:
        digits: decimal digits of a quantity.
        offset: what the quantity is more than the value that is enclosed, but for its sign.
        scale: smaller quantities count as this.
        largest_count: of blocks.
    """

    digits: int
    offset: float
    scale: float
    largest_count: int


def _enclosed(components: Components, blocks: Iterable[PiecePart], goal: Accuracy) -> tuple[float, float, float] | None:
    # Lower bound of the smallest value, a value at a floating-point time, and that time; None: not enclosed.
    blocks = list(blocks)
    if not blocks:
        return None

    def is_enough(answer: Minimum) -> bool:
        if not answer.value.is_finite():
            return False
        error = 0.1**goal.digits * max(abs(float(answer.value) + goal.offset), goal.scale)
        return bool(answer.high - answer.low < error)

    answer = minimum(components, blocks, is_enough, goal.largest_count)
    if not is_enough(answer):
        return None
    last = max(block.piece.end for block in blocks)
    time = min(_stationary(components, blocks, answer.when), float(np.nextafter(float(last), 0.0)))
    piece = next(
        (block.piece for block in blocks if block.piece.start <= Fraction(time) <= block.piece.end), blocks[0].piece
    )
    value = attained(components(piece, ball(Fraction(time) - piece.start), None))
    return float(np.nextafter(float(answer.low), -np.inf)), float(value if value.is_finite() else answer.value), time


def _stationary(components: Components, blocks: Sequence[PiecePart], time: Fraction) -> float:
    # The time near which the lowest component is least, by Newton's method, which stays where that lies elsewhere.
    piece = next(block.piece for block in blocks if block.piece.start <= time <= block.piece.end)
    nearest = time
    for _ in range(NEWTON):
        parts = [part for part in components(piece, ball(nearest - piece.start), None) if part.applies]
        if not parts:
            return float(time)
        lowest = min(parts, key=lambda part: float(part.value[0].mid())).value
        if not lowest[2] > 0:
            return float(time)
        nearest = nearest - number(lowest[1] / (2 * lowest[2]))
        if not piece.start <= nearest <= piece.end or abs(nearest - time) > NEAR * (piece.end - piece.start):
            return float(time)
    return float(nearest)


def exact_peaks(problem: Problem, motions: Sequence[Any], peaks: Peaks, digits: int) -> Peaks:
    """Peaks of motions to a number of digits, where tensions follow from the motion; heights stay as they are."""
    columns = {name: getattr(peaks, name).copy() for name in EXTREMES}
    when, cables = peaks.when.copy(), peaks.cables.copy()
    with precision(BITS):
        for i, motion in enumerate(motions):
            pieces = SeriesPieces(motion.formulas())
            for name, (sign, functions) in _quantities(problem).items():
                column = EXTREMES.index(name)
                goal = Accuracy(digits, 0.0, SMALL * abs(columns[name][i]), largest_count(problem.robot))
                answer = _enclosed(components_of(problem, _together(functions)), _all(pieces), goal)
                if answer is not None:
                    columns[name][i], when[i, column] = sign * answer[1], answer[2]
                    if len(functions) > 1:
                        cables[i, column] = _lowest_cable(problem, pieces, functions, answer[2])
    return dataclasses.replace(peaks, **columns, when=when, cables=cables)


def _together(functions: Sequence[SlackFunction]) -> SlackFunction:
    return lambda at: [component for function in functions for component in function(at)]


def _lowest_cable(problem: Problem, pieces: SeriesPieces, functions: Sequence[SlackFunction], time: float) -> int:
    piece = pieces.at(Fraction(time))
    at = Kinematics(problem.robot, piece.state(ball(Fraction(time) - piece.start)))
    return int(np.argmin([float(attained(function(at))) for function in functions]))


def _quantities(problem: Problem) -> dict[str, tuple[float, list[SlackFunction]]]:
    # For each peak, the sign with which its smallest value is searched for, and a function for each cable.
    robot: Any = problem.robot
    each = range(robot.n_cables)
    table: dict[str, tuple[float, list[SlackFunction]]] = {
        name: (-1.0, [_negative(QUANTITIES[quantity], k) for k in (each if of_cables else range(1))])
        for name, quantity, of_cables in (
            ("length_max", "length", True),
            ("speed_max", "speed", True),
            ("acceleration_max", "acceleration", True),
            ("mass_centre_speed", "mass_centre_speed", False),
            ("mass_centre_acceleration", "mass_centre_acceleration", False),
        )
    }
    normal = balls(plane_normal(robot))
    table["depth_min"] = 1.0, [lambda at: [Component(dot(normal, at.state.position))]]
    if robot.n_cables > robot.dof:
        return table
    low, high = (np.broadcast_to(side, robot.n_cables) for side in tension_range(robot, problem.limits))
    mass = flint.arb(float(robot.mass))
    table["tension_min"] = 1.0, [_of_tension(k, 1, None) for k in each]
    table["tension_max"] = -1.0, [_of_tension(k, -1, None) for k in each]
    table["tension_margin"] = 1.0, [_of_margin(k, float(low[k]), float(high[k])) for k in each]
    table["mu_min"] = 1.0, [_of_tension(k, 1, mass) for k in each]
    if has_motor_formulas(robot):
        names = MotorDemands._fields if robot.winches.stall_torque is not None else MotorDemands._fields[:-1]
        table |= {name: (-1.0, [_of_motor(name, k) for k in each]) for name in names}
    return table


def _of_motor(quantity: str, k: int) -> SlackFunction:
    return lambda at: [Component(-value, acts) for value, acts in motor_values(at, quantity, k)]


def _negative(quantity: Callable[[Kinematics, int], list[Any]], k: int) -> SlackFunction:
    return lambda at: [Component(-value) for value in quantity(at, k)]


def _of_tension(k: int, sign: int, mass: flint.arb | None) -> SlackFunction:
    # A tension, or a tension over mass and length.
    def components(at: Kinematics) -> list[Component]:
        tension = at.tensions[k] * sign
        return [Component(tension if mass is None else quotient(tension, at.cables[k].length) / mass)]

    return components


def _of_margin(k: int, low: float, high: float) -> SlackFunction:
    def components(at: Kinematics) -> list[Component]:
        tension, limits = at.tensions[k], (flint.arb(low), flint.arb(high))
        above = [Component(limits[1] - tension)] if np.isfinite(high) else []
        return [Component(tension - limits[0]), *above]

    return components
