"""Interior-point method for a convex objective with many linear constraints; each problem solves for its own steps.

The primal-dual method needs no feasible start: slacks and multipliers of all constraints stay positive, and their
products decrease together (Mehrotra 1992).
"""

from typing import NamedTuple, Protocol

import numpy as np

STEPS = 120  # largest number of steps
GAP = 1e-7  # largest duality gap at an optimum, over the objective
FRACTION = 0.99  # fraction of the distance to a bound that a step may go
AIM = 0.1  # a step aims at this fraction of the mean product of slacks and multipliers
MISSED, LEVEL = 1e-9, 1e-6  # largest residuals of constraints and of equations at an optimum


class Constrained(Protocol):
    """Problem: minimise an objective of unknowns z, of any shape, such that no slack is negative."""

    def value(self, z: np.ndarray) -> float:
        """The objective.

        Args:
            z: unknowns.
        """

    def slacks(self, z: np.ndarray) -> np.ndarray:
        """Slacks of the constraints, (m,).

        Args:
            z: unknowns.
        """

    def residual(self, z: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Gradient of the Lagrangian, and residuals of equations, in the shape of `z`.

        Args:
            z: unknowns.
            multipliers: (m,).
        """

    def jt_multipliers(self, z: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Minus the transposed Jacobian of the slacks, times multipliers, in the shape of `z`.

        Args:
            z: unknowns.
            multipliers: (m,).
        """

    def change(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Change of the slacks, to first order, (m,).

        Args:
            z: unknowns.
            step: change of the unknowns, in the shape of `z`.
        """

    def solved(self, z: np.ndarray, weights: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Solution of (H + J^T W J) step = right, with the Hessian H, the Jacobian J of the slacks, and weights W.

        Args:
            z: unknowns.
            weights: (m,).
            right: right-hand side, in the shape of `z`.
        """

    def positive(self, z: np.ndarray) -> np.ndarray:
        """Unknowns that must stay positive, (k,).

        Args:
            z: unknowns, or a step.
        """


class Optimum(NamedTuple):
    """Result of the method.

    Fields:
        z: unknowns.
        multipliers: (m,) multipliers of the constraints.
        is_optimal: whether the method converged.
    """

    z: np.ndarray
    multipliers: np.ndarray
    is_optimal: bool


def _length(pairs: list[tuple[np.ndarray, np.ndarray]]) -> float:
    # Return the longest step, up to 1, in which no value decreases by more than a fraction of itself.
    lengths = [1.0]
    for value, change in pairs:
        falling = change < 0.0
        lengths.append(FRACTION * float(np.min(-value[falling] / change[falling], initial=np.inf)))
    return min(lengths)


def interior_point(problem: Constrained, z: np.ndarray) -> Optimum:
    """Minimise the objective of a problem, from unknowns z."""
    slacks = problem.slacks(z)
    slacks = np.maximum(slacks, 0.05)
    multipliers = 0.1 * problem.value(z) / len(slacks) / slacks
    for _ in range(STEPS):
        missed = slacks - problem.slacks(z)
        residual = problem.residual(z, multipliers)
        complement = float(slacks @ multipliers)
        is_met = np.abs(missed).max() < MISSED and np.abs(residual).max() < LEVEL
        if is_met and complement < GAP * problem.value(z):
            return Optimum(z, multipliers, True)
        target, weights = AIM * complement / len(slacks), multipliers / slacks
        change = target / slacks - multipliers + weights * missed
        try:
            step = problem.solved(z, weights, -residual - problem.jt_multipliers(z, change))
        except np.linalg.LinAlgError:  # widths of cells may differ too much for double precision
            break
        slack_step = problem.change(z, step) - missed
        multiplier_step = target / slacks - multipliers - weights * slack_step
        primal = _length([(slacks, slack_step), (problem.positive(z), problem.positive(step))])
        dual = _length([(multipliers, multiplier_step)])
        if not np.isfinite(primal * dual) or not np.isfinite(step).all():
            break
        z = z + primal * step
        slacks, multipliers = slacks + primal * slack_step, multipliers + dual * multiplier_step
    return Optimum(z, multipliers, False)
