"""Durations at which the verdict of a Bezier segment can change: roots of polynomials in r = (T / pi)^2.

Multiplied by r, the cubics of `margins` have coefficients that are polynomials in r, if the second control point is
given or follows from an acceleration at the start, middle = start + r acceleration (15). The smallest value of a cubic
on [-1, 1] can be zero only if its value at an end is zero, or if two roots in c coincide: then its discriminant, of
degree 8 in r at most, is zero.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.families.beziers.motion import powers
from cspr_jax.numerics.polynomials import product, total
from cspr_jax.numerics.shapes import Float


class Ends(NamedTuple):
    """Ends of n segments, and their second control points as functions of r.

    Fields:
        start: (n, 3) from the centroid of the spools, z down, m.
        end: (n, 3) likewise.
        middle: (n, 3) second control point for r = 0, m.
        middle_change: (n, 3) derivative of the second control point by r: 0, or the acceleration at the start, m/s^2.
    """

    start: np.ndarray
    end: np.ndarray
    middle: np.ndarray
    middle_change: np.ndarray

    def middles(self, durations: Float[np.ndarray, "n ..."]) -> Float[np.ndarray, "n ... 3"]:
        """Second control points for given durations."""
        r = (np.asarray(durations) / np.pi) ** 2
        more = (slice(None), *[None] * (r.ndim - 1))
        return self.middle[more] + self.middle_change[more] * r[..., None]


def critical_durations(
    rows: Float[np.ndarray, "n_cables 3"],
    arms: Float[np.ndarray, "n_cables 3"],
    normal: Float[np.ndarray, "3"],
    gravity: float,
    ends: Ends,
) -> list[np.ndarray]:
    """Durations between which no cable becomes taut or slack, and no depth below the spools changes sign."""
    # Use units in which r, and so the coefficients, are about 1.
    extent = np.abs(ends.end - ends.start).sum(1) + np.abs(ends.start).sum(1)
    unit = extent / gravity
    vectors = _vectors(ends, unit)
    polynomials = [*_of_cables(rows, arms, gravity, unit, vectors), *_of_depth(normal, vectors)]
    return [np.pi * np.sqrt(unit[i] * _positive_roots([table[i] for table in polynomials])) for i in range(len(unit))]


def _vectors(ends: Ends, unit: np.ndarray) -> list[np.ndarray]:
    # Return the coefficients A, B, C of (17), each (n, 3, 2), by powers of r in these units.
    constant = powers(ends.start, ends.middle, ends.end)
    nothing = np.zeros_like(ends.middle_change)
    change = powers(nothing, ends.middle_change * unit[:, None], nothing)
    return [np.stack(pair, axis=-1) for pair in zip(constant, change, strict=True)]


def _of_cables(
    rows: np.ndarray, arms: np.ndarray, gravity: float, unit: np.ndarray, vectors: list[np.ndarray]
) -> list[np.ndarray]:
    # Return pseudotensions times r at both ends, and the discriminants of the cubics.
    square, linear, constant = vectors
    # Weight per mass, r g, z down.
    weight = np.zeros((len(unit), 3, 2))
    weight[:, 2, 1] = gravity * unit
    first = total(2.0 * square, -weight)
    moments = [
        _cross(first, constant),
        total(total(-_cross(linear, constant), 2.0 * _cross(square, linear)), -_cross(weight, linear)),
        total(-4.0 * _cross(square, constant), -_cross(weight, square)),
        -3.0 * _cross(square, linear),
    ]
    forces = [first, -linear, -4.0 * square, 0.0 * square]
    polynomials = []
    for row, arm in zip(rows, arms, strict=True):
        f = [total(_dot(row, p), _dot(arm, t)) for p, t in zip(forces, moments, strict=True)]
        scale = sum(np.abs(x).max(-1, keepdims=True) for x in f)
        f = [x / np.where(scale > 0.0, scale, 1.0) for x in f]
        even, odd = total(f[0], f[2]), total(f[1], f[3])
        polynomials += [total(even, odd), total(even, -odd), _discriminant(f)]
    return polynomials


def _of_depth(normal: np.ndarray, vectors: list[np.ndarray]) -> list[np.ndarray]:
    square, linear, constant = (_dot(normal, x) for x in vectors)
    return [total(product(linear, linear), -4.0 * product(square, constant))]


def _discriminant(f: list[np.ndarray]) -> np.ndarray:
    # Return the discriminant of the cubic f0 + f1 c + f2 c^2 + f3 c^3.
    f0, f1, f2, f3 = f
    pairs = {"02": product(f0, f2), "13": product(f1, f3), "03": product(f0, f3), "11": product(f1, f1)}
    terms = [
        18.0 * product(product(f1, f2), pairs["03"]),
        -4.0 * product(pairs["02"], product(f2, f2)),
        product(pairs["11"], product(f2, f2)),
        -4.0 * product(pairs["13"], pairs["11"]),
        -27.0 * product(pairs["03"], pairs["03"]),
    ]
    discriminant = terms[0]
    for term in terms[1:]:
        discriminant = total(discriminant, term)
    return discriminant


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    # Return cross products of vectors (n, 3, d) whose components are polynomials.
    pairs = [(1, 2), (2, 0), (0, 1)]
    return np.stack([product(a[:, i], b[:, j]) - product(a[:, j], b[:, i]) for i, j in pairs], axis=1)


def _dot(vector: np.ndarray, table: np.ndarray) -> np.ndarray:
    return np.einsum("i,nid->nd", vector, table)


def _positive_roots(tables: list[np.ndarray]) -> np.ndarray:
    # Keep roots that rounding has moved off the real axis: durations between roots are tested anyway.
    roots = np.concatenate([np.roots(table[::-1]) for table in tables if np.isfinite(table).all()])
    near = np.abs(roots.imag) <= 1e-3 * np.abs(roots)
    return np.unique(roots.real[near & (roots.real > 0.0) & np.isfinite(roots)])
