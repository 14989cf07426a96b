"""Proofs, without halving, that cells at one orientation lie fully inside or outside of a workspace."""

from __future__ import annotations

import dataclasses

import numpy as np

from cspr_jax.numerics.batches import in_batches, in_parts
from cspr_jax.numerics.elementary import unit_vectors
from cspr_jax.numerics.linear import lanes
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line
from cspr_jax.robots.statics.wrench_sets import spanning
from cspr_jax.robots.tensions.tension_rules import distributions
from cspr_jax.workspaces.cells.cells import cells_about
from cspr_jax.workspaces.cells.inside_cells import lower_margins
from cspr_jax.workspaces.cells.outside_cells import are_beyond, are_one_sided
from cspr_jax.workspaces.cells.shifts import leaving_points, shifts
from cspr_jax.workspaces.cells.worst_facet_normals import worst_facets
from cspr_jax.workspaces.requirements import CLOSURE
from cspr_jax.workspaces.search import WorkspaceSearch

PART = 256  # number of cells that are proved at a time, so that their arrays fit into a cache
BATCH = 1024  # number of poses whose facet normals are compared at a time
# Distance of tensions at the centre from their limits, as a fraction of the margin: at the full margin only one point
# is feasible, which rounding may exclude.
KEPT = 0.98
# Number of rounds of the search for displacements of spools with which a wrench cannot be supplied.
ROUNDS = 2


class CellProofs:
    """Proofs of cells at one orientation, without halving.

    `inside` holds for all robots whose spools are within a distance of their positions, `outside` for one of them.
    """

    def __init__(self, search: WorkspaceSearch, quaternion: np.ndarray, spools: float = 0.0) -> None:
        """Prepare proofs for the robot and requirement of a search; displaced spools exclude pulleys."""
        robot = search.robot
        self._robot, self._search, self._quaternion, self._spools = robot, search, quaternion, spools
        self._requirement, self._is_closure = search.requirement, search.requirement.condition == CLOSURE
        self._unbounded = tuple(np.isinf(search.requirement.high).tolist())
        self._arms, self._forces = cable_wrenches(robot, quaternion, search.unit)
        # The required wrenches are the same at every position, since the robot does not turn.
        required = search.required(np.zeros(3), quaternion)
        self._wrenches, self._enclosing = required.corners, required.enclosing.corners
        self._spreads = np.reshape(required.ellipsoids, (-1, robot.dof))
        self._boxed = search
        if required.ellipsoids:
            # Wrenches that include all required ones, with boxes about the ellipsoids.
            loads = search.requirement.wrenches.enclosing
            self._boxed = WorkspaceSearch(robot, dataclasses.replace(search.requirement, wrenches=loads))
        self._subsets = spanning(robot.n_cables, robot.dof)

    def matrices(self, positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n dof n_cables"]:
        """Wrench matrices."""
        return self._matrices(positions, self._exits(positions))

    def _matrices(self, positions: np.ndarray, exits: np.ndarray) -> np.ndarray:
        return np.einsum("nik,kmi->nmi", unit_vectors(exits - positions[:, None]), self._forces)

    def inside(self, positions: Float[np.ndarray, "n 3"], half: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Tell whether cells are proved to lie fully inside."""
        if not (self._spools or half.any()):
            return self._search(positions, np.tile(self._quaternion, (len(positions), 1))).verdict == 0
        return self.lower_margins(positions, half) > 0.0

    def lower_margins(
        self, positions: Float[np.ndarray, "n 3"], half: Float[np.ndarray, "n 3"]
    ) -> Float[np.ndarray, "n"]:
        """Lower bounds of margins over cells."""
        exits, moves = self._exits(positions), self._moves(positions, half) + self._spools
        units, count = self._matrices(positions, exits), len(self._arms)
        low, high, loads = self._requirement.low, self._requirement.high, self._enclosing
        margin = self._boxed(positions, np.tile(self._quaternion, (len(positions), 1))).margin
        if self._is_closure:  # tensions that give no wrench
            low, high, loads = np.zeros(count), np.full(count, np.inf), np.zeros((1, units.shape[1]))
            slack = np.ones((1, 1))
        else:
            scale = (np.abs(loads).max() + np.abs(low).max()) or 1.0
            slack = KEPT * np.where(np.isfinite(margin), np.maximum(margin, 0.0), scale)[:, None]
        tensions = [_tensions(units, load, low + slack, high - slack) for load in loads]

        def part(chosen):
            cells = cells_about(positions[chosen], half[chosen], exits[chosen], self._forces, moves[chosen])
            each = zip(tensions, loads, strict=True)
            return np.min([lower_margins(cells, x[chosen], load, low, high) for x, load in each], axis=0)

        return np.concatenate(in_parts(part, len(positions), PART))

    def outside(self, positions: Float[np.ndarray, "n 3"], half: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Tell whether cells are proved to lie fully outside."""
        low, high = self._requirement.low, self._requirement.high
        finite = np.where(self._unbounded, 0.0, high)
        condition = "closure" if self._is_closure else "tensions"

        def kernel(matrices):
            loads, unbounded = (self._wrenches, self._spreads), self._unbounded
            return worst_facets(matrices, *loads, low, finite, condition=condition, unbounded=unbounded)

        exits, moves = self._exits(positions), self._moves(positions, half)
        for left in range(ROUNDS if self._spools else 0, -1, -1):
            worst = in_batches(kernel, self._matrices(positions, exits), batch_size=BATCH)
            held, along = self._subsets[worst.subset], np.asarray(worst.normal)[:, None] * self._spreads
            loads = self._wrenches[worst.load] + (self._spreads * unit_vectors(along)).sum(1)
            if left:
                exits = self._exits(positions) + self._displacements(
                    positions, exits, np.asarray(worst.normal), held, loads
                )

        def proved(chosen, normals, held):
            cells = cells_about(positions[chosen], half[chosen], exits[chosen], self._forces, moves[chosen])
            if self._is_closure:
                return are_one_sided(cells, normals, held)
            return are_beyond(cells, normals, held, loads[chosen], low, high)

        def part(chosen):
            is_outside = proved(chosen, worst.inner[chosen], None)
            left = np.arange(chosen.start, chosen.stop)[~is_outside]
            is_outside[~is_outside] = proved(left, worst.normal[left], held[left])
            return is_outside

        return np.concatenate(in_parts(part, len(positions), PART))

    def _displacements(
        self, positions: np.ndarray, exits: np.ndarray, normals: np.ndarray, held: np.ndarray, loads: np.ndarray
    ) -> np.ndarray:
        # Displacements of spools, (n, n_cables, 3) m, with which, to first order, tensions supply the smallest wrench
        # along given normals. Cables that act along a normal are at their limits; the others have tensions that come
        # nearest to the wrench.
        matrices, units = self._matrices(positions, exits), unit_vectors(exits - positions[:, None])
        effects = np.einsum("nm,kmi->nik", normals, self._forces)
        products = (effects * units).sum(2)
        if self._is_closure:
            tensions = -np.ones(products.shape)
            np.put_along_axis(tensions, held, 0.0, axis=1)
        else:
            bounds = np.where(self._unbounded, self._requirement.low, self._requirement.high)
            tensions = np.where(products > 0.0, bounds, self._requirement.low)
            np.put_along_axis(tensions, held, 0.0, axis=1)
            missing = loads - (matrices @ tensions[..., None])[..., 0]
            balancing = np.linalg.pinv(np.take_along_axis(matrices, held[:, None], axis=2)) @ missing[..., None]
            np.put_along_axis(tensions, held, balancing[..., 0], axis=1)
        return -self._spools * unit_vectors(tensions[..., None] * (effects - products[..., None] * units))

    def _exits(self, positions: np.ndarray) -> np.ndarray:
        # Points at which cables leave, minus the arms of their attachment points, (n, n_cables, 3).
        return leaving_points(self._robot, positions, self._quaternion) - self._arms

    def _moves(self, positions: np.ndarray, half: np.ndarray) -> np.ndarray:
        # Largest movement of exits, (n, n_cables); infinite where an attachment point may be within its pulley.
        if self._robot.pulleys is None:
            return np.zeros((len(positions), len(self._arms)))
        turns = np.tile(self._quaternion, (len(positions), 1))
        moved = shifts(self._robot, positions, turns, np.linalg.norm(half, axis=1))
        return np.where(moved.free > 0.0, moved.exits[:, None], np.inf)


def _tensions(units: np.ndarray, wrench: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    shape = len(units), units.shape[2]
    limits = [np.broadcast_to(limit, shape) for limit in (low, high)]
    return np.asarray(distributions(units, np.broadcast_to(wrench, (len(units), len(wrench))), *limits).tensions)


def cable_wrenches(
    robot: AnyRobot, quaternion: Float[np.ndarray, "4"], unit: Float[np.ndarray, "dof"]
) -> tuple[Float[np.ndarray, "n_cables 3"], Float[np.ndarray, "3 dof n_cables"]]:
    """Wrenches of forces at the attachment points."""
    row, count = PATTERNS[robot.pattern], robot.n_cables
    axes = np.eye(3)
    forces = np.repeat(axes[list(row.forces)].T[..., None], count, axis=2)
    if not isinstance(robot, PlatformRobot):
        return np.zeros((count, 3)), forces / unit[:, None]
    rotation = np.array([[float(x) for x in line] for line in lanes.rotation_matrix(tuple(quaternion))])
    arms = np.asarray(robot.platform_points) @ rotation.T
    moments = np.cross(arms, axes[:, None])  # (3, n_cables, 3)
    directions = rotation @ np.asarray(across_line(robot)) if row.along_line else axes[:, list(row.moments)]
    return arms, np.concatenate([forces, (moments @ directions).transpose(0, 2, 1)], axis=1) / unit[:, None]
