"""What a plan leaves open: z0 and the epsilon of its amplitude function; and its poses as points."""

from pathlib import Path

import numpy as np

from cspr_jax import problem
from cspr_jax.amplitudes import Amplitude
from cspr_jax.config.plan import Choice, PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, shown
from cspr_jax.feasibility.certificate import Shared
from cspr_jax.maps.answers import Answers
from cspr_jax.maps.minimum_arcs import minimum_arcs
from cspr_jax.robots import PointMassRobot, centroid
from cspr_jax.trajectories import depths

REST_TOLERANCE = 1e-9  # m
# A conservative z0 must lie above its bound: by this part of it.
ABOVE_BOUND = 1e-6
EPSILONS = np.linspace(0.02, 0.5, 49)
DEPTHS = 200


def answers_along(shared: Shared, keys: PlanFile, points: np.ndarray, z0: np.ndarray) -> Answers:
    """Answers of all segments of a plan, for one z0 or several at once.

    Args:
        shared: robot, limits and amplitude.
        keys: the plan.
        points: (n + 1, 3), or (n_depths, n + 1, 3), m.
        z0: (n,), or (n_depths * n,), m.

    Returns:
        the answers, as long as `z0`.
    """
    fixed = np.array([pose.arcs or 0 for pose in keys.pose[1:]])
    repeats = len(z0) // len(fixed)
    largest = max(keys.max_arcs, int(fixed.max()))
    starts = points[:-1] if points.ndim == 2 else points[:, :-1].reshape(-1, 3)
    ends = points[1:] if points.ndim == 2 else points[:, 1:].reshape(-1, 3)
    return minimum_arcs(shared, starts, ends, z0, max_arcs=largest, arcs=np.tile(fixed, repeats))


def _targets(spec: RobotFile, keys: PlanFile) -> np.ndarray:
    # Poses that are not at rest, in the kernels' axes.
    moving = [pose.position for pose in keys.pose if not pose.rest]
    return np.asarray(moving, float).reshape(-1, 3) * problem.axis_signs(spec)


def pose_points(robot: PointMassRobot, spec: RobotFile, keys: PlanFile, z0: float) -> np.ndarray:
    """Poses as points in the kernels' axes; those at rest are P0.

    Args:
        robot: gives the centroid.
        spec: gives the file's axes.
        keys: the plan.
        z0: m.

    Returns:
        (n_poses, 3) m.
    """
    hub = np.asarray(centroid(robot)) + np.array([0.0, 0.0, z0])
    signs = problem.axis_signs(spec)
    return np.array([hub if pose.rest else np.asarray(pose.position) * signs for pose in keys.pose])


def chosen_depth(shared: Shared, spec: RobotFile, keys: PlanFile, path: Path) -> float:
    """The plan's z0, given or chosen.

    Args:
        shared: robot, limits and amplitude.
        spec: gives the file's axes.
        keys: the plan.
        path: named in errors.

    Returns:
        z0, m.

    Raises:
        ConfigError: a pose without a position, a rest pose off P0, or no z0 that can be chosen.
    """
    for i, pose in enumerate(keys.pose):
        if pose.position is None and not pose.rest:
            raise ConfigError(path, f"pose[{i}].position is missing: [x, y, z] in m, or rest = true")
    targets = _targets(spec, keys)
    if keys.z0 is None:
        raise ConfigError(path, 'z0 is missing: depth of P0, m, or { choose = "mean" | "conservative" | "fastest" }')
    if not isinstance(keys.z0, Choice):
        _check_rest(shared.robot, spec, keys, keys.z0, path)
        return keys.z0
    for i, pose in enumerate(keys.pose):
        if pose.rest and pose.position is not None:
            raise ConfigError(path, f"pose[{i}].position = {shown(pose.position)}: must be absent where z0 is chosen")
    if not len(targets):
        raise ConfigError(path, "z0 = { choose = ... }: must be a number where every pose is at rest")
    if keys.z0.choose == "mean":
        z0 = depths.mean_depth(shared.robot, targets)
    elif keys.z0.choose == "conservative":
        z0 = depths.conservative_depth(shared.robot, targets) * (1.0 + ABOVE_BOUND)
    else:
        z0 = _fastest_depth(shared, spec, keys, targets)
    if not z0 > 0.0:
        raise ConfigError(
            path, f'z0.choose = "{keys.z0.choose}": must be a number here, since no z0 > 0 follows from the poses'
        )
    return z0


def _check_rest(robot: PointMassRobot, spec: RobotFile, keys: PlanFile, z0: float, path: Path) -> None:
    hub = (np.asarray(centroid(robot)) + np.array([0.0, 0.0, z0])) * problem.axis_signs(spec)
    for i, pose in enumerate(keys.pose):
        if pose.rest and pose.position is not None and np.abs(np.asarray(pose.position) - hub).max() > REST_TOLERANCE:
            place = [float(f"{value:.9g}") for value in hub]
            raise ConfigError(
                path, f"pose[{i}].position = {shown(pose.position)}: must be P0 = {place} at rest, or absent"
            )


def _fastest_depth(shared: Shared, spec: RobotFile, keys: PlanFile, targets: np.ndarray) -> float:
    # The duration grows with the root of z0 between changes of the arcs: a coarse look, then a fine one at the best.
    least = max(depths.least_depth(shared.robot, targets), 1e-3)
    safe = depths.conservative_depth(shared.robot, targets)
    trial = np.linspace(0.5 * least, max(1.5 * least, safe if np.isfinite(safe) else 0.0), DEPTHS)
    for _ in range(2):
        points = np.stack([pose_points(shared.robot, spec, keys, z0) for z0 in trial])
        answers = answers_along(shared, keys, points, np.repeat(trial, len(keys.pose) - 1))
        cost = np.where(answers.arcs > 0, answers.duration, np.inf).reshape(DEPTHS, -1).sum(1)
        best = int(np.argmin(cost))
        if not np.isfinite(cost[best]):
            best = int(np.argmax(answers.margin.reshape(DEPTHS, -1).min(1)))
        chosen = float(trial[best])
        trial = np.linspace(trial[max(best - 1, 0)], chosen, DEPTHS)
    return chosen


def best_amplitude(shared: Shared, spec: RobotFile, keys: PlanFile, z0: float, path: Path) -> Amplitude:
    """The amplitude function whose epsilon gives the shortest plan; among equals, the largest margin.

    Args:
        shared: robot and limits.
        spec: gives the file's axes.
        keys: the plan.
        z0: m.
        path: named in errors.

    Returns:
        the function.
    """
    points = pose_points(shared.robot, spec, keys, z0)
    ranked: list[tuple[float, float, int, Amplitude]] = []
    for epsilon in EPSILONS:
        amplitude = problem.build_amplitude(keys, path, epsilon=float(epsilon))
        answers = answers_along(shared._replace(amplitude=amplitude), keys, points, np.full(len(points) - 1, z0))
        cost = np.where(answers.arcs > 0, answers.duration, np.inf).sum()
        ranked.append((round(float(cost), 9), -float(answers.margin.min()), len(ranked), amplitude))
    return min(ranked)[-1]
