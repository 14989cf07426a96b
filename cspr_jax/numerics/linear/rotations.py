"""Orientations as unit quaternions, scalar first."""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.shapes import Float


def from_tilt_torsion(angles: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 4"]:
    """Orientations of tilt-and-torsion angles, Z_phi X_theta Z_(sigma - phi), thesis section 3.10.2."""
    half_tilt, half_torsion = 0.5 * angles[..., 1], 0.5 * angles[..., 2]
    across = angles[..., 0] - half_torsion
    return np.stack(
        [
            np.cos(half_tilt) * np.cos(half_torsion),
            np.sin(half_tilt) * np.cos(across),
            np.sin(half_tilt) * np.sin(across),
            np.cos(half_tilt) * np.sin(half_torsion),
        ],
        axis=-1,
    )


def cylindrical_frames(positions: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    """Azimuths (3.98) of the cylindrical frames of positions: add them to tilt-and-torsion angles in these frames."""
    azimuth = np.arctan2(positions[..., 1], positions[..., 0])
    return np.stack([azimuth, np.zeros_like(azimuth), np.zeros_like(azimuth)], axis=-1)


def about_vertical(angle: float) -> Float[np.ndarray, "3 3"]:
    """The matrix of a rotation about the z axis."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def matrix(quaternion: Float[Array, "4"]) -> Float[Array, "3 3"]:
    """The rotation matrix of a unit quaternion, (3.29) with (3.31)."""
    w, x, y, z = quaternion
    return jnp.stack(
        [
            jnp.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)]),
            jnp.stack([2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)]),
            jnp.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]),
        ]
    )


def product(left: Float[Array, "4"], right: Float[Array, "4"]) -> Float[Array, "4"]:
    """The product of two quaternions, (3.18), of which the right one rotates first."""
    scalar = left[0] * right[0] - jnp.dot(left[1:], right[1:])
    vector = left[0] * right[1:] + right[0] * left[1:] + jnp.cross(left[1:], right[1:])
    return jnp.concatenate([scalar[None], vector])


def products(left: np.ndarray, right: np.ndarray) -> Float[np.ndarray, "n 4"]:
    """Products of quaternions, one by one; see `product`."""
    scalar = left[:, :1] * right[:, :1] - (left[:, 1:] * right[:, 1:]).sum(1, keepdims=True)
    vector = left[:, :1] * right[:, 1:] + right[:, :1] * left[:, 1:] + np.cross(left[:, 1:], right[:, 1:])
    return np.concatenate([scalar, vector], axis=1)


# A quaternion times these signs is its conjugate.
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


def conjugate(quaternion: Float[Array, "... 4"]) -> Float[Array, "... 4"]:
    """The opposite rotation."""
    return quaternion * jnp.array(CONJUGATE, quaternion.dtype)


def upper(quaternion: Float[Array, "... 4"]) -> Float[Array, "... 4"]:
    """The one of q and -q whose angle is in [-pi, pi]: its scalar part is not negative, thesis section 3.7."""
    return jnp.where(quaternion[..., :1] < 0.0, -quaternion, quaternion)
