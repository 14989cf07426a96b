"""Bounds of movements and rotations of cables while a robot translates within a cell. Arrays in, answers out.

A cable is a segment from its exit E to its attachment point A. While the robot moves by at most h, so does A. On a
pulley of radius r, E moves along the cable by r / f times the distance that A moves across the cable in the plane of
the pulley, where f is the free length; and together with this plane by at most 2 r / w times the distance that A moves
out of it, where w is the distance of A from the swivel axis (`robots.model.pulleys`). For all positions of A, E stays
within a range of width 4 r and height 2 r.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.workspaces.poses import geometry

BATCH = 4096
# Diagonal of the range of exits, over the radius of the pulley.
EXIT_RANGE = math.sqrt(20.0)


class Shifts(NamedTuple):
    """Bounds of movements while robots move within their cells.

    Fields:
        robot: (n,) largest movement of the robot, m.
        exits: (n,) largest movement of an exit, m; 0 without pulleys.
        units: (n, n_cables) norms of the changes of the cables' unit vectors.
        free: (n, n_cables) smallest free lengths of the cables, m.
    """

    robot: np.ndarray
    exits: np.ndarray
    units: np.ndarray
    free: np.ndarray


def shifts(
    robot: AnyRobot,
    positions: Float[np.ndarray, "n 3"],
    quaternions: Float[np.ndarray, "n 4"],
    distance: Float[np.ndarray, "n"],
) -> Shifts:
    """Bounds of movements while robots move within their cells."""
    targets = in_batches(lambda x: geometry.attachments(robot, *x), (positions, quaternions), batch_size=BATCH)
    rays, maximum = targets - np.asarray(robot.base_points), distance[:, None]
    if robot.pulleys is None:
        free = np.linalg.norm(rays, axis=2) - maximum
        return Shifts(distance, np.zeros(len(distance)), unit_changes(maximum, free), free)
    radius, axes = np.asarray(robot.pulleys.radius), np.asarray(robot.pulleys.axes)
    high = (rays * axes).sum(2)
    wide = np.linalg.norm(rays - high[..., None] * axes, axis=2)
    # The distance of A from the centre of the pulley, which swivels with the cable, changes by at most the movement.
    out = np.hypot(wide - radius, high) - maximum
    free = np.sqrt(np.maximum(np.square(np.maximum(out, 0.0)) - radius**2, 0.0))
    wide = np.maximum(wide - maximum, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        exits = maximum * np.fmax(radius / free, 2.0 * radius / wide)
    exits = np.where(radius > 0.0, np.fmin(exits, EXIT_RANGE * radius), 0.0)
    return Shifts(distance, exits.max(1), unit_changes(maximum, np.minimum(free, wide)), free)


def leaving_points(
    robot: AnyRobot, positions: Float[np.ndarray, "n 3"], quaternion: Float[np.ndarray, "4"]
) -> Float[np.ndarray, "n n_cables 3"]:
    """Points at which cables leave: their base points, or points of their pulleys."""
    pulleys = robot.pulleys
    if pulleys is None:
        return np.broadcast_to(np.asarray(robot.base_points), (len(positions), robot.n_cables, 3))
    poses = positions, np.tile(quaternion, (len(positions), 1))
    return in_batches(lambda x: geometry.exit_points(robot, pulleys, *x), poses, batch_size=BATCH)


def unit_changes(distance: Float[np.ndarray, "n k"], length: np.ndarray) -> np.ndarray:
    """Bound of the changes of unit vectors."""
    return np.where(length > 0.0, np.minimum(distance / np.where(length > 0.0, length, 1.0), 2.0), 2.0)
