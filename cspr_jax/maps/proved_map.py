"""Base of maps of proved motions of any robot from given positions in one orientation."""

import functools
import operator
from typing import ClassVar

import numpy as np

from cspr_jax.build.orientations import given_quaternion
from cspr_jax.build.scenes import scene_of
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError
from cspr_jax.maps.from_positions import check_start
from cspr_jax.maps.grid_map import CHECK_ERROR, GridMap, exceeds
from cspr_jax.motion.answers import Answers
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.schema.tiles import Grid
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.criteria import FLAGS, pose_conditions

CONTACTS = functools.reduce(operator.or_, FLAGS.values())
# A cell shows a clearance only if its verdict has no flags but these.
_BESIDE = CONTACTS | Verdict.UNDECIDED | Verdict.UNCERTAINTY | Verdict.BELOW_FLOOR
_COLUMNS = {"tension_margin": "margin", "tension_margin_bound": "margin_bound"}


class ProvedMap(GridMap):
    """A map of proved motions from given positions to each target; see `GridMap`.

    Fields:
        from_rest: whether the start may be given as rest in P0.
    """

    proves = True
    any_cables = True
    from_rest: ClassVar[bool] = False

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Refuse robots that cannot follow a path, and starts without a position."""
        super().__init__(robot_file, spec, file)
        check_start(robot_file, spec, file, rests=self.from_rest)
        if robot_file.own_pattern == "1T" or PATTERNS[robot_file.own_pattern].is_jointed:
            allowed = "must be one that moves in space or in a plane in this map"
            raise ConfigError(file, f'robot "{robot_file.name}" is {robot_file.kind}: {allowed}')
        start, axes = spec.trajectory.start, [getattr(spec.axes, f"from_{name}") for name in "xyz"]
        if start is None and None in axes:
            allowed = "{ position = [x, y, z] }, or axes from_x, from_y, from_z"
            raise ConfigError(file, f"trajectory.from is missing: {allowed}")
        for key in ("tilt_torsion", "beta_hat", *(() if robot_file.is_platform else ("quaternion",))):
            if start is not None and getattr(start, key) is not None:
                absent = f'must be absent with family = "{spec.trajectory.family}"'
                raise ConfigError(file, f"trajectory.from.{key}: {absent}")
        self._unit = None
        if isinstance(self._problem.robot, PlatformRobot):
            quaternion = None if start is None else start.quaternion
            self._unit = given_quaternion(quaternion, "trajectory.from.quaternion", file)
        self._scene = scene_of(self._problem.robot, robot_file, self._frame, spec, file, trajectory=spec.trajectory)

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse targets that are all out of reach; see `GridMap.refuse_hopeless`."""
        if pose_conditions(self._problem.robot)[1]:
            super().refuse_hopeless(grid)

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        feasible, duration, margin = answers["verdict"] == 0, answers["duration"], answers["tension_margin"]
        return {
            "a feasible cell without a duration": feasible & ~(duration >= 0.0),
            "an infeasible cell with a duration": ~feasible & np.isfinite(duration),
            "a duration below its proved bound": feasible & exceeds(answers["lower_bound"], duration),
            "a feasible cell with a margin below zero": feasible & ~(margin > -self._missed * self._weight),
            "a margin below its proved bound": exceeds(answers["tension_margin_bound"], margin),
            "a feasible cell that touches an obstacle": feasible & (answers["clearance"] <= -CHECK_ERROR),
        }


def proved_columns(answers: Answers) -> dict[str, np.ndarray]:
    """Columns of a map of proved motions."""
    columns = {name: getattr(answers, name) for name in ("verdict", "tolerated", "not_tolerated")}
    columns |= {name: getattr(answers, source) for name, source in _COLUMNS.items()}
    clear = np.array([proof.smallest(proof.proof.high, CONTACTS) for proof in answers.proof])
    return columns | {"clearance": np.where(answers.verdict & ~np.uint32(_BESIDE.value), np.nan, clear)}


def joined_columns(parts: list[tuple[np.ndarray, dict[str, np.ndarray]]]) -> dict[str, np.ndarray]:
    """Columns of all cells, joined from columns of parts of them."""
    joined = {name: np.empty(len(parts[0][0]), column.dtype) for name, column in parts[0][1].items()}
    for rows, columns in parts:
        for name, column in columns.items():
            joined[name][rows] = column
    return joined
