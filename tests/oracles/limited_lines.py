"""NumPy/SciPy reference for straight lines under limits on cables: tensions, accelerations, speeds, lengths, a floor.

Axes, base points, planar robots and motion laws as in `lines`; the spools lie anywhere, their number is any.  A motion
is (name, T, r): "s-curve" with p = r T, "quintic" or "cubic" (r is not looked at).  Acceleration ranges are of s'',
where X'' = (X1 - X0) s''.  Limits are those of `Limits`, by keyword.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, pairwise, product

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid

from .lines import REST, Array, Law, _points, cubic, path_limits, quintic, s_curve, tension_margin

Motion = tuple[str, float, float]
Run = Motion | Law
Table = tuple[Array, Array, Array]

UNBOUNDED = 1e6  # |X''| over gravity: a range of s'' ends there at the latest
FLAT = 1e-9  # singular values below this, of the unit vectors, are zero
ZERO = 1e-11  # cosines below this are zero
SLACK = 1e-12  # weights: what rounding may take off a face


@dataclass(frozen=True)
class Limits:
    """Each is off at its default; tension and cable limits are one number or one a cable.  SI; floor: the lowest z."""

    planar: bool = False
    gravity: float = 9.81
    tension_min: ArrayLike = 0.0
    tension_max: ArrayLike = np.inf
    max_acceleration: float = np.inf
    cable_speed_max: ArrayLike = np.inf
    cable_acceleration_max: ArrayLike = np.inf
    cable_length_min: ArrayLike = 0.0
    cable_length_max: ArrayLike = np.inf
    floor: float = -np.inf


@dataclass(frozen=True)
class Line:
    """A line and the spools, in the axes that the robot moves in, and limits."""

    base: Array
    start: Array
    step: Array
    given: Limits

    @classmethod
    def of(cls, base: ArrayLike, start: ArrayLike, end: ArrayLike, **limits: object) -> "Line":
        given = Limits(**limits)
        spools, first, last = _points(given.planar, base, start, end)
        if np.array_equal(first, last):
            raise ValueError("a line without length")
        return cls(spools, first, last - first, given)

    @property
    def size(self) -> float:
        return float(np.linalg.norm(self.step))

    @property
    def unit(self) -> float:
        """One gravity, of s''."""
        return self.given.gravity / self.size

    def cables(self, s: Array) -> tuple[Array, Array, Array]:
        """l, dl/ds and d2l/ds2, the cables on the last axis."""
        rays = self.start + s[..., None, None] * self.step - self.base
        lengths = np.linalg.norm(rays, axis=-1)
        if not np.all(lengths > 0.0):
            raise ValueError("the mass is in a base point")
        slopes = rays @ self.step / lengths
        return lengths, slopes, (self.step @ self.step - slopes**2) / lengths


def corners_of(motion: Motion) -> Array:
    """The times between which the motion is smooth."""
    name, duration, ratio = motion
    fractions = [0.0, ratio / 2, ratio, (1 + ratio) / 2, 1.0] if name == "s-curve" else [0.0, 0.5, 1.0]
    return duration * np.array(fractions)


def law_of(motion: Motion, t: ArrayLike) -> Law:
    """s, s', s'' at the times t."""
    name, duration, ratio = motion
    if name == "s-curve":
        return s_curve(t, ratio * duration, duration)
    return {"quintic": quintic, "cubic": cubic}[name](np.asarray(t, dtype=np.float64), duration)


def cable_rates(
    base: ArrayLike, start: ArrayLike, end: ArrayLike, law: Law, *, planar: bool = False
) -> tuple[Array, Array, Array]:
    """l, l' and l'' of every cable (last axis): l' = e.X', l'' = e.X'' + (X'.X' - l'^2)/l, e from the spool to X."""
    s, speed, second_derivative = (np.asarray(part, dtype=np.float64) for part in law)
    lengths, slopes, curves = Line.of(base, start, end, planar=planar).cables(s)
    return lengths, slopes * speed[..., None], slopes * second_derivative[..., None] + curves * speed[..., None] ** 2


def _share(limit: ArrayLike, used: Array) -> float:
    """The smallest (limit - used) / limit; infinite without a limit."""
    limits = np.broadcast_to(np.asarray(limit, dtype=np.float64), used.shape)
    ended = np.isfinite(limits)
    return float(np.min((limits[ended] - used[ended]) / limits[ended], initial=np.inf))


def margins(
    base: ArrayLike, mass: float, start: ArrayLike, end: ArrayLike, law: Run, *, samples: int = 2001, **limits: object
) -> dict[str, float]:
    """The smallest slacks along a motion: its corners and `samples` times, or all samples of a law given as arrays."""
    line = Line.of(base, start, end, **limits)
    given = line.given
    if isinstance(law[0], str):
        law = law_of(law, np.union1d(np.linspace(0.0, law[1], samples), corners_of(law)))
    s, _, second_derivative = law
    lengths, speeds, bends = cable_rates(base, start, end, law, planar=given.planar)
    options = {name: getattr(given, name) for name in ("gravity", "tension_min", "tension_max")}
    pushes = zip(line.start + s[:, None] * line.step, second_derivative[:, None] * line.step, strict=True)
    return {
        "tension": min(tension_margin(line.base, *push, mass=mass, **options) for push in pushes),
        "acceleration": _share(given.max_acceleration, line.size * np.abs(second_derivative)),
        "cable_speed": _share(given.cable_speed_max, np.abs(speeds)),
        "cable_acceleration": _share(given.cable_acceleration_max, np.abs(bends)),
        "cable_length_min": float(np.min(lengths - given.cable_length_min)),
        "cable_length_max": float(np.min(given.cable_length_max - lengths)),
        "floor": float(np.min(line.start[-1] + s * line.step[-1] - given.floor)),
    }


def acceleration_range(
    base: ArrayLike, mass: float, start: ArrayLike, end: ArrayLike, s: ArrayLike, **limits: object
) -> tuple[Array, Array]:
    """The lowest and the highest s'' at places s by HiGHS (`lines.path_limits`): NaN if none, infinite if unlimited."""
    given = Limits(**limits)
    options = {name: getattr(given, name) for name in ("planar", "gravity", "tension_min", "tension_max")}
    options["max_acceleration"] = given.max_acceleration
    low, high = path_limits(base, start, end, s, mass=mass, **options)
    none = np.isposinf(low) & np.isneginf(high)
    return np.where(none, np.nan, low), np.where(none, np.nan, high)


def _normals(units: Array, rank: int) -> Array:
    """Normals (place, face, axis) of the faces of the sums of weighted vectors (place, axis, cable) of one rank."""
    left = np.linalg.svd(units)[0]
    span, off = left[:, :, :rank], np.swapaxes(left[:, :, rank:], 1, 2)
    inside = np.swapaxes(span, 1, 2) @ units
    # A face holds rank - 1 independent ones of the vectors; off their span both normals bound a flat set.
    if rank == 3:
        one, other = np.array(list(combinations(range(units.shape[2]), 2))).T
        normals = np.cross(inside[:, :, one], inside[:, :, other], axis=1)
    elif rank == 2:
        normals = np.stack([-inside[:, 1], inside[:, 0]], axis=1)
    else:
        normals = np.ones_like(inside[:, :, :1])
    found = np.concatenate([np.swapaxes(span @ normals, 1, 2), off], axis=1)
    sizes = np.linalg.norm(found, axis=-1, keepdims=True)
    found = np.where(sizes > FLAT, found / np.maximum(sizes, FLAT), 0.0)
    return np.concatenate([found, -found], axis=1)


def range_by_faces(
    base: ArrayLike, mass: float, start: ArrayLike, end: ArrayLike, s: ArrayLike, **limits: object
) -> tuple[Array, Array]:
    """`acceleration_range` in closed form, for a row of places; an end beyond UNBOUNDED is there.

    The resultants F of tensions in a box are a zonotope (a cone without maxima).  Each face, of normal w, bounds them:
    w.F <= the sum of the larger of w.u_k t_min and w.u_k t_max.  With F = m (X'' - g) that is an inequality in s''.
    Where none is feasible the lowest is above the highest (not NaN, so as to interpolate).
    """
    line = Line.of(base, start, end, **limits)
    given, places = line.given, np.atleast_1d(np.asarray(s, dtype=np.float64))
    least, most = (np.asarray(limit) / (mass * given.gravity) for limit in (given.tension_min, given.tension_max))
    rays = line.base - (line.start + places[:, None] * line.step)[:, None]
    units = np.swapaxes(rays / line.cables(places)[0][..., None], 1, 2)
    ranks = np.sum(np.linalg.svd(units, compute_uv=False) > FLAT, axis=1)
    ends = np.outer([-1.0, 1.0], np.full(len(places), given.max_acceleration / given.gravity))
    for rank, part in product(np.unique(ranks), range(0, len(places), 4000)):  # memory
        here = part + np.flatnonzero(ranks[part : part + 4000] == rank)
        normals = _normals(units[here], int(rank))
        cosines = normals @ units[here]
        cosines[np.abs(cosines) < ZERO] = 0.0
        far = np.where(cosines > 0.0, most, least)
        far[cosines == 0.0] = 0.0
        room = np.sum(cosines * far, axis=-1) - normals[..., -1] + SLACK
        rise = normals @ (line.step / line.size)
        rise[np.abs(rise) < ZERO] = 0.0
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            bound = room / rise
        ends[1, here] = np.minimum(ends[1, here], np.min(np.where(rise > 0.0, bound, np.inf), axis=1))
        ends[0, here] = np.maximum(ends[0, here], np.max(np.where(rise < 0.0, bound, -np.inf), axis=1))
        ends[:, here[np.any((rise == 0.0) & (room < -1e3 * SLACK), axis=1)]] = [[UNBOUNDED], [-UNBOUNDED]]
    low, high = np.clip(ends, -UNBOUNDED, UNBOUNDED) * line.unit
    return low, high


def range_table(
    base: ArrayLike, mass: float, start: ArrayLike, end: ArrayLike, *, places: int = 2001, **limits: object
) -> Table:
    """s, lowest, highest: cells are halved until a straight line between their ends is right in their middle.

    Right: to 1e-9 gravities and 1e-7 of the value itself; cells of 1e-12 are left.
    """
    unit = Line.of(base, start, end, **limits).unit

    def ranges(s: Array) -> Array:
        return np.stack(range_by_faces(base, mass, start, end, s, **limits), axis=-1)

    s = np.linspace(0.0, 1.0, places)
    values = ranges(s)
    cells = np.arange(places - 1)
    while len(cells):
        middle = (s[cells] + s[cells + 1]) / 2
        exact = ranges(middle)
        wrong = np.abs(exact - (values[cells] + values[cells + 1]) / 2)
        bad = np.any(wrong > 1e-9 * (unit + 100.0 * np.abs(exact)), axis=1) & (s[cells + 1] - s[cells] > 1e-12)
        s, values = np.insert(s, cells + 1, middle), np.insert(values, cells + 1, exact, axis=0)
        moved = (cells + np.arange(len(cells)))[bad]
        cells = np.sort(np.concatenate([moved, moved + 1]))
    return s, values[:, 0], values[:, 1]


def _rest_at_ends(table: Table) -> bool:
    return bool(np.all(table[1][[0, -1]] <= 0.0) and np.all(table[2][[0, -1]] >= 0.0))


def _rates(line: Line, table: Table, motion: Motion, x: Array) -> tuple[Array, Array]:
    """The least and the largest q = 1/T^2 that the limits allow at the fractions x of a motion of T = 1."""
    s, speed, second_derivative = law_of(motion, x)
    s, given = np.clip(s, 0.0, 1.0), line.given
    low, high = np.interp(s, table[0], table[1]), np.interp(s, table[0], table[2])
    up, down = second_derivative > 0.0, second_derivative < 0.0
    size = np.where(up | down, np.abs(second_derivative), 1.0)
    shut = ~up & ~down & ((low > 0.0) | (high < 0.0))
    with np.errstate(over="ignore", divide="ignore"):
        least = np.where(up, low, np.where(down, -high, -np.inf)) / size
        most = np.where(shut, -np.inf, np.where(up, high, np.where(down, -low, np.inf)) / size)
        if np.any(np.isfinite([*np.ravel(given.cable_speed_max), *np.ravel(given.cable_acceleration_max)])):
            _, slopes, curves = line.cables(s)
            by_speed = (given.cable_speed_max / np.abs(slopes * speed[:, None])) ** 2
            by_bend = given.cable_acceleration_max / np.abs(
                slopes * second_derivative[:, None] + curves * speed[:, None] ** 2
            )
            most = np.minimum(most, np.minimum(by_speed, by_bend).min(axis=1))
    return least, most


def _lowest(values: Array, count: int) -> Array:
    """Where the lowest local minima are."""
    padded = np.concatenate([[np.inf], values, [np.inf]])
    found = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]) & np.isfinite(values))
    return found[np.argsort(values[found])][:count]


def _score(rates: Callable[[Array], tuple[Array, Array]], corners: Array) -> float:
    """The largest q that all samples allow; minus the gap where none is.  Extremes between samples are zoomed in on."""
    x = np.unique(np.concatenate([np.linspace(*pair, 501) for pair in pairwise(corners)]))
    bound = []
    for side, sign in ((0, -1.0), (1, 1.0)):
        values = sign * rates(x)[side]
        extreme, found = values.min(), _lowest(values, 8)
        left, right, row = x[np.maximum(found - 1, 0)], x[np.minimum(found + 1, len(x) - 1)], np.arange(len(found))
        for _ in range(5 if len(found) else 0):
            near = np.linspace(left, right, 21)
            zoomed = sign * rates(near.ravel())[side].reshape(near.shape)
            best, extreme = zoomed.argmin(axis=0), min(extreme, zoomed.min())
            left, right = near[np.maximum(best - 1, 0), row], near[np.minimum(best + 1, 20), row]
        bound.append(sign * float(extreme))
    least, most = max(bound[0], 0.0), bound[1]
    return most if 0.0 < most >= least * (1 - 1e-10) else max(most - least, -1e300)


def least_duration(
    base: ArrayLike,
    mass: float,
    start: ArrayLike,
    end: ArrayLike,
    law: str = "s-curve",
    *,
    ratios: tuple[float, float] = (1e-4, 1 - 1e-4),
    table: Table | None = None,
    **limits: object,
) -> tuple[float, float]:
    """The least T, and its r, by brute force: s(t/T) does not depend on T, so that every limit is linear in q = 1/T^2.

    A grid over r, its three best peaks zoomed in on.  The q of one r are an interval, which need not reach down to 0.
    `ratios` is the range of r (two equal ends: one r), `table` the `range_table` of the same arguments.
    """
    line = Line.of(base, start, end, **limits)
    given, lowest = line.given, line.start[-1] + min(line.step[-1], 0.0)
    table = range_table(base, mass, start, end, **limits) if table is None else table
    nearest = np.clip((line.base - line.start) @ line.step / line.size**2, 0.0, 1.0)
    lengths = line.cables(np.append(nearest, [0.0, 1.0]))[0]
    away = np.any(lengths < given.cable_length_min - REST) or np.any(lengths > given.cable_length_max + REST)
    if away or lowest < given.floor - REST or not _rest_at_ends(table):
        return np.nan, np.nan

    def score(ratio: float) -> float:
        motion = (law, 1.0, ratio)
        return _score(lambda x: _rates(line, table, motion, x), corners_of(motion))

    if law != "s-curve" or ratios[0] == ratios[1]:
        best, ratio = score(ratios[0]), (ratios[0] if law == "s-curve" else np.nan)
    else:
        # s = r where s'' = 0: rest has to be feasible there.  The ends of such stretches are in the first grid.
        still = (table[1] <= 0.0) & (table[2] >= 0.0)
        bounds = table[0][np.flatnonzero(still & ~(np.append(still[1:], False) & np.append(False, still[:-1])))]
        first = np.unique(np.clip(np.concatenate([np.linspace(*ratios, 200), bounds]), *ratios))
        values = np.array([score(each) for each in first])
        best, ratio = values.max(), first[values.argmax()]
        for middle in first[_lowest(-values, 3)]:
            for half in 0.25 ** np.arange(10) * (ratios[1] - ratios[0]) / 199:
                near = np.clip(np.linspace(middle - half, middle + half, 13), *ratios)
                values = np.array([score(each) for each in near])
                middle = near[values.argmax()]
                best, ratio = max((best, ratio), (values.max(), middle))
    if best <= 0.0:
        return np.nan, np.nan
    bends = law_of((law, 1.0, ratio), np.append(corners_of((law, 1.0, ratio)), 0.2))[2]
    unlimited = np.abs(bends).max() * best > 0.9 * UNBOUNDED * line.unit
    return (0.0, np.nan) if unlimited else (float(best**-0.5), float(ratio))


def least_time_bound(
    base: ArrayLike, mass: float, start: ArrayLike, end: ArrayLike, *, table: Table | None = None, **limits: object
) -> float:
    """The least time of any motion from rest to rest within the tensions, max_acceleration and cable_speed_max.

    In the phase plane y = s'^2/2 has the slope s''.  From each place where y has a cap (zero at both ends) it rises by
    highest at most, and comes down to it by -lowest at most: the smallest of all these bounds is a motion, and nowhere
    is another faster.  s = (1 - cos q)/2 takes the roots at both ends out of the integral of ds/s'.

    NaN where there is none, or no rest at an end; infinite where an end is not left.  Other limits are not looked at.
    """
    line, cells = Line.of(base, start, end, **limits), 200_000
    table = range_table(base, mass, start, end, **limits) if table is None else table
    q = np.linspace(0.0, np.pi, 2 * cells + 1)
    s = np.sin(q / 2) ** 2
    low, high = np.interp(s, table[0], table[1]), np.interp(s, table[0], table[2])
    if np.any(low > high) or not _rest_at_ends(table):
        return np.nan
    with np.errstate(divide="ignore"):
        cap = np.min((line.given.cable_speed_max / np.abs(line.cables(s)[1])) ** 2 / 2, axis=-1)
    cap[[0, -1]] = 0.0
    gained, lost = (cumulative_trapezoid(part, s, initial=0.0) for part in (high, low))
    forward = gained + np.minimum.accumulate(cap - gained)
    backward = lost + np.minimum.accumulate((cap - lost)[::-1])[::-1]
    energy = np.minimum(forward, backward)
    if np.min(energy) < -1e-9 * np.max(energy):
        return np.nan
    if np.min(energy[1::2]) <= 0.0:
        return np.inf
    return float(np.sum(np.sin(q[1::2]) / 2 / np.sqrt(2.0 * energy[1::2])) * np.pi / cells)
