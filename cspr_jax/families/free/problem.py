"""Question of a search: poses, limits and objective; and how its bounds are tightened after a proof."""

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
from cspr_jax.motion.problem import Problem, search_problem
from cspr_jax.numerics.shapes import Bool
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.criteria import criteria
from cspr_jax.verification.piece_slacks import PieceSlacks, piece_slacks

LEFT = 1e-7  # smallest slack that a proof must find, in the units of values
STEP = 1e-6  # smallest change of a bound that is tightened
MAX_PART = 0.03  # largest change of a bound, over the larger of half its range and 1
BESIDE = 0.5  # change on neighbouring pieces over the change on the piece
MORE = 1.5  # change of a bound over the missing slack
PATIENCE = 4  # after these rounds the factor is a growing power of `MORE`, as some motions keep changing
SAMPLES = 4, 8  # samples of each interval: for point masses, and for platforms, whose tensions vary more


class FreeSettings(NamedTuple):
    """Settings of a search.

    Fields:
        objective: row of `objectives.OBJECTIVES`.
        longest: longest duration of a segment, s; None for any.
        starts: number of motions from which the search for a segment starts; None: all of `starts.starts`.
        until: time at which all searches end, as of `time.monotonic`, s.
        intervals: number of intervals of the spline of a segment, even.
        samples: number of samples of each interval at which limits are kept; None: as in `SAMPLES`.
    """

    objective: str = "time"
    longest: float | None = None
    starts: int | None = None
    until: float = np.inf
    intervals: int = 48
    samples: int | None = None


def planned_problem(problem: Problem) -> Problem:
    """The problem without uncertainty."""
    return problem._replace(limits=dataclasses.replace(problem.limits, uncertainty=None))


@dataclasses.dataclass(frozen=True)
class FreeQuestion:
    """Question of a search: which motion through poses within limits is the best?

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
        robot, searched = problem.robot, search_problem(problem).limits
        limits = bounds(robot, searched, criteria(robot, problem.limits, scene), settings.longest is not None)
        objective, limits = OBJECTIVES[settings.objective](limits, robot.n_cables)
        return cls(problem, scene, poses, limits, objective, settings)

    @property
    def is_planned(self) -> bool:
        """Tell whether it is about the planned robot alone, not about all robots within an uncertainty."""
        return self.problem.limits.uncertainty is None

    @property
    def planned(self) -> Problem:
        """The problem of the planned robot alone."""
        return planned_problem(self.problem)

    @property
    def samples(self) -> int:
        """Number of samples of each interval at which the final motion keeps limits."""
        turns = len(coordinates(self.problem.robot.pattern)[1]) > 0
        return self.settings.samples or SAMPLES[turns]

    def tasks(self, intervals: int, samples: int) -> Tasks:
        """The question as a task on some number of intervals."""
        numbers, problem = basis(intervals, samples), search_problem(self.problem)
        return tasks_of(problem, numbers, self.limits, self.objective, self.poses, self.settings.longest)


def more(number: int) -> float:
    """Change of a bound in a round, over the missing slack."""
    return MORE ** max(1, number - PATIENCE + 1)


def slacks_of(question: FreeQuestion, motions: list[Spline]) -> PieceSlacks:
    """Slacks of consecutive motions over their pieces."""
    full = chained(motions)
    return piece_slacks(question.problem, full, np.asarray(full.knots), question.scene)


def tightened(question: FreeQuestion, tasks: Tasks, slacks: PieceSlacks, number: int) -> Tasks | None:
    """Tasks with tighter bounds where the proof finds too little slack; None where it finds enough everywhere."""
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
    # A slack that is smallest near an end of a piece depends as much on the bounds of the neighbouring piece.
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
    if tasks.rests_anywhere:
        highest[:, -1] = -1
    is_given = np.zeros((*tasks.low.shape[:4], len(limits.orders)), bool)
    is_given[:, :, 0, 0], is_given[:, :, -1, -1] = (limits.orders <= side for side in (highest[:, :-1], highest[:, 1:]))
    return is_given
