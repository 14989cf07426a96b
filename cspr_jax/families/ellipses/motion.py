"""Motion on harmonic ellipses: turns on an ellipse, and transfers between ellipses, from rest or to rest.

Along a law s from 0 to 1, centre, axes and frequency go from those of the first ellipse to those of the last:

    x = C + a cos(theta) + b sin(theta),    C = C0 + s (C1 - C0), a and b likewise,    theta' = w0 + s (w1 - w0).

The first two derivatives of the law are zero at its start and its end, so that position, velocity and acceleration at
both ends are those of the ellipses. Rest is an ellipse whose axes are zero; with a constant law the motion turns on one
ellipse.
"""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.rotation import Rotation, rotation_bounds, rotation_formula, rotation_state
from cspr_jax.motion.amplitudes import Amplitude, LawPiece, derivatives, from_pieces, law_pieces, named
from cspr_jax.motion.formulas import Expression, MotionPiece, combined, function, rational, rationals
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds
from cspr_jax.numerics.bounds.function_bounds import sincospi
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.model.state import State
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.bounds.amplitude_bounds import TimeBounds, time_bounds

# Number of blocks whose bounds are computed at a time.
BATCH = 64


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class EllipseMotion:
    """Motion from one ellipse to another, and turns on the latter; see `Motion`.

    Fields:
        first: the ellipse at the start, leaves (3,).
        last: the ellipse at the end.
        frequencies: (2,) frequencies of the first and the last ellipse, rad/s.
        phase: () angle theta at the start, rad.
        law: s as a function of normalised time.
        progress: integral of the law from the start.
        time: () duration, s.
        rotation: rotation of a platform; None for a point mass.
    """

    first: Ellipse
    last: Ellipse
    frequencies: Array
    phase: Array
    law: Amplitude
    progress: Amplitude
    time: Array
    rotation: Rotation | None = None

    @property
    def z0(self) -> Array:
        """Depth at which slacks are normalised, that of the last centre, () m."""
        return self.last.centre[..., 2]

    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return self.time

    def state(self, tau: Array) -> State:
        """State; see `Motion.state`."""
        tau = jnp.asarray(tau, float)
        s = derivatives(self.law, tau, order=2)
        start, change = self.frequencies[0], self.frequencies[1] - self.frequencies[0]
        angle = self.phase + self.time * (start * tau + change * derivatives(self.progress, tau, order=0)[0])
        rates = (start + change * s[0], change * s[1] / self.time)
        in_time = (s[0], s[1] / self.time, s[2] / self.time**2)
        turns = (jnp.cos(angle), jnp.sin(angle))
        position = _kinematics(self.first, self.last, in_time, turns, rates)
        if self.rotation is None:
            return State(*position)
        return State(
            *position, *rotation_state(self.rotation, in_time, _oscillation(self.rotation, in_time, turns, rates))
        )

    def breaks(self) -> Array:
        """Knots of the law; see `Motion.breaks`."""
        return self.law.knots

    def bounds(self, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states; see `BoundedMotion.bounds`."""
        blocks = (
            time_bounds(self.law, self.time, start, end),
            time_bounds(self.progress, self.time, start, end, orders=1).values[0],
        )
        return in_batches(partial(_bounds, self), blocks, batch_size=BATCH)

    def formulas(self) -> list[MotionPiece]:
        """Formulas; see `motion.formulas.HasFormulas`."""
        first, last = ([rationals(vector) for vector in ellipse] for ellipse in (self.first, self.last))
        (start, end), phase, time = rationals(self.frequencies), rational(self.phase), rational(self.time)

        def curve(tau: Expression, laws: list[LawPiece]) -> tuple[list[Expression], list[Expression] | None]:
            s, rest = laws[0].at(tau), 1 - laws[0].at(tau)
            angle = tau * (start * time) + phase
            if start != end:
                angle = angle + laws[1].at(tau) * ((end - start) * time)
            cosine, sine = function("cos", angle), function("sin", angle)
            factors: list[Any] = [1, cosine, sine]
            position = combined([s * x for x in factors] + [rest * x for x in factors], [*last, *first])
            if self.rotation is None:
                return position, None
            return position, rotation_formula(self.rotation, s, cosine, sine)

        return law_pieces([self.law, self.progress], self.time, curve)


def _kinematics(first: Ellipse, last: Ellipse, s: tuple, turns: tuple, rates: tuple) -> tuple[Any, Any, Any]:
    # Return position, velocity and acceleration from s and the cosine and sine of the angle, with two time derivatives
    # of s and of the angle; works on numbers and on bounds.
    spans = [after - before for before, after in zip(first, last, strict=True)]
    cosine, sine = turns
    a, b = (s[0] * span + start for span, start in zip(spans[1:], first[1:], strict=True))
    outward, forward = a * cosine + b * sine, b * cosine - a * sine
    growing = [s[1] * span for span in spans]
    bending = [s[2] * span for span in spans]
    position = s[0] * spans[0] + first.centre + outward
    velocity = growing[0] + growing[1] * cosine + growing[2] * sine + forward * rates[0]
    swept = growing[2] * cosine - growing[1] * sine
    second_derivative = bending[0] + bending[1] * cosine + bending[2] * sine
    acceleration = second_derivative + swept * (rates[0] * 2.0) + forward * rates[1] - outward * (rates[0] * rates[0])
    return position, velocity, acceleration


def _oscillation(rotation: Rotation, s: tuple, turns: tuple, rates: tuple) -> tuple[Any, Any, Any]:
    # The angle of oscillation follows p cos(theta) + q sin(theta), as positions follow an ellipse.
    first, last = (Ellipse(jnp.zeros_like(parts[0]), parts[0], parts[1]) for parts in (rotation.first, rotation.last))
    return _kinematics(first, last, s, turns, rates)


@persistent_jit
def _bounds(motion: EllipseMotion, blocks: tuple[TimeBounds, AffineBounds]) -> StateBounds:
    start, change = motion.frequencies[0], motion.frequencies[1] - motion.frequencies[0]
    time = motion.time

    def one(block: tuple[TimeBounds, AffineBounds]) -> StateBounds:
        values, progress = block
        s, s1, s2 = (value.each(lambda x: x[None]) for value in values.values)
        tau, progress = (value.each(lambda x: x[None]) for value in (values.tau, progress))
        angle = (tau * start + progress * change) * (time / math.pi) + motion.phase / math.pi
        sine, cosine = sincospi(angle)
        rates = (s * change + start, s1 * (change / time))
        in_time, turns = (s, s1 * (1.0 / time), s2 * (1.0 / time**2)), (cosine, sine)
        position = _kinematics(motion.first, motion.last, in_time, turns, rates)
        if motion.rotation is None:
            return StateBounds(*position)
        oscillation = _oscillation(motion.rotation, in_time, turns, rates)
        return StateBounds(*position, *rotation_bounds(motion.rotation, in_time, oscillation))

    return jax.vmap(one)(blocks)


def turning(ellipse: Ellipse, frequency: Float[Array, ""], phase: Float[Array, ""], turns: Any) -> EllipseMotion:
    """Turns on one ellipse."""
    law, time = with_turns(named("quintic"), 0.0), 2.0 * math.pi * jnp.asarray(turns, float) / frequency
    return EllipseMotion(ellipse, ellipse, jnp.stack([frequency, frequency]), phase, law, integral(law), time)


def with_turns(amplitude: Amplitude, fraction: float) -> Amplitude:
    """Law that makes a transfer in a fraction of the time, and turns for the rest."""
    if fraction == 0.0:
        return from_pieces("1", (), (0.0,), ((1.0,),))
    powers = fraction ** -np.arange(amplitude.coefficients.shape[1])
    pieces = (np.asarray(amplitude.coefficients) * powers).tolist()
    knots, origins = (np.asarray(x) * fraction for x in (amplitude.knots, amplitude.origins))
    if fraction == 1.0:
        return amplitude
    return from_pieces(amplitude.name, [*knots, fraction], [*origins, 1.0], [*pieces, (1.0,)])


def integral(law: Amplitude) -> Amplitude:
    """Integral of a law from its start."""
    origins, knots = np.asarray(law.origins), np.asarray(law.knots)
    pieces, value = [], 0.0
    for coefficients, origin, first, last in zip(law.coefficients, origins, [0.0, *knots], [*knots, 1.0], strict=True):
        curve = np.polynomial.Polynomial(np.asarray(coefficients)).integ(lbnd=first - origin)
        pieces.append((curve + value).coef.tolist())
        value += float(curve(last - origin))
    return from_pieces(law.name, knots.tolist(), origins.tolist(), pieces)
