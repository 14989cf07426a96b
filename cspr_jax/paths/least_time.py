"""Least time along one section of a path: the fastest motion, proved, and a lower bound of all motions' time."""

import dataclasses
from typing import NamedTuple, cast

import numpy as np

from cspr_jax.curves.spline import Spline
from cspr_jax.motions.problem import Problem
from cspr_jax.paths.bound import path_bound
from cspr_jax.paths.controllable import Fastest, smallest_of_slopes
from cspr_jax.paths.discrete import FASTER, Discrete, discrete
from cspr_jax.paths.refusals import NoMotion, refusal
from cspr_jax.paths.section import Section, SectionSettings
from cspr_jax.paths.smooth import Ends, smooth
from cspr_jax.paths.tightening import cell_slacks
from cspr_jax.paths.timed import Run, cell_times, distance_from_path, timed
from cspr_jax.robots.clearance import Scene

# Rounds of proof and tightening; how often ramps are shortened by half where none of their length exist.
ROUNDS, SHORTER = 8, 4
# Speed of a motion that counts as slow, over that of a fall along the path.
SLOW = 0.01


class PhasePlane(NamedTuple):
    """Path speeds of a section, (n_nodes,) each, m/s.

    Fields:
        coordinate: s, m.
        low: smallest path speed from which the end can be reached; NaN where there is none.
        high: largest such path speed.
        cap: largest path speed that limits of speeds allow.
        speed: of the motion; NaN without one.
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
        motion: over time; its knots are those of the grid; a slow one if none is feasible.
        coordinate: (n_nodes,) s at these knots, m.
        duration: of it, s.
        lower_bound: rigorous lower bound of the time of any motion along the section, s; NaN where none is known.
        jumping: duration of the fastest motion without ramps on the same grid, before margins, s.
        ramp_time: of the motion, s; 0 where its accelerations jump.
        deviation: largest distance of the motion from the path at samples, m.
        names: of the criteria that can bind: name of a flag, cable from 0 on or None.
        binds: (n_cells,) number of the one that binds in each cell; -1: none.
        plane: path speeds.
        failure: why there is no motion, or None.
    """

    motion: Spline
    coordinate: np.ndarray
    duration: float
    lower_bound: float
    jumping: float
    ramp_time: float
    deviation: float
    names: tuple[tuple[str, int | None], ...]
    binds: np.ndarray
    plane: PhasePlane
    failure: NoMotion | None


def least_time_motion(problem: Problem, scene: Scene | None, section: Section, settings: SectionSettings) -> LeastTime:
    """Find the fastest motion along a section.

    Args:
        scene: bodies that can meet; they are judged with the motion, and do not change it.
        settings: of this section.

    Returns:
        the motion; where tightening ends before all is proved, the last one.
    """
    path = discrete(problem, section, settings)
    first = path.fastest(np.zeros_like(path.grid.width))
    if first.empty[0] >= 0 or not first.is_start[0]:
        return _without_motion(problem, path, first)
    jumping, bend = _bent(path, first)
    bound = path_bound(problem, path, jumping.x)
    run, jerk = _ramped(path, jumping, settings.ramp_time)
    margins, weight = path.no_margins, float(problem.robot.mass * problem.robot.gravity)
    for _ in range(ROUNDS):
        motion = timed(section, path.grid, run)
        slacks = cell_slacks(problem, motion, scene)
        if slacks.is_met:
            break
        margins = slacks.grown(margins, weight)
        tighter = path.with_margins(margins)
        slower = _smooth(tighter, run, jerk) if np.isfinite(jerk) else _jumping(tighter, bend)
        if slower is None:
            break
        run = slower
    times = np.diff(np.asarray(motion.knots))
    speed = np.sqrt(run.x)
    return LeastTime(
        motion=motion,
        coordinate=path.grid.nodes,
        duration=float(times.sum()),
        lower_bound=bound if np.isfinite(bound) else np.nan,
        jumping=float(cell_times(jumping, path.grid.width).sum()),
        ramp_time=float(np.ptp(np.concatenate([jumping.before, jumping.after])) / jerk),
        deviation=distance_from_path(section, path.grid, run, motion),
        names=slacks.names,
        binds=slacks.binding(),
        plane=_plane(path, first, speed),
        failure=None,
    )


def _plane(path: Discrete, solution: Fastest, speed: np.ndarray) -> PhasePlane:
    with np.errstate(invalid="ignore"):  # of the square roots of unknown speeds
        low, high = np.sqrt(solution.low[:, 0]), np.sqrt(solution.high[:, 0])
    cap = path.cap()
    return PhasePlane(path.grid.nodes, low, high, np.where(cap < path.largest, np.sqrt(cap), np.inf), speed)


def _without_motion(problem: Problem, path: Discrete, solution: Fastest) -> LeastTime:
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
        plane=_plane(path, solution, np.full(len(path.grid.nodes), np.nan)),
        failure=refusal(problem, path, solution),
    )


def _slow(path: Discrete) -> Run:
    # A slow motion, whose tensions are about those at rest, to be shown where none is feasible.
    share = path.grid.nodes / path.grid.nodes[-1]
    bump = 4.0 * SLOW**2 * path.largest / FASTER**2
    x = (1.0 - share) * path.ends[0] + share * path.ends[1] + bump * share * (1.0 - share)
    x[[0, -1]] = path.ends
    u = 0.5 * np.diff(x) / path.grid.width
    return Run(x, u, u)


def _run_of(solution: Fastest, path: Discrete, bend: np.ndarray) -> Run | None:
    if solution.empty[0] >= 0 or not solution.is_start[0]:
        return None
    half = 0.5 * bend * path.grid.width
    return Run(solution.x[:, 0], solution.u[:, 0] - half, solution.u[:, 0] + half)


def _jumping(path: Discrete, bend: np.ndarray) -> Run | None:
    return _run_of(path.fastest(bend), path, bend)


def _bent(path: Discrete, solution: Fastest) -> tuple[Run, np.ndarray]:
    # Let the path acceleration change within cells as it does from cell to cell, twice; the changes that it has then.
    bend = np.zeros_like(path.grid.width)
    run = _run_of(solution, path, bend)
    for _ in range(2):
        change = smallest_of_slopes(solution.u, path.grid.width[:, None])[:, 0]
        following = path.fastest(change)
        better = _run_of(following, path, change)
        if better is None:
            break
        run, bend, solution = better, change, following
    return cast(Run, run), bend


def _ramped(path: Discrete, jumping: Run, ramp_time: float) -> tuple[Run, float]:
    # The fastest motion with ramps, half as long where there is none, and the largest path jerk.
    if ramp_time > 0.0:
        rests = path.can_rest()
        rests = rests[0] and path.ends[0] == 0.0, rests[1] and path.ends[1] == 0.0
        for times in 0.5 ** np.arange(SHORTER) * ramp_time:
            jerk = float(np.ptp(np.concatenate([jumping.before, jumping.after])) / times)
            run = _smooth(path, jumping._replace(rests=rests), jerk)
            if run is not None:
                return run, jerk
    return jumping, np.inf


def _smooth(path: Discrete, start: Run, jerk: float) -> Run | None:
    # The accelerations at nodes begin as means of those of both cells.
    u = 0.5 * (np.append(start.before, start.after[-1]) + np.insert(start.after, 0, start.before[0]))
    solution = smooth(path.node_rows(), Ends(path.ends, start.rests), (start.x, u), jerk)
    return Run(solution.x, solution.u[:-1], solution.u[1:], start.rests) if solution.is_optimal else None
