"""Plan of a single cell of a map: the motion whose verdict, duration and margins the cell holds."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cspr_jax.config.keys.ellipse import SweepEllipse, cell_axes
from cspr_jax.config.keys.obstacles import ObstacleKeys
from cspr_jax.config.keys.path import SAME_PLACE, TargetPath
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.plan import PlanFile
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.quantities import parameter_values

# Quantities that fix the number of arcs, and how many arcs one unit of each is.
COUNTS = {"arcs": 1, "tried_arcs": 1, "oscillations": 2, "tried_oscillations": 2}
# Axes of an orientation; an axis that a map lacks is 0.
ORIENTATION = ("tilt_azimuth", "tilt", "torsion")


def cell_plan(
    settings: Mapping[str, Any], cell: Mapping[str, float], values: Mapping[str, Any], *, samples: int = 120
) -> dict[str, Any] | None:
    """Plan of the motion of one cell, as in a plan file; None for maps whose cells are no motions."""
    kind = MAP_KINDS[settings["map"]]
    if not kind.planned:
        return None
    shared = TrajectoryKeys.model_fields.keys() & PlanFile.model_fields.keys()
    trajectory = settings.get("trajectory", {})
    trajectory_keys = {name: value for name, value in trajectory.items() if name in shared}
    for key in ("limits", "without"):
        if settings.get(key):
            trajectory_keys[key] = settings[key]
    if parameters := parameter_values(cell):
        trajectory_keys["parameters"] = parameters
    if trajectory.get("family") == "path":
        return _path(settings, cell, {"samples": samples, **trajectory_keys})
    if "ellipse" in kind.takes:
        return _turn(settings, cell, values, {"samples": samples, **trajectory_keys})
    depth = {name: cell[name] for name in ("z0", "inclination") if name in cell}
    if trajectory.get("family") == "free":
        return _free(settings, cell, {"samples": samples, **trajectory_keys, **depth})
    used = float(values.get("used_inclination", np.nan))
    if trajectory_keys.get("inclination") == "best" and np.isfinite(used):
        depth["inclination"] = used
    if kind.is_over_orientations and not depth:
        robot = settings["robot"]
        frame = frame_of(np.asarray(robot["base_points"], float), robot.get("z_axis", "down"))
        depth["z0"] = float(frame.depth(cell["z"]))  # horizontal transitions
    target: dict[str, Any] = {"position": _target(settings, cell)}
    if any(axis in cell for axis in ORIENTATION):
        target["tilt_torsion"] = [float(cell.get(axis, 0.0)) for axis in ORIENTATION]
    if np.isfinite(values.get("beta_hat", np.nan)):
        target["beta_hat"] = float(values["beta_hat"])
    count = next((int(values[name]) * arcs for name, arcs in COUNTS.items() if int(values.get(name, 0)) > 0), 0)
    if count:
        target["arcs"] = count
    plan = {"schema": 1, "robot": settings["robot"], "samples": samples, **trajectory_keys, **depth}
    plan["pose"] = [_start(settings, cell), target]
    return plan | {name: settings[name] for name in ObstacleKeys.model_fields if name in settings}


def _turn(
    settings: Mapping[str, Any], cell: Mapping[str, float], values: Mapping[str, Any], plan_file: Mapping[str, Any]
) -> dict[str, Any] | None:
    # Plan one turn on the ellipse of a cell.
    table = SweepEllipse.model_validate(settings.get("ellipse") or {})
    robot = settings["robot"]
    axes = cell_axes(table, cell, is_planar=bool(robot.get("planar")) or robot.get("pattern") == "2T")
    rule = table.model_dump(mode="json", exclude_none=True)["frequency"]
    frequency = values.get("used_frequency", cell.get("frequency", rule))
    if not isinstance(frequency, str | dict):
        frequency = float(frequency)
        if not (np.isfinite(frequency) and frequency > 0.0):
            return None
    if not np.any(axes):
        return None
    ellipse = {"centre": _target(settings, cell), "half_axes": [axis.tolist() for axis in axes]}
    return {"schema": 1, "robot": robot, **plan_file, "ellipse": {**ellipse, "frequency": frequency}, "turns": 1.0}


def _path(
    settings: Mapping[str, Any], cell: Mapping[str, float], plan_file: Mapping[str, Any]
) -> dict[str, Any] | None:
    # Plan the path to the target of a cell.
    start, end = _start(settings, cell), _target(settings, cell)
    robot, table = settings["robot"], TargetPath.model_validate(settings["trajectory"].get("path") or {})
    path = table.between(start["position"], end, robot.get("z_axis", "down"))
    if path is None:
        return None
    target = {**start, "position": end, "path": path.model_dump(mode="json", exclude_none=True)}
    obstacles = {name: settings[name] for name in ObstacleKeys.model_fields if name in settings}
    return {"schema": 1, "robot": robot, **plan_file, "pose": [start, target], **obstacles}


def _free(
    settings: Mapping[str, Any], cell: Mapping[str, float], plan_file: Mapping[str, Any]
) -> dict[str, Any] | None:
    # Plan the free motion to the target of a cell, which keeps the orientation.
    start, end = _start(settings, cell), _target(settings, cell)
    if "position" in start and math.dist(start["position"], end) <= SAME_PLACE:
        return None
    target = {name: value for name, value in start.items() if name != "rest"} | {"position": end}
    obstacles = {name: settings[name] for name in ObstacleKeys.model_fields if name in settings}
    return {"schema": 1, "robot": settings["robot"], **plan_file, "pose": [start, target], **obstacles}


def _start(settings: Mapping[str, Any], cell: Mapping[str, float]) -> dict[str, Any]:
    start = dict(settings.get("trajectory", {}).get("from") or {})
    if any(f"from_{name}" in cell for name in "xyz"):
        fixed = start.get("position", [0.0, 0.0, 0.0])
        start["position"] = [float(cell.get(f"from_{name}", fixed[i])) for i, name in enumerate("xyz")]
    return start or {"rest": True}


def _target(settings: Mapping[str, Any], cell: Mapping[str, float]) -> list[float]:
    if "radius" not in cell:
        return [float(cell[name]) for name in "xyz"]
    # The azimuth turns about the vertical through the centroid of the spools.
    centre = np.mean(np.asarray(settings["robot"]["base_points"], float), axis=0)
    radius, azimuth = cell["radius"], cell["azimuth"]
    x, y = centre[:2] + radius * np.array([np.cos(azimuth), np.sin(azimuth)])
    return [float(x), float(y), float(cell["z"])]
