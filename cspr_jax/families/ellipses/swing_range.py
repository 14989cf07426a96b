"""Range of swings: to each landing place the slowest release from an ellipse about a centre, at its natural frequency.

After the time of flight t the object is at the target if the velocity of the release p is (q - p) / t, with q the place
above the target from which it would fall there in that time. With depths below the plane of the spools, D that of the
centre, the ellipse is feasible exactly if the centre lies below the hull of the spools and (`releases`)

    (depth of p - D)^2 + (depth of q - depth of p)^2 / (w t)^2 < D^2,

an interval of the depth of p; a floor gives one of its height likewise. So for each time of flight the slowest release
is the point of a box, cut by planes parallel to that of the spools, that is nearest to q. Times of flight are searched.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import hull_of
from cspr_jax.maps.release_box import ReleaseBox
from cspr_jax.maps.releases import Releases
from cspr_jax.motion.limits import limits_set
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.schema.verdicts import FLAGS, Verdict

if TYPE_CHECKING:
    from jaxtyping import Float

# Shortest time of flight, over the longest one, number of times, and how often a grid of `AROUND` times narrows about
# the best one.
SHORTEST, LOOKS, AROUND, NARROWED = 0.003, 513, 33, 8
# Share of its room that an ellipse keeps from the plane of the spools and from the floor.
KEPT = 1e-6
# Bound of the rounding of margins.
MARGIN_ERROR = 1e-13
# Halvings that find a nearest point, and cells at a time.
HALVINGS, TOGETHER = 80, 256
# Slopes of the plane of the spools that count as none.
LEVEL = 1e-9


@dataclasses.dataclass(frozen=True)
class SwingRange(Releases):
    """Slowest releases from ellipses to n landing places; see `Releases`.

    Where there is none, the verdict says what stands in the way at all times of flight that were looked at. Margins are
    of taut cables and depth, and over the depth of the centre of the floor.

    Fields:
        swing_amplitude: (n,) largest distance of the ellipse from its centre, m.
    """

    swing_amplitude: np.ndarray


def other_limit(limits: Limits) -> str | None:
    """Name of a limit other than a floor, which no formula here knows."""
    names = [row.name for row in limits_set(limits) if row.name != "floor"]
    return next(iter([*names, *(["uncertainty"] if limits.uncertainty is not None else [])]), None)


class _Cells(NamedTuple):
    # Centres and targets of n cells, depths of the centres below the plane of the spools, natural frequencies (n, 1).
    centre: np.ndarray
    target: np.ndarray
    depth: np.ndarray
    frequency: np.ndarray


class _Space(NamedTuple):
    # Normal of the plane of the spools, gravity, places of release, depth of the floor.
    normal: np.ndarray
    gravity: float
    box: ReleaseBox
    floor: float


class _Looks(NamedTuple):
    # At (n, k) times of flight: the slowest release, (n, k, 3), its speed, inf without one, and the largest rooms that
    # ellipses leave below the plane of the spools and above the floor, over the depth of the centre.
    place: np.ndarray
    speed: np.ndarray
    below: np.ndarray
    above: np.ndarray


def swing_range(
    robot: PointMassRobot,
    centres: Float[np.ndarray, "n 3"],
    targets: Float[np.ndarray, "n 3"],
    box: ReleaseBox,
    floor: float | None = None,
) -> SwingRange:
    """Slowest releases from ellipses at their natural frequencies."""
    hull = hull_of(robot)
    space = _Space(np.asarray(hull.normal), float(robot.gravity), box, np.inf if floor is None else floor)
    depth = _depth(centres, space.normal)
    # Above the spools there is no swing, and any numbers do.
    cells = _Cells(centres, targets, np.where(depth > 0.0, depth, 1.0), np.zeros((len(centres), 1)))
    cells = cells._replace(frequency=np.sqrt(space.gravity / cells.depth)[:, None])
    parts = [slice(i, i + TOGETHER) for i in range(0, len(centres), TOGETHER)]
    columns = [_slowest(space, _Cells(*(column[part] for column in cells))) for part in parts]
    time, place, speed, below, above = (np.concatenate(column) for column in zip(*columns, strict=True))
    velocity = (_above(space, cells, time[:, None])[:, 0] - place) / time[:, None]
    ellipse, rates = Ellipse(centres, place - centres, velocity / cells.frequency), cells.frequency[:, 0]
    nothing = np.zeros_like(centres)
    still = harmonics.of_many(harmonics.least_margin, hull, Ellipse(centres, nothing, nothing), rates)
    margin = harmonics.of_many(harmonics.least_margin, hull, ellipse, rates)
    is_found = np.isfinite(speed) & (margin > MARGIN_ERROR)
    lost = np.where(below > 0.0, 0, Verdict.ABOVE_SPOOLS.value) | np.where(above > 0.0, 0, Verdict.BELOW_FLOOR.value)
    lost = np.where(still > 0.0, np.where(lost == 0, Verdict.UNDECIDED.value, lost), Verdict.SLACK_CABLE.value)
    lost = np.where(np.abs(still) > MARGIN_ERROR, lost, Verdict.UNDECIDED.value)
    lost = np.where(depth > 0.0, lost, Verdict.ABOVE_SPOOLS.value)
    # The larger half-axis, from the eigenvalues of a a + b b.
    squares = [np.sum(one * other, axis=1) for one, other in ((ellipse[1],) * 2, (ellipse[2],) * 2, ellipse[1:])]
    size = np.sqrt(0.5 * (squares[0] + squares[1]) + np.hypot(0.5 * (squares[0] - squares[1]), squares[2]))

    def shown(values: np.ndarray) -> np.ndarray:
        return np.where(is_found, values, np.nan)

    return SwingRange(
        np.where(is_found, 0, lost).astype(FLAGS),
        np.where(still > 0.0, np.minimum(np.minimum(still, 1.0) * below, above), np.minimum(still, -KEPT)),
        *(shown(x) for x in (speed, time, *place.T, size)),
    )


def _depth(places: np.ndarray, normal: np.ndarray) -> np.ndarray:
    # Below the plane of the spools, (...) m; a product of matrices would round by the number of places.
    return places[..., 0] * normal[0] + places[..., 1] * normal[1] + places[..., 2] * normal[2]


def _above(space: _Space, cells: _Cells, times: np.ndarray) -> np.ndarray:
    # Places from which the object would fall to the target, (n, k, 3).
    fall = 0.5 * space.gravity * times[..., None] ** 2
    return cells.target[:, None] - fall * np.array([0.0, 0.0, 1.0])


def _looks(space: _Space, cells: _Cells, times: np.ndarray) -> _Looks:
    normal, (low, high) = space.normal, space.box
    fallen, fraction = _above(space, cells, times), 1.0 / (cells.frequency * times) ** 2
    # Depths that the box has, and those that ellipses leave.
    corners = np.sort(np.stack([low * normal, high * normal]), axis=0).sum(1)
    depths = _interval(cells.depth, _depth(fallen, normal), fraction, cells.depth, corners)
    heights = _interval(
        cells.centre[:, 2], fallen[..., 2], fraction, space.floor - cells.centre[:, 2], (low[2], high[2])
    )
    first, last = (np.broadcast_to(side, fallen.shape).copy() for side in (low, high))
    first[..., 2], last[..., 2] = np.maximum(low[2], heights.low), np.minimum(high[2], heights.high)
    place = _nearest(fallen, first, last, normal, depths)
    depth = _depth(place, normal)
    rounding = KEPT * 1e-3 * cells.depth[:, None]
    is_in = (depth > depths.low - rounding) & (depth < depths.high + rounding) & (first[..., 2] <= last[..., 2])
    speed = np.sqrt(((fallen - place) ** 2).sum(-1)) / times
    above = np.where(np.isinf(space.floor), np.inf, heights.room / cells.depth[:, None])
    return _Looks(place, np.where(is_in, speed, np.inf), depths.room / cells.depth[:, None], above)


class _Interval(NamedTuple):
    # Ends of a coordinate of the release, (n, k) m, NaN where there is none; and the largest room in the box, m.
    low: np.ndarray
    high: np.ndarray
    room: np.ndarray


def _interval(centre: np.ndarray, fallen: np.ndarray, fraction: np.ndarray, reach: np.ndarray, box) -> _Interval:
    # The p for which (p - centre)^2 + share (fallen - p)^2 stays below the square of the reach.
    middle = (centre[:, None] + fraction * fallen) / (1.0 + fraction)
    away, inner = fallen - centre[:, None], reach[:, None] * (1.0 - KEPT)
    square = inner**2 / (1.0 + fraction) - fraction * away**2 / (1.0 + fraction) ** 2
    half = np.where(inner > 0.0, np.sqrt(np.where(square >= 0.0, square, np.nan)), np.nan)
    best = np.clip(middle, *box)
    swing = np.sqrt((best - centre[:, None]) ** 2 + fraction * (fallen - best) ** 2)
    return _Interval(middle - half, middle + half, reach[:, None] - swing)


def _nearest(
    places: np.ndarray, low: np.ndarray, high: np.ndarray, normal: np.ndarray, depths: _Interval
) -> np.ndarray:
    # The points nearest to places in boxes whose depth lies in an interval: a shift along the normal, cut by the box.
    nearest = np.minimum(np.maximum(places, low), high)
    depth = _depth(nearest, normal)
    goal = np.ravel(np.clip(depth, depths.low, depths.high))
    moved = np.flatnonzero((goal != np.ravel(depth)) & np.isfinite(goal))
    start, first, last = (x.reshape(-1, 3)[moved] for x in (places, low, high))
    goal = goal[moved]
    # A shift that takes each coordinate which it changes beyond the box.
    slope = np.abs(normal[np.abs(normal) > LEVEL])
    away = np.maximum(np.abs(first - start), np.abs(last - start))[:, np.abs(normal) > LEVEL]
    up = (away / slope).max(1, initial=0.0)
    down = -up
    for _ in range(HALVINGS):
        shift = 0.5 * (down + up)
        is_high = _depth(np.minimum(np.maximum(start + shift[:, None] * normal, first), last), normal) > goal
        down, up = np.where(is_high, down, shift), np.where(is_high, shift, up)
    flat = nearest.reshape(-1, 3)
    flat[moved] = np.minimum(np.maximum(start + (0.5 * (down + up))[:, None] * normal, first), last)
    return flat.reshape(places.shape)


def _slowest(space: _Space, cells: _Cells) -> tuple[np.ndarray, ...]:
    # Times of flight, places and speeds of the slowest releases; rooms below the spools and above the floor at the time
    # at which the smaller of both is the largest.
    top = np.minimum(space.box.low * space.normal, space.box.high * space.normal).sum()
    # Longer flights rise above the spools.
    drop = np.maximum((_depth(cells.target, space.normal) - top) / cells.depth, 0.0)
    longest = 1.0 + np.sqrt(1.0 + 2.0 * drop)
    times = np.geomspace(SHORTEST, 1.0, LOOKS) * longest[:, None] / cells.frequency
    looks, each = _looks(space, cells, times), np.arange(len(drop))
    at = np.minimum(looks.below, looks.above).argmax(1)
    below, above = looks.below[each, at], looks.above[each, at]
    for _ in range(NARROWED):
        best = looks.speed.argmin(1)
        first, last = (times[each, np.clip(best + step, 0, times.shape[1] - 1)] for step in (-1, 1))
        times = np.linspace(first, last, AROUND, axis=1)
        looks = _looks(space, cells, times)
    best = looks.speed.argmin(1)
    return times[each, best], looks.place[each, best], looks.speed[each, best], below, above
