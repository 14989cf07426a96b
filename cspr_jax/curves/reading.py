"""Splines from what users bring: tables of samples, pieces of other programs, and curves of SciPy.

Tables are interpolated as they say; pieces stay exactly as they are. Tables that are too long for memory are read and
interpolated window by window (`config.motions.text.windows`), each with enough rows of its neighbours that its pieces
equal those of the spline through all rows, up to rounding.
"""

import dataclasses
import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from scipy.interpolate import BPoly, BSpline, PPoly

from cspr_jax.config.motions.table import MotionPieces, MotionTable
from cspr_jax.config.motions.text import MotionWindow
from cspr_jax.curves.interpolation import check_order, check_steps, continuous, hermite, interpolated
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import InputError
from cspr_jax.numerics.bounds.piecewise_bounds import bernstein_of_powers
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear import rotations

# Tolerances, as fractions of the largest coefficient:
PIECES_ERROR = 1e-6  # of the gap where two pieces meet
WINDOWS_ERROR = 1e-9  # of the gap where two windows meet
COEFFICIENT_ERROR = 1e-12  # of the rounding of coefficients
# Meaning of a curve's columns, by their number: indices of x, y, z and the quaternion.
_WIDTHS = {2: (0, 2), 3: (0, 1, 2), 7: (0, 1, 2, 3, 4, 5, 6)}


def spline_of(
    source: MotionTable | MotionPieces, *, interpolation: str | None = None, ends: str | None = None
) -> Spline:
    """A motion that was read, as a spline in its axes."""
    check_steps(source.knots if isinstance(source, MotionPieces) else source.times)
    if isinstance(source, MotionPieces):
        return _of_pieces(source, interpolation, ends)
    check_order(source.times, repeated=True)
    kind = interpolation or source.interpolation or ("cubic" if source.velocities is None else "hermite")
    table = source
    if kind == "hermite" and table.velocities is not None:
        turning = table.quaternions is not None and table.angular_velocities is not None
        if turning or (np.diff(table.times) == 0.0).any():
            return _of_rates(table)
    elif (np.diff(table.times) == 0.0).any():
        table = _without_joins(table)
    return interpolated(
        table.times,
        table.positions,
        table.quaternions,
        velocities=table.velocities if kind == "hermite" else None,
        accelerations=table.accelerations if kind == "hermite" else None,
        interpolation=kind,
        ends=ends or table.ends or "rest",
    )


def pieces_of(curve: Any) -> MotionPieces:
    """Pieces of a curve of SciPy, converted exactly."""
    if isinstance(curve, BSpline):
        knots = np.unique(curve.t[curve.k : len(curve.t) - curve.k])
        orders = range(curve.k + 1)
        powers = np.stack([curve(knots[:-1], order) / math.factorial(order) for order in orders], axis=1)
    elif isinstance(curve, PPoly):
        knots, powers = curve.x, np.moveaxis(curve.c[::-1], 0, 1)
    elif isinstance(curve, BPoly):
        knots, powers = curve.x, np.moveaxis(curve.c, 0, 1)
    else:
        raise InputError("motion", None, "must be a BSpline, PPoly, BPoly or CubicSpline", problem=type(curve).__name__)
    if powers.ndim != 3 or powers.shape[2] not in _WIDTHS or np.iscomplexobj(powers):
        allowed = "must be (n, 3) positions, (n, 2) x and z, or (n, 7) positions and quaternions, over the first axis"
        raise InputError("motion", None, allowed, problem=f"values of shape {powers.shape[2:]}")
    if not np.isfinite(powers).all() or not (np.diff(knots) > 0.0).all():
        raise InputError("motion", None, "must have finite coefficients and increasing knots", problem="a curve")
    table = powers
    if not isinstance(curve, BPoly):
        table = bernstein_of_powers(powers * np.diff(knots)[:, None, None] ** np.arange(powers.shape[1])[:, None])
    values = np.zeros((*table.shape[:2], max(table.shape[2], 3)))
    values[:, :, _WIDTHS[table.shape[2]]] = table
    quaternion = values[:, :, 3:] if values.shape[2] == 7 else None
    return MotionPieces(np.asarray(knots, float), values[:, :, :3], quaternion, is_planar=table.shape[2] == 2)


def window_splines(
    windows: Iterable[MotionWindow],
    *,
    z_axis: str | None = None,
    interpolation: str | None = None,
    ends: str | None = None,
) -> Iterator[tuple[float, Spline]]:
    """A table that is read window by window, as a spline for each window."""
    begin, before = None, None
    for window in windows:
        table = window.table if z_axis is None else window.table.in_axes(z_axis)
        if "periodic" in (ends, ends or table.ends) and not (window.is_last and begin is None):
            raise InputError("ends", "periodic", "another one in tables that are read window by window")
        full = spline_of(table, interpolation=interpolation, ends=ends)
        begin = float(table.times[0]) if begin is None else begin
        since, knots = table.times - table.times[0], np.asarray(full.knots)
        first, last = (int(np.searchsorted(knots, since[index])) for index in (window.first, window.last))
        if first == last:
            continue
        quaternion = None if full.quaternion is None else as_float64(np.asarray(full.quaternion)[first:last])
        part = as_float64(knots[first : last + 1] - knots[first]), as_float64(np.asarray(full.position)[first:last])
        spline = dataclasses.replace(full, knots=part[0], position=part[1], quaternion=quaternion)
        if before is not None and interpolation != "hermite":
            _check_window(before, spline)
        before = spline
        yield float(table.times[window.first]) - begin, spline


def _of_pieces(pieces: MotionPieces, interpolation: str | None, ends: str | None) -> Spline:
    for key, value in (("interpolation", interpolation), ("ends", ends)):
        if value is not None:
            raise InputError(key, value, "absent for a motion of polynomial pieces")
    position, quaternion = (_with_rates(table) for table in (pieces.position, pieces.quaternion))
    if quaternion is not None:
        dots = (quaternion[1:, 0] * quaternion[:-1, -1]).sum(axis=1)
        quaternion = quaternion * np.cumprod(np.append(1.0, np.where(dots < 0.0, -1.0, 1.0)))[:, None, None]
    width = np.diff(pieces.knots)[:, None]
    for name, table in (("position", position), ("quaternion", quaternion)):
        if table is not None:
            _check_joins(name, table, width, pieces.knots - pieces.knots[0])
    since = as_float64(pieces.knots - pieces.knots[0])
    return Spline(since, as_float64(position), None if quaternion is None else as_float64(quaternion))


def _with_rates(table: np.ndarray | None) -> np.ndarray | None:
    # Pieces of degree 1 in place of constants, which have no derivatives.
    return table if table is None or table.shape[1] > 1 else np.repeat(table, 2, axis=1)


def _check_joins(name: str, table: np.ndarray, width: np.ndarray, knots: np.ndarray) -> None:
    # No force makes a mass follow a jump of its position or velocity.
    degree = table.shape[1] - 1
    starts, ends = degree * (table[:, 1:2] - table[:, :1]), degree * (table[:, -1:] - table[:, -2:-1])
    for words, first, last, scale in (
        ("value", table[:, 0], table[:, -1], np.abs(table).max()),
        ("rate", starts[:, 0] / width, ends[:, 0] / width, np.abs(np.diff(table, axis=1) / width[:, None]).max()),
    ):
        jumps = np.linalg.norm(first[1:] - last[:-1], axis=1)
        rounding = COEFFICIENT_ERROR * np.abs(table).max() / (1.0 if words == "value" else width.min())
        far = np.flatnonzero(jumps > PIECES_ERROR * scale * max(degree, 1) + rounding)
        if len(far):
            error = f"its {words} jumps by {jumps[far[0]]:.3g} at t = {knots[far[0] + 1]:.6g} s"
            raise InputError(
                name, None, "must be continuous with its first derivative: no force makes a mass jump", problem=error
            )


def _of_rates(table: MotionTable) -> Spline:
    # Hermite pieces of positions and, from angular velocities, of quaternions; without these, a spline of quaternions.
    derivatives = [table.positions, table.velocities]
    derivatives += [] if table.accelerations is None else [table.accelerations]
    since = table.times - table.times[0]
    knots, quaternion = since[np.append(True, np.diff(since) > 0.0)], None
    if table.quaternions is not None and table.angular_velocities is not None:
        units = continuous(table.quaternions)
        turns = [_pure(table.angular_velocities)]
        turns += [] if table.angular_accelerations is None else [_pure(table.angular_accelerations)]
        first = 0.5 * rotations.products(turns[0], units)
        turning = [units, first]
        if len(turns) == 2:
            turning.append(0.5 * (rotations.products(turns[1], units) + rotations.products(turns[0], first)))
        quaternion = hermite(since, turning)
    elif table.quaternions is not None:
        plain = _without_joins(table)
        rotated = interpolated(plain.times, plain.positions, plain.quaternions, interpolation="cubic")
        quaternion = np.asarray(rotated.quaternion)
    curve = Spline(as_float64(knots), as_float64(hermite(since, derivatives)), None, interpolation="hermite")
    return curve if quaternion is None else dataclasses.replace(curve, quaternion=as_float64(quaternion))


def _pure(vectors: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros((len(vectors), 1)), vectors], axis=1)


def _without_joins(table: MotionTable) -> MotionTable:
    is_later = np.append(True, np.diff(table.times) > 0.0)
    parts = {field.name: getattr(table, field.name) for field in dataclasses.fields(table)}
    arrays = {name: value[is_later] for name, value in parts.items() if isinstance(value, np.ndarray)}
    return dataclasses.replace(table, **arrays)


def _check_window(before: Spline, after: Spline) -> None:
    # Compare Taylor coefficients of both windows where they meet, over the shorter of the two pieces there.
    steps = [float(np.diff(np.asarray(spline.knots))[index]) for spline, index in ((before, -1), (after, 0))]
    step = min(steps)
    for name in ("position", "quaternion"):
        ends, starts = getattr(before, name), getattr(after, name)
        if ends is None:
            continue
        tables = [np.asarray(ends)[-1], np.asarray(starts)[0]]
        sign = -1.0 if name == "quaternion" and float(tables[0][-1] @ tables[1][0]) < 0.0 else 1.0
        scale, degree = max(float(np.abs(table).max()) for table in tables), len(tables[0]) - 1
        for order in range(3):
            last, first = np.diff(tables[0], order, axis=0)[-1], sign * np.diff(tables[1], order, axis=0)[0]
            away = np.abs(last * (step / steps[0]) ** order - first * (step / steps[1]) ** order).max()
            if order <= degree and away > WINDOWS_ERROR * scale:
                raise InputError(
                    "interpolation",
                    None,
                    'must be "cubic" or "hermite" in so long a table',
                    problem="the spline through its uneven times is felt from window to window",
                )
