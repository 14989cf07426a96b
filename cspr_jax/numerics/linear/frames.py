"""Axes of a robot file beside those of the kernels: z down, origin in the centroid of the spools.

This module alone converts coordinates, in float64: the centroid is subtracted before anything else is computed, so that
no digits are lost on a robot whose spools lie far from the origin of its axes.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from cspr_jax.numerics.shapes import Float

# Unit quaternion of no rotation, scalar first.
IDENTITY = (1.0, 0.0, 0.0, 0.0)
# A z-up file is rotated by half a turn about x, so that nothing is mirrored.
_SIGNS = {"down": (1.0, 1.0, 1.0), "up": (1.0, -1.0, -1.0)}


def _numbers(values):
    # Convert to float64, except arrays of jax, which may be traced.
    return values if hasattr(values, "at") else np.asarray(values, float)


def _beside(vector, array):
    # Give the vector the rank of the array, since callers may have set jax to raise an error where ranks differ.
    return vector.reshape((1,) * (array.ndim - 1) + vector.shape)


@dataclasses.dataclass(frozen=True)
class Frame:
    """Axes and origin of a robot file, relative to those of the kernels.

    Fields:
        signs: (3,) factors, +1 or -1, from axes of the file to axes of the kernels, and back.
        origin: (3,) centroid of the spools in the file's axes, to the nearest float64, m.
        rest: (3,) rounding error of the origin, m.
    """

    signs: np.ndarray
    origin: np.ndarray
    rest: np.ndarray

    def inward(self, points) -> Float[np.ndarray, "... 3"]:
        """Points of the file in the kernels' coordinates."""
        array = _numbers(points)
        origin, rest, signs = (_beside(x, array) for x in (self.origin, self.rest, self.signs))
        return ((array - origin) - rest) * signs

    def outward(self, points) -> Float[np.ndarray, "... 3"]:
        """Points of the kernels in the file's coordinates."""
        array = _numbers(points)
        origin, rest, signs = (_beside(x, array) for x in (self.origin, self.rest, self.signs))
        return origin + (array * signs + rest)

    def depth(self, height) -> Float[np.ndarray, "..."]:
        """Depth below the centroid of the spools of a z coordinate of the file."""
        return ((_numbers(height) - self.origin[2]) - self.rest[2]) * self.signs[2]

    def height(self, depth) -> Float[np.ndarray, "..."]:
        """Height in the file of a depth below the centroid of the spools."""
        return self.origin[2] + (_numbers(depth) * self.signs[2] + self.rest[2])

    def rotated(self, vectors) -> Float[np.ndarray, "... 3"]:
        """Vectors of the file in the kernels' axes, or the reverse."""
        array = _numbers(vectors)
        return array * _beside(self.signs, array)

    def rotated_tensor(self, tensor):
        """A tensor of the file in the kernels' axes, or the reverse."""
        return self.signs[:, None] * tensor * self.signs[None]

    def rotated_angles(self, angles) -> Float[np.ndarray, "... 3"]:
        """Angles of tilt and torsion of the file in the kernels' axes, or the reverse."""
        return np.asarray(angles, float) * np.array([self.signs[1], 1.0, self.signs[2]])

    def rotated_quaternions(self, quaternions) -> Float[np.ndarray, "... 4"]:
        """Orientations of the file in the kernels' axes, or the reverse."""
        # The scalar part keeps its sign, as the component along x does.
        array = _numbers(quaternions)
        return array * _beside(self.signs[np.array([0, 0, 1, 2])], array)


def frame_of(base_points, z_axis: str) -> Frame:
    """The frame of a robot."""
    points, signs = _numbers(base_points), np.array(_SIGNS[z_axis])
    if not isinstance(points, np.ndarray):
        origin = points.mean(0)
        return Frame(signs, origin, (points - origin[None]).mean(0))
    origin = np.array([math.fsum(column) / len(points) for column in points.T])
    rest = np.array([math.fsum(column) / len(points) for column in (points - origin).T])
    return Frame(signs, origin, rest)
