"""Raw speed of the check, beside a NumPy version of the same check in the same run.

One three-cable check is the three pseudotensions at one tau of one trajectory. The NumPy version
computes the printed formulas, (2.12) to (2.14) and (2.31) to (2.48), on whole arrays.
"""

import math
import os
import platform
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np

from cspr_jax import amplitudes
from cspr_jax.feasibility.certificate import Shared
from cspr_jax.feasibility.limits import Limits
from cspr_jax.maps import sieve
from cspr_jax.maps.minimum_arcs import segments_between
from cspr_jax.robots import point_mass_robot

SCHEMA = 1
REPEATS = 5
MAX_ARCS = 30
BATCHES = 8
NUMPY_SEGMENTS = 128
Z0 = 1.7
RADIUS = 0.26


def bench() -> dict[str, Any]:
    """Measure the rates.

    Returns:
        the object that `cspr bench --json` prints: checks per second, best of five.
    """
    shared, ends = _work(BATCHES * sieve.BATCH)
    starts = np.broadcast_to([0.7, 0.7, 3.0], ends.shape).copy()
    parities, _ = segments_between(shared, starts, ends, np.full(len(ends), Z0))
    rates: dict[str, float] = {}
    for dtype in ("float32", "float64"):
        pair = jax.tree.map(lambda x, d=dtype: np.asarray(x, d), (parities[0], parities[1]))
        batches = [jax.device_put(jax.tree.map(lambda x, i=i: x[i::BATCHES], pair)) for i in range(BATCHES)]
        rates[dtype] = len(ends) * MAX_ARCS * sieve.SAMPLES / _best(partial(_all, shared, batches))
    few = ends[:NUMPY_SEGMENTS]
    rates["numpy"] = (
        len(few) * MAX_ARCS * sieve.SAMPLES / _best(partial(_numpy_checks, np.asarray(shared.robot.base_points), few))
    )
    return {
        "schema": SCHEMA,
        "checks_per_second": {"float32": None, "float64": None, "numpy": None},
        "three_cable": rates,
        "ratio_to_numpy": {dtype: rates[dtype] / rates["numpy"] for dtype in ("float32", "float64")},
        "cores": len(os.sched_getaffinity(0)),
        "device": f"{jax.devices()[0].platform} {jax.devices()[0].device_kind}",
        "machine": platform.machine(),
        "jax": jax.__version__,
        "repeats": REPEATS,
    }


def _work(count: int) -> tuple[Shared, np.ndarray]:
    half = math.sqrt(3.0) / 2.0
    base = RADIUS * np.array([[half, -0.5, 0.0], [-half, -0.5, 0.0], [0.0, 1.0, 0.0]])
    robot = point_mass_robot(base, mass=0.198)
    ends = np.random.default_rng(0).uniform([-1.5, -1.5, 0.3], [1.5, 1.5, 3.2], (count, 3))
    return Shared(robot, Limits(), amplitudes.named("quintic")), ends


def _all(shared: Shared, batches: list) -> None:
    found = [sieve.upper_bounds(shared.amplitude, *pair, max_arcs=MAX_ARCS) for pair in batches]
    jax.block_until_ready(found)


def _best(work: Callable[[], object]) -> float:
    work()  # compiles
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def _numpy_checks(base: np.ndarray, ends: np.ndarray) -> np.ndarray:
    # Smallest pseudotension of each segment and number of arcs: (segments, MAX_ARCS).
    tau = (np.arange(sieve.SAMPLES) + 0.5) / sieve.SAMPLES
    amplitude = (10 * tau**3 - 15 * tau**4 + 6 * tau**5, 30 * tau**2 - 60 * tau**3 + 30 * tau**4)
    bend = 60 * tau - 180 * tau**2 + 120 * tau**3
    hub, start, g = np.array([0.0, 0.0, Z0]), np.array([0.7, 0.7, 3.0]), 9.81
    v1, v2 = start - hub, ends - hub
    r1, r2 = np.linalg.norm(v1), np.linalg.norm(v2, axis=1)[:, None]
    q1 = v1 / r1
    across = v2 - (v2 @ q1)[:, None] * q1
    q2 = across / np.linalg.norm(across, axis=1)[:, None]
    psi = np.arctan2(np.linalg.norm(across, axis=1), v2 @ q1)[:, None]
    r, slope, curve = r1 + (r2 - r1) * amplitude[0], (r2 - r1) * amplitude[1], (r2 - r1) * bend
    found = []
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
        along, side = rate * (curve * u + 2 * slope * u1 + r * u2), rate * (curve * v + 2 * slope * v1d + r * v2d)
        place = [hub[i] + q1[i] * (r * u) + q2[:, i, None] * (r * v) for i in range(3)]
        force = [q1[i] * along + q2[:, i, None] * side - (g if i == 2 else 0.0) for i in range(3)]
        found.append(np.min([_kappa(base, k, place, force).min(1) for k in range(3)], axis=0))
    return np.stack(found, axis=1)


def _kappa(base: np.ndarray, k: int, place: list, force: list) -> np.ndarray:
    after, before = base[(k + 1) % 3], base[(k + 2) % 3]
    d, c = after - before, np.cross(after, before)
    return (
        (place[1] * d[2] - place[2] * d[1] + c[0]) * force[0]
        + (place[2] * d[0] - place[0] * d[2] + c[1]) * force[1]
        + (place[0] * d[1] - place[1] * d[0] + c[2]) * force[2]
    )
