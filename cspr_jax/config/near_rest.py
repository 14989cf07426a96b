"""Hint about positions that are P0 except for their last digits."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cspr_jax.errors import shown
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.robots.model.spool_plane import AT_P0, largest_radius

# Positions closer to P0 than this, in m or as a fraction of z0, are probably meant to be P0.
NEAR_P0 = 1e-3


def almost_at_rest(key: str, position: Sequence[float], z0: float, robot: Any, cure: str = "rest = true") -> str:
    """Hint that a position was probably meant to be P0; else empty."""
    spools = np.asarray(robot.base_points)
    rest = frame_of(spools, robot.z_axis).outward(np.array([0.0, 0.0, z0]))
    distance = float(np.linalg.norm(np.asarray(position) - rest))
    if not AT_P0 * largest_radius(spools) < distance <= NEAR_P0 * max(1.0, z0):
        return ""
    written = ", ".join(f"{value:.12g}" for value in (np.round(rest, 12) + 0.0).tolist())
    return (
        f"{key} = {shown(np.asarray(position).tolist())}: {distance:.2g} m from P0 = [{written}], and not at rest "
        f"there: the direction of so short a way decides the motion; if P0 is meant: {cure}"
    )
