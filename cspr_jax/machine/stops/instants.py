"""States of a sequence of motions at some instants, from which a robot is to be stopped."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from cspr_jax.motion.motion import Motion, states_at
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.linear.rotations import CONJUGATE, products
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.state import State

# Speeds and accelerations below this fraction of sqrt(g r) and g count as rest, with the radius r of the robot; angular
# ones, times r, likewise.
RESTING = 1e-9


@dataclasses.dataclass(frozen=True)
class StateSamples:
    """States of k instants, in the axes of the kernels of a robot.

    Fields:
        times: (k,) since the start of the motions, s.
        position: (k, 3) mass centre, m.
        velocity: (k, 3) m/s.
        acceleration: (k, 3) m/s^2.
        quaternion: (k, 4) unit, scalar first; None for a point mass.
        angular_velocity: (k, 3) rad/s; None likewise.
        angular_acceleration: (k, 3) rad/s^2; None likewise.
    """

    times: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    quaternion: np.ndarray | None = None
    angular_velocity: np.ndarray | None = None
    angular_acceleration: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.times)

    def take(self, rows: np.ndarray) -> StateSamples:
        """Some of the instants."""
        columns: dict[str, Any] = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        selected: dict[str, Any] = {name: None if part is None else part[rows] for name, part in columns.items()}
        return StateSamples(**selected)

    @property
    def rates(self) -> Float[np.ndarray, "k n"]:
        """Velocities, of platforms with angular velocities."""
        return self._joined(self.velocity, self.angular_velocity)

    @property
    def accelerations(self) -> Float[np.ndarray, "k n"]:
        """Accelerations, of platforms with angular accelerations."""
        return self._joined(self.acceleration, self.angular_acceleration)

    def _joined(self, linear: np.ndarray, angular: np.ndarray | None) -> np.ndarray:
        return linear if angular is None else np.concatenate([linear, angular], axis=1)

    def is_still(self, radius: float, gravity: float) -> np.ndarray:
        """Tell at which instants the robot has no velocity, (k,)."""
        return _are_small(self.velocity, self.angular_velocity, np.sqrt(gravity * radius), radius)

    def rests(self, radius: float, gravity: float) -> np.ndarray:
        """Tell at which instants the robot is at rest, (k,)."""
        forceless = _are_small(self.acceleration, self.angular_acceleration, gravity, radius)
        return self.is_still(radius, gravity) & forceless

    def moved(self, before: Frame, after: Frame, references: Sequence[np.ndarray]) -> StateSamples:
        """The same states in the axes of another robot with the same file's axes.

        `references` has the rotation from a platform's axes in the file to those of the kernels, before and after.
        """
        changes: dict[str, Any] = {"position": after.inward(before.outward(self.position))}
        if self.quaternion is not None:
            # Both kernels have parallel axes; only the platform's own axes may differ.
            between = products(references[0][None], (references[1] * CONJUGATE)[None])
            changes["quaternion"] = products(self.quaternion, between)
        return dataclasses.replace(self, **{name: np.asarray(value) for name, value in changes.items()})


def _are_small(linear: np.ndarray, angular: np.ndarray | None, unit: float, radius: float) -> np.ndarray:
    # Angular rates have the unit over the radius.
    scaled = linear if angular is None else np.concatenate([linear, radius * angular], axis=1)
    return np.abs(scaled).max(1) <= RESTING * unit


def instants_of(
    motions: Sequence[Motion], durations: Float[np.ndarray, "n"], times: Float[np.ndarray, "k"]
) -> StateSamples:
    """States of motions that follow one another."""
    starts = np.concatenate([[0.0], np.cumsum(durations)])
    segment = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(motions) - 1)
    parts: list[tuple[np.ndarray, State]] = []
    for i in np.unique(segment).tolist():
        rows = np.flatnonzero(segment == i)
        tau = np.clip((times[rows] - starts[i]) / durations[i], 0.0, 1.0)
        parts.append((rows, jax.tree.map(np.asarray, states_at(motions[i], tau))))
    order = np.argsort(np.concatenate([rows for rows, _ in parts]))
    columns = dict[str, Any]()
    for name in (field.name for field in dataclasses.fields(StateSamples) if field.name != "times"):
        values = [getattr(state, name) for _, state in parts]
        columns[name] = None if values[0] is None else np.concatenate(values)[order]
    return StateSamples(times=np.asarray(times, float), **columns)
