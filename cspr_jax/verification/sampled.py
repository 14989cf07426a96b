"""Answers of motions that are only sampled: refuted by a sample, or undecided. They serve families without a proof."""

from functools import partial

import jax
import numpy as np

from cspr_jax.motion.answers import Answers
from cspr_jax.motion.motion import Motion, common_shape
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.slacks import flags, slacks
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.search.minima import narrowed
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.verdicts import FLAGS, Verdict

BATCH = 512


@persistent_jit
def _slacks(motion: Motion, problem: Problem, tau) -> jax.Array:
    return jax.vmap(lambda t: slacks(problem, motion, t))(tau)


def sampled_answers(problem: Problem, motions: list[Motion], samples: int = 400) -> Answers:
    """Answers of motions that are only sampled."""
    tau = np.linspace(0.0, 1.0, samples + 1)
    minimum, duration = [], []
    for motion in motions:
        kernel = partial(_slacks, common_shape(motion), problem)

        def at(points: np.ndarray, kernel=kernel) -> np.ndarray:
            return in_batches(kernel, points.ravel(), batch_size=BATCH).reshape(*points.shape, -1)

        minimum.append(narrowed(at, tau, at(tau[None]))[0])
        duration.append(float(motion.duration()))
    slack, slack_flags = np.array(minimum), flags(problem)
    broken = sum(
        (np.where(column <= 0.0, flag.value, 0) for flag, column in _by_flag(slack_flags, slack)), np.zeros(1, int)
    )
    verdict = np.where(broken == 0, Verdict.UNDECIDED.value, broken)
    verdict = np.where(np.isfinite(slack).all(1), verdict, Verdict.NOT_FINITE.value)
    is_limit = np.arange(len(slack_flags)) > slack_flags.index(Verdict.ABOVE_SPOOLS)
    none = np.zeros(len(motions), int)
    return Answers(
        arcs=none,
        tried_arcs=none,
        verdict=verdict.astype(FLAGS),
        duration=np.array(duration),
        margin=slack[:, ~is_limit].min(1),
        margin_bound=np.full(len(motions), np.nan),
        limit_margin=slack[:, is_limit].min(1, initial=np.inf),
        feasible_at_infinity=np.full(len(motions), np.nan),
        tolerated=np.full(len(motions), np.nan),
        not_tolerated=np.full(len(motions), np.nan),
    )


def _by_flag(slack_flags: tuple[Verdict, ...], slack: np.ndarray) -> list[tuple[Verdict, np.ndarray]]:
    # Return the smallest slack of each flag, so that no flag is counted twice.
    return [
        (flag, slack[:, [slack_flag is flag for slack_flag in slack_flags]].min(1))
        for flag in dict.fromkeys(slack_flags)
    ]
