"""Cables that meet each other or the platform, one lane a case: the fast form of `interference`."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.linear.lanes import Matrix, Vector, cross, dot, rotated_back
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts.interference import PARALLEL
from cspr_jax.robots.statics.wrench_lanes import CableLanes

TINY = 1e-30  # m^2


def gaps(base_points: Float[Array, "n_cables 3"], pairs: Sequence[tuple[int, int]], cables: CableLanes) -> list[Vector]:
    """The shortest vectors between cables."""
    vectors = []
    for i, j in pairs:
        offset = [base_points[j, k] - base_points[i, k] for k in range(3)]
        vectors.append(gap(offset, cables.rays[i], cables.rays[j]))
    return vectors


def gap(offset: Vector, u: Vector, v: Vector) -> Vector:
    """The shortest vector between two segments; `interference.between` in lanes."""
    uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
    au, av = dot(offset, u), dot(offset, v)
    denominator = uu * vv - uv * uv
    is_parallel = denominator <= PARALLEL * uu * vv
    s = (au * vv - av * uv) / jnp.where(is_parallel, 1.0, denominator)
    s = jnp.clip(jnp.where(is_parallel, 0.0, s), 0.0, 1.0)
    t = jnp.clip((s * uv - av) / vv, 0.0, 1.0)
    s = jnp.clip((au + t * uv) / uu, 0.0, 1.0)
    return tuple(offset[k] + t * v[k] - s * u[k] for k in range(3))


def residual(sides: tuple[Vector, Vector], normal: Vector, seen: Vector) -> Vector:
    """Vector from the nearest point of the sector of a corner to the end of its cable."""
    height = dot(normal, seen)
    up = tuple(height * n for n in normal)
    flat = tuple(v - w for v, w in zip(seen, up, strict=True))

    def area(a: Vector, b: Vector) -> Array:
        return dot(cross(a, b), normal)

    one, two = sides
    inside = (area(two, flat) >= 0.0) & (area(flat, one) >= 0.0)
    left = []
    for side in sides:
        # The sector of a point inside the platform has no sides.
        fraction = jnp.maximum(dot(seen, side) / jnp.maximum(dot(side, side), TINY), 0.0)
        left.append(tuple(v - fraction * w for v, w in zip(seen, side, strict=True)))
    is_first = dot(left[0], left[0]) <= dot(left[1], left[1])
    return tuple(jnp.where(inside, w, jnp.where(is_first, a, b)) for w, a, b in zip(up, *left, strict=True))


def cable_directions(cables: CableLanes, rotation: Matrix) -> list[Vector]:
    """The cables from the platform to the spools, in the platform's axes; not of unit length."""
    return [rotated_back(rotation, tuple(-x for x in ray)) for ray in cables.rays]


def as_arrays(
    between: Sequence[Vector], directions: Sequence[Vector]
) -> tuple[Float[Array, "n n_pairs 3"], Float[Array, "n n_cables 3"]]:
    """Vectors as the arrays that `interference` takes."""
    arrays = [jnp.stack([jnp.stack(v, -1) for v in vectors], 1) for vectors in (between, directions) if vectors]
    return arrays[0] if between else jnp.zeros((len(arrays[-1]), 0, 3)), arrays[-1]
