"""Columns of launches to many landing points, the same for all motions from which the object is released."""

import dataclasses
from typing import Self

import numpy as np

from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.schema.columns import Columns


@dataclasses.dataclass(frozen=True)
class Releases(Columns):
    """Slowest releases to n landing points, (n,) each; NaN where there is none, except in the first two columns.

    Fields:
        verdict: flags of `Verdict`; 0 where a launch is found.
        largest_margin: largest margin of all motions tried.
        release_speed: speed at the release, m/s.
        flight_time: time of flight, s.
        release_x: x of the position of release, m.
        release_y: y likewise.
        release_z: z likewise.
    """

    verdict: np.ndarray
    largest_margin: np.ndarray
    release_speed: np.ndarray
    flight_time: np.ndarray
    release_x: np.ndarray
    release_y: np.ndarray
    release_z: np.ndarray

    @property
    def feasible(self) -> np.ndarray:
        """Tell to which points a feasible launch is found, (n,)."""
        return self.verdict == 0

    @property
    def releases(self) -> np.ndarray:
        """Positions of the releases, (n, 3) m."""
        return np.stack([self.release_x, self.release_y, self.release_z], axis=1)

    def placed(self, frame: Frame) -> Self:
        """The same releases with their positions in other axes."""
        x, y, z = frame.outward(self.releases).T
        return dataclasses.replace(self, release_x=x, release_y=y, release_z=z)
