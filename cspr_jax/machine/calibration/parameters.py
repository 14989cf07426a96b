"""Which numbers of a setup are unknown, all in metres of cable.

Every parameter moves numbers of single cables linearly: coordinates of the spool and of the attachment point, the
offset, the radii of drum and pulley. A matrix per cable says how; it holds the plane of a planar robot, the line of a
rod and the level of two spools.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import one_of
from cspr_jax.machine.calibration.setups import Setup, small_rotations
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.rotations import products
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line

# Numbers of a cable: its spool, its attachment point, its offset, the radii of its drum and of its pulley.
SPOOL, ATTACHMENT, OFFSET, DRUM, PULLEY, LOCAL = slice(0, 3), slice(3, 6), 6, 7, 8, 9
# Numbers of the tracker: its shift, its turn, and the point that it follows.
SHIFT, TURN, TARGET, TRACKER = slice(0, 3), slice(3, 6), slice(6, 9), 9
GROUPS = ("spools", "attachments", "offsets", "drums", "pulleys", "tracker", "target")
SINGULAR_NAMES = {"spools": "spool", "attachments": "attachment", "offsets": "offset", "drums": "drum radius"}
SINGULAR_NAMES |= {"pulleys": "pulley radius", "tracker": "tracker", "target": "target"}


class Parameter(NamedTuple):
    """An unknown number.

    Fields:
        group: one of `GROUPS`.
        cable: index of the cable; None: of none, or of all.
        axis: "x", "y" or "z", "along" the line of a rod, or "".
        sign: factor from the kernels' axes to those of the file.
        unit: of its value in reports.
        per_metre: its change over one metre of the parameter.
    """

    group: str
    cable: int | None
    axis: str
    sign: float = 1.0
    unit: str = "m"
    per_metre: float = 1.0

    @property
    def name(self) -> str:
        """Name, with cables counted from 1."""
        cable = "" if self.cable is None else f" {self.cable + 1}"
        return f"{SINGULAR_NAMES[self.group]}{cable} {self.axis}".rstrip()


@dataclasses.dataclass(frozen=True)
class Parameters:
    """The unknown numbers of a setup.

    Fields:
        rows: the parameters.
        of_cables: (n_cables, 9, p) changes of the numbers of cables over the parameters.
        of_tracker: (9, p) changes of the tracker's numbers.
    """

    rows: tuple[Parameter, ...]
    of_cables: np.ndarray
    of_tracker: np.ndarray

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(self.rows)

    @property
    def units(self) -> Float[np.ndarray, "p"]:
        """Changes of reported numbers, in the axes of the file, over the parameters."""
        return np.array([row.sign * row.per_metre for row in self.rows])

    @property
    def is_of_machine(self) -> np.ndarray:
        """Tell which parameters belong to the robot, (p,)."""
        return np.array([row.group not in ("tracker", "target") for row in self.rows])

    def moved(self, setup: Setup, step: Float[np.ndarray, "p"]) -> Setup:
        """A setup after a step."""
        each, tracker, robot = self.of_cables @ step, self.of_tracker @ step, setup.robot
        changes: dict[str, Any] = {"base_points": as_float64(robot.base_points + each[:, SPOOL])}
        if isinstance(robot, PlatformRobot):
            changes["platform_points"] = as_float64(robot.platform_points + each[:, ATTACHMENT])
        if robot.winches is not None:
            radius = as_float64(robot.winches.drum_radius + each[:, DRUM])
            changes["winches"] = dataclasses.replace(robot.winches, drum_radius=radius)
        if robot.pulleys is not None:
            radius = as_float64(robot.pulleys.radius + each[:, PULLEY])
            changes["pulleys"] = dataclasses.replace(robot.pulleys, radius=radius)
        orientation = products(small_rotations(tracker[None, TURN]), np.asarray(setup.orientation)[None])[0]
        return setup._replace(
            robot=dataclasses.replace(robot, **changes),
            offsets=setup.offsets + each[:, OFFSET],
            orientation=orientation,
            shift=setup.shift + tracker[SHIFT],
            target=setup.target + tracker[TARGET],
        )


def with_common(setup: Setup, common: jax.Array) -> Setup:
    """A setup with the same numbers added to those of all cables, for derivatives."""
    robot = setup.robot
    changes: dict[str, Any] = {"base_points": robot.base_points + common[None, SPOOL]}
    if isinstance(robot, PlatformRobot):
        changes["platform_points"] = robot.platform_points + common[None, ATTACHMENT]
    if robot.winches is not None:
        changes["winches"] = dataclasses.replace(robot.winches, drum_radius=robot.winches.drum_radius + common[DRUM])
    if robot.pulleys is not None:
        changes["pulleys"] = dataclasses.replace(robot.pulleys, radius=robot.pulleys.radius + common[PULLEY])
    return setup._replace(robot=dataclasses.replace(robot, **changes), offsets=setup.offsets + common[OFFSET])


def checked_groups(robot: AnyRobot, free: Sequence[str], *, are_angles: bool, has_positions: bool) -> tuple[str, ...]:
    """Groups of parameters to estimate, in order; refuses those that the robot or the measurements do not have."""
    reasons = {
        "attachments": "" if isinstance(robot, PlatformRobot) else "absent: a point mass has none",
        "target": "" if isinstance(robot, PlatformRobot) else "absent: a point mass has none",
        "drums": "" if are_angles else "absent where lengths are measured: drums need angles of motors",
        "pulleys": "" if robot.pulleys is not None else "absent: the robot has no pulleys",
    }
    row = PATTERNS[robot.pattern]
    if row.is_jointed or row.dof == 1:
        # Such positions lie in one point or on one line, and say where the joint or the guide is.
        reasons["tracker"] = (
            f"absent for a robot on a {'joint' if row.is_jointed else 'guide'}: positions say where it is"
        )
        reasons["target"] = reasons.get("target") or reasons["tracker"]
    for name in ("tracker", "target"):
        reasons[name] = reasons.get(name) or ("" if has_positions else "absent where no positions are measured")
    for name in free:
        if name not in GROUPS:
            raise InputError("free", name, one_of(name, GROUPS))
        if reasons.get(name):
            raise InputError("free", name, reasons[name])
    if not any(name not in ("tracker", "target") for name in free):
        raise InputError("free", list(free), f"at least one of {', '.join(GROUPS[:5])}")
    return tuple(name for name in GROUPS if name in free)


def parameters_of(setup: Setup, groups: Sequence[str], signs: Float[np.ndarray, "3"], length: float) -> Parameters:
    """The parameters of groups; `length` is what a drum pays out at the measured poses, on average."""
    robot, parts = setup.robot, list[tuple[Parameter, np.ndarray, np.ndarray]]()
    for group in groups:
        if group in ("tracker", "target"):
            parts += _of_tracker(robot, group, signs, length)
        else:
            parts += _of_cables(robot, group, signs, length)
    rows, cables, tracker = zip(*parts, strict=True)
    return Parameters(rows, np.stack(cables, axis=2), np.stack(tracker, axis=1))


def _of_cables(robot: AnyRobot, group: str, signs: np.ndarray, length: float) -> list:
    parts = []
    for i in range(robot.n_cables):
        if group in ("spools", "attachments"):
            start = SPOOL.start if group == "spools" else ATTACHMENT.start
            parts += [(row, i, start, vector) for row, vector in _of_point(robot, group, i, signs)]
        elif group == "offsets":
            parts.append((Parameter(group, i, ""), i, OFFSET, np.ones(1)))
        elif group == "drums" and robot.winches is not None:
            per_metre = float(robot.winches.drum_radius[i]) / length
            parts.append((Parameter(group, i, "", per_metre=per_metre), i, DRUM, np.array([per_metre])))
        elif group == "pulleys" and robot.pulleys is not None and robot.pulleys.radius[i] > 0.0:
            parts.append((Parameter(group, i, ""), i, PULLEY, np.ones(1)))
    columns = []
    for row, i, start, vector in parts:
        column = np.zeros((robot.n_cables, LOCAL))
        # A number that belongs to no single cable is the same for all.
        column[slice(None) if row.cable is None else i, start : start + len(vector)] = vector
        columns.append((row, column, np.zeros(TRACKER)))
    return columns


def _of_point(robot: AnyRobot, group: str, i: int, signs: np.ndarray) -> list[tuple[Parameter, np.ndarray]]:
    # Coordinates of a spool or an attachment point that the kind of robot leaves free.
    row = PATTERNS[robot.pattern]
    if group == "attachments" and row.along_line and isinstance(robot, PlatformRobot):
        line = np.cross(*np.asarray(across_line(robot)).T)
        point = np.asarray(robot.platform_points)[i]
        return [(Parameter(group, i, "along"), line if line @ point >= 0.0 else -line)]
    axes = (0, 2) if row.is_planar else (0, 1, 2)
    rows = [(Parameter(group, i, "xyz"[axis], float(signs[axis])), np.eye(3)[axis]) for axis in axes]
    if robot.pattern == "2T" and robot.n_cables == robot.dof and group == "spools":
        # Two spools of a planar robot are level: their height is one number.
        level = (rows[1][0]._replace(cable=None), rows[1][1])
        return [rows[0]] if i else [rows[0], level]
    return rows


def _of_tracker(robot: AnyRobot, group: str, signs: np.ndarray, length: float) -> list:
    row, parts = PATTERNS[robot.pattern], []
    axes: Sequence[int] = (0, 2) if row.is_planar else (0, 1, 2)
    turns: Sequence[int] = (1,) if row.is_planar else (0, 1, 2)
    if group == "target":
        parts = [(Parameter(group, None, "xyz"[k], float(signs[k])), TARGET.start + k, 1.0) for k in axes]
    else:
        parts = [(Parameter(group, None, f"shift {'xyz'[k]}", float(signs[k])), SHIFT.start + k, 1.0) for k in axes]
        for k in turns:
            parameter = Parameter(group, None, f"turn {'xyz'[k]}", float(signs[k]), "rad", 1.0 / length)
            parts.append((parameter, TURN.start + k, 1.0 / length))
    columns = []
    for parameter, index, value in parts:
        column = np.zeros(TRACKER)
        column[index] = value
        columns.append((parameter, np.zeros((robot.n_cables, LOCAL)), column))
    return columns
