"""Root mean squares of the torques of motors over a full motion, or over several that follow each other, by proof.

Over a block, a torque lies within rho of a line m + l s, so that its square has the integral m^2 + l^2 / 3 over a unit
of time, to 2 (|m| + |l|) rho + rho^2; where friction may act on both sides, or the drum has two radii, the square lies
between the smallest and the largest one of these cases. Blocks whose bounds are widest are halved until each limit is
decided.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, flat
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import ROUNDING, TOUCHED
from cspr_jax.robots.bounds.motor_bounds import motor_bounds, torque_bounds
from cspr_jax.robots.bounds.state_bounds import StateBounds, balance_bounds, cable_bounds
from cspr_jax.robots.bounds.witness_tensions import witness_tensions
from cspr_jax.robots.cables import AnyRobot, wrench_units
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.winches import Winches
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.criteria import Criterion
from cspr_jax.verification.proved_answers import MotionProof, proof_of

FIRST = 64  # number of blocks of each motion at the start
BATCH = 64
MAX_BLOCKS = 20_000
# In each round, blocks are halved whose bounds are wider than this fraction of the widest.
WIDE = 0.1


class MeanTorques(NamedTuple):
    """Bounds of the mean squares of torques.

    Fields:
        low: (n_motions, n_cables) lower bounds of the integrals of squared torques, N^2 m^2 s.
        high: (n_motions, n_cables) upper bounds.
        durations: (n_motions,) s.
    """

    low: np.ndarray
    high: np.ndarray
    durations: np.ndarray

    @property
    def rms_low(self) -> Float[np.ndarray, "n_cables"]:
        """Lower bounds of the root mean squares over all motions; 0 where nothing is known."""
        return np.nan_to_num(self._rms(self.low), nan=0.0, posinf=np.inf)

    @property
    def rms_high(self) -> Float[np.ndarray, "n_cables"]:
        """Upper bounds of the root mean squares over all motions; inf where nothing is known."""
        return np.nan_to_num(self._rms(self.high), nan=np.inf, posinf=np.inf)

    @property
    def rms_of_each(self) -> np.ndarray:
        """Lower bounds of the root mean squares over each motion, (n_motions, n_cables); 0 where nothing is known."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.nan_to_num(np.sqrt(self.low / self.durations[:, None]), nan=0.0, posinf=0.0)

    def _rms(self, side: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(side.sum(0) / self.durations.sum())


def mean_torques(problem: Problem, motions: Sequence[Any]) -> MeanTorques:
    """Bounds of mean squares over all motions together, close enough to decide `motor_torque_rms_max`."""
    limit = np.asarray(problem.limits.motor_torque_rms_max) * (1.0 + TOUCHED)
    durations = np.array([float(motion.duration()) for motion in motions])
    edges = durations[:, None] * np.linspace(0.0, 1.0, FIRST + 1)
    motion = np.repeat(np.arange(len(motions)), FIRST)
    start, end = edges[:, :-1].ravel(), edges[:, 1:].ravel()
    low, high = _integrals(problem, motions, motion, start, end)
    while True:
        sums = [_sums(motion, side, len(motions)) for side in (low, high)]
        totals = MeanTorques(sums[0], sums[1], durations)
        is_open = ~(totals.rms_low > limit) & ~(totals.rms_high <= limit)
        gap = (high - low)[:, is_open].max(1, initial=0.0)
        if not gap.max(initial=0.0) > 0.0 or len(motion) > MAX_BLOCKS:
            return totals
        wide = gap >= WIDE * gap.max()
        middle = 0.5 * (start + end)[wide]
        halves = (
            np.repeat(motion[wide], 2),
            *(np.stack(pair, axis=1).ravel() for pair in ((start[wide], middle), (middle, end[wide]))),
        )
        more = _integrals(problem, motions, *halves)
        motion, start, end = (
            np.concatenate([old[~wide], new]) for old, new in zip((motion, start, end), halves, strict=True)
        )
        low, high = (np.concatenate([old[~wide], new]) for old, new in zip((low, high), more, strict=True))


def _sums(motion: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    # Sums for each motion; their rounding is far below the allowance of limits.
    total = np.zeros((count, values.shape[1]))
    np.add.at(total, motion, values)
    return total


def _integrals(
    problem: Problem, motions: Sequence[Any], motion: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    low, high = (np.empty((len(motion), problem.robot.n_cables)) for _ in range(2))
    kernel = partial(_kernel, problem.robot, problem.limits)
    for i in np.unique(motion).tolist():
        rows = np.flatnonzero(motion == i)
        if not hasattr(motions[i], "bounds"):  # a function that is only sampled
            low[rows], high[rows] = 0.0, np.inf
            continue
        sides = in_batches(kernel, motions[i].bounds(start[rows], end[rows]), batch_size=BATCH)
        width = (end - start)[rows, None]
        low[rows], high[rows] = (np.where(width == 0.0, 0.0, side * width) for side in sides)
    return low, high


@persistent_jit(compiler_options=compile_options.proof_options())
def _kernel(robot: AnyRobot, limits: Limits, states: StateBounds) -> tuple[Array, Array]:
    # Bound the means of squared torques over blocks.
    def one(state: StateBounds) -> tuple[Array, Array]:
        cables, unit = cable_bounds(robot, state), 1.0 / wrench_units(robot)
        matrix, wrench = balance_bounds(robot, state, cables)
        tensions = witness_tensions(matrix * unit[:, None], wrench * unit, *tension_range(robot, limits))
        motors = motor_bounds(cast("Winches", robot.winches), cables)
        torque = torque_bounds(cast("Winches", robot.winches), motors, tensions.tension)
        # A drum with layers has two more cases, copies of the first two where its radius is one.
        is_copy = motors.has_one_radius[None] & (jnp.arange(len(motors.side)) >= 2)[:, None]
        may_act = motors.may_act() & ~is_copy
        low, high = _squares(torque)
        one_case = _mean_square(torque)
        is_mixed = jnp.sum(may_act, axis=0) > 1
        smallest = minimum_of(jnp.where(may_act, low, jnp.inf), axis=0)
        largest = maximum_of(jnp.where(may_act, high, -jnp.inf), axis=0)
        of_case = (jnp.sum(jnp.where(may_act, side, 0.0), axis=0) for side in one_case)
        low, high = (jnp.where(is_mixed, *pair) for pair in zip((smallest, largest), of_case, strict=True))
        return jnp.where(low > 0.0, low, 0.0), jnp.where(high >= 0.0, high, jnp.inf)

    return jax.vmap(one)(states)


def _squares(torque: AffineBounds) -> tuple[Array, Array]:
    nearest = jnp.maximum(0.0, jnp.maximum(torque.low(), -torque.high()))
    return nearest**2, torque.magnitude() ** 2


def _mean_square(torque: AffineBounds) -> tuple[Array, Array]:
    line = flat(torque)
    mean = line.middle**2 + line.linear**2 / 3.0
    off = (2.0 * (jnp.abs(line.middle) + jnp.abs(line.linear)) + line.radius) * line.radius + ROUNDING * mean
    return mean - off, mean + off


def extended(case: MotionProof, totals: MeanTorques, limit: Float[np.ndarray, "n_cables"]) -> MotionProof:
    """A proof, extended by the limit of the root mean square of each motor's torque."""
    usual, count = case.proof, len(limit)
    rows = [
        Criterion(Verdict.MOTOR_OVER_TORQUE_RMS, (k,), "N m", allowed=value, sense="most", allowance=TOUCHED * value)
        for k, value in enumerate(limit.tolist())
    ]
    nothing = [np.empty((0, 2))] * count
    proof = dataclasses.replace(
        usual,
        low=np.append(usual.low, limit - totals.rms_high),
        high=np.append(usual.high, limit - totals.rms_low),
        when=np.append(usual.when, np.full(count, np.nan)),
        failing=usual.failing + nothing,
        open=usual.open + nothing,
    )
    return case._replace(criteria=(*case.criteria, *rows), proof=proof, scales=np.append(case.scales, limit))


def with_means(problem: Problem, case: MotionProof, motion: Any) -> MotionProof:
    """A proof of a motion that is a full plan, with means where all other criteria are proved."""
    limit = problem.limits.motor_torque_rms_max
    if limit is None or not case.is_feasible:
        return case
    return extended(case, mean_torques(problem, [motion]), np.asarray(limit))


def with_means_of_each(problem: Problem, proofs: Sequence[MotionProof], motions: Sequence[Any]) -> list[MotionProof]:
    """Proofs of motions, each of which is a full plan, with means."""
    return [with_means(problem, *each) for each in zip(proofs, motions, strict=True)]


def proof_with_means(problem: Problem, motion: Any, scene: Scene | None) -> MotionProof:
    """Proof of one motion that is a full plan; without means where other criteria are not proved."""
    return with_means(problem, proof_of(problem, motion, scene), motion)
