"""Workspaces from Python: which poses a robot on any number of cables can hold."""

import numpy as np

from cspr_jax.api.argument_checks import checked
from cspr_jax.api.arguments import points_of, quaternions
from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.arithmetic.frames import Frame
from cspr_jax.errors import InputError
from cspr_jax.motions.given_limits import limits_over
from cspr_jax.robots.kernel_axes import centred
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.schema.given_numbers import numbers
from cspr_jax.workspaces.geometry import mass_centres
from cspr_jax.workspaces.questions import CONDITIONS, FEASIBLE, check_cables, required_wrenches, requirement
from cspr_jax.workspaces.search import WorkspaceAnswers, WorkspaceSearch

__all__ = ["WorkspaceAnswers", "workspace"]


PRECISIONS = ("float64", "float32")


@checked
def workspace(  # noqa: PLR0913
    robot: PointMassRobot | PlatformRobot,
    positions,
    orientations=None,
    *,
    condition: str = FEASIBLE,
    tension_min=None,
    tension_max=None,
    wrenches=None,
    wrench_box=None,
    wrench_ellipsoid=None,
    acceleration=None,
    capacity_length: float | None = None,
    precision: str = "float64",
) -> WorkspaceAnswers:
    """Workspace of a robot of any pattern on any number of cables: whether each of n poses belongs to it.

    Args:
        robot: a point mass or a body on as many cables as degrees of freedom, or more; pulleys count.
        positions: (n, 3) of the origin of the platform frame, of a robot on a joint of the joint, in the robot's axes,
            m; n >= 1.
        orientations: (n, 4) unit quaternions, scalar first, from the orientation of the file; None: that one.
        condition: "static": taut cables of any tension hold the weight; "wrench-feasible": tensions within limits
            supply all wrenches; "wrench-closure": cables that are pulled hard enough resist every wrench.
        tension_min: smallest tension, () or (n_cables,) N, of "wrench-feasible"; None: the robot's, else 0.
        tension_max: largest tension, likewise, inf allowed; None: the robot's, else none.
        wrenches: (k, dof) what the cables must supply, of "wrench-feasible": forces, N, then moments about the mass
            centre, or the joint, N m, in the robot's axes; None: what holds the weight still.
        wrench_box: (dof,) half widths of a box of wrenches about each of these, N and N m.
        wrench_ellipsoid: (dof,) semi-axes of an ellipsoid of wrenches about each of these, N and N m.
        acceleration: radius of a ball of accelerations of the mass centre that the cables must give beside, m/s^2.
        capacity_length: of "wrench-feasible": by which moments are divided, m (of a point mass any length), for the
            capacity margin in place of that of the tensions: the distance of the wrenches from the faces of all that
            the cables can supply, N (Guay et al. 2014; Ruiz et al. 2015).
        precision: "float64"; "float32": it decides poses where it can, and float64 the others, so that verdicts are the
            same; margins of the former are good to some 1e-3 of the limits.

    Returns:
        verdicts, 0 inside, and margins.

    Raises:
        InputError: another kind of robot, or one on too many cables, an unknown condition, shapes that do not fit,
            values that are not finite, quaternions that are not of unit length, orientations of a point mass,
            moments of a rod, accelerations of a robot on a joint, limits or wrenches where the condition has none,
            limits that contradict each other.
    """
    if not isinstance(robot, PointMassRobot | PlatformRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a point mass or a platform")
    check_cables(robot)
    if condition not in CONDITIONS:
        raise InputError("condition", condition, " or ".join(f'"{name}"' for name in CONDITIONS))
    if precision not in PRECISIONS:
        raise InputError("precision", precision, " or ".join(f'"{name}"' for name in PRECISIONS))
    requirements = {"wrench_box": wrench_box, "wrench_ellipsoid": wrench_ellipsoid, "acceleration": acceleration}
    requirements |= {"tension_min": tension_min, "tension_max": tension_max, "wrenches": wrenches}
    for key, value in (*requirements.items(), ("capacity_length", capacity_length)):
        if value is not None and condition != FEASIBLE:
            raise InputError(key, value, f'None with condition "{condition}"')
    places = _places(robot, positions)
    with double_precision():
        centred_robot, frame = centred(robot)
        limits = _limits(robot, tension_min, tension_max)
        loads = required_wrenches(
            centred_robot, frame, points=wrenches, box=wrench_box, ellipsoid=wrench_ellipsoid, acceleration=acceleration
        )
        inner, turns = _poses(centred_robot, frame, places, orientations)
        posed = requirement(centred_robot, condition, limits, loads, capacity_length)
        return WorkspaceSearch(centred_robot, posed, precision=precision)(inner, turns)


def _places(robot, positions) -> np.ndarray:
    places = points_of("positions", positions)
    row = PATTERNS[robot.pattern]
    if row.is_planar and places[:, 1].any():
        raise InputError("positions", "y not 0", "y = 0: the plane of a planar robot")
    return places


def _limits(robot, tension_min, tension_max) -> Limits:
    if tension_max is not None and np.ndim(tension_max) == 0:  # of an infinite one each cable has its own
        allowed = f"a number > 0, or {robot.n_cables}: one a cable"
        tension_max = np.full(robot.n_cables, numbers("tension_max", tension_max, allowed))
    return limits_over(robot, Limits(tension_min=tension_min, tension_max=tension_max), any_tensions=True)


def _poses(robot, frame: Frame, places: np.ndarray, orientations) -> tuple[np.ndarray, np.ndarray | None]:
    row = PATTERNS[robot.pattern]
    inner, turns = np.asarray(frame.inward(places)), None
    if orientations is not None:
        if not row.is_body:
            raise InputError("orientations", None, "must be None", fault="a point mass has none")
        unit_quaternions = quaternions("orientations", orientations, len(places))
        if row.is_planar and unit_quaternions[:, [1, 3]].any():
            raise InputError("orientations", "not about y", "turns about y: those of a planar robot")
        turns = frame.turned_quaternions(unit_quaternions)
    return mass_centres(robot, inner, turns), turns
