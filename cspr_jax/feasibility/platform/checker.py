"""Feasibility of a platform's motions, with margins: samples, finer where it matters, and cables in between.

A first look takes a few instants. A check takes 64 samples an arc, and a sample on either side of each knot of the
amplitude function; around the smallest samples of every criterion, and of the distance between cables, the smallest
value is then narrowed down. Between samples cables are followed with halved steps until they turn little. A margin
within the tolerance of zero is undecided: nothing here is a proof.
"""

import threading
from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.arithmetic.batches import in_batches, room
from cspr_jax.feasibility.platform.crossings import passed_over
from cspr_jax.feasibility.platform.end_acceleration import endpoint
from cspr_jax.feasibility.platform.kernels import cable_vectors, moving_along, still_along
from cspr_jax.feasibility.platform.motion_checker import FEW, MANY, TOLERANCE, MotionChecker, PoseChecks
from cspr_jax.feasibility.platform.prefilter import FIRST, Prefilter
from cspr_jax.feasibility.platform.samples import Motions, Narrowing, Places, Samples, along, low_points
from cspr_jax.feasibility.platform.slack_lanes import order
from cspr_jax.feasibility.platform.slacks import flags
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots.interference import contacts
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.trajectories.platform_segment import USUAL, Kind, PoseSegment

# Where the determinant changes by more than this factor from sample to sample, so many pieces have two samples more.
STEEP, PIECES = 1.25, 4
# So many arcs are held at a time: each is 64 samples of several criteria.
ARCS = 8 * MANY
TOUCH = 1e-6  # of the platform's size
BESIDE_KNOT = 1e-12


# One function for XLA instead of some hundred small ones.
_end = jax.jit(endpoint)


class PoseChecker(MotionChecker):
    """Checker of motions of one robot on six cables.

    Args:
        problem: robot, limits, amplitude.
        kind: of the motions.
        batch: how many are computed at a time.

    Fields:
        prefilter: the first look, which comes before checks.
        done: how many instants of motions were looked at so far, in the first look and in checks, and how many motions
            were checked.
    """

    def __init__(self, problem: Problem, kind: Kind = USUAL, *, batch: int = FEW) -> None:
        """Find what can meet."""
        super().__init__(problem, kind, batch=batch)
        self.done, self._lock = {"prefilter": 0, "checks": 0, "motions": 0}, threading.Lock()
        near = contacts(problem.robot)
        self._platform, self._pairs = (near.sides, near.normal), tuple((int(i), int(j)) for i, j in near.pairs)
        self.flags = flags(problem.limits)
        self._size = float(np.linalg.norm(np.asarray(problem.robot.platform_points), axis=1).max())
        knots = np.asarray(problem.amplitude.knots)
        count = partial(self._count, "prefilter")
        self.prefilter = Prefilter(problem.robot, problem.amplitude, kind, -TOLERANCE, FIRST * batch, count)
        self._of_motion = Narrowing(problem, kind, None, batch)
        self._of_pose = self._of_motion._replace(pairs=self._pairs)
        self._knots = np.sort(np.concatenate([knots - BESIDE_KNOT, knots + BESIDE_KNOT]))

    def _count(self, what: str, many: int) -> None:
        with self._lock:
            self.done[what] += many

    def end_interval(self, position: np.ndarray, quaternion: np.ndarray, z0: float) -> tuple[float, float, float]:
        """Values of (3.91) and (3.92); see `MotionChecker.end_interval`."""
        end = _end(self.problem.robot, position, quaternion, jnp.asarray(z0))
        return float(end.preferred), float(end.lowest), float(end.highest)

    def check(self, segments: PoseSegment, arcs: np.ndarray, *, whole: bool = True) -> PoseChecks:
        """Check motions in full; see `MotionChecker.check`."""
        checks, motions = self.nothing(len(arcs)), Motions(segments, arcs)
        self._count("motions", len(arcs))
        size = max(room(ARCS) // max(arcs, default=1), 1)
        for start in range(0, len(arcs), size):
            piece = np.arange(start, min(start + size, len(arcs)))
            checks.put(piece, self._checked(motions.rows(piece), whole))
        return checks

    def _checked(self, motions: Motions, whole: bool) -> PoseChecks:
        checks = self.nothing(len(motions.arcs))
        samples = self._along(moving_along, motions)
        # Samples refute most of what is not feasible; what is narrowed down around them, some of the others.
        is_open = np.logical_or(whole, (samples.least() > -TOLERANCE).all(0))
        rest, motions = np.flatnonzero(is_open), motions.rows(is_open)
        checks.verdict[~is_open] = Verdict.SLACK_CABLE.value
        if not len(rest):
            return checks
        moving = self._moving(motions, samples.of(is_open))
        is_open = np.logical_or(whole, (moving > -TOLERANCE).all(0))
        checks.verdict[rest[~is_open]] = Verdict.SLACK_CABLE.value
        if is_open.any():
            checks.put(rest[is_open], self._still(motions.rows(is_open), moving[:, is_open]))
        return checks

    def _along(self, kernel: Callable, motions: Motions) -> Samples:
        samples = along(partial(kernel, self.problem, kind=self.kind), motions, size=self.batch)
        self._count("checks", len(jax.tree.leaves(samples.values)[0]) * len(samples.row))
        return samples

    def _moving(self, motions: Motions, samples: Samples) -> np.ndarray:
        # (n_values, n) smallest values of the criteria that depend on the motion.
        least = self._of_motion.around(motions, samples)
        # The motion may jump at a knot.
        places = np.meshgrid(np.arange(len(least)), np.arange(len(motions.arcs)), self._knots, indexing="ij")
        which, row, tau = (x.ravel() for x in places)
        self._of_motion.lower(least, motions, Places(which, row, tau, np.zeros(len(row))))
        return least

    def _still(self, motions: Motions, moving: np.ndarray) -> PoseChecks:
        # With what depends on the pose alone; `moving` is of `_moving`.
        along_arcs = self._along(partial(still_along, platform=self._platform, pairs=self._pairs), motions)
        still_samples = along_arcs.values
        samples = along_arcs._replace(values=still_samples.values)
        still = self._of_pose.around(motions, samples)
        self._beside_singularities(motions, samples, moving)
        nearest, least = still[-1], np.concatenate([moving, still[:-1]])[order(self.problem.limits)]
        is_finite = np.isfinite(least).all(0) & ~np.isnan(nearest) & (self.durations(*motions) > 0.0)
        step, item = np.nonzero(still_samples.wide)
        ends = samples.instants(motions, item, step), samples.instants(motions, item, step + 1)
        met, hit = passed_over(
            partial(self._cable_vectors, motions), self._platform, samples.row[item], ends, len(motions.arcs)
        )
        hit[samples.row[still_samples.hit]] = True
        return PoseChecks(
            np.where(is_finite, self._verdict(least, nearest, met, hit), Verdict.NOT_FINITE.value),
            np.where(is_finite, least, np.nan).T,
            np.where(is_finite, nearest, np.nan),
        )

    def _verdict(self, least: np.ndarray, nearest: np.ndarray, met: np.ndarray, hit: np.ndarray) -> np.ndarray:
        verdict = Verdict.CABLE_CABLE.value * met | Verdict.CABLE_PLATFORM.value * hit
        for flag, value in zip(self.flags, least, strict=True):
            verdict |= np.where(value <= -TOLERANCE, flag.value, 0)
            verdict |= np.where(np.abs(value) <= TOLERANCE, Verdict.UNDECIDED.value, 0)
        verdict |= np.where(~met & (nearest < TOUCH * self._size), Verdict.UNDECIDED.value, 0)
        # What is broken for certain is said alone.
        reasons = verdict & ~Verdict.UNDECIDED.value
        return np.where(reasons != 0, reasons, verdict)

    def _beside_singularities(self, motions: Motions, samples: Samples, moving: np.ndarray) -> None:
        # Tensions have the determinant below the line: between samples in which that changes by much they are sampled
        # more finely. `samples` has it first; `moving` is of `_moving`, and is written into.
        determinant = samples.values[:, 0]
        low, high = (f(determinant[1:], determinant[:-1]) for f in (np.minimum, np.maximum))
        place, item = np.nonzero((low > 0.0) & (high > STEEP * low))
        if not len(place):
            return
        piece = np.repeat((np.arange(PIECES) + 0.5) / PIECES, len(place))
        item = np.tile(item, PIECES)
        row, tau = samples.row[item], samples.instants(motions, item, np.tile(place, PIECES) + piece)
        places = Places(np.zeros(len(row), int), row, tau, motions.steps(row) / (2.0 * PIECES))
        tension = self._of_motion.lower(moving, motions, places, sections=0).reshape(PIECES, 1, -1)
        some = low_points(tension, moving[:1, row[: len(place)]])
        some = some[0] * len(place) + some[2]
        self._of_motion.lower(moving, motions, Places(*(x[some] for x in places)))

    def _cable_vectors(self, motions: Motions, row: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        kernel = partial(cable_vectors, self.problem, pairs=self._pairs, kind=self.kind)
        gap, direction = in_batches(kernel, (*motions.items(row), tau), size=self.batch)
        return gap, direction / np.linalg.norm(direction, axis=2, keepdims=True)
