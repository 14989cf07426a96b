"""Cells of a workspace: boxes of positions at one orientation, and bounds of functions of the position; no jax.

Let the force density of a cable be its tension over its length, f_i = t_i / L_i(p), and its ray r_i(p) = e_i - p, where
e_i is its base point minus the arm of its attachment point. At one orientation the wrench of a cable is linear in its
ray, A_i r_i, so that W(p) t = w becomes Z(p) f = w, whose columns Z_i(p) = A_i (e_i - p) are affine in the position:
only the lengths are nonlinear, and they enter only the limits of the tensions. With positions p = p0 + H x, where H
contains half of the cell's extents and |x_k| <= 1,

    Z(p) = Z0 - sum_k x_k N_k,        N_k = H_k [A_1 e_k, ..., A_n e_k],

and a solution with a fixed basis is a power series in x. `inside_cells` and `outside_cells` keep its terms of first and
second order and bound the rest by norms. Exits e_i may lie anywhere in balls: with a pulley e_i moves with p, by a
bounded distance, and robots within an uncertainty have displaced spools.

Arrays are (cells, ...); coefficients of first order in x have one axis of length 3, those of second order two.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float, Int

# Rounding error of a sum of up to some hundred products of float64 (2.2e-16 each), as a fraction of its terms, with a
# reserve for rays, arms and rotations that are rounded themselves.
CELL_ERROR = 1e-12


class Cells(NamedTuple):
    """Cells of a robot at one orientation.

    Fields:
        matrices: (n, m, n_cables) Z0 at the centres, moments over a length, m.
        changes: (n, 3, m, n_cables) N_k, m.
        rays: (n, n_cables, 3) vectors from attachment to base points at the centres, m.
        steps: (n, n_cables, 3) unit vectors of the cables times half of the cell's extents, decreases of lengths, m.
        lengths: (n, n_cables) L_i at the centres, m.
        radius: (n,) from centre to corner, m.
        rounding: (n, n_cables) bound of the rounding error of a column of Z, m.
        moves: (n, n_cables) largest distance of exits from their positions at the centres, m.
        wrenches: (n, 3, m, n_cables) A_i.
    """

    matrices: np.ndarray
    changes: np.ndarray
    rays: np.ndarray
    steps: np.ndarray
    lengths: np.ndarray
    radius: np.ndarray
    rounding: np.ndarray
    moves: np.ndarray
    wrenches: np.ndarray

    @property
    def column_changes(self) -> np.ndarray:
        """Bound of the change of a column of Z by movements of its exit, (n, n_cables), m."""
        return self.moves * np.sqrt((self.wrenches**2).sum((1, 2)))

    @property
    def shortest(self) -> np.ndarray:
        """Lower bound of the lengths over the cells, (n, n_cables), m; not positive where there is no bound."""
        return (self.lengths - self.radius[:, None]) * (1.0 - CELL_ERROR) - self.rounding - self.moves

    def take(self, chosen: Int[np.ndarray, "k"]) -> "Cells":
        """Some of the cells."""
        return Cells(*(values[chosen] for values in self))


def cells_about(
    centres: Float[np.ndarray, "n 3"],
    half: Float[np.ndarray, "n 3"],
    exits: Float[np.ndarray, "n n_cables 3"],
    wrenches: Float[np.ndarray, "3 m n_cables"],
    moves: Float[np.ndarray, "n n_cables"],
) -> Cells:
    """Cells about centres."""
    rays = exits - centres[:, None]
    lengths = np.linalg.norm(rays, axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = rays * half[:, None] / lengths[..., None]
    matrices = (rays.transpose(0, 2, 1)[:, :, None] * wrenches).sum(1)
    spans = np.linalg.norm(exits, axis=2) + np.linalg.norm(centres, axis=1)[:, None]
    rounding = CELL_ERROR * np.sqrt((wrenches**2).sum((0, 1))) * spans
    changes, each = half[:, :, None, None] * wrenches, np.broadcast_to(wrenches, (len(centres), *wrenches.shape))
    return Cells(matrices, changes, rays, steps, lengths, np.linalg.norm(half, axis=1), rounding, moves, each)


def largest_linear(linear: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "..."]:
    """Largest value of a linear function over the cells."""
    return np.abs(linear).sum(-1)


def smallest_quadratic(quadratic: Any) -> Any:
    """Lower bound of a quadratic form over the cells, as the sum of bounds of all products of two components."""
    squares = quadratic.diagonal(axis1=-2, axis2=-1).clip(max=0.0).sum(-1)
    both = quadratic + quadratic.swapaxes(-1, -2)
    return squares - abs(both[..., (0, 0, 1), (1, 2, 2)]).sum(-1)


def norm_bound(vectors: Float[np.ndarray, "n 3 ..."]) -> Float[np.ndarray, "n"]:
    """Bound of the norm of a linear function over the cells: Euclidean for vectors, Frobenius for matrices."""
    rows = vectors.reshape(*vectors.shape[:2], math.prod(vectors.shape[2:]))
    return np.sqrt(np.abs(rows @ rows.transpose(0, 2, 1)).sum((1, 2)))


def pair_norm(vectors: Float[np.ndarray, "n 3 3 m"]) -> Float[np.ndarray, "n"]:
    """Bound of the Euclidean norm of a quadratic function over the cells."""
    both = vectors + vectors.transpose(0, 2, 1, 3)
    norms = np.linalg.norm(both, axis=3)
    return 0.5 * norms.sum((1, 2))


def inverse_factor(squares: Float[np.ndarray, "n m m"]) -> Float[np.ndarray, "n m m"]:
    """Inverse of the lower Cholesky factor of symmetric matrices, without an error for indefinite ones."""
    n = squares.shape[1]
    left = np.ascontiguousarray(squares.transpose(1, 2, 0))
    inverse = np.zeros_like(left)
    with np.errstate(all="ignore"):
        for k in range(n):
            scale = 1.0 / np.sqrt(left[k, k])
            column = left[k:, k] * scale
            inverse[k, k] = 1.0
            inverse[k, : k + 1] *= scale
            for i in range(k + 1, n):
                left[i, k + 1 : i + 1] -= column[i - k] * column[1 : i - k + 1]
                inverse[i, : k + 1] -= column[i - k] * inverse[k, : k + 1]
    return inverse.transpose(2, 0, 1)
