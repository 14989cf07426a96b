"""Slacks of any motion over each of its pieces, so that a search can be tightened where they are too small."""

from typing import NamedTuple

import numpy as np

from cspr_jax.motions.block_slacks import block_slacks
from cspr_jax.motions.criteria import Criterion, criteria
from cspr_jax.motions.motion import BoundedMotion
from cspr_jax.motions.problem import Problem
from cspr_jax.robots.clearance import Scene

# Times that a piece is halved, and by how much of what is missed, or of the least, its bounds may be apart.
HALVINGS, LOOSE, LEAST = 5, 0.5, 1e-7


class PieceSlacks(NamedTuple):
    """Bounds of the slacks of criteria over pieces of a motion.

    Fields:
        rows: the criteria.
        low: (n_pieces, n_criteria) lower bounds, in their units.
        high: (n_pieces, n_criteria) upper bounds.
    """

    rows: list[Criterion]
    low: np.ndarray
    high: np.ndarray


def piece_slacks(problem: Problem, motion: BoundedMotion, knots: np.ndarray, scene: Scene | None) -> PieceSlacks:
    """Bounds of the slacks over pieces, close where they are negative.

    Args:
        knots: (n_pieces + 1,) borders of the pieces, s.
        scene: as for `motions.proved_answers.proved_answers`.

    Returns:
        the bounds.
    """
    rows = criteria(problem.robot, problem.limits, scene)
    piece, start, end = np.arange(len(knots) - 1), knots[:-1], knots[1:]
    low, high = np.full((2, len(piece), len(rows)), np.inf)
    for level in range(HALVINGS + 1):
        slacks = block_slacks(problem.robot, problem.limits, motion.bounds, start, end, scene)
        np.minimum.at(high, piece, slacks.high)
        apart = slacks.high - slacks.low > LOOSE * np.maximum(-slacks.high, LEAST)
        is_loose = ((slacks.low < 0.0) & apart).any(1) & (level < HALVINGS)
        np.minimum.at(low, piece[~is_loose], slacks.low[~is_loose])
        if not is_loose.any():
            break
        piece, middle = np.repeat(piece[is_loose], 2), 0.5 * (start + end)[is_loose]
        start = np.stack([start[is_loose], middle], axis=1).ravel()
        end = np.stack([middle, end[is_loose]], axis=1).ravel()
    return PieceSlacks(rows, low, high)
