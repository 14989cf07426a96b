"""Reach of cable-suspended parallel robots in motion: feasible trajectories, maps, margins.

Importing the package loads nothing heavy: each public name is loaded when it is first used. Type checkers and editors
read `__init__.pyi`.
"""

import importlib
import sys
from typing import Any

__version__ = "0.2.0"

# The module below the package that holds each public name.
_MODULES = {
    "ImportedRobot": "api.files.imports",
    "LaunchErrors": "launch.landings",
    "Limits": "robots.model.limits",
    "Replay": "api.files.replays",
    "Simulation": "api.files.simulations",
    "Stops": "api.stops",
    "Uncertainty": "robots.model.limits",
    "Verdict": "schema.verdicts",
    "WorkspaceVolume": "outputs.volumes",
    "accessible": "api.families.platform_searches",
    "amplitude": "api.families.motions",
    "anchors": "api.files.anchors",
    "attainable": "api.families.platform_searches",
    "available_accelerations": "api.workspaces",
    "benchmark": "api.files.published",
    "bezier": "api.families.beziers",
    "bezier_durations": "api.families.beziers",
    "bezier_verdicts": "api.families.beziers",
    "calibrate": "api.calibration",
    "check": "api.checks",
    "check_many": "api.many_checks",
    "compare_log": "api.files.logs",
    "compute_sweep": "api.sweeps",
    "copy_examples": "api.files.listings",
    "design": "api.designs",
    "ellipse": "api.families.ellipses",
    "ellipse_frequencies": "api.families.ellipses",
    "ellipse_margin": "api.differentiable",
    "ellipse_margins": "api.families.ellipses",
    "encoder_error": "api.workspaces",
    "forward": "api.forward_kinematics",
    "hypocycloid": "api.families.motions",
    "import_robot": "api.files.imports",
    "keep_compiled_code": "api.sweeps",
    "launch_range": "api.families.beziers",
    "least_time": "api.families.lines",
    "least_time_paths": "api.families.paths",
    "list_examples": "api.files.listings",
    "list_quantities": "api.files.listings",
    "list_robots": "api.files.listings",
    "list_tables": "api.files.published",
    "load_robot": "api.robots",
    "make_problem": "api.families.motions",
    "merge": "api.sweeps",
    "minimum_arcs": "api.families.searches",
    "minimum_oscillations": "api.families.searches",
    "minimum_pose_arcs": "api.families.platform_searches",
    "new_file": "api.files.listings",
    "natural_frequencies": "api.elasticity",
    "open_result": "api.sweeps",
    "parallel_pair_robot": "api.robots",
    "plan": "api.plans",
    "platform": "api.robots",
    "platform_motion": "api.families.motions",
    "plot": "api.files.pictures",
    "point_mass": "api.robots",
    "point_mass_robot": "api.robots",
    "pose_frequencies": "api.differentiable",
    "pose_lengths": "api.differentiable",
    "pose_margin": "api.differentiable",
    "pose_tensions": "api.differentiable",
    "pose_wrench_matrix": "api.differentiable",
    "replay": "api.files.replays",
    "replay_elastic": "api.files.replays",
    "report": "api.files.reports",
    "retime": "api.retiming",
    "run": "api.sweeps",
    "sampled_margin": "api.families.motions",
    "sensitivity": "api.workspaces",
    "simulate": "api.files.simulations",
    "size": "api.sizing",
    "slacks": "api.families.motions",
    "spline": "api.families.motions",
    "status": "api.sweeps",
    "stiffness": "api.elasticity",
    "stops": "api.stops",
    "straight_line": "api.families.lines",
    "swing_range": "api.families.swing_ranges",
    "table": "api.files.published",
    "tensions": "api.families.motions",
    "three_cable_equivalent": "api.robots",
    "transition": "api.families.motions",
    "verify": "api.sweeps",
    "verify_certificate": "api.certificates",
    "with_cables": "api.robots",
    "workspace": "api.workspaces",
    "workspace_volume": "api.sweeps",
}
# Names that programs still use for these.
_ALIASES = {"compute": "compute_sweep", "table_names": "list_tables"}
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    attribute = _ALIASES.get(name, name)
    if attribute not in _MODULES:
        # With these two, Python itself asks whether a name of `__dir__` was meant.
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name, obj=sys.modules[__name__])
    return getattr(importlib.import_module(f"cspr_jax.{_MODULES[attribute]}"), attribute)


def __dir__() -> list[str]:
    """Names that completion offers: the public ones, loaded or not."""
    return sorted({*globals(), *__all__})
