"""Verdicts of poses by linear programs and by least squares: slow and general, to compare with; no jax."""

import numpy as np

# Of what is wanted: what a residual may be off.
CLOSE = 1e-6


def by_program(matrix: np.ndarray, wrench: np.ndarray, low: np.ndarray | None, high: np.ndarray | None) -> bool:
    """Whether tensions supply a wrench, by a linear program (HiGHS): the largest s with low + s <= t <= high - s.

    Args:
        matrix: (dof, n_cables) wrench matrix, moments over a length.
        wrench: (dof,) what the cables must supply, N.
        low: (n_cables,) N; None: wrench closure is asked about, s <= t <= 1 - s with no wrench at all; the rank of the
            matrix is not looked at.
        high: (n_cables,) N, inf for none; None: likewise.

    Returns:
        whether the largest s is positive.
    """
    from scipy.optimize import linprog  # takes long to import, and few ask

    dof, count = matrix.shape
    if low is None or high is None:
        low, high, wrench = np.zeros(count), np.ones(count), np.zeros(dof)
    keeps = [np.c_[-np.eye(count), np.ones(count)], np.c_[np.eye(count), np.ones(count)]]
    limits = np.r_[-low, high]
    is_finite = np.isfinite(limits)
    found = linprog(
        np.r_[np.zeros(count), -1.0],
        A_ub=np.vstack(keeps)[is_finite],
        b_ub=limits[is_finite],
        A_eq=np.c_[matrix, np.zeros(dof)],
        b_eq=wrench,
        # Without largest tensions s may have no bound of its own.
        bounds=[*[(None, None)] * count, (None, np.abs(wrench).max() + 1.0)],
    )
    return bool(found.status == 0 and found.x[-1] > 0.0)


def by_squares(matrix: np.ndarray, wrench: np.ndarray, low: np.ndarray | None, high: np.ndarray | None) -> bool:
    """Whether tensions supply a wrench, by least squares with none negative (NNLS).

    Args:
        matrix: (dof, n_cables) wrench matrix, moments over a length.
        wrench: (dof,) what the cables must supply, N.
        low: (n_cables,) N; None: wrench closure is asked about, by tensions of 1 or more without a wrench; the rank of
            the matrix is not looked at.
        high: (n_cables,) N, inf for none; None: likewise.

    Returns:
        whether the residual is below 1e-6 of what is wanted.
    """
    from scipy.optimize import nnls

    dof, count = matrix.shape
    if low is None or high is None:
        low, high, wrench = np.ones(count), np.full(count, np.inf), np.zeros(dof)
    bounded = np.flatnonzero(np.isfinite(high))
    # What is left to each largest tension is one more unknown.
    given = np.zeros((dof + len(bounded), count + len(bounded)))
    given[:dof, :count] = matrix
    given[dof + np.arange(len(bounded)), bounded] = 1.0
    given[dof:, count:] = np.eye(len(bounded))
    wanted = np.r_[wrench - matrix @ low, (high - low)[bounded]]
    return bool(nnls(given, wanted)[1] <= CLOSE * np.linalg.norm(wanted))
