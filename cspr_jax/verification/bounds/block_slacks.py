"""Bounds of slacks of any motion over blocks of time, from bounds of its states.

A motion passes a singularity, and cables without thickness pass through each other, at isolated times only. If such an
event is proved to happen within a block that is short enough, the slack counts as negative there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.limits import limits_set, motor_limits_set
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, dot, norm
from cspr_jax.numerics.bounds.function_bounds import changes_sign, determinant, magnitude_range
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.contact_bounds import contact_bounds, corner_depths, passings
from cspr_jax.robots.bounds.motor_bounds import motor_bounds, motor_slack, part_of, tension_lines
from cspr_jax.robots.bounds.state_bounds import CableBounds, StateBounds, balance_bounds, cable_bounds
from cspr_jax.robots.bounds.witness_tensions import WitnessTensions, witness_tensions
from cspr_jax.robots.cables import AnyRobot, wrench_units
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.contacts.contact_bodies import Bodies, bodies_of, default_scene, platform_corners
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.model.winches import Winches
from cspr_jax.robots.statics.wrench_balance import SINGULAR
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.criteria import ALL, AT_TIMES, CriterionParts, bounds_tensions, criteria, pose_conditions

# Numbers of blocks that are bounded together, with contacts and without.
BATCH = 64
RATES_BATCH = 128
# Largest duration, s, of a block and the one before it for events at single times to count.
SHORTEST = 1e-6
# Minus the upper bound of a slack that is proved to vanish at a single time.
SMALLEST = 1e-12
Pair = tuple[Array, Array] | Array
# Bounds of slacks, without lines or with them, in the order of the fields of `BlockSlacks`.
Part = tuple[Array, ...]


class BlockSlacks(NamedTuple):
    """Bounds of slacks over k blocks: by numbers, and by lines over the block.

    Fields:
        low: (k, n_criteria) lower bounds, -inf without bounds.
        high: (k, n_criteria) upper bounds, inf without bounds.
        low_rise: (k, n_criteria) rise, from start to end, of a line below the slack whose lower end is at `low`; None:
            there is no line.
        high_rise: (k, n_criteria) likewise for a line above the slack whose higher end is at `high`.
    """

    low: np.ndarray
    high: np.ndarray
    low_rise: np.ndarray = None  # type: ignore[assignment]
    high_rise: np.ndarray = None  # type: ignore[assignment]

    def complete(self) -> "BlockSlacks":
        """The bounds with lines, which are level where there were none."""
        rises = (np.zeros_like(self.low) if rise is None else rise for rise in (self.low_rise, self.high_rise))
        return BlockSlacks(self.low, self.high, *rises)


def _lines(below: Pair, above: Pair) -> Part:
    # Fields of `BlockSlacks` from the values at start and end of a line below and a line above the slack.
    return jnp.minimum(*below), jnp.maximum(*above), below[1] - below[0], above[1] - above[0]


def _part(slack: AffineBounds) -> Part:
    # Bound a slack around a line by lines, and the smallest value of a slack around a parabola by numbers.
    return _lines(*_edges(slack)) if slack.square is None else (slack.low(), slack.low() + 2.0 * slack.radius)


def _edges(slack: AffineBounds) -> tuple[Pair, Pair]:
    sides = slack.middle - slack.radius, slack.middle + slack.radius
    below, above = ((side - slack.linear, side + slack.linear) for side in sides)
    return below, above


@persistent_jit(static_argnames=("passes", "kinds"))
def _kernel(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    states: StateBounds,
    passes: bool = False,
    kinds: CriterionParts = ALL,
) -> tuple[Array, ...] | Array:
    # Bound the slacks, or tell which of them are proved to vanish at a single time.
    def one(state: StateBounds) -> tuple[Array, ...] | Array:
        cables, matrix, wrench = _balance(robot, state)
        if passes:
            return _passes(robot, bodies, matrix, state, cables)
        parts = _of_rates(robot, limits, state, (cables, matrix, wrench), kinds)
        parts += _of_pose(robot, matrix, state) if kinds.usual else []
        if kinds.contacts:
            parts.append(contact_bounds(robot, bodies, state, cables))
            corners = platform_corners(robot, bodies)
            if limits.floor is not None and corners is not None:
                heights = -corner_depths(corners, state) + limits.floor
                parts.append((minimum_of(heights.low(), keepdims=True), minimum_of(heights.high(), keepdims=True)))
        return _joined(parts)

    return jax.vmap(one)(states)


def _balance(robot: AnyRobot, state: StateBounds) -> tuple[CableBounds, AffineBounds, AffineBounds]:
    cables, unit = cable_bounds(robot, state), 1.0 / wrench_units(robot)
    matrix, wrench = balance_bounds(robot, state, cables)
    return cables, matrix * unit[:, None], wrench * unit


def _joined(parts: list[Part]) -> Part:
    # Parts with only two bounds have no lines: add level ones.
    level = [(*part, *[jnp.zeros_like(part[0])] * (4 - len(part))) for part in parts]
    low, high, *rises = (jnp.concatenate(side) for side in zip(*level, strict=True))
    low, high = jnp.where(jnp.isnan(low), -jnp.inf, low), jnp.where(jnp.isnan(high), jnp.inf, high)
    return low, high, *(jnp.where(jnp.isfinite(rise), rise, 0.0) for rise in rises)


@persistent_jit(compiler_options=compile_options.proof_options())
def _speeds_kernel(velocity: AffineBounds) -> Part:
    return jax.vmap(lambda each: _joined([_part(-norm(each.each(lambda x: x[None])))]))(velocity)


@persistent_jit
def _rates_kernel(robot: AnyRobot, limits: Limits, states: StateBounds) -> tuple[Array, Array]:
    # Bound the smallest slacks: the lower end of a line above a slack is an upper bound of its smallest value.
    def one(state: StateBounds) -> tuple[Array, Array]:
        parts = _of_rates(robot, limits, state, _balance(robot, state), ALL)
        low, high, _, rise = _joined(parts)
        return low, high - jnp.abs(rise)

    return jax.vmap(one)(states)


def _of_rates(
    robot: AnyRobot,
    limits: Limits,
    state: StateBounds,
    balance: tuple[CableBounds, AffineBounds, AffineBounds],
    kinds: CriterionParts,
) -> list[Part]:
    # Bound the slacks of tensions and limits, those of winches last.
    parts, (cables, matrix, wrench) = list[Part](), balance
    has_motors = kinds.motors and robot.winches is not None and bool(motor_limits_set(limits))
    if not (kinds.usual or has_motors):
        return parts
    tensions = witness_tensions(matrix, wrench, *tension_range(robot, limits))
    if kinds.usual:
        parts += [*_of_tensions(robot, limits, tensions), *limit_slacks(limits, state, cables)]
    if has_motors:
        parts += _of_motors(robot, limits, balance, tensions)
    return parts


def tension_slacks(robot: AnyRobot, limits: Limits, matrix: AffineBounds, wrench: AffineBounds) -> list[Part]:
    """Bounds of the slacks of tensions over one block."""
    return _of_tensions(robot, limits, witness_tensions(matrix, wrench, *tension_range(robot, limits)))


def _of_tensions(robot: AnyRobot, limits: Limits, tensions: WitnessTensions) -> list[Part]:
    low, high = tension_range(robot, limits)
    if robot.n_cables > robot.dof:
        return [_lines(tensions.below[:, None], tensions.above[:, None])]
    slacks = [tensions.tension - low]
    slacks += [] if limits.tension_max is None else [high - tensions.tension]
    return [_part(slack) for slack in slacks]


def _of_motors(
    robot: AnyRobot,
    limits: Limits,
    balance: tuple[CableBounds, AffineBounds, AffineBounds],
    tensions: WitnessTensions,
) -> list[Part]:
    # Bound the slacks of limits of winches, of redundant cables by tensions in ranges that narrow limit by limit.
    (cables, matrix, wrench), winches = balance, cast("Winches", robot.winches)
    parts, motors = list[Part](), motor_bounds(winches, cables)
    allowed = tension_lines(*map(jnp.asarray, tension_range(robot, limits)))
    for row in motor_limits_set(limits):
        limit = jnp.asarray(getattr(limits, row.name))
        if robot.n_cables == robot.dof or not bounds_tensions(row):
            parts.append(part_of(motor_slack(winches, row.quantity, limit, motors, tensions.tension)))
            continue
        allowed = allowed.narrowed(winches, row.quantity, limit, motors)
        outer = allowed.low.below, allowed.high.above
        narrow = witness_tensions(matrix, wrench, allowed.low.above, allowed.high.below, outer)
        parts.append(_lines(narrow.below[:, None], narrow.above[:, None]))
    return parts


def _of_pose(robot: AnyRobot, matrix: AffineBounds, state: StateBounds) -> list[Part]:
    # Bound the determinant and the depth below the spools, where they are criteria.
    parts: list[Part] = []
    is_regular, is_below = pose_conditions(robot)
    if is_regular:
        low, high = magnitude_range(determinant(matrix))
        parts.append((low[None] - SINGULAR, high[None] - SINGULAR))
    if is_below:
        parts.append(_lines(*_edges(dot(state.position, plane_normal(robot)).each(lambda x: x[None]))))
    return parts


def _passes(robot: AnyRobot, bodies: Bodies, matrix: AffineBounds, state: StateBounds, cables: CableBounds) -> Array:
    # Tell which of the determinant and the contacts are proved to vanish within a block, (1 + n_contacts,).
    is_regular, _ = pose_conditions(robot)
    through = changes_sign(determinant(matrix)) if is_regular else jnp.zeros((), bool)
    return jnp.concatenate([through[None], passings(robot, bodies, state, cables)])


def limit_slacks(limits: Limits, state: StateBounds, cables: CableBounds) -> list[Part]:
    """Bounds of the slacks of all other limits over one block; speeds and accelerations count with the worse sign."""
    parts: list[Part] = []
    values = {"depth": state.position.each(lambda x: x[2:]), "length": cables.length}
    rates = {"speed": cables.rate, "acceleration": cables.acceleration}
    sizes = {"mass_centre_speed": state.velocity, "mass_centre_acceleration": state.acceleration}
    for row in limits_set(limits):
        limit = jnp.asarray(getattr(limits, row.name))
        if row.quantity in values:
            parts.append(_part(limit - values[row.quantity]))
        elif row.quantity in sizes:
            parts.append(_part(limit - norm(sizes[row.quantity].each(lambda x: x[None]))))
        elif row.quantity in rates:
            parts.append(_within(limit, rates[row.quantity]))
    return parts


def _within(limit: Array, value: AffineBounds) -> Part:
    # The smaller of two slacks is above the line between its values at both ends, and below each of the two.
    one, other = limit - value, value + limit
    if value.square is not None:
        return tuple(jnp.minimum(*sides) for sides in zip(_part(one), _part(other), strict=True))
    (below, above), (other_below, other_above) = _edges(one), _edges(other)
    is_nearer = one.high() <= other.high()
    start, end = (jnp.where(is_nearer, *ends) for ends in zip(above, other_above, strict=True))
    low = jnp.minimum(below[0], other_below[0]), jnp.minimum(below[1], other_below[1])
    return _lines(low, (start, end))


def block_slacks(
    robot: AnyRobot,
    limits: Limits,
    bounds: Callable[[np.ndarray, np.ndarray], StateBounds],
    start: Float[np.ndarray, "k"],
    end: Float[np.ndarray, "k"],
    scene: Scene | None = None,
    parts: CriterionParts = ALL,
) -> BlockSlacks:
    """Bounds of the slacks of a motion over blocks of time."""
    bodies = bodies_of(robot, scene or default_scene(robot))
    slacks = partial(_kernel, robot, limits, bodies, kinds=parts)
    low, high, *rises = in_batches(slacks, bounds(start, end), batch_size=BATCH)
    rows = criteria(robot, limits, scene, parts)
    at_times = np.array([row.flag in AT_TIMES for row in rows])
    is_open = ~((low > 0.0) | (high < 0.0))[:, at_times]
    # Extend blocks to earlier times, so that an event at the border of two blocks lies within an extended block.
    before = np.maximum(2.0 * start - end, 0.0)
    short = np.flatnonzero(is_open.any(1) & (end - before <= SHORTEST))
    if len(short):
        kernel = partial(_kernel, robot, limits, bodies, passes=True)
        # `bounds` takes all blocks, which may belong to several motions.
        states = jax.tree.map(lambda array: np.asarray(array)[short], bounds(before, end))
        passes = in_batches(kernel, states, batch_size=BATCH)
        passes = passes if rows[np.argmax(at_times)].flag == Verdict.SINGULAR else passes[:, 1:]
        passes = passes if parts.contacts else passes[:, :1]
        vanishing = np.zeros((len(short), len(rows)), bool)
        vanishing[:, at_times] = passes & is_open[short]
        high[short] = np.where(vanishing, -SMALLEST, high[short])
        rises[1][short] = np.where(vanishing, 0.0, rises[1][short])
    return BlockSlacks(low, high, *rises)


def rate_slacks(
    robot: AnyRobot, limits: Limits, states: StateBounds
) -> tuple[Float[np.ndarray, "k n"], Float[np.ndarray, "k n"]]:
    """Bounds of the smallest slacks of tensions and limits, the first criteria, over blocks."""
    return in_batches(partial(_rates_kernel, robot, limits), states, batch_size=RATES_BATCH)


def speed_slacks(states: StateBounds) -> BlockSlacks:
    """Bounds of minus the speed of the mass centre over k blocks; adding the limit makes it a slack."""
    return BlockSlacks(*in_batches(_speeds_kernel, states.velocity, batch_size=RATES_BATCH))
