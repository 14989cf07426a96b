"""Gaps between moving convex bodies over a block of time: bounds, from affine bounds of their corners.

For a direction n and all corners a and b of two bodies, the smallest n . (b - a) / |n| is a lower bound of their signed
distance (the distance of separated bodies, or minus the smallest translation that separates overlapping ones). The
direction is that between the nearest points in the middle of the block and turns at the rate that it has there,
n(s) = e + s e', so that the error of the bound decreases with the square of the length of the block. Any direction
gives a valid bound, so n needs no bounds itself. The upper bound is the distance between two fixed points of the
bodies, the nearest ones in the middle; for overlapping bodies, minus the depth of a point of one below all faces of the
other.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, dot, norm_squared
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts.interference import nearest

# Edges whose angle has a smaller squared sine count as parallel, since their common normal would be inaccurate.
PARALLEL_SQUARE = 1e-8
TINY = 1e-200
DISTANCE_ERROR = 1e-14


class Solid(NamedTuple):
    """Convex body.

    Fields:
        corners: bounds (m, 3), m.
        edges: (n_edges, 2) indices of corners.
        faces: (n_faces, 3) corners of triangles, counterclockwise as seen from outside; (0, 3) of a segment.
    """

    corners: Any
    edges: Any
    faces: Any


class FacePlanes(NamedTuple):
    """Planes of the faces of a body that does not move.

    Fields:
        normals: (n_faces, 3) outward unit normals.
        offsets: (n_faces,) products of the normals with points of their planes, m.
    """

    normals: Any
    offsets: Any


class Features(NamedTuple):
    """The nearest features of two bodies.

    Fields:
        bodies: edges and faces of the two bodies.
        kind: 0: two edges; 1: a corner of the first and a face of the second; 2: a face of the first and a corner.
        first: index of the edge, corner or face of the first body.
        second: index of the edge, corner or face of the second body.
    """

    bodies: tuple[Solid, Solid]
    kind: Any
    first: Any
    second: Any

    def nearest_on_edges(self, p: Float[Array, "m 3"], q: Float[Array, "k 3"]) -> tuple[list[Array], Array, Array]:
        """Corners of the two nearest edges, and the nearest points as fractions of these edges."""
        edges = [
            body.edges[0] if len(body.edges) == 1 else jnp.asarray(body.edges)[jnp.minimum(k, len(body.edges) - 1)]
            for body, k in zip(self.bodies, (self.first, self.second), strict=True)
        ]
        return edges, *nearest(*_ends(p, edges[0]), *_ends(q, edges[1]))


SEGMENT = np.array([[0, 1]]), np.zeros((0, 3), int)
_CORNERS = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
# Corners of boxes in the order of `box_corners`; their edges, and their faces in two triangles each.
BOX_SIGNS = 2.0 * _CORNERS - 1.0
BOX = (
    np.array([[i, j] for i in range(8) for j in range(i) if np.abs(_CORNERS[i] - _CORNERS[j]).sum() == 1]),
    np.reshape(
        [0, 1, 3, 0, 3, 2, 4, 7, 5, 4, 6, 7, 0, 5, 1, 0, 4, 5, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 7, 3, 1, 5, 7],
        (-1, 3),
    ),
)


def clearance_bounds(first: Solid, second: Solid) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Bounds of the distance of two bodies."""
    corners = first.corners.middle, second.corners.middle
    features = nearest_features(*corners, first, second)
    line = turning(partial(parting_direction, features), first.corners, second.corners)
    between = second.corners.each(lambda x: x[None]) - first.corners.each(lambda x: x[:, None])
    low = along(line, between.each(lambda x: x.reshape(-1, 3)))
    point, other = (
        dot(body.corners.each(jnp.transpose), weights[None])
        for body, weights in zip((first, second), nearest_weights(features, *corners), strict=True)
    )
    return low, distance_bound(point, other)


def turning(direction: Callable[..., Array], *points: AffineBounds) -> AffineBounds:
    """A direction that turns at a constant rate; value and rate are those of a function of points in the middle."""
    middles, derivatives = (tuple(getattr(x, name) for x in points) for name in ("middle", "linear"))
    middle, turn = jax.jvp(direction, middles, derivatives)
    return AffineBounds(middle, jnp.where(jnp.sum(turn**2) <= 1.0, turn, 0.0), jnp.zeros_like(middle))


def along(line: AffineBounds, vectors: AffineBounds) -> Float[Array, ""]:
    """Smallest component of vectors along a turning direction."""
    middle, turn = line.middle, line.linear
    low = minimum_of(dot(line.each(lambda x: x[None]), vectors).low())
    length = jnp.sqrt(jnp.dot(middle, middle) + jnp.dot(turn, turn) + 2.0 * jnp.abs(jnp.dot(middle, turn)))
    return jnp.where(low > 0.0, low * (1.0 - DISTANCE_ERROR) / length, -jnp.inf)


def distance_bound(first: AffineBounds, second: AffineBounds) -> Float[Array, ""]:
    """Largest distance of two points."""
    return jnp.sqrt(norm_squared(second - first).high()) * (1.0 + DISTANCE_ERROR)


def depth_bound(body: Solid, planes: FacePlanes) -> Float[Array, ""]:
    """Upper bound of the signed distance of a body from a fixed one, by the depths of points of its edges."""
    start, end = (body.corners.each(lambda x, k=k: x[body.edges[:, k]]) for k in range(2))
    part = inner_fractions(start.middle, end.middle, planes)[:, None]
    points = start * (1.0 - part) + end * part
    heights = dot(points.each(lambda x: x[:, None]), planes.normals[None]) - planes.offsets[None]
    minimum = minimum_of(maximum_of(heights.high(), axis=1))
    return jnp.where(minimum < 0.0, minimum, jnp.inf)


def inner_fractions(
    start: Float[Array, "n_edges 3"], end: Float[Array, "n_edges 3"], planes: FacePlanes
) -> Float[Array, "n_edges"]:
    """Midpoints, as fractions of edges, of the parts of edges that are behind all planes."""
    high, low = (points @ planes.normals.T - planes.offsets[None] for points in (start, end))
    meet = high / jnp.where(high == low, 1.0, high - low)
    first = maximum_of(jnp.where(low < high, meet, 0.0), axis=1)
    last = minimum_of(jnp.where(low > high, meet, 1.0), axis=1)
    return jnp.clip(0.5 * (jnp.clip(first, 0.0, 1.0) + jnp.clip(last, 0.0, 1.0)), 0.0, 1.0)


def _ends(corners: Array, edges: Any) -> tuple[Array, Array]:
    # Starts and rays of edges.
    start = corners[edges[..., 0]]
    return start, corners[edges[..., 1]] - start


def _over(points: Array, corners: Array, faces: Any) -> Array:
    # Heights of points (m, 3) over faces, (m, n_faces); infinite where they are not above the triangle.
    points, (a, b, c) = points[:, None], (corners[faces[:, k]][None] for k in range(3))
    normals = _normal(a, b, c)
    height = jnp.sum((points - a) * normals, axis=2)
    # A triangle without an area has no normal.
    is_above = (height >= 0.0) & (jnp.sum(normals**2, axis=2) > 0.5)
    for start, end in ((a, b), (b, c), (c, a)):
        is_above &= jnp.sum(jnp.cross(end - start, points - start) * normals, axis=2) >= 0.0
    return jnp.where(is_above, height, jnp.inf)


def _normal(a: Array, b: Array, c: Array) -> Array:
    return _unit(jnp.cross(b - a, c - a))


def _unit(vectors: Array) -> Array:
    return vectors / jnp.sqrt(jnp.maximum(jnp.sum(vectors**2, axis=-1, keepdims=True), TINY))


def nearest_features(p: Float[Array, "m 3"], q: Float[Array, "k 3"], first: Solid, second: Solid) -> Features:
    """Find the nearest features of two bodies."""
    if len(first.edges) == len(second.edges) == 1:
        return Features((first, second), 0, 0, 0)
    (a, u), (b, v) = _ends(p, first.edges), _ends(q, second.edges)
    a, u, b, v = a[:, None], u[:, None], b[None], v[None]
    s, t = nearest(a, u, b, v)
    gap = b + t[..., None] * v - a - s[..., None] * u
    parts = [jnp.sum(gap**2, axis=2)]
    if len(second.faces):
        parts.append(_over(p, q, second.faces) ** 2)
    if len(first.faces):
        parts.append(_over(q, p, first.faces).T ** 2)
    indices = [jnp.argmin(part) for part in parts]
    minimum = jnp.stack([part.reshape(-1)[index] for part, index in zip(parts, indices, strict=True)])
    best = jnp.argmin(minimum)
    numbers = [
        jnp.stack([index // part.shape[1], index % part.shape[1]]) for part, index in zip(parts, indices, strict=True)
    ]
    kinds = jnp.asarray([0] + [1] * bool(len(second.faces)) + [2] * bool(len(first.faces)))
    return Features((first, second), kinds[best], *jnp.stack(numbers)[best])


def parting_direction(features: Features, p: Float[Array, "m 3"], q: Float[Array, "k 3"]) -> Float[Array, "3"]:
    """Direction from the first body to the second along the shortest line between them."""
    (first, second), (edges, s, t) = features.bodies, features.nearest_on_edges(p, q)
    (a, u), (b, v) = _ends(p, edges[0]), _ends(q, edges[1])
    gap, normal = b + t * v - a - s * u, jnp.cross(u, v)
    inside = (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0)
    inside &= jnp.dot(normal, normal) > PARALLEL_SQUARE * jnp.dot(u, u) * jnp.dot(v, v)
    # The common normal of two edges is accurate even if they nearly touch, if both nearest points are inside of them.
    gap = jnp.where(inside, jnp.where(jnp.dot(normal, gap) < 0.0, -normal, normal), gap)
    direction = _unit(gap)
    for kind, corners, body, face, sign in (
        (1, q, second, features.second, -1.0),
        (2, p, first, features.first, 1.0),
    ):
        if len(body.faces):
            corner = jnp.asarray(body.faces)[jnp.minimum(face, len(body.faces) - 1)]
            direction = jnp.where(
                features.kind == kind, sign * _normal(*(corners[corner[k]] for k in range(3))), direction
            )
    return direction


def nearest_weights(
    features: Features, p: Float[Array, "m 3"], q: Float[Array, "k 3"]
) -> tuple[Float[Array, "m"], Float[Array, "k"]]:
    """Weights of the corners in the nearest points."""
    (first, second), (edges, s, t) = features.bodies, features.nearest_on_edges(p, q)

    def spread(count: int, corners: Array, fractions: list[Array]) -> Array:
        parts = (jnp.where(jnp.arange(count) == corners[k], part, 0.0) for k, part in enumerate(fractions))
        return sum(parts, start=jnp.zeros(count))

    def on_edge(count: int, edge: Array, part: Array) -> Array:
        return spread(count, edge, [1.0 - part, part])

    def on_face(corners: Array, faces: Any, face: Array, point: Array) -> Array:
        corner = jnp.asarray(faces)[jnp.minimum(face, len(faces) - 1)]
        a, b, c = (corners[corner[k]] for k in range(3))
        normal = jnp.cross(b - a, c - a)
        square = jnp.maximum(jnp.dot(normal, normal), TINY)
        second = jnp.clip(jnp.dot(jnp.cross(point - a, c - a), normal) / square, 0.0, 1.0)
        third = jnp.clip(jnp.dot(jnp.cross(b - a, point - a), normal) / square, 0.0, 1.0 - second)
        return spread(len(corners), corner, [1.0 - second - third, second, third])

    def at_corner(count: int, corner: Array) -> Array:
        return jnp.where(jnp.arange(count) == corner, 1.0, 0.0)

    of_first, of_second = on_edge(len(p), edges[0], s), on_edge(len(q), edges[1], t)
    if len(second.faces):
        is_this = features.kind == 1
        of_first = jnp.where(is_this, at_corner(len(p), features.first), of_first)
        point = p[jnp.minimum(features.first, len(p) - 1)]
        of_second = jnp.where(is_this, on_face(q, second.faces, features.second, point), of_second)
    if len(first.faces):
        is_this = features.kind == 2
        point = q[jnp.minimum(features.second, len(q) - 1)]
        of_first = jnp.where(is_this, on_face(p, first.faces, features.first, point), of_first)
        of_second = jnp.where(is_this, at_corner(len(q), features.second), of_second)
    return of_first, of_second
