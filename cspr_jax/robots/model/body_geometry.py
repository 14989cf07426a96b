"""Attachment points, mass centre and inertia of a body on cables, checked. NumPy alone."""

from __future__ import annotations

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.patterns import Pattern
from cspr_jax.robots.model.point_mass import LARGEST_LENGTH, checked_coordinates
from cspr_jax.robots.model.spool_plane import is_on_line

# Points closer together than this fraction of the largest distance are one point.
SAME = 1e-9
# Tolerance for rounding of inertia tensors, in tests of symmetry and of I1 + I2 = I3 for flat bodies.
INERTIA_TOLERANCE = 1e-9
# Largest distance of a rod's mass centre from the line of its attachment points, as a fraction of its length.
BESIDE = 1e-6


def is_same(points: Float[np.ndarray, "n 3"], first: int, second: int) -> bool:
    """Tell whether two points coincide."""
    span = np.ptp(points, axis=0).max()
    return bool(np.linalg.norm(points[first] - points[second]) <= SAME * span)


def checked_platform(platform_points, count: int, pattern: Pattern) -> Float[np.ndarray, "n_cables 3"]:
    """Check the attachment points of a body."""
    points = checked_coordinates("platform_points", platform_points, pattern.dof)
    if len(points) != count:
        raise InputError(
            "platform_points", None, f"must be {count}, as many as base_points", problem=f"{len(points)} points"
        )
    if pattern.is_planar:
        if (points[:, 1] != 0.0).any():
            raise InputError("platform_points", points.tolist(), "points with y = 0: the plane of a planar robot")
        if not np.ptp(points, axis=0).max() > 0.0:
            raise InputError("platform_points", points.tolist(), "points that are not all the same: no cable turns it")
    elif pattern.along_line:
        if not is_on_line(points) or not np.ptp(points, axis=0).max() > 0.0:
            raise InputError("platform_points", points.tolist(), 'points on one line, and not all the same: "2R3T"')
    elif not pattern.is_jointed and is_on_line(points):
        raise InputError(
            "platform_points",
            points.tolist(),
            'points that are not on one line, or coincident (all on one line: pattern = "2R3T", a rod)',
        )
    return points


def checked_centre(
    centre_of_mass, platform: Float[np.ndarray, "n_cables 3"], pattern: Pattern
) -> Float[np.ndarray, "3"]:
    """Check the mass centre of a body."""
    centre = np.asarray(centre_of_mass, float)
    if centre.shape != (3,) or not (np.abs(centre) <= LARGEST_LENGTH).all():
        raise InputError("centre_of_mass", centre_of_mass, "three coordinates, at most 1e6 m")
    if pattern.is_planar and centre[1] != 0.0:
        raise InputError("centre_of_mass", centre.tolist(), "a point with y = 0: the plane of a planar robot")
    if pattern.along_line:
        offsets = platform - platform[0]
        line = offsets[np.argmax((offsets**2).sum(1))]
        beside = np.linalg.norm(np.cross(centre - platform[0], line)) / (line @ line)
        if not beside <= BESIDE:
            raise InputError("centre_of_mass", centre.tolist(), "a point on the line of platform_points: a rod")
    return centre


def checked_inertia(inertia, pattern: Pattern) -> Float[np.ndarray, "3 3"]:
    """Check the inertia tensor of a body."""
    tensor = np.asarray(inertia, float)
    if tensor.shape != (3, 3) or not np.isfinite(tensor).all():
        raise InputError("inertia", inertia, "three rows of three finite numbers, kg m^2")
    scale = np.abs(tensor).max()
    if np.abs(tensor - tensor.T).max() > INERTIA_TOLERANCE * scale:
        raise InputError("inertia", tensor.tolist(), "a symmetric tensor")
    tensor = 0.5 * (tensor + tensor.T)
    if pattern.is_planar:
        if not tensor[1, 1] > 0.0:
            raise InputError("inertia", tensor.tolist(), "a tensor with a positive moment about y, inertia[1][1]")
        return tensor
    low, middle, high = np.linalg.eigvalsh(tensor)
    if pattern.along_line:
        if not (low >= -INERTIA_TOLERANCE * scale and middle > 0.0):
            raise InputError("inertia", tensor.tolist(), "a tensor of no negative moment, 0 at most about one axis")
    elif not low > 0.0:
        raise InputError("inertia", tensor.tolist(), "a positive definite tensor")
    if high > (low + middle) * (1.0 + INERTIA_TOLERANCE):
        raise InputError(
            "inertia", tensor.tolist(), "a tensor of a real body: no principal moment above the sum of the other two"
        )
    return tensor
