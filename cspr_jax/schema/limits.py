"""Limits beyond taut cables: one row each. No jax here: files and tables use them too."""

import dataclasses
from typing import Any, Literal

from cspr_jax.schema.verdicts import Verdict

# Largest numbers of arcs, and of intervals of a grid, in files and arguments.
LARGEST_MAX_ARCS, LARGEST_GRID = 1000, 100_000
# Largest multiple of an uncertainty that is tried.
LARGEST_MULTIPLE = 1000.0


@dataclasses.dataclass(frozen=True)
class Uncertain:
    """A part of the uncertainty of a robot.

    Fields:
        name: key in files, and field of `robots.model.limits.Uncertainty`.
        unit: unit of its values.
        smallest: smallest value, of a robot without this uncertainty.
        largest: largest value.
        description: text for the reference.
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
        flag: flag of verdicts where it is violated.
        sense: whether it is a lower ("least") or an upper ("most") limit.
        quantity: field of `motion.limits.Values` that it bounds.
        unit: unit of the limit and of the quantity.
        per_cable: whether each cable has a value of its own.
        of_motion: whether the quantity depends on the motion of the effector, not on its pose alone.
        from_zero: whether 0 is allowed in addition to positive values; ignored for coordinates.
        description: text for the reference.
        legend: words for its colour in maps.
        colour: colour of cells that violate it.
        chart: chart of a motion that shows where it is violated; "": the chart of the path.
        peak: field of `motion.peaks.Peaks` that reports show under the name of the limit; "": none.
        seconds: time that its proof takes in a cell with 30 arcs; `CellCost.limits` of a kind of map multiplies it.
        of_winch: whether it is a limit of winches, a key of `[winch]` in robot files; the general proof alone knows
            these, so that families never see them.
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
    legend: str
    colour: str
    chart: str = ""
    peak: str = ""
    seconds: float = 6e-3
    of_winch: bool = False

    @property
    def allowed(self) -> str:
        """Allowed values, in words."""
        return "a number: z of the floor" if self.is_height else f"a number {'>=' if self.from_zero else '>'} 0"

    @property
    def is_height(self) -> bool:
        """Tell whether it is a height, which may have any sign, rather than a length or a rate."""
        return self.quantity == "depth"

    @property
    def of_mass_centre(self) -> bool:
        """Tell whether it bounds speed or acceleration of the mass centre."""
        return self.quantity.startswith("mass_centre")

    @property
    def extreme(self) -> str:
        """Peak of the quantity, in words, for the reference."""
        if self.of_winch:
            return f"Robots with winches: {self.description}; null without winches."
        quantity = self.quantity.removeprefix("mass_centre_")
        return f"{SENSES[self.sense]} {quantity} of {'any cable' if self.per_cable else 'the mass centre'}."


SENSES = {"least": "Smallest", "most": "Largest"}
FLOOR = "z of the floor, which no point of the effector passes: mass centre, attachment points, shape if it is given"


def _of_tension(name: str, flag: Verdict, words: str, sense: Literal["least", "most"], **more: Any) -> Limit:
    is_least = sense == "least"
    return Limit(name, flag, sense, "tension", "N", True, True, is_least, words, chart="tension", seconds=5e-4, **more)


def _of_cables(name: str, flag: Verdict, quantity: str, unit: str, *, of_motion: bool, **more: Any) -> Limit:
    words, peak = f"largest cable {quantity}", f"{quantity}_max"
    return Limit(name, flag, "most", quantity, unit, True, of_motion, False, words, peak=peak, **more)


def _of_mass_centre(name: str, flag: Verdict, quantity: str, unit: str, **more: Any) -> Limit:
    words, peak = f"largest {quantity} of the mass centre", f"mass_centre_{quantity}"
    return Limit(name, flag, "most", peak, unit, False, True, False, words, peak=peak, **more)


def _of_motors(name: str, flag: Verdict, unit: str, words: str, **more: Any) -> Limit:
    quantity = name.removesuffix("_max")
    return Limit(name, flag, "most", quantity, unit, True, True, False, words, peak=quantity, of_winch=True, **more)


# Rows are in the order of slacks. The floor is a z coordinate in files, and a largest depth in the kernels' axes.
LIMITS = (
    _of_tension(
        "tension_min", Verdict.SLACK_CABLE, "smallest tension", "least", legend="slack cable", colour="#56B4E9"
    ),
    _of_tension(
        "tension_max", Verdict.OVER_TENSION, "largest tension", "most", legend="too much tension", colour="#0072B2"
    ),
    Limit(
        "floor",
        Verdict.BELOW_FLOOR,
        "most",
        "depth",
        "m",
        False,
        False,
        True,
        FLOOR,
        legend="below the floor",
        colour="#6f6f6f",
        seconds=2e-4,
    ),
    _of_cables(
        "cable_length_max",
        Verdict.CABLE_TOO_LONG,
        "length",
        "m",
        of_motion=False,
        legend="cable too long",
        colour="#8c6d31",
        chart="length",
        seconds=3e-4,
    ),
    _of_cables(
        "cable_speed_max",
        Verdict.CABLE_TOO_FAST,
        "speed",
        "m/s",
        of_motion=True,
        legend="cable too fast",
        colour="#7b4173",
        chart="rate",
    ),
    _of_cables(
        "cable_acceleration_max",
        Verdict.CABLE_OVER_ACCELERATION,
        "acceleration",
        "m/s^2",
        of_motion=True,
        legend="cable acceleration",
        colour="#bd9e39",
        chart="rate",
        seconds=2e-3,
    ),
    _of_mass_centre(
        "speed_max", Verdict.TOO_FAST, "speed", "m/s", legend="too fast", colour="#A05195", chart="velocity"
    ),
    _of_mass_centre(
        "acceleration_max",
        Verdict.OVER_ACCELERATION,
        "acceleration",
        "m/s^2",
        legend="acceleration",
        colour="#D9B44A",
        chart="acceleration",
    ),
    _of_motors(
        "motor_speed_max",
        Verdict.MOTOR_TOO_FAST,
        "rad/s",
        "largest speed of the motor",
        legend="motor too fast",
        colour="#2A9D8F",
        chart="rate",
    ),
    _of_motors(
        "motor_torque_max",
        Verdict.MOTOR_OVER_TORQUE,
        "N m",
        "largest torque of the motor",
        legend="motor torque",
        colour="#E76F51",
        chart="tension",
    ),
    _of_motors(
        "motor_power_max",
        Verdict.MOTOR_OVER_POWER,
        "W",
        "largest power of the motor, driving or braking",
        legend="motor power",
        colour="#8AB17D",
        chart="tension",
    ),
    _of_motors(
        "motor_load_max",
        Verdict.MOTOR_OVER_LOAD,
        "1",
        "largest torque / motor_stall_torque + speed / motor_no_load_speed (1 where these are given)",
        legend="motor load",
        colour="#287271",
        chart="tension",
    ),
    _of_motors(
        "motor_torque_rms_max",
        Verdict.MOTOR_OVER_TORQUE_RMS,
        "N m",
        "largest root mean square of the motor's torque over the full motion",
        legend="motor heat",
        colour="#B56576",
        chart="tension",
    ),
)
