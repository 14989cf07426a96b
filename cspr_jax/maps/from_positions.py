"""Base of maps of motions that start at rest in a given position, which need not be P0."""

from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError
from cspr_jax.maps.grid_map import PointMassMap


def check_start(robot_file: RobotFile, spec: SweepFile, file: object, *, rests: bool = False) -> None:
    """Refuse a start that the robot cannot have."""
    start = spec.trajectory.start
    if robot_file.is_planar and start is not None and start.position is not None and start.position[1] != 0.0:
        raise ConfigError(file, "trajectory.from.position: must have y = 0: a planar robot")
    if start is not None and start.rest and not rests:
        raise ConfigError(file, "trajectory.from: must be { position = [x, y, z] } in this map, or axes from_x, ...")


class FromPositionsMap(PointMassMap):
    """The map of motions of a point mass from given positions; see `GridMap`."""

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Refuse starts without a position."""
        super().__init__(robot_file, spec, file)
        check_start(robot_file, spec, file)
