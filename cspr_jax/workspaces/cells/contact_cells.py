"""Bounds of clearances over cells: of cables from each other, from obstacles and from their platform.

While a robot moves within a cell without turning, every point of its bodies is affine in x, |x_k| <= 1, except exits
of pulleys, which stay within balls, and the ends of the parts of cables that are left out next to a platform, whose
terms of second order are bounded. As over blocks of time (`robots.contacts.convex_gaps`), the distance of two convex
bodies is at least the smallest component, along any direction, of the vectors between their corners. The direction is
that between the nearest points at the centre and turns with x as it does there, n(x) = n + sum_k x_k n_k, so that the
components are quadratic in x and errors of the bounds are of second order. The upper bound is the distance of two fixed
points of the bodies, which is largest at a corner of the cell.
"""

from __future__ import annotations

import itertools
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.linear.rotations import matrix
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.contacts.contact_bodies import Bodies, Shape, bodies_of
from cspr_jax.robots.contacts.convex_gaps import (
    BOX,
    SEGMENT,
    FacePlanes,
    Solid,
    inner_fractions,
    nearest_features,
    nearest_weights,
    parting_direction,
)
from cspr_jax.runtime import compile_options
from cspr_jax.workspaces.cells.cells import smallest_quadratic

BATCH = 512
# Error of distances over the largest coordinate: far above rounding errors of bounds, far below measurable distances.
DISTANCE_ERROR = 1e-12
# Half of the largest norm of the second derivative of r / |r|, times |r|^2.
UNIT_CURVATURE = 0.5 * np.sqrt(4.0 / 3.0)
SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))

Range = tuple[Array, Array]


class CellPoints(NamedTuple):
    """Points (m, ...) while a robot moves within a cell: within `radius` of `middle` + `jacobian` x.

    Fields:
        middle: (m, 3) points at the centre of the cell, m.
        jacobian: (m, 3, 3) derivatives with respect to x, one column for each component, m.
        radius: (m,) largest distance from the linear function, m.
    """

    middle: Any
    jacobian: Any
    radius: Any

    def minus(self, other: "CellPoints") -> "CellPoints":
        """Differences from other points, which move independently up to their radius."""
        return CellPoints(self.middle - other.middle, self.jacobian - other.jacobian, self.radius + other.radius)

    def weighted(self, weights: Array) -> "CellPoints":
        """Sums (k, ...) of points, weights (k, m) not negative."""
        return CellPoints(
            weights @ self.middle, jnp.einsum("km,mij->kij", weights, self.jacobian), weights @ jnp.asarray(self.radius)
        )


class _CellLanes(NamedTuple):
    # Position (3,) and half extents (3,); exits of the cables (n_cables, 3), and their movements (n_cables,), m.
    position: Any
    half: Any
    exits: Any
    shifts: Any


def clearance_bounds(
    robot: AnyRobot,
    scene: Scene,
    quaternion: Float[np.ndarray, "4"],
    positions: Float[np.ndarray, "n 3"],
    half: Float[np.ndarray, "n 3"],
    exits: Float[np.ndarray, "n n_cables 3"],
    shifts: Float[np.ndarray, "n n_cables"],
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Bounds of the smallest clearance in cells."""
    bodies, rotation = bodies_of(robot, scene), np.asarray(matrix(jnp.asarray(quaternion)))
    body = None if bodies.body is None else _rotated(bodies.body, rotation)
    rotated = bodies._replace(points=bodies.points @ rotation.T, body=body)
    low, high = in_batches(partial(_kernel, rotated), _CellLanes(positions, half, exits, shifts), batch_size=BATCH)
    return np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)


def _rotated(shape: Shape, rotation: np.ndarray) -> Shape:
    planes = FacePlanes(shape.planes.normals @ rotation.T, shape.planes.offsets)
    return shape._replace(corners=shape.corners @ rotation.T, planes=planes)


@partial(jax.jit, compiler_options=compile_options.proof_options())
def _kernel(bodies: Bodies, cells: _CellLanes) -> Range:
    return jax.vmap(partial(_of_cell, bodies))(cells)


def _of_cell(bodies: Bodies, cell: _CellLanes) -> Range:
    count, moved = len(bodies.points), jnp.diag(cell.half)
    jacobian = jnp.broadcast_to(jnp.stack([jnp.zeros((3, 3)), moved]), (count, 2, 3, 3))
    middle = jnp.stack([cell.exits, cell.position[None] + bodies.points], axis=1)
    cables = CellPoints(middle, jacobian, jnp.stack([cell.shifts, jnp.zeros(count)], axis=1))
    parts: list[Range] = []
    if len(bodies.pairs):
        one, other = (_at(cables, bodies.pairs[:, k]) for k in range(2))
        low, high = jax.vmap(lambda p, q: _gap(Solid(p, *SEGMENT), Solid(q, *SEGMENT)))(one, other)
        thickness = bodies.radii[bodies.pairs].sum(1)
        parts.append((low - thickness, high - thickness))
    low, high = _from_obstacles(bodies, cables, lambda points: Solid(points, *SEGMENT))
    parts.append((low - bodies.radii[None], high - bodies.radii[None]))
    if bodies.body is not None:
        shape = bodies.body
        parts.append(_from_platform(bodies, shape, cell))
        moving = jnp.broadcast_to(moved, (len(shape.corners), 3, 3))
        placed = CellPoints(shape.corners + cell.position[None], moving, jnp.zeros(len(shape.corners)))
        planes = FacePlanes(shape.planes.normals, shape.planes.offsets + shape.planes.normals @ cell.position)
        solids = jax.tree.map(lambda array: array[None], placed)
        parts.append(_from_obstacles(bodies, solids, lambda points: Solid(points, shape.edges, shape.faces), planes))
    low, high = (minimum_of(jnp.concatenate([side.ravel() for side in sides])) for sides in zip(*parts, strict=True))
    allowance = DISTANCE_ERROR * (bodies.extent + maximum_of(jnp.abs(cell.position)))
    return low - allowance, high + allowance


def _at(points: CellPoints, index: Any) -> CellPoints:
    return jax.tree.map(lambda array: array[index], points)


def _fixed(corners: Array) -> CellPoints:
    return CellPoints(corners, jnp.zeros((*corners.shape, 3)), jnp.zeros(len(corners)))


def _gap(first: Solid, second: Solid) -> Range:
    # Bound the distance of two bodies whose corners are `CellPoints`; from below only where they are proved separated.
    p, q = first.corners, second.corners
    features = nearest_features(p.middle, q.middle, first, second)

    def moving(one: Array, other: Array) -> tuple[Array, Array]:
        return jax.jvp(partial(parting_direction, features), (p.middle, q.middle), (one, other))

    normal, turns = jax.vmap(moving, in_axes=(2, 2), out_axes=(None, 1))(p.jacobian, q.jacobian)
    turns = jnp.where(jnp.sum(turns**2) <= 1.0, turns, 0.0)
    each = [CellPoints(*(jnp.expand_dims(array, axis) for array in x)) for x, axis in ((p, 1), (q, 0))]
    between = each[1].minus(each[0])
    linear = between.middle @ turns + jnp.einsum("i,pqik->pqk", normal, between.jacobian)
    quadratic = jnp.einsum("ik,pqil->pqkl", turns, between.jacobian)
    longest = jnp.sqrt(jnp.sum(normal**2) + 2.0 * jnp.sum(jnp.abs(normal @ turns)) + jnp.sum(jnp.abs(turns.T @ turns)))
    low = (
        between.middle @ normal
        - jnp.sum(jnp.abs(linear), axis=-1)
        + smallest_quadratic(quadratic)
        - longest * between.radius
    )
    low = minimum_of(low)
    weights = nearest_weights(features, p.middle, q.middle)
    nearest = q.weighted(weights[1][None]).minus(p.weighted(weights[0][None]))
    ends = nearest.middle + SIGNS @ nearest.jacobian[0].T
    high = maximum_of(jnp.sqrt(jnp.sum(ends**2, axis=1))) + nearest.radius[0]
    return jnp.where(low > 0.0, low / longest, -jnp.inf), high


def _depth(body: Solid, planes: FacePlanes) -> Array:
    # Upper bound of the signed distance of a body from a fixed one, by points of its edges; inf where it is not proved
    # that they overlap.
    start, end = (body.corners.middle[body.edges[:, k]] for k in range(2))
    part = inner_fractions(start, end, planes)[:, None]
    count = len(body.corners.middle)
    weights = (1.0 - part) * jnp.eye(count)[body.edges[:, 0]] + part * jnp.eye(count)[body.edges[:, 1]]
    points = body.corners.weighted(weights)
    heights = points.middle @ planes.normals.T - planes.offsets[None] + points.radius[:, None]
    heights = heights + jnp.sum(jnp.abs(jnp.einsum("fi,mik->mfk", planes.normals, points.jacobian)), axis=-1)
    deepest = minimum_of(maximum_of(heights, axis=1))
    return jnp.where(deepest < 0.0, deepest, jnp.inf)


def _from_obstacles(bodies: Bodies, points: CellPoints, solid: Any, planes: FacePlanes | None = None) -> Range:
    # Bound the distances of bodies (n, m, ...) from all obstacles, (n_obstacles, n), in any order of obstacles.
    parts = [(jnp.zeros((0, len(points.middle))),) * 2]
    if len(bodies.rods):

        def from_rod(rod: Array, radius: Array, one: CellPoints) -> Range:
            axis = Solid(_fixed(rod), *SEGMENT)
            low, high = _gap(axis, solid(one))
            deep = jnp.inf if planes is None else _depth(Solid(_seen(rod, one), *SEGMENT), planes)
            return low - radius, jnp.minimum(high, deep) - radius

        over = jax.vmap(jax.vmap(from_rod, (None, None, 0)), (0, 0, None))
        parts.append(over(bodies.rods, bodies.rod_radii, points))
    if bodies.boxes is not None:

        def from_box(box: Shape, one: CellPoints) -> Range:
            low, high = _gap(solid(one), Solid(_fixed(box.corners), *BOX))
            return low, jnp.minimum(high, _depth(solid(one), box.planes))

        parts.append(jax.vmap(jax.vmap(from_box, (None, 0)), (0, None))(bodies.boxes, points))
    low, high = (jnp.concatenate(sides) for sides in zip(*parts, strict=True))
    return low, high


def _seen(corners: Array, platform: CellPoints) -> CellPoints:
    # Points fixed in space, in the axes of a platform that moves like its first corner.
    jacobian = jnp.broadcast_to(-platform.jacobian[0], (len(corners), 3, 3))
    return CellPoints(corners, jacobian, jnp.zeros(len(corners)))


def _from_platform(bodies: Bodies, shape: Shape, cell: _CellLanes) -> Range:
    # In the axes of the platform its shape and the attachment points do not move.
    ray, moved = cell.exits - cell.position[None] - bodies.points, -jnp.diag(cell.half)
    length, radius = jnp.sqrt(jnp.sum(ray**2, axis=1)), jnp.sqrt(jnp.sum(cell.half**2)) + cell.shifts
    unit, shortest = ray / length[:, None], length - radius
    across = (jnp.eye(3)[None] - unit[:, :, None] * unit[:, None, :]) / length[:, None, None]
    rest = cell.shifts / length + UNIT_CURVATURE * (radius / shortest) ** 2
    count = len(ray)
    ends = CellPoints(
        jnp.stack([bodies.points + bodies.leave * unit, cell.exits - cell.position[None]], axis=1),
        jnp.stack([bodies.leave * across @ moved, jnp.broadcast_to(moved, (count, 3, 3))], axis=1),
        jnp.stack([bodies.leave * rest, cell.shifts], axis=1),
    )

    def one(cable: CellPoints) -> Range:
        low, high = _gap(Solid(cable, *SEGMENT), Solid(_fixed(shape.corners), shape.edges, shape.faces))
        return low, jnp.minimum(high, _depth(Solid(cable, *SEGMENT), shape.planes))

    low, high = jax.vmap(one)(ends)
    # A cable that may be no longer than the part that is left out has no bounds.
    is_long = shortest > bodies.leave
    return jnp.where(is_long, low, -jnp.inf) - bodies.radii, jnp.where(is_long, high, jnp.inf) - bodies.radii
