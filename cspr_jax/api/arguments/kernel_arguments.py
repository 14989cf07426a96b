"""Conversion of arguments of public functions for kernels, and batches of motions from answers."""

from __future__ import annotations

import warnings
from typing import Any

import jax
import numpy as np

from cspr_jax.config.near_rest import almost_at_rest
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import DEPTHS, POINTS
from cspr_jax.errors.suggestions import one_of
from cspr_jax.motion.amplitudes import NAMES, Amplitude, boundary_errors, named
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.given_limits import limits_over
from cspr_jax.motion.motion import Placed
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.linear.frames import IDENTITY, Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import UNIT_NORM
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PLANAR, PointMassRobot
from cspr_jax.robots.model.robot import check_determined, check_moved
from cspr_jax.robots.model.tension_rule_table import TENSION_RULES
from cspr_jax.robots.statics.kernel_axes import prepared


def check_point_mass(robot: Any) -> None:
    """Refuse robots that are not point masses."""
    if not isinstance(robot, PointMassRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a point mass")


def check_in_plane(key: str, points: Float[np.ndarray, "n 3"], *, is_planar: bool) -> None:
    """Refuse points outside the plane of a planar robot."""
    if is_planar and points[:, 1].any():
        raise InputError(key, "y not 0", "y = 0: the plane of a planar robot")


def check_rule(robot: Any, rule: str) -> None:
    """Refuse an unknown rule of tensions, and one that needs a largest tension of every cable where there is none."""
    if rule not in TENSION_RULES:
        raise InputError("rule", rule, one_of(rule, TENSION_RULES))
    high = robot.limits.tension_max
    if TENSION_RULES[rule].is_bounded and robot.n_cables > robot.dof and (high is None or not _is_finite(high)):
        raise InputError("rule", rule, "another one without a largest tension of every cable")


def _is_finite(values: Any) -> bool:
    # Numbers that jax traces count as finite, since they have no values yet.
    return isinstance(values, jax.core.Tracer) or bool(np.isfinite(np.asarray(values)).all())


def starts_and_ends(robot: Any, start, targets) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Starts and ends of many motions of a point mass, (n, 3) each."""
    check_point_mass(robot)
    ends, starts = points_of("targets", targets), points_of("start", np.atleast_2d(np.asarray(start, float)))
    if len(starts) not in (1, len(ends)):
        raise InputError("start", f"shape {starts.shape}", f"finite numbers of shape (3,) or {ends.shape}")
    check_in_plane("targets", np.concatenate([ends, starts]), is_planar=robot.dof == PLANAR)
    return np.broadcast_to(starts, ends.shape).copy(), ends


def amplitude_of(amplitude: str | Amplitude, *, free_end: bool | None = None) -> Amplitude:
    """Amplitude function, given by its name or as a function."""
    try:
        function = named(amplitude) if isinstance(amplitude, str) else amplitude
    except InputError as error:
        allowed = f"{one_of(str(amplitude), NAMES)}; those with an epsilon are amplitude(name, epsilon)"
        raise InputError("amplitude", amplitude, allowed) from error
    if free_end is not None and isinstance(function.coefficients, np.ndarray):
        broken = boundary_errors(function, free_end=free_end)
        if broken:
            conditions = "(1.27) and (1.28)" if free_end else "(2.49)"
            raise InputError(
                "amplitude", function.name, f"an amplitude function that meets {conditions}: " + "; ".join(broken)
            )
    return function


def warn_of_rest(robot: Any, key: str, position: Any, z0: Any, cure: str) -> None:
    """Warn of a position that differs from P0 only in its last digits."""
    if np.shape(position) == (3,) and np.shape(z0) == ():
        line = almost_at_rest(key, np.asarray(position, float).tolist(), float(z0), robot, cure)
        if line:
            warnings.warn(line, stacklevel=5)  # blames the caller, above the check of arguments


def kernel_problem(
    robot: Any,
    amplitude: str | Amplitude,
    limits: Limits | None,
    *,
    free_end: bool | None = False,
    families: tuple[str, ...] = (),
    any_cables: bool = False,
) -> tuple[Problem, Frame]:
    """Robot, limits and amplitude function in the form for kernels."""
    function = amplitude_of(amplitude, free_end=free_end)
    (check_moved if any_cables else check_determined)(robot)
    prepared_robot, frame = prepared(robot)
    # Apply the same rule as `build.robots.is_redundant_platform`.
    any_tensions = isinstance(robot, PlatformRobot) and robot.n_cables > robot.dof
    limit_values = limits_over(robot, limits, any_tensions=any_tensions, families=families)
    return Problem(prepared_robot, limit_values, function), frame


def batched(kind, segments, problem: Problem, answers: Answers, frame: Frame, *more) -> Any:
    """Motions of answers as one motion with a leading dimension in all leaves, for `jax.vmap`."""
    count = len(answers.tried_arcs)
    shared = jax.tree.map(lambda x: np.broadcast_to(x, (count, *np.shape(x))), (problem.amplitude, frame))
    return Placed(kind(segments, shared[0], answers.tried_arcs.astype(float), *more), shared[1])


def depths(z0, count: int) -> Float[np.ndarray, "count"]:
    """Depths of P0, one for each motion."""
    if np.shape(z0) not in ((), (count,)):
        raise InputError("z0", f"shape {np.shape(z0)}", f"a number > 0, or ({count},) of them")
    return np.broadcast_to(DEPTHS.array("z0", z0), (count,)).copy()


def release_ranges(x, y, z) -> list:
    """Ranges of the coordinates of the position of release."""
    for name, values in {"release_x": x, "release_y": y, "release_z": z}.items():
        if values is not None and not values[0] <= values[1]:
            raise InputError(name, list(values), "[least, largest], the first not above the second, at most 1e6 m")
    return [x, y, z]


def quaternions(key: str, orientations, count: int) -> Float[np.ndarray, "count 4"]:
    """Orientations as unit quaternions; refuses other shapes."""
    if orientations is None:
        return np.tile(IDENTITY, (count, 1))
    values = np.asarray(orientations, float)
    if values.shape != (count, 4) or not np.abs(np.linalg.norm(values, axis=1) - 1.0).max() <= UNIT_NORM:
        raise InputError(key, f"shape {values.shape}", f"({count}, 4) unit quaternions, scalar first")
    return values / np.linalg.norm(values, axis=1, keepdims=True)


def points_of(key: str, points) -> Float[np.ndarray, "n 3"]:
    """Points as an array; refuses other shapes."""
    return POINTS.array(key, points)
