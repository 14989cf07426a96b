"""Least time along one section of a path: the fastest motion, proved, and a lower bound of the time of all motions."""

import dataclasses
import itertools
from collections.abc import Generator, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.curves.spline import Spline
from cspr_jax.families.paths.geometry.section import Section, SectionSettings
from cspr_jax.families.paths.least_time.bound import path_bound
from cspr_jax.families.paths.least_time.controllable import GridSolution
from cspr_jax.families.paths.least_time.discrete import FASTER, Discrete, discretes
from cspr_jax.families.paths.least_time.jumping import Jumping, PathAccelerations, again, jumping_motions
from cspr_jax.families.paths.least_time.nodes import PathSpeeds
from cspr_jax.families.paths.least_time.refusals import NoMotion, refusal
from cspr_jax.families.paths.least_time.smooth import SectionEnds, Smooth, below_ramps, smooth
from cspr_jax.families.paths.least_time.tightening import BindingName, CellSlacks, Trial, together
from cspr_jax.families.paths.least_time.timed import cell_times, distance_from_path, moving, timed
from cspr_jax.motion.limits import are_of_motors, motor_limits_set
from cspr_jax.motion.problem import Problem, bounding_problem, search_problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.runtime.progress import RateEstimate
from cspr_jax.runtime.stages import within
from cspr_jax.schema.verdicts import Verdict

ROUNDS = 8  # largest number of rounds of proof and tightening
SHORTER = 4  # number of ramp times tried, each half of the one before, until a motion with them exists
# A slow motion has this speed over that of a fall along the path.
SLOW = 0.01
FINER = (2, 4)  # factors of finer grids, for motions without a proof or without a close lower bound
FAR = 0.002  # a lower bound is close if it is below the duration by at most this fraction
STARTS = (0.8, 0.4)  # the search with ramps starts from these fractions of x of the motion without ramps
# Motions near which limits of torques are linear: largest number, and the change of the time at which they end.
REFERENCES, SAME_TIME = 12, 1e-4
SLOWER = 0.25  # squared path speeds of a slower motion, over those of one near which there is no motion
TANGENTS = 3  # number of optima, each with tangents at the previous one
# Number of sections solved at a time.
TOGETHER = 64


class PhasePlane(NamedTuple):
    """Path speeds of a section, (n_nodes,) each, m/s.

    Fields:
        coordinate: path coordinate s, m.
        low: smallest path speed from which the end can be reached; NaN where there is none.
        high: largest such path speed.
        cap: largest path speed that limits of speeds allow.
        speed: path speed of the motion; NaN without one.
    """

    coordinate: np.ndarray
    low: np.ndarray
    high: np.ndarray
    cap: np.ndarray
    speed: np.ndarray


@dataclasses.dataclass(frozen=True)
class LeastTime:
    """The fastest motion along a section.

    Fields:
        motion: motion over time, whose knots are those of the grid; a slow one if none is feasible.
        coordinate: (n_nodes,) s at these knots, m.
        duration: duration of the motion, s.
        lower_bound: rigorous lower bound of the time of any motion forward along the section, s; NaN if none is
            proved.
        jumping: duration of the fastest motion without ramps on the same grid, without margins, s.
        ramp_time: time of ramps of the motion, s; 0 if its accelerations jump.
        deviation: largest distance of the motion from the path at samples, m.
        names: names of the criteria that can bind.
        binds: (n_cells,) index of the criterion that binds in each cell; -1: none.
        feed: (n_cells,) largest speed that the section itself allows, m/s, inf for none.
        plane: path speeds that are possible along the section.
        failure: why there is no motion, or None.
    """

    motion: Spline
    coordinate: np.ndarray
    duration: float
    lower_bound: float
    jumping: float
    ramp_time: float
    deviation: float
    names: tuple[BindingName, ...]
    binds: np.ndarray
    feed: np.ndarray
    plane: PhasePlane
    failure: NoMotion | None


def least_time_motion(
    problem: Problem, section: Section, settings: SectionSettings, guess: PathAccelerations | None = None
) -> LeastTime:
    """Find the fastest motion along a section."""
    return least_time_motions(problem, [section], [settings], [guess])[0]


def least_times_along(
    problem: Problem, sections: Sequence[Section], settings: Sequence[SectionSettings], batch: int = TOGETHER
) -> Iterator[LeastTime]:
    """Find the fastest motions along sections, in groups whose progress is announced."""
    count, progress = len(sections), RateEstimate()
    for first in range(0, count, batch):
        progress.advance(first, count)
        part, left = slice(first, first + batch), progress.left()
        with within(f"least time, section {first + 1} of {count}" + f", {left}" * bool(left)):
            motions = least_time_motions(problem, sections[part], settings[part])
        yield from motions


def least_time_motions(
    problem: Problem,
    sections: Sequence[Section],
    settings: Sequence[SectionSettings],
    guesses: Sequence[PathAccelerations | None] = (),
) -> list[LeastTime]:
    """Find the fastest motions along sections; of limits of winches they keep all but root mean squares."""
    searched, bounding = search_problem(problem), bounding_problem(problem)
    problems = _SearchProblems(searched, bounding, _with_torques(problem, searched))
    guesses = guesses or [None] * len(sections)
    answers = _solved(problems, sections, settings, guesses)
    for finer in FINER:
        # A finer grid may give a motion, or its proof, where this one does not.
        unmet = [k for k, (_, is_met) in enumerate(answers) if not is_met]
        if not unmet:
            break
        closer = [settings[k]._replace(grid=finer * settings[k].grid) for k in unmet]
        following = _solved(problems, [sections[k] for k in unmet], closer, [guesses[k] for k in unmet])
        for k, answer in zip(unmet, following, strict=True):
            answers[k] = answer
    return [_with_motors(problem.limits, searched.limits, answer) for answer, _ in answers]


class _SearchProblems(NamedTuple):
    # The problem of searches without motors, that of lower bounds, and that of motions that keep limits of motors.
    searched: Problem
    bounding: Problem
    motors: Problem


class _SectionSearch(NamedTuple):
    # A section on its grid with its fastest motion, without limits of torques and with them.
    settings: SectionSettings
    guess: PathAccelerations | None
    path: Discrete
    start: Jumping
    plain: Discrete
    plain_start: Jumping


def _with_torques(problem: Problem, searched: Problem) -> Problem:
    # Limits of speeds of motors are limits of cables in searches.
    rows = [row for row in motor_limits_set(problem.limits) if row.name != "motor_speed_max"]
    if not rows:
        return searched
    limits = dataclasses.replace(searched.limits, **{row.name: getattr(problem.limits, row.name) for row in rows})
    return problem._replace(limits=limits)


def _solved(
    problems: _SearchProblems,
    sections: Sequence[Section],
    settings: Sequence[SectionSettings],
    guesses: Sequence[PathAccelerations | None],
) -> list[tuple[LeastTime, bool]]:
    paths = discretes(problems.searched, sections, settings)
    starts = jumping_motions(paths, guesses)
    cases = [_SectionSearch(*each, *each[2:]) for each in zip(settings, guesses, paths, starts, strict=True)]
    moving_ones = [k for k, start in enumerate(starts) if start.run is not None]
    if problems.motors is not problems.searched:
        for k, case in zip(
            moving_ones, _keeping_torques(problems.motors, [cases[k] for k in moving_ones]), strict=True
        ):
            cases[k] = case
    return together(problems.motors, [_proved(problems, case) for case in cases])


def _keeping_torques(problem: Problem, cases: list[_SectionSearch]) -> list[_SectionSearch]:
    # Take each motion as the next one near which limits of torques are linear, until times hardly change; take a slower
    # one where there is none, since limits are stricter far below the speeds at which they are linear.
    times, going = np.full(len(cases), np.inf), list(range(len(cases)))
    runs: list[Any] = [case.start.run for case in cases]
    for _ in range(REFERENCES):
        chosen = [cases[k] for k in going]
        sections, settings = [case.path.section for case in chosen], [case.settings for case in chosen]
        paths = discretes(problem, sections, settings, [runs[k] for k in going])
        rows = list(zip(going, paths, jumping_motions(paths, [case.guess for case in chosen]), strict=True))
        going = []
        for k, path, start in rows:
            if start.run is None and np.isfinite(times[k]):
                continue
            cases[k] = cases[k]._replace(path=path, start=start)
            time = np.inf if start.run is None else float(cell_times(start.run, path.grid.width).sum())
            if start.run is None or times[k] - time >= SAME_TIME * time:
                going.append(k)
            runs[k], times[k] = start.run or _slowed(runs[k]), time
        if not going:
            break
    return cases


def _slowed(run: PathSpeeds) -> PathSpeeds:
    x, before, after = (SLOWER * part for part in run[:3])
    return run._replace(x=x, before=before, after=after)


def _with_motors(limits: Limits, searched: Limits, answer: LeastTime) -> LeastTime:
    # Name motors where their speeds are the limits that cables bind at.
    if limits.motor_speed_max is None:
        return answer
    of_motors, cable, motor = are_of_motors(limits, searched), Verdict.CABLE_TOO_FAST, Verdict.MOTOR_TOO_FAST
    names = (
        name._replace(criterion=motor.text) if name.criterion == cable.text and of_motors[name.cable] else name
        for name in answer.names
    )
    return dataclasses.replace(answer, names=tuple(names))


def _proved(problems: _SearchProblems, case: _SectionSearch) -> Generator[Trial, CellSlacks, tuple[LeastTime, bool]]:
    # Tighten the limits on the grid until the motion keeps them everywhere; return whether it does. The generator
    # yields motions, and receives the bounds of their slacks.
    problem, settings, path = problems.motors, case.settings, case.path
    jumping, u_rate, first = case.start
    plain = case.plain_start.run
    if jumping is None or plain is None:
        return _without_motion(problem, path, first), False
    section = path.section
    fastest_time, plain_time = (float(cell_times(run, path.grid.width).sum()) for run in (jumping, plain))
    bound = _bound(problems.bounding, case.plain, settings, plain.x, plain_time)
    run, jerk = _ramped(path, jumping, settings.ramp_time)
    margins, weight = path.no_margins, float(problem.robot.mass * problem.robot.gravity)
    slower: PathSpeeds | None = run
    for _ in range(ROUNDS):
        if slower is None:
            break
        run = slower
        motion = timed(section, path.grid, run)
        slacks = yield Trial(motion, path.grid.feed)
        margins = slacks.grown(margins, weight)
        slower = None if slacks.is_met else _slower(path.with_margins(margins), run, u_rate, jerk)
    times = np.diff(np.asarray(motion.knots))
    speed = np.sqrt(run.x)
    names, binds = slacks.binding(path.grid.feed, section.feeds)
    answer = LeastTime(
        motion=motion,
        coordinate=path.grid.nodes,
        duration=float(times.sum()),
        lower_bound=bound if np.isfinite(bound) else np.nan,
        jumping=fastest_time,
        ramp_time=float(np.ptp(np.concatenate([jumping.before, jumping.after])) / jerk),
        deviation=distance_from_path(section, path.grid, run, motion),
        names=names,
        binds=binds,
        feed=path.grid.feed,
        plane=_plane(path, first, speed),
        failure=None,
    )
    return answer, slacks.is_met


def _bound(problem: Problem, path: Discrete, settings: SectionSettings, x: np.ndarray, duration: float) -> float:
    # Refine the grid while the lower bound is not close to the duration.
    bound = path_bound(problem, path, x)
    for finer in FINER:
        if bound >= (1.0 - FAR) * duration:
            break
        other = discretes(problem, [path.section], [settings._replace(grid=finer * settings.grid)])[0]
        bound = max(bound, path_bound(problem, other, np.interp(other.grid.nodes, path.grid.nodes, x)))
    return bound


def _plane(path: Discrete, solution: GridSolution, speed: np.ndarray) -> PhasePlane:
    with np.errstate(invalid="ignore"):  # square roots of unknown speeds are NaN
        low, high = np.sqrt(solution.low), np.sqrt(solution.high)
    cap = path.cap()
    return PhasePlane(path.grid.nodes, low, high, np.where(cap < path.largest, np.sqrt(cap), np.inf), speed)


def _without_motion(problem: Problem, path: Discrete, solution: GridSolution) -> LeastTime:
    run = _slow(path)
    motion = timed(path.section, path.grid, run)
    return LeastTime(
        motion=motion,
        coordinate=path.grid.nodes,
        duration=float(motion.knots[-1]),
        lower_bound=np.nan,
        jumping=np.nan,
        ramp_time=np.nan,
        deviation=distance_from_path(path.section, path.grid, run, motion),
        names=(),
        binds=np.full(len(path.grid.width), -1),
        feed=path.grid.feed,
        plane=_plane(path, solution, np.full(len(path.grid.nodes), np.nan)),
        failure=refusal(problem, path, solution),
    )


def _slow(path: Discrete) -> PathSpeeds:
    # Return a slow motion, with tensions close to those at rest, to show where none is feasible.
    fraction = path.grid.nodes / path.grid.nodes[-1]
    bump = 4.0 * SLOW**2 * path.largest / FASTER**2
    x = (1.0 - fraction) * path.ends[0] + fraction * path.ends[1] + bump * fraction * (1.0 - fraction)
    x[[0, -1]] = path.ends
    u = 0.5 * np.diff(x) / path.grid.width
    return PathSpeeds(x, u, u)


def _ramped(path: Discrete, jumping: PathSpeeds, ramp_time: float) -> tuple[PathSpeeds, float]:
    # Return the fastest motion with ramps, halved while there is none, and the largest path jerk.
    if ramp_time > 0.0:
        rests = path.can_rest()
        ends = SectionEnds(path.ends, (rests[0] and path.ends[0] == 0.0, rests[1] and path.ends[1] == 0.0))
        for time, slower in itertools.product(0.5 ** np.arange(SHORTER) * ramp_time, STARTS):
            jerk = float(np.ptp(np.concatenate([jumping.before, jumping.after])) / time)
            start = below_ramps(slower * jumping.x, path.grid.width, jerk, ends)
            run = _smoothed(path, start, ends, jerk, TANGENTS)
            if run is not None:
                return run, jerk
    return jumping, np.inf


def _smoothed(path: Discrete, start: Smooth, ends: SectionEnds, jerk: float, times: int) -> PathSpeeds | None:
    motion = smooth(path.node_half_planes(), ends, start, jerk, times)
    return (
        None
        if motion is None
        else moving(PathSpeeds(motion.x, motion.u[:-1], motion.u[1:], ends.rests), path.grid.width)
    )


def _slower(path: Discrete, run: PathSpeeds, u_rate: np.ndarray, jerk: float) -> PathSpeeds | None:
    # Return the fastest motion within tighter limits.
    if not np.isfinite(jerk):
        return again([path], [u_rate])[0]
    start = Smooth(run.x, np.append(run.before, run.after[-1]))
    return _smoothed(path, start, SectionEnds(path.ends, run.rests), jerk, 1)
