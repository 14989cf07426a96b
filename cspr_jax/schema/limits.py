"""Limits beyond taut cables: one row each. No jax here: files and tables use them too."""

import dataclasses
from typing import Literal

from cspr_jax.schema.verdicts import Verdict

# Numbers of arcs that files and arguments may ask for.
LARGEST_MAX_ARCS, LARGEST_GRID = 1000, 100_000
# Multiples of an uncertainty are not followed further.
LARGEST_MULTIPLE = 1000.0


@dataclasses.dataclass(frozen=True)
class Uncertain:
    """A part of the uncertainty of a robot.

    Fields:
        name: key in files, and field of `robots.model.limits.Uncertainty`.
        unit: of its values.
        smallest: value, of a robot without this uncertainty.
        largest: largest value.
        description: for the reference.
    """

    name: str
    unit: str
    smallest: float
    largest: float
    description: str

    @property
    def allowed(self) -> str:
        """Allowed values, in words."""
        return f"a number from {self.smallest:g} to {self.largest:g}"


UNCERTAINTIES = (
    Uncertain("spool_positions", "m", 0.0, 1e6, "every spool is within this distance of its place"),
    Uncertain("mass_centre", "m", 0.0, 1e6, "platform: the mass centre is within this distance of its place"),
    Uncertain("mass_factor", "1", 1.0, 1e6, "the mass is between 1 / factor and factor times the robot's; inertia too"),
)


@dataclasses.dataclass(frozen=True)
class Limit:
    """A limit of a quantity of the robot's state.

    Fields:
        name: key in files, and field of `robots.model.limits.Limits`.
        flag: the verdict where it is broken.
        sense: whether the quantity must be at least or at most so large.
        quantity: of `motion.limits.Values`.
        unit: of both.
        per_cable: whether each cable has a value of its own.
        of_motion: whether the quantity depends on how the effector moves, not only on where it is.
        from_zero: whether 0 is allowed, besides positive values; ignored for coordinates.
        description: for the reference.
    """

    name: str
    flag: Verdict
    sense: Literal["least", "most"]
    quantity: str
    unit: str
    per_cable: bool
    of_motion: bool
    from_zero: bool
    description: str

    @property
    def allowed(self) -> str:
        """Allowed values, in words."""
        return "a number: z of the floor" if self.is_height else f"a number {'>=' if self.from_zero else '>'} 0"

    @property
    def is_height(self) -> bool:
        """Tell whether it is a height, of any sign, and not a length or a rate."""
        return self.quantity == "depth"

    @property
    def of_mass_centre(self) -> bool:
        """Tell whether it bounds how fast the mass centre moves."""
        return self.quantity.startswith("mass_centre")


def _of_mass_centre(name: str, flag: Verdict, quantity: str, unit: str) -> Limit:
    words = f"largest {quantity} of the mass centre"
    return Limit(name, flag, "most", f"mass_centre_{quantity}", unit, False, True, False, words)


def _of_cables(name: str, flag: Verdict, quantity: str, unit: str, *, of_motion: bool) -> Limit:
    return Limit(name, flag, "most", quantity, unit, True, of_motion, False, f"largest cable {quantity}")


FLOOR = "z of the floor, which no point of the effector passes: mass centre, attachment points, shape if it is given"
# In the order of their slacks. The floor is z in the axes of a file, and a depth in the kernels': at most so deep.
LIMITS = (
    Limit("tension_min", Verdict.SLACK_CABLE, "least", "tension", "N", True, True, True, "smallest tension"),
    Limit("tension_max", Verdict.OVER_TENSION, "most", "tension", "N", True, True, False, "largest tension"),
    Limit("floor", Verdict.BELOW_FLOOR, "most", "depth", "m", False, False, True, FLOOR),
    _of_cables("cable_length_max", Verdict.CABLE_TOO_LONG, "length", "m", of_motion=False),
    _of_cables("cable_speed_max", Verdict.CABLE_TOO_FAST, "speed", "m/s", of_motion=True),
    _of_cables("cable_acceleration_max", Verdict.CABLE_OVER_ACCELERATION, "acceleration", "m/s^2", of_motion=True),
    _of_mass_centre("speed_max", Verdict.TOO_FAST, "speed", "m/s"),
    _of_mass_centre("acceleration_max", Verdict.OVER_ACCELERATION, "acceleration", "m/s^2"),
)
