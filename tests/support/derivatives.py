"""Many robots of one pattern with all their numbers, and differences that know their own error."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

import cspr_jax
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from support.cable_robots import GRAVITY, any_robot
from support.workspaces import made

# Steps of central differences over the size of the numbers, and Neville's extrapolation from each to the next.
STEPS = 1e-2 / 4.0 ** np.arange(7)
# Differences whose own estimate of their error is larger count as none: a kink lies within their smallest step.
ESTIMATE = 1e-7


def _robot(rng, pattern, count, wheels):
    suspended = count == PATTERNS[pattern].dof and pattern in ("2T", "3T", "3R3T")
    kind = {"bounds": str(rng.choice(["equal", "mixed", "unbounded"]))}
    drawn = any_robot(rng, pattern, count, **kind, **({} if pattern == "3R" else {"suspended": suspended}))
    platform = drawn.platform
    if pattern == "3R3T" and suspended:  # near a hexapod whose cables make triangles
        angles = 2.0 * np.pi * (np.arange(6)[:, None] + [0.0, 0.5]) / 6.0
        ring = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        drawn.base[:, :2] = 2.5 * ring[[0, 0, 2, 2, 4, 4], 0] + rng.uniform(-0.3, 0.3, (6, 2))
        platform[:, :2] = 0.5 * ring[[5, 1, 1, 3, 3, 5], 0] + rng.uniform(-0.1, 0.1, (6, 2))
        platform[:, 2] = rng.uniform(-0.1, 0.1, 6)
    elif PATTERNS[pattern].is_body and pattern != "2R3T" and rng.random() < 0.7:
        # Attached on the sides of the spools, turned to and fro, so that cables hold each other.
        turn = Rotation.from_rotvec(np.outer((-1.0) ** np.arange(count), [0.0, 1.0, 0.0])).as_matrix()
        platform[:] = drawn.arm + np.einsum("kij,kj->ki", turn, 0.2 * drawn.base) + 0.1 * platform
    if pattern == "2R3T":  # else two ends would be equally far from the first point, and either could give the axes
        platform *= rng.uniform(0.8, 1.0, (count, 1))
    if pattern == "2T" and count == 2:
        drawn.base[:, 2] = drawn.base[0, 2]
    robot = cspr_jax.with_cables(made(drawn), axial_stiffness=1e4 * np.exp(rng.uniform(0.0, 3.0, count)))
    if wheels:
        axes = np.array([0.0, 0.0, 1.0]) * np.sign(drawn.base[:, 2:]) + rng.uniform(-0.4, 0.4, (count, 3))
        axes[:, 1] *= pattern not in ("2T", "1R2T")  # the plane of a planar robot
        robot = cspr_jax.with_cables(robot, pulley_radius=rng.uniform(0.02, 0.1, count), pulley_axes=axes)
    robot = dataclasses.replace(robot, limits=Limits(tension_min=drawn.low, tension_max=drawn.high))
    position, rotation = drawn.pose(rng)
    return robot, position, Rotation.from_matrix(rotation).as_quat(scalar_first=True)


def drawn(pattern, count, number, *, wheels=False, seed=0):
    """Robots of one pattern and number of cables, stacked, and their numbers with poses; all by leading axes."""
    rng = np.random.default_rng([seed, count, list(PATTERNS).index(pattern)])
    robots, positions, turns = zip(*(_robot(rng, pattern, count, wheels) for _ in range(number)), strict=True)
    robots = jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf, float) for leaf in leaves]), *robots)
    numbers = {"position": np.array(positions), "base_points": robots.base_points, "mass": robots.mass}
    numbers |= {"gravity": robots.gravity, "axial_stiffness": robots.axial_stiffness}
    numbers |= {"tension_min": robots.limits.tension_min, "tension_max": robots.limits.tension_max}
    if isinstance(robots, PlatformRobot):
        parts = ("platform_points", "centre_of_mass", "inertia")
        numbers |= {"quaternion": np.array(turns)} | {name: getattr(robots, name) for name in parts}
    if wheels:
        numbers |= {"pulley_radius": robots.pulleys.radius, "pulley_axes": robots.pulleys.axes}
    return robots, numbers


def moved(robot, numbers):
    """A robot with other numbers, its position, and its orientation or None."""
    changes = {name: value for name, value in numbers.items() if name in {f.name for f in dataclasses.fields(robot)}}
    limits = Limits(tension_min=numbers["tension_min"], tension_max=numbers["tension_max"])
    if "pulley_radius" in numbers:
        changes["pulleys"] = type(robot.pulleys)(numbers["pulley_radius"], numbers["pulley_axes"])
    return dataclasses.replace(robot, limits=limits, **changes), numbers["position"], numbers.get("quaternion")


def directions(pattern, numbers, seed=0):
    """For each kind of number a direction of the size of the numbers, along which a robot keeps its pattern."""
    rng, weight = np.random.default_rng(seed), numbers["mass"] * GRAVITY
    sizes = {"tension_min": weight, "tension_max": weight, "mass": numbers["mass"], "gravity": numbers["gravity"]}
    found = {}
    for name, value in numbers.items():
        size = sizes.get(name, np.ones(len(value)))
        if name in ("axial_stiffness", "inertia", "pulley_radius"):
            size = np.abs(value).reshape(len(value), -1).max(1)
        found[name] = rng.uniform(-1.0, 1.0, value.shape) * size.reshape(-1, *[1] * (value.ndim - 1))
    if "inertia" in found:
        found["inertia"] = found["inertia"] + found["inertia"].swapaxes(1, 2)
    kept = {"1T": [0, 0, 1], "2T": [1, 0, 1], "1R2T": [1, 0, 1]}.get(pattern, [1, 1, 1])
    for name in {"position", "base_points", "platform_points", "centre_of_mass"} & found.keys():
        found[name] = found[name] * kept
    if pattern == "2R3T":  # all attachment points stay on one line
        points = numbers["platform_points"]
        turn = np.cross(rng.uniform(-1.0, 1.0, (len(points), 1, 3)), points)
        found["platform_points"] = turn + rng.uniform(-1.0, 1.0, (*points.shape[:2], 1)) * points
    return found


@np.errstate(invalid="ignore")  # a margin may be unbounded at one end of a step
def differences(value, numbers, direction):
    """Derivatives of values (n,) along directions, by central differences, and estimates of their errors."""
    table, best = [], (np.zeros(len(direction[next(iter(direction))])), np.inf)
    for step in STEPS:
        ends = [value(jax.tree.map(lambda x, d, s=s: x + s * d, numbers, direction)) for s in (step, -step)]
        row = [(ends[0] - ends[1]) / (2.0 * step)]
        for k, before in enumerate(table[-1] if table else ()):
            row.append(row[-1] + (row[-1] - before) / (16.0 ** (k + 1) - 1.0))
        if table:
            for k in range(1, len(row)):
                error = np.maximum(np.abs(row[k] - row[k - 1]), np.abs(row[k] - table[-1][k - 1]))
                error = np.where(np.isnan(error), np.inf, error)
                best = np.where(error < best[1], row[k], best[0]), np.minimum(error, best[1])
        table.append(row)
    return best


def compared(function, robots, numbers, seed=0):
    """Largest errors of derivatives by each kind of number, the share without a kink, and the number of robots.

    The function gives an array; a random product with it, over its largest entry, is differentiated by the reverse mode
    under vmap over robots. Errors are over 1 + the largest derivative of the robot.
    """
    rng, count = np.random.default_rng(seed + 1), len(numbers["mass"])

    def values(robot, own):
        return jnp.asarray(function(*moved(robot, own)))

    at = np.asarray(jax.jit(jax.vmap(values))(robots, numbers)).reshape(count, -1)
    held = np.isfinite(at).all(1)
    robots, numbers = jax.tree.map(lambda x: x[held], (robots, numbers))
    at = at[held]
    weights = rng.uniform(-1.0, 1.0, at.shape) / np.abs(at).max(1, keepdims=True, initial=1e-12)

    def one(own, robot, weight):
        return jnp.dot(values(robot, own).reshape(-1), weight)

    each = jax.jit(jax.vmap(one))
    gradients = jax.jit(jax.vmap(jax.grad(one)))(numbers, robots, weights)
    moves = directions(robots.pattern, numbers, seed)
    flat = {name: (np.asarray(g) * moves[name]).reshape(len(at), -1).sum(1) for name, g in gradients.items()}
    scale = 1.0 + np.max([np.abs(x) for x in flat.values()], axis=0)
    errors, fraction = {}, {}
    for name in numbers:
        direction = {other: move * (other == name) for other, move in moves.items()}
        wanted, estimate = differences(lambda own: np.asarray(each(own, robots, weights)), numbers, direction)
        assert np.isfinite(flat[name]).all(), name
        known = estimate <= ESTIMATE * scale
        errors[name] = np.max(np.abs(flat[name] - wanted)[known] / scale[known], initial=0.0)
        fraction[name] = known.mean() if len(known) else 1.0
    return errors, fraction, int(held.sum())
