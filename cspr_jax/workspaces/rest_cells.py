"""Whole cells of maps of workspaces against all conditions of a workspace. Arrays in, answers out."""

import numpy as np

from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.robots.clearance import Scene
from cspr_jax.schema.meanings import OPEN_CONDITIONS
from cspr_jax.schema.verdicts import FLAGS, OPEN
from cspr_jax.workspaces.cell_proofs import CellProofs
from cspr_jax.workspaces.contact_cells import clearance_bounds
from cspr_jax.workspaces.geometry import mass_centres
from cspr_jax.workspaces.questions import CLOSURE
from cspr_jax.workspaces.rest_poses import RestPoses
from cspr_jax.workspaces.shifts import Shifts, leaving_points, shifts
from cspr_jax.workspaces.whole_cells import ROUND, proved_sides, sides_of

# How often open cells are halved along each axis.
DEPTH = 2
# Rounding of distances, m: far above what coordinates below 1e6 m have, far below what anybody measures.
CLOSE = 1e-9
LIMITS = {"floor_margin": "floor", "length_margin": "cable lengths", "speed_margin": "cable speeds"}


class RestCells:
    """Proofs, at one orientation, that whole cells lie on one side of a workspace.

    While a robot moves by a distance without turning, its heights and the lengths of its cables change by no more than
    this distance; speeds of cables change as `workspaces.shifts` says.
    """

    def __init__(self, poses: RestPoses, quaternion: np.ndarray) -> None:
        """Prepare the proofs, for a unit quaternion (4,), scalar first."""
        self._poses, self._robot, self._quaternion = poses, poses.robot, quaternion
        with double_precision():
            self._searches = [(s, CellProofs(self._robot, s, quaternion)) for s in poses.searches.values()]
        self._names = ["closure" if s.requirement.condition == CLOSURE else "tensions" for s, _ in self._searches]
        self._has_contacts = poses.around is not None and bool(poses.around.meetings)
        self._names += ["clearances"] * self._has_contacts
        self._names += [LIMITS[name] for name, _, _ in poses.limited(np.zeros((1, 3)), self._turns(1))]

    def __call__(self, origins: np.ndarray, half: np.ndarray, *, depth: int = DEPTH) -> tuple[np.ndarray, np.ndarray]:
        """Tell which cells are proved to lie wholly on one side of the workspace.

        Args:
            origins: (n, 3) of the platform at the centres of the cells, kernels' coordinates, m.
            half: (n, 3) half sizes of the cells, m.
            depth: how often open cells are halved along each axis.

        Returns:
            (n,) 0: neither side is proved; 1: inside; 2: outside, as in `schema.meanings.CELL_SIDES`; (n,) what leaves
            the cell open, numbers of `schema.meanings.OPEN_CONDITIONS`.
        """
        sides, reasons = np.zeros(len(origins), np.int16), np.zeros(len(origins), np.int16)
        numbers = np.array([OPEN_CONDITIONS.index(name) for name in self._names])
        with double_precision():
            for first in range(0, len(origins), ROUND):
                part = slice(first, first + ROUND)
                centres = self.at(origins[part])
                held = np.zeros((len(centres), len(numbers)), bool)
                result = proved_sides(self, origins[part], half[part], centres, held, depth)
                sides[part] = np.where(result.proved, np.where(centres > 0, 1, 2), 0)
                # The first of several conditions.
                open_condition = numbers[np.argmin(result.held, axis=1)]
                is_border = result.mixed | (centres == 0)
                reason = np.where(is_border, OPEN_CONDITIONS.index("boundary"), open_condition)
                outside = OPEN_CONDITIONS.index("outside")
                reasons[part] = np.where(result.proved, 0, np.where(is_border | (centres > 0), reason, outside))
        return sides, reasons

    def _turns(self, count: int) -> np.ndarray:
        return np.repeat(self._quaternion[None], count, axis=0)

    def at(self, positions: np.ndarray) -> np.ndarray:
        """Sides of positions; see `whole_cells.CellConditions`."""
        verdict = self._poses(positions, self._turns(len(positions)))["verdict"]
        is_open = (verdict & ~FLAGS(OPEN.value)) == 0
        return np.where(verdict == 0, 1, np.where(is_open, 0, -1))

    def proved(
        self, positions: np.ndarray, half: np.ndarray, sides: np.ndarray, held: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Proofs of cells without halving; see `whole_cells.CellConditions`."""
        held, is_broken = held.copy(), np.zeros(len(positions), bool)
        turns, radius = self._turns(len(positions)), np.linalg.norm(half, axis=1)
        positions = self._poses.origins(positions, turns)
        mass_positions = mass_centres(self._robot, positions, turns)
        moved = shifts(self._robot, mass_positions, turns, radius)
        for k, (search, proofs) in enumerate(self._searches):
            answers = search(mass_positions, turns)
            chosen = np.flatnonzero((sides > 0) & ~held[:, k])
            if len(chosen):
                bounds = proofs.least_margins(mass_positions[chosen], half[chosen], answers.margin[chosen])
                held[chosen, k] = bounds > 0.0
            chosen = np.flatnonzero((sides < 0) & ~is_broken & (sides_of(answers) < 0))
            if len(chosen):
                is_broken[chosen] = proofs.outside(mass_positions[chosen], half[chosen])
        for k, (low, high) in enumerate(
            self._distances(positions, mass_positions, half, moved, sides), len(self._searches)
        ):
            held[:, k] |= low > CLOSE
            is_broken |= high < -CLOSE
        if self._robot.pulleys is not None:
            # An attachment point within a pulley has no free cable.
            held &= (moved.free > 0.0).all(1, keepdims=True)
        return held, is_broken

    def _distances(self, positions, mass_positions, half, moved: Shifts, sides: np.ndarray):
        # Yield bounds (n,) of the smallest slack of clearances and of each limit.
        poses, turns = self._poses, self._turns(len(positions))
        if poses.around is not None and self._has_contacts:
            yield self._clearances(poses.around, mass_positions, half, moved)
        changes = {} if poses.speeds is None else {"speed_margin": poses.speeds.changes(moved)}
        for name, _, slack in poses.limited(positions, turns):
            change = changes.get(name, moved.robot[:, None])
            yield (slack - change).min(1), (slack + change).min(1)

    def _clearances(
        self, around: Scene, mass_positions: np.ndarray, half: np.ndarray, moved: Shifts
    ) -> tuple[np.ndarray, np.ndarray]:
        exits = leaving_points(self._robot, mass_positions, self._quaternion)
        moves = np.broadcast_to(moved.exits[:, None], exits.shape[:2])
        return clearance_bounds(self._robot, around, self._quaternion, mass_positions, half, exits, moves)
