"""Reach of cable-suspended parallel robots in motion: feasible trajectories, maps, margins.

Importing the package loads nothing heavy: each public name is loaded when it is first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cspr_jax.api.accelerations import available_accelerations as available_accelerations
    from cspr_jax.api.beziers import bezier as bezier
    from cspr_jax.api.beziers import bezier_durations as bezier_durations
    from cspr_jax.api.beziers import bezier_verdicts as bezier_verdicts
    from cspr_jax.api.examples import copy_examples as copy_examples
    from cspr_jax.api.examples import list_examples as list_examples
    from cspr_jax.api.imports import ImportedRobot as ImportedRobot
    from cspr_jax.api.imports import import_robot as import_robot
    from cspr_jax.api.launches import launch_range as launch_range
    from cspr_jax.api.lines import least_time as least_time
    from cspr_jax.api.lines import straight_line as straight_line
    from cspr_jax.api.lists import list_quantities as list_quantities
    from cspr_jax.api.lists import list_robots as list_robots
    from cspr_jax.api.motions import amplitude as amplitude
    from cspr_jax.api.motions import hypocycloid as hypocycloid
    from cspr_jax.api.motions import make_problem as make_problem
    from cspr_jax.api.motions import platform_motion as platform_motion
    from cspr_jax.api.motions import sampled_margin as sampled_margin
    from cspr_jax.api.motions import slacks as slacks
    from cspr_jax.api.motions import tensions as tensions
    from cspr_jax.api.motions import transition as transition
    from cspr_jax.api.pictures import plot as plot
    from cspr_jax.api.plans import plan as plan
    from cspr_jax.api.platform_searches import accessible as accessible
    from cspr_jax.api.platform_searches import attainable as attainable
    from cspr_jax.api.platform_searches import minimum_pose_arcs as minimum_pose_arcs
    from cspr_jax.api.replays import Replay as Replay
    from cspr_jax.api.replays import replay as replay
    from cspr_jax.api.reports import report as report
    from cspr_jax.api.robots import load_robot as load_robot
    from cspr_jax.api.robots import parallel_pair_robot as parallel_pair_robot
    from cspr_jax.api.robots import platform as platform
    from cspr_jax.api.robots import point_mass as point_mass
    from cspr_jax.api.robots import point_mass_robot as point_mass_robot
    from cspr_jax.api.robots import three_cable_equivalent as three_cable_equivalent
    from cspr_jax.api.robots import with_cables as with_cables
    from cspr_jax.api.runs import keep_compiled_code as keep_compiled_code
    from cspr_jax.api.runs import open_result as open_result
    from cspr_jax.api.runs import status as status
    from cspr_jax.api.runs import verify as verify
    from cspr_jax.api.searches import minimum_arcs as minimum_arcs
    from cspr_jax.api.searches import minimum_oscillations as minimum_oscillations
    from cspr_jax.api.sensitivities import encoder_error as encoder_error
    from cspr_jax.api.sensitivities import sensitivity as sensitivity
    from cspr_jax.api.speed import benchmark as benchmark
    from cspr_jax.api.sweeps import compute as compute
    from cspr_jax.api.sweeps import run as run
    from cspr_jax.api.tables import table as table
    from cspr_jax.api.tables import table_names as table_names
    from cspr_jax.api.templates import new_file as new_file
    from cspr_jax.api.volumes import WorkspaceVolume as WorkspaceVolume
    from cspr_jax.api.volumes import workspace_volume as workspace_volume
    from cspr_jax.api.workspaces import workspace as workspace
    from cspr_jax.beziers.landings import LaunchErrors
    from cspr_jax.robots.limits import Limits as Limits
    from cspr_jax.robots.limits import Uncertainty as Uncertainty
    from cspr_jax.schema.verdicts import Verdict as Verdict

__version__ = "0.1.0"

_PUBLIC = {
    "ImportedRobot": ("cspr_jax.api.imports", "ImportedRobot"),
    "LaunchErrors": ("cspr_jax.beziers.landings", "LaunchErrors"),
    "Limits": ("cspr_jax.robots.limits", "Limits"),
    "Replay": ("cspr_jax.api.replays", "Replay"),
    "Uncertainty": ("cspr_jax.robots.limits", "Uncertainty"),
    "Verdict": ("cspr_jax.schema.verdicts", "Verdict"),
    "WorkspaceVolume": ("cspr_jax.api.volumes", "WorkspaceVolume"),
    "accessible": ("cspr_jax.api.platform_searches", "accessible"),
    "amplitude": ("cspr_jax.api.motions", "amplitude"),
    "attainable": ("cspr_jax.api.platform_searches", "attainable"),
    "available_accelerations": ("cspr_jax.api.accelerations", "available_accelerations"),
    "benchmark": ("cspr_jax.api.speed", "benchmark"),
    "bezier": ("cspr_jax.api.beziers", "bezier"),
    "bezier_durations": ("cspr_jax.api.beziers", "bezier_durations"),
    "bezier_verdicts": ("cspr_jax.api.beziers", "bezier_verdicts"),
    "compute": ("cspr_jax.api.sweeps", "compute"),
    "copy_examples": ("cspr_jax.api.examples", "copy_examples"),
    "encoder_error": ("cspr_jax.api.sensitivities", "encoder_error"),
    "hypocycloid": ("cspr_jax.api.motions", "hypocycloid"),
    "import_robot": ("cspr_jax.api.imports", "import_robot"),
    "keep_compiled_code": ("cspr_jax.api.runs", "keep_compiled_code"),
    "launch_range": ("cspr_jax.api.launches", "launch_range"),
    "least_time": ("cspr_jax.api.lines", "least_time"),
    "list_examples": ("cspr_jax.api.examples", "list_examples"),
    "list_quantities": ("cspr_jax.api.lists", "list_quantities"),
    "list_robots": ("cspr_jax.api.lists", "list_robots"),
    "load_robot": ("cspr_jax.api.robots", "load_robot"),
    "make_problem": ("cspr_jax.api.motions", "make_problem"),
    "minimum_arcs": ("cspr_jax.api.searches", "minimum_arcs"),
    "minimum_oscillations": ("cspr_jax.api.searches", "minimum_oscillations"),
    "minimum_pose_arcs": ("cspr_jax.api.platform_searches", "minimum_pose_arcs"),
    "new_file": ("cspr_jax.api.templates", "new_file"),
    "open_result": ("cspr_jax.api.runs", "open_result"),
    "parallel_pair_robot": ("cspr_jax.api.robots", "parallel_pair_robot"),
    "plan": ("cspr_jax.api.plans", "plan"),
    "platform": ("cspr_jax.api.robots", "platform"),
    "platform_motion": ("cspr_jax.api.motions", "platform_motion"),
    "plot": ("cspr_jax.api.pictures", "plot"),
    "point_mass": ("cspr_jax.api.robots", "point_mass"),
    "point_mass_robot": ("cspr_jax.api.robots", "point_mass_robot"),
    "replay": ("cspr_jax.api.replays", "replay"),
    "report": ("cspr_jax.api.reports", "report"),
    "run": ("cspr_jax.api.sweeps", "run"),
    "sampled_margin": ("cspr_jax.api.motions", "sampled_margin"),
    "sensitivity": ("cspr_jax.api.sensitivities", "sensitivity"),
    "slacks": ("cspr_jax.api.motions", "slacks"),
    "status": ("cspr_jax.api.runs", "status"),
    "straight_line": ("cspr_jax.api.lines", "straight_line"),
    "table": ("cspr_jax.api.tables", "table"),
    "table_names": ("cspr_jax.api.tables", "table_names"),
    "tensions": ("cspr_jax.api.motions", "tensions"),
    "three_cable_equivalent": ("cspr_jax.api.robots", "three_cable_equivalent"),
    "transition": ("cspr_jax.api.motions", "transition"),
    "verify": ("cspr_jax.api.runs", "verify"),
    "with_cables": ("cspr_jax.api.robots", "with_cables"),
    "workspace": ("cspr_jax.api.workspaces", "workspace"),
    "workspace_volume": ("cspr_jax.api.volumes", "workspace_volume"),
}
__all__ = [  # as `_PUBLIC`, for those that read it without running it
    "ImportedRobot",
    "LaunchErrors",
    "Limits",
    "Replay",
    "Uncertainty",
    "Verdict",
    "WorkspaceVolume",
    "accessible",
    "amplitude",
    "attainable",
    "available_accelerations",
    "benchmark",
    "bezier",
    "bezier_durations",
    "bezier_verdicts",
    "compute",
    "copy_examples",
    "encoder_error",
    "hypocycloid",
    "import_robot",
    "keep_compiled_code",
    "launch_range",
    "least_time",
    "list_examples",
    "list_quantities",
    "list_robots",
    "load_robot",
    "make_problem",
    "minimum_arcs",
    "minimum_oscillations",
    "minimum_pose_arcs",
    "new_file",
    "open_result",
    "parallel_pair_robot",
    "plan",
    "platform",
    "platform_motion",
    "plot",
    "point_mass",
    "point_mass_robot",
    "replay",
    "report",
    "run",
    "sampled_margin",
    "sensitivity",
    "slacks",
    "status",
    "straight_line",
    "table",
    "table_names",
    "tensions",
    "three_cable_equivalent",
    "transition",
    "verify",
    "with_cables",
    "workspace",
    "workspace_volume",
]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _PUBLIC[name]
    return getattr(importlib.import_module(module), attribute)


def __dir__() -> list[str]:
    """Names that completion offers: the public ones, loaded or not."""
    return sorted({*globals(), *__all__})
