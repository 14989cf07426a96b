"""Random paths of ten robots with limits that bind, inside the footprint and partly outside, the same for a seed."""

import dataclasses

import numpy as np
from scipy.optimize import linprog

from . import any_motion_cases, least_time, least_time_bounds, path_rows

KINDS = ("2T-2", "2T-3", "2T-4", "3T-3", "3T-4", "3T-8", "1R2T-4", "3R3T-6", "3R3T-7", "3R3T-8")
TILT = 0.1
# What limits are drawn as, of what the least time under limits of tensions needs: some bind, some do not.
SHARES = {
    "cable_speed_max": (0.4, 1.1),
    "cable_acceleration_max": (0.6, 1.2),
    "speed_max": (0.4, 1.1),
    "acceleration_max": (0.5, 1.1),
}


@dataclasses.dataclass(frozen=True)
class Case:
    """A robot, its limits, and a path of its mass centre, in the axes of the robot's base points."""

    kind: str
    robot: dict
    limits: dict
    path: path_rows.Path


def least_tension(matrix, wrench):
    """Largest tension that all cables can have at least, at one place; -inf if there is no balance."""
    dof, n = matrix.shape
    cost = np.append(np.zeros(n), -1.0)
    above = np.concatenate([-np.eye(n), np.ones((n, 1))], axis=1)
    equal = np.concatenate([matrix, np.zeros((dof, 1))], axis=1)
    answer = linprog(cost, above, np.zeros(n), equal, wrench, [(None, None)] * (n + 1), method="highs")
    return np.inf if answer.status == 3 else (answer.x[-1] if answer.status == 0 else -np.inf)


def largest_tension(matrix, wrench, low):
    """Least of the largest tensions with every cable at `low` at least, at one place; inf if there is no balance."""
    dof, n = matrix.shape
    cost = np.append(np.zeros(n), 1.0)
    below = np.concatenate([np.eye(n), -np.ones((n, 1))], axis=1)
    equal = np.concatenate([matrix, np.zeros((dof, 1))], axis=1)
    answer = linprog(cost, below, np.zeros(n), equal, wrench, [*([(low, None)] * n), (None, None)], method="highs")
    return answer.x[-1] if answer.status == 0 else np.inf


def tension_limits(rng, robot, path, places=15):
    """Limits of tensions between which the robot rests with some room along the path, if it can."""
    balance = path_rows.balance(robot, path.at(np.linspace(0.0, path.length, places)))
    weight, n = robot["mass"] * robot["gravity"], len(robot["base_points"])
    pairs = list(zip(balance.matrix, balance.c / weight, strict=True))
    least = min(least_tension(*pair) for pair in pairs)
    # Cables to the ground could be pulled as hard as one likes.
    low = rng.uniform(0.1, 0.8) * min(least, 0.3) if least > 0.0 else rng.choice([0.0, 0.01])
    needs = np.array([largest_tension(*pair, low) for pair in pairs])
    high = rng.uniform(1.1, 2.0) * max(np.max(needs, initial=0.5, where=np.isfinite(needs)), low)
    uneven = 1.0 + 0.02 * rng.random(n)
    return {"tension_min": weight * low / uneven, "tension_max": weight * high * uneven}


def demands(robot, limits, path):
    """Largest speeds and accelerations of the least time under limits of tensions, or guesses."""
    solution = least_time.solved(least_time.problem(robot, limits, path, 60))
    g, size = robot["gravity"], np.ptp(np.asarray(robot["base_points"]), axis=0).max()
    if solution.verdict != "feasible":
        quick = 0.5 * np.sqrt(g * size)
        return dict.fromkeys(("cable_speed_max", "speed_max"), quick) | dict.fromkeys(
            ("cable_acceleration_max", "acceleration_max"), 0.8 * g
        )
    motion = least_time_bounds.Timed(path, solution.nodes, solution.x)
    state = motion.state(np.linspace(*motion.times, 300))
    s, speed, u = motion.progress(np.linspace(*motion.times, 300))
    _, rate, second_derivative = path_rows.lengths(robot, path.at(s))
    return {
        "cable_speed_max": np.abs(rate * speed[:, None]).max(),
        "cable_acceleration_max": np.abs(rate * u[:, None] + second_derivative * speed[:, None] ** 2).max(),
        "speed_max": np.linalg.norm(state.velocity, axis=1).max(),
        "acceleration_max": np.linalg.norm(state.acceleration, axis=1).max(),
    }


def random_path(rng, robot, reference, ranges, size, outside):
    """A smooth path through a few poses; outside: with way-points beyond the spools."""
    count = int(rng.integers(3, 7))
    spread = rng.uniform(0.3, 0.8)
    points = reference + spread * ranges * rng.uniform(-1.0, 1.0, (count, 3))
    if outside:
        away = rng.normal(size=3) * (ranges > 0.0) * (1.0, 1.0, 0.0)
        away /= np.linalg.norm(away)
        is_platform = robot["platform_points"] is not None
        points[1:-1] += size * rng.uniform(0.3, 0.7 if is_platform else 1.1) * away
    turns = None
    if robot["platform_points"] is not None:
        turns = np.concatenate([np.ones((count, 1)), TILT * rng.uniform(-1.0, 1.0, (count, 3))], axis=1)
        if robot["pattern"] == "1R2T":
            turns[:, [1, 3]] = 0.0
    return path_rows.through(points, turns, str(rng.choice(["cubic", "quintic"])))


def case(kind, seed, outside=False):
    """The case of a kind and a seed."""
    rng = np.random.default_rng([seed, KINDS.index(kind), int(outside)])
    robot, *frame = any_motion_cases.random_robot(rng, kind)
    path = random_path(rng, robot, *frame, outside)
    limits = tension_limits(rng, robot, path)
    needs = demands(robot, limits, path)
    for name, (least, most) in SHARES.items():
        fraction, is_drawn = rng.uniform(least, most), rng.random() < 0.4
        if is_drawn:
            limits[name] = float(fraction * needs[name])
    return Case(kind, robot, limits, path)
