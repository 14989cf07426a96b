"""Set points: what drums and motors do at the ticks of a clock, evaluated at these instants, not interpolated.

Torques are feed-forward: those that hold the tensions and accelerate the rotors, with the friction of the direction in
which each motor turns, and none at standstill.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import jax
import numpy as np

from cspr_jax.machine.drum_motions import drums_and_motors
from cspr_jax.motion.limits import choosing_limits
from cspr_jax.motion.motion import Motion, common_shape
from cspr_jax.motion.ticks import ticks
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits

BATCH = 512  # number of instants computed at a time


class SetPoints(NamedTuple):
    """Set points of n axes at m instants; arrays (m, n) but for the times.

    Fields:
        t: (m,) times k / rate from the start, and the exact end, s.
        length: length of each cable without load, which its drum pays out, m.
        rate: its rate, m/s.
        acceleration: its acceleration, m/s^2.
        tension: tension of each cable, N.
        angle: angle of each motor, rad; None for a robot without winches.
        speed: speed of each motor, rad/s; None without winches.
        motor_acceleration: acceleration of each motor, rad/s^2; None without winches.
        torque: feed-forward torque of each motor, positive where the angle grows, N m; None without winches.
    """

    t: np.ndarray
    length: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    tension: np.ndarray
    angle: np.ndarray | None
    speed: np.ndarray | None
    motor_acceleration: np.ndarray | None
    torque: np.ndarray | None


def set_points(
    robot: AnyRobot,
    limits: Limits,
    motions: Sequence[Motion],
    durations: Float[np.ndarray, "n"],
    rate: float,
    rule: str,
) -> SetPoints:
    """Set points along consecutive motions."""
    limits = choosing_limits(robot, limits)
    times, taus = ticks(durations, rate)
    parts = []
    for motion, tau in zip(motions, taus, strict=True):
        if len(tau):
            one = partial(drums_and_motors, robot, limits, common_shape(motion), rule=rule)
            parts.append(in_batches(one, tau, batch_size=BATCH))
    drums, motors = jax.tree.map(lambda *arrays: np.concatenate(arrays), *parts)
    of_motors = [None] * 4 if motors is None else motors[:4]
    return SetPoints(times, *drums, *of_motors)
