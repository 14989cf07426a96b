"""Determinants of the wrenches of unit tensions, and their derivatives.

A determinant is a sum of products of minors of three rows, and each minor is linear in each of its columns. So its
second derivatives need only first derivatives of the wrenches, and cofactors; all are polynomials, which stay finite
where the determinant vanishes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot, wrench_units
from cspr_jax.robots.model.state import State

# Number of rows of a minor: as many as a spatial platform has forces, or moments.
MINOR = 3
FORCES, MOMENTS = slice(0, MINOR), slice(MINOR, 2 * MINOR)


class Determinant(NamedTuple):
    """A determinant and its derivatives with respect to d coordinates.

    Fields:
        value: () the determinant.
        gradient: (d,) first derivatives.
        hessian: (d, d) second derivatives, without the part from second derivatives of the matrix.
        cofactors: (n, n) weights of second derivatives of the matrix in those of the determinant.
    """

    value: Array
    gradient: Array
    hessian: Array
    cofactors: Array


def unit_wrenches(robot: AnyRobot, state: State) -> Float[Array, "dof n_cables"]:
    """Wrenches of unit tensions, moments over the radius of the platform."""
    return robot.wrench_matrix(state) / wrench_units(robot)[:, None]


def determinant(robot: AnyRobot, state: State) -> Float[Array, ""]:
    """Determinant of the wrenches of unit tensions."""
    matrix = unit_wrenches(robot, state)
    if len(matrix) == MINOR:
        return _minors(matrix)[0]
    signs, others = _laplace(len(matrix))
    return jnp.dot(signs * _minors(matrix[FORCES]), _minors(matrix[MOMENTS])[others])


def with_derivatives(matrix: Callable[[Array], Array], point: Float[Array, "d"]) -> Determinant:
    """Determinant of a matrix, with derivatives."""
    values, derivatives = matrix(point), jax.jacfwd(matrix)(point)
    if len(values) == MINOR:
        value, (cofactors, hessian) = _minors(values)[0], _weighted(jnp.ones(1), values, derivatives)
    else:
        # Laplace's expansion: minors of the moments are constant weights of minors of the forces, and vice versa.
        (forces, by_forces), (moments, by_moments) = (
            (_minors(values[part]), jax.jacfwd(lambda point, part=part: _minors(matrix(point)[part]))(point))
            for part in (FORCES, MOMENTS)
        )
        signs, others = _laplace(len(values))
        of_forces, of_moments = signs * moments[others], (signs * forces)[others]
        upper, hessian = _weighted(of_forces, values[FORCES], derivatives[FORCES])
        lower, further = _weighted(of_moments, values[MOMENTS], derivatives[MOMENTS])
        both = by_forces.T @ (signs[:, None] * by_moments[others])
        value, cofactors, hessian = (
            jnp.dot(forces, of_forces),
            jnp.concatenate([upper, lower]),
            hessian + further + both + both.T,
        )
    return Determinant(value, jnp.einsum("ak,akd->d", cofactors, derivatives), hessian, cofactors)


def _minors(rows: Array) -> Array:
    # Return determinants of three rows for each choice of three columns, in the order of `combinations`. They are
    # computed number by number, since gathering columns takes much longer.
    columns = range(rows.shape[1])
    a, b, c = ([rows[i, j] for j in columns] for i in range(MINOR))
    pairs = {(i, j): a[i] * b[j] - a[j] * b[i] for i, j in itertools.combinations(columns, 2)}
    return jnp.stack(
        [
            pairs[i, j] * c[k] - pairs[i, k] * c[j] + pairs[j, k] * c[i]
            for i, j, k in itertools.combinations(columns, MINOR)
        ]
    )


def _weighted(weights: Array, rows: Array, derivatives: Array) -> tuple[Array, Array]:
    # Return derivatives of a weighted sum of minors: the first by the rows, (3, n), and the second by coordinates,
    # (d, d), from derivatives of the rows, (3, n, d).
    alternating, across = _alternating(rows.shape[1]), _alternating(MINOR)[0]
    products = jnp.einsum("klm,cm->klc", jnp.tensordot(weights, alternating, 1), rows)
    matrices = jnp.einsum("klc,abc->klab", products, across)
    cofactors = 0.5 * jnp.einsum("klab,bl->ak", matrices, rows)
    return cofactors, jnp.einsum("aki,klab,blj->ij", derivatives, matrices, derivatives)


@cache
def _alternating(count: int) -> np.ndarray:
    # Return signs of permutations of the columns of each minor, (minors, n, n, n).
    sets = list(itertools.combinations(range(count), MINOR))
    signs = np.zeros((len(sets), count, count, count))
    for number, columns in enumerate(sets):
        for first, second, third in itertools.permutations(range(MINOR)):
            sign = np.sign((second - first) * (third - first) * (third - second))
            signs[number, columns[first], columns[second], columns[third]] = sign
    return signs


@cache
def _laplace(count: int) -> tuple[Any, np.ndarray]:
    # Return signs of the minors of the first three rows in Laplace's expansion, and indices of complementary minors.
    sets = list(itertools.combinations(range(count), MINOR))
    rest = [tuple(column for column in range(count) if column not in columns) for columns in sets]
    signs = np.array([(-1.0) ** (sum(columns) - MINOR) for columns in sets])
    return signs, np.array([sets.index(columns) for columns in rest])
