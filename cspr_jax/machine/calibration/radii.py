"""Radii of spheres that hold points with a probability, for points with normal errors.

A normal vector is L z with z of the unit covariance. The length of z and its direction u are independent, so that the
probability of a sphere is the mean over all directions of that of |z|^2 <= r^2 / u' L' L u, which is chi-square, or F
where the variance itself is estimated.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtr, fdtr

from cspr_jax.numerics.shapes import Float

# Nodes of the quadrature over directions, in the cosine of the inclination and in the azimuth.
NODES = 32


def _directions() -> tuple[np.ndarray, np.ndarray]:
    # Squares of the components of unit vectors (NODES^2, 3) and their weights.
    cosine, weights = np.polynomial.legendre.leggauss(NODES)
    azimuth = (np.arange(NODES) + 0.5) * (0.5 * np.pi / NODES)
    level, high = 1.0 - cosine[:, None] ** 2, np.broadcast_to(cosine[:, None] ** 2, (NODES, NODES))
    squares = np.stack([level * np.cos(azimuth) ** 2, level * np.sin(azimuth) ** 2, high], axis=-1)
    return squares.reshape(-1, 3), np.repeat(0.5 * weights / NODES, NODES)


def radius_of(covariance: Float[np.ndarray, "3 3"], probability: float, degrees: float = np.inf) -> float:
    """Radius of the sphere about a point that holds it with a probability; `degrees` of freedom of its variance."""
    variances = np.clip(np.linalg.eigvalsh(covariance), 0.0, None)
    if not variances[-1] > 0.0:
        return 0.0
    squares, weights = _directions()
    along = squares @ (variances / variances[-1])

    def excess(ratio: float) -> float:
        values = ratio**2 / np.maximum(along, np.finfo(float).tiny)
        inside = chdtr(3.0, values) if np.isinf(degrees) else fdtr(3.0, degrees, values / 3.0)
        return float(weights @ inside) - probability

    largest = 1.0
    while excess(largest) < 0.0:
        largest *= 2.0
    return float(np.sqrt(variances[-1]) * brentq(excess, 0.0, largest, xtol=1e-12))
