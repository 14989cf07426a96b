"""Interpolation of samples in time: the piecewise polynomial that a controller plays of a table.

`INTERPOLATIONS` are C2 cubic and C4 quintic splines through the samples, and Hermite pieces, cubic from velocities and
quintic from accelerations too. Quaternions are made continuous in sign, interpolated by themselves, and normalised
afterwards; where positions are Hermite pieces, quaternions are a spline of the same degree.
"""

import numpy as np
from scipy.interpolate import BPoly, CubicSpline, PPoly, make_interp_spline

from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.errors import InputError
from cspr_jax.splines.motion import Spline, bernstein_of_powers

INTERPOLATIONS = ("cubic", "quintic", "hermite")
ENDS = ("rest", "natural", "periodic")
# The ends of a periodic motion differ by no more than this part of its extent.
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
        extent = np.ptp(array, axis=0).max()
        if ends == "periodic" and name == "positions" and np.abs(array[-1] - array[0]).max() > PERIODIC * extent:
            raise InputError("ends", ends, "another one where the last position is not the first")


def _spline(times: np.ndarray, values: np.ndarray, degree: int, ends: str) -> np.ndarray:
    # Bernstein coefficients of each piece, (n - 1, degree + 1, width).
    if ends == "periodic":
        # To the last bit; quaternions may come back with the other sign, which is the same orientation.
        values = np.concatenate([values[:-1], values[:1] * np.sign(np.sum(values[:1] * values[-1:]) or 1.0)])
    if degree == 3:
        return _pieces(CubicSpline(times, values, bc_type="clamped" if ends == "rest" else ends))
    orders = {"rest": (1, 2), "natural": (3, 4)}.get(ends, ())
    zeros = [(order, np.zeros(values.shape[1])) for order in orders]
    spline = make_interp_spline(times, values, degree, bc_type=(zeros, zeros) if orders else "periodic")
    derivatives = [spline.derivative(order)(times) if order else spline(times) for order in range(3)]
    return _hermite(times, derivatives)


def _hermite(times: np.ndarray, derivatives: list) -> np.ndarray:
    # Bernstein coefficients of the pieces with these values and derivatives, (n, width) each, at their ends.
    table = np.stack([np.asarray(values, float) for values in derivatives], axis=1)
    return np.moveaxis(BPoly.from_derivatives(times, table).c, 0, 1)


def _pieces(spline: PPoly) -> np.ndarray:
    powers = np.moveaxis(spline.c[::-1], 0, 1)
    return bernstein_of_powers(powers * np.diff(spline.x)[:, None, None] ** np.arange(powers.shape[1])[:, None])
