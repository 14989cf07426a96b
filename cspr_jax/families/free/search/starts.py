"""Motions from which searches start: lines, lines deflected to all sides, and swings about P0."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from cspr_jax.families.free.search.equations import coordinates
from cspr_jax.families.free.search.tasks import Tasks
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import rest_point, spool_radius

ARCS = 3  # largest number of arcs of swings
DEFLECTION = 0.35  # deflection of lines, over their length
# Lines last this many times as long as with the acceleration of gravity.
SLOWER = 1.3


class Starts(NamedTuple):
    """Motions of one segment each.

    Fields:
        task: (n,) indices of the tasks.
        controls: (n, 1, K, d) control points.
        duration: (n, 1) s.
    """

    task: np.ndarray
    controls: np.ndarray
    duration: np.ndarray


def joined_starts(parts: Sequence[Starts]) -> Starts:
    """Starts of several kinds for the same tasks."""
    return Starts(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def starts(tasks: Tasks, z0: float, max_count: int | None = None) -> Starts:
    """Starts of searches, in the same order for each task."""
    begun = list[_Start]()
    for start, end in tasks.ends[:, 0]:
        lines = _lines(tasks, start, end)
        swings = _swings(tasks, start, end, z0, ARCS if max_count is None else max(1, max_count - len(lines)))
        # Alternate lines and swings, so that a small number of starts has both.
        begun += [one for pair in zip_longest(lines, swings) for one in pair if one is not None][:max_count]
    task = np.repeat(np.arange(len(tasks.ends)), len(begun) // len(tasks.ends))
    controls = np.einsum("kj,njd->nkd", tasks.basis.fit, np.array([one.samples for one in begun]))
    return Starts(task, controls[:, None], np.array([[one.duration] for one in begun]))


class _Start(NamedTuple):
    # Coordinates (K, d) at the Greville abscissae of the control points, and the duration, s.
    samples: np.ndarray
    duration: float


def _line(tasks: Tasks, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    # Return a motion with a cubic law: at rest only at the ends, with accelerations there.
    tau = tasks.basis.averages[:, None]
    return start + (end - start) * (3.0 * tau**2 - 2.0 * tau**3)


def _lines(tasks: Tasks, start: np.ndarray, end: np.ndarray) -> list[_Start]:
    # Return the straight line, and lines that are deflected to all sides.
    tau, along = tasks.basis.averages[:, None], coordinates(tasks.robot.pattern)[0]
    gravity, radius = float(tasks.robot.gravity), float(spool_radius(tasks.robot))
    length = float(np.linalg.norm((end - start)[: len(along)])) + radius * float(
        np.linalg.norm((end - start)[len(along) :])
    )
    line, duration = _line(tasks, start, end), SLOWER * 2.0 * np.sqrt(2.0 * max(length, 0.1 * radius) / gravity)
    return [
        _Start(line + DEFLECTION * length * deflection_profile(tau) * direction, duration)
        for direction in deflections(end - start, along)
    ]


def _swings(tasks: Tasks, start: np.ndarray, end: np.ndarray, z0: float, max_arcs: int) -> list[_Start]:
    # Return swings about P0 of one arc, two arcs, and so on.
    tau, along = tasks.basis.averages[:, None], coordinates(tasks.robot.pattern)[0]
    line, end_fraction, center = _line(tasks, start, end), tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2), start.copy()
    center[: len(along)] = rest_point(z0)[along]
    half, swings = np.pi * np.sqrt(z0 / float(tasks.robot.gravity)), list[_Start]()
    for arcs in range(1, max_arcs + 1):
        first, last = np.cos(arcs * np.pi * tau), np.cos(arcs * np.pi * (1.0 - tau))
        swing = center + (start - center) * (1.0 - end_fraction) * first + (end - center) * end_fraction * last
        samples = np.concatenate([swing[:, : len(along)], line[:, len(along) :]], axis=1)
        swings.append(_Start(samples, arcs * half))
    return swings


def deflection_profile(tau: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Deflection over time, 1 in the middle; at the ends it changes neither position nor velocity."""
    return 16.0 * (tau * (1.0 - tau)) ** 2


def deflections(chord: Float[np.ndarray, "d"], along: np.ndarray) -> list[np.ndarray]:
    """Directions of deflections; the first is zero."""
    down = np.zeros(len(chord))
    down[np.flatnonzero(along == 2)] = 1.0
    directions = [np.zeros(len(chord)), -down, down]
    if len(along) == 3:
        side = np.zeros(len(chord))
        side[:2] = -chord[1], chord[0]
        length = np.linalg.norm(side)
        side[:2] = side[:2] / length if length > 0.0 else (1.0, 0.0)
        directions += [side, -side]
    return directions
