"""Motions that are sought together, and their unknowns: control points, durations, accelerations at poses.

A motion is at a pose at each end of its segments, with a given velocity there, and an acceleration that the segments at
both sides share. So the outer three control points at each end follow from the duration and the acceleration.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from cspr_jax.free.basis import Basis
from cspr_jax.free.instants import InstantValues, instant_values
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.limits import Limits

# Control points at each end that follow from the others.
OUTER = 3


class Unknowns(NamedTuple):
    """Unknowns of l motions of s segments, with K control points, m intervals and n instants; or changes of them.

    Fields:
        inner: (l, s, K - 6, d) control points between the outer ones.
        duration: (l, s) s.
        acceleration: (l, s + 1, d) at the poses, m/s^2, rad/s^2.
        values: (l, s, m, n, n_values) as of `instants`.
        multipliers: (l, s, m, n, n_equations).
        low_push: (l, s, m, n, n_values) multipliers of lower bounds, at least 0.
        high_push: (l, s, m, n, n_values) of upper bounds.
    """

    inner: np.ndarray
    duration: np.ndarray
    acceleration: np.ndarray
    values: np.ndarray
    multipliers: np.ndarray
    low_push: np.ndarray
    high_push: np.ndarray

    def taken(self, rows: np.ndarray) -> "Unknowns":
        """Unknowns of some of the motions.

        Args:
            rows: numbers, or a mask.

        Returns:
            the unknowns.
        """
        return Unknowns(*(leaf[rows] for leaf in self))


@dataclasses.dataclass(frozen=True)
class Tasks:
    """l motions of s segments each, of d coordinates.

    Fields:
        robot: centred, z down.
        limits: of it.
        basis: of all segments.
        places: (l, s, 2, d) coordinates at start and end of each segment, m; Rodrigues vectors.
        velocities: (l, s, 2, d) there, m/s, rad/s.
        references: (l, s, 4) orientations from which Rodrigues vectors count.
        turns: (l, s, 2, d, d) second derivatives of the coordinates from accelerations.
        accelerations: (l, s + 1, d) at the poses, m/s^2, rad/s^2, where they are given.
        is_free: (l, s + 1) whether they are not.
        low: (l, s, m, n, n_values) lower bounds, -inf for none.
        high: (l, s, m, n, n_values) upper bounds, inf for none.
        scale: (l,) half a swing, s, over which durations count.
    """

    robot: AnyRobot
    limits: Limits
    basis: Basis
    places: np.ndarray
    velocities: np.ndarray
    references: np.ndarray
    turns: np.ndarray
    accelerations: np.ndarray
    is_free: np.ndarray
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray

    def taken(self, rows: np.ndarray) -> "Tasks":
        """Some of the motions.

        Args:
            rows: numbers, or a mask.

        Returns:
            the tasks.
        """
        names = ("places", "velocities", "references", "turns", "accelerations", "is_free", "low", "high", "scale")
        return dataclasses.replace(self, **{name: getattr(self, name)[rows] for name in names})

    @property
    def border(self) -> np.ndarray:
        """Numbers of the outer coordinates that move, of all K d of a segment, (4 d,)."""
        d, last = self.places.shape[-1], self.basis.controls * self.places.shape[-1]
        return np.concatenate([np.arange(d, 3 * d), np.arange(last - 3 * d, last - d)])

    def controls(self, unknowns: Unknowns) -> np.ndarray:
        """All control points.

        Returns:
            (l, s, K, d).
        """
        shape = *unknowns.duration.shape, self.basis.controls, self.places.shape[-1]
        controls, time = np.empty(shape), unknowns.duration[..., None]
        controls[:, :, OUTER:-OUTER] = unknowns.inner
        for side, sign in ((0, 1.0), (1, -1.0)):
            place, step = self.places[:, :, side], sign * self.basis.end_slope * time * self.velocities[:, :, side]
            bend = self.basis.end_bend * time**2 * self._second(unknowns, side)
            steps = (place, place + step, place + 3.0 * step + bend)
            for k, value in enumerate(steps):
                controls[:, :, k if side == 0 else -1 - k] = value
        return controls

    def _second(self, unknowns: Unknowns, side: int) -> np.ndarray:
        # Second derivatives in time of the coordinates at the start or end of each segment, (l, s, d).
        count = self.places.shape[1]
        acceleration = unknowns.acceleration[:, side : count + side]
        return (self.turns[:, :, side] @ acceleration[..., None])[..., 0]

    def border_slopes(self, unknowns: Unknowns) -> np.ndarray:
        """Derivatives of the outer coordinates that move, by what moves them.

        Returns:
            (l, s, 4 d, 1 + 2 d) in the order of `border`, by the duration and both accelerations of a segment.
        """
        d, time, basis = self.places.shape[-1], unknowns.duration[..., None], self.basis
        slopes = np.zeros((*unknowns.duration.shape, 4 * d, 1 + 2 * d))
        for side, sign in ((0, 1.0), (1, -1.0)):
            near = slice(0, d) if side == 0 else slice(3 * d, 4 * d)
            far = slice((1 + side) * d, (2 + side) * d)
            step = sign * basis.end_slope * self.velocities[:, :, side]
            slopes[:, :, near, 0] = step
            slopes[:, :, far, 0] = 3.0 * step + 2.0 * basis.end_bend * time * self._second(unknowns, side)
            columns = slice(1 + side * d, 1 + (1 + side) * d)
            slopes[:, :, far, columns] = basis.end_bend * time[..., None] ** 2 * self.turns[:, :, side]
        return slopes

    def border_bends(self, unknowns: Unknowns, push: np.ndarray) -> np.ndarray:
        """Second derivatives of the outer coordinates, times multipliers.

        Args:
            push: (l, s, 4 d) multipliers, in the order of `border`.

        Returns:
            (l, s, 1 + 2 d, 1 + 2 d) by the duration and both accelerations of a segment.
        """
        d, twice = self.places.shape[-1], 2.0 * self.basis.end_bend
        bends = np.zeros((*unknowns.duration.shape, 1 + 2 * d, 1 + 2 * d))
        for side in (0, 1):
            along = push[:, :, (1 + side) * d : (2 + side) * d]
            bends[:, :, 0, 0] += twice * np.sum(along * self._second(unknowns, side), axis=-1)
            mixed = twice * unknowns.duration[..., None] * (along[..., None, :] @ self.turns[:, :, side])[..., 0, :]
            columns = slice(1 + side * d, 1 + (1 + side) * d)
            bends[:, :, 0, columns] += mixed
            bends[:, :, columns, 0] += mixed
        return bends

    def equations(self, unknowns: Unknowns) -> tuple[InstantValues, np.ndarray]:
        """Equations at all instants.

        Returns:
            the equations, leaves (l, s, m, n, ...); their residuals with all values.
        """
        shape, cables = unknowns.values.shape[:-1], self.robot.n_cables
        equations = instant_values(
            self.robot,
            self.limits,
            np.broadcast_to(self.references[:, :, None, None], (*shape, 4)),
            self.basis.places(self.controls(unknowns)),
            np.broadcast_to(unknowns.duration[:, :, None, None], shape),
            unknowns.values[..., :cables],
            unknowns.multipliers,
        )
        residual = equations.residual.copy()
        residual[..., self.robot.dof :] += unknowns.values[..., cables:]
        return equations, residual
