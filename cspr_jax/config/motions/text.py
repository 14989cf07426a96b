"""Tables of motions as text, such as CSV: streamed, so that the number of rows is not limited by memory.

Separators are commas, semicolons, tabs or spaces; with semicolons and tabs, decimal commas are read too. Error messages
name the line of the file and the column.
"""

import dataclasses
import io
import math
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from cspr_jax.config.formats.model import LARGEST_NUMBER
from cspr_jax.config.motions.columns import MotionColumns
from cspr_jax.config.motions.heads import TIMES
from cspr_jax.config.motions.preamble import Preamble, cells_of, has_content, is_number, number_of
from cspr_jax.config.motions.stamps import Stamps, near_repeat, unit_of_stamps
from cspr_jax.config.motions.table import MotionTable
from cspr_jax.config.reading import decoded, opened
from cspr_jax.errors import ConfigError, shown
from cspr_jax.errors.suggestions import look_alike

BLOCK = 4 << 20  # number of bytes that are read at a time
LARGEST_LINE = 1 << 16
MAX_ROWS = 1_000_000  # largest number of rows of a table that is read in full
WINDOW = 200_000  # number of rows of a window
# Number of rows of the neighbours that a window includes on each side: from one row to the next, the influence of a row
# on a spline falls by a factor of 0.27 (cubic) or 0.43 (quintic).
OVERLAP = 100
# Quaternions whose norm is within UNIT of 1 count as unit ones; others from SHORTEST to LONGEST are normalised with a
# note, and all others refused.
UNIT = 1e-3
SHORTEST = 0.5
LONGEST = 2.0
MEETING = 1e-6  # largest jump of positions or velocities where legs meet, as a fraction of their largest values

EMPTY = (",", ";", "\t", " ")  # first characters of lines that may consist of separators alone
_COMMENT_LINE = re.compile(r"^[ \t]*%.*$", re.MULTILINE)
_EMPTY_LINE = re.compile(r"^[,;\t ]+$", re.MULTILINE)


class TooLongError(ConfigError):
    """A table with too many rows to be read in full."""


@dataclasses.dataclass(frozen=True)
class MotionWindow:
    """Consecutive rows of a table, with some of the rows before and after them.

    Fields:
        table: all these rows.
        first: index, in `table`, of the row at which the window itself begins and the window before it ends.
        last: index, in `table`, of the last row of the window itself.
        is_last: whether it is the last window.
    """

    table: MotionTable
    first: int
    last: int
    is_last: bool


def read(path: Path, *, has_times: bool = True) -> MotionTable:
    """A table of a motion, or of the points of a path, read in full."""
    window = next(windows(path, MAX_ROWS, has_times=has_times))
    if not window.is_last:
        raise TooLongError(path, f"more than {MAX_ROWS} rows: must be fewer where a motion is read as a whole")
    return window.table


def windows(path: Path, rows: int = WINDOW, *, has_times: bool = True) -> Iterator[MotionWindow]:
    """A table of a motion, window by window."""
    reader = _Reader(path, has_times)
    pending, first, count = np.empty((0, 0)), 0, 0
    for block in reader.blocks():
        pending = np.concatenate([pending, block]) if len(pending) else block
        count += len(block)
        while len(pending) > first + rows + OVERLAP + 1:
            last = first + rows
            yield MotionWindow(reader.table(pending[: last + OVERLAP + 1]), first, last, is_last=False)
            pending, first = pending[last - OVERLAP :], OVERLAP
    if count < 2:
        words = "a time and a position" if has_times else "a position"
        raise ConfigError(path, f"{count} rows: must be two or more, each with {words}")
    yield MotionWindow(reader.table(pending), first, len(pending) - 1, is_last=True)


class _Reader:
    def __init__(self, path: Path, has_times: bool) -> None:
        self.path, self.has_times = path, has_times
        self.notes: dict[str, None] = {}
        self.previous: np.ndarray | None = None
        self.preamble = Preamble(path, has_times)
        self.columns: MotionColumns
        self.delimiter: str | None = None
        self.stamps = Stamps()
        self.is_close = False  # whether the user has been told that stamps nearly repeat
        self.converters: dict[int | str, Callable[[str], float]] = {}

    def blocks(self) -> Iterator[np.ndarray]:
        # Rows (n, columns) in the units of the file, checked.
        is_above = True
        for line, text in _texts(self.path):
            start, body = line, text
            if not text.strip(" \t,;\n"):
                continue
            if is_above:
                above = self._above(text, line)
                if above is None:
                    continue
                is_above, start, body = False, line + above, text.split("\n", above)[-1]
                self._begin(body)
            rows = self._numbers(body, start)
            if len(rows):
                self._check(rows, body, start)
                self.previous = rows[-1]
                yield rows
        if is_above:
            self.preamble.end()

    def _above(self, text: str, line: int) -> int | None:
        # Number of lines above the first row; None: there is no row.
        for k, row in enumerate(text.split("\n")):
            if not self.preamble.takes(line + k, row):
                return k
        return None

    def table(self, rows: np.ndarray) -> MotionTable:
        values, names = self.columns.values, ("velocities", "accelerations")
        turning = ("angular_velocities", "angular_accelerations")
        time = values("times", rows) if self.has_times else np.arange(float(len(rows)))[:, None]
        positions = values("positions", rows)
        quaternions = self._quaternions(rows)
        parts = {name: values(name, rows) for name in names}
        if quaternions is not None:
            parts |= {name: values(name, rows) for name in turning}
        return MotionTable(
            time[:, 0],  # type: ignore[index]
            positions,  # type: ignore[arg-type]
            quaternions,
            **parts,
            interpolation=self.directives.get("interpolation") or ("hermite" if self.columns.is_written else None),
            ends=self.directives.get("ends"),
            z_axis=self.directives.get("z"),
            point=self.directives.get("point", self.columns.written_point),
            from_reference=self.columns.written_point == "mass-centre",
            is_planar="y" not in self.columns.names,
            notes=tuple(self.notes),
        )

    def _begin(self, text: str) -> None:
        # Take columns from what stands above the rows, and the separator from the first row.
        self.columns, self.delimiter = self.preamble.columns, self.preamble.delimiter
        self.directives = self.preamble.directives
        self.notes |= dict.fromkeys(self.columns.notes)
        cells = self._cells(text.partition("\n")[0])
        pairs = zip(self.columns.names, cells, strict=False)
        self.converters = {k: _zero for k, (name, cell) in enumerate(pairs) if not name and not is_number(cell)}
        if self.has_times:
            self._begin_times(cells)

    def _begin_times(self, cells: list[str]) -> None:
        column = self.columns.names.index("t")
        cell = cells[column].replace(",", ".") if column < len(cells) else ""
        unit = None if self.columns.has_time_unit else unit_of_stamps(cell)
        if unit is not None:
            factors = self.columns.factors.copy()
            factors[column] = TIMES[unit]
            self.columns = dataclasses.replace(self.columns, factors=factors)
            self.notes[f"times have no unit: taken as stamps since 1970 in {unit}"] = None
        self.stamps = Stamps(cell)
        if self.stamps.offset:
            self.converters[column] = self.stamps.since

    def _cells(self, text: str) -> list[str]:
        cells = cells_of(text, self.delimiter)
        spare = min(self.preamble.tail, max(len(cells) - len(self.columns.names), 0))
        return cells[: len(cells) - spare] if spare and not any(cells[len(cells) - spare :]) else cells

    def _numbers(self, text: str, line: int) -> np.ndarray:
        plain = text.replace(",", ".") if self.delimiter in (";", "\t") else text
        if "%" in plain:
            plain = _COMMENT_LINE.sub("", plain)
        # Searching for plain text is far faster than for a pattern.
        if plain[:1] in EMPTY or any(f"\n{separator}" in plain for separator in EMPTY):
            plain = _EMPTY_LINE.sub("", plain)
        if self.preamble.tail:
            separator = re.escape(str(self.delimiter))
            plain = re.sub(rf"(?:{separator} *){{1,{self.preamble.tail}}}$", "", plain, flags=re.MULTILINE)
        try:
            rows = self._loaded(plain)
        except ValueError as error:
            self._refuse(text, line)
            # Columns that are not read may hold text in later rows.
            unread: dict[int | str, Callable[[str], float]] = {
                k: _zero for k, name in enumerate(self.columns.names) if not name
            }
            if len(unread) == len(self.converters.keys() & unread.keys()):
                raise ConfigError(self.path, f"its rows cannot be read: {str(error).splitlines()[0]}"[:300]) from error
            self.converters |= unread
            return self._numbers(text, line)
        if rows.size and rows.shape[1] != len(self.columns.names):
            self._refuse(text, line)
        return rows

    def _loaded(self, plain: str) -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about a block without rows
            return np.loadtxt(
                io.StringIO(plain),
                delimiter=self.delimiter,
                ndmin=2,
                quotechar='"',
                converters=self.converters or None,
                encoding=None,
            )

    def _refuse(self, text: str, line: int) -> None:
        # Raise an error for the first row that is wrong.
        heads = self.columns.heads
        for row_number, row in enumerate(text.split("\n"), line):
            if not has_content(row):
                continue
            cells = self._cells(row)
            if len(cells) != len(heads):
                raise ConfigError(
                    self.path, f"line {row_number}: {len(cells)} values: must be {len(heads)}, as in the header"
                )
            for k, (name, cell) in enumerate(zip(self.columns.names, cells, strict=True)):
                is_split = "," in cell and self.delimiter not in (";", "\t")
                number = number_of(cell) if name != "t" else number_of(cell) - float(self.stamps.offset)
                if name and (is_split or not abs(number) <= LARGEST_NUMBER):
                    label = f"line {row_number}, column {k + 1}: {name}"
                    odd = ", without a comma" if is_split else look_alike(cell[:100])
                    raise ConfigError(self.path, f"{label} = {shown(cell)}: must be a finite number{odd}")

    def _check(self, rows: np.ndarray, text: str, line: int) -> None:
        read = [k for k, name in enumerate(self.columns.names) if name]
        if not (np.abs(rows[:, read]) <= LARGEST_NUMBER).all():
            self._refuse(text, line)
        chain = rows if self.previous is None else np.vstack([self.previous, rows])
        if self.has_times:
            self._check_times(chain, len(chain) - len(rows), text, line)
        quaternions = self.columns.values("quaternions", rows)
        if quaternions is not None:
            self._check_lengths(quaternions, text, line)
            if self.previous is None and not self.columns.is_named:
                self._note_scalar(quaternions)
        for group in ("rotations", "tilts"):
            angles = self.columns.values(group, rows)
            if angles is not None and np.abs(angles).max() > 2.0 * math.pi + 1e-3:
                maximum = np.abs(angles).max()
                self.notes[f"angles reach {maximum:.4g} rad: are they degrees? Then say so: # units: deg"] = None

    def _note_scalar(self, quaternions: np.ndarray) -> None:
        first, *_, last = np.abs(quaternions).mean(axis=0)
        if last > first:
            names = ("t, " if self.has_times else "") + "x, y, z, qx, qy, qz, qw"
            self.notes[
                "hint: the last column looks like the scalar part of quaternions, which are taken scalar first: if it "
                f"is, name the columns: {names}"
            ] = None

    def _check_times(self, chain: np.ndarray, before: int, text: str, line: int) -> None:
        column = self.columns.names.index("t")
        steps = np.diff(chain[:, column])
        late = np.flatnonzero(steps < 0.0 if self.columns.is_written else steps <= 0.0)
        if len(late):
            self._refuse_time(chain, int(late[0]), before, text, line)
        repeat = None if self.columns.is_written or self.is_close else near_repeat(chain[:, column])
        if repeat is not None:
            self.is_close, (i, factor) = True, repeat
            number, stamp = _line_of(text, line, i + 1 - before), self._stamp(chain[i + 1])
            self.notes[
                f"line {number}: hint: t = {stamp} nearly repeats the time before it: the step is {factor:.2g} times "
                "shorter than others, and what differs between the two rows is a jump: leave out one of them"
            ] = None
        if self.columns.is_written:
            self._check_joins(chain, steps, before, text, line)

    def _refuse_time(self, chain: np.ndarray, i: int, before: int, text: str, line: int) -> None:
        number = _line_of(text, line, i + 1 - before)
        earlier, later = self._stamp(chain[i]), self._stamp(chain[i + 1])
        words = "times repeat" if earlier == later else "rows are out of order"
        raise ConfigError(
            self.path, f"line {number}: t = {later}: {words}: must be more than {earlier}, the time before it"
        )

    def _stamp(self, row: np.ndarray) -> str:
        return self.stamps.shown(float(row[self.columns.names.index("t")]))

    def _check_joins(self, chain: np.ndarray, steps: np.ndarray, before: int, text: str, line: int) -> None:
        # Two rows of the same time are the end and start of two legs; only their accelerations may differ.
        joins = np.flatnonzero(steps == 0.0)
        for group in ("positions", "velocities"):
            values = self.columns.values(group, chain)
            if values is None or not len(joins):
                continue
            away = np.abs(values[joins + 1] - values[joins]).max(axis=1)
            jumps = np.flatnonzero(away > MEETING * np.abs(values).max())
            if len(jumps):
                number = _line_of(text, line, int(joins[jumps[0]]) + 1 - before)
                jump = float(away[jumps[0]])
                raise ConfigError(self.path, f"line {number}: {group} jump by {jump:g} at one time: must be continuous")

    def _check_lengths(self, quaternions: np.ndarray, text: str, line: int) -> None:
        sizes = np.linalg.norm(quaternions, axis=1)
        odd = np.flatnonzero((sizes < SHORTEST) | (sizes > LONGEST))
        if len(odd):
            number = _line_of(text, line, int(odd[0]))
            values = quaternions[odd[0]].tolist()
            raise ConfigError(
                self.path, f"line {number}: qw, qx, qy, qz = {shown(values)}: must be a unit quaternion, scalar first"
            )
        if np.abs(sizes - 1.0).max() > UNIT:
            self.notes["quaternions of lengths other than 1 are normalised"] = None

    def _quaternions(self, rows: np.ndarray) -> np.ndarray | None:
        quaternions = self.columns.values("quaternions", rows)
        if quaternions is not None:
            return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
        rotations, tilts = self.columns.values("rotations", rows), self.columns.values("tilts", rows)
        if rotations is None and tilts is None:
            return None
        from scipy.spatial.transform import Rotation  # importing it takes time, and only angles need it

        if rotations is not None:  # R = Rz(yaw) Ry(pitch) Rx(roll)
            return Rotation.from_euler("ZYX", rotations[:, ::-1]).as_quat(scalar_first=True)
        phi, theta, sigma = tilts.T  # type: ignore[union-attr]
        angles = np.stack([phi, theta, sigma - phi], axis=1)
        return Rotation.from_euler("ZXZ", angles).as_quat(scalar_first=True)


def _texts(path: Path) -> Iterator[tuple[int, str]]:
    # Blocks of whole lines, each with the number of its first line.
    rest, line = b"", 1
    with opened(path) as file:
        while data := file.read(BLOCK):
            chunk = rest + data
            cut = chunk.rfind(b"\n" if b"\n" in chunk else b"\r") + 1
            text = _plain(chunk[:cut] if cut else chunk, path, line)
            if not cut and len(chunk) > LARGEST_LINE:
                raise ConfigError(path, f"line {line} has more than {LARGEST_LINE} bytes: must be a table of text")
            if not cut:
                rest = chunk
                continue
            rest = chunk[cut:]
            yield line, text
            line += text.count("\n")
    if rest:
        yield line, _plain(rest, path, line)


def _plain(data: bytes, path: Path, line: int) -> str:
    if data.startswith((b"\x89HDF", b"PK\x03\x04")):
        raise ConfigError(path, "is not a table of text: must be text, such as CSV")
    text = decoded(data, path, line=line)
    if "\0" in text:
        number = line + text.count("\n", 0, text.index("\0"))
        raise ConfigError(path, f"byte 0x00 in line {number}: must be a table of text")
    return text


def _zero(cell: str) -> float:
    return 0.0


def _line_of(text: str, line: int, row: int) -> int:
    # Line number of a row of a block.
    count = -1
    for number, content in enumerate(text.split("\n"), line):
        count += has_content(content)
        if count == row:
            return number
    return line
