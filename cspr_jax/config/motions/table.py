"""Motions as users bring them: samples over time, or polynomial pieces. SI units and radians."""

from __future__ import annotations

import dataclasses

import numpy as np

from cspr_jax.config.wording import either
from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float

# Vectors between a file with z up and one with z down, by half a turn about x; see `numerics.linear.frames`.
_FLIP = np.array([1.0, -1.0, -1.0])
_FLIP_QUATERNION = np.array([1.0, 1.0, -1.0, -1.0])
Z_AXES = ("down", "up")
# Points of a platform whose positions a motion may have.
POINTS = ("mass-centre", "origin")
FAR = 30.0  # motions that go beyond this multiple of the robot's size are probably in other units
# Integer times of more rows than this are probably milliseconds, or have no unit.
MANY = 50


@dataclasses.dataclass(frozen=True)
class MotionTable:
    """Samples of a motion.

    Fields:
        times: (n,) s, increasing; with velocities, a time may stand twice where the acceleration jumps.
        positions: (n, 3) m.
        quaternions: (n, 4) unit quaternions, scalar first, or None.
        velocities: (n, 3) m/s, or None.
        accelerations: (n, 3) m/s^2, or None.
        angular_velocities: (n, 3) rad/s, fixed axes, or None.
        angular_accelerations: (n, 3) rad/s^2, fixed axes, or None.
        interpolation: interpolation that the file asks for, one of `curves.interpolation.INTERPOLATIONS`, or None.
        ends: ends that the file asks for, one of `curves.interpolation.ENDS`, or None.
        z_axis: direction of its z axis, "up" or "down"; None: as in the file of the robot.
        point: point whose positions it has, one of `POINTS`; None: unknown.
        from_reference: whether orientations are relative to the reference orientation, not to the platform's own axes.
        is_planar: whether it has no y, as motions of planar robots may; its y is 0.
        notes: lines for the user.
    """

    times: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray | None = None
    velocities: np.ndarray | None = None
    accelerations: np.ndarray | None = None
    angular_velocities: np.ndarray | None = None
    angular_accelerations: np.ndarray | None = None
    interpolation: str | None = None
    ends: str | None = None
    z_axis: str | None = None
    point: str | None = None
    from_reference: bool = False
    is_planar: bool = False
    notes: tuple[str, ...] = ()

    def in_axes(self, z_axis: str) -> "MotionTable":
        """The motion in the axes of a robot file."""
        if not _is_flipped(self.z_axis, z_axis):
            return self
        return dataclasses.replace(
            self,
            positions=self.positions * _FLIP,
            quaternions=_flipped(self.quaternions, _FLIP_QUATERNION),
            velocities=_flipped(self.velocities, _FLIP),
            accelerations=_flipped(self.accelerations, _FLIP),
            angular_velocities=_flipped(self.angular_velocities, _FLIP),
            angular_accelerations=_flipped(self.angular_accelerations, _FLIP),
            z_axis=z_axis,
        )


@dataclasses.dataclass(frozen=True)
class MotionPieces:
    """Piecewise polynomial motion.

    Fields:
        knots: (m + 1,) times between the pieces, increasing, s.
        position: (m, degree + 1, 3) Bernstein coefficients of each piece, m.
        quaternion: (m, degree + 1, 4) likewise, scalar first, of any norm but zero; or None.
        z_axis: direction of its z axis, "up" or "down"; None: as in the file of the robot.
        point: point whose positions it has, one of `POINTS`; None: unknown.
        is_planar: whether it has no y, as motions of planar robots may; its y is 0.
        notes: lines for the user.
    """

    knots: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray | None = None
    z_axis: str | None = None
    point: str | None = None
    is_planar: bool = False
    notes: tuple[str, ...] = ()

    def in_axes(self, z_axis: str) -> "MotionPieces":
        """The motion in the axes of a robot file."""
        if not _is_flipped(self.z_axis, z_axis):
            return self
        quaternion = _flipped(self.quaternion, _FLIP_QUATERNION)
        return dataclasses.replace(self, position=self.position * _FLIP, quaternion=quaternion, z_axis=z_axis)


def unit_hints(table: MotionTable, base_points: Float[np.ndarray, "n_cables 3"]) -> list[str]:
    """Hints that the units of a table are probably others than those in which it is read."""
    points = np.asarray(base_points, float)
    extent = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    distance = float(np.abs(table.positions - points.mean(axis=0)).max())
    lines = []
    if distance > FAR * extent:
        lines.append(
            f"positions are up to {distance:.3g} m from the spools of a robot of {extent:.3g} m: are they millimetres? "
            "Then say so: # units: mm"
        )
    times = table.times
    if len(times) > MANY and np.array_equal(times, np.round(times)):
        lines.append(
            f"times are whole numbers, from {times[0]:g} to {times[-1]:g} s: are they milliseconds? "
            "Then say so: # units: ms"
        )
    return lines


def _is_flipped(before: str | None, after: str) -> bool:
    if after not in Z_AXES:
        raise InputError("z_axis", after, either(Z_AXES))
    return before not in (None, after)


def _flipped(vectors: np.ndarray | None, signs: np.ndarray) -> np.ndarray | None:
    return None if vectors is None else vectors * signs
