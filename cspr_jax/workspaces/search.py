"""Workspaces: margins of many poses of a robot on any number of cables. Arrays in, answers out.

Each pose is tried by the fastest method first, then by more accurate ones until rounding cannot change the answer: by
the null space of six to eight cables in space, by the normals to dof - 1 cables, and by singular values.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.numerics.batches import in_batches, in_parts
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import BOUNDARY, FORMULAS_UNDECIDED, TOUCHED
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.schema.columns import Columns
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.workspaces.poses import exact, facet_normals, geometry, kernels
from cspr_jax.workspaces.poses.margins import Wrenches
from cspr_jax.workspaces.required_wrenches import RequiredWrenches
from cspr_jax.workspaces.requirements import CLOSURE, Requirement

# Largest difference of the bounds of a margin in single precision, as a fraction of the largest limit.
SINGLE_ERROR = 1e-3
PART = 1 << 18
# Number of poses of a short batch, for few poses and for preparing a search.
BATCH = 1024
MAX_SHORT = 8  # largest number of short batches
# Bytes of the wrench matrices of a long batch, for many poses: large enough to outweigh the overhead of a call, small
# enough that caches hold most of them.
BYTES = 6_400_000
TRIALS = 200  # number of poses by which the base block is chosen
FEW_TRIALS = 8  # number of poses by which choices of cables without a facet are found
# Number of boxes in which such poses are sampled, each twice as wide as the one before, for pulleys of up to 1e6 m.
WIDENINGS = 40
# Up to this number of open poses, singular values answer them at once, since compiling would take longer.
FEW = 100


@dataclasses.dataclass(frozen=True)
class WorkspaceAnswers(Columns):
    """Answers about n poses.

    Fields:
        verdict: (n,) flags of `Verdict`; 0: the pose belongs to the workspace. Singular: the cables do not span a
            required wrench. Undecided: on the boundary, within 1e-9 of the limits, unless these may be touched.
        margin: (n,) largest distance that tensions can keep from their limits, N, negative outside; inf where it is
            unbounded, -inf where the cables do not span the wrench. For wrench closure a pure number in [-1, 1].
        is_exact: (n,) whether the pose was answered by singular values.
    """

    verdict: np.ndarray
    margin: np.ndarray
    is_exact: np.ndarray


class Poses(NamedTuple):
    """Poses, with the wrenches that the cables must supply at each.

    Fields:
        positions: (n, 3) m.
        quaternions: (n, 4) unit quaternions, scalar first.
        wrenches: (n, dof) moments over a length, N; None: those of the requirement.
        robots: rows of the robots of the poses, where these have several; None: one robot.
    """

    positions: np.ndarray
    quaternions: np.ndarray
    wrenches: np.ndarray | None
    robots: Any = None

    def rows(self, index: Any) -> "Poses":
        """Poses chosen by indices, a slice or a mask (n,)."""
        wrenches = None if self.wrenches is None else self.wrenches[index]
        robots = None if self.robots is None else self.robots.rows(index)
        return Poses(self.positions[index], self.quaternions[index], wrenches, robots)


Stage = Callable[[Poses], np.ndarray]


class Constants(NamedTuple):
    """Numbers of a robot that kernels of margins take.

    Fields:
        robot: robot, centred, z down.
        limits: limits of tensions, in the order of the kernel's cables.
        wrenches: wrenches that the cables must supply, moments over a length; without points they are those of poses.
    """

    robot: AnyRobot
    limits: kernels.TensionLimits
    wrenches: Wrenches


def cast(tree: Any, dtype: type) -> Any:
    """Arrays of a tree in another type."""
    return jax.tree.map(lambda x: np.asarray(x, dtype), tree)


class WorkspaceSearch:
    """Search for poses of a robot that meet a requirement; data that depend only on the robot are prepared once.

    Fields:
        robot: robot, centred, z down.
        requirement: requirement that each pose must meet.
        unit: (dof,) divisors of the components of wrenches: for moments a length of the robot, m.
    """

    def __init__(self, robot: AnyRobot, requirement: Requirement, *, precision: str = "float64") -> None:
        """Prepare the search for a robot, centred, z down.

        With precision "float32", poses are decided in single precision where it suffices, with margins accurate to 1e-3
        of the limits, and otherwise in float64.
        """
        self.robot, self.requirement, self._precision, self._length = robot, requirement, precision, _length(robot)
        self.unit = np.where(geometry.scales(robot), self._length, 1.0)
        self._wrenches = requirement.wrenches.over(self.unit)
        self._measure = "tensions" if requirement.capacity_length is None else "capacity"
        capacity_length = requirement.capacity_length or self._length
        self._normals_unit = np.where(geometry.scales(robot), capacity_length / self._length, 1.0)
        self._boundary = BOUNDARY
        if requirement.condition == CLOSURE:
            self._measure = "closure"
        else:
            sizes = requirement.wrenches.magnitude, float(robot.mass * robot.gravity)
            self._boundary *= np.abs([*requirement.low, *requirement.high[np.isfinite(requirement.high)], *sizes]).max()
        self._few, self._has_limits = FEW_TRIALS, has_limits(requirement)
        matrices = self._trials()
        self._choices = facet_normals.choices_of(matrices[: self._few])
        self._order = tuple[int, ...]()
        is_few = 0 <= robot.n_cables - facet_normals.CABLES <= facet_normals.MAX_OTHERS
        if robot.dof == facet_normals.CABLES and is_few and self._wrenches.is_one and self._measure != "capacity":
            self._order = facet_normals.base_order(matrices)

    def __call__(
        self,
        positions: Float[np.ndarray, "n 3"],
        quaternions: Float[np.ndarray, "n 4"] | None,
        wrenches: Float[np.ndarray, "n dof"] | None = None,
    ) -> WorkspaceAnswers:
        """Tell whether poses belong to the workspace."""
        if len(positions) == 0:
            return WorkspaceAnswers(np.zeros(0, FLAGS), np.zeros(0), np.zeros(0, bool))
        quaternions = np.tile(IDENTITY, (len(positions), 1)) if quaternions is None else quaternions
        loads = self._weights(positions, quaternions) if wrenches is None else wrenches / self.unit
        return self.answers(Poses(positions, quaternions, loads))

    def answers(self, poses: Poses) -> WorkspaceAnswers:
        """Tell whether poses belong to the workspace."""
        parts = in_parts(lambda part: self._part(poses.rows(part)), len(poses.positions), PART)
        margin, is_exact, is_outside = (np.concatenate(x) for x in zip(*parts, strict=True))
        verdict = np.where(margin > 0.0, 0, Verdict.WRENCH_INFEASIBLE)
        verdict = np.where(np.abs(margin) <= self._boundary, Verdict.UNDECIDED, verdict)
        verdict[self._touching(poses, margin)] = 0
        verdict = np.where(is_outside, Verdict.SINGULAR, verdict)
        verdict = np.where(np.isnan(margin), Verdict.NOT_FINITE, verdict)
        return WorkspaceAnswers(verdict.astype(FLAGS), margin, is_exact)

    def _trials(self) -> np.ndarray:
        return self._trials_of(self.robot)

    def _trials_of(self, robot: AnyRobot) -> np.ndarray:
        # Finite wrench matrices of sampled poses among the spools, at which no cable ends within its pulley. If pulleys
        # are large there may be such poses only farther out.
        rng, base, row = np.random.default_rng(1), np.asarray(robot.base_points), PATTERNS[robot.pattern]
        low, high = base.min(0), base.max(0)
        middle, half = 0.5 * (low + high), 0.4 * (high - low)
        # If all spools have the same x, some components vanish only in their plane: sample outside of it.
        moves = np.isin(range(3), row.forces or range(3))
        half = np.where(moves, np.maximum(half, 0.2 * half.max() or 1.0), half)
        regular = np.zeros((0, robot.dof, robot.n_cables))
        for widening in range(WIDENINGS):
            positions = middle + 2.0**widening * half * rng.uniform(-1.0, 1.0, (TRIALS, 3))
            quaternions = np.array(IDENTITY) + 0.2 * rng.normal(size=(TRIALS, 4))
            if row.is_planar:
                quaternions[:, [1, 3]] = 0.0
            matrices = self._matrices(
                robot, positions, quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
            )
            regular = np.concatenate([regular, matrices[np.isfinite(matrices).all((1, 2))]])
            if len(regular) >= FEW_TRIALS:
                return regular
        allowed = "must leave room for poses where no cable ends within its pulley"
        raise InputError("pulley_radius", None, allowed, problem="none among the spools, nor around them")

    def _matrices(self, robot: AnyRobot, positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        # Wrench matrices with moments over the length.
        poses = positions, quaternions
        matrices = in_batches(lambda x: geometry.wrench_matrices(robot, *x), poses, batch_size=TRIALS)
        return matrices / self.unit[:, None]

    def _part(self, poses: Poses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        count = len(poses.positions)
        margin, is_open, is_outside = np.full(count, np.nan), np.ones(count, bool), np.zeros(count, bool)
        for stage, accepts in self._stages():
            indices = np.flatnonzero(is_open)
            if len(indices) == 0 or len(indices) < min(FEW, count):
                break
            bounds = stage(poses.rows(indices))
            is_known = accepts(bounds)
            decided = bounds[is_known]
            margin[indices[is_known]] = 0.5 * (decided.real + decided.imag)
            is_open[indices[is_known]] = False
        is_open |= np.abs(margin) <= self._boundary
        indices = np.flatnonzero(is_open)
        if len(indices):
            margin[indices], is_outside[indices] = self._exactly(poses.rows(indices))
        return margin, is_open, is_outside

    def _stages(self):
        def is_known(bounds, factor=1.0):
            with np.errstate(invalid="ignore"):
                return (bounds.real == bounds.imag) | (bounds.imag - bounds.real <= factor * self._boundary)

        def is_clear(bounds):
            is_beyond = (bounds.real > self._boundary) | (bounds.imag < -self._boundary)
            return is_beyond & is_known(bounds, SINGLE_ERROR / BOUNDARY)

        if not len(self._choices.table):  # at all poses, the cables do not span all components
            return

        if self._precision == "float32":
            yield self._stage(np.float32, bool(self._order)), is_clear
        if self._order:
            yield self._stage(np.float64, True), is_known
        yield self._stage(np.float64, False), is_known

    def batch(self, dtype: type) -> int:
        """Length of a long batch on a CPU."""
        entries = self.robot.dof * self.robot.n_cables
        return 1 << int(np.log2(BYTES / (entries * np.dtype(dtype).itemsize)))

    def kernel(self, dtype: type, *, by_null_space: bool = False) -> Callable[..., Array]:
        """Compiled margins of a batch of poses."""
        constants = cast(self._constants(self.robot, self.requirement, by_null_space=by_null_space), dtype)
        return partial(self._margins(dtype, by_null_space=by_null_space), constants)

    def _constants(self, robot: AnyRobot, demanded: Requirement, *, by_null_space: bool) -> Constants:
        # Numbers of a robot that kernels take; of required wrenches all but the weight of a body on a joint.
        ordered = list(self._order) if by_null_space else slice(None)
        limits = (as_float64(demanded.low[ordered]), as_float64(demanded.high[ordered]), as_float64(self._normals_unit))
        required = demanded.wrenches.over(self.unit)
        points = [] if required.points is None else [[as_float64(x) for x in point] for point in required.points]
        box = None if required.box is None else as_float64(required.box)
        wrenches = Wrenches(points, box, [as_float64(x) for x in required.ellipsoids])
        return Constants(robot, kernels.TensionLimits(*limits), wrenches)

    def _margins(self, dtype: type, *, by_null_space: bool) -> Callable[..., Array]:
        # Compiled margins of a batch of poses, from the numbers of a robot, or of the robot of each pose.
        options = {"measure": self._measure, "is_bounded": bool(np.isfinite(self.requirement.high).all())}
        choices = self._relations if by_null_space else self._choices
        choices, length = choices._replace(counts=cast(choices.counts, dtype)), cast(as_float64(self._length), dtype)

        def compiled(constants, position, quaternion, load):
            columns, loss = geometry.wrench_columns(constants.robot, position, quaternion, length)
            wrenches = constants.wrenches if load is None else constants.wrenches._replace(points=[load])
            if not by_null_space:
                return kernels.by_normals(columns, loss, wrenches, constants.limits, choices, **options)
            space = kernels.null_space(columns, loss, wrenches.points[0], order=self._order)
            return kernels.by_null_space(space, constants.limits, choices, **options)

        return compiled

    def _stage(self, dtype: type, by_null_space: bool) -> Stage:
        compiled, is_body = self.kernel(dtype, by_null_space=by_null_space), PATTERNS[self.robot.pattern].is_body

        def lanes(array):
            return tuple(np.ascontiguousarray(column, dtype) for column in array.T)

        def stage(poses):
            quaternions = lanes(poses.quaternions) if is_body else None
            loads = None if poses.wrenches is None else lanes(poses.wrenches)
            batch = lanes(poses.positions), quaternions, loads
            return in_batches(lambda x: compiled(*x), batch, batch_size=self._batch(poses, dtype))

        return stage

    def _batch(self, poses: Poses, dtype: type) -> int:
        # One of only two lengths, since code is compiled for each.
        return BATCH if len(poses.positions) <= MAX_SHORT * BATCH else self.batch(dtype)

    @property
    def _relations(self) -> facet_normals.CableSubsets:
        # Cables of each facet normal alone, in the order of the block.
        table, counts = self._choices
        indices = np.argsort(self._order)[table[:, self.robot.dof - 1 :]].astype(np.int32)
        sorting = np.argsort(indices, axis=1)
        ordered = None if counts is None else np.take_along_axis(counts, sorting, 1)
        return facet_normals.CableSubsets(np.take_along_axis(indices, sorting, 1), ordered)

    def required(self, position: Float[np.ndarray, "3"], quaternion: Float[np.ndarray, "4"]) -> RequiredWrenches:
        """Wrenches that the cables must supply at a pose."""
        load = self._weights(position[None], quaternion[None])
        return self._wrenches if load is None else self._wrenches.about(load[0])

    def _weights(self, positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray | None:
        # Only the weight of a body on a joint depends on the pose.
        if self._wrenches.points is not None:
            return None
        poses = positions, quaternions
        return in_batches(lambda x: geometry.weights(self.robot, *x), poses, batch_size=BATCH) / self.unit

    @property
    def allowance(self) -> float:
        """Distance from a limit within which it may be touched, N."""
        return TOUCHED / BOUNDARY * self._boundary

    def _touching(self, poses: Poses, margin: np.ndarray) -> np.ndarray:
        # Poses at which tensions touch or slightly exceed limits, but keep the limits widened by the allowance.
        rows = np.flatnonzero(np.abs(margin) <= self.allowance)
        if self._measure == "closure" or not self._has_limits or not len(rows):
            return rows[:0]
        return rows[self._exactly(poses.rows(rows), TOUCHED)[0] > FORMULAS_UNDECIDED / BOUNDARY * self._boundary]

    def _exactly(self, poses: Poses, widening: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        measure = self._normals_unit if self._measure == "capacity" else None
        count = len(poses.positions)
        margins, is_outside = np.full(count, np.nan), np.zeros(count, bool)
        for i, (columns, required, low, high) in enumerate(self._problems(poses)):
            if not np.isfinite(columns).all():
                continue
            if self._measure == "closure":
                margins[i] = exact.closure_margin(columns, self._choices)
                is_outside[i] = exact.facet_normals(columns)[2].shape[1] < len(columns)
            else:
                wider = low * (1.0 - widening), high * (1.0 + widening)
                margins[i] = exact.wrench_margin(columns, required, *wider, measure)
                is_outside[i] = margins[i] == -np.inf
        return margins, is_outside

    def _problems(self, poses: Poses) -> Iterator[tuple[np.ndarray, RequiredWrenches, np.ndarray, np.ndarray]]:
        # Wrench matrix, required wrenches, and smallest and largest tensions at each pose.
        for i, columns in enumerate(self._matrices(self.robot, poses.positions, poses.quaternions)):
            required = self._wrenches if poses.wrenches is None else self._wrenches.about(poses.wrenches[i])
            yield columns, required, self.requirement.low, self.requirement.high


def has_limits(required: Requirement) -> bool:
    """Tell whether tensions have limits beyond taut cables."""
    return bool(required.low.any() or np.isfinite(required.high).any())


def _length(robot: AnyRobot) -> float:
    # Length of the platform by which moments are divided.
    if not isinstance(robot, PlatformRobot):
        return 1.0
    points = np.asarray(robot.platform_points)
    return float(np.sqrt((points**2).sum(1).mean())) or 1.0
