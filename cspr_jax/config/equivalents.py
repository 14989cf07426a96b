"""Choice of the robot that a plan or a sweep moves: that of its file, or an equivalent point mass on three cables."""

from collections.abc import Collection, Iterable

from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError

PLATFORM = "3R3T"


def as_moved(robot_file: RobotFile, patterns: Iterable[Collection[str]]) -> RobotFile:
    """The robot as trajectory families, or a kind of map, move it."""
    if not robot_file.is_platform:
        return robot_file
    if not robot_file.translation_only and all(PLATFORM in allowed for allowed in patterns):
        return robot_file
    try:
        return robot_file.equivalent()
    except InputError:  # the function that refuses the platform adds `no_equivalent`
        return robot_file


def no_equivalent(robot_file: RobotFile) -> str:
    """Reason why a platform is not moved as a point mass, to be appended to a line that refuses it."""
    try:
        if robot_file.is_platform:
            robot_file.parallel_pairs()
    except InputError as error:
        return f"; nor do three parallel pairs of cables keep it from turning: {error.problem}"
    return ""
