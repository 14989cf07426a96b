"""Answers for motions between poses, once numbers of arcs are chosen."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np

from cspr_jax.families.platforms.arcs import (
    Candidates,
    FewestArcs,
    best_candidates,
    refused_by_limits,
    segments_with,
    smallest_arcs,
    unavoidable,
)
from cspr_jax.families.platforms.end_acceleration import AT_REST
from cspr_jax.families.platforms.motion_checker import MotionChecker, PlatformChecks
from cspr_jax.families.platforms.platform_segment import PlatformSegment, take_segments
from cspr_jax.motion.answers import Answers
from cspr_jax.numerics.shapes import Float
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.fewest_limits import Refused, rank

NEVER = np.iinfo(int).max


@dataclasses.dataclass(frozen=True)
class PlatformMotionAnswers(Answers):
    """Answers for segments between poses.

    Fields:
        beta_hat: (n, 2) beta-hat at both ends.
        det_margin: (n,) smallest determinant over its value at rest in P0; NaN on more than six cables, which have no
            determinant, and whose contacts with the platform are not sampled.
        cable_distance: (n,) smallest distance between cables that can touch, m.
        refuted_at: (n,) time at which the motion of `tried_arcs` is refuted, s: by its tensions, else by limits or
            contacts; NaN if it is not refuted, or by contacts that were only sampled.
    """

    beta_hat: np.ndarray
    det_margin: np.ndarray
    cable_distance: np.ndarray
    refuted_at: np.ndarray

    def details(self, i: int) -> dict[str, Any]:
        """Determinant, contacts and beta-hat; see `Answers.details`."""
        verdict, has_determinant = Verdict(int(self.verdict[i])), not np.isnan(self.det_margin[i])
        return super().details(i) | {
            "det_sign_constant": bool(self.det_margin[i] > 0.0) if has_determinant else None,
            "det_margin": float(self.det_margin[i]),
            "cable_interference": bool(verdict & Verdict.CABLE_CABLE),
            "cable_distance_min": float(self.cable_distance[i]),
            "platform_interference": bool(verdict & Verdict.CABLE_PLATFORM) if has_determinant else None,
            "refuted_at": float(self.refuted_at[i]),
            "beta_hat": [float(value) for value in self.beta_hat[i]],
        }


def settled(
    checker: MotionChecker,
    candidates: Candidates,
    smallest: FewestArcs,
    *,
    refused: Refused,
    max_arcs: int,
    fixed: np.ndarray | None = None,
    margins: bool = True,
    is_final: bool = True,
) -> tuple[PlatformMotionAnswers, PlatformSegment]:
    """Answers for motions, with and without a feasible number of arcs."""
    tried = np.where(smallest.arcs > 0, smallest.arcs, refused.arcs)
    if fixed is not None:
        tried = np.where(tried > 0, tried, np.maximum(fixed, 0))
    none = np.flatnonzero(tried == 0)
    tried[none] = best_candidates(checker, candidates.take(none), max_arcs=max_arcs)
    segments, checks = segments_with(checker.problem.robot, candidates, tried), smallest.checks
    is_open = np.zeros(len(tried), bool)
    if is_final:
        smallest, is_open = _confirmed(checker, segments, smallest)
    others = np.flatnonzero((smallest.arcs == 0) & ~is_open)
    checks.put(others, checker.check(take_segments(segments, others), tried[others], margins=margins))
    has_tolerance = np.flatnonzero(~np.isnan(checks.tolerated))
    tolerances = checker.tolerated(take_segments(segments, has_tolerance), tried[has_tolerance])
    checks.tolerated[has_tolerance] = np.maximum(checks.tolerated[has_tolerance], tolerances.proved)
    checks.not_tolerated[has_tolerance] = np.minimum(checks.not_tolerated[has_tolerance], tolerances.refuted)
    duration = checker.durations(segments, tried)
    beta_hats = np.stack(candidates.beta_hats, axis=1)
    if checker.kind.plain:  # beta-hat of the cosine, (3.66)
        beta_hats = np.tile(-((math.pi * tried / duration) ** 2 / segments.rate)[:, None], 2)
    doubtful = (smallest.undecided > 0) & ((smallest.arcs == 0) | (smallest.undecided < smallest.arcs))
    parts = checker, candidates, smallest, refused, checks
    reasons = _reasons(*parts, margins=margins, max_arcs=max_arcs, fixed=fixed)
    none = np.where(doubtful, Verdict.UNDECIDED.value, reasons | Verdict.NO_ARCS.value)
    less = np.where(doubtful, Verdict.FEWER_ARCS_UNDECIDED.value, 0)
    nothing = np.full(len(tried), np.nan)
    answers = PlatformMotionAnswers(
        arcs=smallest.arcs,
        tried_arcs=tried,
        verdict=np.where(smallest.arcs > 0, less, none).astype(FLAGS),
        duration=duration,
        margin=np.minimum(checks.slack[:, 0], checks.slack[:, 2]),
        margin_bound=checks.bound,
        limit_margin=checks.slack[:, 3:].min(1, initial=np.inf),
        feasible_at_infinity=nothing,
        tolerated=checks.tolerated,
        not_tolerated=checks.not_tolerated,
        beta_hat=beta_hats,
        det_margin=checks.slack[:, 1],
        cable_distance=checks.gap,
        refuted_at=checks.refuted_tau * duration,
    )
    return answers, segments


def _confirmed(
    checker: MotionChecker, segments: PlatformSegment, smallest: FewestArcs
) -> tuple[FewestArcs, np.ndarray]:
    # If a proof leaves a motion open, or refutes it only between samples, report its number of arcs as undecided.
    passed = np.flatnonzero(smallest.arcs > 0)
    if len(passed):
        part = checker.confirmed(take_segments(segments, passed), smallest.arcs[passed], smallest.checks.take(passed))
        smallest.checks.put(passed, part)
    is_open = (smallest.arcs > 0) & (smallest.checks.verdict != 0)
    undecided = np.where(is_open & (smallest.undecided == 0), smallest.arcs, smallest.undecided)
    return smallest._replace(arcs=np.where(is_open, 0, smallest.arcs), undecided=undecided), is_open


def _reasons(
    checker: MotionChecker,
    candidates: Candidates,
    smallest: FewestArcs,
    refused: Refused,
    checks: PlatformChecks,
    *,
    margins: bool,
    max_arcs: int,
    fixed: np.ndarray | None,
) -> np.ndarray:
    # Return the flags of the criteria that leave motions without a number of arcs.
    limits = sum({flag.value for flag in itertools.compress(checker.flags, checker.is_limit)})
    basic = checks.verdict & ~(limits & ~Verdict.SLACK_CABLE.value)
    by_limits = refused.arcs > 0
    broken = refused.broken.copy()
    if margins:
        others = np.flatnonzero((smallest.arcs == 0) & ~by_limits & (basic != checks.verdict))
        suspects = checker.breaks(checks.slack[others]) & checker.is_limit
        part = None if fixed is None else fixed[others]
        motions = candidates.motions(others)
        broken[others] = unavoidable(checker, motions, suspects, max_arcs=max_arcs, fixed=part)
    named = np.zeros(len(basic), int)
    for flag, column in zip(checker.flags, broken.T, strict=True):
        named |= np.where(column, flag.value, 0)
    # Motions that limits refuse may also be undecided, or proved for the planned robot alone: keep these flags.
    alone = named | (checks.verdict & (Verdict.UNCERTAINTY | Verdict.UNDECIDED).value)
    return np.where(by_limits, alone, basic | named)


def trials(
    motions: Candidates, values: Float[np.ndarray, "n n_values"], *, same: bool = False
) -> tuple[Float[np.ndarray, "k"], Candidates]:
    """Motions with several values of beta-hat at their ends."""
    cell, option = np.nonzero(~np.isnan(values))
    return cell, _with_ends(motions.take(cell), values[cell, option], same=same)


def reached(
    checker: MotionChecker,
    motions: Candidates,
    values: Float[np.ndarray, "n n_values"],
    *,
    max_arcs: int,
    same: bool = False,
    margins: bool = True,
    fixed: np.ndarray | None = None,
) -> PlatformMotionAnswers:
    """Smallest numbers of arcs of motions, each tried with several values of beta-hat at its end."""
    cell, trial = trials(motions, values, same=same)
    of_trials = smallest_arcs(checker, trial, max_arcs=max_arcs, fixed=fixed, margins=margins)
    arcs, undecided, checks = np.zeros(len(values), int), np.full(len(values), NEVER), checker.nothing(len(values))
    beta_hats = np.where(np.isnan(values[:, 0]), AT_REST, values[:, 0])
    # Several values may pass for one motion: write in reverse order, so that the value tried first remains.
    best = np.flatnonzero(of_trials.arcs > 0)[::-1]
    arcs[cell[best]], beta_hats[cell[best]] = of_trials.arcs[best], trial.beta_hats[1][best]
    checks.put(cell[best], of_trials.checks.take(best))
    np.minimum.at(undecided, cell, np.where(of_trials.undecided > 0, of_trials.undecided, NEVER))
    smallest = FewestArcs(arcs, np.where(undecided < NEVER, undecided, 0), checks)
    # A motion without an answer takes the value that the fewest limits refuse, if any.
    open_ones = np.flatnonzero(((arcs == 0) & (undecided == NEVER))[cell])
    of_limits = refused_by_limits(checker, trial.take(open_ones), max_arcs=max_arcs, fixed=fixed)
    refused = Refused(np.zeros(len(values), int), np.zeros((len(values), len(checker.flags)), bool))
    ranks = rank(checker.flags, of_limits.broken)
    best = np.lexsort((of_limits.arcs, ranks))[::-1]  # written last: the fewest limits, then the fewest arcs
    best = best[of_limits.arcs[best] > 0]
    cells = cell[open_ones[best]]
    refused.arcs[cells], refused.broken[cells] = of_limits.arcs[best], of_limits.broken[best]
    beta_hats[cells] = trial.beta_hats[1][open_ones[best]]
    chosen = _with_ends(motions, beta_hats, same=same)
    return settled(checker, chosen, smallest, refused=refused, max_arcs=max_arcs, fixed=fixed, margins=margins)[0]


def _with_ends(motions: Candidates, beta_hats: np.ndarray, *, same: bool) -> Candidates:
    return motions._replace(beta_hats=(beta_hats if same else motions.beta_hats[0], beta_hats))
