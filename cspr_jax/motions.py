"""A plan's motion as rows over time: CSV or HDF5."""

import csv
import io
from pathlib import Path

import h5py
import jax
import numpy as np

from cspr_jax import tensions
from cspr_jax.errors import ConfigError
from cspr_jax.planning import Plan
from cspr_jax.problem import axis_signs
from cspr_jax.quantities import TRAJECTORY
from cspr_jax.store.disk import Disk
from cspr_jax.store.netcdf import new_hdf5, set_attributes
from cspr_jax.store.publishing import publish
from cspr_jax.trajectories import hypocycloid

# Those of the states that change sign when time runs backwards: velocity and rates.
_RATES = (1, 4)
_OF_EFFECTOR = ("position", "velocity", "acceleration")
LARGEST_ROWS = 20_000_000


@jax.jit
def _states(shared, segment, arcs, tau):
    def one(t):
        position, velocity, acceleration = hypocycloid.motion(segment, shared.amplitude, arcs, t)
        length, rate, _ = tensions.cable_motion(shared.robot, position, velocity, acceleration)
        return position, velocity, acceleration, length, rate, tensions.tensions(shared.robot, position, acceleration)

    return jax.vmap(one)(tau)


def rows(plan: Plan, *, rate: float | None = None) -> dict[str, np.ndarray]:
    """States along a plan.

    Args:
        plan: the plan.
        rate: rows a second over the whole plan, Hz; None: `samples` rows a segment, ends included.

    Returns:
        "t" (n,) s and the other names of `quantities.TRAJECTORY`, (n, 3) or (n, n_cables), in the plan's axes.
    """
    duration = plan.answers.duration
    starts = np.concatenate([[0.0], np.cumsum(duration)])
    parts = []
    for i, length in enumerate(duration):
        if rate is None:
            tau = np.linspace(0.0, 1.0, plan.keys.samples)
        else:
            ticks = np.arange(np.ceil(starts[i] * rate - 1e-9), np.ceil(starts[i + 1] * rate - 1e-9))
            tau = np.clip((ticks / rate - starts[i]) / length, 0.0, 1.0)
        segment = jax.tree.map(lambda x, i=i: x[i], plan.segments)
        back = bool(plan.backwards[i])
        states = _states(plan.shared, segment, float(plan.answers.tried_arcs[i]), 1.0 - tau if back else tau)
        states = (-np.asarray(s) if back and k in _RATES else np.asarray(s) for k, s in enumerate(states))
        parts.append((starts[i] + tau * length, *states))
    found = {name: np.concatenate(column) for name, column in zip(TRAJECTORY, zip(*parts, strict=True), strict=True)}
    for name in _OF_EFFECTOR:
        found[name] = found[name] * axis_signs(plan.spec)
    return found


def write_rows(plan: Plan, path: Path, *, rate: float | None = None) -> None:
    """Write the motion of a plan to a .csv or .h5 file.

    Args:
        plan: the plan.
        path: its ending says which.
        rate: rows a second, Hz, or None.

    Raises:
        ConfigError: another ending, or too many rows.
        StoreError: the disk or the folder refuses.
    """
    if rate is not None and rate * plan.answers.duration.sum() > LARGEST_ROWS:
        raise ConfigError("--rate", f"{rate:g} Hz: must give at most {LARGEST_ROWS} rows")
    if rate is None and plan.keys.samples * len(plan.answers.duration) > LARGEST_ROWS:
        raise ConfigError("samples", f"{plan.keys.samples}: must give at most {LARGEST_ROWS} rows in all")
    found = rows(plan, rate=rate)
    if path.suffix == ".csv":
        publish(Disk(), path, _csv(found).encode())
    else:
        _write_hdf5(plan, path, found)


def _csv(found: dict[str, np.ndarray]) -> str:
    heads = ["t"]
    for name in list(TRAJECTORY)[1:]:
        parts = "xyz" if name in _OF_EFFECTOR else range(1, found[name].shape[1] + 1)
        heads += [f"{name}_{part}" for part in parts]
    table = np.column_stack([found[name] for name in TRAJECTORY])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    writer.writerows([[repr(float(value)) for value in row] for row in table])
    return text.getvalue()


def _write_hdf5(plan: Plan, path: Path, found: dict[str, np.ndarray]) -> None:
    spec = plan.spec
    attributes = {"Conventions": "CF-1.11", "robot": spec.name, "mass": spec.mass, "z_axis": spec.z_axis, "z0": plan.z0}
    cables = list(range(1, found["tension"].shape[1] + 1))
    with new_hdf5(path, attributes) as file:
        for name, labels in (("t", found["t"]), ("axis", list("xyz")), ("cable", cables)):
            file[name] = labels
            file[name].make_scale(name)
        for name, quantity in TRAJECTORY.items():
            data: h5py.Dataset = file[name] if name in file else file.create_dataset(name, data=found[name])
            set_attributes(data, {"units": quantity.units, "long_name": quantity.long_name})
            if name != "t":
                data.dims[0].attach_scale(file["t"])
                data.dims[1].attach_scale(file["axis" if name in _OF_EFFECTOR else "cable"])
