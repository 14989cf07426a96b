"""Files, directories and values of axes that a user selects."""

import math
from pathlib import Path

import numpy as np

from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.errors.suggestions import one_of
from cspr_jax.outputs.plots.style.labels import value
from cspr_jax.store.reading.result import Result

# A requested value may lie outside the range of an axis by this fraction of its coordinates.
SAME = 1e-9
LONGEST_NAMES = 64  # number of letters of the first line that are read to recognise a table of this program


def result_at(path: Path) -> Path:
    """The file to draw."""
    if not path.is_dir():
        return path
    from cspr_jax.sweep.inspection import result_in  # only a directory needs it

    return result_in(path)


def is_own_motion(path: Path) -> bool:
    """Tell whether a file is a user's own motion, not a file of this program."""
    if path.suffix.lower() in (".h5", ".hdf5", ".nc") or not path.is_file():
        return False
    with path.open("rb") as file:
        return not file.readline(LONGEST_NAMES).removeprefix(b"\xef\xbb\xbf").startswith(b"t,position_x,")


def coordinates_of(words: list[str], option: str = "--at") -> dict[str, float]:
    """Values of axes from words of the command line."""
    at = {}
    for text in words:
        axis, _, number = text.partition("=")
        try:
            at[axis] = float(number)
        except ValueError as error:
            raise ConfigError(option, f"{shown(text)}: must be AXIS=VALUE, such as z=1.7") from error
        if not math.isfinite(at[axis]):
            raise ConfigError(option, f"{shown(text)}: must be a finite number")
    return at


def nearest(result: Result, axis: str, coordinate: float, option: str = "--at") -> tuple[int, str]:
    """The point of an axis that is drawn for a coordinate."""
    if axis not in result.axes:
        raise InputError(option, axis, one_of(axis, result.axes))
    points = result.axes[axis]
    low, high = float(points.min()), float(points.max())
    rounding = SAME * max(abs(low), abs(high))
    if not low - rounding <= coordinate <= high + rounding:
        allowed = f"{axis} in [{low:.6g}, {high:.6g}]" if high > low else f"{axis} = {low:.6g}, its one point"
        raise InputError(option, f"{axis}={coordinate:.6g}", allowed)
    index = int(np.argmin(np.abs(points - coordinate)))
    words = value(result, axis, points[index])
    if abs(points[index] - coordinate) > rounding:
        words += f" (nearest to {value(result, axis, coordinate).partition(' = ')[2]})"
    return index, words
