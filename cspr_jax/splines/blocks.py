"""Affine bounds of a spline's states over blocks of time."""

import jax
import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.arithmetic.piecewise_bounds import overlaps, piecewise_bounds
from cspr_jax.arithmetic.rotation_bounds import rotation_bounds
from cspr_jax.robots.state_bounds import StateBounds

BATCH = 1024


def spline_bounds(
    knots: np.ndarray, position: np.ndarray, quaternion: np.ndarray | None, start: np.ndarray, end: np.ndarray
) -> StateBounds:
    """Bounds of the states over blocks of time.

    Args:
        knots: (m + 1,) s.
        position: (m, degree + 1, 3) Bernstein coefficients, m.
        quaternion: (m, degree + 1, 4) likewise; None for a point mass.
        start: (k,) s, increasing or not.
        end: (k,) s, later than `start`.

    Returns:
        the bounds, leaves (k, ...).
    """
    parts = overlaps(knots, start, end)
    translation = piecewise_bounds(position, parts)
    if quaternion is None:
        return StateBounds(*translation)
    return StateBounds(*translation, *in_batches(_rotations, piecewise_bounds(quaternion, parts), size=BATCH))


@jax.jit
def _rotations(bands):
    return jax.vmap(rotation_bounds)(*bands)
