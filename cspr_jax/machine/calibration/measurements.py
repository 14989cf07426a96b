"""Measurements at many poses, with standard deviations."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Bool, Float, Int

# Standard deviations where none are given: only their ratios count then.
USUAL = (1e-4, 1e-4, 1e-3)


class Deviations(NamedTuple):
    """Standard deviations of measurements.

    Fields:
        length: of lengths, or of angles times the radius of the drum over the gear ratio, m.
        position: of each coordinate of a position, m.
        rotation: of each component of an orientation, rad.
        are_given: whether they are known; else one common factor is estimated from the residuals.
    """

    length: float = USUAL[0]
    position: float = USUAL[1]
    rotation: float = USUAL[2]
    are_given: bool = False


USUAL_DEVIATIONS = Deviations()


class SpoolDistances(NamedTuple):
    """Measured distances between spools.

    Fields:
        first: (m,) indices of cables.
        second: (m,) indices of cables.
        distance: (m,) m.
        deviation: (m,) standard deviations, m.
    """

    first: Int[np.ndarray, "m"]
    second: Int[np.ndarray, "m"]
    distance: Float[np.ndarray, "m"]
    deviation: Float[np.ndarray, "m"]


NO_DISTANCES = SpoolDistances(np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros(0))


@dataclasses.dataclass(frozen=True)
class Measurements:
    """Measurements at k poses, in the kernels' axes; NaN where nothing was measured.

    Fields:
        readings: (k, n_cables) lengths, m, or angles of motors, rad.
        positions: (k, 3) positions of the point that the tracker follows, in its axes, m.
        quaternions: (k, 4) orientations of the platform in its axes, scalar first.
        are_angles: whether the readings are angles.
        deviations: standard deviations.
        distances: distances between spools.
        prior: standard deviation of the nominal numbers of the robot, m; inf: nothing is known of them.
    """

    readings: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray
    are_angles: bool = False
    deviations: Deviations = USUAL_DEVIATIONS
    distances: SpoolDistances = NO_DISTANCES
    prior: float = np.inf

    @property
    def count(self) -> int:
        """Number of poses."""
        return len(self.readings)

    def is_measured(self, axes: tuple[int, ...], turns: int) -> Bool[np.ndarray, "k m"]:
        """Tell which residuals exist: of readings, of coordinates along axes, and of components of turns."""
        along = np.isin(np.arange(3), axes) & np.isfinite(self.positions)
        rotations = np.isfinite(self.quaternions).all(1)[:, None] & (np.arange(3) < turns)
        return np.concatenate([np.isfinite(self.readings), along, rotations], axis=1)

    def scales(self, n_cables: int) -> Float[np.ndarray, "m"]:
        """Standard deviations of the residuals of a pose."""
        parts = (self.deviations.length, n_cables), (self.deviations.position, 3), (self.deviations.rotation, 3)
        return np.concatenate([np.full(count, value) for value, count in parts])


def joined_names(n_cables: int, are_angles: bool) -> list[str]:
    """Names of the columns of residuals, as in files."""
    kind = "angle" if are_angles else "length"
    return [*(f"{kind}_{i + 1}" for i in range(n_cables)), "x", "y", "z", *(f"rotation_{axis}" for axis in "xyz")]
