"""Limits of a robot beyond taut cables, and its uncertainty: data only."""

import dataclasses

import jax
from jax import Array


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of a robot: a motion must be feasible for all robots within it.

    Fields:
        spool_positions: () radius of the ball in which each spool lies, m.
        mass_centre: () radius of the ball in which the mass centre lies, platform axes, m; 0 for a point mass.
        mass_factor: () from 1 on; the mass, and with it the inertia, is between 1 / factor and factor times its value.
    """

    spool_positions: Array | float = 0.0
    mass_centre: Array | float = 0.0
    mass_factor: Array | float = 1.0


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Limits:
    """Limits beyond taut cables; None for limits that are not set.

    Fields:
        tension_min: (n_cables,) N.
        tension_max: (n_cables,) N.
        floor: () z of the floor, z down, m.
        cable_length_max: (n_cables,) m.
        cable_speed_max: (n_cables,) m/s, both for paying out and for winding in.
        cable_acceleration_max: (n_cables,) m/s^2, of either sign.
        uncertainty: robots for all of which limits must be met and cables be taut.
    """

    tension_min: Array | None = None
    tension_max: Array | None = None
    floor: Array | None = None
    cable_length_max: Array | None = None
    cable_speed_max: Array | None = None
    cable_acceleration_max: Array | None = None
    uncertainty: Uncertainty | None = None


NO_LIMITS = Limits()
