"""Lengths of cables from what was measured: lengths, or angles of motors."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
from numpy.typing import ArrayLike

from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.model.winches import cable_lengths

LARGEST_LENGTH = 1e6  # m


def lengths_of(robot: Any, source: ArrayLike, *, is_angle: bool) -> Float[np.ndarray, "n n_cables"]:
    """Lengths of cables, m, from lengths, m, or angles of motors, rad."""
    values, count = np.atleast_2d(np.asarray(source, float)), robot.n_cables
    if values.shape[1] != count:
        allowed = f"must be ({count},), one a cable, or (n, {count})"
        raise InputError("lengths", None, allowed, problem=f"an array of shape {np.shape(source)}")
    if is_angle:
        if robot.winches is None:
            allowed = "must be absent: the robot has no [winch], which gives lengths of angles"
            raise InputError("angles", None, allowed, problem="given")
        values = np.asarray(jax.vmap(lambda row: cable_lengths(robot.winches, row))(values))
    return values


def checked_lengths(
    robot: Any, source: ArrayLike, *, is_angle: bool, lines: Int[np.ndarray, "n"] | None = None
) -> Float[np.ndarray, "n n_cables"]:
    """Lengths of cables, m, that are above 0; of a file, errors name one of its lines."""
    values, sources = lengths_of(robot, source, is_angle=is_angle), np.atleast_2d(np.asarray(source, float))
    is_wrong = ~((values > 0.0) & (values <= LARGEST_LENGTH))
    if not is_wrong.any():
        return values
    row, cable = np.argwhere(is_wrong)[0]
    allowed = "a length > 0, at most 1e6 m"
    if is_angle:
        allowed = f"an angle that gives {allowed}, not {values[row, cable]:.9g} m"
    key = f"{'angles' if is_angle else 'lengths'}[{row}, {cable}]"
    if lines is not None:
        key = f"line {lines[row]}: {'angle' if is_angle else 'length'}_{cable + 1}"
    raise InputError(key, float(sources[row, cable]), allowed)
