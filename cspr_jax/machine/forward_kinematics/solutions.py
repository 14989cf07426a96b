"""Poses in which cables have given lengths: in closed form where there is one, else from one start or from many.

Robots are those of the kernels: z down, the origin at the centroid of the spools.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from cspr_jax.machine.forward_kinematics import planar_platforms, spheres
from cspr_jax.machine.forward_kinematics.least_squares import Fits, fitted
from cspr_jax.machine.forward_kinematics.planar_platforms import Cables
from cspr_jax.numerics.batches import in_batches, in_parts
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.shapes import Bool, Float, Int
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, platform_radius
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.workspaces.poses import geometry

# Lengths of a solution are met to this fraction of the robot's size, where there are as many as degrees of freedom.
MET = 1e-9
# The same for platforms in the plane after Newton's steps; where solutions meet, errors of poses are the square roots.
VERIFIED = 1e-12
# Attachment points of two solutions that are closer than this, over the robot's size, are those of one: lengths tell
# two such poses apart by their last digits only, since they differ by the square of the distance.
SAME = 3e-6
# Further starts are tried if lengths of redundant cables differ by more than this, over the robot's size.
POOR = 1e-3
# Solutions of redundant cables beside the best fit at most so many times worse.
WORSE = 3.0
SPATIAL_STARTS, PLANAR_STARTS = 64, 12
BATCH = 4096
PART = 1 << 14
CHUNK = 1 << 12  # sets of lengths whose solutions are sought at once
_COLUMNS = ("positions", "quaternions", "residuals", "is_found", "steps")


@dataclasses.dataclass(frozen=True)
class SolvedPoses:
    """Solutions for n sets of lengths, k each, the chosen ones first.

    Fields:
        positions: (n, k, 3) mass centre, or joint, m.
        quaternions: (n, k, 4).
        residuals: (n, k, n_cables) lengths of the cables in the pose minus given ones, m.
        is_found: (n, k) whether the pose is a solution; the first one is the nearest that there is otherwise.
        steps: (n, k) number of steps of Gauss-Newton; 0 for closed forms.
        is_complete: whether there are no other solutions.
    """

    positions: np.ndarray
    quaternions: np.ndarray
    residuals: np.ndarray
    is_found: np.ndarray
    steps: np.ndarray
    is_complete: bool = False

    def shaped(self, shape: tuple[int, int]) -> SolvedPoses:
        """The same solutions as another table."""
        changes = {name: getattr(self, name)[:, 0] for name in _COLUMNS}
        return dataclasses.replace(self, **{name: x.reshape(*shape, *x.shape[1:]) for name, x in changes.items()})

    def selected(self, index: Int[np.ndarray, "n j"]) -> SolvedPoses:
        """Some solutions of each set, in another order."""
        each = np.arange(len(index))[:, None]
        return dataclasses.replace(self, **{name: getattr(self, name)[each, index] for name in _COLUMNS})


class Search:
    """Search for the poses of a robot with given lengths.

    Args:
        robot: the robot, z down.
        weights: (n_cables,) weights of squared residuals.
        tolerance: largest residual of a solution, m; None: rounding, or any of redundant cables.
        fixed: (3,) point of the guide of a mass on one, or joint of a platform on one, m.
    """

    def __init__(
        self, robot: AnyRobot, weights: Float[np.ndarray, "n_cables"], tolerance: float | None, fixed: np.ndarray
    ) -> None:
        """Prepare what all searches share."""
        self.robot, self.row, self._weights, self._fixed = robot, PATTERNS[robot.pattern], weights, fixed
        base = np.asarray(robot.base_points)
        self._base, self._arms = base, np.zeros_like(base)
        self.size, self.radius = float(np.linalg.norm(base - fixed * self.row.is_jointed, axis=1).max()), 1.0
        if isinstance(robot, PlatformRobot):
            self._arms = np.asarray(robot.platform_points)
            self.radius = float(platform_radius(robot))
        self.size = max(self.size, self.radius * isinstance(robot, PlatformRobot), 1e-9)
        self.is_redundant = robot.n_cables > robot.dof
        usual = np.inf if self.is_redundant else MET * self.size
        self._tolerance = usual if tolerance is None else tolerance

    def near(self, lengths: Float[np.ndarray, "n m"], positions: np.ndarray, quaternions: np.ndarray) -> SolvedPoses:
        """The solution to which Gauss-Newton leads from one start each."""
        return self._one_each(self._fitted(lengths, positions, quaternions))

    def usual(self, lengths: Float[np.ndarray, "n m"]) -> SolvedPoses:
        """One solution each: that found from a level platform below the spools, or the first one that is found."""
        positions, quaternions = self._starts(lengths, np.array([IDENTITY]))
        solutions = self._fitted_all(lengths, positions, quaternions)
        poor, best = np.flatnonzero(self._is_poor(solutions)), self._select_first(solutions)
        for first in range(0, len(poor), CHUNK):
            part = poor[first : first + CHUNK]
            others = self._select_first(self._from_many(lengths[part]))
            for name in _COLUMNS:
                getattr(best, name)[part] = getattr(others, name)
        return best

    def all_solutions(self, lengths: Float[np.ndarray, "n m"]) -> SolvedPoses:
        """All solutions, those first in which a robot at rest can hang, and of these the lowest."""
        if self.is_closed:
            return self._closed(lengths)
        find = self._planar if self._is_planar else lambda part: self._distinct(self._from_many(part))
        # Each set of lengths takes some 30 kB while its solutions are sought.
        parts = [lengths[first : first + CHUNK] for first in range(0, max(len(lengths), 1), CHUNK)]
        return _joined([self._ordered(find(part)) for part in parts])

    @property
    def is_closed(self) -> bool:
        """Tell whether its solutions have a closed form, the lower ones first."""
        is_point = isinstance(self.robot, PointMassRobot) and self.robot.pulleys is None
        return is_point and self.robot.n_cables == self.robot.dof

    def nearest_first(self, poses: SolvedPoses, positions: np.ndarray, quaternions: np.ndarray) -> SolvedPoses:
        """Solutions in the order of their distances from one start each."""
        cosine = np.minimum(np.abs((poses.quaternions * quaternions[:, None]).sum(2)), 1.0)
        rotations = 2.0 * self.radius * self.row.is_body * np.sqrt(1.0 - cosine**2)
        distances = np.linalg.norm(poses.positions - positions[:, None], axis=2) + rotations
        return poses.selected(np.lexsort((distances, ~poses.is_found), axis=1))

    @property
    def _is_planar(self) -> bool:
        return self.robot.pattern == "1R2T" and self.robot.n_cables == self.robot.dof and self.robot.pulleys is None

    def _closed(self, lengths: np.ndarray) -> SolvedPoses:
        centres = spheres.centres_of(self._base, self.row.forces)
        count = len(lengths)
        positions, residuals = np.empty((count, 2, 3)), np.empty((count, 2, self.robot.n_cables))
        counts = np.empty(count, int)

        def solve(part: slice) -> None:
            points, reached, number = spheres.common_points(centres, self._fixed, lengths[part])
            positions[part], counts[part] = points, number
            np.subtract(reached, lengths[part, None], out=residuals[part])

        in_parts(solve, count, PART)
        quaternions = np.broadcast_to(np.array(IDENTITY), (len(lengths), 2, 4))
        is_found = counts[:, None] > np.arange(2)
        closed = SolvedPoses(positions, quaternions, residuals, is_found, np.zeros(is_found.shape, int), True)
        others = np.flatnonzero(counts == 0)
        if len(others):  # the nearest pose instead
            start = positions[others, 0] + 1e-3 * self.size * centres.normal
            near = self._fitted(lengths[others], start, quaternions[others, 0])
            positions[others], residuals[others] = near.positions[:, None], near.residuals[:, None]
            is_found[others, 0] = self._is_solution(near.residuals, near.has_ended)
        return closed

    def _planar(self, lengths: np.ndarray) -> SolvedPoses:
        plane = np.array([0, 2])
        cables = Cables(self._base[:, plane], self._arms[:, plane])
        index, points, angles = planar_platforms.candidates(cables, lengths)
        quaternions = np.zeros((len(index), 4))
        quaternions[:, 0], quaternions[:, 2] = np.cos(0.5 * angles), np.sin(0.5 * angles)
        positions = np.insert(points, 1, 0.0, axis=1)
        with np.errstate(invalid="ignore", over="ignore"):
            reached = np.linalg.norm(
                points[:, None] + planar_platforms.rotated(angles, cables.platform) - cables.base, axis=2
            )
            residuals = reached - lengths[index]
            is_found = np.abs(residuals).max(1) <= VERIFIED * self.size
        many = _table(len(lengths), index[is_found], positions[is_found], quaternions[is_found], residuals[is_found])
        many = dataclasses.replace(self._distinct(many), is_complete=True)
        others = np.flatnonzero(~many.is_found.any(1))
        if len(others):  # the nearest pose instead
            near = self._select_first(self._from_many(lengths[others]))
            for name in ("positions", "quaternions", "residuals", "is_found"):
                getattr(many, name)[others, 0] = getattr(near, name)[:, 0]
        return many

    def _fitted(self, lengths: np.ndarray, positions: np.ndarray, quaternions: np.ndarray) -> Fits:
        return fitted(self.robot, lengths, positions, quaternions, self._weights, (self.size, self.radius))

    def _one_each(self, fits: Fits) -> SolvedPoses:
        is_found = self._is_solution(fits.residuals, fits.has_ended)
        positions, turns, residuals, steps = fits.positions, fits.quaternions, fits.residuals, fits.steps
        return SolvedPoses(positions[:, None], turns[:, None], residuals[:, None], is_found[:, None], steps[:, None])

    def _is_solution(self, residuals: np.ndarray, has_ended: np.ndarray) -> np.ndarray:
        is_met = np.asarray(np.abs(residuals).max(-1) <= self._tolerance)
        return np.logical_and(has_ended, is_met)

    def starts(self, lengths: Float[np.ndarray, "n m"]) -> tuple[np.ndarray, np.ndarray]:
        """Starts of a search for several poses: positions (n, k, 3) and quaternions (n, k, 4), the level ones first."""
        return self._starts(lengths, _orientations(self.row.is_planar, self.row.is_body))

    def _from_many(self, lengths: np.ndarray) -> SolvedPoses:
        return self._fitted_all(lengths, *self.starts(lengths))

    def _fitted_all(self, lengths: np.ndarray, positions: np.ndarray, quaternions: np.ndarray) -> SolvedPoses:
        count, starts = positions.shape[:2]
        each = np.repeat(lengths, starts, axis=0)
        solutions = self._one_each(self._fitted(each, positions.reshape(-1, 3), quaternions.reshape(-1, 4)))
        return solutions.shaped((count, starts))

    def _starts(self, lengths: np.ndarray, quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # In each orientation attachment points lie on spheres about spools: so does the platform, about shifted ones.
        positions, rotations = [], Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
        for rotation in rotations:
            if self.row.is_jointed:
                positions.append(np.broadcast_to(self._fixed, (len(lengths), 1, 3)))
                continue
            centres = spheres.centres_of(self._base - self._arms @ rotation.T, self.row.forces)
            feet, squares = spheres.feet_and_squares(centres, self._fixed, lengths)
            # At height 0 steps could not leave the plane of the spools.
            heights = np.sqrt(np.maximum(squares, (0.1 * self.size) ** 2))[:, None, None]
            sides = np.stack([centres.normal, -centres.normal])[: 1 if centres.is_spanned else 2]
            positions.append(feet[:, None] + heights * sides)
        turns = [np.broadcast_to(q, (*x.shape[:2], 4)) for q, x in zip(quaternions, positions, strict=True)]
        return np.concatenate(positions, axis=1), np.concatenate(turns, axis=1)

    def _costs(self, poses: SolvedPoses) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            costs = (self._weights * poses.residuals**2).sum(-1)
        return np.where(np.isfinite(costs), costs, np.inf)

    def _is_poor(self, poses: SolvedPoses) -> np.ndarray:
        # Tell for each set of lengths whether further starts are worth trying.
        if not self.is_redundant:
            return np.logical_not(poses.is_found.any(1))
        with np.errstate(invalid="ignore"):
            good = poses.is_found & (np.abs(poses.residuals).max(-1) <= POOR * self.size)
        return np.logical_not(good.any(1))

    def _select_first(self, poses: SolvedPoses) -> SolvedPoses:
        # The first solution, of redundant cables the best one; else the nearest pose.
        costs = self._costs(poses)
        if self.is_redundant:  # the first of those that are equally good: of mirror images, the lower one
            costs = np.where(
                costs <= costs.min(1, keepdims=True) + (MET * self.size) ** 2, costs.min(1, keepdims=True), costs
            )
        index = np.where(poses.is_found.any(1), poses.is_found.argmax(1), costs.argmin(1))
        index = np.where(self.is_redundant, np.where(poses.is_found, costs, np.inf).argmin(1), index)
        return poses.selected(index[:, None])

    def _distinct(self, poses: SolvedPoses) -> SolvedPoses:
        # Each solution once, in the order of the columns, and the nearest pose first where there is none.
        count, starts = poses.is_found.shape
        is_found = poses.is_found.copy()
        if self.is_redundant:
            rms = np.sqrt(np.where(is_found, self._costs(poses), np.inf))
            is_found &= rms <= np.maximum(WORSE * rms.min(1, keepdims=True), MET * self.size)
        points = self._attachments(poses)
        previous: list[int] = []
        for k in range(starts):
            for other in previous:
                with np.errstate(invalid="ignore"):
                    distance = np.abs(points[:, k] - points[:, other]).max((1, 2))
                is_found[:, k] &= ~(is_found[:, other] & (distance <= SAME * self.size))
            previous.append(k)
        costs = self._costs(poses)
        order = np.argsort(np.where(is_found, -1.0, costs), axis=1, kind="stable")
        sorted_poses = dataclasses.replace(poses, is_found=is_found).selected(order)
        return _first(sorted_poses, max(int(is_found.sum(1).max(initial=0)), 1)) if count else sorted_poses

    def _attachments(self, poses: SolvedPoses) -> np.ndarray:
        count, starts = poses.is_found.shape
        flat = poses.positions.reshape(-1, 3), poses.quaternions.reshape(-1, 4)
        points = in_batches(lambda x: geometry.attachments(self.robot, *x), flat, batch_size=BATCH)
        return points.reshape(count, starts, -1, 3)

    def _ordered(self, poses: SolvedPoses) -> SolvedPoses:
        # Poses first in which cables hold the weight, then by height; of redundant cables by their residuals.
        count, starts = poses.is_found.shape
        low = -(poses.positions[..., 2])
        if self.is_redundant:
            key = self._costs(poses)
        else:
            flat = poses.positions.reshape(-1, 3), poses.quaternions.reshape(-1, 4)
            key = np.where(self._holds(*flat).reshape(count, starts), 0.0, 1.0)
        order = np.lexsort((low, key, ~poses.is_found), axis=1)
        return poses.selected(order)

    def _holds(self, positions: np.ndarray, quaternions: np.ndarray) -> Bool[np.ndarray, "n"]:
        matrices = in_batches(
            lambda x: geometry.wrench_matrices(self.robot, *x), (positions, quaternions), batch_size=BATCH
        )
        loads = in_batches(lambda x: geometry.weights(self.robot, *x), (positions, quaternions), batch_size=BATCH)
        is_regular = np.isfinite(matrices).all((1, 2))
        with np.errstate(all="ignore"):
            inverse = np.linalg.pinv(np.where(is_regular[:, None, None], matrices, 0.0))
        return is_regular & ((inverse @ loads[..., None])[..., 0] >= 0.0).all(1)


def _joined(parts: list[SolvedPoses]) -> SolvedPoses:
    # Tables of different widths as one, padded.
    width = max(part.is_found.shape[1] for part in parts)

    def padded(values: np.ndarray) -> np.ndarray:
        empty = np.nan if values.dtype == float else 0
        columns = ((0, 0), (0, width - values.shape[1]), *[(0, 0)] * (values.ndim - 2))
        return np.pad(values, columns, constant_values=empty)

    tables = {name: np.concatenate([padded(getattr(part, name)) for part in parts]) for name in _COLUMNS}
    return SolvedPoses(**tables, is_complete=parts[0].is_complete)


def _first(poses: SolvedPoses, count: int) -> SolvedPoses:
    return poses.selected(np.broadcast_to(np.arange(count), (len(poses.is_found), count)))


def _orientations(is_planar: bool, is_body: bool) -> Float[np.ndarray, "k 4"]:
    # No rotation first, then rotations all around, the same ones each time.
    if not is_body:
        return np.array([IDENTITY])
    if is_planar:
        half = np.pi * np.arange(PLANAR_STARTS) / PLANAR_STARTS
        zero = np.zeros_like(half)
        return np.stack([np.cos(half), zero, np.sin(half), zero], axis=1)
    others = np.random.default_rng(1).normal(size=(SPATIAL_STARTS - 1, 4))
    return np.concatenate([[IDENTITY], others / np.linalg.norm(others, axis=1, keepdims=True)])


def _table(
    count: int, index: np.ndarray, positions: np.ndarray, quaternions: np.ndarray, residuals: np.ndarray
) -> SolvedPoses:
    # Lists of solutions of different lengths as one table, padded.
    order = np.argsort(index, kind="stable")
    index = index[order]
    numbers = np.bincount(index, minlength=count)
    column = np.arange(len(index)) - np.repeat(np.cumsum(numbers) - numbers, numbers)
    width = max(int(numbers.max(initial=0)), 1)
    tables = [np.full((count, width, x.shape[1]), np.nan) for x in (positions, quaternions, residuals)]
    for table, values in zip(tables, (positions, quaternions, residuals), strict=True):
        table[index, column] = values[order]
    is_found = np.arange(width) < numbers[:, None]
    return SolvedPoses(tables[0], tables[1], tables[2], is_found, np.zeros((count, width), int))
