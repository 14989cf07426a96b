"""Anchors of robots for firmware from Python, as `cspr anchors` prints them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors.arguments import Point
from cspr_jax.outputs.machine.firmware_anchors import FIRMWARE, anchors_of


@checked()
def anchors(
    reference: str | Path,
    *,
    firmware: Literal["hangprinter", "klipper"] = "hangprinter",
    origin: Point = (0.0, 0.0, 0.0),
) -> list[str]:
    """Write the anchors and drums of a robot as lines for the firmware of its controller.

    Args:
        reference: the name of a robot of the catalogue, or the path of a robot file.
        firmware: "hangprinter", lines M669 and M666 for RepRapFirmware, or "klipper", sections of its kinematics winch.
        origin: point at which the machine is homed, in the axes of the robot file, m.

    Returns:
        the lines, in mm, z up, from that point; comments say what the firmware cannot hold.

    Raises:
        ConfigError: a mistake in the file, a robot that does not move in space, or too many cables.
    """
    robot_file = resolve_robot(str(reference), Path("robot"), Path())
    return FIRMWARE[firmware](anchors_of(robot_file, np.asarray(origin, float).tolist()))
