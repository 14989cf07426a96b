"""Choice of the robot that a plan or sweep moves: the robot of its file, or a point mass equivalent to it."""

from collections.abc import Collection, Iterable

from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError

PLATFORM = "3R3T"


def as_moved(robot_file: RobotFile, patterns: Iterable[Collection[str]]) -> RobotFile:
    """The robot itself, or its equivalent point mass where trajectory families, or a map, need a point mass."""
    if not robot_file.is_platform:
        return robot_file
    if not robot_file.translation_only and all(PLATFORM in allowed for allowed in patterns):
        return robot_file
    try:
        return robot_file.equivalent()
    except InputError:  # the function that refuses the platform adds `no_equivalent`
        return robot_file


def no_equivalent(robot_file: RobotFile) -> str:
    """Reason why a platform has no equivalent point mass, to be appended to a message that refuses it."""
    try:
        if robot_file.is_platform:
            robot_file.parallel_pairs()
    except InputError as error:
        return f"; nor do three parallel pairs of cables keep it from turning: {error.problem}"
    return ""
