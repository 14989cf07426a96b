"""Faces of the feasible accelerations along a straight line, as half-planes of path coordinate and path acceleration.

On the line X0 + D s the normal to two cables' directions, times their lengths, is affine in s, and its product with D
does not depend on s: n(s) . D = n(0) . D, since each change of n is normal to D. So every face of the cone of feasible
accelerations is a straight boundary in the plane of s and s'', Boralugoda (15) to (21), here for any spools. The
product of n(s) with another cable's ray is affine too: a face bounds the cone where all these products are positive. If
the spools lie in one plane, that holds either everywhere below them or nowhere.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import PLANAR, PointMassRobot, relative_acceleration, spool_radius
from cspr_jax.robots.statics.wrench_sets import FLAT, normals_to, spanning


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class LineFaces:
    """Half-planes steepness * s'' >= offset + offset_change * s that a motion along a line may not leave.

    A slack divided by the length of the normal at s, normal + normal_change * s, is the distance of the acceleration
    from the face.

    Fields:
        steepness: (..., n_faces) n . D.
        offset: (..., n_faces) n . g at the start.
        offset_change: (..., n_faces) change of n . g from start to end.
        normal: (..., n_faces, 3) n at the start, towards the other cables.
        normal_change: (..., n_faces, 3) change of n from start to end.
        along: (..., n_faces, n_cables) product of n with each ray to a spool at the start; 0 for rays in the face.
        along_change: (..., n_faces, n_cables) change of `along` from start to end.
        first: (..., n_faces) smallest s at which the face bounds the accelerations of taut cables.
        last: (..., n_faces) largest such s; not above `first` if the face bounds none.
    """

    steepness: Array
    offset: Array
    offset_change: Array
    normal: Array
    normal_change: Array
    along: Array
    along_change: Array
    first: Array
    last: Array

    @property
    def bounds(self) -> Array:
        """Tell whether each face bounds the accelerations of taut cables anywhere on the line, (..., n_faces)."""
        return self.last > self.first


def _normals(robot: PointMassRobot, position: Array) -> tuple[Array, Array]:
    # Return the normals to rays, scaled with the lengths of the rays, (n_choices, 3), and their products with the rays,
    # (n_choices, n_cables).
    rays = robot.base_points - position[None]
    if robot.dof == PLANAR:
        level = normals_to(rays[:, [0, 2]].T)
        normal = jnp.stack([level[:, 0], jnp.zeros_like(level[:, 0]), level[:, 1]], axis=1)
    else:
        normal = normals_to(rays.T)
    products = jnp.linalg.norm(normal, axis=1)[:, None] * jnp.linalg.norm(rays, axis=1)[None]
    along = normal @ rays.T
    spans = np.zeros(along.shape, bool)
    np.put_along_axis(spans, spanning(robot.n_cables, robot.dof), True, axis=1)
    return normal, jnp.where(spans | (jnp.abs(along) <= FLAT * products), 0.0, along)


def line_faces(robot: PointMassRobot, start: Float[Array, "3"], end: Float[Array, "3"], *, in_plane: bool) -> LineFaces:
    """Half-planes of a line between two points."""
    (normal, along), (at_end, along_end) = _normals(robot, start), _normals(robot, end)
    if in_plane:
        # The other cables are on the same side of a face everywhere below the spools: find it far enough below them.
        _, seen = _normals(robot, jnp.zeros_like(start).at[2].set(spool_radius(robot)))
        above, below = (seen > 0.0).any(1), (seen < 0.0).any(1)
        side = jnp.where(above, 1.0, -1.0)[:, None]
        normal, at_end, along, along_end = side * normal, side * at_end, side * along, side * along_end
        first, last = jnp.zeros_like(side[:, 0]), jnp.where(above ^ below, 1.0, 0.0)
    else:
        normal, at_end, along, along_end = (jnp.concatenate([x, -x]) for x in (normal, at_end, along, along_end))
        first, last = _bounding(along, along_end)
    free_fall = -relative_acceleration(robot, jnp.zeros_like(start))
    normal_change = at_end - normal
    return LineFaces(
        steepness=normal @ (end - start),
        offset=normal @ free_fall,
        offset_change=normal_change @ free_fall,
        normal=normal,
        normal_change=normal_change,
        along=along,
        along_change=along_end - along,
        first=first,
        last=last,
    )


def _bounding(start: Array, end: Array) -> tuple[Array, Array]:
    # Find the part of the line where no product is negative and some are positive.
    change = start - end
    crossing = start / jnp.where(change != 0.0, change, 1.0)
    first = maximum_of(jnp.where((start < 0.0) & (end > 0.0), crossing, 0.0), axis=1)
    last = minimum_of(jnp.where((start > 0.0) & (end < 0.0), crossing, 1.0), axis=1)
    never = ((start <= 0.0) & (end <= 0.0) & ((start < 0.0) | (end < 0.0))).any(1)
    flat = ((start == 0.0) & (end == 0.0)).all(1)
    return first, jnp.where(never | flat, first, last)


class Sides(NamedTuple):
    """Upper bounds of s'', as lines in s, and of -s'', as lines in 1 - s from the end of the line.

    Fields:
        up: (..., n_faces + 1) largest s'' at the start; inf if the face does not bound it.
        up_change: (..., n_faces + 1) change of `up` from start to end.
        down: (..., n_faces + 1) largest -s'' at the end; inf if the face does not bound it.
        down_change: (..., n_faces + 1) change of `down` from end to start.
        first: (..., n_faces + 1) smallest s at which the bound holds.
        last: (..., n_faces + 1) largest s at which it holds.
    """

    up: Array
    up_change: Array
    down: Array
    down_change: Array
    first: Array
    last: Array


def sides(faces: LineFaces, largest: Float[Array, ""]) -> Sides:
    """Bounds of the path acceleration; the last one on each side is the largest acceleration."""
    steep = faces.steepness
    is_up, is_down = faces.bounds & (steep < 0.0), faces.bounds & (steep > 0.0)
    over = jnp.where(is_up | is_down, steep, 1.0)
    start, change = faces.offset / over, faces.offset_change / over
    flat = jnp.zeros_like(largest)

    def with_largest(is_bounding, value, change):
        value, change = jnp.where(is_bounding, value, jnp.inf), jnp.where(is_bounding, change, 0.0)
        return jnp.concatenate([value, largest[None]]), jnp.concatenate([change, flat[None]])

    up, up_change = with_largest(is_up, start, change)
    down, down_change = with_largest(is_down, -(start + change), change)
    always = jnp.ones_like(largest)[None]
    first, last = jnp.concatenate([faces.first, 0.0 * always]), jnp.concatenate([faces.last, always])
    return Sides(up, up_change, down, down_change, first, last)
