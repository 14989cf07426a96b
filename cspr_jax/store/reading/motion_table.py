"""Motions as tables: the CSV of `cspr plan -o FILE.csv`, read back.

Its columns are those of a motion file over time. It contains neither the robot nor the plan nor the segments. The
direction of z follows from the work of the cables; tables of earlier versions give it in a comment below their header.
"""

from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.config.keys.limits import MAX_CABLES
from cspr_jax.errors import printable, shown
from cspr_jax.schema.quantities import ACROSS, PARTS, TRAJECTORY
from cspr_jax.store.files.checksum import DamagedError, unreadable
from cspr_jax.store.files.netcdf import file_size

# Bytes of text, of which numbers take a third in memory; the header has some hundred names.
LARGEST_TABLE, LARGEST_HEADER = 2 << 30, 1 << 16
FEASIBLE = "feasible"
WORK_ROWS = 4096  # largest number of rows whose work is examined
EXPLAINED = 0.5  # fraction of the work that lifting must explain if its sign is to give the direction of z


def read_table(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Columns of a table of a motion."""
    if not 0 <= file_size(path) <= LARGEST_TABLE:
        raise DamagedError(f"it is not a file, or has more than {LARGEST_TABLE} bytes")
    try:
        with path.open(encoding="utf-8-sig", newline=None) as file:
            heads = file.readline(LARGEST_HEADER).rstrip("\n").split(",")
            columns = _column_indices(heads)
            comments: list[str] = []
            table = np.loadtxt(_rows(file, comments), delimiter=",", comments=None, ndmin=2)
    except OSError as error:
        raise unreadable(path, error) from error
    except ValueError as error:  # about an invalid number, row or character
        raise DamagedError(f"its rows cannot be read: {str(error).splitlines()[0]}") from error
    if table.shape[1] != len(heads):
        raise DamagedError(f"its rows have {table.shape[1]} numbers, its header has {len(heads)} names")
    attributes: dict[str, Any] = {"robot": printable(path.stem)[:200] or "motion"}
    if heads[-1] == FEASIBLE:
        flags = table[:, -1]
        if not np.isin(flags, (0.0, 1.0)).all():
            raise DamagedError(f"{FEASIBLE} holds another number than 0 and 1")
        attributes[FEASIBLE] = int(flags.all())
    arrays = {name: _typed(name, np.ascontiguousarray(table[:, column])) for name, column in columns.items()}
    if "mass_centre" in arrays:
        attributes["point"] = "origin"
    z_axis = _axis_in(comments) or _vertical(arrays)
    return attributes | ({"z_axis": z_axis} if z_axis else {}), arrays


def _axis_in(comments: list[str]) -> str | None:
    pairs = [line.strip("#,; \t\n").partition(":") for line in comments]
    return next((axis for name, _, axis in ((a.strip(), b, c.strip()) for a, b, c in pairs) if name == "z"), None)


def _vertical(arrays: dict[str, np.ndarray]) -> str | None:
    # Direction of z, or None where the motion is level: fit the power of the cables, -tension . rate, by mass *
    # velocity . acceleration + weight * velocity_z and a term of rotations; the sign of the weight gives the direction.
    needed = ("velocity", "acceleration", "tension", "rate")
    if any(name not in arrays or not np.isfinite(arrays[name]).all() for name in needed):
        return None
    step = -(-len(arrays["t"]) // WORK_ROWS)
    velocity, acceleration, tension, rate = (arrays[name][::step] for name in needed)
    power, terms = -(tension * rate).sum(axis=1), [velocity[:, 2], (velocity * acceleration).sum(axis=1)]
    if "omega" in arrays and "omega_dot" in arrays:
        terms.append((arrays["omega"][::step] * arrays["omega_dot"][::step]).sum(axis=1))
    terms = [term / norm for term in terms if (norm := float(np.linalg.norm(term))) > 0.0]
    if not velocity[:, 2].any() or not power.any():
        return None

    def left(columns: list[np.ndarray]) -> tuple[float, np.ndarray]:
        matrix = np.stack(columns, axis=1) if columns else np.zeros((len(power), 1))
        fitted = np.linalg.lstsq(matrix, power, rcond=None)[0]
        return float(np.sum((power - matrix @ fitted) ** 2)), fitted

    (with_lifting, fitted), (without, _) = left(terms), left(terms[1:])
    if not with_lifting < (1.0 - EXPLAINED) * without:
        return None
    return "up" if fitted[0] > 0.0 else "down"


def _typed(name: str, values: np.ndarray) -> np.ndarray:
    # Column of numbers in the type of its quantity.
    kind = TRAJECTORY[name].kind
    if kind == "float":
        return values
    limits = np.iinfo(kind)
    if not ((values >= limits.min) & (values <= limits.max) & (values == np.round(values))).all():
        raise DamagedError(f"{name} holds another number than integers from {limits.min} to {limits.max}")
    return values.astype(kind)


def _rows(file, comments: list[str]):
    # Rows of the table after the comments below its header; each ends with a line break, the last one too.
    line, has_rows = "", False
    for line in file:
        if not line.endswith("\n"):
            raise DamagedError("its last line is cut off")
        has_rows = has_rows or not line.startswith("#")
        if has_rows:
            yield line
        else:
            comments.append(line)
    if not has_rows:
        raise DamagedError("it has no rows")


def _column_indices(heads: list[str]) -> dict[str, Any]:
    # Columns of each quantity, which must be in the order in which `cspr plan` writes them.
    names = heads[:-1] if heads[-1] == FEASIBLE else heads
    indices: dict[str, Any] = {}
    start = 0
    for name in TRAJECTORY:
        parts = PARTS.get(ACROSS[name], tuple(str(k + 1) for k in range(MAX_CABLES))) if name in ACROSS else ()
        columns = [f"{name}_{part}" for part in parts] or [name]
        count = next((k for k, head in enumerate(names[start:]) if k == len(columns) or head != columns[k]), None)
        count = len(names) - start if count is None else count
        if not count:
            continue
        if ACROSS.get(name) != "cable" and count != len(columns):
            raise DamagedError(f"it has no column {columns[count]} behind {columns[count - 1]}")
        indices[name] = slice(start, start + count) if parts else start
        start += count
    if start < len(names):
        hint = "; a motion of your own needs its robot, --robot" if "position" not in indices else ""
        raise DamagedError(f"column {shown(names[start])}: must be one that `cspr plan` writes, in its order{hint}")
    return indices
