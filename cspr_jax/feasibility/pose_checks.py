"""Whether a platform's motions are feasible, with margins: samples, finer where it matters, and what happens between.

A first look takes 64 samples an arc. Around the three smallest samples of every criterion, and of the distance of
every pair of cables, the smallest value is then narrowed down; between samples, cables are followed with halved
steps until they turn little. A margin within the tolerance of zero is undecided: nothing here is a proof.
"""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.feasibility.interference import Contacts, cables_cross, contacts, gaps, platform_hit, views
from cspr_jax.feasibility.narrowing import narrowed
from cspr_jax.feasibility.pose_kernel import smallest_tensions
from cspr_jax.feasibility.pose_slacks import PoseShared, flags, pose_slacks
from cspr_jax.feasibility.verdicts import Verdict
from cspr_jax.grids import in_batches
from cspr_jax.trajectories.pose_segment import PoseSegment, duration, motion

# Few instants are computed in small batches: a batch is always full.
BATCHES = (512, 4096)
# Instants of one call of the fast kernel, and segments.
CHUNK, KERNEL_BATCH = 32, 2048
SAMPLES = 64  # an arc
# Steps between which a gap or a cable turns by more than this are halved, at most so often.
LEAST_COSINE, HALVINGS = 0.8, 12
TOLERANCE = 1e-7
TOUCH = 1e-6  # of the platform's size


@dataclasses.dataclass(frozen=True)
class PoseChecks:
    """What was found of n motions.

    Fields:
        verdict: (n,) `Verdict` flags; 0 is feasible.
        slack: (n, n_criteria) smallest of each criterion of `pose_slacks.flags`; NaN where not finite.
        gap: (n,) smallest distance between cables that can meet, m.
    """

    verdict: np.ndarray
    slack: np.ndarray
    gap: np.ndarray


def _lowest(shared: PoseShared, arcs: float, tau: np.ndarray, segments: PoseSegment, *, variable: bool) -> Array:
    sign = jnp.sign(shared.conditioning)
    return smallest_tensions(shared.robot, sign, shared.amplitude, arcs, tau, segments, variable=variable)


@partial(jax.jit, static_argnames="variable")
def _everything(shared: PoseShared, pairs: Array, arguments, *, variable: bool) -> tuple[Array, Array, Array]:
    def one(segment, arcs, tau):
        pose = motion(segment, shared.amplitude, arcs, tau, variable=variable)
        where = (shared.robot, pose.position, pose.rotation)
        slack = pose_slacks(shared, pose, shared.robot.gravity / segment.rate)
        return slack, gaps(shared.robot, pairs, *where[1:]), views(*where)

    return jax.vmap(one)(*arguments)


def _values(slack: np.ndarray, gap: np.ndarray) -> np.ndarray:
    return np.concatenate([slack, np.linalg.norm(gap, axis=2)], axis=1)


def _size(count: int) -> int:
    return BATCHES[0] if count <= 2 * BATCHES[0] else BATCHES[1]


@jax.jit
def _durations(arguments) -> Array:
    return jax.vmap(duration)(*arguments)


class PoseChecker:
    """Checks motions of one robot.

    Args:
        shared: robot, limits, amplitude, reference.
        variable: whether positions are hypocycloids of variable amplitude.
    """

    def __init__(self, shared: PoseShared, *, variable: bool = True) -> None:
        """Find what can meet."""
        self.shared, self.variable = shared, variable
        self._contacts: Contacts = contacts(shared.robot)
        self._flags = flags(shared.limits)
        self._size = float(np.linalg.norm(np.asarray(shared.robot.platform_points), axis=1).max())

    def durations(self, segments: PoseSegment, arcs: np.ndarray) -> np.ndarray:
        """Durations of segments.

        Args:
            segments: leaves (n, ...).
            arcs: (n,).

        Returns:
            (n,) s.
        """
        return in_batches(_durations, (segments, arcs.astype(float)), size=BATCHES[0])

    def first_look(self, segments: PoseSegment, arcs: int, tau: np.ndarray) -> np.ndarray:
        """Smallest tension over some instants, by the fast kernel: what is negative here is infeasible.

        Args:
            segments: leaves (n, ...), all of this number of arcs.
            arcs: the number.
            tau: (m,) instants.

        Returns:
            (n,) over its value at rest in P0; -inf beyond a singularity or where not finite.
        """
        shared, count = self.shared, len(segments.rate)
        # One shape for all: instants in chunks, the last of them repeated.
        whole = -(-len(tau) // CHUNK) * CHUNK
        chunks = np.pad(tau, (0, whole - len(tau)), mode="edge").reshape(-1, CHUNK)
        lowest = np.full(count, np.inf)
        for chunk in chunks:
            alive = np.flatnonzero(lowest > -TOLERANCE)
            if not len(alive):
                break
            kernel = partial(_lowest, shared, float(arcs), chunk, variable=self.variable)
            found = in_batches(kernel, jax.tree.map(lambda x, a=alive: x[a], segments), size=KERNEL_BATCH)
            lowest[alive] = np.minimum(lowest[alive], np.where(np.isnan(found), -np.inf, found))
        return lowest

    def check(self, segments: PoseSegment, arcs: np.ndarray) -> PoseChecks:
        """Check motions in full.

        Args:
            segments: leaves (n, ...), of the parity of `arcs`.
            arcs: (n,).

        Returns:
            the checks.
        """
        parts = [self._check_one(jax.tree.map(lambda x, i=i: x[i], segments), int(p)) for i, p in enumerate(arcs)]
        return PoseChecks(*(np.array(column) for column in zip(*parts, strict=True)))

    def _all(self, segment: PoseSegment, arcs: int, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        items = jax.tree.map(lambda x: np.broadcast_to(x, (len(tau), *np.shape(x))), (segment, float(arcs)))
        kernel = partial(_everything, self.shared, self._contacts.pairs, variable=self.variable)
        return in_batches(kernel, (*items, tau), size=_size(len(tau)))

    def _check_one(self, segment: PoseSegment, arcs: int) -> tuple[int, np.ndarray, float]:
        tau = np.linspace(0.0, 1.0, SAMPLES * arcs + 1)
        slack, gap, view = self._all(segment, arcs, tau)
        values = _values(slack, gap)
        if not (np.isfinite(values).all() and float(duration(segment, jnp.asarray(float(arcs)))) > 0.0):
            nothing = np.full(slack.shape[1], np.nan)
            return Verdict.NOT_FINITE.value, nothing, np.nan
        smallest = narrowed(lambda points: _values(*self._all(segment, arcs, points)[:2]), tau, values)
        count = slack.shape[1]
        verdict, least, nearest = 0, smallest[:count], float(smallest[count:].min(initial=np.inf))
        for flag, value in zip(self._flags, least, strict=True):
            verdict |= flag.value if value <= -TOLERANCE else Verdict.UNDECIDED.value if value <= TOLERANCE else 0
        met, hit = self._followed(segment, arcs, tau, gap, view)
        verdict |= Verdict.CABLE_CABLE.value * met | Verdict.CABLE_PLATFORM.value * hit
        if not met and nearest < TOUCH * self._size:
            verdict |= Verdict.UNDECIDED.value
        if verdict & ~Verdict.UNDECIDED.value:
            verdict &= ~Verdict.UNDECIDED.value
        return verdict, least, nearest

    def _followed(
        self, segment: PoseSegment, arcs: int, tau: np.ndarray, gap: np.ndarray, view: np.ndarray
    ) -> tuple[bool, bool]:
        # Whether cables cross, and whether one sweeps over the platform, with steps halved where they turn much.
        for _ in range(HALVINGS):
            size = np.linalg.norm(gap, axis=2)
            turn = (gap[1:] * gap[:-1]).sum(2) / np.maximum(size[1:] * size[:-1], 1e-300)
            swing = (view[1:] * view[:-1]).sum(2)
            wide = np.flatnonzero((turn < LEAST_COSINE).any(1) | (swing < LEAST_COSINE).any(1))
            if not len(wide):
                break
            middle = 0.5 * (tau[wide] + tau[wide + 1])
            _, new_gap, new_view = self._all(segment, arcs, middle)
            tau = np.insert(tau, wide + 1, middle)
            gap, view = np.insert(gap, wide + 1, new_gap, axis=0), np.insert(view, wide + 1, new_view, axis=0)
        met = bool(cables_cross(gap[:-1], gap[1:]).any())
        return met, bool(platform_hit(self._contacts.sides, self._contacts.normal, view[:-1], view[1:]).any())
