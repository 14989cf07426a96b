"""Needs of a motion, beside the allowed values: the worst instant of each criterion, in the units of its limit."""

import dataclasses
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.limits import limits_set, scales, slack, values
from cspr_jax.motion.motion import Motion, common_shape, sample_times
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.search.minima import narrowed_times
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.interference import gaps
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot, separate_pairs
from cspr_jax.robots.model.point_mass import plane_normal, rest_point
from cspr_jax.robots.statics import wrench_balance
from cspr_jax.schema.verdicts import Verdict

BATCH = 512


class Need(NamedTuple):
    """Need of a motion at the instant at which it breaks a criterion most, or comes nearest to it.

    Fields:
        criterion: flag that says that the criterion is broken.
        cables: numbers from 0 on: of one cable, of two that touch, or none.
        tau: the instant, normalised time.
        needed: value that the motion has there, in `unit`.
        allowed: largest, or smallest, value that is allowed.
        unit: unit of both values.
        slack: without a unit, below zero where the criterion is broken.
    """

    criterion: Verdict
    cables: tuple[int, ...]
    tau: float
    needed: float
    allowed: float
    unit: str
    slack: float


class _Criterion(NamedTuple):
    # A criterion over cables, or pairs of cables: its flag, the cables of each value, the allowed values, the unit.
    flag: Verdict
    cables: tuple[tuple[int, ...], ...]
    allowed: np.ndarray
    unit: str


def needs(problem: Problem, motion: Motion, samples: int) -> list[Need]:
    """Needs of a motion, one for each criterion; criteria of tensions only where the motion determines the tensions."""
    robot, limits = problem.robot, _with_tensions(problem.robot, problem.limits)
    moves = bool(np.isfinite(float(motion.duration())))
    leaves, structure = jax.tree.flatten(common_shape(motion))
    kernel = partial(_values, structure, moves, _pairs(robot), leaves, robot, limits)

    def at(tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        reached, slacks = in_batches(kernel, tau.ravel(), batch_size=BATCH)
        return reached.reshape(*tau.shape, -1), slacks.reshape(*tau.shape, -1)

    tau = sample_times(motion, samples)
    minimum, when = (x[0] for x in narrowed_times(lambda points: at(points)[1], tau, at(tau[None])[1]))
    column = np.arange(len(when))
    reached, first, worst = at(when[None])[0][0][column, column], 0, []
    for criterion in _criteria(robot, limits):
        columns = minimum[first : first + len(criterion.cables)]
        k = int(np.argmin(np.where(np.isnan(columns), np.inf, columns)))
        numbers = float(when[first + k]), float(reached[first + k]), float(criterion.allowed[k])
        worst.append(Need(criterion.flag, criterion.cables[k], *numbers, criterion.unit, float(columns[k])))
        first += len(criterion.cables)
    return sorted(worst, key=lambda need: need.slack)


def _with_tensions(robot: AnyRobot, limits: Limits) -> Limits:
    # Without a smallest tension, cables may still not push. A motion does not determine tensions of redundant cables.
    if robot.n_cables > robot.dof:
        return dataclasses.replace(limits, tension_min=None, tension_max=None)
    if limits.tension_min is not None:
        return limits
    return dataclasses.replace(limits, tension_min=as_float64(np.zeros(robot.n_cables)))


def _pairs(robot: AnyRobot) -> tuple[tuple[int, int], ...]:
    return separate_pairs(robot) if isinstance(robot, PlatformRobot) else ()


def _criteria(robot: AnyRobot, limits: Limits) -> list[_Criterion]:
    # The criteria follow in the order of `_values`.
    each = tuple((k,) for k in range(robot.n_cables))
    criteria = [_Criterion(Verdict.ABOVE_SPOOLS, ((),), np.zeros(1), "m")]
    if isinstance(robot, PlatformRobot) and robot.n_cables == robot.dof:
        criteria.append(_Criterion(Verdict.SINGULAR, ((),), np.zeros(1), "1"))
    if _pairs(robot):
        thick = 0.0 if robot.cable_diameter is None else float(robot.cable_diameter)
        criteria.append(_Criterion(Verdict.CABLE_CABLE, _pairs(robot), np.full(len(_pairs(robot)), thick), "m"))
    for row in limits_set(limits):
        limit = np.atleast_1d(np.asarray(getattr(limits, row.name)))
        criteria.append(_Criterion(row.flag, each if row.per_cable else ((),), limit, row.unit))
    return criteria


@partial(jax.jit, static_argnums=(0, 1, 2))
def _values(
    structure, moves: bool, pairs: tuple[tuple[int, int], ...], leaves, robot: AnyRobot, limits: Limits, tau: Array
) -> tuple[Array, Array]:
    # Return the value that the motion has of each criterion, and its slack, (n, n_values) each.
    motion = jax.tree.unflatten(structure, leaves)
    z0 = motion.z0

    def one(t):
        state = motion.state(t)
        if not moves:
            still = jnp.zeros_like(state.position)
            state = state._replace(velocity=still, acceleration=still)
        depth = plane_normal(robot) @ state.position
        reached, slacks = [jnp.atleast_1d(depth)], [jnp.atleast_1d(depth / z0)]
        if isinstance(robot, PlatformRobot) and robot.n_cables == robot.dof:
            current = wrench_balance.normalised_determinant(robot, state.position, state.rotation)
            fraction = current / wrench_balance.normalised_determinant(robot, rest_point(z0), jnp.eye(3))
            reached.append(jnp.atleast_1d(fraction))
            slacks.append(jnp.atleast_1d(fraction))
        if pairs and isinstance(robot, PlatformRobot):
            thick = 0.0 if robot.cable_diameter is None else robot.cable_diameter
            apart = jnp.sqrt(jnp.sum(gaps(robot, jnp.asarray(pairs), state.position, state.rotation) ** 2, axis=1))
            reached.append(apart)
            slacks.append((apart - thick) / z0)
        quantities, scale = values(robot, state), scales(robot.n_cables, robot.mass * robot.gravity, z0)
        for row in limits_set(limits):
            value = jnp.atleast_1d(getattr(quantities, row.quantity))
            reached.append(value)
            slacks.append(slack(row, jnp.asarray(getattr(limits, row.name)), value, scale))
        return jnp.concatenate(reached), jnp.concatenate(slacks)

    return jax.vmap(one)(tau)
