"""Lengths of cables from what was measured: lengths, or angles of motors."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
from numpy.typing import ArrayLike

from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.winches import cable_lengths

LARGEST_LENGTH = 1e6  # m


def lengths_of(robot: Any, source: ArrayLike, *, is_angle: bool) -> Float[np.ndarray, "n n_cables"]:
    """Lengths of cables, m, from lengths or angles of motors."""
    values = np.atleast_2d(np.asarray(source, float))
    if values.shape[1] != robot.n_cables:
        allowed = f"finite numbers of shape ({robot.n_cables},) or (n, {robot.n_cables})"
        raise InputError("lengths", f"shape {np.shape(source)}", allowed)
    if is_angle:
        if robot.winches is None:
            raise InputError("angles", True, "False: the robot has no [winch], which gives lengths of angles")
        values = np.asarray(jax.vmap(lambda row: cable_lengths(robot.winches, row))(values))
    return values


def checked_lengths(
    robot: Any, source: ArrayLike, *, is_angle: bool, lines: np.ndarray | None = None
) -> Float[np.ndarray, "n n_cables"]:
    """Lengths of cables, m, that are above 0; of a file, errors name one of its lines."""
    values, name = lengths_of(robot, source, is_angle=is_angle), "angles" if is_angle else "lengths"
    bad = np.flatnonzero(~((values > 0.0) & (values <= LARGEST_LENGTH)).all(1))
    if len(bad):
        allowed = "lengths > 0, at most 1e6 m" if not is_angle else "angles that give lengths > 0, at most 1e6 m"
        key = f"{name}[{bad[0]}]" if lines is None else f"line {lines[bad[0]]}: {name}"
        raise InputError(key, np.atleast_2d(np.asarray(source, float))[bad[0]].tolist(), allowed)
    return values
