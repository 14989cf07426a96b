"""Margins of more cables than degrees of freedom, as series of balls: distances from the facets of feasible wrenches.

A facet is parallel to d - 1 columns of the wrench matrix. With its normal c, and g_k the product of c with column k,
tensions between low + s and high - s reach the wrench w along c where

    sum over k of (g_k (high_k - s) if g_k > 0, else g_k (low_k + s)) - c . w >= 0,

which bounds s from above, as half of the widths of the ranges do; the margin is the smallest of these bounds (Bouchard,
Gosselin and Moore 2010).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import flint

from cspr_jax.verification.exact.series import absolute, dot, quotient

Vector = list[Any]


def facet_slacks(
    columns: Sequence[Vector], wrench: Vector, low: Sequence[flint.arb], high: Sequence[flint.arb] | None
) -> list[tuple[Any, bool | None]]:
    """Bounds of the margin by widths and facets, and whether each exists: yes, no, or it is not known."""
    zero = wrench[0] * 0
    slacks: list[tuple[Any, bool | None]] = []
    slacks += [] if high is None else [(zero + (up - down) / 2, True) for down, up in zip(low, high, strict=True)]
    for chosen in itertools.combinations(range(len(columns)), len(wrench) - 1):
        normal = _normal([columns[k] for k in chosen], len(wrench))
        products = {k: dot(normal, column) for k, column in enumerate(columns) if k not in chosen}
        total = dot(normal, wrench)
        norms = {k: absolute(g) for k, g in products.items()}
        norm = sum(norms.values(), total * 0)
        for sign in (1, -1):
            slack, exists = -sign * total, True if high is not None else _is_bounded(products.values(), sign)
            for k, g in products.items():
                up, down = (norms[k] + sign * g) / 2, (norms[k] - sign * g) / 2
                slack = slack - down * low[k] + (0 if high is None else up * high[k])
            slacks.append((quotient(slack, norm), exists))
    return slacks


def _is_bounded(products: Any, sign: int) -> bool | None:
    # Without largest tensions there is a facet only where no cable pulls beyond it.
    sides = [sign * g[0] for g in products]
    if any(side > 0 for side in sides):
        return False
    return True if all(side <= 0 for side in sides) else None


def _normal(vectors: Sequence[Vector], count: int) -> Vector:
    # Vector normal to count - 1 others: minors of their matrix, with alternating signs.
    normal = []
    for k in range(count):
        minor = [[vector[i] for i in range(count) if i != k] for vector in vectors]
        value = determinant(minor)
        normal.append(-value if k % 2 else value)
    return normal


def determinant(matrix: Sequence[Sequence[Any]]) -> Any:
    """Determinant by expansion along the first column, with each minor computed once."""
    count = len(matrix)
    if not count:
        return flint.arb_series([1])
    # Minors of the last rows for each choice of columns.
    minors: dict[tuple[int, ...], Any] = {(k,): matrix[-1][k] for k in range(count)}
    for depth in range(2, count + 1):
        row = matrix[-depth]
        minors = {chosen: _expanded(row, minors, chosen) for chosen in itertools.combinations(range(count), depth)}
    return minors[tuple(range(count))]


def _expanded(row: Sequence[Any], minors: dict[tuple[int, ...], Any], chosen: tuple[int, ...]) -> Any:
    total = None
    for position, k in enumerate(chosen):
        term = row[k] * minors[chosen[:position] + chosen[position + 1 :]]
        term = -term if position % 2 else term
        total = term if total is None else total + term
    return total
