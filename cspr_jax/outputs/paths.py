"""Paths of a plan: columns of path speeds for its motion file, and lines about paths below its table."""

from typing import Any

import numpy as np

from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.schema.verdicts import FLAGS, Verdict

MAX_NAMED = 4  # largest number of limits that a line names
MIN_NAMED = 0.005  # fraction of the time during which a limit must bind to be named


def path_lines(segments: list[dict[str, Any]]) -> list[str]:
    """Lines about paths, in the order of the segments."""
    lines = []
    for segment in segments:
        sections, words = segment["sections"] or [], []
        if segment["binding"]:
            words.append(f"binds: {_binding(segment['binding'])}")
        words += _of_sections(sections, segment["to"])
        if words:
            lines.append(f"to {segment['to']}: {'; '.join(words)}")
    return lines


def _binding(rows: list[dict[str, Any]]) -> str:
    texts = [
        f"{row['words']} ({_percent(row['share'])})"
        for row in rows[:MAX_NAMED]
        if row["share"] >= MIN_NAMED or row is rows[0]
    ]
    return ", ".join(texts).replace(")", " of the time)", 1)


def _of_sections(sections: list[dict[str, Any]], to: int) -> list[str]:
    ridden = [section for section in sections if section["ramp_time"] is not None]
    words = [] if len(ridden) == len(sections) else ["no fastest motion, the numbers are those of a slow one"]
    for section in ridden:
        first = section["segments"][0]
        if first < to - 1 and section["lower_bound"] is not None:
            bound, gap = section["lower_bound"], _percent(section["gap"])
            words.append(f"from {first}: {section['duration']:.4f} s, at least {bound:.4f} s, gap {gap}")
    with_ramps = [section for section in ridden if section["ramp_cost"] is not None]
    if with_ramps:
        total = sum(section["duration"] for section in with_ramps)
        without = sum(section["duration"] / (1.0 + section["ramp_cost"]) for section in with_ramps)
        times = sorted({float(f"{section['ramp_time']:.4g}") for section in with_ramps})
        length = " to ".join(f"{time:g}" for time in dict.fromkeys((times[0], times[-1])))
        words.append(f"ramps of {length} s cost {_percent(total / without - 1.0)}")
    speeds = [section["least_speed"] for section in ridden if section["least_speed"]]
    return words + ([f"somewhere it must be as fast as {max(speeds):.3g} m/s"] if speeds else [])


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.2g} %" if fraction < 0.1 else f"{100.0 * fraction:.0f} %"


def path_columns(plan: PlannedMotions) -> dict[str, np.ndarray]:
    """Path speeds at the nodes of all sections of paths, in their order."""
    parts, start = list[dict[str, np.ndarray]](), 0.0
    for leg in plan.legs:
        for section in leg.answers.every_section():
            parts.append(_of_section(section, len(parts) + 1, start))
            start = float(parts[-1]["path_coordinate"][-1])
    if not parts:
        return {}
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    numbers = np.arange(1.0, len(columns["path_coordinate"]) + 1.0)
    bounds = [plan.details(i).get("lower_bound", np.nan) for i in range(len(plan.motions))]
    return {"path_node": numbers, "segment_lower_bound": np.array(bounds, float)} | columns


def _of_section(section: Any, number: int, start: float) -> dict[str, np.ndarray]:
    minimum, plane = section.least, section.least.plane
    flags = np.array([0, *(Verdict[name.criterion.upper()].value for name in minimum.names)], FLAGS)
    cables = np.array([0, *(0 if name.cable is None else name.cable + 1 for name in minimum.names)], np.int16)
    # There is no cell after the last node: repeat the last one.
    binds = np.append(minimum.binds, minimum.binds[-1:]) + 1
    segments = section.before + np.append(section.segments, section.segments[-1:]) + 1
    return {
        "path_coordinate": start + minimum.coordinate,
        "path_section": np.full(len(binds), number, np.int16),
        "path_segment": segments.astype(np.int16),
        "path_speed": np.stack([plane.low, plane.high, plane.speed, plane.cap], axis=1),
        "path_binds": flags[binds],
        "path_binding_cable": cables[binds],
    }
