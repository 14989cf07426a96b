"""Three-cable checks: the three pseudotensions at one tau of a trajectory.

The NumPy version computes the printed formulas, (2.12) to (2.14) and (2.31) to (2.48), on whole arrays.
"""

import math
from functools import partial
from typing import NamedTuple

import jax
import numpy as np

from cspr_jax.bench.timing import best
from cspr_jax.families.swings.arcs import segments_between
from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.families.swings.proof import screen
from cspr_jax.motion import amplitudes
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import device_batch_size, in_threads
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import point_mass_robot, rest_point

MAX_ARCS = 30
BATCHES = 16
NUMPY_SEGMENTS = 128
Z0 = 1.7
RADIUS = 0.26
START = (0.7, 0.7, 3.0)


class ThreeCableWork(NamedTuple):
    """Segments to check.

    Fields:
        problem: robot and amplitude function.
        ends: (n, 3) end points, m.
        segments: segments for even and for odd numbers of arcs, arrays (n, ...).
    """

    problem: Problem
    ends: np.ndarray
    segments: tuple[Segment, Segment]


def work() -> ThreeCableWork:
    """Draw segments from one point to random ones."""
    half = math.sqrt(3.0) / 2.0
    base = RADIUS * np.array([[half, -0.5, 0.0], [-half, -0.5, 0.0], [0.0, 1.0, 0.0]])
    problem = Problem(point_mass_robot(base, mass=0.198), Limits(), amplitudes.named("quintic"))
    ends = np.random.default_rng(0).uniform(
        [-1.5, -1.5, 0.3], [1.5, 1.5, 3.2], (BATCHES * device_batch_size(screen.BATCH), 3)
    )
    starts = np.broadcast_to(START, ends.shape).copy()
    parities, _ = segments_between(problem, starts, ends, np.full(len(ends), Z0))
    return ThreeCableWork(problem, ends, (parities[0], parities[1]))


def rate(work: ThreeCableWork, dtype: str) -> float:
    """Checks a second by the screen."""
    pair = jax.tree.map(lambda x: np.asarray(x, dtype), work.segments)
    batches = [jax.device_put(jax.tree.map(lambda x, i=i: x[i::BATCHES], pair)) for i in range(BATCHES)]

    def one(batch):
        return jax.block_until_ready(screen.upper_bounds(work.problem.amplitude, *batch, max_arcs=MAX_ARCS))

    return checks(len(work.ends)) / best(partial(in_threads, one, batches))


def checks(count: int) -> int:
    """Number of checks that segments take."""
    return count * MAX_ARCS * screen.SAMPLES


def numpy_rate(work: ThreeCableWork) -> float:
    """Checks a second of the NumPy version."""
    ends = work.ends[:NUMPY_SEGMENTS]
    return checks(len(ends)) / best(partial(_numpy_checks, np.asarray(work.problem.robot.base_points), ends))


def _numpy_checks(base: np.ndarray, ends: np.ndarray) -> np.ndarray:
    # Return the smallest pseudotension of each segment and number of arcs: (segments, MAX_ARCS).
    tau = (np.arange(screen.SAMPLES) + 0.5) / screen.SAMPLES
    amplitude = (10 * tau**3 - 15 * tau**4 + 6 * tau**5, 30 * tau**2 - 60 * tau**3 + 30 * tau**4)
    second_derivative = 60 * tau - 180 * tau**2 + 120 * tau**3
    center, start, g = rest_point(Z0), np.array(START), 9.81
    v1, v2 = start - center, ends - center
    r1, r2 = np.linalg.norm(v1), np.linalg.norm(v2, axis=1)[:, None]
    q1 = v1 / r1
    across = v2 - (v2 @ q1)[:, None] * q1
    q2 = across / np.linalg.norm(across, axis=1)[:, None]
    psi = np.arctan2(np.linalg.norm(across, axis=1), v2 @ q1)[:, None]
    r, radial_rate, curve = r1 + (r2 - r1) * amplitude[0], (r2 - r1) * amplitude[1], (r2 - r1) * second_derivative
    smallest = []
    for p in range(1, MAX_ARCS + 1):
        theta = psi + (-1) ** (p - 1) * 2.0 * math.pi * math.ceil((p - 1) / 2)  # (2.34)
        n = 2.0 * math.pi * p / np.abs(theta)
        slow, fast = theta * tau, (n - 1.0) * theta * tau
        cs, ss, cf, sf = np.cos(slow), np.sin(slow), np.cos(fast), np.sin(fast)
        u, v = ((n - 1.0) * cs + cf) / n, ((n - 1.0) * ss - sf) / n
        k = theta * (n - 1.0) / n
        u1, v1d = -k * (ss + sf), k * (cs - cf)
        u2, v2d = -k * theta * (cs + (n - 1.0) * cf), -k * theta * (ss - (n - 1.0) * sf)
        rate = g / Z0 / (theta**2 * (n - 1.0))  # 1 / T^2
        along, side = (
            rate * (curve * u + 2 * radial_rate * u1 + r * u2),
            rate * (curve * v + 2 * radial_rate * v1d + r * v2d),
        )
        position = [center[i] + q1[i] * (r * u) + q2[:, i, None] * (r * v) for i in range(3)]
        force = [q1[i] * along + q2[:, i, None] * side - (g if i == 2 else 0.0) for i in range(3)]
        smallest.append(np.min([_kappa(base, k, position, force).min(1) for k in range(3)], axis=0))
    return np.stack(smallest, axis=1)


def _kappa(base: np.ndarray, k: int, position: list, force: list) -> np.ndarray:
    after, before = base[(k + 1) % 3], base[(k + 2) % 3]
    d, c = after - before, np.cross(after, before)
    return (
        (position[1] * d[2] - position[2] * d[1] + c[0]) * force[0]
        + (position[2] * d[0] - position[0] * d[2] + c[1]) * force[1]
        + (position[0] * d[1] - position[1] * d[0] + c[2]) * force[2]
    )
