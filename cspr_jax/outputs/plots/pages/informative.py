"""Cells of a map whose motions are most instructive: those at the edges of the feasible region, and others far away."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Int

# Quantities whose extremes are instructive.
EXTREME = ("margin", "duration", "arcs", "oscillations")


def telling(data: dict[str, np.ndarray], verdict: Int[np.ndarray, "..."], count: int) -> list[tuple[int, ...]]:
    """Cells to look at, all of them feasible.

    First come the extremes of margins, durations and counts, and for each count the cell with the smallest margin;
    then, one after the other, the cell that is farthest from the chosen ones, in steps of the grid over its size.
    """
    feasible = np.argwhere(verdict == 0)
    if not len(feasible) or count < 1:
        return []
    where = tuple(feasible.T)
    values = {name: data[name][where].astype(float) for name in EXTREME if name in data}
    chosen = list(dict.fromkeys(_extremes(values)))[:count]
    if not chosen:
        chosen = [0]
    places = feasible / np.maximum(np.array(verdict.shape) - 1.0, 1.0)
    gap = np.min([np.square(places - places[i]).sum(1) for i in chosen], axis=0)
    while len(chosen) < min(count, len(feasible)):
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.square(places - places[chosen[-1]]).sum(1))
    return [tuple(int(i) for i in feasible[k]) for k in chosen]


def _extremes(values: dict[str, np.ndarray]) -> list[int]:
    cells = []
    for numbers in values.values():
        if np.isfinite(numbers).any():
            cells += [int(np.nanargmin(numbers)), int(np.nanargmax(numbers))]
    counts = next((values[name] for name in ("arcs", "oscillations") if name in values), None)
    if counts is not None and "margin" in values:
        for number in np.unique(counts):
            minimum = np.where(counts == number, values["margin"], np.inf)
            if np.isfinite(minimum).any():
                cells.append(int(np.argmin(minimum)))
    return cells
