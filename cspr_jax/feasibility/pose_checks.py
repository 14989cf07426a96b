"""Whether a platform's motions are feasible, with margins: samples, finer where it matters, and what happens between.

A first look takes a few instants. A check takes 64 samples an arc, and a sample on either side of each knot of the
amplitude function; around the smallest samples of every criterion, and of the distance between cables, the smallest
value is then narrowed down. Between samples cables are followed with halved steps until they turn little. A margin
within the tolerance of zero is undecided: nothing here is a proof.
"""

import dataclasses
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np

from cspr_jax.feasibility.interference import cables_cross, contacts, platform_hit
from cspr_jax.feasibility.pose_kernel import (
    LEAST_COSINE,
    glances,
    look_along,
    moving_along,
    narrowed,
    smallest_tensions,
)
from cspr_jax.feasibility.pose_lanes import order
from cspr_jax.feasibility.pose_slacks import PoseShared, flags
from cspr_jax.feasibility.verdicts import Verdict
from cspr_jax.grids import in_batches
from cspr_jax.trajectories.pose_segment import USUAL, Kind, PoseSegment, duration

# Sizes of batches for few and for many cases: a batch is always full, and every size is compiled for.
FEW, MANY = 256, 1024
# Instants of one call of the first look, and how many more are looked at than checked at a time.
CHUNK, FIRST = 8, 4
SAMPLES = 64  # an arc
HALVINGS = 12
# Where the determinant changes by more than this factor from sample to sample, so many pieces are narrowed down.
STEEP, PIECES = 1.25, 4
TOLERANCE = 1e-7
TOUCH = 1e-6  # of the platform's size
# Values that spread less along a motion are not narrowed.
LEVEL = 1e-9
BESIDE_KNOT = 1e-12


@dataclasses.dataclass(frozen=True)
class PoseChecks:
    """What was found of n motions.

    Fields:
        verdict: (n,) `Verdict` flags; 0 is feasible.
        slack: (n, n_criteria) smallest of each criterion of `pose_slacks.flags`; NaN where unknown.
        gap: (n,) smallest distance between cables that can meet, m; infinite where none can.
    """

    verdict: np.ndarray
    slack: np.ndarray
    gap: np.ndarray

    def put(self, which: np.ndarray, others: "PoseChecks") -> None:
        """Write others into it.

        Args:
            which: (m,) their places.
            others: of m motions.
        """
        self.verdict[which], self.slack[which], self.gap[which] = others.verdict, others.slack, others.gap

    def rows(self, which: np.ndarray) -> "PoseChecks":
        """Some of them.

        Args:
            which: (m,) indices.

        Returns:
            those of m motions.
        """
        return PoseChecks(self.verdict[which], self.slack[which], self.gap[which])


@jax.jit
def _durations(arguments) -> jax.Array:
    return jax.vmap(duration)(*arguments)


def rows(segments: PoseSegment, which: np.ndarray) -> PoseSegment:
    """Some of many segments.

    Args:
        segments: leaves (n, ...).
        which: indices, or (n,) a mask.

    Returns:
        leaves (m, ...).
    """
    return jax.tree.map(lambda x: x[which], segments)


class PoseChecker:
    """Checks motions of one robot.

    Args:
        shared: robot, limits, amplitude.
        kind: of the motions.
        batch: how many are computed at a time.

    Fields:
        done: how many instants of motions were looked at so far, in the first look and in checks, and how many motions
            were checked.
    """

    def __init__(self, shared: PoseShared, kind: Kind = USUAL, *, batch: int = FEW) -> None:
        """Find what can meet."""
        self.shared, self.kind, self.batch = shared, kind, batch
        self.done, self._lock = {"first look": 0, "checks": 0, "motions": 0}, threading.Lock()
        found = contacts(shared.robot)
        self._platform, self._pairs = (found.sides, found.normal), tuple((int(i), int(j)) for i, j in found.pairs)
        self._flags = flags(shared.limits)
        self._size = float(np.linalg.norm(np.asarray(shared.robot.platform_points), axis=1).max())
        knots = np.asarray(shared.amplitude.knots)
        self._knots = np.sort(np.concatenate([knots - BESIDE_KNOT, knots + BESIDE_KNOT]))

    def _count(self, what: str, many: int) -> None:
        with self._lock:
            self.done[what] += many

    def durations(self, segments: PoseSegment, arcs: np.ndarray) -> np.ndarray:
        """Durations of segments.

        Args:
            segments: leaves (n, ...).
            arcs: (n,).

        Returns:
            (n,) s.
        """
        return in_batches(_durations, (segments, arcs.astype(float)), size=self.batch)

    def first_look(self, segments: PoseSegment, arcs: int, tau: np.ndarray, *, whole: bool = False) -> np.ndarray:
        """Smallest tension over some instants, by the fast kernel: what is negative here is infeasible.

        Args:
            segments: leaves (n, ...), all of this number of arcs.
            arcs: the number.
            tau: (m,) instants.
            whole: whether to look at all of them; else a segment is done after the first few that refute it.

        Returns:
            (n,) over its value at rest in P0; -inf beyond a singularity or where not finite.
        """
        lowest = np.full(len(segments.rate), np.inf)
        # One shape for all: instants in chunks, the last of them repeated.
        length = -(-len(tau) // CHUNK) * CHUNK
        shared = self.shared
        for chunk in np.pad(tau, (0, length - len(tau)), mode="edge").reshape(-1, CHUNK):
            alive = np.flatnonzero((lowest > -TOLERANCE) | whole)
            if not len(alive):
                break
            kernel = partial(smallest_tensions, shared.robot, shared.amplitude, float(arcs), chunk, kind=self.kind)
            some = segments if len(alive) == len(lowest) else rows(segments, alive)
            self._count("first look", len(alive) * CHUNK)
            # Few are not padded to many; where values are compared, not only refuted, all have one shape.
            size = FIRST * self.batch if whole or len(alive) > self.batch else self.batch // 2
            found = in_batches(kernel, some, size=size)
            lowest[alive] = np.minimum(lowest[alive], np.where(np.isnan(found), -np.inf, found))
        return lowest

    def check(self, segments: PoseSegment, arcs: np.ndarray, *, whole: bool = True) -> PoseChecks:
        """Check motions in full.

        Args:
            segments: leaves (n, ...), of the parity of `arcs`.
            arcs: (n,).
            whole: whether to go on where the motion itself is infeasible; else the rest is NaN there.

        Returns:
            the checks.
        """
        found = self.nothing(len(arcs))
        if not len(arcs):
            return found
        self._count("motions", len(arcs))
        moving = self._moving(segments, arcs)
        is_open = whole | (moving > -TOLERANCE).all(0)
        found.verdict[~is_open] = Verdict.SLACK_CABLE.value
        rest = np.flatnonzero(is_open)
        if len(rest):
            found.put(rest, self._still(rows(segments, rest), arcs[rest], moving[:, rest]))
        return found

    def nothing(self, count: int) -> PoseChecks:
        """Checks to be filled.

        Args:
            count: of motions.

        Returns:
            verdicts 0, the rest NaN.
        """
        return PoseChecks(np.zeros(count, int), np.full((count, len(self._flags)), np.nan), np.full(count, np.nan))

    def _still(self, segments: PoseSegment, arcs: np.ndarray, moving: np.ndarray) -> PoseChecks:
        # With what depends on the pose alone; `moving` is of `_moving`.
        kernel = partial(look_along, self.shared, self._platform, pairs=self._pairs, kind=self.kind)
        row, arc, looks = self._along(kernel, segments, arcs)
        still = self._narrowed(segments, arcs, (row, arc, looks.values), self._pairs)
        self._beside_singularities(segments, arcs, (row, arc, looks.values[:, 0]), moving)
        nearest, least = still[-1], np.concatenate([moving, still[:-1]])[order(self.shared.limits)]
        is_finite = np.isfinite(least).all(0) & ~np.isnan(nearest) & (self.durations(segments, arcs) > 0.0)
        verdict = np.zeros(len(arcs), int)
        for flag, value in zip(self._flags, least, strict=True):
            verdict |= np.where(value <= -TOLERANCE, flag.value, 0)
            verdict |= np.where(np.abs(value) <= TOLERANCE, Verdict.UNDECIDED.value, 0)
        step, item = np.nonzero(looks.wide)
        ends = [(arc[item] + (step + k) / SAMPLES) / arcs[row[item]] for k in (0, 1)]
        met, hit = self._followed(segments, arcs, row[item], ends)
        hit[row[looks.hit]] = True
        verdict |= Verdict.CABLE_CABLE.value * met | Verdict.CABLE_PLATFORM.value * hit
        verdict |= np.where(~met & (nearest < TOUCH * self._size), Verdict.UNDECIDED.value, 0)
        reasons = verdict & ~Verdict.UNDECIDED.value
        verdict = np.where(reasons != 0, reasons, verdict)
        return PoseChecks(
            np.where(is_finite, verdict, Verdict.NOT_FINITE.value),
            np.where(is_finite, least, np.nan).T,
            np.where(is_finite, nearest, np.nan),
        )

    def _moving(self, segments: PoseSegment, arcs: np.ndarray) -> np.ndarray:
        # (n_values, n) smallest values of the criteria that depend on the motion.
        kernel = partial(moving_along, self.shared, kind=self.kind)
        least = self._narrowed(segments, arcs, self._along(kernel, segments, arcs), None)
        # The motion may jump at a knot.
        places = np.meshgrid(np.arange(len(least)), np.arange(len(arcs)), self._knots, indexing="ij")
        which, row, tau = (x.ravel() for x in places)
        self._lower(least, segments, arcs, (which, row, tau, np.zeros(len(row))), None)
        return least

    def _beside_singularities(self, segments: PoseSegment, arcs: np.ndarray, seen: tuple, moving: np.ndarray) -> None:
        # Tensions have the determinant below the line: between samples in which that changes by much they are looked
        # for in smaller steps. `moving` is of `_moving`, and is written into.
        row, arc, determinant = seen
        low, high = (f(determinant[1:], determinant[:-1]) for f in (np.minimum, np.maximum))
        place, item = np.nonzero((low > 0.0) & (high > STEEP * low))
        which, pieces = np.repeat(row[item], PIECES), (np.arange(PIECES) + 0.5) / PIECES
        within = arc[item][:, None] + (place[:, None] + pieces) / SAMPLES
        tau, width = within.ravel() / arcs[which], 0.5 / (PIECES * SAMPLES * arcs[which])
        self._lower(moving, segments, arcs, (np.zeros(len(which), int), which, tau, width), None)

    def _along(self, kernel: Callable, segments: PoseSegment, arcs: np.ndarray) -> tuple[np.ndarray, np.ndarray, Any]:
        # Arc by arc: whose it is, which one, and what the kernel says, which has the arcs last.
        row = np.repeat(np.arange(len(arcs)), arcs)
        arc = np.arange(len(row)) - np.repeat(np.cumsum(arcs) - arcs, arcs)
        within = np.linspace(0.0, 1.0, SAMPLES + 1)
        self._count("checks", len(row) * (SAMPLES + 1))

        def batch(items):
            own, which = items
            return kernel(within, (rows(segments, own), arcs[own].astype(float), which.astype(float)))

        return row, arc, in_batches(batch, (row, arc), size=self.batch, axis=-1)

    def _narrowed(
        self,
        segments: PoseSegment,
        arcs: np.ndarray,
        seen: tuple[np.ndarray, np.ndarray, np.ndarray],
        pairs: tuple | None,
    ) -> np.ndarray:
        # (n_values, n): the smallest values, narrowed down around the samples of `_along` that may be near them.
        row, arc, values = seen
        least = np.minimum.reduceat(values.min(0), np.cumsum(arcs) - arcs, axis=1)
        place, which, item = _low_points(values, least[:, row])
        tau = (arc[item] + place / SAMPLES) / arcs[row[item]]
        self._lower(least, segments, arcs, (which, row[item], tau, 1.0 / (SAMPLES * arcs[row[item]])), pairs)
        return least

    def _lower(
        self, least: np.ndarray, segments: PoseSegment, arcs: np.ndarray, places: tuple, pairs: tuple | None
    ) -> None:
        # Put into `least`, (n_values, n), what lies around places: which value, row, instant, width.
        which, row, tau, width = places
        if len(row):
            items = (rows(segments, row), arcs[row].astype(float), tau, width, which.astype(np.int32))
            kernel = partial(narrowed, self.shared, pairs=pairs, kind=self.kind)
            np.minimum.at(least, (which, row), in_batches(kernel, items, size=self.batch))

    def _followed(
        self, segments: PoseSegment, arcs: np.ndarray, row: np.ndarray, ends: list[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        # Whether cables cross, and whether one sweeps over the platform, in steps that are halved.
        met, hit = (np.zeros(len(segments.rate), bool) for _ in range(2))
        seen = [self._glances(segments, arcs, row, tau) for tau in ends] if len(row) else []
        for level in range(HALVINGS + 1):
            if not len(row):
                break
            (gap, view), (next_gap, next_view) = seen
            turns = _turns_much(gap, next_gap) | _turns_much(view, next_view)
            closed = ~turns if level < HALVINGS else np.ones(len(row), bool)
            met[row[closed & cables_cross(gap, next_gap).any(1)]] = True
            hit[row[closed & platform_hit(*self._platform, view, next_view).any(1)]] = True
            row, ends = row[~closed], [end[~closed] for end in ends]
            seen = [(gap[~closed], view[~closed]), (next_gap[~closed], next_view[~closed])]
            if len(row):
                middle = 0.5 * (ends[0] + ends[1])
                between = self._glances(segments, arcs, row, middle)
                seen = [_joined(seen[0], between), _joined(between, seen[1])]
                ends = [np.concatenate([ends[0], middle]), np.concatenate([middle, ends[1]])]
                row = np.concatenate([row, row])
        return met, hit

    def _glances(
        self, segments: PoseSegment, arcs: np.ndarray, row: np.ndarray, tau: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        kernel = partial(glances, self.shared, pairs=self._pairs, kind=self.kind)
        gap, view = in_batches(kernel, (rows(segments, row), arcs[row].astype(float), tau), size=self.batch)
        return gap, view / np.linalg.norm(view, axis=2, keepdims=True)


def _low_points(values: np.ndarray, least: np.ndarray) -> tuple[np.ndarray, ...]:
    # Samples (m, n_values, n) no larger than their neighbours, where a parabola of twice the bend could reach the
    # smallest value (n_values, n).
    falls = values[1:] < values[:-1]
    side = np.ones_like(falls[:1])
    is_low = np.concatenate([side, falls]) & np.concatenate([~falls, side])
    is_low &= np.ptp(values, axis=0) > LEVEL
    place, which, row = np.nonzero(is_low)
    here, last = values[place, which, row], len(values) - 1
    before, after = (values[np.clip(place + k, 0, last), which, row] for k in (-1, 1))
    bend = before - 2.0 * here + after
    reaches = np.isfinite(bend) & (here - 0.25 * bend <= least[which, row])
    return place[reaches], which[reaches], row[reaches]


def _joined(first, second):
    return tuple(np.concatenate(pair) for pair in zip(first, second, strict=True))


def _turns_much(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    inner = (before * after).sum(2)
    sizes = (before * before).sum(2) * (after * after).sum(2)
    return ((inner < 0.0) | (inner**2 < LEAST_COSINE**2 * sizes)).any(1)
