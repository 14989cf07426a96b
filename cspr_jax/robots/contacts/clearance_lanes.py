"""Signed distances of cables from each other and from solid shapes, one lane a pose, without branches.

Cables are segments without thickness in this module; callers subtract half the diameter. Finite ends never give NaN.
Every formula is exact outside of the shape. Terms that vanish for parallel segments are computed from vector products,
not from differences of squares, so that their rounding errors decrease with the angle and distances keep their digits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.numerics.elementary import nan_ignoring_min
from cspr_jax.numerics.linear.lanes import Vector, cross, dot
from cspr_jax.numerics.shapes import Complex, Float

Numbers = Sequence[Array]


def _tiny(template: Array) -> Array:
    # A number that is negligible in a sum of squares, but prevents 0 / 0.
    return jnp.asarray(np.finfo(template.dtype).tiny, template.dtype)


def _greater(a: Array, b: Array) -> Array:
    return jnp.where(a > b, a, b)


def _fraction(x: Array) -> Array:
    # Clip to [0, 1] by one instruction each; `jnp.clip` would propagate NaN, which appears in the distance anyway.
    return nan_ignoring_min(_greater(x, jnp.zeros_like(x)), jnp.ones_like(x))


def _less(a: Vector, b: Vector) -> Vector:
    return tuple(x - y for x, y in zip(a, b, strict=True))


def _along(start: Vector, ray: Vector, part: Array) -> Vector:
    return tuple(x + part * y for x, y in zip(start, ray, strict=True))


def segments(a: Vector, u: Vector, b: Vector, v: Vector) -> Float[Array, "..."]:
    """Distance of two segments."""
    # Find the nearest points of the lines, then clip each to its segment: the last two steps are exact where one point
    # is an end, and for parallel lines from any point found in the first step.
    offset, normal = _less(b, a), cross(u, v)
    uu, vv, uv, tiny = dot(u, u), dot(v, v), dot(u, v), _tiny(offset[0] * u[0])
    s = _fraction(dot(cross(offset, v), normal) / _greater(dot(normal, normal), tiny))
    t = _fraction((s * uv - dot(offset, v)) / _greater(vv, tiny))
    s = _fraction((dot(offset, u) + t * uv) / _greater(uu, tiny))
    between = tuple(offset[k] + t * v[k] - s * u[k] for k in range(3))
    return jnp.sqrt(dot(between, between))


def point_segment(point: Vector, a: Vector, u: Vector) -> Float[Array, "..."]:
    """Distance of a point from a segment."""
    offset = _less(point, a)
    s = _fraction(dot(offset, u) / _greater(dot(u, u), _tiny(offset[0] * u[0])))
    between = tuple(offset[k] - s * u[k] for k in range(3))
    return jnp.sqrt(dot(between, between))


def segment_box(a: Vector, u: Vector, half: Numbers) -> Float[Array, "..."]:
    """Signed distance of a segment from a box around the origin, in its axes."""
    gap = _parting(a, u, half)
    return jnp.where(gap > 0.0, _outside_box(a, u, half), gap)


def _outside_box(a: Vector, u: Vector, half: Numbers) -> Array:
    """Distance of a segment from a box.

    Half the derivative of the squared distance increases along the segment, and is linear between the six planes of the
    faces. It vanishes between the last plane (or end) at which it is not positive and the first at which it is not
    negative.
    """

    def derivative(part):
        beyond = _beyond(_along(a, u, part), half)
        return dot(beyond, u)

    zero, one = jnp.zeros_like(a[0] + u[0]), jnp.ones_like(a[0] + u[0])
    start, stop, at_start, at_stop = zero, one, derivative(zero), derivative(one)
    is_first, is_last = at_start >= 0.0, at_stop <= 0.0
    for k in range(3):
        # A segment parallel to a plane does not cross it: any point will do.
        inverse = 1.0 / jnp.where(u[k] == 0.0, jnp.ones_like(u[k]), u[k])
        for side in (-half[k], half[k]):
            part = _fraction((side - a[k]) * inverse)
            value = derivative(part)
            later, sooner = (value <= 0.0) & (part >= start), (value >= 0.0) & (part <= stop)
            start, at_start = jnp.where(later, part, start), jnp.where(later, value, at_start)
            stop, at_stop = jnp.where(sooner, part, stop), jnp.where(sooner, value, at_stop)
    steep = at_stop - at_start
    part = start - at_start * (stop - start) / jnp.where(steep > 0.0, steep, one)
    part = jnp.where(is_first, zero, jnp.where(is_last, one, _fraction(part)))
    # Try both planes too: where rounding errors dominate the derivative at one of them, that point is the nearer one.
    first, *others = (_beyond(_along(a, u, fraction), half) for fraction in (part, start, stop))
    minimum = dot(first, first)
    for beyond in others:
        minimum = nan_ignoring_min(dot(beyond, beyond), minimum)
    return jnp.sqrt(minimum)


def _beyond(point: Vector, half: Numbers) -> Vector:
    # Return the vector to a point from the nearest point of the box.
    return tuple(x - _greater(nan_ignoring_min(x, h), -h) for x, h in zip(point, half, strict=True))


def _parting(a: Vector, u: Vector, half: Numbers) -> Array:
    """Largest gap between the projections of a segment and a box on a line: not positive where they meet.

    The lines are normal to a face of the box, or to the segment and an edge of the box: these are the normals of the
    Minkowski sum of both shapes, so that a negative gap is minus the smallest translation that separates the shapes.
    """
    w = tuple(0.5 * x for x in u)
    c = tuple(x + y for x, y in zip(a, w, strict=True))
    extent = tuple(jnp.abs(x) for x in w)
    gap = jnp.abs(c[0]) - (half[0] + extent[0])
    for k in (1, 2):
        gap = _greater(jnp.abs(c[k]) - (half[k] + extent[k]), gap)
    for i, j in ((1, 2), (2, 0), (0, 1)):
        square = w[i] * w[i] + w[j] * w[j]
        shadow = jnp.abs(c[i] * w[j] - c[j] * w[i]) - (half[i] * extent[j] + half[j] * extent[i])
        across = shadow / jnp.sqrt(_greater(square, _tiny(square)))
        # A segment parallel to the edge has no normal common to both.
        gap = jnp.where((square > _tiny(square)) & (across > gap), across, gap)
    return gap


def nearest(values: Sequence[Array]) -> Complex[Array, "..."]:
    """The smallest of several arrays and its index, as one complex number, since XLA computes two outputs twice."""
    minimum, index = values[0], jnp.zeros_like(values[0])
    for k, value in enumerate(values[1:], 1):
        is_less = value < minimum
        minimum, index = jnp.where(is_less, value, minimum), jnp.where(is_less, np.asarray(k, value.dtype), index)
    return lax.complex(minimum, index)


class Polyhedron(NamedTuple):
    """A `robots.model.shapes.Hull` for compiled code.

    Fields:
        normals: (n_faces, 3).
        offsets: (n_faces,) m.
        triangles: (n_faces, 3, 3) m.
        edges: (n_edges, 2, 3) m.
        sides: (n_edges, 2, 3).
    """

    normals: Array
    offsets: Array
    triangles: Array
    edges: Array
    sides: Array


def segment_hull(a: Vector, u: Vector, hull: Polyhedron) -> Float[Array, "..."]:
    """Signed distance of a segment from a convex polyhedron, in its axes."""
    zero = jnp.zeros_like(a[0] + u[0])
    count = len(hull.offsets)

    def clip(face, ends):
        high, rate = _of_face(hull, face, a, u)
        meet = -high / jnp.where(rate == 0.0, jnp.ones_like(rate), rate)
        # A segment parallel to a face lies entirely on one side of the face's plane.
        first = jnp.where(rate < 0.0, _greater(meet, ends[0]), ends[0])
        last = jnp.where(rate > 0.0, nan_ignoring_min(meet, ends[1]), ends[1])
        return first, jnp.where((rate == 0.0) & (high > 0.0), -jnp.ones_like(last), last)

    first, last = lax.fori_loop(0, count, clip, (zero, jnp.ones_like(zero)))
    middle = _fraction(0.5 * (first + last))

    def deeper(face, depth):
        high, rate = _of_face(hull, face, a, u)
        return _greater(high + rate * middle, depth)

    depth = lax.fori_loop(0, count, deeper, jnp.full_like(zero, -jnp.inf))
    return jnp.where((first <= last) & (depth < 0.0), depth, _outside_hull(a, u, hull))


def _of_face(hull: Polyhedron, face: Array, a: Vector, u: Vector) -> tuple[Array, Array]:
    # Height of the start above the plane of a face, and its rate of change along the segment.
    normal, corner = hull.normals[face], hull.triangles[face, 0]
    three = [normal[k] for k in range(3)]
    return dot(three, [a[k] - corner[k] for k in range(3)]), dot(three, u)


def _outside_hull(a: Vector, u: Vector, hull: Polyhedron) -> Array:
    """Distance of a segment from a polyhedron that it does not enter: from an edge, or of an end from a face."""

    def to_edge(edge, smallest):
        start, end = hull.edges[edge, 0], hull.edges[edge, 1]
        return nan_ignoring_min(
            segments(a, u, [start[k] for k in range(3)], [end[k] - start[k] for k in range(3)]), smallest
        )

    def to_face(face, smallest):
        normal, triangle = hull.normals[face], hull.triangles[face]
        for point in (a, tuple(x + y for x, y in zip(a, u, strict=True))):
            high = dot([normal[k] for k in range(3)], [point[k] - triangle[0, k] for k in range(3)])
            is_above, areas = high >= 0.0, []
            for i in range(3):
                side, out = triangle[(i + 1) % 3] - triangle[i], [point[k] - triangle[i, k] for k in range(3)]
                areas.append(dot([normal[k] for k in range(3)], cross([side[k] for k in range(3)], out)))
            # The corners of triangles may be in either order.
            inside = ((areas[0] >= 0.0) & (areas[1] >= 0.0) & (areas[2] >= 0.0)) | (
                (areas[0] <= 0.0) & (areas[1] <= 0.0) & (areas[2] <= 0.0)
            )
            smallest = jnp.where(is_above & inside & (high < smallest), high, smallest)
        return smallest

    far = jnp.full_like(a[0] + u[0], jnp.inf)
    smallest = lax.fori_loop(0, len(hull.edges), to_edge, far)
    return lax.fori_loop(0, len(hull.offsets), to_face, smallest)


def boxes(first: Numbers, centre: Vector, axes: Sequence[Vector], half: Numbers) -> Float[Array, "..."]:
    """Largest gap between projections of two boxes on a line, in axes of the first, which is around the origin."""
    gap = jnp.full_like(centre[0] + axes[0][0], -jnp.inf)
    for k in range(3):
        radius = first[k] + sum(half[j] * jnp.abs(axes[j][k]) for j in range(3))
        gap = _greater(jnp.abs(centre[k]) - radius, gap)
        radius = half[k] + sum(first[j] * jnp.abs(axes[k][j]) for j in range(3))
        gap = _greater(jnp.abs(dot(centre, axes[k])) - radius, gap)
    for axis in axes:
        for i, j in ((1, 2), (2, 0), (0, 1)):
            # The line is normal to an edge of each box, so that its component along this axis of the first is zero.
            x, y = -axis[j], axis[i]
            square = x * x + y * y
            radius = first[i] * jnp.abs(x) + first[j] * jnp.abs(y)
            radius = radius + sum(h * jnp.abs(e[i] * x + e[j] * y) for h, e in zip(half, axes, strict=True))
            tiny = _tiny(square)
            across = (jnp.abs(centre[i] * x + centre[j] * y) - radius) / jnp.sqrt(_greater(square, tiny))
            # Parallel edges have no unique common normal.
            gap = jnp.where((square > tiny) & (across > gap), across, gap)
    return gap


def hull_box(hull: Polyhedron, centre: Vector, axes: Sequence[Vector], half: Numbers) -> Float[Array, "..."]:
    """Largest gap between projections of a convex polyhedron and a box on a line, in the axes of the polyhedron.

    The lines are normal to a face of either shape, or to an edge of each where the polyhedron extends farthest along
    the line at its edge: these are the normals of the Minkowski sum of both shapes.
    """

    def gap(line, reached):
        return dot(centre, line) - reached - sum(h * jnp.abs(dot(e, line)) for h, e in zip(half, axes, strict=True))

    def of_face(face, largest):
        return _greater(gap([hull.normals[face, k] for k in range(3)], hull.offsets[face]), largest)

    largest = lax.fori_loop(0, len(hull.offsets), of_face, jnp.full_like(centre[0] + axes[0][0], -jnp.inf))
    corners = hull.triangles.reshape(-1, 3)
    for axis in axes:

        def of_corner(corner, ends, axis=axis):
            height = dot([corners[corner, k] for k in range(3)], axis)
            return nan_ignoring_min(height, ends[0]), _greater(height, ends[1])

        far = jnp.full_like(largest, jnp.inf)
        low, high = lax.fori_loop(0, len(corners), of_corner, (far, -far))
        largest = _greater(_greater(gap(axis, high), gap([-x for x in axis], -low)), largest)
    return lax.fori_loop(0, len(hull.edges), lambda edge, widest: _of_edge(hull, edge, axes, gap, widest), largest)


def _of_edge(hull: Polyhedron, edge: Array, axes: Sequence[Vector], gap, largest: Array) -> Array:
    # Compare projections on the lines normal to an edge of the polyhedron and an edge of the box.
    start, (a, b) = (
        [hull.edges[edge, 0, k] for k in range(3)],
        [[hull.sides[edge, i, k] for k in range(3)] for i in (0, 1)],
    )
    along, sense = [hull.edges[edge, 1, k] - start[k] for k in range(3)], cross(a, b)
    for axis in axes:
        line = cross(along, axis)
        # Remove the component along the edge that rounding leaves where the edges are nearly parallel.
        part = dot(line, along) / dot(along, along)
        line = tuple(x - part * y for x, y in zip(line, along, strict=True))
        square = dot(line, line)
        from_a, to_b = dot(cross(a, line), sense), dot(cross(line, b), sense)
        # The polyhedron extends farthest at the edge if the line, in either direction, lies between the normals of the
        # faces beside the edge.
        one = jnp.ones_like(square)
        sign = jnp.where(
            (from_a >= 0.0) & (to_b >= 0.0), one, jnp.where((from_a <= 0.0) & (to_b <= 0.0), -one, 0.0 * one)
        )
        scale = sign / jnp.sqrt(_greater(square, _tiny(square)))
        line = tuple(scale * x for x in line)
        width = gap(line, dot(start, line))
        largest = jnp.where((square > _tiny(square)) & (sign != 0.0) & (width > largest), width, largest)
    return largest
