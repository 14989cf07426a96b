"""A plan that winches under control drive in MuJoCo: how far the effector, tensions and motors are from the plan."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.machine.setpoints import set_points
from cspr_jax.motion.ticks import ticks
from cspr_jax.outputs.motion_files import rows_at
from cspr_jax.outputs.mujoco.closed_loop import Drives, Loop, WindingSetPoints, driven
from cspr_jax.outputs.mujoco.module import need_mujoco
from cspr_jax.outputs.mujoco.motion import check_durations, check_finite, in_world, suspended, upward
from cspr_jax.outputs.mujoco.replay import path_at
from cspr_jax.outputs.table_layout import two_digits
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.winches import Winches, layer_ends, motor_angles

LARGEST_TICKS = 200_000
LARGEST_DELAY = 1.0  # s
COUNTS = 4096.0  # of encoders a turn, where robot files have none
# Length, m, beyond which no cable of a drum without layers reaches.
FAR = 1e5


@dataclasses.dataclass(frozen=True)
class Simulated:
    """A plan and the motion that its winches drive, at the ticks of the controller; in the axes of the robot file.

    Fields:
        robot: name of the robot.
        z_axis: direction of its z axis, "down" or "up".
        mujoco: version of MuJoCo.
        loop: settings of the closed loop.
        time: (m,) time from the start of the plan, s.
        position: (m, 3) planned position of the mass centre, m.
        reached: (m, 3) position that it has, m.
        rotated: (m,) angle from the planned orientation, rad; 0 for a point mass.
        tension: (m, n_cables) planned tensions, N; for parallel pairs, of all six cables.
        tension_reached: (m, n_cables) tensions of the cables, N.
        angle_error: (m, n) angles of the motors less those of the set points, rad; positive where they wind.
        torque: (m, n) torques of the set points, N m; positive where they wind.
        torque_reached: (m, n) torques of the motors, N m.
    """

    robot: str
    z_axis: str
    mujoco: str
    loop: Loop
    time: np.ndarray
    position: np.ndarray
    reached: np.ndarray
    rotated: np.ndarray
    tension: np.ndarray
    tension_reached: np.ndarray
    angle_error: np.ndarray
    torque: np.ndarray
    torque_reached: np.ndarray

    @property
    def error(self) -> np.ndarray:
        """Distance of the mass centre from the plan, (m,) m."""
        return np.linalg.norm(self.reached - self.position, axis=1)

    def to_dict(self) -> dict[str, Any]:
        """The largest errors, and when they occur, as plain values."""
        off = np.abs(self.tension_reached - self.tension)
        return {
            "robot": self.robot,
            "mujoco": self.mujoco,
            "loop": dataclasses.asdict(self.loop),
            "duration": float(self.time[-1]),
            "position": self._largest(self.error, "m") | {"at_end": float(self.error[-1])},
            "rotation": self._largest(self.rotated, "rad") | {"at_end": float(self.rotated[-1])},
            "tension": self._largest(off.max(1), "N") | {"cable": int(off.max(0).argmax())},
            "tension_min": float(self.tension_reached.min()),
            "slack_fraction": float((self.tension_reached <= 0.0).any(1).mean()),
            "motor_angle": self._largest(np.abs(self.angle_error).max(1), "rad"),
            "motor_torque": self._largest(np.abs(self.torque_reached).max(1), "N m"),
        }

    def _largest(self, values: np.ndarray, units: str) -> dict[str, Any]:
        return {"value": float(values.max()), "units": units, "t": float(self.time[values.argmax()])}

    def lines(self) -> list[str]:
        """The largest errors for people."""
        errors, loop = self.to_dict(), self.loop
        control = (
            f"position loops of {loop.bandwidth:g} rad/s" if loop.bandwidth else "set points alone, without feedback"
        )
        position, tension, torque = errors["position"], errors["tension"], errors["motor_torque"]
        text = [
            f"{self.robot}: {self.time[-1]:.2f} s at {loop.rate:g} Hz in MuJoCo {self.mujoco}; {control}",
            f"position: at most {two_digits(position['value'])} m off the plan, at {position['t']:.2f} s; "
            f"{two_digits(position['at_end'])} m at its end",
        ]
        if self.rotated.any():
            turn = errors["rotation"]
            text.append(
                f"orientation: at most {two_digits(turn['value'])} rad off, at {turn['t']:.2f} s; "
                f"{two_digits(turn['at_end'])} rad at its end"
            )
        slack = f"; a cable is slack {errors['slack_fraction']:.1%} of the time" if errors["slack_fraction"] else ""
        text.append(
            f"tensions: at most {two_digits(tension['value'])} N off, cable {tension['cable'] + 1}, at "
            f"{tension['t']:.2f} s; smallest {errors['tension_min']:.3g} N{slack}"
        )
        text.append(f"motors: torques of at most {two_digits(torque['value'])} N m, at {torque['t']:.2f} s")
        return text


def simulate(plan: PlannedMotions, loop: Loop) -> Simulated:
    """Drive a plan by its winches in MuJoCo."""
    mujoco = need_mujoco()
    robot, written = plan.problem.robot, plan.robot_file.as_written
    for name, value in (("winch", robot.winches), ("axial_stiffness", robot.axial_stiffness)):
        if value is None:
            raise ConfigError(plan.robot_file.name, f"{name}: must be given, since winches drive elastic cables")
    if not (np.asarray(robot.winches.motor_inertia) > 0.0).all():
        raise ConfigError(plan.robot_file.name, "winch.motor_inertia: must be greater than 0 to drive motors")
    check_durations(plan)
    duration = float(plan.answers.duration.sum())
    if not duration * loop.rate <= LARGEST_TICKS:
        raise ConfigError("rate", f"{loop.rate:g} Hz: must give at most {LARGEST_TICKS} ticks")
    durations, motions = plan.answers.duration, [motion for leg in plan.legs for motion in leg.motions]
    taus = ticks(durations, loop.rate)[1]
    columns = rows_at(plan, taus)
    columns["tension"] = columns["tension" if plan.robot_file.pairs is None else "tension_each"]
    check_finite(columns)
    segment = np.repeat(np.arange(1, len(taus) + 1), [len(tau) for tau in taus])
    moved, world = in_world(columns, segment, plan.robot_file.z_axis), upward(plan.robot_file.z_axis)
    found_points = set_points(robot, plan.problem.limits, motions, durations, loop.rate, plan.keys.tension_rule)
    body, points = suspended(plan), _winding(found_points, np.asarray(robot.winches.direction))
    stiffness = np.broadcast_to(np.asarray(written.axial_stiffness, float), (len(body.spools),))
    simulation = driven(
        body,
        moved,
        points,
        _drives(robot.winches, plan.problem.limits, loop),
        stiffness,
        _winch_of(plan, len(stiffness)),
        loop,
    )
    reached, rotated = path_at(moved, simulation.coordinates, body.axes)
    return Simulated(
        robot=plan.robot_file.name,
        z_axis=plan.robot_file.z_axis,
        mujoco=mujoco.__version__,
        loop=loop,
        time=moved.time,
        position=world.rotated(moved.position),
        reached=world.rotated(reached),
        rotated=rotated,
        tension=moved.tension,
        tension_reached=simulation.tension,
        angle_error=simulation.angle - points.angle,
        torque=points.torque,
        torque_reached=simulation.torque,
    )


def _winding(points: Any, direction: np.ndarray) -> WindingSetPoints:
    return WindingSetPoints(*(-direction * each for each in (points.angle, points.speed, points.torque)))


def _winch_of(plan: PlannedMotions, n_cables: int) -> np.ndarray:
    # One winch drives both cables of a pair.
    pairs, winch_of = plan.robot_file.pairs, np.arange(n_cables)
    if pairs is not None:
        winch_of[pairs.cables] = np.arange(len(pairs.cables))[:, None]
    return winch_of


def _drives(winches: Winches, limits: Limits, loop: Loop) -> Drives:
    # A drum with layers is linear from layer to layer, one without everywhere.
    if winches.layers is None:
        ends = np.asarray(winches.zero_length) + FAR * np.array([[1.0], [-1.0]])
    else:
        ends = layer_ends(winches, winches.layers)
    angles = -np.asarray(winches.direction) * np.asarray(jax.vmap(partial(motor_angles, winches))(jnp.asarray(ends)))
    friction, viscous = (loop.friction * np.asarray(x) for x in (winches.friction, winches.viscous_friction))
    inertia, efficiency = np.asarray(winches.motor_inertia), np.asarray(winches.efficiency)
    largest = np.full(len(inertia), np.inf)
    for torque_max in (limits.motor_torque_max, winches.stall_torque):
        largest = largest if torque_max is None else np.minimum(largest, torque_max)
    of_robot = COUNTS if winches.encoder_counts is None else np.asarray(winches.encoder_counts)
    counts = np.broadcast_to(np.asarray(of_robot if loop.counts is None else loop.counts, float), inertia.shape)
    return Drives(list(angles.T), list(ends.T), inertia, friction, viscous, efficiency, largest, counts)
