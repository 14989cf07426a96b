"""Limits of a robot beyond taut cables, and its uncertainty: data only."""

import dataclasses

import jax
from jax import Array

from cspr_jax.errors.suggestions import with_suggestions


@with_suggestions
@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of a robot: a motion must be feasible for every robot within it.

    Fields:
        spool_positions: () largest distance of each spool from its position, m.
        mass_centre: () largest distance of the mass centre from its position, platform axes, m; 0 for a point mass.
        mass_factor: () at least 1; mass and inertia lie between 1 / factor and factor times their values.
    """

    spool_positions: Array | float = 0.0
    mass_centre: Array | float = 0.0
    mass_factor: Array | float = 1.0


@with_suggestions
@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Limits:
    """Limits beyond taut cables; None: no such limit.

    Fields:
        tension_min: (n_cables,) smallest tensions, N.
        tension_max: (n_cables,) largest tensions, N.
        floor: () z of the floor, z down, m.
        cable_length_max: (n_cables,) largest lengths, m.
        cable_speed_max: (n_cables,) largest speeds in either direction, m/s.
        cable_acceleration_max: (n_cables,) largest accelerations of either sign, m/s^2.
        speed_max: () largest speed of the mass centre, m/s.
        acceleration_max: () largest acceleration of the mass centre, m/s^2.
        motor_speed_max: (n_cables,) largest speeds of the motors, rad/s.
        motor_torque_max: (n_cables,) largest torques of the motors, N m.
        motor_power_max: (n_cables,) largest powers of the motors, driving or braking, W.
        motor_load_max: (n_cables,) largest sums of torque over stall torque and speed over no-load speed.
        motor_torque_rms_max: (n_cables,) largest root mean squares of torques over the full motion, N m.
        uncertainty: uncertainty within which every robot must meet the limits with taut cables.
    """

    tension_min: Array | None = None
    tension_max: Array | None = None
    floor: Array | None = None
    cable_length_max: Array | None = None
    cable_speed_max: Array | None = None
    cable_acceleration_max: Array | None = None
    speed_max: Array | None = None
    acceleration_max: Array | None = None
    motor_speed_max: Array | None = None
    motor_torque_max: Array | None = None
    motor_power_max: Array | None = None
    motor_load_max: Array | None = None
    motor_torque_rms_max: Array | None = None
    uncertainty: Uncertainty | None = None


NO_LIMITS = Limits()
