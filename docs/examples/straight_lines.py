"""Straight lines at a mean speed of 0.05 m/s, by the quintic law."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.motions.leg import Leg
from cspr_jax.robots.state import State
from cspr_jax.schema.families import Family
from cspr_jax.motions.sampled import sampled_answers

SPEED = 0.05


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Line:
    start: jax.Array
    end: jax.Array
    z0: jax.Array

    def duration(self):
        return jnp.linalg.norm(self.end - self.start) / SPEED

    def state(self, tau):
        way, time = self.end - self.start, self.duration()
        size = tau**3 * (10.0 + tau * (-15.0 + 6.0 * tau))
        slope = tau**2 * (30.0 + tau * (-60.0 + 30.0 * tau))
        bend = tau * (60.0 + tau * (-180.0 + 120.0 * tau))
        return State(self.start + way * size, way * slope / time, way * bend / time**2)

    def breaks(self):
        return jnp.zeros(0)


class Lines(Leg):
    """Points joined by straight lines."""

    def join(self, problem, z0):
        points = self.stops.points(z0)
        motions = [Line(a, b, np.asarray(z0)) for a, b in zip(points[:-1], points[1:], strict=True)]
        return sampled_answers(problem, motions), motions


FAMILY = Family("straight-line", "straight lines at a mean speed", {"3T": "straight_lines:Lines"})
