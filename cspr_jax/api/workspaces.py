"""Workspaces from Python: which poses a robot on any number of cables can hold."""

import numpy as np

from cspr_jax.api.arguments import points_of, quaternions
from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.arithmetic.frames import Frame
from cspr_jax.errors import InputError
from cspr_jax.problem import centred, limits_over
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.search import workspaces as search
from cspr_jax.search.workspaces import CONDITIONS, FEASIBLE, WorkspaceAnswers, WorkspaceSearch

__all__ = ["WorkspaceAnswers", "workspace"]


def workspace(
    robot: PointMassRobot | PlatformRobot,
    positions,
    orientations=None,
    *,
    condition: str = FEASIBLE,
    tension_min=None,
    tension_max=None,
    wrenches=None,
) -> WorkspaceAnswers:
    """Workspace of a robot of any pattern on any number of cables: whether each of n poses belongs to it.

    Args:
        robot: a point mass or a body on as many cables as degrees of freedom, or more; pulleys count.
        positions: (n, 3) of the origin of the platform frame, of a robot on a joint of the joint, in the robot's axes,
            m.
        orientations: (n, 4) unit quaternions, scalar first, from the orientation of the file; None: that one.
        condition: "static": taut cables of any tension hold the weight; "wrench-feasible": tensions within limits
            supply all wrenches; "wrench-closure": cables that are pulled hard enough resist every wrench.
        tension_min: smallest tension, () or (n_cables,) N, of "wrench-feasible"; None: the robot's, else 0.
        tension_max: largest tension, likewise, inf allowed; None: the robot's, else none.
        wrenches: (k, dof) what the cables must supply, of "wrench-feasible": forces, N, then moments about the mass
            centre, or the joint, N m, in the robot's axes; None: what holds the weight still.

    Returns:
        verdicts, 0 inside, and margins.

    Raises:
        InputError: another kind of robot, an unknown condition, shapes that do not fit, values that are not finite,
            quaternions that are not of unit length, orientations of a point mass, wrenches of a rod, limits or wrenches
            where the condition has none, limits that contradict each other.
    """
    if not isinstance(robot, PointMassRobot | PlatformRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a point mass or a platform")
    if condition not in CONDITIONS:
        raise InputError("condition", condition, " or ".join(f'"{name}"' for name in CONDITIONS))
    for key, value in (("tension_min", tension_min), ("tension_max", tension_max), ("wrenches", wrenches)):
        if value is not None and condition != FEASIBLE:
            raise InputError(key, value, f'None with condition "{condition}"')
    places = _places(robot, positions)
    with double_precision():
        own, frame = centred(robot)
        limits = _limits(robot, tension_min, tension_max)
        loads = None if wrenches is None else search.given_wrenches(own, wrenches, frame)
        inner, turns = _poses(own, frame, places, orientations)
        return WorkspaceSearch(own, search.question(own, condition, limits, loads))(inner, turns)


def _places(robot, positions) -> np.ndarray:
    places = points_of("positions", positions)
    row = PATTERNS[robot.pattern]
    if row.is_planar and places[:, 1].any():
        raise InputError("positions", "y not 0", "y = 0: the plane of a planar robot")
    return places


def _limits(robot, tension_min, tension_max) -> Limits:
    if tension_max is not None and np.ndim(tension_max) == 0:  # of an infinite one each cable has its own
        tension_max = np.full(robot.n_cables, tension_max)
    return limits_over(robot, Limits(tension_min=tension_min, tension_max=tension_max), any_tensions=True)


def _poses(own, frame: Frame, places: np.ndarray, orientations) -> tuple[np.ndarray, np.ndarray | None]:
    row = PATTERNS[own.pattern]
    inner, turns = np.asarray(frame.inward(places)), None
    if orientations is not None:
        if not row.is_body:
            raise InputError("orientations", None, "must be None", fault="a point mass has none")
        given = quaternions("orientations", orientations, len(places))
        if row.is_planar and given[:, [1, 3]].any():
            raise InputError("orientations", "not about y", "turns about y: those of a planar robot")
        turns = frame.turned_quaternions(given)
    return search.mass_centres(own, inner, turns), turns
