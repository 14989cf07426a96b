"""Swing range: the slowest release to each landing point, from an ellipse about a centre at its natural frequency.

Released at p with velocity (q - p) / t, the object hits the target after the time of flight t; q is the point above the
target from which an object at rest would fall to it in that time. With depths below the plane of the spools, and D that
of the centre, the ellipse is feasible exactly if the centre lies below the hull of the spools and (`releases`)

    (depth of p - D)^2 + (depth of q - depth of p)^2 / (w t)^2 < D^2,

an interval of the depth of p; a floor gives an interval of its height likewise. So for each time of flight, the slowest
release is the point nearest to q of a box cut by planes parallel to that of the spools. Times of flight are searched.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import hull_of
from cspr_jax.maps.release_box import ReleaseBox
from cspr_jax.maps.releases import Releases
from cspr_jax.motion.limits import limits_set
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot, spool_radius
from cspr_jax.schema.verdicts import FLAGS, Verdict

SHORTEST = 0.003  # shortest time of flight over the longest one
GRID = 513  # number of times of flight tried first
AROUND = 33  # number of times in each narrower grid about the best one
NARROWED = 8  # number of narrower grids
# Distance of ellipses from the plane of the spools, over the depth of their centre.
KEPT = 1e-6
# Bound of the rounding errors of margins.
MARGIN_ERROR = 1e-13
HALVINGS = 80  # bisections for a nearest point
TOGETHER = 256  # number of cells computed at a time
# Components of the normal of the spool plane up to this value count as zero.
LEVEL = 1e-9


@dataclasses.dataclass(frozen=True)
class SwingRange(Releases):
    """Slowest releases from ellipses to n landing points; see `Releases`.

    Where there is no release, the verdict says what fails at all times of flight tried. Margins are the smallest
    slacks of taut cables and of the depth; the slack of the floor is relative to the depth of the centre.

    Fields:
        swing_amplitude: (n,) largest distance of the ellipse from its centre, m.
    """

    swing_amplitude: np.ndarray


def other_limit(limits: Limits) -> str | None:
    """Name of a limit other than a floor, which the formulas here do not cover; None if there is none."""
    names = [row.name for row in limits_set(limits) if row.name != "floor"]
    return next(iter([*names, *(["uncertainty"] if limits.uncertainty is not None else [])]), None)


class _Cells(NamedTuple):
    # Centres and targets of n cells, depths of the centres below the spool plane, natural frequencies (n, 1).
    centre: np.ndarray
    target: np.ndarray
    depth: np.ndarray
    frequency: np.ndarray


class _Space(NamedTuple):
    # Normal of the spool plane, gravity, box of releases, depth of the floor, and by how much it may be missed.
    normal: np.ndarray
    gravity: float
    box: ReleaseBox
    floor: float
    missed: float


class _Samples(NamedTuple):
    # Results at (n, k) times of flight: the slowest release, (n, k, 3), its speed (inf without a release), and the
    # largest slacks of ellipses to the spool plane and to the floor, over the depth of the centre.
    position: np.ndarray
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
    missed = TOUCHED * float(spool_radius(robot))
    space = _Space(np.asarray(hull.normal), float(robot.gravity), box, np.inf if floor is None else floor, missed)
    depth = _depth(centres, space.normal)
    # Above the spools there is no swing: replace depths by 1 to avoid NaN.
    cells = _Cells(centres, targets, np.where(depth > 0.0, depth, 1.0), np.zeros((len(centres), 1)))
    cells = cells._replace(frequency=np.sqrt(space.gravity / cells.depth)[:, None])
    parts = [slice(i, i + TOGETHER) for i in range(0, len(centres), TOGETHER)]
    columns = [_slowest(space, _Cells(*(column[part] for column in cells))) for part in parts]
    time, position, speed, below, above = (np.concatenate(column) for column in zip(*columns, strict=True))
    velocity = (_above(space, cells, time[:, None])[:, 0] - position) / time[:, None]
    ellipse, rates = Ellipse(centres, position - centres, velocity / cells.frequency), cells.frequency[:, 0]
    nothing = np.zeros_like(centres)
    static = harmonics.of_many(harmonics.least_margin, hull, Ellipse(centres, nothing, nothing), rates)
    margin = harmonics.of_many(harmonics.least_margin, hull, ellipse, rates)
    is_found = np.isfinite(speed) & (margin > MARGIN_ERROR)
    lost = np.where(below > 0.0, 0, Verdict.ABOVE_SPOOLS.value) | np.where(above > 0.0, 0, Verdict.BELOW_FLOOR.value)
    lost = np.where(static > 0.0, np.where(lost == 0, Verdict.UNDECIDED.value, lost), Verdict.SLACK_CABLE.value)
    lost = np.where(np.abs(static) > MARGIN_ERROR, lost, Verdict.UNDECIDED.value)
    lost = np.where(depth > 0.0, lost, Verdict.ABOVE_SPOOLS.value)
    # Return the larger half-axis, from the eigenvalues of a a + b b.
    squares = [np.sum(one * other, axis=1) for one, other in ((ellipse[1],) * 2, (ellipse[2],) * 2, ellipse[1:])]
    amplitude = np.sqrt(0.5 * (squares[0] + squares[1]) + np.hypot(0.5 * (squares[0] - squares[1]), squares[2]))

    def shown(values: np.ndarray) -> np.ndarray:
        return np.where(is_found, values, np.nan)

    return SwingRange(
        np.where(is_found, 0, lost).astype(FLAGS),
        np.where(static > 0.0, np.minimum(np.minimum(static, 1.0) * below, above), np.minimum(static, -KEPT)),
        *(shown(x) for x in (speed, time, *position.T, amplitude)),
    )


def _depth(positions: np.ndarray, normal: np.ndarray) -> np.ndarray:
    # Return depths below the spool plane, (...) m; a matrix product would round differently by number of points.
    return positions[..., 0] * normal[0] + positions[..., 1] * normal[1] + positions[..., 2] * normal[2]


def _above(space: _Space, cells: _Cells, times: np.ndarray) -> np.ndarray:
    # Return the points q from which an object would fall to the target, (n, k, 3).
    drop = 0.5 * space.gravity * times[..., None] ** 2
    return cells.target[:, None] - drop * np.array([0.0, 0.0, 1.0])


def _sampled(space: _Space, cells: _Cells, times: np.ndarray) -> _Samples:
    normal, (low, high) = space.normal, space.box
    fallen, fraction = _above(space, cells, times), 1.0 / (cells.frequency * times) ** 2
    # Intersect the depths of the box with those that feasible ellipses allow.
    corners = np.sort(np.stack([low * normal, high * normal]), axis=0).sum(1)
    depths = _interval(cells.depth, _depth(fallen, normal), fraction, cells.depth, corners, cells.depth * (1.0 - KEPT))
    height = space.floor - cells.centre[:, 2]
    # A floor may be touched, even by a swing that stays at this height.
    inner = np.where(height > space.missed, height, height + space.missed)
    heights = _interval(cells.centre[:, 2], fallen[..., 2], fraction, height, (low[2], high[2]), inner)
    first, last = (np.broadcast_to(side, fallen.shape).copy() for side in (low, high))
    first[..., 2], last[..., 2] = np.maximum(low[2], heights.low), np.minimum(high[2], heights.high)
    position = _nearest(fallen, first, last, normal, depths)
    depth = _depth(position, normal)
    rounding = KEPT * 1e-3 * cells.depth[:, None]
    is_in = (depth > depths.low - rounding) & (depth < depths.high + rounding) & (first[..., 2] <= last[..., 2])
    speed = np.sqrt(((fallen - position) ** 2).sum(-1)) / times
    clear = np.where(np.isinf(space.floor), np.inf, heights.slack / cells.depth[:, None])
    return _Samples(position, np.where(is_in, speed, np.inf), depths.slack / cells.depth[:, None], clear)


class _Interval(NamedTuple):
    # Ends of an interval of a coordinate of p, (n, k) m, NaN if it is empty, and the largest slack in the box, m.
    low: np.ndarray
    high: np.ndarray
    slack: np.ndarray


def _interval(
    centre: np.ndarray, fallen: np.ndarray, fraction: np.ndarray, radius: np.ndarray, box, inner: np.ndarray
) -> _Interval:
    # Return the interval of p where (p - centre)^2 + fraction (fallen - p)^2 is at most the squared inner radius.
    middle = (centre[:, None] + fraction * fallen) / (1.0 + fraction)
    away, inner = fallen - centre[:, None], inner[:, None]
    square = inner**2 / (1.0 + fraction) - fraction * away**2 / (1.0 + fraction) ** 2
    half = np.where(inner > 0.0, np.sqrt(np.where(square >= 0.0, square, np.nan)), np.nan)
    best = np.clip(middle, *box)
    swing = np.sqrt((best - centre[:, None]) ** 2 + fraction * (fallen - best) ** 2)
    return _Interval(middle - half, middle + half, radius[:, None] - swing)


def _nearest(
    positions: np.ndarray, low: np.ndarray, high: np.ndarray, normal: np.ndarray, depths: _Interval
) -> np.ndarray:
    # Return the nearest points in boxes whose depth lies in an interval: shift along the normal, then clip to the box.
    nearest = np.minimum(np.maximum(positions, low), high)
    depth = _depth(nearest, normal)
    goal = np.ravel(np.clip(depth, depths.low, depths.high))
    moved = np.flatnonzero((goal != np.ravel(depth)) & np.isfinite(goal))
    start, first, last = (x.reshape(-1, 3)[moved] for x in (positions, low, high))
    goal = goal[moved]
    # Start from a shift so large that all coordinates that it changes are clipped.
    components = np.abs(normal[np.abs(normal) > LEVEL])
    away = np.maximum(np.abs(first - start), np.abs(last - start))[:, np.abs(normal) > LEVEL]
    up = (away / components).max(1, initial=0.0)
    down = -up
    for _ in range(HALVINGS):
        shift = 0.5 * (down + up)
        is_high = _depth(np.minimum(np.maximum(start + shift[:, None] * normal, first), last), normal) > goal
        down, up = np.where(is_high, down, shift), np.where(is_high, shift, up)
    flat = nearest.reshape(-1, 3)
    flat[moved] = np.minimum(np.maximum(start + (0.5 * (down + up))[:, None] * normal, first), last)
    return flat.reshape(positions.shape)


def _slowest(space: _Space, cells: _Cells) -> tuple[np.ndarray, ...]:
    # Return times of flight, positions and speeds of the slowest releases, and the slacks to the spool plane and the
    # floor at the time at which the smaller of both is largest.
    top = np.minimum(space.box.low * space.normal, space.box.high * space.normal).sum()
    # The longest flight starts at the highest point of the box; longer ones rise above the spools.
    drop = np.maximum((_depth(cells.target, space.normal) - top) / cells.depth, 0.0)
    longest = 1.0 + np.sqrt(1.0 + 2.0 * drop)
    times = np.geomspace(SHORTEST, 1.0, GRID) * longest[:, None] / cells.frequency
    has_floor = np.isfinite(space.floor)
    if has_floor:
        # Just above the floor only level swings are possible; add the time in which an object falls from them.
        level = np.sqrt(2.0 * np.maximum(cells.target[:, 2] - cells.centre[:, 2], 0.0) / space.gravity)[:, None]
        times = np.sort(np.append(times, np.where(level > 0.0, level, times[:, :1]), axis=1), axis=1)
    samples, each = _sampled(space, cells, times), np.arange(len(drop))
    at = np.minimum(samples.below, samples.above).argmax(1)
    below, above = samples.below[each, at], samples.above[each, at]
    for _ in range(NARROWED):
        best = samples.speed.argmin(1)
        best_time, step = times[each, best][:, None], 1 + has_floor
        first, last = (times[each, np.clip(best + side, 0, times.shape[1] - 1)] for side in (-step, step))
        times = np.linspace(first, last, AROUND, axis=1)
        times = np.sort(np.append(times, best_time, axis=1), axis=1) if has_floor else times
        samples = _sampled(space, cells, times)
    best = samples.speed.argmin(1)
    return times[each, best], samples.position[each, best], samples.speed[each, best], below, above
