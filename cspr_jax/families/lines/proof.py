"""Smallest slacks of motions along straight lines, with proved bounds.

Between knots a law of time is a polynomial, and slacks are smooth functions of it, except where the tensions that
accelerate least change. Any fixed choice of tensions over a block bounds the slack from below. Slacks are computed at
both ends of a block; a bound of the second derivative by interval arithmetic shows how far a slack can lie below its
chord. Blocks whose bound is below a slack attained elsewhere are halved until the two agree.
"""

from __future__ import annotations

import math

import jax
import numpy as np

from cspr_jax.families.lines.slacks import LineSlacks, LineStates, slacks, tensions_at, tensions_over
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.numerics.bounds.interval_jets import Jet, lowest
from cspr_jax.numerics.polynomials import bounds, derivatives, over
from cspr_jax.numerics.search.block_minima import MinimumBlocks, Proved, smallest
from cspr_jax.numerics.shapes import Float

# Largest number of values in memory: blocks times faces times cables.
TOGETHER = 1 << 20


def smallest_slacks(
    lines: LineSlacks, laws: Amplitude, durations: Float[np.ndarray, "n"], gravity: float, *, enough: float = math.inf
) -> Proved:
    """Smallest slacks along lines, with their bounds."""
    scales = np.array([gravity if name in lines.low else 1.0 for name in lines.names])
    batch = max(TOGETHER // max(lines.along[0].size, 1), 1)

    def values(part: MinimumBlocks) -> tuple[np.ndarray, np.ndarray]:
        return _of_blocks(lines, laws, durations, part)

    return smallest(_first(laws), len(durations), values, scales, batch_size=batch, enough=enough)


def _first(laws: Amplitude) -> MinimumBlocks:
    # Start with one block per piece, relative to its origin.
    count, pieces = laws.origins.shape
    ends = np.zeros((count, 1)), np.asarray(laws.knots, float), np.ones((count, 1))
    edges = np.concatenate(ends, axis=1)
    line, piece = (x.ravel() for x in np.meshgrid(np.arange(count), np.arange(pieces), indexing="ij"))
    return MinimumBlocks(line, piece, (edges[:, :-1] - laws.origins).ravel(), np.diff(edges).ravel())


def _of_blocks(
    lines: LineSlacks, laws: Amplitude, durations: np.ndarray, blocks: MinimumBlocks
) -> tuple[np.ndarray, np.ndarray]:
    # Bound each group from below over each block, and find its smaller value at the two ends, (n, n_groups) each.
    block_lines = jax.tree.map(lambda x: x[blocks.case], lines)
    s = over(np.asarray(laws.coefficients)[blocks.case, blocks.piece], blocks.start, blocks.width)
    per_time = (1.0 / (blocks.width * durations[blocks.case]))[:, None]
    ends, during = [_at_end(s, end, per_time) for end in (0, 1)], _during(s, per_time)
    groups = [_of_group(block_lines, name, ends, during) for name in lines.names]
    low, attained = (np.stack(x, axis=1) for x in zip(*groups, strict=True))
    return low, attained


def _of_group(line: LineSlacks, name: str, ends: list[LineStates], during: LineStates) -> tuple[np.ndarray, np.ndarray]:
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        if name not in line.low:
            values = np.stack([slacks(line, name, end) for end in ends])
            return lowest(values, slacks(line, name, during)).min(1), values.min((0, 2))
        values = np.stack([slacks(line, name, end, tensions_at(line, name, end.s)) for end in ends])
        tensions, beyond = tensions_over(line, name, ends[0].s, ends[1].s)
        chosen = tensions if tensions.any() else None
        chosen_slacks = np.stack([slacks(line, name, end, chosen) for end in ends])
        low = lowest(chosen_slacks, slacks(line, name, during, chosen))
    return np.where(beyond, np.inf, low).min(1), values.min((0, 2))


def _at_end(s: np.ndarray, end: int, per_time: np.ndarray) -> LineStates:
    values = [(x.sum(1) if end else x[:, 0])[:, None] for x in derivatives(s, 2)]
    return LineStates(values[0], (values[1] * per_time) ** 2, values[2] * per_time**2)


def _during(s: np.ndarray, per_time: np.ndarray) -> LineStates:
    ranges = [bounds(table[:, None]) for table in derivatives(s, 4)]
    speed = Jet(*ranges[1:4]) ** 2 * per_time**2
    return LineStates(Jet(*ranges[:3]), speed, Jet(*ranges[2:]) * per_time**2)
