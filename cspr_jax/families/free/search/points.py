"""Motions with their equations at all instants, during a search, and how far they are from an optimum."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cspr_jax.families.free.search.condensation import Softness, times, transposed
from cspr_jax.families.free.search.derivatives import SCALARS, InstantValues
from cspr_jax.families.free.search.newton import gathered
from cspr_jax.families.free.search.tasks import OUTER, Tasks, Unknowns, wide

if TYPE_CHECKING:
    from jaxtyping import Float

# Multipliers of equations beyond which their mean counts as the unit of errors; keeps the metric of the tensions
# regular.
LARGE, REGULAR = 100.0, 1e-6


class Levels(NamedTuple):
    """Weight of the barriers, (l,), and how far equations may be missed."""

    barrier: np.ndarray
    soft: Softness

    def taken(self, rows: np.ndarray) -> "Levels":
        """Levels of some of the motions."""
        return Levels(self.barrier[rows], Softness(*(leaf[rows] for leaf in self.soft)))


@dataclasses.dataclass(frozen=True)
class SearchPoints:
    """l motions with their equations.

    Fields:
        equations: leaves (l, s, m, n, ...).
        residual: (l, s, m, n, n_equations) of them, with all values.
    """

    tasks: Tasks
    unknowns: Unknowns
    equations: InstantValues
    residual: np.ndarray

    @classmethod
    def of(cls, tasks: Tasks, unknowns: Unknowns) -> "SearchPoints":
        """Look at motions."""
        return cls(tasks, unknowns, *tasks.equations(unknowns))

    def taken(self, rows: np.ndarray) -> "SearchPoints":
        """Some of the motions."""
        equations = InstantValues(*(leaf[rows] for leaf in self.equations))
        return SearchPoints(self.tasks.taken(rows), self.unknowns.taken(rows), equations, self.residual[rows])

    def metric(self) -> Float[np.ndarray, "l s m n dof dof"]:
        """Metric of the residual of tensions' equations: a force counts as the tensions that it would take."""
        matrix = self.equations.matrix
        return matrix @ transposed(matrix) + REGULAR * np.eye(matrix.shape[-2])

    def missed(self) -> Float[np.ndarray, "l"]:
        """By how much equations are missed, at most."""
        return np.abs(self.residual).reshape(len(self.residual), -1).max(1)

    def errors(self, levels: Levels) -> Float[np.ndarray, "l"]:
        """Largest errors of Newton's equations."""
        tasks, unknowns, soft = self.tasks, self.unknowns, levels.soft
        count, dof, d, cables = len(unknowns.values), tasks.robot.dof, tasks.places.shape[-1], tasks.robot.n_cables
        slope = gathered(tasks.basis, times(transposed(self.equations.slope), unknowns.multipliers))
        tensions, shares = unknowns.values[..., :cables], tasks.energy_shares
        slope[..., -2] += tasks.objective.time / tasks.scale[:, None] + np.sum(shares * tensions**2, axis=(2, 3, 4))
        along = times(transposed(tasks.border_slopes(unknowns)), slope[..., tasks.border])
        segments, accelerations = unknowns.duration.shape[1], np.zeros_like(unknowns.acceleration)
        for side in (0, 1):
            accelerations[:, side : segments + side] += along[..., 1 + side * d : 1 + (1 + side) * d]
        balance = times(transposed(self.equations.matrix), unknowns.multipliers[..., :dof])
        values = np.concatenate([balance, unknowns.multipliers[..., dof:]], axis=-1)
        values = values - unknowns.low_push + unknowns.high_push
        values[..., :cables] += 2.0 * shares * wide(unknowns.duration) * tensions
        parts = [slope[..., OUTER * d : -SCALARS - OUTER * d], slope[..., -2] + along[..., 0], values]
        parts.append(np.where(tasks.is_free[..., None], accelerations, 0.0))
        pushes = unknowns.low_push, unknowns.high_push
        if tasks.objective.level > 0.0:
            lifts = tasks.objective.low_lift, -tasks.objective.high_lift
            by_level = sum(push * lift for push, lift in zip(pushes, lifts, strict=True))
            parts.append(tasks.objective.level + by_level.sum((2, 3, 4)))
        for push, gap in zip(pushes, tasks.gaps(unknowns), strict=True):
            is_bound = np.isfinite(gap)
            parts.append(np.where(is_bound, np.where(is_bound, gap, 0.0) * push - wide(levels.barrier), 0.0))
        unit = np.maximum(LARGE, (pushes[0] + pushes[1]).reshape(count, -1).mean(1)) / LARGE
        largest = np.max([np.abs(part).reshape(count, -1).max(1, initial=0.0) for part in parts], axis=0)
        price = self.residual - soft.missed(unknowns.multipliers - soft.level)
        return np.maximum(largest / unit, np.abs(price).reshape(count, -1).max(1))
