"""Slacks of motions over their pieces, so that a search can be tightened where they are too small."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from cspr_jax.motion.motion import BoundedMotion
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.bounds.block_slacks import BATCH, block_slacks
from cspr_jax.verification.criteria import Criterion, criteria
from cspr_jax.verification.robustness.uncertain_slacks import lower_slacks, radii_of

# Half of the length of short blocks, over a usual length.
SHORT = 1e-6
LOOSE = 0.5  # bounds of a piece are close if they differ by less than this fraction of the violation,
SMALLEST = 1e-7  # which counts as no smaller than this, in the unit of the slack
HALVINGS = 5  # largest number of halvings of a piece
Sides = tuple[np.ndarray, np.ndarray]


class PieceSlacks(NamedTuple):
    """Bounds of the smallest slacks of criteria over pieces of a motion.

    Fields:
        rows: the criteria.
        low: (n_pieces, n_criteria) lower bounds, in units of the criteria.
        high: (n_pieces, n_criteria) upper bounds.
    """

    rows: list[Criterion]
    low: np.ndarray
    high: np.ndarray


def piece_slacks(
    problem: Problem, motion: BoundedMotion, knots: Float[np.ndarray, "n_pieces+1"], scene: Scene | None
) -> PieceSlacks:
    """Bounds of the slacks over pieces, for all robots within an uncertainty; close where they are negative."""

    def bounded(_: np.ndarray, start: np.ndarray, end: np.ndarray) -> Sides:
        slacks = block_slacks(problem.robot, problem.limits, motion.bounds, start, end, scene)
        if problem.limits.uncertainty is None:
            return slacks.low, slacks.high
        # In the middle of a block, lower bounds for all robots are close to the smallest slack of these robots.
        middles = motion.bounds(*short_blocks(0.5 * (start + end), end - start))
        low, high = (all_robots_slacks(problem, states) for states in (motion.bounds(start, end), middles))
        return _first_less(slacks.low, low), _first_less(slacks.high, high)

    rows = criteria(problem.robot, problem.limits, scene)
    return PieceSlacks(rows, *close_bounds(bounded, (knots[:-1], knots[1:]), SMALLEST, HALVINGS))


def all_robots_slacks(problem: Problem, states: StateBounds, multiple: float = 1.0) -> Float[np.ndarray, "k n"]:
    """Lower bounds of the slacks of tensions and limits of all robots within an uncertainty."""
    fraction = radii_of(problem.limits, np.full(len(states.position.middle), multiple))
    return in_batches(partial(lower_slacks, problem.robot, problem.limits), (states, fraction), batch_size=BATCH)


def short_blocks(times: Float[np.ndarray, "k"], lengths: Float[np.ndarray, "k"]) -> Sides:
    """Blocks that are short enough for nearly exact bounds."""
    return times - SHORT * lengths, times + SHORT * lengths


def _first_less(slacks: np.ndarray, others: np.ndarray) -> np.ndarray:
    # Replace the first columns of slacks by others where these are smaller.
    count = others.shape[1]
    return np.concatenate([np.minimum(slacks[:, :count], others), slacks[:, count:]], axis=1)


def close_bounds(
    bounded: Callable[[np.ndarray, np.ndarray, np.ndarray], Sides], ends: Sides, smallest: float, halvings: int
) -> Sides:
    """Bounds of the smallest slacks over pieces, which are halved while negative lower bounds are not close."""
    start, end = ends
    piece, bounds = np.arange(len(start)), None
    for level in range(halvings + 1):
        below, above = bounded(piece, start, end)
        low, high = bounds = bounds or (np.full(below.shape, np.inf), np.full(below.shape, np.inf))
        np.minimum.at(high, piece, above)
        # A block is small enough if its lower bound is about as close as its upper one.
        # Halving does not help if even the middle has no bound.
        is_open = (below < 0.0) & (below < above - LOOSE * np.maximum(-above, smallest))
        is_loose = np.any(is_open, axis=1) & (level < halvings)
        np.minimum.at(low, piece[~is_loose], below[~is_loose])
        if not is_loose.any():
            break
        piece, middle = np.repeat(piece[is_loose], 2), 0.5 * (start + end)[is_loose]
        start = np.stack([start[is_loose], middle], axis=1).ravel()
        end = np.stack([middle, end[is_loose]], axis=1).ravel()
    return low, high
