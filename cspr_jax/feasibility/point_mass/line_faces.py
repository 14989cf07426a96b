"""Faces of the feasible accelerations along a straight line, as half-planes of path coordinate and path acceleration.

On the line X0 + D s the normal to two cables' directions, times their lengths, is affine in s, and its product with D
does not depend on s at all: n(s) . D = n(0) . D, since each of its changes is normal to D. So every face of the cone of
feasible accelerations is a straight boundary in the plane of s and s'', Boralugoda (15) to (21), here for any spools
in one plane. Where they are not, which faces bound the cone can change along the line.
"""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.robots.point_mass import PLANAR, PointMassRobot, relative_acceleration, spool_radius, spread
from cspr_jax.robots.wrench_sets import FLAT, normals_to, spanning

# Of the size of a robot: spools nearer to a plane than this lie in it.
IN_PLANE = 1e-9


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class LineFaces:
    """Half-planes steepness * s'' >= offset + slope * s in which a motion along a line stays.

    Over the length of the normal at s, normal + turn * s, a slack is the distance of the acceleration from the face.

    Fields:
        steepness: (..., n_faces) n . D.
        offset: (..., n_faces) n . g at the start.
        slope: (..., n_faces) change of n . g from start to end.
        normal: (..., n_faces, 3) n at the start.
        turn: (..., n_faces, 3) change of n from start to end.
        bounds: (..., n_faces) whether it bounds the accelerations.
    """

    steepness: Array
    offset: Array
    slope: Array
    normal: Array
    turn: Array
    bounds: Array


def in_one_plane(robot: PointMassRobot) -> bool:
    """Whether the spools lie in one plane, those of a planar robot on one line.

    Args:
        robot: the robot; NumPy leaves.

    Returns:
        the claim.
    """
    points = np.asarray(robot.base_points)
    if robot.n_cables <= robot.dof:
        return True
    sizes = spread(points[:, [0, 2]] if robot.dof == PLANAR else points)
    return bool(sizes[robot.dof - 1] <= IN_PLANE * sizes[0])


def _normals(robot: PointMassRobot, place: Array) -> Array:
    # Of rays that keep their lengths.
    rays = robot.base_points - place[None]
    if robot.dof == PLANAR:
        level = normals_to(rays[:, [0, 2]].T)
        return jnp.stack([level[:, 0], jnp.zeros_like(level[:, 0]), level[:, 1]], axis=1)
    return normals_to(rays.T)


def line_faces(robot: PointMassRobot, start: Array, end: Array) -> LineFaces:
    """Half-planes of a line between two points.

    Args:
        robot: a point mass on spools in one plane, z down.
        start: (3,) from the centroid of the spools, m.
        end: (3,) likewise.

    Returns:
        one for each choice of cables that span a face, in the order of `wrench_sets.spanning`.
    """
    at_start, at_end = _normals(robot, start), _normals(robot, end)
    # Which side the other cables are on is the same everywhere below the spools: seen from far enough below them.
    below_all = jnp.zeros_like(start).at[2].set(spool_radius(robot))
    rays, seen = robot.base_points - below_all[None], _normals(robot, below_all)
    along = seen @ rays.T
    scale = jnp.linalg.norm(seen, axis=1)[:, None] * jnp.linalg.norm(rays, axis=1)[None]
    own = np.zeros(along.shape, bool)
    np.put_along_axis(own, spanning(robot.n_cables, robot.dof), True, axis=1)
    share = jnp.where(own, 0.0, along / jnp.where(scale > 0.0, scale, 1.0))
    above, below = (share > FLAT).any(1), (share < -FLAT).any(1)
    side = jnp.where(above, 1.0, -1.0)
    free_fall = -relative_acceleration(robot, jnp.zeros_like(start))
    normal, turn = side[:, None] * at_start, side[:, None] * (at_end - at_start)
    direction = end - start
    return LineFaces(
        steepness=normal @ direction,
        offset=normal @ free_fall,
        slope=turn @ free_fall,
        normal=normal,
        turn=turn,
        bounds=above ^ below,
    )


class Sides(NamedTuple):
    """Bounds of s'' from above, and of -s'' from above seen from the end of the line: lines in s, and in 1 - s.

    Fields:
        up: (..., n_faces + 1) largest s'' at the start; inf of a face that does not bound it.
        up_slope: (..., n_faces + 1) its change from start to end.
        down: (..., n_faces + 1) largest -s'' at the end; inf likewise.
        down_slope: (..., n_faces + 1) its change from end to start.
    """

    up: Array
    up_slope: Array
    down: Array
    down_slope: Array


def sides(faces: LineFaces, largest: Array) -> Sides:
    """Bounds of the path acceleration; the last one of each side is that of the largest acceleration.

    Args:
        faces: of a line.
        largest: () largest size of s'', inf for none, 1/s^2.

    Returns:
        the bounds.
    """
    steep = faces.steepness
    is_up, is_down = faces.bounds & (steep < 0.0), faces.bounds & (steep > 0.0)
    over = jnp.where(is_up | is_down, steep, 1.0)
    start, change = faces.offset / over, faces.slope / over
    flat = jnp.zeros_like(largest)

    def with_largest(wanted, value, slope):
        value, slope = jnp.where(wanted, value, jnp.inf), jnp.where(wanted, slope, 0.0)
        return jnp.concatenate([value, largest[None]]), jnp.concatenate([slope, flat[None]])

    return Sides(*with_largest(is_up, start, change), *with_largest(is_down, -(start + change), change))
