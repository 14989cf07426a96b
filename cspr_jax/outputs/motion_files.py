"""A plan's motion as rows over time: CSV or HDF5."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax import __version__
from cspr_jax.errors import ConfigError
from cspr_jax.families.lines.motion import TimedLine
from cspr_jax.motion.acceleration_sets import along
from cspr_jax.motion.motion import Motion, common_shape, outward
from cspr_jax.motion.ticks import ticks
from cspr_jax.numerics.bounds.intervals import united
from cspr_jax.outputs.binding import binding
from cspr_jax.outputs.paths import path_columns
from cspr_jax.outputs.segment_causes import cause_columns
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.robots import cables
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.tensions.tension_couples import is_rectangle, tension_couples
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.identity import canonical_json
from cspr_jax.schema.quantities import (
    ACROSS,
    EVERY,
    MARGIN_UNITS,
    OTHER_DIMS,
    PARTS,
    SEGMENTS,
    TRAJECTORY,
    columns_of,
    flag_attributes,
)
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.netcdf import describe, new_hdf5, set_attributes
from cspr_jax.store.files.publishing import publish

SCHEMA = 2
# Fields of a state by their names in files.
_FIELDS = {
    "position": "position",
    "velocity": "velocity",
    "acceleration": "acceleration",
    "quaternion": "quaternion",
    "omega": "angular_velocity",
    "omega_dot": "angular_acceleration",
}
LARGEST_ROWS = 20_000_000
# Quantities that may be infinite at some times although the motion itself is finite.
OPEN = ("tension", "tension_residual", "tension_each", "tension_couple", "path_acceleration")


@persistent_jit(static_argnames=("rule", "with_couples"))
def _states(robot, limits: Limits, motion: Motion, tau, *, rule: str, with_couples: bool):
    def one(t):
        state = motion.state(t)
        length, rate, rate_derivative = cables.cable_motion(robot, state)
        of_cables = {"length": length, "rate": rate, "rate_derivative": rate_derivative}
        if robot.n_cables > robot.dof:
            chosen = cables.shared(robot, state, limits, rule)
            of_cables |= {"tension": chosen.tensions, "tension_residual": chosen.residual}
        else:
            of_cables["tension"] = cables.tensions(robot, state)
        if with_couples:
            of_cables["tension_couple"] = tension_couples(robot, state.position, state.acceleration)
        if isinstance(motion, TimedLine):
            direction = motion.direction / jnp.linalg.norm(motion.direction)
            minimum, largest = along(robot, limits, state.position, direction)
            of_cables["path_acceleration"] = jnp.stack([minimum, direction @ state.acceleration, largest])
        return state, of_cables

    return jax.vmap(one)(tau)


def rows(plan: PlannedMotions, *, rate: float | None = None) -> dict[str, np.ndarray]:
    """States along a plan."""
    if rate is not None and not 0.0 < rate < float("inf"):
        raise ConfigError("--rate", f"{rate}: must be a number > 0, in Hz")
    if rate is not None and not np.isfinite(plan.answers.duration).all():
        raise ConfigError("--rate", "must be absent for a plan with a segment that has no motion; see its verdict")
    if rate is not None and rate * plan.answers.duration.sum() > LARGEST_ROWS:
        raise ConfigError("--rate", f"{rate:g} Hz: must give at most {LARGEST_ROWS} rows")
    if rate is None and plan.keys.samples * len(plan.answers.duration) > LARGEST_ROWS:
        raise ConfigError("samples", f"{plan.keys.samples}: must give at most {LARGEST_ROWS} rows in all")
    every_segment = [np.linspace(0.0, 1.0, plan.keys.samples)] * len(plan.answers.duration)
    columns = rows_at(plan, every_segment if rate is None else ticks(plan.answers.duration, rate)[1])
    if not plan.is_at_origin:
        return columns
    from cspr_jax.outputs.platform_poses import at_origin  # SciPy's rotations take time

    return at_origin(plan, columns)


def rows_at(plan: PlannedMotions, taus: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """States at given times of the segments of a plan."""
    duration, motions = plan.answers.duration, [motion for leg in plan.legs for motion in leg.motions]
    starts = np.concatenate([[0.0], np.cumsum(duration)])
    robot = plan.problem.robot
    is_redundant = robot.n_cables > robot.dof
    # Other motions do not depend on limits: leave these out, so that plans with different limits share compiled code.
    needs_limits = is_redundant or any(isinstance(motion, TimedLine) for motion in motions)
    limits = plan.problem.limits if needs_limits else NO_LIMITS
    with_couples = is_redundant and robot.pulleys is None and is_rectangle(robot.base_points)
    pairs, parts = plan.robot_file.pairs, []
    longest = max(len(tau) for tau in taus)
    for i, tau in enumerate(taus):
        # Pad all segments to one length, so that code is compiled once.
        padded, motion = np.concatenate([tau, np.ones(longest - len(tau))]), common_shape(motions[i])
        states_of_segment = _states(
            robot, limits, motion, padded, rule=plan.keys.tension_rule, with_couples=with_couples
        )
        state, of_cables = jax.tree.map(np.asarray, states_of_segment)
        of_cables |= binding(plan.problem, state, of_cables, tau * duration[i], plan.details(i))
        state = outward(plan.frame, state)
        part = {name: getattr(state, field) for name, field in _FIELDS.items()} | of_cables
        part = {name: None if values is None else values[: len(tau)] for name, values in part.items()}
        if pairs is not None:
            part["tension_each"] = pairs.tensions(part["tension"])
        parts.append({"t": starts[i] + tau * duration[i], **part})
    names = [name for name in TRAJECTORY if all(part.get(name) is not None for part in parts)]
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def write_rows(plan: PlannedMotions, path: Path, *, rate: float | None = None) -> None:
    """Write the motion of a plan to a .csv or .h5 file, which says so if the plan is not feasible."""
    is_motion = np.isfinite(plan.answers.duration).all()
    columns = rows(plan, rate=rate) if is_motion else {"t": plan.answers.duration}
    if not all(np.isfinite(values).all() for name, values in columns.items() if name not in OPEN):
        raise ConfigError(path, "not written: the best candidate's motion is not finite; see its verdict")
    if path.suffix == ".csv":
        feasible = None if plan.feasible else _feasible_rows(plan, columns["t"])
        publish(Disk(), path, _csv(columns, feasible).encode())
    else:
        _write_hdf5(plan, path, columns)


def _feasible_rows(plan: PlannedMotions, t: np.ndarray) -> np.ndarray:
    # Tell for each row whether its segment is feasible; rows where two segments meet belong to both.
    ends = np.cumsum(plan.answers.duration)
    before, after = (np.searchsorted(ends, t, side).clip(max=len(ends) - 1) for side in ("left", "right"))
    good = plan.is_feasible
    return good[before] & good[after]


def _csv(columns: dict[str, np.ndarray], feasible: np.ndarray | None) -> str:
    # A line of names, then only numbers, which every program can read; axes and units are those of the robot file.
    heads = [head for name, values in columns.items() for head in columns_of(name, values[0].size)]
    table = np.column_stack(list(columns.values()))
    last = [[]] * len(table) if feasible is None else [[int(flag)] for flag in feasible]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads if feasible is None else [*heads, "feasible"])
    writer.writerows([[repr(float(value)) for value in row] + flag for row, flag in zip(table, last, strict=True)])
    return text.getvalue()


def _write_hdf5(plan: PlannedMotions, path: Path, columns: dict[str, np.ndarray]) -> None:
    of_segments = segments(plan)
    numbers = list(range(1, columns["tension"].shape[1] + 1))
    with new_hdf5(path, attributes(plan)) as file:
        scales = {"t": columns["t"], "axis": list(PARTS["axis"]), "cable": numbers, "segment": of_segments["segment"]}
        needing = (
            ("component", "quaternion"),
            ("each", "tension_each"),
            ("couple", "tension_couple"),
            ("bound", "path_acceleration"),
        )
        for name, quantity in needing:
            if quantity in columns:
                scales[name] = list(PARTS[name])
        for name, labels in scales.items():
            file[name] = labels
            file[name].make_scale(name)
        for name, values in columns.items():
            data: h5py.Dataset = file[name] if name == "t" else file.create_dataset(name, data=values)
            describe(data, TRAJECTORY[name])
            if plan.is_at_origin and name in ("position", "velocity", "acceleration"):
                set_attributes(data, {"long_name": f"{name} of the origin of the platform's axes"})
            if name != "t":
                data.dims[0].attach_scale(file["t"])
            if name in ACROSS:
                data.dims[1].attach_scale(file[ACROSS[name]])
        for name, values in of_segments.items():
            data = file[name] if name == "segment" else file.create_dataset(name, data=values)
            describe(data, SEGMENTS[name])
            if name != "segment":
                data.dims[0].attach_scale(file["segment"])
        for name in ("segment_verdict", "binding"):
            set_attributes(file[name], flag_attributes())
        _write_others(file, plan.outcome_columns | failures(plan) | path_columns(plan))


def _write_others(file: h5py.File, columns: dict[str, np.ndarray]) -> None:
    for name in (part for column in columns for part in OTHER_DIMS[column] if part in PARTS and part not in file):
        file[name] = list(PARTS[name])
        file[name].make_scale(name)
    for name, values in columns.items():
        data = file.create_dataset(name, data=values)
        describe(data, EVERY[name])
        if OTHER_DIMS[name] == (name,):
            data.make_scale(name)
    for name in columns:
        for i, scale in enumerate(OTHER_DIMS[name]):
            if scale != name:
                file[name].dims[i].attach_scale(file[scale])


def failures(plan: PlannedMotions) -> dict[str, np.ndarray]:
    """Intervals of time in which segments fail, for all segments that are proved or refuted at all their times."""
    starts = np.cumsum(plan.answers.duration) - plan.answers.duration
    intervals = [
        start + np.reshape(plan.details(i).get("failing", ()), (-1, 2)) for i, start in enumerate(starts.tolist())
    ]
    failing = united(np.concatenate([np.empty((0, 2)), *intervals]))
    if not len(failing):
        return {}
    parts = [
        (Verdict[name.upper()].value, start + interval[0], start + interval[1])
        for i, start in enumerate(starts.tolist())
        for name, each in plan.details(i).get("failing_by_criterion", {}).items()
        for interval in each
    ]
    columns = {"failure": np.arange(1.0, len(failing) + 1.0), "failing": failing}
    if parts:
        columns["criterion_failure"] = np.arange(1.0, len(parts) + 1.0)
        columns["criterion_failing"] = np.array([part[1:] for part in parts])
        columns["criterion_flag"] = np.array([part[0] for part in parts], FLAGS)
    return columns


def attributes(plan: PlannedMotions) -> dict[str, Any]:
    """Attributes of a motion file, from its plan."""
    robot_file = plan.robot_file
    return {
        "Conventions": "CF-1.11",
        "title": f"Motion of robot {robot_file.name}" + ("" if plan.feasible else ", not proved feasible"),
        "schema": SCHEMA,
        "software": f"cspr_jax {__version__}",
        "feasible": int(plan.feasible),
        "family": plan.keys.family,
        "plan": plan.text,
        "robot": robot_file.name,
        "robot_settings": canonical_json(robot_file.settings),
        "base_points": np.asarray(robot_file.base_points),
        "mass": robot_file.mass,
        "z_axis": robot_file.z_axis,
        **({"point": plan.point} if robot_file.is_platform else {}),
        **({"z0": float(plan.z0)} if np.isfinite(plan.z0) else {}),
    }


def segments(plan: PlannedMotions) -> dict[str, np.ndarray]:
    """Quantities of each segment in a motion file."""
    answers, ends = plan.answers, np.cumsum(plan.answers.duration)
    columns = {
        "segment": np.arange(1, len(ends) + 1),
        "segment_start": np.concatenate([[0.0], ends[:-1]]),
        "segment_end": ends,
        "segment_arcs": answers.arcs,
        "segment_tried_arcs": answers.tried_arcs,
        "segment_verdict": answers.verdict,
        "segment_margin": answers.margin,
        "segment_margin_unit": [MARGIN_UNITS.index(plan.details(i)["margin_unit"]) for i in range(len(ends))],
        "segment_tension_margin": plan.tension_margin,
        **cause_columns(plan.causes),
    }
    return {
        name: np.asarray(values, "float64" if (kind := SEGMENTS[name].kind) == "float" else kind)
        for name, values in columns.items()
    }
