"""Answers from upper bounds of the margin for each number of arcs: proofs first, margins after.

Candidates that the bounds leave are proved or refuted in increasing order until one is proved feasible. Bisection would
be wrong, since more arcs may reduce the margin (tests). If none is feasible, `families.swings.refusals` names the
limits that refuse candidates with taut cables, and one of these candidates is reported; if there is no such candidate,
the one with the largest margin. `families.platforms.answers` does the same for platforms.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.families.swings import hypocycloid
from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.families.swings.parities import pick, rows_of
from cspr_jax.families.swings.proof import criteria
from cspr_jax.families.swings.proof.criteria import BASIC
from cspr_jax.families.swings.proof.enclosures import tolerated_by_point_masses
from cspr_jax.families.swings.proof.limit_screen import LimitScreen
from cspr_jax.families.swings.proof.margins import each_margin, margins
from cspr_jax.families.swings.proof.screen import upper_bounds
from cspr_jax.families.swings.proof.verdicts import first_pass, prove
from cspr_jax.families.swings.refusals import refusals, unavoidable
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float, Num
from cspr_jax.numerics.tolerances import SMALLEST_MARGIN
from cspr_jax.robots.model.limits import NO_LIMITS
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.robustness.tolerances import Tolerated

# Number of segments computed at a time if each takes little work.
BATCH = 4096
# Candidates whose margins differ by less count as equal; the first of them is reported.
TIE = 1e-9
# Samples per arc of the second, denser screen, a multiple of 4.
SAMPLES_PER_ARC = 32
MAX_SAMPLES = 1024
DENSE_BATCH = 512  # number of segments at a time: few need this screen


@persistent_jit
def _durations(arguments) -> jax.Array:
    return jax.vmap(hypocycloid.duration)(*arguments)


class ProvedArcs(NamedTuple):
    """Numbers of arcs that other means than `families.swings.proof.verdicts` have proved feasible.

    Fields:
        arcs: (n,) one number for each segment; 0 for none.
        bound: (n,) proved lower bound of the margin.
    """

    arcs: np.ndarray
    bound: np.ndarray


def decided(
    problem: Problem,
    parities: dict[int, Segment],
    upper: Num[np.ndarray, "n max_arcs"],
    at_ends: Float[np.ndarray, "n n_criteria"],
    infinity: Float[np.ndarray, "n"],
    *,
    arcs: np.ndarray | None = None,
    precomputed: ProvedArcs | None = None,
    measure: Callable[[Problem, Segment, np.ndarray], np.ndarray] = margins,
) -> tuple[Answers, Segment]:
    """Answers from upper bounds."""
    precomputed = precomputed or ProvedArcs(np.zeros(len(upper), int), np.full(len(upper), -np.inf))
    with_limits = as_prescribed(np.minimum(upper, at_ends.min(1)[:, None] + SMALLEST_MARGIN), arcs)
    basic = as_prescribed(np.minimum(upper, at_ends[:, :BASIC].min(1)[:, None] + SMALLEST_MARGIN), arcs)
    search = _search(problem, parities, with_limits, precomputed)
    smallest, bound = search.smallest, search.bound
    tried, slack, broken = _shown(problem, parities, search, with_limits, basic, measure)
    chosen = pick(parities, np.arange(len(smallest)), tried)
    duration = in_batches(_durations, (chosen, tried.astype(float)), batch_size=BATCH)
    none = np.flatnonzero(smallest == 0)
    is_feasible = smallest > 0
    if len(none):
        shown = pick(parities, none, tried[none])
        coarse = first_pass(problem, shown, tried[none].astype(float))
        bound[none] = coarse[1][:, :BASIC].min(1)
        if problem.limits.uncertainty is not None:
            is_feasible[none] = prove(problem, shown, tried[none], coarse=coarse).feasible
    multiples = _tolerated(problem, chosen, tried, np.flatnonzero(is_feasible))
    answers = Answers(
        smallest,
        tried,
        _verdicts(problem, search, slack, broken, multiples),
        duration,
        slack[:, :BASIC].min(1),
        bound,
        slack[:, BASIC:].min(1, initial=np.inf),
        infinity,
        *multiples,
    )
    return answers, chosen


@persistent_jit
def end_slacks(problem: Problem, arcs: float, segments: Segment) -> Float[jax.Array, "n n_criteria"]:
    """Smallest slack of each criterion at both ends.

    At the ends the velocity is zero and the acceleration that of a pendulum, for any number of arcs.
    """

    def one(segment):
        at_ends = jax.vmap(lambda t: jnp.stack(criteria.slacks(*problem, segment, jnp.asarray(arcs), t)))(
            jnp.asarray([0.0, 1.0])
        )
        return minimum_of(at_ends, axis=0)

    return jax.vmap(one)(segments)


def as_prescribed(upper: Float[np.ndarray, "n max_arcs"], arcs) -> Num[np.ndarray, "n max_arcs"]:
    """Upper bounds; -inf for numbers of arcs other than a prescribed one, or below a prescribed minimum."""
    if arcs is None:
        return upper
    fixed, number = np.asarray(arcs)[:, None], np.arange(1, upper.shape[1] + 1)
    return np.where(np.where(fixed > 0, number == fixed, number >= -fixed), upper, -np.inf)


class _Search(NamedTuple):
    # The smallest number of arcs proved feasible; whether a smaller one stayed undecided; the proved margin; whether
    # some number of arcs is feasible for the planned robot, though maybe not within the uncertainty; and the limits
    # that candidates break at samples, (n, max_arcs, n_criteria).
    smallest: np.ndarray
    doubtful: np.ndarray
    bound: np.ndarray
    is_planned: np.ndarray
    broken: np.ndarray


def _search(problem: Problem, parities: dict[int, Segment], upper: np.ndarray, precomputed: ProvedArcs) -> _Search:
    smallest, doubtful, bound = np.zeros(len(upper), int), np.zeros(len(upper), bool), np.full(len(upper), -np.inf)
    is_planned = np.zeros(len(upper), bool)
    screen = LimitScreen(problem, parities, upper >= -SMALLEST_MARGIN)
    while True:
        rows = screen.screened(np.flatnonzero(smallest == 0))
        if not len(rows):
            return _Search(smallest, doubtful, bound, is_planned, screen.broken)
        arcs = np.argmax(screen.alive[rows], axis=1) + 1
        is_precomputed = arcs == precomputed.arcs[rows]
        smallest[rows[is_precomputed]], bound[rows[is_precomputed]] = (
            arcs[is_precomputed],
            precomputed.bound[rows[is_precomputed]],
        )
        rows, arcs = rows[~is_precomputed], arcs[~is_precomputed]
        if not len(rows):
            continue
        proof = prove(problem, pick(parities, rows, arcs), arcs)
        is_feasible, is_refuted = proof.feasible.copy(), proof.infeasible.copy()
        is_planned[rows] |= is_feasible
        if problem.limits.uncertainty is not None:
            indices = np.flatnonzero(is_feasible)
            multiples = tolerated_by_point_masses(
                problem, pick(parities, rows[indices], arcs[indices]), arcs[indices], full=False
            )
            is_feasible[indices], is_refuted[indices] = multiples.proved >= 1.0, multiples.refuted <= 1.0
        smallest[rows[is_feasible]] = arcs[is_feasible]
        bound[rows] = proof.bound[:, :2].min(1)
        doubtful[rows[~is_feasible & ~is_refuted]] = True
        screen.alive[rows, arcs - 1] = False


class _Shown(NamedTuple):
    # Reported numbers of arcs (n,), their smallest slacks, and the criteria that they break, (n, n_criteria).
    tried: np.ndarray
    slack: np.ndarray
    broken: np.ndarray


def _shown(
    problem: Problem,
    parities: dict[int, Segment],
    search: _Search,
    with_limits: np.ndarray,
    basic: np.ndarray,
    measure: Callable,
) -> _Shown:
    # Choose the reported numbers of arcs; `with_limits` and `basic` are upper bounds (n, max_arcs) of the margin over
    # all criteria, and over the criteria that are no limits.
    fixed, by_cables = search.smallest.copy(), np.zeros(len(with_limits), bool)
    # Without limits, or with an undecided candidate, report the largest margin.
    is_refused = (fixed == 0) & ~search.doubtful & ~search.is_planned
    refused = np.flatnonzero(is_refused & bool(limits_set(problem.limits)))
    why = refusals(problem, rows_of(parities, refused), basic[refused], search.broken[refused])
    fixed[refused], by_cables[refused] = why.arcs, why.arcs == 0
    upper = np.where(by_cables[:, None], basic, with_limits)
    tried, slack = _best(problem, parities, upper, fixed, by_cables, measure)
    broken = slack <= 0.0
    broken[refused] = why.broken
    # If no candidate keeps cables taut, name a cable or the spools, and the limits that every number of arcs breaks.
    rows, is_limit = np.flatnonzero(by_cables), np.arange(slack.shape[1]) >= BASIC
    broken[rows] = slack[rows] <= 0.0
    suspects = broken[rows] & is_limit
    broken[rows] &= unavoidable(problem, rows_of(parities, rows), upper[rows], suspects) | ~is_limit
    return _Shown(tried, slack, broken)


def _best(
    problem: Problem,
    parities: dict[int, Segment],
    upper: np.ndarray,
    fixed: np.ndarray,
    by_cables: np.ndarray,
    measure: Callable,
) -> tuple[np.ndarray, np.ndarray]:
    # Return the fixed number of arcs, else the one with the largest margin, for the cables alone or for all criteria,
    # and its slacks. If the cables alone decide, limits are computed only for the chosen number.
    tried, slack = fixed.copy(), np.empty((len(fixed), len(criteria.flags(problem.limits))))
    free = np.flatnonzero((fixed == 0) & ~by_cables)
    if len(free):
        tried[free], slack[free] = _largest_margins(problem, rows_of(parities, free), upper[free], measure)
    free = np.flatnonzero((fixed == 0) & by_cables)
    if len(free):
        without_limits = problem._replace(limits=NO_LIMITS)
        tried[free], _ = _largest_margins(without_limits, rows_of(parities, free), upper[free], measure)
        # None of these is feasible, so refine all criteria together.
        slack[free] = each_margin(problem, pick(parities, free, tried[free]), tried[free])
    chosen = np.flatnonzero(fixed > 0)
    if len(chosen):
        slack[chosen] = measure(problem, pick(parities, chosen, tried[chosen]), tried[chosen])
    return tried, slack


def _largest_margins(
    problem: Problem, parities: dict[int, Segment], upper: np.ndarray, measure: Callable
) -> tuple[np.ndarray, np.ndarray]:
    # Return the numbers of arcs with the largest margins, and their slacks; try candidates in the order of upper
    # bounds.
    upper = np.fmin(upper, _denser_upper_bounds(problem, parities, upper.shape[1]))
    tried = np.argmax(upper, axis=1) + 1
    slack = measure(problem, pick(parities, np.arange(len(tried)), tried), tried)
    best = np.nan_to_num(slack.min(1), nan=-np.finfo(float).max)
    upper[np.arange(len(tried)), tried - 1] = -np.inf
    while True:
        is_open = upper > _improvement(best)[:, None]
        rows = np.flatnonzero(is_open.any(1))
        if not len(rows):
            return tried, slack
        # Take the next candidates of each segment until a batch is full: a full batch takes no longer.
        order = np.argsort(-upper[rows], axis=1, kind="stable")[:, : max(BATCH // len(rows), 1)]
        owner, turn = np.nonzero(np.take_along_axis(is_open[rows], order, axis=1))
        segment, arcs = rows[owner], order[owner, turn] + 1
        candidate, bound = measure(problem, pick(parities, segment, arcs), arcs), upper[segment, arcs - 1]
        upper[segment, arcs - 1] = -np.inf
        for rank in range(order.shape[1]):
            # Compare them one by one, so that ties do not depend on what else is in the batch.
            due = np.flatnonzero((turn == rank) & (bound > _improvement(best)[segment]))
            due = due[candidate[due].min(1) > best[segment[due]]]
            row = segment[due]
            tried[row], slack[row], best[row] = arcs[due], candidate[due], candidate[due].min(1)


def _improvement(best: np.ndarray) -> np.ndarray:
    return best + TIE * (1.0 + np.abs(best))


def _denser_upper_bounds(problem: Problem, parities: dict[int, Segment], max_arcs: int) -> np.ndarray:
    # The first screen has only one or two samples per arc, which bound the margins of many arcs loosely.
    samples = min(SAMPLES_PER_ARC * max_arcs, MAX_SAMPLES)
    kernel = partial(upper_bounds, max_arcs=max_arcs, samples=samples)
    return in_batches(lambda pair: kernel(problem.amplitude, *pair), (parities[0], parities[1]), batch_size=DENSE_BATCH)


def _tolerated(problem: Problem, segments: Segment, arcs: np.ndarray, rows: np.ndarray) -> Tolerated:
    # Return the multiples for all segments; NaN for those not feasible as planned, and without an uncertainty.
    multiples = Tolerated(np.full(len(arcs), np.nan), np.full(len(arcs), np.nan))
    if problem.limits.uncertainty is not None and len(rows):
        picked = jax.tree.map(lambda array: np.asarray(array)[rows], segments)
        for column, values in zip(multiples, tolerated_by_point_masses(problem, picked, arcs[rows]), strict=True):
            column[rows] = values
    return multiples


def _verdicts(
    problem: Problem, search: _Search, slack: np.ndarray, broken: np.ndarray, multiples: Tolerated
) -> np.ndarray:
    flags = np.where(multiples.refuted <= 1.0, Verdict.UNCERTAINTY.value, 0).astype(FLAGS)
    for flag, column in zip(criteria.flags(problem.limits), broken.T, strict=True):
        flags |= np.where(column, flag.value, 0).astype(FLAGS)
    flags |= np.where(np.isnan(slack).any(1), Verdict.NOT_FINITE.value, 0).astype(FLAGS)
    none = np.where(search.doubtful, Verdict.UNDECIDED.value, Verdict.NO_ARCS.value | flags)
    with_arcs = np.where(search.doubtful, Verdict.FEWER_ARCS_UNDECIDED.value, 0)
    return np.where(search.smallest > 0, with_arcs, none).astype(FLAGS)
