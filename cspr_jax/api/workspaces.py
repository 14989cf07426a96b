"""Poses at rest from Python: which ones a robot can hold, how exactly, and with which accelerations."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Literal

import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.arguments.kernel_arguments import check_in_plane, check_point_mass, points_of, quaternions
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import (
    Acceleration,
    CableErrors,
    Length,
    Points,
    Positive,
    Quaternions,
    Tensions,
    VectorOrVectors,
    Wrenches,
    WrenchExtents,
)
from cspr_jax.errors.given_numbers import numbers
from cspr_jax.errors.suggestions import one_of
from cspr_jax.motion.given_limits import limits_over, static_limits
from cspr_jax.motion.limits import touchable_limits
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PLANAR, PointMassRobot
from cspr_jax.robots.statics.kernel_axes import centred, prepared
from cspr_jax.robots.statics.wrench_sets import Faces, spanning
from cspr_jax.schema.verdicts import FLAGS
from cspr_jax.workspaces.acceleration_search import faces_of, margins_and_verdicts
from cspr_jax.workspaces.poses.geometry import mass_centres
from cspr_jax.workspaces.requirements import CONDITIONS, FEASIBLE, check_cables, required_wrenches, requirement
from cspr_jax.workspaces.search import WorkspaceAnswers, WorkspaceSearch
from cspr_jax.workspaces.sensitivities import SensitivitySearch

PRECISIONS = ("float64", "float32")
TENSIONS = "tensions of a state of motion"


@checked(instead=TENSIONS)
def workspace(  # noqa: PLR0913
    robot: PointMassRobot | PlatformRobot,
    positions: Points,
    orientations: Quaternions | None = None,
    *,
    condition: str = FEASIBLE,
    tension_min: Tensions = None,
    tension_max: Tensions = None,
    wrenches: Wrenches | None = None,
    wrench_box: WrenchExtents | None = None,
    wrench_ellipsoid: WrenchExtents | None = None,
    acceleration: Acceleration | None = None,
    capacity_length: Length | None = None,
    precision: str = "float64",
    point: Literal["mass-centre", "origin"] | None = None,
) -> WorkspaceAnswers:
    """Tell whether each of n poses is in the workspace of a robot, of any pattern on any number of cables.

    Args:
        robot: point mass or body on at least as many cables as degrees of freedom; pulleys are taken into account.
        positions: (n, 3) positions of `point`, or of the joint, in the robot's axes, m; n >= 1.
        orientations: (n, 4) unit quaternions, scalar first, relative to the robot file; None: no rotation.
        condition: "static": taut cables with any tensions hold the weight; "wrench-feasible": tensions within limits
            supply all given wrenches; "wrench-closure": with large enough tensions cables resist every wrench.
        tension_min: for "wrench-feasible": smallest tension, () or (n_cables,) N; None: the robot's, else 0.
        tension_max: for "wrench-feasible": largest tension, () or (n_cables,) N, also inf; None: the robot's, or none.
        wrenches: for "wrench-feasible": (k, dof) wrenches that cables must supply: forces, N, then moments about the
            mass centre or the joint, N m, in the robot's axes; None: the wrench that holds the weight.
        wrench_box: (dof,) half widths of a box of wrenches about each of `wrenches`, N and N m.
        wrench_ellipsoid: (dof,) semi-axes of an ellipsoid of wrenches about each of `wrenches`, N and N m.
        acceleration: radius of a ball of accelerations of the mass centre that the cables must also supply, m/s^2.
        capacity_length: for "wrench-feasible": length by which moments are divided, m (any for a point mass). Margins
            are then capacity margins: distances of the wrenches from the faces of the set that the cables can supply, N
            (Guay et al. 2014; Ruiz et al. 2015).
        precision: "float64", or "float32", which decides the poses that it can and leaves the others to float64. So
            verdicts are the same; margins of poses decided in float32 are accurate to some 1e-3 of the limits.
        point: point of a platform whose positions are given: "origin" of its axes, or "mass-centre"; None: the origin.

    Returns:
        verdicts, 0 inside, and margins.

    Raises:
        InputError: the wrong kind of robot, too many cables, an unknown condition, shapes that do not fit, values that
            are not finite, quaternions that are not of unit length, orientations of a point mass, moments of a rod,
            accelerations of a robot on a joint, limits or wrenches for a condition without them, or contradictory
            limits.
    """
    check_kind(robot)
    check_cables(robot)
    if condition not in CONDITIONS:
        raise InputError("condition", condition, one_of(condition, CONDITIONS))
    if precision not in PRECISIONS:
        raise InputError("precision", precision, one_of(precision, PRECISIONS))
    requirements = {"wrench_box": wrench_box, "wrench_ellipsoid": wrench_ellipsoid, "acceleration": acceleration}
    requirements |= {"tension_min": tension_min, "tension_max": tension_max, "wrenches": wrenches}
    for key, value in (*requirements.items(), ("capacity_length", capacity_length)):
        if value is not None and condition != FEASIBLE:
            raise InputError(key, value, f'None with condition "{condition}"')
    points = points_of("positions", positions)
    check_in_plane("positions", points, is_planar=PATTERNS[robot.pattern].is_planar)
    with double_precision():
        centred_robot, frame = centred(robot)
        limits = _limits(robot, tension_min, tension_max, accelerates=bool(acceleration))
        loads = required_wrenches(
            centred_robot, frame, points=wrenches, box=wrench_box, ellipsoid=wrench_ellipsoid, acceleration=acceleration
        )
        inner, turns = kernel_poses(centred_robot, frame, points, orientations, point or "origin")
        posed = requirement(centred_robot, condition, limits, loads, capacity_length)
        return WorkspaceSearch(centred_robot, posed, precision=precision)(inner, turns)


def check_kind(robot) -> None:
    """Refuse what is no robot of this package."""
    if not isinstance(robot, PointMassRobot | PlatformRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a point mass or a platform")


def _limits(robot, tension_min, tension_max, *, accelerates: bool) -> Limits:
    if tension_max is not None and np.ndim(tension_max) == 0:  # inf must be given for each cable
        allowed = f"a number > 0, or {robot.n_cables}: one a cable"
        tension_max = np.full(robot.n_cables, numbers("tension_max", tension_max, allowed))
    bounds = Limits(tension_min=tension_min, tension_max=tension_max)
    return static_limits(robot, limits_over(robot, bounds, any_tensions=True, motors=True), accelerates=accelerates)


def kernel_poses(
    robot, frame: Frame, positions: np.ndarray, orientations, point: str, key: str = "orientations"
) -> tuple[np.ndarray, np.ndarray | None]:
    """Positions of the mass centre, (n, 3), and quaternions, (n, 4), in the kernels' axes."""
    row = PATTERNS[robot.pattern]
    inner, turns = np.asarray(frame.inward(positions)), None
    if orientations is not None:
        if not row.is_body:
            raise InputError(key, None, "must be None", problem="a point mass has none")
        unit_quaternions = quaternions(key, orientations, len(positions))
        if row.is_planar and unit_quaternions[:, [1, 3]].any():
            raise InputError(key, "not about y", "turns about y: those of a planar robot")
        turns = frame.rotated_quaternions(unit_quaternions)
    return (mass_centres(robot, inner, turns) if point == "origin" else inner), turns


@dataclasses.dataclass(frozen=True)
class Sensitivity:
    """Sensitivities of a robot to errors of its cable lengths at n positions, Machines 11 (2), 2023, 224, (7).

    Fields:
        positions: (n, 3) positions as given, in the robot's axes, m.
        sigma_p: (n,) largest displacement over the largest error of a cable length, m/m; inf at singular poses.
        sigma_r: (n,) largest rotation of a platform over the largest error, rad/m, for six independent errors; NaN for
            a point mass.
    """

    positions: np.ndarray
    sigma_p: np.ndarray
    sigma_r: np.ndarray

    @checked()
    def errors(self, cable_error: CableErrors) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the errors of the pose to first order.

        Args:
            cable_error: () or (n,) largest error of the length of a cable, m.

        Returns:
            (n,) displacement, m, and (n,) rotation, rad.

        Raises:
            InputError: the wrong shape, not finite, or negative.
        """
        error = np.asarray(cable_error, float)
        if error.shape not in ((), self.sigma_p.shape):
            raise InputError("cable_error", cable_error, f"a number >= 0, in m, or {len(self.sigma_p)} of them")
        return self.sigma_p * error, self.sigma_r * error


@checked(instead=TENSIONS)
def sensitivity(
    robot: PointMassRobot | PlatformRobot,
    positions: Points,
    orientations: Quaternions | None = None,
    *,
    point: Literal["mass-centre", "origin"] | None = None,
) -> Sensitivity:
    """Sensitivities of a robot to errors of its cable lengths.

    Args:
        robot: point mass on three cables, or on two in a plane, or platform on six.
        positions: (n, 3) positions of `point`, in the robot's axes, m.
        orientations: (n, 4) unit quaternions of a platform in the robot's axes, scalar first, relative to the reference
            orientation, or to that of the robot file if the cables are parallel in three pairs there; None: no
            rotation.
        point: point of a platform whose positions are given: "origin" of its axes, or "mass-centre"; None: the mass
            centre.

    Returns:
        the sensitivities, with displacements of the mass centre.

    Raises:
        InputError: more cables than degrees of freedom, pulleys, or another pattern of motion; shapes that do not fit,
            values that are not finite, quaternions that are not of unit length, or orientations of a point mass.
    """
    check_kind(robot)
    points = points_of("positions", positions)
    check_in_plane("positions", points, is_planar=robot.dof == PLANAR)
    if orientations is not None and isinstance(robot, PointMassRobot):
        raise InputError("orientations", None, "must be None", problem="a point mass has none")
    with double_precision():
        centred_robot, frame = centred(robot)
        turns = None
        if orientations is not None:
            turns = frame.rotated_quaternions(quaternions("orientations", orientations, len(points)))
        search, inner = SensitivitySearch(centred_robot), np.asarray(frame.inward(points))
        if point == "origin":
            inner = mass_centres(search.robot, inner, turns)
        answers = search(inner, turns)
    return Sensitivity(points, np.asarray(answers.sigma_p), np.asarray(answers.sigma_r))


@checked()
def encoder_error(drum_radius: Positive, pulses: Positive) -> float:
    """Error of a cable length due to the resolution of the winch's encoder, 2 pi r / pulses.

    Args:
        drum_radius: radius of the drum or pulley on which the cable is wound, m.
        pulses: pulses of the encoder per turn of the drum.

    Returns:
        the error, m.

    Raises:
        InputError: a number that is not positive.
    """
    return 2.0 * math.pi * drum_radius / pulses


@dataclasses.dataclass(frozen=True)
class AvailableAccelerations:
    """Accelerations that the cables of a point mass can supply at n positions, as faces; float64.

    An acceleration a is feasible where `normals @ a >= offsets`.

    Fields:
        positions: (n, 3) positions in the robot's axes, m.
        normals: (n, n_faces, 3) unit normals, pointing inside, in the robot's axes; 0 for a face that bounds nothing.
        offsets: (n, n_faces) offsets of the faces, m/s^2; -inf for a face that bounds nothing.
        cables: (n_faces, dof - 1) indices, from 0, of the cables that are parallel to the face.
        of_largest: (n, n_faces) whether a cable has its largest tension on the face.
    """

    positions: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray
    cables: np.ndarray
    of_largest: np.ndarray
    _robot: PointMassRobot
    _faces: Faces
    _allowed: Faces
    _frame: Frame

    @checked()
    def margin(self, accelerations: VectorOrVectors) -> np.ndarray:
        """Distances of accelerations from the nearest face.

        Args:
            accelerations: (3,) for all positions, or (n, 3), one for each position, in the robot's axes, m/s^2.

        Returns:
            (n,) m/s^2: positive if the acceleration is feasible, inf if nothing bounds it; negative if it is not,
            and then at least minus its distance from the feasible ones.

        Raises:
            InputError: the wrong shape, or not finite.
        """
        return self._verdicts(accelerations)[0]

    @checked()
    def verdict(self, accelerations: VectorOrVectors) -> np.ndarray:
        """Verdicts of accelerations.

        Args:
            accelerations: as for `margin`.

        Returns:
            (n,) flags of `Verdict`; 0 if feasible. Margins within 1e-9 of gravity, or within rounding, are undecided,
            unless limits may be touched.

        Raises:
            InputError: the wrong shape, or not finite.
        """
        return self._verdicts(accelerations)[1].astype(FLAGS)

    def _verdicts(self, accelerations) -> tuple[np.ndarray, np.ndarray]:
        vectors = np.asarray(accelerations, float)
        if vectors.shape not in ((3,), self.positions.shape):
            allowed = f"finite numbers of shape (3,) or {self.positions.shape}"
            raise InputError("accelerations", f"shape {vectors.shape}", allowed)
        if self._robot.dof == PLANAR and vectors[..., 1].any():
            raise InputError("accelerations", "y not 0", "y = 0: the plane of a planar robot")
        rotated = np.asarray(self._frame.rotated(np.broadcast_to(vectors, self.positions.shape)))
        with double_precision():
            return margins_and_verdicts(
                self._robot, self._faces, self._allowed, self._frame.inward(self.positions), rotated
            )


@checked(instead=TENSIONS)
def available_accelerations(
    robot: PointMassRobot, positions: Points, *, tension_min: Tensions = None, tension_max: Tensions = None
) -> AvailableAccelerations:
    """Feasible accelerations of a point mass on any number of cables, Boralugoda (2) to (6) and their extension.

    Args:
        robot: point mass in space or in a plane.
        positions: (n, 3) positions in the robot's axes, m.
        tension_min: smallest tension, () or (n_cables,) N; None: the robot's, else 0.
        tension_max: largest tension, () or (n_cables,) N; None: the robot's, else none.

    Returns:
        the set of feasible accelerations at each position.

    Raises:
        InputError: the wrong kind of robot, shapes that do not fit, values that are not finite, tensions that
            contradict each other.
    """
    check_point_mass(robot)
    points = points_of("positions", positions)
    check_in_plane("positions", points, is_planar=robot.dof == PLANAR)
    with double_precision():
        tensions: dict[str, Any] = {"tension_min": tension_min, "tension_max": tension_max}
        limits = static_limits(robot, limits_over(robot, Limits(**tensions), motors=True), accelerates=True)
        prepared_robot, frame = prepared(robot)
        allowed = touchable_limits(prepared_robot, limits)
        faces, wider = (faces_of(prepared_robot, each, frame.inward(points)) for each in (limits, allowed))
    cables = np.tile(spanning(robot.n_cables, robot.dof), (2, 1))
    normals, offsets, of_largest = map(np.asarray, (frame.rotated(faces.normals), faces.offsets, faces.of_largest))
    return AvailableAccelerations(points, normals, offsets, cables, of_largest, prepared_robot, faces, wider, frame)
