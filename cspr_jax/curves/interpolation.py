"""Interpolation of samples in time: the piecewise polynomial that a controller makes of a table.

`INTERPOLATIONS` are C2 cubic and C4 quintic splines through the samples, and Hermite pieces: cubic from velocities,
quintic where accelerations are given too. Quaternions are made continuous in sign, interpolated by components, and
normalised afterwards; where positions are Hermite pieces, quaternions are a spline of the same degree.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, CubicSpline, PPoly, make_interp_spline

from cspr_jax.curves.spline import Spline
from cspr_jax.errors import InputError
from cspr_jax.numerics.bounds.piecewise_bounds import bernstein_of_powers
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Float

INTERPOLATIONS = ("cubic", "quintic", "hermite")
ENDS = ("rest", "natural", "periodic")
# The ends of a periodic motion differ by no more than this fraction of its largest coordinate.
PERIODIC = 1e-9
# Accelerations between samples that are closer in time than this would overflow.
MIN_STEP = 1e-12  # s
JUMP = 1e-6  # where legs meet, smaller differences, as fractions of the largest acceleration, are rounding


def interpolated(
    times: Float[np.ndarray, "n"],
    positions: Float[np.ndarray, "n 3"],
    quaternions: Float[np.ndarray, "n 4"] | None = None,
    *,
    velocities: Float[np.ndarray, "n 3"] | None = None,
    accelerations: Float[np.ndarray, "n 3"] | None = None,
    interpolation: str = "cubic",
    ends: str = "rest",
    end_velocities: Float[np.ndarray, "2 3"] | None = None,
    end_accelerations: Float[np.ndarray, "2 3"] | None = None,
) -> Spline:
    """Spline through the samples of a motion."""
    times = np.asarray(times, float)
    _check(times, positions, quaternions, interpolation, ends)
    if interpolation == "hermite" and velocities is None:
        raise InputError("interpolation", interpolation, '"cubic" or "quintic" for samples without velocities')
    if interpolation != "hermite" and velocities is not None:
        raise InputError("interpolation", interpolation, '"hermite" for samples with velocities')
    if accelerations is not None and velocities is None:
        raise InputError("accelerations", None, "absent without velocities")
    since = times - times[0]
    if velocities is None:
        degree = 3 if interpolation == "cubic" else 5
        prescribed = [np.full((2, 3), np.nan) if x is None else x for x in (end_velocities, end_accelerations)]
        table = _spline(since, np.asarray(positions, float), degree, ends, np.stack(prescribed, axis=1))
    else:
        degree = 3 if accelerations is None else 5
        table = hermite(since, [positions, velocities] + ([] if accelerations is None else [accelerations]))
    turning = None if quaternions is None else _spline(since, continuous(np.asarray(quaternions, float)), degree, ends)
    curve = Spline(as_float64(since), as_float64(table), None if turning is None else as_float64(turning))
    return dataclasses.replace(curve, interpolation=interpolation, ends="" if interpolation == "hermite" else ends)


def linear_maps(times: Float[np.ndarray, "n"], kind: str, ends: str, n_arrays: int) -> list[np.ndarray]:
    """Linear maps from the samples of a motion to the Bernstein coefficients of its pieces."""
    since, unit = np.asarray(times, float) - times[0], np.eye(len(times))
    if kind != "hermite":
        return [_spline(since, unit, 3 if kind == "cubic" else 5, ends)]
    arrays = range(n_arrays)
    return [hermite(since, [unit if i == j else np.zeros_like(unit) for i in arrays]) for j in arrays]


def continuous(quaternions: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 4"]:
    """Unit quaternions, each with the sign that brings it nearer to the one before."""
    units = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    flips = np.where(np.sum(units[1:] * units[:-1], axis=1) < 0.0, -1.0, 1.0)
    return units * np.cumprod(np.append(1.0, flips))[:, None]


def check_order(times: Float[np.ndarray, "n"], *, repeated: bool) -> None:
    """Refuse times that do not increase; the error names the first that does not, and the time before it."""
    steps = np.diff(times)
    early = np.flatnonzero(steps < 0.0 if repeated else steps <= 0.0)
    if len(early):
        i, minimum = int(early[0]) + 1, "at least" if repeated else "more than"
        allowed = f"{minimum} times[{i - 1}] = {float(times[i - 1])!r}: times must increase"
        raise InputError(f"times[{i}]", float(times[i]), allowed)


def check_steps(times: Float[np.ndarray, "n"]) -> None:
    """Refuse times that are so close that accelerations would overflow."""
    steps = np.diff(times)
    close = np.flatnonzero((steps > 0.0) & (steps < MIN_STEP))
    if len(close):
        i = int(close[0]) + 1
        raise InputError(f"times[{i}]", float(times[i]), f"{MIN_STEP:g} s or more behind the time before it")


def _check(times: np.ndarray, positions, quaternions, interpolation: str, ends: str) -> None:
    for name, value, allowed in (("interpolation", interpolation, INTERPOLATIONS), ("ends", ends, ENDS)):
        if value not in allowed:
            raise InputError(name, value, " or ".join(f'"{each}"' for each in allowed))
    if times.ndim != 1 or len(times) < 2 or not np.isfinite(times).all():
        raise InputError("times", None, "must be two or more finite numbers, in s", problem=f"shape {times.shape}")
    check_order(times, repeated=False)
    check_steps(times)
    for name, values, width in (("positions", positions, 3), ("quaternions", quaternions, 4)):
        if values is None:
            continue
        array = np.asarray(values, float)
        if array.shape != (len(times), width):
            raise InputError(
                name, None, f"must be ({len(times)}, {width}), a row for each time", problem=f"{array.shape}"
            )
        bad = np.flatnonzero(~np.isfinite(array).all(1))
        if len(bad):
            raise InputError(f"{name}[{bad[0]}]", array[bad[0]].tolist(), "finite numbers")
        if name == "quaternions" and not (np.linalg.norm(array, axis=1) > 0.0).all():
            i = int(np.argmin(np.linalg.norm(array, axis=1)))
            raise InputError(f"quaternions[{i}]", array[i].tolist(), "a quaternion of length above 0")
    if ends == "periodic" and interpolation != "hermite":
        _check_closed(np.asarray(positions, float), "position")
        if quaternions is not None:
            units = continuous(np.asarray(quaternions, float))
            _check_closed(units * np.where(units @ units[0] < 0.0, -1.0, 1.0)[:, None], "orientation")
    if (interpolation, ends, len(times)) == ("quintic", "natural", 2):
        raise InputError("ends", ends, '"rest" or "periodic" with two samples of a quintic')


def _check_closed(values: np.ndarray, name: str) -> None:
    if np.abs(values[-1] - values[0]).max() > PERIODIC * np.abs(values).max():
        raise InputError("ends", "periodic", f"another one where the last {name} is not the first")


def _spline(
    times: np.ndarray, values: np.ndarray, degree: int, ends: str, derivatives: np.ndarray | None = None
) -> np.ndarray:
    # Return Bernstein coefficients of each piece, (n - 1, degree + 1, width). `derivatives` (2, 2, width) are the first
    # and second one at each end, NaN where `ends` decides.
    if ends == "periodic":
        return _periodic(times, values, degree)
    if derivatives is None:
        derivatives = np.full((2, 2, values.shape[1]), np.nan)
    zero = np.zeros(values.shape[1])
    free = [(2, zero)] if degree == 3 else [(3, zero), (4, zero)]
    conditions = []
    for end in derivatives:
        prescribed = [(order, value) for order, value in zip((1, 2), end, strict=True) if not np.isnan(value).any()]
        rest = [(order, zero) for order in (1, 2)]
        usual = rest if ends == "rest" else free
        # Derivatives that are not prescribed follow `ends`.
        conditions.append((prescribed + [pair for pair in usual if pair[0] not in dict(prescribed)])[: degree // 2])
    if degree == 3:
        return _pieces(CubicSpline(times, values, bc_type=(conditions[0][0], conditions[1][0])))
    ordered = tuple(sorted(condition, key=lambda pair: pair[0]) for condition in conditions)
    return _quintic(times, make_interp_spline(times, values, degree, bc_type=ordered))


def _periodic(times: np.ndarray, values: np.ndarray, degree: int) -> np.ndarray:
    # After a full turn a quaternion returns with the opposite sign: it repeats after two periods.
    sign = 1.0 if np.sum(values[0] * values[-1]) >= 0.0 else -1.0
    times = np.concatenate([times, times[1:] + times[-1]])
    values = np.concatenate([values[:-1], sign * values[:-1], values[:1]])
    if degree == 3:
        pieces = _pieces(CubicSpline(times, values, bc_type="periodic"))
    else:
        pieces = _quintic(times, make_interp_spline(times, values, degree, bc_type="periodic"))
    return pieces[: len(pieces) // 2]


def _quintic(times: np.ndarray, spline: BSpline) -> np.ndarray:
    return hermite(times, [spline(times, order) for order in range(3)])


def hermite(times: Float[np.ndarray, "n"], derivatives: list) -> np.ndarray:
    """Pieces with the values and derivatives of samples."""
    width = np.diff(times)[:, None]
    degree = 2 * len(derivatives) - 1
    factors = [math.factorial(degree - i) / math.factorial(degree) for i in range(len(derivatives))]

    def ends(values: list[np.ndarray], step: np.ndarray) -> list[np.ndarray]:
        taylor = [factor * step**i * value for i, (factor, value) in enumerate(zip(factors, values, strict=True))]
        return [sum(math.comb(j, i) * taylor[i] for i in range(j + 1)) for j in range(len(taylor))]

    first = ends([np.asarray(values, float)[:-1] for values in derivatives], width)
    last = ends([np.asarray(values, float)[1:] for values in derivatives], -width)
    return np.stack([*first, *reversed(last)], axis=1)[width[:, 0] > 0.0]


def _pieces(spline: PPoly) -> np.ndarray:
    powers = np.moveaxis(spline.c[::-1], 0, 1)
    return bernstein_of_powers(powers * np.diff(spline.x)[:, None, None] ** np.arange(powers.shape[1])[:, None])


def thinned(spline: Spline, first: int) -> Spline:
    """Hermite pieces through every second sample of a motion, its ends, and where the accelerations of legs jump."""
    knots = np.asarray(spline.knots)
    tables = {name: np.asarray(getattr(spline, name)) for name in ("position", "quaternion")}
    sides = {name: _sides(table, np.diff(knots)[:, None]) for name, table in tables.items() if table.ndim}
    is_kept = np.zeros(len(knots), bool)
    is_kept[[0, -1]] = is_kept[first::2] = True
    for starts, ends in (pair for pairs in sides.values() for pair in pairs[2:]):
        is_kept[1:-1] |= (np.abs(starts[1:] - ends[:-1]) > JUMP * np.abs(ends).max()).any(axis=1)
    at = np.flatnonzero(is_kept)
    times = np.repeat(knots[at], 2)[1:-1]
    fewer: dict[str, Any] = {
        name: as_float64(hermite(times, [_between(starts[at[:-1]], ends[at[1:] - 1]) for starts, ends in pairs]))
        for name, pairs in sides.items()
    }
    return dataclasses.replace(spline, knots=as_float64(knots[at]), **fewer)


def _sides(table: np.ndarray, width: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    # Values and derivatives of the pieces at their starts and ends, up to the order that Hermite pieces prescribe.
    degree, factor, pairs = table.shape[1] - 1, np.ones_like(width), []
    for order in range(degree // 2 + 1):
        differences = np.diff(table, order, axis=1)
        pairs.append((factor * differences[:, 0], factor * differences[:, -1]))
        factor = factor * (degree - order) / width
    return pairs


def _between(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.stack([starts, ends], axis=1).reshape(-1, starts.shape[1])
