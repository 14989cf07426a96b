"""Cells of maps of workspaces: boxes of positions that lie wholly inside a workspace, or wholly outside of it."""

import itertools

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


class WorkspaceCells:
    """Proofs that whole cells of a robot lie inside or outside a workspace.

    In a cell that is proved inside, the robot meets the requirement at each position; in a cell that is proved outside,
    at none. Both allow for rounding. Nothing is proved for robots with pulleys.
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
        side = _sides(answers)
        proved = np.zeros(len(positions), bool)
        chosen = np.flatnonzero(side)
        if len(chosen) and self._robot.pulleys is None:
            quaternion = np.array(IDENTITY) if quaternion is None else np.asarray(quaternion)
            sizes = np.broadcast_to(np.asarray(half, float), positions.shape)[chosen]
            with double_precision():
                proofs = CellProofs(self._robot, self._search, quaternion)
                for first in range(0, len(chosen), ROUND):
                    rows = slice(first, first + ROUND)
                    numbers = chosen[rows]
                    cells = positions[numbers], sizes[rows], side[numbers], answers.margin[numbers]
                    proved[numbers] = self._proved(proofs, quaternion, *cells, depth)
        return proved & (side > 0), proved & (side < 0)

    def _proved(self, proofs, quaternion, centres, half, side, margin, depth) -> np.ndarray:
        """Tell whether cells lie wholly on the side of their centres, halved as often as `depth` allows."""
        is_proved = np.zeros(len(centres), bool)
        inside, outside = np.flatnonzero(side > 0), np.flatnonzero(side < 0)
        if len(inside):
            is_proved[inside] = proofs.least_margins(centres[inside], half[inside], margin[inside]) > 0.0
        if len(outside):
            is_proved[outside] = proofs.outside(centres[outside], half[outside])
        left = np.flatnonzero(~is_proved)
        if depth == 0 or len(left) == 0 or not half.any():
            return is_proved
        corners = np.array(list(itertools.product(*[(-0.5, 0.5) if size else (0.0,) for size in half.max(0)])))
        # Only cells whose parts all have their centres on the same side can be proved.
        inner = centres[left, None] + corners * half[left, None]
        sides, margins = self._centres(inner.reshape(-1, 3), quaternion)
        sides, margins = (values.reshape(inner.shape[:2]) for values in (sides, margins))
        agreeing = (sides == side[left, None]).all(1)
        if agreeing.any():
            halved, count = left[agreeing], len(corners)
            halves, part_sides = (np.repeat(values[halved], count, axis=0) for values in (0.5 * half, side))
            cells = inner[agreeing].reshape(-1, 3), halves, part_sides, margins[agreeing].ravel()
            parts = self._proved(proofs, quaternion, *cells, depth - 1)
            is_proved[halved] = parts.reshape(-1, count).all(1)
        return is_proved

    def _centres(self, positions: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        answers = self._search(positions, np.tile(quaternion, (len(positions), 1)))
        return _sides(answers), answers.margin


def _sides(answers: WorkspaceAnswers) -> np.ndarray:
    # Return 1 strictly inside, -1 strictly outside, else 0.
    return np.where(answers.verdict == 0, 1, np.where(answers.verdict == Verdict.WRENCH_INFEASIBLE, -1, 0))
