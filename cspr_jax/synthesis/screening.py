"""Screening: the first robots of a design, spread evenly over the ranges of its parameters, and all arrangements."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cspr_jax.synthesis.evaluations import FIRST, Evaluation, Evaluator, Goal
from cspr_jax.synthesis.space import Point

# Robots that are screened for each parameter, where a file does not say how many.
EACH = 16
# Arrangements whose parameters are varied: the best at the parameters of the file.
ARRANGEMENTS = 8
# Robots that are screened before the next look at whether to stop.
AT_ONCE = 2048
# Distance, as a fraction of the ranges, within which two robots lead to the same local search.
NEAR = 0.05


def screened(evaluator: Evaluator, count: int | None, stopped: Callable[[], bool]) -> None:
    """Evaluate the robot of the file, all arrangements of it, and points of a Sobol sequence."""
    space = evaluator.space
    _evaluate(evaluator, [space.first._replace(arrangement=each) for each in space.arrangements], stopped)
    if not space.names or stopped():
        return
    from scipy.stats import qmc  # loads much of SciPy

    number = EACH * len(space.names) if count is None else count
    sobol = qmc.Sobol(len(space.names), scramble=True, rng=0)
    fractions = sobol.random_base2(max(number - 1, 0).bit_length())[:number]
    ranked = sorted(evaluator.record.values(), key=lambda one: FIRST.rank(evaluator, one))
    best = list(dict.fromkeys(one.point.arrangement for one in ranked))[:ARRANGEMENTS]
    points = [space.point(each, best[i % len(best)]) for i, each in enumerate(fractions)]
    _evaluate(evaluator, points, stopped)


def _evaluate(evaluator: Evaluator, points: Sequence[Point], stopped: Callable[[], bool]) -> None:
    for start in range(0, len(points), AT_ONCE):
        if stopped() and evaluator.record:  # there is always a robot to end with
            return
        evaluator.many(points[start : start + AT_ONCE])


def starts_of(evaluator: Evaluator, goal: Goal, count: int) -> list[Evaluation]:
    """The best robots so far that are not near each other."""
    chosen = list[Evaluation]()
    for one in sorted(evaluator.record.values(), key=lambda one: goal.rank(evaluator, one)):
        if len(chosen) == count:
            break
        if not any(_are_near(evaluator, one.point, other.point) for other in chosen):
            chosen.append(one)
    return chosen


def _are_near(evaluator: Evaluator, one: Point, other: Point) -> bool:
    space = evaluator.space
    if one.arrangement != other.arrangement:
        return False
    return bool(np.abs(space.fractions(one) - space.fractions(other)).max(initial=0.0) < NEAR)
