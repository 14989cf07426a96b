"""Proofs of motions a second: of long records for three cables, and of many motions for eight cables at a time."""

from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from cspr_jax.bench.timing import best
from cspr_jax.build.robots import load_robot
from cspr_jax.curves.interpolation import interpolated
from cspr_jax.curves.spline import Spline, SplineBatch
from cspr_jax.errors import SelfCheckError
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.verification.proved_answers import MotionProof, proof_of, proofs_of

DURATION, WAYPOINTS = 10.0, 7  # duration of a motion, s, and its number of waypoints
ROWS, TOGETHER = 10_001, 100  # rows of a record, and number of motions proved at a time


class Region(NamedTuple):
    """Region of a robot's motions, and limits of its tensions.

    Fields:
        robot: name in the catalogue.
        middle: middle of the waypoints, from the centroid of the spools, z down, m.
        radius: largest deviation of each coordinate from the middle, m.
        tilt: largest component of the vector parts of quaternions; 0 for a point mass.
        tensions: lower and upper limit, N.
    """

    robot: str
    middle: tuple[float, float, float]
    radius: float
    tilt: float
    tensions: tuple[float, float]


THREE = Region("prototype", (0.0, 0.0, 1.0), 0.12, 0.0, (0.1, 4.0))
EIGHT = Region("cogiro", (0.0, 0.0, 4.0), 1.5, 0.05, (100.0, 5000.0))


def problem(region: Region) -> Problem:
    """Robot and limits of a region."""
    robot = centred(load_robot(region.robot))[0]
    low, high = (as_float64(np.full(robot.n_cables, value)) for value in region.tensions)
    return Problem(robot, Limits(tension_min=low, tension_max=high), named("quintic"))


def poses(region: Region, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray | None]:
    """Random poses in a region."""
    positions = np.array(region.middle) + region.radius * rng.uniform(-1.0, 1.0, (WAYPOINTS, 3))
    turns = np.concatenate([np.ones((WAYPOINTS, 1)), region.tilt * rng.uniform(-1.0, 1.0, (WAYPOINTS, 3))], axis=1)
    return positions, turns if region.tilt else None


def _motion(region: Region, rng: np.random.Generator) -> Spline:
    # Return a quintic spline through random poses.
    return interpolated(np.linspace(0.0, DURATION, WAYPOINTS), *poses(region, rng), interpolation="quintic")


def _decided(proofs: list[MotionProof]) -> None:
    # Refuse undecided motions: only decided ones count.
    if any(not proof.is_feasible and not proof.broken.any() for proof in proofs):
        raise SelfCheckError("a motion of the bench is neither proved nor refuted")


def record_rate() -> float:
    """Records of `ROWS` rows for three cables that are interpolated and proved a second."""
    case, spline = problem(THREE), _motion(THREE, np.random.default_rng(0))
    times = np.linspace(0.0, DURATION, ROWS)
    positions = np.asarray(jax.jit(jax.vmap(spline.state))(times / DURATION).position)
    return 1.0 / best(lambda: _decided([proof_of(case, interpolated(times, positions))]))


def together_rate() -> float:
    """Motions for eight cables that are proved a second, `TOGETHER` at a time."""
    case, rng = problem(EIGHT), np.random.default_rng(0)
    splines = SplineBatch([_motion(EIGHT, rng) for _ in range(TOGETHER)])
    prove = partial(proofs_of, case, splines.bounds, splines.durations, jumps=splines.jumps)
    return TOGETHER / best(lambda: _decided(prove()))


def rates() -> dict[str, Any]:
    """Rates of records and of motions."""
    return {f"3 cables, {ROWS} rows": record_rate(), f"8 cables, {TOGETHER} together": together_rate()}


def lines(measured: dict[str, Any]) -> list[str]:
    """Lines for people."""
    return ["proofs of motions a second", *(f"  {name:26s} {rate:8.3g}" for name, rate in measured.items())]
