"""What a cable-suspended parallel robot can reach when it swings, and how.

Importing the package loads nothing heavy: each public name is loaded when it is first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cspr_jax.api.files import plan as plan
    from cspr_jax.api.searches import minimum_arcs as minimum_arcs
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
    "keep_compiled_code": ("cspr_jax.runtime.xla", "keep_compiled_code"),
    "load_robot": ("cspr_jax.problem", "load_robot"),
    "minimum_arcs": ("cspr_jax.api.searches", "minimum_arcs"),
    "open_result": ("cspr_jax.store.result", "open_result"),
    "plan": ("cspr_jax.api.files", "plan"),
    "point_mass_robot": ("cspr_jax.robots.point_mass", "point_mass_robot"),
}
__all__ = [
    "Limits",
    "Verdict",
    "amplitude",
    "keep_compiled_code",
    "load_robot",
    "minimum_arcs",
    "open_result",
    "plan",
    "point_mass_robot",
]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _PUBLIC[name]
    return getattr(importlib.import_module(module), attribute)
