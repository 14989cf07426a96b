"""Smallest number of oscillations of many transitions, by the envelopes and by the pseudotensions themselves.

The envelopes (1.39) are sufficient, not necessary: a motion may be taut with one oscillation fewer. So answers hold
both the smallest integer that the envelopes allow, and the smallest that is proved from the pseudotensions.
"""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from cspr_jax.families.swings.arcs import check_numbers
from cspr_jax.families.swings.decide import BATCH, ProvedArcs, decided, end_slacks
from cspr_jax.families.swings.hypocycloid import Segment, oscillation
from cspr_jax.families.swings.proof.blocks import blocks
from cspr_jax.families.swings.proof.margins import Functions, margins, smallest_values
from cspr_jax.families.swings.proof.verdicts import tolerance
from cspr_jax.families.swings.transitions import envelope_oscillations as counts
from cspr_jax.families.swings.transitions import transition, zero_tension
from cspr_jax.families.swings.transitions.envelopes import proved_envelope
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import maximum_of, minimum_of, sincospi
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.runtime.stages import stage

# Number of samples of the screen, odd so that they do not coincide with the zeros of an oscillation.
SAMPLES = 61
ENVELOPE_ERROR = 1e-12


@dataclasses.dataclass(frozen=True)
class OscillationAnswers(Answers):
    """Answers for transitions; an oscillation has two arcs.

    Fields:
        oscillations: (n,) smallest number of oscillations proved feasible; 0: none.
        tried_oscillations: (n,) number for which duration and margins are reported.
        envelope_oscillations: (n,) smallest integer that keeps the envelopes positive; 0: none up to the largest tried.
        least_oscillations: (n,) smallest such real number; NaN where |v A| reaches 1, so that there is none.
        inclination_gain: (n,) oscillations, a real number, that the inclination saves relative to a horizontal
            transition.
        used_inclination: (n,) inclination v.
        used_z0: (n,) depth of p0 below the centroid of the spools, m.
    """

    oscillations: np.ndarray
    tried_oscillations: np.ndarray
    envelope_oscillations: np.ndarray
    least_oscillations: np.ndarray
    inclination_gain: np.ndarray
    used_inclination: np.ndarray
    used_z0: np.ndarray

    def details(self, i: int) -> dict[str, Any]:
        """Numbers of oscillations; see `Answers.details`."""
        return super().details(i) | {
            "oscillations": int(self.arcs[i]) // 2 or None,
            "tried_oscillations": int(self.tried_oscillations[i]),
            "envelope_oscillations": int(self.envelope_oscillations[i]) or None,
            "least_oscillations": float(self.least_oscillations[i]),
            "inclination": float(self.used_inclination[i]),
        }


@jax.jit
def _transitions(problem: Problem, arguments) -> Segment:
    return jax.vmap(partial(transition.transition, problem.robot, problem.amplitude))(*arguments)


def transitions_to(problem: Problem, targets: Float[np.ndarray, "n 3"], z0: Float[np.ndarray, "n"]) -> Segment:
    """Transitions from rest to many targets."""
    return in_batches(partial(_transitions, problem), (targets, z0), batch_size=BATCH)


@jax.jit
def _best_inclinations(amplitude: Amplitude, weights: jax.Array) -> jax.Array:
    return jax.vmap(lambda w: counts.best_inclination(amplitude, w)[0])(weights)


def best_inclinations(
    problem: Problem, targets: Float[np.ndarray, "n 3"], *, max_arcs: int = 30
) -> Float[np.ndarray, "n"]:
    """The inclination of each target that needs the fewest oscillations."""
    if problem.robot.n_cables > problem.robot.dof:
        from cspr_jax.families.swings.transitions.redundant_inclinations import redundant_inclinations

        return redundant_inclinations(problem, targets, transitions_to, max_arcs=max_arcs)
    # The weights depend on neither the depth of p0 nor that of the target.
    weights = transition.weights(transitions_to(problem, targets, np.ones(len(targets))))
    if not np.any(problem.amplitude.largest[2]):  # A = tau
        return np.asarray(jax.vmap(lambda w: zero_tension.best_inclination(w)[0])(weights))
    return in_batches(partial(_best_inclinations, problem.amplitude), np.asarray(weights), batch_size=BATCH)


@jax.jit
def _envelopes(amplitude: Amplitude, arguments) -> tuple[jax.Array, jax.Array]:
    def one(weights, v):
        inside = jnp.abs(v) < 1.0
        needed = counts.least_oscillations(amplitude, weights, jnp.where(inside, v, 0.0))
        needed = jnp.where(inside & jnp.isfinite(needed), needed, jnp.nan)
        return needed, counts.horizontal_oscillations(amplitude, weights) - needed

    return jax.vmap(one)(*arguments)


@jax.jit
def _level(amplitude: Amplitude, arguments) -> tuple[jax.Array, jax.Array]:
    # Horizontal transitions take only a third of the work.
    weights, _ = arguments
    needed = jax.vmap(partial(counts.horizontal_oscillations, amplitude))(weights)
    return needed, jnp.zeros_like(needed)


@partial(jax.jit, static_argnames="largest")
def _upper_bounds(amplitude: Amplitude, loads: tuple[jax.Array, jax.Array, jax.Array], *, largest: int) -> jax.Array:
    # Bound 1 + v A cos - L h: the pseudotension for the load L = v + w_k, and the depth for L = 0.
    high, low, v = loads
    tau = (np.arange(SAMPLES) + 0.5) / SAMPLES
    value, rate, second_derivative = derivatives(amplitude, jnp.asarray(tau), order=2)
    end = derivatives(amplitude, jnp.ones(()), order=2)[2]

    def one(n):
        omega = 2.0 * jnp.pi * n
        period = omega**2 - end
        cosine, sine = jnp.cos(omega * tau), jnp.sin(omega * tau)
        h = ((second_derivative - value * end) * cosine - 2.0 * omega * rate * sine) / period
        worst = jnp.maximum(high[:, None] * h[None], low[:, None] * h[None])
        lowest = minimum_of(1.0 + v[:, None] * value[None] * cosine[None] - worst, axis=1)
        guard = ENVELOPE_ERROR * (1.0 + jnp.abs(v) + jnp.maximum(high, -low) * maximum_of(jnp.abs(h)))
        return jnp.where(period > 0.0, lowest + guard, -jnp.inf)

    return lax.map(one, jnp.arange(1.0, largest + 1.0)).T


@jax.jit
def _proofs(amplitude: Amplitude, arguments) -> tuple[jax.Array, jax.Array]:
    def one(segment, weights, v, n):
        return proved_envelope(amplitude, weights, v, n), tolerance(amplitude, segment, 2.0 * n)

    return jax.vmap(one)(*arguments)


def _proved_arcs(
    problem: Problem, segments: Segment, of_targets: tuple[np.ndarray, np.ndarray], allowed: np.ndarray
) -> ProvedArcs:
    # Return the integer numbers of oscillations that the envelopes prove.
    n = np.where(np.isfinite(allowed), allowed, 1.0)
    kernel = partial(_proofs, problem.amplitude)
    bound, near = in_batches(kernel, (segments, *of_targets, n), batch_size=BATCH)
    return ProvedArcs(np.where(np.isfinite(allowed) & (bound > near), 2 * n, 0).astype(int), bound)


def minimum_oscillations(
    problem: Problem, segments: Segment, z0: Float[np.ndarray, "n"], *, max_arcs: int = 30, arcs=None, steady=None
) -> OscillationAnswers:
    """Smallest number of oscillations of transitions.

    Needs 64-bit jax (`jax.config.update("jax_enable_x64", True)`): verdicts are in float64.
    """
    check_numbers(problem.robot, z0, max_arcs)
    stage(f"numbers of oscillations, 1 to {max_arcs // 2}")
    largest = max(max_arcs // 2, 1)
    if problem.robot.n_cables > problem.robot.dof:
        return _on_more_cables(problem, segments, z0, 2 * largest, arcs)
    v, weights = np.asarray(transition.inclination(segments)), np.asarray(transition.weights(segments))
    envelopes = _level if (v == 0.0).all() else _envelopes
    bounds = in_batches(partial(envelopes, problem.amplitude), (weights, v), batch_size=BATCH)
    real, gain = (np.array(column) for column in bounds)
    loads = v[:, None] + weights
    extreme = (np.maximum(loads.max(1), 0.0), np.minimum(loads.min(1), 0.0), v)
    kernel = partial(_upper_bounds, problem.amplitude, largest=largest)
    upper = np.full((len(v), 2 * largest), -np.inf)
    upper[:, 1::2] = in_batches(kernel, extreme, batch_size=BATCH)
    at_ends = in_batches(partial(end_slacks, touchable(problem), 4.0), segments, batch_size=BATCH)
    if steady is not None:
        upper[steady, 1::2], real[steady], gain[steady] = np.inf, 0.0, 0.0
    infinity = _infinity(problem, v)
    allowed = np.floor(np.where(np.isnan(real), np.inf, real)) + 1.0
    parities = {0: segments, 1: segments}
    is_plain = steady is None and not limits_set(problem.limits) and problem.limits.uncertainty is None
    precomputed = _proved_arcs(problem, segments, (weights, v), allowed) if is_plain else None
    measure = transition_margins if steady is None else margins
    answers, _ = decided(
        problem, parities, upper, at_ends, infinity, arcs=arcs, precomputed=precomputed, measure=measure
    )
    return OscillationAnswers(
        **vars(answers),
        oscillations=answers.arcs // 2,
        tried_oscillations=answers.tried_arcs // 2,
        envelope_oscillations=np.where(allowed <= largest, allowed, 0).astype(int),
        least_oscillations=real,
        inclination_gain=np.where(np.isnan(real), np.nan, gain),
        used_inclination=v,
        used_z0=np.asarray(z0, float),
    )


def _infinity(problem: Problem, inclination: np.ndarray) -> np.ndarray:
    # Return the left-hand side of (2.55) of transitions, (n,).
    highest = max(abs(float(problem.amplitude.lowest)), float(problem.amplitude.highest))
    return 1.0 - np.abs(inclination) * highest


def _on_more_cables(
    problem: Problem, segments: Segment, z0: np.ndarray, largest: int, arcs: np.ndarray | None
) -> OscillationAnswers:
    # Redundant cables have no envelopes, since the motion does not determine pseudotensions.
    v = np.asarray(transition.inclination(segments))
    from cspr_jax.families.swings.redundant_arcs import redundant_arcs

    answers, _ = redundant_arcs(
        problem, {0: segments, 1: segments}, _infinity(problem, v), max_arcs=largest, arcs=arcs, step=2
    )
    nothing = np.full(len(v), np.nan)
    return OscillationAnswers(
        **vars(answers),
        oscillations=answers.arcs // 2,
        tried_oscillations=answers.tried_arcs // 2,
        envelope_oscillations=np.zeros(len(v), int),
        least_oscillations=nothing,
        inclination_gain=nothing,
        used_inclination=v,
        used_z0=np.asarray(z0, float),
    )


def _extreme_pseudotensions(robot, limits, amplitude: Amplitude, segment: Segment, arcs: jax.Array, tau: jax.Array):
    # (1.32) is linear in the load v + w_k: at any time the cables with the extreme loads have the smallest
    # pseudotensions; load 0 gives the depth below the spools.
    del robot, limits
    v = transition.inclination(segment)
    loads = v + transition.weights(segment)
    _, steady, period = oscillation(segment, arcs)
    value, rate, second_derivative = derivatives(amplitude, tau, order=2)
    sine, cosine = sincospi(arcs * tau)
    # This is d of `hypocycloid.swing` over the radius; the sense of an even number of arcs is -1.
    coupling = (
        second_derivative - value * segment.end_curvature
    ) / period * cosine - 2.0 * steady / period * rate * sine / (math.pi * arcs)
    level = 1.0 + v * value * cosine
    high, low = jnp.maximum(maximum_of(loads), 0.0), jnp.minimum(minimum_of(loads), 0.0)
    return level - high * coupling, level - low * coupling


def transition_margins(
    problem: Problem, segments: Segment, arcs: Int[np.ndarray, "n"]
) -> Float[np.ndarray, "n n_criteria"]:
    """Smallest slack of each criterion along each transition, as in `margins`, from two functions of time.

    Where both are positive, the first two columns both hold the slack of the cables.
    """
    if limits_set(problem.limits):
        return margins(problem, segments, arcs)
    table = blocks(problem.amplitude, int(np.max(arcs)))
    smallest = smallest_values(Functions(_extreme_pseudotensions, (1, 1)), problem, segments, arcs, table).min(1)
    slacks = np.stack([smallest, smallest], axis=1)
    unclear = np.flatnonzero(~(np.isfinite(smallest) & (smallest > 0.0)))
    if len(unclear):
        slacks[unclear] = margins(problem, jax.tree.map(lambda array: array[unclear], segments), arcs[unclear])
    return slacks
