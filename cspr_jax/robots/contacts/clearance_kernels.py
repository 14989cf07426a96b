"""Compiled functions of `clearance`: the nearest bodies of each kind of contact, one lane a pose.

Each returns one complex number a pose, as `clearance_lanes.nearest` does: the clearance, m, and the index of the
pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.numerics.linear import lanes
from cspr_jax.numerics.linear.lanes import Matrix, Vector
from cspr_jax.numerics.shapes import Complex, Float, Int
from cspr_jax.robots.contacts.clearance_lanes import (
    Polyhedron,
    boxes,
    hull_box,
    nearest,
    point_segment,
    segment_box,
    segment_hull,
    segments,
)

__all__ = [
    "Ball",
    "Brick",
    "Points",
    "Polyhedron",
    "PoseLanes",
    "Rod",
    "of_body",
    "of_cables",
    "of_obstacle",
    "of_platform",
]


class Points(NamedTuple):
    """Geometry of a robot.

    Fields:
        base: (n_cables, 3) m.
        platform: (n_cables, 3) platform axes, m.
        diameters: (n_cables,) m.
    """

    base: Array
    platform: Array
    diameters: Array


class PoseLanes(NamedTuple):
    """Poses as lanes.

    Fields:
        position: three arrays, m.
        quaternion: four arrays of a unit quaternion, scalar first; None: no rotation.
        ends: point at which each cable leaves its spool, three arrays each, m; None: the base points.
    """

    position: Vector
    quaternion: Vector | None
    ends: Sequence[Vector] | None


class Ball(NamedTuple):
    """A sphere.

    Fields:
        centre: (3,) m.
        radius: () m.
    """

    centre: Array
    radius: Array


class Rod(NamedTuple):
    """A cylinder with round ends.

    Fields:
        start: (3,) m.
        ray: (3,) from the start to the end, m.
        radius: () m.
    """

    start: Array
    ray: Array
    radius: Array


class Brick(NamedTuple):
    """A box.

    Fields:
        centre: (3,) m.
        half: (3,) halves of the lengths of its edges, m.
        rotation: (3, 3) axes of the box, one a column.
    """

    centre: Array
    half: Array
    rotation: Array


Solid: TypeAlias = Ball | Rod | Brick
BodyShape: TypeAlias = Brick | Polyhedron


def _three(array: Array) -> Vector:
    return tuple(array[i] for i in range(3))


def _less(a: Vector, b: Vector) -> Vector:
    return tuple(x - y for x, y in zip(a, b, strict=True))


def _rotation(poses: PoseLanes) -> Matrix | None:
    return None if poses.quaternion is None else lanes.rotation_matrix(poses.quaternion)


def _cables(points: Points, poses: PoseLanes) -> tuple[Sequence[Vector], Sequence[Vector]]:
    # Return the points at which cables leave their spools, and the rays from there to the platform.
    rotation, count = _rotation(poses), points.base.shape[0]
    arms = [_three(points.platform[k]) for k in range(count)]
    if rotation is not None:
        arms = [lanes.rotated(rotation, arm) for arm in arms]
    ends = [_three(points.base[k]) for k in range(count)] if poses.ends is None else list(poses.ends)
    return ends, [tuple(poses.position[i] + arms[k][i] - ends[k][i] for i in range(3)) for k in range(count)]


def of_cables(points: Points, poses: PoseLanes, pairs: Int[np.ndarray, "n_pairs 2"]) -> Complex[Array, "n"]:
    """The nearest two cables."""
    return _nearest_pair(points, *_lines(points, poses), pairs)


@jax.jit
def _lines(points: Points, poses: PoseLanes) -> tuple[list[Array] | None, list[Array]]:
    # Return the points at which cables leave their spools, None if these are fixed, and the rays from there to the
    # platform, components (n_cables, n); a loop over values that its own compiled call has stored would be slow.
    if poses.ends is not None:
        ends, rays = _cables(points, poses)
        return [jnp.stack([end[i] for end in ends]) for i in range(3)], [
            jnp.stack([ray[i] for ray in rays]) for i in range(3)
        ]
    shape = points.base.shape[0], len(poses.position[0])
    arms = [jnp.broadcast_to(points.platform[:, i, None], shape) for i in range(3)]
    rotation = _rotation(poses)
    if rotation is not None:
        arms = list(lanes.rotated([[jnp.broadcast_to(x[None], shape) for x in row] for row in rotation], arms))
    return None, [poses.position[i][None] + arms[i] - points.base[:, i, None] for i in range(3)]


@jax.jit
def _nearest_pair(points: Points, starts: list[Array] | None, rays: list[Array], pairs: Array) -> Array:
    template = rays[0][0]

    def line(k):
        ends = [jnp.broadcast_to(points.base[k, i], template.shape) for i in range(3)]
        return ends if starts is None else [x[k] for x in starts], [x[k] for x in rays]

    def step(best, pair):
        (i, j), index = pair
        thick = 0.5 * (points.diameters[i] + points.diameters[j])
        distance = segments(*line(i), *line(j)) - thick
        # Keep the first of equal distances, and keep NaN, as `clearance_lanes.nearest` does.
        is_kept = jnp.isnan(jnp.real(best)) | (distance >= jnp.real(best))
        return jnp.where(is_kept, best, lax.complex(distance, jnp.full_like(distance, index))), None

    far = jnp.full_like(template, jnp.inf)
    start = lax.complex(far, jnp.zeros_like(far))
    return lax.scan(step, start, (pairs, jnp.arange(len(pairs), dtype=template.dtype)))[0]


@jax.jit
def of_obstacle(points: Points, poses: PoseLanes, solid: Solid) -> Complex[Array, "n"]:
    """The cable nearest to an obstacle."""
    ends, rays = _cables(points, poses)
    gaps = []
    for k, (end, ray) in enumerate(zip(ends, rays, strict=True)):
        if isinstance(solid, Ball):
            distance = point_segment(_three(solid.centre), end, ray) - solid.radius
        elif isinstance(solid, Rod):
            distance = segments(_three(solid.start), _three(solid.ray), end, ray) - solid.radius
        else:
            distance = segment_box(*_in_brick(solid, end, ray), _three(solid.half))
        gaps.append(distance - 0.5 * points.diameters[k])
    return nearest(gaps)


def _in_brick(brick: Brick, start: Vector, ray: Vector) -> tuple[Vector, Vector]:
    # Transform a segment to the axes of a box, with the box's centre as origin.
    axes = [_three(row) for row in brick.rotation]
    return lanes.rotated_back(axes, _less(start, _three(brick.centre))), lanes.rotated_back(axes, ray)


@jax.jit
def of_platform(points: Points, poses: PoseLanes, body: BodyShape, leave: Float[Array, ""]) -> Complex[Array, "n"]:
    """The cable nearest to the platform."""
    rotation, gaps = _rotation(poses), []
    _, rays = _cables(points, poses)
    for k, ray in enumerate(rays):
        away = tuple(-x for x in _inward(rotation, ray))
        length = jnp.sqrt(lanes.dot(away, away))
        # A cable shorter than the part that is left out shrinks to the point at its spool.
        part = jnp.where(length > leave, leave / jnp.where(length > leave, length, 1.0), 1.0)
        start = tuple(x + part * y for x, y in zip(_three(points.platform[k]), away, strict=True))
        rest = tuple((1.0 - part) * x for x in away)
        gaps.append(_from_body(body, start, rest) - 0.5 * points.diameters[k])
    return nearest(gaps)


def _from_body(body: BodyShape, start: Vector, ray: Vector) -> Array:
    if isinstance(body, Brick):
        return segment_box(*_in_brick(body, start, ray), _three(body.half))
    return segment_hull(start, ray, body)


@jax.jit
def of_body(poses: PoseLanes, body: BodyShape, solid: Ball | Rod) -> Complex[Array, "n"]:
    """Clearance of the platform from a sphere or a cylinder."""
    zero, rotation = jnp.zeros_like(poses.position[0]), _rotation(poses)
    rod = Rod(solid.centre, jnp.zeros_like(solid.centre), solid.radius) if isinstance(solid, Ball) else solid
    start = _inward(rotation, _less(_three(rod.start), poses.position))
    ray = _inward(rotation, [zero + x for x in _three(rod.ray)])
    return nearest([_from_body(body, start, ray) - rod.radius])


@jax.jit
def of_boxes(poses: PoseLanes, body: Brick, solid: Brick) -> Complex[Array, "n"]:
    """Clearance of a platform that is a box from another box: the largest gap between their projections on a line."""
    zero, rotation = jnp.zeros_like(poses.position[0]), _rotation(poses)
    axes = [_three(row) for row in body.rotation]
    edges = [lanes.rotated_back(axes, _inward(rotation, _three(column))) for column in solid.rotation.T]
    away = _inward(rotation, _less(_three(solid.centre), poses.position))
    centre, _ = _in_brick(body, away, [zero, zero, zero])
    return nearest([boxes(_three(body.half), centre, [tuple(zero + x for x in e) for e in edges], _three(solid.half))])


@jax.jit
def of_hull_box(poses: PoseLanes, body: Polyhedron, solid: Brick) -> Complex[Array, "n"]:
    """Clearance of a polyhedral platform from a box: the largest gap between their projections on a line."""
    zero, rotation = jnp.zeros_like(poses.position[0]), _rotation(poses)
    edges = [tuple(zero + x for x in _inward(rotation, _three(column))) for column in solid.rotation.T]
    centre = _inward(rotation, _less(_three(solid.centre), poses.position))
    return nearest([hull_box(body, centre, edges, _three(solid.half))])


def _inward(rotation: Matrix | None, vector: Vector) -> Vector:
    return vector if rotation is None else lanes.rotated_back(rotation, vector)
