"""Proofs about what depends on a platform's pose alone: contacts, depth, limits on the pose.

A motion is clear if all of its blocks are (`place_blocks`); it meets if two cables, or a cable and the platform, are
proved to meet between two instants (`meetings`); else, after many halvings, it is undecided.
"""

import dataclasses
from functools import partial

import jax
import numpy as np
from jax import Array

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.feasibility.platform import meetings
from cspr_jax.feasibility.platform.blocks import HALVINGS, OPEN, Blocks, parts_of_arcs
from cspr_jax.feasibility.platform.certificate import TOLERANCE
from cspr_jax.feasibility.platform.motions import rows
from cspr_jax.feasibility.platform.place_blocks import STEPS, PlaceBounds, of_pose, place_blocks
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots import contact_lanes
from cspr_jax.robots.interference import contacts
from cspr_jax.robots.wrench_lanes import cables
from cspr_jax.trajectories.platform_lanes import state
from cspr_jax.trajectories.platform_reach import instant_beside, middle_of
from cspr_jax.trajectories.platform_segment import Kind, PoseSegment

# Parts of an arc that are looked at first; nearer than this part of the platform's size is undecided.
PARTS, TOUCH = 4, 1e-9
# Blocks halved so often are held to be near a contact.
NEAR_CONTACT = 3


@dataclasses.dataclass(frozen=True)
class PlaceProof:
    """Proofs about n motions; criteria are the depth below the spools and the limits on the pose that are given.

    Fields:
        is_proved: (n,) nothing meets, and every criterion is met, at every instant.
        met: (n,) two cables meet.
        hit: (n,) a cable lies on the platform.
        is_broken: (n,) a criterion is broken at an instant.
        attained: (n, n_criteria + 1) smallest slacks at the instants that were looked at, and distance between cables.
        bound: (n, n_criteria) proved lower bounds; as attained of motions that are not proved.
        blocks: those that were looked at first.
        nodes: (m, n_criteria + 1, k) of theirs.
    """

    is_proved: np.ndarray
    met: np.ndarray
    hit: np.ndarray
    is_broken: np.ndarray
    attained: np.ndarray
    bound: np.ndarray
    blocks: Blocks
    nodes: np.ndarray


@partial(jax.jit, static_argnames="kind")
def wires_beside(problem: Problem, items, *, kind: Kind) -> tuple[Array, Array]:
    """Cables at one instant beside the middle of each of many blocks.

    Args:
        problem: robot, limits, amplitude.
        items: segments (leaves (n, ...)), arcs (n,), middles (n,) and how far beside them (n,), of tau.
        kind: of the motions.

    Returns:
        (n, n_cables, 3) from spool to platform, and from platform to spool in platform axes, m.
    """
    segments, arcs, middles, off = items
    now = instant_beside(middle_of(problem.amplitude, middles), segments.sense, arcs, off)
    here = state(segments, arcs, now, kind)
    wires = cables(problem.robot, here.position, here.turn)
    return contact_lanes.as_arrays(wires.rays, contact_lanes.cable_directions(wires, here.turn))


class PlaceCertifier:
    """Certifier of what depends on the pose alone along motions of one robot.

    Args:
        problem: robot, limits, amplitude.
        kind: of the motions.
        batch: how many blocks are computed at a time.

    Fields:
        done: how many blocks were looked at so far.
    """

    def __init__(self, problem: Problem, kind: Kind, *, batch: int) -> None:
        """Find what can meet."""
        self._problem, self._kind, self._batch = problem, kind, batch
        near, robot = contacts(problem.robot), problem.robot
        self._platform, self._pairs = (near.sides, near.normal), near.pairs
        self._base, arms = np.asarray(robot.base_points), np.linalg.norm(np.asarray(robot.platform_points), axis=1)
        self._arms, self._touch = arms, TOUCH * float(arms.max())
        self._knots = np.asarray(problem.amplitude.knots)
        self._allowed = 2.0 * TOLERANCE * (np.arange(1 + len(of_pose(problem))) >= 1)
        self.done = 0

    def prove(self, segments: PoseSegment, arcs: np.ndarray, *, margins: bool = False) -> PlaceProof:
        """Prove motions clear, or that something meets or is broken.

        Args:
            segments: leaves (n, ...), of the parity of `arcs`.
            arcs: (n,).
            margins: whether distances between cables are wanted.

        Returns:
            the proofs.
        """
        blocks = first = parts_of_arcs(arcs, self._knots, PARTS)
        count, width = len(arcs), len(self._allowed)
        met, hit, broken, stuck = (np.zeros(count, bool) for _ in range(4))
        attained, bound, nodes = (
            np.full((count, width + 1), np.inf),
            np.full((count, width), np.inf),
            np.zeros((0, 0, 0)),
        )
        for level in range(HALVINGS + 1):
            if not len(blocks.row):
                break
            found = self._looked_at(blocks, segments, arcs, margins=margins)
            nodes = nodes if level else np.asarray(found.nodes)
            least, low = found.nodes.min(0).T, found.slacks.T
            np.minimum.at(attained, blocks.row, least)
            broken[blocks.row[(least[:, :-1] + self._allowed < -TOLERANCE).any(1)]] = True
            is_met = (low > TOLERANCE - self._allowed).all(1)
            is_clear = np.asarray(found.clear) > self._touch
            if level >= NEAR_CONTACT and not is_clear.all():
                self._note_meetings(
                    blocks.some(~is_clear), np.asarray(found.speeds)[:, ~is_clear], (segments, arcs), (met, hit)
                )
            is_known = ((least[:, :-1] - low <= 0.5 * TOLERANCE) & ~(low > TOLERANCE - self._allowed)).any(1)
            is_done = (is_met & is_clear) | is_known | np.isnan(least).any(1) | (level == HALVINGS)
            stuck[blocks.row[is_done & ~(is_met & is_clear)]] = True
            np.minimum.at(bound, blocks.row[is_done], low[is_done])
            is_open = ~is_done & ~(met | hit | broken | stuck)[blocks.row]
            stuck |= np.bincount(blocks.row[is_open], minlength=count) > OPEN * arcs
            blocks = blocks.some(is_open & ~stuck[blocks.row]).halves()
        is_proved = ~(met | hit | broken | stuck)
        bound = np.where(is_proved[:, None], bound, np.minimum(bound, attained[:, :-1]))
        return PlaceProof(is_proved, met, hit, broken, attained, bound, first, nodes)

    def _looked_at(self, blocks: Blocks, segments: PoseSegment, arcs: np.ndarray, *, margins: bool) -> PlaceBounds:
        self.done += len(blocks.row)
        pairs = tuple((int(i), int(j)) for i, j in self._pairs)
        kernel = partial(
            place_blocks,
            self._problem,
            self._platform,
            np.ones(()),
            pairs=pairs,
            kind=self._kind,
            margins=margins,
        )
        items = (rows(segments, blocks.row), arcs[blocks.row].astype(float), blocks.start, blocks.stop)
        return in_batches(kernel, items, size=self._batch, axis=-1)

    def _note_meetings(self, blocks: Blocks, speeds: np.ndarray, motions, found: tuple[np.ndarray, np.ndarray]) -> None:
        # Of all steps of blocks that are not clear.
        segments, arcs = motions
        step = np.tile(np.arange(STEPS), len(blocks.row))
        own, (speed, turn) = np.repeat(np.arange(len(blocks.row)), STEPS), speeds
        row, middle = blocks.row[own], 0.5 * (blocks.start + blocks.stop)[own]
        width = ((blocks.stop - blocks.start) / STEPS)[own]
        items = rows(segments, row), arcs[row].astype(float), middle
        kernel = partial(wires_beside, self._problem, kind=self._kind)
        places = [(step + k - 0.5 * STEPS) * width for k in (0.0, 0.5, 1.0)]
        rays, seen = zip(*(in_batches(kernel, (*items, off), size=self._batch) for off in places), strict=True)
        moved = 0.5 * width[:, None] * (speed[own, None] + self._arms * turn[own, None])
        away = np.linalg.norm(rays[1], axis=2).max(1)[:, None] + self._arms.max() + moved.max(1, keepdims=True)
        turned = 0.5 * width[:, None] * (speed[own, None] + turn[own, None] * away)
        steps = meetings.Step(np.array(rays), np.array(seen), moved, np.broadcast_to(turned, moved.shape))
        met, hit = found
        met[row[meetings.cables_meet(self._base, self._pairs, steps)]] = True
        hit[row[meetings.cables_hit(*self._platform, steps)]] = True
