"""Polynomials through values at Chebyshev's nodes: bounds of their distance from an analytic function, and their range.

A function that is bounded by M on the ellipse with the semi-axes (rho + 1 / rho) / 2 and (rho - 1 / rho) / 2 around
[-1, 1] differs there from the polynomial of degree n through its values at the n + 1 nodes by at most

    4 M rho^-n / (rho - 1)

and a polynomial lies between its smallest and largest Bernstein coefficient (L. N. Trefethen, Approximation Theory and
Approximation Practice, theorem 8.2; G. Farin, Curves and Surfaces for CAGD).
"""

from __future__ import annotations

import functools
import math
from fractions import Fraction

import numpy as np

from cspr_jax.numerics.shapes import Float

DEGREE = 18
# Bound of Lebesgue's constant, the factor by which an error of the values can grow between the nodes.
LEBESGUE = 3.0
# Sums rho of the semi-axes of the ellipses that are tried; the smallest remainder counts.
RADII = (2.5, 6.0)


@functools.cache
def nodes() -> Float[np.ndarray, "n+1"]:
    """Chebyshev's nodes, including both ends."""
    return -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)


@functools.cache
def bernstein() -> Float[np.ndarray, "n+1 n+1"]:
    """Matrix from values at the nodes to Bernstein coefficients."""
    exact = [(1 + Fraction(float(x))) / 2 for x in nodes()]
    scale = max(node.denominator for node in exact)  # all denominators are powers of two
    full, columns = [int(node * scale) for node in exact], []
    for k, node in enumerate(full):
        # Lagrange's polynomial of one node, a product of linear ones: coefficients of (1 - t)^(n - j) t^j.
        powers, denominator = [1], 1
        for other in full[:k] + full[k + 1 :]:
            powers = [(scale - other) * a - other * b for a, b in zip([0, *powers], [*powers, 0], strict=True)]
            denominator *= node - other
        # Python rounds quotients of integers of any size only once; adding 0 avoids -0.
        columns.append([power / (math.comb(DEGREE, j) * denominator) + 0.0 for j, power in enumerate(powers)])
    return np.array(columns).T


def remainders(radii: Float[np.ndarray, "m"]) -> Float[np.ndarray, "m"]:
    """Factors from bounds on ellipses to bounds of the remainder."""
    return 4.0 * radii**-DEGREE / (radii - 1.0)


def semi_axes(radii: Float[np.ndarray, "m"]) -> Float[np.ndarray, "m 2"]:
    """Semi-axes of the ellipses."""
    return np.stack([0.5 * (radii + 1.0 / radii), 0.5 * (radii - 1.0 / radii)], axis=1)
