"""Slacks of criteria as series of balls, in the order of `verification.criteria.criteria`.

A slack is the smallest of its components, each of which is smooth. A component may apply at some times only, such as a
side of friction, or a face of wrenches beyond which no cable can pull.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import flint
import numpy as np

from cspr_jax.motion.limits import limits_set, motor_limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.contacts.contact_bodies import bodies_of, default_scene, platform_corners
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.statics.wrench_balance import SINGULAR
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.schema.limits import Limit
from cspr_jax.verification.criteria import ALL, CriterionParts, bounds_tensions, has_extent, pose_conditions
from cspr_jax.verification.exact.components import Component
from cspr_jax.verification.exact.contacts import contact_functions
from cspr_jax.verification.exact.facets import facet_slacks
from cspr_jax.verification.exact.kinematics import Kinematics, balls
from cspr_jax.verification.exact.series import ORDER, absolute, dot

# Components of a slack of a robot at a state; None: no formula is known.
SlackFunction = Callable[[Kinematics], list[Component]]


def slack_functions(
    problem: Problem,
    scene: Scene | None = None,
    parts: CriterionParts = ALL,
    feeds: Float[np.ndarray, "pieces"] | None = None,
) -> list[SlackFunction | None]:
    """Slacks of all criteria, the last one that of the feeds of pieces; None for those without formulas."""
    robot, limits = problem.robot, problem.limits
    functions: list[SlackFunction | None] = []
    if parts.usual:
        functions += _of_tensions(robot, limits)
        for row in limits_set(limits):
            functions += [] if row.quantity == "tension" else _of_limit(robot, limits, row)
    if parts.motors and robot.winches is not None:
        for row in motor_limits_set(limits):
            functions += _of_motor_limit(robot, limits, row)
    if parts.usual:
        is_regular, is_below = pose_conditions(robot)
        functions += [_regular(robot)] if is_regular else []
        functions += [_below(robot)] if is_below else []
    functions += list(_of_contacts(robot, limits, scene)) if parts.contacts else []
    return functions if feeds is None else [*functions, partial(_of_feeds, feeds)]


def _of_feeds(feeds: Float[np.ndarray, "pieces"], at: Kinematics) -> list[Component]:
    # A piece without a feed has no component.
    feed = float(feeds[at.state.piece])
    return [Component(flint.arb(feed) - _norm(at.state.velocity))] if np.isfinite(feed) else []


def _of_tensions(robot: AnyRobot, limits: Any) -> list[SlackFunction | None]:
    low, high = (np.broadcast_to(side, robot.n_cables) for side in tension_range(robot, limits))
    if robot.n_cables > robot.dof:
        largest = None if limits.tension_max is None else balls(high)
        smallest = balls(low)
        return [lambda at: [Component(*each) for each in facet_slacks(at.columns, at.wrench, smallest, largest)]]
    functions: list[SlackFunction | None] = [partial(_above, k, value) for k, value in enumerate(balls(low))]
    if limits.tension_max is not None:
        functions += [partial(_under, k, value) for k, value in enumerate(balls(high))]
    return functions


def _above(k: int, limit: flint.arb, at: Kinematics) -> list[Component]:
    return [Component(at.tensions[k] - limit)]


def _under(k: int, limit: flint.arb, at: Kinematics) -> list[Component]:
    return [Component(limit - at.tensions[k])]


def _of_limit(robot: AnyRobot, limits: Any, row: Limit) -> list[SlackFunction | None]:
    values = balls(np.broadcast_to(np.atleast_1d(getattr(limits, row.name)), robot.n_cables if row.per_cable else 1))
    quantity = QUANTITIES[row.quantity]

    def of(k: int, limit: flint.arb) -> SlackFunction:
        return lambda at: [Component(limit - value) for value in quantity(at, k)]

    return [of(k, limit) for k, limit in enumerate(values)]


def _both(value: Any) -> list[Any]:
    return [value, -value]


def _norm(vector: list[Any]) -> Any:
    # A norm has no derivative where the vector vanishes, far from every limit.
    square = dot(vector, vector)
    if square[0] > 0:
        return square.sqrt()
    return flint.arb_series([_largest_norm(vector), *[flint.arb("nan")] * (ORDER - 1)], min(square.prec, ORDER))


def _largest_norm(vector: list[Any]) -> flint.arb:
    total = sum((abs(part[0]).upper() ** 2 for part in vector), flint.arb(0)).sqrt()
    return total.union(flint.arb(0))


# Values of a quantity, all of which must keep its limit.
QUANTITIES: dict[str, Callable[[Kinematics, int], list[Any]]] = {
    "depth": lambda at, k: [at.state.position[2]],
    "length": lambda at, k: [at.cables[k].length],
    "speed": lambda at, k: _both(at.rate(k)),
    "acceleration": lambda at, k: _both(at.rate(k).derivative()),
    "mass_centre_speed": lambda at, k: [_norm(at.state.velocity)],
    "mass_centre_acceleration": lambda at, k: [_norm(at.state.acceleration)],
}


def _of_motor_limit(robot: AnyRobot, limits: Any, row: Limit) -> list[SlackFunction | None]:
    is_redundant = robot.n_cables > robot.dof and bounds_tensions(row)
    if not has_motor_formulas(robot) or is_redundant:
        return [None] * (1 if is_redundant else robot.n_cables)
    values = balls(np.broadcast_to(getattr(limits, row.name), robot.n_cables))

    def of(k: int, limit: flint.arb) -> SlackFunction:
        return lambda at: [Component(limit - value, acts) for value, acts in motor_values(at, row.quantity, k)]

    return [of(k, limit) for k, limit in enumerate(values)]


def has_motor_formulas(robot: AnyRobot) -> bool:
    """Tell whether motors of a robot have formulas: the radii of their drums do not change."""
    return robot.winches is not None and robot.winches.layers is None


def motor_values(at: Kinematics, quantity: str, k: int) -> list[Component]:
    """Values of a quantity of a motor, all of which must keep its limit."""
    winches: Any = at.robot.winches
    speed = at.rate(k) * (-flint.arb(float(winches.gear_ratio[k])) / flint.arb(float(winches.drum_radius[k])))
    if quantity == "motor_speed":
        return [Component(value) for value in _both(speed)]
    torques = at.motor_torques(k, speed, speed.derivative())
    if quantity == "motor_torque":
        return [Component(value, acts) for torque, acts in torques for value in _both(torque)]
    if quantity == "motor_power":
        return [Component(value, acts) for torque, acts in torques for value in _both(torque * speed)]
    stall, idle = (flint.arb(float(x[k])) for x in (winches.stall_torque, winches.no_load_speed))
    return [
        Component(value / stall + rate / idle, acts)
        for torque, acts in torques
        for value, rate in itertools.product(_both(torque), _both(speed))
    ]


def _regular(robot: Any) -> SlackFunction:
    row = PATTERNS[robot.pattern]
    moments = robot.dof - len(row.forces)
    square = sum((x * x for point in balls(robot.platform_points) for x in point), flint.arb(0))
    radius = (square / robot.n_cables).sqrt()
    smallest = flint.arb(SINGULAR)
    return lambda at: [Component(absolute(at.determinant / radius**moments) - smallest)]


def _below(robot: AnyRobot) -> SlackFunction:
    normal = balls(plane_normal(robot))
    return lambda at: [Component(dot(normal, at.state.position))]


def _of_contacts(robot: AnyRobot, limits: Any, scene: Scene | None) -> Iterator[SlackFunction | None]:
    around = scene or default_scene(robot)
    yield from contact_functions(robot, around)
    if limits.floor is not None and has_extent(robot, around):
        corners = balls(platform_corners(robot, bodies_of(robot, around)))
        floor = flint.arb(float(limits.floor))
        yield lambda at: [Component(floor - at.state.position[2] - dot(at.state.rotation[2], x)) for x in corners]
