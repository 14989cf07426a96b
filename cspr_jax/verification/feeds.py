"""Feeds: largest speeds of the mass centre on single pieces of a motion, such as in G-code."""

from __future__ import annotations

from typing import Any

import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.bounds.block_slacks import BlockSlacks, speed_slacks
from cspr_jax.verification.criteria import Criterion
from cspr_jax.verification.time_proof import TimeProof, time_proof


def feed_proof(motion: Any, feeds: Float[np.ndarray, "m"]) -> tuple[Criterion, TimeProof]:
    """Proof that a motion keeps its feeds; on pieces without a feed the slack is the largest feed."""
    knots, largest = np.asarray(motion.knots), float(feeds[np.isfinite(feeds)].max())

    def slacks(start: np.ndarray, end: np.ndarray) -> BlockSlacks:
        minimum, maximum = (side[:, None] for side in _extremes(feeds, knots, start, end))
        low, high, *rises = speed_slacks(motion.bounds(start, end))
        is_one = (minimum == maximum) & np.isfinite(maximum)
        return BlockSlacks(
            np.where(np.isfinite(minimum), low + minimum, largest),
            np.where(np.isfinite(maximum), high + maximum, largest),
            *(np.where(is_one, rise, 0.0) for rise in rises),
        )

    missed = TOUCHED * float(feeds.min())
    proof = time_proof(slacks, float(knots[-1]), jumps=knots[1:-1][feeds[1:] != feeds[:-1]], level=-missed)
    allowed = float(feeds[np.searchsorted(knots, proof.when[0], side="right") - 1])
    return Criterion(Verdict.OVER_FEED, (), "m/s", allowed=allowed, sense="most", allowance=missed), proof


def _extremes(
    feeds: np.ndarray, knots: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    # Smallest and largest feed of the pieces in which blocks lie.
    first = np.clip(np.searchsorted(knots, start, side="right") - 1, 0, len(feeds) - 1)
    last = np.clip(np.searchsorted(knots, end, side="left"), first + 1, len(feeds))
    edges = np.stack([first, last], axis=1).ravel()
    minimum = np.minimum.reduceat(np.append(feeds, np.inf), edges)[::2]
    return minimum, np.maximum.reduceat(np.append(feeds, 0.0), edges)[::2]
