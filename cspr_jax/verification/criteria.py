"""Criteria of any motion, in the order of their slacks (`verification.bounds.block_slacks`).

In natural units (N, m, m/s, m/s^2), with n cables:

    tension     of n = dof cables: n distances of the tensions from their limits; of more: the largest distance that all
                tensions together can have from their limits
    limits      for each limit that is given: one for each cable, or a single one
    motors      for each limit of winches: one for each cable; for torque, power and load of n > dof cables, in N, the
                largest distance that all tensions together can have from the limits between which this limit, those
                above it and those of tensions keep them
    regular     of a platform on n = dof cables: magnitude of the normalised determinant less what counts as singular
    below       of a point mass or a rigid platform on n = dof cables: depth below the spool plane
    contacts    of all bodies that can meet: clearance of their surfaces, `robots.bounds.contact_bounds`
    floor       of a platform, where a floor is given: height above it of the lowest of attachment points, and of the
                corners of its shape, if that is known
"""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from cspr_jax.motion.limits import allowance, limits_set, motor_limits_set
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.robots.cables import BOUNDING, AnyRobot
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.contacts.contact_bodies import contact_pairs, default_scene
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import RIGID, PlatformRobot
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.robots.model.winches import largest_radii
from cspr_jax.robots.statics.wrench_balance import SINGULAR
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.schema.limits import Limit
from cspr_jax.schema.verdicts import Verdict

# Patterns of robots that must stay below their spools.
BELOW = ("2T", "3T", RIGID)
FLAGS = {
    "cables": Verdict.CABLE_CABLE,
    "platform": Verdict.CABLE_PLATFORM,
    "obstacle": Verdict.OBSTACLE,
    "platform-obstacle": Verdict.OBSTACLE,
}
# Flags of criteria that can fail at a single time.
AT_TIMES = (Verdict.SINGULAR, *FLAGS.values())


class CriterionParts(NamedTuple):
    """Criteria that a proof is about, since the family of a motion may have proved the others.

    Fields:
        usual: tensions, poses, and limits but those of winches.
        motors: limits of winches.
        contacts: contacts and the floor.
    """

    usual: bool = True
    motors: bool = True
    contacts: bool = True


ALL = CriterionParts()


class Criterion(NamedTuple):
    """Criterion of a slack.

    Fields:
        flag: flag of verdicts where it fails; for tensions of redundant cables `WRENCH_INFEASIBLE`.
        cables: indices of one cable, of two that meet, or none.
        unit: unit of the slack.
        obstacle: index of the obstacle; None: no obstacle is concerned.
        allowed: smallest or largest value that is allowed.
        sense: whether `allowed` is a lower ("least") or an upper ("most") limit.
        allowance: amount by which the quantity may violate it, since limits may be touched.
    """

    flag: Verdict
    cables: tuple[int, ...]
    unit: str
    obstacle: int | None = None
    allowed: float = 0.0
    sense: Literal["least", "most"] = "least"
    allowance: float = 0.0

    def value(self, slack: float) -> float:
        """Value of the bounded quantity, from its slack."""
        return self.allowed + slack if self.sense == "least" else self.allowed - slack


def criteria(
    robot: AnyRobot, limits: Limits, scene: Scene | None = None, parts: CriterionParts = ALL
) -> list[Criterion]:
    """Criteria, in the order of their slacks."""
    rows: list[Criterion] = []
    if parts.usual:
        rows += _tension_criteria(robot, limits)
        for row in limits_set(limits):
            rows += [] if row.quantity == "tension" else _limit_criteria(robot, limits, row)
    if parts.motors and robot.winches is not None:
        for row in motor_limits_set(limits):
            rows += _motor_criteria(robot, limits, row)
    if parts.usual:
        is_regular, is_below = pose_conditions(robot)
        rows += [Criterion(Verdict.SINGULAR, (), "1", allowed=SINGULAR)] if is_regular else []
        rows += [Criterion(Verdict.ABOVE_SPOOLS, (), "m")] if is_below else []
    return rows + (contact_criteria(robot, limits, scene) if parts.contacts else [])


def _tension_criteria(robot: AnyRobot, limits: Limits) -> list[Criterion]:
    numbers = range(robot.n_cables)
    low, high = (np.broadcast_to(side, robot.n_cables).tolist() for side in tension_range(robot, limits))
    if robot.n_cables > robot.dof:
        # A single slack for all tensions together.
        return [Criterion(Verdict.WRENCH_INFEASIBLE, (), "N", allowance=TOUCHED * min(low))]
    rows = [Criterion(Verdict.SLACK_CABLE, (k,), "N", allowed=low[k], allowance=TOUCHED * low[k]) for k in numbers]
    if limits.tension_max is not None:
        rows += [
            Criterion(Verdict.OVER_TENSION, (k,), "N", allowed=high[k], sense="most", allowance=TOUCHED * high[k])
            for k in numbers
        ]
    return rows


def _limit_criteria(robot: AnyRobot, limits: Limits, row: Limit) -> list[Criterion]:
    values = np.atleast_1d(np.asarray(getattr(limits, row.name), float))
    values = np.broadcast_to(values, robot.n_cables if row.per_cable else 1).tolist()
    cables = [(k,) if row.per_cable else () for k in range(len(values))]
    return [
        Criterion(row.flag, each, row.unit, None, value, row.sense, float(allowance(row, value, robot)))
        for each, value in zip(cables, values, strict=True)
    ]


def _motor_criteria(robot: AnyRobot, limits: Limits, row: Limit) -> list[Criterion]:
    if robot.n_cables == robot.dof or not bounds_tensions(row):
        return _limit_criteria(robot, limits, row)
    # The tension at standstill by which a limit of torque may be exceeded.
    winches: Any = robot.winches
    missed = 0.0
    if row.quantity == "motor_torque":
        each = np.asarray(limits.motor_torque_max) * np.asarray(winches.gear_ratio * winches.efficiency)
        missed = TOUCHED * float(np.min(each / np.asarray(largest_radii(winches))))
    return [Criterion(row.flag, (), "N", allowance=missed)]


def bounds_tensions(row: Limit) -> bool:
    """Tell whether a limit of winches bounds tensions."""
    return row.name in BOUNDING


def levels(rows: Sequence[Criterion]) -> np.ndarray:
    """Slacks above which criteria are met, and below which they fail, (n_criteria,) in their units."""
    return np.array([-row.allowance for row in rows])


def contact_criteria(robot: AnyRobot, limits: Limits, scene: Scene | None = None) -> list[Criterion]:
    """Criteria of contacts and of the floor, the last ones of all."""
    rows, around = [], scene or default_scene(robot)
    for kind, cable, other in contact_pairs(robot, around):
        bodies = [k for k in (cable, other if kind == "cables" else -1) if k >= 0]
        rows.append(Criterion(FLAGS[kind], tuple(bodies), "m", other if FLAGS[kind] == Verdict.OBSTACLE else None))
    if limits.floor is not None and has_extent(robot, around):
        allowed, missed = float(limits.floor), TOUCHED * float(spool_radius(robot))
        rows.append(Criterion(Verdict.BELOW_FLOOR, (), "m", allowed=allowed, sense="most", allowance=missed))
    return rows


def has_extent(robot: AnyRobot, scene: Scene) -> bool:
    """Tell whether points of a robot other than its mass centre must be above a floor."""
    return isinstance(robot, PlatformRobot) or scene.body is not None


def pose_conditions(robot: AnyRobot) -> tuple[bool, bool]:
    """Tell whether poses must be regular, and below the spools."""
    is_determined = robot.n_cables == robot.dof
    return is_determined and PATTERNS[robot.pattern].is_body, is_determined and robot.pattern in BELOW
