"""Plans retimed: the same paths in the least time that all limits allow."""

import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.build.scenes import scene_of
from cspr_jax.curves.spline import Spline, chained
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.paths.answers import PathAnswers, feeds_of
from cspr_jax.families.paths.geometry.section import SectionSettings
from cspr_jax.families.paths.least_time.discrete import FASTER
from cspr_jax.families.paths.least_time.least_time import LeastTime, least_time_motions
from cspr_jax.families.paths.leg import Ride, cut, section_answer
from cspr_jax.families.paths.retraced import Retraced, retraced
from cspr_jax.motion.answers import Answers, replaced
from cspr_jax.motion.motion import Motion, states_at
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.plans.planning import PlannedMotions, with_motions
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.attained import with_attained
from cspr_jax.verification.proved_answers import proved_answers

# A motion replaces the planned one if it saves this fraction of the duration.
SMALLEST_GAIN = 1e-4
# A motion with a path speed above this fraction of the largest one searched counts as not bounded by any limit.
UNBOUNDED = 0.5
AWAY = 1e-6  # m; if the motion is farther from the planned path, its grid is doubled
DOUBLINGS = 3  # largest number of grids tried, the first one included
# Accelerations at a pose may jump by this fraction of gravity without a warning.
JUMPS = 1e-6
# Why motions stay as planned.
UNPROVED = "no faster motion is proved"
OF_MEANS = "the full plan exceeds motor_torque_rms_max with faster motions"


@dataclasses.dataclass(frozen=True)
class RetimedAnswers(PathAnswers):
    """Answers of segments that were retimed.

    Fields:
        lower_bound: (n,) lower bound of the time along each path, s; NaN without one, or if the motion passes a pose.
        planned_duration: (n,) duration before retiming, s.
        deviation: (n,) largest distance from the planned path at samples, m; 0 for a motion that stays as planned.
        is_retimed: (n,) whether the motion is the faster one and not the planned one.
    """

    lower_bound: np.ndarray
    planned_duration: np.ndarray
    deviation: np.ndarray
    is_retimed: np.ndarray

    def details(self, i: int) -> dict[str, Any]:
        """Durations before and after, deviation from the planned path, bounds; see `Answers.details`."""
        duration, bound, planned = (float(x[i]) for x in (self.duration, self.lower_bound, self.planned_duration))
        return super().details(i) | {
            "lower_bound": bound,
            "gap": 1.0 - bound / duration,
            "planned_duration": planned,
            "gain": 1.0 - duration / planned,
            "retimed": bool(self.is_retimed[i]),
            "path_deviation": float(self.deviation[i]),
        }


class _Faster(NamedTuple):
    # A fastest motion along a path; `deviation` is its largest distance from the planned motion, m.
    ride: Ride
    fastest: LeastTime
    deviation: float


def retimed(plan: PlannedMotions, grid: int, ramp_time: float, path: Path) -> PlannedMotions:
    """A plan whose motions run along their paths in the least time.

    Between two poses at rest, new motions replace the planned ones if they are proved and either faster or in place of
    motions that are not feasible.
    """
    motions = [motion for leg in plan.legs for motion in leg.motions]
    _check(plan, motions, path)
    problem = plan.problem
    scene = scene_of(problem.robot, plan.robot_file, plan.frame, plan.keys, path, trajectory=plan.keys)
    try:
        paths = retraced(problem.robot, motions, grid, plan.feeds)
    except InputError as error:
        raise ConfigError(path, f"retime: {error}") from error
    faster = _fastest(plan, paths, grid, ramp_time)
    parts: list[list[Spline]] = [[] for _ in motions]
    for one in faster:
        for segment, motion in cut(one.fastest, one.ride):
            parts[segment].append(motion)
    trial = [chained(splines) if splines else motion for splines, motion in zip(parts, motions, strict=True)]
    proved = proved_answers(problem, trial, scene, _feeds_along(faster, len(motions)))
    moves = np.array([len(splines) > 0 for splines in parts])
    is_fast = moves & _is_better(plan, proved, faster)
    is_better = _keeping_means(plan, trial, motions, is_fast, _groups(faster, len(motions)))
    answers = _answers(plan, faster, _with_planned(plan, scene, proved, motions, np.flatnonzero(~is_better)), is_better)
    chosen = [new if better else old for new, old, better in zip(trial, motions, is_better, strict=True)]
    lines = (
        _stays(moves & ~is_fast)
        + _stays(is_fast & ~is_better, OF_MEANS)
        + _jumps(plan, faster, is_better)
        + _unbounded(plan, faster)
    )
    lines += answers.notes("retime: ramp_time")
    return with_motions(plan, with_attained(plan.problem, answers, chosen, scene), chosen, lines, scene)


def _feeds_along(faster: Sequence[_Faster], count: int) -> list[np.ndarray | None]:
    sections = [section_answer(one.fastest, one.ride) for one in faster]
    through = [[each for each in sections if (each.segments == i).any()] for i in range(count)]
    return [feeds_of(each, i) if each else None for i, each in enumerate(through)]


def _check(plan: PlannedMotions, motions: list[Motion], path: Path) -> None:
    if plan.outcomes:
        raise ConfigError(path, "retime: must be absent for a plan that launches an object, whose flight has its time")
    if not motions:
        raise ConfigError(path, "retime: must be absent for a motion that is too long to be held")
    unknown = np.flatnonzero(~np.isfinite(plan.answers.duration))
    if len(unknown):
        raise ConfigError(path, f"retime: must be absent: segment {unknown[0] + 1} has no motion; see its verdict")


def _fastest(plan: PlannedMotions, paths: Sequence[Retraced], grid: int, ramp_time: float) -> list[_Faster]:
    # Find the fastest motions along paths; refine the grids of those that deviate too far.
    answers, rows = dict[int, _Faster](), list(range(len(paths)))
    for doubling in range(DOUBLINGS):
        chosen = [paths[k] for k in rows]
        settings = [SectionSettings(grid * 2**doubling, ramp_time, *one.speeds) for one in chosen]
        along = least_time_motions(
            plan.problem, [one.section for one in chosen], settings, [one.accelerations for one in chosen]
        )
        for k, one, each, fastest in zip(rows, chosen, settings, along, strict=True):
            answers[k] = _Faster(Ride(one.section, each, one.segments), fastest, one.deviation + fastest.deviation)
        rows = [k for k in rows if answers[k].deviation > AWAY]
        if not rows:
            break
    return [answers[k] for k in range(len(paths))]


def _answers(plan: PlannedMotions, faster: Sequence[_Faster], proved: Answers, is_better: np.ndarray) -> RetimedAnswers:
    # Report sections for retimed motions only, bounds for all.
    count = len(is_better)
    bound, deviation = np.zeros(count), np.zeros(count)
    sections = np.empty(count, object)
    sections[:] = [[] for _ in range(count)]
    for one in faster:
        section = section_answer(one.fastest, one.ride)
        first, last = section.ends
        bound[first : last + 1] += one.fastest.lower_bound if first == last else np.nan
        for segment in np.flatnonzero(is_better[first : last + 1]) + first:
            sections[segment].append(section)
            deviation[segment] = max(deviation[segment], one.deviation)
    columns = {field.name: getattr(proved, field.name) for field in dataclasses.fields(proved)}
    return RetimedAnswers(
        **columns | {name: getattr(plan.answers, name) for name in ("arcs", "tried_arcs")},
        sections=sections,
        lower_bound=np.where(bound > 0.0, bound, np.nan),
        planned_duration=np.array(plan.answers.duration),
        deviation=deviation,
        is_retimed=is_better,
    )


def _is_better(plan: PlannedMotions, answers: Answers, faster: Sequence[_Faster]) -> np.ndarray:
    # Tell which of the n motions replace the planned ones: between two poses at rest, all or none.
    before, after = np.array(plan.answers.duration), answers.duration
    group = _groups(faster, len(before))
    better = np.zeros(len(before), bool)
    for name in np.unique(group).tolist():
        rows = group == name
        is_faster = after[rows].sum() < (1.0 - SMALLEST_GAIN) * before[rows].sum() or not plan.is_feasible[rows].all()
        better[rows] = answers.feasible[rows].all() and is_faster
    return better


def _groups(faster: Sequence[_Faster], count: int) -> np.ndarray:
    # Number the groups of segments between two poses at rest, (n,).
    group = np.arange(count)
    for segments in (one.ride.segments for one in faster):
        group[np.isin(group, group[segments])] = group[segments].min()
    return group


def _keeping_means(
    plan: PlannedMotions, trial: Sequence[Motion], motions: Sequence[Motion], is_better: np.ndarray, group: np.ndarray
) -> np.ndarray:
    # Take back the groups with the largest mean torques, one by one, until the full plan keeps their limit.
    limit, retimed_rows = plan.problem.limits.motor_torque_rms_max, is_better.copy()
    if limit is None:
        return is_better
    from cspr_jax.verification.mean_torques import mean_torques  # few plans need it

    largest = np.asarray(limit)
    while True:
        chosen = [new if better else old for new, old, better in zip(trial, motions, retimed_rows, strict=True)]
        means = mean_torques(plan.problem, chosen)
        if (means.rms_high <= largest * (1.0 + TOUCHED)).all():
            return retimed_rows
        if not retimed_rows.any():  # nor does the plan as it was
            return is_better
        worst = np.where(retimed_rows, (means.rms_of_each / largest).max(1), -1.0).argmax()
        retimed_rows &= group != group[worst]


def _with_planned(
    plan: PlannedMotions, scene: Scene, answers: Answers, motions: list[Motion], rows: np.ndarray
) -> Answers:
    # Replace answers by those of the planned motions in `rows`; a motion that its family has proved stays feasible.
    if not len(rows):
        return answers
    feeds = plan.feeds
    others = proved_answers(plan.problem, [motions[i] for i in rows], scene, [feeds[i] for i in rows])
    answers = replaced(answers, rows, others, np.arange(len(rows)))
    answers.verdict[rows] = np.where(plan.is_feasible[rows], 0, answers.verdict[rows])
    return answers


def _stays(is_kept: np.ndarray, why: str = UNPROVED) -> list[str]:
    numbers = ", ".join(str(i + 1) for i in np.flatnonzero(is_kept).tolist())
    return [f"retime: as planned, since {why}: to {numbers}"] if numbers else []


def _jumps(plan: PlannedMotions, faster: list[_Faster], is_better: np.ndarray) -> list[str]:
    # Warn of tensions that jump where the motion turns back at a position at which the robot cannot rest.
    largest, gravity = 0.0, float(plan.problem.robot.gravity)
    for before, after in itertools.pairwise(faster):
        if is_better[before.ride.segments[-1]] and is_better[after.ride.segments[0]]:
            ends = ((before, 1.0), (after, 0.0))
            end, start = (states_at(ride.fastest.motion, np.array([tau])).acceleration for ride, tau in ends)
            largest = max(largest, float(np.linalg.norm(start - end)))
    if not largest > JUMPS * gravity:
        return []
    return [f"retime: accelerations, and so tensions, jump by up to {largest:.3g} m/s^2 where the motion stops"]


def _unbounded(plan: PlannedMotions, faster: list[_Faster]) -> list[str]:
    numbers = list[int]()
    for one in faster:
        length = float(one.fastest.coordinate[-1])
        maximum = FASTER * np.sqrt(float(plan.problem.robot.gravity) * length)
        if np.nanmax(one.fastest.plane.speed, initial=0.0) > UNBOUNDED * maximum:
            numbers += (one.ride.segments + 1).tolist()
    names = ", ".join(map(str, dict.fromkeys(numbers)))
    more = "give tension_max or a limit of speeds"
    return [f"retime: no limit bounds the time of the motion to {names}: {more}"] if names else []
