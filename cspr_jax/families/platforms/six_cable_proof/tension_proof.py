"""Proofs of the tensions and the determinant of a platform's motions, also between samples.

Each block of a motion (`tension_blocks`) is proved, refuted by a sample, or halved. The motion is then

    proved       if every block is proved: no cable slack, no singularity, limits on the motion met
    refuted      if a sample breaks a criterion by more than the tolerance
    undecided    if a block stays open although its slack is enclosed within half the tolerance, or after many halvings

A touched limit counts as met: the slacks of limits are those of `problem.touchable`, and undecided only within
rounding.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.families.platforms.platform_segment import PlatformSegment, take_segments
from cspr_jax.families.platforms.six_cable_proof.tension_blocks import (
    BASIC,
    TensionBounds,
    TensionRange,
    of_motion,
    tension_blocks,
    tension_ranges,
)
from cspr_jax.families.platforms.six_cable_proof.work_list import LIMITS_UNDECIDED, BlockBounds, WorkList
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds import chebyshev
from cspr_jax.numerics.shapes import Bool, Float, Num
from cspr_jax.numerics.tolerances import SIX_CABLES_UNDECIDED
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.wrench_lanes import CABLES
from cspr_jax.schema.limits import LIMITS
from cspr_jax.verification.bounds.blocks import Blocks, growing, parts_of_arcs

# Numbers of blocks of an arc at first, from rest and between poses, where orientations turn faster. If margins are
# refined from the samples of blocks, the number is fixed; for verdicts alone it grows from the first to the second
# number with the amplitude, see `blocks.growing`.
WITH_MARGINS = (3, 6)
FROM_REST = (1.0, 5.0)
BETWEEN = (6.0, 6.0)
# Number of orders of the cables that are tried while rounding keeps a block open.
ORDERS = 6
MATTERS = 0.1  # rounding matters above this fraction of the total allowance


@dataclasses.dataclass(frozen=True)
class TensionProof:
    """Proofs for n motions; criteria are those of `tension_blocks.TensionBounds`.

    Fields:
        is_proved: (n,) whether every criterion is always met.
        is_refuted: (n,) whether a criterion is broken at a sample.
        attained: (n, n_criteria) smallest slacks at the samples.
        bound: (n, n_criteria) proved lower bounds; NaN for motions that are not proved.
        refuted_tau: (n,) tau at which a criterion is violated most; NaN if none is.
        motion: (k,) index of the motion of each of the first blocks.
        first: bounds of the first blocks.
    """

    is_proved: np.ndarray
    is_refuted: np.ndarray
    attained: np.ndarray
    bound: np.ndarray
    refuted_tau: np.ndarray
    motion: np.ndarray
    first: BlockBounds


class _Order(NamedTuple):
    # The robot with its cables in another order, and the sign that this order gives to determinants.
    problem: Problem
    sign: float
    cables: list[int]


class Certifier:
    """Certifier of the tensions, the determinant and the limits on the motion of one robot on six cables.

    Args:
        problem: robot, limits and amplitude function.
        batch: number of blocks computed at a time.
        count_samples: called with the number of computed samples.
    """

    def __init__(
        self, problem: Problem, kind: PlatformMotionKind, *, batch: int, count_samples: Callable[[int], None]
    ) -> None:
        """Choose orders of the cables."""
        problem = touchable(problem)
        self._kind, self._batch, self._count = kind, batch, count_samples
        self._knots, self._orders = np.asarray(problem.amplitude.knots), _orders(problem)
        self._is_limit = np.arange(BASIC + len(of_motion(problem))) >= BASIC
        ramp = FROM_REST if kind.from_rest else BETWEEN
        self._parts = WITH_MARGINS[not kind.from_rest], growing(problem.amplitude, ramp, ramp)

    def prove(
        self,
        segments: PlatformSegment,
        arcs: Num[np.ndarray, "n"],
        *,
        near: float = 0.0,
        margins: bool = False,
        ignored: Bool[np.ndarray, "n_criteria"] | None = None,
    ) -> TensionProof:
        """Prove motions, or refute them."""
        blocks = parts_of_arcs(arcs, self._knots, self._parts[not margins])
        motions = segments, arcs, determinant_at_rest(self._orders[0].problem, segments)

        def bounds_of(part: Blocks, _: int) -> BlockBounds:
            bounds = self._bounds_in_orders(part, motions, margins=margins)
            tau = part.times(chebyshev.nodes()[:, None] if margins else np.asarray(bounds.offset)[None])
            nodes, bound = np.asarray(bounds.nodes), np.asarray(bounds.bound)
            return BlockBounds(
                nodes, bound, tau, lambda attained: bound[0] >= near * np.maximum(attained[part.row, 0], 0.0)
            )

        work = WorkList(
            arcs,
            np.where(self._is_limit, LIMITS_UNDECIDED if margins else SIX_CABLES_UNDECIDED, SIX_CABLES_UNDECIDED),
            ignored,
        )
        first = work.run(blocks, bounds_of)
        is_proved = ~work.is_refuted & ~work.is_stuck
        proof = TensionProof(is_proved, work.is_refuted, work.attained, work.bound, work.refuted_tau, blocks.row, first)
        if not margins:
            self._prove_again(proof, segments, arcs, np.flatnonzero(work.is_stuck & ~work.is_refuted), ignored)
        return proof

    def _prove_again(
        self, proof: TensionProof, segments: PlatformSegment, arcs: np.ndarray, stuck: np.ndarray, ignored
    ) -> None:
        # Reduced values are in single precision, which cannot decide limits that are nearly touched.
        is_near = (proof.attained[stuck][:, self._is_limit] < SIX_CABLES_UNDECIDED).any(1)
        is_near &= (proof.attained[stuck][:, ~self._is_limit] > SIX_CABLES_UNDECIDED).all(1)
        if is_near.any():
            again = stuck[is_near]
            closer = self.prove(take_segments(segments, again), arcs[again], margins=True, ignored=ignored)
            for name in ("is_proved", "is_refuted", "attained", "bound", "refuted_tau"):
                getattr(proof, name)[again] = getattr(closer, name)

    def _bounds_in_orders(self, blocks: Blocks, motions, *, margins: bool) -> TensionBounds:
        bounds = self.bounds(0, blocks, motions, margins=margins, reduced=not margins)
        for k in range(1, len(self._orders)):
            # These blocks are still open because the first three cables lie nearly in one plane.
            open_ones = np.flatnonzero(_rounding_matters(bounds) & ~(bounds.bound > SIX_CABLES_UNDECIDED).all(0))
            if not len(open_ones):
                break
            better = self.bounds(k, blocks.part(open_ones), motions, margins=margins, reduced=not margins)
            # Replace the values at nodes as well: if these cables lie in one plane, the values are rounding errors,
            # which could refute.
            surer = better.rounding < bounds.rounding[open_ones]
            bounds.nodes[:, :, open_ones[surer]] = better.nodes[:, :, surer]
            bounds.offset[open_ones[surer]] = better.offset[surer]
            bounds.bound[:, open_ones] = np.fmax(bounds.bound[:, open_ones], better.bound)
            bounds.rounding[open_ones] = np.minimum(bounds.rounding[open_ones], better.rounding)
            bounds.allowed[open_ones] = np.minimum(bounds.allowed[open_ones], better.allowed)
        return bounds

    def bounds(self, order: int, blocks: Blocks, motions, *, margins: bool, reduced: bool = False) -> TensionBounds:
        """Bounds on blocks."""
        problem, items = self._items(order, blocks, motions)
        kernel = partial(tension_blocks, problem, np.ones(()), kind=self._kind, margins=margins, reduced=reduced)
        return in_batches(kernel, items, batch_size=self._batch, axis=-1)

    def _items(self, order: int, blocks: Blocks, motions) -> tuple[Problem, tuple]:
        # Return the robot with its cables in a given order, and its blocks in the form for kernels.
        segments, arcs, at_rest = motions
        problem, sign, _ = self._orders[order]
        self._count(len(blocks.row) * (chebyshev.DEGREE + 1))
        motion_items = take_segments(segments, blocks.row), arcs[blocks.row].astype(float), sign * at_rest[blocks.row]
        return problem, (*motion_items, blocks.start, blocks.stop)

    def ranges(
        self, blocks: Blocks, segments: PlatformSegment, arcs: Num[np.ndarray, "n"]
    ) -> tuple[Float[np.ndarray, "k n_cables"], Float[np.ndarray, "k n_cables"]]:
        """Ranges of the tensions on blocks."""
        motions = segments, arcs, determinant_at_rest(self._orders[0].problem, segments)
        count = len(blocks.row)
        low, high = np.full((count, CABLES), -np.inf), np.full((count, CABLES), np.inf)
        remaining = np.arange(count)
        for k, order in enumerate(self._orders):
            problem, items = self._items(k, blocks.part(remaining), motions)
            kernel = partial(tension_ranges, problem._replace(limits=Limits()), np.ones(()), kind=self._kind)
            bounds = in_batches(kernel, items, batch_size=self._batch, axis=-1)
            index = np.ix_(remaining, np.array(order.cables))
            low[index], high[index] = np.fmax(low[index], bounds.low.T), np.fmin(high[index], bounds.high.T)
            # As in `_bounds_in_orders`, continue with blocks in which the first three cables lie nearly in one plane.
            remaining = remaining[_rounding_matters(bounds)]
            if not len(remaining):
                break
        return low, high


def _rounding_matters(bounds: TensionBounds | TensionRange) -> np.ndarray:
    # Tell where rounding matters: elsewhere only shorter blocks give better bounds, not another order of the cables.
    rounding, allowed = np.asarray(bounds.rounding), np.asarray(bounds.allowed)
    return (rounding > 0.25 * SIX_CABLES_UNDECIDED) & (rounding >= MATTERS * allowed)


def _orders(problem: Problem) -> list[_Order]:
    # The robot's own order comes first, then the orders whose first, third and fifth ray span the largest volumes at
    # rest, as far below the spools as their largest coordinate.
    robot = problem.robot
    base, arms = np.asarray(robot.base_points), np.asarray(robot.platform_points)
    rays = arms + np.array([0.0, 0.0, float(np.abs(base).max())]) - base
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    threes = sorted(
        itertools.combinations(range(CABLES), 3), key=lambda three: -abs(float(np.linalg.det(rays[list(three)])))
    )
    orders = [list(range(CABLES))]
    for three in threes[: ORDERS - 1]:
        others = [k for k in range(CABLES) if k not in three]
        orders.append([k for pair in zip(three, others, strict=True) for k in pair])
    return [_Order(_reordered(problem, order), _sign(order), order) for order in orders]


def _sign(order: list[int]) -> float:
    return float((-1) ** sum(a > b for a, b in itertools.combinations(order, 2)))


def _reordered(problem: Problem, order: list[int]) -> Problem:
    # Let no cables share joints, so that one compiled function serves every order.
    robot, limits = problem.robot, problem.limits
    points = {name: np.asarray(getattr(robot, name))[order] for name in ("base_points", "platform_points")}
    changed = dataclasses.replace(robot, **points, joints=tuple(range(CABLES)), limits=Limits())
    each = {limit.name: getattr(limits, limit.name) for limit in LIMITS}
    values: dict[str, Any] = {
        limit.name: np.asarray(each[limit.name])[order]
        if limit.per_cable and each[limit.name] is not None
        else each[limit.name]
        for limit in LIMITS
    }
    return problem._replace(robot=changed, limits=Limits(**values))


def determinant_at_rest(problem: Problem, segments: PlatformSegment) -> Float[np.ndarray, "n"]:
    """Determinant of the Jacobian J (3.5) at rest in P0, with the sign of `wrench_lanes.balance`."""
    robot, (depths, inverse) = problem.robot, np.unique(np.asarray(segments.center)[:, 2], return_inverse=True)
    arms = np.asarray(robot.platform_points)
    forces = np.asarray(robot.base_points) - arms - np.array([0.0, 0.0, 1.0]) * depths[:, None, None]
    wrenches = np.concatenate([forces, np.cross(arms, forces)], axis=2)
    return -np.linalg.det(wrenches)[inverse.ravel()]
