"""Path speeds of a plan, as its motion file has them: from which the end can be reached, and what limits allow."""

from typing import Any

import numpy as np

from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.schema.verdicts import FLAGS, Verdict


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
    # Behind the last node there is no cell.
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
