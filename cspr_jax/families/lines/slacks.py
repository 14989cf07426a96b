"""Slacks of taut cables and of limits along a straight line, as functions of s, s'^2 and s''.

On the line a cable has length l = sqrt(|D|^2 (s - c)^2 + h^2), rate |D|^2 (s - c) / l s', and second derivative
|D|^2 h^2 / l^3 s'^2 + |D|^2 (s - c) / l s''. Every slack here is affine in s'^2 and s'', so for one law it is affine in
1 / T^2. The formulas are written once: a search evaluates them on arrays, a proof on interval jets.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.lines.faces import line_faces
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.bounds.interval_jets import Jet
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.schema.limits import LIMITS

TAUT = "taut"


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class LineSlacks:
    """Coefficients of slacks along a line; those of faces are over the smallest norm of n on the line.

    Fields:
        square: () |D|^2, m^2.
        nearest: (n_cables,) s at which each cable would be shortest; it may lie beyond the ends.
        squared_distance: (n_cables,) square of its length there, m^2.
        steepness: (n_faces,) n . D of the faces on both sides.
        offset: (n_faces,) n . g at the start; -inf if the face bounds nothing.
        offset_change: (n_faces,) change of n . g from start to end.
        along: (n_faces, n_cables) n . r of the rays at the start.
        along_change: (n_faces, n_cables) change of n . r from start to end.
        normal_change_square: (n_faces,) square of the norm of the change of n.
        narrowest: (n_faces,) s at which n would be smallest; it may lie beyond the ends.
        smallest_square: (n_faces,) square of the norm of n there.
        spans: (n_faces,) whether the cables of the face span it.
        low: smallest tensions over the mass, by group of faces, (n_cables,) m/s^2 each.
        high: largest tensions over the mass, by group of faces; inf for none.
        largest: limits on speeds and accelerations, by name; (n_cables,) for those of cables, else (1,).
    """

    square: Array
    nearest: Array
    squared_distance: Array
    steepness: Array
    offset: Array
    offset_change: Array
    along: Array
    along_change: Array
    normal_change_square: Array
    narrowest: Array
    smallest_square: Array
    spans: Array
    low: dict[str, Array]
    high: dict[str, Array]
    largest: dict[str, Array]

    @property
    def names(self) -> tuple[str, ...]:
        """Groups of slacks: taut cables, and the limits in their order."""
        set_names = {*self.low, *self.largest}
        return tuple(name for name in (TAUT, *(limit.name for limit in LIMITS)) if name in set_names)

    @property
    def tightest(self) -> str:
        """Group of faces that implies all other groups."""
        return [name for name in self.names if name in self.low][-1]


def line_slacks(problem: Problem, start: Float[Array, "3"], end: Float[Array, "3"]) -> LineSlacks:
    """Coefficients of slacks along a line."""
    robot, direction = problem.robot, end - start
    faces = line_faces(robot, start, end, in_plane=False)
    square = direction @ direction
    rays = robot.base_points - start[None]
    nearest = rays @ direction / square
    squared_distance = jnp.sum((rays - nearest[:, None] * direction[None]) ** 2, axis=1)
    change = jnp.sum(faces.normal_change**2, axis=1)
    narrowest = -jnp.sum(faces.normal * faces.normal_change, axis=1) / jnp.where(change > 0.0, change, 1.0)
    minimum = jnp.sum((faces.normal + narrowest[:, None] * faces.normal_change) ** 2, axis=1)
    at = jnp.clip(narrowest, 0.0, 1.0)
    norm = jnp.linalg.norm(faces.normal + at[:, None] * faces.normal_change, axis=1)
    spans = (norm > 0.0) & ((faces.along != 0.0) | (faces.along_change != 0.0)).any(1)
    over = jnp.where(spans, norm, 1.0)
    low, high = _tensions(problem)
    return LineSlacks(
        square=square,
        nearest=nearest,
        squared_distance=squared_distance,
        steepness=faces.steepness / over,
        offset=jnp.where(spans, faces.offset / over, -jnp.inf),
        offset_change=faces.offset_change / over,
        along=faces.along / over[:, None],
        along_change=faces.along_change / over[:, None],
        normal_change_square=change / over**2,
        narrowest=narrowest,
        smallest_square=minimum / over**2,
        spans=spans,
        low=low,
        high=high,
        largest={
            limit.name: jnp.broadcast_to(
                getattr(problem.limits, limit.name), (robot.n_cables if limit.per_cable else 1,)
            )
            for limit in limits_set(problem.limits)
            if limit.of_motion and limit.quantity != "tension"
        },
    )


def _tensions(problem: Problem) -> tuple[dict[str, Array], dict[str, Array]]:
    # The group of largest tensions includes smallest tensions.
    robot, none = problem.robot, jnp.zeros(problem.robot.n_cables)
    minimum, maximum = tension_range(robot, problem.limits)
    low, high = {TAUT: none}, {TAUT: none + jnp.inf}
    if problem.limits.tension_min is not None:
        low["tension_min"], high["tension_min"] = minimum / robot.mass, none + jnp.inf
    if problem.limits.tension_max is not None:
        low["tension_max"], high["tension_max"] = minimum / robot.mass, maximum / robot.mass
    return low, high


class LineStates(NamedTuple):
    """State of a motion along a line, as arrays or as jets over blocks; the last dimension has length 1.

    Fields:
        s: path coordinate.
        speed: s'^2, 1/s^2.
        second_derivative: s'', 1/s^2.
    """

    s: Any
    speed: Any
    second_derivative: Any


def slacks(line: LineSlacks, name: str, at: LineStates, tensions: Any = None) -> Any:
    """Slacks of a group at states; with fixed tensions, a lower bound of them."""
    if name == "speed_max":
        return 1.0 - at.speed * (line.square[..., None] / line.largest[name] ** 2)
    if name == "acceleration_max":
        fraction = at.second_derivative * (line.square[..., None] ** 0.5 / line.largest[name])
        return joined(1.0 - fraction, 1.0 + fraction)
    away = at.s - line.nearest
    square = line.square[..., None]
    length2 = away**2 * square + line.squared_distance
    if name == "cable_speed_max":
        return 1.0 - away**2 * length2**-1.0 * at.speed * (square / line.largest[name]) ** 2
    if name == "cable_acceleration_max":
        second = (
            length2**-1.5 * at.speed * (square * line.squared_distance)
            + away * length2**-0.5 * at.second_derivative * square
        )
        return joined(1.0 - second / line.largest[name], 1.0 + second / line.largest[name])
    slack = at.second_derivative * line.steepness - at.s * line.offset_change - line.offset
    if tensions is not None:
        slack = slack - _cable_acceleration(line, at.s, length2**-0.5, tensions)
    size2 = (at.s - line.narrowest) ** 2 * line.normal_change_square + line.smallest_square
    return slack * size2**-0.5


def _cable_acceleration(line: LineSlacks, s: Any, shortness: Any, tensions: Any) -> Any:
    # Return the acceleration that the cables cause towards the inside of each face.
    if isinstance(s, Jet):
        return ((s.expanded(-1) * line.along_change + line.along) * shortness.expanded(-2) * tensions).summed()
    return ((line.along + line.along_change * s[..., None]) * tensions * shortness[..., None, :]).sum(-1)


def tensions_at(line: LineSlacks, name: str, s: Any) -> Any:
    """Tensions within limits that accelerate least towards the inside of each face."""
    xp = np if isinstance(s, np.ndarray) else jnp
    low, high = line.low[name][..., None, :], line.high[name][..., None, :]
    along = line.along + line.along_change * s[..., None]
    return xp.where(along > 0.0, low, xp.where(along < 0.0, high, 0.0))


def tensions_over(
    line: LineSlacks, name: str, first: Float[np.ndarray, "n 1"], last: Float[np.ndarray, "n 1"]
) -> tuple[Float[np.ndarray, "n n_faces n_cables"], Bool[np.ndarray, "n n_faces"]]:
    """One choice of tensions for a full block, which bounds slacks from below."""
    low, high = line.low[name][:, None, :], line.high[name][:, None, :]
    ends = [line.along + line.along_change * s[..., None] for s in (first, last)]
    endless = ~np.isfinite(high)
    beyond = ((ends[0] < 0.0) & (ends[1] < 0.0) & endless).any(-1)
    return np.where((ends[0] + ends[1] < 0.0) & ~endless, high, low), np.asarray(beyond | ~line.spans)


def joined(first: Any, second: Any) -> Any:
    """Slacks of two groups, joined."""
    if isinstance(first, Jet):
        return first.joined(second)
    xp = np if isinstance(first, np.ndarray) else jnp
    return xp.concatenate([first, second], axis=-1)
