"""Criteria of a segment as slacks: a slack is positive exactly if its criterion is met.

At one time, with kappa_k the normalised pseudotension of cable k (1 at rest in p0), and eta the vertical
depth below the spools over z0:

    taut               kappa_k        thesis (2.12) to (2.14)
    below the spools   eta

`limit_slacks` adds the slacks of the given limits. For each slack there is a bound of its second derivative
over an interval, from the closed form, so that verdicts also hold between samples.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.families.swings.hypocycloid import Segment, oscillation, swing
from cspr_jax.motion.amplitudes import Amplitude, derivatives, local_bounds
from cspr_jax.numerics.bounds.value_and_derivatives import Bounds, hypotenuse
from cspr_jax.numerics.elementary import maximum_of, sincospi
from cspr_jax.numerics.shapes import Float, Num


class SwingState(NamedTuple):
    """State of a segment at one time.

    Fields:
        kappa: normalised pseudotensions, one () for each cable.
        eta: () depth below the spools over z0.
        c: (2,) position in the plane of the trajectory, m.
        d: (2,) c + c'' / lambda, m.
        amplitude_values: A, A', A'', each ().
    """

    kappa: list[Array]
    eta: Array
    c: Array
    d: Array
    amplitude_values: tuple[Array, ...]


def swing_state(segment: Segment, amplitude: Amplitude, arcs: Num[Array, ""], tau: Float[Array, ""]) -> SwingState:
    """State of a segment at one time, by closed form."""
    values = derivatives(amplitude, tau, order=2)
    c, d = swing(segment, values, arcs, tau)
    cross = c[0] * d[1] - c[1] * d[0]
    eta = 1.0 + segment.tilt[0] * c[0] + segment.tilt[1] * c[1]
    terms = [segment.coupling[k, 0] * d[0] + segment.coupling[k, 1] * d[1] for k in range(segment.coupling.shape[0])]
    kappa = [eta + term + segment.twist[k] * cross for k, term in enumerate(terms)]
    return SwingState(kappa, eta, c, d, values)


def normalised_pseudotensions(
    segment: Segment, amplitude: Amplitude, arcs: Num[Array, ""], tau: Float[Array, ""]
) -> Float[Array, "n_cables"]:
    """Pseudotensions over their value at rest in p0 at one time, by closed form."""
    return jnp.stack(swing_state(segment, amplitude, arcs, tau).kappa)


def largest_term(amplitude: Amplitude, segment: Segment, arcs: Num[Array, ""]) -> Float[Array, ""]:
    """Bound of the sum of magnitudes of all terms of a normalised pseudotension, which scales its rounding errors."""
    ratio, steady, period = oscillation(segment, arcs)
    span = jnp.abs(segment.end_radius - segment.start_radius)
    largest = amplitude.largest.astype(span.dtype)
    radius = jnp.maximum(segment.start_radius, segment.end_radius) + span * (largest[0] - 1.0)
    gain, second_derivative = steady / period, jnp.abs(segment.end_curvature)
    force = (span * largest[2] + second_derivative * radius) / period + gain * (
        span * largest[1] / arcs + 2.0 * ratio * radius
    )
    coupling = maximum_of(jnp.sum(jnp.abs(segment.coupling), axis=-1))
    twist = maximum_of(jnp.abs(segment.twist))
    return 1.0 + radius * jnp.sum(jnp.abs(segment.tilt)) + force * (coupling + radius * twist)


class IntervalBounds(NamedTuple):
    """An interval of tau without a knot of the amplitude function inside, with bounds over it.

    Fields:
        middle: () middle of the interval.
        radius: () half the width of the interval.
        swing_radius: bounds of r.
        radial_rate: bounds of r'.
        second_derivative: bounds of r''.
        position: (2,) position c in the middle, m.
    """

    middle: Array
    radius: Array
    swing_radius: Bounds
    radial_rate: Bounds
    second_derivative: Bounds
    position: Array


def interval_bounds(
    segment: Segment, amplitude: Amplitude, arcs: Num[Array, ""], start: Float[Array, ""], stop: Float[Array, ""]
) -> IntervalBounds:
    """The interval [start, stop] with bounds of the radius r(tau) of (2.48) over it."""
    middle, radius = 0.5 * (start + stop), 0.5 * (stop - start)
    span = segment.end_radius - segment.start_radius
    a = local_bounds(amplitude, middle, radius)
    r1, r2, r3, r4 = (jnp.abs(span) * a[j] for j in range(1, 5))
    at_middle = segment.start_radius + span * derivatives(amplitude, middle, order=0)[0]
    r0 = jnp.abs(at_middle) + radius * r1
    position = swing_state(segment, amplitude, arcs, middle).c
    return IntervalBounds(middle, radius, Bounds(r0, r1, r2), Bounds(r1, r2, r3), Bounds(r2, r3, r4), position)


def _components(segment: Segment, vector: Array, over: IntervalBounds) -> tuple[Bounds, Bounds]:
    # Bound vector . e_r and vector . e_t, which precession rotates into each other.
    lateral, axial = sincospi(segment.sense * segment.precession * over.middle)
    length = hypotenuse(vector[0], vector[1])
    rate = math.pi * segment.precession
    change = over.radius * rate * length
    radial = jnp.minimum(jnp.abs(vector[0] * axial - vector[1] * lateral) + change, length)
    tangential = jnp.minimum(jnp.abs(vector[0] * lateral + vector[1] * axial) + change, length)
    return (
        Bounds(radial, rate * tangential, rate**2 * radial),
        Bounds(tangential, rate * radial, rate**2 * tangential),
    )


@jax.jit
def row_bounds(
    segment: Segment,
    arcs: Num[Array, ""],
    over: IntervalBounds,
    tilt: Float[Array, "2"],
    coupling: Float[Array, "2"] | None = None,
    twist: Float[Array, ""] | None = None,
) -> Bounds:
    """Bounds of tilt . c + coupling . d + twist (c x d) over an interval.

    In the precessing frame it is X cos Phi + Y sin Phi + E (cos 2 Phi - 1) + F sin 2 Phi with Phi = pi p tau. X, Y, E
    and F vary slowly; their bounds and those of Phi give the bounds of the sum.
    """
    ratio, steady, period = oscillation(segment, arcs)
    omega, gain = math.pi * arcs, steady / period
    tilt_r, tilt_t = _components(segment, tilt, over)
    x, y = tilt_r * over.swing_radius, (tilt_t * over.swing_radius).times(ratio)
    if coupling is not None:
        pull_r, pull_t = _components(segment, coupling, over)
        rho = (over.second_derivative + over.swing_radius.times(jnp.abs(segment.end_curvature))).times(1.0 / period)
        x = x + pull_r * rho
        y = y + (pull_t * (rho + over.swing_radius.times(2.0 * gain))).times(ratio)
        y = y + (pull_r * over.radial_rate).times(2.0 * gain / omega)
    total = _oscillating(x, y, omega)
    if twist is not None:
        e = (over.swing_radius * over.radial_rate).times(gain * twist * ratio / omega)
        total = (
            total
            + _oscillating(e, (over.swing_radius * over.swing_radius).times(gain * twist * ratio), 2.0 * omega)
            + e
        )
    return total


def _oscillating(cosine: Bounds, sine: Bounds, omega: Array) -> Bounds:
    # Bound f cos(omega tau) + g sin(omega tau) and its derivatives, with the worst phase for each pair of factors.
    return Bounds(
        hypotenuse(cosine.value, sine.value),
        hypotenuse(cosine.derivative + omega * sine.value, sine.derivative + omega * cosine.value),
        hypotenuse(
            cosine.curvature + 2.0 * omega * sine.derivative + omega**2 * cosine.value,
            sine.curvature + 2.0 * omega * cosine.derivative + omega**2 * sine.value,
        ),
    )


def each_taut_bounds(segment: Segment, arcs: Num[Array, ""], over: IntervalBounds) -> list[Bounds]:
    """Bounds of the variable part kappa_k - 1 over an interval; its derivatives are those of kappa_k."""
    cables = range(segment.coupling.shape[0])
    return [row_bounds(segment, arcs, over, segment.tilt, segment.coupling[k], segment.twist[k]) for k in cables]


def taut_bounds(segment: Segment, arcs: Num[Array, ""], over: IntervalBounds) -> Bounds:
    """The bounds of `each_taut_bounds` as arrays."""
    return jax.tree.map(lambda *bounds: jnp.stack(bounds), *each_taut_bounds(segment, arcs, over))
