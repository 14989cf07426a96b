"""Slacks of any motion over blocks of time: bounds, from bounds of its states, of how far each criterion is met.

In natural units (N, m, m/s, m/s^2), in this order, with n cables:

    tension     of n = dof cables: n distances of the tensions from their limits; of more: the largest distance that all
                tensions together can have from their limits
    limits      that are given, one for each cable, of the floor one: depth, length, speed, acceleration
    regular     of a platform on n = dof cables: size of the normalised determinant less what counts as singular
    below       of a point mass or a rigid platform on n = dof cables: depth below the plane of the spools
    contacts    of all bodies that can meet: clearance of their surfaces, `robots.contact_bounds`
    floor       where there is one, and the shape of the platform is known: height of its lowest corner above the floor

A motion passes a singularity, and cables without thickness pass through each other, at an instant only. Where that is
proved to happen within a block that is short enough, the slack counts as negative there.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic.affine_bounds import AffineBounds, dot
from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.arithmetic.determinant_bounds import changes_sign, determinant, size_range
from cspr_jax.motions.limits import limits_set
from cspr_jax.robots.cables import AnyRobot, wrench_units
from cspr_jax.robots.clearance import Scene
from cspr_jax.robots.contact_bodies import Bodies, bodies_of, default_scene, meetings
from cspr_jax.robots.contact_bounds import contact_bounds, corner_depths, passings
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.robots.platform import RIGID
from cspr_jax.robots.point_mass import plane_normal
from cspr_jax.robots.state_bounds import CableBounds, StateBounds, balance_bounds, cable_bounds
from cspr_jax.robots.witness_tensions import witness_tensions
from cspr_jax.robots.wrench_balance import SINGULAR
from cspr_jax.robots.wrench_sets import tension_range
from cspr_jax.schema.verdicts import Verdict

BATCH = 64
# Length of a block and the one before it, together, at which what happens at an instant counts for the block, s.
INSTANT = 1e-6
# Upper bound of a slack that vanishes at an instant.
SMALLEST = 1e-12
# Patterns of the robots that have to stay below their spools.
BELOW = ("2T", "3T", RIGID)
FLAGS = {
    "cables": Verdict.CABLE_CABLE,
    "platform": Verdict.CABLE_PLATFORM,
    "obstacle": Verdict.OBSTACLE,
    "platform-obstacle": Verdict.OBSTACLE,
}


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


def criteria(robot: AnyRobot, limits: Limits, scene: Scene | None = None) -> list[Criterion]:
    """Criteria, in the order of their slacks.

    Args:
        scene: bodies that can meet, in the robot's axes; None: the cables of a platform alone.

    Returns:
        n_criteria of them.
    """
    cables, around = range(robot.n_cables), scene or default_scene(robot)
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
    is_regular, is_below = _rest(robot)
    rows += [Criterion(Verdict.SINGULAR, (), "1")] if is_regular else []
    rows += [Criterion(Verdict.ABOVE_SPOOLS, (), "m")] if is_below else []
    for kind, cable, other in meetings(robot, around):
        bodies = [k for k in (cable, other if kind == "cables" else -1) if k >= 0]
        rows.append(Criterion(FLAGS[kind], tuple(bodies), "m", other if FLAGS[kind] == Verdict.OBSTACLE else None))
    if limits.floor is not None and around.body is not None:
        rows.append(Criterion(Verdict.BELOW_FLOOR, (), "m"))
    return rows


def _rest(robot: AnyRobot) -> tuple[bool, bool]:
    # Tell whether the determinant, and the depth below the spools, are judged.
    is_determined = robot.n_cables == robot.dof
    return is_determined and PATTERNS[robot.pattern].is_body, is_determined and robot.pattern in BELOW


@partial(jax.jit, static_argnames="passes")
def _kernel(
    robot: AnyRobot, limits: Limits, bodies: Bodies, states: StateBounds, passes: bool = False
) -> tuple[Array, Array] | Array:
    # Bound the slacks, or tell which of them are proved to vanish at an instant.
    def one(state: StateBounds) -> tuple[Array, Array] | Array:
        cables = cable_bounds(robot, state)
        unit = 1.0 / wrench_units(robot)
        matrix, wrench = balance_bounds(robot, state, cables)
        matrix, wrench = matrix * unit[:, None], wrench * unit
        if passes:
            return _passes(robot, bodies, matrix, state, cables)
        parts = [*_of_tensions(robot, limits, matrix, wrench), *_of_limits(limits, state, cables)]
        parts += [*_of_pose(robot, matrix, state), contact_bounds(robot, bodies, state, cables)]
        if limits.floor is not None and bodies.body is not None:
            heights = -corner_depths(bodies.body, state) + limits.floor
            parts.append((jnp.min(heights.low(), keepdims=True), jnp.min(heights.high(), keepdims=True)))
        lows, highs = (jnp.concatenate(side) for side in zip(*parts, strict=True))
        return jnp.where(jnp.isnan(lows), -jnp.inf, lows), jnp.where(jnp.isnan(highs), jnp.inf, highs)

    return jax.vmap(one)(states)


def _of_tensions(
    robot: AnyRobot, limits: Limits, matrix: AffineBounds, wrench: AffineBounds
) -> list[tuple[Array, Array]]:
    low, high = tension_range(robot, limits)
    tensions = witness_tensions(matrix, wrench, low, high)
    if robot.n_cables > robot.dof:
        return [(tensions.margin_low[None], tensions.margin_high[None])]
    slacks = [tensions.tension - low]
    slacks += [] if limits.tension_max is None else [high - tensions.tension]
    return [(slack.low(), slack.high()) for slack in slacks]


def _of_pose(robot: AnyRobot, matrix: AffineBounds, state: StateBounds) -> list[tuple[Array, Array]]:
    # Bound the determinant and the depth below the spools, where they are judged.
    parts, (is_regular, is_below) = [], _rest(robot)
    if is_regular:
        low, high = size_range(determinant(matrix))
        parts.append((low[None] - SINGULAR, high[None] - SINGULAR))
    if is_below:
        depth = dot(state.position, plane_normal(robot))
        parts.append((depth.low()[None], depth.high()[None]))
    return parts


def _passes(robot: AnyRobot, bodies: Bodies, matrix: AffineBounds, state: StateBounds, cables: CableBounds) -> Array:
    # Tell which of the determinant and the contacts are proved to vanish within a block, (1 + n_meetings,).
    is_regular, _ = _rest(robot)
    through = changes_sign(determinant(matrix)) if is_regular else jnp.zeros((), bool)
    return jnp.concatenate([through[None], passings(robot, bodies, state, cables)])


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
    scene: Scene | None = None,
) -> BlockSlacks:
    """Bounds of the slacks of a motion over blocks of time.

    Args:
        robot: centred, z down, without pulleys.
        bounds: gives those of the motion's states over blocks, from their starts and ends, (k,) s each.
        start: (k,) s.
        end: (k,) s.
        scene: bodies that can meet, in the robot's axes; None: the cables of a platform alone.

    Returns:
        the bounds.
    """
    bodies = bodies_of(robot, scene or default_scene(robot))
    low, high = in_batches(partial(_kernel, robot, limits, bodies), bounds(start, end), size=BATCH)
    rows = criteria(robot, limits, scene)
    at_instants = np.array([row.flag in (Verdict.SINGULAR, *FLAGS.values()) for row in rows])
    is_open = ~((low > 0.0) | (high < 0.0))[:, at_instants]
    # What happens at the border of two blocks is within the second one and the end of the first.
    before = np.maximum(2.0 * start - end, 0.0)
    short = np.flatnonzero(is_open.any(1) & (end - before <= INSTANT))
    if len(short):
        kernel = partial(_kernel, robot, limits, bodies, passes=True)
        passes = in_batches(kernel, bounds(before[short], end[short]), size=BATCH)
        passes = passes if rows[np.argmax(at_instants)].flag == Verdict.SINGULAR else passes[:, 1:]
        found = np.zeros((len(short), len(rows)), bool)
        found[:, at_instants] = passes & is_open[short]
        high[short] = np.where(found, -SMALLEST, high[short])
    return BlockSlacks(low, high)
