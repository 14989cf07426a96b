"""Sequence of a plan: its poses, grouped in legs of one family each."""

from __future__ import annotations

import contextlib
import dataclasses
from pathlib import Path

import numpy as np

from cspr_jax.config.equivalents import no_equivalent
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, shown
from cspr_jax.motion.leg import Leg
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.plans.verified_legs import verified
from cspr_jax.schema.families import FAMILIES, moving
from cspr_jax.schema.limits import LIMITS

POINT_MASS = "3T"


class PlanLegs:
    """Poses of a plan.

    Args:
        path: path of the plan file, named in errors.

    Fields:
        waypoints: all poses.
        legs: in order; each begins where the previous one ends.

    Raises:
        ConfigError: a family cannot join its poses.
    """

    def __init__(self, robot_file: RobotFile, plan_file: PlanFile, path: Path) -> None:
        """Refuse poses without a position, and families that cannot move the robot."""
        _check_families(robot_file, plan_file, path)
        _check_keys(plan_file, path)
        _check_poses(robot_file, plan_file, path)
        frame, last = frame_of(robot_file.base_points, robot_file.z_axis), len(plan_file.pose) - 1
        self.waypoints = Waypoints(robot_file, plan_file, path, frame, plan_file.family, 0, last)
        changes = [i for i in range(1, last) if plan_file.family_of(i) != plan_file.family_of(i - 1)]
        self.legs: list[Leg] = []
        for first, after in zip([0, *changes], [*changes, last], strict=True):
            family = plan_file.family_of(first)
            leg = FAMILIES[family].leg(robot_file.own_pattern)
            plain = leg(Waypoints(robot_file, plan_file, path, frame, family, first, after))
            if FAMILIES[family].is_searched:
                plain.begin_with(_others(plain.waypoints))
            self.legs.append(_verified(plain))

    def table(self, problem: Problem, depths: Float[np.ndarray, "n_depths"]) -> dict[str, np.ndarray]:
        """Feasibility, durations and margins for several depths of P0."""
        answers = [leg.answers(problem, depths) for leg in self.legs]
        return {
            name: np.hstack([getattr(leg_answers, name).reshape(len(depths), -1) for leg_answers in answers])
            for name in ("feasible", "duration", "margin")
        }


def _verified(leg: Leg) -> Leg:
    plan_file, robot_file = leg.waypoints.plan_file, leg.waypoints.robot_file
    return verified(
        leg,
        obstacles=bool(plan_file.obstacle_keys),
        pulleys=robot_file.pulley_radius is not None,
        motors=robot_file.winch is not None
        and any(
            row.of_winch and (getattr(plan_file, row.name) is not None or robot_file.limit(row.name) is not None)
            for row in LIMITS
        ),
    )


def _others(waypoints: Waypoints) -> list[Leg]:
    # Make legs over the same poses from the families whose motions are starting points of searches.
    pattern, legs = waypoints.robot_file.own_pattern, list[Leg]()
    for row in FAMILIES.values():
        if row.begins_searches and pattern in row.legs:
            with contextlib.suppress(ConfigError):  # the family cannot join these poses
                legs.append(_verified(row.leg(pattern).for_searches(dataclasses.replace(waypoints, family=row.name))))
    return legs


def _check_families(robot_file: RobotFile, plan_file: PlanFile, path: Path) -> None:
    for i in range(len(plan_file.pose) - 1):
        family, pose_family = plan_file.family_of(i), plan_file.pose[i + 1].family
        if robot_file.own_pattern in FAMILIES[family].legs:
            continue
        key = "family" if pose_family is None else f"pose[{i + 1}].family"
        names = " or ".join(f'"{name}"' for name in moving(robot_file.own_pattern))
        if not names:
            moved = "it moves robots of the patterns " + ", ".join(FAMILIES[family].legs)
            raise ConfigError(
                path, f'{key} = "{family}": no family moves {robot_file.kind} ("{robot_file.name}") yet: {moved}'
            )
        why = no_equivalent(robot_file) if POINT_MASS in FAMILIES[family].legs else ""
        raise ConfigError(path, f'{key} = "{family}": must be {names} for {robot_file.kind} ("{robot_file.name}"){why}')


def _check_keys(plan_file: PlanFile, path: Path) -> None:
    for key in dict.fromkeys(key for row in FAMILIES.values() for key in row.keys):
        families = [name for name, row in FAMILIES.items() if key in row.keys]
        if getattr(plan_file, key) is not None and not set(plan_file.families) & set(families):
            raise ConfigError(path, f"{key}: must be absent unless family = {either(families)}")


def _check_poses(robot_file: RobotFile, plan_file: PlanFile, path: Path) -> None:
    _check_plane(robot_file, plan_file, path)
    if plan_file.beat is not None and not robot_file.is_platform:
        raise ConfigError(path, f'beat = "{plan_file.beat}": must be absent for {robot_file.kind}')
    for i, pose in enumerate(plan_file.pose):
        _check_pose_keys(plan_file, i, path)
        if pose.position is None and not pose.rest and i not in plan_file.resulting_poses:
            raise ConfigError(path, f"pose[{i}].position is missing: [x, y, z] in m, or rest = true")
        for key in () if robot_file.is_platform else ("tilt_torsion", "quaternion", "beta_hat"):
            if getattr(pose, key) is not None:
                raise ConfigError(path, f"pose[{i}].{key}: must be absent for {robot_file.kind}")
        if robot_file.is_planar and pose.position is not None and pose.position[1] != 0.0:
            raise ConfigError(path, f"pose[{i}].position = {shown(pose.position)}: must have y = 0: a planar robot")


def _check_pose_keys(plan_file: PlanFile, i: int, path: Path) -> None:
    before, after = ({plan_file.family_of(k)} if 0 <= k < len(plan_file.pose) - 1 else set() for k in (i - 1, i))
    for attribute, near, where in (
        ("pose_keys", before, "leads there"),
        ("end_keys", before | after, "leads to it or from it"),
    ):
        for key in dict.fromkeys(key for row in FAMILIES.values() for key in getattr(row, attribute)):
            families = [name for name, row in FAMILIES.items() if key in getattr(row, attribute)]
            if getattr(plan_file.pose[i], key) is not None and not near & set(families):
                raise ConfigError(path, f"pose[{i}].{key}: must be absent unless family = {either(families)} {where}")


def _check_plane(robot_file: RobotFile, plan_file: PlanFile, path: Path) -> None:
    for key, value in plan_file.vectors.items():
        if robot_file.is_planar and value is not None and value[1] != 0.0:
            raise ConfigError(path, f"{key} = {shown(value)}: must have y = 0: a planar robot")
