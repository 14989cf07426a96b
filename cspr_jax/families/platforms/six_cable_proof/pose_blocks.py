"""Bounds of contacts, depth and limits on the pose, which depend on the pose alone, on blocks of a platform's motions.

Two cables are apart where some unit vector e has e . (x_j - x_i) > 0 for all points x of both: this is linear in the
points, so that the ends of the cables are enough. A cable is off the platform where its vector v from its corner, in
platform axes, has e . v > 0 for a unit vector e of the polar cone of the corner's sector. Any e is valid on a whole
block. The e of the middle is taken: along the shortest vector between the cables, or along the residual of the
projection of the cable onto the sector (Moreau).
Between instants h apart a function f with |f''| <= C stays above its smaller end less C h^2 / 8.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.families.platforms.platform_segment import PlatformSegment
from cspr_jax.families.platforms.platform_segment_lanes import StateLanes, state
from cspr_jax.families.platforms.six_cable_proof.complex_bounds import instant_beside, middle_of, reach
from cspr_jax.families.platforms.six_cable_proof.work_list import least_nodes
from cspr_jax.motion.limits import limits_set, scales
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.linear.lanes import Vector, dot, largest, materialized, rotated_back, smallest
from cspr_jax.robots.contacts import interference_lanes
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.statics.wrench_lanes import CABLES, CableLanes, cable_lanes
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.limits import Limit

if TYPE_CHECKING:
    from jaxtyping import Float

# Steps of a block, and the instants at their ends.
STEPS = 4
PLACES = np.linspace(-1.0, 1.0, STEPS + 1)
# Lengths and heights may be wrong by this part of the size of coordinates.
POSE_ERROR = 1e-13
TINY = 1e-30


class PlaceBounds(NamedTuple):
    """Bounds and attained values of n blocks.

    Fields:
        clear: (n,) lower bound of the distances between cables that can meet, and of the distances of cables from the
            sectors of their corners, m.
        slacks: (n_criteria, n) lower bounds of the depth below the spools and of the limits on the pose.
        nodes: (n_instants, n_criteria + 1, n) attained slacks at instants a step apart; the smallest distance between
            cables, m. Without margins the least of each: (1, n_criteria + 1, n).
        place: (n,) place of the smallest of the least slacks, from -1 to 1; 0 with margins.
        bends: (3, n) C h^2 / 8, by which motions between two instants may depart from the chord: of the mass centre, m;
            of a point of the platform beside it, over its distance; of vectors as the platform sees them, m.
    """

    clear: Array
    slacks: Array
    nodes: Array
    place: Array
    bends: Array


class _Bends(NamedTuple):
    # Departures (n,) from the chord between two instants, C h^2 / 8: of the centre, m; of an arm of unit length; of
    # vectors seen from the platform, m.
    centre: Array
    arm: Array
    seen: Array


def of_pose(problem: Problem) -> list[Limit]:
    """Rows of the limits on the pose that are set."""
    return [row for row in limits_set(problem.limits) if not row.of_motion]


@persistent_jit(static_argnames=("pairs", "kind", "margins"))
def place_blocks(
    problem: Problem, platform, one: Float[Array, ""], items, *, pairs: tuple, kind: PlatformMotionKind, margins: bool
) -> PlaceBounds:
    """Bounds on blocks."""
    segments, arcs, start, stop = items
    middle, half = middle_of(problem.amplitude, 0.5 * (start + stop)), 0.5 * (stop - start)

    def at(off):
        return state(segments, arcs, instant_beside(middle, segments.sense, arcs, off * half), kind, one)

    bounds = reach(segments, arcs, middle, (half, jnp.zeros_like(half)), kind)
    fraction = (2.0 * half / STEPS) ** 2 / 8.0
    turning = bounds.angular_acceleration + bounds.omega**2
    instant = materialized(instant_beside(middle, segments.sense, arcs, jnp.zeros_like(half)), one)
    current = state(segments, arcs, instant, kind, one)
    position, rotation = materialized((current.position, current.rotation), one)
    away = [
        dot(x, x) for x in ([position[i] - problem.robot.base_points[k, i] for i in range(3)] for k in range(CABLES))
    ]
    seen = (
        turning * (jnp.sqrt(largest(away)) + half * bounds.speed)
        + bounds.second_derivative
        + 2.0 * bounds.omega * bounds.speed
    )
    bends = materialized(_Bends(bounds.second_derivative * fraction, turning * fraction, seen * fraction), one)
    gaps, left = _separators(problem.robot, platform, pairs, (position, rotation), one)

    def on(place):
        pose = at(place)
        cables = cable_lanes(problem.robot, pose.position, pose.rotation)
        apart = _apart(problem.robot, pairs, gaps, cables, bends)
        away = zip(left, interference_lanes.cable_directions(cables, pose.rotation), strict=True)
        clear = jnp.minimum(apart, smallest([dot(e, v) for e, v in away]) - bends.seen)
        values = _slacks(problem, segments, pose, cables)
        if margins and pairs:
            squares = [dot(x, x) for x in interference_lanes.gaps(problem.robot.base_points, pairs, cables)]
            values.append(jnp.sqrt(smallest(squares)))
        # Pack two real numbers into one complex number, so that one loop computes both.
        return lax.complex(clear, values[0]), *values[1:]

    first, *others = lax.map(on, PLACES)
    nodes = [jnp.imag(first), *others]
    if not (margins and pairs):
        nodes.append(jnp.full_like(nodes[0], jnp.inf))
    steps = _steps(problem, segments, bends)
    if margins:
        attained, place = jnp.stack(nodes, axis=1), jnp.zeros_like(half)
    else:
        attained, place = least_nodes(nodes, len(nodes) - 1, PLACES)
    size = jnp.max(jnp.abs(problem.robot.base_points)) + segments.center[:, 2]
    return PlaceBounds(
        jnp.min(jnp.real(first), axis=0) - POSE_ERROR * size,
        jnp.stack([jnp.min(x, axis=0) - step - POSE_ERROR for x, step in zip(nodes[:-1], steps, strict=True)]),
        attained,
        place,
        jnp.stack(bends),
    )


def _separators(robot: PlatformRobot, platform, pairs: tuple, middle, one: Array) -> tuple[list[Vector], list[Vector]]:
    # Find unit vectors between cables, one a pair, and away from sectors, one a cable, by the pose in the middle. All
    # pairs, or cables, are computed at a time, components (m, n) with lanes last: XLA then uses vectors, in little
    # code.
    position, rotation = ([x[None] for x in middle[0]], [[x[None] for x in row] for row in middle[1]])
    points, base = ([x[:, k, None] for k in range(3)] for x in (robot.platform_points, robot.base_points))
    rays = materialized([position[k] + dot(rotation[k], points) - base[k] for k in range(3)], one)
    seen = rotated_back(rotation, [-x for x in rays])
    sides, normal = platform
    first, last = ([sides[:, side, k, None] for k in range(3)] for side in range(2))
    left = _units(interference_lanes.residual((first, last), [normal[k] for k in range(3)], seen))
    if not pairs:
        return [], left
    i, j = (np.array([pair[k] for pair in pairs]) for k in range(2))
    apart = [x[j] - x[i] for x in base]
    return _units(interference_lanes.gap(apart, [x[i] for x in rays], [x[j] for x in rays])), left


def _units(vectors: Vector) -> list[Vector]:
    # Return m unit vectors along vectors with components (m, n).
    scale = 1.0 / jnp.sqrt(jnp.maximum(dot(vectors, vectors), TINY))
    columns = [x * scale for x in vectors]
    return [tuple(x[k] for x in columns) for k in range(columns[0].shape[0])]


def _apart(robot: PlatformRobot, pairs: tuple, gaps: list[Vector], cables: CableLanes, bends: _Bends) -> Array:
    # Return the least over pairs of e . (x_j - x_i) at the ends of both cables, less what may be missed in between.
    if not pairs:
        return jnp.full_like(bends.centre, jnp.inf)
    sizes = jnp.sqrt(jnp.sum(robot.platform_points**2, axis=1))
    values = []
    for (i, j), e in zip(pairs, gaps, strict=True):
        first, last = dot(e, cables.rays[i]), dot(e, cables.rays[j])
        spools = dot(e, [robot.base_points[j, k] - robot.base_points[i, k] for k in range(3)])
        between = jnp.sqrt(jnp.sum((robot.platform_points[i] - robot.platform_points[j]) ** 2))
        values += [
            spools,
            spools + last - bends.centre - sizes[j] * bends.arm,
            spools - first - bends.centre - sizes[i] * bends.arm,
            spools + last - first - between * bends.arm,
        ]
    return smallest(values)


def _slacks(problem: Problem, segments: PlatformSegment, here: StateLanes, cables: CableLanes) -> list[Array]:
    # Return the slacks of the depth below the spools, and of limits on the pose.
    robot, z0 = problem.robot, problem.robot.gravity / segments.rate
    normal = plane_normal(robot)
    values = [dot([normal[i] for i in range(3)], here.position) / z0]
    factor, size = scales(CABLES, robot.mass * robot.gravity, z0)["depth"]
    for row in of_pose(problem):
        limit = getattr(problem.limits, row.name)
        if row.quantity == "depth":
            attached = [ray[2] + robot.base_points[k, 2] for k, ray in enumerate(cables.rays)]
            values.append((limit - largest([here.position[2], *attached])) * factor / size)
        else:
            values.append(smallest([1.0 - jnp.sqrt(dot(ray, ray)) / limit[k] for k, ray in enumerate(cables.rays)]))
    return values


def _steps(problem: Problem, segments: PlatformSegment, bends: _Bends) -> list[Array]:
    # Bound how far the slacks of `_slacks` may fall below their values at two instants; a length is convex along the
    # chord of its ray.
    robot, z0 = problem.robot, problem.robot.gravity / segments.rate
    steps = [jnp.sqrt(jnp.sum(plane_normal(robot) ** 2)) * bends.centre / z0]
    factor, size = scales(CABLES, robot.mass * robot.gravity, z0)["depth"]
    arms = jnp.sqrt(jnp.sum(robot.platform_points**2, axis=1))
    for row in of_pose(problem):
        limit = getattr(problem.limits, row.name)
        if row.quantity == "depth":
            # The mass centre swings in a plane: on level ways it keeps its depth.
            steep = jnp.sqrt(jnp.sum(segments.plane[:, 2] ** 2, axis=1))
            steps.append((steep * bends.centre + jnp.max(arms) * bends.arm) * factor / size)
        else:
            steps.append(largest([(bends.centre + arms[k] * bends.arm) / limit[k] for k in range(CABLES)]))
    return steps
