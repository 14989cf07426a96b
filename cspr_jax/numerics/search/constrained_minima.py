"""Least value of a smooth objective under smallest margins: the best of many places are improved, and proved."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.batches import in_batches

if TYPE_CHECKING:
    from jaxtyping import Float

# A function of arguments and unknowns (n,) that gives the objective () and the margins (n_margins,).
Parts = Callable[[Any, Array], tuple[Array, Array]]
LOOKED_AT, IMPROVED, BATCH = 4096, 8, 512
# Smallest margins that are required, one after the other, until the answer is proved.
MARGINS = (1e-9, 1e-7, 1e-5, 1e-3)
STEPS, AGREED = 200, 1e-12


class Judged(NamedTuple):
    """Judgement of one place.

    Fields:
        feasible: whether it is proved feasible.
        margin: smallest margin.
    """

    feasible: bool
    margin: float


@partial(jax.jit, static_argnums=0)
def _screened(parts: Parts, arguments: Any, places: Array) -> tuple[Array, Array]:
    def one(x):
        value, margins = parts(arguments, x)
        return value, jnp.min(margins)

    return jax.vmap(one)(places)


@partial(jax.jit, static_argnums=0)
def _both(parts: Parts, arguments: Any, x: Array) -> tuple[Array, Array]:
    return parts(arguments, x)


@partial(jax.jit, static_argnums=0)
def _slopes(parts: Parts, arguments: Any, x: Array) -> tuple[Array, Array]:
    return jax.jacfwd(lambda unknowns: parts(arguments, unknowns))(x)


def least(
    parts: Parts,
    arguments: Any,
    low: Float[np.ndarray, "n"],
    high: Float[np.ndarray, "n"],
    judged: Callable[[np.ndarray], Judged],
) -> Float[np.ndarray, "n"]:
    """Unknowns with the least objective among feasible ones: a local minimum, or the best of several."""
    from scipy.stats import qmc  # it takes a second to import

    fraction = qmc.Halton(len(low), seed=0).random(LOOKED_AT)
    places = low + (high - low) * fraction
    value, margin = in_batches(partial(_screened, parts, arguments), places, batch_size=BATCH)
    usable = np.isfinite(value) & np.isfinite(margin)
    margin = np.where(usable, margin, -np.inf)
    # Feasible places come first, the smallest objective ahead; then the places that are nearest to being feasible.
    order = np.lexsort((np.where(margin > 0.0, value, -margin), margin <= 0.0))
    best, verdict = places[order[0]], judged(places[order[0]])
    size = float(value[order[0]])
    for start in places[order[:IMPROVED]]:
        candidate = _improved(parts, arguments, start, list(zip(low, high, strict=True)), judged)
        other, length = judged(candidate), float(_both(parts, arguments, jnp.asarray(candidate))[0])
        if (other.feasible, -length if other.feasible else other.margin) > (
            verdict.feasible,
            -size if verdict.feasible else verdict.margin,
        ):
            best, verdict, size = candidate, other, length
    return best


def _improved(
    parts: Parts,
    arguments: Any,
    start: np.ndarray,
    bounds: list[tuple[float, float]],
    judged: Callable[[np.ndarray], Judged],
) -> np.ndarray:
    from scipy.optimize import minimize  # likewise

    def of(function, index: int) -> Callable[[np.ndarray], np.ndarray]:
        return lambda x: np.asarray(function(parts, arguments, jnp.asarray(x))[index])

    place = start
    for margin in MARGINS:
        limit = {"type": "ineq", "fun": lambda x, m=margin: of(_both, 1)(x) - m, "jac": of(_slopes, 1)}
        with np.errstate(all="ignore"):
            answer = minimize(
                of(_both, 0),
                place,
                jac=of(_slopes, 0),
                method="SLSQP",
                bounds=bounds,
                constraints=[limit],
                options={"maxiter": STEPS, "ftol": AGREED},
            )
        if not np.isfinite(answer.x).all():
            break
        place = answer.x
        if judged(place).feasible:
            break
    return place
