"""Numbers of winches: one row each. No jax here: files use them too."""

import dataclasses
from collections.abc import Collection


@dataclasses.dataclass(frozen=True)
class WinchNumber:
    """A number of a winch, one for all cables or one per cable.

    Fields:
        name: key of `[winch]` in robot files, and argument of `with_winches`.
        unit: unit.
        description: text for the reference.
        default: value where it is absent; None: there is none.
        from_zero: whether 0 is allowed in addition to positive values.
        largest: largest value.
        is_required: whether every winch has it.
        is_whole: whether only whole numbers are allowed.
    """

    name: str
    unit: str
    description: str
    default: float | None = None
    from_zero: bool = False
    largest: float = 1e9
    is_required: bool = False
    is_whole: bool = False

    @property
    def allowed(self) -> str:
        """Allowed values, in words."""
        if self.name == "direction":
            return "1 or -1"
        kind = "a whole number" if self.is_whole else "a number"
        return f"{kind} {'>=' if self.from_zero else '>'} 0" + f", at most {self.largest:g}" * (self.largest < 1e9)

    def is_allowed(self, value: float) -> bool:
        """Tell whether a number may be its value."""
        if self.name == "direction":
            return value in (1.0, -1.0)
        is_in_range = (value >= 0.0 if self.from_zero else value > 0.0) and value <= self.largest
        return is_in_range and (not self.is_whole or float(value).is_integer())


WINCH_NUMBERS = (
    WinchNumber(
        "drum_radius",
        "m",
        "distance of the cable's centre line from the axis of the drum, in the first layer",
        largest=1e6,
        is_required=True,
    ),
    WinchNumber("gear_ratio", "1", "turns of the motor for one turn of the drum", 1.0),
    WinchNumber(
        "motor_inertia", "kg m^2", "inertia of rotor, gear and drum, as the motor sees it", 0.0, from_zero=True
    ),
    WinchNumber("friction", "N m", "Coulomb friction, as the motor sees it", 0.0, from_zero=True),
    WinchNumber("viscous_friction", "N m s/rad", "friction over speed, as the motor sees it", 0.0, from_zero=True),
    WinchNumber("efficiency", "1", "power at the cable over power of the motor while it winds", 1.0, largest=1.0),
    WinchNumber("zero_length", "m", "length of the cable at angle 0 of the motor", 0.0, from_zero=True, largest=1e6),
    WinchNumber("direction", "1", "1 where a growing angle of the motor pays out, -1 where it winds", 1.0),
    WinchNumber("layer_turns", "1", "turns of a layer; the radius grows by cable_diameter from layer to layer"),
    WinchNumber(
        "cable_length",
        "m",
        "length of the cable from its end on the drum: beside layer_turns; what is not paid out lies on the drum",
        largest=1e6,
    ),
    WinchNumber("motor_stall_torque", "N m", "torque at standstill of the line that falls with speed"),
    WinchNumber("motor_no_load_speed", "rad/s", "speed at which that line has no torque"),
    WinchNumber("encoder_counts", "1", "counts of the encoder for one turn of the motor", is_whole=True),
)
# Numbers that are given together, or not at all.
TOGETHER = (("layer_turns", "cable_length"), ("motor_stall_torque", "motor_no_load_speed"))
# Limits of winches, keys of `[winch]` too: rows of `schema.limits`, which describe them.
WINCH_LIMITS = tuple(
    WinchNumber(name, unit, "limit of the motor")
    for name, unit in (
        ("motor_speed_max", "rad/s"),
        ("motor_torque_max", "N m"),
        ("motor_power_max", "W"),
        ("motor_load_max", "1"),
        ("motor_torque_rms_max", "N m"),
    )
)
# Line, and the limit that it sets to 1 where no other value is given.
LINE, LOAD = TOGETHER[1][0], "motor_load_max"


def missing_number(names: Collection[str]) -> tuple[str, str] | None:
    """A number that must be given beside another one that is; None: none is missing."""
    pairs = [*TOGETHER, *((other, number) for number, other in TOGETHER), (LOAD, LINE)]
    return next(((other, number) for number, other in pairs if number in names and other not in names), None)
