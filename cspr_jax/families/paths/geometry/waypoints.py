"""Consecutive motions of any kind: states at many times, and smooth parts between stops."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.motion.motion import Motion, states_at
from cspr_jax.numerics.shapes import Float, Int

# Number of samples of a motion in the search for stops, and smallest number of samples of a smooth part.
SAMPLES, FEWEST = 2000, 8
AT_REST = 1e-9  # a motion is at rest if its speed over the largest one is below this
STEPS = 80  # Gauss-Newton steps for the time of a stop
# A motion turns back if its radius of curvature at the smallest speed is below this, m.
CUSP = 4e-10
# Speeds of consecutive motions may differ by this fraction of the largest speed, due to rounding.
MEETS = 1e-6
# Ends of a smooth part are evaluated inside it by this fraction of the part, so on its own side of a jump.
INSIDE = 1e-11
BATCH = 256


class SmoothPart(NamedTuple):
    """Part of a motion on which its acceleration is continuous, and within which it does not stop.

    Fields:
        motion: index of the motion.
        start: tau at the start.
        end: tau at the end.
        at_rest: whether the motion is at rest at the start, and at the end.
    """

    motion: int
    start: float
    end: float
    at_rest: tuple[bool, bool] = (False, False)


class MovingPoints(NamedTuple):
    """Positions of motions, and their derivatives in time.

    Fields:
        position: (k, 3) m; for a platform (k, 7), with the unit quaternion last.
        first: first derivative of `position`.
        second: second derivative of `position`.
        velocity: (k, 3) m/s; for a platform (k, 6), with the angular velocity times the platform's radius last.
        acceleration: as `velocity`, m/s^2.
    """

    position: np.ndarray
    first: np.ndarray
    second: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    @property
    def speed(self) -> np.ndarray:
        """Speeds, including those of rotation, (k,) m/s."""
        return np.linalg.norm(self.velocity, axis=1)


class MotionSequence:
    """Consecutive motions.

    Args:
        motions: the n motions.
        platform_radius: radius of the platform, m; unused for a point mass.

    Fields:
        duration: (n,) s.
    """

    def __init__(self, motions: Sequence[Motion], platform_radius: float) -> None:
        """Store the motions and their durations."""
        self._motions, self.platform_radius = list(motions), platform_radius
        self.duration = np.array([float(motion.duration()) for motion in motions])

    def rates(self, number: Int[np.ndarray, "k"], tau: Float[np.ndarray, "k"]) -> MovingPoints:
        """Positions and their derivatives."""
        columns: list[np.ndarray] = []
        for k in np.unique(number).tolist():
            chosen = number == k
            rates = self._of_one(self._motions[k], tau[chosen])
            columns = columns or [np.empty((len(tau), values.shape[1])) for values in rates]
            for column, values in zip(columns, rates, strict=True):
                column[chosen] = values
        return MovingPoints(*columns)

    def inside(
        self, parts: Sequence[SmoothPart], number: Int[np.ndarray, "k"], fraction: Float[np.ndarray, "k"]
    ) -> MovingPoints:
        """Positions and their derivatives inside smooth parts."""
        motion, start, end = (np.array([part[i] for part in parts])[number] for i in range(3))
        return self.rates(motion.astype(int), start + (end - start) * np.clip(fraction, INSIDE, 1.0 - INSIDE))

    def ends(self, motion: int) -> Float[np.ndarray, "pieces+1"]:
        """Starts and ends of the pieces of a motion."""
        return np.concatenate([[0.0], np.asarray(self._motions[motion].breaks()), [1.0]])

    def times(self, parts: Sequence[SmoothPart]) -> Float[np.ndarray, "m"]:
        """Durations of smooth parts."""
        return np.array([(part.end - part.start) * self.duration[part.motion] for part in parts])

    def _of_one(self, motion: Motion, tau: np.ndarray) -> MovingPoints:
        state: Any = states_at(motion, tau, BATCH)
        p, v, a = state.position, state.velocity, state.acceleration
        if state.quaternion is None:
            return MovingPoints(p, v, a, v, a)
        q, w, b = state.quaternion, state.angular_velocity, state.angular_acceleration
        turn = 0.5 * _product(w, q)
        second_derivative = 0.5 * (_product(b, q) + _product(w, turn))
        positions = [np.concatenate(pair, axis=1) for pair in ((p, q), (v, turn), (a, second_derivative))]
        return MovingPoints(
            *positions, *[np.concatenate([x, self.platform_radius * y], axis=1) for x, y in ((v, w), (a, b))]
        )

    def parts(self) -> list[SmoothPart]:
        """Smooth parts of all motions, in order, without those in which nothing moves."""
        breaks = [np.unique([0.0, *np.asarray(motion.breaks()), 1.0]) for motion in self._motions]
        smooth = [SmoothPart(k, *pair) for k, cuts in enumerate(breaks) for pair in itertools.pairwise(cuts)]
        lengths = np.array([part.end - part.start for part in smooth])
        counts = np.maximum(FEWEST, np.ceil(SAMPLES * lengths)).astype(int)
        number = np.repeat(np.arange(len(smooth)), counts + 1)
        fraction = np.concatenate([np.linspace(0.0, 1.0, count + 1) for count in counts])
        speed = self.inside(smooth, number, fraction).speed
        rest_speed = AT_REST * speed.max()
        if len(smooth) > 1:
            self._check_meeting(smooth, rest_speed)
        # Local minima of the speed among samples of one part are near stops.
        is_lowest = (speed[1:-1] <= speed[:-2]) & (speed[1:-1] < speed[2:]) & (number[2:] == number[:-2])
        index = np.flatnonzero(is_lowest) + 1
        fractions, is_stop = self._rest_points(
            smooth, number[index], fraction[index], 1.0 / counts[number[index]], rest_speed
        )
        ends = self.inside(smooth, np.repeat(np.arange(len(smooth)), 2), np.tile([0.0, 1.0], len(smooth)))
        # Stops at ends are located within the fraction INSIDE of the part.
        speed_error = np.linalg.norm(ends.acceleration, axis=1) * np.repeat(self.times(smooth), 2) * INSIDE
        is_end = (ends.speed <= rest_speed + 10.0 * speed_error).reshape(-1, 2)
        split_parts: list[SmoothPart] = []
        for k, part in enumerate(smooth):
            inner = np.sort(fractions[is_stop & (number[index] == k)])
            inner = inner[(inner > 10.0 * INSIDE) & (inner < 1.0 - 10.0 * INSIDE)]
            cuts = [part.start, *(part.start + (part.end - part.start) * inner).tolist(), part.end]
            at_rest = [bool(is_end[k, 0]), *[True] * len(inner), bool(is_end[k, 1])]
            for i in range(len(cuts) - 1):
                split_parts.append(SmoothPart(part.motion, cuts[i], cuts[i + 1], (at_rest[i], at_rest[i + 1])))
        middles = self.inside(
            split_parts, np.repeat(np.arange(len(split_parts)), 3), np.tile([0.25, 0.5, 0.75], len(split_parts))
        )
        moves = (middles.speed.reshape(-1, 3) > rest_speed).any(1)
        return [part for part, is_moving in zip(split_parts, moves, strict=True) if is_moving]

    def _check_meeting(self, smooth: list[SmoothPart], rest_speed: float) -> None:
        number = np.arange(len(smooth) - 1)
        before, after = self.inside(smooth, number, number * 0.0 + 1.0), self.inside(smooth, number + 1, number * 0.0)
        jump = np.linalg.norm(after.velocity - before.velocity, axis=1)
        bad = np.flatnonzero(jump > MEETS / AT_REST * rest_speed)
        if len(bad):
            name = f"segment {smooth[int(bad[0]) + 1].motion + 1}"
            raise InputError(
                name, None, "must go on at the same velocity", problem=f"it jumps by {jump[bad[0]]:.3g} m/s"
            )

    def _rest_points(
        self, smooth: list[SmoothPart], number: np.ndarray, fraction: np.ndarray, width: np.ndarray, rest_speed: float
    ) -> tuple[np.ndarray, np.ndarray]:
        # Return fractions of parts at which the speed is smallest, by Gauss-Newton steps, and whether these are stops.
        if not len(number):
            return fraction, np.zeros(0, bool)
        times, low, high = self.times(smooth)[number], fraction - width, fraction + width
        best, speed, radius = fraction.copy(), np.full(len(number), np.inf), np.full(len(number), np.inf)
        for _ in range(STEPS):
            rates = self.inside(smooth, number, fraction)
            better = rates.speed < speed
            best, speed = np.where(better, fraction, best), np.where(better, rates.speed, speed)
            square = np.sum(rates.acceleration**2, axis=1)
            turn = rates.speed**2 / np.sqrt(np.where(square > 0.0, square, np.inf))
            radius = np.where(better, turn, radius)
            step = np.sum(rates.velocity * rates.acceleration, axis=1) / np.where(square > 0.0, square, np.inf)
            fraction = np.clip(fraction - step / times, low, high)
            if not better.any():
                break
        return best, (speed <= rest_speed) | (radius <= CUSP)


def _product(vector: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    # Return products (k, 4) of quaternions, of which the first factors have scalar part 0.
    scalar, rest = quaternion[:, :1], quaternion[:, 1:]
    first = -np.sum(vector * rest, axis=1, keepdims=True)
    return np.concatenate([first, scalar * vector + np.cross(vector, rest)], axis=1)
