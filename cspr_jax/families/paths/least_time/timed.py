"""Motion along a path in time: quintic pieces through positions, velocities and accelerations at the nodes.

This motion is what controllers play, and what is proved. It is on the path at the nodes; `distance_from_path` tells how
far from the path it is between them.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from cspr_jax.curves.spline import Spline
from cspr_jax.families.paths.geometry.section import Section
from cspr_jax.families.paths.least_time.nodes import PathGrid, PathSpeeds, derivatives, points_on
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Float

# Fractions of the time of a cell at which the distance from the path is measured.
FRACTIONS = (0.25, 0.5, 0.75)
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(12)


def cell_times(run: PathSpeeds, width: Float[np.ndarray, "n_cells"]) -> Float[np.ndarray, "n_cells"]:
    """Times of the cells, on which the path acceleration changes at a constant rate over s."""
    # Substitute s - s0 = D r^2 at a start from zero speed, and D (1 - (1 - r)^2) at such an end: nothing is singular.
    r, weights = 0.5 * (_POINTS + 1.0), 0.5 * _WEIGHTS
    starts, ends = (run.x[:-1] == 0.0)[:, None], (run.x[1:] == 0.0)[:, None]
    fraction = np.where(starts, r**2, np.where(ends, 1.0 - (1.0 - r) ** 2, r))
    derivative = np.where(starts, 2.0 * r, np.where(ends, 2.0 * (1.0 - r), 1.0))
    u_change = (run.after - run.before)[:, None]
    x = run.x[:-1, None] + 2.0 * width[:, None] * (run.before[:, None] * fraction + 0.5 * u_change * fraction**2)
    with np.errstate(invalid="ignore", divide="ignore"):  # for cells that no motion traverses
        times = width * np.sum(weights * derivative / np.sqrt(x), axis=1)
    for end, rest in zip((0, -1), run.rests, strict=True):
        if rest:
            times[end] = 3.0 * width[end] / np.sqrt(run.x[1 + 3 * end])
    return times


def moving(run: PathSpeeds, width: Float[np.ndarray, "n_cells"]) -> PathSpeeds | None:
    """Path speeds, if they let a motion traverse all cells; else None."""
    return run if np.isfinite(cell_times(run, width)).all() else None


def timed(section: Section, grid: PathGrid, run: PathSpeeds) -> Spline:
    """The motion over time."""
    times = cell_times(run, grid.width)
    speeds = np.sqrt(run.x)
    sides = [
        derivatives(points_on(section.curve, grid.nodes[:-1], ahead=True)),
        derivatives(points_on(section.curve, grid.nodes[1:], ahead=False)),
    ]
    tables = []
    for start, end in zip(*sides, strict=True):
        rates = [
            (value, first * speed[:, None], first * u[:, None] + second * (speed**2)[:, None])
            for (value, first, second), speed, u in (
                (start, speeds[:-1], run.before),
                (end, speeds[1:], run.after),
            )
        ]
        tables.append(_quintic(rates[0], rates[1], times[:, None]))
    position, quaternion = tables[0], tables[1] if len(tables) > 1 else None
    knots = np.concatenate([[0.0], np.cumsum(times)])
    turning = None if quaternion is None else as_float64(quaternion)
    return dataclasses.replace(
        section.curve, knots=as_float64(knots), position=as_float64(position), quaternion=turning
    )


def _quintic(start: tuple, end: tuple, width: np.ndarray) -> np.ndarray:
    # Return Bernstein coefficients (n_cells, 6, k) from values and two derivatives at both ends.
    (p, v, a), (q, w, b) = start, end
    one, two = width / 5.0, width**2 / 20.0
    return np.stack([p, p + one * v, p + 2.0 * one * v + two * a, q - 2.0 * one * w + two * b, q - one * w, q], axis=1)


def distance_from_path(section: Section, grid: PathGrid, run: PathSpeeds, motion: Spline) -> float:
    """Largest distance of the motion from the path, at some times in each cell."""
    times, speeds = np.diff(motion.knots), np.sqrt(run.x)
    # Approximate the path coordinate by a quintic in time as well; its error hardly changes the distance.
    ends = (grid.nodes[:-1], speeds[:-1], run.before), (grid.nodes[1:], speeds[1:], run.after)
    first, last = (tuple(x[:, None] for x in end) for end in ends)
    path_coordinate = _quintic(first, last, times[:, None])
    largest = 0.0
    for fraction in FRACTIONS:
        values = [_at(table, fraction) for table in (path_coordinate, np.asarray(motion.position))]
        position, ahead, _ = derivatives(points_on(section.curve, values[0][:, 0], ahead=True))[0]
        # A body that only turns has no direction of motion.
        norms = np.linalg.norm(ahead, axis=1, keepdims=True)
        off, along = values[1] - position, ahead / np.where(norms > 0.0, norms, 1.0)
        off = off - np.sum(off * along, axis=1, keepdims=True) * along
        largest = max(largest, float(np.linalg.norm(off, axis=1).max()))
    return largest


def _at(table: np.ndarray, fraction: float) -> np.ndarray:
    while table.shape[1] > 1:
        table = (1.0 - fraction) * table[:, :-1] + fraction * table[:, 1:]
    return table[:, 0]
