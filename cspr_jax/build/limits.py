"""Limits for the kernels, built from checked files, and shared out among pairs of cables."""

import dataclasses
from typing import Any

import numpy as np

from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.config.limits import LimitKeys
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.motions.given_limits import check_bounded, check_certain, limits_of
from cspr_jax.robots.limits import NO_LIMITS, Limits
from cspr_jax.robots.parallel_pairs import ParallelPairs
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.schema.limits import LIMITS


def build_limits(robot_file: RobotFile, keys: LimitKeys, file: object) -> Limits:
    """Limits of the file over those of the robot.

    Args:
        robot_file: the robot.
        keys: of the plan or sweep.
        file: named in errors.

    Returns:
        the limits.

    Raises:
        ConfigError: a smallest tension that is not below the largest, or a list of another length.
    """
    pairs = robot_file.pairs
    try:
        limits = limits_of(robot_file, vars(keys), vars(robot_file), "", len(robot_file.as_written.base_points))
        return limits if pairs is None else pair_limits(limits, pairs)
    except InputError as error:
        raise ConfigError(file, str(error)) from error


def pair_limits(limits: Limits, pairs: ParallelPairs) -> Limits:
    """Limits of the three cables that stand for pairs of six.

    Args:
        limits: of the six cables; the floor is that of the effector.
        pairs: the pairs.

    Returns:
        the limits, (3,) each.

    Raises:
        InputError: of some pair no tension is within the limits of both cables.
    """
    values: dict[str, Any] = {
        row.name: leaf(pairs.bound(value, is_tension=row.quantity == "tension", is_least=row.sense == "least"))
        for row in LIMITS
        if row.per_cable and (value := getattr(limits, row.name)) is not None
    }
    low, high = values.get("tension_min"), values.get("tension_max")
    if low is not None and high is not None and not (low < high).all():
        pair = int(np.argmin(high - low))
        allowed = "must be below tension_max, each over the cable's share of it"
        first, second = (pairs.cables[pair] + 1).tolist()
        raise InputError(
            "tension_min", None, allowed, fault=f"{low[pair]:.6g} N of the pair of cables {first} and {second}"
        )
    return dataclasses.replace(limits, **values)


def limits_over(
    robot: PointMassRobot | PlatformRobot,
    limits: Limits | None,
    *,
    any_tensions: bool = False,
    families: tuple[str, ...] = (),
) -> Limits:
    """Limits that are given over those of a robot, as the kernels take them.

    Args:
        robot: in its own axes.
        limits: one number or one a cable each, in the robot's axes; None: those of the robot.
        any_tensions: whether some of the largest tensions may be infinite.
        families: of the trajectories that are judged by all of an uncertainty; none: there may be none.

    Returns:
        the limits.

    Raises:
        InputError: numbers of another count, or no limits at all: not finite, a length or speed that is not positive,
            a smallest tension that is not below the largest.
    """
    merged = limits_of(robot, vars(limits or NO_LIMITS), vars(robot.limits), "limits.")
    if not any_tensions:
        check_bounded(merged)
    check_certain(robot, merged, families)
    return merged
