"""Taut cables on harmonic ellipses x = C + a cos(wt) + b sin(wt): each pseudotension has one harmonic.

The acceleration is -w^2 (x - C). The force that holds the mass against it and gravity pulls along a ray from x that
meets the plane of the spools at a point q; all cables can be taut exactly while q lies within the hull of the spools.
Let F be affine in the horizontal coordinates of q, 0 on one edge of the hull and 1 at the centroid of the spools, eta
the depth of x below that of C, D the depth of C, and e = 1 - w^2 D / g. Times a positive number, F at q is

    kappa = F(C) (1 + (1 - e) eta / D) + e (F(x) - F(C)),

in which the products of first harmonics have cancelled: a constant and one harmonic. On three cables kappa is the
normalised pseudotension of the cable opposite to the edge. Its smallest value is a formula, without samples; the
frequencies at which it stays positive are an interval of e around 0, the natural frequency sqrt(g / D), at which every
ellipse below the spools is feasible whose centre lies below the hull.

Source: Gosselin, Ren, Foucault, Dynamic trajectory planning of a two-DOF cable-suspended parallel robot, ICRA 2012;
Mottola, Gosselin, Carricato, J. Mechanisms and Robotics 10 (2018) 031004. The form above is derived in docs/theory.md.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.ellipses.hull import Hull

BATCH = 16384
# Halvings that narrow e to the last bit.
HALVINGS = 64


class Ellipse(NamedTuple):
    """Harmonic ellipse; numbers of jax or of NumPy.

    Fields:
        centre: (..., 3) C, from the centroid of the spools, z down, m.
        cosine: (..., 3) a, m.
        sine: (..., 3) b, m.
    """

    centre: Any
    cosine: Any
    sine: Any


class _Terms(NamedTuple):
    # kappa of each edge is `constant` and the harmonic `tilting` + e `pulling`, of cosine and sine (n_edges, 2); depth
    # of the centre, () m, and the size of the harmonic of the depth, () m.
    constant: Array
    tilting: Array
    pulling: Array
    depth: Array
    swing: Array


def _terms(hull: Hull, ellipse: Ellipse) -> _Terms:
    def flat(vector: Array) -> Array:
        return hull.edges[:, 0] * vector[0] + hull.edges[:, 1] * vector[1]

    def rise(vector: Array) -> Array:
        return hull.normal[0] * vector[0] + hull.normal[1] * vector[1] + vector[2]

    constant, depth = 1.0 + flat(ellipse.centre), rise(ellipse.centre)
    axes = (ellipse.cosine, ellipse.sine)
    tilting = jnp.stack([constant * (rise(axis) / depth) for axis in axes], axis=1)
    pulling = jnp.stack([flat(axis) for axis in axes], axis=1) - tilting
    return _Terms(constant, tilting, pulling, depth, jnp.hypot(*(rise(axis) for axis in axes)))


def _slack(terms: _Terms, e: Array) -> Array:
    # Smallest kappa of each edge, (n_edges,).
    harmonic = terms.tilting + e * terms.pulling
    return terms.constant - jnp.hypot(harmonic[:, 0], harmonic[:, 1])


def harmonic_margins(hull: Hull, ellipse: Ellipse, frequency: Array) -> Array:
    """Smallest values along an ellipse, all positive exactly if it is feasible.

    Args:
        ellipse: leaves (3,).
        frequency: () rad/s.

    Returns:
        (n_edges + 1,) of kappa for each edge, 1 at rest below the centroid; of the depth, over that of the centre.
    """
    terms = _terms(hull, ellipse)
    slack = _slack(terms, 1.0 - frequency**2 * terms.depth / hull.gravity)
    # Above the spools no cable pulls upwards, whatever the quotients say.
    is_below = terms.depth > 0.0
    depth = jnp.where(is_below, 1.0 - terms.swing / terms.depth, -1.0)
    return jnp.concatenate([jnp.where(is_below, slack, -jnp.inf), depth[None]])


def least_margin(hull: Hull, ellipse: Ellipse, frequency: Array) -> Array:
    """Smallest of the margins along an ellipse.

    Args:
        ellipse: leaves (3,).
        frequency: () rad/s.

    Returns:
        () positive exactly if it is feasible.
    """
    return jnp.min(harmonic_margins(hull, ellipse, frequency))


def _roots(terms: _Terms) -> tuple[Array, Array]:
    # Ends of the e at which each edge is met, (n_edges,), below and above 0; without ends, infinite.
    square = jnp.sum(terms.pulling**2, axis=1)
    mixed = jnp.sum(terms.tilting * terms.pulling, axis=1)
    rest = terms.constant**2 - jnp.sum(terms.tilting**2, axis=1)
    # Of the two roots the one in which nothing cancels gives the other by their product.
    far = -(mixed + jnp.copysign(jnp.sqrt(mixed**2 + square * jnp.maximum(rest, 0.0)), mixed))
    ends = far / square, -rest / far
    has_ends = square > 0.0
    low = jnp.where(has_ends, jnp.minimum(*ends), -jnp.inf)
    return low, jnp.where(has_ends, jnp.maximum(*ends), jnp.inf)


def frequency_interval(hull: Hull, ellipse: Ellipse) -> tuple[Array, Array]:
    """Frequencies at which an ellipse is feasible: between two ends, which are not.

    Args:
        ellipse: leaves (3,).

    Returns:
        () rad/s each, the upper one inf where nothing bounds it, the lower one 0 where the ellipse lies in the static
        workspace; NaN where no frequency is feasible.
    """
    terms = _terms(hull, ellipse)
    low, high = _roots(terms)
    slowest, fastest = jnp.minimum(jnp.min(high), 1.0), jnp.max(low)
    exists = jnp.all(terms.constant > 0.0) & (terms.depth > terms.swing)
    ends = (jnp.sqrt((1.0 - e) * hull.gravity / terms.depth) for e in (slowest, fastest))
    first, last = (jnp.where(exists, end, jnp.nan) for end in ends)
    return first, last


def best_frequency(hull: Hull, ellipse: Ellipse) -> Array:
    """Frequency with the largest margin.

    Args:
        ellipse: leaves (3,).

    Returns:
        () rad/s; 0 where slower is always better; NaN where no frequency is feasible.
    """
    terms = _terms(hull, ellipse)
    low, high = _roots(terms)

    # The smallest of functions that bend downwards bends downwards: it rises up to its largest value.
    def halved(_, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        middle = 0.5 * (ends[0] + ends[1])
        active = jnp.argmin(_slack(terms, middle))
        rises = jnp.sum((terms.tilting + middle * terms.pulling)[active] * terms.pulling[active]) < 0.0
        return jnp.where(rises, middle, ends[0]), jnp.where(rises, ends[1], middle)

    # Beside the natural frequency, e = 0, nothing helps an edge whose slack e does not change.
    ends = (jnp.clip(jnp.max(low), -1e6, 0.0), jnp.clip(jnp.min(high), 0.0, 1.0))
    first, last = jax.lax.fori_loop(0, HALVINGS, halved, ends)
    e = 0.5 * (first + last)
    exists = jnp.all(terms.constant > 0.0) & (terms.depth > terms.swing)
    frequency = jnp.sqrt(jnp.maximum(1.0 - e, 0.0) * hull.gravity / terms.depth)
    return jnp.where(exists, jnp.where(last >= 1.0 - 1e-12, 0.0, frequency), jnp.nan)


@partial(jax.jit, static_argnums=0)
def _each(function, hull: Hull, items):
    return jax.vmap(partial(function, hull))(*items)


def of_many(function, hull: Hull, *items):
    """One of the functions above for many ellipses.

    Args:
        items: what it takes behind the hull, leaves (n, ...).

    Returns:
        its results, NumPy leaves (n, ...).
    """
    return in_batches(partial(_each, function, hull), items, size=BATCH)
