"""Workspaces: margins of many poses of a robot on any number of cables. Arrays in, answers out.

Poses that rounding may have decided, and those whose wrench matrix is near a loss of rank, are answered once more, by
singular values.
"""

import dataclasses
from typing import Any

import numpy as np

from cspr_jax.arithmetic.batches import in_batches, in_parts
from cspr_jax.arithmetic.frames import Frame
from cspr_jax.errors import InputError
from cspr_jax.feasibility.workspace import exact, kernels
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.clearance import clearances, scene
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.wrench_sets import tension_range
from cspr_jax.schema.labelled import Columns
from cspr_jax.schema.verdicts import Verdict

STATIC, CLOSURE, FEASIBLE = "static", "wrench-closure", "wrench-feasible"
CONDITIONS = (STATIC, CLOSURE, FEASIBLE)
# Of the largest limit of the tensions, or of the wrench: a margin nearer to zero is that of the boundary.
BOUNDARY = 1e-9
BATCH, ARRAYS, PART = 4096, 256, 65536
# Poses by which the base block is chosen.
TRIALS = 200


@dataclasses.dataclass(frozen=True)
class WorkspaceAnswers(Columns):
    """Answers about n poses.

    Fields:
        verdict: (n,) flags of `Verdict`; 0: the pose belongs to the workspace. Singular: the cables do not span a
            wrench that they must supply. Undecided: on the boundary, within 1e-9 of the limits.
        margin: (n,) N: by how much tensions can keep from their limits, negative outside; inf where nothing bounds it,
            -inf where the cables do not span the wrench. Of wrench closure a pure number in [-1, 1].
        is_exact: (n,) whether the pose was answered by singular values.
    """

    verdict: np.ndarray
    margin: np.ndarray
    is_exact: np.ndarray


@dataclasses.dataclass(frozen=True)
class Question:
    """What is asked of each pose.

    Fields:
        condition: one of `CONDITIONS`.
        low: (n_cables,) smallest tensions, N.
        high: (n_cables,) largest ones, inf for none, N.
        wrenches: (k, dof) what the cables must supply, kernels' axes, N and N m; None: what holds the weight still.
    """

    condition: str
    low: np.ndarray
    high: np.ndarray
    wrenches: np.ndarray | None = None


def question(robot: AnyRobot, condition: str, limits: Limits, wrenches: np.ndarray | None = None) -> Question:
    """A question of a condition.

    Args:
        robot: the robot.
        condition: one of `CONDITIONS`.
        limits: of the tensions; of account for "wrench-feasible" alone.
        wrenches: as in `Question`.

    Returns:
        the question.
    """
    low, high = tension_range(robot, limits if condition == FEASIBLE else Limits())
    return Question(condition, np.asarray(low), np.asarray(high), wrenches)


def given_wrenches(robot: AnyRobot, given: Any, frame: Frame) -> np.ndarray:
    """Wrenches as the kernels take them.

    Args:
        robot: gives the pattern.
        given: (k, dof) in the axes of the file, N and N m.
        frame: of the file.

    Returns:
        (k, dof).

    Raises:
        InputError: another shape, not finite, or of a rod.
    """
    row = PATTERNS[robot.pattern]
    if row.along_line:
        raise InputError("wrenches", "of a rod", "absent: its two axes of moments turn with it")
    try:
        values = np.asarray(given, float)
    except ValueError:
        values = np.full(0, np.nan)
    if values.ndim != 2 or values.shape[0] == 0 or values.shape[1] != robot.dof or not np.isfinite(values).all():
        raise InputError("wrenches", f"shape {values.shape}", f"finite numbers of shape (k, {robot.dof})")
    return values * np.array([frame.signs[i] for i in (*row.forces, *row.moments)])


def mass_centres(robot: AnyRobot, origins: np.ndarray, quaternions: np.ndarray | None) -> np.ndarray:
    """Positions of the mass centre, as the kernels take them; of a robot on a joint those of the joint.

    Args:
        robot: centred, z down.
        origins: (n, 3) of the platform frame, m.
        quaternions: (n, 4) unit quaternions, scalar first, or (1, 4) one for all; None: no rotation.

    Returns:
        (n, 3) m.
    """
    row = PATTERNS[robot.pattern]
    if not isinstance(robot, PlatformRobot) or row.is_jointed or robot.centre_of_mass is None:
        return origins
    arm = np.asarray(robot.centre_of_mass)
    if quaternions is None:
        return origins + arm
    scalar, axis = quaternions[:, :1], quaternions[:, 1:]
    twice = 2.0 * np.cross(axis, np.broadcast_to(arm, axis.shape))
    return origins + arm + scalar * twice + np.cross(axis, twice)


def apart(robot: AnyRobot, positions: np.ndarray, quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clearance of the cables of a robot from each other.

    Args:
        robot: centred, z down.
        positions: (n, 3) of the mass centre, m.
        quaternions: (n, 4) unit quaternions, scalar first.

    Returns:
        (n,) m, inf where no two cables can meet; (n,) flags of `Verdict`.
    """
    diameter = 0.0 if robot.cable_diameter is None else np.asarray(robot.cable_diameter)
    turns, ends = quaternions if PATTERNS[robot.pattern].is_body else None, None
    pulleys = robot.pulleys
    if pulleys is not None:
        ends = in_batches(lambda x: kernels.exit_points(robot, pulleys, *x), (positions, quaternions), size=BATCH)
    found = clearances(scene(robot, diameter=diameter), positions, turns, ends=ends)
    verdict = np.where(found.clearance > 0.0, 0, Verdict.CABLE_CABLE)
    return found.clearance, np.where(found.is_open, Verdict.UNDECIDED, verdict).astype(np.uint16)


class WorkspaceSearch:
    """A question to poses of one robot; what it needs of the robot alone is found once.

    Args:
        robot: centred, z down.
        asked: what is asked of each pose.
        unrolled: whether lanes, which compile twenty times as long as arrays and are five times as fast, are worth it
            for robots that may go by them: from some 500,000 poses on.

    Fields:
        unit: (dof,) by which the components of wrenches are divided: 1, and of moments a length, m.
    """

    def __init__(self, robot: AnyRobot, asked: Question, *, unrolled: bool = True) -> None:
        """Find what depends on the robot alone."""
        self._robot, self._asked, self._length = robot, asked, _length(robot)
        self._kind = "closure" if asked.condition == CLOSURE else "tensions"
        self._unbounded = tuple(np.isinf(asked.high).tolist())
        self._high = np.where(np.isinf(asked.high), 0.0, asked.high)
        self.unit = np.where(kernels.scales(robot), self._length, 1.0)
        self._boundary = BOUNDARY
        if self._kind != "closure":
            loads = [float(robot.mass * robot.gravity)] if asked.wrenches is None else np.ravel(asked.wrenches)
            self._boundary *= np.abs(np.concatenate([asked.low, self._high, loads])).max()
        self._by_lanes = unrolled and kernels.is_unrolled(robot)
        self._order = self._base_order() if self._by_lanes and robot.dof == kernels.CABLES else ()

    def __call__(
        self, positions: np.ndarray, quaternions: np.ndarray | None, wrenches: np.ndarray | None = None
    ) -> WorkspaceAnswers:
        """Whether poses belong to the workspace.

        Args:
            positions: (n, 3) of the mass centre, or of the joint, m.
            quaternions: (n, 4) unit quaternions, scalar first; None: no rotation.
            wrenches: (n, k, dof) what the cables must supply at each pose, N and N m; None: those of the question.

        Returns:
            the answers.
        """
        if len(positions) == 0:
            return WorkspaceAnswers(np.zeros(0, np.uint16), np.zeros(0), np.zeros(0, bool))
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(positions), 1)) if quaternions is None else quaternions
        loads = self._wrenches(positions, turns) if wrenches is None else wrenches / self.unit
        parts = in_parts(lambda part: self._part(positions[part], turns[part], loads[part]), len(positions), PART)
        margin, is_exact, is_outside = (np.concatenate(x) for x in zip(*parts, strict=True))
        verdict = np.where(margin > 0.0, 0, Verdict.WRENCH_INFEASIBLE)
        verdict = np.where(np.abs(margin) <= self._boundary, Verdict.UNDECIDED, verdict)
        verdict = np.where(is_outside, Verdict.SINGULAR, verdict)
        verdict = np.where(np.isnan(margin), Verdict.NOT_FINITE, verdict)
        return WorkspaceAnswers(verdict.astype(np.uint16), margin, is_exact)

    def _base_order(self) -> tuple[int, ...]:
        # The block that is the farthest from singular at poses among the spools.
        rng, base = np.random.default_rng(1), np.asarray(self._robot.base_points)
        low, high = base.min(0), base.max(0)
        middle, half = 0.5 * (low + high), 0.4 * (high - low)
        half[2] = max(half[2], 0.2 * half.max())
        places = middle + half * rng.uniform(-1.0, 1.0, (TRIALS, 3))
        turns = np.array([1.0, 0.0, 0.0, 0.0]) + 0.2 * rng.normal(size=(TRIALS, 4))
        turns /= np.linalg.norm(turns, axis=1, keepdims=True)
        return kernels.base_order(self._matrices(places, turns))

    def _matrices(self, positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        # Wrench matrices, moments over the length.
        found = in_batches(lambda x: kernels.wrench_matrices(self._robot, *x), (positions, quaternions), size=ARRAYS)
        return found / self.unit[:, None]

    def _wrenches(self, positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        # What the cables must supply, (n, k, dof), moments over the length.
        if self._asked.wrenches is not None:
            every = self._asked.wrenches[None]
        elif PATTERNS[self._robot.pattern].is_jointed:
            poses = positions, quaternions
            every = in_batches(lambda x: kernels.weights(self._robot, *x), poses, size=ARRAYS)[:, None]
        else:  # the same everywhere
            every = np.asarray(kernels.weights(self._robot, positions[:1], quaternions[:1]))[None]
        return np.broadcast_to(every / self.unit, (len(positions), *every.shape[1:]))

    def _part(
        self, positions: np.ndarray, quaternions: np.ndarray, wrenches: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        compiled, size = (self._lanes, BATCH) if self._by_lanes else (self._arrays, ARRAYS)
        found = in_batches(compiled, (positions, quaternions, wrenches), size=size)
        margin, is_exact = np.array(found.value), np.array(found.is_open)
        is_exact |= np.abs(margin) <= self._boundary
        is_outside = np.zeros(len(positions), bool)
        open_ones = np.flatnonzero(is_exact)
        if len(open_ones):
            poses = positions[open_ones], quaternions[open_ones]
            margin[open_ones], is_outside[open_ones] = self._exactly(self._matrices(*poses), wrenches[open_ones])
        return margin, is_exact, is_outside

    def _lanes(self, batch):
        places, turns, loads = batch
        turned = tuple(turns.T) if PATTERNS[self._robot.pattern].is_body else None
        units = kernels.unit_vectors(self._robot, tuple(places.T), turned)
        given = units, turned, [tuple(load.T) for load in np.moveaxis(loads, 1, 0)]
        return kernels.margins(self._robot, *given, *self._limits, order=self._order, **self._options)

    def _arrays(self, batch):
        return kernels.array_margins(self._robot, *batch, *self._limits, **self._options)

    @property
    def _limits(self) -> tuple[tuple[np.ndarray, np.ndarray], np.float64]:
        return (self._asked.low, self._high), np.float64(self._length)

    @property
    def _options(self) -> dict[str, Any]:
        return {"condition": self._kind, "unbounded": self._unbounded}

    def _exactly(self, matrices: np.ndarray, wrenches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        margins, is_outside = np.full(len(matrices), np.nan), np.zeros(len(matrices), bool)
        for i, (columns, loads) in enumerate(zip(matrices, wrenches, strict=True)):
            if not np.isfinite(columns).all():
                continue
            if self._kind == "closure":
                margins[i] = exact.closure_margin(columns)
                is_outside[i] = exact.cocircuits(columns)[2].shape[1] < len(columns)
            else:
                margins[i] = exact.tension_margin(columns, loads, self._asked.low, self._asked.high)
                is_outside[i] = margins[i] == -np.inf
        return margins, is_outside


def _length(robot: AnyRobot) -> float:
    # By which moments are divided: the size of the platform.
    if not isinstance(robot, PlatformRobot):
        return 1.0
    points = np.asarray(robot.platform_points)
    return float(np.sqrt((points**2).sum(1).mean())) or 1.0
