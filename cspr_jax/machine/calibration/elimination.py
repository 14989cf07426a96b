"""Poses eliminated from the linearised problem: rows that only parameters change, their null space, redundancy, steps.

All is by singular values of whitened derivatives, not of their squares, so that no digits are lost.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.machine.calibration.predictions import Linearised
from cspr_jax.numerics.shapes import Bool, Float

# Singular values up to this fraction of the largest one are those of directions that cannot be seen. Rounding leaves
# some 1e-14; a direction at the bound would be known ten million times worse than the best one.
RANK = 1e-7
# Part of a unit vector in the null space above which it is unseen. Null vectors have errors of some 1e-16 / RANK; a
# part at the bound leaves ten micrometres open where a metre is.
UNSEEN = 1e-5
# Directions that cannot be seen of which less than this part moves the machine move the tracker alone.
TRACKER_ALONE = 1e-6


class Reduced(NamedTuple):
    """The problem of the parameters alone.

    Fields:
        left: (k, m, m) left singular vectors of the derivatives by the poses.
        inverse: (k, d, d) from their first components to steps of the poses.
        is_free: (k, m) components that the poses do not reach.
        rows: (k, m, p) derivatives of the components by the parameters, 1/m.
        right: (k, m) components of the residuals.
        values: (p,) singular values of all free rows, 1/m.
        vectors: (p, p) their right singular vectors, one a row.
        projected: (p,) residuals along the left singular vectors.
        is_seen: (p,) directions that can be seen.
    """

    left: np.ndarray
    inverse: np.ndarray
    is_free: np.ndarray
    rows: np.ndarray
    right: np.ndarray
    values: np.ndarray
    vectors: np.ndarray
    projected: np.ndarray
    is_seen: np.ndarray

    @property
    def null_space(self) -> Float[np.ndarray, "q p"]:
        """Directions that cannot be seen, one a row."""
        return self.vectors[~self.is_seen]

    @property
    def unseen_parts(self) -> Float[np.ndarray, "p"]:
        """Part of each parameter that lies in the null space, 0 to 1, whatever basis this has."""
        return np.linalg.norm(self.null_space, axis=0)

    @property
    def covariance(self) -> Float[np.ndarray, "p p"]:
        """Covariance of the parameters for whitened residuals of variance 1, without what cannot be seen, m^2."""
        spread = self.vectors[self.is_seen] / self.values[self.is_seen, None]
        return spread.T @ spread

    @property
    def information(self) -> Float[np.ndarray, "p p"]:
        """Information about the parameters, 1/m^2."""
        spread = self.vectors * self.values[:, None]
        return spread.T @ spread


def toward_nominal(
    null_space: Float[np.ndarray, "q p"], is_of_machine: Bool[np.ndarray, "p"]
) -> Float[np.ndarray, "p p"]:
    """Map from a change of the parameters to the step along the null space that makes the machine's part least.

    With its sum with the identity as P, P C P^T is the covariance of parameters after this step, for any covariance C.
    """
    weights = is_of_machine.astype(float)
    outer, parts, inner = np.linalg.svd(null_space.T * weights[:, None], full_matrices=False)
    moves = parts > TRACKER_ALONE
    return -null_space.T @ (inner[moves].T / parts[moves]) @ (outer.T[moves] * weights)


def reduced(
    problem: Linearised, extra: Float[np.ndarray, "q p"], extra_right: Float[np.ndarray, "q"], damping: float = 0.0
) -> Reduced:
    """The problem of the parameters alone; damping in 1/m makes steps of poses shorter."""
    count, dof = problem.by_pose.shape[1:]
    values, rows, right = problem.by_pose, problem.by_parameters, problem.residuals
    if damping:
        poses = len(values)
        values = np.concatenate([values, np.broadcast_to(damping * np.eye(dof), (poses, dof, dof))], axis=1)
        rows = np.concatenate([rows, np.zeros((poses, dof, rows.shape[2]))], axis=1)
        right = np.concatenate([right, np.zeros((poses, dof))], axis=1)
        count += dof
    left, magnitudes, across = np.linalg.svd(values)
    reached = magnitudes > RANK * magnitudes[:, :1]
    safe = np.where(reached, magnitudes, 1.0)
    inverse = np.swapaxes(across, 1, 2) * np.where(reached, 1.0 / safe, 0.0)[:, None]
    is_free = np.ones((len(values), count), bool)
    is_free[:, :dof] = ~reached
    rows, right = np.swapaxes(left, 1, 2) @ rows, np.einsum("kji,kj->ki", left, right)
    free, n_columns = is_free[:, :, None], rows.shape[2]
    stacked = np.concatenate([(rows * free).reshape(-1, n_columns), extra, np.zeros((n_columns + 1, n_columns))])
    residual = np.concatenate([(right * is_free).ravel(), extra_right, np.zeros(n_columns + 1)])
    # The triangular factor has the same singular values as all rows.
    factor = np.asarray(np.linalg.qr(np.column_stack([stacked, residual]), mode="r"))[:n_columns]
    directions, singular, vectors = np.linalg.svd(factor[:, :n_columns])
    is_seen = singular > RANK * max(singular[0], np.finfo(float).tiny)
    projected = directions.T @ factor[:, n_columns]
    return Reduced(left, inverse, is_free, rows, right, singular, vectors, projected, is_seen)


def step_of(problem: Reduced, damping: float = 0.0) -> Float[np.ndarray, "p"]:
    """Step of the parameters along what can be seen."""
    vectors, values = problem.vectors[problem.is_seen], problem.values[problem.is_seen]
    return -vectors.T @ (problem.projected[problem.is_seen] * values / (values**2 + damping**2))


def pose_steps(problem: Reduced, step: Float[np.ndarray, "p"]) -> Float[np.ndarray, "k d"]:
    """Steps of the coordinates of the poses beside a step of the parameters, m."""
    dof = problem.inverse.shape[1]
    moved = (problem.right + problem.rows @ step)[:, :dof]
    return -np.einsum("kij,kj->ki", problem.inverse, moved)


def redundancies(problem: Reduced) -> Float[np.ndarray, "k m"]:
    """Variance of each residual over that of its measurement: 0 where a mistake would change no residual."""
    free = problem.left * problem.is_free[:, None]
    spread = problem.vectors[problem.is_seen] / problem.values[problem.is_seen, None]
    lost = free @ (problem.rows @ spread.T)
    return np.sum(free**2, axis=2) - np.sum(lost**2, axis=2)


def degrees_of_freedom(problem: Reduced, is_used: Bool[np.ndarray, "k m"], extra: int) -> int:
    """Number of measurements, `extra` of them of no pose, beyond the numbers that they determine."""
    reached = np.count_nonzero(~problem.is_free)
    return int(np.count_nonzero(is_used) + extra - reached - np.count_nonzero(problem.is_seen))


def predicted_variances(linearised: Linearised, problem: Reduced) -> Float[np.ndarray, "k m"]:
    """Variances of predicted measurements, for whitened residuals of variance 1."""
    inverse, dof = problem.inverse, problem.inverse.shape[1]
    spread = problem.vectors[problem.is_seen] / problem.values[problem.is_seen, None]
    by_pose = linearised.by_pose @ inverse
    along = linearised.by_parameters @ spread.T - by_pose @ (problem.rows[:, :dof] @ spread.T)
    return np.sum(by_pose**2, axis=2) + np.sum(along**2, axis=2)
