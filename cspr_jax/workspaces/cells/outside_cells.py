"""Cells in which no tensions within limits suffice at any position, from the worst facet normal at the centre; no jax.

Let c be normal to dof - 1 columns S of Z at all x: c(x) . Z_S(x) = 0. These cables have no effect along c, and the
wrench cannot be supplied at x if

    c(x) . w > sum over the others of the largest of low_j y_j and high_j y_j,    y_j = c(x) . Z_j(x) / L_j(x)

(with high_j = inf: y_j <= 0); and no wrench along -c can be supplied where all y_j are >= 0. With M = [W_S, c0] and
M C^-T = Q, which has orthonormal columns,

    c(x) = Q g(x),    g^T = e^T (I - K)^-1,    K = sum_k x_k K_k,    K_k = Q^T [N_kS / L_S, 0] C^-T,

where e is the last unit vector, so that with z_j = Q^T Z_j0 and its change a_j = sum_k x_k Q^T N_k e_j

    c(x) . Z_j(x) = e . z_j + e . v_j + e . K v_j + rest_j,    v_j = K z_j - a_j,
    |rest_j| <= |e^T K| |K| |v_j| / (1 - |K|).

Inverse lengths are L0 / L = 1 + u . dp / L0 + rest, |rest| <= |dp|^2 L0 / (L0 - |dp|)^3, since the second derivatives
of 1 / L have norm 2 / L^3. The bounds allow for rounding of Q, because of which Q^T Q is not exactly I. Where no cable
is nearly normal to c, a fixed c serves as well (K = 0), and the products are affine.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Bool, Float, Int
from cspr_jax.workspaces.cells.cells import (
    CELL_ERROR,
    Cells,
    inverse_factor,
    largest_linear,
    norm_bound,
    smallest_quadratic,
)


class Products(NamedTuple):
    """Products of c(x) with the columns of Z(x), over lengths at the centre, and, as the last one, with the wrench.

    Fields:
        value: (n, n_cables + 1) products at the centres.
        linear: (n, n_cables + 1, 3) coefficients of first order in x.
        quadratic: (n, n_cables + 1, 3, 3) coefficients of second order.
        rest: (n, n_cables + 1) bounds of all higher orders.
    """

    value: np.ndarray
    linear: np.ndarray
    quadratic: np.ndarray
    rest: np.ndarray

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest values over the cells, (n, n_cables + 1) each."""
        spread = largest_linear(self.linear) + self.rest
        return (
            self.value - spread + smallest_quadratic(self.quadratic),
            self.value + spread - smallest_quadratic(-self.quadratic),
        )


def are_beyond(
    cells: Cells,
    normals: Float[np.ndarray, "n m"],
    held: Int[np.ndarray, "n m-1"] | None,
    wrenches: Float[np.ndarray, "n m"],
    low: Float[np.ndarray, "n_cables"],
    high: Float[np.ndarray, "n_cables"],
) -> Bool[np.ndarray, "n"]:
    """Tell whether no tensions can supply a wrench at any position of cells."""
    with np.errstate(all="ignore"):
        products, others = products_of(cells, normals, held, wrenches), _others(cells, held)
        minimum, maximum = (side[:, :-1] for side in products.ends)
        # The sign at the centre selects the limit of each other cable; where the sign may change, the slack is reduced.
        is_positive = products.value[:, :-1] > 0.0
        is_bounded = np.isfinite(high)
        limits = np.where(others, np.where(is_positive & is_bounded, high, low), 0.0)
        wrong = np.maximum(np.where(is_positive, -minimum, maximum), 0.0)
        is_kept = (~others | is_bounded | (maximum <= 0.0)).all(1)
        width = np.where(is_bounded, high - low, 0.0)
        cost = np.where(others, width * wrong * cells.lengths / cells.shortest, 0.0).sum(1)
        slack = lower_slacks(cells, products, limits) - cost
        scale = (np.abs(limits) * np.abs(products.value[:, :-1])).sum(1) + np.abs(products.value[:, -1])
        return is_kept & (cells.shortest > 0.0).all(1) & (slack > CELL_ERROR * scale)


def are_one_sided(
    cells: Cells, normals: Float[np.ndarray, "n m"], held: Int[np.ndarray, "n m-1"] | None
) -> Bool[np.ndarray, "n"]:
    """Tell whether at every position of cells there is a wrench that cables cannot resist."""
    with np.errstate(all="ignore"):
        products = products_of(cells, normals, held, np.zeros_like(normals))
        minimum = products.ends[0][:, :-1]
        is_proved = (~_others(cells, held) | (minimum > CELL_ERROR * np.abs(products.value[:, :-1]))).all(1)
        return is_proved & (cells.shortest > 0.0).all(1)


def _others(cells: Cells, held: np.ndarray | None) -> np.ndarray:
    others = np.ones(cells.lengths.shape, bool)
    if held is not None:
        np.put_along_axis(others, held, False, axis=1)
    return others


def products_of(
    cells: Cells,
    normals: Float[np.ndarray, "n m"],
    held: Int[np.ndarray, "n m-1"] | None,
    wrenches: Float[np.ndarray, "n m"],
) -> Products:
    """Products of a normal that stays normal to the cables S, or of a fixed one where that suffices."""
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    units = np.concatenate([cells.matrices / cells.lengths[:, None], wrenches[..., None]], axis=2)
    changes = cells.changes / cells.lengths[:, None, None]
    none = np.zeros((*changes.shape[:3], 1))
    changes = np.concatenate([changes, none], axis=3)
    rounding = np.concatenate(
        [(cells.rounding + cells.column_changes) / cells.lengths, np.zeros((len(normals), 1))], axis=1
    )
    rounding = rounding + CELL_ERROR * np.maximum(np.linalg.norm(units, axis=1), 1.0)
    if held is None:
        return _with_fixed_normal(normals, units, changes, rounding)
    return _with_moving_normal(normals, held, units, changes, rounding)


def _with_fixed_normal(normals: np.ndarray, units: np.ndarray, changes: np.ndarray, rounding: np.ndarray) -> Products:
    # Products of a fixed normal c, which are affine.
    value, linear = (normals[:, None] @ units)[:, 0], -(normals[:, None, None] @ changes)[:, :, 0]
    nothing = np.zeros((*value.shape, 3, 3))
    return Products(value, linear.transpose(0, 2, 1), nothing, rounding + CELL_ERROR * np.abs(linear).sum(1))


def _with_moving_normal(
    normals: np.ndarray, held: np.ndarray, units: np.ndarray, changes: np.ndarray, rounding: np.ndarray
) -> Products:
    # Products of a normal c that turns so that it stays normal to the cables S.
    frame = np.concatenate([np.take_along_axis(units, held[:, None], axis=2), normals[..., None]], axis=2)
    inverse = inverse_factor(frame.transpose(0, 2, 1) @ frame).transpose(0, 2, 1)  # C^-T
    rows = (frame @ inverse).transpose(0, 2, 1)  # Q^T
    moved = np.take_along_axis(changes, held[:, None, None], axis=3) @ inverse[:, None, :-1]
    operators = rows[:, None] @ moved  # K_k
    inverse_norm, count = np.linalg.norm(inverse, axis=(1, 2)), frame.shape[2]
    lost = np.linalg.norm(rounding[:, :-1], axis=1) + CELL_ERROR * norm_bound(changes)
    defect = (
        np.linalg.norm(rows @ rows.transpose(0, 2, 1) - np.eye(count), axis=(1, 2))
        + np.sqrt(count) * inverse_norm * lost
    )
    columns, shifts = rows @ units, rows[:, None] @ changes
    first = operators @ columns[:, None] - shifts  # v_j
    last = operators[:, :, -1]  # e^T K_k
    norm = (norm_bound(operators) + defect)[:, None]
    after, defect, first_norms = np.where(norm < 1.0, 1.0 / (1.0 - norm), np.inf), defect[:, None], _norms(first)
    rest = norm_bound(last)[:, None] * norm * after * first_norms
    rest = rest + after**2 * defect * (np.linalg.norm(columns, axis=1) + _norms(shifts)) + after * rounding
    quadratic = last[:, :, None, None] @ first[:, None]
    return Products(columns[:, -1], first[:, :, -1].transpose(0, 2, 1), np.moveaxis(quadratic[..., 0, :], -1, 1), rest)


def _norms(vectors: np.ndarray) -> np.ndarray:
    # Bound the norms of linear functions of x, (n, 3, m, k), over the cells, (n, k).
    columns = vectors.transpose(0, 3, 1, 2)
    return np.sqrt(np.abs(columns @ columns.transpose(0, 1, 3, 2)).sum((2, 3)))


def lower_slacks(cells: Cells, products: Products, limits: Float[np.ndarray, "n n_cables"]) -> Float[np.ndarray, "n"]:
    """Lower bounds over cells of the component along c of a wrench minus the wrench of some tensions."""
    steps = cells.steps / cells.lengths[..., None]  # terms of first order of L0 / L
    value, linear, quadratic = products.value[:, :-1], products.linear[:, :-1], products.quadratic[:, :-1]
    second = -np.minimum(smallest_quadratic(quadratic), smallest_quadratic(-quadratic))
    middle = products.value[:, -1] - (limits * value).sum(1)
    along = products.linear[:, -1] - (limits[..., None] * (linear + value[..., None] * steps)).sum(1)
    deviation = quadratic + linear[..., :, None] * steps[..., None, :]
    quadratic_terms = products.quadratic[:, -1] - (limits[..., None, None] * deviation).sum(1)
    shift, radius = largest_linear(steps), cells.radius[:, None]
    inverse_rest = radius**2 * cells.lengths / cells.shortest**3 + cells.moves * cells.lengths / cells.shortest**2
    cable_rests = products.rest[:, :-1]
    maximum = np.abs(value) + largest_linear(linear) + second + cable_rests
    rest = cable_rests * (1.0 + shift) + second * shift + maximum * inverse_rest
    rest = products.rest[:, -1] + (np.abs(limits) * rest).sum(1)
    return middle - largest_linear(along) + smallest_quadratic(quadratic_terms) - rest
