"""Cables whose measured lengths do not agree with the others, and cables that are slack.

A pose changes the lengths by J times its displacement; what of them lies across J, along the null vectors N of the
wrench matrix, no pose explains: s = N^T r, for residuals r of least squares. An error c of cable i alone leaves
s = N_i c, with the i-th row of N. A constant error over a log is c = sum N_i . s / sum |N_i|^2, and it explains the
fraction (sum N_i . s)^2 / (sum |N_i|^2 sum |s|^2) of all that disagrees. With as many cables as degrees of freedom
there is no null vector: any lengths are those of a pose.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float

# Fraction that one cable must explain to be named, and how many times that of the next one.
EXPLAINS, CLEARLY = 0.5, 1.3
# Gaps between rows of an interval, in rows, that do not end it.
BRIDGED = 2


class Disagreement(NamedTuple):
    """How cables disagree over a log.

    Fields:
        errors: (m,) constant error of each cable that explains most by itself, m.
        fractions: (m,) fraction of what disagrees that it explains.
        cable: index of the cable that explains most of it; None: none stands out, or it cannot be told.
        spread: root mean square of what no pose explains, m.
    """

    errors: np.ndarray
    fractions: np.ndarray
    cable: int | None
    spread: float


def null_vectors(matrices: Float[np.ndarray, "n dof m"]) -> Float[np.ndarray, "n m r"]:
    """Orthonormal vectors of lengths that no small displacement of the pose gives."""
    dof = matrices.shape[1]
    return np.linalg.svd(matrices)[2][:, dof:].transpose(0, 2, 1)


def disagreement_of(null: Float[np.ndarray, "n m r"], measured: Float[np.ndarray, "n m"]) -> Disagreement:
    """Disagreement of cables, from null vectors and measured minus fitted lengths."""
    parts = np.einsum("nmr,nm->nr", null, measured)
    along = np.einsum("nmr,nr->m", null, parts)
    squares, total = (null**2).sum((0, 2)), float((parts**2).sum())
    errors = along / np.where(squares > 0.0, squares, 1.0)
    fractions = errors * along / (total if total > 0.0 else 1.0)
    order = np.argsort(-fractions)
    best = float(fractions[order[0]])
    is_clear = best >= EXPLAINS and best >= CLEARLY * float(fractions[order[1]])
    spread = float(np.sqrt(total / max(len(parts) * parts.shape[1], 1)))
    return Disagreement(errors, fractions, int(order[0]) if is_clear and total > 0.0 else None, spread)


def robust_deviation(null: Float[np.ndarray, "n m r"], measured: Float[np.ndarray, "n m"]) -> float:
    """Standard deviation of lengths, m, from the median of what no pose explains, for errors that are independent."""
    return 1.4826 * float(np.median(np.abs(np.einsum("nmr,nm->nr", null, measured))))


def longer_rows(null: Float[np.ndarray, "n m r"], measured: Float[np.ndarray, "n m"], threshold: float) -> np.ndarray:
    """Rows and cables (n, m) where one cable alone is longer than the pose of the others; needs two spare cables."""
    parts = np.einsum("nmr,nm->nr", null, measured)
    along, squares = np.einsum("nmr,nr->nm", null, parts), (null**2).sum(2)
    errors = along / np.where(squares > 0.0, squares, 1.0)
    fractions = errors * along / np.maximum((parts**2).sum(1), 1e-300)[:, None]
    best = fractions.argmax(1)
    each = np.arange(len(best))
    second = np.where(np.arange(fractions.shape[1]) == best[:, None], -np.inf, fractions).max(1)
    is_one = (fractions[each, best] >= EXPLAINS) & (fractions[each, best] >= CLEARLY * second)
    is_longer = np.zeros(fractions.shape, bool)
    is_longer[each, best] = is_one & (errors[each, best] > threshold)
    return is_longer


def intervals(times: Float[np.ndarray, "n"], is_inside: np.ndarray) -> list[tuple[float, float]]:
    """Intervals of time of consecutive rows."""
    rows = np.flatnonzero(is_inside)
    if not len(rows):
        return []
    cuts = np.flatnonzero(np.diff(rows) > BRIDGED)
    starts, ends = rows[np.r_[0, cuts + 1]], rows[np.r_[cuts, len(rows) - 1]]
    return [(float(times[a]), float(times[b])) for a, b in zip(starts, ends, strict=True)]
