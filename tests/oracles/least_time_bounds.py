"""NumPy reference that verifies motions along paths, and bounds the least time of a path from both sides.

From above: a motion whose limits hold at the nodes and between, from the grid's problem with rows that are tightened
where points between the nodes break them. From below: what any motion must meet on the whole of a cell. There, with
x' = 2 u, A and B linear but for curvature, means over the cell marked by bars, and the chord's x_m = (x_0 + x_1) / 2,

    A u + B x <= C    gives    A_m u_bar + B_m x_m + (B_m - A' / 2) (x_bar - x_m) <= C_bar + curvature,

by parts. With u_- <= u <= u_+ the mean of x is off its chord by r(u_bar) = D (u_+ - u_bar) (u_bar - u_-) / (u_+ - u_-)
at most, which is concave: its tangents give rows of u_bar and x_0. What is no proof: u_-, u_+ and the curvatures are
those of the ends and the middle of a cell, with a factor `SAFETY`. The error is of the order of D.
"""

import dataclasses
import math

import numpy as np

from . import any_motion, least_time, path_rows, sampled_motion

SAFETY = 2.0
INNER = tuple(np.linspace(0.0, 1.0, 11))
FEW_SIDES = 16


@dataclasses.dataclass(frozen=True)
class Timed:
    """Motion along a path with x at nodes, straight in s between: u constant in each cell."""

    path: path_rows.Path
    nodes: np.ndarray
    x: np.ndarray

    @property
    def clock(self):
        """Times of the nodes, (N + 1,)."""
        speed = np.sqrt(self.x)
        return np.concatenate([[0.0], np.cumsum(2.0 * np.diff(self.nodes) / (speed[:-1] + speed[1:]))])

    @property
    def times(self):
        return 0.0, self.clock[-1]

    def progress(self, times):
        """s, s' and s'' at times, (3, k)."""
        clock, steps = self.clock, np.diff(self.nodes)
        i = np.clip(np.searchsorted(clock, times, "right") - 1, 0, len(steps) - 1)
        u = np.diff(self.x)[i] / (2.0 * steps[i])
        since, speed = np.asarray(times) - clock[i], np.sqrt(self.x[i])
        s = np.clip(self.nodes[i] + since * (speed + 0.5 * u * since), self.nodes[i], self.nodes[i + 1])
        return np.stack([s, np.maximum(speed + u * since, 0.0), u])

    def state(self, times):
        """State at times, as any motion's."""
        s, speed, u = self.progress(np.atleast_1d(times))
        clock = self.clock
        i = np.clip(np.searchsorted(clock, times, "right") - 1, 0, len(self.nodes) - 2)
        at = self.path.at(s, 0.5 * (self.nodes[i] + self.nodes[i + 1]))
        speed, u = speed[:, None], u[:, None]
        first = (at.first * speed, at.first * u + at.second * speed**2)
        return sampled_motion.State(
            at.position, *first, at.rotation, at.omega * speed, at.omega * u + at.alpha * speed**2
        )


def slacks(robot, limits, motion, times):
    """Slacks of all limits at times, dict of (k,): by linear programs, or by solving where n = dof. SI units."""
    low, high = path_rows.tension_range(robot, limits)
    verifier = any_motion.Verifier(robot, limits, motion, any_motion.Centring(low, high))
    made, state = verifier.slacks(times), motion.state(np.atleast_1d(times))
    if np.isinf(high).all() and not np.isfinite(low).any():
        del made["tension"]
    for name, part in (("speed_max", state.velocity), ("acceleration_max", state.acceleration)):
        if limits.get(name) is not None:
            made[name] = limits[name] - np.linalg.norm(part, axis=1)
    return made


def breaches(problem_, solution, shares=INNER):
    """By how much rows are broken in cells, the most of each name, dict of (N,): 0 where they hold."""
    steps, worst = np.diff(problem_.nodes), {}
    for fraction in shares:
        place = least_time.places_of(problem_.path, problem_.nodes, fraction)
        found = path_rows.rows(problem_.robot, problem_.limits, place, **problem_.polygon)
        off = -path_rows.slack(found, solution.u, solution.x[:-1] + 2.0 * steps * fraction * solution.u)
        names = np.array(found.names)
        for name in dict.fromkeys(found.names):
            broken = np.maximum(off[:, names == name].max(1), 0.0)
            worst[name] = np.maximum(worst.get(name, 0.0), broken)
    return worst


def above(robot, limits, path, count=1000, rounds=20):
    """Motion whose limits hold between the nodes too, but for 1e-8 of their size, and its time; or (None, inf)."""
    problem_ = least_time.problem(robot, limits, path, count, outer=False)
    size = {"tension": robot["mass"] * robot["gravity"]}
    for _ in range(rounds):
        solution = least_time.solved(problem_)
        if solution.verdict != "feasible":
            break
        worst = breaches(problem_, solution)
        near = {name: 1e-9 * size.get(name, np.max(limits.get(name, 1.0)) ** 2) for name in worst}
        if all((worst[name] <= 10.0 * near[name]).all() for name in worst):
            return Timed(path, solution.nodes, solution.x), solution.time
        tighter = {n: problem_.tighter.get(n, 0.0) + 1.5 * v + near[n] * (v > 0.0) for n, v in worst.items()}
        problem_ = dataclasses.replace(problem_, tighter=tighter)
    return None, math.inf


def estimate(robot, limits, path, count=400):
    """Least time by the optimum of the midpoint scheme, and its change from half as many cells, s; no bound."""
    times = []
    for cells in (count // 2, count):
        problem_ = least_time.problem(robot, limits, path, cells, "midpoint")
        solution = least_time.solved(problem_)
        if solution.verdict != "feasible":
            return math.inf, math.inf
        times.append(least_time.optimum(problem_, solution)[1])
    return times[1], abs(times[1] - times[0])


@dataclasses.dataclass(frozen=True)
class Necessary:
    """Rows of u_bar and the chord's middle x_m that any motion meets on the cells, and bounds of x and u.

    a, b, c: (N, rows). low, high: (N,) of u. caps: (N + 1,) of x at the nodes.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    low: np.ndarray
    high: np.ndarray
    caps: np.ndarray


def aligned_rows(robot, limits, path, nodes):
    """Rows at the start, middle and end of cells, arrays (3, N, rows), smooth from one to the next."""
    places = [least_time.places_of(path, nodes, fraction) for fraction in (0.0, 0.5, 1.0)]
    made = [path_rows.kinematic_rows(robot, limits, place, FEW_SIDES) for place in places]
    parts = [[np.concatenate([p[k] for p in one.values()], 1)] if made[0] else [] for one in made for k in range(3)]
    found = [path_rows.normals(path_rows.balance(robot, place).matrix) for place in places]
    # Scaled so that all have the same part along the middle's: then rows are smooth functions of s.
    middle = found[1] / np.abs(found[1] @ path_rows.balance(robot, places[1]).matrix).sum(2)[..., None]
    for k, place in enumerate(places):
        part = np.sum(found[k] * middle, axis=2)[..., None]
        smooth = found[k] * np.sum(middle * middle, axis=2)[..., None] / part
        for j, row in enumerate(path_rows.tension_rows(robot, limits, place, smooth)):
            parts[3 * k + j].append(row)
    joined = [np.concatenate(part, axis=1) for part in parts]
    return [np.stack(joined[k::3]) for k in range(3)]


def extremes(a, b, c, most):
    """Least and largest u, and largest x, of the polygon of rows (rows,) and 0 <= x <= most."""
    rows = np.append(a, [0.0, 0.0]), np.append(b, [-1.0, 1.0]), np.append(c, [0.0, most])
    x = least_time.span(*rows)
    u = least_time.span(rows[1], rows[0], rows[2])
    return u[0], u[1], x[1]


def necessary(robot, limits, path, nodes, most):
    """Rows that any motion meets, x nowhere above `most` (N + 1,), in SI units; None where u has no bounds."""
    a, b, c = aligned_rows(robot, limits, path, nodes)
    d = np.diff(nodes)[:, None]
    unit_u, unit_x = robot["gravity"], robot["gravity"] * path.length
    top = np.maximum(most[:-1], most[1:])
    boxes = np.array(
        [
            [extremes(a[k, i] * unit_u, b[k, i] * unit_x, c[k, i], top[i] / unit_x) for k in range(3)]
            for i in range(len(d))
        ]
    )
    low, high = boxes[..., 0].min(1) * unit_u, boxes[..., 1].max(1) * unit_u
    caps = boxes[..., 2] * unit_x
    caps = np.minimum(np.append(caps[:, 0], math.inf), np.append(math.inf, caps[:, 2]))
    if not (np.isfinite(high - low).all() and np.isfinite(top).all()):
        return None
    reach = np.maximum(np.abs(low), np.abs(high))[:, None]
    bends = [np.abs(v[2] - 2.0 * v[1] + v[0]) for v in (a, b, c)]
    slope_a, slope_b = a[2] - a[0], b[2] - b[0]  # over the cell
    mean_c = (c[0] + 4.0 * c[1] + c[2]) / 6.0 + bends[2] / 6.0
    # Curvature v'' D^2 / 8 is half of a second difference of half a cell.
    more = SAFETY * (0.5 * bends[0] * reach + 0.5 * bends[1] * top[:, None] + np.abs(slope_b) * reach * d / 6.0)
    factor = np.abs(b[1] - 0.5 * slope_a / d)
    tangents = []
    for fraction in (0.0, 0.5, 1.0):
        # r = D w share (1 - share), r' = D (1 - 2 share), with w = u_+ - u_- and u = u_- + w share.
        wide = (high - low)[:, None]
        at = low[:, None] + wide * fraction
        r, slope = d * wide * fraction * (1.0 - fraction), d * (1.0 - 2.0 * fraction)
        tangents.append((a[1] - factor * slope, b[1], mean_c + more + factor * (r - slope * at)))
    return Necessary(*(np.concatenate([t[k] for t in tangents], axis=1) for k in range(3)), low, high, caps)


def reached(rows_, nodes, units, start, forwards):
    """Largest x at nodes from one end of the path, (N + 1,), None if there is none: cell by cell, both ways alike."""
    unit_u, unit_x = units
    steps, sign = np.diff(nodes), 1.0 if forwards else -1.0
    sets = np.full((len(nodes), 2), math.nan)
    order = range(len(steps)) if forwards else range(len(steps) - 1, -1, -1)
    sets[0 if forwards else -1] = start / unit_x
    for i in order:
        before, after = (i, i + 1) if forwards else (i + 1, i)
        ahead = steps[i] * unit_u / unit_x * sign
        # Unknowns: u_bar and x at the node that is reached; x at the other is x - 2 ahead u.
        a, b = rows_.a[i] * unit_u, rows_.b[i] * unit_x
        more_a = [-2.0 * ahead, 2.0 * ahead, 0.0, 0.0, 1.0, -1.0]
        more_b = [1.0, -1.0, 1.0, -1.0, 0.0, 0.0]
        more_c = [sets[before, 1], -sets[before, 0], rows_.caps[after] / unit_x, 0.0]
        more_c += [rows_.high[i] / unit_u, -rows_.low[i] / unit_u]
        low, high = least_time.span(
            np.append(a - ahead * b, more_a), np.append(b, more_b), np.append(rows_.c[i], more_c)
        )
        if not low <= high:
            return None
        sets[after] = max(low, 0.0), high
    return sets[:, 1] * unit_x


def shortest(d, first, last, up, down):
    """Least time over a cell with x at most first + 2 up s and last + 2 down (d - s), s."""

    def leg(x, rate, length):
        return (math.sqrt(x + 2.0 * rate * length) - math.sqrt(x)) / rate if rate > 1e-12 else length / math.sqrt(x)

    up, down = max(up, 0.0), max(down, 0.0)
    meet = (0.5 * (last - first) + down * d) / max(up + down, 1e-300)
    meet = min(max(meet, 0.0), d)
    return (leg(first, up, meet) if meet > 0.0 else 0.0) + (leg(last, down, d - meet) if meet < d else 0.0)


def fastest(robot, limits, path, nodes, start=0.0):
    """Bound of x at nodes by the work that tensions within their limits, and the weight, can do, (N + 1,)."""
    place = path.at(nodes)
    ahead, turning = (np.linalg.norm(v, axis=1) for v in (place.first, place.omega))
    total = np.sum(path_rows.tension_range(robot, limits)[1])
    arm = np.linalg.norm(path_rows.attachments(robot, place)[0], axis=1).max()
    weight = robot["mass"] * robot["gravity"]
    with np.errstate(invalid="ignore"):
        force = SAFETY * np.nan_to_num((total + weight) * ahead + total * arm * turning, nan=math.inf)
    work = np.concatenate([[0.0], np.cumsum(np.diff(nodes) * np.maximum(force[1:], force[:-1]))])
    inertia = 0.0 if robot["inertia"] is None else np.trace(robot["inertia"])
    energy = 0.5 * start * (robot["mass"] * ahead[0] ** 2 + inertia * turning[0] ** 2)
    return 2.0 * (work + energy) / (robot["mass"] * ahead**2)


def below(robot, limits, path, count=1000, passes=2, ends=(0.0, 0.0)):
    """Bound of the least time from below, s; infinite if the relaxed problem has no motion.

    It takes bounds of u: every cable has a tension_max, or accelerations and speeds are limited. Otherwise 0.
    """
    nodes = path.nodes(count)
    units = robot["gravity"], robot["gravity"] * path.length
    most, total = fastest(robot, limits, path, nodes, ends[0]), 0.0
    for _ in range(passes):
        rows_ = necessary(robot, limits, path, nodes, most)
        if rows_ is None:
            return 0.0
        sides = [reached(rows_, nodes, units, end, way) for end, way in zip(ends, (True, False), strict=True)]
        if sides[0] is None or sides[1] is None:
            return math.inf
        most = np.minimum(*sides)
        cells = zip(np.diff(nodes), most[:-1], most[1:], rows_.high, -rows_.low, strict=True)
        total = sum(shortest(*cell) for cell in cells)
    return total
