"""Proofs that cells of maps, boxes of positions, lie fully inside or outside of a workspace."""

from __future__ import annotations

import itertools
from typing import NamedTuple, Protocol

import numpy as np

from cspr_jax.numerics.shapes import Bool, Float, Int
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.workspaces.search import WorkspaceAnswers

# Number of cells that are proved at a time.
ROUND = 65536


class CellConditions(Protocol):
    """Conditions on positions, which can be proved to hold, or to fail, in full cells."""

    def at(self, positions: np.ndarray) -> np.ndarray:
        """Sides of positions.

        Args:
            positions: (n, 3) m.

        Returns:
            (n,) 1 strictly inside, -1 strictly outside, else 0.
        """

    def proved(
        self, positions: np.ndarray, half: np.ndarray, sides: np.ndarray, held: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Prove conditions over cells, without halving.

        Args:
            positions: (n, 3) centres, m.
            half: (n, 3) half of the cells' extents, m.
            sides: (n,) sides of the centres.
            held: (n, n_conditions) conditions that have been proved in the full cell.

        Returns:
            (n, n_conditions) conditions that hold in the full cell; (n,) whether at each position one fails.
        """


class CellSides(NamedTuple):
    """Results of proofs of cells.

    Fields:
        proved: (n,) whether the cell lies fully on the side of its centre.
        held: (n, n_conditions) conditions that are proved to hold in the full cell.
        mixed: (n,) whether the cell has positions on both sides.
    """

    proved: np.ndarray
    held: np.ndarray
    mixed: np.ndarray


def proved_sides(
    conditions: CellConditions,
    positions: Float[np.ndarray, "n 3"],
    half: Float[np.ndarray, "n 3"],
    sides: Int[np.ndarray, "n"],
    held: Bool[np.ndarray, "n n_conditions"],
    depth: int,
) -> CellSides:
    """Tell which cells lie fully on the side of their centres; undecided ones are halved up to `depth` times."""
    held, is_broken = conditions.proved(positions, half, sides, held)
    result = CellSides(np.where(sides > 0, held.all(1), is_broken & (sides < 0)), held, np.zeros(len(sides), bool))
    left = np.flatnonzero(~result.proved & (sides != 0))
    if depth == 0 or len(left) == 0 or not half.any():
        return result
    corners = np.array(list(itertools.product(*[(-0.5, 0.5) if h else (0.0,) for h in half.max(0)])))
    inner = positions[left, None] + corners * half[left, None]
    part_sides = conditions.at(inner.reshape(-1, 3)).reshape(inner.shape[:2])
    result.mixed[left] = (part_sides == -sides[left, None]).any(1)
    # A cell can be proved only if the centres of all its parts are on the same side.
    agreeing = (part_sides == sides[left, None]).all(1)
    if agreeing.any():
        halved, count = left[agreeing], len(corners)
        halves, own_sides, own_held = (np.repeat(values[halved], count, axis=0) for values in (0.5 * half, sides, held))
        parts = proved_sides(conditions, inner[agreeing].reshape(-1, 3), halves, own_sides, own_held, depth - 1)
        shape = len(halved), count
        result.proved[halved], result.mixed[halved] = (
            parts.proved.reshape(shape).all(1),
            parts.mixed.reshape(shape).any(1),
        )
        result.held[halved] = parts.held.reshape(*shape, -1).all(1)
    return result


def sides_of(answers: WorkspaceAnswers) -> Int[np.ndarray, "n"]:
    """Sides of poses."""
    return np.where(answers.verdict == 0, 1, np.where(answers.verdict == Verdict.WRENCH_INFEASIBLE, -1, 0))
