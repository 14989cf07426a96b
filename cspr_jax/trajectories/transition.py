"""Transitions between rest and a point beyond the static workspace, thesis chapter 1, in the product's axes.

The effector swings about p0 on the straight line through the target, in n oscillations whose size
grows like the amplitude function A: p = p0 + u A cos(2 pi n tau), (1.20), (1.21), (1.89). With the
duration (1.29) its end acceleration is that of a pendulum hung from the centroid of the spools.
"""

import dataclasses
import math

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax import robots
from cspr_jax.amplitudes import Amplitude, derivatives
from cspr_jax.robots import PointMassRobot
from cspr_jax.trajectories.couplings import couplings


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Transition:
    """A transition from rest in p0.

    Fields:
        hub: (3,) p0, m.
        offset: (3,) u, from p0 to the target, m.
        rate: () g / z0, 1/s^2.
        inclination: () v of (1.31): how much deeper below the spools the target is than p0, over z0.
        weights: (n_cables,) the weighted trajectory parameters w_k: (1.37) and (1.93) for their robots.
    """

    hub: Array
    offset: Array
    rate: Array
    inclination: Array
    weights: Array


def transition(robot: PointMassRobot, target: Array, z0: Array) -> Transition:
    """The transition from rest in p0 to a target.

    The weights follow from the robot's own spools: (v + w_k) is what the acceleration along u takes
    from cable k.

    Args:
        robot: a point mass on three cables, any triangle.
        target: (3,) z down, m.
        z0: () depth of p0 below the centroid of the spools, m.

    Returns:
        the transition.
    """
    below = jnp.stack([jnp.zeros_like(z0), jnp.zeros_like(z0), z0])
    hub = robots.centroid(robot) + below
    offset = target - hub
    tilt, pull, _ = couplings(robot, below, offset[:, None])
    return Transition(hub, offset, robot.gravity / z0, tilt[0], -pull[:, 0] - tilt[0])


def planar_weights(reach: Array) -> Array:
    """Weights of the planar robot: two cables from spools on a level line, (1.37).

    Args:
        reach: () distance of the target from the middle of the spools along the line, over half of their distance.

    Returns:
        (2,) w_1 and w_2.
    """
    return jnp.stack([-reach, reach])


def squared_duration(amplitude: Amplitude, oscillations: Array) -> Array:
    """T^2 g / z0, (1.29).

    Args:
        amplitude: A.
        oscillations: () n, a float.

    Returns:
        () 4 pi^2 n^2 - A''(1).
    """
    bend = derivatives(amplitude, jnp.ones_like(oscillations), order=2)[2]
    return (2.0 * math.pi * oscillations) ** 2 - bend


def duration(transition: Transition, amplitude: Amplitude, oscillations: Array) -> Array:
    """Duration, (1.29).

    Args:
        transition: the transition.
        amplitude: A.
        oscillations: () n, a float.

    Returns:
        () s; NaN where A''(1) leaves none.
    """
    return jnp.sqrt(squared_duration(amplitude, oscillations) / transition.rate)


def motion(transition: Transition, amplitude: Amplitude, oscillations: Array, tau: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration at one instant, (1.20), (1.21), (1.89).

    Args:
        transition: the transition.
        amplitude: A.
        oscillations: () n, a float.
        tau: () time over the duration; 1 - tau is the way back to rest, (1.56), its velocity reversed.

    Returns:
        (3,) m, (3,) m/s, (3,) m/s^2.
    """
    size, slope, bend = derivatives(amplitude, tau, order=2)
    omega = 2.0 * math.pi * oscillations
    cosine, sine = jnp.cos(omega * tau), jnp.sin(omega * tau)
    time = duration(transition, amplitude, oscillations)
    swing = size * cosine
    rate = (slope * cosine - omega * size * sine) / time
    acceleration = (bend * cosine - 2.0 * omega * slope * sine - omega**2 * swing) / time**2
    u = transition.offset
    return transition.hub + u * swing, u * rate, u * acceleration
