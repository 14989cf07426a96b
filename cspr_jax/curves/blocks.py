"""Affine bounds of a spline's states over blocks of time."""

import jax
import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.arithmetic.piecewise_bounds import overlaps, piecewise_bounds
from cspr_jax.arithmetic.rotation_bounds import rotation_bounds
from cspr_jax.robots.state_bounds import StateBounds
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit

BATCH = 256


def spline_bounds(
    knots: np.ndarray,
    position: np.ndarray,
    quaternion: np.ndarray | None,
    start: np.ndarray,
    end: np.ndarray,
    *,
    of_knots: np.ndarray | None = None,
    of_blocks: np.ndarray | None = None,
    parabolas: bool = False,
) -> StateBounds:
    """Bounds of the states over blocks of time, of one motion or of several, whose tables follow each other.

    Args:
        knots: (m + 1,) s, or (m + n,) those of n motions.
        position: (m, degree + 1, 3) Bernstein coefficients, m.
        quaternion: (m, degree + 1, 4) likewise; None for a point mass.
        start: (k,) s, increasing or not.
        end: (k,) s, later than `start`.
        of_knots: (m + n,) numbers of the motions, from 0 on; None: there is one.
        of_blocks: (k,) likewise.
        parabolas: whether bands are around parabolas.

    Returns:
        the bounds, leaves (k, ...).

    Raises:
        ValueError: blocks with parabolas reach over several pieces.
    """
    motions = (of_knots, of_blocks) if of_knots is not None and of_blocks is not None else None
    parts = overlaps(knots, start, end, motions)
    translation = piecewise_bounds(position, parts, parabolas=parabolas)
    if quaternion is None:
        return StateBounds(*translation)
    turning = piecewise_bounds(quaternion, parts, parabolas=parabolas)
    return StateBounds(*translation, *in_batches(_rotations, turning, size=BATCH))


@persistent_jit(compiler_options=compile_options.least())
def _rotations(bands):
    return jax.vmap(rotation_bounds)(*bands)
