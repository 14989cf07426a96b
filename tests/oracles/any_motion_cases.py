"""Random motions of twelve robots for `any_motion`: about half of them break a limit, none by far."""

import dataclasses
import math

import numpy as np

from . import any_motion, sampled_motion

KINDS = ("2T-2", "2T-3", "3T-3", "3T-4", "3T-8", "1R2T-3", "1R2T-4", "3R3T-6", "3R3T-6s", "3R3T-7", "3R3T-8", "3R3T-12")
COARSE = 200
CORNERS = np.array([[1.0, 0.8, 0.0], [-1.0, 0.8, 0.0], [-1.0, -0.8, 0.0], [1.0, -0.8, 0.0]])


@dataclasses.dataclass(frozen=True)
class Case:
    """A robot, its limits, and samples of the motion of its mass centre."""

    kind: str
    robot: dict
    limits: dict
    samples: dict

    @property
    def motion(self):
        """The motion through the samples."""
        return sampled_motion.sampled(**self.samples)


def ring(count, radius, phase=0.0, z=0.0):
    """Points of a level ring, (count, 3)."""
    angle = phase + 2.0 * math.pi * np.arange(count) / count
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, z)], axis=1)


def frame(kind):
    """Unit robot, z up: spools at z = 0 or so, platform points (None: a point), reference position, half ranges."""
    pattern, count = kind.split("-")
    if pattern == "2T":
        base = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.15, 0.0, 0.3], [-0.4, 0.0, 0.25]][: int(count)]
        return np.array(base), None, [0.0, 0.0, -1.0], [0.5, 0.0, 0.4]
    if kind == "3T-3":
        return ring(3, 1.0, 0.2), None, [0.0, 0.0, -1.1], [0.3, 0.3, 0.4]
    if kind == "3T-4":
        return CORNERS, None, [0.0, 0.0, -0.7], [0.5, 0.4, 0.3]
    if kind == "3T-8":
        base = np.concatenate([CORNERS, 0.9 * ring(4, 1.0, 0.1, -1.6)])
        return base, None, [0.0, 0.0, -0.7], [0.4, 0.3, 0.3]
    if kind == "1R2T-3":
        base = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.28, 0.0, 0.13]])
        body = np.array([[-0.29, 0.0, 0.07], [-0.09, 0.0, 0.07], [0.28, 0.0, 0.03]])
        return base, body, [0.05, 0.0, -0.9], [0.2, 0.0, 0.2]
    if kind == "1R2T-4":
        base = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.2, 0.0, 0.2], [-0.4, 0.0, 0.25]])
        body = np.array([[0.2, 0.0, 0.1], [-0.2, 0.0, 0.05], [0.25, 0.0, -0.02], [-0.22, 0.0, 0.08]])
        return base, body, [0.05, 0.0, -0.9], [0.2, 0.0, 0.2]
    if kind in ("3R3T-6", "3R3T-6s"):
        # Octahedral: pairs of spools at three corners, pairs of attachments at three corners half a turn between.
        radius = 0.35 if kind == "3R3T-6" else 0.2
        base = np.repeat(ring(3, 1.0, math.pi / 2.0), 2, axis=0)
        body = ring(3, radius, math.pi / 6.0)[[0, 1, 1, 2, 2, 0]]
        return base, body, [0.0, 0.0, -1.0], [0.15, 0.15, 0.25]
    if kind == "3R3T-7":
        base = np.concatenate([np.repeat(ring(3, 1.0, math.pi / 2.0), 2, axis=0), [[0.1, -0.05, 0.3]]])
        body = np.concatenate([ring(3, 0.3, math.pi / 6.0)[[0, 1, 1, 2, 2, 0]], [[0.02, 0.01, 0.1]]])
        return base, body, [0.0, 0.0, -1.0], [0.15, 0.15, 0.25]
    # Suspended, and the twelve with four cables to the ground: attachments of crossed cables, high and low.
    box = np.array([[0.15, 0.12, 0.1], [-0.15, 0.12, 0.1], [-0.15, -0.12, 0.1], [0.15, -0.12, 0.1]])
    low = box * [1.0, 1.0, -1.0]
    base = np.repeat(CORNERS, 2, axis=0) + np.tile([[0.03, 0.0, 0.0], [0.0, 0.03, -0.05]], (4, 1))
    body = np.stack([box[[3, 0, 1, 2]], low[[1, 2, 3, 0]]], axis=1).reshape(8, 3)
    if kind == "3R3T-12":
        base = np.concatenate([base, CORNERS - [0.0, 0.0, 1.6]])
        body = np.concatenate([body, low[[1, 2, 3, 0]]])
    return base, body, [0.0, 0.0, -0.8], [0.3, 0.25, 0.2]


def random_robot(rng, kind, pulleys=False):
    """A robot of a kind, its reference position and half ranges, m."""
    base, body, reference, ranges = frame(kind)
    is_planar = kind.startswith(("2T", "1R2T"))
    size = math.exp(rng.uniform(math.log(0.5), math.log(50.0)))
    uneven = 0.03 * rng.normal(size=base.shape)
    if is_planar:
        uneven[:, 1] = 0.0
    if kind == "2T-2":
        uneven[:, 2] = 0.0  # two spools are on a level line
    base = size * (base + uneven)
    mass = math.exp(rng.uniform(math.log(0.1), math.log(500.0)))
    flip = rng.random() < 0.5 and not is_planar
    turn = np.diag([1.0, -1.0, -1.0]) if flip else np.diag([1.0, 1.0, 1.0])
    if is_planar and rng.random() < 0.5:
        turn, flip = np.diag([1.0, 1.0, -1.0]), True
    robot = {
        "base_points": base @ turn,
        "platform_points": None,
        "mass": mass,
        "inertia": None,
        "centre_of_mass": np.zeros(3),
        "gravity": 9.81,
        "pattern": kind.split("-")[0],
        "z_axis": "down" if flip else "up",
        "pulley_radius": None,
        "pulley_axes": None,
        "cable_diameter": 0.001 * size,
    }
    if body is not None:
        radii = size * np.array([0.2, 0.2, 0.25]) * rng.uniform(0.5, 1.0, 3)
        shape = np.diag(radii**2)
        if not is_planar:
            rotated = sampled_motion.rotations(rng.normal(size=(1, 4)))[0]
            shape = rotated @ shape @ rotated.T
        # An ellipsoid's inertia: tr(S) I - S is that of a body.
        robot["inertia"] = 0.2 * mass * (np.trace(shape) * np.eye(3) - shape)
        robot["centre_of_mass"] = size * 0.02 * rng.normal(size=3) * (1.0, 0.0 if is_planar else 1.0, 1.0)
        robot["platform_points"] = (size * body) @ turn
    if pulleys:
        count = len(base)
        robot["pulley_radius"] = size * rng.uniform(0.005, 0.04, count)
        axes = np.tile([0.0, 0.0, 1.0], (count, 1)) + 0.2 * rng.normal(size=(count, 3)) * (not is_planar)
        robot["pulley_axes"] = axes / np.linalg.norm(axes, axis=1)[:, None] @ turn
    return robot, size * (turn @ reference), size * np.array(ranges), size


def waves(rng, times, count):
    """Sums of two waves and their first two derivatives, (n, 3, count): values within -1 to 1."""
    period = times[-1] - times[0]
    values = np.zeros((len(times), 3, count))
    for fraction in (0.6, 0.4):
        frequency = 2.0 * math.pi * rng.uniform(0.3, 1.5, count) / period
        angle = frequency * (times[:, None] - times[0]) + rng.uniform(0.0, 2.0 * math.pi, count)
        turns = (np.sin(angle), frequency * np.cos(angle), -(frequency**2) * np.sin(angle))
        values += fraction * np.stack(turns, axis=1)
    return values


def random_samples(rng, robot, reference, ranges, size, duration):
    """Samples of a motion that lasts a time."""
    is_planar = robot["pattern"] in ("2T", "1R2T")
    interpolation = rng.choice(["cubic", "quintic", "hermite", "hermite"])
    count = int(rng.choice([2, 4, 6, 9, 14, 40, 150])) if interpolation != "hermite" else int(rng.integers(3, 12))
    # Two samples do not give other splines a motion.
    is_free = count > 2 and interpolation != "hermite"
    ends = str(rng.choice(["rest", "natural", "periodic"])) if is_free else "rest"
    steps = np.cumsum(rng.uniform(0.6, 1.4, count - 1)) if rng.random() < 0.5 else np.arange(1.0, count)
    times = rng.choice([0.0, 0.7]) + duration * np.concatenate([[0.0], steps]) / steps[-1]
    if count >= 40 or interpolation == "hermite":
        shifts, turns = waves(rng, times, 3), waves(rng, times, 4)
    else:
        shifts, turns = (np.zeros((count, 3, n)) for n in (3, 4))
        shifts[:, 0], turns[:, 0] = rng.uniform(-1.0, 1.0, (count, 3)), rng.uniform(-1.0, 1.0, (count, 4))
    shifts, turns = shifts * ranges * rng.choice([0.3, 0.6, 1.0, 1.5]), 0.12 * turns
    shifts[:, 0] += reference
    turns[:, 0, 0] += 1.0
    if is_planar:
        turns[:, :, [1, 3]] = 0.0
    if ends == "periodic":
        shifts[-1], turns[-1] = shifts[0], turns[0]
    samples = {"times": times, "positions": shifts[:, 0], "interpolation": str(interpolation), "ends": ends}
    if interpolation == "hermite":
        orders = slice(1, 2 + int(rng.random() < 0.5))
        samples["rates"] = shifts[:, orders]
    if robot["platform_points"] is not None:
        samples["quaternions"] = turns[:, 0] * rng.choice([1.0, 1.0, 1.0, -1.0], (count, 1))
    return samples


def random_limits(rng, robot, motion):
    """Limits near what a motion needs; all are there, so that the kernels of a kind of robot are compiled once."""
    times = np.linspace(*motion.times, COARSE)
    state = motion.state(times)
    found = any_motion.cables(robot, state)
    matrix, wrench = any_motion.balance(robot, state, found)
    count, weight = len(robot["base_points"]), robot["mass"] * robot["gravity"]
    dof = matrix.shape[1]

    def room(part):
        """Return an excess of a limit over what is needed: small, of either sign; or so large that it is none."""
        wide = rng.uniform(0.02, 0.6) * part
        return rng.choice([-0.4 * wide, wide, 50.0 * part], p=[0.15, 0.45, 0.4])

    if count == dof:
        f = any_motion.tensions(matrix, wrench)
        spread = weight / count
        least = max(0.0, f.min() - room(0.3 * spread))
        largest = max(least + spread, f.max() + room(spread))
    else:
        hi = rng.uniform(0.8, 2.0) * weight
        s = any_motion.Centring(np.zeros(count), np.full(count, hi)).largest(matrix, wrench).min()
        inset = s - rng.choice([-0.03, 0.03, 0.06], p=[0.2, 0.4, 0.4]) * weight * rng.random()
        least = max(0.0, inset)
        largest = max(hi - inset, least + 0.1 * weight)
    limits = {"tension_min": least * (1.0 + 0.02 * rng.random(count)), "tension_max": np.full(count, largest)}
    demands = {
        "cable_length_max": found.lengths.max(),
        "cable_speed_max": np.abs(found.rates).max(),
        "cable_acceleration_max": np.abs(found.accelerations).max(),
    }
    for name, demand in demands.items():
        limits[name] = np.full(count, demand + room(0.5 * demand))
    sign = 1.0 if robot["z_axis"] == "down" else -1.0
    limits["floor"] = sign * ((sign * state.position[:, 2]).max() + room(0.2 * np.ptp(state.position[:, 2])))
    return limits


def swivels(robot, state):
    """Whether attachments stay away from the axes of their pulleys, at which these flip over."""
    attachments = any_motion.cables({**robot, "pulley_radius": None}, state).attachments
    away = attachments - robot["base_points"]
    axes = robot["pulley_axes"]
    across = away - np.sum(away * axes, axis=2)[..., None] * axes
    return (np.linalg.norm(across, axis=2) > 3.0 * robot["pulley_radius"]).all()


def random_case(rng, pulleys=False, kind=None):
    """A random case; some robots have pulleys where they may."""
    kind = str(rng.choice(KINDS)) if kind is None else kind
    robot, reference, ranges, size = random_robot(rng, kind, pulleys and rng.random() < 0.5)
    samples = random_samples(rng, robot, reference, ranges, size, 1.0)
    motion = sampled_motion.sampled(**samples)
    times = np.linspace(*motion.times, COARSE)
    quick = np.linalg.norm(motion.state(times).acceleration, axis=1).max()
    # In a time k as long: accelerations are 1 / k^2 of these. None is above the share of gravity drawn.
    fraction = rng.choice([rng.uniform(0.02, 0.4), rng.uniform(0.4, 2.0)], p=[0.9, 0.1])
    k = math.sqrt(quick / (fraction * robot["gravity"]))
    samples["times"] = samples["times"] * k
    if "rates" in samples:
        samples["rates"] = samples["rates"] / k ** np.arange(1, 1 + samples["rates"].shape[1])[:, None]
    motion = sampled_motion.sampled(**samples)
    if robot["pulley_radius"] is not None and not swivels(robot, motion.state(np.linspace(*motion.times, COARSE))):
        robot["pulley_radius"] = robot["pulley_axes"] = None
    return Case(kind, robot, random_limits(rng, robot, motion), samples)
