"""Exact evaluations of robots: numbers of all objectives and requirements, in which order robots are, and a record."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.synthesis.measures.measure import FEASIBLE, Columns, Measure
from cspr_jax.synthesis.questions import ROUNDING, Question
from cspr_jax.synthesis.space import Point, RobotSpace, UnsuitableRobotError

# An objective without a value counts so much among requirements that are missed.
NO_OBJECTIVE = 1.0


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """Numbers of a robot.

    Fields:
        point: its point.
        values: (q,) numbers of the objectives, then of the requirements; NaN where it has none.
        missed: by how much it misses the requirements, each as a fraction of its bound; 0: it meets all; inf: it has
            no numbers.
        slack: smallest margin of what is required to be feasible, which decides between robots that are equally good;
            inf without such requirements.
        problem: why it has no numbers; empty where it has.
        is_screened: whether robots were lanes; results hold numbers of robots one by one.
    """

    point: Point
    values: tuple[float, ...]
    missed: float
    slack: float = math.inf
    problem: str = ""
    is_screened: bool = False


class Evaluator:
    """Evaluates robots, each once.

    Fields:
        space: robots of the design.
        objectives: what is to be large or small.
        requirements: what must hold.
        count: number of evaluations of all or some of a robot's numbers, by which searches are compared.
        record: all evaluations that were asked for, by their points, in their order.
        known: evaluations of an earlier process, by point and by whether robots were lanes.
        on_new: function that is called with evaluations that are new.
    """

    def __init__(
        self,
        space: RobotSpace,
        objectives: Sequence[Question],
        requirements: Sequence[Question],
    ) -> None:
        """Start with an empty record."""
        self.space, self.objectives, self.requirements = space, tuple(objectives), tuple(requirements)
        self.count, self.record = 0, dict[Point, Evaluation]()
        self.known = dict[tuple[Point, bool], Evaluation]()
        self.on_new: Callable[[list[Evaluation]], None] = lambda new: None

    def with_requirements(self, requirements: Sequence[Question]) -> Evaluator:
        """An evaluator of the same robots with other requirements."""
        return Evaluator(self.space, self.objectives, requirements)

    def worth(self, evaluation: Evaluation, objective: int) -> float:
        """The number of an objective, of which more is better."""
        return self.objectives[objective].sense * evaluation.values[objective]

    @property
    def questions(self) -> tuple[Question, ...]:
        """Objectives, then requirements."""
        return (*self.objectives, *self.requirements)

    @property
    def measures(self) -> list[Measure]:
        """The measures of all questions, each once."""
        return list({id(question.measure): question.measure for question in self.questions}.values())

    def one(self, point: Point) -> Evaluation:
        """The numbers of a robot, from functions for one robot alone, which decide."""
        if point not in self.record or self.record[point].is_screened:
            earlier = self.known.get((point, False))
            self.record[point] = self._computed(point) if earlier is None else earlier
        return self.record[point]

    def _computed(self, point: Point) -> Evaluation:
        columns, problem = dict[int, Columns](), ""
        for measure in self.measures:
            try:
                columns[id(measure)] = measure.columns(point)
            except UnsuitableRobotError as error:
                problem = str(error)
                break
        self.count += 1
        result = self._evaluation(point, None if problem else columns, problem)
        self.on_new([result])
        return result

    def many(self, points: Sequence[Point]) -> list[Evaluation]:
        """Numbers of many robots, as lanes where that can be; see `Measure.many`."""
        new_points = [point for point in dict.fromkeys(points) if point not in self.record]
        new = [point for point in new_points if (point, True) not in self.known]
        evaluations = dict[Point, Evaluation]()
        if new:
            parts = {id(measure): measure.many(new) for measure in self.measures}
            for i, point in enumerate(new):
                columns = {key: part[i] for key, part in parts.items()}
                present = {key: one for key, one in columns.items() if one is not None}
                result = self._evaluation(point, present if len(present) == len(columns) else None, "no such robot")
                evaluations[point] = dataclasses.replace(result, is_screened=True)
            self.count += len(new)
            self.on_new(list(evaluations.values()))
        self.record |= {point: evaluations.get(point) or self.known[point, True] for point in new_points}
        return [self.record[point] for point in points]

    def _evaluation(self, point: Point, columns: Mapping[int, Columns] | None, problem: str) -> Evaluation:
        if columns is None:
            return Evaluation(point, (math.nan,) * len(self.questions), math.inf, -math.inf, problem)
        values, missed, slack = [], 0.0, math.inf
        for question in self.questions:
            numbers = columns[id(question.measure)]
            values.append(question.value(numbers))
            if math.isnan(values[-1]):
                missed += NO_OBJECTIVE if question.sense else math.inf
            elif not question.sense:
                missed += question.miss(values[-1], numbers)
            if question.quantity == FEASIBLE and not question.sense:
                margins = [numbers[name] for name in question.measure.slacks()]
                slack = min(slack, *(float(np.fmin.reduce(margin, initial=math.inf)) for margin in margins))
        return Evaluation(point, tuple(values), missed, slack)


@dataclasses.dataclass(frozen=True)
class Goal:
    """One objective, beside bounds of another one.

    Fields:
        objective: index of the objective.
        level: smallest value of the other objective, times its sense; -inf: any.
        other: index of the other objective.
    """

    objective: int = 0
    level: float = -math.inf
    other: int = 1

    def relaxed(self, fraction: float) -> Goal:
        """The goal with a level that is lower by a fraction, where robots are to keep more in reserve."""
        return (
            self if math.isinf(self.level) else dataclasses.replace(self, level=self.level - fraction * abs(self.level))
        )

    def rank(self, evaluator: Evaluator, evaluation: Evaluation) -> tuple[float, float, float]:
        """Sort key of a robot: the smaller, the better."""
        worth, missed = evaluator.worth(evaluation, self.objective), evaluation.missed
        if math.isfinite(self.level) and math.isfinite(missed):
            short = self.level - evaluator.worth(evaluation, self.other)
            magnitude = abs(self.level) or 1.0
            missed += short / magnitude if short > ROUNDING * magnitude else 0.0
        cost = math.inf if math.isnan(worth) else -worth
        return (missed, -evaluation.slack, cost) if missed > 0.0 else (missed, cost, -evaluation.slack)


# The first objective alone.
FIRST = Goal()


def front_of(values: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, "n"]:
    """Tell which pairs, of which more is better, no other pair surpasses in both, up to rounding."""
    finite = np.where(np.isfinite(values), np.abs(values), 0.0)
    unit = ROUNDING * np.maximum(finite.max(0, initial=0.0), 1e-300)
    rounded = np.round(values / unit)
    best, is_best = -math.inf, np.zeros(len(values), bool)
    for i in np.lexsort((-rounded[:, 1], -rounded[:, 0])):
        if rounded[i, 1] > best:
            best, is_best[i] = rounded[i, 1], True
    return is_best
