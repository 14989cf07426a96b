"""Times of tables as they are written: stamps since 1970 have more digits than floats, and tell their unit by them."""

import re
from decimal import ROUND_FLOOR, Decimal

from cspr_jax.config.motions.heads import TIMES

# Whole stamps without a unit that are instants between these, s since 1970, have digits enough to tell their unit.
EPOCH = (3e8, 5e9)
UNITS = ("ms", "us", "ns")
LARGE = 1e6  # floats hold smaller stamps to 1e-10
LONGEST = 60  # digits
_WHOLE, _DECIMAL = re.compile(r"[0-9]+"), re.compile(r"[-+]?[0-9]+\.?[0-9]*")


def unit_of_stamps(cell: str) -> str | None:
    """Unit in which a whole number is an instant of our days, but for seconds."""
    if not _WHOLE.fullmatch(cell) or len(cell) > LONGEST:
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


def _is_decimal(cell: str) -> bool:
    return len(cell) <= LONGEST and _DECIMAL.fullmatch(cell) is not None
