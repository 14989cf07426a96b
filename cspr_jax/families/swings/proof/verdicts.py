"""Verdicts that also hold between samples.

A slack f with |f''| <= M on an interval of length h satisfies f >= min(f at its ends) - M h^2 / 8.
The interval [0, 1] is divided into blocks at the knots of the amplitude function, and each block into
16 intervals; M comes from the closed form, for each block. A segment is

    proved feasible    if this lower bound exceeds the tolerance in every block,
    proved infeasible  if a sample is below minus the tolerance,
    divided further    otherwise, where it is open; division into quarters reduces the gap to a sixteenth,
    undecided          if the gap is below the tolerance and still contains zero.

The tolerance covers rounding (see `tolerance`). A touched limit, such as a target on the floor, counts as met: the
slacks of limits are those of the wider limits of `problem.touchable`, and their tolerance is rounding alone.
"""

from __future__ import annotations

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.families.swings.proof.blocks import INTERVALS, blocks, over_blocks
from cspr_jax.families.swings.proof.criteria import BASIC, curvatures, slacks
from cspr_jax.families.swings.proof.slacks import largest_term
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.linear.lanes import smallest_of_each
from cspr_jax.numerics.shapes import Bool, Float, Num
from cspr_jax.numerics.tolerances import SMALLEST_MARGIN
from cspr_jax.runtime.persistent_jit import persistent_jit

BATCH = 1024
# Batch lengths for few segments: with limits, for which a full batch takes several times as long, and in plans.
SMALL = 128
OF_PLANS = 16  # for plans, which rarely have more segments
FINEST_CUT = 12
# Number of blocks of a segment in one step of a first pass.
TOGETHER = 2


@dataclasses.dataclass(frozen=True)
class Proof:
    """Proofs of n segments; a segment that is neither feasible nor infeasible is undecided.

    Fields:
        feasible: (n,) whether every criterion that counts is always met.
        infeasible: (n,) whether some criterion that counts is broken at some time.
        met: (n, n_criteria) whether the criterion is proved to be always met.
        broken: (n, n_criteria) whether the criterion is proved to be broken at some time.
        sampled: (n, n_criteria) smallest slack at the samples of a first pass.
        bound: (n, n_criteria) lower bound of the slack, proved by a first pass.
    """

    feasible: np.ndarray
    infeasible: np.ndarray
    met: np.ndarray
    broken: np.ndarray
    sampled: np.ndarray
    bound: np.ndarray


def tolerance(
    amplitude: Amplitude, segment: Segment, arcs: Num[Array, ""], minimum: float = SMALLEST_MARGIN
) -> Float[Array, ""]:
    """Slacks closer to zero than this are undecided: `minimum`, plus the possible rounding."""
    terms = largest_term(amplitude, segment, arcs)
    return minimum + 512.0 * jnp.finfo(terms.dtype).eps * terms


def tolerances(problem: Problem, segment: Segment, arcs: Array) -> Array:
    """Tolerance of each criterion of one segment, (n_criteria,)."""
    rounding = tolerance(problem.amplitude, segment, arcs, 0.0)
    return jnp.stack([rounding + SMALLEST_MARGIN] * BASIC + [rounding] * len(limits_set(problem.limits)))


def block_bounds(
    problem: Problem, segments: Segment, arcs: Float[Array, "n"], start: Float[Array, "n"], stop: Float[Array, "n"]
) -> tuple[tuple[Float[Array, "n"], ...], tuple[Float[Array, "n"], ...]]:
    """Smallest sampled slack and proved lower bound of each criterion, over one block of each segment."""
    weight = (jnp.arange(INTERVALS + 1, dtype=arcs.dtype) / INTERVALS)[:, None]
    tau = start[None] * (1.0 - weight) + stop[None] * weight
    values = jax.vmap(jax.vmap(partial(slacks, *problem)), in_axes=(None, None, 0))(segments, arcs, tau)
    sampled, fraction = smallest_of_each(values), ((stop - start) / INTERVALS) ** 2 / 8.0
    bounds = jax.vmap(partial(curvatures, *problem))(segments, arcs, start, stop)
    return sampled, tuple(low - bound * fraction for low, bound in zip(sampled, bounds, strict=True))


@persistent_jit
def _first_pass(problem: Problem, edges: Array, counts: Array, arguments) -> tuple[Array, Array, Array]:
    segments, arcs = arguments
    bounds_of = jax.vmap(partial(block_bounds, problem), in_axes=(None, None, 0, 0))

    def step(state, start, stop):
        sampled, proved = bounds_of(segments, arcs, start, stop)
        return tuple(map(jnp.minimum, state, smallest_of_each((*sampled, *proved))))

    n_criteria = BASIC + len(limits_set(problem.limits))
    nothing = (jnp.full_like(arcs, jnp.inf),) * (2 * n_criteria)
    minima = over_blocks(edges, counts, arcs, nothing, step, together=TOGETHER)
    near = jax.vmap(partial(tolerances, problem))(segments, arcs)
    return jnp.stack(minima[:n_criteria], axis=1), jnp.stack(minima[n_criteria:], axis=1), near


@persistent_jit
def _closer_pass(problem: Problem, arguments) -> tuple[Array, Array]:
    sampled, proved = block_bounds(problem, *arguments)
    return jnp.stack(sampled, axis=1), jnp.stack(proved, axis=1)


def prove(
    problem: Problem,
    segments: Segment,
    arcs: Num[np.ndarray, "n"],
    *,
    ignored: Bool[np.ndarray, "n n_criteria"] | None = None,
    coarse: tuple[np.ndarray, ...] | None = None,
) -> Proof:
    """Prove or refute segments, each with a given number of arcs."""
    arcs = np.asarray(arcs, float)
    table = blocks(problem.amplitude, int(arcs.max()))
    sampled, bound, near = first_pass(problem, segments, arcs) if coarse is None else coarse
    counted = ~(np.zeros(sampled.shape, bool) if ignored is None else ignored)
    met, broken = bound > near, ~(sampled >= -near)
    feasible, infeasible = (met | ~counted).all(1), (broken & counted).any(1)
    open_ones = np.flatnonzero(~feasible & ~infeasible)
    if len(open_ones):
        some_segments, some_arcs = jax.tree.map(lambda x: x[open_ones], (segments, arcs))
        parts = near[open_ones], counted[open_ones]
        feasible[open_ones], refuted = _cut(problem, some_segments, some_arcs, *parts, table)
        infeasible[open_ones], broken[open_ones] = refuted.any(1), broken[open_ones] | refuted
    return Proof(feasible, infeasible, met | (feasible[:, None] & counted), broken, sampled, bound)


def length(problem: Problem, count: int, few: int = 0) -> int:
    """Length of the batches for a number of segments, or of their blocks."""
    return SMALL if count <= few or (2 * count <= BATCH and limits_set(problem.limits)) else BATCH


def is_met_at_samples(
    problem: Problem, segments: Segment, arcs: Num[np.ndarray, "n"]
) -> Bool[np.ndarray, "n n_criteria"]:
    """Criteria that are met at all samples of a first pass."""
    arcs = np.asarray(arcs, float)
    sampled, _, near = first_pass(problem, segments, arcs)
    return sampled >= -near


def first_pass(problem: Problem, segments: Segment, arcs: Num[np.ndarray, "n"]) -> tuple[np.ndarray, ...]:
    """Smallest samples and proved bounds of all criteria by a first pass over segments, and tolerances."""
    table = blocks(problem.amplitude, int(arcs.max()))
    order = np.argsort(arcs, kind="stable")
    back = np.argsort(order, kind="stable")
    arguments = jax.tree.map(lambda x: x[order], (segments, arcs))
    result = in_batches(
        partial(_first_pass, touchable(problem), *table), arguments, batch_size=length(problem, len(arcs), OF_PLANS)
    )
    return jax.tree.map(lambda x: x[back], result)


def _cut(
    problem: Problem, segments: Segment, arcs: np.ndarray, near: np.ndarray, counted: np.ndarray, table
) -> tuple[np.ndarray, np.ndarray]:
    # Return which segments are proved (n,), and which criteria that count are broken (n, n_criteria). Items are open
    # blocks of segments: owner, start, stop.
    problem, (edges, counts) = touchable(problem), table
    broken, stuck = np.zeros(counted.shape, bool), np.zeros(len(arcs), bool)
    count = counts[arcs.astype(int)]
    owner = np.repeat(np.arange(len(arcs)), count)
    index = np.concatenate([np.arange(c) for c in count])
    row = arcs.astype(int)[owner]
    start, stop = edges[row, index], edges[row, index + 1]
    for _ in range(FINEST_CUT):
        items = (*jax.tree.map(lambda x, o=owner: x[o], (segments, arcs)), start, stop)
        sampled, proved = in_batches(partial(_closer_pass, problem), items, batch_size=length(problem, len(owner)))
        limit = near[owner]
        fails: np.ndarray = ~(sampled >= -limit) & counted[owner]
        failing = np.flatnonzero(fails.any(1))
        np.logical_or.at(broken, owner[failing], fails[failing])
        refuted = np.asarray(broken.any(1))
        unproved = ~(proved > limit) & counted[owner]
        closed = (unproved & (sampled - proved <= 0.5 * limit)).any(1)
        np.logical_or.at(stuck, owner, closed)
        keep = unproved.any(1) & ~refuted[owner] & ~stuck[owner]
        if not keep.any():
            return ~refuted & ~stuck, broken
        owner, start, stop = _quarters(owner[keep], start[keep], stop[keep])
    stuck[owner] = True
    return ~broken.any(1) & ~stuck, broken


def _quarters(owner: np.ndarray, start: np.ndarray, stop: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    weight = np.arange(5) / 4.0
    edge = start[:, None] * (1.0 - weight) + stop[:, None] * weight
    return np.repeat(owner, 4), edge[:, :-1].ravel(), edge[:, 1:].ravel()
