"""The fastest proved motion of several for each instant: samples refute, proofs decide, from the fastest on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cspr_jax.curves.interpolation import hermite
from cspr_jax.curves.spline import Spline, SplineBatch
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.bounds.block_slacks import block_slacks
from cspr_jax.verification.criteria import criteria, levels
from cspr_jax.verification.proved_answers import MotionProof, proofs_of

SAMPLES = 33  # samples of a motion that may refute it


class ProvedStop(NamedTuple):
    """A motion to rest, in the axes of the kernels.

    Fields:
        kind: "rest", "path", "free" or "swing".
        motion: the motion.
        proof: its proof.
    """

    kind: str
    motion: Spline
    proof: MotionProof

    @property
    def duration(self) -> float:
        """Duration, s; none where the robot rests already."""
        return 0.0 if self.kind == "rest" else float(self.motion.knots[-1])


class Candidate(NamedTuple):
    """A motion to rest that is not proved yet, from one of the instants."""

    sample: int
    kind: str
    motion: Spline

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.motion.knots[-1])


def hermite_spline(
    times: Float[np.ndarray, "n"],
    position: Sequence[Float[np.ndarray, "n 3"]],
    quaternion: Sequence[Float[np.ndarray, "n 4"]] | None,
    z0: float,
) -> Spline:
    """Quintic pieces through positions, and orientations of any norm, with their first and second derivatives."""
    turning = None if quaternion is None else as_float64(hermite(times, list(quaternion)))
    return Spline(as_float64(times), as_float64(hermite(times, list(position))), turning, as_float64(z0))


def fastest_proved(problem: Problem, scene: Scene | None, candidates: Sequence[Candidate]) -> dict[int, ProvedStop]:
    """The fastest candidate that is proved, by instant."""
    left = [one for one, is_left in zip(candidates, _unrefuted(problem, scene, candidates), strict=True) if is_left]
    queues = dict[int, list[Candidate]]()
    for one in sorted(left, key=lambda one: one.duration):
        queues.setdefault(one.sample, []).append(one)
    fastest = dict[int, ProvedStop]()
    while queues:
        first = [queue.pop(0) for queue in queues.values()]
        for one, proof in zip(first, proved(problem, scene, [one.motion for one in first]), strict=True):
            if proof.is_feasible:
                fastest[one.sample] = ProvedStop(one.kind, one.motion, proof)
        queues = {k: queue for k, queue in queues.items() if queue and k not in fastest}
    return fastest


def proved(problem: Problem, scene: Scene | None, motions: Sequence[Spline]) -> list[MotionProof]:
    """Proofs of motions."""
    if not motions:
        return []
    batch = SplineBatch(motions)
    return proofs_of(problem, batch.bounds, batch.durations, scene, batch.jumps, intervals=False)


def _unrefuted(problem: Problem, scene: Scene | None, candidates: Sequence[Candidate]) -> Bool[np.ndarray, "n"]:
    # Tell which motions keep all criteria at samples.
    if not candidates:
        return np.zeros(0, bool)
    batch = SplineBatch([one.motion for one in candidates])
    motion = np.repeat(np.arange(len(candidates)), SAMPLES)
    times = (batch.durations[:, None] * np.linspace(0.0, 1.0, SAMPLES)).ravel()

    def bounds(start: np.ndarray, end: np.ndarray):
        return batch.bounds(motion, start, end)

    high = block_slacks(problem.robot, problem.limits, bounds, times, times, scene).high
    level = levels(tuple(criteria(problem.robot, problem.limits, scene)))
    keeps = np.asarray(np.where(np.isnan(high), np.inf, high) >= level)
    return np.all(keeps.reshape(len(candidates), -1), axis=1)
