"""Piecewise polynomial motion: what a table of samples or way-points and an interpolation are, in Bernstein form."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic import rotations
from cspr_jax.robots.state import State
from cspr_jax.robots.state_bounds import StateBounds
from cspr_jax.splines.blocks import spline_bounds


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Spline:
    """Piecewise polynomial motion; see `motions.motion.Motion`.

    Fields:
        knots: (m + 1,) instants between the m pieces, the first 0, increasing; s.
        position: (m, degree + 1, 3) Bernstein coefficients of each piece, m.
        quaternion: (m, degree + 1, 4) likewise, scalar first, continuous; their length is of no account, but not zero;
            None for a point mass.
        z0: () depth at which slacks are normalised, m.
    """

    knots: Array
    position: Array
    quaternion: Array | None
    z0: Array

    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return self.knots[-1]

    def state(self, tau: Array) -> State:
        """State; see `Motion.state`."""
        knots = jnp.asarray(self.knots)
        t = tau * knots[-1]
        piece = jnp.clip(jnp.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
        width = knots[piece + 1] - knots[piece]
        share = (t - knots[piece]) / width
        position, velocity, acceleration = _values(jnp.asarray(self.position)[piece], share, width)
        if self.quaternion is None:
            return State(position, velocity, acceleration)
        turning = _turning(*_values(jnp.asarray(self.quaternion)[piece], share, width))
        return State(position, velocity, acceleration, *turning)

    def breaks(self) -> Array:
        """Breaks; see `Motion.breaks`."""
        return self.knots[1:-1] / self.knots[-1]

    def bounds(self, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states; see `BoundedMotion.bounds`."""
        quaternion = None if self.quaternion is None else np.asarray(self.quaternion)
        return spline_bounds(np.asarray(self.knots), np.asarray(self.position), quaternion, start, end)


def _values(coefficients: Array, share: Array, width: Array) -> tuple[Array, Array, Array]:
    # Value and first two derivatives of (degree + 1, n) Bernstein coefficients, at a share of the width of the piece.
    degree = coefficients.shape[0] - 1
    first = jnp.diff(coefficients, axis=0) * (degree / width)
    second = jnp.diff(first, axis=0) * (max(degree - 1, 0) / width)
    return _bernstein(coefficients, share), _bernstein(first, share), _bernstein(second, share)


def _bernstein(coefficients: Array, share: Array) -> Array:
    # By the steps of de Casteljau.
    while coefficients.shape[0] > 1:
        coefficients = coefficients[:-1] + share * jnp.diff(coefficients, axis=0)
    return coefficients.sum(0)


def _turning(quaternion: Array, first: Array, second: Array) -> tuple[Array, Array, Array, Array]:
    # Rotation, angular velocity and acceleration, and unit quaternion; as in `arithmetic.rotation_bounds`.
    square = jnp.dot(quaternion, quaternion)
    unit = quaternion / jnp.sqrt(square)
    rotation = rotations.matrix(unit)

    def across(f: Array) -> Array:
        turning = f[1:] * quaternion[0] - f[0] * quaternion[1:] - jnp.cross(f[1:], quaternion[1:])
        return 2.0 * turning / square

    angular_velocity = across(first)
    angular_acceleration = across(second) - angular_velocity * (2.0 * jnp.dot(quaternion, first) / square)
    return rotation, angular_velocity, angular_acceleration, unit
