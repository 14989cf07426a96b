"""Reference for the fastest motion there is between two poses at zero velocity, by direct collocation and ipopt.

The mass centre's acceleration, and the second derivative of a Gibbs vector r of rotations, are straight in time between
N + 1 nodes: positions are cubics with continuous accelerations, whose second differences are exact. In the quaternion
(1, r) q_0, q_0 is the mean of both ends. Tensions at the nodes, and at places between them, are unknowns of their own,

    W f = (m (a - g), I alpha + omega x I omega),    lo <= f <= hi,

so that cables may be more than degrees of freedom. Limits hold at these places, with room where samples between break
them. With ever more nodes T falls to the infimum of all motions: accelerations may jump there, and those at the ends
cost nothing. Robots, limits and states are those of `any_motion`, but for pulleys. casadi is imported where it is used.
"""

import dataclasses
import math

import numpy as np

from . import any_motion, least_time_bounds, least_time_forms, path_rows, sampled_motion

SHARES = (0.0, 0.5)
# Powers in which values are bounded.
BOUNDED = {"cable_speed_max": 1, "cable_acceleration_max": 1, "speed_max": 2, "acceleration_max": 2}
TOUCH = 3e-7  # by which limits may be broken, over their size
NEAREST = 0.01  # to the plane of the spools, over their spread
OPTIONS = {"print_level": 0, "sb": "yes", "max_iter": 600, "tol": 1e-9}
EASES = (4.0, 2.0, 1.4, 1.0)
TURNED = {"2T": [], "3T": [], "1R2T": [1], "3R3T": [0, 1, 2]}


@dataclasses.dataclass(frozen=True)
class Pose:
    """Position of the mass centre (3,) and, of a body, its unit quaternion (4,)."""

    position: np.ndarray
    quaternion: np.ndarray = (1.0, 0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Answer:
    """Least time that was met, s, and its motion; infinite, and None, where there was none.

    nodes: (3, N + 1, d) coordinates and their derivatives. starts: times from all starts, on the first mesh, s.
    meshes: times of the best one on each mesh, s, before room was made.
    """

    time: float
    motion: sampled_motion.Motion | None
    nodes: np.ndarray
    starts: tuple
    meshes: tuple

    @property
    def infimum(self):
        """Time on ever finer meshes, from the last two, of which one has twice as many steps: errors fall as h^2."""
        return self.meshes[-1] + (self.meshes[-1] - self.meshes[-2]) / 3.0


def product(a, b):
    """Product of quaternions (..., 4)."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    w = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    return np.concatenate([w, a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])], -1)


def middle(start, end):
    """Mean q_0 of two orientations, (4,), and their Gibbs vectors about it, (2, 3)."""
    both = sampled_motion.signed(np.array([start.quaternion, end.quaternion], float))
    mean = both.sum(0) / np.linalg.norm(both.sum(0))
    rotated = product(both, mean * [1.0, -1.0, -1.0, -1.0])
    return mean, rotated[:, 1:] / rotated[:, :1]


def coordinates(robot):
    """Numbers of the coordinates that move, of x, y, z and the Gibbs vector."""
    return [k for k in any_motion.ROWS[robot["pattern"]] if k < 3] + [3 + k for k in TURNED[robot["pattern"]]]


def demands(robot, mean):
    """Function of casadi: q, q', q'' (d,) and tensions (n,) -> residual of the balance over its size, lengths' two
    derivatives (n,), speed and acceleration squared, depth below the plane of the spools.
    """
    import casadi as ca

    moving, dof = coordinates(robot), len(any_motion.ROWS[robot["pattern"]])
    n, body = len(robot["base_points"]), robot["platform_points"]
    values = [ca.SX.sym(name, len(moving)) for name in ("q", "v", "a")]
    tensions = ca.SX.sym("f", n)
    whole = [ca.SX.zeros(6) for _ in values]
    for part, value in zip(whole, values, strict=True):
        for k, number in enumerate(moving):
            part[number] = value[k]
    (p, v, a), (r, r1, r2) = ([part[s] for part in whole] for s in (slice(0, 3), slice(3, 6)))
    # 2 vec(q' q*) / |q|^2 of q = (1, r): its real part is r . r', and the imaginary one r' - r' x r.
    square = 1.0 + ca.dot(r, r)
    omega = 2.0 * (r1 - ca.cross(r1, r)) / square
    alpha = 2.0 * (r2 - ca.cross(r2, r)) / square - omega * 2.0 * ca.dot(r, r1) / square
    turn = ca.SX.eye(3) + 2.0 * (ca.skew(r) + ca.skew(r) @ ca.skew(r)) / square
    turn = turn @ ca.DM(sampled_motion.rotations(np.array([mean]))[0])
    force = robot["mass"] * (a - ca.DM(any_motion.gravity(robot)))
    moment, size = ca.SX.zeros(3), 1.0
    arms = np.zeros((n, 3))
    if body is not None:
        arms = np.asarray(body, float) - robot["centre_of_mass"]
        inertia = turn @ ca.DM(np.asarray(robot["inertia"], float)) @ turn.T
        moment = inertia @ alpha + ca.cross(omega, inertia @ omega)
        size = np.linalg.norm(arms, axis=1).max()
    rates, bends = [], []
    for k in range(n):
        arm = turn @ ca.DM(arms[k])
        d = p + arm - ca.DM(robot["base_points"][k])
        turning = ca.cross(omega, arm)
        d1, d2 = v + turning, a + ca.cross(alpha, arm) + ca.cross(omega, turning)
        length = ca.norm_2(d)
        rate = ca.dot(d, d1) / length
        rates.append(rate)
        bends.append((ca.dot(d1, d1) + ca.dot(d, d2) - rate**2) / length)
        pull = -tensions[k] * d / length
        force, moment = force - pull, moment - ca.cross(arm, pull)
    left = ca.vertcat(force, moment / size)[any_motion.ROWS[robot["pattern"]]]
    left = left / (robot["mass"] * robot["gravity"])
    normal, level = plane(robot)
    outs = [left, ca.vertcat(*rates), ca.vertcat(*bends), ca.dot(v, v), ca.dot(a, a), ca.dot(ca.DM(normal), p) - level]
    assert left.numel() == dof
    return ca.Function("demands", [*values, tensions], outs)


def plane(robot):
    """Unit normal (3,), with gravity, and level of the plane through two or three spools."""
    base, down = np.asarray(robot["base_points"], float), np.sign(any_motion.gravity(robot))
    across = [0.0, 1.0, 0.0] if robot["pattern"] in ("2T", "1R2T") else base[2] - base[0]
    normal = np.cross(base[1] - base[0], across)
    normal *= np.sign(normal @ down) / np.linalg.norm(normal)
    return normal, normal @ base[0]


def stays_below(robot):
    """Whether motions have to stay below the plane of the spools: of point masses on as many cables as it takes."""
    return robot["platform_points"] is None and len(robot["base_points"]) == len(any_motion.ROWS[robot["pattern"]])


class Transcription:
    """The problem on some steps: unknowns T, coordinates and their two derivatives at nodes, tensions at places."""

    def __init__(self, robot, limits, start, end, steps, accelerations=(None, None)):
        import casadi as ca

        self.steps, self.moving = steps, coordinates(robot)
        self.mean, turns = middle(start, end)
        self.ends = [np.concatenate([s.position, r])[self.moving] for s, r in zip((start, end), turns, strict=True)]
        at = np.append(np.repeat(np.arange(steps), len(SHARES)), steps - 1)
        s = np.append(np.tile(SHARES, steps), 1.0)
        self.places, d, n = (at + s) / steps, len(self.moving), len(robot["base_points"])
        time = ca.MX.sym("T")
        q, v, a, f = unknowns = [ca.MX.sym("x", d, steps + 1) for _ in range(3)] + [ca.MX.sym("f", n, len(at))]
        h = time / steps
        g = [q[:, 1:] - q[:, :-1] - h * v[:, :-1] - h**2 * (2.0 * a[:, :-1] + a[:, 1:]) / 6.0]
        g += [v[:, 1:] - v[:, :-1] - 0.5 * h * (a[:, :-1] + a[:, 1:])]
        g += [q[:, 0] - self.ends[0], q[:, -1] - self.ends[1], v[:, 0], v[:, -1]]
        g += [a[:, -k] - np.asarray(x)[self.moving] for k, x in enumerate(accelerations) if x is not None]
        s = ca.DM(np.tile(s, (d, 1)))
        q, v, a, after = q[:, at], v[:, at], a[:, at], a[:, at + 1]
        inner = (
            q + h * s * v + h**2 * (s**2 * a / 2.0 + s**3 * (after - a) / 6.0),
            v + h * (s * a + s**2 * (after - a) / 2.0),
            a + s * (after - a),
        )
        left, *values = demands(robot, self.mean).map(len(at))(*inner, f)
        g.append(left)
        self.zeros, self.most = np.zeros(sum(x.numel() for x in g)), []
        for (name, power), value in zip(BOUNDED.items(), values[:4], strict=True):
            if limits.get(name) is not None:
                most = np.broadcast_to(limits[name], value.shape[0]) ** power
                g.append(ca.DM(np.diag(1.0 / most)) @ value)
                self.most.append((power, len(most)))
        self.below = np.full(len(at) if stays_below(robot) else 0, NEAREST * np.ptp(robot["base_points"], axis=0).max())
        g += [values[4]] * stays_below(robot)
        self.tensions = path_rows.tension_range(robot, limits)
        self.weight = robot["mass"] * robot["gravity"]
        problem = {"x": ca.vertcat(time, *map(ca.vec, unknowns)), "f": time, "g": ca.vertcat(*map(ca.vec, g))}
        self.solver = ca.nlpsol("solver", "ipopt", problem, {"print_time": False, "ipopt": OPTIONS})

    def solved(self, time, nodes, tensions=None, room=0.0, ease=1.0):
        """T, infinite where the solver fails, nodes (3, N + 1, d), and tensions (places, n), from others."""
        room, free = np.broadcast_to(room, len(self.places)), np.full(nodes.size, np.inf)
        low, high = (x + s * self.weight * room[:, None] for x, s in zip(self.tensions, (1.0, -1.0), strict=True))
        most = np.concatenate([self.zeros, *(np.repeat((ease - room) ** p, n) for p, n in self.most)])
        bounds = {
            "lbx": np.concatenate([[1e-3], -free, low.ravel()]),
            "ubx": np.concatenate([[np.inf], free, ease * high.ravel()]),
            "lbg": np.concatenate([-most, self.below]),
            "ubg": np.concatenate([most, np.inf * self.below]),
        }
        if tensions is None:
            tensions = np.clip(self.weight / low.shape[1], low, high)
        x = np.concatenate([[time], nodes.ravel(), tensions.ravel()])
        x = np.asarray(self.solver(x0=x, **bounds)["x"]).ravel()
        count = 1 + nodes.size
        time = x[0] if self.solver.stats()["success"] else math.inf
        return time, x[1:count].reshape(nodes.shape), x[count:].reshape(len(self.places), -1)

    def eased(self, time, nodes):
        """The same, where it fails by limits that are ever less easy."""
        best = self.solved(time, nodes)
        if not math.isfinite(best[0]):
            best = time, nodes, None
            for ease in EASES:
                if math.isfinite(best[0]):
                    best = self.solved(*best, ease=ease)
        return best

    def finer(self, other, time, nodes, tensions):
        """Nodes and tensions of another number of steps, from those of this one."""
        times, spline = time * np.linspace(0.0, 1.0, other.steps + 1), cubics(time, nodes)
        made = np.stack([spline(times, order) for order in range(3)])
        return made, np.stack([np.interp(other.places, self.places, f) for f in tensions.T], axis=1)


def cubics(time, nodes):
    """Spline of nodes (3, N + 1, d) in a time."""
    q, v, a = nodes
    h = time / (len(q) - 1)
    return sampled_motion.Spline(
        np.linspace(0.0, time, len(q)), np.stack([q[:-1], v[:-1], 0.5 * a[:-1], np.diff(a, axis=0) / (6.0 * h)], axis=1)
    )


def integrated(robot, start, end, time, accelerations):
    """Nodes of accelerations (N + 1, d) of the coordinates, from the start at zero velocity."""
    a, h = np.asarray(accelerations, float), time / (len(accelerations) - 1)
    first = np.append(start.position, middle(start, end)[1][0])[coordinates(robot)]
    v = np.concatenate([0.0 * a[:1], np.cumsum(0.5 * h * (a[1:] + a[:-1]), axis=0)])
    steps = h * v[:-1] + h**2 * (2.0 * a[:-1] + a[1:]) / 6.0
    return np.stack([first + np.concatenate([0.0 * a[:1], np.cumsum(steps, axis=0)]), v, a])


def motion(robot, start, end, time, nodes):
    """The motion of nodes, for any verifier."""
    spline, moving = cubics(time, nodes), coordinates(robot)
    whole = np.zeros((*spline.coefficients.shape[:2], 6))
    whole[:, 0, :3] = start.position
    whole[..., moving] = spline.coefficients
    rotated = None
    if robot["platform_points"] is not None:
        quaternions = np.concatenate([np.zeros_like(whole[..., :1]), whole[..., 3:]], axis=2)
        quaternions[:, 0, 0] = 1.0
        rotated = sampled_motion.Spline(spline.knots, product(quaternions, middle(start, end)[0]))
    return sampled_motion.Motion(sampled_motion.Spline(spline.knots, whole[..., :3]), rotated)


def starts(robot, problem, count, rng):
    """First times and nodes: a line, swings of 1 to 3 arcs about the point under the spools, and lines that bend."""
    tau = np.linspace(0.0, 1.0, problem.steps + 1)[:, None]
    first, last = problem.ends
    blend = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
    under = np.append(np.mean(robot["base_points"], axis=0), np.zeros(3))[problem.moving]
    level = problem.moving.index(2)
    depth, under[level] = 0.5 * abs(first + last - 2.0 * under)[level], 0.5 * (first + last)[level]
    pace = math.sqrt(depth / robot["gravity"])
    for number in range(count):
        time, line = 2.0 * pace, first + blend * (last - first)
        if 0 < number < 4:
            away = (1.0 - blend) * (first - under) + blend * (-1.0) ** number * (last - under)
            time, line = math.pi * number * pace, under + away * np.cos(math.pi * number * tau)
        elif number:
            widths = np.where(np.array(problem.moving) < 3, 0.5 * depth, 0.1)
            time, waves = rng.uniform(1.5, 8.0) * pace, np.arange(1, rng.integers(2, 5))
            bends = np.sin(math.pi * tau) * np.sin(math.pi * waves * tau) / waves
            line = line + bends @ (widths * rng.normal(size=(len(waves), len(first))))
        times = time * tau[:, 0]
        spline = sampled_motion.spline(times, line)
        yield time, np.stack([spline(times, order) for order in range(3)])


def least_time(robot, limits, start, end, steps=(30, 60), count=8, seed=0, accelerations=(None, None), rounds=8):
    """Least time between two poses at zero velocity, from several starts: an `Answer`."""
    size = max(np.linalg.norm(np.asarray(p.position) - np.mean(robot["base_points"], axis=0)) for p in (start, end))
    scale = least_time_forms.Scale(1.0 / size, 1.0 / robot["mass"])
    small, tight = scale.robot(robot), scale.limits(limits)
    ends = [Pose(np.asarray(p.position, float) / size, p.quaternion) for p in (start, end)]
    given = [None if x is None else np.asarray(x, float) * np.repeat([1.0, size], 3) for x in accelerations]
    problem, rng = Transcription(small, tight, *ends, steps[0], given), np.random.default_rng(seed)
    made = [problem.eased(*first) for first in starts(small, problem, count, rng)]
    best, room = min(made, key=lambda answer: answer[0]), 0.0
    meshes = [best[0]]
    for number in steps[1:] if math.isfinite(best[0]) else ():
        coarse, problem = problem, Transcription(small, tight, *ends, number, given)
        best = problem.solved(best[0], *coarse.finer(problem, *best))
        meshes.append(best[0])
    for _ in range(rounds):
        if not math.isfinite(best[0]):
            break
        broken = breaches(small, tight, motion(small, *ends, *best[:2]), len(problem.places))
        if broken.max() < TOUCH:
            break
        room = room + 1.5 * broken
        best = problem.solved(*best, room)
    pace, unit = 1.0 / scale.time, np.where(np.array(problem.moving) < 3, size, 1.0)
    nodes = best[1] * unit / pace ** np.arange(3.0)[:, None, None]
    moved = motion(robot, start, end, pace * best[0], nodes) if math.isfinite(best[0]) else None
    return Answer(pace * best[0], moved, nodes, tuple(pace * x[0] for x in made), tuple(pace * x for x in meshes))


def breaches(robot, limits, moved, places, inner=10):
    """By how much limits are broken between places and their neighbours, (places,): over the weight, or the limit."""
    times = np.linspace(*moved.times, inner * (places - 1) + 1)
    broken = np.zeros(len(times))
    for name, slack in least_time_bounds.slacks(robot, limits, moved, times).items():
        unit = robot["mass"] * robot["gravity"] if name == "tension" else np.min(limits[name])
        broken = np.maximum(broken, -slack / unit)
    halves = np.maximum(broken[:-1].reshape(-1, inner).max(1), broken[1:].reshape(-1, inner).max(1))
    return np.maximum(np.append(halves, 0.0), np.append(0.0, halves))
