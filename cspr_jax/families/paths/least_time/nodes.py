"""Nodes of a section of a path, and the half-planes of path speed and acceleration on both sides of them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array

from cspr_jax.curves.spline import Spline, piece_state, piece_values
from cspr_jax.families.paths.geometry.section import Section
from cspr_jax.families.paths.least_time.constraints import HalfPlanes, path_half_planes
from cspr_jax.families.paths.least_time.motor_bounds import ReferenceMotion
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.state import State
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit

RAMP = 0.25  # cells become wider over this fraction of the nodes, from an end at zero speed
SMALLER = 5  # number of even narrower cells at such an end
BATCH, MANY = 64, 512  # number of points computed at a time, for one section and for many
DEGREE = 5  # degree to which all pieces are raised, so that all sections share compiled programs
# A node counts as the end of a piece if its distance from it is below this fraction of the shortest piece.
NEAR = 1e-9


class PathGrid(NamedTuple):
    """Nodes of a section.

    Fields:
        nodes: (n_cells + 1,) path coordinates, m; they include all knots of the section, and all jumps of accelerations
            and of speed limits.
        speed: (n_cells,) largest speed of the mass centre in each cell, m/s, inf for none.
        feed: (n_cells,) largest speed that the section itself allows, m/s, inf if the robot's limit is lower.
    """

    nodes: np.ndarray
    speed: np.ndarray
    feed: np.ndarray

    @property
    def width(self) -> np.ndarray:
        """Widths of the cells, (n_cells,), m."""
        return np.diff(self.nodes)


class PathSpeeds(NamedTuple):
    """Path speeds and accelerations of a motion along a section.

    Fields:
        x: (n_nodes,) squared path speeds.
        before: (n_cells,) path accelerations at the starts of the cells.
        after: (n_cells,) path accelerations at the ends of the cells.
        rests: whether the motion is at rest at the start, and at the end; s is the cube of time over the cell there.
    """

    x: np.ndarray
    before: np.ndarray
    after: np.ndarray
    rests: tuple[bool, bool] = (False, False)


class PathPoints(NamedTuple):
    """Points on pieces of a section, (k, ...) each.

    Fields:
        position: (k, 6, 3) Bernstein coefficients of positions on their pieces, m.
        quaternion: (k, 6, 4) Bernstein coefficients of quaternions; None for a point mass.
        fraction: (k,) fraction of the piece at which the point lies, from 0 to 1.
        width: (k,) widths of the pieces, m.
        offset: (k, 3) as in `Spline`, or None.
    """

    position: Any
    quaternion: Any
    fraction: Any
    width: Any
    offset: Any


def grid_of(section: Section, count: int, slow: tuple[bool, bool], speed_max: float = np.inf) -> PathGrid:
    """Nodes of a section, spaced like times of a motion that speeds up and slows down: close together at slow ends."""
    knots = np.asarray(section.curve.knots)
    nodes = knots[-1] * _fractions(count, slow)
    changes = knots[1:-1][section.speed[1:] != section.speed[:-1]]
    coordinates: list[float] = np.unique(np.concatenate([section.curve.jumps(), changes, section.knots[1:-1]])).tolist()
    for k, s in enumerate(coordinates):
        nearest = int(np.argmin(np.abs(nodes - s)))
        if 0 < nearest < len(nodes) - 1 and nodes[nearest] not in coordinates[:k]:
            nodes[nearest] = s
        else:
            nodes = np.insert(nodes, np.searchsorted(nodes, s), s)
    speed = section.speed[_pieces(knots, 0.5 * (nodes[1:] + nodes[:-1]))]
    return PathGrid(nodes, np.minimum(speed, speed_max), np.where(speed < speed_max, speed, np.inf))


def _pieces(knots: np.ndarray, s: np.ndarray) -> np.ndarray:
    return np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(knots) - 2)


def _fractions(count: int, slow: tuple[bool, bool]) -> np.ndarray:
    # Divide the cells at slow ends again, each a quarter as wide as the next.
    more = SMALLER if count > 8 * SMALLER else 0
    fractions = _distance_at(np.linspace(0.0, 1.0, count + 1 - more * sum(slow)), slow)
    parts = 0.25 ** np.arange(more, 0, -1)
    first, last = fractions[1] * parts, 1.0 - (1.0 - fractions[-2]) * parts[::-1]
    inner = [first] * slow[0] + [fractions[1:-1]] + [last] * slow[1]
    return np.concatenate([fractions[:1], *inner, fractions[-1:]])


def _distance_at(time: np.ndarray, slow: tuple[bool, bool]) -> np.ndarray:
    # Return the distance of a motion whose speed rises for a fraction of its time from a slow end, and falls to one.
    before, after = (RAMP if end else 0.0 for end in slow)
    distance, left = time - 0.5 * before, 1.0 - time
    total = 1.0 - 0.5 * before - 0.5 * after
    if before:
        distance = np.where(time < before, 0.5 * time**2 / before, distance)
    if after:
        distance = np.where(left < after, total - 0.5 * left**2 / after, distance)
    return distance / total


def points_on(curve: Spline, coordinates: Float[np.ndarray, "k"], *, ahead: bool) -> PathPoints:
    """Points on a curve."""
    knots = np.asarray(curve.knots)
    near = NEAR * float(np.diff(knots).min())
    piece = _pieces(knots, coordinates + (near if ahead else -near))
    width = np.diff(knots)[piece]
    fraction = np.clip((coordinates - knots[piece]) / width, 0.0, 1.0)
    turning = None if curve.quaternion is None else _raised(np.asarray(curve.quaternion))[piece]
    offset = None if curve.offset is None else np.broadcast_to(curve.offset, (len(piece), 3))
    return PathPoints(_raised(np.asarray(curve.position))[piece], turning, fraction, width, offset)


def _raised(coefficients: np.ndarray) -> np.ndarray:
    # Write the same pieces as polynomials of a higher degree.
    while coefficients.shape[1] <= DEGREE:
        degree = coefficients.shape[1]
        fractions = (np.arange(1, degree) / degree)[:, None]
        inner = fractions * coefficients[:, :-1] + (1.0 - fractions) * coefficients[:, 1:]
        coefficients = np.concatenate([coefficients[:, :1], inner, coefficients[:, -1:]], axis=1)
    return coefficients


def state_at(point: PathPoints) -> State:
    """State at one point of a path that is traversed at unit path speed."""
    return piece_state(*point)


@persistent_jit(compiler_options=compile_options.proof_options())
def _half_planes(
    robot: AnyRobot, limits: Limits, arguments: tuple[PathPoints, Array, ReferenceMotion | None]
) -> HalfPlanes:
    return jax.vmap(lambda point, speed, reference: path_half_planes(robot, limits, state_at(point), speed, reference))(
        *arguments
    )


def side_half_planes(
    robot: AnyRobot,
    limits: Limits,
    curves: Sequence[Spline],
    grids: Sequence[PathGrid],
    references: Sequence[PathSpeeds | None],
) -> list[tuple[HalfPlanes, HalfPlanes]]:
    """Half-planes at the starts and at the ends of the cells of several sections; all have references, or none has."""
    points, speeds, jumps_of_grids, near = [], [], [], list[ReferenceMotion]()
    for curve, grid, run in zip(curves, grids, references, strict=True):
        # Compute only one side of each node, and the other one where something jumps.
        jumps = np.flatnonzero(np.isin(grid.nodes, curve.jumps()) | np.pad(grid.speed[1:] != grid.speed[:-1], 1))
        points += [
            points_on(curve, grid.nodes[:-1], ahead=True),
            points_on(curve, grid.nodes[[*jumps.tolist(), -1]], ahead=False),
        ]
        speeds += [grid.speed, grid.speed[[*(jumps - 1).tolist(), -1]]]
        jumps_of_grids.append(jumps)
        if run is not None:
            behind = run.after[[*(jumps - 1).tolist(), -1]], run.x[[*jumps.tolist(), -1]]
            near += [ReferenceMotion(run.before, run.x[:-1]), ReferenceMotion(*behind)]
    together = jax.tree.map(lambda *x: np.concatenate(x), *points)
    batch = BATCH if len(curves) == 1 else MANY
    reference = jax.tree.map(lambda *x: np.concatenate(x), *near) if near else None
    arguments = (together, np.concatenate(speeds), reference)
    half_planes = in_batches(partial(_half_planes, robot, limits), arguments, batch_size=batch)
    sides, first = [], 0
    for grid, jumps in zip(grids, jumps_of_grids, strict=True):
        count = len(grid.speed)
        last = first + count + len(jumps) + 1
        start = jax.tree.map(lambda x, part=slice(first, first + count): x[part], half_planes)
        before = jax.tree.map(lambda x, part=slice(first + count, last): x[part], half_planes)
        end = jax.tree.map(lambda s, b, j=jumps: _ended(s, b, j), start, before)
        sides.append((start, end))
        first = last
    return sides


def _ended(start: np.ndarray, before: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    # Values at the ends of cells are those at the starts of the next cells, except at jumps and at the last node.
    end = np.concatenate([start[1:], before[-1:]])
    end[jumps - 1] = before[:-1]
    return end


@persistent_jit(compiler_options=compile_options.proof_options())
def _derivatives(points: PathPoints) -> Any:
    def one(point: PathPoints):
        rates = [piece_values(point.position, point.fraction, point.width)]
        if point.quaternion is not None:
            rates.append(piece_values(point.quaternion, point.fraction, point.width))
        return rates

    return jax.vmap(one)(points)


def derivatives(points: PathPoints) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Values and first two derivatives along the path."""
    return in_batches(_derivatives, points, batch_size=BATCH)
