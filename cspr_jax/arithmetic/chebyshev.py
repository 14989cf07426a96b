"""Polynomials through values at Chebyshev's nodes: bounds of their distance from an analytic function, and their range.

A function that is bounded by M on the ellipse with the semi-axes (rho + 1 / rho) / 2 and (rho - 1 / rho) / 2 around
[-1, 1] differs there from the polynomial of degree n through its values at the n + 1 nodes by at most

    4 M rho^-n / (rho - 1)

and a polynomial lies between its smallest and largest Bernstein coefficient (L. N. Trefethen, Approximation Theory and
Approximation Practice, theorem 8.2; G. Farin, Curves and Surfaces for CAGD).
"""

import functools
import math
from fractions import Fraction

import numpy as np

DEGREE = 18
# Bound of Lebesgue's constant of the nodes, by which an error of the values can grow between them.
LEBESGUE = 3.0
# Sizes rho of the ellipse; the ellipse with the smaller remainder counts.
RADII = (2.5, 6.0)


@functools.cache
def nodes() -> np.ndarray:
    """Chebyshev's nodes, both ends among them.

    Returns:
        (n + 1,) in [-1, 1], increasing.
    """
    return -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)


@functools.cache
def bernstein() -> np.ndarray:
    """Matrix from values at the nodes to Bernstein coefficients.

    Returns:
        (n + 1, n + 1), computed in fractions and rounded once.
    """
    places = [(1 + Fraction(float(x))) / 2 for x in nodes()]
    rows = [
        [Fraction(math.comb(DEGREE, j)) * t**j * (1 - t) ** (DEGREE - j) for j in range(DEGREE + 1)]
        + [Fraction(int(i == k)) for k in range(DEGREE + 1)]
        for i, t in enumerate(places)
    ]
    for k in range(DEGREE + 1):
        sizes = [abs(row[k]) for row in rows[k:]]
        pivot = k + sizes.index(max(sizes))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(DEGREE + 1):
            if i != k and rows[i][k]:
                rows[i] = [x - rows[i][k] * y for x, y in zip(rows[i], rows[k], strict=True)]
    return np.array([[float(x) for x in row[DEGREE + 1 :]] for row in rows])


def remainders(radii: np.ndarray) -> np.ndarray:
    """Factors from bounds on ellipses to bounds of the remainder.

    Args:
        radii: (m,) rho, above 1.

    Returns:
        (m,).
    """
    return 4.0 * radii**-DEGREE / (radii - 1.0)


def semi_axes(radii: np.ndarray) -> np.ndarray:
    """Semi-axes of the ellipses.

    Args:
        radii: (m,) rho, at least 1.

    Returns:
        (m, 2) along the axis and across.
    """
    return np.stack([0.5 * (radii + 1.0 / radii), 0.5 * (radii - 1.0 / radii)], axis=1)
