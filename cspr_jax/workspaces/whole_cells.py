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

# How often a cell that is not decided is halved along each axis: the first time decides most of what can be decided.
DEPTH = 1
# Cells at a time.
ROUND = 65536


class WorkspaceCells:
    """A question to whole cells of a robot.

    At each position of a cell proved inside the robot has what is asked, at each of a cell proved outside it has not,
    rounding included. Of a robot with pulleys nothing is proved.
    """

    def __init__(self, robot: AnyRobot, requirement: Requirement) -> None:
        """Prepare the question for a robot, centred, z down."""
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
            quaternion: (4,) unit quaternion of all of them, scalar first; None: no rotation.
            answers: of `WorkspaceSearch` at the centres. Centres that are undecided or singular prove nothing.
            depth: how often cells that are not decided are halved along each axis.

        Returns:
            (n,) whether a cell is proved inside; (n,) outside. Neither: not decided.
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
        # Only those can be proved all of whose parts have their centres on the same side.
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
    # Strictly inside 1, strictly outside -1, neither 0.
    return np.where(answers.verdict == 0, 1, np.where(answers.verdict == Verdict.WRENCH_INFEASIBLE, -1, 0))
