"""Content of a page about a motion: the robot at its rows, its tensions, and what there is of its segments."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.outputs.plots.moving import limits_of, moving
from cspr_jax.outputs.plots.pages.packing import packed
from cspr_jax.outputs.plots.reasons import FEASIBLE_COLOUR, REASONS
from cspr_jax.plans.causes import cause_text
from cspr_jax.schema.verdicts import Verdict

# Rows of a motion in a page, at most.
MOST_ROWS = 1200


def motion_content(
    title: str,
    columns: Mapping[str, np.ndarray],
    segments: Mapping[str, np.ndarray],
    spec: RobotFile,
    keys: PlanFile,
) -> dict[str, Any]:
    """What a page shows of a motion.

    Args:
        title: of the motion.
        columns: rows by the names of `schema.motion_quantities.TRAJECTORY`, and the flight if there is one.
        segments: by the names of `schema.motion_quantities.SEGMENTS`.
        spec: the robot whose cables have these tensions.
        keys: the plan, for the limits.

    Returns:
        plain values, for JSON.
    """
    rows = _chosen(np.asarray(columns["t"]))
    robot, tension = moving(columns, spec, rows), np.asarray(columns["tension"])[rows]
    return {
        "title": title,
        "isDown": spec.z_axis == "down",
        "count": len(rows),
        "cables": len(robot.base),
        "base": np.round(robot.base, 9).tolist(),
        "t": packed(np.asarray(columns["t"])[rows]),
        "path": packed(robot.position),
        "attached": packed(robot.attached),
        "corners": packed(robot.corners),
        "edges": robot.corners.shape[1] // 2,
        "tension": packed(tension),
        "flight": np.asarray(columns["flight_position"]).tolist() if "flight_position" in columns else None,
        "limits": [{"words": words, "value": value} for words, value in limits_of(spec, keys)],
        "segments": _segments(segments),
    }


def _chosen(time: np.ndarray) -> np.ndarray:
    # Evenly in time, as many as there are or a page takes; where segments meet rows are twice.
    count = min(len(time), MOST_ROWS)
    wanted = np.linspace(time[0], time[-1], count)
    return np.unique(np.clip(np.searchsorted(time, wanted - 1e-12), 0, len(time) - 1))


def _segments(segments: Mapping[str, np.ndarray]) -> list[dict[str, Any]]:
    rows = []
    for i, end in enumerate(np.asarray(segments.get("segment_end", ())).tolist()):
        code = int(segments["segment_verdict"][i])
        words = Verdict(code).text.replace("_", " ").replace("+", ", ")
        colour = next((REASONS[flag][1] for flag in REASONS if code & flag.value), FEASIBLE_COLOUR)
        rows.append(
            {
                "start": float(segments["segment_start"][i]),
                "end": end,
                "arcs": int(segments["segment_tried_arcs"][i]),
                "margin": _number(segments["segment_margin"][i]),
                "isFeasible": int(segments["segment_arcs"][i]) > 0 or code == 0,
                "verdict": ": ".join(filter(None, (words, cause_text(segments, i)))),
                "colour": colour,
            }
        )
    return rows


def _number(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None
