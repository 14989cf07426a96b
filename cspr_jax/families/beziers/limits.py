"""Proved lower bounds of the smallest slacks of limits along Bezier segments.

In c = cos(pi tau) every limited quantity is made of polynomials: squares of cable lengths and of lengths times their
rates, pseudotensions, the depth. Over a block of c, Bernstein coefficients bound each polynomial and its derivatives;
interval jets carry these bounds to the slacks.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np

from cspr_jax.families.beziers.motion import Bezier, powers
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.bounds.interval_jets import Jet, lowest
from cspr_jax.numerics.polynomials import bounds, derivatives, over, product, total
from cspr_jax.numerics.search.block_minima import MinimumBlocks, Proved, smallest
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.statics.force_balance import adjugate

Items = dict[str, Any]
# Number of blocks computed at a time.
TOGETHER = 1 << 14


def limit_slacks(
    problem: Problem, motions: Bezier, kappa: Float[np.ndarray, "n n_cables 4"], is_below: Bool[np.ndarray, "n"]
) -> Proved:
    """Smallest slacks of the limits that are set, in their order."""
    limits, tables = limits_set(problem.limits), _tables(problem, motions, kappa, is_below)
    slacks = [_SLACKS[limit.name](problem, getattr(problem.limits, limit.name)) for limit in limits]
    count = len(is_below)
    full = MinimumBlocks(np.arange(count), np.zeros(count, int), np.full(count, -1.0), np.full(count, 2.0))

    def values(blocks: MinimumBlocks) -> tuple[np.ndarray, np.ndarray]:
        block_tables = {name: over(x[blocks.case], *_wide(blocks, x.ndim)) for name, x in tables.items()}
        ends = [{name: x.sum(-1) if end else x[..., 0] for name, x in block_tables.items()} for end in (0, 1)]
        during = {name: Jet(*map(bounds, derivatives(x, 2))) for name, x in block_tables.items()}
        pairs = [_of_limit(slack, ends, during) for slack in slacks]
        low, attained = (np.stack(x, axis=1) for x in zip(*pairs, strict=True))
        return low, attained

    proved = smallest(full, count, values, np.ones(len(limits)), batch_size=TOGETHER)
    unknown = ~is_below[:, None] & np.array([limit.quantity == "tension" for limit in limits])[None]
    return Proved(*(np.where(unknown, -np.inf, x) for x in proved))


def _wide(blocks: MinimumBlocks, dimensions: int) -> tuple[np.ndarray, np.ndarray]:
    shape = (-1, *[1] * (dimensions - 2))
    return blocks.start.reshape(shape), blocks.width.reshape(shape)


def _of_limit(slack: Callable[[Items], Any], ends: list[Items], during: Items) -> tuple[np.ndarray, np.ndarray]:
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        values = np.stack([slack(end) for end in ends])
        return lowest(values, slack(during)).min(1), values.min((0, 2))


def _tables(problem: Problem, motions: Bezier, kappa: np.ndarray, is_below: np.ndarray) -> dict[str, np.ndarray]:
    # Return coefficients of the powers of c, (n, n_cables, d) or (n, 1, d).
    a = np.asarray(problem.robot.base_points)
    square, linear, constant = powers(motions.start, motions.middle, motions.end)
    u = ((np.pi / motions.time) ** 2)[:, None, None]
    position = np.stack([constant, linear, square], axis=-1)
    second_derivative = u * np.stack([2.0 * square, -linear, -4.0 * square], axis=-1)
    rays = np.repeat(-position[:, None], len(a), axis=1)
    rays[..., 0] += a
    radial_rate = np.stack([linear, 2.0 * square], axis=-1)[:, None]
    per_time = product(u, np.array([1.0, 0.0, -1.0]))
    along = _dot(rays, radial_rate)
    rows, arms = (np.asarray(x)[0] for x in jax.jit(adjugate)(problem.robot))
    level = np.einsum("i,nij->nj", np.cross(arms, a[0]) - rows, position)
    level[:, 0] += rows @ a[0]
    return {
        "square": _dot(rays, rays),
        "kappa": kappa,
        "determinant": np.where(is_below[:, None], level, [1.0, 0.0, 0.0])[:, None],
        "depth": position[:, 2:],
        "rate": product(per_time, product(along, along)),
        "speed": product(per_time, _dot(radial_rate, radial_rate)),
        "acceleration": _dot(second_derivative[:, None], second_derivative[:, None]),
        "second_derivative": total(
            product(per_time, _dot(radial_rate, radial_rate)), -_dot(rays, second_derivative[:, None])
        ),
        "z0": np.broadcast_to(motions.z0[:, None, None], (len(u), 1, 1)),
    }


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    # Return the scalar products of vectors (..., 3, d).
    return product(first, second).sum(-2)


def _tension(problem: Problem, limit, sense: float) -> Callable[[Items], Any]:
    robot = problem.robot
    unit = sense * robot.n_cables / float(robot.mass * robot.gravity)
    maximum = np.asarray(limit)

    def slack(at: Items) -> Any:
        return (at["kappa"] * at["square"] ** 0.5 * at["determinant"] ** -1.0 * float(robot.mass) - maximum) * unit

    return slack


def _floor(problem: Problem, limit) -> Callable[[Items], Any]:
    return lambda at: (at["depth"] * -1.0 + float(limit)) * at["z0"] ** -1.0


def _length(problem: Problem, limit) -> Callable[[Items], Any]:
    return lambda at: at["square"] ** 0.5 * (-1.0 / np.asarray(limit)) + 1.0


def _speed(problem: Problem, limit) -> Callable[[Items], Any]:
    return lambda at: at["rate"] * at["square"] ** -1.0 * (-1.0 / np.asarray(limit) ** 2) + 1.0


def _acceleration(problem: Problem, limit) -> Callable[[Items], Any]:
    def slack(at: Items) -> Any:
        fraction = (
            (at["second_derivative"] - at["rate"] * at["square"] ** -1.0)
            * at["square"] ** -0.5
            * (1.0 / np.asarray(limit))
        )
        if isinstance(fraction, Jet):
            return (fraction * -1.0 + 1.0).joined(fraction + 1.0)
        return np.concatenate([1.0 - fraction, 1.0 + fraction], axis=-1)

    return slack


def _of_mass_centre(problem: Problem, limit, quantity: str) -> Callable[[Items], Any]:
    return lambda at: at[quantity] * (-1.0 / float(limit) ** 2) + 1.0


# Slacks by the name of their limit.
_SLACKS: dict[str, Callable[[Problem, Any], Callable[[Items], Any]]] = {
    "tension_min": partial(_tension, sense=1.0),
    "tension_max": partial(_tension, sense=-1.0),
    "floor": _floor,
    "cable_length_max": _length,
    "cable_speed_max": _speed,
    "cable_acceleration_max": _acceleration,
    "speed_max": partial(_of_mass_centre, quantity="speed"),
    "acceleration_max": partial(_of_mass_centre, quantity="acceleration"),
}
