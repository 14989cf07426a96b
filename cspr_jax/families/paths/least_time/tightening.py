"""Limits that a motion along a path breaks between the nodes, according to proof, and limits that bind it."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Generator, Mapping, Sequence
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.ndimage import maximum_filter1d

from cspr_jax.curves.spline import Spline, SplineBatch
from cspr_jax.families.paths.least_time.discrete import GridMargins
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.runtime.stages import stage
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import Verdict, criterion_words
from cspr_jax.verification.bounds.block_slacks import rate_slacks, speed_slacks
from cspr_jax.verification.criteria import Criterion, criteria
from cspr_jax.verification.piece_slacks import Sides, close_bounds
from cspr_jax.verification.proved_answers import TENSIONS

LEFT = 1e-7  # slack over its scale that larger margins are to leave
MORE, STEP = 1.3, 1e-5  # margins grow by this multiple of the missing slack plus this
BINDING = 0.01  # a criterion binds if its slack over its scale is below this
# After the first round, margins also grow in the nearest n_cells / SPREAD cells on each side.
SPREAD = 150
# Number of times that a cell is halved.
HALVINGS = 3
# Units of criteria on speeds and on accelerations, which depend on how fast a motion is.
SPEEDS, ACCELERATIONS = "m/s", "m/s^2"
Answer = TypeVar("Answer")
OF_MOTORS = functools.reduce(operator.or_, (row.flag for row in LIMITS if row.of_winch))


def _is_tension(row: Criterion) -> bool:
    # Limits of motors of redundant cables are limits of all tensions together.
    return bool(row.flag & TENSIONS or (row.flag & OF_MOTORS and row.unit == "N"))


class Trial(NamedTuple):
    """Motion whose slacks are to be bounded.

    Fields:
        motion: motion with one piece for each cell.
        feed: (n_cells,) largest speed that the section itself allows, m/s, inf for none.
    """

    motion: Spline
    feed: np.ndarray


class BindingName(NamedTuple):
    """Name of a criterion that can bind a motion.

    Fields:
        criterion: name of the criterion's flag.
        cable: index from 0; None if it is about no single cable.
        feed: words of G-code for a feed, such as "F6000"; "" for other criteria.
    """

    criterion: str
    cable: int | None
    feed: str = ""

    @property
    def words(self) -> str:
        """The criterion in words."""
        return criterion_words(Verdict[self.criterion.upper()], self.cable, self.feed)


class CellSlacks(NamedTuple):
    """Bounds of the slacks of criteria over the cells of a motion, over their scales.

    Fields:
        criteria: criteria of tensions, speeds and accelerations.
        low: (n_cells, n_rows) lower bounds; tensions over the weight, all else over its limit.
        high: (n_cells, n_rows) upper bounds of the smallest slack in each cell.
    """

    criteria: list[Criterion]
    low: np.ndarray
    high: np.ndarray

    @property
    def is_met(self) -> bool:
        """Tell whether all criteria are met in all cells."""
        return bool((self.low > 0.0).all())

    def grown(self, margins: GridMargins, weight: float) -> GridMargins:
        """Larger margins, which should make the motion meet the criteria that it breaks."""
        # Tightening one cell may move a violation to the next cell: let margins grow around it, too.
        radius = len(self.low) // SPREAD if any(side.any() for side in margins) else 0

        def lacking(chosen: list[bool]) -> np.ndarray:
            missed = LEFT - self.low[:, chosen].min(1, initial=np.inf)
            more = np.where(missed > 0.0, MORE * missed + STEP, 0.0)
            return maximum_filter1d(more, 2 * radius + 1, mode="nearest")

        tension = weight * lacking([_is_tension(criterion) for criterion in self.criteria])
        speed = lacking([criterion.unit == SPEEDS for criterion in self.criteria])
        acceleration = lacking([not _is_tension(row) and row.unit != SPEEDS for row in self.criteria])
        return GridMargins(*(old + more for old, more in zip(margins, (tension, acceleration, speed), strict=True)))

    def binding(
        self, feed: Float[np.ndarray, "n_cells"], words: Mapping[float, str]
    ) -> tuple[tuple[BindingName, ...], Int[np.ndarray, "n_cells"]]:
        """The criterion that binds in each cell."""
        nearest = self.high.argmin(1)
        names = [
            BindingName(criterion.flag.text, criterion.cables[0] if criterion.cables else None)
            for criterion in self.criteria
        ]
        binds = np.where(self.high[np.arange(len(nearest)), nearest] < BINDING, nearest, -1)
        if self.criteria[-1].flag == Verdict.OVER_FEED:
            last, (feeds, number) = names.pop(), np.unique(feed, return_inverse=True)
            binds = np.where(binds == len(names), len(names) + number, binds)
            names += [last._replace(feed=words.get(speed, f"{speed:g} m/s")) for speed in feeds.tolist()]
        return tuple(names), binds


def cell_slacks(problem: Problem, trials: Sequence[Trial]) -> list[CellSlacks]:
    """Bounds of slacks that depend on how fast motions are, on each of their pieces; the last is that of feeds."""
    motions = [trial.motion for trial in trials]
    robot, limits, splines = problem.robot, problem.limits, SplineBatch(motions)
    all_criteria = criteria(robot, limits)
    weight = float(robot.mass * robot.gravity)
    chosen = [
        k
        for k, row in enumerate(all_criteria)
        if _is_tension(row) or row.unit in (SPEEDS, ACCELERATIONS) or row.flag & OF_MOTORS
    ]
    scales = np.array([weight if _is_tension(all_criteria[k]) else all_criteria[k].allowed for k in chosen])
    knots = [np.asarray(motion.knots) for motion in motions]
    counts = [len(each) - 1 for each in knots]
    start, end = (np.concatenate([each[side] for each in knots]) for side in (slice(None, -1), slice(1, None)))
    motion = np.repeat(np.arange(len(motions)), counts)
    feed = np.concatenate([trial.feed for trial in trials])
    has_feed = bool(np.isfinite(feed).any())

    def bounded(cell: np.ndarray, start: np.ndarray, end: np.ndarray) -> Sides:
        states = splines.bounds(motion[cell], start, end, parabolas=robot.pulleys is None)
        below, above = (side[:, chosen] / scales for side in rate_slacks(robot, limits, states))
        if not has_feed:
            return below, above
        # The lower end of a line above a slack is not below the smallest slack.
        speeds, scale = speed_slacks(states), feed[cell, None]
        sides = 1.0 + speeds.low / scale, 1.0 + (speeds.high - np.abs(speeds.high_rise)) / scale
        return np.hstack([below, sides[0]]), np.hstack([above, sides[1]])

    low, high = close_bounds(bounded, (start, end), STEP, HALVINGS)
    parts = (np.split(side, np.cumsum(counts)[:-1]) for side in (low, high))
    named = [all_criteria[k] for k in chosen] + [Criterion(Verdict.OVER_FEED, (), SPEEDS, sense="most")] * has_feed
    return [CellSlacks(named, *sides) for sides in zip(*parts, strict=True)]


def together(problem: Problem, searches: Sequence[Generator[Trial, CellSlacks, Answer]]) -> list[Answer]:
    """Results of searches that ask for bounds of slacks of motions; all bounds of a round are computed together."""
    answers: dict[int, Answer] = {}
    trials: dict[int, Trial] = {}

    def resumed(k: int, following: Callable[[], Trial]) -> None:
        try:
            trials[k] = following()
        except StopIteration as end:
            answers[k] = end.value

    for k, search in enumerate(searches):
        resumed(k, partial(next, search))
    number = 0
    while trials:
        number, going = number + 1, list(trials)
        stage(f"proof {number}")
        for k, slacks in zip(going, cell_slacks(problem, [trials.pop(k) for k in going]), strict=True):
            resumed(k, partial(searches[k].send, slacks))
    return [answers[k] for k in range(len(searches))]
