"""Binding criteria along a motion: at each time the criterion with the smallest slack, negative where it fails."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.motion.limits import motor_limits_set, other_limits
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import plane_normal, spool_radius
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.winches import motor_demands
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.criteria import pose_conditions


def binding(
    problem: Problem,
    state: State,
    of_cables: Mapping[str, np.ndarray],
    times: Float[np.ndarray, "n"],
    details: Mapping[str, Any],
) -> dict[str, np.ndarray]:
    """Flags of the binding criteria, and their cables."""
    slacks, names = [], []
    for flag, slack in _slacks(problem, state, of_cables):
        slacks.append(slack)
        names += [(flag.value, k + 1 if slack.shape[1] > 1 else 0) for k in range(slack.shape[1])]
    table, numbers = np.concatenate(slacks, axis=1)[: len(times)], np.array(names)
    nearest = np.where(np.isnan(table), np.inf, table).argmin(1)
    flags, cables = numbers[nearest].T
    # If none of these criteria fails at a row, another one may, within its intervals of failure.
    is_broken = (np.take_along_axis(table, nearest[:, None], 1) < 0.0).any(1)
    for name, intervals in (details.get("failing_by_criterion") or {}).items():
        ends = np.reshape(intervals, (-1, 2))
        inside = ((ends[:, 0] <= times[:, None]) & (times[:, None] <= ends[:, 1])).any(1) & ~is_broken
        flags, cables = np.where(inside, Verdict[name.upper()].value, flags), np.where(inside, 0, cables)
    return {"binding": flags.astype(FLAGS), "binding_cable": cables.astype(np.int16)}


def _slacks(problem: Problem, state: State, of_cables: Mapping[str, np.ndarray]) -> list[tuple[Verdict, np.ndarray]]:
    # Slacks (m, 1), or (m, n_cables), of each criterion, scaled as in `verification.proved_answers`.
    robot, limits = problem.robot, problem.limits
    # On a guide a single spool is the centroid itself.
    weight, radius = float(robot.mass * robot.gravity) / robot.n_cables, float(spool_radius(robot)) or 1.0
    low, high = (np.asarray(side, float) for side in tension_range(robot, limits))
    tension = of_cables["tension"]
    rows = [(Verdict.SLACK_CABLE, (tension - low) / weight)]
    if np.isfinite(high).any():
        rows.append((Verdict.OVER_TENSION, (high - tension) / weight))
    values = {
        "depth": state.position[:, 2:],
        "length": of_cables["length"],
        "speed": np.abs(of_cables["rate"]),
        "acceleration": np.abs(of_cables["rate_derivative"]),
        "mass_centre_speed": np.linalg.norm(state.velocity, axis=1)[:, None],
        "mass_centre_acceleration": np.linalg.norm(state.acceleration, axis=1)[:, None],
    }
    for row in other_limits(limits):
        limit = np.asarray(getattr(limits, row.name), float)
        rows.append((row.flag, (limit - values[row.quantity]) / (radius if row.unit == "m" else limit)))
    rows += _of_motors(problem, of_cables)
    if pose_conditions(robot)[1]:
        rows.append((Verdict.ABOVE_SPOOLS, (state.position @ np.asarray(plane_normal(robot)))[:, None] / radius))
    return rows


def _of_motors(problem: Problem, of_cables: Mapping[str, np.ndarray]) -> list[tuple[Verdict, np.ndarray]]:
    # Slacks of limits of winches over these limits, with the tensions of the rows.
    winches, limits = problem.robot.winches, motor_limits_set(problem.limits)
    if winches is None or not limits:
        return []
    with double_precision():
        length, rate, second_derivative, tension = (
            jnp.asarray(of_cables[name]) for name in ("length", "rate", "rate_derivative", "tension")
        )
        values = jax.vmap(partial(motor_demands, winches))((length, rate, second_derivative), tension)
    return [
        (row.flag, 1.0 - np.asarray(getattr(values, row.quantity)) / np.asarray(getattr(problem.limits, row.name)))
        for row in limits
    ]
