"""Transitions between rest and a point beyond the static workspace, thesis chapter 1, in the axes of the kernels.

The effector oscillates about p0 on the straight line through the target, in n oscillations that grow
with the amplitude function A: p = p0 + u A cos(2 pi n tau), (1.20), (1.21), (1.89). With the duration
(1.29) its end acceleration is that of a pendulum that hangs from the centroid of the spools.

It is a segment of chapter 2 from rest with an even number of arcs p = 2 n, except that A''(1) need
not vanish. Reversed in time it returns to rest, (1.56) to (1.58). With a constant amplitude it is
a swing between the target and its opposite point.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.families.swings import hypocycloid
from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import PointMassRobot, plane_normal, rest_point


@jax.jit
def transition(robot: PointMassRobot, amplitude: Amplitude, target: Float[Array, "3"], z0: Float[Array, ""]) -> Segment:
    """The transition from rest in p0 to a target."""
    segment = hypocycloid.segment(robot, rest_point(z0), target, z0, odd=jnp.asarray(False))
    second_derivative = derivatives(amplitude, jnp.ones_like(z0), order=2)[2]
    return dataclasses.replace(segment, end_curvature=second_derivative)


@jax.jit
def steady(segment: Segment) -> Segment:
    """The swing of constant amplitude in which a transition ends."""
    return dataclasses.replace(
        segment, start_radius=segment.end_radius, end_curvature=jnp.zeros_like(jnp.asarray(segment.end_curvature))
    )


def inclination(segment: Segment) -> Float[Array, "..."]:
    """Depth of the target below the spools minus that of p0, over z0: v of (1.31)."""
    return segment.end_radius * segment.tilt[..., 0]


@jax.jit
def weights(segment: Segment) -> Float[Array, "... n_cables"]:
    """The weighted trajectory parameters w_k: (1.37) and (1.93), by number of cables."""
    load = -segment.end_radius[..., None] * segment.coupling[..., 0]
    return load - inclination(segment)[..., None]


@jax.jit
def depth_for(robot: PointMassRobot, target: Float[Array, "3"], inclination: Float[Array, ""]) -> Float[Array, ""]:
    """The depth z0 of p0 for which a target has a given inclination, from (1.31)."""
    return plane_normal(robot) @ target / (1.0 + inclination)
