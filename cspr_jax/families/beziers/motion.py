"""Bezier curves of the second order, traversed by half a period of a cosine (launch paper, section 3.1).

With c = cos(pi tau), which goes from 1 to -1, the position is A c^2 + B c + C, (17); with w = pi / T the acceleration
is w^2 (2 A - B c - 4 A c^2), (18). It is w^2 (middle - start) at the start and w^2 (middle - end) at the end; where two
segments meet, both are equal (15).
"""

from __future__ import annotations

import dataclasses
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.formulas import Expression, MotionPiece, combined, function, rational, rationals
from cspr_jax.numerics import elementary
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds
from cspr_jax.numerics.bounds.function_bounds import sincospi
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.model.state import State
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.bounds.amplitude_bounds import normalised

# Number of blocks whose bounds are computed at a time.
BATCH = 64


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Bezier:
    """Motion along a Bezier curve of the second order; see `Motion`. Fields are jax numbers, or NumPy arrays of many.

    Fields:
        start: (3,) first control point, from the centroid of the spools, z down, m.
        middle: (3,) second control point, which the curve does not pass in general, m.
        end: (3,) third control point, m.
        time: () duration T, s.
        z0: () depth at which slacks are normalised, m.
    """

    start: Any
    middle: Any
    end: Any
    time: Any
    z0: Any

    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return self.time

    def state(self, tau: Array) -> State:
        """State, (17) and (18); see `Motion.state`."""
        sine, c = elementary.sincospi(jnp.asarray(tau, float))
        square, linear, rest = powers(self.start, self.middle, self.end)
        w = np.pi / self.time
        velocity = -w * sine * (2.0 * square * c + linear)
        acceleration = w**2 * (2.0 * square - linear * c - 4.0 * square * c**2)
        return State(square * c**2 + linear * c + rest, velocity, acceleration)

    def breaks(self) -> Array:
        """Return no breaks; see `Motion.breaks`."""
        return jnp.zeros(0)

    def bounds(self, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states; see `BoundedMotion.bounds`."""
        return many_bounds(jax.tree.map(lambda x: np.asarray(x)[None], self), np.zeros(len(start), int), start, end)

    def formulas(self) -> list[MotionPiece]:
        """Formulas; see `motion.formulas.HasFormulas`."""
        square, linear, rest = (rationals(x) for x in powers(*map(np.asarray, (self.start, self.middle, self.end))))
        time = rational(self.time)

        def curve(u: Expression) -> tuple[list[Expression], None]:
            c = function("cos_pi", u / time)
            return combined([c * c, c, 1], [square, linear, rest]), None

        return [MotionPiece(Fraction(0), time, curve)]


def many_bounds(
    curves: Bezier, motion: Int[np.ndarray, "k"], start: Float[np.ndarray, "k"], end: Float[np.ndarray, "k"]
) -> StateBounds:
    """Bounds of the states of a batch of segments over blocks of time."""
    each = jax.tree.map(lambda x: x[motion], curves)
    return in_batches(_bounds, (each, normalised(each.time, start, end)), batch_size=BATCH)


@persistent_jit
def _bounds(blocks: tuple[Bezier, AffineBounds]) -> StateBounds:
    def one(curve: Bezier, tau: AffineBounds) -> StateBounds:
        # 2 c^2 = 1 + cos(2 pi tau), and 2 c sin(pi tau) = sin(2 pi tau).
        (sine, c), (sine2, c2) = sincospi(tau), sincospi(tau * 2.0)
        square, linear, rest = powers(curve.start, curve.middle, curve.end)
        w = np.pi / curve.time
        return StateBounds(
            c2 * (0.5 * square) + c * linear + (rest + 0.5 * square),
            (sine2 * square + sine * linear) * -w,
            (c * linear + c2 * (2.0 * square)) * -(w**2),
        )

    return jax.vmap(one)(*blocks)


def powers(start: Any, middle: Any, end: Any) -> tuple[Any, Any, Any]:
    """Coefficients of the powers of c = cos(pi tau) in the position, (17)."""
    return 0.25 * (start - 2.0 * middle + end), 0.5 * (start - end), 0.25 * (start + 2.0 * middle + end)


def end_acceleration(middle: Any, end: Any, duration: Any) -> Any:
    """Acceleration at the end of a segment, which is that at the start of the next: (8), (15)."""
    return (np.pi / duration) ** 2 * (middle - end)
