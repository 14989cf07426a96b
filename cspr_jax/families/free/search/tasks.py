"""Motions that are searched for together, and their unknowns: control points, durations, accelerations, levels.

At each end of a segment the motion is at a pose, with a given velocity, and an acceleration that both adjacent segments
have. So duration and acceleration determine the outer three control points at each end. Where a motion may come to rest
anywhere, the unknown acceleration at its last pose is the shift of that pose instead: there all accelerations are zero.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.families.free.search.basis import Basis
from cspr_jax.families.free.search.derivatives import EquationValues, equation_values, residuals
from cspr_jax.families.free.search.objectives import Objective
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits

# Number of control points at each end that duration and acceleration determine.
OUTER = 3


def wide(numbers: np.ndarray) -> np.ndarray:
    """Numbers of motions (l,), or of segments (l, s), in a shape that broadcasts to values at samples."""
    return numbers.reshape(*numbers.shape, *[1] * (5 - numbers.ndim))


class Unknowns(NamedTuple):
    """Unknowns of l motions of s segments, with K control points, m intervals and n samples; or changes of them.

    Fields:
        inner: (l, s, K - 6, d) control points between the outer ones.
        duration: (l, s) durations of segments, s.
        acceleration: (l, s + 1, d) accelerations at the poses, m/s^2, rad/s^2.
        level: (l, s) level of the objective, which shifts bounds of tensions.
        values: (l, s, m, n, n_values) values at samples, as `equations` defines them.
        multipliers: (l, s, m, n, n_equations) multipliers of the equations.
        low_multipliers: (l, s, m, n, n_values) multipliers of lower bounds, not negative.
        high_multipliers: (l, s, m, n, n_values) multipliers of upper bounds, not negative.
    """

    inner: np.ndarray
    duration: np.ndarray
    acceleration: np.ndarray
    level: np.ndarray
    values: np.ndarray
    multipliers: np.ndarray
    low_multipliers: np.ndarray
    high_multipliers: np.ndarray

    def take(self, indices: np.ndarray) -> "Unknowns":
        """Unknowns of some of the motions."""
        return Unknowns(*(values[indices] for values in self))


class ClearancePlanes(NamedTuple):
    """K values at + gradient . coordinates at each sample; they have lower bounds, as values of limits have.

    Fields:
        gradient: (l, s, m, n, K, d) gradients by the coordinates.
        at: (l, s, m, n, K) values at coordinates 0.
        minimum: for each plane, the index of its pair of bodies and the clearance that they must keep, m.
    """

    gradient: np.ndarray
    at: np.ndarray
    minimum: tuple[tuple[int, float], ...]


@dataclasses.dataclass(frozen=True)
class Tasks:
    """l motions of s segments each, of d coordinates.

    Fields:
        robot: centred robot, z down.
        limits: limits of the robot.
        basis: basis functions of all segments.
        ends: (l, s, 2, d) coordinates at start and end of each segment, m; Rodrigues vectors.
        velocities: (l, s, 2, d) at start and end of each segment, m/s, rad/s.
        references: (l, s, 4) orientations relative to which Rodrigues vectors are measured.
        turns: (l, s, 2, d, d) matrices from accelerations to second derivatives of the coordinates.
        accelerations: (l, s + 1, d) given accelerations at the poses, m/s^2, rad/s^2.
        is_free: (l, s + 1) whether the acceleration at a pose is free instead.
        low: (l, s, m, n, n_values) lower bounds at level 0, -inf for none.
        high: (l, s, m, n, n_values) upper bounds at level 0, inf for none.
        scale: (l,) unit of durations in the objective: half a swing, s.
        objective: what is minimised.
        longest: () longest duration of a segment, s; None for any.
        planes: clearance planes, whose values come last; None without any.
        rests_anywhere: whether the motion comes to rest at any pose; `ends` has one near it.
    """

    robot: AnyRobot
    limits: Limits
    basis: Basis
    ends: np.ndarray
    velocities: np.ndarray
    references: np.ndarray
    turns: np.ndarray
    accelerations: np.ndarray
    is_free: np.ndarray
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray
    objective: Objective
    longest: np.ndarray | None = None
    planes: ClearancePlanes | None = None
    rests_anywhere: bool = False

    def take(self, indices: np.ndarray) -> "Tasks":
        """Some of the motions."""
        names = ("ends", "velocities", "references", "turns", "accelerations", "is_free", "low", "high", "scale")
        planes = self.planes
        if planes is not None:
            planes = planes._replace(gradient=planes.gradient[indices], at=planes.at[indices])
        return dataclasses.replace(self, **{name: getattr(self, name)[indices] for name in names}, planes=planes)

    @property
    def n_limited(self) -> int:
        """Number of values before those of planes."""
        return self.low.shape[-1] - (0 if self.planes is None else self.planes.at.shape[-1])

    def within(self, planes: ClearancePlanes, low: np.ndarray) -> "Tasks":
        """The same tasks with other planes."""
        count, none, objective = self.n_limited, np.full(low.shape, np.inf), self.objective
        low_lift, high_lift = (
            np.pad(lift[:count], (0, low.shape[-1])) for lift in (objective.low_lift, objective.high_lift)
        )
        return dataclasses.replace(
            self,
            low=np.concatenate([self.low[..., :count], low], axis=-1),
            high=np.concatenate([self.high[..., :count], none], axis=-1),
            objective=objective._replace(low_lift=low_lift, high_lift=high_lift),
            planes=planes,
        )

    def beside(self, unknowns: Unknowns, values: np.ndarray) -> Unknowns:
        """Unknowns of these tasks as those of tasks with other planes, with given values of these and multipliers 0."""
        old, new = self.low.shape[-1] - self.n_limited, values.shape[-1]

        def changed(values: np.ndarray) -> np.ndarray:
            return np.concatenate([values[..., : values.shape[-1] - old], np.zeros((*values.shape[:-1], new))], axis=-1)

        names = "values", "multipliers", "low_multipliers", "high_multipliers"
        unknowns = unknowns._replace(**{name: changed(getattr(unknowns, name)) for name in names})
        unknowns.values[..., self.n_limited :] = values
        return unknowns

    def bounds(self, level: Float[np.ndarray, "l s"]) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the values."""
        level = wide(level)
        return self.low + level * self.objective.low_lift, self.high + level * self.objective.high_lift

    def gaps(self, unknowns: Unknowns) -> tuple[np.ndarray, np.ndarray]:
        """Distances of the values from their bounds."""
        low, high = self.bounds(unknowns.level)
        return unknowns.values - low, high - unknowns.values

    def gap_changes(self, change: Unknowns) -> tuple[np.ndarray, np.ndarray]:
        """Changes of the distances of the values from their bounds."""
        level = wide(change.level)
        low, high = level * self.objective.low_lift, level * self.objective.high_lift
        return change.values - low, high - change.values

    @property
    def energy_weights(self) -> np.ndarray:
        """Weights of samples in the objective, for the squares of tensions times the duration, (l, 1, m, n, 1)."""
        return self.objective.energy / wide(self.scale) * self.basis.weights[..., None]

    def cost(self, unknowns: Unknowns) -> Float[np.ndarray, "l"]:
        """Objective of each task."""
        time = self.objective.time * unknowns.duration.sum(1) / self.scale
        squares = unknowns.values[..., : self.robot.n_cables] ** 2 * wide(unknowns.duration)
        energy = np.sum(self.energy_weights * squares, axis=(1, 2, 3, 4))
        return time + energy + self.objective.level * unknowns.level.sum(1)

    def energies(self, unknowns: Unknowns) -> Float[np.ndarray, "l s"]:
        """Integrals of the sum of the squares of the tensions over each segment."""
        squares = np.sum(unknowns.values[..., : self.robot.n_cables] ** 2, axis=-1)
        weight = float(self.robot.mass * self.robot.gravity)
        return weight**2 * unknowns.duration * np.sum(self.basis.weights * squares, axis=(2, 3))

    def cost_change(self, unknowns: Unknowns, change: Unknowns) -> Float[np.ndarray, "l"]:
        """Derivative of the objective along a change."""
        cables = self.robot.n_cables
        tensions, duration = unknowns.values[..., :cables], wide(unknowns.duration)
        squares = wide(change.duration) * tensions**2
        squares = squares + 2.0 * duration * tensions * change.values[..., :cables]
        energy = np.sum(self.energy_weights * squares, axis=(1, 2, 3, 4))
        time = self.objective.time * change.duration.sum(1) / self.scale
        return time + energy + self.objective.level * change.level.sum(1)

    @property
    def border(self) -> np.ndarray:
        """Indices of the outer coordinates that are not fixed, among all K d of a segment, (4 d,) or (5 d,)."""
        d, last = self.ends.shape[-1], self.basis.controls * self.ends.shape[-1]
        return np.concatenate([np.arange(d, 3 * d), np.arange(last - 3 * d, last - (not self.rests_anywhere) * d)])

    def controls(self, unknowns: Unknowns) -> np.ndarray:
        """All control points."""
        shape = *unknowns.duration.shape, self.basis.controls, self.ends.shape[-1]
        controls, time = np.empty(shape), unknowns.duration[..., None]
        controls[:, :, OUTER:-OUTER] = unknowns.inner
        for side, sign in ((0, 1.0), (1, -1.0)):
            end, step = self.ends[:, :, side], sign * self.basis.velocity_step * time * self.velocities[:, :, side]
            if side and self.rests_anywhere:
                end = end + unknowns.acceleration[:, 1:]
            second_derivative = self.basis.acceleration_step * time**2 * self._second(unknowns, side)
            steps = (end, end + step, end + 3.0 * step + second_derivative)
            for k, value in enumerate(steps):
                controls[:, :, k if side == 0 else -1 - k] = value
        return controls

    def _second(self, unknowns: Unknowns, side: int) -> np.ndarray:
        # Return second derivatives in time of the coordinates at the start or end of each segment, (l, s, d).
        count = self.ends.shape[1]
        if side and self.rests_anywhere:
            return np.zeros_like(self.ends[:, :, side])
        acceleration = unknowns.acceleration[:, side : count + side]
        return (self.turns[:, :, side] @ acceleration[..., None])[..., 0]

    def border_jacobians(self, unknowns: Unknowns) -> np.ndarray:
        """Derivatives of the outer coordinates that are not fixed, by the duration and the accelerations."""
        d, time, basis = self.ends.shape[-1], unknowns.duration[..., None], self.basis
        jacobians = np.zeros((*unknowns.duration.shape, len(self.border), 1 + 2 * d))
        if self.rests_anywhere:  # the last three control points move with the pose
            jacobians[:, :, 2 * d :, 1 + d :] = np.tile(np.eye(d), (3, 1))
        for side, sign in ((0, 1.0), (1, -1.0))[: 1 if self.rests_anywhere else 2]:
            near = slice(0, d) if side == 0 else slice(3 * d, 4 * d)
            far = slice((1 + side) * d, (2 + side) * d)
            step = sign * basis.velocity_step * self.velocities[:, :, side]
            jacobians[:, :, near, 0] = step
            jacobians[:, :, far, 0] = 3.0 * step + 2.0 * basis.acceleration_step * time * self._second(unknowns, side)
            columns = slice(1 + side * d, 1 + (1 + side) * d)
            jacobians[:, :, far, columns] = basis.acceleration_step * time[..., None] ** 2 * self.turns[:, :, side]
        return jacobians

    def border_hessians(self, unknowns: Unknowns, multipliers: np.ndarray) -> np.ndarray:
        """Second derivatives of the same coordinates, times multipliers."""
        d, twice = self.ends.shape[-1], 2.0 * self.basis.acceleration_step
        hessians = np.zeros((*unknowns.duration.shape, 1 + 2 * d, 1 + 2 * d))
        for side in (0,) if self.rests_anywhere else (0, 1):
            along = multipliers[:, :, (1 + side) * d : (2 + side) * d]
            hessians[:, :, 0, 0] += twice * np.sum(along * self._second(unknowns, side), axis=-1)
            mixed = twice * unknowns.duration[..., None] * (along[..., None, :] @ self.turns[:, :, side])[..., 0, :]
            columns = slice(1 + side * d, 1 + (1 + side) * d)
            hessians[:, :, 0, columns] += mixed
            hessians[:, :, columns, 0] += mixed
        return hessians

    def equations(self, unknowns: Unknowns) -> tuple[EquationValues, np.ndarray]:
        """Equations at all samples."""
        planes = self.planes
        count = unknowns.multipliers.shape[-1] - (0 if planes is None else planes.at.shape[-1])
        equations = equation_values(*self._samples(unknowns), unknowns.multipliers[..., :count])
        if planes is not None:
            others = equations.jacobian.shape[-1] - self.ends.shape[-1]
            jacobian = np.concatenate(
                [equations.jacobian, np.pad(-planes.gradient, [*[(0, 0)] * 5, (0, others)])], axis=-2
            )
            residual = self._with_planes(equations.residual, planes, unknowns)
            equations = equations._replace(residual=residual, jacobian=jacobian)
        return equations, self._with_values(equations.residual.copy(), unknowns)

    def residual(self, unknowns: Unknowns) -> Float[np.ndarray, "l s m n n_equations"]:
        """Residuals of the equations at all samples, which all values enter."""
        missed, planes = residuals(*self._samples(unknowns)), self.planes
        return self._with_values(missed if planes is None else self._with_planes(missed, planes, unknowns), unknowns)

    def _with_planes(self, residual: np.ndarray, planes: ClearancePlanes, unknowns: Unknowns) -> np.ndarray:
        coordinates = self.basis.evaluate(self.controls(unknowns))[..., 0, :]
        return np.concatenate(
            [residual, -planes.at - np.sum(planes.gradient * coordinates[..., None, :], axis=-1)], axis=-1
        )

    def _samples(self, unknowns: Unknowns) -> tuple[Any, ...]:
        # Return the arguments of the equations at all samples, except multipliers.
        shape = unknowns.values.shape[:-1]
        return (
            self.robot,
            self.limits,
            self.longest,
            np.broadcast_to(self.references[:, :, None, None], (*shape, 4)),
            self.basis.evaluate(self.controls(unknowns)),
            np.broadcast_to(unknowns.duration[:, :, None, None], shape),
            unknowns.values[..., : self.robot.n_cables],
        )

    def _with_values(self, residual: np.ndarray, unknowns: Unknowns) -> np.ndarray:
        residual[..., self.robot.dof :] += unknowns.values[..., self.robot.n_cables :]
        return residual
