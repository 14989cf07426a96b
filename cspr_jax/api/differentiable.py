"""Values at one pose, or on one ellipse, in pure jax: to be jitted, vmapped and differentiated by poses and robots.

Values have the precision that jax is set to: call `jax.config.update("jax_enable_x64", True)` for float64. At a kink a
derivative is that of one of the smooth functions that meet there.
"""

from __future__ import annotations

from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.arguments.kernel_arguments import check_in_plane, check_point_mass, check_rule
from cspr_jax.api.workspaces import check_kind
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import Point, QuaternionOrNone, Rate
from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.hull import traced_hull
from cspr_jax.numerics.linear.frames import IDENTITY, Frame
from cspr_jax.numerics.linear.rotations import matrix
from cspr_jax.robots import cables
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.elasticity.natural_frequencies import frequencies_at_rest
from cspr_jax.robots.elasticity.stiffness import pose_lengths as lengths_in
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.tension_rule_table import CENTRED
from cspr_jax.robots.statics.kernel_axes import centred, coordinate_signs
from cspr_jax.robots.statics.wrench_balance import at_rest
from cspr_jax.workspaces.requirements import check_cables

PosePoint = Literal["mass-centre", "origin"]


@checked(traced=True)
def pose_lengths(
    robot: PointMassRobot | PlatformRobot,
    position: Point,
    quaternion: QuaternionOrNone = None,
    *,
    point: PosePoint | None = None,
) -> Array:
    """Lengths of the cables at a pose.

    Args:
        robot: robot of any pattern on any number of cables, pulleys included.
        position: (3,) position of `point`, or of the joint, in the robot's axes, m.
        quaternion: (4,) orientation of a body, scalar first, relative to the robot file, of any length but 0; None: no
            rotation.
        point: point of a platform whose position is given, "origin" of its axes or "mass-centre"; None: the origin.

    Returns:
        (n_cables,) in cable order, with the arcs on pulleys, m.

    Raises:
        InputError: the wrong kind of robot, shapes that do not fit, values that are not finite, a quaternion of a point
            mass, or y not 0 on a planar robot.
    """
    return _LENGTHS(robot, *_checked(robot, position, quaternion), point=point)


@checked(traced=True)
def pose_wrench_matrix(
    robot: PointMassRobot | PlatformRobot,
    position: Point,
    quaternion: QuaternionOrNone = None,
    *,
    point: PosePoint | None = None,
) -> Array:
    """Wrenches on the effector of unit tensions at a pose.

    Args:
        robot: as for `pose_lengths`.
        position: as for `pose_lengths`.
        quaternion: as for `pose_lengths`.
        point: as for `pose_lengths`.

    Returns:
        (dof, n_cables): the force; below it the moment about the mass centre or the joint, m; in the robot's axes, only
        components that the pattern balances; moments of a rod are about two axes normal to it.

    Raises:
        InputError: as for `pose_lengths`.
    """
    return _WRENCH_MATRIX(robot, *_checked(robot, position, quaternion), point=point)


@checked(traced=True)
def pose_tensions(
    robot: PointMassRobot | PlatformRobot,
    position: Point,
    quaternion: QuaternionOrNone = None,
    *,
    rule: str = CENTRED,
    point: PosePoint | None = None,
) -> Array:
    """Tensions that hold a robot at rest in a pose.

    Args:
        robot: as for `pose_lengths`; its limits are those of the tensions.
        position: as for `pose_lengths`.
        quaternion: as for `pose_lengths`.
        rule: rule that chooses the tensions of redundant cables, as for `tensions`; derivatives of "p-norm" are those
            of the last step of its iteration, and not promised.
        point: as for `pose_lengths`.

    Returns:
        (n_cables,) N, as by `tensions`: negative if a cable would have to push, and of least norm where the rule finds
        none within the limits.

    Raises:
        InputError: as for `pose_lengths`, an unknown rule, or a rule that needs a largest tension of every cable on a
            robot without them.
    """
    check_rule(robot, rule)
    return _TENSIONS(robot, *_checked(robot, position, quaternion), rule=rule, point=point)


@checked(traced=True)
def pose_margin(
    robot: PointMassRobot | PlatformRobot,
    position: Point,
    quaternion: QuaternionOrNone = None,
    *,
    point: PosePoint | None = None,
) -> Array:
    """Margin of a pose at rest: the largest distance that tensions can keep from their limits, as in `workspace`.

    It proves nothing where rounding decides its sign: `workspace` does.

    Args:
        robot: as for `pose_lengths`; its limits are those of the tensions, at least 0 without any.
        position: as for `pose_lengths`.
        quaternion: as for `pose_lengths`.
        point: as for `pose_lengths`.

    Returns:
        () N, positive if tensions within the limits hold the weight; inf where it is unbounded, -inf where the cables
        do not span all wrenches.

    Raises:
        InputError: as for `pose_lengths`, or too many cables.
    """
    check_kind(robot)
    check_cables(robot)
    return _MARGIN(robot, *_checked(robot, position, quaternion), point=point)


@checked(traced=True)
def pose_frequencies(
    robot: PointMassRobot | PlatformRobot,
    position: Point,
    quaternion: QuaternionOrNone = None,
    *,
    rule: str = CENTRED,
    point: PosePoint | None = None,
) -> Array:
    """Natural frequencies of a robot on elastic cables at rest in a pose, as by `natural_frequencies`.

    Args:
        robot: as for `pose_lengths`, with an `axial_stiffness`.
        position: as for `pose_lengths`.
        quaternion: as for `pose_lengths`.
        rule: as for `pose_tensions`.
        point: as for `pose_lengths`.

    Returns:
        (dof,) rad/s, increasing; 0 where the equilibrium is not stable, NaN where a cable is slack.

    Raises:
        InputError: as for `pose_tensions`, or a robot without `axial_stiffness`.
    """
    check_kind(robot)
    if robot.axial_stiffness is None:
        raise InputError("robot", None, "must have an axial_stiffness: with_cables gives one", problem="missing")
    check_rule(robot, rule)
    return _FREQUENCIES(robot, *_checked(robot, position, quaternion), rule=rule, point=point)


@checked(traced=True)
def ellipse_margin(robot: PointMassRobot, centre: Point, a: Point, b: Point, frequency: Rate) -> Array:
    """Margin of one harmonic ellipse, as by `ellipse_margins`.

    Args:
        robot: point mass on two or more cables without pulleys, with all spools in one plane, which is not checked.
        centre: (3,) centre in the robot's axes, m.
        a: (3,) vector from the centre to the point at the angle 0, m.
        b: (3,) vector from the centre to the point a quarter of a turn later, m.
        frequency: () rad/s.

    Returns:
        () positive exactly if all cables stay taut.

    Raises:
        InputError: the wrong kind of robot, pulleys, shapes that do not fit, or y not 0 on a planar robot.
    """
    check_point_mass(robot)
    if robot.pulleys is not None or robot.pattern == "1T":
        raise InputError("robot", None, "must be in space or a plane, without pulleys", problem="a guide or pulleys")
    for name, vector in (("centre", centre), ("a", a), ("b", b)):
        _check_plane(robot, name, vector)
    return _ELLIPSE_MARGIN(robot, *(jnp.asarray(x, float) for x in (centre, a, b, frequency)))


def _checked(robot: AnyRobot, position, quaternion) -> tuple[Array, Array]:
    # Check what does not depend on values that jax traces.
    check_kind(robot)
    if quaternion is not None and not PATTERNS[robot.pattern].is_body:
        raise InputError("quaternion", None, "must be None", problem="a point mass has none")
    _check_plane(robot, "position", position)
    return jnp.asarray(position, float), jnp.asarray(IDENTITY if quaternion is None else quaternion, float)


def _check_plane(robot: AnyRobot, name: str, vector) -> None:
    if not isinstance(vector, jax.core.Tracer):
        check_in_plane(name, np.reshape(np.asarray(vector), (1, 3)), is_planar=PATTERNS[robot.pattern].is_planar)


def _at(robot: AnyRobot, position: Array, quaternion: Array, point: str | None) -> tuple[AnyRobot, State, Frame]:
    # The robot and its state in the kernels' axes.
    inner, frame = centred(robot)
    turn = jnp.asarray(frame.rotated_quaternions(quaternion))
    rotation = matrix(turn / jnp.sqrt(jnp.dot(turn, turn)))
    centre, row = jnp.asarray(frame.inward(position)), PATTERNS[robot.pattern]
    if not isinstance(inner, PlatformRobot):
        return inner, State(centre, jnp.zeros_like(centre), jnp.zeros_like(centre)), frame
    if point != "mass-centre" and not row.is_jointed and inner.centre_of_mass is not None:
        centre = centre + rotation @ inner.centre_of_mass
    return inner, at_rest(centre, rotation), frame


def _lengths(robot: AnyRobot, position: Array, quaternion: Array, *, point: str | None) -> Array:
    return lengths_in(*_at(robot, position, quaternion, point)[:2])


def _wrench_matrix(robot: AnyRobot, position: Array, quaternion: Array, *, point: str | None) -> Array:
    inner, state, frame = _at(robot, position, quaternion, point)
    return jnp.asarray(coordinate_signs(inner, frame))[:, None] * inner.wrench_matrix(state)


def _tensions(robot: AnyRobot, position: Array, quaternion: Array, *, rule: str, point: str | None) -> Array:
    return cables.tensions(*_at(robot, position, quaternion, point)[:2], robot.limits, rule)


def _margin(robot: AnyRobot, position: Array, quaternion: Array, *, point: str | None) -> Array:
    return cables.margin(*_at(robot, position, quaternion, point)[:2], robot.limits)


def _frequencies(robot: AnyRobot, position: Array, quaternion: Array, *, rule: str, point: str | None) -> Array:
    return frequencies_at_rest(*_at(robot, position, quaternion, point)[:2], robot.limits, rule)


def _ellipse_margin(robot: PointMassRobot, centre: Array, a: Array, b: Array, frequency: Array) -> Array:
    inner, frame = centred(robot)
    ellipse = harmonics.Ellipse(frame.inward(centre), frame.rotated(a), frame.rotated(b))
    return harmonics.least_margin(traced_hull(inner), ellipse, frequency)


# Compile all operations of a function together: XLA would compile each of them by itself.
_LENGTHS = jax.jit(_lengths, static_argnames="point")
_WRENCH_MATRIX = jax.jit(_wrench_matrix, static_argnames="point")
_TENSIONS = jax.jit(_tensions, static_argnames=("rule", "point"))
_MARGIN = jax.jit(_margin, static_argnames="point")
_FREQUENCIES = jax.jit(_frequencies, static_argnames=("rule", "point"))
_ELLIPSE_MARGIN = jax.jit(_ellipse_margin)
