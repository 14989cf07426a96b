"""Differential evolution: smallest objective subject to required margins, for many problems at once.

A fixed set of points is evaluated in groups, and the best of each group form a population. Each generation moves every
member towards one of the best and along the difference of two others, and keeps the move if it is no worse; so steps
shrink with the population and follow the valleys in which it lies. The smallest of several margins has kinks, at which
a search by gradients would get stuck. All problems use the same points and moves, so that results are repeatable and do
not depend on other problems.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.numerics.batches import in_batches, in_parts
from cspr_jax.numerics.shapes import Float

# A function of arguments, one of `questions` and unknowns (d,) in [0, 1] that gives the objective () >= 0 and the
# smallest margin ().
Parts = Callable[[Any, Any, Array], tuple[Array, Array]]
# These numbers were chosen by measurement.
GROUP = 64  # number of points of a group, the best of which becomes a member
GENERATIONS = 2  # number of generations per member
LED = 10  # number of members per leader, one of the best towards which members move
STEPS = (0.4, 0.9)  # range of the lengths of steps
CHANCE = 0.9  # probability that an unknown takes part in a step
BATCH = 16  # number of problems of a batch
PART = 256  # number of problems that a thread takes at a time


class Moves(NamedTuple):
    """Moves of all generations.

    Fields:
        leader: (n_generations, n) index, among the leaders, of the one towards which each member is moved.
        first: (n_generations, n) index of the first member of the difference.
        second: (n_generations, n) index of the second member of the difference.
        step: (n_generations, n, 1) length of the step.
        is_moved: (n_generations, n, d) mask of the unknowns that take part.
    """

    leader: Any
    first: Any
    second: Any
    step: Any
    is_moved: Any


def moves_of(unknowns: int, population: int) -> Moves:
    """Moves, the same for all problems."""
    random = np.random.default_rng(0)
    shape = (GENERATIONS * population, population)
    # Pairing a permutation with itself, rolled by one, pairs no member with itself.
    first = random.permuted(np.tile(np.arange(population), (shape[0], 1)), axis=1)
    is_moved = random.random((*shape, unknowns)) < CHANCE
    np.put_along_axis(is_moved, random.integers(unknowns, size=(*shape, 1)), True, axis=2)
    leader = random.integers(_leaders(population), size=shape)
    return Moves(leader, first, np.roll(first, 1, axis=1), random.uniform(*STEPS, (*shape, 1)), is_moved)


def _leaders(population: int) -> int:
    return max(population // LED, 1)


@partial(jax.jit, static_argnums=0)
def _evolved(parts: Parts, arguments: Any, margins: Array, points: Array, moves: Moves, questions: Any) -> Array:
    def one(question: Any) -> Array:
        evaluate = partial(_evaluated, parts, arguments, question)
        value, margin = evaluate(points)

        def search(threshold: Array, search_moves: Moves) -> Array:
            rank = _rank(value, margin, threshold)
            groups = jnp.arange(len(points)).reshape(-1, GROUP)
            at = jnp.take_along_axis(groups, jnp.argmin(rank[groups], axis=1)[:, None], axis=1)[:, 0]
            members, rank = lax.scan(partial(_generation, evaluate, threshold), (points[at], rank[at]), search_moves)[0]
            return members[jnp.argmin(rank)]

        return jax.vmap(search)(margins, moves)

    return jax.vmap(one)(questions)


def _evaluated(parts: Parts, arguments: Any, question: Any, points: Array) -> tuple[Array, Array]:
    value, margin = jax.vmap(lambda x: parts(arguments, question, x))(points)
    usable = (value * 0.0 == 0.0) & (margin * 0.0 == 0.0)
    return jnp.where(usable, value, jnp.inf), jnp.where(usable, margin, -jnp.inf)


def _generation(
    evaluate: Callable[[Array], tuple[Array, Array]], threshold: Array, state: tuple[Array, Array], move: Moves
) -> tuple[tuple[Array, Array], None]:
    members, rank = state
    good = members[lax.top_k(-rank, _leaders(len(members)))[1]][move.leader]
    moved = members + move.step * (good - members + members[move.first] - members[move.second])
    # Go half of the way to a bound that a step would cross.
    moved = jnp.where(moved < 0.0, 0.5 * members, jnp.where(moved > 1.0, 0.5 * (members + 1.0), moved))
    moved = jnp.where(move.is_moved, moved, members)
    new = _rank(*evaluate(moved), threshold)
    better = new <= rank
    return (jnp.where(better[:, None], moved, members), jnp.where(better, new, rank)), None


def _rank(value: Array, margin: Array, threshold: Array) -> Array:
    # Lower ranks are better: points with the required margin come first, by objective, then the others, by margin.
    return jnp.where(margin >= threshold, -1.0 - 1.0 / (1.0 + value), -margin)


def evolved(
    parts: Parts, arguments: Any, questions: Any, *, unknowns: int, margins: tuple[float, ...], population: int
) -> Float[np.ndarray, "n n_margins d"]:
    """Best points of many problems, for each required margin."""
    from scipy.stats import qmc  # it takes a second to import

    points = qmc.Halton(unknowns, seed=0).random(GROUP * population)
    base_moves = moves_of(unknowns, population)
    # The search for each margin gets moves of its own, since one may find a point that another misses.
    moves = jax.tree.map(lambda x: np.stack([np.roll(x, i, axis=0) for i in range(len(margins))]), base_moves)
    kernel = partial(_evolved, parts, arguments, np.asarray(margins), points, moves)

    def part(index: slice) -> np.ndarray:
        return in_batches(kernel, jax.tree.map(lambda x: x[index], questions), batch_size=BATCH)

    return np.concatenate(in_parts(part, len(jax.tree.leaves(questions)[0]), PART))
