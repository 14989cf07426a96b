"""Motions of files and tables, as splines in the axes of the kernels."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from scipy.interpolate import BarycentricInterpolator
from scipy.spatial.transform import Rotation

from cspr_jax.config.motions.table import MotionPieces, MotionTable
from cspr_jax.config.motions.text import LONGEST, SHORTEST
from cspr_jax.config.robot import RobotFile
from cspr_jax.curves.reading import pieces_of, spline_of
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import InputError
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import IDENTITY, Frame
from cspr_jax.numerics.linear.rotations import CONJUGATE, products
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.statics.reference_pose import aligned

MANY = 30  # samples; motions with fewer may be sequences of waypoints
MOVING = 0.2  # an end that is faster than this fraction of the largest speed moves
AT_REST = 1e-6  # m/s; samples that are slower are at rest, but for rounding
BESIDE = 1e-9  # fraction of the largest coordinate by which rounding may move a robot off its plane or guide
JOINT_STAYS = 1e-6  # m; a joint that moves less is taken as fixed: tables of six decimals are rounded


def samples_of(times, positions, quaternions=None, velocities=None, accelerations=None) -> MotionTable:
    """Samples of a motion from arrays."""
    times, positions = np.asarray(times, float), np.asarray(positions, float)
    others = {"quaternions": quaternions, "velocities": velocities, "accelerations": accelerations}
    arrays: dict[str, Any] = {name: np.asarray(values, float) for name, values in others.items() if values is not None}
    if accelerations is not None and velocities is None:
        raise InputError("accelerations", None, "absent without velocities")
    for name, values in ({"positions": positions} | arrays).items():
        if len(values) != len(times):
            raise InputError(
                name, None, f"must have {len(times)} rows, one for each time", problem=f"shape {values.shape}"
            )
    if "quaternions" in arrays:
        with np.errstate(over="ignore"):
            norms = np.linalg.norm(arrays["quaternions"], axis=1)
        odd = np.flatnonzero(~((norms >= SHORTEST) & (norms <= LONGEST)))
        if len(odd):
            quaternion = arrays["quaternions"][odd[0]].tolist()
            raise InputError(f"quaternions[{odd[0]}]", quaternion, "a unit quaternion, scalar first")
    return MotionTable(times, positions, **arrays)


def source_spline(
    source: Any, *, z_axis: str, is_platform: bool, interpolation: str | None = None, ends: str | None = None
) -> Spline:
    """A motion as a spline, in the axes of a robot file."""
    if isinstance(source, Spline):
        return source
    if not isinstance(source, MotionTable | MotionPieces):
        source = pieces_of(source)
    spline = spline_of(source.in_axes(z_axis), interpolation=interpolation, ends=ends)
    if is_platform and spline.quaternion is None:
        turning = np.zeros((len(spline.knots) - 1, 1, 4)) + np.eye(4)[0]
        return dataclasses.replace(spline, quaternion=as_float64(turning))
    if not is_platform and spline.quaternion is not None:
        raise InputError("quaternions", None, "must be absent for a point mass", problem="orientations")
    return spline


def kept_to(pattern: str, spline: Spline, *, is_planar: bool) -> Spline:
    """Check that a robot of a pattern can follow a motion; remove rounding errors of coordinates that must not move."""
    row, position = PATTERNS[pattern], np.array(spline.position)
    turning = None if spline.quaternion is None else np.array(spline.quaternion)
    if is_planar and not row.is_planar:
        raise InputError("positions", None, "must have y too, but for planar robots", problem="x and z alone")
    tolerance = BESIDE * np.abs(position).max()
    if row.is_planar:
        beside = float(np.abs(position[:, :, 1]).max())
        if beside > tolerance:
            raise InputError("positions", None, "must be 0 on a planar robot", problem=f"y reaches {beside:.3g} m")
        position[:, :, 1] = 0.0
        if turning is not None:
            if np.abs(turning[:, :, [1, 3]]).max() > BESIDE * np.abs(turning).max():
                raise InputError("orientations", None, "must turn about y alone", problem="those of a planar robot")
            turning[:, :, [1, 3]] = 0.0
    if row.name == "1T" and np.ptp(position[:, :, :2], axis=(0, 1)).max() > tolerance:
        raise InputError("positions", None, "must be the same everywhere on a vertical guide", problem="x and y")
    if row.is_jointed:
        moved = float(np.ptp(position, axis=(0, 1)).max())
        if not moved <= JOINT_STAYS:
            allowed = "must be those of the joint about which the robot turns, the same everywhere"
            raise InputError("positions", None, allowed, problem=f"they differ by {moved:.3g} m")
        position[:] = position[0, 0]
    return dataclasses.replace(
        spline, position=as_float64(position), quaternion=None if turning is None else as_float64(turning)
    )


def moving_ends(source: Any, ends: str | None) -> list[str]:
    """Hints about samples that move at an end where the curve is assumed to be at rest."""
    if not isinstance(source, MotionTable) or source.velocities is not None or (ends or source.ends) is not None:
        return []
    lines, times, positions = [], source.times, source.positions
    if len(times) < MANY:
        return []
    largest = float(np.max(np.linalg.norm(np.diff(positions, axis=0), axis=1) / np.diff(times)))
    for word, part in (("begin", slice(None, 4)), ("end", slice(-4, None))):
        end = times[part][0 if word == "begin" else -1]
        curve = BarycentricInterpolator(times[part] - end, positions[part])
        speed = float(np.linalg.norm(curve.derivative(0.0)))
        if speed > max(MOVING * largest, AT_REST):
            lines.append(
                f"hint: its samples {word} at {speed:.3g} m/s, where the curve is taken to be at rest: ends natural or "
                "periodic, or velocities in the file, would keep that"
            )
    return lines


def placed_inward(
    spline: Spline, frame: Frame, reference: Float[np.ndarray, "4"], centre: Float[np.ndarray, "3"] | None = None
) -> Spline:
    """A spline brought from the axes of a robot file to those of the kernels."""
    turning = spline.quaternion
    if turning is not None:
        units = frame.rotated_quaternions(np.asarray(turning)).reshape(-1, 4)
        # The product is linear in the quaternion, so it applies to Bernstein coefficients too.
        turning = as_float64(products(units, (reference * CONJUGATE)[None]).reshape(turning.shape))
    moved = dataclasses.replace(spline, position=as_float64(frame.inward(spline.position)), quaternion=turning)
    if centre is None or not np.any(centre) or turning is None:
        return moved
    return dataclasses.replace(moved, offset=as_float64(_rotation(reference).apply(frame.rotated(centre))))


def centre_from(robot_file: RobotFile, point: str | None) -> Float[np.ndarray, "3"] | None:
    """Offset from the point whose positions a motion has to the mass centre; None where the two are the same."""
    centre, is_jointed = robot_file.centre_of_mass, PATTERNS[robot_file.own_pattern].is_jointed
    return None if centre is None or is_jointed or point != "origin" else np.asarray(centre)


def reference_of(robot: AnyRobot) -> Float[np.ndarray, "4"]:
    """Rotation from the axes of a platform in its file to those of the kernels."""
    if not isinstance(robot, PlatformRobot):
        return np.array(IDENTITY)
    return np.roll(Rotation.from_matrix(aligned(centred(robot)[0])[1]).as_quat(), 1)


def _rotation(quaternion: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(quaternion, -1))
