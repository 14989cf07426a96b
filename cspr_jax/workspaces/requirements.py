"""Requirements of workspaces: a condition, limits of the tensions, and the wrenches that the cables must supply."""

import dataclasses
import math
from typing import Any

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.errors.given_numbers import numbers
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.workspaces.poses import geometry
from cspr_jax.workspaces.required_wrenches import RequiredWrenches

STATIC = "static"
CLOSURE = "wrench-closure"
FEASIBLE = "wrench-feasible"
CONDITIONS = (STATIC, CLOSURE, FEASIBLE)
# Largest number of choices of dof - 1 cables, with which a pose takes seconds, and megabytes of memory.
MAX_CHOICES = 100_000


@dataclasses.dataclass(frozen=True)
class Requirement:
    """Requirement that each pose must meet.

    Fields:
        condition: one of `CONDITIONS`.
        low: (n_cables,) smallest tensions, N.
        high: (n_cables,) largest tensions, inf for none, N.
        wrenches: wrenches that the cables must supply, kernels' axes, N and N m.
        capacity_length: length by which moments are divided for the capacity margin, m; None: the margin is that of
            tensions.
    """

    condition: str
    low: np.ndarray
    high: np.ndarray
    wrenches: RequiredWrenches
    capacity_length: float | None = None


def check_cables(robot: AnyRobot) -> None:
    """Refuse robots with too many cables, since the number of choices grows with a power of their number."""
    if math.comb(robot.n_cables, robot.dof - 1) > MAX_CHOICES:
        maximum = max(n for n in range(robot.n_cables) if math.comb(n, robot.dof - 1) <= MAX_CHOICES)
        allowed = f"at most {maximum} for workspaces of {robot.dof} degrees of freedom"
        raise InputError("robot", None, f"must have {allowed}", problem=f"{robot.n_cables} cables")


def requirement(
    robot: AnyRobot,
    condition: str,
    limits: Limits,
    wrenches: RequiredWrenches | None = None,
    capacity_length: float | None = None,
) -> Requirement:
    """Requirement of a condition."""
    if condition != FEASIBLE:
        limits, wrenches, capacity_length = Limits(), None, None
    low, high = tension_range(robot, limits)
    return Requirement(condition, np.asarray(low), np.asarray(high), wrenches or _weight(robot), capacity_length)


def _weight(robot: AnyRobot) -> RequiredWrenches:
    # Wrench that holds the robot at rest; for a body on a joint it depends on the orientation.
    if PATTERNS[robot.pattern].is_jointed:
        return RequiredWrenches(None)
    wrench = np.zeros((1, robot.dof))
    wrench[0, PATTERNS[robot.pattern].forces.index(2)] = -float(robot.mass * robot.gravity)
    return RequiredWrenches(wrench)


def required_wrenches(
    robot: AnyRobot,
    frame: Frame,
    *,
    points: Any = None,
    box: Any = None,
    ellipsoid: Any = None,
    acceleration: Any = None,
) -> RequiredWrenches:
    """Wrenches that cables must supply, for the kernels: all sums of one wrench of each given set."""
    row, ellipsoids = PATTERNS[robot.pattern], list[np.ndarray]()
    required = _weight(robot)
    if points is not None:
        signs = np.ones(robot.dof)  # moments of a rod are 0
        signs[: len(row.forces) + len(row.moments)] = [frame.signs[i] for i in (*row.forces, *row.moments)]
        required = RequiredWrenches(_finite(robot, "wrenches", points, 2) * signs)
    half = None if box is None else _not_negative("wrench_box", _finite(robot, "wrench_box", box, 1))
    if ellipsoid is not None:
        ellipsoids.append(_not_negative("wrench_ellipsoid", _finite(robot, "wrench_ellipsoid", ellipsoid, 1)))
    if acceleration is not None:
        if row.is_jointed:
            raise InputError("acceleration", acceleration, "must be absent", problem="of a robot on a joint")
        radius = numbers("acceleration", acceleration, "a number >= 0, in m/s^2")
        if radius.ndim or not 0.0 <= radius < np.inf:
            raise InputError("acceleration", acceleration, "a number >= 0, in m/s^2")
        radius = float(robot.mass) * radius
        ellipsoids.append(np.where(geometry.scales(robot), 0.0, radius))
    return dataclasses.replace(required, box=half, ellipsoids=tuple(ellipsoids))


def _finite(robot: AnyRobot, key: str, entries: Any, ndim: int) -> np.ndarray:
    allowed = "finite numbers of shape " + (f"({robot.dof},)" if ndim == 1 else f"(k, {robot.dof}), k >= 1")
    values = numbers(key, entries, allowed)
    if values.ndim != ndim or not values.size or values.shape[-1] != robot.dof:
        raise InputError(key, None, f"must be {allowed}", problem=f"an array of shape {values.shape}")
    if not np.isfinite(values).all():
        raise InputError(key, values.tolist(), allowed)
    if PATTERNS[robot.pattern].along_line and values[..., 3:].any():
        raise InputError(key, "moments of a rod", "0 there: their two axes turn with it")
    return values


def _not_negative(key: str, values: np.ndarray) -> np.ndarray:
    if not (values >= 0.0).all():
        raise InputError(key, values.tolist(), "not negative")
    return values
