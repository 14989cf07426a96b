"""Placeholder: the motion along a section at a constant speed, with slow ramps."""

from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import BPoly

from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.curves.interpolation import hermite
from cspr_jax.curves.spline import Spline
from cspr_jax.motions.problem import Problem
from cspr_jax.paths.section import Section, SectionSettings
from cspr_jax.robots.clearance import Scene

SPEED = 0.1  # m/s


class LeastTime(NamedTuple):
    """Motion along a section.

    Fields:
        motion: over time; its knots are at the cells of the grid, and at all knots of the section.
        coordinate: (m + 1,) s at the knots of the motion.
        duration: s.
        lower_bound: proved lower bound of the least time, s.
        binding: what binds where.
        cause: why there is no motion; "" where there is one.
    """

    motion: Spline
    coordinate: np.ndarray
    duration: float
    lower_bound: float
    binding: list
    cause: str = ""


def least_time_motion(problem: Problem, scene: Scene, section: Section, settings: SectionSettings) -> LeastTime:
    """Motion along a section.

    Args:
        scene: bodies that can meet.
        settings: cells, ramps, and speeds at both ends.

    Returns:
        the motion.
    """
    knots = np.asarray(section.curve.knots)
    grid = np.unique(np.concatenate([knots, np.linspace(0.0, knots[-1], settings.grid + 1)]))
    s = np.concatenate([grid[:1], grid[1:][np.diff(grid) > 1e-9 * grid[-1]]])
    s[-1] = knots[-1]
    # s'^2 = x: a parabola in s from 0 to 0, of constant acceleration at both ends.
    share = s / s[-1]
    legs = np.diff(np.asarray(section.curve.position)[[0, -1]], axis=1)[[0, 1], [0, -1]] * 5.0
    paces = np.linalg.norm(legs, axis=1) / np.diff(knots)[[0, -1]]
    first, last = (np.array([settings.start_speed, settings.end_speed]) / np.where(paces > 0.0, paces, 1.0)) ** 2
    ends = (1.0 - share) * first + share * last
    x = ends + 4.0 * SPEED**2 * share * (1.0 - share)
    rate, bend = np.sqrt(np.maximum(x, 0.0)), 0.5 * np.gradient(x, s, edge_order=2)
    steps = 2.0 * np.diff(s) / (rate[1:] + rate[:-1])
    times = np.concatenate([[0.0], np.cumsum(steps)])
    tables: list[Any] = []
    for table in (section.curve.position, section.curve.quaternion):
        if table is None:
            tables.append(None)
            continue
        curve = BPoly(np.moveaxis(np.asarray(table), 1, 0), knots)
        value, first, second = (curve(s, order) for order in range(3))
        derivatives = [value, first * rate[:, None], first * bend[:, None] + second * x[:, None]]
        tables.append(leaf(hermite(times, derivatives)))
    motion = Spline(leaf(times), *tables)
    return LeastTime(motion, s, float(times[-1]), 0.0, [])
