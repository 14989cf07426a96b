"""Motions of any kind one behind another: their states at many instants, and the smooth parts between their stops."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.motion.motion import Motion, states_at

if TYPE_CHECKING:
    from jaxtyping import Float, Int

# Samples of a motion among which stops are sought, and the fewest of a smooth part.
SAMPLES, FEWEST = 2000, 8
# Part of the largest speed below which a motion stands still; steps by which the instant of a stop is refined.
STILL, STEPS = 1e-9, 80
# Radius of a turn at the least speed, m, below which the motion turns back there.
CUSP = 4e-10
# Part of the largest speed by which motions may differ where one goes on from another.
MEETS = 1e-6
# Share of a smooth part by which its ends lie inside of it, so that each is evaluated on its own side of a break.
INSIDE = 1e-11
BATCH = 256


class SmoothPart(NamedTuple):
    """Part of a motion over which its acceleration is continuous, and within which it does not stop.

    Fields:
        motion: number of the motion.
        start: tau.
        end: tau.
        at_rest: whether the motion is at rest at the start, and at the end.
    """

    motion: int
    start: float
    end: float
    at_rest: tuple[bool, bool] = (False, False)


class MovingPlaces(NamedTuple):
    """Places of motions, and derivatives in time.

    Fields:
        place: (k, 3) m, of a platform (k, 7) with the unit quaternion behind.
        first: derivative of the place.
        second: the second one.
        velocity: (k, 3) m/s, of a platform (k, 6) with the angular velocity times its size behind.
        acceleration: likewise, m/s^2.
    """

    place: np.ndarray
    first: np.ndarray
    second: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    @property
    def speed(self) -> np.ndarray:
        """Speeds, that of turning included, (k,) m/s."""
        return np.linalg.norm(self.velocity, axis=1)


class MotionSequence:
    """Motions one behind another.

    Args:
        motions: n of them.
        size: of the platform, m; of no account for a point mass.

    Fields:
        duration: (n,) s.
    """

    def __init__(self, motions: Sequence[Motion], size: float) -> None:
        """Take the durations."""
        self._motions, self.size = list(motions), size
        self.duration = np.array([float(motion.duration()) for motion in motions])

    def rates(self, number: Int[np.ndarray, "k"], tau: Float[np.ndarray, "k"]) -> MovingPlaces:
        """Places and their derivatives."""
        columns: list[np.ndarray] = []
        for k in np.unique(number).tolist():
            chosen = number == k
            rates = self._of_one(self._motions[k], tau[chosen])
            columns = columns or [np.empty((len(tau), values.shape[1])) for values in rates]
            for column, values in zip(columns, rates, strict=True):
                column[chosen] = values
        return MovingPlaces(*columns)

    def inside(
        self, parts: Sequence[SmoothPart], number: Int[np.ndarray, "k"], fraction: Float[np.ndarray, "k"]
    ) -> MovingPlaces:
        """Places and their derivatives within smooth parts."""
        motion, start, end = (np.array([part[i] for part in parts])[number] for i in range(3))
        return self.rates(motion.astype(int), start + (end - start) * np.clip(fraction, INSIDE, 1.0 - INSIDE))

    def ends(self, motion: int) -> Float[np.ndarray, "pieces+1"]:
        """Starts and ends of the pieces of a motion."""
        return np.concatenate([[0.0], np.asarray(self._motions[motion].breaks()), [1.0]])

    def times(self, parts: Sequence[SmoothPart]) -> Float[np.ndarray, "m"]:
        """Durations of smooth parts."""
        return np.array([(part.end - part.start) * self.duration[part.motion] for part in parts])

    def _of_one(self, motion: Motion, tau: np.ndarray) -> MovingPlaces:
        state: Any = states_at(motion, tau, BATCH)
        p, v, a = state.position, state.velocity, state.acceleration
        if state.quaternion is None:
            return MovingPlaces(p, v, a, v, a)
        q, w, b = state.quaternion, state.angular_velocity, state.angular_acceleration
        turn = 0.5 * _product(w, q)
        second_derivative = 0.5 * (_product(b, q) + _product(w, turn))
        places = [np.concatenate(pair, axis=1) for pair in ((p, q), (v, turn), (a, second_derivative))]
        return MovingPlaces(*places, *[np.concatenate([x, self.size * y], axis=1) for x, y in ((v, w), (a, b))])

    def parts(self) -> list[SmoothPart]:
        """Smooth parts of all motions, in their order, without those in which nothing moves."""
        breaks = [np.unique([0.0, *np.asarray(motion.breaks()), 1.0]) for motion in self._motions]
        smooth = [SmoothPart(k, *pair) for k, cuts in enumerate(breaks) for pair in itertools.pairwise(cuts)]
        lengths = np.array([part.end - part.start for part in smooth])
        counts = np.maximum(FEWEST, np.ceil(SAMPLES * lengths)).astype(int)
        number = np.repeat(np.arange(len(smooth)), counts + 1)
        fraction = np.concatenate([np.linspace(0.0, 1.0, count + 1) for count in counts])
        speed = self.inside(smooth, number, fraction).speed
        still = STILL * speed.max()
        if len(smooth) > 1:
            self._check_meeting(smooth, still)
        # Least speeds among the samples of one part lie near stops.
        is_least = (speed[1:-1] <= speed[:-2]) & (speed[1:-1] < speed[2:]) & (number[2:] == number[:-2])
        row = np.flatnonzero(is_least) + 1
        instants, is_stop = self._stops(smooth, number[row], fraction[row], 1.0 / counts[number[row]], still)
        ends = self.inside(smooth, np.repeat(np.arange(len(smooth)), 2), np.tile([0.0, 1.0], len(smooth)))
        # A stop at an end is met to INSIDE of the part.
        reach = np.linalg.norm(ends.acceleration, axis=1) * np.repeat(self.times(smooth), 2) * INSIDE
        is_end = (ends.speed <= still + 10.0 * reach).reshape(-1, 2)
        rows: list[SmoothPart] = []
        for k, part in enumerate(smooth):
            inner = np.sort(instants[is_stop & (number[row] == k)])
            inner = inner[(inner > 10.0 * INSIDE) & (inner < 1.0 - 10.0 * INSIDE)]
            cuts = [part.start, *(part.start + (part.end - part.start) * inner).tolist(), part.end]
            at_rest = [bool(is_end[k, 0]), *[True] * len(inner), bool(is_end[k, 1])]
            for i in range(len(cuts) - 1):
                rows.append(SmoothPart(part.motion, cuts[i], cuts[i + 1], (at_rest[i], at_rest[i + 1])))
        middles = self.inside(rows, np.repeat(np.arange(len(rows)), 3), np.tile([0.25, 0.5, 0.75], len(rows)))
        moves = (middles.speed.reshape(-1, 3) > still).any(1)
        return [part for part, is_moving in zip(rows, moves, strict=True) if is_moving]

    def _check_meeting(self, smooth: list[SmoothPart], still: float) -> None:
        number = np.arange(len(smooth) - 1)
        before, after = self.inside(smooth, number, number * 0.0 + 1.0), self.inside(smooth, number + 1, number * 0.0)
        jump = np.linalg.norm(after.velocity - before.velocity, axis=1)
        bad = np.flatnonzero(jump > MEETS / STILL * still)
        if len(bad):
            name = f"segment {smooth[int(bad[0]) + 1].motion + 1}"
            raise InputError(
                name, None, "must go on at the same velocity", problem=f"it jumps by {jump[bad[0]]:.3g} m/s"
            )

    def _stops(
        self, smooth: list[SmoothPart], number: np.ndarray, fraction: np.ndarray, width: np.ndarray, still: float
    ) -> tuple[np.ndarray, np.ndarray]:
        # Shares of parts at which the speed is least, by steps of Gauss and Newton, and whether it is a stop.
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
        return best, (speed <= still) | (radius <= CUSP)


def _product(vector: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    # Products (k, 4) of quaternions, the first of which have no scalar.
    scalar, rest = quaternion[:, :1], quaternion[:, 1:]
    first = -np.sum(vector * rest, axis=1, keepdims=True)
    return np.concatenate([first, scalar * vector + np.cross(vector, rest)], axis=1)
