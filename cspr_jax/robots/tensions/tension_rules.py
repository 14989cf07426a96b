"""Rules that choose the tensions of redundant cables: a table of all, and the functions of those that are not exact.

`tension_distribution` has the exact rules. Controllers use the closed forms; these cannot test a workspace, since they
may miss feasible tensions. Among 100,000 random poses of a suspended robot on eight cables the closed form found
tensions for 12 % of the feasible poses (35 % with wider limits) and the improved one for 98.8 % (99.6 %); neither found
infeasible ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.errors import InputError
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import double_precision, maximum_of, minimum_of, solved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.tension_rule_table import TENSION_RULES
from cspr_jax.robots.tensions.tension_distribution import (
    TENSION_ERROR,
    AllTensions,
    Distribution,
    all_tensions,
    beyond,
    centred,
    checked,
    keeps,
    least_norm,
    projected,
)
from cspr_jax.robots.tensions.tension_distribution_lanes import FREE, least_norms

BATCH = 4096
# Newton's method for the p-norm: over STEPS steps the weight of the barriers at limits decreases from FIRST_WEIGHT to
# LAST_WEIGHT, which the last LAST_STEPS steps keep.
STEPS = 60
LAST_STEPS = 12
FIRST_WEIGHT = 1e-1
LAST_WEIGHT = 1e-14
LENGTHS = 24  # number of lengths that are tried for each step
LONGEST_STEP = 0.99  # length of the longest step over the distance to the nearest limit
# Distances of tensions from the reference below this fraction of the largest one are raised to it: at a distance of 0 a
# second derivative would be infinite.
NEAR = 1e-9
# For cables without a largest tension the search begins below this multiple of a sum: the largest tension of least
# norm, the largest `tension_min` and the largest reference tension.
FAR = 10.0
EXPONENT = 4.0
MIN_EXPONENT = 1.01
MAX_EXPONENT = 100.0


@jax.jit
def closed_form(
    matrix: Float[Array, "dof n_cables"],
    wrench: Float[Array, "dof"],
    tension_min: Float[Array, "n_cables"],
    tension_max: Float[Array, "n_cables"],
) -> Distribution:
    """The tensions nearest to the middles of their ranges: mid + W^+ (w - W mid), Pott, Bruckmann and Mikelsons (2009).

    They may exceed limits even where other tensions keep them.
    """
    middle = 0.5 * (tension_min + tension_max)
    rest = all_tensions(matrix, wrench - matrix @ middle)
    solutions = all_tensions(matrix, wrench)
    tensions = middle + rest.min_norm
    answer = checked(matrix, wrench, tension_min, tension_max, solutions, tensions)
    return _as_found(answer, tensions, tension_min, tension_max)


@jax.jit
def improved_closed_form(
    matrix: Float[Array, "dof n_cables"],
    wrench: Float[Array, "dof"],
    tension_min: Float[Array, "n_cables"],
    tension_max: Float[Array, "n_cables"],
) -> Distribution:
    """The closed form, repeated with the cable that exceeds its limit most held at the limit, Pott (2013).

    A cable that is held is never released, so that feasible tensions are missed in rare cases.
    """
    solutions = all_tensions(matrix, wrench)
    middle = 0.5 * (tension_min + tension_max)
    aim = solutions.kernel @ (middle - solutions.min_norm)
    freedom, count = solutions.kernel.shape

    def hold(_, state):
        point, sides = state
        excess = beyond(solutions.tensions(point), tension_min, tension_max)
        free = jnp.where(sides == 0.0, jnp.abs(excess), 0.0)
        worst = jnp.argmax(free)
        is_worst = (jnp.arange(count) == worst) & (free[worst] > TENSION_ERROR * maximum_of(tension_max))
        sides = jnp.where(is_worst, jnp.sign(excess), sides)
        limits = jnp.where(sides > 0.0, tension_min, tension_max)
        offsets = jnp.where(sides == 0.0, 0.0, limits - solutions.min_norm)
        nearest = projected(solutions.kernel, sides != 0.0, aim, offsets)[0]
        return jnp.where(is_worst.any(), nearest, point), sides

    point, _ = lax.fori_loop(0, freedom, hold, (aim, jnp.zeros(count)))
    tensions = solutions.tensions(point)
    answer = checked(matrix, wrench, tension_min, tension_max, solutions, tensions)
    return _as_found(answer, tensions, tension_min, tension_max)


def _as_found(answer: Distribution, tensions: Array, low: Array, high: Array) -> Distribution:
    # Tensions of least norm replace tensions that exceed limits; if they keep the limits, the rule has missed them.
    return answer._replace(is_within=answer.is_within & keeps(tensions, low, high))


@jax.jit
def p_norm(
    matrix: Float[Array, "dof n_cables"],
    wrench: Float[Array, "dof"],
    tension_min: Float[Array, "n_cables"],
    tension_max: Float[Array, "n_cables"],
    reference: Float[Array, "n_cables"],
    exponent: Float[Array, ""],
) -> Distribution:
    """The tensions within limits whose p-norm about reference tensions is smallest; exact to 1e-6 of their range.

    By Newton's method with logarithmic barriers, whose weight decreases to 1e-14 of the largest value: active limits
    are then reached to 1e-10, weakly active ones to the square root of the weight.
    """
    solutions = all_tensions(matrix, wrench)
    magnitude = (
        maximum_of(jnp.abs(solutions.min_norm)) + maximum_of(jnp.abs(tension_min)) + maximum_of(jnp.abs(reference))
    )
    largest = jnp.where(jnp.isfinite(tension_max), tension_max, FAR * magnitude)
    start, slack = centred(matrix, wrench, tension_min, largest)
    # If only one point is feasible, that point is the result.
    is_open = slack > TENSION_ERROR * magnitude
    tensions = jnp.where(
        is_open,
        _along_barriers(solutions, start.tensions, tension_min, tension_max, reference, exponent),
        start.tensions,
    )
    return checked(matrix, wrench, tension_min, tension_max, solutions, tensions)


def _along_barriers(solutions: AllTensions, start: Array, low: Array, high: Array, reference: Array, p: Array) -> Array:
    freedom = solutions.kernel.shape[0]
    if freedom == 0:
        return start
    scale = maximum_of(jnp.abs(start - reference))
    scale = jnp.where(scale > 0.0, scale, 1.0)
    has_largest = jnp.isfinite(high)

    def slacks(tensions):
        above, below = tensions - low, jnp.where(has_largest, high - tensions, scale)
        return above / scale, jnp.where(has_largest, below / scale, 1.0)

    def value(tensions, weight):
        above, below = slacks(tensions)
        inside = (above > 0.0) & (below > 0.0)
        logs = jnp.log(jnp.where(inside, above, 1.0)) + jnp.log(jnp.where(inside, below, 1.0))
        distance = jnp.abs(tensions - reference) / scale
        each = jnp.exp(p * jnp.log(jnp.maximum(distance, NEAR))) / p - weight * logs
        return jnp.where(inside.all(), jnp.sum(each), jnp.inf)

    def step(k, tensions):
        part = jnp.minimum(k / (STEPS - LAST_STEPS), 1.0)
        weight = FIRST_WEIGHT * jnp.exp(part * np.log(LAST_WEIGHT / FIRST_WEIGHT))
        away = (tensions - reference) / scale
        distance = jnp.maximum(jnp.abs(away), NEAR)
        second_derivative = jnp.exp((p - 2.0) * jnp.log(distance))
        above, below = slacks(tensions)
        gradient = second_derivative * away + weight * (jnp.where(has_largest, 1.0 / below, 0.0) - 1.0 / above)
        diagonal = (p - 1.0) * second_derivative + weight * (
            jnp.where(has_largest, 1.0 / below**2, 0.0) + 1.0 / above**2
        )
        hessian = (solutions.kernel * diagonal[None]) @ solutions.kernel.T
        hessian = hessian + jnp.eye(freedom) * (1e-15 * jnp.trace(hessian) + 1e-300)
        direction = -solved(hessian, (solutions.kernel @ gradient)[:, None])[0][:, 0] @ solutions.kernel
        # Bound the step by the distance to the nearest limit.
        up, down = (
            jnp.where(has_largest, below / jnp.where(direction > 0.0, direction, 1.0), jnp.inf),
            above / jnp.where(direction < 0.0, -direction, 1.0),
        )
        free = minimum_of(jnp.where(direction > 0.0, up, jnp.where(direction < 0.0, down, jnp.inf)))
        lengths = jnp.minimum(1.0, LONGEST_STEP * free) * 0.5 ** np.arange(LENGTHS)
        tried = tensions[None] + (scale * lengths)[:, None] * direction[None]
        values = jax.vmap(value, (0, None))(tried, weight)
        best = jnp.argmin(values)
        return jnp.where(values[best] < value(tensions, weight), tried[best], tensions)

    return lax.fori_loop(0, STEPS, step, start)


class Rule(NamedTuple):
    """A rule that chooses tensions.

    Fields:
        function: function of matrix, wrench, smallest and largest tensions; for the p-norm also reference and exponent.
        is_bounded: whether every cable needs a largest tension.
    """

    function: Callable[..., Distribution]
    is_bounded: bool


def _centred(matrix: Array, wrench: Array, tension_min: Array, tension_max: Array) -> Distribution:
    return centred(matrix, wrench, tension_min, tension_max)[0]


_FUNCTIONS: dict[str, Callable[..., Distribution]] = {
    "least-norm": least_norm,
    "centred": _centred,
    "closed-form": closed_form,
    "improved-closed-form": improved_closed_form,
    "p-norm": p_norm,
}
RULES = {name: Rule(_FUNCTIONS[name], row.is_bounded) for name, row in TENSION_RULES.items()}


def by_rule(
    rule: str,
    matrix: Float[Array, "dof n_cables"],
    wrench: Float[Array, "dof"],
    tension_min: Float[Array, "n_cables"],
    tension_max: Float[Array, "n_cables"],
) -> Distribution:
    """Tensions in one state by a rule; the p-norm has the exponent 4 and `middles` as reference."""
    more = (middles(tension_min, tension_max), jnp.asarray(EXPONENT)) if rule == "p-norm" else ()
    return RULES[rule].function(matrix, wrench, tension_min, tension_max, *more)


def middles(tension_min: Float[Array, "..."], tension_max: Float[Array, "..."]) -> Float[Array, "..."]:
    """Middles of the ranges of the tensions, the default reference of the p-norm."""
    is_bounded = jnp.isfinite(tension_max)
    return jnp.where(is_bounded, 0.5 * (tension_min + jnp.where(is_bounded, tension_max, 0.0)), tension_min)


def distributions(
    matrices,
    wrenches,
    tension_min,
    tension_max,
    *,
    rule: str = "least-norm",
    reference=None,
    exponent: float = EXPONENT,
) -> Distribution:
    """Tensions of many poses by a rule."""
    if rule not in RULES:
        raise InputError("rule", rule, f"one of {', '.join(RULES)}")
    matrix, wrench = np.asarray(matrices, float), np.asarray(wrenches, float)
    if matrix.ndim != 3 or wrench.shape != matrix.shape[:2]:
        raise InputError(
            "wrenches",
            None,
            "must be (n, dof) of matrices (n, dof, n_cables)",
            problem=f"{matrix.shape}, {wrench.shape}",
        )
    count, _, cables = matrix.shape
    low, high = (_each(*x, (count, cables)) for x in (("tension_min", tension_min), ("tension_max", tension_max)))
    arguments = [matrix, wrench, low, high]
    if RULES[rule].is_bounded and not np.isfinite(high).all():
        raise InputError(
            "tension_max", None, f"must be finite with rule {rule}", problem="a cable without a largest tension"
        )
    if rule == "p-norm":
        if not MIN_EXPONENT <= exponent <= MAX_EXPONENT:
            raise InputError("exponent", exponent, f"from {MIN_EXPONENT} to {MAX_EXPONENT}")
        with double_precision():
            middle = np.asarray(middles(jnp.asarray(low), jnp.asarray(high)))
        about = middle if reference is None else _each("reference", reference, (count, cables))
        arguments += [about, np.full(count, float(exponent))]
    with double_precision():
        if not count:
            return Distribution(*map(jnp.asarray, (np.zeros((0, cables)), np.zeros(0), np.zeros(0, bool))))
        if rule == "least-norm" and cables - matrix.shape[1] in FREE:
            return _least_norms(*arguments)
        return in_batches(lambda batch: _COMPILED[rule](*batch), tuple(arguments), batch_size=BATCH)


_COMPILED = {name: jax.jit(jax.vmap(rule.function)) for name, rule in RULES.items()}


def _least_norms(matrix: np.ndarray, wrench: np.ndarray, low: np.ndarray, high: np.ndarray) -> Distribution:
    # Compute in lanes, and by the slow form for the poses that lanes cannot decide.
    answer, is_open = least_norms(matrix, wrench, low, high)
    again = np.flatnonzero(is_open)
    if len(again):
        open_cases = tuple(x[again] for x in (matrix, wrench, low, high))
        slow = in_batches(lambda batch: _COMPILED["least-norm"](*batch), open_cases, batch_size=BATCH)
        for old, new in zip(answer, slow, strict=True):
            old[again] = new
    return answer


def _each(name: str, values, shape: tuple[int, int]) -> np.ndarray:
    array = np.asarray(values, float)
    if array.shape not in ((), shape[1:], shape):
        raise InputError(name, None, f"must be {shape[1:]} or {shape}", problem=f"an array of shape {array.shape}")
    return np.ascontiguousarray(np.broadcast_to(array, shape))
