"""The question of a search: poses, limits, and what the motion is to be the best in; bounds tighten after a proof."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from cspr_jax.curves.spline import Spline, chained
from cspr_jax.families.free.poses import FreePoses, check_searched, tasks_of
from cspr_jax.families.free.search.basis import basis
from cspr_jax.families.free.search.equations import ValueBounds, bounds, coordinates
from cspr_jax.families.free.search.objectives import OBJECTIVES, Objective
from cspr_jax.families.free.search.tasks import Tasks
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Bool
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.criteria import criteria
from cspr_jax.verification.piece_slacks import PieceSlacks, piece_slacks

LEFT = 1e-7  # slack that a proof must find, in the units of values
STEP = 1e-6  # by which bounds tighten at least
MAX_PART = 0.03  # by which bounds tighten at most, over half their range or 1, whichever is larger
BESIDE = 0.5  # tightening of the neighbouring pieces, over that of the piece
MORE = 1.5  # tightening over the slack that is missing
PATIENCE = 4  # rounds after which the factor is a growing power of `MORE`, since some motions change in every round
SAMPLES = 4, 8  # of each interval, of point masses and of platforms, whose tensions change more between two of them


class FreeSettings(NamedTuple):
    """Settings of a search.

    Fields:
        objective: row of `objectives.OBJECTIVES`.
        longest: duration of a segment, s; None for any.
        starts: number of motions from which the search of a segment begins; None for those of `starts.starts`.
        until: time of `time.monotonic` at which all searches end, s.
        intervals: of the spline of a segment, even.
        samples: of each interval at which limits are kept; None for those of `SAMPLES`.
    """

    objective: str = "time"
    longest: float | None = None
    starts: int | None = None
    until: float = np.inf
    intervals: int = 48
    samples: int | None = None


def planned_problem(problem: Problem) -> Problem:
    """A problem without uncertainty."""
    return problem._replace(limits=dataclasses.replace(problem.limits, uncertainty=None))


@dataclasses.dataclass(frozen=True)
class FreeQuestion:
    """Question of a search: the best motion through poses within limits.

    Fields:
        limits: bounds of the values at each sample.
    """

    problem: Problem
    scene: Scene | None
    poses: FreePoses
    limits: ValueBounds
    objective: Objective
    settings: FreeSettings

    @classmethod
    def of(cls, problem: Problem, scene: Scene | None, poses: FreePoses, settings: FreeSettings) -> FreeQuestion:
        """Take limits from the robot, and the objective from the settings."""
        check_searched(problem)
        robot = problem.robot
        limits = bounds(robot, problem.limits, criteria(robot, problem.limits, scene), settings.longest is not None)
        objective, limits = OBJECTIVES[settings.objective](limits, robot.n_cables)
        return cls(problem, scene, poses, limits, objective, settings)

    @property
    def is_planned(self) -> bool:
        """Tell whether it is about the planned robot alone, and not about all within an uncertainty."""
        return self.problem.limits.uncertainty is None

    @property
    def planned(self) -> Problem:
        """The problem of the planned robot alone."""
        return planned_problem(self.problem)

    @property
    def samples(self) -> int:
        """Samples of each interval at which limits are kept in the end."""
        turns = len(coordinates(self.problem.robot.pattern)[1]) > 0
        return self.settings.samples or SAMPLES[turns]

    def tasks(self, intervals: int, samples: int) -> Tasks:
        """The question on some intervals."""
        numbers = basis(intervals, samples)
        return tasks_of(self.problem, numbers, self.limits, self.objective, self.poses, self.settings.longest)


def more(number: int) -> float:
    """How much bounds tighten in a round, over what is missed."""
    return MORE ** max(1, number - PATIENCE + 1)


def slacks_of(question: FreeQuestion, motions: list[Spline]) -> PieceSlacks:
    """Slacks of consecutive motions over their pieces."""
    full = chained(motions)
    return piece_slacks(question.problem, full, np.asarray(full.knots), question.scene)


def tightened(question: FreeQuestion, tasks: Tasks, slacks: PieceSlacks, number: int) -> Tasks | None:
    """Tighter bounds where the proof finds less slack than is needed."""
    limits = question.limits
    changes = np.abs(limits.rises) + np.abs(limits.falls)
    unit = changes.max(1)
    missed = np.where(unit > 0.0, LEFT - slacks.low * unit, 0.0)
    if not (missed > 0.0).any():
        return None
    half = 0.5 * (limits.high - limits.low)
    range_of_values = np.max(np.where((changes > 0.0) & np.isfinite(half), half, 1.0), axis=1, initial=1.0)
    steps = np.where(
        missed > 0.0, np.minimum(more(number) * missed + STEP, MAX_PART * range_of_values), 0.0
    ) / np.where(unit > 0.0, unit, 1.0)
    # A slack that is smallest near the end of a piece depends as much on the bounds of the next piece.
    steps = steps.reshape(len(tasks.low), -1, len(unit))
    near = steps.copy()
    near[:, 1:] = np.maximum(near[:, 1:], BESIDE * steps[:, :-1])
    near[:, :-1] = np.maximum(near[:, :-1], BESIDE * steps[:, 1:])
    count = tasks.n_limited
    tighter = dataclasses.replace(tasks, low=tasks.low.copy(), high=tasks.high.copy())
    for bound, changes, sign in ((tighter.low, limits.rises, 1.0), (tighter.high, limits.falls, -1.0)):
        steps = (near[..., None] * changes).max(2).reshape(*bound.shape[:3], 1, -1)
        bound[..., :count] += sign * np.where(_fixed_by_poses(tasks, limits), 0.0, steps)
    return tighter


def _fixed_by_poses(tasks: Tasks, limits: ValueBounds) -> Bool[np.ndarray, "l s m n n_values"]:
    # Tell which values poses fix, and no motion changes: there limits may be touched.
    highest = np.where(tasks.is_free, 1, 2)[..., None]
    is_given = np.zeros((*tasks.low.shape[:4], len(limits.orders)), bool)
    is_given[:, :, 0, 0], is_given[:, :, -1, -1] = (limits.orders <= side for side in (highest[:, :-1], highest[:, 1:]))
    return is_given
