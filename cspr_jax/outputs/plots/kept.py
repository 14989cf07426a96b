"""Robot and plan that a motion file keeps, for pictures that need more than its rows."""

import json
from pathlib import Path

from cspr_jax.config.plan import PlanFile, kept_plan
from cspr_jax.config.reading import checked
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError
from cspr_jax.store.result import Result


def kept(result: Result, file: str, quantity: str) -> tuple[RobotFile, PlanFile]:
    """Robot and plan of a motion.

    Args:
        result: the motion.
        file: its name, for errors.
        quantity: that is asked for, for errors.

    Returns:
        the robot that was planned, and the plan.

    Raises:
        InputError: the file keeps none, as those of earlier versions.
        ConfigError: a mistake in the plan.
    """
    settings, text = (result.attributes.get(name) for name in ("robot_settings", "plan"))
    if not settings or not text:
        fault = f'"{quantity}" of a motion that keeps no robot and no plan'
        raise InputError("--quantity", quantity, "must be of one that `cspr plan -o` writes now", fault=fault)
    # The settings were checked when the file was read.
    spec = checked(RobotFile, json.loads(settings), file)
    return spec.equivalent() if spec.translation_only else spec, kept_plan(text, Path(file))
