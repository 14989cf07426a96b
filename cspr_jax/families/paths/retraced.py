"""Paths of motions of any kind, as sections from stop to stop, along which other speeds can be chosen.

With the speed g = sqrt(|v|^2 + (r w)^2) of a motion, where r is the radius of the platform, the path coordinate has
ds = g dt, the first derivative is p' = v / g and the second (a - p' dg/dt) / g^2; quaternions likewise. At a stop p' is
the direction of the acceleration or, if that vanishes too, the limit of v / g, from samples beside the stop; p'' may
have no limit there, and is taken from the cubic through the end of the first piece.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BPoly

from cspr_jax.curves.interpolation import hermite
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import InputError
from cspr_jax.families.paths.geometry.section import Section
from cspr_jax.families.paths.geometry.waypoints import MotionSequence, MovingPoints, SmoothPart
from cspr_jax.families.paths.least_time.jumping import PathAccelerations
from cspr_jax.motion.motion import Motion
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.platform import PlatformRobot

# A piece is halved while it is farther than this from the path of the motion, m, while it turns by more than this
# angle, rad, or while the ratio of the speeds at its ends is larger than this.
CLOSE = 1e-8
TURN = 0.1
RATIO = 1.3
HALVINGS = 32  # largest number of halvings
BRIEF = 4e-6  # s; shorter pieces are not halved, since rounding affects their second derivatives too much
PIECES, FEWEST = 48, 4  # number of pieces of a section at first, and smallest number in each smooth part
# The direction at a stop is extrapolated from samples at these fractions of a smooth part, with these weights.
BESIDE, WEIGHTS = 1e-3 * np.arange(1.0, 5.0), np.array([4.0, -6.0, 4.0, -1.0])
# Near a stop the acceleration counts as constant if speed over time differs from it by a smaller fraction.
UNEVEN = 0.1
# Fractions of the time of each piece that divide it, for quadrature, and for comparing the curve with the motion.
QUARTERS = np.linspace(0.0, 1.0, 5)
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
AXES = 3
# At ends that are not stops, the mass centre must be faster than this fraction of the speed that includes rotation.
TURNS = 1e-6


class Retraced(NamedTuple):
    """Path of motions from one stop to the next.

    Fields:
        section: section in the axes of the motions; its knots are at ends of motions, and where
            the motion almost stops.
        segments: (k - 1,) indices of the motions between its k knots.
        speeds: speeds of the mass centre at the start and at the end, m/s.
        accelerations: path accelerations of the motions.
        deviation: largest distance of the section from the path of the motions, at samples, m.
    """

    section: Section
    segments: np.ndarray
    speeds: tuple[float, float]
    accelerations: PathAccelerations
    deviation: float


@dataclasses.dataclass
class _Pieces:
    # The n pieces of a section: the smooth part that each belongs to, and its start and end as fractions of the part.
    number: np.ndarray
    start: np.ndarray
    end: np.ndarray

    def halved(self, chosen: np.ndarray) -> "_Pieces":
        counts = 1 + chosen
        number, start, end = (np.repeat(x, counts) for x in (self.number, self.start, self.end))
        middle = 0.5 * (self.start + self.end)[chosen]
        first = (np.cumsum(counts) - counts)[chosen]
        end[first], start[first + 1] = middle, middle
        return _Pieces(number, start, end)

    def times(self, times: np.ndarray) -> np.ndarray:
        # Return the times of the pieces from those of the parts.
        return times[self.number] * (self.end - self.start)

    def within(self, fractions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Return parts, and fractions of parts, at given fractions of all pieces, (n * k,) each.
        inner = self.start[:, None] + (self.end - self.start)[:, None] * fractions
        return np.repeat(self.number, len(fractions)), inner.ravel()


def platform_radius(robot: AnyRobot) -> float:
    """Radius of a platform, by which angles become lengths along paths."""
    if not isinstance(robot, PlatformRobot):
        return 1.0
    return float(np.linalg.norm(np.asarray(robot.platform_points), axis=1).max())


def retraced(
    robot: AnyRobot, motions: Sequence[Motion], cells: int, feeds: Sequence[np.ndarray | None] = ()
) -> list[Retraced]:
    """Paths of consecutive motions, from each stop to the next."""
    sequence = MotionSequence(motions, platform_radius(robot))
    paths: list[Retraced] = []
    run: list[SmoothPart] = []
    for part in sequence.parts():
        if run and (run[-1].at_rest[1] or part.at_rest[0]):
            paths.append(_path(sequence, run, cells, feeds))
            run = []
        run.append(part)
    return [*paths, _path(sequence, run, cells, feeds)] if run else paths


def _feed(motions: MotionSequence, part: SmoothPart, feeds: Sequence[np.ndarray | None]) -> float:
    # Return the feed in a smooth part, which lies in one piece of its motion.
    pieces = feeds[part.motion] if feeds else None
    if pieces is None:
        return np.inf
    ends = motions.ends(part.motion)
    return float(pieces[np.searchsorted(ends, 0.5 * (part.start + part.end), side="right") - 1])


def _path(motions: MotionSequence, parts: list[SmoothPart], cells: int, feeds: Sequence[np.ndarray | None]) -> Retraced:
    times = motions.times(parts)
    counts = np.maximum(FEWEST, np.round(PIECES * times / times.sum())).astype(int)
    number = np.repeat(np.arange(len(parts)), counts)
    start = np.concatenate([np.arange(count) / count for count in counts])
    pieces = _Pieces(number, start, start + 1.0 / counts[number])
    signs = _signs(motions, parts)
    for _ in range(HALVINGS):
        curve, distances = _curve(motions, parts, pieces, signs)
        is_coarse = (distances > CLOSE) | _changes(motions, parts, pieces)
        chosen = is_coarse & (pieces.times(times) > BRIEF)
        if not chosen.any():
            break
        pieces = pieces.halved(chosen)
    numbers = np.array([part.motion for part in parts])[pieces.number]
    # Nodes are close together where the motion almost stops as well.
    is_knot = np.diff(numbers, prepend=-1) != 0
    narrow = np.diff(curve.knots) < curve.knots[-1] / cells
    is_knot[1:] |= narrow[1:] & narrow[:-1]
    knots = np.asarray(curve.knots)[[*np.flatnonzero(is_knot).tolist(), -1]]
    ends = motions.inside(parts, pieces.number[[0, -1]], np.array([0.0, 1.0]))
    at_rest = np.array([parts[0].at_rest[0], parts[-1].at_rest[1]])
    start, end = np.where(at_rest, 0.0, np.linalg.norm(ends.velocity[:, :AXES], axis=1)).tolist()
    if ((np.array([start, end]) <= TURNS * ends.speed) & ~at_rest).any():
        name = f"segment {numbers[0] + 1}"
        raise InputError(name, None, "must move its mass centre where it begins and ends", problem="it turns in place")
    return Retraced(
        section=Section(curve, np.array([_feed(motions, part, feeds) for part in parts])[pieces.number], knots),
        segments=numbers[is_knot],
        speeds=(start, end),
        accelerations=_path_accelerations(motions, parts, pieces, curve),
        deviation=float(distances.max()),
    )


def _changes(motions: MotionSequence, parts: list[SmoothPart], pieces: _Pieces) -> np.ndarray:
    # Tell for each piece whether direction or speed change much along it. Pieces at a stop do not count: there the
    # ratio of speeds is always large.
    start, end = (motions.inside(parts, pieces.number, fraction) for fraction in (pieces.start, pieces.end))
    speeds = np.stack([start.speed, end.speed])
    ratio = speeds.max(0) > RATIO * speeds.min(0)
    cosine = np.sum(start.velocity * end.velocity, axis=1) / np.maximum(speeds.prod(0), np.finfo(float).tiny)
    changes = ratio | (cosine < np.cos(TURN))
    for piece, at_rest in ((0, parts[0].at_rest[0]), (-1, parts[-1].at_rest[1])):
        changes[piece] &= not at_rest
    return changes


def _path_accelerations(
    motions: MotionSequence, parts: list[SmoothPart], pieces: _Pieces, curve: Spline
) -> PathAccelerations:
    # If the acceleration jumps at the end of a piece, take its value inside the piece.
    start, end = (motions.inside(parts, pieces.number, fraction) for fraction in (pieces.start, pieces.end))
    speed_rates = []
    for rates in (start, end):
        speed = np.maximum(rates.speed, np.finfo(float).tiny)
        speed_rates.append(np.sum(rates.velocity * rates.acceleration, axis=1) / speed)
    both = np.stack(speed_rates, axis=1).ravel()
    for edge, near, at_rest in ((0, 1, parts[0].at_rest[0]), (-1, -2, parts[-1].at_rest[1])):
        both[edge] = both[near] if at_rest else both[edge]
    return PathAccelerations(np.repeat(curve.knots, 2)[1:-1], both)


def _signs(motions: MotionSequence, parts: list[SmoothPart]) -> np.ndarray:
    # Return signs (m,) that make quaternions continuous from part to part.
    count = np.arange(len(parts))
    first, last = (motions.inside(parts, count, np.full(len(parts), fraction)).position for fraction in (0.0, 1.0))
    products = np.sum(first[1:, AXES:] * last[:-1, AXES:], axis=1)
    return np.cumprod(np.append(1.0, np.where(products < 0.0, -1.0, 1.0)))


def _curve(
    motions: MotionSequence, parts: list[SmoothPart], pieces: _Pieces, signs: np.ndarray
) -> tuple[Spline, np.ndarray]:
    # Return Hermite pieces, and the largest distance of each from the path of the motions.
    times = pieces.times(motions.times(parts))
    fractions = (QUARTERS[:-1, None] + 0.125 * (_POINTS + 1.0)).ravel()
    speeds = motions.inside(parts, *pieces.within(fractions)).speed.reshape(len(times), len(QUARTERS) - 1, -1)
    lengths = 0.125 * times[:, None] * (speeds @ _WEIGHTS)
    widths = lengths.sum(1)
    knots = np.concatenate([[0.0], np.cumsum(widths)])

    def signed(rates: MovingPoints, number: np.ndarray) -> MovingPoints:
        ones = np.ones((len(number), AXES))
        sign = np.concatenate([ones, np.repeat(signs[number, None], rates.position.shape[1] - AXES, axis=1)], axis=1)
        return rates._replace(position=rates.position * sign, first=rates.first * sign, second=rates.second * sign)

    start = _derivatives(signed(motions.inside(parts, pieces.number, pieces.start), pieces.number))
    end = _derivatives(signed(motions.inside(parts, pieces.number, pieces.end), pieces.number))
    for side, piece, at_rest in ((start, 0, parts[0].at_rest[0]), (end, -1, parts[-1].at_rest[1])):
        if at_rest:
            number = np.full(len(BESIDE), pieces.number[piece])
            sign = -1.0 if piece else 1.0
            beside = signed(motions.inside(parts, number, BESIDE if piece == 0 else 1.0 - BESIDE), number)
            side[1][piece] = _direction(beside, sign * BESIDE[:2] * motions.times(parts)[number[:2]])
            chord, h = end[0][piece] - start[0][piece], widths[piece]
            near, far = (2.0, 4.0) if piece else (4.0, 2.0)
            side[2][piece] = sign * (6.0 * chord / h - near * start[1][piece] - far * end[1][piece]) / h
    nodes = np.repeat(knots, 2)[1:-1]
    values = [np.stack(pair, axis=1).reshape(len(nodes), -1) for pair in zip(start, end, strict=True)]
    table = hermite(nodes, values)
    inner = motions.inside(parts, *pieces.within(QUARTERS[1:-1]))
    coordinates = (knots[:-1, None] + np.cumsum(lengths, axis=1)[:, :-1]).ravel()
    off = BPoly(np.moveaxis(table, 1, 0), knots)(coordinates) - signed(inner, np.repeat(pieces.number, 3)).position
    distances = _distances(off, inner, motions.platform_radius).reshape(len(times), -1).max(1)
    quaternion = as_float64(table[:, :, AXES:]) if table.shape[2] > AXES else None
    return Spline(as_float64(knots), as_float64(table[:, :, :AXES]), quaternion), distances


def _direction(beside: MovingPoints, times: np.ndarray) -> np.ndarray:
    # Return the derivative along the path at a stop, from samples at times (2,) after the stop, s; negative: before it.
    norm = np.linalg.norm(beside.acceleration[0])
    if abs(beside.speed[0] / abs(times[0]) - norm) < UNEVEN * norm:
        # Near the stop the acceleration is almost constant, and gives the direction.
        direction, acceleration = (2.0 * pair[0] - pair[1] for pair in (beside.second, beside.acceleration))
        return np.sign(times[0]) * direction / np.linalg.norm(acceleration)
    mean = WEIGHTS @ _derivatives(beside)[1]
    return mean / np.linalg.norm(WEIGHTS @ (beside.velocity / beside.speed[:, None]))


def _derivatives(rates: MovingPoints) -> list[np.ndarray]:
    # Return the position and its first two derivatives along the path.
    speed = rates.speed[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):  # at stops
        first = rates.first / speed
        speed_rate = np.sum(rates.velocity * rates.acceleration, axis=1, keepdims=True) / speed
        return [rates.position, first, (rates.second - first * speed_rate) / speed**2]


def _distances(off: np.ndarray, rates: MovingPoints, radius: float) -> np.ndarray:
    # Return lengths of the components across the path; a quaternion changes by half the angle of its orientation.
    off = np.concatenate([off[:, :AXES], 2.0 * radius * off[:, AXES:]], axis=1)
    along = np.concatenate([rates.first[:, :AXES], 2.0 * radius * rates.first[:, AXES:]], axis=1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.linalg.norm(off - np.sum(off * along, axis=1, keepdims=True) * along, axis=1)
