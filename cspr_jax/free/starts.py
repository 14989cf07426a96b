"""Motions from which searches begin: lines, lines bent to all sides, and swings about P0."""

from typing import NamedTuple

import numpy as np

from cspr_jax.free.instants import coordinates
from cspr_jax.free.tasks import Tasks
from cspr_jax.robots.point_mass import rest_point, spool_radius

# Numbers of arcs of swings; by how much of their length lines are bent.
ARCS, BENT = (1, 2, 3), 0.35
# Durations of lines over those of motions with the acceleration of gravity.
SLOWER = 1.3


class Starts(NamedTuple):
    """Motions of one segment each.

    Fields:
        task: (n,) numbers of the tasks.
        controls: (n, 1, K, d) control points.
        duration: (n, 1) s.
    """

    task: np.ndarray
    controls: np.ndarray
    duration: np.ndarray


def starts(tasks: Tasks, z0: float) -> Starts:
    """Starts of searches, in the same order for each task.

    Args:
        tasks: of one segment each.
        z0: depth of P0, m.

    Returns:
        the starts of the first task, then of the second one, ...
    """
    tau, robot = tasks.basis.averages, tasks.robot
    # At rest only at the ends, where accelerations do not vanish.
    share = (3.0 * tau**2 - 2.0 * tau**3)[:, None]
    bulge, grown = 16.0 * (tau * (1.0 - tau))[:, None] ** 2, (tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2))[:, None]
    along = coordinates(robot.pattern)[0]
    gravity, size = float(robot.gravity), float(spool_radius(robot))
    curves, durations = list[np.ndarray](), list[float]()
    for start, end in tasks.places[:, 0]:
        line = start + (end - start) * share
        chord = (end - start)[: len(along)]
        length = float(np.linalg.norm(chord)) + size * float(np.linalg.norm((end - start)[len(along) :]))
        curves += [line + BENT * length * bulge * way for way in _ways(chord, along, len(start))]
        durations += [SLOWER * 2.0 * np.sqrt(2.0 * max(length, 0.1 * size) / gravity)] * (len(curves) - len(durations))
        hub = np.array(start)
        hub[: len(along)] = rest_point(z0)[along]
        for arcs in ARCS:
            first, last = np.cos(arcs * np.pi * tau)[:, None], np.cos(arcs * np.pi * (1.0 - tau))[:, None]
            swing = hub + (start - hub) * (1.0 - grown) * first + (end - hub) * grown * last
            swing[:, len(along) :] = line[:, len(along) :]
            curves.append(swing)
            durations.append(arcs * np.pi * np.sqrt(z0 / gravity))
    each = len(curves) // len(tasks.places)
    controls = np.einsum("kj,njd->nkd", tasks.basis.fit, np.array(curves))
    return Starts(np.repeat(np.arange(len(tasks.places)), each), controls[:, None], np.array(durations)[:, None])


def _ways(chord: np.ndarray, along: np.ndarray, d: int) -> list[np.ndarray]:
    # Directions in which lines are bent: none, up and down, and to both sides.
    ways = [np.zeros(d)]
    down = np.zeros(d)
    down[np.flatnonzero(along == 2)] = 1.0
    ways += [-down, down]
    if len(along) == 3:
        side = np.zeros(d)
        side[:2] = -chord[1], chord[0]
        length = np.linalg.norm(side)
        side[:2] = side[:2] / length if length > 0.0 else (1.0, 0.0)
        ways += [side, -side]
    return ways
