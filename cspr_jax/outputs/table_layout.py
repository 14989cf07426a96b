"""A published table in its printed layout, with published and computed numbers in each cell."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from cspr_jax.runtime import terminal

MISMATCH = "!="
UNKNOWN = "?"
NOTHING = "none"
LEGEND = (
    f"Each cell: published / computed, with as many digits as printed. {MISMATCH}: they differ by more than the "
    f"rounding of these digits. {UNKNOWN}: not printed, or not known. {NOTHING}: no feasible number was found."
)
# Heads of columns in place of their names in JSON.
_HEADS = {"feasible_at_infinity": "p to infinity", "T": "T (s)", "proportion": "proportion (%)"}
WIDEST = 10  # largest number of columns of a table that is shown in one block
SIDE_BY_SIDE = 6  # number of columns of each block of a wider table
DIGIT_ERROR = 1e-9  # rounding error of a number, and relative one of half a unit of its last digit


@dataclasses.dataclass(frozen=True)
class Cell:
    """One cell of a table.

    Fields:
        row: head of the row, as printed.
        column: head of the column as printed, or its name.
        computed: number that this program computed; None where there is none.
        printed: number as printed in the source; "" where it is not printed, or not known.
        variant: interpretation of the source, where there are several.
    """

    row: str
    column: str
    computed: float | None
    printed: str
    variant: str = ""

    @property
    def published(self) -> float | None:
        """The printed number; whole where it has no decimals."""
        if not self.printed:
            return None
        return float(self.printed) if "." in self.printed else int(self.printed)

    @property
    def differs(self) -> bool:
        """Tell whether the computed number differs from the printed one by more than the rounding of its digits."""
        if self.published is None:
            return False
        half = 0.5 * 10.0 ** -_decimals(self.printed)
        return self.computed is None or abs(self.computed - self.published) > half * (1.0 + DIGIT_ERROR) + DIGIT_ERROR


def grid(
    title: str,
    cells: Sequence[Cell],
    *,
    transposed: bool = False,
    heads: Mapping[str, str] = MappingProxyType({}),
    reading: str = "",
    is_full: bool = False,
    reason: Callable[[Cell], str] = lambda _: "",
) -> Any:
    """A table for a terminal: a block for each interpretation of the source, or only for the one that fits."""
    from rich.console import Group  # only a terminal needs it

    variants = list(dict.fromkeys(cell.variant for cell in cells))
    reading = reading if reading in variants else ""
    variants.sort(key=lambda name: name != reading)
    blocks: list[Any] = []
    reasons: dict[str, str] = {}  # reasons with their letters
    for name in variants:
        cells_of_variant = [cell for cell in cells if cell.variant == name]
        letters = {cell: _letter(reason(cell), reasons) for cell in cells_of_variant if cell.differs}
        if reading and name != reading and not is_full:
            blocks.append(terminal.cell(_in_a_line(name, cells_of_variant, letters)))
            continue
        words = f"{name} (the reading that the printed numbers fit)" if name and name == reading else name
        blocks += [terminal.cell(words, style="bold")] if name else []
        across = list(dict.fromkeys(cell.row if transposed else cell.column for cell in cells_of_variant))
        step = SIDE_BY_SIDE if len(across) > WIDEST else len(across)
        for first in range(0, len(across), step):
            heads_of_block = across[first : first + step]
            part = [cell for cell in cells_of_variant if (cell.row if transposed else cell.column) in heads_of_block]
            blocks.append(_block(part, transposed, _HEADS | dict(heads), letters))
    lines = [terminal.cell(f"{letter}: {text}") for text, letter in reasons.items()]
    return Group(terminal.cell(title, style="italic"), *blocks, *lines, terminal.cell(LEGEND, style="dim"))


def _letter(text: str, reasons: dict[str, str]) -> str:
    # Reasons are lettered in the order in which they appear.
    return reasons.setdefault(text, f"[{chr(ord('a') + len(reasons))}]") if text else ""


def _in_a_line(name: str, cells: list[Cell], letters: Mapping[Cell, str]) -> str:
    printed = [cell for cell in cells if cell.printed]
    listed = " ".join(sorted({letter for letter in letters.values() if letter}))
    words = f"{len(letters)} of {len(printed)} cells differ {listed}".rstrip() if letters else "no cell differs"
    return f"{name}: {words}"


def _block(cells: list[Cell], transposed: bool, heads: Mapping[str, str], letters: Mapping[Cell, str]) -> Any:
    from rich.table import Table

    table = Table()
    by = {(cell.column, cell.row) if transposed else (cell.row, cell.column): cell for cell in cells}
    rows, columns = (list(dict.fromkeys(key[i] for key in by)) for i in (0, 1))
    table.add_column("")
    for name in columns:
        table.add_column(terminal.cell(heads.get(name, name)), justify="right", no_wrap=True)
    for row in rows:
        cells_of_row = [by.get((row, column)) for column in columns]
        texts = [terminal.cell("") if one is None else _text(one, cells, letters.get(one, "")) for one in cells_of_row]
        table.add_row(terminal.cell(heads.get(row, row)), *texts)
    return table


def _text(cell: Cell, cells: list[Cell], letter: str) -> Any:
    text = f"{cell.printed or UNKNOWN} / {computed_text(cell, cells)}"
    if not cell.differs:
        return terminal.cell(text)
    return terminal.cell(f"{text} {MISMATCH} {letter}".rstrip(), style="bold red")


def computed_text(cell: Cell, cells: list[Cell]) -> str:
    """The computed number with the digits of the printed one, or of its column."""
    if cell.computed is None:
        return NOTHING
    printed = [other.printed for other in cells if other.column == cell.column and other.printed]
    if cell.printed or printed:
        decimals = _decimals(cell.printed) if cell.printed else min(map(_decimals, printed))
        return f"{round(cell.computed, decimals) + 0.0:.{decimals}f}"  # no -0
    return f"{cell.computed:.0f}" if abs(cell.computed) >= 1000.0 else f"{cell.computed:.4g}"


def two_digits(value: float) -> str:
    """A number with two significant digits."""
    text = f"{value:.2g}"
    return f"{value:.0f}" if "e+" in text else text


def _decimals(printed: str) -> int:
    return len(printed.partition(".")[2])
