"""Cables that meet each other or the platform, one lane a case: the fast form of `interference`."""

from collections.abc import Sequence

import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.lanes import Matrix, Vector, dot, turned_back
from cspr_jax.robots.interference import PARALLEL
from cspr_jax.robots.wrench_lanes import Cables


def gaps(base_points: Array, pairs: Sequence[tuple[int, int]], wires: Cables) -> list[Vector]:
    """The shortest vectors between cables.

    Args:
        base_points: (n_cables, 3) m.
        pairs: indices of cables; known when this is compiled.
        wires: the cables.

    Returns:
        one vector a pair, from its first cable to its second, m.
    """
    squares = [dot(ray, ray) for ray in wires.rays]
    vectors: list[Vector] = []
    for i, j in pairs:
        u, v, uu, vv = wires.rays[i], wires.rays[j], squares[i], squares[j]
        apart = [base_points[j, k] - base_points[i, k] for k in range(3)]
        uv, au, av = dot(u, v), dot(apart, u), dot(apart, v)
        denominator = uu * vv - uv * uv
        is_parallel = denominator <= PARALLEL * uu * vv
        s = (au * vv - av * uv) / jnp.where(is_parallel, 1.0, denominator)
        s = jnp.clip(jnp.where(is_parallel, 0.0, s), 0.0, 1.0)
        t = jnp.clip((s * uv - av) / vv, 0.0, 1.0)
        s = jnp.clip((au + t * uv) / uu, 0.0, 1.0)
        vectors.append(tuple(apart[k] + t * v[k] - s * u[k] for k in range(3)))
    return vectors


def cable_directions(wires: Cables, turn: Matrix) -> list[Vector]:
    """The cables from the platform to the spools, in the platform's axes; not of unit length.

    Args:
        wires: the cables.
        turn: rows of the rotation matrix.

    Returns:
        one vector a cable, platform axes, m.
    """
    return [turned_back(turn, tuple(-x for x in ray)) for ray in wires.rays]


def as_arrays(between: Sequence[Vector], directions: Sequence[Vector]) -> tuple[Array, Array]:
    """Vectors as the arrays that `interference` takes.

    Args:
        between: of `gaps`, (n,) each.
        directions: of `cable_directions`.

    Returns:
        (n, n_pairs, 3) and (n, n_cables, 3).
    """
    arrays = [jnp.stack([jnp.stack(v, -1) for v in vectors], 1) for vectors in (between, directions) if vectors]
    return arrays[0] if between else jnp.zeros((len(arrays[-1]), 0, 3)), arrays[-1]
