"""Conditions of a map of a workspace, in words."""

import numpy as np

from cspr_jax.config.robot import RobotFile
from cspr_jax.config.workspace import WorkspaceTable
from cspr_jax.outputs.plots.notes import table
from cspr_jax.outputs.plots.posed import asked, robot_of
from cspr_jax.store.result import Result

SETS = {"maximum": "some", "inclusion": "some", "dextrous": "every", "total": "every"}


def conditions(result: Result) -> str:
    """What the poses of a map of a workspace have to meet.

    Args:
        result: the map.

    Returns:
        the conditions with their numbers, and the orientations that they are asked of if the map says which.
    """
    wanted, limits, robot = asked(result), table(result.settings, "limits"), robot_of(result)
    words = []
    for name in wanted.conditions:
        words.append(name + (f" {_tensions(limits, robot)}" if name == "wrench-feasible" else ""))
    words += _wrenches(wanted)
    for key, text in (("floor", "floor at z = {} m"), ("cable_length_max", "cables up to {} m")):
        given = limits.get(key, getattr(robot, key, None))
        if given is not None:
            words.append(text.format(_numbers(given)))
    return ", ".join(words + _orientations(wanted))


def _tensions(limits: dict, robot: RobotFile) -> str:
    low, high = (limits.get(name, getattr(robot, name)) for name in ("tension_min", "tension_max"))
    least = _numbers(0.0 if low is None else low)
    if high is None or not np.isfinite(high).any():
        return f"above {least} N"
    return f"{least} to {_numbers(high)} N"


def _numbers(given) -> str:
    # One for all cables, or the range of theirs.
    low, high = np.min(given), np.max(given)
    return f"{low:.4g}" if low == high else f"{low:.4g} .. {high:.4g}"


def _wrenches(wanted: WorkspaceTable) -> list[str]:
    words = []
    if wanted.wrenches is not None:
        words.append("one wrench" if len(wanted.wrenches) == 1 else f"{len(wanted.wrenches)} wrenches")
    for name, text in (("wrench_box", "box"), ("wrench_ellipsoid", "ellipsoid")):
        sizes = getattr(wanted, name)
        if sizes is not None:
            words.append(f"{text} of wrenches ±({', '.join(f'{size:.4g}' for size in sizes)})")
    if wanted.acceleration is not None:
        words.append(f"accelerations up to {wanted.acceleration:.4g} m/s²")
    return words


def _orientations(wanted: WorkspaceTable) -> list[str]:
    words = []
    if wanted.orientations is not None:
        text = SETS[wanted.orientations]
        if wanted.quaternions is not None:
            text += f" one of {len(wanted.quaternions)} orientations"
        elif wanted.tilt_max is not None:
            text += f" tilt up to {np.degrees(wanted.tilt_max):.4g}°"
            text += f" with torsion up to {np.degrees(wanted.torsion_max):.4g}°" if wanted.torsion_max else ""
        else:
            text += " orientation"
        words.append(text)
    if wanted.orientation is not None:
        words.append(f"orientation ({', '.join(f'{part:.3g}' for part in wanted.orientation)})")
    return words
