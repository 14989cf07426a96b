"""Newton's equations of single samples, from which values and multipliers are eliminated (condensed).

With changes dx of the state, changes dv of the values, new multipliers y, and weights W of the bounds,

W dv + M dx + A^T y = value_right          A dv + J dx - S y = equation_right

where S softens the equations: their residual may be S (y - y0), at a price in the objective.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.families.free.search.derivatives import EquationValues
from cspr_jax.numerics.shapes import Float

# A matrix that may be singular within rounding is regularized by this fraction of its trace.
ROUNDED = 1e-14


def transposed(matrix: Float[np.ndarray, "... m n"]) -> Float[np.ndarray, "... n m"]:
    """Transposes of matrices."""
    return np.swapaxes(matrix, -1, -2)


def times(matrix: Float[np.ndarray, "... m n"], vector: Float[np.ndarray, "... n"]) -> Float[np.ndarray, "... m"]:
    """Products of matrices and vectors."""
    return (matrix @ vector[..., None])[..., 0]


class Softness(NamedTuple):
    """How large residuals of equations may be, at a price.

    Fields:
        softness: (l,) diagonal of S for equations other than those of tensions.
        metric: (l, s, m, n, dof, dof) S for the equations of tensions, over `softness`.
        level: (l, s, m, n, n_equations) multipliers y0.
    """

    softness: np.ndarray
    metric: np.ndarray
    level: np.ndarray

    def missed(self, multipliers: Float[np.ndarray, "l s m n n_equations"]) -> np.ndarray:
        """Residuals S y for multipliers y."""
        dof = self.metric.shape[-1]
        parts = times(self.metric, multipliers[..., :dof]), multipliers[..., dof:]
        return self.softness[:, None, None, None, None] * np.concatenate(parts, axis=-1)

    def paid(self, residual: Float[np.ndarray, "l s m n n_equations"]) -> np.ndarray:
        """Multipliers y of residuals S y."""
        dof = self.metric.shape[-1]
        tensions = np.linalg.solve(self.metric, residual[..., :dof, None])[..., 0]
        return np.concatenate([tensions, residual[..., dof:]], axis=-1) / self.softness[:, None, None, None, None]


class Condensed(NamedTuple):
    """Newton's equations in the state alone, hessian dx + gradient = 0, and how the rest follows from dx.

    Fields:
        hessian: (..., n_x, n_x).
        gradient: (..., n_x).
        start: (..., n_values + n_equations) changes of the values, and new multipliers, if the state does not change.
        decrease: (..., n_values + n_equations, n_x) by how much these decrease with the state; first tensions, then
            multipliers of their equations, then other values, then multipliers of theirs.
    """

    hessian: np.ndarray
    gradient: np.ndarray
    start: np.ndarray
    decrease: np.ndarray

    def changes(
        self, step: Float[np.ndarray, "... n_x"], n_cables: int, dof: int
    ) -> tuple[Float[np.ndarray, "... n_values"], Float[np.ndarray, "... n_equations"]]:
        """Changes of the values, and new multipliers, from changes of the state."""
        both = self.start - times(self.decrease, step)
        others = (both.shape[-1] - n_cables - dof) // 2
        parts = np.split(both, np.cumsum([n_cables, dof, others]), axis=-1)
        return np.concatenate(parts[::2], axis=-1), np.concatenate(parts[1::2], axis=-1)


def condensed(
    equations: EquationValues,
    weights: Float[np.ndarray, "... n_values"],
    value_right: Float[np.ndarray, "... n_values"],
    equation_right: Float[np.ndarray, "... n_equations"],
    soft: Softness,
) -> Condensed:
    """Eliminate values and multipliers."""
    matrix, softness = equations.matrix, soft.softness[:, None, None, None, None]
    dof, cables = matrix.shape[-2:]
    system = np.zeros((*weights.shape[:-1], cables + dof, cables + dof))
    numbers = np.arange(cables)
    system[..., numbers, numbers] = weights[..., :cables]
    system[..., :cables, cables:], system[..., cables:, :cables] = transposed(matrix), matrix
    system[..., cables:, cables:] = -softness[..., None] * soft.metric
    left = np.concatenate([equations.mixed, equations.jacobian[..., :dof, :]], axis=-2)
    right = np.concatenate([value_right[..., :cables], equation_right[..., :dof]], axis=-1)
    solved = np.linalg.solve(system, np.concatenate([left, right[..., None]], axis=-1))
    decrease, start = solved[..., :-1], solved[..., -1]
    hessian = equations.hessian - transposed(left) @ decrease
    gradient = times(transposed(left), start)
    # Other values: W dv + y = value_right, dv + J dx - S y = equation_right.
    jacobian, weight = equations.jacobian[..., dof:, :], weights[..., cables:]
    fraction = weight / (1.0 + softness * weight)
    multiplier = (value_right[..., cables:] - weight * equation_right[..., dof:]) / (1.0 + softness * weight)
    hessian = hessian + transposed(jacobian) @ (fraction[..., None] * jacobian)
    gradient = gradient + times(transposed(jacobian), multiplier)
    starts = start, equation_right[..., dof:] + softness * multiplier, multiplier
    falls = decrease, (1.0 - softness * fraction)[..., None] * jacobian, -fraction[..., None] * jacobian
    return Condensed(hessian, gradient, np.concatenate(starts, axis=-1), np.concatenate(falls, axis=-2))


def repaired_values(
    matrix: Float[np.ndarray, "l s m n dof n_cables"],
    weights: Float[np.ndarray, "l s m n n_values"],
    missed: Float[np.ndarray, "l s m n n_equations"],
    soft: Softness,
) -> Float[np.ndarray, "l s m n n_values"]:
    """Changes dv of the values that correct residuals e of the equations while the state stays the same.

    These minimise dv^T W dv + (e + A dv)^T (e + A dv) / S.
    """
    dof, cables = matrix.shape[-2:]
    softness = soft.softness[:, None, None, None, None]
    lighter = matrix / weights[..., None, :cables]
    stiff = lighter @ transposed(matrix) + softness[..., None] * soft.metric
    stiff += ROUNDED * np.trace(stiff, axis1=-2, axis2=-1)[..., None, None] * np.eye(dof)
    correction = np.linalg.solve(stiff, missed[..., :dof, None])[..., 0]
    others = missed[..., dof:] / (1.0 + softness * weights[..., cables:])
    return -np.concatenate([times(transposed(lighter), correction), others], axis=-1)
