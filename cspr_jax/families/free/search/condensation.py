"""Newton's equations of single instants, from which values and multipliers are eliminated.

With changes dx of the state, dv of the values and new multipliers y, and the weights W of the bounds,

    W dv + M dx + A^T y = push          A dv + J dx - S y = aim

where S softens the equations: they may be missed by S (y - y0), which the objective pays for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cspr_jax.families.free.search.derivatives import InstantValues

if TYPE_CHECKING:
    from jaxtyping import Float

# Part of its trace that keeps a matrix regular which is only so within rounding.
ROUNDED = 1e-14


def transposed(matrix: Float[np.ndarray, "... m n"]) -> Float[np.ndarray, "... n m"]:
    """Transposes."""
    return np.swapaxes(matrix, -1, -2)


def times(matrix: Float[np.ndarray, "... m n"], vector: Float[np.ndarray, "... n"]) -> Float[np.ndarray, "... m"]:
    """Products with vectors."""
    return (matrix @ vector[..., None])[..., 0]


class Softness(NamedTuple):
    """How far equations may be missed, for a price.

    Fields:
        size: (l,) S of the other values.
        metric: (l, s, m, n, dof, dof) S of the tensions over `size`.
        level: (l, s, m, n, n_equations) multipliers y0.
    """

    size: np.ndarray
    metric: np.ndarray
    level: np.ndarray

    def missed(self, multipliers: Float[np.ndarray, "l s m n n_equations"]) -> np.ndarray:
        """S times vectors."""
        dof = self.metric.shape[-1]
        parts = times(self.metric, multipliers[..., :dof]), multipliers[..., dof:]
        return self.size[:, None, None, None, None] * np.concatenate(parts, axis=-1)

    def paid(self, residual: Float[np.ndarray, "l s m n n_equations"]) -> np.ndarray:
        """Vectors over S."""
        dof = self.metric.shape[-1]
        tensions = np.linalg.solve(self.metric, residual[..., :dof, None])[..., 0]
        return np.concatenate([tensions, residual[..., dof:]], axis=-1) / self.size[:, None, None, None, None]


class Eliminated(NamedTuple):
    """Newton's equations in the state alone, bend dx + slope = 0, and what follows from dx.

    Fields:
        second_derivative: (..., n_x, n_x).
        slope: (..., n_x).
        start: (..., n_values + n_equations) changes of the values and new multipliers where the state stays.
        fall: (..., n_values + n_equations, n_x) by how much they fall with the state; tensions, then multipliers of
            their equations, then other values, then theirs.
    """

    second_derivative: np.ndarray
    slope: np.ndarray
    start: np.ndarray
    fall: np.ndarray

    def changes(
        self, step: Float[np.ndarray, "... n_x"], n_cables: int, dof: int
    ) -> tuple[Float[np.ndarray, "... n_values"], Float[np.ndarray, "... n_equations"]]:
        """Changes of the values, and new multipliers."""
        both = self.start - times(self.fall, step)
        others = (both.shape[-1] - n_cables - dof) // 2
        parts = np.split(both, np.cumsum([n_cables, dof, others]), axis=-1)
        return np.concatenate(parts[::2], axis=-1), np.concatenate(parts[1::2], axis=-1)


def eliminated(
    equations: InstantValues,
    weights: Float[np.ndarray, "... n_values"],
    push: Float[np.ndarray, "... n_values"],
    aim: Float[np.ndarray, "... n_equations"],
    soft: Softness,
) -> Eliminated:
    """Eliminate values and multipliers."""
    matrix, size = equations.matrix, soft.size[:, None, None, None, None]
    dof, cables = matrix.shape[-2:]
    system = np.zeros((*weights.shape[:-1], cables + dof, cables + dof))
    numbers = np.arange(cables)
    system[..., numbers, numbers] = weights[..., :cables]
    system[..., :cables, cables:], system[..., cables:, :cables] = transposed(matrix), matrix
    system[..., cables:, cables:] = -size[..., None] * soft.metric
    left = np.concatenate([equations.mixed, equations.slope[..., :dof, :]], axis=-2)
    right = np.concatenate([push[..., :cables], aim[..., :dof]], axis=-1)
    solved = np.linalg.solve(system, np.concatenate([left, right[..., None]], axis=-1))
    fall, start = solved[..., :-1], solved[..., -1]
    second_derivative = equations.second_derivative - transposed(left) @ fall
    slope = times(transposed(left), start)
    # Other values: W dv + y = push, dv + J dx - S y = aim.
    jacobian, weight = equations.slope[..., dof:, :], weights[..., cables:]
    fraction = weight / (1.0 + size * weight)
    multiplier = (push[..., cables:] - weight * aim[..., dof:]) / (1.0 + size * weight)
    second_derivative = second_derivative + transposed(jacobian) @ (fraction[..., None] * jacobian)
    slope = slope + times(transposed(jacobian), multiplier)
    starts = start, aim[..., dof:] + size * multiplier, multiplier
    falls = fall, (1.0 - size * fraction)[..., None] * jacobian, -fraction[..., None] * jacobian
    return Eliminated(second_derivative, slope, np.concatenate(starts, axis=-1), np.concatenate(falls, axis=-2))


def less_missed(
    matrix: Float[np.ndarray, "l s m n dof n_cables"],
    weights: Float[np.ndarray, "l s m n n_values"],
    missed: Float[np.ndarray, "l s m n n_equations"],
    soft: Softness,
) -> Float[np.ndarray, "l s m n n_values"]:
    """Changes dv of the values that make up for what equations miss, e, with the state as it is.

    They make dv^T W dv + (e + A dv)^T (e + A dv) / S least.
    """
    dof, cables = matrix.shape[-2:]
    size = soft.size[:, None, None, None, None]
    lighter = matrix / weights[..., None, :cables]
    stiff = lighter @ transposed(matrix) + size[..., None] * soft.metric
    stiff += ROUNDED * np.trace(stiff, axis1=-2, axis2=-1)[..., None, None] * np.eye(dof)
    push = np.linalg.solve(stiff, missed[..., :dof, None])[..., 0]
    others = missed[..., dof:] / (1.0 + size * weights[..., cables:])
    return -np.concatenate([times(transposed(lighter), push), others], axis=-1)
