"""Conditions of a map of a workspace, in words."""

import numpy as np

from cspr_jax.config.keys.workspace import WorkspaceTable
from cspr_jax.config.robot import RobotFile
from cspr_jax.outputs.plots.robots.robot_at import robot_of, workspace_of
from cspr_jax.outputs.plots.style.fixed_axes import table
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.store.reading.result import Result

# Margins of the conditions of a workspace, in words: a pose is inside where all requested margins are positive.
MARGINS = {
    "static": "wrench_margin",
    "wrench-feasible": "wrench_margin",
    "wrench-closure": "closure_margin",
    "interference-free": "clearance",
}
# Words for cells with a positive margin that are not in the workspace.
EXCLUDED = "excluded by other conditions"
SETS = {"maximum": "some", "inclusion": "some", "dextrous": "every", "total": "every"}


def is_workspace(result: Result) -> bool:
    """Tell whether a result is a map of a workspace with its verdicts."""
    return result.attributes.get("map") == "workspace" and "verdict" in result.data


def condition_phrases(result: Result) -> list[str]:
    """Phrase for the title of a map that names its conditions."""
    return [conditions(result)] if is_workspace(result) and result.settings else []


def shown_first(result: Result) -> str:
    """The quantity of a map that a picture shows by default."""
    pictured = [name for name in MAP_KINDS[result.attributes["map"]].pictured if name in result.data]
    if is_workspace(result) and len({MARGINS[name] for name in workspace_of(result).conditions}) > 1:
        return "verdict"
    names = [*pictured, *result.data]
    # Skip margins that were not requested.
    return next((name for name in names if not np.isnan(result.data[name]).all()), names[0])


def is_margin(result: Result, name: str) -> bool:
    """Tell whether a quantity is the margin of one condition of a workspace, positive inside."""
    return is_workspace(result) and name.endswith(("_margin", "clearance"))


def excluded(result: Result, name: str) -> np.ndarray:
    """Cells that a margin of a workspace counts as inside, but other conditions exclude."""
    data = result.data[name]
    if not is_margin(result, name):
        return np.zeros(data.shape, bool)
    return (data > 0.0) & (result.data["verdict"] != 0)


def conditions(result: Result) -> str:
    """Conditions that the poses of a map of a workspace have to meet."""
    workspace, limits, robot = workspace_of(result), table(result.settings, "limits"), robot_of(result)
    words = []
    for name in workspace.conditions:
        words.append(name + (f" {_tensions(limits, robot)}" if name == "wrench-feasible" else ""))
    words += _wrenches(workspace)
    for key, text in (("floor", "floor at z = {} m"), ("cable_length_max", "cables up to {} m")):
        bound = limits.get(key, getattr(robot, key, None))
        if bound is not None:
            words.append(text.format(_numbers(bound)))
    if workspace.speed is not None or workspace.angular_speed is not None:
        speeds = ((workspace.speed, "m/s"), (workspace.angular_speed, "rad/s"))
        words.append("moving at up to " + " and ".join(f"{value:.4g} {unit}" for value, unit in speeds if value))
    if workspace.obstacle:
        words.append("one obstacle" if len(workspace.obstacle) == 1 else f"{len(workspace.obstacle)} obstacles")
    return ", ".join(words + _orientations(workspace))


def _tensions(limits: dict, robot: RobotFile) -> str:
    low, high = (limits.get(name, getattr(robot, name)) for name in ("tension_min", "tension_max"))
    minimum = _numbers(0.0 if low is None else low)
    if high is None or not np.isfinite(high).any():
        return f"above {minimum} N"
    return f"{minimum} to {_numbers(high)} N"


def _numbers(limit) -> str:
    # Write one number if it is the same for all cables, else the range of their numbers.
    low, high = np.min(limit), np.max(limit)
    return f"{low:.4g}" if low == high else f"{low:.4g} .. {high:.4g}"


def _wrenches(workspace: WorkspaceTable) -> list[str]:
    words = []
    if workspace.wrenches is not None:
        words.append("one wrench" if len(workspace.wrenches) == 1 else f"{len(workspace.wrenches)} wrenches")
    for name, text in (("wrench_box", "box"), ("wrench_ellipsoid", "ellipsoid")):
        sizes = getattr(workspace, name)
        if sizes is not None:
            words.append(f"{text} of wrenches ±({', '.join(f'{number:.4g}' for number in sizes)})")
    if workspace.acceleration is not None:
        words.append(f"accelerations up to {workspace.acceleration:.4g} m/s²")
    return words


def _orientations(workspace: WorkspaceTable) -> list[str]:
    words = []
    if workspace.orientations is not None:
        text = SETS[workspace.orientations]
        if workspace.quaternions is not None:
            text += f" one of {len(workspace.quaternions)} orientations"
        elif workspace.tilt_max is not None:
            text += f" tilt up to {np.degrees(workspace.tilt_max):.4g}°"
            text += f" with torsion up to {np.degrees(workspace.torsion_max):.4g}°" if workspace.torsion_max else ""
        else:
            text += " orientation"
        words.append(text)
    if workspace.orientation is not None:
        words.append(f"orientation ({', '.join(f'{part:.3g}' for part in workspace.orientation)})")
    return words
