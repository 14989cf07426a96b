"""Lower bound of the duration of any motion along a straight line under limits of tensions and of cables.

The line is divided into cells. Over each cell, interval arithmetic bounds s'', -s'' and s' from above by constants. No
motion is faster than accelerating at these bounds, keeping the largest speed, and braking. Limits of cable
accelerations restrict fast motions further; ignoring this only lowers the bound.
"""

from __future__ import annotations

import jax
import numpy as np

from cspr_jax.families.lines.slacks import LineSlacks
from cspr_jax.numerics.bounds.interval_jets import Jet, lowest
from cspr_jax.numerics.shapes import Float

CELLS = 256
# Largest number of values in memory: cells times faces times cables.
TOGETHER = 1 << 20


def least_durations(lines: LineSlacks, largest: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """Lower bounds of durations."""
    batch = max(TOGETHER // (CELLS * max(lines.along[0].size, 1)), 1)
    parts = [slice(i, i + batch) for i in range(0, len(largest), batch)]
    return np.concatenate([_bounds(jax.tree.map(lambda x, part=part: x[part], lines), largest[part]) for part in parts])


def _bounds(lines: LineSlacks, largest: np.ndarray) -> np.ndarray:
    edges = np.linspace(0.0, 1.0, CELLS + 1)
    up, down, speed = _constants(lines, edges)
    up, down = (np.minimum(x, largest[:, None]) for x in (up, down))
    width, cap = 1.0 / CELLS, 0.5 * speed**2
    # Largest s'^2 / 2 at the edges of cells, as reached from the start and from the end.
    ahead, back = (_energies(*pair, width) for pair in ((up, cap), (down[:, ::-1], cap[:, ::-1])))
    energy = np.minimum(ahead, back[:, ::-1])
    with np.errstate(divide="ignore"):
        rising = 2.0 * width / (_speed(energy[:, :-1]) + _speed(energy[:, :-1] + up * width))
        falling = 2.0 * width / (_speed(energy[:, 1:]) + _speed(energy[:, 1:] + down * width))
        return np.maximum.reduce([rising, falling, width / speed]).sum(1)


def _speed(energy: np.ndarray) -> np.ndarray:
    return np.sqrt(2.0 * energy)


def _energies(gain: np.ndarray, cap: np.ndarray, width: float) -> np.ndarray:
    energy = np.zeros((len(gain), CELLS + 1))
    for i in range(CELLS):
        after = cap[:, i + 1] if i + 1 < CELLS else np.inf
        energy[:, i + 1] = np.minimum(np.minimum(energy[:, i] + gain[:, i] * width, cap[:, i]), after)
    return energy


def _constants(lines: LineSlacks, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # Return upper bounds of s'', -s'' and s' over the cells, (n, CELLS) each.
    line = jax.tree.map(lambda x: x[:, None], lines)
    first, last = edges[None, :-1, None], edges[None, 1:, None]
    one, none = np.full_like(first, 1.0 / CELLS), np.zeros_like(first)
    s = Jet((first, last), (one, one), (none, none))
    away = s - line.nearest
    shortness = (away**2 * line.square[..., None] + line.squared_distance) ** -0.5
    by_faces = _face_bounds(line, lines.tightest, s, shortness)
    up, down = (np.where(sign * line.steepness < 0.0, by_faces, np.inf).min(-1) for sign in (1.0, -1.0))
    # The rate of a cable over s' increases along the line.
    ends = [(x - line.nearest) * line.square[..., None] for x in (first, last)]
    rates = [
        x / np.sqrt((x / line.square[..., None]) ** 2 * line.square[..., None] + line.squared_distance) for x in ends
    ]
    minimum = np.where(rates[0] * rates[1] > 0.0, np.minimum(*np.abs(rates)), 0.0)
    speed = np.full_like(up, np.inf)
    with np.errstate(divide="ignore"):
        if "cable_speed_max" in line.largest:
            speed = (line.largest["cable_speed_max"] / minimum).min(-1)
        if "cable_acceleration_max" in line.largest:
            # A cable that lengthens has l'' >= l_s s'', one that shortens has l'' >= |l_s| (-s'').
            maximum = line.largest["cable_acceleration_max"] / minimum
            up = np.minimum(up, np.where(rates[0] > 0.0, maximum, np.inf).min(-1))
            down = np.minimum(down, np.where(rates[1] < 0.0, maximum, np.inf).min(-1))
        length = np.sqrt(line.square)
        if "speed_max" in line.largest:
            speed = np.minimum(speed, line.largest["speed_max"][..., 0] / length)
        if "acceleration_max" in line.largest:
            up, down = (np.minimum(x, line.largest["acceleration_max"][..., 0] / length) for x in (up, down))
    return np.maximum(up, 0.0), np.maximum(down, 0.0), speed


def _face_bounds(line: LineSlacks, name: str, s: Jet, shortness: Jet) -> np.ndarray:
    # Bound s'' or -s'' by each face over the cells, (n, CELLS, n_faces); inf if the face bounds nothing there.
    first, last = s.value
    free = [line.offset + line.offset_change * x for x in (first, last)]
    along = (s.expanded(-1) * line.along_change + line.along) * shortness.expanded(-2)
    ends = np.stack(
        [
            (line.along + line.along_change * x[..., None])
            * ((x - line.nearest) ** 2 * line.square[..., None] + line.squared_distance)[..., None, :] ** -0.5
            for x in (first, last)
        ]
    )
    low = lowest(ends, along)
    tensions = np.where(low < 0.0, line.high[name][..., None, :], line.low[name][..., None, :])
    with np.errstate(invalid="ignore", divide="ignore"):
        pulled = np.where(low == 0.0, 0.0, low * tensions).sum(-1)
        return np.where(line.spans, -(np.minimum(free[0], free[1]) + pulled) / np.abs(line.steepness), np.inf)
