"""Problem that all motions of a plan or map share: robot, limits, amplitude function."""

import dataclasses
from typing import Generic, NamedTuple, TypeVar

from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.limits import necessary_limits, search_limits, touchable_limits
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot

RobotKind = TypeVar("RobotKind", PointMassRobot, PlatformRobot)


class Problem(NamedTuple, Generic[RobotKind]):
    """Robot, limits and amplitude function of a plan or map, as the kernels take them.

    Fields:
        robot: centred, z down; a platform in its reference axes.
        limits: limits beyond taut cables.
        amplitude: amplitude function A.
    """

    robot: RobotKind
    limits: Limits
    amplitude: Amplitude


def touchable(problem: Problem[RobotKind]) -> Problem[RobotKind]:
    """The problem with limits widened for proofs; see `limits.touchable_limits`."""
    return problem._replace(limits=touchable_limits(problem.robot, problem.limits))


def search_problem(problem: Problem[RobotKind]) -> Problem[RobotKind]:
    """The problem for searches, without winches; see `limits.search_limits`."""
    return _without_winches(problem)._replace(limits=search_limits(problem.robot, problem.limits))


def bounding_problem(problem: Problem[RobotKind]) -> Problem[RobotKind]:
    """The problem for lower bounds, without winches; see `limits.necessary_limits`."""
    return _without_winches(problem)._replace(limits=necessary_limits(problem.robot, problem.limits))


def _without_winches(problem: Problem[RobotKind]) -> Problem[RobotKind]:
    if problem.robot.winches is None:
        return problem
    return problem._replace(robot=dataclasses.replace(problem.robot, winches=None))
