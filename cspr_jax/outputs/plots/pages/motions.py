"""Content of a page about a motion: the robot at its rows, its tensions, and its segments."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.outputs.plots.motions.motion import failing_in, point_words
from cspr_jax.outputs.plots.pages.page import packed
from cspr_jax.outputs.plots.robots.obstacles import lines_on, points_of
from cspr_jax.outputs.plots.robots.robot_along import limits_of, moving
from cspr_jax.outputs.plots.robots.robot_at import hull_of
from cspr_jax.outputs.plots.style.fitting import shortened
from cspr_jax.outputs.plots.style.labels import WRITTEN, cable_names
from cspr_jax.outputs.plots.style.word_ticks import FEASIBLE_COLOUR, REASONS
from cspr_jax.outputs.segment_causes import cause_text
from cspr_jax.robots.model.shapes import Obstacle
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import Verdict, criterion_words

# Largest number of rows of a motion in a page.
MAX_ROWS = 1200
# Largest number of nodes of paths in a page.
MAX_NODES = 50_000
# Largest number of intervals of failure that the page names; it shades all of them.
MAX_INTERVALS = 12
# Columns of cables, with the quantities of their limits; units of all quantities that limits bound.
CHARTS = ("path", "tension", "rate", "length")
OF_CABLES = {"tension": "tension", "rate": "speed", "length": "length"}
UNITS = {row.quantity: WRITTEN.get(row.unit, row.unit).replace("^2", "²") for row in LIMITS}


def motion_content(
    title: str,
    columns: Mapping[str, np.ndarray],
    segments: Mapping[str, np.ndarray],
    robot_file: RobotFile | None,
    plan_file: PlanFile | None,
    z_axis: str = "down",
) -> dict[str, Any]:
    """Content of the page of a motion."""
    rows = _chosen(np.asarray(columns["t"]))
    robot = moving(columns, robot_file, rows, plan_file)
    return {
        "title": title,
        "facts": [
            *_facts(np.asarray(columns["t"]), segments, robot_file, plan_file),
            *([("path", point_words(columns).removeprefix(", "))] if point_words(columns) else []),
            *_bounds(columns),
            *_failures(columns),
        ],
        "isDown": (z_axis if robot_file is None else robot_file.z_axis) == "down",
        "count": len(rows),
        "cables": cable_names(columns),
        "base": np.round(robot.base, 9).tolist(),
        "t": packed(np.asarray(columns["t"])[rows]),
        "path": packed(robot.position),
        "attached": packed(robot.attached),
        # Points of cables on pulleys, between entry and attachment points.
        "arcs": packed(robot.cable_points[:, :, 1:-1]),
        "onArc": robot.cable_points.shape[2] - 2,
        "corners": packed(robot.corners),
        "edges": robot.corners.shape[1] // 2,
        **{name: packed(np.asarray(columns[name])[rows]) for name in OF_CABLES if name in columns},
        "flight": np.asarray(columns["flight_position"]).tolist() if "flight_position" in columns else None,
        "limits": {name: _limits(robot_file, plan_file, quantity) for name, quantity in OF_CABLES.items()},
        "segments": _segments(segments),
        "paths": _paths(columns),
        "failing": np.asarray(columns.get("failing", ())).tolist(),
        "failingIn": {name: failing_in(columns, name, CHARTS).tolist() for name in CHARTS},
        "bodies": [_surface(body) for body in ([] if plan_file is None else plan_file.bodies)],
    }


def _limits(robot_file: RobotFile | None, plan_file: PlanFile | None, quantity: str) -> list[dict[str, Any]]:
    if robot_file is None or plan_file is None:
        return []
    return [{"words": words, "value": value} for words, value in limits_of(robot_file, plan_file, quantity)]


def _facts(
    time: np.ndarray, segments: Mapping[str, np.ndarray], robot_file: RobotFile | None, plan_file: PlanFile | None
) -> list[tuple[str, str]]:
    # Describe robot, limits and duration in words.
    count = len(segments.get("segment_end", ()))
    of_segments = f" in {count} segment{'s' if count > 1 else ''}" if count else ""
    facts = [("duration", f"{time[-1] - time[0]:.4g} s{of_segments}")]
    if robot_file is None or plan_file is None:
        return [("robot", "the file keeps neither robot nor limits; --plan gives them"), *facts]
    body = "platform" if robot_file.is_platform else "point mass"
    cables = f"on {len(robot_file.base_points)} cables, z {robot_file.z_axis}"
    robot = f"{shortened(robot_file.name)}, {body} of {robot_file.mass:.4g} kg {cables}"
    limits = ", ".join(filter(None, (_bound(row, limits_of(robot_file, plan_file, row)) for row in UNITS)))
    return [("robot", robot), ("limits", limits or "none, but that all cables are taut"), *facts]


def _failures(columns: Mapping[str, np.ndarray]) -> list[tuple[str, str]]:
    intervals = np.asarray(columns.get("failing", ())).tolist()
    named = [f"{start:.6f} to {end:.6f} s" for start, end in intervals[:MAX_INTERVALS]]
    more = [f"{len(intervals) - MAX_INTERVALS} more"] if len(intervals) > MAX_INTERVALS else []
    return [("fails", f"{', '.join(named + more)}; each shaded in its chart")] if intervals else []


def _bounds(columns: Mapping[str, np.ndarray]) -> list[tuple[str, str]]:
    # The least time that any motion along the paths takes.
    bounds, time = np.asarray(columns.get("segment_lower_bound", ())), np.asarray(columns["t"])
    if not len(bounds) or not np.isfinite(bounds).all():
        return []
    gap = 100.0 * (1.0 - float(bounds.sum()) / float(time[-1] - time[0]))
    return [("least time", f"at least {bounds.sum():.4g} s, proved; the motion takes {gap:.2g} % more")]


def _paths(columns: Mapping[str, np.ndarray]) -> dict[str, Any] | None:
    # Path speeds, and for each node words for the limit that binds after it.
    if "path_speed" not in columns or len(columns["path_speed"]) > MAX_NODES:
        return None
    minimum, largest, actual, allowed = np.asarray(columns["path_speed"]).T
    flags, cables = (np.asarray(columns[name]).tolist() for name in ("path_binds", "path_binding_cable"))
    words = [
        criterion_words(Verdict(flag), cable - 1 if cable else None) if flag else "nothing"
        for flag, cable in zip(flags, cables, strict=True)
    ]
    speeds = {"least": minimum, "largest": largest, "actual": actual, "allowed": allowed}
    return {
        "s": np.round(np.asarray(columns["path_coordinate"], float), 6).tolist(),
        **{name: [_number(round(value, 6)) for value in values.tolist()] for name, values in speeds.items()},
        "binds": words,
        "sections": np.asarray(columns["path_section"]).tolist(),
    }


def _surface(body: Obstacle) -> dict[str, Any]:
    # Corners and triangles of a body, as a browser draws them.
    triangles = hull_of(points_of(body))[0]
    corners, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    lines = [np.round(line, 9).tolist() for line in lines_on(body)]
    return {
        "name": shortened(body.name),
        "corners": np.round(corners, 9).tolist(),
        "triangles": numbers.reshape(-1, 3).tolist(),
        "lines": lines,
    }


def _bound(quantity: str, limits: list[tuple[str, float]]) -> str:
    if quantity == "depth":
        return f"floor at z = {limits[0][1]:.4g} m" if limits else ""
    parts = []
    for words, phrase in (("smallest allowed", "at least"), ("largest allowed", "at most")):
        values = [value for sense, value in limits if sense == words]
        if values:
            each = f" to {values[-1]:.4g}, by cable" if len(values) > 1 else ""
            parts.append(f"{phrase} {values[0]:.4g}{each}")
    is_plain = quantity == "tension" or quantity.startswith("mass_centre")
    name = quantity.replace("_", " ") if is_plain else f"cable {quantity}"
    return f"{name} {' and '.join(parts)} {UNITS[quantity]}" if parts else ""


def _chosen(time: np.ndarray) -> np.ndarray:
    # Choose rows evenly in time, as many as there are or as a page can hold; where segments meet there are two rows.
    count = min(len(time), MAX_ROWS)
    times = np.linspace(time[0], time[-1], count)
    return np.unique(np.clip(np.searchsorted(time, times - 1e-12), 0, len(time) - 1))


def _segments(segments: Mapping[str, np.ndarray]) -> list[dict[str, Any]]:
    rows, margins = [], segments.get("segment_tension_margin")  # files of earlier versions have none
    for i, end in enumerate(np.asarray(segments.get("segment_end", ())).tolist()):
        code = int(segments["segment_verdict"][i])
        words = Verdict(code).text.replace("_", " ").replace("+", ", ")
        colour = next((REASONS[flag][1] for flag in REASONS if code & flag.value), FEASIBLE_COLOUR)
        rows.append(
            {
                "start": float(segments["segment_start"][i]),
                "end": end,
                "arcs": int(segments["segment_tried_arcs"][i]),
                "margin": None if margins is None else _number(margins[i]),
                "isFeasible": int(segments["segment_arcs"][i]) > 0 or code == 0,
                "verdict": ": ".join(filter(None, (words, cause_text(segments, i)))),
                "colour": colour,
            }
        )
    return rows


def _number(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None
