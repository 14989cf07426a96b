"""Proofs of turns on many ellipses at once.

Time is the angle of the turn here: so turns that get slower and slower have a limit, which has no velocity.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import jax
import numpy as np

from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds
from cspr_jax.numerics.bounds.function_bounds import sincospi
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.proved_answers import MotionProof, proofs_of

if TYPE_CHECKING:
    from jaxtyping import Float, Int

# Blocks of which bounds are computed at a time, and turns that are proved together.
BATCH, TOGETHER = 64, 1024
# Not less than a turn, whatever the rounding.
TURN = math.nextafter(2.0 * math.pi, 7.0)


@dataclasses.dataclass(frozen=True)
class Turns:
    """One turn on each of n ellipses.

    Fields:
        ellipses: leaves (n, 3).
        frequencies: (n,) rad/s; 0: the limit of slow turns.
    """

    ellipses: Ellipse
    frequencies: np.ndarray

    def bounds(
        self, motion: Int[np.ndarray, "k"], start: Float[np.ndarray, "k"], end: Float[np.ndarray, "k"]
    ) -> StateBounds:
        """Bounds of the states over blocks."""
        chosen = Ellipse(*(np.asarray(leaf)[motion] for leaf in self.ellipses))
        return in_batches(_bounds, (chosen, self.frequencies[motion], start, end), batch_size=BATCH)


@persistent_jit
def _bounds(blocks: tuple) -> StateBounds:
    def one(block: tuple) -> StateBounds:
        (centre, a, b), rate, start, end = block
        angle = AffineBounds(0.5 * (start + end), 0.5 * (end - start), 0.0 * start) * (1.0 / math.pi)
        sine, cosine = sincospi(angle.each(lambda x: x[None]))
        outward, forward = cosine * a + sine * b, cosine * b - sine * a
        return StateBounds(outward + centre, forward * rate, outward * -(rate**2))

    return jax.vmap(one)(blocks)


def turn_proofs(problem: Problem, turns: Turns) -> list[MotionProof]:
    """Proofs of one turn on each ellipse."""
    proofs: list[MotionProof] = []
    for first in range(0, len(turns.frequencies), TOGETHER):
        part = slice(first, first + TOGETHER)
        chunk = Turns(Ellipse(*(leaf[part] for leaf in turns.ellipses)), turns.frequencies[part])
        proofs += proofs_of(problem, chunk.bounds, np.full(len(chunk.frequencies), TURN))
    return proofs
