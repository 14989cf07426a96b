"""Sizes of motors as plain values and as a table for a terminal."""

import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cspr_jax.machine.sizing import MotionDemands

# Columns: name of the field and of its limit, head and unit. The safety factor multiplies the first five.
COLUMNS = (
    ("torque", "motor_torque_max", "torque", "N m"),
    ("speed", "motor_speed_max", "speed", "rad/s"),
    ("power", "motor_power_max", "power", "W"),
    ("braking_power", "motor_power_max", "braking", "W"),
    ("torque_rms", "motor_torque_rms_max", "rms torque", "N m"),
    ("energy", "", "energy", "J"),
    ("regenerated_energy", "", "regenerated", "J"),
)
WITH_FACTOR = tuple(name for name, *_ in COLUMNS[:5])
SUMMED = ("energy", "regenerated_energy")


def number(value: float) -> float | None:
    """A number for JSON."""
    return float(value) if math.isfinite(value) else None


def worst(peaks: Iterable[MotionDemands], name: str) -> np.ndarray:
    """Largest value of each motor; NaN only where there is none."""
    return functools.reduce(np.fmax, [getattr(each, name) for each in peaks])


def overall(peaks: MotionDemands) -> dict[str, float]:
    """Largest values of any motor, and energies of all of them."""
    return {name: float((np.sum if name in SUMMED else np.max)(getattr(peaks, name))) for name, *_ in COLUMNS}


def demands_object(peaks: MotionDemands) -> dict[str, Any]:
    """Demands on each motor and on all of them."""
    count = len(peaks.torque)
    axes = [{"axis": k + 1} | {name: number(getattr(peaks, name)[k]) for name, *_ in COLUMNS} for k in range(count)]
    return {
        "duration": number(peaks.duration),
        "axes": axes,
        "overall": {name: number(value) for name, value in overall(peaks).items()},
    }


def size_object(
    robot: str, factor: float, each: Mapping[str, MotionDemands], joint: MotionDemands, limits: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    """Sizes as plain values."""
    object_of_joint = demands_object(joint)
    worst_rms = worst(each.values(), "torque_rms")
    required = {
        name: number(factor * (float(worst_rms.max()) if name == "torque_rms" else overall(joint)[name]))
        for name in WITH_FACTOR
    }
    return {
        "schema": 1,
        "robot": robot,
        "factor": factor,
        **object_of_joint,
        "required": required,
        "limits": {name: np.asarray(values).tolist() for name, values in limits.items()},
        "sources": [{"name": name} | demands_object(peaks) for name, peaks in each.items()],
    }


def size_table(sized: Mapping[str, Any]) -> Any:
    """Sizes as a table for a terminal."""
    from rich.table import Table  # only a terminal needs it

    title = f"{sized['robot']}: what {_sources(sized['sources'])} of the motors"
    table = Table(title=title, title_style="table.title", title_justify="left", caption_justify="left")
    table.add_column("axis")
    for _, _, head, unit in COLUMNS:
        table.add_column(f"{head} ({unit})", justify="right")
    for row in sized["axes"]:
        table.add_row(str(row["axis"]), *(_cell(row[name]) for name, *_ in COLUMNS))
    table.add_row("all", *(_cell(sized["overall"][name]) for name, *_ in COLUMNS), style="bold", end_section=True)
    factor = f"times {sized['factor']:g}"
    table.add_row(factor, *(_cell(sized["required"].get(name)) for name, *_ in COLUMNS))
    if sized["limits"].keys() - {"line"}:
        table.add_row("limits", *(_limits(sized["limits"].get(limit)) for _, limit, *_ in COLUMNS))
    table.caption = _caption(sized)
    return table


def _sources(sources: Sequence[Mapping[str, Any]]) -> str:
    if len(sources) == 1:
        return f"{sources[0]['name']} asks"
    return f"{len(sources)} motions or results ask"


def _cell(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _limits(values: Sequence[float] | None) -> str:
    if values is None:
        return ""
    low, high = min(values), max(values)
    return f"{low:.4g}" if low == high else f"{low:.4g} .. {high:.4g}"


def _caption(sized: Mapping[str, Any]) -> str:
    lines = []
    if sized["duration"] is not None:
        lines.append(f"over {sized['duration']:.4g} s; all: largest of any motor, energies of all motors together")
    if "line" in sized["limits"]:
        stall, fastest = map(_limits, sized["limits"]["line"])
        lines.append(f"the motor's line: {stall} N m at standstill, none at {fastest} rad/s")
    if len(sized["sources"]) > 1:
        lines.append("rms torque: over all of them one after the other; times the factor: of the worst one")
    return "\n".join(lines)
