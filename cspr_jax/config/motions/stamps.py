"""Times of tables as written: stamps since 1970 have more digits than floats, and their size shows their unit."""

from __future__ import annotations

import re
from decimal import ROUND_FLOOR, Decimal

import numpy as np

from cspr_jax.config.motions.heads import TIMES
from cspr_jax.numerics.shapes import Float

# An integer without a unit is a stamp in that unit in which it lies between these times, s since 1970.
EPOCH = (3e8, 5e9)
UNITS = ("ms", "us", "ns")
LARGE = 1e6  # floats resolve smaller stamps to 1e-10
LONGEST = 60  # largest number of digits of a stamp
CLOSER = 100.0  # a stamp nearly repeats the one before if the step is this many times smaller than the median step
_DIGITS, _DECIMAL = re.compile(r"[0-9]+"), re.compile(r"[-+]?[0-9]+\.?[0-9]*")


def unit_of_stamps(cell: str) -> str | None:
    """Unit other than seconds in which an integer is a time between those of `EPOCH`."""
    if not _DIGITS.fullmatch(cell) or len(cell) > LONGEST:
        return None
    return next((unit for unit in UNITS if EPOCH[0] <= float(cell) * TIMES[unit] < EPOCH[1]), None)


class Stamps:
    """Times of a table, with an integer offset subtracted where floats would lose their last digits."""

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
    """Index of the first stamp that the next one nearly repeats, and the median step over the step between them."""
    steps = np.diff(times)
    steps = np.where(steps > 0.0, steps, np.inf)
    if len(steps) < 4:
        return None
    i, median = int(np.argmin(steps)), float(np.median(steps))
    first = int(np.argmax(steps * CLOSER < median))
    return (first, median / float(steps[first])) if steps[i] * CLOSER < median < np.inf else None


def _is_decimal(cell: str) -> bool:
    return len(cell) <= LONGEST and _DECIMAL.fullmatch(cell) is not None
