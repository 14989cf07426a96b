"""Robot of a map at a pose, as pictures draw it: spools, cables, platform. Without jax."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cspr_jax.config.keys.workspace import WorkspaceTable
from cspr_jax.config.missing_cables import without_cables
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.shapes import Float, Num
from cspr_jax.numerics.tolerances import UNIT_NORM
from cspr_jax.outputs.plots.style.fixed_axes import table
from cspr_jax.robots.model.shapes import FLAT, hull, is_flat, rotation_matrix
from cspr_jax.schema.quantities import is_of_robot, parameter_values
from cspr_jax.store.reading.result import Result

ON_ARC = 9  # number of points through which an arc is drawn, including its ends
TURN = {"x": np.array([0.0, 1.0, 0.0, 0.0]), "z": np.array([0.0, 0.0, 0.0, 1.0])}


class Posed(NamedTuple):
    """A robot at a pose, in the axes of its file.

    Fields:
        base: (n_cables, 3) points at which the cables leave, m.
        attached: (n_cables, 3) attachment points, for a point mass its position, m.
        cable_points: (n_cables, m, 3) points through which the cables are drawn, m.
        faces: (m, 3, 3) triangles of the hull of the attachment points, m; empty where these lie on a line.
        edges: (k, 2, 3) edges of the hull, m.
    """

    base: np.ndarray
    attached: np.ndarray
    cable_points: np.ndarray
    faces: np.ndarray
    edges: np.ndarray


def robot_of(result: Result, coordinates: Mapping[str, float] | None = None) -> RobotFile:
    """The robot of a map, in a cell where axes are parameters; those without a coordinate are as in the robot file."""
    robot_file = RobotFile(**result.settings["robot"]).with_parameters(parameter_values(coordinates or {}))
    return without_cables(robot_file, result.settings.get("without"), "result")


def spools_of(result: Result, coordinates: Mapping[str, float]) -> Float[np.ndarray, "n 3"] | None:
    """Spools of the robot in a cell; None where they depend on parameters that have no coordinate."""
    axes = result.axes | {axis: choice.points for axis, choice in result.choices.items()}
    names = [name for name in axes if is_of_robot(name)]
    if not names:
        return np.asarray(result.attributes["base_points"], float) if "base_points" in result.attributes else None
    fixed = {name: value for name, value in coordinates.items() if name not in result.choices}
    ends = [{name: float(f(axes[name])) for name in names} | fixed for f in (np.min, np.max)]
    first, last = (np.asarray(robot_of(result, end).base_points) for end in ends)
    return first if np.array_equal(first, last) else None


def workspace_of(result: Result) -> WorkspaceTable:
    """Requirements of a map of a workspace on its poses."""
    return WorkspaceTable(**table(result.settings, "workspace"))


def posed(result: Result, position: Float[np.ndarray, "3"], angles: dict[str, float]) -> Posed:
    """The robot of a map of a workspace, with the origin of the platform frame at a position."""
    robot_file = robot_of(result, angles)
    azimuth, tilt, torsion = (angles.get(name, 0.0) for name in ("tilt_azimuth", "tilt", "torsion"))
    rotation = _about("z", azimuth) @ _about("x", tilt) @ _about("z", torsion - azimuth)
    quaternion = np.array(workspace_of(result).orientation or IDENTITY)
    norm = np.linalg.norm(quaternion)
    if abs(norm - 1.0) > UNIT_NORM:
        raise InputError("workspace.orientation", quaternion.tolist(), "of length 1")
    rotation = rotation @ rotation_matrix(quaternion / norm)
    base = np.array(robot_file.base_points, float)
    body = np.zeros_like(base) if robot_file.platform_points is None else np.array(robot_file.platform_points, float)
    faces, edges = hull_of(body)
    attached = position + body @ rotation.T
    return Posed(
        base, attached, cable_points(robot_file, attached), position + faces @ rotation.T, position + edges @ rotation.T
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


def cable_points(
    robot_file: RobotFile, attached: Float[np.ndarray, "... n_cables 3"]
) -> Num[np.ndarray, "... n_cables m 3"]:
    """Points through which cables are drawn."""
    entry = np.asarray(robot_file.base_points, float)
    if robot_file.pulley_radius is None:
        return np.stack([np.broadcast_to(entry, attached.shape), attached], axis=-2)
    up = [0.0, 0.0, 1.0 if robot_file.z_axis == "up" else -1.0]
    axis = np.broadcast_to(np.asarray(up if robot_file.pulley_axes is None else robot_file.pulley_axes), entry.shape)
    axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
    radius = np.broadcast_to(np.asarray(robot_file.pulley_radius, float), len(entry))
    ray = attached - entry
    high = np.sum(ray * axis, axis=-1)
    aside = ray - high[..., None] * axis
    wide = np.linalg.norm(aside, axis=-1)
    side = aside / np.where(wide > 0.0, wide, 1.0)[..., None]
    # Angles about the centre of the pulley, from the entry point on, of the attachment point and of the exit point.
    across = wide - radius
    with np.errstate(invalid="ignore"):
        free = np.sqrt(across**2 + high**2 - radius**2)
    left = np.arctan2(high, -across) % (2.0 * np.pi) - np.arctan2(free, radius)
    angles = np.maximum(left, 0.0)[..., None] * np.linspace(0.0, 1.0, ON_ARC)
    along, up_axis = (1.0 - np.cos(angles)) * radius[:, None], np.sin(angles) * radius[:, None]
    arc = entry[:, None] + along[..., None] * side[..., None, :] + up_axis[..., None] * axis[:, None]
    return np.concatenate([arc, attached[..., None, :]], axis=-2)
