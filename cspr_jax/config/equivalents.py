"""Choice of the robot that a plan or sweep moves: that of its file, what is left of it, or an equivalent point mass."""

from collections.abc import Collection, Iterable, Sequence

from cspr_jax.config.missing_cables import without_cables
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, InputError

PLATFORM = "3R3T"


def as_moved(
    robot_file: RobotFile,
    patterns: Iterable[Collection[str]],
    without: Sequence[int] | str | None = None,
    file: object = "robot",
) -> RobotFile:
    """The robot without the missing cables, or its equivalent where trajectory families, or a map, need a point mass.

    `without` and `file` are those of `missing_cables.without_cables`.
    """
    robot_file = without_cables(robot_file, without, file)
    if not robot_file.is_platform:
        return robot_file
    if not robot_file.translation_only and all(PLATFORM in allowed for allowed in patterns):
        return robot_file
    try:
        return robot_file.equivalent()
    except InputError as error:
        if robot_file.translation_only:
            source, key = robot_file.placed("translation_only", file)
            raise ConfigError(source, f"{key} = true: must be absent: {error.problem}") from error
        return robot_file  # the function that refuses the platform adds `no_equivalent`


def no_equivalent(robot_file: RobotFile) -> str:
    """Reason why a platform has no equivalent point mass, to be appended to a message that refuses it."""
    try:
        if robot_file.is_platform:
            robot_file.parallel_pairs()
    except InputError as error:
        return f"; nor do three parallel pairs of cables keep it from turning: {error.problem}"
    return ""
