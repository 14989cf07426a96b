"""Limits for the kernels, built from checked files."""

from cspr_jax.config.keys.limits import LimitKeys
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.motion.given_limits import limits_of, pair_limits
from cspr_jax.robots.model.limits import Limits


def build_limits(robot_file: RobotFile, keys: LimitKeys, file: object) -> Limits:
    """Limits of the file, with those of the robot where it gives none."""
    pairs = robot_file.pairs
    try:
        limits = limits_of(robot_file, vars(keys), vars(robot_file), "", len(robot_file.as_written.base_points))
        return limits if pairs is None else pair_limits(limits, pairs)
    except InputError as error:
        raise ConfigError(file, str(error)) from error
