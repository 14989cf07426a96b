"""Feasibility of a platform's motions, proved on blocks of time or refuted by a sample, and their margins.

A screen with a few samples refutes most infeasible motions. Then `tension_proof` proves tensions, the determinant and
limits on the motion, and `pose_proof` proves contacts and limits on the pose. Margins are the smallest attained values,
refined around the smallest samples of each criterion; proved bounds are given beside them.
"""

from __future__ import annotations

import threading
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.platforms.beta_hat import end_options
from cspr_jax.families.platforms.end_acceleration import endpoint
from cspr_jax.families.platforms.motion_checker import BESIDE_KNOT, FEW, MANY, MotionChecker, PlatformChecks
from cspr_jax.families.platforms.platform_segment import Motions, PlatformSegment
from cspr_jax.families.platforms.platform_segment_lanes import phase_lanes, state
from cspr_jax.families.platforms.six_cable_proof.enclosures import Robustness
from cspr_jax.families.platforms.six_cable_proof.margins import Samples, narrowed
from cspr_jax.families.platforms.six_cable_proof.pose_proof import PoseCertifier, PoseProof
from cspr_jax.families.platforms.six_cable_proof.screen import FIRST, TensionScreen
from cspr_jax.families.platforms.six_cable_proof.slacks import flags, moving_slacks, order, static_slacks
from cspr_jax.families.platforms.six_cable_proof.tension_blocks import of_motion
from cspr_jax.families.platforms.six_cable_proof.tension_proof import Certifier, TensionProof
from cspr_jax.motion.limits import allowance, limits_set, scales
from cspr_jax.motion.platform_kind import USUAL, PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches, in_threads
from cspr_jax.numerics.linear.lanes import dot, smallest
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import SIX_CABLES_UNDECIDED
from cspr_jax.robots.contacts import interference_lanes
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.robots.statics.wrench_lanes import CABLES, cable_lanes
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.limits import Limit
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.robustness.tolerances import Tolerated

BLOCKS = 1024  # largest number of blocks in a call
ARCS = 32 * MANY  # largest number of arcs of motions in memory at a time
# Number of samples computed at a time.
SAMPLES = 1 << 18
# If margins are wanted, bounds must be at least this fraction of the attained values.
NEAR = 0.5


# Compile one function instead of some hundred small ones.
_end = jax.jit(endpoint)


@persistent_jit(static_argnames=("pairs", "kind"))
def slacks_at(problem: Problem, items, *, pairs: tuple, kind: PlatformMotionKind) -> tuple[Float[Array, "n"], ...]:
    """Slacks and distances between cables at samples."""
    segments, arcs, tau = items
    phase = phase_lanes(problem.amplitude, segments.sense, arcs, tau)
    current = state(segments, arcs, phase, kind)
    cables = cable_lanes(problem.robot, current.position, current.rotation)
    slacks = [
        *moving_slacks(problem, segments, arcs, phase, kind),
        *static_slacks(problem, segments, current, cables),
    ]
    squares = [dot(gap, gap) for gap in interference_lanes.gaps(problem.robot.base_points, pairs, cables)]
    nearest = jnp.sqrt(smallest(squares)) if squares else jnp.full_like(segments.rate, jnp.inf)
    # Return a tuple: XLA would compute the full stack for each of its elements.
    return *(slacks[k] for k in order(problem.limits)), nearest


class PlatformChecker(MotionChecker):
    """Checker of motions of one robot on six cables.

    Args:
        problem: robot, limits and amplitude function.
        batch: number of motions computed at a time.

    Fields:
        screen: the cheap test that comes before checks.
        done: numbers of samples computed so far in the screen ("screen") and in checks ("checks"), and of checked
            motions ("motions").
    """

    def __init__(self, problem: Problem, kind: PlatformMotionKind = USUAL, *, batch: int = FEW) -> None:
        """Prepare the screen and both proofs."""
        super().__init__(problem, kind, batch=batch)
        self._lock, self.done = threading.Lock(), {"screen": 0, "motions": 0, "checks": 0}
        self._compiling, self._compiled = threading.Lock(), set[bool]()
        self.flags = flags(problem.limits)
        knots = np.asarray(problem.amplitude.knots)
        count, count_checks = partial(self._count, "screen"), partial(self._count, "checks")
        self.screen = TensionScreen(problem.robot, problem.amplitude, kind, -SIX_CABLES_UNDECIDED, FIRST * batch, count)
        self._tensions = Certifier(problem, kind, batch=min(batch, BLOCKS), count_samples=count_checks)
        self._poses = PoseCertifier(problem, kind, batch=min(batch, BLOCKS), count_samples=count_checks)
        self._robustness = None
        if problem.limits.uncertainty is not None:
            self._robustness = Robustness(problem, kind, batch=min(batch, BLOCKS), count_samples=count_checks)
        self._knots = np.concatenate([knots - BESIDE_KNOT, knots + BESIDE_KNOT])
        basic, missed = flags(Limits()), [_missed(problem, row) for row in limits_set(problem.limits)]
        self._missed = np.array([SIX_CABLES_UNDECIDED] * len(basic) + missed)
        # Index of each criterion in a list with criteria of the motion first, then those of the pose.
        self._order = np.array(order(problem.limits))
        self._n_moving = 1 + len(of_motion(problem))

    def _count(self, what: str, many: int) -> None:
        with self._lock:
            self.done[what] += many

    def end_interval(self, position: np.ndarray, quaternion: np.ndarray, z0: float) -> tuple[float, float, float]:
        """Values of (3.91) and (3.92); see `MotionChecker.end_interval`."""
        end = _end(self.problem.robot, position, quaternion, jnp.asarray(z0))
        return float(end.preferred), float(end.lowest), float(end.highest)

    def end_options(
        self, positions: np.ndarray, quaternions: np.ndarray, z0: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values of beta-hat to try at poses; see `MotionChecker.end_options`."""
        return end_options(self.problem.robot, positions, quaternions, z0, count)

    def breaks(self, slack: np.ndarray) -> np.ndarray:
        """Mask of the criteria that are certainly broken; see `MotionChecker.breaks`."""
        return slack < -self._missed

    def sampled(self, segments: PlatformSegment, arcs: int, tau: np.ndarray) -> np.ndarray:
        """Smallest slacks at some samples; see `MotionChecker.sampled`."""
        motions, chunk = Motions(segments, np.full(len(segments.rate), arcs)), max(SAMPLES // len(tau), 1)
        kernel = partial(slacks_at, self.problem, pairs=self._poses.pairs, kind=self.kind)
        minimum = []
        for start in range(0, len(motions.arcs), chunk):
            index = np.repeat(np.arange(start, min(start + chunk, len(motions.arcs))), len(tau))
            times = np.tile(tau, len(index) // len(tau))
            slacks = in_batches(kernel, (*motions.items(index), times), batch_size=self.batch)
            minimum.append(np.stack(slacks[:-1], axis=1).reshape(-1, len(tau), len(self.flags)).min(1))
        return np.concatenate(minimum)

    def check(
        self,
        segments: PlatformSegment,
        arcs: np.ndarray,
        *,
        full: bool = True,
        margins: bool = True,
        ignored: np.ndarray | None = None,
    ) -> PlatformChecks:
        """Check motions in full; see `MotionChecker.check`."""
        checks, motions = self.nothing(len(arcs)), Motions(segments, arcs)
        self._count("motions", len(arcs))
        chunk = max(ARCS // max(arcs, default=1), 1)
        for start in range(0, len(arcs), chunk):
            piece = np.arange(start, min(start + chunk, len(arcs)))
            checks.put(piece, self._checked(motions.take(piece), full=full, margins=margins, ignored=ignored))
        return checks

    def _checked(self, motions: Motions, *, full: bool, margins: bool, ignored: np.ndarray | None) -> PlatformChecks:
        checks = self.nothing(len(motions.arcs))
        self._compile(motions, margins=margins)
        moving, static = self._narrowed_criteria()
        moving_ignored, static_ignored = (None if ignored is None else ignored[x] for x in (moving, static[:-1]))
        near = NEAR if margins else 0.0
        tensions = self._tensions.prove(*motions, near=near, margins=margins, ignored=moving_ignored)
        checks.verdict[:] = np.where(tensions.is_refuted, Verdict.SLACK_CABLE.value, Verdict.UNDECIDED.value)
        checks.refuted_tau[:] = np.where(tensions.is_refuted, tensions.refuted_tau, np.nan)
        open_motions = np.flatnonzero(np.logical_or(full, ~tensions.is_refuted))
        if not len(open_motions):
            return checks
        part = motions.take(open_motions)
        poses = self._poses.prove(*part, margins=margins, ignored=static_ignored)
        checks.refuted_tau[open_motions] = np.where(
            tensions.is_refuted[open_motions], tensions.refuted_tau[open_motions], poses.refuted_tau
        )
        is_finite = ~np.isnan(tensions.attained[open_motions]).any(1) & ~np.isnan(poses.attained).any(1)
        is_finite &= self.durations(*part) > 0.0
        is_proved = tensions.is_proved[open_motions] & poses.is_proved & is_finite
        checks.bound[open_motions] = np.where(
            is_proved, np.minimum(tensions.bound[open_motions, 0], poses.bound[:, 0]), np.nan
        )
        minimum = self._attained(tensions.attained[open_motions], poses.attained)
        if margins:
            samples = _samples(moving, tensions, open_motions), _samples(static, poses, np.arange(len(open_motions)))
            self._narrow(minimum, part, samples, np.logical_or(full, is_proved))
        verdict = self._verdict(minimum[:-1], is_proved, poses, ignored)
        if ignored is None:
            self._apply_uncertainty(checks, open_motions, part, verdict)
        checks.verdict[open_motions] = np.where(is_finite, verdict, Verdict.NOT_FINITE.value)
        checks.slack[open_motions] = np.where(is_finite, minimum[:-1], np.nan).T
        checks.gap[open_motions] = np.where(is_finite, minimum[-1], np.nan)
        return checks

    def _compile(self, motions: Motions, *, margins: bool) -> None:
        # Compile both proofs at once before the first check: XLA takes seconds for each, on one core. Other threads
        # wait.
        with self._compiling:
            if margins not in self._compiled:
                one = motions.take(np.arange(1))
                in_threads(lambda proofs: proofs.prove(*one, margins=margins), [self._tensions, self._poses])
                self._compiled.add(margins)

    def tolerated(self, segments: PlatformSegment, arcs: np.ndarray) -> Tolerated:
        """Multiples of the uncertainty that motions tolerate; see `MotionChecker.tolerated`."""
        if self._robustness is None:
            return super().tolerated(segments, arcs)
        return self._robustness.tolerated(segments, arcs)

    def _apply_uncertainty(
        self, checks: PlatformChecks, indices: np.ndarray, motions: Motions, verdict: np.ndarray
    ) -> None:
        # Motions that are feasible as planned must also tolerate the uncertainty.
        feasible = np.flatnonzero(verdict == Verdict.FEASIBLE)
        if self._robustness is None or not len(feasible):
            return
        tolerances = self._robustness.tolerated(*motions.take(feasible), full=False)
        checks.tolerated[indices[feasible]], checks.not_tolerated[indices[feasible]] = tolerances
        open_ones = np.where(tolerances.refuted <= 1.0, Verdict.UNCERTAINTY.value, Verdict.UNDECIDED.value)
        verdict[feasible] = np.where(tolerances.proved >= 1.0, Verdict.FEASIBLE.value, open_ones)

    def _verdict(
        self, minimum: np.ndarray, is_proved: np.ndarray, poses: PoseProof, ignored: np.ndarray | None
    ) -> np.ndarray:
        # If a criterion is certainly broken, the verdict names only such criteria.
        verdict = Verdict.CABLE_CABLE.value * poses.met | Verdict.CABLE_PLATFORM.value * poses.hit
        broken = self.breaks(minimum.T) & (True if ignored is None else ~ignored)
        for flag, column in zip(self.flags, broken.T, strict=True):
            verdict |= np.where(column, flag.value, 0)
        return np.where(is_proved, 0, np.where(verdict == 0, Verdict.UNDECIDED.value, verdict))

    def _attained(self, moving: np.ndarray, static: np.ndarray) -> np.ndarray:
        # Return (n_criteria + 1, n) in the order of the flags, then the distance between cables. In proofs the
        # determinant is the second of the criteria that depend on the motion.
        columns = np.concatenate([moving[:, :1], moving[:, 2:], moving[:, 1:2], static[:, :-1]], axis=1)
        return np.concatenate([columns[:, self._order], static[:, -1:]], axis=1).T

    def _narrowed_criteria(self) -> tuple[np.ndarray, np.ndarray]:
        # Find the indices of the values of both proofs among the criteria, with the distance between cables last. The
        # determinant is second among the criteria that depend on the motion, and the first one after them among all.
        indices = np.argsort(self._order)
        moving = indices[[0, self._n_moving, *range(1, self._n_moving)]]
        return moving, np.append(indices[self._n_moving + 1 :], len(self.flags))

    def _narrow(self, minima: np.ndarray, motions: Motions, samples: tuple[Samples, ...], selected: np.ndarray) -> None:
        # Lower the attained values, (n_criteria + 1, n), of selected motions to their margins.
        def values_at(index: np.ndarray, tau: np.ndarray) -> np.ndarray:
            kernel = partial(slacks_at, self.problem, pairs=self._poses.pairs, kind=self.kind)
            return np.stack(in_batches(kernel, (*motions.items(index), tau), batch_size=self.batch))

        indices = np.flatnonzero(selected)
        if not len(indices):
            return
        # Limits on speeds and accelerations are proved by other functions of the same sign, and beyond a singularity
        # nothing is proved: start again from true slacks.
        minima[np.argsort(self._order)[1 : self._n_moving]] = np.inf
        minima[np.isneginf(minima)] = np.inf
        # Add the ends of motions, and both sides of knots, where slacks may jump.
        for tau in (0.0, 1.0, *self._knots):
            minima[:, indices] = np.fmin(minima[:, indices], values_at(indices, np.full(len(indices), tau)))
        for one in samples:
            narrowed(values_at, minima, one, selected)


def _missed(problem: Problem, limit_row: Limit) -> float:
    # Return how far below zero a slack must be to break a limit; depths are over z0, at least a tenth of the spool
    # radius.
    robot, limit = problem.robot, float(np.min(getattr(problem.limits, limit_row.name)))
    units = scales(CABLES, robot.mass * robot.gravity, 0.1 * spool_radius(robot))
    factor, unit = units.get(limit_row.quantity, (1.0, limit))
    return 2.0 * factor * float(allowance(limit_row, limit, robot) / unit)


def _samples(criteria: np.ndarray, proof: TensionProof | PoseProof, motions: np.ndarray) -> Samples:
    # Take samples of the motions in `rows` at the times of their first blocks; motions are indexed within `rows`.
    numbers = np.full(len(proof.is_proved), -1)
    numbers[motions] = np.arange(len(motions))
    motion = numbers[proof.motion]
    # Indexing with a mask would make blocks the slowest axis in memory.
    motion, tau, nodes = (np.compress(motion >= 0, x, axis=-1) for x in (motion, proof.first.tau, proof.first.nodes))
    return Samples(criteria, motion, tau, nodes)
