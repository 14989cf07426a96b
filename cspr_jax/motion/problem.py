"""Problem that all motions of a question share: robot, limits, amplitude function."""

from typing import Generic, NamedTuple, TypeVar

from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot

RobotKind = TypeVar("RobotKind", PointMassRobot, PlatformRobot)


class Problem(NamedTuple, Generic[RobotKind]):
    """Robot, limits and amplitude function of a question, as the kernels take them.

    Fields:
        robot: centred, z down; a platform in its reference axes.
        limits: limits beyond taut cables.
        amplitude: A.
    """

    robot: RobotKind
    limits: Limits
    amplitude: Amplitude
