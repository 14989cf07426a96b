"""Sensitivity to errors of the cable lengths from Python."""

import dataclasses
import math

import numpy as np

from cspr_jax.api.argument_checks import checked
from cspr_jax.api.arguments import points_of, quaternions
from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.errors import InputError
from cspr_jax.robots.kernel_axes import centred
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import PLANAR, PointMassRobot
from cspr_jax.workspaces.sensitivities import SensitivitySearch


@dataclasses.dataclass(frozen=True)
class Sensitivity:
    """Sensitivities of a robot to errors of its cable lengths at n places, Machines 11 (2), 2023, 224, (7).

    Fields:
        positions: (n, 3) of the mass centre, in the robot's axes, m.
        sigma_p: (n,) largest displacement over the largest error of a cable length, m/m; infinite at a singular place.
        sigma_r: (n,) largest turn of a platform over that error, rad/m, all six errors independent; NaN for a point
            mass.
    """

    positions: np.ndarray
    sigma_p: np.ndarray
    sigma_r: np.ndarray

    @checked
    def errors(self, cable_error) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the errors of the pose, to first order.

        Args:
            cable_error: () or (n,) largest error of the length of a cable, m.

        Returns:
            (n,) displacement, m, and (n,) turn, rad.

        Raises:
            InputError: another shape, not finite, or negative.
        """
        error = np.asarray(cable_error, float)
        if error.shape not in ((), self.sigma_p.shape):
            raise InputError("cable_error", cable_error, f"a number >= 0, in m, or {len(self.sigma_p)} of them")
        return self.sigma_p * error, self.sigma_r * error


@checked
def sensitivity(robot: PointMassRobot | PlatformRobot, positions, orientations=None) -> Sensitivity:
    """Sensitivities of a robot to errors of its cable lengths.

    Args:
        robot: a point mass on three cables, or two in a plane, or a platform on six.
        positions: (n, 3) of the mass centre, in the robot's axes, m.
        orientations: (n, 4) unit quaternions of a platform in these axes, scalar first, from the reference orientation,
            or from that of its file if its cables are parallel in three pairs there; None: that.

    Returns:
        the sensitivities.

    Raises:
        InputError: more cables than degrees of freedom, pulleys, or another pattern of motion; shapes that do not fit,
            values that are not finite, quaternions that are not of unit length, or orientations of a point mass.
    """
    if not isinstance(robot, PointMassRobot | PlatformRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a point mass or a platform")
    places = points_of("positions", positions)
    if robot.dof == PLANAR and places[:, 1].any():
        raise InputError("positions", "y not 0", "y = 0: the plane of a planar robot")
    if orientations is not None and isinstance(robot, PointMassRobot):
        raise InputError("orientations", None, "must be None", fault="a point mass has none")
    with double_precision():
        centred_robot, frame = centred(robot)
        turns = None
        if orientations is not None:
            turns = frame.turned_quaternions(quaternions("orientations", orientations, len(places)))
        answers = SensitivitySearch(centred_robot)(frame.inward(places), turns)
    return Sensitivity(places, np.asarray(answers.sigma_p), np.asarray(answers.sigma_r))


@checked
def encoder_error(drum_radius: float, pulses: float) -> float:
    """Error of a cable's length from the resolution of its winch's encoder, 2 pi r / pulses.

    Args:
        drum_radius: of the drum or pulley that the cable is wound on, m.
        pulses: of the encoder, a turn of the drum.

    Returns:
        m.

    Raises:
        InputError: a number that is not positive.
    """
    return 2.0 * math.pi * drum_radius / pulses
