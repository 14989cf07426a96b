"""Directions that measurements cannot see, in words and numbers, and correlations of what they can.

Motions of all spools, or of all attachment points, as one body are bodies by name; of what is left of the null space a
basis with as few parameters as possible is shown.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.spatial.transform import Rotation

from cspr_jax.machine.calibration.parameters import (
    ATTACHMENT,
    DRUM,
    LOCAL,
    OFFSET,
    PULLEY,
    SHIFT,
    SPOOL,
    TARGET,
    TRACKER,
    TURN,
    Parameters,
)
from cspr_jax.machine.calibration.setups import Setup
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.robot import Robot

# Part of a unit vector outside the null space up to which it counts as inside.
INSIDE = 1e-5
# Parameters of a direction below this fraction of its largest one are not shown.
SMALL = 0.02
MAX_TERMS = 8
NOTHING = "changes nothing that was measured"
LEVEL = "; so how level the robot stands is not measured"


class Direction(NamedTuple):
    """A direction of the parameters.

    Fields:
        text: what it is, in words.
        vector: (p,) the direction in the axes of the file, its largest entry 1.
    """

    text: str
    vector: np.ndarray

    def to_dict(self, parameters: Parameters) -> dict[str, Any]:
        """Words and numbers."""
        shown = {row.name: float(v) for row, v in zip(parameters.rows, self.vector, strict=True) if abs(v) > SMALL}
        return {"text": self.text, "parameters": shown}


def unseen_directions(
    parameters: Parameters, setup: Setup, null_space: Float[np.ndarray, "q p"]
) -> tuple[Direction, ...]:
    """All directions along which the measurements do not change."""
    bodies, vectors = list[Direction](), list[np.ndarray]()
    for text, vector in _bodies(parameters, setup):
        unit = vector / np.linalg.norm(vector)
        if np.linalg.norm(unit - null_space.T @ (null_space @ unit)) <= INSIDE:
            bodies.append(Direction(text, _in_file(parameters, vector)))
            vectors.append(unit)
    rest = null_space
    if vectors:
        basis = np.linalg.svd(np.array(vectors) @ null_space.T)
        rank = int(np.count_nonzero(basis[1] > INSIDE))
        rest = basis[2][rank:] @ null_space
    return (*bodies, *_sparse(parameters, rest))


def _in_file(parameters: Parameters, vector: np.ndarray) -> np.ndarray:
    # A direction in the units and axes of reports, its largest entry 1.
    reported = vector * parameters.units
    return reported / reported[np.abs(reported).argmax()]


def _sparse(parameters: Parameters, null_space: np.ndarray) -> Iterator[Direction]:
    # Each vector of the basis has a parameter of its own.
    if not len(null_space):
        return
    pivots = qr(null_space, pivoting=True, mode="r")[1][: len(null_space)]
    for vector in np.linalg.solve(null_space[:, pivots], null_space):
        shown = _in_file(parameters, np.where(np.abs(vector) > SMALL * np.abs(vector).max(), vector, 0.0))
        text = f"{terms(parameters, shown)} together: {'their sum ' if np.count_nonzero(shown) > 1 else ''}{NOTHING}"
        yield Direction(text if np.count_nonzero(shown) > 1 else f"{terms(parameters, shown)} alone: {NOTHING}", shown)


def terms(parameters: Parameters, vector: Float[np.ndarray, "p"]) -> str:
    """The largest entries of a direction, in words."""
    order = [i for i in np.argsort(-np.abs(vector), kind="stable") if abs(vector[i]) > SMALL * np.abs(vector).max()]
    words = [f"{parameters.rows[i].name} by {vector[i]:+.3g} {parameters.rows[i].unit}" for i in order[:MAX_TERMS]]
    more = f" and {len(order) - MAX_TERMS} more" if len(order) > MAX_TERMS else ""
    return ", ".join(words) + more


def _bodies(parameters: Parameters, setup: Setup) -> Iterator[tuple[str, np.ndarray]]:
    # Motions of all spools, or of all attachment points, and one factor on everything; if they can be written as
    # parameters.
    robot = setup.robot
    rotation = Rotation.from_quat(setup.orientation, scalar_first=True).as_matrix()
    base = np.asarray(robot.base_points)
    for k, axis in enumerate("xyz"):
        unit, tracker = np.eye(3)[k], np.zeros(TRACKER)
        tracker[SHIFT] = -rotation @ unit
        text = f"a shift of all spools and poses along {axis} {NOTHING}"
        yield from _written(parameters, text, _of_cables(robot, SPOOL, unit), tracker)
        tracker = np.zeros(TRACKER)
        tracker[TURN] = -rotation @ unit
        level = LEVEL if axis != "z" else ""
        text = f"a turn of all spools and poses about {axis} {NOTHING}{level}"
        yield from _written(parameters, text, _of_cables(robot, SPOOL, np.cross(unit, base)), tracker)
        if not isinstance(robot, PlatformRobot):
            continue
        for word, back, moves, target in (
            (f"shift of all attachment points along {axis}", "moved", unit, unit),
            (
                f"turn of all attachment points about {axis}",
                "turned",
                np.cross(unit, np.asarray(robot.platform_points)),
                np.cross(unit, setup.target),
            ),
        ):
            tracker = np.zeros(TRACKER)
            tracker[TARGET] = target
            text = f"a {word} of the platform, with poses {back} back, {NOTHING}"
            yield from _written(parameters, text, _of_cables(robot, ATTACHMENT, moves), tracker)
    yield from _scaled(parameters, setup)


def _of_cables(robot: Robot, part: slice, moves: np.ndarray) -> np.ndarray:
    numbers = np.zeros((robot.n_cables, LOCAL))
    numbers[:, part] = moves
    return numbers


def _scaled(parameters: Parameters, setup: Setup) -> Iterator[tuple[str, np.ndarray]]:
    robot = setup.robot
    if robot.winches is None:
        return
    numbers = np.zeros((robot.n_cables, LOCAL))
    numbers[:, SPOOL], numbers[:, DRUM] = robot.base_points, robot.winches.drum_radius
    numbers[:, OFFSET] = np.asarray(robot.winches.zero_length) + setup.offsets
    if isinstance(robot, PlatformRobot):
        numbers[:, ATTACHMENT] = robot.platform_points
    if robot.pulleys is not None:
        numbers[:, PULLEY] = robot.pulleys.radius
    tracker = np.zeros(TRACKER)
    tracker[TARGET] = setup.target
    text = f"one factor on the robot, its drums and the poses {NOTHING}; measure a distance between two spools"
    yield from _written(parameters, text, numbers, tracker)


def _written(
    parameters: Parameters, text: str, numbers: np.ndarray, tracker: np.ndarray
) -> Iterator[tuple[str, np.ndarray]]:
    # The motion as a vector of parameters, if it is one. The tracker matters only where it is free.
    count = parameters.count
    free = np.abs(parameters.of_tracker).any(axis=1)
    columns = np.concatenate([parameters.of_cables.reshape(-1, count), parameters.of_tracker])
    moves = np.concatenate([numbers.ravel(), np.where(free, tracker, 0.0)])
    vector = np.linalg.lstsq(columns, moves, rcond=None)[0]
    norm = np.linalg.norm(moves)
    if np.linalg.norm(vector) > INSIDE * norm and np.linalg.norm(columns @ vector - moves) <= INSIDE * norm:
        yield text, vector


def correlations(
    parameters: Parameters, covariance: Float[np.ndarray, "p p"], count: int
) -> list[tuple[str, str, float]]:
    """The most correlated pairs of parameters, the strongest first."""
    deviations = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))  # rounding of exact measurements
    safe = np.where(deviations > 0.0, deviations, 1.0)
    ratios = covariance / safe[:, None] / safe
    first, second = np.triu_indices(parameters.count, 1)
    values = ratios[first, second] * np.array([row.sign for row in parameters.rows])[first]
    values = values * np.array([row.sign for row in parameters.rows])[second]
    order = np.argsort(-np.abs(values), kind="stable")[:count]
    names = [row.name for row in parameters.rows]
    return [(names[first[i]], names[second[i]], float(values[i])) for i in order]
