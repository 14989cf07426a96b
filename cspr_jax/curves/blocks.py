"""Affine bounds of a spline's states over blocks of time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax
import numpy as np

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.piecewise_bounds import overlaps, piecewise_bounds
from cspr_jax.numerics.bounds.rotation_bounds import rotation_bounds
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit

if TYPE_CHECKING:
    from jaxtyping import Float, Int

BATCH = 256


def spline_bounds(
    knots: np.ndarray,
    position: Float[np.ndarray, "m degree+1 3"],
    quaternion: Float[np.ndarray, "m degree+1 4"] | None,
    start: Float[np.ndarray, "k"],
    end: Float[np.ndarray, "k"],
    *,
    of_knots: np.ndarray | None = None,
    of_blocks: Int[np.ndarray, "k"] | None = None,
    parabolas: bool = False,
) -> StateBounds:
    """Bounds of the states over blocks of time, of one motion or of several, whose tables follow each other."""
    motions = (of_knots, of_blocks) if of_knots is not None and of_blocks is not None else None
    parts = overlaps(knots, start, end, motions)
    translation = piecewise_bounds(position, parts, parabolas=parabolas)
    if quaternion is None:
        return StateBounds(*translation)
    turning = piecewise_bounds(quaternion, parts, parabolas=parabolas)
    return StateBounds(*translation, *in_batches(_rotations, turning, batch_size=BATCH))


@persistent_jit(compiler_options=compile_options.least())
def _rotations(bands):
    return jax.vmap(rotation_bounds)(*bands)
