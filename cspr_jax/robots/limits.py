"""Limits of a robot beyond taut cables: data only."""

import dataclasses

import jax
from jax import Array


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Limits:
    """Limits beyond taut cables; None where there is none.

    Fields:
        tension_min: (n_cables,) N.
        tension_max: (n_cables,) N.
        floor: () z of the floor, z down, m.
        cable_length_max: (n_cables,) m.
        cable_speed_max: (n_cables,) m/s, of paying out and of winding in.
        cable_acceleration_max: (n_cables,) m/s^2, of either sign.
    """

    tension_min: Array | None = None
    tension_max: Array | None = None
    floor: Array | None = None
    cable_length_max: Array | None = None
    cable_speed_max: Array | None = None
    cable_acceleration_max: Array | None = None


NO_LIMITS = Limits()
