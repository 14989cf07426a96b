"""Robot of a map at a pose, as pictures draw it: spools, cables, platform. Without jax."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cspr_jax.config.keys.workspace import WorkspaceTable
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.tolerances import UNIT_NORM
from cspr_jax.outputs.plots.robots.cable_paths import cable_ways
from cspr_jax.outputs.plots.style.fixed_axes import table
from cspr_jax.robots.model.shapes import FLAT, hull, is_flat, rotation_matrix
from cspr_jax.store.reading.result import Result

if TYPE_CHECKING:
    from jaxtyping import Float

TURN = {"x": np.array([0.0, 1.0, 0.0, 0.0]), "z": np.array([0.0, 0.0, 0.0, 1.0])}


class Posed(NamedTuple):
    """A robot at a pose, in the axes of its file.

    Fields:
        base: (n_cables, 3) where the cables leave, m.
        attached: (n_cables, 3) where they are attached, for a point mass its place, m.
        ways: (n_cables, m, 3) points that they are drawn through, m.
        faces: (m, 3, 3) triangles of the hull of these points, m; empty where they lie on a line.
        edges: (k, 2, 3) edges of it, m.
    """

    base: np.ndarray
    attached: np.ndarray
    ways: np.ndarray
    faces: np.ndarray
    edges: np.ndarray


def robot_of(result: Result) -> RobotFile:
    """The robot of a map."""
    return RobotFile(**result.settings["robot"])


def workspace_of(result: Result) -> WorkspaceTable:
    """Requirements of a map of a workspace on its poses."""
    return WorkspaceTable(**table(result.settings, "workspace"))


def posed(result: Result, place: Float[np.ndarray, "3"], angles: dict[str, float]) -> Posed:
    """The robot of a map of a workspace, with the origin of the platform frame at a place."""
    robot_file = robot_of(result)
    azimuth, tilt, torsion = (angles.get(name, 0.0) for name in ("tilt_azimuth", "tilt", "torsion"))
    rotation = _about("z", azimuth) @ _about("x", tilt) @ _about("z", torsion - azimuth)
    quaternion = np.array(workspace_of(result).orientation or IDENTITY)
    size = np.linalg.norm(quaternion)
    if abs(size - 1.0) > UNIT_NORM:
        raise InputError("workspace.orientation", quaternion.tolist(), "of length 1")
    rotation = rotation @ rotation_matrix(quaternion / size)
    base = np.array(robot_file.base_points, float)
    body = np.zeros_like(base) if robot_file.platform_points is None else np.array(robot_file.platform_points, float)
    faces, edges = hull_of(body)
    attached = place + body @ rotation.T
    return Posed(
        base, attached, cable_ways(robot_file, attached), place + faces @ rotation.T, place + edges @ rotation.T
    )


def _about(axis: str, angle: float) -> np.ndarray:
    return rotation_matrix(np.array([np.cos(0.5 * angle), 0.0, 0.0, 0.0]) + np.sin(0.5 * angle) * TURN[axis])


def hull_of(points: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, "m 3 3"], Float[np.ndarray, "k 2 3"]]:
    """Hull of the points of a platform; a polygon for points in a plane, the two ends for points on a line."""
    if not is_flat(points):
        solid = hull(points)
        return solid.triangles, solid.edges
    from scipy.spatial import ConvexHull

    _, spread, axes = np.linalg.svd(points - points.mean(0))
    flat = points @ axes[:2].T
    if len(points) < 3 or spread[1] <= FLAT * spread[0]:
        ends = points[[flat[:, 0].argmin(), flat[:, 0].argmax()]]
        return np.empty((0, 3, 3)), ends[None]
    ring = points[ConvexHull(flat).vertices]
    faces = [ring[[0, k, k + 1]] for k in range(1, len(ring) - 1)]
    return np.array(faces), np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
