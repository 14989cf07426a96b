"""Poses of equilibrium of robots whose cables may be slack: minima of the potential energy.

The mass centre is as low as the cables let it be: its depth is largest where no cable is longer than its given length
(Carricato and Merlet, IEEE Trans. Robotics 29 (1), 2013: geometrico-static problem). Cables that are shorter in that
pose are slack. Of a point mass the problem is convex, and has one solution; a platform may have several, found from
several starts. Each is verified: tensions of taut cables are not negative and hold the weight, and the depth falls in
all directions that taut cables leave, to second order.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.optimize import minimize, nnls

from cspr_jax.machine.forward_kinematics.least_squares import moved
from cspr_jax.machine.forward_kinematics.solutions import Search, SolvedPoses
from cspr_jax.numerics.linear.rotations import matrix
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.workspaces.poses import geometry

# Cables count as taut where they are shorter than given by less than this, over the robot's size.
TAUT = 1e-6
# Largest remainder of the weight that tensions of taut cables leave, over the weight.
BALANCED = 1e-5
# Curvature of the depth, over weight and size, above which a pose is no maximum of the depth.
LARGEST_CURVATURE = 1e-6
STARTS, MOST_ITERATIONS = 12, 300


class Equilibria(NamedTuple):
    """Poses of equilibrium, with tensions (n, k, n_cables) N; 0 where a cable is slack."""

    poses: SolvedPoses
    tensions: np.ndarray


def equilibria(
    search: Search, lengths: Float[np.ndarray, "n m"], starts: tuple[np.ndarray, np.ndarray] | None
) -> Equilibria:
    """Stable poses for each set of lengths, the lowest first; from one start each, or from several."""
    rows = [
        _equilibria_of(search, row, None if starts is None else (starts[0][i], starts[1][i]))
        for i, row in enumerate(lengths)
    ]
    width = max(max(len(row) for row in rows), 1)
    n_cables = search.robot.n_cables
    count = len(rows)
    positions, quaternions = np.full((count, width, 3), np.nan), np.full((count, width, 4), np.nan)
    residuals, tensions = np.full((count, width, n_cables), np.nan), np.full((count, width, n_cables), np.nan)
    steps, is_found = np.zeros((count, width), int), np.zeros((count, width), bool)
    for i, row in enumerate(rows):
        for k, (pose, forces, residual, number, is_stable) in enumerate(row):
            positions[i, k], quaternions[i, k], residuals[i, k] = pose[:3], pose[3:], residual
            tensions[i, k], steps[i, k], is_found[i, k] = forces, number, is_stable
    return Equilibria(SolvedPoses(positions, quaternions, residuals, is_found, steps), tensions)


def _equilibria_of(search: Search, lengths: np.ndarray, start: tuple[np.ndarray, np.ndarray] | None) -> list[tuple]:
    if start is None:
        positions, quaternions = search.starts(lengths[None])
        starts = list(zip(positions[0], quaternions[0], strict=True))[: STARTS if search.row.is_body else 2]
    else:
        starts = [start]
    solutions: list[tuple] = []
    for position, quaternion in starts:
        one = _lowest(search, lengths, np.concatenate([position, quaternion]))
        if one is not None and not any(_is_same(search, one[0], other[0]) for other in solutions):
            solutions.append(one)
    stable = [one for one in solutions if one[-1]] or solutions[:1]
    return sorted(stable, key=lambda one: -one[0][2])


def _is_same(search: Search, first: np.ndarray, second: np.ndarray) -> bool:
    targets = [np.asarray(geometry.attachments(search.robot, x[None, :3], x[None, 3:])) for x in (first, second)]
    return bool(np.abs(targets[0] - targets[1]).max() <= 1e-4 * search.size)


def _lowest(search: Search, lengths: np.ndarray, pose: np.ndarray) -> tuple | None:
    # A local maximum of the depth by sequential quadratic programs, in a chart about a pose that follows it.
    steps = 0
    for _ in range(4):
        move, number = _program(search, lengths, pose)
        pose = np.asarray(_posed(search.robot, pose, move, search.radius))
        steps += number
        if np.abs(move).max(initial=0.0) <= 1e-9 * search.size:
            break
    values, gradients = (np.asarray(x) for x in _local(search.robot, pose, np.zeros(search.robot.dof), search.radius))
    residual = values[1:] - lengths
    if not np.isfinite(gradients).all() or not residual.max() <= TAUT * search.size:
        return None
    weight = float(search.robot.mass) * float(search.robot.gravity)
    is_taut, load, tensions = residual >= -TAUT * search.size, weight * gradients[0], np.zeros(len(lengths))
    if is_taut.any():
        tensions[is_taut] = nnls(gradients[1:][is_taut].T, load)[0]
    is_balanced = np.linalg.norm(tensions @ gradients[1:] - load) <= BALANCED * weight
    is_stable = bool(is_balanced and _is_stable(search, pose, tensions, gradients[1:], weight))
    return pose, tensions, residual, steps, is_stable


def _program(search: Search, lengths: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, int]:
    extent, precomputed = search.size, dict[bytes, tuple[np.ndarray, np.ndarray]]()

    def local(move: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = move.tobytes()
        if key not in precomputed:
            values, gradients = _local(search.robot, pose, move * extent, search.radius)
            precomputed[key] = np.asarray(values) / extent, np.asarray(gradients)
        return precomputed[key]

    slack = {
        "type": "ineq",
        "fun": lambda move: lengths / extent - local(move)[0][1:],
        "jac": lambda move: -local(move)[1][1:],
    }
    result = minimize(
        lambda move: (-local(move)[0][0], -local(move)[1][0]),
        np.zeros(search.robot.dof),
        jac=True,
        method="SLSQP",
        constraints=[slack],
        options={"maxiter": MOST_ITERATIONS, "ftol": 1e-15},
    )
    is_good = np.isfinite(result.x).all()
    return np.where(is_good, result.x, 0.0) * extent, int(result.nit)


def _is_stable(search: Search, pose: np.ndarray, tensions: np.ndarray, gradients: np.ndarray, weight: float) -> bool:
    # Curvature of weight times depth minus tensions times lengths, where cables under tension keep their lengths.
    zero = np.zeros(search.robot.dof)
    curvature = np.asarray(_curvature(search.robot, pose, zero, tensions, weight, search.radius))
    active = gradients[tensions > BALANCED * weight]
    _, singular, rows = np.linalg.svd(active) if len(active) else (None, np.zeros(0), np.eye(len(zero)))
    free = rows[int((singular > 1e-8).sum()) :]
    if not len(free):
        return True
    return bool(np.linalg.eigvalsh(free @ curvature @ free.T).max() * search.size / weight <= LARGEST_CURVATURE)


@jax.jit
def _posed(robot: AnyRobot, pose: Float[Array, "7"], move: Float[Array, "dof"], radius: Float[Array, ""]) -> Array:
    position, quaternion = moved(robot, pose[:3, None], pose[3:, None], [x[None] for x in move], radius)
    return jnp.concatenate([position[:, 0], quaternion[:, 0]])


def _depth_and_lengths(robot: AnyRobot, pose: Array, move: Array, radius: Array) -> Float[Array, "n"]:
    # Depth of the mass centre, and lengths of the cables, after a small motion.
    pose = _posed(robot, pose, move, radius)
    depth = pose[2]
    if PATTERNS[robot.pattern].is_jointed and isinstance(robot, PlatformRobot) and robot.centre_of_mass is not None:
        depth = depth + (matrix(pose[3:]) @ robot.centre_of_mass)[2]
    lengths = geometry.length_lanes(robot, tuple(x[None] for x in pose[:3]), tuple(x[None] for x in pose[3:]))
    return jnp.concatenate([depth[None], lengths[:, 0]])


@jax.jit
def _local(
    robot: AnyRobot, pose: Float[Array, "7"], move: Float[Array, "dof"], radius: Float[Array, ""]
) -> tuple[Float[Array, "n"], Float[Array, "n dof"]]:
    def at(x: Array) -> Array:
        return _depth_and_lengths(robot, pose, x, radius)

    return at(move), jax.jacfwd(at)(move)


@jax.jit
def _curvature(
    robot: AnyRobot, pose: Array, zero: Array, tensions: Array, weight: Array, radius: Array
) -> Float[Array, "dof dof"]:
    def energy(x: Array) -> Array:
        values = _depth_and_lengths(robot, pose, x, radius)
        return weight * values[0] - jnp.dot(tensions, values[1:])

    return jax.jacfwd(jax.jacfwd(energy))(zero)
