"""Slacks of any motion over blocks of time: bounds, from bounds of its states, of how far each criterion is met.

In natural units (N, m, m/s, m/s^2), in this order, with n cables:

    tension     of n = dof cables: n distances of the tensions from their limits; of more: the largest distance that all
                tensions together can have from their limits
    limits      that are given, one for each cable, of the floor one: depth, length, speed, acceleration
"""

from collections.abc import Callable
from functools import partial
from typing import Literal, NamedTuple

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
Pair = tuple[Array, Array] | Array


class Criterion(NamedTuple):
    """Criterion of a slack.

    Fields:
        flag: the verdict where it is broken; of the tensions of redundant cables `WRENCH_INFEASIBLE`.
        cables: numbers from 0 on: of one cable, of two that meet, or none.
        unit: of the slack.
        obstacle: number of the obstacle from 0 on; None: no obstacle is concerned.
        allowed: the least, or the most, that the quantity may be.
        sense: whether it must be at least or at most so large.
    """

    flag: Verdict
    cables: tuple[int, ...]
    unit: str
    obstacle: int | None = None
    allowed: float = 0.0
    sense: Literal["least", "most"] = "least"

    def value(self, slack: float) -> float:
        """Value of the quantity that is bounded.

        Args:
            slack: (), in `unit`.

        Returns:
            () likewise.
        """
        return self.allowed + slack if self.sense == "least" else self.allowed - slack


class BlockSlacks(NamedTuple):
    """Bounds of slacks over k blocks: by numbers, and by lines over the block that rise from or to these numbers.

    Fields:
        low: (k, n_criteria) lower bounds, -inf where nothing is known.
        high: (k, n_criteria) upper bounds, inf where nothing is known.
        low_rise: (k, n_criteria) rise of the line below the slack, from start to end, whose lower end is at `low`;
            None: no line is known.
        high_rise: (k, n_criteria) likewise of the line above, whose higher end is at `high`.
    """

    low: np.ndarray
    high: np.ndarray
    low_rise: np.ndarray = None  # type: ignore[assignment]
    high_rise: np.ndarray = None  # type: ignore[assignment]

    def complete(self) -> "BlockSlacks":
        """The bounds with lines, level ones where none are known.

        Returns:
            the bounds.
        """
        rises = (np.zeros_like(self.low) if rise is None else rise for rise in (self.low_rise, self.high_rise))
        return BlockSlacks(self.low, self.high, *rises)


def _lines(below: Pair, above: Pair) -> tuple[Array, ...]:
    # Fields of `BlockSlacks` from values of a line below and of a line above, at the start and at the end of a block.
    return jnp.minimum(*below), jnp.maximum(*above), below[1] - below[0], above[1] - above[0]


def _edges(slack: AffineBounds) -> tuple[Pair, Pair]:
    sides = slack.middle - slack.radius, slack.middle + slack.radius
    below, above = ((side - slack.slope, side + slack.slope) for side in sides)
    return below, above


def criteria(robot: AnyRobot, limits: Limits) -> list[Criterion]:
    """Criteria, in the order of their slacks.

    Returns:
        n_criteria of them.
    """
    numbers = range(robot.n_cables)
    if robot.n_cables > robot.dof:
        rows = [Criterion(Verdict.WRENCH_INFEASIBLE, (), "N")]
    else:
        low, high = (np.broadcast_to(side, robot.n_cables).tolist() for side in tension_range(robot, limits))
        rows = [Criterion(Verdict.SLACK_CABLE, (k,), "N", allowed=low[k]) for k in numbers]
        if limits.tension_max is not None:
            rows += [Criterion(Verdict.OVER_TENSION, (k,), "N", allowed=high[k], sense="most") for k in numbers]
    for row in limits_set(limits):
        if row.quantity == "tension":
            continue
        values = np.atleast_1d(np.asarray(getattr(limits, row.name), float))
        values = np.broadcast_to(values, robot.n_cables if row.per_cable else 1).tolist()
        cables = [(k,) if row.per_cable else () for k in range(len(values))]
        rows += [
            Criterion(row.flag, each, row.unit, allowed=value, sense=row.sense)
            for each, value in zip(cables, values, strict=True)
        ]
    return rows


@partial(jax.jit, static_argnames="is_redundant")
def _kernel(robot: AnyRobot, limits: Limits, states: StateBounds, is_redundant: bool) -> tuple[Array, ...]:
    def one(state: StateBounds) -> tuple[Array, ...]:
        cables = cable_bounds(robot, state)
        unit = 1.0 / wrench_units(robot)
        matrix, wrench = balance_bounds(robot, state, cables)
        low, high = tension_range(robot, limits)
        tensions = witness_tensions(matrix * unit[:, None], wrench * unit, low, high)
        if is_redundant:
            parts = [_lines(tensions.below[:, None], tensions.above[:, None])]
        else:
            slacks = [tensions.tension - low]
            slacks += [] if limits.tension_max is None else [high - tensions.tension]
            parts = [_lines(*_edges(slack)) for slack in slacks]
        parts += _of_limits(limits, state, cables)
        # A part of two bounds has no lines.
        level = [(*part, *[jnp.zeros_like(part[0])] * (4 - len(part))) for part in parts]
        low, high, *rises = (jnp.concatenate(side) for side in zip(*level, strict=True))
        low, high = jnp.where(jnp.isnan(low), -jnp.inf, low), jnp.where(jnp.isnan(high), jnp.inf, high)
        return low, high, *(jnp.where(jnp.isfinite(rise), rise, 0.0) for rise in rises)

    return jax.vmap(one)(states)


def _of_limits(limits: Limits, state: StateBounds, cables: CableBounds) -> list[tuple[Array, ...]]:
    # Bound the slacks of all other limits; of speeds and accelerations that of the worse sign.
    parts: list[tuple[Array, ...]] = []
    values = {"depth": state.position.each(lambda x: x[2:]), "length": cables.length}
    rates = {"speed": cables.rate, "acceleration": cables.acceleration}
    for row in limits_set(limits):
        limit = jnp.asarray(getattr(limits, row.name))
        if row.quantity in values:
            parts.append(_lines(*_edges(limit - values[row.quantity])))
        elif row.quantity in rates:
            parts.append(_within(limit, rates[row.quantity]))
    return parts


def _within(limit: Array, value: AffineBounds) -> tuple[Array, ...]:
    # The smaller of two slacks is above the line between the smaller values at both ends, and below each of both.
    one, other = limit - value, value + limit
    (below, above), (other_below, other_above) = _edges(one), _edges(other)
    is_nearer = one.high() <= other.high()
    start, end = (jnp.where(is_nearer, *ends) for ends in zip(above, other_above, strict=True))
    low = jnp.minimum(below[0], other_below[0]), jnp.minimum(below[1], other_below[1])
    return _lines(low, (start, end))


def block_slacks(
    robot: AnyRobot,
    limits: Limits,
    bounds: Callable[[np.ndarray, np.ndarray], StateBounds],
    start: np.ndarray,
    end: np.ndarray,
) -> BlockSlacks:
    """Bounds of the slacks of a motion over blocks of time.

    Args:
        robot: centred, z down, without pulleys.
        bounds: gives those of the motion's states over blocks, from their starts and ends, (k,) s each.
        start: (k,) s.
        end: (k,) s.

    Returns:
        the bounds.
    """
    kernel = partial(_kernel, robot, limits, is_redundant=robot.n_cables > robot.dof)
    return BlockSlacks(*in_batches(kernel, bounds(start, end), size=BATCH))
