"""Which robot a plan or a sweep moves: that of its file, or the point mass on three cables that it is."""

from collections.abc import Collection, Iterable

from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError

PLATFORM = "3R3T"


def as_moved(spec: RobotFile, patterns: Iterable[Collection[str]]) -> RobotFile:
    """The robot as trajectory families, or a kind of map, move it.

    Args:
        spec: the robot of a file.
        patterns: for each of them, patterns of motion of the robots that it moves.

    Returns:
        a platform's equivalent, if it says that it only translates, or if some of them move no platforms and it has
        one; else the robot itself.
    """
    if not spec.is_platform:
        return spec
    if not spec.translation_only and all(PLATFORM in some for some in patterns):
        return spec
    try:
        return spec.equivalent()
    except InputError:  # who refuses the platform adds `no_equivalent`
        return spec


def no_equivalent(spec: RobotFile) -> str:
    """Why a platform is not moved as a point mass, to go on with in a line that refuses it.

    Args:
        spec: the robot.

    Returns:
        the reason; empty of other robots.
    """
    try:
        if spec.is_platform:
            spec.parallel_pairs()
    except InputError as error:
        return f"; nor do three parallel pairs of cables keep it from turning: {error.fault}"
    return ""
