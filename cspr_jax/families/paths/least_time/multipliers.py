"""Multipliers that make the lower bound of the least time close: those of a discrete problem with this bound as dual.

With multipliers that are linear between nodes, the bound of `families.paths.least_time.duality` is the dual of a
problem in which x = s'^2 is constant in each cell. Half-planes hold at the nodes, where u is the difference of x in the
adjacent cells over the sum of their widths, and x is their mean weighted by the widths. The only unknowns are x of the
cells, so an interior-point method needs only a tridiagonal matrix.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded

from cspr_jax.families.paths.least_time.interior_point import interior_point
from cspr_jax.numerics.shapes import Float

# The search starts from these fractions of the x of a motion, in order: near limits it may get stuck.
STARTS = (0.8, 0.4, 1.0)


class SideHalfPlanes(NamedTuple):
    """Half-planes at the nodes, u_coefficient u + x_coefficient x <= bound, and caps of the cells.

    Where the two sides of a node differ, the half-planes of both hold.

    Fields:
        u: (n_rows, n_nodes) coefficients of u.
        before: (n_rows, n_nodes) coefficients of x at the end of the previous cell.
        after: (n_rows, n_nodes) coefficients of x at the start of the next cell.
        bound: (n_rows, n_nodes) bounds.
        cap: (n_nodes - 1,) largest x of each cell.
        width: (n_nodes - 1,) widths of the cells, m.
    """

    u: np.ndarray
    before: np.ndarray
    after: np.ndarray
    bound: np.ndarray
    cap: np.ndarray
    width: np.ndarray


def dual_multipliers(
    half_planes: SideHalfPlanes, ends: tuple[float, float], start: Float[np.ndarray, "n_nodes-1"]
) -> tuple[Float[np.ndarray, "n_rows n_nodes"], Float[np.ndarray, "n_nodes-1"]]:
    """Multipliers of the half-planes and of the caps."""
    problem = _Staggered(half_planes, ends)
    for fraction in STARTS:
        optimum = interior_point(problem, fraction * start)
        if optimum.is_optimal:
            break
    of_nodes, of_cells = problem.parts(optimum.multipliers)
    return of_nodes / problem.weights, of_cells / (half_planes.cap * half_planes.width)


class _Staggered:
    # Constraints at nodes: before x0 + after x1 <= bound, with x of the adjacent cells; those of cells: x / cap <= 1.
    def __init__(self, half_planes: SideHalfPlanes, ends: tuple[float, float]) -> None:
        self.width, self.cap = half_planes.width, half_planes.cap
        sides = np.concatenate([[0.0], self.width]), np.concatenate([self.width, [0.0]])
        both = sides[0] + sides[1]
        self.weights = 0.5 * both
        self.before, self.after = (
            (-half_planes.u + half_planes.before * sides[0]) / both,
            (half_planes.u + half_planes.after * sides[1]) / both,
        )
        self.bound = half_planes.bound.copy()
        self.bound[:, 0] += half_planes.u[:, 0] * ends[0] / self.width[0]
        self.bound[:, -1] -= half_planes.u[:, -1] * ends[1] / self.width[-1]

    def parts(self, constraints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return constraints[: self.bound.size].reshape(self.bound.shape), constraints[self.bound.size :]

    def value(self, z: np.ndarray) -> float:
        return float(np.sum(self.width / np.sqrt(z)))

    def positive(self, z: np.ndarray) -> np.ndarray:
        return z

    def slacks(self, z: np.ndarray) -> np.ndarray:
        return np.append(self.bound, np.ones_like(z)) + self.change(z, z)

    def change(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        total = np.zeros_like(self.bound)
        total[:, 1:] -= self.before[:, 1:] * step
        total[:, :-1] -= self.after[:, :-1] * step
        return np.append(total, -step / self.cap)

    def jt_multipliers(self, z: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        of_nodes, caps = self.parts(multipliers)
        return np.sum((self.before * of_nodes)[:, 1:] + (self.after * of_nodes)[:, :-1], axis=0) + caps / self.cap

    def residual(self, z: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        return self.jt_multipliers(z, multipliers) - 0.5 * self.width * z**-1.5

    def solved(self, z: np.ndarray, weights: np.ndarray, right: np.ndarray) -> np.ndarray:
        of_nodes, caps = self.parts(weights)
        banded = np.zeros((2, len(z)))
        banded[1] = 0.75 * self.width * z**-2.5 + caps / self.cap**2
        banded[1] += np.sum((of_nodes * self.before**2)[:, 1:] + (of_nodes * self.after**2)[:, :-1], axis=0)
        banded[0, 1:] = np.sum((of_nodes * self.before * self.after)[:, 1:-1], axis=0)
        return solveh_banded(banded, right, check_finite=False)
