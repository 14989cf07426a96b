"""Elastic cables from Python: stiffness, natural frequencies and modes of poses."""

from __future__ import annotations

import dataclasses
from typing import Literal, NamedTuple

import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.arguments.kernel_arguments import check_in_plane, check_rule, points_of
from cspr_jax.api.workspaces import check_kind, kernel_poses
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import Points, Quaternions, TensionsOfPoses
from cspr_jax.numerics.elementary import as_float64, double_precision
from cspr_jax.numerics.linear.frames import IDENTITY, Frame
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.elasticity.natural_frequencies import Modes, are_taut, modes_of, rest_poses, stiffnesses
from cspr_jax.robots.elasticity.springs import unstretched_lengths
from cspr_jax.robots.elasticity.stiffness import Stiffness
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.model.tension_rule_table import CENTRED
from cspr_jax.robots.statics.kernel_axes import centred, coordinate_signs

STATES = "tensions of a state of motion"


@dataclasses.dataclass(frozen=True)
class RobotStiffness:
    """Stiffness and mass matrices of a robot on elastic cables in n poses, in its axes; NaN where a cable is slack.

    Coordinates are displacements of the mass centre, m, then a rotation vector about it, or about the joint, rad: those
    that the robot's pattern of motion has, in the order of its wrenches.

    Fields:
        matrix: (n, dof, dof) stiffness matrix, elastic + geometric; N/m, N and N m.
        elastic: (n, dof, dof) part of the springs: sum of EA / l0 times the squared columns of the wrench matrix.
        geometric: (n, dof, dof) part of the tensions, and of the weight of a robot on a joint.
        mass: (n, dof, dof) mass matrix; kg, kg m and kg m^2.
        twists: (n, dof, 6) velocity and angular velocity for a unit rate of each coordinate.
        tensions: (n, n_cables) N.
        unstretched_lengths: (n, n_cables) lengths that drums set, with what is wrapped around pulleys, m.
    """

    matrix: np.ndarray
    elastic: np.ndarray
    geometric: np.ndarray
    mass: np.ndarray
    twists: np.ndarray
    tensions: np.ndarray
    unstretched_lengths: np.ndarray


@dataclasses.dataclass(frozen=True)
class NaturalFrequencies:
    """Natural frequencies and modes of a robot on elastic cables in n poses; NaN where a cable is slack.

    Fields:
        frequencies: (n, dof) rad/s, increasing; 0 where the equilibrium is not stable.
        squares: (n, dof) their squares, rad^2/s^2; negative where it is not stable.
        displacements: (n, dof, 3) displacement of the mass centre, or joint, in each mode, robot's axes; with
            `rotations` of modal mass 1, so that both are over the root of 1 kg.
        rotations: (n, dof, 3) rotation vector in each mode; 0 for a point mass.
        tensions: (n, n_cables) N.
    """

    frequencies: np.ndarray
    squares: np.ndarray
    displacements: np.ndarray
    rotations: np.ndarray
    tensions: np.ndarray


@checked(instead=STATES)
def stiffness(
    robot: PointMassRobot | PlatformRobot,
    positions: Points,
    quaternions: Quaternions | None = None,
    *,
    tensions: TensionsOfPoses = None,
    rule: str = CENTRED,
    point: Literal["mass-centre", "origin"] | None = None,
) -> RobotStiffness:
    """Stiffness and mass matrices of poses, with unstretched lengths that drums hold fixed.

    Args:
        robot: robot of any pattern with an `axial_stiffness`; pulleys are taken into account.
        positions: (n, 3) positions of `point`, or of the joint, in the robot's axes, m.
        quaternions: (n, 4) unit quaternions, scalar first, relative to the robot file; None: no rotation.
        tensions: (), (n_cables,) or (n, n_cables) tensions, N, positive; None: those that hold the robot at rest.
            Others are taken as they are: the matrix then is the symmetric part of the derivative of the wrench.
        rule: rule that chooses the tensions of redundant cables at rest, within the limits of the robot.
        point: point of a platform whose positions are given, "origin" of its axes or "mass-centre"; None: the origin.

    Returns:
        the matrices, by the second derivative of the potential energy.

    Raises:
        InputError: a robot without `axial_stiffness`, shapes that do not fit, numbers that are not finite, orientations
            of a point mass, or an unknown rule.
    """
    with double_precision():
        matrices = _matrices(robot, positions, quaternions, tensions, rule, point)
        signs = coordinate_signs(matrices.robot, matrices.frame)
        both = signs[:, None] * signs
        parts = {name: getattr(matrices.stiffness, name) * both[None] for name in ("elastic", "geometric", "mass")}
        slack = ~are_taut(matrices.tensions)
        for name in ("elastic", "geometric"):
            parts[name][slack] = np.nan
        stretched, forces = matrices.stiffness.lengths, as_float64(matrices.tensions)
        unstretched = np.asarray(unstretched_lengths(stretched, forces, matrices.robot.axial_stiffness))
    directions = signs[None, :, None] * matrices.twists * np.tile(matrices.frame.signs, 2)
    unstretched = np.where(slack[:, None], np.nan, unstretched)
    total = parts["elastic"] + parts["geometric"]
    return RobotStiffness(
        matrix=total, twists=directions, tensions=matrices.tensions, unstretched_lengths=unstretched, **parts
    )


@checked(instead=STATES)
def natural_frequencies(
    robot: PointMassRobot | PlatformRobot,
    positions: Points,
    quaternions: Quaternions | None = None,
    *,
    tensions: TensionsOfPoses = None,
    rule: str = CENTRED,
    point: Literal["mass-centre", "origin"] | None = None,
) -> NaturalFrequencies:
    """Natural frequencies and modes of poses on elastic cables, whose drums stand still.

    Args:
        robot: as for `stiffness`.
        positions: (n, 3) as for `stiffness`.
        quaternions: (n, 4) as for `stiffness`.
        tensions: as for `stiffness`.
        rule: as for `stiffness`.
        point: as for `stiffness`.

    Returns:
        frequencies and modes.

    Raises:
        InputError: as for `stiffness`.
    """
    with double_precision():
        matrices = _matrices(robot, positions, quaternions, tensions, rule, point)
        modes: Modes = modes_of(matrices.stiffness, are_taut(matrices.tensions))
    shapes = np.einsum("nmc,ncj->nmj", modes.shapes, matrices.twists) * np.tile(matrices.frame.signs, 2)
    return NaturalFrequencies(modes.frequencies, modes.squares, shapes[..., :3], shapes[..., 3:], matrices.tensions)


class _Matrices(NamedTuple):
    # Matrices in the kernels' axes.
    robot: AnyRobot
    frame: Frame
    stiffness: Stiffness
    twists: np.ndarray
    tensions: np.ndarray


def _matrices(robot, positions, quaternions, tensions, rule: str, point: str | None) -> _Matrices:
    check_kind(robot)
    if robot.axial_stiffness is None:
        raise InputError(
            "axial_stiffness", None, "must be given, in N: with_cables(robot, axial_stiffness=...)", problem="missing"
        )
    check_rule(robot, rule)
    points = points_of("positions", positions)
    check_in_plane("positions", points, is_planar=PATTERNS[robot.pattern].is_planar)
    inner, frame = centred(robot)
    centres, turns = kernel_poses(inner, frame, points, quaternions, point or "origin", "quaternions")
    turns = np.tile(IDENTITY, (len(points), 1)) if turns is None else turns
    states, at_rest = rest_poses(inner, centres, turns, robot.limits, rule)
    chosen = at_rest if tensions is None else _checked_tensions(tensions, at_rest.shape)
    return _Matrices(inner, frame, *stiffnesses(inner, states, chosen), chosen)


def _checked_tensions(tensions, shape: tuple[int, ...]) -> np.ndarray:
    values = np.asarray(tensions, float)
    if values.shape not in ((), shape[1:], shape):
        raise InputError("tensions", f"shape {values.shape}", f"numbers > 0 of shape (), {shape[1:]} or {shape}, N")
    return np.broadcast_to(values, shape).copy()
