"""Verdicts of motions along straight lines: proved if all slacks have positive bounds, refuted by a negative slack."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.families.lines.durations import BATCH, Durations, lines_of
from cspr_jax.families.lines.motion import fixed_law, largest_second_derivative, s_curve
from cspr_jax.families.lines.proof import smallest_slacks
from cspr_jax.families.lines.slacks import TAUT
from cspr_jax.motion.acceleration_sets import faces_at
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.limits import limits_set, scales, slack
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.numerics.tolerances import FORMULAS_UNDECIDED
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.proved_verdicts import Verdicts, plain_slack, with_touched


@jax.jit
def _s_curves(ratios) -> Amplitude:
    return jax.vmap(s_curve)(ratios)


def laws_of(law: str, ratios: Float[np.ndarray, "n"]) -> Amplitude:
    """Laws of time."""
    if law == "s-curve":
        return in_batches(_s_curves, ratios, batch_size=BATCH)
    one = jax.tree.map(np.asarray, fixed_law(law))
    return jax.tree.map(lambda x: np.broadcast_to(x, (len(ratios), *x.shape)), one)


def acceleration_slack(
    starts: Float[np.ndarray, "n 3"],
    ends: Float[np.ndarray, "n 3"],
    timings: Durations,
    *,
    law: str,
    max_acceleration: float,
) -> Float[np.ndarray, "n"]:
    """Slack of the largest acceleration along lines, from the peak of s'' of each law in closed form."""
    largest = np.linalg.norm(ends - starts, axis=1) * largest_second_derivative(law, timings.ratio)
    with np.errstate(invalid="ignore", divide="ignore"):
        return 1.0 - largest / timings.duration**2 / max_acceleration


def verdicts(
    problem: Problem,
    starts: Float[np.ndarray, "n 3"],
    ends: Float[np.ndarray, "n 3"],
    timings: Durations,
    *,
    law: str,
    max_acceleration: float,
    sharp: bool,
) -> Verdicts:
    """Verdicts of motions of given durations."""

    def verdicts_of(allowed: Problem, indices: np.ndarray) -> Verdicts:
        parts = starts[indices], ends[indices], timings.part(indices)
        return _verdicts(allowed, *parts, law=law, max_acceleration=max_acceleration, sharp=sharp)

    return with_touched(problem, verdicts_of(problem, np.arange(len(starts))), verdicts_of)


def _verdicts(
    problem: Problem,
    starts: np.ndarray,
    ends: np.ndarray,
    timings: Durations,
    *,
    law: str,
    max_acceleration: float,
    sharp: bool,
) -> Verdicts:
    gravity = float(np.asarray(problem.robot.gravity))
    lines = lines_of(problem, starts, ends)
    enough = np.inf if sharp else FORMULAS_UNDECIDED
    proved = smallest_slacks(lines, laws_of(law, timings.ratio), timings.duration, gravity, enough=enough)
    doubt = FORMULAS_UNDECIDED * np.array([gravity if name in lines.low else 1.0 for name in lines.names])
    own_flags = {row.name: row.flag.value for row in LIMITS} | {TAUT: Verdict.SLACK_CABLE.value}
    flags = np.where(proved.attained < -doubt, [own_flags[name] for name in lines.names], 0)
    limit_margin, broken, doubtful = _at_ends(problem, starts, ends)
    for name, values in zip(lines.names[1:], proved.attained.T[1:], strict=True):
        limit_margin = np.minimum(
            limit_margin, plain_slack(name, values / gravity if name.startswith("tension") else values)
        )
    broken |= np.bitwise_or.reduce(flags, axis=1)
    is_within = (
        acceleration_slack(starts, ends, timings, law=law, max_acceleration=max_acceleration) > FORMULAS_UNDECIDED
    )
    is_open = ~(proved.bound > doubt).all(1) | doubtful | ~is_within
    verdict = np.where(broken > 0, broken, np.where(is_open, Verdict.UNDECIDED.value, 0)).astype(FLAGS)
    return Verdicts(verdict, proved.attained[:, 0], proved.bound[:, 0], limit_margin)


def _at_ends(problem: Problem, starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # Return smallest slacks, flags and doubts, (n,) each, for limits on positions. Only the ends matter, since lengths
    # are convex in s, and depths are linear.
    robot, positions = problem.robot, np.stack([starts, ends], axis=1)
    lengths = np.linalg.norm(positions[:, :, None] - np.asarray(robot.base_points), axis=3)
    each: dict[str, Any] = {"depth": positions[..., 2:], "length": lengths}
    scale: Any = scales(robot.n_cables, robot.mass * robot.gravity, spool_radius(robot))
    limit_margin, flags = np.full(len(starts), np.inf), np.zeros(len(starts), int)
    for limit in limits_set(problem.limits):
        if not limit.of_motion:
            allowed: Any = np.asarray(getattr(problem.limits, limit.name))
            smallest = np.asarray(slack(limit, allowed, each[limit.quantity], scale)).min((1, 2))
            limit_margin, flags = (
                np.minimum(limit_margin, smallest),
                flags | np.where(smallest < -FORMULAS_UNDECIDED, limit.flag.value, 0),
            )
    return limit_margin, flags, ~(limit_margin > FORMULAS_UNDECIDED)


def limits_at_rest(
    problem: Problem, starts: Float[np.ndarray, "n 3"], ends: Float[np.ndarray, "n 3"]
) -> Int[np.ndarray, "n"]:
    """Limits that a robot at rest at either end breaks; a limit that it only touches is not broken."""
    problem = touchable(problem)
    _, flags, _ = _at_ends(problem, starts, ends)
    limits = {
        limit_row.name: getattr(problem.limits, limit_row.name)
        for limit_row in limits_set(problem.limits)
        if limit_row.quantity == "tension"
    }
    fails = partial(_fails_at_rest, problem, starts, ends)
    alone = {name: fails({name: limit}) for name, limit in limits.items()}
    for limit_row in limits_set(problem.limits):
        flags |= np.where(alone.get(limit_row.name, False), limit_row.flag.value, 0)
    if len(limits) > 1:  # if two limits fail only together, name the largest tension
        together = fails(limits) & ~np.any(list(alone.values()), axis=0)
        flags |= np.where(together, Verdict.OVER_TENSION.value, 0)
    return flags


def _fails_at_rest(problem: Problem, starts: np.ndarray, ends: np.ndarray, limits: dict[str, Any]) -> np.ndarray:
    # Tell whether rest at either end breaks limits of tensions, or needs slack cables, (n,).
    limited = problem._replace(limits=Limits(**limits))
    margins = [in_batches(partial(_at_rest, limited), positions, batch_size=BATCH) for positions in (starts, ends)]
    return np.min(margins, axis=0) < -FORMULAS_UNDECIDED * float(np.asarray(problem.robot.gravity))


@jax.jit
def _at_rest(problem: Problem, positions):
    return jax.vmap(lambda x: faces_at(problem.robot, problem.limits, x).margin(jnp.zeros_like(x)))(positions)
