"""Proofs about the tensions and the determinant of a platform's motions, between the instants too.

Every block of a motion (`tension_blocks`) is proved, or refuted by an instant, or halved. So is the motion:

    proved       if every block is: no cable slack, no singularity, limits on the motion met
    refuted      if some instant breaks a criterion by more than the tolerance
    undecided    if a block still holds zero where its slack is known to half the tolerance, or after many halvings

A limit that is touched counts as met, as with point masses: limits are allowed twice the tolerance.
"""

import dataclasses
import itertools
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.arithmetic import chebyshev
from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.feasibility.platform.blocks import HALVINGS, OPEN, Blocks, parts_of_arcs
from cspr_jax.feasibility.platform.motions import rows
from cspr_jax.feasibility.platform.tension_blocks import BlockBounds, of_motion, tension_blocks
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.wrench_lanes import CABLES
from cspr_jax.schema.limits import LIMITS
from cspr_jax.trajectories.platform_segment import Kind, PoseSegment

TOLERANCE = 1e-6
# Parts of an arc that are looked at first: an orientation that goes from one pose to another turns faster.
FROM_REST, BETWEEN = 3, 8
# Orders of the cables that are tried, one after the other, where rounding keeps a block open.
ORDERS = 6
BASIC = 2  # criteria that are no limits


@dataclasses.dataclass(frozen=True)
class TensionProof:
    """Proofs about n motions; criteria are those of `tension_blocks.BlockBounds`.

    Fields:
        is_proved: (n,) every criterion is met at every instant.
        is_refuted: (n,) some criterion is broken at an instant.
        attained: (n, n_criteria) smallest slacks at the instants that were looked at.
        bound: (n, n_criteria) proved lower bounds; -inf of motions that are refuted.
        instant: (n,) tau of the smallest slack of all.
        blocks: those that were looked at first.
        nodes: (m, n_criteria, k) of theirs.
    """

    is_proved: np.ndarray
    is_refuted: np.ndarray
    attained: np.ndarray
    bound: np.ndarray
    instant: np.ndarray
    blocks: Blocks
    nodes: np.ndarray


class _Order(NamedTuple):
    # The same robot, its cables in another order, and the sign that this gives to determinants.
    problem: Problem
    sign: float


class Certifier:
    """Certifier of motions of one robot on six cables.

    Args:
        problem: robot, limits, amplitude.
        kind: of the motions.
        batch: how many blocks are computed at a time.

    Fields:
        done: how many blocks were looked at so far.
    """

    def __init__(self, problem: Problem, kind: Kind, *, batch: int) -> None:
        """Order the cables."""
        self._kind, self._batch = kind, batch
        self._knots = np.asarray(problem.amplitude.knots)
        self._orders = _orders(problem)
        self._allowed = 2.0 * TOLERANCE * (np.arange(BASIC + len(of_motion(problem))) >= BASIC)
        self.done = 0

    def prove(
        self, segments: PoseSegment, arcs: np.ndarray, *, near: float = 0.0, margins: bool = False
    ) -> TensionProof:
        """Prove motions, or refute them.

        Args:
            segments: leaves (n, ...), of the parity of `arcs`.
            arcs: (n,).
            near: part of the smallest slack that is attained of taut cables below which no bound of it may stay.
            margins: whether the nodes of the normalised determinant are wanted.

        Returns:
            the proofs.
        """
        blocks = first = parts_of_arcs(arcs, self._knots, FROM_REST if self._kind.from_rest else BETWEEN)
        state = _State(len(arcs), self._allowed)
        nodes = np.zeros((chebyshev.DEGREE + 1, len(self._allowed), 0))
        standing = _standing(self._orders[0].problem, segments)
        for level in range(HALVINGS + 1):
            if not len(blocks.row):
                break
            found = self._looked_at(blocks, (segments, arcs, standing), margins=margins)
            nodes = nodes if level else np.asarray(found.nodes)
            is_open = state.told(blocks, found, near, last=level == HALVINGS)
            crowded = np.bincount(blocks.row[is_open], minlength=len(arcs)) > OPEN * arcs
            state.is_stuck |= crowded
            is_open &= ~crowded[blocks.row]
            blocks = blocks.some(is_open).halves()
        bound = np.where(
            (state.is_refuted | state.is_stuck)[:, None], np.minimum(state.bound, state.attained), state.bound
        )
        is_proved = ~state.is_refuted & ~state.is_stuck
        return TensionProof(is_proved, state.is_refuted, state.attained, bound, state.instant, first, nodes)

    def _looked_at(self, blocks: Blocks, motions, *, margins: bool) -> BlockBounds:
        found = self._bounds(0, blocks, motions, margins=margins)
        for k in range(1, len(self._orders)):
            # What is not proved because the first three cables lie nearly in one plane.
            open_ones = np.flatnonzero((found.rounding > 0.25 * TOLERANCE) & ~(found.bound > TOLERANCE).all(0))
            open_ones = open_ones[(found.nodes[:, :, open_ones] > -TOLERANCE).all((0, 1))]
            if not len(open_ones):
                break
            better = self._bounds(k, blocks.some(open_ones), motions, margins=margins)
            found.bound[:, open_ones] = np.maximum(found.bound[:, open_ones], better.bound)
            found.rounding[open_ones] = np.minimum(found.rounding[open_ones], better.rounding)
        return found

    def _bounds(self, order: int, blocks: Blocks, motions, *, margins: bool) -> BlockBounds:
        segments, arcs, standing = motions
        problem, sign = self._orders[order]
        self.done += len(blocks.row)
        own = rows(segments, blocks.row), arcs[blocks.row].astype(float), sign * standing[blocks.row]
        kernel = partial(tension_blocks, problem, np.ones(()), kind=self._kind, margins=margins)
        return in_batches(kernel, (*own, blocks.start, blocks.stop), size=self._batch, axis=-1)


class _State:
    # What is known of n motions so far.

    def __init__(self, count: int, allowed: np.ndarray) -> None:
        self._allowed = allowed
        self.attained, self.bound = np.full((count, len(allowed)), np.inf), np.full((count, len(allowed)), np.inf)
        self.is_refuted, self.is_stuck = np.zeros(count, bool), np.zeros(count, bool)
        self.instant, self._least = np.full(count, np.nan), np.full(count, np.inf)

    def told(self, blocks: Blocks, found: BlockBounds, near: float, *, last: bool) -> np.ndarray:
        # Takes in what was found of blocks; which of them are to be halved.
        nodes, low = found.nodes.min(0).T, found.bound.T
        np.minimum.at(self.attained, blocks.row, nodes)
        self._note_instants(blocks, np.asarray(found.nodes).min(1))
        # NaN refutes nothing, and proves nothing.
        self.is_refuted[blocks.row[(nodes + self._allowed < -TOLERANCE).any(1)]] = True
        is_proved = (low > TOLERANCE - self._allowed).all(1)
        with np.errstate(invalid="ignore"):  # of infinite bounds, and of refuted motions, whose blocks leave anyway
            is_near = low[:, 0] >= near * self.attained[blocks.row, 0]
            is_known = ((nodes - low <= 0.5 * TOLERANCE) & ~(low > TOLERANCE - self._allowed)).any(1)
        is_done = is_proved & is_near | is_known | last | np.isnan(nodes).any(1)
        self.is_stuck[blocks.row[is_done & ~is_proved]] = True
        np.minimum.at(self.bound, blocks.row[is_done], low[is_done])
        return ~is_done & ~self.is_refuted[blocks.row] & ~self.is_stuck[blocks.row]

    def _note_instants(self, blocks: Blocks, nodes: np.ndarray) -> None:
        # (m, k) smallest slacks at nodes.
        place = nodes.argmin(0)
        value = nodes[place, np.arange(len(place))]
        tau = 0.5 * (blocks.start + blocks.stop + (blocks.stop - blocks.start) * chebyshev.nodes()[place])
        best = np.argsort(-value, kind="stable")  # the smallest of a motion is written last
        row, value, tau = blocks.row[best], value[best], tau[best]
        is_less = value < self._least[row]
        self._least[row[is_less]], self.instant[row[is_less]] = value[is_less], tau[is_less]


def _orders(problem: Problem) -> list[_Order]:
    # As it is, then those whose first, third and fifth ray span the largest volumes at rest, a unit below the spools.
    robot = problem.robot
    base, arms = np.asarray(robot.base_points), np.asarray(robot.platform_points)
    rays = arms + np.array([0.0, 0.0, float(np.abs(base).max())]) - base
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    threes = sorted(
        itertools.combinations(range(CABLES), 3), key=lambda three: -abs(float(np.linalg.det(rays[list(three)])))
    )
    every = [list(range(CABLES))]
    for three in threes[: ORDERS - 1]:
        others = [k for k in range(CABLES) if k not in three]
        every.append([k for pair in zip(three, others, strict=True) for k in pair])
    return [_Order(_reordered(problem, order), _sign(order)) for order in every]


def _sign(order: list[int]) -> float:
    return float((-1) ** sum(a > b for a, b in itertools.combinations(order, 2)))


def _reordered(problem: Problem, order: list[int]) -> Problem:
    # No point is shared, so that one compiled function serves every order.
    robot, limits = problem.robot, problem.limits
    points = {name: np.asarray(getattr(robot, name))[order] for name in ("base_points", "platform_points")}
    changed = dataclasses.replace(robot, **points, joints=tuple(range(CABLES)), limits=Limits())
    each = {row.name: getattr(limits, row.name) for row in LIMITS}
    own: dict[str, Any] = {
        row.name: np.asarray(each[row.name])[order] if row.per_cable and each[row.name] is not None else each[row.name]
        for row in LIMITS
    }
    return problem._replace(robot=changed, limits=Limits(**own))


def _standing(problem: Problem, segments: PoseSegment) -> np.ndarray:
    # det J(P0), with the sign that `wrench_lanes.balance` gives it, (n,) m^9.
    robot, (depths, own) = problem.robot, np.unique(np.asarray(segments.hub)[:, 2], return_inverse=True)
    arms = np.asarray(robot.platform_points)
    forces = np.asarray(robot.base_points) - arms - np.array([0.0, 0.0, 1.0]) * depths[:, None, None]
    wrenches = np.concatenate([forces, np.cross(arms, forces)], axis=2)
    return -np.linalg.det(wrenches)[own.ravel()]
