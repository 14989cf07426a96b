"""Lines above the rows of a table: names of columns, units, directives and comments, each read once.

Names stand in a line of their own, or else in the last comment above the rows that has a name for each column. A note
tells the user of comments that mention columns in another way; rows that contradict them are refused.
"""

import csv
import math
import re
from pathlib import Path

from cspr_jax.config.motions.columns import MotionColumns, columns, directives, identified, plain_names
from cspr_jax.config.motions.heads import NO_UNIT, is_unit, kind_of_unit, mentioned, units_within
from cspr_jax.errors import ConfigError, shown

COMMENT_SIGNS = ("#", "%")
SEPARATORS = (";", "\t", ",")
MAX_COLUMNS = 1000
LARGEST_COMMENTS = 1 << 18  # largest number of letters of all comments above the rows
MAX_HINTS = 3  # largest number of notes about comments
LONGEST_COMMENT = 1 << 16  # letters; longer comments do not name columns
_SEPARATOR_LINE = re.compile(r"\"?sep=(.)\"?[,;\t ]*", re.IGNORECASE)
# A word and the unit in brackets behind it, or a unit alone.
_BLANK_SEPARATED = re.compile(r"[^\s\[(]*\s*\[[^\]]*\]|[^\s\[(]*\s*\([^)]*\)|\S+")
_COMMENT_BEHIND = re.compile(r"\s#")
_OF_COLUMNS = re.compile(r"\b(units?|times?|positions?|lengths?|distances?|coordinates?|angles?)\b")
_PLAIN_NUMBER = re.compile(r"[-+]?[0-9.,]+(e[-+]?[0-9]+)?|[-+]?(nan|inf|infinity)", re.IGNORECASE)


class Preamble:
    """Lines above the rows of a table, fed one after another up to the first row."""

    def __init__(self, path: Path, has_times: bool) -> None:
        self.path, self.has_times = path, has_times
        self.delimiter: str | None = None
        self.tail = 0  # empty cells at the end of each row, as spreadsheets write them
        self.directives: dict[str, str] = {}
        self.columns: MotionColumns
        self._comments: list[tuple[int, str]] = []
        self._comment_length = 0
        self._names: tuple[int, str] | None = None
        self._units: list[str] | None = None

    def takes(self, line: int, text: str) -> bool:
        """Read a line, unless it is the first row; tell whether it was read."""
        if is_comment(text):
            self._comment_length += len(text)
            if self._comment_length > LARGEST_COMMENTS:
                raise ConfigError(
                    self.path, f"line {line}: more than {LARGEST_COMMENTS} letters of comments: must be above fewer"
                )
            self._comments.append((line, text.strip(' \t"').rstrip(",;").lstrip("#%! \t")))
            return True
        if not has_content(text):
            return True
        if self._names is None and self._units is None:
            return self._first(line, text)
        if self._units is None and self._is_row_of_units(text):
            self._units = cells_of(text, self.delimiter)
            return True
        self._finish(text)
        return False

    def end(self) -> None:
        """Check the names of a table without rows."""
        if self._names is not None:
            self._finish(None)

    def _first(self, line: int, text: str) -> bool:
        match = _SEPARATOR_LINE.fullmatch(text.strip(" \n"))
        if match is not None:
            self.delimiter = match[1]
            return True
        cells = cells_of(text, self._delimiter_of(text))
        cells = cells[: len(cells) - _empty_at_end(cells)]
        is_row = all(is_number(cell) for cell in cells)
        if is_row or (any(is_number(cell) for cell in cells) and self._names_row(cells)):
            self._finish(text, line)
            return False
        self._names = (line, text)
        return True

    def _delimiter_of(self, text: str) -> str | None:
        if self.delimiter is not None and self.delimiter in text:
            return self.delimiter
        return next((separator for separator in SEPARATORS if separator in text), None)

    def _names_row(self, cells: list[str]) -> bool:
        # Tell whether comments name the columns of a row in which columns that are not read hold text.
        _, heads = self._named_by_comment(len(cells))
        if heads is None:
            return False
        parts, _ = identified(heads, self.has_times)
        return all(is_number(cell) for cell, part in zip(cells, parts, strict=True) if part.name)

    def _is_row_of_units(self, row: str) -> bool:
        _, names = self._names or (0, "")
        self._set_delimiter(names, row)
        heads, cells = self._heads(names), cells_of(row, self.delimiter)
        if len(cells) > len(heads) or any(is_number(cell) and cell not in NO_UNIT for cell in cells):
            return False
        return _are_units(cells, [part.name for part in identified(heads, self.has_times)[0]])

    def _set_delimiter(self, names: str | None, row: str | None) -> None:
        # Rows may have another separator than the names above them.
        first = names if names is not None else row
        delimiter = self._delimiter_of(first or "")
        if names is not None and row is not None and (delimiter is None or delimiter not in row):
            other = self._delimiter_of(row)
            if other != delimiter and len(cells_of(row, other)) == len(_split(names, delimiter)):
                delimiter = other
        self.delimiter = delimiter

    def _heads(self, names: str) -> list[str]:
        text = _COMMENT_BEHIND.split(names)[0].strip(" \n")
        return _split(text, self._delimiter_of(text))

    def _finish(self, row: str | None, line: int = 0) -> None:
        self.directives = directives(self._comments, self.path)
        line, names = self._names or (line, None)
        self._set_delimiter(names, row)
        cells = [] if row is None else cells_of(row, self.delimiter)
        heads = None if names is None else self._heads(names)
        empty = _empty_at_end(cells)
        if heads is not None:
            spare = _empty_at_end(heads)
            heads = heads[: len(heads) - spare]
            # Empty cells in columns that have a name are missing values.
            self.tail = max(spare, min(empty, len(cells) - len(heads)))
        else:
            self.tail = empty
        count = len(cells) - self.tail if heads is None else len(heads)
        if count > MAX_COLUMNS:
            raise ConfigError(self.path, f"line {line}: {count} columns: must be at most {MAX_COLUMNS}")
        named, names_line = line, heads
        if heads is None:
            named, names_line = self._named_by_comment(count)
        units = dict(enumerate(self._units or ())) or self._commented_units(count, names_line)
        notes = self._refuse_contradictions(count, heads is None, names_line is None, bool(units), names_line or [])
        common = self.directives.get("units", "")
        self.columns = columns(
            names_line, count, common, self.path, named or line, has_times=self.has_times, own_units=units, notes=notes
        )

    def _named_by_comment(self, count: int) -> tuple[int, list[str] | None]:
        # Line number and heads of the last comment that has a name for each column.
        for line, text in reversed(self._comments):
            for heads in _readings(text, count):
                names = {part.name for part in identified(heads, self.has_times)[0]}
                needed = ("t", "x", "z") if self.has_times else ("x", "z")
                if names.issuperset(needed) and not _are_units(heads, heads):
                    return line, heads
        return 0, None

    def _commented_units(self, count: int, heads: list[str] | None) -> dict[int, str]:
        # Units from the last comment that consists of one unit for each column, or of the names of a header with units.
        plain = plain_names(count, self.has_times)
        names = list(plain) if heads is None else [part.name for part in identified(heads, self.has_times)[0]]
        if len(names) != count:
            return {}
        for _, text in reversed(self._comments):
            for words in _readings(text, count):
                if _are_units(words, names):
                    return dict(enumerate(words))
                parts = identified(words, self.has_times)[0]
                if heads is not None and {part.name for part in parts} == set(names):
                    units = {part.name: part.unit for part in parts}
                    return {k: units[name] for k, name in enumerate(names)}
        return {}

    def _refuse_contradictions(
        self, count: int, is_bare: bool, is_unnamed: bool, has_units: bool, heads: list[str]
    ) -> list[str]:
        # Refuse comments that seem to name columns or units, in a form that is not read, where nothing else names
        # them; return notes about the other comments.
        free = [(line, text) for line, text in self._comments if len(text) <= LONGEST_COMMENT and not _is_said(text)]
        plain = plain_names(count, self.has_times)
        spoken = [(line, text, mentioned(text)) for line, text in free]
        if is_unnamed:
            for line, text, names in spoken:
                if len({*names}) >= 2 and not _in_order(names, plain) and _readings(text, count):
                    self._refuse_names(line, text, names, plain)
            everything = [name for _, _, names in spoken for name in names]
            if len({*everything}) >= 3 and not _in_order(everything, plain):
                line, text, _ = next(entry for entry in spoken if entry[2])
                self._refuse_names(line, text, everything, plain)
        notes = [
            f"line {line}: hint: a comment speaks of {', '.join(dict.fromkeys(names))}: {shown(text)}"
            for line, text, names in spoken
            if names and is_unnamed
        ][:MAX_HINTS]
        if (
            has_units
            or "units" in self.directives
            or any(kind_of_unit(part.unit) for part in identified(heads, True)[0])
        ):
            return notes
        for line, text, names in spoken:
            units = units_within(text)
            is_about = bool(names) or _OF_COLUMNS.search(text.lower()) is not None
            if units and is_unnamed and is_about:
                raise ConfigError(
                    self.path,
                    f"line {line}: a comment speaks of {units[0]}, {shown(text)}: must say units as # units: "
                    f"{', '.join(dict.fromkeys(units))}, or behind names, as x [{units[0]}]",
                )
            if units and (is_bare or is_about) and len(notes) < MAX_HINTS:
                notes.append(
                    f"line {line}: hint: a comment speaks of {units[0]}, but columns are taken in s, m and rad"
                )
        return notes

    def _refuse_names(self, line: int, text: str, names: list[str], plain: tuple[str, ...]) -> None:
        words = ", ".join(dict.fromkeys(names))
        order = f", which would be taken as {', '.join(plain)}" if plain else ""
        raise ConfigError(
            self.path,
            f"line {line}: a comment speaks of columns {words}, {shown(text)}, but names not each of them{order}: must "
            "be a line with a name for each column",
        )


def is_comment(text: str) -> bool:
    """Tell whether a line is nothing but a comment, possibly quoted by a spreadsheet."""
    return text.lstrip(' \t"').startswith(COMMENT_SIGNS)


def has_content(text: str) -> bool:
    """Tell whether a line has a cell with content."""
    return not text.lstrip().startswith("%") and bool(text.split("#")[0].strip(" \t,;\n"))


def cells_of(row: str, delimiter: str | None) -> list[str]:
    """Cells of a row."""
    text = row.split("#")[0].strip(" \n")
    if '"' in text and delimiter is not None:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))]
    return [cell.strip().strip('"').strip() for cell in text.split(delimiter)]


def is_number(cell: str) -> bool:
    """Tell whether a cell is a number."""
    return not math.isnan(number_of(cell)) or cell.strip().lower().lstrip("+-") == "nan"


def number_of(cell: str) -> float:
    """A cell as a number."""
    try:
        return float(cell.replace(",", ".")) if cell.isascii() and "_" not in cell else math.nan
    except ValueError:
        return math.nan


def _split(text: str, delimiter: str | None) -> list[str]:
    # Heads; blanks part names, but not a name and its unit.
    if delimiter is not None:
        return [cell.strip().strip("\"'").strip() for cell in text.split(delimiter)]
    return [word.strip().strip("\"'") for word in _BLANK_SEPARATED.findall(text)]


def _empty_at_end(cells: list[str]) -> int:
    filled = [k for k, cell in enumerate(cells) if cell]
    return max(len(cells) - 1, 0) - max(filled, default=0)


def _readings(text: str, count: int) -> list[list[str]]:
    # All ways to split a comment into that number of words, with and without a first part that ends in a colon.
    if len(text) > LONGEST_COMMENT:
        return []
    readings = []
    for body in dict.fromkeys((text, text.partition(":")[2], text.partition("=")[2])):
        plain = body.strip()
        if plain[:1] + plain[-1:] in ("[]", "()", "{}") and not any(bracket in plain[1:-1] for bracket in "[](){}"):
            plain = plain[1:-1]
        for delimiter in (*SEPARATORS, "|", None):
            if delimiter is not None and delimiter not in plain:
                continue
            words = _split(plain, delimiter)
            words = words[: len(words) - _empty_at_end(words)] if len(words) > count else words
            if len(words) == count and count > 1 and not all(_PLAIN_NUMBER.fullmatch(word) for word in words):
                readings.append(words)
    return readings


def _are_units(words: list[str], names: list[str]) -> bool:
    read = [word for word, name in zip(words, names, strict=False) if name]
    return any(map(is_unit, read)) and all(is_unit(word) or word.strip("[]()") in NO_UNIT for word in read)


def _is_said(text: str) -> bool:
    # Tell whether a comment is a directive, such as for units.
    return text.partition(":")[0].strip().lower() in ("units", "unit", "z", "z_axis", "point", "interpolation", "ends")


def _in_order(names: list[str], plain: tuple[str, ...]) -> bool:
    # Tell whether names are in the order that is assumed for columns without names.
    left = iter(plain)
    return all(name in left for name in dict.fromkeys(names))
