"""Verdicts of poses by linear programs and by least squares: slow and general, for comparisons; no jax."""

from __future__ import annotations

import numpy as np

from cspr_jax.numerics.shapes import Float

# Largest residual of a solution, over the right-hand side.
CLOSE = 1e-6


def by_program(
    matrix: Float[np.ndarray, "dof n_cables"],
    wrench: Float[np.ndarray, "dof"],
    low: Float[np.ndarray, "n_cables"] | None,
    high: Float[np.ndarray, "n_cables"] | None,
) -> bool:
    """Tell if tensions can supply a wrench, by a linear program (HiGHS) for the largest s, low + s <= t <= high - s."""
    from scipy.optimize import linprog  # takes long to import, and is rarely needed

    dof, count = matrix.shape
    if low is None or high is None:
        low, high, wrench = np.zeros(count), np.ones(count), np.zeros(dof)
    keeps = [np.c_[-np.eye(count), np.ones(count)], np.c_[np.eye(count), np.ones(count)]]
    limits = np.r_[-low, high]
    is_finite = np.isfinite(limits)
    program = linprog(
        np.r_[np.zeros(count), -1.0],
        A_ub=np.vstack(keeps)[is_finite],
        b_ub=limits[is_finite],
        A_eq=np.c_[matrix, np.zeros(dof)],
        b_eq=wrench,
        # Without largest tensions s may be unbounded: give it a bound.
        bounds=[*[(None, None)] * count, (None, np.abs(wrench).max() + 1.0)],
    )
    return bool(program.status == 0 and program.x[-1] > 0.0)


def by_squares(
    matrix: Float[np.ndarray, "dof n_cables"],
    wrench: Float[np.ndarray, "dof"],
    low: Float[np.ndarray, "n_cables"] | None,
    high: Float[np.ndarray, "n_cables"] | None,
) -> bool:
    """Tell whether tensions can supply a wrench, by non-negative least squares (NNLS)."""
    from scipy.optimize import nnls

    dof, count = matrix.shape
    if low is None or high is None:
        low, high, wrench = np.ones(count), np.full(count, np.inf), np.zeros(dof)
    bounded = np.flatnonzero(np.isfinite(high))
    # The slack of each largest tension is one more unknown.
    system = np.zeros((dof + len(bounded), count + len(bounded)))
    system[:dof, :count] = matrix
    system[dof + np.arange(len(bounded)), bounded] = 1.0
    system[dof:, count:] = np.eye(len(bounded))
    right_side = np.r_[wrench - matrix @ low, (high - low)[bounded]]
    return bool(nnls(system, right_side)[1] <= CLOSE * np.linalg.norm(right_side))
