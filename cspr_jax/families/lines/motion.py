"""Straight lines from rest to rest, by a law of time: the S-model, the quintic and the cubic.

The law s(tau) runs from 0 to 1 and is a piecewise polynomial, an `Amplitude` like those of chapter 2. In the S-model
(Boralugoda, Tables 3.1 and 3.2, their last range corrected) the acceleration is a triangle upwards during the fraction
p / T of the time, then a triangle downwards. With the quintic it is smooth, with the cubic it jumps at both ends.
"""

from __future__ import annotations

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion import amplitudes
from cspr_jax.motion.amplitudes import Amplitude, derivatives, law_pieces
from cspr_jax.motion.formulas import MotionPiece, combined, rationals
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.model.state import State
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.bounds.amplitude_bounds import TimeBounds, time_bounds

# Number of blocks whose bounds are computed at a time.
BATCH = 64
LAWS = ("s-curve", "quintic", "cubic")


def s_curve(ratio: Float[Array, ""]) -> Amplitude:
    """Law of the S-model."""
    ratio = jnp.asarray(ratio, float)
    rest, zero, one = 1.0 - ratio, jnp.zeros_like(ratio), jnp.ones_like(ratio)
    up, down = 4.0 / (3.0 * ratio**2), 4.0 / (3.0 * rest**2)
    # Expand the pieces about the start, about the time of largest speed from either side, and about the end.
    pieces = [
        [zero, zero, zero, up],
        [ratio, 2.0 * one, zero, -up],
        [ratio, 2.0 * one, zero, -down],
        [one, zero, zero, down],
    ]
    steepest = jnp.maximum(1.0 / ratio, 1.0 / rest)
    return Amplitude(
        knots=jnp.stack([0.5 * ratio, ratio, 0.5 * (1.0 + ratio)]),
        origins=jnp.stack([zero, ratio, ratio, one]),
        coefficients=jnp.stack([jnp.stack(piece) for piece in pieces]),
        largest=jnp.stack([one, 2.0 * one, 4.0 * steepest, 8.0 * steepest**2, zero, zero]),
        lowest=zero,
        highest=one,
        name="s-curve",
    )


def fixed_law(name: str) -> Amplitude:
    """Law without a parameter."""
    return amplitudes.named("quintic") if name == "quintic" else amplitudes.from_polynomial([0.0, 0.0, 3.0, -2.0])


def largest_second_derivative(law: str, ratio: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """Largest |s''| over tau of a law."""
    if law == "s-curve":
        return 4.0 / np.minimum(ratio, 1.0 - ratio)
    return np.full(np.shape(ratio), np.asarray(fixed_law(law).largest)[2])


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class TimedLine:
    """Motion along a straight line from rest to rest; see `Motion`.

    Fields:
        start: (3,) from the centroid of the spools, z down, m.
        direction: (3,) from the start to the end, m.
        law: the law s(tau).
        time: () duration T, s.
    """

    start: Array
    direction: Array
    law: Amplitude
    time: Array

    @property
    def z0(self) -> Array:
        """Depth at which slacks are normalised: that of the start, () m."""
        return self.start[..., 2]

    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return self.time

    def state(self, tau: Array) -> State:
        """State, (7) to (9); see `Motion.state`."""
        s, s1, s2 = derivatives(self.law, jnp.asarray(tau, float), order=2)
        along = (self.start + s * self.direction, s1 / self.time * self.direction, s2 / self.time**2 * self.direction)
        return State(*along)

    def breaks(self) -> Array:
        """Knots of the law; see `Motion.breaks`."""
        return self.law.knots

    def bounds(self, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states; see `BoundedMotion.bounds`."""
        blocks = time_bounds(self.law, self.time, start, end)
        return in_batches(partial(_bounds, self), blocks, batch_size=BATCH)

    def formulas(self) -> list[MotionPiece]:
        """Formulas; see `motion.formulas.HasFormulas`."""
        start, direction = rationals(self.start), rationals(self.direction)
        return law_pieces(
            [self.law], self.time, lambda tau, laws: (combined([1, laws[0].at(tau)], [start, direction]), None)
        )


@persistent_jit
def _bounds(line: TimedLine, blocks: TimeBounds) -> StateBounds:
    def one(block: TimeBounds) -> StateBounds:
        s, s1, s2 = (value.each(lambda x: x[None]) for value in block.values)
        rates = (s1 * (line.direction / line.time), s2 * (line.direction / line.time**2))
        return StateBounds(s * line.direction + line.start, *rates)

    return jax.vmap(one)(blocks)
