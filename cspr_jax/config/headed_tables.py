"""Tables of numbers below a line with the names of their columns, as CSV; each mistake names line and column.

Separators are commas, semicolons or tabs; units follow names in brackets, as in `x [mm]`. Empty cells, and those of
`GAPS`, are gaps. Lines that begin with # are comments.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from cspr_jax.config.motions.heads import parted, unit_of
from cspr_jax.config.motions.preamble import SEPARATORS, cells_of, has_content, is_comment, number_of
from cspr_jax.config.reading import decoded, opened
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, shown
from cspr_jax.errors.suggestions import look_alike
from cspr_jax.numerics.shapes import Float

LARGEST_FILE = 1 << 28  # bytes
LARGEST_ROWS = 2_000_000
LARGEST_NUMBER = 1e12
GAPS = ("", "nan", "na", "null", "none")


@dataclasses.dataclass(frozen=True)
class HeadedTable:
    """A table that has been read up to its cells.

    Fields:
        path: its file.
        head_line: line of the names.
        heads: names as written, with units.
        separator: of the cells.
        rows: text of the rows, with the numbers of their lines.
    """

    path: Path
    head_line: int
    heads: list[str]
    separator: str
    rows: list[tuple[int, str]]

    @property
    def lines(self) -> tuple[int, ...]:
        """Numbers of the lines of the rows."""
        return tuple(line for line, _ in self.rows)

    def error(self, message: str, column: int | None = None) -> ConfigError:
        """A mistake in the line of the names."""
        label = "" if column is None else f", column {column + 1}: {shown(self.heads[column])}"
        return ConfigError(self.path, f"line {self.head_line}{label}: {message}")

    def name_and_unit(self, column: int) -> tuple[str, str]:
        """Name of a column, in small letters, and its unit as written, or empty."""
        return parted(self.heads[column])

    def factor(self, column: int, units: Mapping[str, float]) -> float:
        """Factor from the unit of a column, one of `units`, to SI; without a unit 1."""
        unit = self.name_and_unit(column)[1]
        if not unit:
            return 1.0
        word = unit if unit in units else unit_of(unit)
        if word not in units:
            raise self.error(f"unit {shown(unit)}: must be {either(tuple(units)) if units else 'absent'}", column)
        return units[word]

    def numbers(self, columns: Sequence[int], factors: Sequence[float]) -> Float[np.ndarray, "n c"]:
        """Numbers of some columns, times factors, with NaN for gaps."""
        table = np.full((len(self.rows), len(columns)), np.nan)
        for i, (line, text) in enumerate(self.rows):
            is_plain = text.isascii() and not any(sign in text for sign in '"#_')
            cells = text.split(self.separator) if is_plain else cells_of(text, self.separator)
            if len(cells) != len(self.heads):
                count = f"{len(cells)} values: must be {len(self.heads)}, as in the header"
                raise ConfigError(self.path, f"line {line}: {count}")
            for k, column in enumerate(columns):
                try:
                    table[i, k] = float(cells[column]) if is_plain else self._number(line, column, cells[column])
                except ValueError:
                    table[i, k] = self._number(line, column, cells[column])
                if abs(table[i, k]) > LARGEST_NUMBER:
                    raise self._refused(line, column, cells[column])
        return table * np.asarray(factors)

    def _number(self, line: int, column: int, cell: str) -> float:
        cell = cell.strip()
        if cell.lower() in GAPS:
            return math.nan
        number = number_of(cell) if self.separator != "," or "," not in cell else math.nan
        if math.isnan(number):
            raise self._refused(line, column, cell)
        return number

    def _refused(self, line: int, column: int, cell: str) -> ConfigError:
        cell, name = cell.strip(), self.name_and_unit(column)[0]
        label = f"line {line}, column {column + 1}: {name} = {shown(cell)}"
        return ConfigError(self.path, f"{label}: must be a finite number, or empty{look_alike(cell[:100])}")


def read_headed(path: Path, words: str) -> HeadedTable:
    """Read a table; `words` say what its columns must be."""
    with opened(path) as file:
        data = file.read(LARGEST_FILE + 1)
    if len(data) > LARGEST_FILE:
        raise ConfigError(path, f"is longer than {LARGEST_FILE} bytes: must be shorter")
    if data.startswith((b"\x89HDF", b"PK\x03\x04")):
        raise ConfigError(path, "is not a table of text: must be CSV")
    lines = decoded(data, path).split("\n")
    rows = [(i, line) for i, line in enumerate(lines, 1) if not is_comment(line) and has_content(line)]
    if len(rows) < 2:
        count = "a header line alone" if rows else "is empty"
        raise ConfigError(path, f"{count}: must be a line with names of columns, {words}, and rows below it")
    if len(rows) - 1 > LARGEST_ROWS:
        raise ConfigError(path, f"{len(rows) - 1} rows: must be at most {LARGEST_ROWS}")
    (head_line, head), *body = rows
    separator = next((separator for separator in SEPARATORS if separator in head), ",")
    return HeadedTable(path, head_line, cells_of(head, separator), separator, body)
