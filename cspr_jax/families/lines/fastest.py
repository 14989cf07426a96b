"""Fastest motions along straight lines with verdicts: by formulas, or by search where these motions break a limit."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from cspr_jax.families.lines.any_limits import LONGER
from cspr_jax.families.lines.durations import Durations, Rule, by_cells, by_formula, by_search, moving
from cspr_jax.families.lines.verdicts import acceleration_slack, limits_at_rest, verdicts
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem, bounding_problem, search_problem
from cspr_jax.numerics.batches import in_parts
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import FORMULAS_UNDECIDED
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import in_one_plane, spool_radius
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.proved_verdicts import Verdicts

# Number of lines that a thread computes at a time, if there is anything to search or to prove.
PART = 256
Table = TypeVar("Table", Durations, Verdicts)
# Ends count as one position if their distance is less than this fraction of the spools' largest coordinate.
SAME_PLACE = 1e-12
# A line passes through a spool if its distance from it is less than this fraction of the same coordinate.
THROUGH = 1e-9
# Flags of rest at an end: those of positions, which every motion raises, and those that exclude any motion.
OF_POSITIONS = sum({row.flag.value for row in LIMITS if not row.of_motion})
NO_MOTION = (Verdict.SLACK_CABLE | Verdict.OVER_TENSION | Verdict.SINGULAR).value
# A motion counts as standing still if it lasts this many times a fall by the robot's radius plus the line's length.
STANDING = 1e4
# Fractions of a duration below this have too few digits in the formulas.
SHORT = 1e-6


class Fastest(NamedTuple):
    """Fastest motions along n lines, (n,) each.

    Fields:
        durations: finite where there is a motion; 0 where both ends are the same position.
        verdicts: verdicts of the motions, or why there is no motion.
        moves: whether there is a motion between two positions.
    """

    durations: Durations
    verdicts: Verdicts
    moves: np.ndarray


def fastest(
    problem: Problem,
    starts: Float[np.ndarray, "n 3"],
    ends: Float[np.ndarray, "n 3"],
    *,
    law: str,
    rule: Rule,
    max_acceleration: float,
    sharp: bool,
) -> Fastest:
    """Fastest motions along straight lines; of limits of winches they keep those of speeds."""
    problem, bounding = search_problem(problem), bounding_problem(problem)
    how: dict[str, Any] = {
        "bounding": bounding,
        "law": law,
        "rule": rule,
        "max_acceleration": max_acceleration,
        "sharp": sharp,
    }
    if len(starts) <= PART or (in_one_plane(problem.robot) and not moving(problem.limits)):
        return _fastest(problem, starts, ends, **how)
    parts = in_parts(lambda part: _fastest(problem, starts[part], ends[part], **how), len(starts), PART)
    durations, results, moves = zip(*parts, strict=True)
    return Fastest(_joined(Durations, durations), _joined(Verdicts, results), np.concatenate(moves))


def _joined(kind: type[Table], parts: Sequence[Table]) -> Table:
    return kind(*(np.concatenate(columns) for columns in zip(*(vars(part).values() for part in parts), strict=True)))


def _fastest(
    problem: Problem,
    starts: np.ndarray,
    ends: np.ndarray,
    *,
    bounding: Problem,
    law: str,
    rule: Rule,
    max_acceleration: float,
    sharp: bool,
) -> Fastest:
    robot, in_plane = problem.robot, in_one_plane(problem.robot)
    timings = by_formula(robot, starts, ends, law=law, rule=rule, max_acceleration=max_acceleration)
    # Formulas give no duration where neither taut cables nor `max_acceleration` bound the acceleration; limits may.
    by_limits_alone = ~timings.is_bounded & (rule == "optimum" and _bound_accelerations(problem.limits))
    timings.is_bounded[by_limits_alone], timings.lower_bound[by_limits_alone] = True, 0.0
    results, may_move, in_place = _at_rest(problem, starts, ends, timings)
    verdicts_of = partial(verdicts, problem, law=law, max_acceleration=max_acceleration, sharp=sharp)
    if in_plane:
        # Durations by formulas without limits need no proof, unless p or T - p has too few digits, or the peak of the
        # acceleration may exceed its limit.
        is_short = (np.minimum(timings.ratio, 1.0 - timings.ratio) < SHORT) & (law == "s-curve")
        is_within = acceleration_slack(starts, ends, timings, law=law, max_acceleration=max_acceleration) > 0.0
        indices = np.flatnonzero(
            may_move & ~by_limits_alone & (sharp | bool(limits_set(problem.limits)) | is_short | ~is_within)
        )
        if len(indices) > 0:
            results.replace(indices, verdicts_of(starts[indices], ends[indices], timings.part(indices)))
    # If an end breaks a limit, no other motion helps.
    indices = np.flatnonzero(may_move & in_place & ((results.verdict != 0) | ~in_plane | by_limits_alone))
    if (moving(problem.limits) or not in_plane) and rule == "optimum" and len(indices) > 0:
        before, positions = timings.part(indices), (starts[indices], ends[indices])
        searched = by_search(problem, *positions, before, law=law, max_acceleration=max_acceleration)
        reasons = _without_motion(problem, verdicts_of, *positions, searched, results.verdict[indices])
        durations, part = _proved(verdicts_of, *positions, searched, reasons)
        results.replace(indices, part)
        timings.replace(indices, durations)
    moves = may_move & np.isfinite(timings.duration)
    indices = np.flatnonzero(moves & (bool(moving(problem.limits)) | (timings.lower_bound == 0.0)))
    if len(indices) > 0:
        cells = by_cells(bounding, starts[indices], ends[indices], max_acceleration)
        timings.lower_bound[indices] = np.maximum(timings.lower_bound[indices], cells)
    return Fastest(timings, results, moves)


def _bound_accelerations(limits: Limits) -> bool:
    # Tell whether limits bound the acceleration along every line.
    largest = limits.tension_max
    return limits.acceleration_max is not None or (largest is not None and bool(np.isfinite(np.asarray(largest)).all()))


def _at_rest(
    problem: Problem, starts: np.ndarray, ends: np.ndarray, timings: Durations
) -> tuple[Verdicts, np.ndarray, np.ndarray]:
    # Return why there is no motion, where one is possible, and where both ends keep all limits at rest.
    doubt = FORMULAS_UNDECIDED * float(np.asarray(problem.robot.gravity))
    scale = float(np.abs(np.asarray(problem.robot.base_points)).max())
    is_same = np.linalg.norm(ends - starts, axis=1) <= SAME_PLACE * scale
    above, slack = ~(timings.depth > 0.0), timings.rest < -doubt
    flags = np.where(above, Verdict.ABOVE_SPOOLS.value, 0) | np.where(above | slack, Verdict.SLACK_CABLE.value, 0)
    # If cables are slack, limits of their tensions add no information.
    flags |= limits_at_rest(problem, starts, ends) & np.where(flags == 0, ~0, OF_POSITIONS)
    flags |= np.where(_touches(problem, starts, ends), Verdict.SINGULAR.value, 0)
    rests = (flags == 0) & (timings.rest > doubt)
    open_ended = np.where(timings.is_bounded, Verdict.UNDECIDED.value, Verdict.NOT_FINITE.value)
    # If only limits on positions fail, show the motion of the formulas nevertheless.
    no_motion = NO_MOTION if in_one_plane(problem.robot) else ~0
    may_move = ~above & (timings.rest > doubt) & ~is_same & timings.is_bounded & ((flags & no_motion) == 0)
    verdict = np.where(may_move | (rests & is_same), 0, np.where(flags > 0, flags, open_ended)).astype(FLAGS)
    nothing = np.full(len(starts), np.nan)
    margin = np.minimum(np.where(above, np.nan, timings.rest), 0.0)
    return Verdicts(verdict, margin, nothing.copy(), np.full(len(starts), np.inf)), may_move, flags == 0


def _touches(problem: Problem, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    # Tell whether lines pass through a spool, where a cable has no direction.
    spools, direction = np.asarray(problem.robot.base_points), (ends - starts)[:, None]
    rays, square = spools[None] - starts[:, None], (direction**2).sum(2)
    part = np.clip((rays * direction).sum(2) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    distances = np.linalg.norm(rays - part[..., None] * direction, axis=2)
    return (distances <= THROUGH * np.abs(spools).max()).any(1)


def _without_motion(
    problem: Problem,
    verdicts_of: Callable[..., Verdicts],
    starts: np.ndarray,
    ends: np.ndarray,
    timings: Durations,
    before: np.ndarray,
) -> np.ndarray:
    # Return the flags of lines along which a search finds no motion: those of an almost static motion, else those of
    # the motion by formulas.
    flags, open_lines = before.copy(), np.flatnonzero(~np.isfinite(timings.duration))
    if len(open_lines):
        long = np.linalg.norm(ends - starts, axis=1) + float(spool_radius(problem.robot))
        slow_time = np.sqrt(long / float(np.asarray(problem.robot.gravity))) * STANDING
        slow = dataclasses.replace(timings, duration=slow_time, ratio=np.full(len(slow_time), 0.5)).part(open_lines)
        slower = verdicts_of(starts[open_lines], ends[open_lines], slow).verdict
        is_informative = (slower != 0) & (slower != Verdict.UNDECIDED.value)
        flags[open_lines] = np.where(is_informative, slower, flags[open_lines])
    return flags


def _proved(
    verdicts_of: Callable[..., Verdicts], starts: np.ndarray, ends: np.ndarray, timings: Durations, before: np.ndarray
) -> tuple[Durations, Verdicts]:
    # Prolong durations from a search until they are proved; lines without a motion keep their earlier flags.
    nothing = np.full(len(starts), np.nan)
    flags = np.where(before > 0, before, Verdict.UNDECIDED.value).astype(FLAGS)
    results = Verdicts(flags, nothing.copy(), nothing.copy(), np.full(len(starts), np.inf))
    durations = timings.part(np.arange(len(starts)))
    durations.duration[~np.isfinite(timings.duration)] = np.nan
    open_lines = np.flatnonzero(np.isfinite(timings.duration))
    for longer in LONGER:
        if len(open_lines) == 0:
            break
        durations.duration[open_lines] = timings.duration[open_lines] * (1.0 + longer)
        part = verdicts_of(starts[open_lines], ends[open_lines], durations.part(open_lines))
        results.replace(open_lines, part)
        open_lines = open_lines[part.verdict != 0]
    return durations, results
