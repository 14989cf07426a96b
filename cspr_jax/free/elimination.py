"""Newton's equations of single instants, from which values and multipliers are eliminated.

With changes dx of the state, dv of the values and new multipliers y, and the weights W of the bounds,

    W dv + M dx + A^T y = push          A dv + J dx - S y = aim

where S softens the equations: they may be missed by S (y - y0), which the objective pays for.
"""

from typing import NamedTuple

import numpy as np

from cspr_jax.free.derivatives import InstantValues

# Part of its trace that keeps a matrix regular which is only so within rounding.
ROUNDED = 1e-14


def transposed(matrix: np.ndarray) -> np.ndarray:
    """Transposes.

    Args:
        matrix: (..., m, n).

    Returns:
        (..., n, m).
    """
    return np.swapaxes(matrix, -1, -2)


def times(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Products with vectors.

    Args:
        matrix: (..., m, n).
        vector: (..., n).

    Returns:
        (..., m).
    """
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

    def missed(self, multipliers: np.ndarray) -> np.ndarray:
        """S times vectors.

        Args:
            multipliers: (l, s, m, n, n_equations).

        Returns:
            likewise.
        """
        dof = self.metric.shape[-1]
        parts = times(self.metric, multipliers[..., :dof]), multipliers[..., dof:]
        return self.size[:, None, None, None, None] * np.concatenate(parts, axis=-1)

    def paid(self, residual: np.ndarray) -> np.ndarray:
        """Vectors over S.

        Args:
            residual: (l, s, m, n, n_equations).

        Returns:
            likewise.
        """
        dof = self.metric.shape[-1]
        tensions = np.linalg.solve(self.metric, residual[..., :dof, None])[..., 0]
        return np.concatenate([tensions, residual[..., dof:]], axis=-1) / self.size[:, None, None, None, None]


class Eliminated(NamedTuple):
    """Newton's equations in the state alone, bend dx + slope = 0, and what follows from dx.

    Fields:
        bend: (..., n_x, n_x).
        slope: (..., n_x).
        start: (..., n_values + n_equations) changes of the values and new multipliers where the state stays.
        fall: (..., n_values + n_equations, n_x) by how much they fall with the state; tensions, then multipliers of
            their equations, then other values, then theirs.
    """

    bend: np.ndarray
    slope: np.ndarray
    start: np.ndarray
    fall: np.ndarray

    def changes(self, step: np.ndarray, n_cables: int, dof: int) -> tuple[np.ndarray, np.ndarray]:
        """Changes of the values, and new multipliers.

        Args:
            step: (..., n_x).
            n_cables: number of tensions.
            dof: number of their equations.

        Returns:
            (..., n_values), (..., n_equations).
        """
        both = self.start - times(self.fall, step)
        others = (both.shape[-1] - n_cables - dof) // 2
        parts = np.split(both, np.cumsum([n_cables, dof, others]), axis=-1)
        return np.concatenate(parts[::2], axis=-1), np.concatenate(parts[1::2], axis=-1)


def eliminated(
    equations: InstantValues, weights: np.ndarray, push: np.ndarray, aim: np.ndarray, soft: Softness
) -> Eliminated:
    """Eliminate values and multipliers.

    Args:
        weights: (..., n_values) W.
        push: (..., n_values).
        aim: (..., n_equations).

    Returns:
        the equations that are left.
    """
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
    bend = equations.bend - transposed(left) @ fall
    slope = times(transposed(left), start)
    # Other values: W dv + y = push, dv + J dx - S y = aim.
    jacobian, weight = equations.slope[..., dof:, :], weights[..., cables:]
    share = weight / (1.0 + size * weight)
    multiplier = (push[..., cables:] - weight * aim[..., dof:]) / (1.0 + size * weight)
    bend = bend + transposed(jacobian) @ (share[..., None] * jacobian)
    slope = slope + times(transposed(jacobian), multiplier)
    starts = start, aim[..., dof:] + size * multiplier, multiplier
    falls = fall, (1.0 - size * share)[..., None] * jacobian, -share[..., None] * jacobian
    return Eliminated(bend, slope, np.concatenate(starts, axis=-1), np.concatenate(falls, axis=-2))


def less_missed(matrix: np.ndarray, weights: np.ndarray, missed: np.ndarray, soft: Softness) -> np.ndarray:
    """Changes dv of the values that make up for what equations miss, e, with the state as it is.

    They make dv^T W dv + (e + A dv)^T (e + A dv) / S least.

    Args:
        matrix: (l, s, m, n, dof, n_cables) A of the tensions.
        weights: (l, s, m, n, n_values) W.
        missed: (l, s, m, n, n_equations) e.

    Returns:
        (l, s, m, n, n_values).
    """
    dof, cables = matrix.shape[-2:]
    size = soft.size[:, None, None, None, None]
    lighter = matrix / weights[..., None, :cables]
    stiff = lighter @ transposed(matrix) + size[..., None] * soft.metric
    stiff += ROUNDED * np.trace(stiff, axis1=-2, axis2=-1)[..., None, None] * np.eye(dof)
    push = np.linalg.solve(stiff, missed[..., :dof, None])[..., 0]
    others = missed[..., dof:] / (1.0 + size * weights[..., cables:])
    return -np.concatenate([times(transposed(lighter), push), others], axis=-1)
