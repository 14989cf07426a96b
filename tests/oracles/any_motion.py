"""NumPy and HiGHS reference for any motion of any cable robot: cables, tensions, slacks, intervals of failure.

A robot is a dict: base_points (n, 3), platform_points (n, 3) or None, mass, inertia (3, 3) about the mass centre in the
platform's axes, centre_of_mass (3,) from the platform frame's origin, gravity, pattern ("2T", "3T", "1R2T", "3R3T"),
z_axis ("up", "down"), pulley_radius (n,) or None, pulley_axes (n, 3), cable_diameter. Limits are a dict of tension_min,
tension_max (n,), floor, cable_length_max, cable_speed_max, cable_acceleration_max; absent or None: no limit.
A motion (`sampled_motion`) is that of the mass centre. Planar robots lie in the plane of x and z and turn about y.

Balance about the mass centre, where a cable with the tension f pulls along u, from its attachment R b to its spool:

    sum f u + m g = m a,    sum f (R b) x u = I alpha + omega x (I omega)

A swivelling pulley of radius r turns about the axis k through its entry point A, in which the cable travels along k. In
the plane of k and of the attachment B, with e normal to k on B's side, the centre is C = A + r e; a cable that has
wrapped an angle q is at C + r n, n = -cos q e + sin q k, and leaves along t = sin q e + cos q k: B - C = r n + free t.
The length is r q + free. Its rate is t . B', for the pulley's own turning moves the cable across itself only.
"""

import dataclasses

import numpy as np
from scipy.optimize import linprog

SAMPLES = 20_001
ROWS = {"2T": [0, 2], "3T": [0, 1, 2], "1R2T": [0, 2, 4], "3R3T": [0, 1, 2, 3, 4, 5]}
NEAR = 1e-9


def dot(a, b):
    return np.sum(a * b, axis=-1)


@dataclasses.dataclass(frozen=True)
class Cables:
    """Cables at k instants: lengths and two derivatives (k, n), towards spools (k, n, 3), ends of the free parts."""

    lengths: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray
    towards: np.ndarray
    arms: np.ndarray
    leaving: np.ndarray
    attachments: np.ndarray


def cables(robot, state):
    """Cables of a state."""
    base = np.asarray(robot["base_points"], float)
    points = robot["platform_points"]
    body = np.zeros_like(base) if points is None else np.asarray(points, float) - robot["centre_of_mass"]
    arms = np.einsum("kij,nj->kni", state.rotation, body)
    omega, alpha = state.omega[:, None], state.alpha[:, None]
    turning = np.cross(omega, arms)
    b = state.position[:, None] + arms
    db = state.velocity[:, None] + turning
    ddb = state.acceleration[:, None] + np.cross(alpha, arms) + np.cross(omega, turning)
    if robot.get("pulley_radius") is None:
        d = b - base
        length = np.sqrt(dot(d, d))
        rate = dot(d, db) / length
        second_derivative = (dot(db, db) + dot(d, ddb) - rate**2) / length
        return Cables(length, rate, second_derivative, -d / length[..., None], arms, np.broadcast_to(base, b.shape), b)
    r = np.asarray(robot["pulley_radius"], float)
    axes = np.asarray(robot["pulley_axes"], float)
    k = axes / np.linalg.norm(axes, axis=1)[:, None]
    d = b - base
    across = d - dot(d, k)[..., None] * k
    reach = np.sqrt(dot(across, across))
    e = across / reach[..., None]
    x, y = reach - r, dot(d, k)
    free = np.sqrt(x**2 + y**2 - r**2)
    wrapped = np.arctan2(x, y) + np.arctan2(r, free)
    sin, cos = np.sin(wrapped)[..., None], np.cos(wrapped)[..., None]
    n, t = sin * k - cos * e, sin * e + cos * k
    # Swivelling: the attachment moves across the pulley's plane; unrolling: within it, across the cable.
    swivel = db - dot(db, k)[..., None] * k - dot(db, e)[..., None] * e
    de = swivel / reach[..., None]
    within = dot(db, e)[..., None] * e + dot(db, k)[..., None] * k
    unroll = -dot(within, n) / free
    dt = unroll[..., None] * (cos * e - sin * k) + sin * de
    length, rate = r * wrapped + free, dot(t, db)
    return Cables(length, rate, dot(dt, db) + dot(t, ddb), -t, arms, base + r[:, None] * (e + n), b)


def gravity(robot):
    """Acceleration of gravity, (3,)."""
    return np.array([0.0, 0.0, robot["gravity"] if robot["z_axis"] == "down" else -robot["gravity"]])


def balance(robot, state, found):
    """Wrench matrices (k, dof, n) and wrenches (k, dof) that the cables are to apply."""
    columns = np.concatenate([found.towards, np.cross(found.arms, found.towards)], axis=2)
    force = robot["mass"] * (state.acceleration - gravity(robot))
    moment = np.zeros_like(force)
    if robot["platform_points"] is not None:
        inertia = state.rotation @ np.asarray(robot["inertia"], float) @ np.swapaxes(state.rotation, 1, 2)
        spin = np.einsum("kij,kj->ki", inertia, state.omega)
        moment = np.einsum("kij,kj->ki", inertia, state.alpha) + np.cross(state.omega, spin)
    rows = ROWS[robot["pattern"]]
    return np.swapaxes(columns[:, :, rows], 1, 2), np.concatenate([force, moment], axis=1)[:, rows]


class Centring:
    """Tensions as far from their limits as can be: the largest s with A f = w, lo + s <= f <= hi - s.

    A basis is a vertex of the program: the cables at lo + s, at hi - s, and between. HiGHS gives bases, one at a time;
    where a basis that is known balances, keeps the limits and has multipliers of the right signs, it is the optimum.
    """

    def __init__(self, lo, hi):
        self.lo, self.hi = np.asarray(lo, float), np.asarray(hi, float)
        self.bases, self.programs = [], 0

    def largest(self, matrix, wrench):
        """Largest s (k,) of wrench matrices (k, dof, n) and wrenches (k, dof)."""
        count, dof, n = matrix.shape
        if n == dof:
            with np.errstate(all="ignore"):
                f = tensions(matrix, wrench)
                return np.minimum(f - self.lo, self.hi - f).min(1)
        s, open_ = np.full(count, np.nan), np.arange(count)
        for basis in list(self.bases):
            open_ = self._try(basis, matrix, wrench, s, open_)
        while len(open_):
            at = open_[len(open_) // 2]
            s[at], basis = self.program(matrix[at], wrench[at])
            open_ = open_[open_ != at]
            if basis is not None and basis not in self.bases:
                self.bases.insert(0, basis)
                open_ = self._try(basis, matrix, wrench, s, open_)
        return s

    def _try(self, basis, matrix, wrench, s, open_):
        """Settle the open instants at which a basis is the optimum; the others, in order."""
        if not len(open_):
            return open_
        low, high = (np.array(part, int) for part in basis)
        between = np.setdiff1d(np.arange(len(self.lo)), np.concatenate([low, high]))
        a, w = matrix[open_], wrench[open_]
        last = a[:, :, low].sum(2) - a[:, :, high].sum(2)
        square = np.concatenate([a[:, :, between], last[:, :, None]], axis=2)
        # Multiplied by its transpose: rows of singular ones become infinite or nan, and fail below.
        right = w - a[:, :, low] @ self.lo[low] - a[:, :, high] @ self.hi[high]
        is_regular = np.abs(np.linalg.det(square)) > 1e-12 * np.prod(np.linalg.norm(square, axis=1), axis=1)
        square[~is_regular] = np.eye(square.shape[1])
        inverse = np.linalg.inv(square)
        x = np.einsum("kij,kj->ki", inverse, right)
        x += np.einsum("kij,kj->ki", inverse, right - np.einsum("kij,kj->ki", square, x))
        c = np.einsum("ki,kin->kn", inverse[:, -1], a)
        f, slack = x[:, :-1], x[:, -1]
        near = NEAR * (1.0 + np.abs(x).max(1))[:, None]
        is_best = is_regular & (f - slack[:, None] >= self.lo[between] - near).all(1)
        is_best &= (f + slack[:, None] <= self.hi[between] + near).all(1)
        is_best &= (c[:, low] >= -NEAR).all(1) & (c[:, high] <= NEAR).all(1)
        s[open_[is_best]] = slack[is_best]
        return open_[~is_best]

    def program(self, a, w):
        """Solve one program by HiGHS: s, and its basis (None: not a simple vertex)."""
        self.programs += 1
        dof, n = a.shape
        eye, one = np.eye(n), np.ones((n, 1))
        is_limited = np.isfinite(self.hi)
        upper = np.concatenate([np.concatenate([-eye, one], 1), np.concatenate([eye, one], 1)[is_limited]])
        bounds = np.concatenate([-self.lo, self.hi[is_limited]])
        equal = np.concatenate([a, np.zeros((dof, 1))], axis=1)
        cost = np.append(np.zeros(n), -1.0)
        free = [(None, None)] * (n + 1)
        answer = linprog(
            cost,
            upper,
            bounds,
            equal,
            w,
            free,
            method="highs-ds",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        if answer.status in (3, 4):
            return np.inf, None
        if answer.status != 0:
            raise RuntimeError(answer.message)
        low = answer.ineqlin.marginals[:n] < -1e-12
        high = np.zeros(n, bool)
        high[is_limited] = answer.ineqlin.marginals[n:] < -1e-12
        if (low & high).any() or low.sum() + high.sum() != n + 1 - dof:
            return -answer.fun, None
        return -answer.fun, (tuple(np.flatnonzero(low).tolist()), tuple(np.flatnonzero(high).tolist()))


def tensions(matrix, wrench):
    """Tensions of as many cables as degrees of freedom, (k, n); where they don't exist, nan."""
    is_regular = np.linalg.det(matrix) != 0.0
    solved = np.full(wrench.shape, np.nan)
    solved[is_regular] = np.linalg.solve(matrix[is_regular], wrench[is_regular][..., None])[..., 0]
    return solved


def tension_limits(robot, limits):
    """Least and largest tension of each cable, two arrays (n,)."""
    n = len(robot["base_points"])
    low, high = limits.get("tension_min"), limits.get("tension_max")
    spread = [0.0 if low is None else low, np.inf if high is None else high]
    return tuple(np.broadcast_to(np.asarray(x, float), n) for x in spread)


@dataclasses.dataclass(frozen=True)
class Verifier:
    """Slacks of a motion under limits, each positive where it holds: N, m, m/s, m/s2."""

    robot: dict
    limits: dict
    motion: object
    centring: Centring

    def slacks(self, times):
        """Slack of each criterion at times, dict of (k,) arrays."""
        state = self.motion.state(np.atleast_1d(times))
        found = cables(self.robot, state)
        slack = {"tension": self.centring.largest(*balance(self.robot, state, found))}
        floor = self.limits.get("floor")
        if floor is not None:
            sign = 1.0 if self.robot["z_axis"] == "down" else -1.0
            # All of the platform: its mass centre and its attachment points.
            heights = np.concatenate([state.position[:, None, 2], found.attachments[:, :, 2]], axis=1)
            slack["floor"] = (sign * (floor - heights)).min(1)
        demands = {
            "cable_length_max": found.lengths,
            "cable_speed_max": np.abs(found.rates),
            "cable_acceleration_max": np.abs(found.accelerations),
        }
        for name, demand in demands.items():
            if self.limits.get(name) is not None:
                slack[name] = (np.asarray(self.limits[name]) - demand).min(1)
        return slack

    def least(self, times):
        """Smallest slack in units of a limit's own size, and only its sign counts, (k,)."""
        return np.min(list(self.slacks(times).values()), axis=0)


def verifier(robot, limits, motion):
    """Verifier of a motion."""
    return Verifier(robot, limits, motion, Centring(*tension_limits(robot, limits)))


def refined(function, times, values, rounds=4, parts=20):
    """Samples with finer ones about the valleys and peaks near zero, where a sign between samples may hide."""
    for _ in range(rounds):
        inner = np.pad(values, 1, mode="edge")
        before, after = inner[:-2], inner[2:]
        reach = 2.0 * np.maximum(np.abs(values - before), np.abs(values - after))
        is_turning = ((values <= before) & (values <= after)) | ((values >= before) & (values >= after))
        near = np.flatnonzero(is_turning & (np.abs(values) <= reach) & (values != 0.0))
        near = near[np.diff(times)[np.clip(near, 0, len(times) - 2)] > 1e-9]
        if not len(near):
            break
        low, high = times[np.maximum(near - 1, 0)], times[np.minimum(near + 1, len(times) - 1)]
        fine = np.unique(np.linspace(low, high, 2 * parts + 1).ravel())
        fine = fine[~np.isin(fine, times)]
        order = np.argsort(np.concatenate([times, fine]))
        values = np.concatenate([values, function(fine)])[order]
        times = np.concatenate([times, fine])[order]
    return times, values


def failing(function, times, values):
    """Intervals in which a slack is negative, (k, 2), from its samples: signs by bisection to 1e-10 s."""
    times, values = refined(function, times, values)
    bad = ~(values >= 0.0)
    jumps = np.flatnonzero(bad[1:] != bad[:-1])
    low, high, first = times[jumps].copy(), times[jumps + 1].copy(), bad[jumps]
    while len(jumps) and (high - low).max() > 1e-10:
        middle = 0.5 * (low + high)
        same = ~(function(middle) >= 0.0) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    ends = 0.5 * (low + high)
    ends = np.concatenate([times[:1] if bad[0] else [], ends, times[-1:] if bad[-1] else []])
    return ends.reshape(-1, 2)


def smallest(function, times, values, candidates=3, rounds=5, parts=10):
    """Smallest value of a function of time from its samples, and ever finer ones about the lowest valleys."""
    inner = np.pad(values, 1, constant_values=np.inf)
    valleys = np.flatnonzero((values <= inner[:-2]) & (values <= inner[2:]))
    if not len(valleys) or not np.isfinite(values).all():
        return -np.inf
    places = times[valleys[np.argsort(values[valleys])[:candidates]]]
    width, lowest = np.diff(times).max(), values.min()
    for _ in range(rounds):
        fine = np.clip(places[:, None] + width * np.linspace(-1.0, 1.0, 2 * parts + 1), times[0], times[-1])
        found = function(fine.ravel()).reshape(fine.shape)
        lowest = min(lowest, found.min())
        places, width = fine[np.arange(len(fine)), found.argmin(1)], width / parts
    return lowest


@dataclasses.dataclass(frozen=True)
class Verification:
    """Smallest slack of each criterion, and the intervals (k, 2) in which one is negative, s."""

    slacks: dict
    failing: np.ndarray

    @property
    def feasible(self):
        """Every limit holds at every instant."""
        return not len(self.failing)


def verified(robot, limits, motion, samples=SAMPLES):
    """Verification of a motion from samples, refined where slacks are small."""
    verifier_ = verifier(robot, limits, motion)
    times = np.linspace(*motion.times, samples)
    values = verifier_.slacks(times)
    least = {n: smallest(lambda t, n=n: verifier_.slacks(t)[n], times, v) for n, v in values.items()}
    return Verification(least, failing(verifier_.least, times, np.min(list(values.values()), axis=0)))
