"""Poses from lengths of the cables, or from angles of their motors, from Python."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.arguments.kernel_arguments import check_in_plane, quaternions
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import ANY, PointOrPoints, Positive
from cspr_jax.errors.given_numbers import Numbers
from cspr_jax.machine.forward_kinematics.equilibrium import TAUT, equilibria
from cspr_jax.machine.forward_kinematics.lengths import checked_lengths
from cspr_jax.machine.forward_kinematics.solutions import Search, SolvedPoses
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import IDENTITY, Frame
from cspr_jax.robots.cables import wrench_units
from cspr_jax.robots.model.patterns import PATTERNS, Pattern
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.workspaces.poses import geometry
from cspr_jax.workspaces.poses.geometry import mass_centres

_LENGTHS = "finite numbers of shape (n_cables,) or (n, n_cables), in m, or in rad with angles = True"
Lengths = Annotated[ArrayLike, Numbers(_LENGTHS, ((ANY,), (ANY, ANY)))]
_QUATERNIONS = "unit quaternions of shape (4,) or (n, 4), scalar first"
Orientations = Annotated[ArrayLike, Numbers(_QUATERNIONS, ((4,), (ANY, 4)))]
_WEIGHTS = "numbers >= 0, one a cable, of which as many as degrees of freedom are above 0"
Weights = Annotated[ArrayLike, Numbers(_WEIGHTS, ((ANY,),), minimum=0.0, maximum=1e9)]


@dataclasses.dataclass(frozen=True)
class ForwardKinematics:
    """Poses in which the cables of a robot have n sets of lengths.

    Fields:
        positions: (n, 3) positions of `point`, or of the joint, in the robot's axes, m: the solution that is meant, or
            where there is none the nearest pose that was found.
        quaternions: (n, 4) unit quaternions, scalar first; of a point mass (1, 0, 0, 0).
        is_found: (n,) whether the pose has these lengths, within the tolerance.
        residuals: (n, n_cables) lengths of the cables in the pose minus given ones, m.
        steps: (n,) number of steps of Gauss-Newton; 0 where the pose has a closed form.
        count: (n,) number of solutions that were found, of those that were asked for.
        all_positions: (n, k, 3) all solutions, NaN behind the last; None unless asked for. The first is the one above.
        all_quaternions: (n, k, 4); None likewise.
        is_complete: whether there are no other solutions than these.
        slack: (n, n_cables) whether each cable is slack, at equilibrium; None unless that was asked for.
        tensions: (n, n_cables) N, at equilibrium, 0 where a cable is slack; None likewise.
    """

    positions: np.ndarray
    quaternions: np.ndarray
    is_found: np.ndarray
    residuals: np.ndarray
    steps: np.ndarray
    count: np.ndarray
    all_positions: np.ndarray | None
    all_quaternions: np.ndarray | None
    is_complete: bool
    slack: np.ndarray | None
    tensions: np.ndarray | None
    _robot: Any = dataclasses.field(repr=False)
    _inner: tuple[np.ndarray, np.ndarray] = dataclasses.field(repr=False)

    @property
    def residual(self) -> np.ndarray:
        """Largest absolute residual of each pose; slack cables do not count.

        Returns:
            (n,) m.
        """
        return np.abs(self.residuals if self.slack is None else np.where(self.slack, 0.0, self.residuals)).max(1)

    @property
    def worst_cable(self) -> np.ndarray:
        """Cable with the largest residual in each pose.

        Returns:
            (n,) indices from 0. With as many cables as degrees of freedom the residuals are rounding, and name none;
            with one cable more their ratios depend on the pose alone.
        """
        return np.abs(self.residuals).argmax(1)

    @cached_property
    def conditioning(self) -> np.ndarray:
        """How well the lengths determine each pose.

        Returns:
            (n,) smallest over largest singular value of the derivatives of the lengths, with rotations times the
            radius of the platform; 0 at singular poses.
        """
        robot = self._robot
        with double_precision():
            units = np.asarray(wrench_units(robot))
            matrices = np.asarray(geometry.wrench_matrices(robot, *self._inner)) / units[:, None]
        singular = np.linalg.svd(np.where(np.isfinite(matrices), matrices, 0.0), compute_uv=False)
        largest = np.where(singular[:, 0] > 0.0, singular[:, 0], 1.0)
        return singular[:, -1] / largest


@checked(instead="lengths: cable_lengths of a state")
def forward(  # noqa: PLR0913
    robot: PointMassRobot | PlatformRobot,
    lengths: Lengths,
    *,
    start: PointOrPoints | None = None,
    start_orientations: Orientations | None = None,
    angles: bool = False,
    all_solutions: bool = False,
    equilibrium: bool = False,
    weights: Weights | None = None,
    tolerance: Positive | None = None,
    point: Literal["mass-centre", "origin"] | None = None,
) -> ForwardKinematics:
    """Poses of a robot, of any pattern, from lengths of its cables or angles of its motors.

    Point masses on as many cables as degrees of freedom have closed forms: the solution below the plane of the spools
    is meant, unless a start is given. Other poses are found by least squares, from the start, or from a level platform
    and, where that fails, from others. A platform in the plane on three cables has up to six solutions.

    Args:
        robot: point mass or body on at least as many cables as degrees of freedom; pulleys are taken into account.
        lengths: (n, n_cables) or (n_cables,) lengths of the taut cables from their base points, arcs on pulleys
            included, m.
        start: (3,) or (n, 3) positions of `point` from which the search starts, in the robot's axes, m; of a mass on a
            guide a point of the guide, of a platform on a joint the joint. None: the origin of the axes for these,
            none for others.
        start_orientations: (4,) or (n, 4) orientations of a platform at the start; None: no rotation.
        angles: whether `lengths` are angles of the motors, rad, of a robot with winches.
        all_solutions: whether to look for all solutions. They are complete where `is_complete` says so; otherwise they
            are those found from many starts.
        equilibrium: whether cables may be slack: the pose is then the stable one of least potential energy in which no
            cable is longer than given; `weights` and `tolerance` must be absent.
        weights: (n_cables,) weights of the squared residuals of redundant cables; None: all equal.
        tolerance: largest residual of a solution, m; None: rounding (1e-9 of the robot's size), and of redundant
            cables any.
        point: point of a platform whose positions are meant: "origin" of its axes, or "mass-centre"; None: the origin.

    Returns:
        poses, and residuals of the lengths.

    Raises:
        InputError: shapes that do not fit, `weights` or `tolerance` beside `equilibrium`, lengths that are not above 0,
            angles of a robot without winches, or a start outside the plane of a planar robot.
    """
    if not isinstance(robot, PointMassRobot | PlatformRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a point mass or a platform")
    for name, value in (("weights", weights), ("tolerance", tolerance)):
        if equilibrium and value is not None:
            raise InputError(name, None, "must be absent beside equilibrium, which has none", problem="given")
    row = PATTERNS[robot.pattern]
    with double_precision():
        cable_lengths = checked_lengths(robot, lengths, is_angle=angles)
        inner_robot, frame = centred(robot)
        if robot.n_cables < robot.dof:
            raise InputError("robot", robot.n_cables, f"{robot.dof} cables or more, as many as degrees of freedom")
        loads = _weights(weights, robot)
        starts = _starts(inner_robot, frame, start, start_orientations, len(cable_lengths), point or "origin")
        fixed = np.asarray(frame.inward(np.zeros(3))) if starts is None else starts[0][0]
        search = Search(inner_robot, loads, tolerance, np.where(np.isin(range(3), row.forces), 0.0, fixed))
        if row.is_jointed and start_orientations is None:  # the joint alone is no start
            starts = None
        if equilibrium:
            rest = equilibria(search, cable_lengths, starts)
            answers = _answers(inner_robot, frame, rest.poses, point or "origin", is_all=all_solutions)
            is_slack = rest.poses.residuals[:, 0] < -TAUT * search.size
            return dataclasses.replace(answers, slack=is_slack, tensions=rest.tensions[:, 0])
        poses = _poses(search, cable_lengths, starts, is_all=all_solutions)
        return _answers(inner_robot, frame, poses, point or "origin", is_all=all_solutions)


def _poses(
    search: Search, cable_lengths: np.ndarray, starts: tuple[np.ndarray, np.ndarray] | None, *, is_all: bool
) -> SolvedPoses:
    is_every = is_all or search.is_closed
    if starts is None:
        return search.all_solutions(cable_lengths) if is_every else search.usual(cable_lengths)
    return (
        search.nearest_first(search.all_solutions(cable_lengths), *starts)
        if is_every
        else search.near(cable_lengths, *starts)
    )


def _weights(weights: Any, robot: Any) -> np.ndarray:
    if weights is None:
        return np.ones(robot.n_cables)
    values = np.asarray(weights, float)
    if values.shape != (robot.n_cables,) or (values > 0.0).sum() < robot.dof:
        raise InputError("weights", values.tolist(), f"{robot.n_cables} {_WEIGHTS}")
    return values / values.max()


def _starts(
    robot: Any, frame: Frame, start: Any, orientations: Any, count: int, point: str
) -> tuple[np.ndarray, np.ndarray] | None:
    # Positions of the mass centre, (n, 3), and quaternions, (n, 4), of the starts, as kernels take them.
    row: Pattern = PATTERNS[robot.pattern]
    if start is None:
        if orientations is not None:
            raise InputError("start_orientations", None, "must be absent without start", problem="given")
        return None
    points = np.atleast_2d(np.asarray(start, float))
    check_in_plane("start", points, is_planar=row.is_planar)
    is_placed = row.is_jointed or row.dof == 1
    if len(points) != 1 and (is_placed or len(points) != count):
        allowed = "must be (3,)" if is_placed else f"must be (3,) or ({count}, 3)"
        raise InputError("start", None, allowed, problem=f"an array of shape {np.shape(start)}")
    turns = np.array([IDENTITY])
    if orientations is not None:
        if not row.is_body:
            raise InputError("start_orientations", None, "must be None", problem="a point mass has none")
        values = np.atleast_2d(np.asarray(orientations, float))
        if len(values) not in (1, count):
            error = f"an array of shape {np.shape(orientations)}"
            raise InputError("start_orientations", None, f"must be (4,) or ({count}, 4)", problem=error)
        turns = np.asarray(frame.rotated_quaternions(quaternions("start_orientations", values, len(values))))
        if row.is_planar and turns[:, [1, 3]].any():
            error = "rotations not about y"
            raise InputError("start_orientations", None, "must be about y, those of a planar robot", problem=error)
    inner = np.broadcast_to(np.asarray(frame.inward(points)), (count, 3)).copy()
    rotations = np.broadcast_to(turns, (count, 4)).copy()
    return (mass_centres(robot, inner, rotations) if point == "origin" else inner), rotations


def _answers(robot: Any, frame: Frame, poses: SolvedPoses, point: str, *, is_all: bool) -> ForwardKinematics:
    # In the axes of the robot's file; positions are of the origin of the platform's axes, or of the mass centre.
    is_body, columns = PATTERNS[robot.pattern].is_body, slice(None if is_all else 1)
    inner, turns = poses.positions[:, columns], poses.quaternions[:, columns]
    outer, orientations = inner, turns
    if is_body:
        turns = np.where(turns[..., :1] < 0.0, -turns, turns)
        flat = turns.reshape(-1, 4)
        if point == "origin":
            arms = mass_centres(robot, np.zeros((len(flat), 3)), flat)
            outer = inner - np.broadcast_to(arms, (len(flat), 3)).reshape(inner.shape)
        orientations = np.asarray(frame.rotated_quaternions(turns))
    positions = np.asarray(frame.outward(outer))
    shown = poses.is_found[..., None]
    return ForwardKinematics(
        positions[:, 0],
        orientations[:, 0],
        poses.is_found[:, 0],
        poses.residuals[:, 0],
        poses.steps[:, 0],
        poses.is_found.sum(1),
        np.where(shown, positions, np.nan) if is_all else None,
        np.where(shown, orientations, np.nan) if is_all else None,
        poses.is_complete,
        None,
        None,
        robot,
        (poses.positions[:, 0], poses.quaternions[:, 0]),
    )
