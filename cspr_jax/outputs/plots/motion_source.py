"""Robot and plan of a motion, from its file or from one beside it, for pictures that need more than its rows."""

import dataclasses
import json
from pathlib import Path

import numpy as np

from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.plan import PlanFile, kept_plan, read_plan
from cspr_jax.config.reading import checked, read_text
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.outputs.plots.robot_along import moving
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.identity import canonical_json
from cspr_jax.store.result import Result

# Lengths of cables in a table and of the robot in its poses differ by rounding alone, over the longest one.
SAME_LENGTH = 1e-6


def keeps_plan(result: Result) -> bool:
    """Tell whether a motion has its robot and its plan.

    Returns:
        false for tables read without their plan, and for files of earlier versions.
    """
    return bool(result.attributes.get("robot_settings") and result.attributes.get("plan"))


def with_plan(result: Result, file: str, path: Path) -> Result:
    """A motion without robot and plan, with those of a plan file.

    Args:
        file: its name, for errors.

    Returns:
        the motion, with the attributes that an HDF5 file keeps.

    Raises:
        ConfigError: a mistake in the plan, a motion that has a plan or is a map, or one of another robot.
    """
    if result.is_map or keeps_plan(result):
        raise ConfigError("--plan", f"{path}: cannot be combined with {file}, which keeps what it was made of")
    text = read_text(path)
    keys = read_plan(text, path)
    robot_file = as_moved(resolve_robot(keys.robot, path, path.parent), [FAMILIES[name].legs for name in keys.families])
    _check_cables(result, file, robot_file, path)
    attributes = {
        "robot": robot_file.name,
        "robot_settings": canonical_json(robot_file.settings),
        "plan": text,
        "family": keys.family,
        "base_points": np.asarray(robot_file.base_points, float),
        "mass": robot_file.mass,
        "z_axis": robot_file.z_axis,
        **({"z0": keys.z0} if isinstance(keys.z0, float) else {}),
    }
    return dataclasses.replace(result, attributes=result.attributes | attributes)


def _check_cables(result: Result, file: str, robot_file: RobotFile, path: Path) -> None:
    # The lengths must be those of this robot in these poses; for cables over pulleys only their number is known.
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
            fault = f"cable {cable + 1} is {length[row, cable]:.6g} m long at t = {result.axes['t'][row]:.6g} s"
            raise ConfigError(path, f"its robot {robot_file.name} is not that of {file}, where {fault}")


def robot_and_plan(result: Result, file: str, quantity: str) -> tuple[RobotFile, PlanFile]:
    """Robot and plan of a motion.

    Args:
        file: its name, for errors.
        quantity: of the picture, for errors.

    Returns:
        the robot that was planned, and the plan.

    Raises:
        InputError: the file keeps none, as files of earlier versions.
        ConfigError: a mistake in the plan.
    """
    if not keeps_plan(result):
        fault = f'"{quantity}" of a motion that keeps no robot and no plan'
        allowed = "must have its plan beside it, --plan FILE.toml, or be an HDF5 file of `cspr plan -o`"
        raise InputError("--quantity", quantity, allowed, fault=fault)
    settings, text = (str(result.attributes[name]) for name in ("robot_settings", "plan"))
    # The settings were checked when the file was read.
    robot_file = checked(RobotFile, json.loads(settings), file)
    return robot_file.equivalent() if robot_file.translation_only else robot_file, kept_plan(text, Path(file))
