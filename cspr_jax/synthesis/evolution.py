"""Search where numbers jump, such as numbers of arcs and fractions of cells: SciPy's differential evolution."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from cspr_jax.synthesis.evaluations import Evaluation, Evaluator, Goal

# Members for each parameter, and the fewest that differential evolution takes.
MEMBERS, FEWEST = 5, 6
# Worth of a margin beside a number that jumps, as a fraction of it, so that among equals the safer robot stays.
TIE = 1e-6
# Cost of robots that miss requirements, beyond that of all others.
MISSED = 1e12


def evolved(
    evaluator: Evaluator,
    starts: Sequence[Evaluation],
    goal: Goal,
    generations: int,
    stopped: Callable[[], bool] = lambda: False,
) -> Evaluation:
    """The best robot of a population that starts from some robots, with the arrangement of the first of them."""
    from scipy.optimize import differential_evolution  # loads much of SciPy

    space, arrangement = evaluator.space, starts[0].point.arrangement
    count = len(space.names)

    def rank(evaluation: Evaluation) -> tuple[float, float, float]:
        return goal.rank(evaluator, evaluation)

    population_size = max(MEMBERS * count, FEWEST)
    members = [space.fractions(start.point) for start in starts if start.point.arrangement == arrangement][
        :population_size
    ]
    random = np.random.default_rng(0)
    others = random.uniform(size=(population_size - len(members), count))
    near = np.clip(members[0] + 0.1 * random.normal(size=others.shape), 0.0, 1.0)
    population = np.concatenate([members, np.where(np.arange(len(others))[:, None] % 2, others, near)])

    def costs(fractions: np.ndarray) -> np.ndarray:
        points = [space.point(column, arrangement) for column in fractions.T]
        return np.array([_cost(rank(evaluation), evaluation) for evaluation in evaluator.many(points)])

    differential_evolution(
        costs,
        [(0.0, 1.0)] * count,
        init=population,
        maxiter=generations,
        tol=1e-8,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=0,
        callback=lambda intermediate_result: stopped(),
    )
    tried = [one for one in evaluator.record.values() if one.point.arrangement == arrangement]
    return evaluator.one(min([*tried, *starts], key=rank).point)


def _cost(rank: tuple[float, float, float], evaluation: Evaluation) -> float:
    missed, worth, _ = rank
    if missed > 0.0 or math.isnan(worth) or worth == math.inf:
        return MISSED * (1.0 + min(missed, MISSED))
    if math.isinf(worth):
        return -MISSED
    slack = evaluation.slack if math.isfinite(evaluation.slack) else 0.0
    return worth - TIE * max(abs(worth), 1.0) * math.tanh(slack)
