"""Taut cables on harmonic ellipses x = C + a cos(wt) + b sin(wt): each pseudotension has one harmonic.

The acceleration is -w^2 (x - C). The force that holds the mass against it and gravity pulls along a ray from x that
meets the plane of the spools at a point q; all cables can be taut exactly while q lies within the hull of the spools.
Let F be affine in the horizontal coordinates of q, 0 on one edge of the hull and 1 at the centroid of the spools, eta
the depth of x below that of C, D the depth of C, and e = 1 - w^2 D / g. Times a positive number, F at q is

    kappa = F(C) (1 + (1 - e) eta / D) + e (F(x) - F(C)),

in which the products of first harmonics have cancelled: it is a constant and one harmonic. On three cables kappa is the
normalised pseudotension of the cable opposite to the edge. A formula gives its smallest value without samples; the
frequencies at which it stays positive are an interval of e around 0, the natural frequency sqrt(g / D), at which every
ellipse below the spools is feasible whose centre lies below the hull.

Source: Gosselin, Ren, Foucault, Dynamic trajectory planning of a two-DOF cable-suspended parallel robot, ICRA 2012;
Mottola, Gosselin, Carricato, J. Mechanisms and Robotics 10 (2018) 031004. The form above is derived in docs/theory.md.
"""

from __future__ import annotations

from functools import partial, reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.ellipses.hull import SpoolHull
from cspr_jax.numerics.batches import in_batches, in_parts
from cspr_jax.numerics.shapes import Float

BATCH = 16384  # number of ellipses computed at a time
LARGEST = 1 << 20  # largest number of ellipses for one of two threads
# Number of bisections that determine e to the last bit.
HALVINGS = 64


class Ellipse(NamedTuple):
    """Harmonic ellipse.

    Fields:
        centre: (..., 3) C, from the centroid of the spools, z down, m.
        cosine: (..., 3) a, m.
        sine: (..., 3) b, m.
    """

    centre: Any
    cosine: Any
    sine: Any


class _Edge(NamedTuple):
    # kappa of one edge is `constant` plus a harmonic with the cosine and sine coefficients `tilting` + e `pulling`.
    constant: Array
    tilting: tuple[Array, Array]
    pulling: tuple[Array, Array]


class _Terms(NamedTuple):
    # Edge by edge, since XLA computes a stack once for each of its elements; `depth` is that of the centre, () m, and
    # `swing` the norm of the harmonic of the depth, () m.
    edges: list[_Edge]
    depth: Array
    swing: Array


@jax.custom_jvp
def _norm(pair: tuple[Array, Array]) -> Array:
    return jnp.sqrt(pair[0] * pair[0] + pair[1] * pair[1])


@_norm.defjvp
def _norm_derivative(primals, tangents):
    # Level ellipses have no harmonic of the depth, whose norm is then at its minimum: the derivative is 0.
    (pair,), (change,) = primals, tangents
    norm = _norm(pair)
    product = pair[0] * change[0] + pair[1] * change[1]
    return norm, jnp.where(norm > 0.0, product / jnp.where(norm > 0.0, norm, 1.0), 0.0)


def _terms(hull: SpoolHull, ellipse: Ellipse) -> _Terms:
    def rise(vector: Array) -> Array:
        return hull.normal[0] * vector[0] + hull.normal[1] * vector[1] + vector[2]

    depth, swing = rise(ellipse.centre), (rise(ellipse.cosine), rise(ellipse.sine))

    def of_edge(gradient: Array) -> _Edge:
        def flat(vector: Array) -> Array:
            return gradient[0] * vector[0] + gradient[1] * vector[1]

        constant = 1.0 + flat(ellipse.centre)
        fraction = constant / depth
        tilting = (fraction * swing[0], fraction * swing[1])
        return _Edge(constant, tilting, (flat(ellipse.cosine) - tilting[0], flat(ellipse.sine) - tilting[1]))

    return _Terms([of_edge(gradient) for gradient in hull.edges], depth, _norm(swing))


def _slacks(terms: _Terms, e: Array) -> list[Array]:
    # Return the smallest kappa of each edge.
    return [
        constant - _norm((tilting[0] + e * pulling[0], tilting[1] + e * pulling[1]))
        for constant, tilting, pulling in terms.edges
    ]


def harmonic_margins(hull: SpoolHull, ellipse: Ellipse, frequency: Float[Array, ""]) -> Float[Array, "n_edges+1"]:
    """Smallest values of kappa and of the depth along an ellipse; it is feasible exactly if all are positive."""
    return jnp.stack(_margins(hull, ellipse, frequency))


def _margins(hull: SpoolHull, ellipse: Ellipse, frequency: Array) -> list[Array]:
    terms = _terms(hull, ellipse)
    slacks = _slacks(terms, 1.0 - frequency**2 * terms.depth / hull.gravity)
    # Above the spools no cable pulls upwards, whatever the quotients say.
    is_below = terms.depth > 0.0
    depth = jnp.where(is_below, 1.0 - terms.swing / terms.depth, -1.0)
    return [*(jnp.where(is_below, slack, -jnp.inf) for slack in slacks), depth]


def least_margin(hull: SpoolHull, ellipse: Ellipse, frequency: Float[Array, ""]) -> Float[Array, ""]:
    """The smallest margin along an ellipse."""
    return reduce(lambda a, b: jnp.where((b < a) | jnp.isnan(b), b, a), _margins(hull, ellipse, frequency))


def _roots(terms: _Terms) -> tuple[Array, Array]:
    # Return the nearest e below and above 0, () each, at which an edge is reached; infinite if there is none.
    pairs = [_roots_of_edge(edge) for edge in terms.edges]
    return reduce(jnp.maximum, [low for low, _ in pairs]), reduce(jnp.minimum, [high for _, high in pairs])


def _roots_of_edge(edge: _Edge) -> tuple[Array, Array]:
    tilting, pulling = edge.tilting, edge.pulling
    square = pulling[0] ** 2 + pulling[1] ** 2
    mixed = tilting[0] * pulling[0] + tilting[1] * pulling[1]
    rest = edge.constant**2 - (tilting[0] ** 2 + tilting[1] ** 2)
    # Compute the root without cancellation; the product of both gives the other.
    far = -(mixed + jnp.copysign(jnp.sqrt(mixed**2 + square * jnp.maximum(rest, 0.0)), mixed))
    ends = far / square, -rest / far
    has_ends = square > 0.0
    low = jnp.where(has_ends, jnp.minimum(*ends), -jnp.inf)
    return low, jnp.where(has_ends, jnp.maximum(*ends), jnp.inf)


def _exists(terms: _Terms) -> Array:
    # Tell whether the natural frequency, and so any, is feasible.
    return reduce(jnp.logical_and, [edge.constant > 0.0 for edge in terms.edges], terms.depth > terms.swing)


def frequency_interval(hull: SpoolHull, ellipse: Ellipse) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Ends of the interval of feasible frequencies, which are themselves not feasible."""
    terms = _terms(hull, ellipse)
    low, high = _roots(terms)
    exists = _exists(terms)
    ends = (jnp.sqrt((1.0 - e) * hull.gravity / terms.depth) for e in (jnp.minimum(high, 1.0), low))
    first, last = (jnp.where(exists, end, jnp.nan) for end in ends)
    return first, last


def best_frequency(hull: SpoolHull, ellipse: Ellipse) -> Float[Array, ""]:
    """Frequency with the largest margin."""
    terms = _terms(hull, ellipse)
    low, high = _roots(terms)

    # The minimum of concave functions is concave: bisect for the e at which it stops rising.
    def halved(_, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        middle = 0.5 * (ends[0] + ends[1])
        rates = jnp.stack([_decrease(edge, middle) for edge in terms.edges])
        rate = rates[jnp.argmin(jnp.stack(_slacks(terms, middle)))]
        # If the slack does not depend on the frequency, as without axes, take the nearest to the natural one.
        rises = (rate < 0.0) | ((rate == 0.0) & (middle < 0.0))
        return jnp.where(rises, middle, ends[0]), jnp.where(rises, ends[1], middle)

    # If an edge's slack does not depend on e, it must be positive at the natural frequency, e = 0.
    ends = (jnp.clip(low, -1e6, 0.0), jnp.clip(high, 0.0, 1.0))
    first, last = jax.lax.fori_loop(0, HALVINGS, halved, ends)
    e = 0.5 * (first + last)
    frequency = jnp.sqrt(jnp.maximum(1.0 - e, 0.0) * hull.gravity / terms.depth)
    return jnp.where(_exists(terms), jnp.where(last >= 1.0 - 1e-12, 0.0, frequency), jnp.nan)


def _decrease(edge: _Edge, e: Array) -> Array:
    # Return the rate at which kappa of an edge decreases with e, times a positive number.
    (t0, t1), (p0, p1) = edge.tilting, edge.pulling
    return (t0 + e * p0) * p0 + (t1 + e * p1) * p1


@partial(jax.jit, static_argnums=0)
def _each(function, hull: SpoolHull, items):
    return jax.vmap(partial(function, hull))(*items)


def of_many(function, hull: SpoolHull, *items):
    """One of the functions above, for a batch of ellipses."""

    def part(index: slice):
        return in_batches(
            partial(_each, function, hull), jax.tree.map(lambda array: array[index], items), batch_size=BATCH
        )

    count = len(jax.tree.leaves(items)[0])
    if count <= BATCH:
        return part(slice(None))
    return jax.tree.map(lambda *parts: np.concatenate(parts), *in_parts(part, count, LARGEST))
