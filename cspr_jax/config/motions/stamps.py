"""Times of tables as they are written: stamps since 1970 have more digits than floats, and these show their unit."""

from __future__ import annotations

import re
from decimal import ROUND_FLOOR, Decimal

import numpy as np

from cspr_jax.config.motions.heads import TIMES
from cspr_jax.numerics.shapes import Float

# A whole number without a unit is a stamp in the unit in which it lies between these times, s since 1970.
EPOCH = (3e8, 5e9)
UNITS = ("ms", "us", "ns")
LARGE = 1e6  # floats hold smaller stamps to 1e-10
LONGEST = 60  # digits
CLOSER = 100.0  # a stamp nearly repeats if its step is that many times smaller than the median one
_DIGITS, _DECIMAL = re.compile(r"[0-9]+"), re.compile(r"[-+]?[0-9]+\.?[0-9]*")


def unit_of_stamps(cell: str) -> str | None:
    """Unit other than seconds in which a whole number is a time of our days."""
    if not _DIGITS.fullmatch(cell) or len(cell) > LONGEST:
        return None
    return next((unit for unit in UNITS if EPOCH[0] <= float(cell) * TIMES[unit] < EPOCH[1]), None)


class Stamps:
    """Times of a table less a whole number near the first one, where floats would lose digits of them."""

    def __init__(self, first: str = "0") -> None:
        is_large = _is_decimal(first) and abs(float(first)) >= LARGE
        self.offset = Decimal(first).to_integral_value(ROUND_FLOOR) if is_large else Decimal(0)

    def since(self, cell: str) -> float:
        """A time, less the offset."""
        return float(Decimal(cell) - self.offset) if _is_decimal(cell) else float(cell) - float(self.offset)

    def shown(self, t: float) -> str:
        """A time as the file has it."""
        return f"{Decimal(repr(t)) + self.offset:f}" if self.offset else repr(t)


def near_repeat(times: Float[np.ndarray, "n"]) -> tuple[int, float] | None:
    """First two stamps that nearly repeat."""
    steps = np.diff(times)
    steps = np.where(steps > 0.0, steps, np.inf)
    if len(steps) < 4:
        return None
    i, median = int(np.argmin(steps)), float(np.median(steps))
    first = int(np.argmax(steps * CLOSER < median))
    return (first, median / float(steps[first])) if steps[i] * CLOSER < median < np.inf else None


def _is_decimal(cell: str) -> bool:
    return len(cell) <= LONGEST and _DECIMAL.fullmatch(cell) is not None
