"""Cause: a criterion because of which a motion is not feasible, in numbers."""

import dataclasses
import math
from typing import Any

from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import CRITERIA, Verdict

DIGITS, MOST_DIGITS = 3, 12  # digits of the numbers needed and allowed; more than DIGITS only where these look equal
ON_PLANE = 1e-9  # m; heights above the spools up to this are rounding errors, which texts leave out
# Text of each flag; {cable} is "cable 1", or "cables 1 and 3".
_WORDS = {
    Verdict.SLACK_CABLE: "{cable} has {needed} {unit}{when}, at least {allowed} needed",
    Verdict.ABOVE_SPOOLS: "{missed} {unit} above the plane of the spools{when}",
    Verdict.BELOW_FLOOR: "z = {needed} {unit}{when}, the floor is at {allowed}",
    Verdict.SINGULAR: "the cables cannot carry every wrench{when}",
    Verdict.CABLE_CABLE: "{cable} touch{when}",
    Verdict.OBSTACLE: "{body} is {needed} {unit} from {obstacle}{when}, at least {allowed} needed",
    Verdict.CABLE_PLATFORM: "a cable touches the platform{when}",
    Verdict.WRENCH_INFEASIBLE: "the tensions miss their limits by {missed} {unit}{when}",
    Verdict.UNDECIDED: "neither proved nor refuted{when}: {needed} {unit}, and {allowed} {unit} is the limit",
    Verdict.UNCERTAINTY: "it stands {allowed} of the uncertainty, {needed} needed",
}
_WORDS[Verdict.OVER_FEED] = "the mass centre needs {needed} {unit}{when}, the feed allows {allowed}"
_WORDS |= dict.fromkeys(
    (row.flag for row in LIMITS if row.of_mass_centre), "the mass centre needs {needed} {unit}{when}, {allowed} allowed"
)
_WORDS |= {row.flag: "motor {numbers} needs {needed} {unit}{when}, {allowed} allowed" for row in LIMITS if row.of_winch}
_WORDS[Verdict.MOTOR_OVER_TORQUE_RMS] = (
    "motor {numbers} needs {needed} {unit} as root mean square over the full motion, {allowed} allowed"
)
_OF_MOTORS = {row.flag: "its " + row.description.removesuffix(" of the motor") for row in LIMITS if row.of_winch}
# Redundant cables, whose tensions can be chosen.
_TOGETHER = "the tensions at which each motor keeps {quantity} miss their limits by {missed} {unit}{when}"
UNITS = {flag: row.unit for flag, row in CRITERIA.items()} | {Verdict.UNCERTAINTY: "1"}
_USUAL = "{cable} needs {needed} {unit}{when}, {allowed} allowed"


@dataclasses.dataclass(frozen=True)
class Cause:
    """A criterion because of which a segment is not feasible.

    Fields:
        criterion: name of its flag, as in verdicts.
        cables: indices from 0 on: of one cable, of two that touch, or none.
        t: time of the worst violation, from the start of the segment, s; NaN where it is not known.
        needed: value of the segment at that time, in the axes of the robot file; NaN where it is not known.
        allowed: largest, or smallest, value that is allowed.
        unit: unit of both; "" where there are none.
        obstacle: name of the obstacle that is touched; "" where none is.
        digits: digits of numbers in the text; None: as many as tell needed and allowed apart.
    """

    criterion: str
    cables: tuple[int, ...] = ()
    t: float = math.nan
    needed: float = math.nan
    allowed: float = math.nan
    unit: str = ""
    obstacle: str = ""
    digits: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """The cause as a plan's JSON has it."""
        table: dict[str, Any] = {"criterion": self.criterion, "cable": self.cables[0] if self.cables else None}
        if len(self.cables) > 1:
            table["cables"] = list(self.cables)
        if self.obstacle:
            table["obstacle"] = self.obstacle
        return table | {"t": self.t, "needed": self.needed, "allowed": self.allowed, "unit": self.unit or None}

    @property
    def text(self) -> str:
        """The cause in words, such as "cable 1 needs 3.07 m/s at t = 0.75 s, 2.5 allowed"."""
        flag, numbers = Verdict[self.criterion.upper()], " and ".join(str(k + 1) for k in self.cables)
        if not math.isfinite(self.needed) and flag not in (Verdict.SINGULAR, Verdict.CABLE_PLATFORM):
            return flag.text.replace("_", " ")
        time = f"{self.t:.2f}" if self.digits is None else f"{self.t:.{self.digits}g}"
        when = f" at t = {time} s" if math.isfinite(self.t) else ""
        if flag is Verdict.ABOVE_SPOOLS and not -self.needed > ON_PLANE:
            return f"on the plane of the spools{when}"
        needed, allowed = _told_apart(self.needed, self.allowed, self.digits or DIGITS)
        is_together = not self.cables and flag in _OF_MOTORS
        return (_TOGETHER if is_together else _WORDS.get(flag, _USUAL)).format(
            quantity=_OF_MOTORS.get(flag, ""),
            numbers=numbers,
            cable=f"cable{'s' if len(self.cables) > 1 else ''} {numbers}",
            needed=needed,
            allowed=allowed,
            missed=f"{max(0.0, -self.needed):.{self.digits or DIGITS}g}",
            body=f"cable {numbers}" if numbers else "the platform",
            obstacle=self.obstacle or "an obstacle",
            unit=self.unit.replace("^2", "²"),
            when=when,
        )


def _told_apart(first: float, second: float, fewest: int) -> tuple[str, str]:
    # Write two numbers with as few digits as tell them apart.
    for digits in range(fewest, max(fewest, MOST_DIGITS) + 1):
        texts = tuple(f"{value:.{digits}g}" for value in (first, second))
        if texts[0] != texts[1]:
            break
    return texts[0], texts[1]
