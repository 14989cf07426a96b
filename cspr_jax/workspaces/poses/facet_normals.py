"""Facet normals of a wrench matrix W, given by their products with the cables.

A facet normal c is normal to dof - 1 columns of W, and y = c . W is a vector of the row space with the fewest non-zero
components. These y characterise the wrenches that cables can supply. Tensions at a distance s from all limits give a
wrench w, W t = w, if and only if for each such y and any tensions t0 with W t0 = w the product y . t0 keeps a distance,
which grows with s, from the bounds that follow from the limits (hyperplane shifting: Bouchard, Gosselin and Moore 2010;
Gouttefarde and Krut 2010). Every wrench can be resisted if and only if the rank is full and each y has components of
both signs.

All y are computed from c or, with six components and at most eight cables, from the relations among the rows of the
null space. One lane a pose: all numbers are arrays (...) of one shape.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.linear.lanes import cross, dot, largest
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.statics.wrench_sets import spanning

CABLES = 6  # number of cables of a base block, in two groups of three
# Largest number of cables in addition to a base block.
MAX_OTHERS = 2
# A product of unit columns that is shorter than this at all tried poses is no normal.
NOTHING = 1e-12

Column = Sequence[Array]


class CableSubsets(NamedTuple):
    """Choices of dof - 1 cables with a facet normal, which is not normal to all other columns.

    Fields:
        table: (n_choices, n_cables) the dof - 1 chosen cables, then the others.
        counts: (n_choices, n_cables - dof + 1) 1 where the component of another cable can be nonzero, else 0; None: all
            can.
    """

    table: np.ndarray
    counts: np.ndarray | None


def choices_of(matrices: Float[np.ndarray, "n dof n_cables"]) -> CableSubsets:
    """Choices of dof - 1 cables that have a facet normal at some pose; four cables at one point never have one."""
    _check_finite(matrices)
    dof, count = matrices.shape[1:]
    chosen = spanning(count, dof)
    others = [np.setdiff1d(np.arange(count), row) for row in chosen]
    table = np.concatenate([chosen, np.array(others, int).reshape(len(chosen), -1)], axis=1).astype(np.int32)
    rows = [np.delete(np.arange(dof), k) for k in range(dof)]
    sizes = np.zeros((len(table), count - dof + 1))
    for matrix in matrices:
        columns = matrix[:, chosen].transpose(1, 0, 2)  # (n_choices, dof, dof - 1)
        normals = np.stack([(-1.0) ** k * np.linalg.det(columns[:, row]) for k, row in enumerate(rows)], -1)
        rest = matrix[:, table[:, dof - 1 :]]
        np.maximum(sizes, np.abs(np.einsum("sk,ksj->sj", normals, rest)), out=sizes)
    is_one = (sizes > NOTHING).any(1)
    counts = (sizes > NOTHING)[is_one]
    return CableSubsets(table[is_one], None if counts.all() else counts.astype(float))


def _check_finite(matrices: np.ndarray) -> None:
    if not len(matrices) or not np.isfinite(matrices).all():
        raise ValueError("structure follows from finite wrench matrices alone, at least one")


def normal(columns: Sequence[Column]) -> Column:
    """Normal to dof - 1 columns: their generalised cross product."""
    dof = len(columns) + 1
    if dof == 2:
        return (-columns[0][1], columns[0][0])
    if dof == 3:
        return cross(*columns)
    half = len(columns) - 2
    head, tail = _minors(columns[:half]), _minors(columns[half:])
    return [_laplace(head, tail, [row for row in range(dof) if row != k], (-1) ** (k + dof - 1)) for k in range(dof)]


def _minors(columns: Sequence[Column]) -> dict[tuple[int, ...], Array]:
    # Determinants of all choices of as many rows as there are columns.
    dof = len(columns[0])
    minors: dict[tuple[int, ...], Array] = {(row,): columns[0][row] for row in range(dof)}
    for order, column in enumerate(columns[1:], 2):
        larger = {}
        for rows in itertools.combinations(range(dof), order):
            terms = [column[row] * minors[rows[:i] + rows[i + 1 :]] for i, row in enumerate(rows)]
            larger[rows] = _signed_sum(terms, [(-1) ** (i + order - 1) for i in range(order)])
        minors = larger
    return minors


def _laplace(head: dict, tail: dict, rows: Sequence[int], sign: int) -> Array:
    # Determinant of some rows from minors of the first and of the last columns.
    terms, signs, order = list[Array](), list[int](), len(next(iter(head)))
    for chosen in itertools.combinations(range(len(rows)), order):
        rest = [index for index in range(len(rows)) if index not in chosen]
        terms.append(head[tuple(rows[i] for i in chosen)] * tail[tuple(rows[i] for i in rest)])
        signs.append(sign * (-1) ** (sum(chosen) + order * (order - 1) // 2))
    return _signed_sum(terms, signs)


def _signed_sum(terms: Sequence[Array], signs: Sequence[int]) -> Array:
    total = terms[0] if signs[0] > 0 else -terms[0]
    for term, sign in zip(terms[1:], signs[1:], strict=True):
        total = total + term if sign > 0 else total - term
    return total


def product(a: Sequence[Array], b: Sequence[Array]) -> Float[Array, "..."]:
    """Scalar product of vectors of any length."""
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def relation(rows: Sequence[Sequence[Array]]) -> Sequence[Array]:
    """Linear relation among rows of the null space, one more than its columns: a y that is 0 for all other cables."""
    if len(rows) == 2:
        return (rows[1][0], -rows[0][0])
    i, j, k = rows

    def minor(a, b):
        return a[0] * b[1] - a[1] * b[0]

    return (minor(j, k), minor(k, i), minor(i, j))


class Block(NamedTuple):
    """Tensions of six cables for some wrenches, times a common factor.

    Fields:
        tensions: six tensions for each wrench, in the order of the block.
        common: common factor: the cube of a volume times the determinant of the block.
        scale: magnitude of the numbers whose rounding errors are those of the tensions.
    """

    tensions: Sequence[Sequence[Array]]
    common: Array
    scale: Array


def block(columns: Sequence[Column], wrenches: Sequence[Column]) -> Block:
    """Tensions of six cables in two groups of three, by adjugates, without divisions."""
    a, c = [column[:3] for column in columns[:3]], [column[3:] for column in columns[:3]]
    adjugate = (cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1]))
    volume = dot(a[0], adjugate[0])

    def reduced(six):
        # Tensions of three cables that cancel the force, times the volume, and the remaining moment.
        tensions_for_force = [dot(row, six[:3]) for row in adjugate]
        left = tuple(volume * six[3 + i] - sum(c[j][i] * tensions_for_force[j] for j in range(3)) for i in range(3))
        return tensions_for_force, left

    first_tensions, lefts = zip(*[reduced(column) for column in columns[3:]], strict=True)
    inner = (cross(lefts[1], lefts[2]), cross(lefts[2], lefts[0]), cross(lefts[0], lefts[1]))
    determinant = dot(lefts[0], inner[0])
    tensions = []
    for wrench in wrenches:
        tensions_for_force, left = reduced(wrench)
        last = [dot(row, left) for row in inner]
        first = [
            tensions_for_force[j] * determinant - sum(first_tensions[n][j] * last[n] for n in range(3))
            for j in range(3)
        ]
        tensions.append([*first, *(volume * x for x in last)])
    # All tensions are products of two remaining moments and of factors of at most 1.
    maximum = largest([jnp.abs(x) for left in lefts for x in left])
    return Block(tensions, volume * determinant, maximum * maximum)


def base_order(matrices: Float[np.ndarray, "n 6 n_cables"]) -> tuple[int, ...]:
    """Order of the cables in which the first six, and the forces of the first three, are far from singular."""
    _check_finite(matrices)
    count = matrices.shape[2]

    def determinant(chosen, rows):
        return np.quantile(np.abs(np.linalg.det(matrices[:, :rows][:, :, list(chosen)])), 0.02)

    triples = {chosen: determinant(chosen, 3) for chosen in itertools.combinations(range(count), 3)}
    sixes = {chosen: determinant(chosen, CABLES) for chosen in itertools.combinations(range(count), CABLES)}

    def worth(pair):
        six, three = pair
        return sixes[six] * triples[three] ** 3

    pairs = [(six, three) for six in sixes for three in itertools.combinations(six, 3)]
    six, three = max(pairs, key=worth)
    last = [k for k in range(count) if k not in six]
    return (*three, *(k for k in six if k not in three), *last)
