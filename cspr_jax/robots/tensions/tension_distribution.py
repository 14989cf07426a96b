"""Tensions of a robot with redundant cables, in one state: those of least norm, or the farthest from their limits.

All tensions that give a wrench are t = t0 + N^T x, with t0 of least norm and the rows of N an orthonormal basis of
tensions that give no wrench, so that the tensions of least norm within limits have the shortest feasible x. With one or
two components of x (d + 1 or d + 2 cables) this is the feasible point nearest to 0 among 0 itself, the point of each
limit's line nearest to 0, and the intersections of two such lines. With more components, the limit that is exceeded
most is fixed, one after the other, as in the improved closed form of Pott (2013); but a fixed limit is released if its
multiplier becomes negative (Goldfarb and Idnani 1983), so that the result is exact: if none is found, none exists.

The largest distance from the limits is the distance of the wrench from the nearest face of `wrench_sets`.
"""

from __future__ import annotations

import functools
import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.errors import InputError
from cspr_jax.numerics.elementary import maximum_of, minimum_of, solved
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.robots.statics.wrench_sets import FLAT, beside_faces, face_distances, one_sided_faces

WITHIN = TOUCHED  # largest violation of a limit that counts as kept, over the largest tension
TENSION_ERROR = 1e-11  # the same for comparing candidates
# A unit vector depends linearly on others if its component normal to them is shorter than this.
DEPENDENT = 1e-10
INDEPENDENT = 1e-7  # the same, for limits from which derivatives follow
# Largest number of steps of the search for active limits, over the number of cables; random cases take fewer than two.
LONGEST = 10


class Distribution(NamedTuple):
    """Tensions of all cables in one state.

    Fields:
        tensions: (n_cables,) N. Where no tensions are feasible, or a rule finds none, those of least norm without
            limits. They may not be finite where the cables do not span all components of a wrench.
        residual: () length of W t - w, over 1 + the length of w.
        is_within: () whether all limits are kept, to 1e-9 of the largest tension, and W has full rank.
    """

    tensions: Array
    residual: Array
    is_within: Array


class AllTensions(NamedTuple):
    """All tensions that give a wrench: min_norm + x @ kernel.

    Fields:
        min_norm: (n_cables,) tensions of least norm, N.
        kernel: (n_free, n_cables) orthonormal rows of tensions that give no wrench, one for each redundant cable.
        is_regular: () whether the cables span all components of a wrench.
    """

    min_norm: Array
    kernel: Array
    is_regular: Array

    def tensions(self, point: Float[Array, "m"]) -> Float[Array, "n_cables"]:
        """Tensions of a given x."""
        return self.min_norm + point @ self.kernel


@jax.jit
def least_norm(
    matrix: Float[Array, "dof n_cables"],
    wrench: Float[Array, "dof"],
    tension_min: Float[Array, "n_cables"],
    tension_max: Float[Array, "n_cables"],
) -> Distribution:
    """Tensions of least norm within limits."""
    solutions = all_tensions(matrix, wrench)
    tensions = solutions.tensions(_shortest(solutions, tension_min, tension_max))
    return checked(matrix, wrench, tension_min, tension_max, solutions, tensions)


@jax.jit
def centred(
    matrix: Float[Array, "dof n_cables"],
    wrench: Float[Array, "dof"],
    tension_min: Float[Array, "n_cables"],
    tension_max: Float[Array, "n_cables"],
) -> tuple[Distribution, Array]:
    """The tensions that are farthest from their limits; among these, those of least norm."""
    solutions = all_tensions(matrix, wrench)
    tensions, largest = _most_central(matrix, tension_min, tension_max, solutions.min_norm, solutions.kernel)
    answer = checked(matrix, wrench, tension_min, tension_max, solutions, tensions)
    return answer, jnp.where(solutions.is_regular, largest, -jnp.inf)


@jax.custom_jvp
def _most_central(matrix: Array, low: Array, high: Array, min_norm: Array, kernel: Array) -> tuple[Array, Array]:
    # The central tensions, and their largest distance from the limits.
    solutions = AllTensions(min_norm, kernel, jnp.asarray(True))
    largest, _ = _largest_distance(matrix, low, high, solutions)
    inwards = jnp.where(jnp.isfinite(largest), largest, 0.0)
    return solutions.tensions(_shortest(solutions, low + inwards, high - inwards)), largest


@_most_central.defjvp
def _most_central_derivatives(primals, tangents):
    # Cables of the nearest face are at their limits even where symmetry alone would bring them there: the search for
    # the shortest tensions may then name too few limits, from which the same tensions follow, but other derivatives.
    values = _most_central(*primals)

    def followed(matrix, low, high, min_norm, kernel):
        solutions = AllTensions(min_norm, kernel, jnp.asarray(True))
        largest, nearest = _largest_distance(matrix, low, high, solutions)
        inwards = jnp.where(jnp.isfinite(largest), largest, 0.0)
        low, high = low + inwards, high - inwards
        sides = _independent(kernel, nearest, _sides_at(values[0], low, high))
        return solutions.tensions(_at_limits(solutions, low, high, sides)), largest

    return values, jax.jvp(followed, primals, tangents)[1]


def _sides_at(tensions: Array, low: Array, high: Array) -> Array:
    # Limits that tensions are at, with the signs of `_limits_reached`.
    near = WITHIN * maximum_of(jnp.abs(tensions))
    return jnp.where(jnp.abs(tensions - low) <= near, 1.0, jnp.where(jnp.abs(tensions - high) <= near, -1.0, 0.0))


def _independent(kernel: Array, products: Array, others: Array) -> Array:
    """Sides of cables with independent columns of the kernel: as many as there are, those of the face first.

    The relation among the cables of a face gives the limit of one of them: best, that of the largest product.
    """
    kernel, products, others = lax.stop_gradient((kernel, products, others))
    freedom, count = kernel.shape
    beyond_face = 1.0 + maximum_of(jnp.abs(products)) + jnp.where(others == 0.0, 1.0, 0.0)
    order = jnp.argsort(jnp.where(products != 0.0, jnp.abs(products), beyond_face))

    def hold(carry, k):
        rest, sides = carry
        side = jnp.where(products[k] != 0.0, jnp.sign(products[k]), others[k])
        square = jnp.sum(rest[:, k] ** 2)
        is_held = (side != 0.0) & (square > INDEPENDENT**2)
        unit = rest[:, k] / jnp.sqrt(jnp.where(is_held, square, 1.0))
        rest = jnp.where(is_held, rest - unit[:, None] * (unit @ rest)[None], rest)
        return (rest, jnp.where(is_held & (jnp.arange(count) == k), side, sides)), None

    return lax.scan(hold, (kernel, jnp.zeros(count)), order)[0][1] if freedom else jnp.zeros(count)


def checked(
    matrix: Float[Array, "dof n_cables"],
    wrench: Float[Array, "dof"],
    low: Float[Array, "n_cables"],
    high: Float[Array, "n_cables"],
    solutions: AllTensions,
    tensions: Float[Array, "n_cables"],
) -> Distribution:
    """Tensions with their residual and verdict."""
    tensions = jnp.where(keeps(tensions, low, high), tensions, solutions.min_norm)
    residual = jnp.linalg.norm(matrix @ tensions - wrench) / (1.0 + jnp.linalg.norm(wrench))
    return Distribution(tensions, residual, solutions.is_regular & keeps(tensions, low, high))


def keeps(
    tensions: Float[Array, "n_cables"], low: Float[Array, "n_cables"], high: Float[Array, "n_cables"]
) -> Bool[Array, ""]:
    """Tell whether tensions keep their limits, to 1e-9 of the largest."""
    return maximum_of(jnp.abs(beyond(tensions, low, high))) <= WITHIN * maximum_of(jnp.abs(tensions))


def beyond(tensions: Float[Array, "..."], low: Float[Array, "..."], high: Float[Array, "..."]) -> Float[Array, "..."]:
    """Signed violation: by how much tensions are below their smallest value (positive) or above their largest."""
    return jnp.maximum(low - tensions, 0.0) - jnp.maximum(tensions - high, 0.0)


def all_tensions(matrix: Float[Array, "dof n_cables"], wrench: Float[Array, "dof"]) -> AllTensions:
    """All tensions that give a wrench."""
    dof, count = matrix.shape
    if count < dof:
        raise InputError("matrix", None, f"must be {dof} or more, one a cable", problem=f"{count} columns")
    frame, along, left = _frame(matrix, wrench)
    return AllTensions(along[:dof] @ frame[:dof], frame[dof:], minimum_of(left[:dof]) > FLAT * maximum_of(left[:dof]))


def _frame(matrix: Array, wrench: Array) -> tuple[Array, Array, Array]:
    """Orthonormal rows (n, n), those of W first; (n,) their products with tensions; (n,) their lengths before scaling.

    By Gram and Schmidt, always with the longest vector left: of the rows of W, then of unit vectors, whose products
    have no meaning.
    """
    dof, count = matrix.shape
    is_row = np.arange(dof + count) < dof

    def take(carry, k):
        rest, products, frame, along = carry
        square = jnp.where(is_row == (k < dof), jnp.sum(rest**2, axis=1), -1.0)
        index = jnp.argmax(square)
        # Subtract the components along other rows once more, since rounding has left some.
        again = frame @ rest[index]
        vector = rest[index] - again @ frame
        length = jnp.linalg.norm(vector)
        unit, product = vector / length, (products[index] - jnp.dot(again, along)) / length
        parts, is_next = rest @ unit, jnp.arange(count) == k
        rest, products = rest - parts[:, None] * unit[None], products - parts * product
        frame, along = jnp.where(is_next[:, None], unit[None], frame), jnp.where(is_next, product, along)
        return (rest, products, frame, along), square[index]

    none = jnp.zeros(count)
    start = jnp.concatenate([matrix, jnp.eye(count)]), jnp.concatenate([wrench, none]), jnp.zeros((count, count)), none
    (_, _, frame, along), square = lax.scan(take, start, jnp.arange(count))
    return frame, along, lax.stop_gradient(jnp.sqrt(square))


def _shortest(solutions: AllTensions, low: Array, high: Array) -> Array:
    """The shortest x (r,) within limits; where there is none, an x that exceeds them little."""
    freedom = solutions.kernel.shape[0]
    if freedom == 0:
        return jnp.zeros(0)
    if freedom > 2:
        return _at_limits(solutions, low, high, _limits_reached(solutions, low, high))
    points, is_point = _candidates(solutions, low, high)
    tensions = solutions.min_norm[None] + points @ solutions.kernel
    excess = maximum_of(jnp.abs(beyond(tensions, low[None], high[None])), axis=1)
    is_within = is_point & (excess <= TENSION_ERROR * maximum_of(jnp.abs(tensions), axis=1))
    # If only one point is feasible, rounding may exclude it: then take the smallest violation.
    worse = jnp.where(is_within.any(), jnp.where(is_within, jnp.sum(points**2, axis=1), jnp.inf), excess)
    return points[jnp.argmin(jnp.where(is_point, worse, jnp.inf))]


def _candidates(solutions: AllTensions, low: Array, high: Array) -> tuple[Array, Array]:
    """Candidates for the shortest x of one or two components, (k, r), and a mask of those that exist."""
    freedom, count = solutions.kernel.shape
    rows = jnp.concatenate([solutions.kernel.T, solutions.kernel.T])
    limits = jnp.concatenate([low, high])
    is_limit = jnp.isfinite(limits)
    offsets = jnp.where(is_limit, limits, 0.0) - jnp.concatenate([solutions.min_norm, solutions.min_norm])
    square = jnp.sum(rows**2, axis=1)
    is_line = is_limit & (square > FLAT**2)
    feet = rows * (offsets / jnp.where(is_line, square, 1.0))[:, None]
    points, is_point = jnp.concatenate([jnp.zeros((1, freedom)), feet]), jnp.concatenate([np.array([True]), is_line])
    if freedom == 1:
        return points, is_point
    one, other = _pairs(count)
    rotated = jnp.stack([rows[:, 1], -rows[:, 0]], axis=1)
    product = jnp.sum(rows[one] * rotated[other], axis=1)
    meet = is_line[one] & is_line[other] & (jnp.abs(product) > FLAT)
    crossings = offsets[one][:, None] * rotated[other] - offsets[other][:, None] * rotated[one]
    crossings = crossings / jnp.where(meet, product, 1.0)[:, None]
    return jnp.concatenate([points, crossings]), jnp.concatenate([is_point, meet])


@functools.cache
def _pairs(count: int) -> tuple[np.ndarray, np.ndarray]:
    # Pairs of limits of two different cables, by index among 2n limits, of which smallest tensions come first.
    pairs = [pair for pair in itertools.combinations(range(2 * count), 2) if (pair[1] - pair[0]) % count]
    return np.array(pairs)[:, 0], np.array(pairs)[:, 1]


class _ActiveSet(NamedTuple):
    # State of the search for the active limits of the shortest x. At each step x = multipliers @ kernel.T is the
    # shortest x for some of the limits.
    point: Array  # (r,)
    multipliers: Array  # (n,) with the signs of `sides`, and of the sought limit
    sides: Array  # (n,) 1 held at its smallest tension, -1 at its largest, 0 free
    sought: Array  # () the cable whose limit is next
    is_seeking: Array  # ()
    is_stuck: Array  # ()
    steps: Array  # ()


def _limits_reached(solutions: AllTensions, low: Array, high: Array) -> Array:
    """Active limits of the shortest x, (n,): 1 the smallest tension, -1 the largest, 0 none."""
    solutions, low, high = lax.stop_gradient((solutions, low, high))
    freedom, count = solutions.kernel.shape

    def is_open(search):
        tensions = solutions.tensions(search.point)
        worst = maximum_of(jnp.abs(beyond(tensions, low, high)))
        is_beyond = worst > TENSION_ERROR * maximum_of(jnp.abs(tensions))
        return (search.is_seeking | is_beyond) & ~search.is_stuck & (search.steps < LONGEST * count)

    none, no = jnp.zeros(count), jnp.asarray(False)
    # Tensions that are not finite cannot be brought within limits.
    is_lost = ~(jnp.isfinite(solutions.min_norm).all() & jnp.isfinite(solutions.kernel).all())
    start = _ActiveSet(jnp.zeros(freedom), none, none, jnp.asarray(0), no, is_lost, jnp.asarray(0))
    return lax.while_loop(is_open, lambda search: _step(solutions, low, high, search), start).sides


def _step(solutions: AllTensions, low: Array, high: Array, search: _ActiveSet) -> _ActiveSet:
    """One step towards the sought limit, until it is reached or a fixed limit must be released."""
    excess = beyond(solutions.tensions(search.point), low, high)
    sought = jnp.where(search.is_seeking, search.sought, jnp.argmax(jnp.abs(excess)))
    is_sought = jnp.arange(excess.size) == sought
    side, distance = jnp.sign(excess[sought]), jnp.abs(excess[sought])
    is_held = search.sides != 0.0
    direction, loss = projected(solutions.kernel, is_held, side * solutions.kernel[:, sought], jnp.zeros_like(excess))
    square = jnp.dot(direction, direction)
    is_blocked = (is_held.sum() >= direction.size) | (square <= DEPENDENT**2)
    full = jnp.where(is_blocked, jnp.inf, distance / jnp.where(is_blocked, 1.0, square))
    losing = is_held & (search.sides * loss > 0.0)
    until = jnp.where(losing, search.multipliers / jnp.where(losing, loss, 1.0), jnp.inf)
    first = jnp.argmin(until)
    length = jnp.minimum(full, until[first])
    is_stuck, is_reached = jnp.isinf(length), full <= until[first]
    length = jnp.where(is_stuck, 0.0, length)
    let_go = (jnp.arange(excess.size) == first) & ~is_reached
    multipliers = search.multipliers + length * (jnp.where(is_sought, side, 0.0) - loss)
    sides = jnp.where(is_sought & is_reached & ~is_stuck, side, search.sides)
    return _ActiveSet(
        point=search.point + jnp.where(is_blocked, 0.0, length) * direction,
        multipliers=jnp.where(let_go, 0.0, multipliers),
        sides=jnp.where(let_go, 0.0, sides),
        sought=sought,
        is_seeking=~is_reached,
        is_stuck=is_stuck,
        steps=search.steps + 1,
    )


def _at_limits(solutions: AllTensions, low: Array, high: Array, sides: Array) -> Array:
    # Shortest x at which all tensions whose side is not 0 are at their limits.
    limits = jnp.where(sides > 0.0, low, jnp.where(sides < 0.0, high, 0.0))
    offsets = jnp.where(sides == 0.0, 0.0, limits - solutions.min_norm)
    return projected(solutions.kernel, sides != 0.0, jnp.zeros(solutions.kernel.shape[0]), offsets)[0]


def projected(
    kernel: Float[Array, "m n_cables"],
    is_held: Bool[Array, "n_cables"],
    vector: Float[Array, "m"],
    products: Float[Array, "n_cables"],
) -> tuple[Float[Array, "m"], Float[Array, "n_cables"]]:
    """The vector nearest to a given one that has prescribed products with the held columns of the kernel."""
    freedom = kernel.shape[0]
    held = jnp.where(is_held[None], kernel, 0.0)
    above = jnp.concatenate([jnp.eye(freedom), held], axis=1)
    below = jnp.concatenate([held.T, jnp.diag(jnp.where(is_held, 0.0, 1.0))], axis=1)
    right = jnp.concatenate([vector, jnp.where(is_held, products, 0.0)])
    solution = solved(jnp.concatenate([above, below]), right[:, None])[0][:, 0]
    return solution[:freedom], solution[freedom:]


def _largest_distance(matrix: Array, low: Array, high: Array, solutions: AllTensions) -> tuple[Array, Array]:
    """Largest distance r from limits, () N: the minimum of half of each cable's range and of what each face allows.

    Also the products (n,) of the nearest face with the cables, which are at this distance from their smallest tensions
    where the product is positive, from their largest ones where it is negative; 0 for all other cables.
    """
    dof, count = matrix.shape
    if count == dof:
        return _smallest(jnp.concatenate([solutions.min_norm - low, high - solutions.min_norm])), jnp.zeros(count)
    others, products = beside_faces(count, dof), one_sided_faces(matrix, solutions.kernel)

    def slack(along, cables):
        # The slack is infinite where a cable without a largest tension can pull beyond the face.
        reached = jnp.where(along < 0.0, high[cables], low[cables])
        return jnp.sum(along * (solutions.min_norm[cables] - reached), axis=-1)

    both, cables = jnp.concatenate([products, -products]), np.concatenate([others, others])
    each = lax.stop_gradient(face_distances(both, slack(both, cables), jnp.ones(both.shape)))
    # Compute the distance from the nearest face again, differentiably, without infinite limits.
    nearest = jnp.argmin(each)
    is_face = jnp.isfinite(each[nearest])
    along = jnp.where(is_face, both[nearest], 0.0)
    norm = jnp.where(is_face, jnp.sum(jnp.where(along < 0.0, -along, along)), 1.0)
    distance = jnp.where(is_face, slack(along, jnp.asarray(cables)[nearest]) / norm, jnp.inf)
    half, narrowest = 0.5 * _smallest(high - low), jnp.arange(count) == jnp.argmin(high - low)
    is_half = (half < distance) | jnp.isnan(half)
    products = jnp.zeros(count).at[jnp.asarray(cables)[nearest]].set(along)
    return jnp.where(is_half, half, distance), jnp.where(is_half, jnp.where(narrowest, 1.0, 0.0), products)


def _smallest(values: Array) -> Array:
    # The smallest value, with the derivatives of the first of equal ones; XLA's minimum has their mean.
    return values[jnp.argmin(values)]
