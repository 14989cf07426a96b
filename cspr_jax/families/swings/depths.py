"""Guide values for z0, the depth of P0 below the centroid of the spools."""

from __future__ import annotations

import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.model.robot import Robot


def _depths(robot: Robot, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    normal = np.asarray(plane_normal(robot))
    return targets, targets @ normal, normal


def mean_depth(robot: Robot, targets: Float[np.ndarray, "n 3"]) -> float:
    """Mean depth of the targets, as chosen in thesis section 2.9."""
    return float(_depths(robot, targets)[0][:, 2].mean())


def least_depth(robot: Robot, targets: Float[np.ndarray, "n 3"]) -> float:
    """Bound (2.59): below it, many arcs cannot reach some target, though few arcs may."""
    return float(_depths(robot, targets)[1].max() / 2.0)


def conservative_depth(robot: Robot, targets: Float[np.ndarray, "n 3"]) -> float:
    """Bound (2.58): above it, every segment between the targets is feasible with enough arcs.

    The bound keeps every target inside the sphere about P0 that touches the spool plane, |p - p0| < z0 / |n|, with n
    the plane's normal whose vertical component is 1. For an inclined plane the condition is quadratic in z0, and can
    fail for large z0 as well, or for all z0.
    """
    below, depth, normal = _depths(robot, targets)
    height, square = below[:, 2], (below**2).sum(1)
    sine_squared = 1.0 - 1.0 / (normal @ normal)  # squared sine of the plane's inclination
    inside = height**2 - sine_squared * square
    if not ((depth > 0.0) & (inside >= 0.0) & (height > 0.0)).all():
        return float("nan")
    root = np.sqrt(inside)
    with np.errstate(over="ignore"):  # for a target just below the spools no z0 is deep enough
        lowest = float((square / (height + root)).max())
    if sine_squared > 0.0 and lowest >= float(((height + root) / sine_squared).min()):
        return float("nan")
    return lowest
