"""Row of the table of quantities."""

import dataclasses
from typing import Literal

# By type, narrower ones in which earlier versions stored the same numbers.
EARLIER = {"uint32": ("uint16",)}


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A dataset of a result file, or a coordinate of its axes.

    Fields:
        name: of the dataset.
        units: as in UDUNITS; "1" for a pure number.
        long_name: a short phrase for labels.
        description: one sentence.
        kind: "float" (of the run's dtype) or the NumPy name of an integer type.
        unflagged: of flags of a verdict: what pictures say where none is set; empty: it is no verdict.
        signed: whether either sign is as good as the other, so that zero is in the middle of a picture's colours.
        meanings: of whole numbers that stand for words: their row of `schema.meanings.MEANINGS`; empty: they do not.
        contoured: whether sections of it show where it is a whole number.
        better: of two cells' numbers, which one is better; empty: neither.
    """

    name: str
    units: str
    long_name: str
    description: str
    kind: Literal["float", "uint32", "uint16", "int16"] = "float"
    unflagged: str = ""
    signed: bool = False
    meanings: str = ""
    contoured: bool = False
    better: Literal["", "smaller", "larger"] = ""

    @property
    def readable(self) -> tuple[str, ...]:
        """NumPy names of the types that files have it in, its own first."""
        return ("float64", "float32") if self.kind == "float" else (self.kind, *EARLIER.get(self.kind, ()))
