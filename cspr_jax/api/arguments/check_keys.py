"""Keys of plans from robots and limits that are made in Python."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.config.keys.limits import LimitTable
from cspr_jax.config.keys.obstacles import ObstacleKeys
from cspr_jax.config.reading import plain_values
from cspr_jax.errors import InputError, demand
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.winches import winch_table
from cspr_jax.schema.limits import LIMITS, UNCERTAINTIES

# Errors name this instead of a file if there is no file.
NAME = Path("motion")


def robot_table(robot: AnyRobot) -> dict[str, Any]:
    """Keys of the robot file of a robot made in Python."""
    table: dict[str, Any] = {"name": robot.name or "robot", "pattern": robot.pattern, "z_axis": robot.z_axis}
    table |= {
        name: getattr(robot, name) for name in ("base_points", "mass", "gravity", "cable_diameter", "axial_stiffness")
    }
    if isinstance(robot, PlatformRobot):
        table |= {name: getattr(robot, name) for name in ("platform_points", "inertia", "centre_of_mass")}
        if robot.centre_of_mass is not None and not PATTERNS[robot.pattern].is_jointed:
            table["platform_points"] = np.asarray(robot.platform_points) + np.asarray(robot.centre_of_mass)
    if robot.pulleys is not None:
        table |= {"pulley_radius": robot.pulleys.radius, "pulley_axes": robot.pulleys.axes}
    table |= {row.name: getattr(robot.limits, row.name) for row in LIMITS if row.per_cable and not row.of_winch}
    table["axial_stiffness"] = robot.axial_stiffness
    if robot.winches is not None:
        table["winch"] = winch_table(robot.winches, robot.limits)
    return plain_values(
        {
            key: np.asarray(value) if hasattr(value, "shape") else value
            for key, value in table.items()
            if value is not None
        }
    )


def check_keys(
    robot: AnyRobot | str | Path, limits: Limits | Mapping[str, Any] | None, **settings: Any
) -> dict[str, Any]:
    """Keys of a plan whose motion is to be checked."""
    spec: dict[str, Any] = {"schema": 1, "family": "spline", "motion": str(NAME)}
    spec["robot"] = str(robot) if isinstance(robot, str | Path) else robot_table(robot)
    return spec | {name: value for name, value in settings.items() if value is not None} | _limit_keys(limits)


def _limit_keys(limits: Limits | Mapping[str, Any] | None) -> dict[str, Any]:
    if limits is None or isinstance(limits, Mapping):
        names = [*LimitTable.model_fields, *ObstacleKeys.model_fields]
        for key in (key for key in limits or {} if key not in names):
            allowed = demand("a key of [limits] of a plan, or of what surrounds the robot")
            raise InputError(f"limits[{key!r}]", None, did_you_mean(str(key), names) + allowed, problem="unknown key")
        return plain_values(dict(limits or {}))
    values = {row.name: getattr(limits, row.name) for row in LIMITS}
    numbers = {name: np.asarray(value) for name, value in values.items() if value is not None}
    if limits.uncertainty is None:
        return plain_values(numbers)
    parts = {row.name: np.asarray(getattr(limits.uncertainty, row.name)) for row in UNCERTAINTIES}
    return plain_values({"limits": numbers | {"uncertainty": parts}})
