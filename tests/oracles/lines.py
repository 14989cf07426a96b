"""NumPy/SciPy reference for a point mass on two to four cables that moves along a straight line (boralugoda-thesis).

Axes: z UP, gravity (0, 0, -g), the four-cable robot's A1 above the origin.  Points are (x, y, z); a planar robot lies
in the x-z plane and its points are (x, z), or (x, y, z) with one y for all.  Base points are the rows of an (n, 3) or
(n, 2) array.  A line is X(t) = X0 + (X1 - X0) s(t), a motion law the triple (s, s', s'') of the time t.
Tension limits are one number or one a cable.  Numbers in brackets are the thesis's; its errors are derived away here,
nothing is taken from its print.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import OptimizeResult, linprog

Array = NDArray[np.float64]
Law = tuple[Array, Array, Array]
Bound = Callable[[Array], Array]

CAP = 1e6  # weights: a tension margin beyond it counts as unbounded
FLAT = 1e-12  # singular values below this, of the unit vectors, are zero
REST = 1e-9  # relative residual of an equation that counts as solved

# The test case of chapter 4.
BASE = np.array([[0.0, 0.0, 30.0], [45.0, 0.0, 30.0], [45.0, 30.0, 30.0], [0.0, 30.0, 30.0]])
START, END = np.array([1.0, 20.0, 7.0]), np.array([15.0, 28.0, 3.0])
GRAVITY, MAX_ACCELERATION = 9.81, 10.0


def _points(planar: bool, *points: ArrayLike) -> list[Array]:
    """The points in the axes that the robot moves in."""
    found = [np.asarray(point, dtype=np.float64) for point in points]
    if planar and any(point.shape[-1] == 3 for point in found):
        heights = np.concatenate([point[..., 1].ravel() for point in found])
        if np.ptp(heights) > 0.0:
            raise ValueError(f"a planar robot out of its plane: {heights}")
        found = [point[..., [0, 2]] for point in found]
    return found


def _pull(base_points: ArrayLike, position: ArrayLike, planar: bool) -> Array:
    """Unit vectors from the mass to the base points, as columns."""
    base, point = _points(planar, base_points, position)
    rays = base - point
    lengths = np.linalg.norm(rays, axis=1)
    if not np.all(lengths > 0.0):
        raise ValueError("the mass is in a base point")
    return (rays / lengths[:, None]).T


def _free(acceleration: ArrayLike, gravity: float, planar: bool) -> Array:
    """Acceleration less gravity: what the cables have to give a unit of mass."""
    vector = np.array(acceleration, dtype=np.float64)
    if planar and vector.shape[-1] == 3:
        if vector[1] != 0.0:
            raise ValueError(f"a planar robot leaves its plane: {vector}")
        vector = vector[[0, 2]]
    vector[-1] += gravity
    return vector


def _highs(cost: ArrayLike, **problem: object) -> OptimizeResult:
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10, "presolve": False}
    return linprog(cost, method="highs-ds", options=options, **problem)


def tension_margin(
    base_points: ArrayLike,
    position: ArrayLike,
    acceleration: ArrayLike,
    *,
    mass: float,
    gravity: float,
    tension_min: ArrayLike = 0.0,
    tension_max: ArrayLike = np.inf,
    planar: bool = False,
) -> float:
    """Largest s, N, with tension_min + s <= t <= tension_max - s and sum of t_i u_i = m (a - g), by HiGHS."""
    pull = _pull(base_points, position, planar)
    cables = pull.shape[1]
    weight = mass * gravity
    load = mass * _free(acceleration, gravity, planar) / weight
    left, values, _ = np.linalg.svd(pull, full_matrices=False)
    span = left[:, values > FLAT]
    if np.linalg.norm(load - span @ (span.T @ load)) > REST * max(np.linalg.norm(load), 1.0):
        return -np.inf
    least, most = (np.broadcast_to(limit, cables) / weight for limit in (tension_min, tension_max))
    ended = np.isfinite(most)
    one, column = np.eye(cables), np.ones((cables, 1))
    found = _highs(
        np.append(np.zeros(cables), -1.0),
        A_ub=np.vstack([np.hstack([-one, column]), np.hstack([one, column])[ended]]),
        b_ub=np.concatenate([-least, most[ended]]),
        A_eq=np.hstack([span.T @ pull, np.zeros((span.shape[1], 1))]),
        b_eq=span.T @ load,
        bounds=[(None, None)] * cables + [(None, CAP)],
    )
    assert found.status == 0, found.message
    return float(found.x[-1] * weight)


def path_limits(
    base_points: ArrayLike,
    start: ArrayLike,
    end: ArrayLike,
    s: ArrayLike,
    *,
    mass: float,
    gravity: float,
    tension_min: ArrayLike = 0.0,
    tension_max: ArrayLike = np.inf,
    planar: bool = False,
    max_acceleration: float | None = None,
) -> tuple[Array, Array]:
    """The least and the largest feasible s'' at each s of the line: X'' = (X1 - X0) s'', three linear programs each."""
    base, first, last = _points(planar, base_points, start, end)
    step = last - first
    size = float(np.linalg.norm(step))
    reach = None if max_acceleration is None or size == 0.0 else max_acceleration / (size * gravity)
    places = np.asarray(s, dtype=np.float64)
    lower, upper = np.empty(places.size), np.empty(places.size)
    limits = (np.broadcast_to(limit, len(base)) / (mass * gravity) for limit in (tension_min, tension_max))
    ranges = [(low, high if np.isfinite(high) else None) for low, high in zip(*limits, strict=True)]
    ranges.append((None if reach is None else -reach, reach))
    for place, here in enumerate(places.ravel()):
        # In weights and in s'' / g: sum of t_i u_i - (X1 - X0) s'' = (0, 0, 1).
        equation = np.column_stack([_pull(base, first + here * step, False), -step])
        problem = {"A_eq": equation, "b_eq": np.eye(len(step))[-1], "bounds": ranges}
        cost = np.eye(len(base) + 1)[-1]
        if _highs(0.0 * cost, **problem).status != 0:
            lower[place], upper[place] = np.inf, -np.inf
            continue
        least, most = _highs(cost, **problem), _highs(-cost, **problem)
        lower[place] = least.x[-1] * gravity if least.status == 0 else -np.inf
        upper[place] = most.x[-1] * gravity if most.status == 0 else np.inf
    return lower.reshape(places.shape), upper.reshape(places.shape)


def s_curve(t: ArrayLike, p: float, duration: float) -> Law:
    """The S-model: s'' is linear between its corners at 0, p/2, p, (T + p)/2, T; each piece is integrated exactly."""
    time = np.asarray(t, dtype=np.float64)
    knots = np.array([0.0, p / 2, p, (duration + p) / 2, duration])
    corners = np.array([0.0, 4 / (p * duration), 0.0, -4 / (duration * (duration - p)), 0.0])
    spans = np.diff(knots)
    jerks = np.diff(corners) / spans
    speeds = np.append(0.0, np.cumsum(spans * (corners[:-1] + corners[1:]) / 2))
    places = np.append(0.0, np.cumsum(spans * (speeds[:-1] + spans * (2 * corners[:-1] + corners[1:]) / 6)))
    piece = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, 3)
    tau = time - knots[piece]
    place, speed, corner, jerk = places[piece], speeds[piece], corners[piece], jerks[piece]
    second_derivative = corner + jerk * tau
    return (
        place + tau * (speed + tau * (corner / 2 + tau * jerk / 6)),
        speed + tau * (corner + tau * jerk / 2),
        second_derivative,
    )


def _scaled(law: Callable[[Array], Law], t: ArrayLike, duration: float) -> Law:
    place, speed, second_derivative = law(np.asarray(t, dtype=np.float64) / duration)
    return place, speed / duration, second_derivative / duration**2


def quintic(t: ArrayLike, duration: float) -> Law:
    """From rest to rest with s'' = 0 at both ends: s = 10 x^3 - 15 x^4 + 6 x^5 of x = t / T."""
    law = np.polynomial.Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
    return _scaled(lambda x: (law(x), law.deriv()(x), law.deriv(2)(x)), t, duration)


def cubic(t: ArrayLike, duration: float) -> Law:
    """From rest to rest, s'' jumps at both ends: s = 3 x^2 - 2 x^3 of x = t / T."""
    law = np.polynomial.Polynomial([0.0, 0.0, 3.0, -2.0])
    return _scaled(lambda x: (law(x), law.deriv()(x), law.deriv(2)(x)), t, duration)


def _rates(lower: Bound, upper: Bound, ratio: float, tau: Array) -> tuple[Array, Array]:
    """The least and the largest 1/T^2 that the limits allow the S-curve of p = ratio T at tau = t/T."""
    s, _, second_derivative = s_curve(tau, ratio, 1.0)
    s = np.clip(s, 0.0, 1.0)
    low, high = (np.broadcast_to(np.asarray(bound(s), dtype=np.float64), s.shape) for bound in (lower, upper))
    up, down = second_derivative > 0.0, second_derivative < 0.0
    size = np.where(up | down, np.abs(second_derivative), 1.0)
    with np.errstate(over="ignore"):
        least = np.where(up, low, np.where(down, -high, -np.inf)) / size
        most = np.where(up, high, np.where(down, -low, np.inf)) / size
    most = np.where(~up & ~down & ((low > 0.0) | (high < 0.0)), -np.inf, most)
    return least, np.where(low > high, -np.inf, most)


def _largest_rate(lower: Bound, upper: Bound, ratio: float, samples: int) -> float:
    """The largest 1/T^2 of the S-curves of one p/T: the corners are among the samples, the lowest places zoomed in on.

    Zero where there is none.
    """
    corners = np.array([0.0, ratio / 2, ratio, (1 + ratio) / 2, 1.0])
    tau = np.unique(np.concatenate([np.linspace(*pair, samples) for pair in pairwise(corners)]))
    least, most = _rates(lower, upper, ratio, tau)
    found = float(most.min())
    if not np.isfinite(found):
        return 0.0 if found < 0.0 else np.inf
    padded = np.concatenate([[np.inf], most, [np.inf]])
    lowest = np.flatnonzero((most <= padded[:-2]) & (most <= padded[2:]) & (most <= found + 0.01 * abs(found)))
    for place in lowest[np.argsort(most[lowest])][:6]:
        left, right = tau[max(place - 1, 0)], tau[min(place + 1, len(tau) - 1)]
        for _ in range(5):
            near = np.union1d(np.linspace(left, right, 41), corners[(corners > left) & (corners < right)])
            values = _rates(lower, upper, ratio, near)[1]
            at = int(values.argmin())
            found = min(found, float(values[at]))
            left, right = near[max(at - 1, 0)], near[min(at + 1, len(near) - 1)]
    return found if found > max(float(least.max()), 0.0) else 0.0


def least_duration_of_s_curve(
    lower: Bound, upper: Bound, *, ratios: int = 100, samples: int = 1001, rounds: int = 9
) -> tuple[float, float]:
    """The least T of an S-curve within lower(s) <= s'' <= upper(s), over all (p, T), by brute force.

    With p = r T the curve s(t/T) does not depend on T and s'' goes as 1/T^2: for each r the least T is sampled.  The
    best r of the grid are zoomed in on, each round ten times.  T is good to 1e-9; p to 1e-7 or so where the best is
    smooth in p.
    """

    def rates(grid: Array) -> Array:
        return np.array([_largest_rate(lower, upper, ratio, samples) for ratio in grid])

    first = np.arange(1, ratios) / ratios
    values = rates(first)
    padded = np.concatenate([[0.0], values, [0.0]])
    peaks = np.flatnonzero((values >= padded[:-2]) & (values >= padded[2:]) & (values > 0.0))
    best, ratio = 0.0, np.nan
    for peak in peaks[np.argsort(-values[peaks])][:3]:
        middle, half = first[peak], 1.0 / ratios
        for _ in range(rounds):
            grid = np.linspace(max(middle - half, 1e-6), min(middle + half, 1.0 - 1e-6), 21)
            near = rates(grid)
            middle = grid[near.argmax()]
            half /= 10.0
            if near.max() > best:
                best, ratio = float(near.max()), float(middle)
    if best == 0.0:
        return np.inf, np.nan
    return best**-0.5, ratio * best**-0.5


def least_time(lower: Bound, upper: Bound, *, cells: int = 200_000) -> float:
    """The least time of any motion from rest to rest within lower(s) <= s'' <= upper(s): s'' jumps from one to another.

    v^2/2 is at most the integral of upper from 0 and at most that of -lower up to 1; the smaller of both is a motion,
    and nowhere is another faster.  s = (1 - cos q)/2 takes the roots at both ends out of the integral of ds/v.
    Infinite where there is no motion, or where an end is not left (its limit is zero: s'' = k s from rest).  Limits may
    be infinite; limits that jump cost digits (the integrals are trapezoids and midpoints of `cells` cells).
    """
    q = np.linspace(0.0, np.pi, 2 * cells + 1)
    s = np.sin(q / 2) ** 2
    low, high = (np.broadcast_to(np.asarray(bound(s), dtype=np.float64), s.shape) for bound in (lower, upper))
    if np.any(low > high) or high[0] <= 0.0 or low[-1] >= 0.0:
        return np.inf
    # Over s for the first integral and over 1 - s for the second: each keeps its digits at its end.
    gained = cumulative_trapezoid(high, s, initial=0.0)[1::2]
    lost = cumulative_trapezoid(-low[::-1], s, initial=0.0)[::-1][1::2]
    energy = np.minimum(gained, lost)
    if np.any(energy <= 0.0):
        return np.inf
    return float(np.sum(np.sin(q[1::2]) / 2 / np.sqrt(2.0 * energy)) * np.pi / cells)


def tension_couples(
    position: ArrayLike,
    acceleration: ArrayLike,
    *,
    x_max: float,
    y_max: float,
    z_max: float,
    mass: float,
    gravity: float,
) -> Array:
    """T12, T23, T34, T41 (30)-(33) on the last axis, N: of each pair of cables along one side the resultant across it.

    The force balance in the y-z plane gives T12 and T34, that in the x-z plane T23 and T41; nothing printed is used.
    """
    (x, y, z), (ax, ay, az) = (np.moveaxis(np.asarray(vector), -1, 0) for vector in (position, acceleration))
    height, lift = z_max - z, mass * (az + gravity)

    def pair(at: Array, side: float, push: Array) -> tuple[Array, Array]:
        """The resultants from 0 and from the far side: -at n + (side - at) f = push and height (n + f) = lift."""
        far = (push + at * lift / height) / side
        return (lift / height - far) * np.hypot(at, height), far * np.hypot(side - at, height)

    t12, t34 = pair(y, y_max, mass * ay)
    t41, t23 = pair(x, x_max, mass * ax)
    return np.stack([t12, t23, t34, t41], axis=-1)


def couples_mismatch(couples: ArrayLike, position: ArrayLike, *, x_max: float, y_max: float, z_max: float) -> Array:
    """T12/L12 + T34/L34 - T23/L23 - T41/L41, N/m: each half is the lift over the depth, so that wrong ones show.

    Lengths across the sides, with h = z_max - z: L12 = hypot(y, h), L34 = hypot(y_max - y, h), L41 = hypot(x, h) and
    L23 = hypot(x_max - x, h).
    """
    t12, t23, t34, t41 = np.moveaxis(np.asarray(couples), -1, 0)
    x, y, z = np.moveaxis(np.asarray(position), -1, 0)
    height = z_max - z
    across = t12 / np.hypot(y, height) + t34 / np.hypot(y_max - y, height)
    return across - t23 / np.hypot(x_max - x, height) - t41 / np.hypot(x, height)


def case_lines(decimals: int | None = None) -> tuple[np.poly1d, np.poly1d]:
    """(25) and (24), both limits of s'' in the test case: lines in s through the limits at both ends."""
    ends = path_limits(BASE, START, END, [0.0, 1.0], mass=10.0, gravity=GRAVITY)
    lines = [np.array([at_end - at_start, at_start]) for at_start, at_end in ends]
    lower, upper = (np.poly1d(line if decimals is None else np.round(line, decimals)) for line in lines)
    return lower, upper


def table_4_3(
    p_values: ArrayLike,
    durations: ArrayLike,
    *,
    decimals: int | None = 5,
    after_p: bool = True,
    max_acceleration: float | None = None,
    samples: int = 501,
) -> tuple[Array, Array]:
    """Max_a and Max_b of 4.2.5: the most by which s'' of the S-curve passes the upper and the lower limit.

    What reproduces all 160 printed cells to the last digit: the lines (24) and (25) with coefficients rounded to FIVE
    decimals, -0.35036 s + 0.43795 and -0.43189 s - 0.03085 (three decimals are printed), and the corners t = p/2 and
    t = (T + p)/2 among the samples; Max_a then rounded to four decimals, Max_b to five.  Exact coefficients miss two
    cells of Max_a and 43 of Max_b, by one in the last digit.
    What the printed cells do not tell, as both ways give the same there: whether the limit of 10 m/s^2 is in (0.602 on
    s'', beyond both lines everywhere: it changes nothing); whether Max_a is over all t or t <= p (one over the whole
    table, p from 1.8 to 2.75, T from 2.9 to 4.4); whether Max_b is over all t or t >= p.  The last two differ in 15
    cells of T >= 4.25: over all t Max_b is never below -0.03085, its value at t = 0.
    """
    lower, upper = case_lines(decimals)
    most = np.inf if max_acceleration is None else max_acceleration / float(np.linalg.norm(END - START))
    p_values, durations = np.atleast_1d(p_values), np.atleast_1d(durations)
    above, below = np.empty((2, len(durations), len(p_values)))
    for row, duration in enumerate(durations):
        for column, p in enumerate(p_values):
            corners = [0.0, p / 2, p, (duration + p) / 2, duration]
            t = np.concatenate([np.linspace(*pair, samples) for pair in pairwise(corners)])
            s, _, second_derivative = s_curve(t, p, duration)
            above[row, column] = np.max(second_derivative - np.minimum(upper(s), most))
            under = np.maximum(lower(s), -most) - second_derivative
            below[row, column] = np.max(under[t >= p] if after_p else under)
    return above, below
