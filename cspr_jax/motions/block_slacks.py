"""Slacks of any motion over blocks of time: bounds, from bounds of its states, of how far each criterion is met.

In natural units (N, m, m/s, m/s^2), in this order, with n cables:

    tension     of n = dof cables: n distances of the tensions from their limits; of more: the largest distance that all
                tensions together can have from their limits
    limits      that are given, one for each cable, of the floor one: depth, length, speed, acceleration
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic.affine_bounds import AffineBounds
from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.motions.limits import limits_set
from cspr_jax.robots.cables import AnyRobot, wrench_units
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.state_bounds import CableBounds, StateBounds, balance_bounds, cable_bounds
from cspr_jax.robots.witness_tensions import witness_tensions
from cspr_jax.robots.wrench_sets import tension_range
from cspr_jax.schema.verdicts import Verdict

BATCH = 64


class Criterion(NamedTuple):
    """Criterion of a slack.

    Fields:
        flag: the verdict where it is broken; of the tensions of redundant cables `WRENCH_INFEASIBLE`.
        cables: numbers from 0 on: of one cable, of two that meet, or none.
        unit: of the slack.
        obstacle: number of the obstacle from 0 on; None: no obstacle is concerned.
    """

    flag: Verdict
    cables: tuple[int, ...]
    unit: str
    obstacle: int | None = None


class BlockSlacks(NamedTuple):
    """Bounds of slacks over k blocks.

    Fields:
        low: (k, n_criteria) lower bounds, -inf where nothing is known.
        high: (k, n_criteria) upper bounds, inf where nothing is known.
    """

    low: np.ndarray
    high: np.ndarray


def criteria(robot: AnyRobot, limits: Limits) -> list[Criterion]:
    """Criteria, in the order of their slacks.

    Returns:
        n_criteria of them.
    """
    cables = range(robot.n_cables)
    if robot.n_cables > robot.dof:
        rows = [Criterion(Verdict.WRENCH_INFEASIBLE, (), "N")]
    else:
        rows = [Criterion(Verdict.SLACK_CABLE, (k,), "N") for k in cables]
        rows += [Criterion(Verdict.OVER_TENSION, (k,), "N") for k in cables if limits.tension_max is not None]
    for row in limits_set(limits):
        if row.quantity != "tension":
            rows += [
                Criterion(row.flag, each, row.unit) for each in ([(k,) for k in cables] if row.per_cable else [()])
            ]
    return rows


@partial(jax.jit, static_argnames="is_redundant")
def _kernel(robot: AnyRobot, limits: Limits, states: StateBounds, is_redundant: bool) -> tuple[Array, Array]:
    def one(state: StateBounds) -> tuple[Array, Array]:
        cables = cable_bounds(robot, state)
        unit = 1.0 / wrench_units(robot)
        matrix, wrench = balance_bounds(robot, state, cables)
        low, high = tension_range(robot, limits)
        tensions = witness_tensions(matrix * unit[:, None], wrench * unit, low, high)
        if is_redundant:
            parts = [(tensions.margin_low[None], tensions.margin_high[None])]
        else:
            slacks = [tensions.tension - low]
            slacks += [] if limits.tension_max is None else [high - tensions.tension]
            parts = [(slack.low(), slack.high()) for slack in slacks]
        parts += _of_limits(limits, state, cables)
        lows, highs = (jnp.concatenate(side) for side in zip(*parts, strict=True))
        return jnp.where(jnp.isnan(lows), -jnp.inf, lows), jnp.where(jnp.isnan(highs), jnp.inf, highs)

    return jax.vmap(one)(states)


def _of_limits(limits: Limits, state: StateBounds, cables: CableBounds) -> list[tuple[Array, Array]]:
    # Bound the slacks of all other limits; of speeds and accelerations that of the worse sign.
    parts = []
    values = {"depth": state.position.each(lambda x: x[2:]), "length": cables.length}
    rates = {"speed": cables.rate, "acceleration": cables.acceleration}
    for row in limits_set(limits):
        limit = jnp.asarray(getattr(limits, row.name))
        if row.quantity in values:
            slack = limit - values[row.quantity]
            parts.append((slack.low(), slack.high()))
        elif row.quantity in rates:
            above, below = _both(limit, rates[row.quantity])
            parts.append((jnp.minimum(above.low(), below.low()), jnp.minimum(above.high(), below.high())))
    return parts


def _both(limit: Array, value: AffineBounds) -> tuple[AffineBounds, AffineBounds]:
    return -value + limit, value + limit


def block_slacks(
    robot: AnyRobot,
    limits: Limits,
    bounds: Callable[[np.ndarray, np.ndarray], StateBounds],
    start: np.ndarray,
    end: np.ndarray,
) -> BlockSlacks:
    """Bounds of the slacks of a motion over blocks of time.

    Args:
        robot: centred, z down.
        bounds: gives those of the motion's states over blocks, from their starts and ends, (k,) s each.
        start: (k,) s.
        end: (k,) s.

    Returns:
        the bounds.
    """
    kernel = partial(_kernel, robot, limits, is_redundant=robot.n_cables > robot.dof)
    return BlockSlacks(*in_batches(kernel, bounds(start, end), size=BATCH))
