"""Motions of files and tables, as splines in the axes of the kernels."""

import dataclasses
from typing import Any

import numpy as np
from scipy.interpolate import BarycentricInterpolator
from scipy.spatial.transform import Rotation

from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.arithmetic.frames import IDENTITY, Frame
from cspr_jax.arithmetic.rotations import products
from cspr_jax.config.motions.table import MotionPieces, MotionTable
from cspr_jax.errors import InputError
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.kernel_axes import centred
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.reference_pose import aligned
from cspr_jax.splines.motion import Spline
from cspr_jax.splines.reading import pieces_of, spline_of

# Samples of a motion, not way-points, are at least so many; the part of the largest speed that counts as moving.
MANY, MOVING = 30, 0.2
BACK = np.array([1.0, -1.0, -1.0, -1.0])


def samples_of(times, positions, quaternions=None, velocities=None, accelerations=None) -> MotionTable:
    """Samples of a motion from arrays.

    Args:
        times: (n,) s.
        positions: (n, 3) m.
        quaternions: (n, 4) or None.
        velocities: (n, 3) m/s, or None.
        accelerations: (n, 3) m/s^2, or None.

    Returns:
        the samples.

    Raises:
        InputError: numbers of rows that differ.
    """
    times, positions = np.asarray(times, float), np.asarray(positions, float)
    others = {"quaternions": quaternions, "velocities": velocities, "accelerations": accelerations}
    arrays: dict[str, Any] = {name: np.asarray(rows, float) for name, rows in others.items() if rows is not None}
    for name, rows in ({"positions": positions} | arrays).items():
        if len(rows) != len(times):
            raise InputError(name, None, f"must have {len(times)} rows, one for each time", fault=f"shape {rows.shape}")
    return MotionTable(times, positions, **arrays)


def source_spline(
    source: Any, *, z_axis: str, is_platform: bool, interpolation: str | None = None, ends: str | None = None
) -> Spline:
    """A motion as a spline, in the axes of a robot file.

    Args:
        source: samples, polynomial pieces, a curve of SciPy in these axes, or a spline in them.
        z_axis: direction of their z, "up" or "down".
        is_platform: whether the robot has orientations; where the motion has none, it keeps its own axes.
        interpolation: of samples; None: as they say, else "hermite" with velocities, "cubic" without.
        ends: of samples; None: as they say, else "rest".

    Returns:
        the spline.

    Raises:
        InputError: samples that make no motion of this robot.
    """
    if isinstance(source, Spline):
        return source
    if not isinstance(source, MotionTable | MotionPieces):
        source = pieces_of(source)
    spline = spline_of(source.in_axes(z_axis), interpolation=interpolation, ends=ends)
    if is_platform and spline.quaternion is None:
        turning = np.zeros((len(spline.knots) - 1, 1, 4)) + np.eye(4)[0]
        return dataclasses.replace(spline, quaternion=leaf(turning))
    if not is_platform and spline.quaternion is not None:
        raise InputError("quaternions", None, "must be absent for a point mass", fault="orientations")
    return spline


def moving_ends(source: Any, ends: str | None) -> list[str]:
    """Hints of samples that move at an end where the curve is taken to be at rest.

    Args:
        source: samples, or anything else.
        ends: that the user asked for; None: none.

    Returns:
        one line for each end.
    """
    if not isinstance(source, MotionTable) or source.velocities is not None or (ends or source.ends) is not None:
        return []
    lines, times, positions = [], source.times, source.positions
    if len(times) < MANY:
        return []
    largest = float(np.max(np.linalg.norm(np.diff(positions, axis=0), axis=1) / np.diff(times)))
    for word, rows in (("begin", slice(None, 4)), ("end", slice(-4, None))):
        place = times[rows][0 if word == "begin" else -1]
        curve = BarycentricInterpolator(times[rows] - place, positions[rows])
        speed = float(np.linalg.norm(curve.derivative(0.0)))
        if speed > MOVING * largest:
            lines.append(
                f"hint: its samples {word} at {speed:.3g} m/s, where the curve is taken to be at rest: ends natural or "
                "periodic, or velocities in the file, would keep that"
            )
    return lines


def placed_inward(spline: Spline, frame: Frame, reference: np.ndarray, centre: np.ndarray | None = None) -> Spline:
    """A spline in the axes of a robot file, in those of the kernels.

    Args:
        spline: orientations are those of the platform's axes in the file; NumPy leaves.
        reference: (4,) of `reference_of`.
        centre: (3,) mass centre in the axes of the platform in the file, m, if the positions are those of their origin;
            None: the positions are those of the mass centre.

    Returns:
        the spline, from the centroid of the spools, z down, orientations from the reference one.
    """
    turning = spline.quaternion
    if turning is not None:
        rows = frame.turned_quaternions(np.asarray(turning)).reshape(-1, 4)
        # A product is linear in the quaternion, and so in its coefficients.
        turning = leaf(products(rows, (reference * BACK)[None]).reshape(turning.shape))
    moved = dataclasses.replace(spline, position=leaf(frame.inward(spline.position)), quaternion=turning)
    if centre is None or not np.any(centre) or turning is None:
        return moved
    return dataclasses.replace(moved, offset=leaf(_rotation(reference).apply(frame.turned(centre))))


def reference_of(robot: AnyRobot) -> np.ndarray:
    """Rotation from the axes of a platform in its file to those of the kernels.

    Args:
        robot: in its own axes.

    Returns:
        (4,) unit quaternion; of a point mass no rotation.
    """
    if not isinstance(robot, PlatformRobot):
        return np.array(IDENTITY)
    return np.roll(Rotation.from_matrix(aligned(centred(robot)[0])[1]).as_quat(), 1)


def _rotation(quaternion: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(quaternion, -1))
