"""Straight line at a mean speed of 0.05 m/s, by the quintic law."""

import dataclasses

import jax
import jax.numpy as jnp

from cspr_jax.robots.model.state import State

SPEED = 0.05


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Line:
    """Motion between two points, in the axes of the kernels."""

    start: jax.Array
    end: jax.Array
    z0: jax.Array

    def duration(self):
        """Duration, s."""
        return jnp.linalg.norm(self.end - self.start) / SPEED

    def state(self, tau):
        """Position, velocity and acceleration at normalised time."""
        way, time = self.end - self.start, self.duration()
        size = tau**3 * (10.0 + tau * (-15.0 + 6.0 * tau))
        slope = tau**2 * (30.0 + tau * (-60.0 + 30.0 * tau))
        second_derivative = tau * (60.0 + tau * (-180.0 + 120.0 * tau))
        return State(self.start + way * size, way * slope / time, way * second_derivative / time**2)

    def breaks(self):
        """Normalised times at which the motion is less smooth: none."""
        return jnp.zeros(0)
