"""Bounds of rotations over a block, from those of quaternions of any length and of their first two derivatives."""

from typing import NamedTuple

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, cross, dot, norm_squared, squared, stacked
from cspr_jax.numerics.bounds.function_bounds import reciprocal


class RotationBounds(NamedTuple):
    """Bounds of a rotation and of its angular velocity and acceleration.

    Fields:
        rotation: (3, 3) from body to fixed axes.
        angular_velocity: (3,) fixed axes, rad/s.
        angular_acceleration: (3,) fixed axes, rad/s^2.
    """

    rotation: AffineBounds
    angular_velocity: AffineBounds
    angular_acceleration: AffineBounds


def rotation_bounds(quaternion: AffineBounds, first: AffineBounds, second: AffineBounds) -> RotationBounds:
    """Bounds of the rotation of a quaternion that is normalised afterwards; see `unit_rotation_bounds`.

    With n = |q|^2, the angular velocity is 2 vec(q' q*) / n; since vec(q' q'*) = 0, the derivative of its numerator is
    2 vec(q'' q*).
    """
    unit, inverse = unit_rotation_bounds(quaternion, first, second), reciprocal(norm_squared(quaternion))
    angular_velocity = unit.angular_velocity * inverse
    relative_rate = 2.0 * dot(quaternion, first) * inverse
    angular_acceleration = unit.angular_acceleration * inverse - angular_velocity * relative_rate
    return RotationBounds(unit.rotation * inverse, angular_velocity, angular_acceleration)


def unit_rotation_bounds(quaternion: AffineBounds, first: AffineBounds, second: AffineBounds) -> RotationBounds:
    """Bounds of the rotation of a unit quaternion."""
    w, x, y, z = (quaternion.each(lambda array, i=i: array[i]) for i in range(4))
    ww, xx, yy, zz = (squared(part) for part in (w, x, y, z))
    rows = [
        [ww + xx - yy - zz, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), ww - xx + yy - zz, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), ww - xx - yy + zz],
    ]
    rotation = stacked([stacked(row) for row in rows], axis=0)
    return RotationBounds(rotation, _across(first, quaternion), _across(second, quaternion))


def _across(f: AffineBounds, q: AffineBounds) -> AffineBounds:
    # 2 vec(f q*) of quaternions f and q.
    (f_scalar, f_vector), (q_scalar, q_vector) = (
        (bounds.each(lambda x: x[:1]), bounds.each(lambda x: x[1:])) for bounds in (f, q)
    )
    return 2.0 * (f_vector * q_scalar - f_scalar * q_vector - cross(f_vector, q_vector))
