"""The package from Python: load a robot, plan a sequence, map an array of targets, open a result."""

from pathlib import Path

import jax
import numpy as np

from cspr_jax import planning, problem
from cspr_jax.amplitudes import Amplitude, named
from cspr_jax.config.robot import resolve_robot
from cspr_jax.config.trajectory import TrajectoryKeys
from cspr_jax.errors import InputError
from cspr_jax.feasibility.certificate import Shared
from cspr_jax.feasibility.limits import Limits
from cspr_jax.maps.answers import Answers
from cspr_jax.maps.minimum_arcs import minimum_arcs as _minimum_arcs
from cspr_jax.planning import Plan
from cspr_jax.platforms import PlatformRobot
from cspr_jax.robots import PointMassRobot, centroid, is_planar


def load_robot(reference: str | Path) -> PointMassRobot | PlatformRobot:
    """A robot of the catalogue, or of a file. Its axes become z down.

    Args:
        reference: a catalogue name, or the path of a robot file.

    Returns:
        the robot, without the limits that its file may hold; with six cables, a platform.

    Raises:
        ConfigError: no such robot, or a mistake in its file.
    """
    spec = resolve_robot(str(reference), reference, Path.cwd())
    build = problem.build_platform if spec.is_platform else problem.build_robot
    return build(spec, TrajectoryKeys(), reference)


def plan(path: str | Path) -> Plan:
    """Plan the sequence of a plan file; see `cspr_jax.reports.plan_object` for plain values.

    Args:
        path: the file.

    Returns:
        the plan, feasible or not.

    Raises:
        ConfigError: a mistake in the file.
    """
    with jax.enable_x64(True):
        return planning.plan(Path(path))


def minimum_arcs(
    robot: PointMassRobot,
    targets: np.ndarray,
    *,
    start: np.ndarray | None = None,
    z0: np.ndarray | float,
    amplitude: Amplitude | None = None,
    limits: Limits | None = None,
    max_arcs: int = 30,
) -> Answers:
    """Smallest number of arcs to each of many targets, with duration, margin and verdict.

    Args:
        robot: a point mass on three cables.
        targets: (n, 3) m, z down.
        start: (3,) or (n, 3) m; None: at rest in P0.
        z0: () or (n,) depth of P0 below the centroid of the spools, m.
        amplitude: None: the quintic (2.50).
        limits: None: cables taut and the effector below the spools, nothing else.
        max_arcs: largest number of arcs tried.

    Returns:
        the answers, (n,) each.

    Raises:
        InputError: another kind of robot, shapes that do not fit, values that are not finite, z0 not positive,
            max_arcs below 1, or an amplitude function that breaks (2.49).
    """
    if not isinstance(robot, PointMassRobot) or is_planar(robot):
        raise InputError("robot", robot.name, "a point mass on three cables")
    ends = np.asarray(targets, float)
    if ends.ndim != 2 or ends.shape[1] != 3 or not len(ends) or not np.isfinite(ends).all():
        raise InputError("targets", f"shape {ends.shape}", "finite numbers of shape (n, 3), n >= 1")
    if np.shape(z0) not in ((), (len(ends),)):
        raise InputError("z0", f"shape {np.shape(z0)}", f"a number > 0, or ({len(ends)},) of them")
    depth = np.broadcast_to(np.asarray(z0, float), (len(ends),))
    if start is None:
        starts = np.asarray(centroid(robot), float) + np.stack(
            [np.zeros(len(ends)), np.zeros(len(ends)), depth], axis=1
        )
    else:
        starts = np.asarray(start, float)
        if starts.shape not in ((3,), ends.shape) or not np.isfinite(starts).all():
            raise InputError("start", f"shape {starts.shape}", f"finite numbers of shape (3,) or {ends.shape}")
    shared = Shared(robot, limits or Limits(), amplitude or named("quintic"))
    with jax.enable_x64(True):
        return _minimum_arcs(shared, np.broadcast_to(starts, ends.shape).copy(), ends, depth.copy(), max_arcs=max_arcs)
