"""Straight lines from rest to rest in the least time: arrays of ends in, answers out."""

import dataclasses
import functools
import operator
from functools import partial
from typing import Any

import jax
import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.feasibility.limits import given
from cspr_jax.feasibility.point_mass.line_faces import LineFaces, line_faces
from cspr_jax.feasibility.point_mass.line_limits import limit_slacks, open_limits
from cspr_jax.feasibility.point_mass.line_proof import Proved, smallest_margin
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.search.answers import Answers
from cspr_jax.search.least_time import BATCH, TOLERANCE, Rule, least_times
from cspr_jax.trajectories.timed_lines import TimedLine, fixed_law, s_curve


@dataclasses.dataclass(frozen=True)
class LineAnswers(Answers):
    """Answers of straight lines, one each.

    Fields:
        acceleration_time: (n,) p, s.
        least_duration: (n,) no motion along the line is faster, s.
        active: (n, 2) number of the bound that holds back the acceleration, and of that which holds back the braking:
            from 1 on; 0: none.
        names: of these bounds, the first one's first.
    """

    acceleration_time: np.ndarray
    least_duration: np.ndarray
    active: np.ndarray
    names: tuple[str, ...] = ()

    @property
    def feasible(self) -> np.ndarray:
        """Whether each line is proved feasible, (n,)."""
        return self.verdict == 0

    def details(self, i: int) -> dict[str, Any]:
        """Details of a segment; see `Answers.details`."""
        active = dict.fromkeys(self.names[k - 1] for k in self.active[i] if k > 0)
        return {
            "acceleration_time": float(self.acceleration_time[i]),
            "active": list(active),
            "least_duration": float(self.least_duration[i]),
            "arcs": None,
            "tried_arcs": None,
        }


@jax.jit
def _faces(robot: PointMassRobot, arguments) -> LineFaces:
    return jax.vmap(partial(line_faces, robot))(*arguments)


def timed_lines(
    problem: Problem,
    starts: np.ndarray,
    ends: np.ndarray,
    *,
    law: str = "s-curve",
    rule: Rule = "optimum",
    max_acceleration: float = np.inf,
) -> tuple[LineAnswers, list[TimedLine]]:
    """The fastest motions along straight lines by a law of time.

    Args:
        problem: robot, on spools in one plane.
        starts: (n, 3) from the centroid of the spools, z down, m; at rest.
        ends: (n, 3) likewise, elsewhere.
        law: one of `trajectories.timed_lines.LAWS`.
        rule: of the S-model.
        max_acceleration: largest size of the acceleration, m/s^2.

    Returns:
        the answers, margins in m/s^2; the motions, not finite where none is feasible.
    """
    robot, count = problem.robot, len(starts)
    least = least_times(robot, starts, ends, law=law, rule=rule, max_acceleration=max_acceleration)
    faces = in_batches(partial(_faces, robot), (starts, ends), size=BATCH)
    gravity = float(np.asarray(robot.gravity))
    motions, verdicts = [], least.verdict.copy()
    margin, proved = np.minimum(least.rest_margin, 0.0), np.full(count, np.nan)
    rows, room = given(problem.limits), np.full(count, np.inf)
    for i in range(count):
        time, possible = least.duration[i], np.isfinite(least.duration[i])
        ratio = leaf(least.acceleration_time[i] / time if possible else 0.5)
        shape = jax.tree.map(np.asarray, s_curve(ratio) if law == "s-curve" else fixed_law(law))
        motions.append(TimedLine(leaf(starts[i]), leaf(ends[i] - starts[i]), shape, leaf(time)))
        if not possible:
            continue
        found = smallest_margin(jax.tree.map(lambda x, i=i: x[i], faces), shape, float(time), gravity)
        margin[i], proved[i] = found.margin, found.bound
        verdicts[i] = _verdict(found, gravity)
        if rows:
            slack = np.asarray(_limit_slacks(problem, motions[i]))
            room[i], verdicts[i] = slack.min(), verdicts[i] | _broken(problem, slack)
    none, nothing = np.zeros(count, int), np.full(count, np.nan)
    answers = LineAnswers(
        none,
        none,
        verdicts,
        least.duration,
        margin,
        proved,
        room,
        nothing,
        least.acceleration_time,
        least.least_duration,
        np.stack([least.active_up, least.active_down], axis=1),
        least.names,
    )
    return answers, motions


_limit_slacks = jax.jit(limit_slacks)


def _broken(problem: Problem, slack: np.ndarray) -> int:
    # A sample refutes; only at ends it proves.
    flags = Verdict.UNDECIDED.value if open_limits(problem.limits) else 0
    broken = [row.flag.value for row, value in zip(given(problem.limits), slack, strict=True) if not value > 0.0]
    return functools.reduce(operator.or_, broken) if broken else flags


def _verdict(found: Proved, gravity: float) -> int:
    if found.bound > TOLERANCE * gravity:
        return 0
    return (Verdict.SLACK_CABLE if found.margin < -TOLERANCE * gravity else Verdict.UNDECIDED).value
