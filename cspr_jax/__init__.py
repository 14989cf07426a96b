"""What a cable-suspended parallel robot can reach when it swings, and how.

Importing the package loads nothing heavy: each public name is loaded when it is first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cspr_jax.api.examples import copy_examples as copy_examples
    from cspr_jax.api.examples import list_examples as list_examples
    from cspr_jax.api.lists import list_quantities as list_quantities
    from cspr_jax.api.lists import list_robots as list_robots
    from cspr_jax.api.pictures import plot as plot
    from cspr_jax.api.plans import plan as plan
    from cspr_jax.api.runs import status as status
    from cspr_jax.api.runs import verify as verify
    from cspr_jax.api.searches import minimum_arcs as minimum_arcs
    from cspr_jax.api.speed import benchmark as benchmark
    from cspr_jax.api.sweeps import compute as compute
    from cspr_jax.api.sweeps import run as run
    from cspr_jax.api.tables import table as table
    from cspr_jax.api.tables import table_names as table_names
    from cspr_jax.problem import load_robot as load_robot
    from cspr_jax.robots.limits import Limits as Limits
    from cspr_jax.robots.point_mass import point_mass_robot as point_mass_robot
    from cspr_jax.runtime.xla import keep_compiled_code as keep_compiled_code
    from cspr_jax.schema.verdicts import Verdict as Verdict
    from cspr_jax.store.result import open_result as open_result
    from cspr_jax.trajectories.amplitudes import named as amplitude

__version__ = "0.1.0"

_PUBLIC = {
    "Limits": ("cspr_jax.robots.limits", "Limits"),
    "Verdict": ("cspr_jax.schema.verdicts", "Verdict"),
    "amplitude": ("cspr_jax.trajectories.amplitudes", "named"),
    "benchmark": ("cspr_jax.api.speed", "benchmark"),
    "compute": ("cspr_jax.api.sweeps", "compute"),
    "copy_examples": ("cspr_jax.api.examples", "copy_examples"),
    "keep_compiled_code": ("cspr_jax.runtime.xla", "keep_compiled_code"),
    "list_examples": ("cspr_jax.api.examples", "list_examples"),
    "list_quantities": ("cspr_jax.api.lists", "list_quantities"),
    "list_robots": ("cspr_jax.api.lists", "list_robots"),
    "load_robot": ("cspr_jax.problem", "load_robot"),
    "minimum_arcs": ("cspr_jax.api.searches", "minimum_arcs"),
    "open_result": ("cspr_jax.store.result", "open_result"),
    "plan": ("cspr_jax.api.plans", "plan"),
    "plot": ("cspr_jax.api.pictures", "plot"),
    "point_mass_robot": ("cspr_jax.robots.point_mass", "point_mass_robot"),
    "run": ("cspr_jax.api.sweeps", "run"),
    "status": ("cspr_jax.api.runs", "status"),
    "table": ("cspr_jax.api.tables", "table"),
    "table_names": ("cspr_jax.api.tables", "table_names"),
    "verify": ("cspr_jax.api.runs", "verify"),
}
__all__ = [
    "Limits",
    "Verdict",
    "amplitude",
    "benchmark",
    "compute",
    "copy_examples",
    "keep_compiled_code",
    "list_examples",
    "list_quantities",
    "list_robots",
    "load_robot",
    "minimum_arcs",
    "open_result",
    "plan",
    "plot",
    "point_mass_robot",
    "run",
    "status",
    "table",
    "table_names",
    "verify",
]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _PUBLIC[name]
    return getattr(importlib.import_module(module), attribute)
