"""Tables of polynomials: coefficients of the powers of x in the last dimension, the constant one first."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from cspr_jax.numerics.shapes import Float


def product(first: Float[np.ndarray, "... n"], second: Float[np.ndarray, "... m"]) -> np.ndarray:
    """Product of polynomials."""
    n, m = first.shape[-1], second.shape[-1]
    shape = np.broadcast_shapes(first.shape[:-1], second.shape[:-1])
    coefficients = np.zeros((*shape, n + m - 1))
    for i in range(n):
        coefficients[..., i : i + m] += first[..., i, None] * second
    return coefficients


def total(first: Float[np.ndarray, "... n"], second: Float[np.ndarray, "... m"]) -> np.ndarray:
    """Sum of polynomials of any degrees."""
    n = max(first.shape[-1], second.shape[-1])
    a, b = (np.concatenate([x, np.zeros((*x.shape[:-1], n - x.shape[-1]))], axis=-1) for x in (first, second))
    return a + b


def derivatives(table: Float[np.ndarray, "... n"], order: int) -> list[np.ndarray]:
    """Polynomials and their derivatives."""
    tables = [table]
    for _ in range(order):
        last = tables[-1]
        n = last.shape[-1]
        tables.append(last[..., 1:] * np.arange(1, n) if n > 1 else np.zeros_like(last))
    return tables


def over(
    table: Float[np.ndarray, "... n"], start: Float[np.ndarray, "..."], width: Float[np.ndarray, "..."]
) -> Float[np.ndarray, "... n"]:
    """Polynomials of another variable, which is 0 at the start of a block and 1 at its end."""
    degree = table.shape[-1] - 1
    moved = np.zeros(np.broadcast_shapes(table.shape, (*np.shape(start), 1)))
    for i in range(degree + 1):
        for j in range(i + 1):
            moved[..., j] += math.comb(i, j) * table[..., i] * start ** (i - j)
    return moved * width[..., None] ** np.arange(degree + 1)


def bounds(table: Float[np.ndarray, "... n"]) -> tuple[Float[np.ndarray, "..."], Float[np.ndarray, "..."]]:
    """Bounds of polynomials over [0, 1], by their Bernstein coefficients."""
    coefficients = table @ _weights(table.shape[-1] - 1).T
    return coefficients.min(-1), coefficients.max(-1)


@cache
def _weights(degree: int) -> np.ndarray:
    orders = range(degree + 1)
    return np.array([[math.comb(i, j) / math.comb(degree, j) if j <= i else 0.0 for j in orders] for i in orders])
