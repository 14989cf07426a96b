"""Workspaces: margins of poses, clearances of cables, tensions of least norm a second; beside LP and least squares."""

import time
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from cspr_jax.bench.timing import best
from cspr_jax.build.robots import load_robot
from cspr_jax.numerics.batches import device_batch_size, in_threads
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.robots.contacts import clearance_kernels
from cspr_jax.robots.contacts.clearance import scene
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot, platform_robot
from cspr_jax.robots.model.point_mass import PointMassRobot, point_mass_robot
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.tensions.tension_distribution_lanes import least_norms
from cspr_jax.robots.tensions.tension_programs import by_program, by_squares
from cspr_jax.workspaces.poses import geometry
from cspr_jax.workspaces.requirements import CLOSURE, FEASIBLE, requirement
from cspr_jax.workspaces.search import WorkspaceSearch

# Number of batches of poses, and of poses with twelve cables.
BATCHES, FEW_BATCHES = 16, 4
# Numbers of poses in one call: for distances of cables, for tensions, and for linear programs and least squares.
PAIRS_BATCH = 65_536
TENSIONS = 65_536
SAMPLE = 100


class SamplePoses(NamedTuple):
    """Random poses among the spools, as lanes.

    Fields:
        position: three arrays (n,), position of the mass centre, m.
        quaternion: four arrays (n,), unit quaternions; None for a point mass.
    """

    position: tuple[np.ndarray, ...]
    quaternion: tuple[np.ndarray, ...] | None


def _poses(robot: PointMassRobot | PlatformRobot, count: int, dtype: str) -> SamplePoses:
    rng, base = np.random.default_rng(0), np.asarray(robot.base_points)
    half = np.maximum(0.4 * np.ptp(base, axis=0), 0.5)
    quaternions = np.array(IDENTITY) + 0.1 * rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)

    def lanes(array):
        return tuple(np.ascontiguousarray(column, dtype) for column in array.T)

    position = lanes(half * rng.uniform(-1.0, 1.0, (count, 3)))
    return SamplePoses(position, lanes(quaternions) if isinstance(robot, PlatformRobot) else None)


def _four_cables() -> PointMassRobot:
    spools = [[-2.0, -1.0, 0.0], [2.0, -1.0, 0.0], [2.0, 1.0, 0.0], [-2.0, 1.0, 0.0]]
    limits = Limits(tension_min=as_float64(np.full(4, 1.0)), tension_max=as_float64(np.full(4, 100.0)))
    return point_mass_robot(spools, mass=2.0, limits=limits)


def _twelve_cables() -> PlatformRobot:
    # Add four cables at the middles of edges to the eight of a box.
    signs = (-1.0, 1.0)
    corners = np.array(
        [[x, y, z] for x in signs for y in signs for z in signs] + [[x, y, 0.0] for x in signs for y in signs]
    )
    shape = np.array([0.3, 0.2, 0.25]) * corners[:, [1, 2, 0]] * np.array([1.0, -1.0, 1.0])
    limits = Limits(tension_min=as_float64(np.full(12, 10.0)), tension_max=as_float64(np.full(12, 2000.0)))
    return platform_robot(3.0 * corners, shape, mass=50.0, inertia=np.eye(3), limits=limits)


def margin_rate(
    robot: PointMassRobot | PlatformRobot, condition: str, dtype: str, *, by_null_space: bool, batches: int
) -> tuple[float, float]:
    """Margins of one condition a second, from poses as lanes to lower and upper bounds."""
    centred_robot = centred(robot)[0]
    start = time.perf_counter()
    search = WorkspaceSearch(centred_robot, requirement(centred_robot, condition, robot.limits))
    numbers = np.dtype(dtype).type
    kernel, n_poses = search.kernel(numbers, by_null_space=by_null_space), device_batch_size(search.batch(numbers))
    all_poses = _poses(centred_robot, batches * n_poses, dtype)
    parts = [jax.device_put(jax.tree.map(lambda x, i=i: x[i::batches], all_poses)) for i in range(batches)]

    def one(poses):
        return jax.block_until_ready(kernel(poses.position, poses.quaternion, None))

    one(parts[0])
    first = time.perf_counter() - start
    return batches * n_poses / best(partial(in_threads, one, parts)), first


def clearance_rate(dtype: str) -> float:
    """Poses a second for which the nearest two of eight cables are found, among 28 pairs."""
    signs = (-1.0, 1.0)
    corners = np.array([[x, y, z] for x in signs for y in signs for z in signs])
    robot = platform_robot(corners * [5.0, 4.0, 3.0], corners * [0.4, 0.3, 0.2], mass=1.0, inertia=np.eye(3))
    among = scene(robot, diameter=0.01)
    of_robot = clearance_kernels.Points(*map(as_float64, (among.base_points, among.platform_points, among.diameters)))
    points = jax.tree.map(lambda x: np.asarray(x, dtype), of_robot)
    n_poses, pairs = device_batch_size(PAIRS_BATCH), np.array(among.pairs, np.int32)
    all_poses = _poses(robot, 4 * n_poses, dtype)
    parts = [jax.device_put(jax.tree.map(lambda x, i=i: x[i::4], all_poses)) for i in range(4)]

    def one(poses):
        lanes = clearance_kernels.PoseLanes(poses.position, poses.quaternion, None)
        return jax.block_until_ready(clearance_kernels.of_cables(points, lanes, pairs))

    return 4 * n_poses / best(partial(in_threads, one, parts))


def tension_rate(robot: PointMassRobot | PlatformRobot) -> float:
    """Tensions of least norm within limits a second, from arrays of wrench matrices to arrays of tensions."""
    count = TENSIONS
    centred_robot = centred(robot)[0]
    search = WorkspaceSearch(centred_robot, requirement(centred_robot, FEASIBLE, robot.limits))
    poses = _poses(centred_robot, count, "float64")
    positions, quaternions = np.stack(poses.position, 1), np.stack(poses.quaternion or (), 1)
    matrices = np.asarray(geometry.wrench_matrices(centred_robot, positions, quaternions)) / search.unit[:, None]
    wrenches = np.repeat(search.required(positions[0], quaternions[0]).corners, count, axis=0)
    limits = [
        np.broadcast_to(x, (count, centred_robot.n_cables)) for x in (search.requirement.low, search.requirement.high)
    ]
    return count / best(lambda: least_norms(matrices, wrenches, *limits))


def rates() -> dict[str, Any]:
    """Rates of margins, clearances and tensions."""
    eight, four, twelve = load_robot("cogiro"), _four_cables(), _twelve_cables()
    rows: dict[str, Any] = {}
    for name, robot, condition, by_null_space, batches in (
        ("4 cables, point mass", four, FEASIBLE, False, BATCHES),
        ("8 cables", eight, FEASIBLE, True, BATCHES),
        ("8 cables, closure", eight, CLOSURE, True, BATCHES),
        ("8 cables, by normals", eight, FEASIBLE, False, BATCHES),
        ("12 cables", twelve, FEASIBLE, False, FEW_BATCHES),
    ):
        measured = {
            dtype: margin_rate(robot, condition, dtype, by_null_space=by_null_space, batches=batches)
            for dtype in ("float32", "float64")
        }
        rows[name] = {dtype: rate for dtype, (rate, _) in measured.items()} | {"first_s": measured["float32"][1]}
    rows["28 pairs of cables"] = {dtype: clearance_rate(dtype) for dtype in ("float32", "float64")}
    rows["least tensions, 8 cables"] = {"float64": tension_rate(eight)}
    return rows | {"8 cables, others": _others(eight)}


def _others(robot: PointMassRobot | PlatformRobot) -> dict[str, float]:
    # Return poses a second by linear programs and by least squares.
    centred_robot = centred(robot)[0]
    search = WorkspaceSearch(centred_robot, requirement(centred_robot, FEASIBLE, robot.limits))
    poses = _poses(centred_robot, SAMPLE, "float64")
    positions, quaternions = np.stack(poses.position, 1), np.stack(poses.quaternion or (), 1)
    matrices = np.asarray(geometry.wrench_matrices(centred_robot, positions, quaternions)) / search.unit[:, None]
    wrench = search.required(positions[0], quaternions[0]).corners[0]

    def rate(decide) -> float:
        low, high = search.requirement.low, search.requirement.high
        return SAMPLE / best(lambda: [decide(matrix, wrench, low, high) for matrix in matrices])

    return {"HiGHS": rate(by_program), "NNLS": rate(by_squares)}


def lines(measured: dict[str, Any]) -> list[str]:
    """Lines for people."""
    text = ["workspaces, poses a second"]
    for name, row in measured.items():
        words = [f"{key} {value / 1e6:8.3g} M/s" for key, value in row.items() if key != "first_s"]
        text.append(
            f"  {name:26s} {', '.join(words)}" + (f", first {row['first_s']:.1f} s" if "first_s" in row else "")
        )
    return text
