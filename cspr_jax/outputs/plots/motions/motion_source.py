"""Robot and plan of a motion, from its file or another one, for pictures that need more than its rows."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.missing_cables import without_cables
from cspr_jax.config.motions.table import Z_AXES
from cspr_jax.config.plan import PlanFile, checked_plan, plan_of_text, read_plan
from cspr_jax.config.reading import checked, json_text, read_text
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.outputs.plots.robots.robot_along import moving
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.identity import canonical_json
from cspr_jax.store.reading.result import Result

# Largest difference between cable lengths in a table and those of the robot in the same poses, over the longest one.
SAME_LENGTH = 1e-6


def keeps_plan(result: Result) -> bool:
    """Tell whether a motion has its robot and its plan."""
    return bool(result.attributes.get("robot_settings") and result.attributes.get("plan"))


def completed(
    result: Result, file: str, *, plan: Path | None, robot: dict[str, Any] | None, z_axis: str | None
) -> Result:
    """A motion in CSV, which contains neither robot nor axes, completed by a given plan or robot."""
    if plan is not None:
        return with_plan(result, file, plan)
    if robot is not None:
        return with_robot(result, file, robot)
    if z_axis is None:
        return result
    _refuse_kept("--z-axis", z_axis, result, file)
    if z_axis not in Z_AXES:
        raise ConfigError("--z-axis", f"{shown(z_axis)}: must be {either(Z_AXES)}")
    return dataclasses.replace(result, attributes=result.attributes | {"z_axis": z_axis})


def with_plan(result: Result, file: str, path: Path) -> Result:
    """A motion without robot and plan, completed by those of a plan file."""
    _refuse_kept("--plan", str(path), result, file)
    text = read_text(path)
    plan_file = read_plan(text, path)
    legs_of = [FAMILIES[name].legs for name in plan_file.families]
    robot_file = resolve_robot(plan_file.robot, path, path.parent, plan_file.parameters, plan_file.parameter)
    robot_file = as_moved(robot_file, legs_of, plan_file.without, path)
    others = {"family": plan_file.family} | ({"z0": plan_file.z0} if isinstance(plan_file.z0, float) else {})
    return _with_robot_file(result, file, robot_file, path, others | {"plan": text})


def with_robot(result: Result, file: str, spec: dict[str, Any]) -> Result:
    """A motion without robot and plan, completed by a robot and a plan that takes the motion from its file."""
    robot = spec["robot"]
    _refuse_kept("--robot", robot if isinstance(robot, str) else robot["name"], result, file)
    plan = checked_plan(spec, "--robot")
    robot_file = without_cables(resolve_robot(plan.robot, "--robot", Path(), plan.parameters), plan.without, "--robot")
    # For a platform that only translates, motion files have the cables of the equivalent point mass.
    robot_file = robot_file.equivalent() if "tension_each" in result.data else robot_file
    return _with_robot_file(result, file, robot_file, "--robot", {"plan": json_text(spec)})


def _refuse_kept(option: str, words: str, result: Result, file: str) -> None:
    if result.is_map or keeps_plan(result):
        raise ConfigError(option, f"{words}: cannot be combined with {file}, which keeps what it was made of")


def _with_robot_file(
    result: Result, file: str, robot_file: RobotFile, source: object, others: dict[str, Any]
) -> Result:
    _check_cables(result, file, robot_file, source)
    attributes = {
        "robot": robot_file.name,
        "robot_settings": canonical_json(robot_file.settings),
        "base_points": np.asarray(robot_file.base_points, float),
        "mass": robot_file.mass,
        "z_axis": robot_file.z_axis,
    }
    return dataclasses.replace(result, attributes=result.attributes | attributes | others)


def _check_cables(result: Result, file: str, robot_file: RobotFile, path: object) -> None:
    # Check that cable lengths are those of this robot in these poses; for cables over pulleys check their number alone.
    count = result.data["tension"].shape[1]
    if len(robot_file.base_points) != count:
        raise ConfigError(
            path, f"its robot {robot_file.name} has {len(robot_file.base_points)} cables: {file} has {count}"
        )
    if robot_file.is_platform is not ("quaternion" in result.data):
        raise ConfigError(path, f"its robot {robot_file.name} and {file}: must both turn, or both be point masses")
    if robot_file.pulley_radius is None and "length" in result.data:
        robot, length = moving(result.data, robot_file, np.arange(len(result.axes["t"]))), result.data["length"]
        gap = np.abs(np.linalg.norm(robot.attached - robot.base, axis=2) - length)
        row, cable = np.unravel_index(gap.argmax(), gap.shape)
        if gap[row, cable] > SAME_LENGTH * length.max():
            error = f"cable {cable + 1} is {length[row, cable]:.6g} m long at t = {result.axes['t'][row]:.6g} s"
            raise ConfigError(path, f"its robot {robot_file.name} is not that of {file}, where {error}")


def robot_and_plan(result: Result, file: str, quantity: str) -> tuple[RobotFile, PlanFile]:
    """Robot and plan of a motion."""
    if not keeps_plan(result):
        error = f'"{quantity}" of a motion that keeps no robot and no plan'
        allowed = "must have its plan, --plan FILE.toml, or its robot, --robot, or be an HDF5 file of `cspr plan -o`"
        raise InputError("--quantity", quantity, allowed, problem=error)
    settings, text = (str(result.attributes[name]) for name in ("robot_settings", "plan"))
    # The settings were checked when the file was read.
    plan = plan_of_text(text, Path(file))
    robot_file = without_cables(checked(RobotFile, json.loads(settings), file), plan.without, file)
    return robot_file.equivalent() if robot_file.translation_only else robot_file, plan
