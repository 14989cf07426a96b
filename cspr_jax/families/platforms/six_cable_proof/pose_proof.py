"""Proofs of contacts, depth and limits on the pose, which depend on a platform's pose alone.

A motion is clear if all of its blocks are clear (`pose_blocks`). It has a contact if two cables, or a cable and the
platform, are proved to touch between two times (`cable_contacts`). Otherwise, after many halvings, it is undecided.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial

import jax
import numpy as np
from jax import Array

from cspr_jax.families.platforms.platform_segment import PlatformSegment, take_segments
from cspr_jax.families.platforms.platform_segment_lanes import state
from cspr_jax.families.platforms.six_cable_proof.cable_contacts import CablesOfStep, cables_hit, cables_meet
from cspr_jax.families.platforms.six_cable_proof.complex_bounds import middle_of, phase_beside
from cspr_jax.families.platforms.six_cable_proof.pose_blocks import OFFSETS, PoseBounds, of_pose, pose_blocks
from cspr_jax.families.platforms.six_cable_proof.work_list import LIMITS_UNDECIDED, BlockBounds, WorkList
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Bool, Float, Num
from cspr_jax.numerics.tolerances import SIX_CABLES_UNDECIDED
from cspr_jax.robots.contacts import interference_lanes
from cspr_jax.robots.contacts.interference import contacts
from cspr_jax.robots.statics.wrench_lanes import cable_lanes
from cspr_jax.verification.bounds.blocks import Blocks, growing, parts_of_arcs

# Number of blocks per arc at first, if margins are wanted.
PARTS = 8
# The same for verdicts alone, as in `tension_proof`: at cusps, and halfway between two cusps, where platforms are
# fastest.
FROM_REST, BETWEEN = ((0.7, 3.7), (0.7, 15.7)), ((4.0, 4.0), (11.0, 11.0))
TOUCH = 1e-9  # distances below this fraction of the platform's radius are undecided
NEAR_CONTACT = 5  # contacts are searched for after this many halvings of a block
# Times halfway between those of a block, from -1 to 1.
MIDDLES = 0.5 * (OFFSETS[1:] + OFFSETS[:-1])


@dataclasses.dataclass(frozen=True)
class PoseProof:
    """Proofs for n motions; criteria are the depth below the spools and the given limits on the pose.

    Fields:
        is_proved: (n,) whether there is no contact at any time, and every criterion is always met.
        is_refuted: (n,) whether there is a contact, or a criterion is broken at some time.
        met: (n,) whether two cables touch.
        hit: (n,) whether a cable touches the platform.
        attained: (n, n_criteria + 1) smallest slacks at the samples, and smallest distance between cables.
        bound: (n, n_criteria) proved lower bounds; NaN for motions that are not proved.
        refuted_tau: (n,) tau at which a criterion is violated most, or in the middle of a step with a contact; NaN if
            there is neither.
        motion: (k,) index of the motion of each of the first blocks.
        first: bounds of the first blocks.
    """

    is_proved: np.ndarray
    is_refuted: np.ndarray
    met: np.ndarray
    hit: np.ndarray
    attained: np.ndarray
    bound: np.ndarray
    refuted_tau: np.ndarray
    motion: np.ndarray
    first: BlockBounds


@partial(jax.jit, static_argnames="kind")
def cables_beside(
    problem: Problem, items, *, kind: PlatformMotionKind
) -> tuple[Float[Array, "n n_cables 3"], Float[Array, "n n_cables 3"]]:
    """Cables of many blocks, each at one time beside the middle of its block."""
    segments, arcs, middles, off = items
    phase = phase_beside(middle_of(problem.amplitude, middles), segments.sense, arcs, off)
    current = state(segments, arcs, phase, kind)
    cables = cable_lanes(problem.robot, current.position, current.rotation)
    return interference_lanes.as_arrays(cables.rays, interference_lanes.cable_directions(cables, current.rotation))


class PoseCertifier:
    """Certifier of contacts, depth and limits on the pose along motions of one robot on six cables.

    Args:
        problem: robot, limits and amplitude function.
        batch: number of blocks computed at a time.
        count_samples: called with the number of computed samples.

    Fields:
        pairs: pairs of cables that can touch.
    """

    def __init__(
        self, problem: Problem, kind: PlatformMotionKind, *, batch: int, count_samples: Callable[[int], None]
    ) -> None:
        """Find which cables can touch each other or the platform."""
        self._problem, self._kind, self._batch, self._count = touchable(problem), kind, batch, count_samples
        near, points = contacts(problem.robot), np.asarray(problem.robot.platform_points)
        self.pairs = tuple((int(i), int(j)) for i, j in near.pairs)
        self._near, self._arms = near, np.linalg.norm(points, axis=1)
        self._knots = np.asarray(problem.amplitude.knots)
        self._undecided = np.array([SIX_CABLES_UNDECIDED] + [LIMITS_UNDECIDED] * len(of_pose(problem)))
        self._parts = PARTS, growing(problem.amplitude, *(FROM_REST if kind.from_rest else BETWEEN))

    def prove(
        self,
        segments: PlatformSegment,
        arcs: Num[np.ndarray, "n"],
        *,
        margins: bool = False,
        ignored: Bool[np.ndarray, "n_criteria"] | None = None,
    ) -> PoseProof:
        """Prove motions, or refute them."""
        blocks, work = (
            parts_of_arcs(arcs, self._knots, self._parts[not margins]),
            WorkList(arcs, self._undecided, ignored),
        )
        met, hit, touch = np.zeros(len(arcs), bool), np.zeros(len(arcs), bool), TOUCH * float(self._arms.max())

        def bounds_of(part: Blocks, level: int) -> BlockBounds:
            bounds = self._bounds(part, segments, arcs, margins=margins)
            is_clear = np.asarray(bounds.clear) > touch
            doubtful = np.flatnonzero(~is_clear)
            if level >= NEAR_CONTACT and len(doubtful):
                doubtful_blocks = part.part(doubtful)
                cables = self._cables(doubtful_blocks, np.asarray(bounds.deviations)[:, doubtful], (segments, arcs))
                base, between = np.asarray(self._problem.robot.base_points), doubtful_blocks.times(MIDDLES[:, None])
                for flag, step in (
                    (met, cables_meet(base, self._near.pairs, cables)),
                    (hit, cables_hit(self._near.sides, self._near.normal, cables)),
                ):
                    meeting = np.flatnonzero(step >= 0)
                    flag[doubtful_blocks.row[meeting]] = True
                    work.refute(doubtful_blocks.row[meeting], between[step[meeting], meeting])
            nodes, bound = np.asarray(bounds.nodes), np.asarray(bounds.slacks)
            tau = part.times(OFFSETS[:, None] if margins else np.asarray(bounds.offset)[None])
            return BlockBounds(nodes, bound, tau, lambda _: is_clear)

        first = work.run(blocks, bounds_of)
        is_proved = ~work.is_refuted & ~work.is_stuck
        results = work.attained, work.bound, work.refuted_tau
        return PoseProof(is_proved, work.is_refuted, met, hit, *results, blocks.row, first)

    def _bounds(self, blocks: Blocks, segments: PlatformSegment, arcs: np.ndarray, *, margins: bool) -> PoseBounds:
        self._count(len(blocks.row) * len(OFFSETS))
        kernel = partial(
            pose_blocks,
            self._problem,
            (self._near.sides, self._near.normal),
            np.ones(()),
            pairs=self.pairs,
            kind=self._kind,
            margins=margins,
        )
        items = (take_segments(segments, blocks.row), arcs[blocks.row].astype(float), blocks.start, blocks.stop)
        return in_batches(kernel, items, batch_size=self._batch, axis=-1)

    def _cables(self, blocks: Blocks, deviations: np.ndarray, motions) -> CablesOfStep:
        # Return the cables at the times of blocks.
        segments, arcs = motions
        block = np.tile(np.arange(len(blocks.row)), len(OFFSETS))
        motion, middle = blocks.row[block], 0.5 * (blocks.start + blocks.stop)[block]
        items = (
            take_segments(segments, motion),
            arcs[motion].astype(float),
            middle,
            blocks.times(OFFSETS[:, None]).ravel() - middle,
        )
        vectors = in_batches(partial(cables_beside, self._problem, kind=self._kind), items, batch_size=self._batch)
        rays, platform_rays = (x.reshape(len(OFFSETS), len(blocks.row), *x.shape[1:]) for x in vectors)
        centre, arm, platform = deviations
        return CablesOfStep(rays, platform_rays, centre[:, None] + arm[:, None] * self._arms, platform)
