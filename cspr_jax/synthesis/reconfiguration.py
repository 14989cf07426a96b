"""Robots that are set anew between tasks: the best setting for each task, and the fewest changes.

Tasks are done in their order, and those in a row may share a setting. Of all ways to divide them into groups those with
the fewest groups are tried first; a group that no robot can do alone is in none of them.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator

from cspr_jax.synthesis.evaluations import FIRST, Evaluator
from cspr_jax.synthesis.measures.groups import GroupedSpace
from cspr_jax.synthesis.problem import DesignProblem, Groups
from cspr_jax.synthesis.search import Chosen, Progress, searched


@dataclasses.dataclass(frozen=True)
class Division:
    """A division of the tasks into groups, with the best robot.

    Fields:
        space: robots with a setting for each group of tasks.
        evaluator: evaluator of its robots.
        chosen: the best of these.
    """

    space: GroupedSpace
    evaluator: Evaluator
    chosen: Chosen


def reconfigured(
    problem: DesignProblem, progress: Progress, prepare: Callable[[Evaluator, str], None]
) -> tuple[Division, list[Division]]:
    """The division with the fewest groups, and the best one of these; and each task alone.

    `prepare` is called with each evaluator before it is used, and with the name of its groups.
    """
    tasks, divisions = problem.tasks, dict[tuple[tuple[str, ...], ...], Division]()

    def divided(groups: Groups) -> Division:
        key = tuple(map(tuple, groups))
        if key not in divisions:
            evaluator = problem.evaluator_of(groups)
            prepare(evaluator, "; ".join(" ".join(group) for group in groups))
            best = searched(evaluator, problem.design.search, _within(progress, groups))[0]
            divisions[key] = Division(problem.grouped_space(groups), evaluator, best)
        return divisions[key]

    alone = [divided([[task]]) for task in tasks]
    best = None
    for count in range(1, len(tasks) + 1):
        for groups in _divisions(tasks, count):
            if progress.stopped():
                break
            if count > 1 and not all(divided([group]).chosen.is_proved for group in groups):
                continue
            there = divided(groups)
            if best is None or _rank(there) < _rank(best):
                best = there
        if best is not None and (best.chosen.is_proved or progress.stopped()):
            break
    return best or alone[0], alone


def _rank(division: Division) -> tuple[float, float]:
    missed, cost, _ = FIRST.rank(division.evaluator, division.chosen.evaluation)
    return missed + (not division.chosen.is_proved), cost


def _divisions(tasks: list[str], count: int) -> Iterator[list[list[str]]]:
    # All ways to cut a row of tasks into so many groups.
    for cuts in itertools.combinations(range(1, len(tasks)), count - 1):
        ends = [0, *cuts, len(tasks)]
        yield [tasks[a:b] for a, b in itertools.pairwise(ends)]


def _within(progress: Progress, groups: Groups) -> Progress:
    words = "; ".join(" ".join(group) for group in groups)
    return dataclasses.replace(progress, tell=lambda line: progress.tell(f"{words}: {line}"))
