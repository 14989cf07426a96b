"""Cells in which tensions stay within limits at every position, from tensions at the centre; no jax.

With force densities f0 at the centre, Z0 f0 = w, and weights D, the force densities

    f(x) = f0 + D U^T (I - T)^-1 j,    C^-1 Z0 D = U,    T = sum_k x_k T_k,    j = sum_k x_k j_k,
    T_k = C^-1 N_k D U^T,    j_k = C^-1 N_k f0

satisfy Z(x) f(x) = w, where C C^T = Z0 D^2 Z0^T, so that U has orthonormal rows: to first order, the change of f from
f0 has the smallest sum of (df_i / D_i)^2. D_i is the distance of f0_i from its limits, so that tensions near a limit
hardly change. Then

    f_i(x) = f0_i + D_i (U_i . j + U_i . T j + e_i),    |e_i| <= |U_i| |T| |T j| / (1 - |T|),

and the tension is its product with L_i(x), which lies between L0_i - u_i . dp and the same plus
|dp|^2 / (2 (L0_i - |dp|)). Where exits may be displaced by s_i, -A_i s_i f0_i adds to C j, and u_i . s_i to the length:
both effects of an exit on a tension are added as vectors, so that a displacement along the exit's own cable has no
effect to first order; all other effects are bounded by norms. The bounds allow for rounding of C, because of which
C^-1 Z0 D U^T is not exactly I and Z0 f0 not exactly w. Where |T| < 1 the rank of Z(x) is full, too, since
C^-1 Z(x) D U^T = I - T.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.workspaces.cells.cells import (
    CELL_ERROR,
    Cells,
    inverse_factor,
    largest_linear,
    norm_bound,
    pair_norm,
    smallest_quadratic,
)


class _DensityChange(NamedTuple):
    # Relative change of the force densities over a cell: terms of first and second order in x, terms of first order in
    # displacements of exits, and a bound of the rest.
    linear: np.ndarray  # (n, n_cables, 3)
    quadratic: np.ndarray  # (n, n_cables, 3, 3)
    exits: np.ndarray  # (n, n_cables, n_exits, 3) 1/m
    rest: np.ndarray  # (n, n_cables)

    @property
    def second(self) -> np.ndarray:
        """Bound of the absolute value of the term of second order, (n, n_cables)."""
        return -np.minimum(smallest_quadratic(self.quadratic), smallest_quadratic(-self.quadratic))


def lower_margins(
    cells: Cells,
    tensions: Float[np.ndarray, "n n_cables"],
    wrench: Float[np.ndarray, "m"],
    low: Float[np.ndarray, "n_cables"],
    high: Float[np.ndarray, "n_cables"],
) -> Float[np.ndarray, "n"]:
    """Lower bounds of the tension margin over cells."""
    minimum, maximum = tension_bounds(cells, tensions, wrench, low, high)
    with np.errstate(invalid="ignore"):
        below = np.where(np.isfinite(high), high - maximum, np.inf)
    margin = np.minimum(minimum - low, below).min(1)
    return np.where(np.isnan(margin), -np.inf, margin)


def tension_bounds(
    cells: Cells,
    tensions: Float[np.ndarray, "n n_cables"],
    wrench: Float[np.ndarray, "m"],
    low: Float[np.ndarray, "n_cables"],
    high: Float[np.ndarray, "n_cables"],
) -> tuple[Float[np.ndarray, "n n_cables"], Float[np.ndarray, "n n_cables"]]:
    """Bounds of tensions that give a wrench at all positions of cells."""
    with np.errstate(all="ignore"):
        densities = tensions / cells.lengths
        weights = np.minimum(tensions - low, high - tensions) / cells.lengths
        change = _density_change(cells, densities, weights, wrench)
        minimum, maximum = _tension_range(cells, densities, weights, change)
        lost = CELL_ERROR * (np.abs(tensions) + np.abs(low) + np.where(np.isfinite(high), np.abs(high), 0.0))
        is_known = ((weights > 0.0) & (cells.shortest > 0.0) & np.isfinite(change.rest)).all(1, keepdims=True)
        return np.where(is_known, minimum - lost, -np.inf), np.where(is_known, maximum + lost, np.inf)


def _density_change(cells: Cells, densities: np.ndarray, weights: np.ndarray, wrench: np.ndarray) -> _DensityChange:
    weighted = cells.matrices * weights[:, None]
    inverse = inverse_factor(weighted @ weighted.transpose(0, 2, 1))
    rows = inverse @ weighted  # U
    back = rows.transpose(0, 2, 1)
    changes = inverse[:, None] @ cells.changes
    operators = (changes * weights[:, None, None]) @ back[:, None]  # T_k
    first = (changes @ densities[:, None, :, None])[..., 0]  # j_k
    second = (operators[:, :, None] @ first[:, None, ..., None])[..., 0]  # T_k j_l
    # Bound C^-1 Z0 D U^T - I and C^-1 (Z0 f0 - w), which are not zero only because of rounding.
    inverse_norm = np.linalg.norm(inverse, axis=(1, 2))
    parts = np.linalg.norm(weighted, axis=(1, 2)) + norm_bound(cells.changes * weights[:, None, None])
    lost = inverse_norm * np.linalg.norm(rows, axis=(1, 2)) * (CELL_ERROR * parts + _length(cells.rounding * weights))
    defect = np.linalg.norm(rows @ back - np.eye(rows.shape[1]), axis=(1, 2))
    off, exits = np.zeros(len(inverse_norm)), np.zeros((*densities.shape, densities.shape[1], 3))
    if cells.moves.any():
        moved = -inverse[:, None] @ cells.wrenches  # (n, 3, m, n_exits)
        maximum = np.linalg.norm(moved, axis=(1, 2)) * cells.moves
        off = (maximum * densities).sum(1)
        exits = (back[:, None] @ (moved * densities[:, None, None])).transpose(0, 2, 3, 1)
        lost = lost + np.sqrt(1.0 + defect) * _length(maximum * weights)
    defect = defect + lost
    supplied = (cells.matrices @ densities[..., None])[..., 0]
    sizes = np.abs(cells.matrices) @ np.abs(densities)[..., None]
    hidden = CELL_ERROR * (_length(sizes[..., 0]) + _length(wrench)) + (cells.rounding * np.abs(densities)).sum(1)
    residual = _length((inverse @ (supplied - wrench)[..., None])[..., 0]) + inverse_norm * hidden
    norm, start = norm_bound(operators) + defect, norm_bound(first)
    after = np.where(norm < 1.0, 1.0 / (1.0 - norm), np.inf)
    late = np.minimum(pair_norm(second), norm_bound(operators) * start) + defect * start
    rest = defect * start + norm * after * (late + off) + after * residual
    columns = _length(back)
    linear, quadratic = (first @ rows).transpose(0, 2, 1), _by_cable(second @ rows[:, None])
    return _DensityChange(linear, quadratic, exits, columns * rest[:, None])


def _over_exits(cells: Cells, effects: np.ndarray) -> np.ndarray:
    # Largest sums, (n, n_cables), of effects (n, n_cables, n_exits, 3) of exits within their balls.
    return (_length(effects) * cells.moves[:, None]).sum(2)


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((vectors * vectors).sum(-1))


def _by_cable(values: np.ndarray) -> np.ndarray:
    return np.moveaxis(values, -1, 1)


def _tension_range(
    cells: Cells, densities: np.ndarray, weights: np.ndarray, change: _DensityChange
) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest tensions over cells, (n, n_cables) each."""
    lengths, shortening = cells.lengths, largest_linear(cells.steps)
    second = change.second
    moved = _over_exits(cells, change.exits)
    spread = weights * (largest_linear(change.linear) + second + moved + change.rest)
    lowest, highest = densities - spread, densities + spread
    # Expand (L0 - u . dp) f as a whole, since terms of first order may cancel.
    relative = weights * lengths
    linear = relative[..., None] * change.linear - densities[..., None] * cells.steps
    mixed = cells.steps[..., :, None] * change.linear[..., None, :]
    quadratic = relative[..., None, None] * change.quadratic - weights[..., None, None] * mixed
    rest = weights * (shortening * (second + moved) + (lengths + shortening) * change.rest)
    middle = lengths * densities
    lengthened = np.eye(lengths.shape[1])[None, ..., None] * (cells.rays * (densities / lengths)[..., None])[:, :, None]
    rest = rest + _over_exits(cells, relative[..., None, None] * change.exits + lengthened) + cells.moves * spread
    minimum = middle - largest_linear(linear) + smallest_quadratic(quadratic) - rest
    maximum = middle + largest_linear(linear) - smallest_quadratic(-quadratic) + rest
    radius = cells.radius[:, None]
    longest = lengths + radius + cells.moves
    minimum = np.where(lowest >= 0.0, np.maximum(minimum, cells.shortest * lowest), longest * lowest)
    maximum = np.minimum(maximum + 0.5 * (radius + cells.moves) ** 2 / cells.shortest * highest, longest * highest)
    return minimum, np.where(highest >= 0.0, maximum, 0.0)
