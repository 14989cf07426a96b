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
    "ImportedRobot": "api.imports",
    "LaunchErrors": "motions.landings",
    "Limits": "robots.limits",
    "Replay": "api.replays",
    "Uncertainty": "robots.limits",
    "Verdict": "schema.verdicts",
    "WorkspaceVolume": "outputs.volumes",
    "accessible": "api.platform_searches",
    "amplitude": "api.motions",
    "attainable": "api.platform_searches",
    "available_accelerations": "api.workspaces",
    "benchmark": "api.published",
    "bezier": "api.beziers",
    "bezier_durations": "api.beziers",
    "bezier_verdicts": "api.beziers",
    "check": "api.checks",
    "check_many": "api.many_checks",
    "compute_sweep": "api.sweeps",
    "copy_examples": "api.listings",
    "ellipse": "api.ellipses",
    "ellipse_frequencies": "api.ellipses",
    "ellipse_margins": "api.ellipses",
    "encoder_error": "api.workspaces",
    "hypocycloid": "api.motions",
    "import_robot": "api.imports",
    "keep_compiled_code": "api.sweeps",
    "launch_range": "api.beziers",
    "least_time": "api.lines",
    "least_time_paths": "api.paths",
    "list_examples": "api.listings",
    "list_quantities": "api.listings",
    "list_robots": "api.listings",
    "list_tables": "api.published",
    "load_robot": "api.robots",
    "make_problem": "api.motions",
    "merge": "api.sweeps",
    "minimum_arcs": "api.searches",
    "minimum_oscillations": "api.searches",
    "minimum_pose_arcs": "api.platform_searches",
    "new_file": "api.listings",
    "open_result": "api.sweeps",
    "parallel_pair_robot": "api.robots",
    "plan": "api.plans",
    "platform": "api.robots",
    "platform_motion": "api.motions",
    "plot": "api.pictures",
    "point_mass": "api.robots",
    "point_mass_robot": "api.robots",
    "replay": "api.replays",
    "report": "api.reports",
    "retime": "api.retiming",
    "run": "api.sweeps",
    "sampled_margin": "api.motions",
    "sensitivity": "api.workspaces",
    "slacks": "api.motions",
    "spline": "api.motions",
    "status": "api.sweeps",
    "straight_line": "api.lines",
    "swing_range": "api.swing_ranges",
    "table": "api.published",
    "tensions": "api.motions",
    "three_cable_equivalent": "api.robots",
    "transition": "api.motions",
    "verify": "api.sweeps",
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
