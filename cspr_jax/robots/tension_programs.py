"""Verdicts of poses by linear programs and by least squares: slow and general, to compare with; no jax."""

import numpy as np

# A residual may be off by this part of the right-hand side.
CLOSE = 1e-6


def by_program(matrix: np.ndarray, wrench: np.ndarray, low: np.ndarray | None, high: np.ndarray | None) -> bool:
    """Tell whether tensions supply a wrench, by a linear program (HiGHS): the largest s with low + s <= t <= high - s.

    Args:
        matrix: (dof, n_cables) wrench matrix, moments over a length.
        wrench: (dof,) wrench that the cables must supply, N.
        low: (n_cables,) smallest tensions, N; None: test wrench closure, s <= t <= 1 - s without a wrench, whatever the
            rank of the matrix.
        high: (n_cables,) largest tensions, N, inf for none; None: likewise.

    Returns:
        whether the largest s is positive.
    """
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
        # Without largest tensions s may have no bound: give it one.
        bounds=[*[(None, None)] * count, (None, np.abs(wrench).max() + 1.0)],
    )
    return bool(program.status == 0 and program.x[-1] > 0.0)


def by_squares(matrix: np.ndarray, wrench: np.ndarray, low: np.ndarray | None, high: np.ndarray | None) -> bool:
    """Tell whether tensions supply a wrench, by least squares with none negative (NNLS).

    Args:
        matrix: (dof, n_cables) wrench matrix, moments over a length.
        wrench: (dof,) wrench that the cables must supply, N.
        low: (n_cables,) smallest tensions, N; None: test wrench closure, by tensions of 1 or more without a wrench,
            whatever the rank of the matrix.
        high: (n_cables,) largest tensions, N, inf for none; None: likewise.

    Returns:
        whether the residual is below 1e-6 of the right-hand side.
    """
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
