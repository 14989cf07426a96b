"""Smallest slacks that a proved motion attains, and when: minima within the blocks that the proof leaves for them.

The proof bounds each smallest slack and says which blocks may hold it. States at single times within these, at their
ends and on both sides of joints say what is attained; the best of them are followed until the time is known to a
millionth of the duration, and better.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from cspr_jax.arithmetic.minima import vertex_values
from cspr_jax.motions.block_parts import TimeBlocks
from cspr_jax.motions.block_slacks import block_slacks
from cspr_jax.motions.motion import BESIDE, Motion
from cspr_jax.motions.motion_tolerances import instant_states
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.proved_answers import MotionProof, ProvedAnswers, margins_of
from cspr_jax.robots.clearance import Scene

# Times that are followed for each criterion at first, and then; points at each; rounds, each four times as fine.
STARTS, FOLLOWED, POINTS, ROUNDS = 6, 2, 9, 11
# Blocks of a criterion that are sampled at most: those with the smallest upper bounds.
MOST_BLOCKS = 1000
SAME = 1e-9  # of a slack, by which one seen by samples may lie above that of a proof
Slacks = Callable[[np.ndarray], np.ndarray]
AnyProved = TypeVar("AnyProved", bound=ProvedAnswers)


def with_attained(
    problem: Problem, answers: AnyProved, motions: Sequence[Motion], scene: Scene | None = None
) -> AnyProved:
    """Answers whose margins and causes are those that motions attain.

    Args:
        motions: n of them, as for `attained`.
        scene: bodies that can meet, as for `attained`; None: the cables of a platform alone.

    Returns:
        the answers.
    """
    proofs = np.array(answers.proof)
    for i, motion in enumerate(motions):
        proofs[i] = attained(problem, motion, answers.proof[i], scene)
    return dataclasses.replace(answers, proof=proofs, **margins_of(list(proofs)))


def attained(
    problem: Problem, motion: Motion, case: MotionProof, scene: Scene | None = None, *, contacts_alone: bool = False
) -> MotionProof:
    """A proof whose smallest slacks, and their times, are those that the motion attains.

    Args:
        motion: that is proved, from the centroid of the spools, z down.
        scene: bodies that can meet, as its proof takes them; None: the cables of a platform alone.
        contacts_alone: whether the proof is of contacts alone.

    Returns:
        the proof.
    """
    proof, duration = case.proof, float(motion.duration())
    columns = _nearest(case)
    if proof.near is None or not len(columns) or not np.isfinite(duration):
        return case

    def slacks(times: np.ndarray) -> np.ndarray:
        states = instant_states(motion, times / duration)
        bounds = problem.robot, problem.limits, lambda *_: states, times, times, scene
        return block_slacks(*bounds, contacts_alone=contacts_alone).high

    columns = columns[columns < proof.near.slacks.low.shape[1]]  # feeds come last, from another proof
    joints = duration * np.asarray(motion.breaks(), float)
    smallest, when = _minima(slacks, proof.near, proof.high, columns, joints, duration)
    high, times = proof.high.copy(), proof.when.copy()
    # A touch between two floats is proved but not attained, and what a proof has seen may lie lower.
    is_seen = np.isfinite(smallest) & ~((high[columns] < 0.0) & (smallest >= 0.0))
    is_seen &= smallest <= high[columns] + SAME * np.abs(high[columns])
    high[columns[is_seen]], times[columns[is_seen]] = smallest[is_seen], when[is_seen]
    return case._replace(proof=dataclasses.replace(proof, high=high, when=times))


def _nearest(case: MotionProof) -> np.ndarray:
    # Criteria that may be the worst ones of their flags.
    low, high = (side / case.scales for side in (case.proof.low, case.proof.high))
    flags = np.array([row.flag.value for row in case.criteria])
    least = np.array([high[flags == flag].min() for flag in flags])
    return np.flatnonzero((low <= least) & np.isfinite(high))


def _minima(
    slacks: Slacks, near: TimeBlocks, high: np.ndarray, columns: np.ndarray, joints: np.ndarray, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    # Smallest slack of each of the chosen criteria, (m,), and when, by samples of blocks and then around the best.
    edges, may_hold = _sampled_blocks(near, high, columns)
    inner = joints[(np.searchsorted(edges[0], joints, "right") > np.searchsorted(edges[1], joints))]
    sides = (inner[:, None] * [1.0 - BESIDE, 1.0]).ravel()
    times = np.unique(np.clip(np.concatenate([*edges, edges.mean(0), sides]), 0.0, duration))
    values = slacks(times)[:, columns]
    before, after = np.maximum(np.arange(len(times)) - 1, 0), np.minimum(np.arange(len(times)) + 1, len(times) - 1)
    # Samples in blocks that cannot hold the smallest slack of a criterion do not count for it.
    first, last = (np.searchsorted(times, side) for side in edges)
    inside = np.zeros((len(times) + 1, len(columns)), int)
    np.add.at(inside, first, may_hold)
    np.subtract.at(inside, last + 1, may_hold)
    ranks = np.where(inside.cumsum(0)[:-1] > 0, vertex_values(times, values), np.inf)
    is_low = (values <= values[before]) & (values <= values[after])
    ranks = np.where(is_low | (ranks == ranks.min(0)), ranks, np.inf)
    starts = np.argsort(ranks, axis=0, kind="stable")[:STARTS]
    width = np.maximum(times[after] - times, times - times[before])[starts]
    return _followed(slacks, columns, times[starts], width, duration)


def _followed(
    slacks: Slacks, columns: np.ndarray, places: np.ndarray, width: np.ndarray, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    # Minima of the criteria around places (k, m), within widths (k, m).
    column = np.arange(len(columns))
    for step in range(ROUNDS):
        points = np.clip(places[..., None] + width[..., None] * np.linspace(-1.0, 1.0, POINTS), 0.0, duration)
        values = slacks(points.ravel())[:, columns].reshape(*points.shape, len(columns))[:, column, :, column]
        values = np.moveaxis(values, 0, 1)
        chosen = values.argmin(2)[..., None]
        places, lowest = (np.take_along_axis(table, chosen, 2)[..., 0] for table in (points, values))
        width = 2.0 * width / (POINTS - 1)
        best = np.argsort(lowest, axis=0, kind="stable")[: FOLLOWED if step else STARTS]
        places, width, lowest = (np.take_along_axis(table, best, 0) for table in (places, width, lowest))
    return lowest[0], places[0]


def _sampled_blocks(near: TimeBlocks, high: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # Starts and ends (2, k) of the blocks to sample, s, and which criteria (k, m) each may be the worst of.
    may_hold = near.slacks.low[:, columns] <= high[columns]
    upper = np.where(may_hold, near.slacks.high[:, columns], np.inf)
    for column in np.flatnonzero(may_hold.sum(0) > MOST_BLOCKS):
        may_hold[np.argsort(upper[:, column], kind="stable")[MOST_BLOCKS:], column] = False
    rows = np.flatnonzero(may_hold.any(1))
    return np.stack([near.start[rows], near.end[rows]]), may_hold[rows]
