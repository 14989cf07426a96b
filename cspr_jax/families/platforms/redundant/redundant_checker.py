"""Feasibility of motions of a platform on more than six cables, with margins: samples first, a proof at the end.

Motion and limits do not determine the tensions. The margin at a time is the margin of a workspace (`workspaces`) at
the pose for the wrench that the motion needs: the largest s such that tensions between f_min + s and f_max - s supply
the wrench. Neither the determinant nor the platform's side of the spools matters: where the cables cannot supply the
wrench, there is no s. Searches take samples, finer ones where necessary; the motion that they choose is then proved by
tensions that balance it throughout blocks of time (`verification.proved_answers`), and so is that cables, even thick
ones, do not touch each other. Contacts with the platform are checked if its attachment points lie in a plane, or if a
plan gives its shape.
"""

from __future__ import annotations

from functools import partial

import jax
import numpy as np

from cspr_jax.families.platforms.beta_hat import LARGEST, options
from cspr_jax.families.platforms.end_acceleration import AT_REST
from cspr_jax.families.platforms.motion_checker import BASIC, BESIDE_KNOT, FEW, TOUCH, MotionChecker, PlatformChecks
from cspr_jax.families.platforms.platform_segment import Motions, PlatformMotion, PlatformSegment, take_segments
from cspr_jax.families.platforms.redundant.crossings import CableVectors, crossings
from cspr_jax.families.platforms.redundant.redundant_kernels import cable_vectors, end_wrenches, samples_of
from cspr_jax.motion.limits import other_limits
from cspr_jax.motion.platform_kind import USUAL, PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.search.minima import narrowed_times
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import SAMPLES_UNDECIDED
from cspr_jax.robots.model.platform import separate_pairs
from cspr_jax.schema.verdicts import Verdict, conjunction
from cspr_jax.verification.proved_answers import proof_of
from cspr_jax.workspaces.poses import exact
from cspr_jax.workspaces.requirements import FEASIBLE, requirement
from cspr_jax.workspaces.search import WorkspaceSearch

MAX_SAMPLES = 200_000  # number of samples in memory at a time
CHUNK = 8  # number of samples of a motion screened at a time
# Number of samples per arc.
SAMPLES = 32
# A search refines minima between samples if the smallest sample is below this fraction of the largest.
NEAR = 0.1
HALVINGS = 60  # bisections of an interval of beta-hat, down to rounding
FLAT = 1e-12  # derivatives of distances from planes count as zero below this fraction of the weight per cable
# Empty interval.
NONE = (LARGEST, -LARGEST)


class MarginScreen:
    """Cheap test of motions by the margins of their tensions, and by other limits; see `Screen`."""

    def __init__(self, checker: "RedundantChecker") -> None:
        """Store the checker."""
        self._checker = checker

    def lowest(self, segments: PlatformSegment, arcs: int, tau: np.ndarray) -> np.ndarray:
        """Smallest margin over some samples; see `Screen.lowest`."""
        return self._minima(segments, arcs, tau)[:, 0]

    def refuted(self, segments: PlatformSegment, arcs: int, tau: np.ndarray, *, limits: bool = True) -> np.ndarray:
        """Tell which motions some samples refute; see `Screen.refuted`."""
        is_refuted = np.zeros(len(segments.rate), bool)
        for start in range(0, len(tau), CHUNK):
            alive = np.flatnonzero(~is_refuted)
            if not len(alive):
                break
            minimum = self._minima(take_segments(segments, alive), arcs, tau[start : start + CHUNK])
            is_refuted[alive] = ~(minimum[:, : None if limits else 1] > -SAMPLES_UNDECIDED).all(1)
        return is_refuted

    def _minima(self, segments: PlatformSegment, arcs: int, tau: np.ndarray) -> np.ndarray:
        # Return slacks (n, n_slacks), the margin first, without distances between cables.
        motions = Motions(segments, np.full(len(segments.rate), arcs))
        minimum = self._checker.values(motions, np.tile(tau, (len(motions.arcs), 1)))[:, :, :-1].min(1)
        return np.where(np.isnan(minimum), -np.inf, minimum)


class RedundantChecker(MotionChecker):
    """Checker of motions of one robot on more cables than six; see `MotionChecker`."""

    def __init__(self, problem: Problem, kind: PlatformMotionKind = USUAL, *, batch: int = FEW) -> None:
        """Find which cables can touch."""
        super().__init__(problem, kind, batch=batch)
        robot, limits = problem.robot, problem.limits
        self._limits = other_limits(limits)
        basic = (Verdict.WRENCH_INFEASIBLE, Verdict.SINGULAR, Verdict.ABOVE_SPOOLS)
        self.flags, self.screen = (*basic, *(row.flag for row in self._limits)), MarginScreen(self)
        self._requirement = requirement(robot, FEASIBLE, limits)
        self._workspace = WorkspaceSearch(robot, self._requirement)
        self._weight = float(robot.mass * robot.gravity) / robot.n_cables
        self._pairs = np.array(separate_pairs(robot), int).reshape(-1, 2)
        radius = float(np.linalg.norm(np.asarray(robot.platform_points), axis=1).max())
        self._diameter = 0.0 if robot.cable_diameter is None else float(robot.cable_diameter)
        self._touch = TOUCH * radius
        knots = np.asarray(problem.amplitude.knots)
        self._knots = np.clip(np.concatenate([knots - BESIDE_KNOT, knots + BESIDE_KNOT]), 0.0, 1.0)

    def values(self, motions: Motions, tau: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "n m n_values"]:
        """Margins, other slacks, and distances between cables along motions."""
        motion = np.repeat(np.arange(len(tau)), tau.shape[1])
        kernel = partial(samples_of, self.problem, self._pairs, kind=self.kind)
        states = in_batches(kernel, (*motions.items(motion), tau.ravel()), batch_size=self.batch)
        is_finite = (
            np.isfinite(states.position).all(1)
            & np.isfinite(states.quaternion).all(1)
            & np.isfinite(states.wrench).all(1)
        )
        margin = np.full(len(motion), np.nan)
        poses = states.position[is_finite], states.quaternion[is_finite], states.wrench[is_finite]
        margin[is_finite] = self._workspace(*poses).margin
        values = np.concatenate([margin[:, None] / self._weight, states.slacks], axis=1)
        return values.reshape(*tau.shape, -1)

    def end_interval(self, position: np.ndarray, quaternion: np.ndarray, z0: float) -> tuple[float, float, float]:
        """Value with the largest margin, and interval of positive margins; see `MotionChecker.end_interval`."""
        # The wrench is linear in beta-hat, and so is its distance from each plane; the margin is the smallest distance,
        # so it is concave.
        matrix, wrenches = (np.asarray(x) for x in end_wrenches(self.problem.robot, position, quaternion, z0))
        unit = self._workspace.unit
        planes = exact.margin_planes(matrix / unit[:, None], self._requirement.low, self._requirement.high)
        if exact.is_outside(wrenches / unit, planes.basis):
            return AT_REST, *NONE
        first, second = planes.offsets - (wrenches / unit) @ planes.normals.T
        derivative = second - first
        if len(derivative) == 0 or np.abs(derivative).max() <= FLAT * self._weight:
            is_held = first.min(initial=np.inf) > 0.0
            return AT_REST, *((-np.inf, np.inf) if is_held else NONE)
        low, high = -LARGEST, LARGEST
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            rises = derivative[np.argmin(first + middle * derivative)] > 0.0
            low, high = (middle, high) if rises else (low, middle)
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = -first / derivative
        is_held = (first[derivative == 0.0] > 0.0).all()
        lowest, highest = zero[derivative > 0.0].max(initial=-np.inf), zero[derivative < 0.0].min(initial=np.inf)
        return 0.5 * (low + high), *((lowest, highest) if is_held else NONE)

    def end_options(
        self, positions: np.ndarray, quaternions: np.ndarray, z0: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values of beta-hat to try at poses, that of the largest margin first; see `MotionChecker.end_options`."""
        # If no value is feasible, keep the one of largest margin: its motion shows what fails.
        poses = zip(positions, quaternions, z0.tolist(), strict=True)
        ends = np.array([self.end_interval(*pose) for pose in poses]).reshape(-1, 3)
        values = options(ends[:, 0], ends[:, 1], ends[:, 2], count)
        values[:, 0] = np.where(np.isnan(values[:, 0]), ends[:, 0], values[:, 0])
        return values, np.ones(len(ends), bool)

    def breaks(self, slack: np.ndarray) -> np.ndarray:
        """Mask of the criteria that are certainly broken; see `MotionChecker.breaks`."""
        return slack <= -SAMPLES_UNDECIDED

    def sampled(self, segments: PlatformSegment, arcs: int, tau: np.ndarray) -> np.ndarray:
        """Smallest slacks at some samples; see `MotionChecker.sampled`."""
        motions = Motions(segments, np.full(len(segments.rate), arcs))
        return _in_order(self.values(motions, np.tile(tau, (len(motions.arcs), 1))).min(1))

    def check(
        self,
        segments: PlatformSegment,
        arcs: np.ndarray,
        *,
        full: bool = True,
        margins: bool = True,
        ignored: np.ndarray | None = None,
    ) -> PlatformChecks:
        """Check motions by samples, without a proof; see `MotionChecker.check`."""
        return self._at_samples(Motions(segments, arcs), full, ignored)

    def confirmed(self, segments: PlatformSegment, arcs: np.ndarray, checks: PlatformChecks) -> PlatformChecks:
        """Checks of motions that passed, each with a proof; see `MotionChecker.confirmed`."""
        motions = Motions(segments, arcs)
        checks = self._at_samples(motions, True, None)
        for i in np.flatnonzero(checks.verdict == 0).tolist():
            segment, count = jax.tree.map(lambda x: x[0], motions.items(np.array([i])))
            motion = PlatformMotion(segment, self.problem.amplitude, count, self.kind)
            proof = proof_of(self.problem, motion)
            checks.verdict[i], checks.bound[i] = proof.verdict, proof.margin_bound / self._weight
            checks.slack[i, 0] = np.fmin(checks.slack[i, 0], proof.margin / self._weight)
            clearance = proof.smallest(proof.proof.high, Verdict.CABLE_CABLE)
            checks.gap[i] = np.fmin(checks.gap[i], clearance + self._diameter)
            firsts = [float(intervals[0].mean()) for intervals in proof.proof.failing if len(intervals)]
            checks.refuted_tau[i] = min(firsts, default=np.nan) / float(motion.duration())
        return checks

    def _at_samples(self, motions: Motions, full: bool, ignored: np.ndarray | None) -> PlatformChecks:
        arcs = motions.arcs
        checks = self.nothing(len(arcs))
        for count in np.unique(arcs).tolist():
            # Check motions with the same number of samples together.
            alike = np.flatnonzero(arcs == count)
            chunk = max(MAX_SAMPLES // (SAMPLES * count), 1)
            for start in range(0, len(alike), chunk):
                piece = alike[start : start + chunk]
                checks.put(piece, self._checked(motions.take(piece), SAMPLES * count, full, ignored))
        return checks

    def _checked(self, motions: Motions, steps: int, full: bool, ignored: np.ndarray | None) -> PlatformChecks:
        tau = np.linspace(0.0, 1.0, steps + 1)
        samples = self.values(motions, np.tile(tau, (len(motions.arcs), 1)))
        counted = np.ones(len(self.flags), bool) if ignored is None else ~ignored
        first = samples[:, :, :-1][:, :, np.append(True, counted[BASIC:])]
        is_open = np.logical_or(full, (first.min((1, 2)) > -SAMPLES_UNDECIDED))
        checks = self.nothing(len(motions.arcs))
        checks.verdict[~is_open] = Verdict.WRENCH_INFEASIBLE.value
        if not is_open.any():
            return checks
        motions, samples = motions.take(is_open), samples[is_open]
        minimum, when = self._smallest(motions, tau, samples, full)
        if len(self._knots):  # slacks may jump at knots
            beside = self.values(motions, np.tile(self._knots, (len(minimum), 1)))
            when = np.where(beside.min(1) < minimum, self._knots[beside.argmin(1)], when)
            minimum = np.minimum(minimum, beside.min(1))
        open_checks = self._checks(minimum, self._met(motions, tau), self.durations(*motions), counted[BASIC:])
        open_checks.refuted_tau[:] = _refuted_at(minimum[:, :-1], when[:, :-1])
        checks.put(np.flatnonzero(is_open), open_checks)
        return checks

    def _smallest(
        self, motions: Motions, tau: np.ndarray, samples: np.ndarray, full: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        # Return smallest values (n, n_values) and their times.
        minimum, when = samples.min(1), tau[samples.argmin(1)]
        is_near = np.logical_or(full, ~(minimum > NEAR * np.abs(samples).max(1)).all(1))
        if is_near.any():
            near_motions = motions.take(is_near)
            minimum[is_near], when[is_near] = narrowed_times(partial(self.values, near_motions), tau, samples[is_near])
        return minimum, when

    def _met(self, motions: Motions, tau: np.ndarray) -> np.ndarray:
        # Find motions in which cables pass through each other between samples.
        many, steps = len(motions.arcs), len(tau) - 1
        ends = tuple(np.tile(part, many) for part in (tau[:-1], tau[1:]))
        motion = np.repeat(np.arange(many), steps)

        def vectors(motion: np.ndarray, when: np.ndarray) -> CableVectors:
            kernel = partial(cable_vectors, self.problem, self._pairs, kind=self.kind)
            return in_batches(kernel, (*motions.items(motion), when), batch_size=self.batch)

        if not len(self._pairs):
            return np.zeros(many, bool)
        return crossings(vectors, None, motion, (ends[0], ends[1]), many)[0]

    def _checks(self, minima: np.ndarray, met: np.ndarray, duration: np.ndarray, counted: np.ndarray) -> PlatformChecks:
        margin, nearest, others = minima[:, 0], minima[:, -1], minima[:, 1:-1]
        free = nearest - self._diameter
        verdict = Verdict.CABLE_CABLE.value * (met | (free <= -self._touch))
        verdict |= np.where(~met & (np.abs(free) < self._touch), Verdict.UNDECIDED.value, 0)
        verdict |= np.where(np.isneginf(margin), Verdict.SINGULAR.value, 0)
        is_short = np.isfinite(margin) & (margin <= -SAMPLES_UNDECIDED)
        verdict |= np.where(is_short, Verdict.WRENCH_INFEASIBLE.value, 0)
        for limit, value, counts in zip(self._limits, others.T, counted, strict=True):
            verdict |= np.where(counts & (value <= -SAMPLES_UNDECIDED), limit.flag.value, 0)
        # Leave limits that are nearly touched to the proof.
        is_strict = float(np.min(self._requirement.low)) == 0.0
        verdict |= np.where(is_strict & (np.abs(margin) <= SAMPLES_UNDECIDED), Verdict.UNDECIDED.value, 0)
        verdict = conjunction(verdict)
        is_finite = ~np.isnan(minima).any(1) & (duration > 0.0)
        return PlatformChecks(
            np.where(is_finite, verdict, Verdict.NOT_FINITE.value),
            np.where(is_finite[:, None], _in_order(minima), np.nan),
            np.where(is_finite, nearest, np.nan),
            *(np.full(len(margin), np.nan) for _ in range(4)),
        )


def _refuted_at(minima: np.ndarray, when: np.ndarray) -> np.ndarray:
    # Take smallest values (n, n_values), the margin first, and their times. Return the time of the margin if it is
    # negative, else that of the worst other value if that is negative, else NaN.
    worst = np.where(minima[:, 0] <= -SAMPLES_UNDECIDED, 0, minima.argmin(1))
    index = np.arange(len(minima))
    return np.where(minima[index, worst] <= -SAMPLES_UNDECIDED, when[index, worst], np.nan)


def _in_order(values: np.ndarray) -> np.ndarray:
    # Convert margin, slacks of other limits and distance to slacks in the order of the flags, (n, n_criteria): NaN for
    # the determinant, which does not exist, and infinity for the depth below the spools, which does not matter.
    nothing, always = np.full((len(values), 1), np.nan), np.full((len(values), 1), np.inf)
    return np.concatenate([values[:, :1], nothing, always, values[:, 1:-1]], axis=1)
