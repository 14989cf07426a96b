"""Proofs of full cells of maps for all conditions of a workspace together. Arrays in, answers out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.schema.meanings import OPEN_CONDITIONS
from cspr_jax.schema.verdicts import FLAGS, OPEN, Verdict
from cspr_jax.workspaces.all_robots import AllRobots, MassSearch
from cspr_jax.workspaces.cells.cell_proofs import CellProofs
from cspr_jax.workspaces.cells.contact_cells import clearance_bounds
from cspr_jax.workspaces.cells.shifts import Shifts, leaving_points, shifts, unit_changes
from cspr_jax.workspaces.cells.speeds import CableSpeeds
from cspr_jax.workspaces.cells.whole_cells import ROUND, proved_sides, sides_of
from cspr_jax.workspaces.clearances import nearer_exits
from cspr_jax.workspaces.poses.geometry import mass_centres
from cspr_jax.workspaces.requirements import CLOSURE
from cspr_jax.workspaces.search import WorkspaceSearch
from cspr_jax.workspaces.static_poses import RestPoses

# Number of times that open cells are halved along each axis.
DEPTH = 2
# Error of distances, m: far above the rounding of coordinates below 1e6 m, far below measurable distances.
CLOSE = 1e-9
LIMITS = {"floor_margin": "floor", "length_margin": "cable lengths", "speed_margin": "cable speeds"}


class RestCells:
    """Proofs, at one orientation, that full cells lie on one side of a workspace.

    While a robot translates, its heights and the lengths of its cables change by at most the distance that it moves;
    `workspaces.cells.shifts` bounds the change of speeds of cables. With an uncertainty, a pose is inside if it is
    for all robots, and outside if it is for one; single poses are cells of zero extent.
    """

    def __init__(self, poses: RestPoses, quaternion: np.ndarray, all_robots: AllRobots | None = None) -> None:
        """Prepare the proofs for a unit quaternion (4,), scalar first; proofs for all robots exclude pulleys."""
        self._poses, self._robot, self._quaternion, self._all_robots = poses, poses.robot, quaternion, all_robots
        self._spools = 0.0 if all_robots is None else all_robots.spools
        single = {name: [MassSearch(one, one)] for name, one in poses.searches.items()}
        searches = single if all_robots is None else all_robots.searches
        with double_precision():
            self._proofs = [self._mass_proofs(one) for each in searches.values() for one in each]
        self._names = ["closure" if name == CLOSURE else "tensions" for name, each in searches.items() for _ in each]
        self._has_contacts = poses.around is not None and bool(poses.around.contact_pairs)
        self._names += ["clearances"] * self._has_contacts
        self._names += [LIMITS[name] for name, *_ in poses.limited(np.zeros((1, 3)), self._turns(1))]

    def _mass_proofs(self, searches: MassSearch) -> tuple[CellProofs, CellProofs, WorkspaceSearch]:
        # Proofs that cells are inside, proofs that they are outside, and the search for poses that may be outside.
        enclosing, attained = searches
        outside = CellProofs(attained, self._quaternion, self._spools)
        inside = outside if enclosing is attained else CellProofs(enclosing, self._quaternion, self._spools)
        return inside, outside, attained

    def __call__(
        self, origins: Float[np.ndarray, "n 3"], half: Float[np.ndarray, "n 3"], *, depth: int = DEPTH
    ) -> tuple[Int[np.ndarray, "n"], Int[np.ndarray, "n"]]:
        """Tell which cells are proved to lie fully on one side of the workspace."""
        sides, reasons = np.zeros(len(origins), np.int16), np.zeros(len(origins), np.int16)
        numbers = np.array([OPEN_CONDITIONS.index(name) for name in self._names])
        with double_precision():
            for first in range(0, len(origins), ROUND):
                part = slice(first, first + ROUND)
                centres = self.at(origins[part])
                held = np.zeros((len(centres), len(numbers)), bool)
                result = proved_sides(self, origins[part], half[part], centres, held, depth)
                sides[part] = np.where(result.proved, np.where(centres > 0, 1, 2), 0)
                # Report the first of several open conditions.
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
        verdict = self.verdicts(positions, self._poses(positions, self._turns(len(positions)))["verdict"])
        is_open = (verdict & ~FLAGS(OPEN.value)) == 0
        return np.where(verdict == 0, 1, np.where(is_open, 0, -1))

    def verdicts(self, positions: Float[np.ndarray, "n 3"], verdict: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
        """Verdicts about all robots."""
        if self._all_robots is None:
            return verdict
        verdict, chosen = verdict.copy(), np.flatnonzero(verdict == 0)
        # Conditions that hold for all robots if they hold for one.
        are_same = [name == "floor" or (not self._spools and name != "tensions") for name in self._names]
        for side in (1, -1):
            if len(chosen) == 0:
                break
            held, none = np.tile(are_same, (len(chosen), 1)), np.zeros((len(chosen), 3))
            with double_precision():
                held, is_broken = self.proved(positions[chosen], none, np.full(len(chosen), side), held)
            verdict[chosen] = np.where(is_broken, Verdict.UNCERTAINTY, Verdict.UNDECIDED)
            if side > 0:
                verdict[chosen[held.all(1)]] = 0
                chosen = chosen[~held.all(1)]
        return verdict

    def proved(
        self, positions: np.ndarray, half: np.ndarray, sides: np.ndarray, held: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Proofs of cells without halving; see `whole_cells.CellConditions`."""
        held, is_broken = held.copy(), np.zeros(len(positions), bool)
        turns, radius = self._turns(len(positions)), np.linalg.norm(half, axis=1)
        positions = self._poses.origins(positions, turns)
        mass_positions = mass_centres(self._robot, positions, turns)
        moved = shifts(self._robot, mass_positions, turns, radius)
        for k, (inside, outside, search) in enumerate(self._proofs):
            chosen = np.flatnonzero((sides > 0) & ~held[:, k])
            if len(chosen):
                held[chosen, k] = inside.inside(mass_positions[chosen], half[chosen])
            chosen = np.flatnonzero((sides < 0) & ~is_broken)
            answers = search(mass_positions[chosen], turns[chosen])
            chosen = chosen[answers.margin > -np.inf if self._spools else sides_of(answers) < 0]
            if len(chosen):
                is_broken[chosen] = outside.outside(mass_positions[chosen], half[chosen])
        distances = self._distances(positions, mass_positions, half, moved, sides)
        for k, (low, high) in enumerate(distances, len(self._proofs)):
            held[:, k] |= low > CLOSE
            is_broken |= high < -CLOSE
        if self._robot.pulleys is not None:
            # There is no free cable if an attachment point may be within its pulley.
            held &= (moved.free > 0.0).all(1, keepdims=True)
        return held, is_broken

    def _distances(
        self, positions: np.ndarray, mass_positions: np.ndarray, half: np.ndarray, moved: Shifts, sides: np.ndarray
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        # Yield bounds (n,) of the smallest slacks of clearances and of each limit: for all robots, and for one.
        poses, turns = self._poses, self._turns(len(positions))
        if poses.around is not None and self._has_contacts:
            yield self._clearances(poses.around, mass_positions, half, moved, sides)
        for name, _, slack, missed in poses.limited(positions, turns):
            change = moved.robot[:, None]
            low, high = slack - change, slack + change
            if name == "length_margin":
                low, high = low - self._spools, high - self._spools
            if name == "speed_margin" and poses.speeds is not None:
                low, high = self._speeds(poses.speeds, positions, mass_positions, moved, slack)
            yield (low + missed).min(1), (high + missed).min(1)

    def _speeds(
        self, speeds: CableSpeeds, positions: np.ndarray, mass_positions: np.ndarray, moved: Shifts, slack: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        change = speeds.changes(moved)
        if not self._spools:
            return slack - change, slack + change
        farther = shifts(self._robot, mass_positions, self._turns(len(positions)), moved.robot + self._spools)
        low, high = slack - speeds.changes(farther), slack + change
        margins, lengths = speeds.displaced(positions, self._quaternion, self._spools)
        units = unit_changes(moved.robot[:, None], lengths - moved.robot[:, None])
        return low, np.minimum(high, margins + speeds.changes(moved._replace(units=units)))

    def _clearances(
        self, around: Scene, mass_positions: np.ndarray, half: np.ndarray, moved: Shifts, sides: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        exits = leaving_points(self._robot, mass_positions, self._quaternion)
        moves = np.broadcast_to(moved.exits[:, None], exits.shape[:2])

        def bounds(chosen: np.ndarray, exits: np.ndarray, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            cells = mass_positions[chosen], half[chosen]
            return clearance_bounds(self._robot, around, self._quaternion, *cells, exits, moves[chosen])

        if not self._spools:
            return bounds(np.arange(len(half)), exits, moves)
        low, high = np.full(len(half), -np.inf), np.full(len(half), np.inf)
        inside, outside = np.flatnonzero(sides > 0), np.flatnonzero(sides < 0)
        if len(inside):
            low[inside] = bounds(inside, exits[inside], moves + self._spools)[0]
        if len(outside):
            turns = self._turns(len(outside))
            near = nearer_exits(self._robot, around, mass_positions[outside], turns, exits[outside], self._spools)
            high[outside] = np.min([bounds(outside, one, moves)[1] for one in (exits[outside], *near)], axis=0)
        return low, high
