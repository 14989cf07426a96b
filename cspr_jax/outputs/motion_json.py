"""Rows of a motion over time as JSON."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.outputs.motion_files import OPEN, SCHEMA, attributes, rows
from cspr_jax.outputs.plan_report import finite
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.schema.quantities import TRAJECTORY
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish

# Attributes of motion files that JSON has in addition to the rows.
BESIDE = ("title", "software", "feasible", "family", "robot", "mass", "z_axis", "point", "z0")


def rows_object(plan: PlannedMotions, rate: float | None) -> dict[str, Any]:
    """The rows of a plan as plain values."""
    columns = rows(plan, rate=rate)
    units = {name: TRAJECTORY[name].units for name in columns}
    return {"units": units, "rows": finite({name: values.tolist() for name, values in columns.items()})}


def write_json(plan: PlannedMotions, path: Path, *, rate: float | None = None) -> None:
    """Write the rows of a plan to a .json file, with their units and attributes of the robot."""
    is_motion = np.isfinite(plan.answers.duration).all()
    fields: dict[str, Any] = rows_object(plan, rate) if is_motion else {"rows": {"t": [None]}}
    if any(None in np.ravel(values) for name, values in fields["rows"].items() if name not in OPEN):
        raise ConfigError(path, "not written: the best candidate's motion is not finite; see its verdict")
    named = attributes(plan)
    beside = {name: named[name] for name in BESIDE if name in named} | {"feasible": plan.feasible}
    text = json.dumps({"schema": SCHEMA, **beside, **fields}, allow_nan=False)
    publish(Disk(), path, f"{text}\n".encode())
