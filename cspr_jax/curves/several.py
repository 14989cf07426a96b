"""Several splines in one table, so that bounds of blocks of all of them are computed together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cspr_jax.curves.blocks import spline_bounds
from cspr_jax.curves.spline import Spline, moved
from cspr_jax.robots.bounds.state_bounds import StateBounds

if TYPE_CHECKING:
    from jaxtyping import Float, Int


class SeveralSplines:
    """Splines of one degree, all of positions alone or all of orientations too, of any numbers of pieces."""

    def __init__(self, splines: Sequence[Spline]):
        """Join the tables."""
        self._offset = splines[0].offset
        if any(not np.array_equal(np.asarray(spline.offset), np.asarray(self._offset)) for spline in splines):
            raise ValueError("one offset of the mass centre")
        self._knots = np.concatenate([np.asarray(spline.knots) for spline in splines])
        self._of_knots = np.repeat(np.arange(len(splines)), [len(spline.knots) for spline in splines])
        turning = [spline.quaternion for spline in splines if spline.quaternion is not None]
        if len(turning) not in (0, len(splines)):
            raise ValueError("either all splines have orientations, or none")
        self._position = np.concatenate([np.asarray(spline.position) for spline in splines])
        self._quaternion = np.concatenate([np.asarray(table) for table in turning]) if turning else None
        self.durations = np.array([float(spline.knots[-1]) for spline in splines])
        self.jumps = [spline.jumps() for spline in splines]

    def bounds(
        self,
        motion: Int[np.ndarray, "k"],
        start: Float[np.ndarray, "k"],
        end: Float[np.ndarray, "k"],
        *,
        parabolas: bool = False,
    ) -> StateBounds:
        """Bounds of the states over blocks; see `motion.motion.BoundedMotion.bounds`."""
        bounds = spline_bounds(
            self._knots,
            self._position,
            self._quaternion,
            start,
            end,
            of_knots=self._of_knots,
            of_blocks=motion,
            parabolas=parabolas,
        )
        return bounds if self._offset is None else moved(bounds, self._offset)
