"""Solid shapes that cables are kept clear of: spheres, cylinders with round ends, boxes, convex hulls. Without jax."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.numerics.linear.frames import IDENTITY, Frame
from cspr_jax.numerics.tolerances import UNIT_NORM

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

# The same number as in `robots.model.point_mass`, which imports jax.
LARGEST_LENGTH = 1e6
# Points closer to a plane than this fraction of their extent lie in it.
FLAT = 1e-9
# Tolerance of points on a surface, m: rounding of coordinates of some metres.
WITHIN = 1e-10


@dataclasses.dataclass(frozen=True)
class Sphere:
    """A ball.

    Fields:
        centre: (3,) m.
        radius: m.
        name: for people.
    """

    centre: np.ndarray
    radius: float
    name: str = "sphere"


@dataclasses.dataclass(frozen=True)
class Cylinder:
    """A cylinder with half a ball at each end: all points within the radius of a segment, its axis.

    Fields:
        start: (3,) start of the axis, m.
        end: (3,) end of the axis, m.
        radius: m.
        name: for people.
    """

    start: np.ndarray
    end: np.ndarray
    radius: float
    name: str = "cylinder"


@dataclasses.dataclass(frozen=True)
class Box:
    """A box.

    Fields:
        centre: (3,) m.
        half: (3,) halves of the lengths of its edges, m.
        rotation: (3, 3) axes of the box, one a column.
        name: for people.
    """

    centre: np.ndarray
    half: np.ndarray
    rotation: np.ndarray
    name: str = "box"


@dataclasses.dataclass(frozen=True)
class Hull:
    """A convex polyhedron that spans a volume.

    Fields:
        normals: (n_faces, 3) outward unit normals of its triangles.
        offsets: (n_faces,) products of the normals with points of their triangles, m.
        triangles: (n_faces, 3, 3) corners, m.
        edges: (n_edges, 2, 3) ends of the edges, without edges inside of a flat face, m.
        sides: (n_edges, 2, 3) outward normals of the two faces that meet at each edge.
        name: for people.
    """

    normals: np.ndarray
    offsets: np.ndarray
    triangles: np.ndarray
    edges: np.ndarray
    sides: np.ndarray
    name: str = "hull"


Obstacle: TypeAlias = Sphere | Cylinder | Box
Body: TypeAlias = Box | Hull


def sphere(centre, radius: float, *, name: str = "sphere") -> Sphere:
    """A ball, its numbers checked."""
    return Sphere(_point("centre", centre), _radius(radius), name)


def cylinder(start, end, radius: float, *, name: str = "cylinder") -> Cylinder:
    """A cylinder with round ends, its numbers checked."""
    return Cylinder(_point("start", start), _point("end", end), _radius(radius), name)


def box(centre, edges, quaternion=IDENTITY, *, name: str = "box") -> Box:
    """A box, its numbers checked."""
    lengths, components = _point("size", edges), np.asarray(quaternion, float)
    if not (lengths >= 0.0).all():
        raise InputError("size", edges, "three lengths, none negative")
    if components.shape != (4,) or not abs(np.linalg.norm(components) - 1.0) <= UNIT_NORM:
        raise InputError("quaternion", quaternion, "four numbers of a unit quaternion, scalar first")
    rotation = rotation_matrix(components / np.linalg.norm(components))
    return Box(_point("centre", centre), 0.5 * lengths, rotation, name)


def box_between(lowest, highest, *, name: str = "box") -> Box:
    """A box along the axes."""
    low, high = _point("lowest", lowest), _point("highest", highest)
    if not (low <= high).all():
        raise InputError("lowest", lowest, f"nowhere above {high.tolist()}")
    return Box(0.5 * (low + high), 0.5 * (high - low), np.eye(3), name)


def hull(points, *, name: str = "hull") -> Hull:
    """The convex hull of points."""
    from scipy.spatial import ConvexHull

    coordinates = np.asarray(points, float)
    if coordinates.ndim != 2 or coordinates.shape[1] != 3 or not (np.abs(coordinates) <= LARGEST_LENGTH).all():
        raise InputError("points", points, "points of three coordinates, at most 1e6 m")
    if is_flat(coordinates):
        raise InputError("points", coordinates.tolist(), "four points or more that are not all in a plane")
    convex = ConvexHull(coordinates)
    corners, normals = convex.simplices, convex.equations[:, :3]
    # Compute offsets again from the corners, so that they fit the coordinates to rounding.
    offsets = np.einsum("fi,fi->f", normals, coordinates[corners].mean(1))
    edges, sides = [], []
    for face, (simplex, others) in enumerate(zip(corners, convex.neighbors, strict=True)):
        for k, other in enumerate(others):
            if face < other and normals[face] @ normals[other] < 1.0 - FLAT:
                edges.append(coordinates[np.delete(simplex, k)])
                sides.append(normals[[face, other]])
    return Hull(normals, offsets, coordinates[corners], np.array(edges), np.array(sides), name)


def is_flat(points: Float[np.ndarray, "n 3"]) -> bool:
    """Tell whether points lie in a plane."""
    if len(points) < 4:
        return True
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return bool(spread[2] <= FLAT * spread[0])


def is_within(shape: Body, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """Tell whether points are inside of a shape or on its surface."""
    if isinstance(shape, Box):
        out = (np.abs((points - shape.centre) @ shape.rotation) - shape.half).max(1)
    else:
        out = (points @ shape.normals.T - shape.offsets).max(1)
    return out <= WITHIN


def point_distances(shape: Obstacle, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """Distances of points from the surface of a shape, negative inside."""
    if isinstance(shape, Sphere):
        return np.linalg.norm(points - shape.centre, axis=1) - shape.radius
    if isinstance(shape, Cylinder):
        along = shape.end - shape.start
        fraction = (points - shape.start) @ along / max(float(along @ along), np.finfo(float).tiny)
        nearest = shape.start + np.clip(fraction, 0.0, 1.0)[:, None] * along
        return np.linalg.norm(points - nearest, axis=1) - shape.radius
    beyond = np.abs((points - shape.centre) @ shape.rotation) - shape.half
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(1), 0.0)


def inward(shape: Obstacle, frame: Frame) -> Obstacle:
    """An obstacle of a robot file in the kernels' coordinates."""
    if isinstance(shape, Cylinder):
        return dataclasses.replace(shape, start=frame.inward(shape.start), end=frame.inward(shape.end))
    if isinstance(shape, Sphere):
        return dataclasses.replace(shape, centre=frame.inward(shape.centre))
    return dataclasses.replace(shape, centre=frame.inward(shape.centre), rotation=frame.rotated(shape.rotation.T).T)


def in_kernel_axes(shape: Body, frame: Frame) -> Body:
    """The shape of a platform in the platform axes of the kernels."""
    return _changed(shape, frame.rotated)


def rotated(shape: Body, rotation: Float[np.ndarray, "3 3"]) -> Body:
    """The shape of a platform in other platform axes with the same origin."""
    return _changed(shape, lambda vectors: vectors @ rotation.T)


def _changed(shape: Body, turn: Callable[[Any], Any]) -> Body:
    if isinstance(shape, Box):
        return dataclasses.replace(shape, centre=turn(shape.centre), rotation=turn(shape.rotation.T).T)
    normals, triangles, edges, sides = map(turn, (shape.normals, shape.triangles, shape.edges, shape.sides))
    return dataclasses.replace(shape, normals=normals, triangles=triangles, edges=edges, sides=sides)


def _point(key: str, coordinates) -> np.ndarray:
    point = np.asarray(coordinates, float)
    if point.shape != (3,) or not (np.abs(point) <= LARGEST_LENGTH).all():
        raise InputError(key, coordinates, "three numbers, at most 1e6 m")
    return point


def _radius(radius: float) -> float:
    if not 0.0 <= radius <= LARGEST_LENGTH:
        raise InputError("radius", radius, "a length, not negative, at most 1e6 m")
    return float(radius)


def rotation_matrix(quaternion) -> Float[np.ndarray, "3 3"]:
    """The rotation matrix of a unit quaternion, like `numerics.linear.rotations.matrix`, but without jax."""
    w, x, y, z = np.asarray(quaternion, float)
    vector = np.array([x, y, z])
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return (w * w - vector @ vector) * np.eye(3) + 2.0 * np.outer(vector, vector) + 2.0 * w * skew
