"""Smallest number of arcs of many segments, with duration, margin and verdict.

For each segment: a sieve bounds the margin of every number of arcs from above; the survivors are
proved or refuted in increasing order, until one is proved feasible. Never by bisection: more arcs
can lose margin (tests). Where none is feasible, the candidate with the largest margin is reported.
"""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.amplitudes import boundary_errors
from cspr_jax.errors import InputError
from cspr_jax.feasibility import criteria
from cspr_jax.feasibility.certificate import SMALLEST_MARGIN, Shared, prove
from cspr_jax.feasibility.margins import margins
from cspr_jax.feasibility.verdicts import Verdict
from cspr_jax.grids import in_batches
from cspr_jax.maps import sieve
from cspr_jax.robots import LARGEST_LENGTH
from cspr_jax.trajectories import hypocycloid
from cspr_jax.trajectories.hypocycloid import Segment

# Candidates whose margins differ by less are equally good; the first of them is reported.
TIE = 1e-9


@dataclasses.dataclass(frozen=True)
class Answers:
    """One answer a segment.

    Fields:
        arcs: (n,) smallest number of arcs proved feasible; 0: none.
        tried_arcs: (n,) the number of arcs that duration and margins belong to: `arcs`, else the best candidate.
        verdict: (n,) `Verdict` flags; 0 is feasible.
        duration: (n,) s.
        margin: (n,) smallest normalised pseudotension, or depth below the spools over z0.
        margin_bound: (n,) proved lower bound of the same.
        limit_margin: (n,) smallest slack of the limits; inf where none is given.
        feasible_at_infinity: (n,) left-hand side of (2.55).
    """

    arcs: np.ndarray
    tried_arcs: np.ndarray
    verdict: np.ndarray
    duration: np.ndarray
    margin: np.ndarray
    margin_bound: np.ndarray
    limit_margin: np.ndarray
    feasible_at_infinity: np.ndarray


@jax.jit
def _segments(shared: Shared, points) -> tuple[Segment, Segment, jax.Array]:
    def one(start, end, z0):
        even, odd = (hypocycloid.segment(shared.robot, start, end, z0, odd=jnp.asarray(odd)) for odd in (False, True))
        return even, odd, hypocycloid.feasibility_at_infinity(even, shared.amplitude)

    return jax.vmap(one)(*points)


def segments_between(
    shared: Shared, starts: np.ndarray, ends: np.ndarray, z0: np.ndarray
) -> tuple[dict[int, Segment], np.ndarray]:
    """Segments of many pairs of points.

    Args:
        shared: gives the robot and the amplitude function.
        starts: (n, 3) m, z down.
        ends: (n, 3) m.
        z0: (n,) m.

    Returns:
        the segments for even (key 0) and odd (key 1) numbers of arcs, leaves (n, ...), and the
        left-hand side of (2.55), (n,).
    """
    even, odd, infinity = in_batches(partial(_segments, shared), (starts, ends, z0), size=sieve.BATCH)
    return {0: even, 1: odd}, infinity


@jax.jit
def _durations(arguments) -> jax.Array:
    return jax.vmap(hypocycloid.duration)(*arguments)


def minimum_arcs(
    shared: Shared,
    starts: np.ndarray,
    ends: np.ndarray,
    z0: np.ndarray,
    *,
    max_arcs: int = 30,
    arcs=None,
    dtype="float64",
) -> Answers:
    """Smallest number of arcs of each segment from a start to an end.

    Needs 64-bit jax (`jax.config.update("jax_enable_x64", True)`): verdicts are float64's.

    Args:
        shared: robot, limits and amplitude.
        starts: (n, 3) m, z down.
        ends: (n, 3) m.
        z0: (n,) depth of p0 below the centroid of the spools, m; positive.
        max_arcs: largest number of arcs tried.
        arcs: (n,) a fixed number of arcs for each segment, 0 where free; None: all free.
        dtype: precision of the sieve, "float64" or "float32"; the verdicts are the same.

    Returns:
        the answers.

    Raises:
        InputError: an amplitude function that breaks (2.49); max_arcs below 1; z0 not positive; jax without 64 bits.
    """
    _check(shared, z0, max_arcs)
    parities, infinity = segments_between(shared, starts, ends, z0)
    upper = _sieved(shared, parities[0], parities[1], max_arcs, dtype)
    if arcs is not None:
        fixed = np.asarray(arcs)[:, None]
        upper = np.where((fixed == 0) | (fixed == np.arange(1, max_arcs + 1)), upper, -np.inf)
    found, doubtful, bound = _search(shared, parities, upper)
    tried, slack = _best(shared, parities, upper, found)
    chosen = pick(parities, np.arange(len(found)), tried)
    duration = in_batches(_durations, (chosen, tried.astype(float)), size=sieve.BATCH)
    none = np.flatnonzero(found == 0)
    if len(none):
        bound[none] = prove(shared, pick(parities, none, tried[none]), tried[none]).bound[:, :2].min(1)
    return Answers(
        found,
        tried,
        _verdicts(shared, found, doubtful, slack),
        duration,
        slack[:, :2].min(1),
        bound,
        slack[:, 2:].min(1, initial=np.inf),
        infinity,
    )


def _check(shared: Shared, z0: np.ndarray, max_arcs: int) -> None:
    if not jax.config.read("jax_enable_x64"):
        raise InputError("jax_enable_x64", False, "true: verdicts need float64")
    broken = boundary_errors(shared.amplitude)
    if broken:
        raise InputError(
            "amplitude", shared.amplitude.name, "an amplitude function that meets (2.49): " + "; ".join(broken)
        )
    if max_arcs < 1:
        raise InputError("max_arcs", max_arcs, "an integer >= 1")
    fits = (np.asarray(z0) > 0.0) & (np.asarray(z0) <= LARGEST_LENGTH)
    if not fits.all():
        raise InputError("z0", float(np.asarray(z0)[~fits][0]), "a number > 0, at most 1e6 m")


def _sieved(shared: Shared, even: Segment, odd: Segment, max_arcs: int, dtype: str) -> np.ndarray:
    # Upper bounds (n, max_arcs): of the sieve, and of the two ends, where every slack is known.
    cast = jax.tree.map(lambda x: np.asarray(x, dtype), (even, odd))
    kernel = partial(sieve.upper_bounds, max_arcs=max_arcs)
    upper = in_batches(lambda pair: kernel(shared.amplitude, *pair), cast, size=sieve.BATCH).astype(float)
    at_ends = in_batches(partial(_end_slacks, shared), odd, size=sieve.BATCH)
    return np.where(np.isnan(upper), -np.inf, np.minimum(upper, at_ends[:, None] + SMALLEST_MARGIN))


@jax.jit
def _end_slacks(shared: Shared, odd: Segment) -> jax.Array:
    # At both ends the velocity is zero and the acceleration a pendulum's, whatever the number of arcs: say 3.
    def one(segment):
        at_ends = jax.vmap(lambda t: jnp.stack(criteria.slacks(*shared, segment, jnp.asarray(3.0), t)))(
            jnp.asarray([0.0, 1.0])
        )
        return jnp.min(at_ends)

    return jax.vmap(one)(odd)


def pick(parities: dict[int, Segment], rows: np.ndarray, arcs: np.ndarray) -> Segment:
    """Some segments, each of the parity of its number of arcs.

    Args:
        parities: as `segments_between` gives them.
        rows: (m,) which segments.
        arcs: (m,) number of arcs of each.

    Returns:
        leaves (m, ...).
    """
    is_odd = arcs % 2 == 1

    def choose(even, odd):
        return np.where(is_odd.reshape(-1, *[1] * (even.ndim - 1)), odd[rows], even[rows])

    return jax.tree.map(choose, parities[0], parities[1])


def _search(
    shared: Shared, parities: dict[int, Segment], upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # The smallest number of arcs proved feasible, whether a smaller one stayed undecided, and the proved margin.
    found, doubtful, bound = np.zeros(len(upper), int), np.zeros(len(upper), bool), np.full(len(upper), -np.inf)
    alive = upper >= -SMALLEST_MARGIN
    while True:
        rows = np.flatnonzero((found == 0) & alive.any(1))
        if not len(rows):
            return found, doubtful, bound
        arcs = np.argmax(alive[rows], axis=1) + 1
        proof = prove(shared, pick(parities, rows, arcs), arcs)
        found[rows[proof.feasible]] = arcs[proof.feasible]
        bound[rows] = proof.bound[:, :2].min(1)
        doubtful[rows[~proof.feasible & ~proof.infeasible]] = True
        alive[rows, arcs - 1] = False


def _best(
    shared: Shared, parities: dict[int, Segment], upper: np.ndarray, found: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    # Margins at the number of arcs found, else at the candidate with the largest; upper bounds say where to look next.
    tried = np.where(found > 0, found, np.argmax(upper, axis=1) + 1)
    slack = margins(shared, pick(parities, np.arange(len(found)), tried), tried)
    best = slack.min(1)
    rest = np.where(found[:, None] > 0, -np.inf, upper)
    rest[np.arange(len(rest)), tried - 1] = -np.inf
    while True:
        rows = np.flatnonzero(rest.max(1) > np.where(np.isnan(best), -np.inf, best) + TIE * (1.0 + np.abs(best)))
        if not len(rows):
            return tried, slack
        arcs = np.argmax(rest[rows], axis=1) + 1
        candidate = margins(shared, pick(parities, rows, arcs), arcs)
        rest[rows, arcs - 1] = -np.inf
        better = candidate.min(1) > best[rows]
        tried[rows[better]], slack[rows[better]] = arcs[better], candidate[better]
        best[rows[better]] = candidate.min(1)[better]


def _verdicts(shared: Shared, found: np.ndarray, doubtful: np.ndarray, slack: np.ndarray) -> np.ndarray:
    broken = np.zeros(len(found), np.uint16)
    for flag, column in zip(criteria.flags(shared.limits), slack.T, strict=True):
        broken |= np.where(column <= 0.0, flag.value, 0).astype(np.uint16)
    broken |= np.where(np.isnan(slack).any(1), Verdict.NOT_FINITE.value, 0).astype(np.uint16)
    none = np.where(doubtful, Verdict.UNDECIDED.value, Verdict.NO_ARCS.value | broken)
    some = np.where(doubtful, Verdict.FEWER_ARCS_UNDECIDED.value, 0)
    return np.where(found > 0, some, none).astype(np.uint16)
