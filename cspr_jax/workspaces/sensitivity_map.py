"""Maps of sensitivities to errors of the cable lengths."""

import numpy as np

from cspr_jax.build.robots import kernel_robot
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError
from cspr_jax.maps.grid_map import GridMap
from cspr_jax.schema.tiles import Grid
from cspr_jax.workspaces.poses.geometry import mass_centres
from cspr_jax.workspaces.sensitivities import SensitivitySearch

CHECK_ERROR = 1e-9


class SensitivityMap(GridMap):
    """The sensitivities of a robot at each position; see `GridMap`."""

    any_cables = True

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Refuse robots on more cables than degrees of freedom, whose cable lengths are not independent."""
        super().__init__(robot_file, spec, file)
        robot = kernel_robot(robot_file, spec.trajectory, file, any_cables=True)
        if robot.n_cables != robot.dof:
            source, key = robot_file.placed("base_points", file)
            raise ConfigError(source, f"{key}: {robot.n_cables} points: must be {robot.dof} in this map")
        self._search = SensitivitySearch(robot)

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        positions = self._targets(cells)
        if self._keys.point == "origin":
            positions = mass_centres(self._search.robot, positions, None)
        return self._search(positions)._asdict()

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse no grid: each position has an answer; see `GridMap.refuse_hopeless`."""

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        return {
            "a displacement smaller than the error of the cables": ~(answers["sigma_p"] >= 1.0 - CHECK_ERROR),
            "a negative turn": answers["sigma_r"] < 0.0,
        }
