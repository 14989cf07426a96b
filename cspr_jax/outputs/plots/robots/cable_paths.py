"""Ways of cables in pictures: straight from their spools, or around an arc of a pulley first. Without jax.

`robots.model.pulleys` has the same geometry, with derivatives; here are the points of its arcs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cspr_jax.config.robot import RobotFile

if TYPE_CHECKING:
    from jaxtyping import Float, Num

ON_ARC = 9  # points that an arc is drawn through, its ends included


def cable_ways(
    robot_file: RobotFile, attached: Float[np.ndarray, "... n_cables 3"]
) -> Num[np.ndarray, "... n_cables m 3"]:
    """Points that cables are drawn through."""
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
    # Angles about the centre of the pulley, from where the cable enters: of the attachment, and of where it leaves.
    across = wide - radius
    with np.errstate(invalid="ignore"):
        free = np.sqrt(across**2 + high**2 - radius**2)
    left = np.arctan2(high, -across) % (2.0 * np.pi) - np.arctan2(free, radius)
    angles = np.maximum(left, 0.0)[..., None] * np.linspace(0.0, 1.0, ON_ARC)
    along, up_axis = (1.0 - np.cos(angles)) * radius[:, None], np.sin(angles) * radius[:, None]
    arc = entry[:, None] + along[..., None] * side[..., None, :] + up_axis[..., None] * axis[:, None]
    return np.concatenate([arc, attached[..., None, :]], axis=-2)
