"""Answers from upper bounds of the margin, one for each number of arcs: proofs first, margins after.

The candidates of a point mass that the bounds leave are proved or refuted in increasing order, until one is proved
feasible. Never by bisection: more arcs can lose margin (tests). Where none is feasible, the candidate with the largest
margin is reported. Answers of platforms are those of `search.platform_answers`.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.feasibility.point_mass import criteria
from cspr_jax.feasibility.point_mass.certificate import SMALLEST_MARGIN, prove
from cspr_jax.feasibility.point_mass.enclosures import tolerated_by_point_masses
from cspr_jax.feasibility.point_mass.margins import margins
from cspr_jax.feasibility.problem import Problem
from cspr_jax.feasibility.tolerances import Tolerated
from cspr_jax.schema.labelled import Columns
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.trajectories import hypocycloid
from cspr_jax.trajectories.hypocycloid import Segment

# Segments computed at a time where little is computed for each.
BATCH = 4096
# Candidates whose margins differ by less are equally good; the first of them is reported.
TIE = 1e-9
Said = TypeVar("Said", bound="Answers")


@dataclasses.dataclass(frozen=True)
class Answers(Columns):
    """One answer a segment.

    Fields:
        arcs: (n,) smallest number of arcs proved feasible, on more than six cables found so at samples; 0: none.
        tried_arcs: (n,) the number of arcs that duration and margins belong to: `arcs`, else the best candidate.
        verdict: (n,) `Verdict` flags; 0 is feasible.
        duration: (n,) s.
        margin: (n,) smallest normalised pseudotension, or depth below the spools over z0.
        margin_bound: (n,) proved lower bound of the same; NaN where nothing is proved, as on more than six cables.
        limit_margin: (n,) smallest slack of the limits; inf where none is given.
        feasible_at_infinity: (n,) left-hand side of (2.55).
        tolerated: (n,) largest multiple of the uncertainty that the motion is proved to stand; NaN where none is given.
        not_tolerated: (n,) smallest one found that it does not.
    """

    arcs: np.ndarray
    tried_arcs: np.ndarray
    verdict: np.ndarray
    duration: np.ndarray
    margin: np.ndarray
    margin_bound: np.ndarray
    limit_margin: np.ndarray
    feasible_at_infinity: np.ndarray
    tolerated: np.ndarray
    not_tolerated: np.ndarray

    @property
    def feasible(self) -> np.ndarray:
        """Whether each segment is feasible, (n,): proved, on more than six cables found at samples."""
        return self.arcs > 0

    def details(self, i: int) -> dict[str, Any]:
        """Details of a segment that only this kind of answers has, by their names in a plan's JSON.

        Args:
            i: number of the segment.

        Returns:
            plain values.
        """
        return {}


def joined(parts: list[Said]) -> Said:
    """Answers side by side.

    Args:
        parts: at least one.

    Returns:
        one for all.
    """
    return type(parts[0])(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])})


@jax.jit
def _durations(arguments) -> jax.Array:
    return jax.vmap(hypocycloid.duration)(*arguments)


class Known(NamedTuple):
    """Numbers of arcs proved feasible by other means than the certificate.

    Fields:
        arcs: (n,) one for each segment; 0: none.
        bound: (n,) proved lower bound of its margin.
    """

    arcs: np.ndarray
    bound: np.ndarray


def decided(
    problem: Problem,
    parities: dict[int, Segment],
    upper: np.ndarray,
    infinity: np.ndarray,
    *,
    known: Known | None = None,
    measure: Callable[[Problem, Segment, np.ndarray], np.ndarray] = margins,
) -> tuple[Answers, Segment]:
    """Answers from upper bounds.

    Args:
        problem: robot, limits and amplitude.
        parities: the segments for even (key 0) and odd (key 1) numbers of arcs, leaves (n, ...).
        upper: (n, max_arcs) upper bounds of the margin, column p - 1 for p arcs; -inf where it is out of the question.
        infinity: (n,) left-hand side of (2.55).
        known: what is proved already; None: nothing.
        measure: finds the margins, as `margins` does.

    Returns:
        the answers; the segments that durations and margins belong to, leaves (n, ...).
    """
    known = known or Known(np.zeros(len(upper), int), np.full(len(upper), -np.inf))
    smallest, doubtful, bound = _search(problem, parities, upper, known)
    tried, slack = _best(problem, parities, upper, smallest, measure)
    chosen = pick(parities, np.arange(len(smallest)), tried)
    duration = in_batches(_durations, (chosen, tried.astype(float)), size=BATCH)
    none = np.flatnonzero(smallest == 0)
    is_feasible = smallest > 0
    if len(none):
        proof = prove(problem, pick(parities, none, tried[none]), tried[none])
        bound[none], is_feasible[none] = proof.bound[:, :2].min(1), proof.feasible
    multiples = _tolerated(problem, chosen, tried, np.flatnonzero(is_feasible))
    answers = Answers(
        smallest,
        tried,
        _verdicts(problem, smallest, doubtful, slack, multiples),
        duration,
        slack[:, :2].min(1),
        bound,
        slack[:, 2:].min(1, initial=np.inf),
        infinity,
        *multiples,
    )
    return answers, chosen


@jax.jit
def end_slacks(problem: Problem, arcs: float, segments: Segment) -> jax.Array:
    """Smallest slack at the two ends.

    There the velocity is zero and the acceleration a pendulum's, whatever the number of arcs.

    Args:
        problem: robot, limits and amplitude.
        arcs: any number of arcs of the segments' parity.
        segments: leaves (n, ...).

    Returns:
        (n,).
    """

    def one(segment):
        at_ends = jax.vmap(lambda t: jnp.stack(criteria.slacks(*problem, segment, jnp.asarray(arcs), t)))(
            jnp.asarray([0.0, 1.0])
        )
        return jnp.min(at_ends)

    return jax.vmap(one)(segments)


def only(upper: np.ndarray, arcs) -> np.ndarray:
    """Upper bounds where the number of arcs of some segments is fixed.

    Args:
        upper: (n, max_arcs).
        arcs: (n,) a fixed number of arcs for each segment, 0 where free; None: all free.

    Returns:
        (n, max_arcs), -inf at numbers of arcs that are not wanted.
    """
    if arcs is None:
        return upper
    fixed = np.asarray(arcs)[:, None]
    return np.where((fixed == 0) | (fixed == np.arange(1, upper.shape[1] + 1)), upper, -np.inf)


def pick(parities: dict[int, Segment], rows: np.ndarray, arcs: np.ndarray) -> Segment:
    """Some segments, each of the parity of its number of arcs.

    Args:
        parities: as `segments_between` gives them.
        rows: (m,) which segments.
        arcs: (m,) number of arcs of each.

    Returns:
        leaves (m, ...).
    """
    if parities[0] is parities[1]:
        return jax.tree.map(lambda leaf: np.asarray(leaf)[rows], parities[0])
    is_odd = arcs % 2 == 1

    def choose(even, odd):
        return np.where(is_odd.reshape(-1, *[1] * (even.ndim - 1)), odd[rows], even[rows])

    return jax.tree.map(choose, parities[0], parities[1])


def _search(
    problem: Problem, parities: dict[int, Segment], upper: np.ndarray, known: Known
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # The smallest number of arcs proved feasible, whether a smaller one stayed undecided, and the proved margin.
    smallest, doubtful, bound = np.zeros(len(upper), int), np.zeros(len(upper), bool), np.full(len(upper), -np.inf)
    alive = upper >= -SMALLEST_MARGIN
    while True:
        rows = np.flatnonzero((smallest == 0) & alive.any(1))
        if not len(rows):
            return smallest, doubtful, bound
        arcs = np.argmax(alive[rows], axis=1) + 1
        given = arcs == known.arcs[rows]
        smallest[rows[given]], bound[rows[given]] = arcs[given], known.bound[rows[given]]
        rows, arcs = rows[~given], arcs[~given]
        if not len(rows):
            continue
        proof = prove(problem, pick(parities, rows, arcs), arcs)
        is_feasible, is_refuted = proof.feasible.copy(), proof.infeasible.copy()
        if problem.limits.uncertainty is not None:
            some = np.flatnonzero(is_feasible)
            found = tolerated_by_point_masses(problem, pick(parities, rows[some], arcs[some]), arcs[some], whole=False)
            is_feasible[some], is_refuted[some] = found.proved >= 1.0, found.refuted <= 1.0
        smallest[rows[is_feasible]] = arcs[is_feasible]
        bound[rows] = proof.bound[:, :2].min(1)
        doubtful[rows[~is_feasible & ~is_refuted]] = True
        alive[rows, arcs - 1] = False


def _best(
    problem: Problem, parities: dict[int, Segment], upper: np.ndarray, smallest: np.ndarray, measure: Callable
) -> tuple[np.ndarray, np.ndarray]:
    # Margins at the number of arcs found, else at the candidate with the largest; upper bounds say where to look next.
    tried = np.where(smallest > 0, smallest, np.argmax(upper, axis=1) + 1)
    slack = measure(problem, pick(parities, np.arange(len(smallest)), tried), tried)
    best = slack.min(1)
    rest = np.where(smallest[:, None] > 0, -np.inf, upper)
    rest[np.arange(len(rest)), tried - 1] = -np.inf
    while True:
        rows = np.flatnonzero(rest.max(1) > np.where(np.isnan(best), -np.inf, best) + TIE * (1.0 + np.abs(best)))
        if not len(rows):
            return tried, slack
        arcs = np.argmax(rest[rows], axis=1) + 1
        candidate = measure(problem, pick(parities, rows, arcs), arcs)
        rest[rows, arcs - 1] = -np.inf
        better = candidate.min(1) > best[rows]
        tried[rows[better]], slack[rows[better]] = arcs[better], candidate[better]
        best[rows[better]] = candidate.min(1)[better]


def _tolerated(problem: Problem, segments: Segment, arcs: np.ndarray, which: np.ndarray) -> Tolerated:
    # Of all segments, of which some are feasible as they are planned; NaN of the others, and without an uncertainty.
    every = Tolerated(np.full(len(arcs), np.nan), np.full(len(arcs), np.nan))
    if problem.limits.uncertainty is not None and len(which):
        some = jax.tree.map(lambda leaf: np.asarray(leaf)[which], segments)
        for own, found in zip(every, tolerated_by_point_masses(problem, some, arcs[which]), strict=True):
            own[which] = found
    return every


def _verdicts(
    problem: Problem, smallest: np.ndarray, doubtful: np.ndarray, slack: np.ndarray, multiples: Tolerated
) -> np.ndarray:
    broken = np.where(multiples.refuted <= 1.0, Verdict.UNCERTAINTY.value, 0).astype(FLAGS)
    for flag, column in zip(criteria.flags(problem.limits), slack.T, strict=True):
        broken |= np.where(column <= 0.0, flag.value, 0).astype(FLAGS)
    broken |= np.where(np.isnan(slack).any(1), Verdict.NOT_FINITE.value, 0).astype(FLAGS)
    none = np.where(doubtful, Verdict.UNDECIDED.value, Verdict.NO_ARCS.value | broken)
    some = np.where(doubtful, Verdict.FEWER_ARCS_UNDECIDED.value, 0)
    return np.where(smallest > 0, some, none).astype(FLAGS)
