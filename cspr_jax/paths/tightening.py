"""Limits that a motion along a path misses between the nodes, by proof, and those that bind it."""

from typing import NamedTuple

import numpy as np

from cspr_jax.curves.spline import Spline
from cspr_jax.motions.block_slacks import block_slacks
from cspr_jax.motions.criteria import Criterion, criteria
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.proved_answers import TENSIONS
from cspr_jax.paths.discrete import GridMargins
from cspr_jax.robots.clearance import Scene

# Slack, over its scale, that is left where a limit is met; by what more than is missed, and by how
# much at least, margins grow; below which a criterion binds.
LEFT, MORE, STEP, BINDING = 1e-7, 1.3, 1e-5, 0.01
# Times that a cell is halved, and by how much of what is missed its bounds may be apart.
HALVINGS, LOOSE = 3, 0.5
# Criteria that faster or slower motion changes, by their units.
SPEEDS, ACCELERATIONS = "m/s", "m/s^2"


class CellSlacks(NamedTuple):
    """Bounds of the slacks of criteria over the cells of a motion, over their scales.

    Fields:
        rows: criteria of tensions, speeds and accelerations.
        low: (n_cells, n_rows) lower bounds; of tensions over the weight, of others over what is allowed.
        high: (n_cells, n_rows) upper bounds.
    """

    rows: list[Criterion]
    low: np.ndarray
    high: np.ndarray

    @property
    def is_met(self) -> bool:
        """Tell whether all criteria are met in all cells."""
        return bool((self.low > 0.0).all())

    def grown(self, margins: GridMargins, weight: float) -> GridMargins:
        """Margins with which what is missed will be met.

        Args:
            margins: with which the motion was sought.
            weight: N.

        Returns:
            the margins.
        """

        def lacking(chosen: list[bool]) -> np.ndarray:
            missed = LEFT - self.low[:, chosen].min(1, initial=np.inf)
            return np.where(missed > 0.0, MORE * missed + STEP, 0.0)

        tension = weight * lacking([bool(row.flag & TENSIONS) for row in self.rows])
        others = (lacking([row.unit == unit for row in self.rows]) for unit in (ACCELERATIONS, SPEEDS))
        return GridMargins(*(old + more for old, more in zip(margins, (tension, *others), strict=True)))

    @property
    def names(self) -> tuple[tuple[str, int | None], ...]:
        """Names of the criteria: of the flag, and the cable from 0 on, or None."""
        return tuple((row.flag.text, row.cables[0] if row.cables else None) for row in self.rows)

    def binding(self) -> np.ndarray:
        """The criterion that binds in each cell.

        Returns:
            (n_cells,) number of the criterion that is nearest to its limit; -1 where none binds.
        """
        nearest = self.high.argmin(1)
        return np.where(self.high[np.arange(len(nearest)), nearest] < BINDING, nearest, -1)


def cell_slacks(problem: Problem, motion: Spline, scene: Scene | None = None) -> CellSlacks:
    """Bounds of the slacks that depend on how fast a motion is, over each of its pieces.

    Args:
        scene: as for `motions.proved_answers.proved_answers`.

    Returns:
        the bounds.
    """
    knots, rows = np.asarray(motion.knots), criteria(problem.robot, problem.limits, scene)
    weight = float(problem.robot.mass * problem.robot.gravity)
    chosen = [k for k, row in enumerate(rows) if row.flag & TENSIONS or row.unit in (SPEEDS, ACCELERATIONS)]
    scales = np.array([weight if rows[k].flag & TENSIONS else rows[k].allowed for k in chosen])
    cell, start, end = np.arange(len(knots) - 1), knots[:-1], knots[1:]
    low = np.full((len(cell), len(chosen)), np.inf)
    high = low.copy()
    for level in range(HALVINGS + 1):
        slacks = block_slacks(problem.robot, problem.limits, motion.bounds, start, end, scene)
        below, above = slacks.low[:, chosen] / scales, slacks.high[:, chosen] / scales
        np.minimum.at(high, cell, above)
        # A block says how much is missed where the lower bound is about as close as the upper one.
        is_loose = ((below < 0.0) & (above - below > LOOSE * np.maximum(-above, LEFT))).any(1) & (level < HALVINGS)
        np.minimum.at(low, cell[~is_loose], below[~is_loose])
        if not is_loose.any():
            break
        cell, middle = np.repeat(cell[is_loose], 2), 0.5 * (start + end)[is_loose]
        start = np.stack([start[is_loose], middle], axis=1).ravel()
        end = np.stack([middle, end[is_loose]], axis=1).ravel()
    return CellSlacks([rows[k] for k in chosen], low, high)
