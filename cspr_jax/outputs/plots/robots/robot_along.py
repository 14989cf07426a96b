"""The robot at the rows of its motion: attachment points of its cables, and edges of its platform."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.numerics.shapes import Int
from cspr_jax.outputs.plots.robots.obstacles import points_of
from cspr_jax.outputs.plots.robots.robot_at import cable_points, hull_of
from cspr_jax.robots.model.shapes import Hull, rotation_matrix
from cspr_jax.schema.limits import LIMITS


class Moving(NamedTuple):
    """A robot in motion, in the axes of its file.

    Fields:
        base: (n_cables, 3) points at which the cables leave, m.
        position: (n, 3) position of the effector at each row, m.
        attached: (n, n_cables, 3) attachment points of the cables, m.
        cable_points: (n, n_cables, m, 3) points through which the cables are drawn, from `base` to `attached`, m.
        corners: (n, 2 n_edges, 3) ends of the platform's edges, one after the other, m; none for a point mass.
    """

    base: np.ndarray
    position: np.ndarray
    attached: np.ndarray
    cable_points: np.ndarray
    corners: np.ndarray


def moving(
    columns: Mapping[str, np.ndarray],
    robot_file: RobotFile | None,
    rows: Int[np.ndarray, "n"],
    plan_file: PlanFile | None = None,
) -> Moving:
    """The robot at rows of its motion."""
    position, quaternion = np.asarray(columns["position"])[rows], columns.get("quaternion")
    if robot_file is None:
        nothing = np.empty((len(rows), 0, 3))
        return Moving(np.empty((0, 3)), position, nothing, np.empty((len(rows), 0, 2, 3)), nothing)
    base = np.asarray(robot_file.base_points, float)
    body = np.zeros_like(base) if robot_file.platform_points is None else np.asarray(robot_file.platform_points, float)
    # Poses of a motion are of the mass centre and relative to the reference orientation, unless they are of the axes.
    centre = np.zeros(3) if "mass_centre" in columns else np.asarray(robot_file.centre_of_mass or [0.0] * 3, float)
    body = body - centre
    edges, rotations = np.empty((0, 2, 3)), np.eye(3)[None]
    if quaternion is not None:
        edges, quaternion = _edges(robot_file, plan_file, body, centre), np.asarray(quaternion)[rows]
        # With more cables the reference orientation is given by the file's axes, and jax need not be loaded.
        if "mass_centre" not in columns and len(base) <= 6:
            from cspr_jax.outputs.platform_poses import of_own_axes

            quaternion = of_own_axes(robot_file, quaternion)
        rotations = np.array([rotation_matrix(one) for one in quaternion])
    # Rotate points with the platform, at each row.
    attached, corners = (
        position[:, None] + np.einsum("rij,kj->rki", rotations, x) for x in (body, edges.reshape(-1, 3))
    )
    return Moving(base, position, attached, cable_points(robot_file, attached), corners)


def _edges(robot_file: RobotFile, plan_file: PlanFile | None, attached: np.ndarray, centre: np.ndarray) -> np.ndarray:
    # Edges (n, 2, 3) of the platform, relative to the point whose positions the motion has.
    points = robot_file.platform_points or ()
    shape = None if plan_file is None else plan_file.body(centre.tolist(), points)
    if isinstance(shape, Hull):
        return shape.edges
    return hull_of(attached if shape is None else points_of(shape))[1]


def limits_of(robot_file: RobotFile, plan: PlanFile, quantity: str = "tension") -> list[tuple[str, float]]:
    """Limits of a quantity, to be drawn beside its values."""
    limits = []
    for row in LIMITS:
        limit_of_plan = getattr(plan, row.name, None)
        limit = robot_file.limit(row.name) if limit_of_plan is None else limit_of_plan
        if row.quantity != quantity or limit is None:
            continue
        values = np.unique(np.atleast_1d(np.asarray(limit, float)))
        values = values[np.isfinite(values) & ((values > 0.0) | row.is_height)]
        words = ("smallest allowed" if row.sense == "least" else "largest allowed") if not row.is_height else "floor"
        limits += [(words, value) for value in values.tolist()]
    return limits
