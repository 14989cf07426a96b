"""Maps of feasible accelerations: static, wrench-feasible and wrench-closure workspaces of point masses."""

import numpy as np

from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError
from cspr_jax.maps.grid_map import PointMassMap
from cspr_jax.numerics.tolerances import BOUNDARY
from cspr_jax.schema.tiles import Grid
from cspr_jax.schema.verdicts import FLAGS
from cspr_jax.workspaces.acceleration_search import reach_of

MAX_CABLES = 20


class FeasibleAccelerationMap(PointMassMap):
    """The accelerations that are feasible at each position; see `GridMap`."""

    any_cables = True

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Refuse robots on so many cables that the corners of their faces need too much memory."""
        super().__init__(robot_file, spec, file)
        if self._problem.robot.n_cables > MAX_CABLES:
            source, key = robot_file.placed("base_points", file)
            raise ConfigError(source, f"{key}: must be at most {MAX_CABLES} in this map")

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        answers = reach_of(self._problem.robot, self._problem.limits, self._targets(cells))._asdict()
        return answers | {"verdict": answers["verdict"].astype(FLAGS)}

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse no grid: each position has an answer; see `GridMap.refuse_hopeless`."""

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        feasible, margin = answers["verdict"] == 0, answers["acceleration_margin"]
        tolerance, mass = (
            float(np.asarray(x)) for x in (BOUNDARY * self._problem.robot.gravity, self._problem.robot.mass)
        )
        level, maximum = answers["level_acceleration"], answers["level_acceleration_max"]
        return {
            "a feasible cell with a margin below zero": feasible & ~(margin > -self._missed * self._weight / mass),
            "an infeasible cell with a margin above zero": ~feasible
            & (margin > tolerance)
            & (answers["verdict"] != 2048),
            "a margin that limits of the tensions make larger": margin > answers["static_margin"] + tolerance,
            "a level acceleration above the largest": level > maximum * (1.0 + BOUNDARY) + tolerance,
            "a number that is none": sum(np.isnan(values) for values in answers.values()) > 0,
        }
