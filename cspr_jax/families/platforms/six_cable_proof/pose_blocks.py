"""Bounds of contacts, depth and limits on the pose over blocks of motions; these depend on a platform's pose alone.

Two cables do not touch if some unit vector e has e . (x_j - x_i) > 0 for all points x of both; as this is linear in the
points, the ends of the cables are enough. A cable does not touch the platform if its vector v from its corner, in
platform axes, has e . v > 0 for a unit vector e of the polar cone of the corner's sector. Any e is valid on a full
block; here e is that of the middle: along the shortest vector between the cables, or along the residual of the
projection of the cable onto the sector (Moreau). Between times at a distance h a function f with |f''| <= C stays above
its smaller end value less C h^2 / 8.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.families.platforms.platform_segment import PlatformSegment
from cspr_jax.families.platforms.platform_segment_lanes import StateLanes, state
from cspr_jax.families.platforms.six_cable_proof.complex_bounds import ellipse_bounds, middle_of, phase_beside
from cspr_jax.families.platforms.six_cable_proof.work_list import smallest_nodes
from cspr_jax.motion.limits import limits_set, scales
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.linear.lanes import Vector, dot, largest, materialized, rotated_back, smallest
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts import interference_lanes
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.statics.wrench_lanes import CABLES, CableLanes, cable_lanes
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.limits import Limit

# Number of steps of a block, and the times at their ends, from -1 to 1.
STEPS = 4
OFFSETS = np.linspace(-1.0, 1.0, STEPS + 1)
# Rounding error of lengths and heights over the largest coordinate.
POSE_ERROR = 1e-13
TINY = 1e-30


class PoseBounds(NamedTuple):
    """Bounds and attained values of n blocks.

    Fields:
        clear: (n,) lower bound of the distances between cables that can touch, and of the distances of cables from the
            sectors of their corners, m.
        slacks: (n_criteria, n) lower bounds of the depth below the spools and of the limits on the pose.
        nodes: (n_instants, n_criteria + 1, n) attained slacks at the ends of steps, then the smallest distance between
            cables, m. Without margins only the minimum of each: (1, n_criteria + 1, n).
        offset: (n,) time in the block at which the smallest of these slacks is, from -1 to 1; 0 with margins.
        deviations: (3, n) bounds C h^2 / 8 of deviations from the chord between two times: of the mass centre, m; of a
            point of the platform, over its distance from the mass centre; of vectors in platform axes, m.
    """

    clear: Array
    slacks: Array
    nodes: Array
    offset: Array
    deviations: Array


class _Deviations(NamedTuple):
    # Deviations (n,) from the chord between two times, C h^2 / 8: of the centre, m; of an arm of unit length; of
    # vectors in platform axes, m.
    centre: Array
    arm: Array
    seen: Array


def of_pose(problem: Problem) -> list[Limit]:
    """The limits on the pose that are given."""
    return [limit for limit in limits_set(problem.limits) if not limit.of_motion]


@persistent_jit(static_argnames=("pairs", "kind", "margins"))
def pose_blocks(
    problem: Problem, platform, one: Float[Array, ""], items, *, pairs: tuple, kind: PlatformMotionKind, margins: bool
) -> PoseBounds:
    """Bounds of all criteria of the pose on blocks."""
    segments, arcs, start, stop = items
    middle, half = middle_of(problem.amplitude, 0.5 * (start + stop)), 0.5 * (stop - start)

    def at(off):
        return state(segments, arcs, phase_beside(middle, segments.sense, arcs, off * half), kind, one)

    bounds = ellipse_bounds(segments, arcs, middle, (half, jnp.zeros_like(half)), kind)
    fraction = (2.0 * half / STEPS) ** 2 / 8.0
    turning = bounds.angular_acceleration + bounds.omega**2
    phase = materialized(phase_beside(middle, segments.sense, arcs, jnp.zeros_like(half)), one)
    current = state(segments, arcs, phase, kind, one)
    position, rotation = materialized((current.position, current.rotation), one)
    away = [
        dot(x, x) for x in ([position[i] - problem.robot.base_points[k, i] for i in range(3)] for k in range(CABLES))
    ]
    seen = (
        turning * (jnp.sqrt(largest(away)) + half * bounds.speed)
        + bounds.second_derivative
        + 2.0 * bounds.omega * bounds.speed
    )
    deviations = materialized(
        _Deviations(bounds.second_derivative * fraction, turning * fraction, seen * fraction), one
    )
    gaps, left = _separators(problem.robot, platform, pairs, (position, rotation), one)

    def on(offset):
        pose = at(offset)
        cables = cable_lanes(problem.robot, pose.position, pose.rotation)
        separation = _separation(problem.robot, pairs, gaps, cables, deviations)
        away = zip(left, interference_lanes.cable_directions(cables, pose.rotation), strict=True)
        clear = jnp.minimum(separation, smallest([dot(e, v) for e, v in away]) - deviations.seen)
        values = _slacks(problem, segments, pose, cables)
        if margins and pairs:
            squares = [dot(x, x) for x in interference_lanes.gaps(problem.robot.base_points, pairs, cables)]
            values.append(jnp.sqrt(smallest(squares)))
        # Pack two real numbers into a complex number, so that one loop computes both.
        return lax.complex(clear, values[0]), *values[1:]

    first, *others = lax.map(on, OFFSETS)
    nodes = [jnp.imag(first), *others]
    if not (margins and pairs):
        nodes.append(jnp.full_like(nodes[0], jnp.inf))
    steps = _steps(problem, segments, deviations)
    if margins:
        attained, offset = jnp.stack(nodes, axis=1), jnp.zeros_like(half)
    else:
        attained, offset = smallest_nodes(nodes, len(nodes) - 1, OFFSETS)
    extent = maximum_of(jnp.abs(problem.robot.base_points)) + segments.center[:, 2]
    return PoseBounds(
        minimum_of(jnp.real(first), axis=0) - POSE_ERROR * extent,
        jnp.stack([minimum_of(x, axis=0) - step - POSE_ERROR for x, step in zip(nodes[:-1], steps, strict=True)]),
        attained,
        offset,
        jnp.stack(deviations),
    )


def _separators(robot: PlatformRobot, platform, pairs: tuple, middle, one: Array) -> tuple[list[Vector], list[Vector]]:
    # Find a unit vector for each pair of cables, and one away from the sector for each cable, from the pose in the
    # middle. All pairs, or cables, are computed together, with components (m, n) and lanes last: so XLA uses vectors,
    # with little code.
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
    between = [x[j] - x[i] for x in base]
    return _units(interference_lanes.gap(between, [x[i] for x in rays], [x[j] for x in rays])), left


def _units(vectors: Vector) -> list[Vector]:
    # Return the unit vectors along m vectors with components (m, n).
    scale = 1.0 / jnp.sqrt(jnp.maximum(dot(vectors, vectors), TINY))
    columns = [x * scale for x in vectors]
    return [tuple(x[k] for x in columns) for k in range(columns[0].shape[0])]


def _separation(
    robot: PlatformRobot, pairs: tuple, gaps: list[Vector], cables: CableLanes, deviations: _Deviations
) -> Array:
    # Return the minimum over pairs of e . (x_j - x_i) at the ends of both cables, less the deviation between two times.
    if not pairs:
        return jnp.full_like(deviations.centre, jnp.inf)
    arms = jnp.sqrt(jnp.sum(robot.platform_points**2, axis=1))
    values = []
    for (i, j), e in zip(pairs, gaps, strict=True):
        first, last = dot(e, cables.rays[i]), dot(e, cables.rays[j])
        spools = dot(e, [robot.base_points[j, k] - robot.base_points[i, k] for k in range(3)])
        between = jnp.sqrt(jnp.sum((robot.platform_points[i] - robot.platform_points[j]) ** 2))
        values += [
            spools,
            spools + last - deviations.centre - arms[j] * deviations.arm,
            spools - first - deviations.centre - arms[i] * deviations.arm,
            spools + last - first - between * deviations.arm,
        ]
    return smallest(values)


def _slacks(problem: Problem, segments: PlatformSegment, current: StateLanes, cables: CableLanes) -> list[Array]:
    # Return the slacks of the depth below the spools, and of limits on the pose.
    robot, z0 = problem.robot, problem.robot.gravity / segments.rate
    normal = plane_normal(robot)
    values = [dot([normal[i] for i in range(3)], current.position) / z0]
    factor, unit = scales(CABLES, robot.mass * robot.gravity, z0)["depth"]
    for limit in of_pose(problem):
        allowed = getattr(problem.limits, limit.name)
        if limit.quantity == "depth":
            attached = [ray[2] + robot.base_points[k, 2] for k, ray in enumerate(cables.rays)]
            values.append((allowed - largest([current.position[2], *attached])) * factor / unit)
        else:
            values.append(smallest([1.0 - jnp.sqrt(dot(ray, ray)) / allowed[k] for k, ray in enumerate(cables.rays)]))
    return values


def _steps(problem: Problem, segments: PlatformSegment, deviations: _Deviations) -> list[Array]:
    # Bound how far the slacks of `_slacks` may fall below their values at two times; a length is convex along the chord
    # of its ray.
    robot, z0 = problem.robot, problem.robot.gravity / segments.rate
    steps = [jnp.sqrt(jnp.sum(plane_normal(robot) ** 2)) * deviations.centre / z0]
    factor, unit = scales(CABLES, robot.mass * robot.gravity, z0)["depth"]
    arms = jnp.sqrt(jnp.sum(robot.platform_points**2, axis=1))
    for limit in of_pose(problem):
        allowed = getattr(problem.limits, limit.name)
        if limit.quantity == "depth":
            # The mass centre oscillates in a plane: on level paths its depth is constant.
            steep = jnp.sqrt(jnp.sum(segments.plane[:, 2] ** 2, axis=1))
            steps.append((steep * deviations.centre + maximum_of(arms) * deviations.arm) * factor / unit)
        else:
            steps.append(largest([(deviations.centre + arms[k] * deviations.arm) / allowed[k] for k in range(CABLES)]))
    return steps
