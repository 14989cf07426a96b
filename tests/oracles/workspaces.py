"""NumPy/SciPy reference for workspaces of robots with any number of cables; nothing of the package is used.

z up, SI units.  W t = w: column i of W (d, n) is what one newton in cable i does to the platform, w what all cables
together have to do, m (a - g) and the moment.  Tension margins are solved as linear programs, closure by two more ways,
and everything a second time from the facet normals, vectors of minimal support in the row space of W.  Points: (3,) m.
A definition over orientations takes margin(position, rotation) of one pose, which belongs where it is not negative.
"""

from itertools import combinations, product

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, linprog, nnls
from scipy.spatial import ConvexHull

Array = np.ndarray

PATTERNS = ("1T", "2T", "3T", "1R2T", "2R3T", "3R3T", "3R")
_ROWS = {"1T": [2], "2T": [0, 2], "3T": [0, 1, 2], "1R2T": [0, 2, 4], "3R3T": [*range(6)], "3R": [3, 4, 5]}
RANK = 1e-9  # singular values below this, of the largest, are zero
NOTHING = 1e-14  # and those below this: lines through a joint leave rounding only
ZERO = 1e-10  # entries of facet normals below this, of the largest, are zero
OUTSIDE = 1e-9  # of a wrench: what may lie outside of the span


def rows(pattern: str, platform_points: ArrayLike, rotation: ArrayLike) -> Array:
    """(d, 6) orthonormal rows that a pattern keeps of a force (N) and a moment (N m), in fixed axes.

    2R3T: the moments about two platform axes normal to the line through the attachment points (n, 3).
    """
    if pattern != "2R3T":
        return np.eye(6)[_ROWS[pattern]]
    points = np.asarray(platform_points, float)
    normals = np.linalg.svd(points - points.mean(0))[2][1:] @ np.asarray(rotation, float).T
    return np.block([[np.eye(3), np.zeros((3, 3))], [np.zeros((2, 3)), normals]])


def tangent_point(entry: Array, axis: Array, radius: float, end: Array) -> tuple[Array, float]:
    """Where the cable to `end` leaves a swivelling pulley, (3,) m, and the length from the entry point to `end`, m.

    The cable passes `entry` in the direction `axis`, about which the pulley swivels, and turns towards `end`.
    """
    axis = axis / np.linalg.norm(axis)
    out = (end - entry) - (end - entry) @ axis * axis
    out = out / np.linalg.norm(out)
    centre = entry + radius * out
    across, along = (end - centre) @ out, (end - centre) @ axis
    if np.hypot(across, along) <= radius:
        raise ValueError("the end of the cable is inside the pulley")

    def gap(angle: float) -> float:
        return along * np.sin(angle) - across * np.cos(angle) - radius

    top = np.arctan2(along, -across)  # nearest to the end
    angle = brentq(gap, top - np.pi / 2.0, top, xtol=1e-15) % (2.0 * np.pi)
    point = centre + radius * (np.sin(angle) * axis - np.cos(angle) * out)
    return point, radius * angle + float(np.linalg.norm(end - point))


def full_wrench_matrix(base_points, platform_points, position, rotation, pulley_radii=None, pulley_axes=None) -> Array:
    """(6, n): forces (1) over moments (m) about the origin of the platform points, of unit tensions, fixed axes."""
    arms = np.asarray(platform_points, float) @ np.asarray(rotation, float).T
    ends = np.asarray(position, float) + arms
    exits = np.array(base_points, float)
    if pulley_radii is not None:
        given = zip(exits, np.asarray(pulley_axes, float), pulley_radii, ends, strict=True)
        exits = np.array([tangent_point(*pulley)[0] for pulley in given])
    units = (exits - ends) / np.linalg.norm(exits - ends, axis=1, keepdims=True)
    return np.vstack([units.T, np.cross(arms, units).T])


def wrench_matrix(base_points, platform_points, position, rotation, pattern, **pulleys: ArrayLike) -> Array:
    """W (d, n) of base points (n, 3) m and platform points (n, 3) m, platform axes.

    Platform points, and `position` (3,) m, from the mass centre; with 3R from the joint.  Pulleys: pulley_radii (n,) m
    and pulley_axes (n, 3), in which the cables enter; base points are then the entry points.
    """
    full = full_wrench_matrix(base_points, platform_points, position, rotation, **pulleys)
    return rows(pattern, platform_points, rotation) @ full


def weight(kept: Array, mass: float, arm: ArrayLike = (0.0, 0.0, 0.0), acceleration=(0.0, 0.0, -9.81)) -> Array:
    """(d,) wrench that holds a mass (kg) in gravity, of which the cables see the rows (d, 6) that are kept.

    arm: (3,) m, fixed axes, from the point that moments are about to the mass centre: not zero with 3R.
    """
    force = -mass * np.asarray(acceleration, float)
    return kept @ np.concatenate([force, np.cross(arm, force)])


def _row_space(matrix: Array) -> tuple[Array, Array, Array]:
    # U (d, rank), singular values (rank,), V' (rank, n)
    u, sizes, v = np.linalg.svd(matrix, full_matrices=False)
    rank = int((sizes > max(RANK * sizes[0], NOTHING)).sum())
    return u[:, :rank], sizes[:rank], v[:rank]


def _bounds(matrix: Array, low: ArrayLike, high: ArrayLike) -> tuple[Array, Array]:
    shape = (matrix.shape[1],)
    return np.broadcast_to(np.asarray(low, float), shape), np.broadcast_to(np.asarray(high, float), shape)


def in_span(matrix: Array, wrenches: ArrayLike) -> bool:
    """Whether all wrenches (k, d) are in the span of the columns of (d, n), whatever the signs of the tensions."""
    u = _row_space(matrix)[0]
    wrenches = np.atleast_2d(np.asarray(wrenches, float))
    outside = np.linalg.norm(wrenches - wrenches @ u @ u.T, axis=1)
    return bool(np.all(outside <= OUTSIDE * np.linalg.norm(wrenches, axis=1)))


def farthest_tensions(matrix: Array, wrench: ArrayLike, low: ArrayLike, high: ArrayLike) -> tuple[float, Array | None]:
    """Largest s (N) with low + s <= t <= high - s and W t = w, and such a t (n,), by HiGHS.

    Infinite high bounds do not count; s is inf (t None) where nothing bounds it, -inf where w is not in the span.
    """
    if not in_span(matrix, wrench):
        return -np.inf, None
    low, high = _bounds(matrix, low, high)
    n = matrix.shape[1]
    u, sizes, v = _row_space(matrix)
    aim = u.T @ np.asarray(wrench, float) / sizes
    scale = (
        max(np.abs(aim).max(initial=0.0), np.abs(low).max(), np.abs(high[np.isfinite(high)]).max(initial=0.0)) or 1.0
    )
    ended = np.isfinite(high)
    upper = np.vstack([np.c_[-np.eye(n), np.ones(n)], np.c_[np.eye(n), np.ones(n)][ended]])
    found = linprog(
        np.r_[np.zeros(n), -1.0],
        A_ub=upper,
        b_ub=np.r_[-low, high[ended]] / scale,
        A_eq=np.c_[v, np.zeros(len(v))],
        b_eq=aim / scale,
        bounds=(None, None),
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    if found.status == 0:
        return float(found.x[-1] * scale), found.x[:n] * scale
    if ended.any() or found.status not in (2, 3, 4):  # with a finite bound there always is an optimum
        raise ArithmeticError(found.message)
    return np.inf, None


def tension_margin(matrix: Array, wrenches: ArrayLike, low: ArrayLike, high: ArrayLike) -> float:
    """Smallest margin (N) over wrenches (k, d) or (d,); bounds: numbers or (n,)."""
    return min(farthest_tensions(matrix, w, low, high)[0] for w in np.atleast_2d(np.asarray(wrenches, float)))


def corners(centre: ArrayLike, half: ArrayLike) -> Array:
    """(2^k, d) corners of the box centre +- half, (d,) each; k of half are not zero."""
    centre, half = np.asarray(centre, float), np.asarray(half, float)
    return centre + np.array(list(product(*[(-h, h) if h else (0.0,) for h in half])))


def box_margin(matrix: Array, centre: ArrayLike, half: ArrayLike, low: ArrayLike, high: ArrayLike) -> float:
    """Margin (N) of a box of wrenches: of its corners, for the margin is concave in the wrench."""
    return tension_margin(matrix, corners(centre, half), low, high)


def facet_normals(matrix: Array) -> tuple[Array, Array]:
    """Normals c (k, d), in the span of W, and y = c W (k, n) of all vectors of minimal support, with both signs.

    c is normal to rank - 1 independent columns, for all choices of these; the null vectors come from SVD.  |y| is 1.
    """
    u, sizes, v = _row_space(matrix)
    rank, n = v.shape
    if rank <= 1:
        normals = np.ones((rank, rank))
    else:
        subsets = np.array([v[:, list(subset)].T for subset in combinations(range(n), rank - 1)])
        _, values, right = np.linalg.svd(subsets)
        normals = right[values[:, -1] > RANK, -1]
    y = normals @ v
    y[np.abs(y) < ZERO * np.abs(y).max(1, keepdims=True)] = 0.0
    return (u @ (np.vstack([normals, -normals]) / sizes).T).T, np.vstack([y, -y])


def _slacks(matrix: Array, wrenches: Array, shape: Array, low: ArrayLike, high: ArrayLike) -> tuple[Array, Array]:
    # Per facet normal the distance from its plane times |c|, inf where void, at the worst wrench; and the normals.
    low, high = _bounds(matrix, low, high)
    c, y = facet_normals(matrix)
    with np.errstate(invalid="ignore"):
        reach = np.where(y > 0.0, y * high, y * low).sum(1)
    return reach - (wrenches @ c.T).max(0) - np.linalg.norm(c @ shape, axis=1), np.c_[c, y]


def margin_by_facets(matrix: Array, wrenches: ArrayLike, low, high, shape: ArrayLike | None = None) -> float:
    """Margin (N) by duality, exact also for w + shape e, |e| <= 1: wrenches (k, d) or (d,), shape (d, k).

    No margin is larger than half of a cable's range; beside that the facet normals decide.
    """
    wrenches = np.atleast_2d(np.asarray(wrenches, float))
    shape = np.zeros((len(matrix), 1)) if shape is None else np.asarray(shape, float)
    if not (in_span(matrix, wrenches) and in_span(matrix, shape.T)):
        return -np.inf
    slack, found = _slacks(matrix, wrenches, shape, low, high)
    low, high = _bounds(matrix, low, high)
    return float(min((slack / np.abs(found[:, len(matrix) :]).sum(1)).min(initial=np.inf), (high - low).min() / 2.0))


def ellipsoid_margin(matrix: Array, centre: ArrayLike, shape: ArrayLike, low: ArrayLike, high: ArrayLike) -> float:
    """Exact margin (N) of the wrenches centre + shape e, |e| <= 1; shape (d, k), diagonal for semi-axes."""
    return margin_by_facets(matrix, centre, low, high, shape)


def ellipsoid_bound(matrix, centre, shape, low, high, samples: int, rng: np.random.Generator) -> float:
    """An upper bound of `ellipsoid_margin` by linear programs at random wrenches of the boundary."""
    e = rng.normal(size=(samples, np.shape(shape)[1]))
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    return tension_margin(matrix, np.asarray(centre, float) + e @ np.asarray(shape, float).T, low, high)


def acceleration_margin(matrix, kept: Array, mass: float, radius: float, low, high, arm=(0.0, 0.0, 0.0)) -> float:
    """Margin (N) over all accelerations of the mass centre up to `radius` (m/s^2), at rest otherwise."""
    lever = np.cross(np.asarray(arm, float), np.eye(3)).T  # (3, 3): moment of a force
    ball = mass * radius * kept @ np.vstack([np.eye(3), lever])
    return ellipsoid_margin(matrix, weight(kept, mass, arm), ball, low, high)


def rank_of(matrix: Array) -> int:
    return len(_row_space(matrix)[1])


def closure_margin(matrix: Array) -> float:
    """Largest s <= 1 with W t = 0 and s <= t <= 1, by HiGHS: positive with closure, -inf where the rank is below d."""
    d, n = matrix.shape
    if rank_of(matrix) < d:
        return -np.inf
    upper, equal = np.c_[-np.eye(n), np.ones(n)], np.c_[_row_space(matrix)[2], np.zeros(d)]
    found = linprog(np.r_[np.zeros(n), -1.0], upper, np.zeros(n), equal, np.zeros(d), bounds=(0.0, 1.0))
    return float(found.x[-1])


def is_closed(matrix: Array, tolerance: float = 1e-9) -> bool:
    """Full rank by SVD, and null vectors N with N z > 0: none of y >= 0, sum y = 1, is normal to N (NNLS)."""
    d, n = matrix.shape
    null = np.linalg.svd(matrix)[2][d:]
    if rank_of(matrix) < d:
        return False
    return bool(nnls(np.vstack([null, np.ones(n)]), np.r_[np.zeros(len(null)), 1.0])[1] > tolerance)


def closed_by_facet_normals(matrix: Array) -> bool:
    """Full rank, and every facet normal has entries of both signs."""
    y = facet_normals(matrix)[1]
    return bool(rank_of(matrix) == len(matrix) and np.all((y > 0.0).any(1)))


def is_static(matrix: Array, wrench: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Whether tensions >= 0 hold a wrench (d,), by NNLS."""
    wrench = np.asarray(wrench, float)
    return bool(nnls(matrix, wrench)[1] <= tolerance * np.linalg.norm(wrench))


def capacity_by_hull(matrix: Array, wrenches: ArrayLike, low: ArrayLike, high: ArrayLike) -> float:
    """`capacity_margin` from the convex hull of the 2^n images of the corners of tensions; d <= 3, full rank."""
    low, high = _bounds(matrix, low, high)
    wrenches = np.atleast_2d(np.asarray(wrenches, float))
    images = np.array(list(product(*zip(low, high, strict=True)))) @ matrix.T
    if len(matrix) == 1:
        return float(min((wrenches - images.min()).min(), (images.max() - wrenches).min()))
    planes = ConvexHull(images).equations
    return float(-(wrenches @ planes[:, :-1].T + planes[:, -1]).max())


def capacity_by_planes(matrix: Array, wrenches: ArrayLike, low: ArrayLike, high: ArrayLike) -> float:
    """`capacity_margin` from all planes through d - 1 columns; any d, also with infinite high."""
    wrenches = np.atleast_2d(np.asarray(wrenches, float))
    slack, found = _slacks(matrix, wrenches, np.zeros((len(matrix), 1)), low, high)
    within = float((slack / np.linalg.norm(found[:, : len(matrix)], axis=1)).min(initial=np.inf))
    u = _row_space(matrix)[0]
    flat = -np.linalg.norm(wrenches - wrenches @ u @ u.T, axis=1).max() if u.shape[1] < len(matrix) else np.inf
    return float(min(within, flat))


def capacity_margin(matrix: Array, wrenches: ArrayLike, low: ArrayLike, high: ArrayLike) -> float:
    """Smallest signed distance of wrenches (k, d) from the facets of the available wrenches, in the units of W t.

    Outside it is minus the distance from the farthest violated plane, not from the set.  At most 0 below full rank.
    """
    hull = np.isfinite(high).all() and rank_of(matrix) == len(matrix) <= 3
    return (capacity_by_hull if hull else capacity_by_planes)(matrix, wrenches, low, high)


def point_distance(point: Array, start: Array, end: Array) -> float:
    """Of a point and a segment, by its ends and the foot of the normal."""
    step = end - start
    feet = [0.0, 1.0] + ([float(np.clip((point - start) @ step / (step @ step), 0.0, 1.0))] if step @ step else [])
    return min(float(np.linalg.norm(point - start - f * step)) for f in feet)


def segment_distance(start: Array, end: Array, other_start: Array, other_end: Array) -> float:
    """Of two segments: each end and the other segment, and the points nearest on the lines where inside of both."""
    one, two = end - start, other_end - other_start
    found = [point_distance(p, other_start, other_end) for p in (start, end)]
    found += [point_distance(p, start, end) for p in (other_start, other_end)]
    at = np.clip(np.linalg.lstsq(np.c_[one, -two], other_start - start, rcond=None)[0], 0.0, 1.0)
    return min(*found, float(np.linalg.norm(start + at[0] * one - other_start - at[1] * two)))
