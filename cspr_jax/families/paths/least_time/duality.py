"""Rigorous lower bound of the least time along a path, by weak duality.

A motion along a path that never turns back obeys d(a s')/dt + r in K(s): a(s) is the momentum of a unit path speed, r
the weight, K the wrenches that the cables can give. With u = s'' and x = s'^2, that is a u + a' x + r in K. For any
continuous y(s), with S(y, s) the largest product of y with a wrench of K,

    0 <= integral of S - y . (a u + a' x + r) = integral of S - y . r - (y . a' - y' . a) x / 2, less [y . a x / 2],

by parts, since u is half of the derivative of x along the path. The time is the integral of 1 / sqrt x, and 1 / sqrt x
+ g x is at least 1.5 (2 g)^(1/3), whatever x, so that

    T >= [y . a x / 2] + integral of 1.5 (y . a' - y' . a)^(1/3) + y . r - S(y, s).

Limits of cable accelerations (a = l') and of the Cartesian acceleration (a = p') have the same form; a limit of speed
adds a multiplier times its slack. The multipliers of `families.paths.least_time.multipliers` make the bound close; with
any others it still holds. Over each cell all functions are Taylor models (`numerics.bounds.affine_bounds`).
"""

import dataclasses
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.paths.least_time.constraints import static_state, unit_wrenches
from cspr_jax.families.paths.least_time.discrete import Discrete
from cspr_jax.families.paths.least_time.nodes import PathPoints, points_on, state_at
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, cross, dot, norm_squared, rotated, squared
from cspr_jax.numerics.elementary import maximum_of
from cspr_jax.numerics.tolerances import ROUNDING
from cspr_jax.robots.bounds.state_bounds import CableBounds, StateBounds, balance_bounds, balanced_part, cable_bounds
from cspr_jax.robots.cables import AnyRobot, cable_motion, wrench_units
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import RIGID
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit

BATCH = 64
# The bound is lowered by this fraction of its sums, more than their rounding errors.
SAFE = 1e-10
REPAIRS = 12  # largest number of rounds that repair multipliers
SPREAD = 20  # cells on each side whose multipliers change to repair a cell
SPARE = 1.5  # decrease that a repair adds in the cell, over the missing one
DOWN = 2  # axis of forces along gravity
MORE = 1.01  # added weight over missing weight


class Multipliers(NamedTuple):
    """Multipliers at nodes, linear between them, per metre of path.

    Fields:
        wrench: (n_nodes, dof) multipliers of the wrench balance, over the units of wrenches, s / N.
        cable_acceleration: (n_nodes, n_cables) multipliers of cable accelerations, s^3 / m; zeros without a limit.
        acceleration: (n_nodes, 3) multipliers of the Cartesian acceleration, s^3 / m; zeros without a limit.
    """

    wrench: Any
    cable_acceleration: Any
    acceleration: Any


class SpeedMultipliers(NamedTuple):
    """Multipliers of squared speeds, one for each cell, per metre of path; none is negative.

    Fields:
        cable: (n_cells, n_cables) multipliers of cable speeds, s^3 / m^2.
        mass_centre: (n_cells,) multipliers of the mass centre's speed, s^3 / m^2; unused where it is not limited.
    """

    cable: np.ndarray
    mass_centre: np.ndarray


class _Cell(NamedTuple):
    # Multipliers at both ends of one cell, the width of the cell, and its largest Cartesian speed.
    start: Multipliers
    end: Multipliers
    rates: SpeedMultipliers
    width: Any
    speed: Any


def lower_bound(
    robot: AnyRobot, limits: Limits, path: Discrete, multipliers: Multipliers, rates: SpeedMultipliers
) -> float:
    """Lower bound of the time of all motions forward along a section, with its speeds at the ends."""
    nodes, curve, speed = path.grid.nodes, path.section.curve, path.grid.speed
    states = curve.bounds(nodes[:-1], nodes[1:])
    width = np.diff(nodes)
    for _ in range(REPAIRS):
        start, end = (
            Multipliers(*(values[side] for values in multipliers)) for side in (slice(None, -1), slice(1, None))
        )
        cells = _Cell(start, end, rates, width, speed)
        gains, losses, lacks, short = in_batches(partial(_kernel, robot, limits), (states, cells), batch_size=BATCH)
        if (lacks > 0.0).any():
            multipliers = _with_weight(robot, multipliers, lacks)
            continue
        total = float(np.sum(gains) - np.sum(losses))
        if np.isfinite(total):
            total += _boundary(robot, path, multipliers)
            return total - SAFE * float(np.sum(np.abs(gains)) + np.sum(np.abs(losses)))
        if not np.isfinite(losses + short).all():
            break
        multipliers = _evened(robot, path, multipliers, width * short)
    return -np.inf


def _with_weight(robot: AnyRobot, multipliers: Multipliers, lacks: np.ndarray) -> Multipliers:
    # Add so much weight to y that no cable without a largest tension has a positive product with it.
    wrench = multipliers.wrench.copy()
    lacks = MORE * np.fmax(lacks, 0.0)
    wrench[:, PATTERNS[robot.pattern].forces.index(DOWN)] += np.fmax(np.append(lacks, 0.0), np.insert(lacks, 0, 0.0))
    return multipliers._replace(wrench=wrench)


def _boundary(robot: AnyRobot, path: Discrete, multipliers: Multipliers) -> float:
    # Return [y . a x / 2], summed over the wrench balance, cable accelerations and the Cartesian acceleration.
    total = 0.0
    for node, sign, x in ((0, -1.0, path.ends[0]), (-1, 1.0, path.ends[1])):
        if x > 0.0:
            points = points_on(path.section.curve, path.grid.nodes[[node]], ahead=node == 0)
            duals = multipliers.wrench[node], multipliers.cable_acceleration[node], multipliers.acceleration[node]
            total += 0.5 * sign * x * float(_of_end(robot, jax.tree.map(lambda x: x[0], points), *duals))
    return total


@jax.jit
def _of_end(robot: AnyRobot, point: PathPoints, wrench: Array, cable_acceleration: Array, acceleration: Array) -> Array:
    state = state_at(point)
    along = wrench @ unit_wrenches(robot, state).momentum
    return along + cable_acceleration @ cable_motion(robot, state)[1] + acceleration @ state.velocity


def _evened(robot: AnyRobot, path: Discrete, multipliers: Multipliers, short: np.ndarray) -> Multipliers:
    # Let y decrease more along a in cells where y . a' - y' . a is negative, and less in the cells beside them.
    nodes = np.arange(len(short) + 1)
    fraction = np.zeros(len(nodes))
    for cell in np.flatnonzero(short > 0.0):
        rise = np.clip(1.0 - (cell - nodes) / SPREAD, 0.0, 1.0) * (nodes <= cell)
        drop = np.clip(1.0 - (nodes - cell - 1) / SPREAD, 0.0, 1.0) * (nodes > cell)
        fraction += 0.5 * SPARE * short[cell] * (rise - drop)
    momentum = in_batches(
        partial(_momentum, robot), (points_on(path.section.curve, path.grid.nodes, ahead=True),), batch_size=BATCH
    )
    square = np.sum(momentum**2, axis=1)
    change = np.where(square > 0.0, fraction / np.where(square > 0.0, square, 1.0), 0.0)[:, None] * momentum
    return multipliers._replace(wrench=multipliers.wrench + change)


@persistent_jit(compiler_options=compile_options.proof_options())
def _momentum(robot: AnyRobot, nodes: tuple[PathPoints]) -> Array:
    return jax.vmap(lambda point: unit_wrenches(robot, state_at(point)).momentum)(*nodes)


def _line(start: Array, end: Array) -> AffineBounds:
    return AffineBounds(0.5 * (start + end), 0.5 * (end - start), jnp.zeros_like(start))


def _line_rate(start: Array, end: Array, width: Array) -> AffineBounds:
    # Return the derivative of the line between both values.
    change = (end - start) / width
    return AffineBounds(change, jnp.zeros_like(change), ROUNDING * jnp.abs(change))


def _ends(bounds: AffineBounds, sign: float) -> tuple[Array, Array]:
    # Return the values at both ends of a line that bounds a function from below (-1) or from above (1).
    side = bounds.middle + sign * bounds.radius
    return side - bounds.linear, side + bounds.linear


def _along(start: Array, end: Array, width: Array, momentum: AffineBounds, rate: AffineBounds) -> AffineBounds:
    # Return y . a' - y' . a.
    return dot(_line(start, end), rate) - dot(_line_rate(start, end, width), momentum)


@persistent_jit(compiler_options=compile_options.proof_options())
def _kernel(robot: AnyRobot, limits: Limits, blocks: tuple[StateBounds, _Cell]) -> tuple[Array, Array, Array, Array]:
    # Return for each cell what it adds to the bound, what it takes from the bound, the weight that its multipliers
    # lack, and by how much y . a' - y' . a is negative.
    def one(state: StateBounds, cell: _Cell) -> tuple[Array, Array, Array, Array]:
        twice, lost, lack = _of_wrenches(robot, limits, state, cell)
        cables = cable_bounds(robot, state)
        if limits.cable_acceleration_max is not None:
            ends = cell.start.cable_acceleration, cell.end.cable_acceleration
            twice = twice + _along(*ends, cell.width, cables.rate, cables.acceleration)
            lost += jnp.sum(limits.cable_acceleration_max * 0.5 * (jnp.abs(ends[0]) + jnp.abs(ends[1])))
        if limits.acceleration_max is not None:
            ends = cell.start.acceleration, cell.end.acceleration
            twice = twice + _along(*ends, cell.width, state.velocity, state.acceleration)
            lost += limits.acceleration_max * 0.5 * (jnp.linalg.norm(ends[0]) + jnp.linalg.norm(ends[1]))
        if limits.cable_speed_max is not None:
            twice = twice + (2.0 * cell.rates.cable * squared(cables.rate)).total()
            lost += jnp.sum(jnp.square(limits.cable_speed_max) * cell.rates.cable)
        rate = jnp.where(jnp.isfinite(cell.speed), cell.rates.mass_centre, 0.0)
        twice = twice + 2.0 * rate * norm_squared(state.velocity)
        lost += rate * jnp.square(jnp.where(jnp.isfinite(cell.speed), cell.speed, 0.0))
        # A concave function on a line is above the chord between its values at the ends.
        low, high = _ends(twice, -1.0)
        values = [1.5 * jnp.where(side >= 0.0, jnp.cbrt(side), -jnp.inf) for side in (low, high)]
        short = jnp.maximum(0.0, -jnp.minimum(low, high))
        return cell.width * 0.5 * (values[0] + values[1]), cell.width * lost, lack, short

    return jax.vmap(one)(*blocks)


def _of_wrenches(robot: AnyRobot, limits: Limits, state: StateBounds, cell: _Cell) -> tuple[AffineBounds, Array, Array]:
    # Return y . a' - y' . a of the wrench balance, the mean of S - y . r over the cell, and the weight that y lacks.
    unit = 1.0 / wrench_units(robot)
    rest, accelerated = static_state(state, accelerated=False), static_state(state, accelerated=True)
    cables = cable_bounds(robot, rest)
    matrix, weight = balance_bounds(robot, rest, cables)
    momentum = balance_bounds(robot, accelerated, cables)[1] - weight
    momentum_rate = balance_bounds(robot, state, cables)[1] - weight
    matrix, weight, momentum, momentum_rate = (
        matrix * unit[:, None],
        weight * unit,
        momentum * unit,
        momentum_rate * unit,
    )
    ends = cell.start.wrench, cell.end.wrench
    line = _line(*ends)
    products = rotated(matrix.each(jnp.transpose), line)
    low, high = tension_range(robot, limits)
    is_bounded = jnp.isfinite(high)

    def support_of(value: Array) -> Array:
        return jnp.where(value > 0.0, value * jnp.where(is_bounded, high, 0.0), value * low)

    # A convex function on a line is below the chord between its values at the ends.
    sides = [
        jnp.maximum(support_of(up), support_of(down))
        for up, down in zip(_ends(products, 1.0), _ends(products, -1.0), strict=True)
    ]
    support = 0.5 * jnp.sum(sides[0] + sides[1])
    held = dot(line, weight)
    lack = jnp.zeros(())
    if DOWN in PATTERNS[robot.pattern].forces:
        upward = -matrix.high()[PATTERNS[robot.pattern].forces.index(DOWN)]
        gains = jnp.where(is_bounded, 0.0, products.high())
        lack = maximum_of(jnp.where(gains > 0.0, gains / jnp.maximum(upward, 0.0), 0.0))
    if PATTERNS[robot.pattern].along_line:
        momentum_rate = momentum_rate - _turning_axes(robot, accelerated, cables) * unit
    return _along(*ends, cell.width, momentum, momentum_rate), support - (held.middle - held.radius), lack


def _turning_axes(robot: Any, accelerated: StateBounds, cables: CableBounds) -> AffineBounds:
    # Bound the contribution of axes that turn with the platform to the momentum's derivative: e' . L = e . (L x omega).
    full = balance_bounds(dataclasses.replace(robot, pattern=RIGID), accelerated, cables)[1].each(lambda x: x[3:])
    moment = cross(full, accelerated.angular_acceleration).each(lambda x: x[:, None])
    return balanced_part(robot, accelerated.rotation, moment * 0.0, moment).each(lambda x: x[:, 0])
