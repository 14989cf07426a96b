"""Compiled margins of many poses: loops over the facet normals of a robot, one lane a pose.

The body of a loop is compiled once for any number of cables. Its result is one complex number, with the lower and the
upper bound of the margin as its parts: with two results XLA would compute everything twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.linear.lanes import largest
from cspr_jax.numerics.shapes import Float, Shaped
from cspr_jax.workspaces.poses import margins
from cspr_jax.workspaces.poses.facet_normals import (
    CABLES,
    MAX_OTHERS,
    CableSubsets,
    Column,
    block,
    normal,
    product,
    relation,
)
from cspr_jax.workspaces.poses.margins import BLOCK_EPSILONS, EPSILONS, FacetLimits, Wrenches, length, one_norm

# Up to this number of facet normals the loop is unrolled.
UNROLLED = 10


class TensionLimits(NamedTuple):
    """Limits of the tensions, of one robot or, with a last dimension (n,), of the robot of each pose.

    Fields:
        low: (n_cables,) smallest tensions, N.
        high: (n_cables,) largest tensions, inf for none, N.
        measure: (dof,) factors of the components of a normal in the length by which a capacity margin is divided.
    """

    low: Array
    high: Array
    measure: Array


@partial(jax.jit, static_argnames=("measure", "is_bounded"))
def by_normals(
    components: Sequence[Array],
    loss: Float[Array, "n"],
    wrenches: Wrenches,
    tension_limits: TensionLimits,
    choices: CableSubsets,
    *,
    measure: str,
    is_bounded: bool,
) -> Shaped[Array, "..."]:
    """Margins of poses of any robot, from the normals to dof - 1 cables."""
    dof, template = len(components), components[0][0]
    lanes = wrenches._replace(
        points=[[jnp.broadcast_to(x, template.shape) for x in point] for point in wrenches.points]
    )
    noise = jnp.asarray(EPSILONS * jnp.finfo(template.dtype).eps, template.dtype) * loss
    tension_bound = jnp.where(jnp.isinf(tension_limits.high), 0.0, jnp.abs(tension_limits.high)) + jnp.abs(
        tension_limits.low
    )
    wrench_bound = _wrench_bound(wrenches)

    def facet(row, limits):
        chosen = [[_row(component, row[i]) for component in components] for i in range(dof - 1)]
        across = normal(chosen) if chosen else [jnp.ones_like(template)]
        rest = [[_row(component, k) for component in components] for k in row[dof - 1 :]]
        entries = [product(across, column) for column in rest]
        low, high, counts, scale = limits
        over = one_norm(entries)
        if measure == "capacity":
            over = length([x * tension_limits.measure[k] for k, x in enumerate(across)])
        error = 2.0 * noise * (scale + wrench_bound)
        return _facet_limits(entries, low, high, counts, over, noise, error), margins.supports(across, lanes)

    rest = choices.table[:, dof - 1 :]
    limits = tension_limits.low[rest], tension_limits.high[rest], choices.counts, jnp.sum(tension_bound[rest], axis=1)
    return _smallest_margin(
        facet, choices.table, limits, template, tension_limits, measure=measure, is_bounded=is_bounded
    )


def _facet_limits(
    entries: Sequence[Array], low, high, counts, divisor: Array, noise: Array, error: Array
) -> FacetLimits:
    noises = [noise] * len(entries)
    if counts is not None:  # components that are zero at every pose have no rounding error
        entries, noises = ([x * counts[i] for i, x in enumerate(values)] for values in (entries, noises))
    return FacetLimits(entries, list(low), list(high), divisor, noises, error)


def _wrench_bound(wrenches: Wrenches) -> Array:
    # Upper bound of the norm of a wrench.
    parts = [one_norm(point) for point in wrenches.points]
    spreads = [jnp.sum(axes, axis=0) for axes in (wrenches.box, *wrenches.ellipsoids) if axes is not None]
    return sum(spreads, largest(parts))


def _row(array: Array, k: Array) -> Array:
    return lax.dynamic_index_in_dim(array, k, 0, keepdims=False)


def _smallest_margin(
    facet, table: np.ndarray, limits, template: Array, tension_limits: TensionLimits, *, measure: str, is_bounded: bool
) -> Array:
    # Smallest margin of all facet normals.
    margin_of = margins.bounded_margin if is_bounded else margins.free_margin

    def step(bounds, each):
        facet_normal, asking = facet(*each)
        if measure == "closure":
            lower, upper = margins.closure_margin(facet_normal)
        else:
            lower, upper = margin_of(facet_normal, *asking)
        minimum = jnp.minimum(jnp.real(bounds), lower), jnp.minimum(jnp.imag(bounds), upper)
        return lax.complex(*minimum), None

    largest_one = jnp.inf * jnp.ones_like(template)
    if measure == "tensions":  # margins are at most half of a cable's range
        largest_one = jnp.minimum(largest_one, 0.5 * minimum_of(tension_limits.high - tension_limits.low, axis=0))
    count = len(table)
    start = lax.complex(largest_one, largest_one)
    return lax.scan(step, start, (table, limits), unroll=count if count <= UNROLLED else 1)[0]


class NullSpace(NamedTuple):
    """Tensions of six to eight cables at many poses, with the cables in the order of the block.

    Fields:
        rows: for each cable beyond the first six, derivatives (n_cables, n) of tensions with respect to its tension,
            times a common factor.
        held: (n_cables, n) tensions that supply the wrench, N; 0 beyond the first six.
        noise: (n,) error of the product of a facet normal with a cable.
        loss: (n,) error of the held tensions, N.
        largest: (n,) the largest of the held tensions, N.
    """

    rows: Sequence[Array]
    held: Array
    noise: Array
    loss: Array
    largest: Array


def null_space(
    components: Sequence[Array], loss: Float[Array, "n"], wrench: Column, *, order: tuple[int, ...]
) -> NullSpace:
    """Tensions that give no wrench, and tensions that supply the wrench, of spatial robots on six to eight cables."""
    return _joined(_by_block(components, wrench, order=order), wrench, loss)


@partial(jax.jit, static_argnames=("order",))
def _by_block(
    components: Sequence[Array], wrench: Column, *, order: tuple[int, ...]
) -> tuple[list[list[Array]], Array]:
    # Tensions of the first six cables for each further cable and for the wrench, in pairs as complex numbers, since XLA
    # repeats computations for each result; and their common factor, with the scale of errors.
    template = components[0][0]
    cables = [[component[k] for component in components] for k in order]
    load = [jnp.broadcast_to(x, template.shape) for x in wrench]
    base = block(cables[:CABLES], [*cables[CABLES:], load])
    pairs = [[lax.complex(six[i], six[i + 1]) for i in range(0, CABLES, 2)] for six in base.tensions]
    return pairs, lax.complex(base.common, base.scale)


@jax.jit
def _joined(tensions: tuple[list[list[Array]], Array], wrench: Column, loss: Array) -> NullSpace:
    *others, last = [[part for pair in six for part in (jnp.real(pair), jnp.imag(pair))] for six in tensions[0]]
    common, scale = jnp.real(tensions[1]), jnp.imag(tensions[1])
    zero, count = jnp.zeros_like(common), len(others)
    rows = [[*others[j], *(-common if i == j else zero for i in range(count))] for j in range(count)]
    inverse = 1.0 / common
    held = [x * inverse for x in last]
    rounding = jnp.asarray(BLOCK_EPSILONS * jnp.finfo(common.dtype).eps, common.dtype) * loss * scale
    most_held = largest([jnp.abs(x) for x in held])
    wrench_norm = sum((jnp.abs(x) for x in wrench), zero)
    uncertain = rounding * (wrench_norm + most_held) * jnp.abs(inverse)
    noise = rounding if count else zero
    if count == MAX_OTHERS:
        noise = 4.0 * noise * largest([jnp.abs(x) for row in rows for x in row])
    stacked = [jnp.stack(row) for row in rows]
    return NullSpace(stacked, jnp.stack([*held, *[zero] * count]), noise, uncertain, most_held)


@partial(jax.jit, static_argnames=("measure", "is_bounded"))
def by_null_space(
    space: NullSpace, tension_limits: TensionLimits, choices: CableSubsets, *, measure: str, is_bounded: bool
) -> Shaped[Array, "..."]:
    """Margins of poses from the relations among rows of the null space."""
    template = space.loss
    finite = jnp.where(jnp.isinf(tension_limits.high), 0.0, jnp.abs(tension_limits.high)) + jnp.abs(tension_limits.low)
    tension_bound = jnp.sum(finite, axis=0) + space.largest

    def facet(row, limits):
        rows = [[_row(part, k) for part in space.rows] for k in row]
        entries = relation(rows) if space.rows else [jnp.ones_like(template)]
        low, high, counts = limits
        norm = one_norm(entries)
        asking = product(entries, [_row(space.held, k) for k in row])
        error = 2.0 * space.noise * tension_bound + norm * space.loss
        return _facet_limits(entries, low, high, counts, norm, space.noise, error), (asking, -asking)

    table = choices.table
    limits = tension_limits.low[table], tension_limits.high[table], choices.counts
    return _smallest_margin(facet, table, limits, template, tension_limits, measure=measure, is_bounded=is_bounded)
