"""Random motions that keep every condition, and their checks with limits near an extreme, for tests of decisions."""

import contextlib
import dataclasses
import time
from collections.abc import Iterator, Sequence

import numpy as np
from oracles import exact_motions as oracle

import cspr_jax

SHARES = (1e-6, -1e-6, 1e-9, -1e-9, 1e-12, -1e-12, 1e-14, -1e-14, 1e-15, -1e-15)
# Every limit, so far off that none is broken: which limits there are is known when a function is compiled.
LOOSE = {
    "tension_max": 1e6,
    "tension_min": 1e-6,
    "cable_length_max": 1e4,
    "cable_speed_max": 1e4,
    "cable_acceleration_max": 1e5,
    "speed_max": 1e4,
    "acceleration_max": 1e5,
}
# Seconds of the checks that were counted, for reports.
SECONDS: list[float] = []


@dataclasses.dataclass(frozen=True)
class Case:
    """A robot and a motion, as `check` takes them.

    Fields:
        robot: of the package.
        samples: arguments of `check` but for the robot and the limits.
    """

    robot: object
    samples: dict

    def checked(self, **limits):
        """A check with limits."""
        begin = time.perf_counter()
        check = cspr_jax.check(self.robot, **self.samples, limits=limits or None)
        SECONDS.append(time.perf_counter() - begin)
        return check

    @property
    def n_cables(self) -> int:
        """Number of cables."""
        return len(np.asarray(self.robot.base_points))

    def loose(self, quantity: str) -> dict:
        """Limits that nothing breaks; a floor only where it is asked about."""
        floor = self.robot_floor if quantity == "depth" else {}
        return {name: self._each(name, limit) for name, limit in LOOSE.items()} | floor

    @property
    def robot_floor(self) -> dict:
        """A floor far below."""
        return {"floor": 1e3 if self.robot.z_axis == "down" else -1e3}

    def _each(self, name: str, limit: float):
        return limit if name in ("speed_max", "acceleration_max") else [limit] * self.n_cables

    def with_limit(self, quantity: str, limit: float, cable: int, only: bool = False):
        """A check with one limit, of one cable if the quantity belongs to cables; the others are loose, or absent."""
        name, limits = oracle.LIMIT_OF[quantity], self.loose(quantity)
        if quantity in oracle.OF_EACH_CABLE:
            limits[name][cable] = limit
        elif quantity == "depth":
            limits[name] = self.floor_of(limit)
        else:
            limits[name] = limit
        return self.checked(**({name: limits[name]} if only else limits))

    def floor_of(self, depth: float) -> float:
        """Floor in the axes of the robot file at a depth below the centroid of the spools."""
        middle = float(np.asarray(self.robot.base_points)[:, 2].mean())
        return middle + depth if self.robot.z_axis == "down" else middle - depth


def wrong_verdicts(
    case: Case, quantity: str, cable: int, extreme: oracle.Extreme, shares: Sequence[float] = SHARES, only: bool = False
) -> Iterator[dict | None]:
    """What is wrong with the verdict of each of many limits near an extreme: None where nothing is."""
    allowance = None
    if quantity == "depth":
        allowance = oracle.floor_allowance(case.checked().plan.problem.robot.base_points)
    for limit in oracle.near_limits(extreme.square, quantity, shares, allowance):
        check = case.with_limit(quantity, limit, cable, only)
        # A floor is shifted to the axes of the kernels, and rounded.
        taken = float(check.plan.problem.limits.floor) if quantity == "depth" else limit
        is_kept = oracle.keeps(extreme.square, taken, quantity, allowance)
        expected = "feasible" if is_kept else oracle.FLAG_OF[quantity]
        row = {"quantity": quantity, "cable": cable, "limit": limit, "verdict": check.verdict, "expected": expected}
        yield row if check.verdict != expected else None


def ring(rng: np.random.Generator, count: int) -> np.ndarray:
    """Spools about a vertical, no two at one azimuth, from their centroid."""
    azimuth = 2.0 * np.pi * (np.arange(count) + rng.uniform(-0.25, 0.25, count)) / count + rng.uniform(0.0, 6.0)
    base = np.stack([np.cos(azimuth), np.sin(azimuth), 0.1 * rng.normal(size=count)], axis=1)
    return base - base.mean(0)


def samples_of(rng: np.random.Generator, positions: np.ndarray) -> dict:
    """Arguments of `check`: a cubic, a quintic or Hermite pieces through positions."""
    count = len(positions)
    times = np.cumsum(rng.uniform(0.8, 1.4, count))
    samples = {"times": times - times[0], "positions": positions}
    kind = str(rng.choice(["cubic", "quintic", "hermite", "hermite with accelerations"]))
    if kind in ("cubic", "quintic"):
        return samples | {"interpolation": kind}
    level = np.ones(3) if positions[:, 1].any() else np.array([1.0, 0.0, 1.0])
    level = level if positions[:, 0].any() else np.array([0.0, 0.0, 1.0])
    samples |= {"velocities": 0.1 * rng.normal(size=(count, 3)) * level, "interpolation": "hermite"}
    if kind == "hermite":
        return samples
    return samples | {"accelerations": 0.1 * rng.normal(size=(count, 3)) * level}


def placed(rng: np.random.Generator, base: np.ndarray, positions: np.ndarray, moved: np.ndarray):
    """Spools and positions away from the origin, of a robot whose z axis points down or up."""
    turn = np.diag([1.0, -1.0, -1.0]) if rng.random() < 0.5 else np.eye(3)
    axis = "down" if turn[2, 2] > 0.0 else "up"
    return base @ turn + moved, positions @ turn + moved, axis


def point_mass_case(seed: int, count: int = 3, samples: int = 6) -> Case:
    """A point mass on cables in space, within its static workspace for the most part."""
    rng = np.random.default_rng([seed, count])
    base = ring(rng, count)
    weights = rng.dirichlet(np.full(count, 3.0), samples)
    positions = weights @ base
    positions[:, 2] = rng.uniform(1.0, 2.0, samples)
    base, positions, axis = placed(rng, base, positions, rng.normal(size=3))
    robot = cspr_jax.point_mass(
        base, mass=float(np.exp(rng.uniform(-2.0, 2.0))), gravity=float(rng.uniform(9.0, 10.0)), z_axis=axis
    )
    return Case(robot, samples_of(rng, positions))


def planar_case(seed: int, samples: int = 6) -> Case:
    """A point mass on two cables in the plane y = 0."""
    rng = np.random.default_rng([seed, 2])
    half = rng.uniform(0.8, 1.5)
    base = np.array([[half, 0.0, 0.0], [-half, 0.0, 0.0]])
    positions = np.stack([rng.uniform(-0.5, 0.5, samples), np.zeros(samples), rng.uniform(1.0, 2.0, samples)], 1)
    base, positions, axis = placed(rng, base, positions, rng.normal(size=3) * [1.0, 0.0, 1.0])
    robot = cspr_jax.point_mass(base, mass=float(rng.uniform(0.5, 3.0)), planar=True, z_axis=axis)
    return Case(robot, samples_of(rng, positions))


def guided_case(seed: int, samples: int = 6) -> Case:
    """A point mass on a vertical guide, on one cable."""
    rng = np.random.default_rng([seed, 1])
    positions = np.stack([np.zeros(samples), np.zeros(samples), rng.uniform(1.0, 2.0, samples)], axis=1)
    robot = cspr_jax.point_mass([[0.0, 0.0, 0.0]], mass=float(rng.uniform(0.5, 3.0)), pattern="1T")
    return Case(robot, samples_of(rng, positions))


def hexapod(rng: np.random.Generator):
    """A platform on six cables, its spools and attachment points in pairs but for a few centimetres."""
    corner = 2.0 * np.pi * np.arange(3) / 3.0
    spools, body = corner + np.pi / 2.0, corner + np.pi / 6.0
    base = np.repeat(np.stack([np.cos(spools), np.sin(spools), np.zeros(3)], 1), 2, axis=0)
    points = 0.3 * np.stack([np.cos(body), np.sin(body), np.zeros(3)], 1)[[0, 1, 1, 2, 2, 0]]
    base = base + 0.03 * rng.normal(size=(6, 3))
    points = points + 0.02 * rng.normal(size=(6, 3))
    mass = float(rng.uniform(0.5, 5.0))
    inertia = mass * np.diag([0.02, 0.025, 0.035]) + mass * 1e-3 * np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    return cspr_jax.platform(base, points, mass=mass, inertia=inertia)


def platform_case(seed: int, name: str | None = None, samples: int = 5) -> Case:
    """A platform on six cables, made up or of the catalogue, near its reference pose."""
    rng = np.random.default_rng([seed, 6])
    robot = hexapod(rng) if name is None else cspr_jax.load_robot(name)
    base = np.asarray(robot.base_points)
    size = np.linalg.norm(base - base.mean(0), axis=1).max()
    down = 1.0 if robot.z_axis == "down" else -1.0
    positions = base.mean(0) + size * (np.array([0.0, 0.0, 1.3 * down]) + rng.uniform(-0.15, 0.15, (samples, 3)))
    quaternions = np.concatenate([np.ones((samples, 1)), rng.uniform(-0.06, 0.06, (samples, 3))], axis=1)
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    times = np.cumsum(rng.uniform(1.0, 1.5, samples))
    kind = str(rng.choice(["cubic", "quintic"]))
    given = {"times": times - times[0], "positions": positions, "quaternions": quaternions, "interpolation": kind}
    return Case(robot, given)


def exact_form(case: Case):
    """Robot and pieces of the motion of a feasible case, as the oracle has them; None if it is not feasible."""
    check = case.checked()
    if not check.feasible:
        return None
    (motion,) = check.plan.legs[0].motions
    return oracle.robot_of(check.plan.problem.robot), oracle.pieces_of(motion)


def feasible_cases(make, first: int) -> Iterator[tuple[Case, oracle.Robot, list[oracle.Piece]]]:
    """Feasible cases of a function of seeds, from one on."""
    seed = first
    while True:
        case = make(seed)
        form = exact_form(case)
        if form is not None:
            yield case, *form
        seed += 1


@contextlib.contextmanager
def without_library(monkeypatch):
    """As if the library for exact arithmetic were not installed, where it is optional."""
    with monkeypatch.context() as patch:
        for module in ("cspr_jax.verification.attained", "cspr_jax.plans.planning"):
            patch.setattr(f"{module}.has_exact", lambda: False)
        yield
