"""NumPy and HiGHS reference for the least time along a path: the problem on a grid and its solutions.

On a cell from s_i to s_(i+1) u is constant, so that x_(i+1) = x_i + 2 D u_i. The rows hold at s_i ("collocation"), at
both ends of the cell ("interpolation"), or at its middle ("midpoint"), always with the derivatives of the cell's side.
The controllable set K_i of x_i, from which the end can be reached, is an interval: the x of the polygon

    A u + B x <= C,    x >= 0,    lo_(i+1) <= x + 2 D u <= hi_(i+1).

It comes from Fourier-Motzkin elimination of u (every row from above with every one from below), from the polygon's
vertices, or from HiGHS with the tensions as unknowns: three ways that share nothing but the limits.
Units inside: accelerations over g, s over the length of the path, so that u is over g and x over g L.
"""

import dataclasses
import math

import numpy as np
import scipy.sparse
from scipy.optimize import linprog, minimize_scalar

from . import path_rows

PARALLEL, FEASIBLE = 1e-14, 1e-12
SCHEMES = {"collocation": (0.0,), "interpolation": (0.0, 1.0), "midpoint": (0.5,)}


def span(a, b, c):
    """Least and largest x with a u + b x <= c for some u, by elimination; (nan, nan) if there is none."""
    keep = np.isfinite(c)
    rows = np.stack([a, b, c])[:, keep]
    size = np.maximum(np.abs(rows[0]), np.abs(rows[1]))
    void = size == 0.0
    if (rows[2][void] < -FEASIBLE).any():
        return math.nan, math.nan
    a, b, c = rows[:, ~void] / size[~void]
    up, down, flat = a > PARALLEL, a < -PARALLEL, np.abs(a) <= PARALLEL
    weight_up, weight_down = -a[down][None], a[up][:, None]
    slope = np.concatenate([(weight_up * b[up][:, None] + weight_down * b[down]).ravel(), b[flat]])
    most = np.concatenate([(weight_up * c[up][:, None] + weight_down * c[down]).ravel(), c[flat]])
    level = np.abs(slope) <= PARALLEL
    if (most[level] < -FEASIBLE).any():
        return math.nan, math.nan
    above, below = slope > PARALLEL, slope < -PARALLEL
    high = np.min(most[above] / slope[above], initial=math.inf)
    low = np.max(most[below] / slope[below], initial=-math.inf)
    if low > high + FEASIBLE * (1.0 + abs(high)):
        return math.nan, math.nan
    return min(low, high), high


def vertex_span(a, b, c):
    """The same from the vertices of a polygon that has some, by Cramer's rule."""
    keep = np.isfinite(c)
    a, b, c = a[keep], b[keep], c[keep]
    first, second = np.triu_indices(len(a), 1)
    det = a[first] * b[second] - a[second] * b[first]
    cross = np.abs(det) > PARALLEL * np.hypot(a[first], b[first]) * np.hypot(a[second], b[second])
    first, second, det = first[cross], second[cross], det[cross]
    u = (c[first] * b[second] - c[second] * b[first]) / det
    x = (a[first] * c[second] - a[second] * c[first]) / det
    inside = (a[:, None] * u + b[:, None] * x <= c[:, None] + 1e-11 * (1.0 + np.abs(c))[:, None]).all(0)
    return (x[inside].min(), x[inside].max()) if inside.any() else (math.nan, math.nan)


def steepest(a, b, c, x):
    """Largest u at x."""
    up = a > PARALLEL * np.maximum(np.abs(a), np.abs(b))
    return np.min((c[up] - b[up] * x) / a[up], initial=math.inf)


@dataclasses.dataclass(frozen=True)
class Problem:
    """The problem on a grid: robot, limits, path, nodes (N + 1,), and the points at which the rows of a cell hold.

    shares: where in a cell rows hold, 0 its start, 1 its end. rows: of each share, in SI units, for the x there.
    tighter: dict of (N,), taken off the right sides of rows with that name. ends: x at both ends of the path.
    polygon: `sides` and `outer` of the circle of accelerations.
    """

    robot: dict
    limits: dict
    path: path_rows.Path
    nodes: np.ndarray
    shares: tuple
    rows: tuple
    tighter: dict
    ends: tuple = (0.0, 0.0)
    polygon: dict = dataclasses.field(default_factory=dict)

    @property
    def units(self):
        """Units of u and of x."""
        return self.robot["gravity"], self.robot["gravity"] * self.path.length

    def cell(self, i, target):
        """Rows a, b, c of u_i and x_i in the units of the problem, with those of the interval of x_(i+1)."""
        unit_u, unit_x = self.units
        step = self.nodes[i + 1] - self.nodes[i]
        parts = [(np.array([-0.0]), np.array([-1.0]), np.array([0.0]))]
        for fraction, found in zip(self.shares, self.rows, strict=True):
            off = np.array([self.tighter[n][i] if n in self.tighter else 0.0 for n in found.names])
            parts.append((found.a[i] + 2.0 * step * fraction * found.b[i], found.b[i], found.c[i] - off))
        a, b, c = (np.concatenate([part[k] for part in parts]) for k in range(3))
        scaled = a * unit_u, b * unit_x, c
        ahead = 2.0 * step * unit_u / unit_x
        reach = [(-ahead, -1.0, -target[0] / unit_x), (ahead, 1.0, target[1] / unit_x)]
        return tuple(np.append(v, [r[k] for r in reach]) for k, v in enumerate(scaled))


def places_of(path, nodes, fraction):
    """Places in all cells, at a share of their lengths, with the derivatives on the cell's side."""
    return path.at(nodes[:-1] + fraction * np.diff(nodes), 0.5 * (nodes[:-1] + nodes[1:]))


def problem(robot, limits, path, count=200, scheme="interpolation", ends=(0.0, 0.0), **polygon):
    """Problem on about `count` cells; polygon: `sides` and `outer` of the circle of accelerations."""
    nodes, shares = path.nodes(count), SCHEMES[scheme]
    made = tuple(path_rows.rows(robot, limits, places_of(path, nodes, fraction), **polygon) for fraction in shares)
    return Problem(robot, limits, path, nodes, shares, made, {}, ends, polygon)


def controllable(problem_, way=span):
    """Intervals K_i of x, (N + 1, 2); nan from the cell on, backwards, where there is none."""
    unit = problem_.units[1]
    sets = np.full((len(problem_.nodes), 2), math.nan)
    sets[-1] = problem_.ends[1]
    for i in range(len(sets) - 2, -1, -1):
        low, high = way(*problem_.cell(i, sets[i + 1]))
        if not low <= high:
            break
        sets[i] = max(low, 0.0) * unit, high * unit
    return sets


def duration(nodes, x):
    """Time along nodes with x = s'^2 there and straight between, s."""
    speed = np.sqrt(x)
    with np.errstate(divide="ignore"):
        return np.sum(2.0 * np.diff(nodes) / (speed[:-1] + speed[1:]))


@dataclasses.dataclass(frozen=True)
class Solution:
    """x (N + 1,) and u (N,) of a grid, the controllable sets, and T; or the cell that has none, and T infinite.

    verdict: "feasible", "uncontrollable" (the set of a cell is empty), "start" (the start's x is not in its own).
    """

    verdict: str
    nodes: np.ndarray
    sets: np.ndarray
    x: np.ndarray | None = None
    u: np.ndarray | None = None
    time: float = math.inf
    cell: int = -1


def solved(problem_, way=span):
    """Greedy solution: the largest u at each node that leads into the next set."""
    sets = controllable(problem_, way)
    if np.isnan(sets[0, 0]):
        cell = int(np.flatnonzero(np.isnan(sets[:, 0])).max())
        return Solution("uncontrollable", problem_.nodes, sets, cell=cell)
    start, unit = problem_.ends[0], problem_.units[1]
    if not sets[0, 0] - 1e-10 * unit <= start <= sets[0, 1] + 1e-10 * unit:
        return Solution("start", problem_.nodes, sets, cell=0)
    x, steps = np.full(len(sets), float(start)), np.diff(problem_.nodes)
    for i, step in enumerate(steps):
        u = steepest(*problem_.cell(i, sets[i + 1]), x[i] / unit) * problem_.units[0]
        x[i + 1] = np.clip(x[i] + 2.0 * step * u, *sets[i + 1])
    return Solution("feasible", problem_.nodes, sets, x, np.diff(x) / (2.0 * steps), duration(problem_.nodes, x))


def optimum(problem_, solution, rounds=15, gap=1e-6):
    """Least T of the problem on its grid, from a solution: bounds of it, and x (N + 1,).

    T is convex in x, and rows are linear in it: linear programs of its tangents bound it from below, and T along the
    way to their solutions leads to it (Frank and Wolfe). A greedy solution takes a little longer.
    """
    unit_u, unit_x = problem_.units
    steps, count = np.diff(problem_.nodes), len(problem_.nodes)
    parts, most = [], []
    for i, step in enumerate(steps):
        a, b, c = (v[:-2] for v in problem_.cell(i, (0.0, math.inf)))
        ahead = 2.0 * step * unit_u / unit_x
        rows = np.stack([b - a / ahead, a / ahead], axis=1)
        size = np.maximum(np.abs(rows).max(1), 1e-300)
        parts.append(rows / size[:, None])
        most.append(c / size)
    columns = np.concatenate([np.tile([i, i + 1], len(part)) for i, part in enumerate(parts)])
    values, most = np.concatenate([part.ravel() for part in parts]), np.concatenate(most)
    at = np.repeat(np.arange(len(most)), 2)
    keep = np.isfinite(most)
    matrix = scipy.sparse.csr_matrix((values, (at, columns)), shape=(len(most), count))[keep]
    bounds = [(0.0, None)] * count
    bounds[0], bounds[-1] = ((end / unit_x,) * 2 for end in problem_.ends)
    x, below = solution.x / unit_x, 0.0

    def time(x):
        return duration(problem_.nodes, np.maximum(x, 0.0) * unit_x)

    for _ in range(rounds):
        speed = np.maximum(np.sqrt(x * unit_x), 1e-9 * math.sqrt(unit_x))
        both = (speed[:-1] + speed[1:]) ** 2
        slope = np.zeros(count)
        slope[:-1] -= steps * unit_x / (speed[:-1] * both)
        slope[1:] -= steps * unit_x / (speed[1:] * both)
        slope[[0, -1]] = 0.0
        answer = linprog(slope / np.abs(slope).max(), matrix, most[keep], bounds=bounds, method="highs")
        if answer.status:
            raise RuntimeError(answer.message)
        below = max(below, time(x) + slope @ (answer.x - x))
        fraction = minimize_scalar(
            lambda k, y=answer.x, x=x: time(x + k * (y - x)), bounds=(0.0, 1.0), method="bounded"
        ).x
        if time(x + fraction * (answer.x - x)) < time(x):
            x = x + fraction * (answer.x - x)
        if time(x) - below < gap * time(x):
            break
    return below, time(x), x * unit_x


class ByTensions:
    """The same problem with the tensions as unknowns: HiGHS at each cell. It knows no facet normals."""

    def __init__(self, robot, limits, path, count=50, scheme="interpolation", ends=(0.0, 0.0), sides=path_rows.SIDES):
        self.robot, self.limits, self.path, self.ends = robot, limits, path, ends
        self.nodes = path.nodes(count)
        self.shares = SCHEMES[scheme]
        places = [places_of(path, self.nodes, fraction) for fraction in self.shares]
        self.balances = [path_rows.balance(robot, place) for place in places]
        self.others = [self._stack(path_rows.kinematic_rows(robot, limits, place, sides)) for place in places]
        self.range = path_rows.tension_range(robot, limits)
        self.unit_u, self.unit_x = robot["gravity"], robot["gravity"] * path.length

    @staticmethod
    def _stack(made):
        return [np.concatenate([part[k] for part in made.values()], axis=1) for k in range(3)] if made else None

    def program(self, i, target, cost, x=None):
        """Extreme of cost . (u, x) at a cell, as (u, x) in SI units; None if there is none."""
        n, weight = len(self.range[0]), self.robot["mass"] * self.robot["gravity"]
        step, count = self.nodes[i + 1] - self.nodes[i], len(self.shares)
        equal, right, upper, most = [], [], [], []
        for k, (fraction, found, other) in enumerate(zip(self.shares, self.balances, self.others, strict=True)):
            ahead = 2.0 * step * fraction
            block = np.zeros((found.matrix.shape[1], 2 + count * n))
            block[:, 0] = -(found.a[i] + ahead * found.b[i]) * self.unit_u / weight
            block[:, 1] = -found.b[i] * self.unit_x / weight
            block[:, 2 + k * n : 2 + (k + 1) * n] = found.matrix[i]
            equal.append(block)
            right.append(found.c[i] / weight)
            if other is not None:
                a, b, c = (v[i] for v in other)
                block = np.zeros((len(a), 2 + count * n))
                block[:, 0], block[:, 1] = (a + ahead * b) * self.unit_u, b * self.unit_x
                size = np.maximum(np.abs(block).max(1), 1e-300)
                upper.append(block / size[:, None])
                most.append(c / size)
        block = np.zeros((2, 2 + count * n))
        block[:, 0], block[:, 1] = 2.0 * step * self.unit_u / self.unit_x, 1.0
        block[0] *= -1.0
        is_limited = np.isfinite(target)
        upper.append(block[is_limited])
        most.append((np.array([-target[0], target[1]]) / self.unit_x)[is_limited])
        tensions = [(low / weight, high / weight) for low, high in zip(*self.range, strict=True)]
        speed = (0.0, None) if x is None else (x / self.unit_x,) * 2
        answer = linprog(
            np.concatenate([cost, np.zeros(count * n)]),
            np.concatenate(upper),
            np.concatenate(most),
            np.concatenate(equal),
            np.concatenate(right),
            [(None, None), speed, *(tensions * count)],
            method="highs-ds",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        if answer.status == 3:
            return math.inf, math.inf
        return None if answer.status else (answer.x[0] * self.unit_u, answer.x[1] * self.unit_x)

    def solve(self):
        """Greedy solution, by three programs a cell."""
        sets = np.full((len(self.nodes), 2), math.nan)
        sets[-1] = self.ends[1]
        for i in range(len(sets) - 2, -1, -1):
            extremes = [self.program(i, sets[i + 1], np.array([0.0, sign])) for sign in (1.0, -1.0)]
            if None in extremes:
                return Solution("uncontrollable", self.nodes, sets, cell=i)
            sets[i] = extremes[0][1], max(extremes[0][1], extremes[1][1])
        if not sets[0, 0] - 1e-8 * self.unit_x <= self.ends[0] <= sets[0, 1] + 1e-8 * self.unit_x:
            return Solution("start", self.nodes, sets, cell=0)
        x, steps = np.full(len(sets), float(self.ends[0])), np.diff(self.nodes)
        for i, step in enumerate(steps):
            best = self.program(i, sets[i + 1], np.array([-1.0, 0.0]), x[i])
            # HiGHS keeps rows to 1e-10, so that the start may be out of its set by so much: then straight on.
            u = (sets[i + 1, 1] - x[i]) / (2.0 * step) if best is None else best[0]
            x[i + 1] = np.clip(x[i] + 2.0 * step * u, *sets[i + 1])
        return Solution("feasible", self.nodes, sets, x, np.diff(x) / (2.0 * steps), duration(self.nodes, x))
