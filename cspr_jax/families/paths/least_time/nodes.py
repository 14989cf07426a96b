"""Nodes of a section of a path: between them the path acceleration is sought, and at both sides of them half-planes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np
from jax import Array

from cspr_jax.curves.spline import Spline, piece_state, piece_values
from cspr_jax.families.paths.geometry.section import Section
from cspr_jax.families.paths.least_time.constraints import Rows, path_rows
from cspr_jax.numerics.batches import in_batches
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.state import State
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit

if TYPE_CHECKING:
    from jaxtyping import Float

# Part of the nodes over which cells become wider, from an end at zero speed on; cells there that are narrower still.
RAMP, SMALLER = 0.25, 5
# Places that are computed together, of one section and of several. Pieces are raised to one degree, so that all
# sections share what is compiled.
BATCH, MANY, DEGREE = 64, 512, 5
# A node that is nearer to the end of a piece than this part of its width lies there.
NEAR = 1e-9


class PathGrid(NamedTuple):
    """Nodes of one section.

    Fields:
        nodes: (n_cells + 1,) path coordinates, m; there is one at each mark, and where accelerations or speed limits
            jump.
        speed: (n_cells,) largest speed of the mass centre in each cell, m/s, inf for none.
        feed: (n_cells,) the same where the section itself has it, and not the limits of the robot.
    """

    nodes: np.ndarray
    speed: np.ndarray
    feed: np.ndarray

    @property
    def width(self) -> np.ndarray:
        """Widths of the cells, (n_cells,), m."""
        return np.diff(self.nodes)


class Places(NamedTuple):
    """Places on pieces of a section, (k, ...) each.

    Fields:
        position: (k, 6, 3) Bernstein coefficients of their pieces, m.
        quaternion: (k, 6, 4) likewise; None for a point mass.
        fraction: (k,) of the piece before the place.
        width: (k,) of the pieces, m.
        offset: (k, 3) as of `Spline`, or None.
    """

    position: Any
    quaternion: Any
    fraction: Any
    width: Any
    offset: Any


def grid_of(section: Section, count: int, slow: tuple[bool, bool], speed_max: float = np.inf) -> PathGrid:
    """Nodes of a section: close together where it is slow, as times of a motion that speeds up and slows down are."""
    knots = np.asarray(section.curve.knots)
    nodes = knots[-1] * _shares(count, slow)
    changes = knots[1:-1][section.speed[1:] != section.speed[:-1]]
    places: list[float] = np.unique(np.concatenate([section.curve.jumps(), changes, section.marks[1:-1]])).tolist()
    for k, place in enumerate(places):
        nearest = int(np.argmin(np.abs(nodes - place)))
        if 0 < nearest < len(nodes) - 1 and nodes[nearest] not in places[:k]:
            nodes[nearest] = place
        else:
            nodes = np.insert(nodes, np.searchsorted(nodes, place), place)
    speed = section.speed[_pieces(knots, 0.5 * (nodes[1:] + nodes[:-1]))]
    return PathGrid(nodes, np.minimum(speed, speed_max), np.where(speed < speed_max, speed, np.inf))


def _pieces(knots: np.ndarray, places: np.ndarray) -> np.ndarray:
    return np.clip(np.searchsorted(knots, places, side="right") - 1, 0, len(knots) - 2)


def _shares(count: int, slow: tuple[bool, bool]) -> np.ndarray:
    # The cells at slow ends are divided again, each a quarter as wide as the next.
    more = SMALLER if count > 8 * SMALLER else 0
    shares = _way(np.linspace(0.0, 1.0, count + 1 - more * sum(slow)), slow)
    parts = 0.25 ** np.arange(more, 0, -1)
    first, last = shares[1] * parts, 1.0 - (1.0 - shares[-2]) * parts[::-1]
    inner = [first] * slow[0] + [shares[1:-1]] + [last] * slow[1]
    return np.concatenate([shares[:1], *inner, shares[-1:]])


def _way(time: np.ndarray, slow: tuple[bool, bool]) -> np.ndarray:
    # Way of a motion that speeds up over a part of its time, and slows down over as long, where it has to.
    before, after = (RAMP if end else 0.0 for end in slow)
    way, left = time - 0.5 * before, 1.0 - time
    total = 1.0 - 0.5 * before - 0.5 * after
    if before:
        way = np.where(time < before, 0.5 * time**2 / before, way)
    if after:
        way = np.where(left < after, total - 0.5 * left**2 / after, way)
    return way / total


def places_on(curve: Spline, coordinates: Float[np.ndarray, "k"], *, ahead: bool) -> Places:
    """Places on a curve."""
    knots = np.asarray(curve.knots)
    near = NEAR * float(np.diff(knots).min())
    piece = _pieces(knots, coordinates + (near if ahead else -near))
    width = np.diff(knots)[piece]
    fraction = np.clip((coordinates - knots[piece]) / width, 0.0, 1.0)
    turning = None if curve.quaternion is None else _raised(np.asarray(curve.quaternion))[piece]
    offset = None if curve.offset is None else np.broadcast_to(curve.offset, (len(piece), 3))
    return Places(_raised(np.asarray(curve.position))[piece], turning, fraction, width, offset)


def _raised(coefficients: np.ndarray) -> np.ndarray:
    # The same pieces as polynomials of a higher degree.
    while coefficients.shape[1] <= DEGREE:
        degree = coefficients.shape[1]
        shares = (np.arange(1, degree) / degree)[:, None]
        inner = shares * coefficients[:, :-1] + (1.0 - shares) * coefficients[:, 1:]
        coefficients = np.concatenate([coefficients[:, :1], inner, coefficients[:, -1:]], axis=1)
    return coefficients


def state_at(place: Places) -> State:
    """State of a path that is run along at a unit path speed, at one place."""
    return piece_state(*place)


@persistent_jit(compiler_options=compile_options.proof_options())
def _rows(robot: AnyRobot, limits: Limits, arguments: tuple[Places, Array]) -> Rows:
    return jax.vmap(lambda place, speed: path_rows(robot, limits, state_at(place), speed))(*arguments)


def side_rows(
    robot: AnyRobot, limits: Limits, curves: Sequence[Spline], grids: Sequence[PathGrid]
) -> list[tuple[Rows, Rows]]:
    """Half-planes at the starts and at the ends of the cells of several sections."""
    places, speeds, apart = [], [], []
    for curve, grid in zip(curves, grids, strict=True):
        # One computation will do for both sides of a node, but where something jumps.
        jumps = np.flatnonzero(np.isin(grid.nodes, curve.jumps()) | np.pad(grid.speed[1:] != grid.speed[:-1], 1))
        places += [
            places_on(curve, grid.nodes[:-1], ahead=True),
            places_on(curve, grid.nodes[[*jumps.tolist(), -1]], ahead=False),
        ]
        speeds += [grid.speed, grid.speed[[*(jumps - 1).tolist(), -1]]]
        apart.append(jumps)
    together = jax.tree.map(lambda *leaves: np.concatenate(leaves), *places)
    size = BATCH if len(curves) == 1 else MANY
    rows = in_batches(partial(_rows, robot, limits), (together, np.concatenate(speeds)), batch_size=size)
    sides, first = [], 0
    for grid, jumps in zip(grids, apart, strict=True):
        count = len(grid.speed)
        last = first + count + len(jumps) + 1
        start = jax.tree.map(lambda leaf, part=slice(first, first + count): leaf[part], rows)
        before = jax.tree.map(lambda leaf, part=slice(first + count, last): leaf[part], rows)
        end = jax.tree.map(lambda s, b, j=jumps: _ended(s, b, j), start, before)
        sides.append((start, end))
        first = last
    return sides


def _ended(start: np.ndarray, before: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    # Values at the ends of cells: those at the next starts, but where they jump, and at the last node.
    end = np.concatenate([start[1:], before[-1:]])
    end[jumps - 1] = before[:-1]
    return end


@persistent_jit(compiler_options=compile_options.proof_options())
def _derivatives(places: Places) -> Any:
    def one(place: Places):
        rates = [piece_values(place.position, place.fraction, place.width)]
        if place.quaternion is not None:
            rates.append(piece_values(place.quaternion, place.fraction, place.width))
        return rates

    return jax.vmap(one)(places)


def derivatives(places: Places) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Values and first two derivatives along the path."""
    return in_batches(_derivatives, places, batch_size=BATCH)
