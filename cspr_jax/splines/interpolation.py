"""Interpolation of samples in time: the piecewise polynomial that a controller plays of a table.

`INTERPOLATIONS` are C2 cubic and C4 quintic splines through the samples, and Hermite pieces, cubic from velocities and
quintic from accelerations too. Quaternions are made continuous in sign, interpolated by themselves, and normalised
afterwards; where positions are Hermite pieces, quaternions are a spline of the same degree.
"""

import numpy as np
from scipy.interpolate import BPoly, BSpline, CubicSpline, PPoly, make_interp_spline

from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.arithmetic.piecewise_bounds import bernstein_of_powers
from cspr_jax.errors import InputError
from cspr_jax.splines.motion import Spline

INTERPOLATIONS = ("cubic", "quintic", "hermite")
ENDS = ("rest", "natural", "periodic")
# The ends of a periodic motion differ by no more than this part of its largest number.
PERIODIC = 1e-9


def interpolated(
    times: np.ndarray,
    positions: np.ndarray,
    quaternions: np.ndarray | None = None,
    *,
    velocities: np.ndarray | None = None,
    accelerations: np.ndarray | None = None,
    interpolation: str = "cubic",
    ends: str = "rest",
    z0: float = 1.0,
) -> Spline:
    """Motion through samples.

    Args:
        times: (n,) increasing, s; the motion begins at 0.
        positions: (n, 3) m.
        quaternions: (n, 4) scalar first, of any length but zero; None for a point mass.
        velocities: (n, 3) m/s; with "hermite" alone.
        accelerations: (n, 3) m/s^2; with "hermite" alone.
        interpolation: one of `INTERPOLATIONS`.
        ends: of splines, one of `ENDS`: "rest" (velocity 0 of cubics, acceleration too of quintics), "natural" (the
            derivatives that the degree leaves over are 0) or "periodic".
        z0: depth at which slacks are normalised, m.

    Returns:
        the motion.

    Raises:
        InputError: times that do not increase, samples that are not finite, a quaternion of length 0, ends that do not
            meet, velocities where they are of no use, or none where they are needed.
    """
    times = np.asarray(times, float)
    _check(times, positions, quaternions, interpolation, ends)
    if (velocities is not None) != (interpolation == "hermite"):
        raise InputError("velocities", None, 'needed with interpolation = "hermite", and with no other')
    if accelerations is not None and velocities is None:
        raise InputError("accelerations", None, "absent without velocities")
    since = times - times[0]
    if velocities is None:
        degree = 3 if interpolation == "cubic" else 5
        table = _spline(since, np.asarray(positions, float), degree, ends)
    else:
        degree = 3 if accelerations is None else 5
        table = _hermite(since, [positions, velocities] + ([] if accelerations is None else [accelerations]))
    turning = None if quaternions is None else _spline(since, continuous(np.asarray(quaternions, float)), degree, ends)
    return Spline(leaf(since), leaf(table), None if turning is None else leaf(turning), leaf(z0))


def continuous(quaternions: np.ndarray) -> np.ndarray:
    """Unit quaternions, each of the sign that is nearer to the one before.

    Args:
        quaternions: (n, 4) of any length but zero.

    Returns:
        (n, 4).
    """
    units = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    flips = np.where(np.sum(units[1:] * units[:-1], axis=1) < 0.0, -1.0, 1.0)
    return units * np.cumprod(np.append(1.0, flips))[:, None]


def _check(times: np.ndarray, positions, quaternions, interpolation: str, ends: str) -> None:
    for name, value, allowed in (("interpolation", interpolation, INTERPOLATIONS), ("ends", ends, ENDS)):
        if value not in allowed:
            raise InputError(name, value, " or ".join(f'"{each}"' for each in allowed))
    if times.ndim != 1 or len(times) < 2 or not np.isfinite(times).all():
        raise InputError("times", None, "must be two or more finite numbers, in s", fault=f"shape {times.shape}")
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if len(late):
        i = int(late[0]) + 1
        raise InputError(f"times[{i}]", float(times[i]), f"more than times[{i - 1}] = {float(times[i - 1])!r}")
    for name, values, width in (("positions", positions, 3), ("quaternions", quaternions, 4)):
        if values is None:
            continue
        array = np.asarray(values, float)
        if array.shape != (len(times), width):
            raise InputError(
                name, None, f"must be ({len(times)}, {width}), a row for each time", fault=f"{array.shape}"
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


def _spline(times: np.ndarray, values: np.ndarray, degree: int, ends: str) -> np.ndarray:
    # Bernstein coefficients of each piece, (n - 1, degree + 1, width).
    if ends == "periodic":
        return _periodic(times, values, degree)
    if degree == 3:
        return _pieces(CubicSpline(times, values, bc_type="clamped" if ends == "rest" else "natural"))
    still = [(order, np.zeros(values.shape[1])) for order in ((1, 2) if ends == "rest" else (3, 4))]
    return _quintic(times, make_interp_spline(times, values, degree, bc_type=(still, still)))


def _periodic(times: np.ndarray, values: np.ndarray, degree: int) -> np.ndarray:
    # A quaternion that comes back with the other sign, after a whole turn, does so twice in two periods.
    sign = 1.0 if np.sum(values[0] * values[-1]) >= 0.0 else -1.0
    times = np.concatenate([times, times[1:] + times[-1]])
    values = np.concatenate([values[:-1], sign * values[:-1], values[:1]])
    if degree == 3:
        pieces = _pieces(CubicSpline(times, values, bc_type="periodic"))
    else:
        pieces = _quintic(times, make_interp_spline(times, values, degree, bc_type="periodic"))
    return pieces[: len(pieces) // 2]


def _quintic(times: np.ndarray, spline: BSpline) -> np.ndarray:
    return _hermite(times, [spline(times, order) for order in range(3)])


def _hermite(times: np.ndarray, derivatives: list) -> np.ndarray:
    # Bernstein coefficients of the pieces with these values and derivatives, (n, width) each, at their ends.
    table = np.stack([np.asarray(values, float) for values in derivatives], axis=1)
    return np.moveaxis(BPoly.from_derivatives(times, table).c, 0, 1)


def _pieces(spline: PPoly) -> np.ndarray:
    powers = np.moveaxis(spline.c[::-1], 0, 1)
    return bernstein_of_powers(powers * np.diff(spline.x)[:, None, None] ** np.arange(powers.shape[1])[:, None])
