"""Hull of the spools seen from above, described by affine functions, each 1 at the centroid and 0 on one edge."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.spatial import ConvexHull

from cspr_jax.errors import InputError
from cspr_jax.numerics.elementary import as_float64, maximum_of
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.point_mass import SPATIAL, PointMassRobot, plane_normal, spool_radius

# Spools count as coplanar if their distances from a plane are below this fraction of the robot's radius.
IN_PLANE = 1e-9


class SpoolHull(NamedTuple):
    """Hull of the spools, and the plane that they lie in.

    Fields:
        edges: (n_edges, 2) gradients of the affine functions over x and y, 1/m.
        normal: (3,) normal of the plane, with third component 1.
        gravity: () m/s^2.
    """

    edges: Array
    normal: Array
    gravity: Array


def hull_of(robot: AnyRobot) -> SpoolHull:
    """Hull of the spools of a robot."""
    if not isinstance(robot, PointMassRobot):
        raise InputError("robot", robot.name, "a point mass, for a formula of the frequencies")
    normal, points = np.asarray(plane_normal(robot)), np.asarray(robot.base_points)
    if robot.pulleys is not None:
        raise InputError("pulley_radius", np.asarray(robot.pulleys.radius).tolist(), "absent: formulas know no pulleys")
    if not np.abs(points @ normal).max() <= IN_PLANE * float(spool_radius(robot)):
        allowed = "must lie in one plane, for a formula of the frequencies"
        raise InputError("base_points", None, allowed, problem="spools in several planes")
    edges = np.stack([_gradient(points[:, :2][ends], robot.dof) for ends in edge_ends(points, robot.dof)])
    return SpoolHull(as_float64(edges), as_float64(normal), as_float64(robot.gravity))


def traced_hull(robot: PointMassRobot) -> SpoolHull:
    """Hull of the spools of a robot that jax may trace, which lie in one plane; some edges several times."""
    points, normal = robot.base_points, plane_normal(robot)
    if robot.dof < SPATIAL:
        ends = jnp.stack([points[jnp.argmin(points[:, 0]), 0], points[jnp.argmax(points[:, 0]), 0]])
        return SpoolHull(jnp.stack([-1.0 / ends, jnp.zeros_like(ends)], axis=1), normal, robot.gravity)
    first, second = np.triu_indices(len(points), 1)
    (ax, ay), (bx, by) = points[first, :2].T, points[second, :2].T
    area = ax * by - ay * bx
    is_line = jnp.abs(area) > IN_PLANE * maximum_of(jnp.abs(area))
    gradients = jnp.stack([ay - by, bx - ax], axis=1) / jnp.where(is_line, area, 1.0)[:, None]
    # The line through two spools is an edge if all spools lie on the side of their centroid.
    is_edge = is_line & (gradients @ points[:, :2].T >= -1.0 - IN_PLANE).all(1)
    edges = jnp.where(is_edge[:, None], gradients, gradients[jnp.argmax(is_edge)][None])
    return SpoolHull(edges, normal, robot.gravity)


def formula_hull(robot: AnyRobot) -> SpoolHull | None:
    """Hull of the spools if the formulas hold for the robot, else None."""
    try:
        return hull_of(robot)
    except InputError:
        return None


def edge_ends(points: Float[np.ndarray, "n_cables 3"], dof: int) -> Int[np.ndarray, "n_edges dof-1"]:
    """Spools at the ends of the edges of the hull."""
    count = len(points)
    if count == dof:
        return np.array([[i for i in range(count) if i != cable] for cable in range(count)])
    if dof < SPATIAL:
        return np.array([[points[:, 0].argmin()], [points[:, 0].argmax()]])
    return ConvexHull(points[:, :2]).simplices


def _gradient(ends: np.ndarray, dof: int) -> np.ndarray:
    # Return the gradient of the function that is 1 at the origin and 0 at the ends of an edge.
    if dof < SPATIAL:
        return np.array([-1.0 / ends[0, 0], 0.0])
    return np.linalg.solve(ends, -np.ones(len(ends)))
