"""Several splines in one table, so that bounds of blocks of all of them are computed together."""

from collections.abc import Sequence

import numpy as np

from cspr_jax.curves.blocks import spline_bounds
from cspr_jax.curves.spline import Spline
from cspr_jax.robots.state_bounds import StateBounds


class SeveralSplines:
    """Splines of one degree, all of positions alone or all of orientations too, of any numbers of pieces."""

    def __init__(self, splines: Sequence[Spline]):
        """Join the tables.

        Args:
            splines: at least one.

        Raises:
            ValueError: degrees differ, only some have orientations, or positions are not those of mass centres.
        """
        if any(spline.offset is not None for spline in splines):
            raise ValueError("positions of mass centres alone")
        self._knots = np.concatenate([np.asarray(spline.knots) for spline in splines])
        self._of_knots = np.repeat(np.arange(len(splines)), [len(spline.knots) for spline in splines])
        turning = [spline.quaternion for spline in splines if spline.quaternion is not None]
        if len(turning) not in (0, len(splines)):
            raise ValueError("either all splines have orientations, or none")
        self._position = np.concatenate([np.asarray(spline.position) for spline in splines])
        self._quaternion = np.concatenate([np.asarray(table) for table in turning]) if turning else None
        self.durations = np.array([float(spline.knots[-1]) for spline in splines])
        self.jumps = [spline.jumps() for spline in splines]

    def bounds(self, motion: np.ndarray, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states over blocks; see `motions.motion.BoundedMotion.bounds`.

        Args:
            motion: (k,) numbers of the splines, from 0 on.
            start: (k,) s.
            end: (k,) s.

        Returns:
            the bounds, leaves (k, ...).
        """
        return spline_bounds(
            self._knots,
            self._position,
            self._quaternion,
            start,
            end,
            of_knots=self._of_knots,
            of_blocks=motion,
        )
