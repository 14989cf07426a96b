"""Constrained minimum of a smooth objective: the best of many points are improved, and the results proved feasible."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float

# A function of arguments and unknowns (n,) that gives the objective () and the margins (n_margins,).
Parts = Callable[[Any, Array], tuple[Array, Array]]
SAMPLES = 4096  # number of points that are evaluated
IMPROVED = 8  # number of the best points at which a local search starts
BATCH = 512
# Required margins, tried one after the other until the result is proved feasible.
MARGINS = (1e-9, 1e-7, 1e-5, 1e-3)
STEPS = 200
AGREED = 1e-12


class Verified(NamedTuple):
    """Verdict of one point.

    Fields:
        feasible: whether it is proved feasible.
        margin: smallest margin.
    """

    feasible: bool
    margin: float


@partial(jax.jit, static_argnums=0)
def _screened(parts: Parts, arguments: Any, points: Array) -> tuple[Array, Array]:
    def one(x):
        value, margins = parts(arguments, x)
        return value, minimum_of(margins)

    return jax.vmap(one)(points)


@partial(jax.jit, static_argnums=0)
def _both(parts: Parts, arguments: Any, x: Array) -> tuple[Array, Array]:
    return parts(arguments, x)


@partial(jax.jit, static_argnums=0)
def _derivatives(parts: Parts, arguments: Any, x: Array) -> tuple[Array, Array]:
    return jax.jacfwd(lambda unknowns: parts(arguments, unknowns))(x)


def constrained_minimum(
    parts: Parts,
    arguments: Any,
    low: Float[np.ndarray, "n"],
    high: Float[np.ndarray, "n"],
    verified: Callable[[np.ndarray], Verified],
) -> Float[np.ndarray, "n"]:
    """Feasible unknowns with the smallest objective: the best of the local minima that are found."""
    from scipy.stats import qmc  # it takes a second to import

    fraction = qmc.Halton(len(low), seed=0).random(SAMPLES)
    points = low + (high - low) * fraction
    value, margin = in_batches(partial(_screened, parts, arguments), points, batch_size=BATCH)
    usable = np.isfinite(value) & np.isfinite(margin)
    margin = np.where(usable, margin, -np.inf)
    # Feasible points come first, in the order of their objectives, then all others in the order of their violations.
    order = np.lexsort((np.where(margin > 0.0, value, -margin), margin <= 0.0))
    best, verdict = points[order[0]], verified(points[order[0]])
    objective = float(value[order[0]])
    for start in points[order[:IMPROVED]]:
        candidate = _improved(parts, arguments, start, list(zip(low, high, strict=True)), verified)
        other, other_objective = verified(candidate), float(_both(parts, arguments, jnp.asarray(candidate))[0])
        if (other.feasible, -other_objective if other.feasible else other.margin) > (
            verdict.feasible,
            -objective if verdict.feasible else verdict.margin,
        ):
            best, verdict, objective = candidate, other, other_objective
    return best


def _improved(
    parts: Parts,
    arguments: Any,
    start: np.ndarray,
    bounds: list[tuple[float, float]],
    verified: Callable[[np.ndarray], Verified],
) -> np.ndarray:
    from scipy.optimize import minimize  # takes long to import

    def of(function, index: int) -> Callable[[np.ndarray], np.ndarray]:
        return lambda x: np.asarray(function(parts, arguments, jnp.asarray(x))[index])

    point = start
    for margin in MARGINS:
        limit = {"type": "ineq", "fun": lambda x, m=margin: of(_both, 1)(x) - m, "jac": of(_derivatives, 1)}
        with np.errstate(all="ignore"):
            answer = minimize(
                of(_both, 0),
                point,
                jac=of(_derivatives, 0),
                method="SLSQP",
                bounds=bounds,
                constraints=[limit],
                options={"maxiter": STEPS, "ftol": AGREED},
            )
        if not np.isfinite(answer.x).all():
            break
        point = answer.x
        if verified(point).feasible:
            break
    return point
