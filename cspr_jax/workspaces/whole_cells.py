"""Cells of maps of workspaces: boxes of positions that lie wholly inside a workspace, or wholly outside of it."""

import itertools
from typing import NamedTuple, Protocol

import numpy as np

from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.arithmetic.frames import IDENTITY
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.workspaces.cell_proofs import CellProofs
from cspr_jax.workspaces.questions import Requirement
from cspr_jax.workspaces.search import WorkspaceAnswers, WorkspaceSearch

# How often an open cell is halved along each axis: the first halving decides most cells that can be decided.
DEPTH = 1
# Cells that are proved at a time.
ROUND = 65536


class CellConditions(Protocol):
    """Conditions on positions, each of which can be proved to hold in whole cells, or one of which to fail."""

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
            half: (n, 3) half sizes, m.
            sides: (n,) of the centres.
            held: (n, n_conditions) conditions that hold in the whole cell already.

        Returns:
            (n, n_conditions) conditions that hold in the whole cell; (n,) whether one is broken at each position.
        """


class CellSides(NamedTuple):
    """Results of proofs of cells.

    Fields:
        proved: (n,) whether the cell lies wholly on the side of its centre.
        held: (n, n_conditions) conditions that are proved to hold in the whole cell.
        mixed: (n,) whether the cell has positions on two sides.
    """

    proved: np.ndarray
    held: np.ndarray
    mixed: np.ndarray


def proved_sides(
    conditions: CellConditions, positions: np.ndarray, half: np.ndarray, sides: np.ndarray, held: np.ndarray, depth: int
) -> CellSides:
    """Tell which cells lie wholly on the side of their centres, open ones halved as often as `depth` allows.

    Args:
        positions: (n, 3) centres, m.
        half: (n, 3) half sizes, m.
        sides: (n,) of the centres; 0 proves nothing.
        held: (n, n_conditions) conditions that hold in the whole cell.
        depth: how often open cells are halved along each axis.

    Returns:
        the results.
    """
    held, is_broken = conditions.proved(positions, half, sides, held)
    result = CellSides(np.where(sides > 0, held.all(1), is_broken & (sides < 0)), held, np.zeros(len(sides), bool))
    left = np.flatnonzero(~result.proved & (sides != 0))
    if depth == 0 or len(left) == 0 or not half.any():
        return result
    corners = np.array(list(itertools.product(*[(-0.5, 0.5) if size else (0.0,) for size in half.max(0)])))
    inner = positions[left, None] + corners * half[left, None]
    part_sides = conditions.at(inner.reshape(-1, 3)).reshape(inner.shape[:2])
    result.mixed[left] = (part_sides == -sides[left, None]).any(1)
    # Only cells whose parts all have their centres on the same side can be proved.
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


class WorkspaceCells:
    """Proofs that whole cells of a robot lie inside or outside a workspace.

    In a cell that is proved inside, the robot meets the requirement at each position; in a cell that is proved outside,
    at none. Both allow for rounding.
    """

    def __init__(self, robot: AnyRobot, requirement: Requirement) -> None:
        """Prepare the proofs for a robot, centred, z down."""
        self._robot, self._search = robot, WorkspaceSearch(robot, requirement)

    def __call__(
        self,
        positions: np.ndarray,
        half: np.ndarray,
        quaternion: np.ndarray | None,
        answers: WorkspaceAnswers,
        *,
        depth: int = DEPTH,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tell which cells lie wholly inside, and which wholly outside.

        Args:
            positions: (n, 3) centres of the cells, of the mass centre, or of the joint, m.
            half: (3,) or (n, 3) half sizes along the axes, at least 0, m.
            quaternion: (4,) unit quaternion of all cells, scalar first; None: no rotation.
            answers: of `WorkspaceSearch` at the centres. Centres that are undecided or singular prove nothing.
            depth: how often open cells are halved along each axis.

        Returns:
            (n,) whether each cell is proved inside; (n,) whether it is proved outside.
        """
        side = sides_of(answers)
        proved = np.zeros(len(positions), bool)
        chosen = np.flatnonzero(side)
        if len(chosen):
            quaternion = np.array(IDENTITY) if quaternion is None else np.asarray(quaternion)
            sizes = np.broadcast_to(np.asarray(half, float), positions.shape)[chosen]
            with double_precision():
                condition = _Condition(CellProofs(self._robot, self._search, quaternion), self._search, quaternion)
                for first in range(0, len(chosen), ROUND):
                    rows = slice(first, first + ROUND)
                    numbers = chosen[rows]
                    open_cells = side[numbers], np.zeros((len(numbers), 1), bool)
                    result = proved_sides(condition, positions[numbers], sizes[rows], *open_cells, depth)
                    proved[numbers] = result.proved
        return proved & (side > 0), proved & (side < 0)


class _Condition:
    # One condition on the cables, at one orientation.

    def __init__(self, proofs: CellProofs, search: WorkspaceSearch, quaternion: np.ndarray) -> None:
        self._proofs, self._search, self._quaternion = proofs, search, quaternion

    def _answers(self, positions: np.ndarray) -> WorkspaceAnswers:
        return self._search(positions, np.tile(self._quaternion, (len(positions), 1)))

    def at(self, positions: np.ndarray) -> np.ndarray:
        return sides_of(self._answers(positions))

    def proved(self, positions, half, sides, held) -> tuple[np.ndarray, np.ndarray]:
        held, is_broken = held.copy(), np.zeros(len(positions), bool)
        inside, outside = np.flatnonzero(sides > 0), np.flatnonzero(sides < 0)
        if len(inside):
            margin = self._answers(positions[inside]).margin
            held[inside, 0] = self._proofs.least_margins(positions[inside], half[inside], margin) > 0.0
        if len(outside):
            is_broken[outside] = self._proofs.outside(positions[outside], half[outside])
        return held, is_broken


def sides_of(answers: WorkspaceAnswers) -> np.ndarray:
    """Sides of poses.

    Returns:
        (n,) 1 strictly inside, -1 strictly outside, else 0.
    """
    return np.where(answers.verdict == 0, 1, np.where(answers.verdict == Verdict.WRENCH_INFEASIBLE, -1, 0))
