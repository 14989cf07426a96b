"""Anchors and drums of a robot as lines that firmware reads: RepRapFirmware of Hangprinters, and Klipper.

Both take lengths in mm in axes with z up, from the point at which the machine is homed, and know a robot as lines that
run from fixed points to one point: of a platform whose orientation is kept, the spools less its attachment points.

RepRapFirmware: M669 K6 with N anchors A, B, C, D, I, J, L, O as X:Y:Z and the printable radius P; M666 with the anchor
mode A, the buildup factor Q, spool radii R at home, mechanical advantages U, lines per spool O, teeth of motor gears L
and spool gears H. Sources: HangprinterKinematics.cpp of the repository Duet3D/RepRapFirmware (`Configure`; up to five
anchors before 3.7, eight since), and the explanation of M666 and M669 in the repository tobbelobb/hangprinter. With a
factor Q the square of the radius grows by Q for each mm that is wound: of a layer of n turns by the diameter d of the
cable, Q = d / (pi n), and the spiral passes the middles of the steps from layer to layer.

Klipper: [printer] kinematics: winch, and sections [stepper_a] to [stepper_z] with anchor_x, anchor_y, anchor_z and
rotation_distance, the mm that a line gets shorter in one turn of its motor. Source: docs/Config_Reference.md of the
repository Klipper3d/klipper, section on the kinematics of cable winches.
"""

import dataclasses
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.winch_numbers import WINCH_NUMBERS

MM = 1000.0
LETTERS = "ABCDIJLO"
# Largest numbers of teeth on the motor and on the spool: products over the stages of a gear.
MOTOR_TEETH, SPOOL_TEETH = 1000, 1_000_000


@dataclasses.dataclass(frozen=True)
class Anchors:
    """A robot as firmware knows it.

    Fields:
        name: name of the robot.
        points: (n, 3) anchors from home, z up, mm.
        winch: (n,) numbers of the winches by name; empty without winches.
        radii: (n,) radii of the drums at home, mm; None without winches.
        buildup: (n,) growth of the square of the radius for each mm that is wound, mm; zeros without layers.
        lost: what firmware cannot hold, in words.
    """

    name: str
    points: np.ndarray
    winch: dict[str, np.ndarray]
    radii: np.ndarray | None
    buildup: np.ndarray
    lost: tuple[str, ...]


def anchors_of(robot_file: RobotFile, origin: Sequence[float]) -> Anchors:
    """Anchors of a robot that is homed at a point of the axes of its file, m."""
    if len(PATTERNS[robot_file.own_pattern].forces) != 3:
        raise ConfigError("robot", f"{robot_file.name}: must move in space: firmware moves a point along x, y and z")
    robot_file = robot_file.equivalent() if robot_file.is_platform and robot_file.translation_only else robot_file
    points = np.asarray(robot_file.base_points, float)
    if robot_file.is_platform:
        points = points - np.asarray(robot_file.platform_points, float)
    points = points - np.asarray(origin, float)
    # Half a turn about x where z of the file is down, so that nothing is mirrored.
    points = points * frame_of(points, "up" if robot_file.z_axis == "down" else "down").signs
    winch = _numbers(robot_file, len(points))
    radii, buildup = _drums(robot_file, winch, np.linalg.norm(points, axis=1))
    return Anchors(robot_file.name, MM * points, winch, radii, buildup, tuple(_lost(robot_file, winch)))


def _numbers(robot_file: RobotFile, count: int) -> dict[str, np.ndarray]:
    if robot_file.winch is None:
        return {}
    numbers = {row.name: getattr(robot_file.winch, row.name) for row in WINCH_NUMBERS}
    numbers |= {row.name: row.default for row in WINCH_NUMBERS if numbers[row.name] is None}
    return {
        name: np.broadcast_to(np.asarray(value, float), (count,))
        for name, value in numbers.items()
        if value is not None
    }


def _drums(
    robot_file: RobotFile, winch: dict[str, np.ndarray], lengths: np.ndarray
) -> tuple[np.ndarray | None, np.ndarray]:
    if not winch:
        return None, np.zeros(len(lengths))
    radius, diameter = MM * winch["drum_radius"], MM * (robot_file.cable_diameter or 0.0)
    if "layer_turns" not in winch:
        return radius, np.zeros(len(lengths))
    wound, buildup = MM * (winch["cable_length"] - lengths), diameter / (np.pi * winch["layer_turns"])
    for k in np.flatnonzero(wound < 0.0):
        allowed = f"at least {lengths[k]:.4g} m, the distance of cable {k + 1} from home"
        raise ConfigError(
            "robot", f"{robot_file.name}: winch.cable_length = {winch['cable_length'][k]:g}: must be {allowed}"
        )
    return np.sqrt((radius - 0.5 * diameter) ** 2 + buildup * wound), buildup


def _lost(robot_file: RobotFile, winch: dict[str, np.ndarray]) -> list[str]:
    lost = []
    if robot_file.pulley_radius is not None and np.any(np.asarray(robot_file.pulley_radius)):
        lost.append("pulleys: lines are taken to end where cables enter them")
    if robot_file.is_platform:
        lost.append("rotation: the platform is taken to keep the orientation in which its axes are those of the file")
    if robot_file.axial_stiffness is not None:
        lost.append("axial_stiffness: lines are taken not to stretch")
    if winch:
        reversed_motors = [str(k + 1) for k in np.flatnonzero(winch["direction"] < 0.0)]
        if reversed_motors:
            lost.append(
                f"direction: motors of cables {', '.join(reversed_motors)} wind at growing angles: turn them round"
            )
        lost.append("zero_length, friction, inertia and limits of motors")
    lost.append("limits of tensions: no move is checked")
    return lost


def hangprinter(anchors: Anchors) -> list[str]:
    """Lines of config.g for RepRapFirmware."""
    count = len(anchors.points)
    _check_count(anchors, "hangprinter", 3, len(LETTERS))
    coordinates = [f"{LETTERS[k]}{':'.join(map(_number, point))}" for k, point in enumerate(anchors.points)]
    radius = float(np.hypot(anchors.points[:, 0], anchors.points[:, 1]).max())
    lines = [f"M669 K6 N{count} {' '.join(coordinates)} P{_number(radius)}", "M666 A0"]
    notes = ["N, and more than five anchors from 3.7 on: older firmware has four; A0: it checks no reach"]
    if anchors.radii is not None:
        buildup = float(anchors.buildup.mean())
        radii, ones = ":".join(map(_number, anchors.radii)), ":".join("1" * count)
        lines += [f"M666 Q{buildup:.6f} R{radii}", f"M666 U{ones} O{ones}"]
        teeth = [_teeth(ratio) for ratio in anchors.winch["gear_ratio"].tolist()]
        lines.append(f"M666 L{':'.join(str(t[0]) for t in teeth)} H{':'.join(str(t[1]) for t in teeth)}")
        if np.ptp(anchors.buildup) > 1e-6:
            notes.append("Q is one number for all spools: this is the mean")
        if anchors.buildup.any():
            notes.append("layers are taken for a spiral, half a step off at most")
        notes.append("J, full steps for one turn of each motor: of your drives")
    return _written(";", anchors, lines, notes)


def klipper(anchors: Anchors) -> list[str]:
    """Sections of printer.cfg for Klipper."""
    _check_count(anchors, "klipper", 3, 26)
    notes = ["max_velocity, max_accel, pins and microsteps: of your machine"]
    lines = ["[printer]", "kinematics: winch"]
    for k, point in enumerate(anchors.points):
        lines += ["", f"[stepper_{chr(ord('a') + k)}]"]
        if anchors.radii is not None:
            turn = 2.0 * np.pi * anchors.radii[k] / anchors.winch["gear_ratio"][k]
            lines.append(f"rotation_distance: {turn:.6f}")
        lines += [f"anchor_{axis}: {_number(value)}" for axis, value in zip("xyz", point, strict=True)]
    if anchors.radii is None:
        notes.append("rotation_distance: of your drums, since the robot has no [winch]")
    if anchors.buildup.any():
        notes.append("layers: rotation_distance is that at home, where the radius is not constant")
    return _written("#", anchors, lines, notes)


# Lines of each firmware.
FIRMWARE: dict[str, Callable[[Anchors], list[str]]] = {"hangprinter": hangprinter, "klipper": klipper}


def _check_count(anchors: Anchors, firmware: str, low: int, high: int) -> None:
    count = len(anchors.points)
    if not low <= count <= high:
        raise ConfigError("robot", f"{anchors.name}: {count} cables: must be {low} to {high} for {firmware}")


def _written(prefix: str, anchors: Anchors, lines: list[str], notes: Sequence[str]) -> list[str]:
    head = f"{prefix} {anchors.name}: mm, z up, from the point at which it is homed"
    return [
        head,
        *lines,
        *(f"{prefix} {note}" for note in notes),
        *(f"{prefix} not held: {words}" for words in anchors.lost),
    ]


def _teeth(ratio: float) -> tuple[int, int]:
    # Teeth of motor and spool whose ratio is that of the gear.
    fraction = Fraction(ratio).limit_denominator(MOTOR_TEETH)
    if abs(float(fraction) - ratio) > 1e-9 * ratio or fraction.numerator > SPOOL_TEETH:
        allowed = f"a ratio of numbers of teeth, up to {SPOOL_TEETH} on the spool over {MOTOR_TEETH} on the motor"
        raise ConfigError("winch.gear_ratio", f"{ratio:g}: must be {allowed}")
    return fraction.denominator, fraction.numerator


def _number(value: Any) -> str:
    return f"{round(float(value), 3) + 0.0:.3f}"
