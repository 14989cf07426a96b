"""Hints of likely mistakes in files that can be computed; they change neither results nor exit codes."""

from collections.abc import Iterable, Sequence

import numpy as np

from cspr_jax.config.near_rest import almost_at_rest
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile, axis_points
from cspr_jax.errors import shown
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.robots.model.spool_plane import in_plane

# Cameras over stadiums hang from spools up to 250 m apart; a larger robot, such as the cabin of a radio telescope,
# weighs tonnes.
LARGEST_SPAN, LARGEST_MASS = 300.0, 1000.0  # m, kg
# Bounds of inertia over mass times squared size, which is near 1; a wrong unit changes it by a factor of 1e3 at least.
INERTIA_RATIOS = (1e-5, 1e3)
# Rounding errors of tables of points, as a fraction of the distances between the points of a platform.
ROUNDED_BY_HAND = 1e-3


def robot_hints(robot_file: RobotFile) -> list[str]:
    """Likely mistakes in the units of a robot, and items that were left out of a file of another program."""
    lines, spools = list(robot_file.notes), np.asarray(robot_file.base_points)
    span = float(np.linalg.norm(spools[:, None] - spools, axis=2).max())
    if span > LARGEST_SPAN and robot_file.mass < LARGEST_MASS:
        lines.append(
            f"robot.base_points: spools {span:g} m apart, for a mass of {robot_file.mass:g} kg: are these millimetres? "
            "Lengths are in m"
        )
    if robot_file.platform_points is not None and robot_file.inertia is not None:
        arms = np.asarray(robot_file.platform_points) - np.asarray(robot_file.centre_of_mass or [0.0, 0.0, 0.0])
        radius, largest = float(np.linalg.norm(arms, axis=1).max()), float(np.abs(robot_file.inertia).max())
        ratio = largest / (robot_file.mass * radius**2) if radius > 0.0 else 1.0
        if not INERTIA_RATIOS[0] < ratio < INERTIA_RATIOS[1]:
            lines.append(
                f"robot.inertia: {largest:g} kg m^2 for a mass of {robot_file.mass:g} kg and platform_points "
                f"{radius:g} m from it: do the units fit? Inertia is in kg m^2, lengths are in m"
            )
    return lines + _unbalanced(robot_file)


def _unbalanced(robot_file: RobotFile) -> list[str]:
    # A mass centre far from the points usually has another origin, or is the default of another program.
    if robot_file.platform_points is None:
        return []
    centre, axes = (
        np.asarray(robot_file.centre_of_mass or [0.0, 0.0, 0.0]),
        [0, 2] if robot_file.is_planar else [0, 1, 2],
    )
    points = np.asarray(robot_file.platform_points)
    if robot_file.own_pattern == "3R":  # the joint holds the body too
        points = np.vstack([points, np.zeros(3)])
    extent = float(np.ptp(points, axis=0).max())
    away = _distance_to_hull((points - centre)[:, axes] / extent) * extent if extent > 0.0 else 0.0
    if away <= ROUNDED_BY_HAND * extent:
        return []
    return [
        f"robot.centre_of_mass = {shown(centre.tolist())}: {away:.3g} m outside the hull of platform_points: is it "
        "from the origin of the platform's axes?"
    ]


def _distance_to_hull(points: np.ndarray) -> float:
    # Distance of the origin from the hull of points (n, axes) of extent 1; a heavy row keeps the sum of weights at 1.
    if np.linalg.norm(points.mean(axis=0)) <= ROUNDED_BY_HAND:
        return 0.0
    from scipy.optimize import nnls  # takes long to import, and the mean mostly suffices

    heavy = 1e3
    rows = np.vstack([points.T, np.full(len(points), heavy)])
    try:
        weights, _ = nnls(rows, np.append(np.zeros(points.shape[1]), heavy), maxiter=100 * len(points))
    except RuntimeError:  # the solver did not converge
        return 0.0
    return float(np.linalg.norm(weights @ points) / weights.sum())


def plan_hints(spec: PlanFile, robot_file: RobotFile) -> list[str]:
    """Likely mistakes in a plan that is not feasible."""
    targets = {i: pose.position for i, pose in enumerate(spec.pose) if pose.position is not None and not pose.rest}
    positions = np.asarray(list(targets.values()), float).reshape(-1, 3)
    level = in_plane(np.asarray(robot_file.base_points), positions, planar=robot_file.is_planar)
    lines = [
        f"pose[{i}].position = {shown(position)}: in the plane of the spools, where no tension of the cables carries a "
        "weight: must be below it"
        for (i, position), is_level in zip(targets.items(), level, strict=True)
        if is_level
    ]
    text = forgotten_axis(robot_file, positions[~level].tolist())
    return [*lines, f"pose: {text}"] if text else lines


def sweep_hints(spec: SweepFile, robot_file: RobotFile) -> list[str]:
    """Likely mistakes in a sweep."""
    lines, start, workspace = list[str](), spec.trajectory.start, spec.workspace
    if start is not None and start.position is not None and not start.rest and spec.axes.z0 is not None:
        depth_hints = (
            almost_at_rest("trajectory.from.position", start.position, z0, robot_file)
            for z0 in axis_points(spec.axes.z0)
        )
        lines += [line for line in depth_hints if line][:1]
    if workspace is not None and "interference-free" in workspace.conditions and not robot_file.cable_diameter:
        shapes = (workspace.obstacle, workspace.platform_box, workspace.platform_hull)
        if all(shape is None for shape in shapes):
            lines.append(
                'workspace.conditions: "interference-free" excludes nothing: cables without a thickness hardly ever '
                "meet, and there is neither an obstacle nor a shape of the platform; does the robot lack "
                "cable_diameter?"
            )
    return lines


def forgotten_axis(robot_file: RobotFile, targets: Iterable[Sequence[float]]) -> str:
    """Question about the z axis, if it seems to point the other way; else empty."""
    frame = frame_of(robot_file.base_points, robot_file.z_axis)
    depths, spools = (frame.depth([point[2] for point in points]) for points in (targets, robot_file.base_points))
    is_above = bool(len(depths)) and depths.max() < spools.min()
    return f"every target is above every spool: {axis_question(robot_file.z_axis)}" if is_above else ""


def axis_question(z_axis: str) -> str:
    """Question to the user where all targets are above the spools."""
    other = "up" if z_axis == "down" else "down"
    return f'z points {z_axis} in this robot; does it lack z_axis = "{other}"?'
