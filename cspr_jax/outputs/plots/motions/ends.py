"""Start, way-points and end of a motion, with marks that stay visible where they coincide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D

from cspr_jax.numerics.shapes import Float, Int

# More way-points than these would hide the path.
LARGEST_COUNT = 40
# Each mark is smaller than the one before, and lies inside of it where both coincide.
_HOLLOW: dict[str, Any] = {"linestyle": "", "color": "black", "markerfacecolor": "white"}
LOOKS: dict[str, dict[str, Any]] = {
    "start": {"marker": "o", "markersize": 9.0, "zorder": 5.0, **_HOLLOW},
    "way-points": {"marker": "s", "markersize": 5.5, "zorder": 5.1, **_HOLLOW},
    "end": {"marker": "D", "markersize": 3.2, "zorder": 5.2, "linestyle": "", "color": "black"},
}


def segment_rows(columns: Mapping[str, np.ndarray], time: Float[np.ndarray, "n_rows"]) -> Int[np.ndarray, "n+1"]:
    """Rows of a motion where segments begin and end."""
    ends = np.concatenate([time[:1], columns.get("segment_end", time[-1:])])
    return np.clip(np.searchsorted(time, ends - 1e-9 * max(float(time[-1]), 1.0)), 0, len(time) - 1)


def draw_ends(
    panel: Any, path: Float[np.ndarray, "n_rows 3"], rows: np.ndarray, axes: Sequence[int] = (0, 1, 2)
) -> None:
    """Mark where a motion starts, where its segments meet, and where it ends."""
    rows_by_name = {
        "start": rows[:1],
        "way-points": rows[1:-1] if len(rows) - 2 <= LARGEST_COUNT else rows[:0],
        "end": rows[-1:],
    }
    for name, style in LOOKS.items():
        if len(rows_by_name[name]):
            panel.plot(*path[rows_by_name[name]][:, axes].T, **style, clip_on=False, in_layout=False)


def entries_of_ends(rows: np.ndarray) -> dict[str, Artist]:
    """Entries of a legend for what `draw_ends` marks."""
    shown = [name for name in LOOKS if name != "way-points" or 0 < len(rows) - 2 <= LARGEST_COUNT]
    return {name: Line2D([], [], **LOOKS[name]) for name in shown}
