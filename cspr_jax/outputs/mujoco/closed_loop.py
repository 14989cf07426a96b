"""Winches under control in MuJoCo: motors turn drums, elastic cables pull, and MuJoCo moves the effector.

A cable of which a drum has paid out the length l0 pulls with EA ((l - l0) / l0 + T l'' / l0) where l'' is the rate of
l - l0 and T a time constant of damping, and never less than 0. Motors follow the equation of `robots.model.winches`,
with friction that can hold them. A controller sees angles of encoders, rounded to counts and with noise, and applies,
after a delay, the torques of set points, corrected in proportion to errors of angle and speed.

Angles, speeds and torques are positive where motors wind.
"""

from __future__ import annotations

import collections
import dataclasses
import math
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.outputs.mujoco.mjcf import model_xml
from cspr_jax.outputs.mujoco.module import need_mujoco
from cspr_jax.outputs.mujoco.motion import Played, Suspended
from cspr_jax.outputs.mujoco.replay import callback_lent

# Steps of the integrator in the period of the fastest oscillation of a cable between its drum and the effector.
STEPS_A_PERIOD = 30
# Fraction of the speed's last estimate in its next one.
SMOOTHING = 0.5


@dataclasses.dataclass(frozen=True)
class Drives:
    """Motors and drums of the simulation, of n winches.

    Fields:
        angles: n arrays of ascending angles of the motor, rad, between which the paid-out length is linear.
        lengths: n arrays of lengths at these angles, m.
        inertia: (n,) kg m^2.
        friction: (n,) Coulomb friction, N m.
        viscous_friction: (n,) N m s/rad.
        efficiency: (n,) of gear and drum.
        torque_max: (n,) largest torques of the motors, at standstill, N m; inf without a limit.
        counts: (n,) counts of the encoders a turn; 0: angles are exact.
    """

    angles: list[np.ndarray]
    lengths: list[np.ndarray]
    inertia: np.ndarray
    friction: np.ndarray
    viscous_friction: np.ndarray
    efficiency: np.ndarray
    torque_max: np.ndarray
    counts: np.ndarray

    def paid_out(self, angle: np.ndarray) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
        """Lengths that the drums have paid out, and by how much they fall per rad."""
        length, paid_out_per_rad = np.empty(len(angle)), np.empty(len(angle))
        for k, (x, angles, lengths) in enumerate(zip(angle.tolist(), self.angles, self.lengths, strict=True)):
            i = min(max(int(angles.searchsorted(x)) - 1, 0), len(angles) - 2)
            paid_out_per_rad[k] = (lengths[i] - lengths[i + 1]) / (angles[i + 1] - angles[i])
            length[k] = lengths[i] - paid_out_per_rad[k] * (x - angles[i])
        return length, paid_out_per_rad

    def clipped(self, torque: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Torques that motors give where these are commanded."""
        return np.clip(torque, -self.torque_max, self.torque_max)

    def next_speed(
        self, speed: np.ndarray, torque: np.ndarray, load: np.ndarray, step: float
    ) -> Float[np.ndarray, "n"]:
        """Speeds after a step under motor torques and loads, with friction that at most stops a motor."""
        free = speed + step / self.inertia * (torque - load - self.viscous_friction * speed)
        lost = load * np.where(free > 0.0, 1.0 / self.efficiency - 1.0, 1.0 - self.efficiency)
        return np.sign(free) * np.maximum(np.abs(free) - step / self.inertia * (self.friction + lost), 0.0)


class WindingSetPoints(NamedTuple):
    """Set points of n winches at m ticks.

    Fields:
        angle: (m, n) rad.
        speed: (m, n) rad/s.
        torque: (m, n) N m.
    """

    angle: np.ndarray
    speed: np.ndarray
    torque: np.ndarray


@dataclasses.dataclass(frozen=True)
class Loop:
    """Settings of a closed loop.

    Fields:
        rate: ticks of the controller a second, Hz.
        bandwidth: natural frequency of the position loop of each motor, rad/s; 0: torques of the set points alone.
        delay: time from a measurement to the torque that follows from it, s.
        counts: counts of the encoders a turn; 0: angles are exact; None: those of the robot file, else 4096.
        noise: standard deviation of measured angles, rad.
        damping_time: time constant of the damping of cables, s.
        mass: mass and inertia of the effector over those of the plan.
        friction: friction of the winches over that of the set points.
        stiffness: stiffness of the cables over that of the robot file.
        seed: seed of the noise.
    """

    rate: float = 1000.0
    bandwidth: float = 60.0
    delay: float = 0.001
    counts: float | None = None
    noise: float = 0.0
    damping_time: float = 0.002
    mass: float = 1.0
    friction: float = 1.0
    stiffness: float = 1.0
    seed: int = 0


class Driven(NamedTuple):
    """Results of the simulation at m ticks.

    Fields:
        coordinates: (m, nq) coordinates of MuJoCo's joints.
        tension: (m, n_cables) N.
        angle: (m, n) angles of the motors, rad.
        torque: (m, n) torques of the motors, N m.
    """

    coordinates: np.ndarray
    tension: np.ndarray
    angle: np.ndarray
    torque: np.ndarray


class _Controller:
    """Controller of all motors: torques of set points, corrected by the errors of measured angles and speeds."""

    def __init__(
        self, points: WindingSetPoints, gains: tuple[np.ndarray, np.ndarray], counts: np.ndarray, loop: Loop
    ) -> None:
        self._points, self._gains, self._loop = points, gains, loop
        self._random, self._count = np.random.default_rng(loop.seed), 2.0 * math.pi / np.maximum(counts, 1.0)
        self._is_exact = counts == 0.0
        self._angle, self._speed = points.angle[0], points.speed[0]

    def torque(self, tick: int, angle: np.ndarray) -> np.ndarray:
        """Torques of a tick, from the angles at its time."""
        measured = angle + self._loop.noise * self._random.standard_normal(len(angle))
        measured = np.where(self._is_exact, measured, self._count * np.round(measured / self._count))
        if tick:
            rate = (measured - self._angle) * self._loop.rate
            self._speed = SMOOTHING * self._speed + (1.0 - SMOOTHING) * rate
        self._angle, (points, (stiff, damped)) = measured, (self._points, self._gains)
        errors = points.angle[tick] - measured, points.speed[tick] - self._speed
        return points.torque[tick] + stiff * errors[0] + damped * errors[1]


def driven(
    body: Suspended,
    moved: Played,
    points: WindingSetPoints,
    drives: Drives,
    axial_stiffness: Float[np.ndarray, "n_cables"],
    winch_of: Int[np.ndarray, "n_cables"],
    loop: Loop,
) -> Driven:
    """Drive a robot along set points; `moved` is its planned motion at the ticks."""
    mujoco = need_mujoco()
    with callback_lent(mujoco):
        model = mujoco.MjModel.from_xml_string(model_xml(body, moved))
    model.body_mass[:] *= loop.mass
    model.body_inertia[:] *= loop.mass
    model.actuator_ctrllimited[:] = 0
    data, count = mujoco.MjData(model), len(winch_of)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    stiffness, angle = axial_stiffness * loop.stiffness, points.angle[0].copy()
    # Over pulleys MuJoCo's tendons begin below the entry points.
    paid, paid_out_per_rad = drives.paid_out(angle)
    before = data.ten_length[:count] - paid[winch_of] * (1.0 + moved.tension[0] / axial_stiffness)
    period = 1.0 / loop.rate
    steps = _steps(body, drives, stiffness, paid[winch_of], paid_out_per_rad[winch_of], winch_of, period)
    model.opt.timestep = step = period / steps
    controller = _Controller(points, _gains(body, drives, paid_out_per_rad, loop), drives.counts, loop)
    waiting = collections.deque([drives.clipped(points.torque[0])] * round(loop.delay * loop.rate * steps))
    speed, recorded = points.speed[0].copy(), _empty(len(points.angle), model.nq, count, len(angle))
    for tick in range(len(points.angle)):
        command = drives.clipped(controller.torque(tick, angle))
        for k in range(steps):
            waiting.append(command)
            torque = waiting.popleft()
            paid, paid_out_per_rad = drives.paid_out(angle)
            of_cables = paid[winch_of]
            elongation = data.ten_length[:count] - before - of_cables
            rate = data.ten_velocity[:count] + (paid_out_per_rad * speed)[winch_of]
            tension = np.maximum(stiffness * (elongation + loop.damping_time * rate) / of_cables, 0.0)
            if k == 0:
                for name, value in zip(Driven._fields, (data.qpos, tension, angle, torque), strict=True):
                    recorded[name][tick] = value
            load = paid_out_per_rad * np.bincount(winch_of, tension, len(angle))
            speed = drives.next_speed(speed, torque, load, step)
            angle = angle + step * speed
            data.ctrl[:] = tension
            mujoco.mj_step(model, data)
    return Driven(**recorded)


def _empty(ticks: int, n_coordinates: int, n_cables: int, n_winches: int) -> dict[str, np.ndarray]:
    sizes = (n_coordinates, n_cables, n_winches, n_winches)
    return {name: np.empty((ticks, extent)) for name, extent in zip(Driven._fields, sizes, strict=True)}


def _steps(body, drives, stiffness, lengths, paid_out_per_rad, winch_of, period) -> int:
    # Resolve the fastest oscillation: a cable between the inertia of its drum and the effector.
    masses = 1.0 / body.mass + paid_out_per_rad**2 / drives.inertia[winch_of]
    if body.inertia is not None:
        masses = masses + np.sum(body.points**2, axis=1) / np.linalg.eigvalsh(body.inertia).min()
    fastest = math.sqrt(float(np.max(stiffness / lengths * masses) * len(winch_of)))
    return math.ceil(period * fastest * STEPS_A_PERIOD / (2.0 * math.pi))


def _gains(body: Suspended, drives: Drives, paid_out_per_rad: np.ndarray, loop: Loop) -> tuple[np.ndarray, np.ndarray]:
    # Critically damped loops of rotors that carry their parts of the effector's mass.
    inertia = drives.inertia + body.mass * paid_out_per_rad**2 / len(paid_out_per_rad)
    return inertia * loop.bandwidth**2, 2.0 * inertia * loop.bandwidth
