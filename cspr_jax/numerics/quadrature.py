"""Integrals by the rule of Gauss and Kronrod with 15 points, on intervals that are halved where its error is large.

Jumps and kinks of the integrand need not be known: the intervals around them shrink until they do not matter. Source of
points and weights: R. Piessens et al., QUADPACK, Springer 1983, rule QK15.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cspr_jax.numerics.shapes import Float

_HALF = np.array(
    [
        0.991455371120812639206854697526329,
        0.949107912342758524526189684047851,
        0.864864423359769072789712788640926,
        0.741531185599394439863864773280788,
        0.586087235467691130294144691693013,
        0.405845151377397166906606412076961,
        0.207784955007898467600689403773245,
        0.0,
    ]
)
_KRONROD = np.array(
    [
        0.022935322010529224963732008058970,
        0.063092092629978553290700663189204,
        0.104790010322250183839876322541518,
        0.140653259715525918745189590510238,
        0.169004726639267902826583426598550,
        0.190350578064785409913256402421014,
        0.204432940075298892414161999234649,
        0.209482141084727828012999174891714,
    ]
)
# Gauss' rule with 7 points has every second one.
_GAUSS = np.array(
    [
        0.129484966168869693270611432679082,
        0.279705391489276667901467771423780,
        0.381830050505118944950369775488975,
        0.417959183673469387755102040816327,
    ]
)
POINTS = np.concatenate([-_HALF, _HALF[-2::-1]])
WEIGHTS = np.concatenate([_KRONROD, _KRONROD[-2::-1]])
_OF_GAUSS = np.zeros(15)
_OF_GAUSS[1::2] = np.concatenate([_GAUSS, _GAUSS[-2::-1]])
NARROWEST = 1e-14  # width of an interval, as a fraction of all of them, that is not halved
# Fraction of the tolerance that one interval may take.
FRACTION = 0.01


def integrals(
    function: Callable[[np.ndarray], np.ndarray], edges: Float[np.ndarray, "n"], tolerance: float
) -> Float[np.ndarray, "m"]:
    """Integrals of m functions from the first edge to the last one, to a relative tolerance; zeros stay zero."""
    low, high = np.asarray(edges[:-1], float), np.asarray(edges[1:], float)
    full, total = float(edges[-1] - edges[0]), np.zeros(())
    while len(low):
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        values = function((middle[:, None] + half[:, None] * POINTS).ravel()).reshape(len(low), len(POINTS), -1)
        estimates = half[:, None] * np.einsum("p,kpm->km", WEIGHTS, values)
        errors = np.abs(estimates - half[:, None] * np.einsum("p,kpm->km", _OF_GAUSS, values))
        scale = np.abs(total + estimates.sum(0))
        is_open = (errors > FRACTION * tolerance * scale).any(1) & (half > NARROWEST * full)
        total = total + estimates[~is_open].sum(0)
        low, high, middle = low[is_open], high[is_open], middle[is_open]
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return total
