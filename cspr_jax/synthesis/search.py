"""The search of a design: screening, local searches from the best few, exact numbers, proofs; one objective or two."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from cspr_jax.config.design import SearchKeys
from cspr_jax.errors import ConfigError
from cspr_jax.numerics.shapes import Float
from cspr_jax.synthesis.counting import counted
from cspr_jax.synthesis.evaluations import FIRST, Evaluation, Evaluator, Goal, front_of
from cspr_jax.synthesis.evolution import evolved
from cspr_jax.synthesis.exchange import improved
from cspr_jax.synthesis.measures.measure import FRACTION
from cspr_jax.synthesis.proofs import RequirementProof, proofs_of
from cspr_jax.synthesis.questions import Question
from cspr_jax.synthesis.screening import screened, starts_of

# Fractions of the largest margins that are kept in reserve, in turn, until full cells are proved.
RESERVES = (1e-4, 1e-3, 3e-3, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3)
# Number of times that the last step of these is halved.
HALVINGS = 3
# Local searches end where so many have found the same number, up to this fraction of it.
AGREEING, AGREED = 2, 1e-6
# By how much fewer generations differential evolution has after a local search.
FEWER = 4
# Robots of a front that are nearer to each other than this fraction of its extent count as one.
NEAR = 1e-4


@dataclasses.dataclass
class Progress:
    """Hooks of a search.

    Fields:
        tell: called with a line at each stage.
        stopped: tells whether to end with what there is.
    """

    tell: Callable[[str], None] = lambda line: None
    stopped: Callable[[], bool] = lambda: False


@dataclasses.dataclass(frozen=True)
class Chosen:
    """A robot that a search found.

    Fields:
        evaluation: its numbers.
        proofs: proofs of its requirements, of those for which they are asked.
        requirements: requirements with what is kept in reserve for proofs; empty: nothing is.
    """

    evaluation: Evaluation
    proofs: tuple[RequirementProof, ...] = ()
    requirements: tuple[Question, ...] = ()

    @property
    def is_proved(self) -> bool:
        """Tell whether it meets all requirements, with all proofs that are asked for."""
        return self.evaluation.missed == 0.0 and all(proof.is_whole for proof in self.proofs)


def searched(evaluator: Evaluator, settings: SearchKeys, progress: Progress) -> list[Chosen]:
    """The best robot; of two objectives those of the Pareto front, from the best by the first objective on.

    Raises:
        ConfigError: no robot has an answer to all questions.
    """
    screened(evaluator, settings.screen, progress.stopped)
    progress.tell(f"screened {len(evaluator.record)} robots{_best_words(evaluator)}")
    if all(math.isinf(one.missed) for one in evaluator.record.values()) and not progress.stopped():
        problem = evaluator.one(evaluator.space.first).problem
        words = "no robot has an answer to all questions; that of the file has none since"
        raise ConfigError(evaluator.space.file, f"{words} {problem}")
    best = _best(evaluator, settings, FIRST, progress)
    if len(evaluator.objectives) == 1:
        return [_proved(evaluator, settings, FIRST, best, progress)]
    return _front(evaluator, settings, best, progress)


def _best(evaluator: Evaluator, settings: SearchKeys, goal: Goal, progress: Progress) -> Evaluation:
    # The best robot by one goal, by local searches from the best few robots so far.
    starts = starts_of(evaluator, goal, settings.starts)
    objective = evaluator.objectives[goal.objective]
    questions = [objective, *evaluator.requirements]
    questions += [evaluator.objectives[goal.other]] if math.isfinite(goal.level) else []
    results = list(starts)
    climb = _climb_of(objective)
    for i, start in enumerate(starts if climb is not None and evaluator.space.names else ()):
        if progress.stopped() or climb is None:
            break
        results.append(climb(evaluator, start.point, goal, progress.stopped))
        if _agree(evaluator, results[len(starts) :], goal):  # further searches would find the same
            break
        best = min(results, key=lambda one: goal.rank(evaluator, one))
        progress.tell(f"local search {i + 1} of {len(starts)}{_words(evaluator, best)}")
    results.sort(key=lambda one: goal.rank(evaluator, one))
    if evaluator.space.names and not progress.stopped() and not all(question.is_smooth for question in questions):
        # After a local search it only looks about.
        generations = settings.generations if climb is None else max(settings.generations // FEWER, 1)
        results.insert(0, evolved(evaluator, results, goal, generations, progress.stopped))
        progress.tell(f"differential evolution{_words(evaluator, results[0])}")
    return evaluator.one(min(results, key=lambda one: goal.rank(evaluator, one)).point)


def _climbed(
    evaluator: Evaluator, settings: SearchKeys, start: Evaluation, goal: Goal, progress: Progress
) -> Evaluation:
    # A better robot near one, by the search that suits the objective.
    climb = _climb_of(evaluator.objectives[goal.objective])
    if climb is not None:
        return climb(evaluator, start.point, goal, progress.stopped)
    return evolved(evaluator, [start], goal, settings.generations, progress.stopped)


def _climb_of(objective: Question) -> Callable[..., Evaluation] | None:
    # Local search for an objective; None where it jumps.
    counts = objective.quantity == FRACTION and bool(objective.measure.slacks())
    return improved if objective.is_smooth else counted if counts else None


def _agree(evaluator: Evaluator, results: list[Evaluation], goal: Goal) -> bool:
    # Tell whether the two best of the local searches have met in one optimum.
    if len(results) < AGREEING:
        return False
    first, second, *_ = sorted(goal.rank(evaluator, one) for one in results)
    return first[0] == second[0] == 0.0 and abs(second[1] - first[1]) <= AGREED * abs(first[1])


def _front(evaluator: Evaluator, settings: SearchKeys, first: Evaluation, progress: Progress) -> list[Chosen]:
    # The best robots by each objective, and between them the best by one while the other stays above levels.
    last = _best(evaluator, settings, Goal(1, other=0), progress)
    # Levels of a number that jumps cost a search nothing, while it is hard to make large.
    main = int(not evaluator.objectives[0].is_smooth and evaluator.objectives[1].is_smooth)
    ends, results = sorted(evaluator.worth(one, 1 - main) for one in (first, last)), [first, last]
    if first.missed == 0.0 and last.missed == 0.0 and all(map(math.isfinite, ends)):
        few = settings.model_copy(update={"starts": 1})  # beside robots that are known to be good
        # At the ends the other objective is not yet as good as it can be.
        goals = [Goal(1 - main, max(evaluator.worth(one, main) for one in (first, last)), main)]
        goals += [Goal(main, float(level), 1 - main) for level in np.linspace(ends[0], ends[1], settings.front)[1:]]
        for goal in goals:
            if progress.stopped():
                break
            results.append(_best(evaluator, few, goal, progress))
    chosen = _spread(evaluator, results, settings.front)
    if not chosen:
        return [Chosen(first)]
    proved = [_proved(evaluator, settings, _goal_of(evaluator, one, main), one, progress) for one in chosen]
    on_front = front_of(_worths(evaluator, [one.evaluation for one in proved]))
    return sorted(itertools.compress(proved, on_front), key=lambda one: -evaluator.worth(one.evaluation, 0))


def _goal_of(evaluator: Evaluator, one: Evaluation, main: int) -> Goal:
    return Goal(main, evaluator.worth(one, 1 - main), 1 - main)


def _worths(evaluator: Evaluator, robots: Sequence[Evaluation]) -> Float[np.ndarray, "n 2"]:
    return np.array([[evaluator.worth(one, i) for i in (0, 1)] for one in robots]).reshape(-1, 2)


def _spread(evaluator: Evaluator, results: list[Evaluation], count: int) -> list[Evaluation]:
    # Results that no robot surpasses in both objectives; where numbers jump, then others of that kind, far from these.
    # Results come first, so that among equals they stay.
    all_robots = {one.point: one for one in (*results, *evaluator.record.values())}
    good = [one for one in all_robots.values() if one.missed == 0.0]
    if not good:
        return []
    front = list(itertools.compress(good, front_of(_worths(evaluator, good))))
    points, scale = {one.point for one in results}, np.ptp(_worths(evaluator, front), axis=0) + 1e-300

    def gap(one: Evaluation) -> float:
        distances = (_worths(evaluator, chosen) - _worths(evaluator, [one])) / scale
        return float(np.abs(distances).sum(1).min(initial=math.inf))

    chosen = list[Evaluation]()
    for one in front:
        if one.point in points and gap(one) > NEAR:
            chosen.append(one)
    others = [one for one in front if one.point not in points]
    while others and len(chosen) < count and not all(question.is_smooth for question in evaluator.objectives):
        chosen.append(others.pop(int(np.argmax([gap(one) for one in others]))))
    exact = [evaluator.one(one.point) for one in chosen]
    return [one for one in exact if one.missed == 0.0]


def _proved(evaluator: Evaluator, settings: SearchKeys, goal: Goal, best: Evaluation, progress: Progress) -> Chosen:
    # The robot with its proofs; where these fail, one that keeps as little in reserve as they need.
    chosen = Chosen(best, proofs_of(evaluator, best.point))
    if chosen.is_proved or best.missed > 0.0 or not evaluator.space.names:
        return chosen
    open_ones = {proof.key for proof in chosen.proofs if not proof.is_whole}

    def with_reserve(reserve: float) -> Chosen:
        requirements = [
            one.with_reserve(reserve, one.measure.columns(best.point)) if one.key in open_ones else one
            for one in evaluator.requirements
        ]
        careful = evaluator.with_requirements(requirements)
        point = _climbed(careful, settings, best, goal.relaxed(reserve), progress).point
        evaluator.count += careful.count
        there = Chosen(evaluator.one(point), proofs_of(evaluator, point), tuple(requirements))
        progress.tell(f"proofs with {100.0 * reserve:.3g} % in reserve: {'all' if there.is_proved else 'some open'}")
        return there

    failed = 0.0
    for reserve in RESERVES:
        if progress.stopped():
            return chosen
        there = with_reserve(reserve)
        if there.is_proved:
            break
        failed = reserve
    else:
        return chosen
    low, high = failed, reserve
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if progress.stopped():
            break
        nearer = with_reserve(middle)
        low, high, there = (low, middle, nearer) if nearer.is_proved else (middle, high, there)
    return there


def _words(evaluator: Evaluator, best: Evaluation) -> str:
    pairs = zip(evaluator.questions, best.values, strict=True)
    numbers = ", ".join(f"{question.name} {value:.6g}" for question, value in pairs if question.sense)
    state = "" if best.missed == 0.0 else ", requirements missed"
    return f"; best so far: {numbers}{state}" if math.isfinite(best.missed) else "; no robot so far"


def _best_words(evaluator: Evaluator) -> str:
    return _words(evaluator, min(evaluator.record.values(), key=lambda one: FIRST.rank(evaluator, one)))
