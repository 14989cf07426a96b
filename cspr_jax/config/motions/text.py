"""Tables of motions as text, such as CSV: streamed, so that the number of rows is not limited by memory.

Separators are commas, semicolons, tabs or spaces; behind semicolons and tabs decimal commas are taken too. Each fault
becomes one line with the number of its line in the file and the name of its column.
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
from cspr_jax.config.motions.columns import MotionColumns, columns, directives
from cspr_jax.config.motions.table import MotionTable
from cspr_jax.config.reading import decoded, opened
from cspr_jax.config.suggestions import look_alike
from cspr_jax.errors import ConfigError, shown

BLOCK = 4 << 20  # bytes that are read at a time
LARGEST_LINE = 1 << 16
MOST_ROWS = 1_000_000  # of a table that is read as a whole
WINDOW = 200_000  # rows
# Rows of the neighbours that a window has besides. In a spline an end counts by 0.27 (cubic) or 0.43 (quintic) a row.
OVERLAP = 100
# Lengths of quaternions that are taken for unit ones, that are normalised with a note, and that are refused beyond.
UNIT, SHORTEST, LONGEST = 1e-3, 0.5, 2.0
MEETING = 1e-6  # share of the size of a motion by which its legs may miss each other


class TooLongError(ConfigError):
    """A table of more rows than are read as a whole."""


@dataclasses.dataclass(frozen=True)
class MotionWindow:
    """Consecutive rows of a table, with some of the rows before and behind them.

    Fields:
        table: of all these rows.
        first: index of the row at which the window itself begins; the one before ended there.
        last: index of its last row.
        is_last: whether no other follows.
    """

    table: MotionTable
    first: int
    last: int
    is_last: bool


def read(path: Path, *, has_times: bool = True) -> MotionTable:
    """A table of a motion, or of the points of a path, as a whole.

    Args:
        has_times: as for `windows`.

    Returns:
        the samples; of a path, times are the numbers of the rows.

    Raises:
        ConfigError: a mistake in the file.
        TooLongError: more than `MOST_ROWS` rows; see `windows`.
    """
    window = next(windows(path, MOST_ROWS, has_times=has_times))
    if not window.is_last:
        raise TooLongError(path, f"more than {MOST_ROWS} rows: must be fewer where a motion is read as a whole")
    return window.table


def windows(path: Path, rows: int = WINDOW, *, has_times: bool = True) -> Iterator[MotionWindow]:
    """A table of a motion, window by window.

    Args:
        rows: from the first to the last row of a window, at least `OVERLAP`.
        has_times: whether the table is that of a motion, and not of a path.

    Yields:
        the windows; each begins with the row with which the one before ends.

    Raises:
        ConfigError: a mistake in the file, when the window that holds it is due.
    """
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
        self.columns: MotionColumns
        self.directives: dict[str, str] = {}
        self.delimiter: str | None = None
        self.has_tail = False
        self.unread_text: dict[int | str, Callable[[str], float]] | None = None  # columns of text, which are not read

    def blocks(self) -> Iterator[np.ndarray]:
        # Rows (n, columns) in the units of the file, checked.
        head: str | None = ""
        for line, text in _texts(self.path):
            start, body = line, text
            if head is not None:
                head += text
                if not any(_has_content(row) for row in head.split("\n")):
                    continue  # comments alone so far
                start, body = self._begin(head)
                head = None
            rows = self._numbers(body, start)
            if len(rows):
                self._check(rows, body, start)
                self.previous = rows[-1]
                yield rows

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
            point=self.directives.get("point", "mass-centre" if self.columns.is_written else None),
            from_reference=self.columns.is_written,
            is_planar="y" not in self.columns.names,
            notes=tuple(self.notes),
        )

    def _begin(self, text: str) -> tuple[int, str]:
        # Read comments and header of the first block; return the number of the next line, and the text from there on.
        rows = text.split("\n")
        filled = [number for number, row in enumerate(rows, 1) if _has_content(row)]
        line = filled[0]
        content = rows[line - 1].strip()
        # Comments of this program stand between the names of the columns and the first row.
        head = rows[: filled[1] - 1] if len(filled) > 1 else rows
        # Spreadsheets fill them with empty cells.
        texts = [(number, row.strip(",;\t ").lstrip("# ")) for number, row in enumerate(head, 1) if number != line]
        self.directives = directives([pair for pair in texts if pair[1]], self.path)
        self.delimiter = next((mark for mark in ";\t," if mark in content), None)
        self.has_tail = self.delimiter is not None and content.endswith(self.delimiter)
        heads = self._cells(content)
        has_header = not all(_is_number(cell) for cell in heads)
        names, units = heads if has_header else None, self.directives.get("units", "")
        self.columns = columns(names, len(heads), units, self.path, line, has_times=self.has_times)
        self.notes |= dict.fromkeys(self.columns.notes)
        return line + has_header, "\n".join(rows[line - 1 + has_header :])

    def _cells(self, text: str) -> list[str]:
        text = text.split("#")[0].strip(" \n")
        if self.has_tail:
            text = text.removesuffix(self.delimiter or "")
        cells = [cell.strip().strip('"').strip() for cell in text.split(self.delimiter)]
        return cells

    def _numbers(self, text: str, line: int) -> np.ndarray:
        if self.unread_text is None:
            sample = next((row for row in text.split("\n") if _has_content(row)), None)
            if sample is None:
                return np.empty((0, 0))
            pairs = list(zip(self.columns.names, self._cells(sample), strict=False))
            self.unread_text = {k: _zero for k, (name, cell) in enumerate(pairs) if not name and not _is_number(cell)}
        plain = text.replace(",", ".") if self.delimiter in (";", "\t") else text
        if self.has_tail:
            plain = re.sub(rf"{re.escape(str(self.delimiter))}[ \t]*$", "", plain, flags=re.MULTILINE)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of a block without rows
                rows = np.loadtxt(
                    io.StringIO(plain),
                    delimiter=self.delimiter,
                    ndmin=2,
                    quotechar='"',
                    converters=self.unread_text or None,
                )
        except ValueError as error:
            self._refuse(text, line)
            raise ConfigError(self.path, f"its rows cannot be read: {str(error).splitlines()[0]}"[:300]) from error
        if rows.size and rows.shape[1] != len(self.columns.names):
            self._refuse(text, line)
        return rows

    def _refuse(self, text: str, line: int) -> None:
        # Raise an error for the first row that is at fault.
        heads = self.columns.heads
        for number, row in enumerate(text.split("\n"), line):
            if not _has_content(row):
                continue
            cells = self._cells(row)
            if len(cells) != len(heads):
                raise ConfigError(
                    self.path, f"line {number}: {len(cells)} values: must be {len(heads)}, as in the header"
                )
            for k, (name, cell) in enumerate(zip(self.columns.names, cells, strict=True)):
                is_split = "," in cell and self.delimiter not in (";", "\t")
                if name and (is_split or not abs(_number(cell)) <= LARGEST_NUMBER):
                    place = f"line {number}, column {k + 1}: {name}"
                    odd = ", without a comma" if is_split else look_alike(cell[:100])
                    raise ConfigError(self.path, f"{place} = {shown(cell)}: must be a finite number{odd}")

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
        for group in ("rotations", "tilts"):
            angles = self.columns.values(group, rows)
            if angles is not None and np.abs(angles).max() > 2.0 * math.pi + 1e-3:
                reach = np.abs(angles).max()
                self.notes[f"angles reach {reach:.4g} rad: are they degrees? Then say so: # units: deg"] = None

    def _check_times(self, chain: np.ndarray, before: int, text: str, line: int) -> None:
        steps = np.diff(chain[:, self.columns.names.index("t")])
        late = np.flatnonzero(steps < 0.0 if self.columns.is_written else steps <= 0.0)
        if len(late):
            self._refuse_time(chain, int(late[0]), before, text, line)
        if self.columns.is_written:
            self._check_joins(chain, steps, before, text, line)

    def _refuse_time(self, chain: np.ndarray, i: int, before: int, text: str, line: int) -> None:
        number = _line_of(text, line, i + 1 - before)
        earlier, later = (float(t) for t in chain[i : i + 2, self.columns.names.index("t")])
        words = "times repeat" if earlier == later else "rows are out of order"
        raise ConfigError(
            self.path, f"line {number}: t = {later!r}: {words}: must be more than {earlier!r}, the time before it"
        )

    def _check_joins(self, chain: np.ndarray, steps: np.ndarray, before: int, text: str, line: int) -> None:
        # Legs meet in two rows of one time; only their accelerations may differ.
        joins = np.flatnonzero(steps == 0.0)
        for group in ("positions", "velocities"):
            values = self.columns.values(group, chain)
            if values is None or not len(joins):
                continue
            away = np.abs(values[joins + 1] - values[joins]).max(axis=1)
            apart = np.flatnonzero(away > MEETING * np.abs(values).max())
            if len(apart):
                number = _line_of(text, line, int(joins[apart[0]]) + 1 - before)
                size = float(away[apart[0]])
                raise ConfigError(self.path, f"line {number}: {group} jump by {size:g} at one time: must be continuous")

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
        from scipy.spatial.transform import Rotation  # takes time, and only angles need it

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


def _is_number(cell: str) -> bool:
    return not math.isnan(_number(cell)) or cell.strip().lower().lstrip("+-") == "nan"


def _number(cell: str) -> float:
    try:
        return float(cell.replace(",", ".")) if cell.isascii() and "_" not in cell else math.nan
    except ValueError:
        return math.nan


def _has_content(row: str) -> bool:
    return bool(row.split("#")[0].strip())


def _zero(cell: str) -> float:
    return 0.0


def _line_of(text: str, line: int, row: int) -> int:
    # Number of the line of a row of a block.
    count = -1
    for number, content in enumerate(text.split("\n"), line):
        count += _has_content(content)
        if count == row:
            return number
    return line
