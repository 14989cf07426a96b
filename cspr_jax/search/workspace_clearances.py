"""Clearance of the cables of robots at rest, for maps of workspaces. Arrays in, answers out."""

import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.feasibility.workspace import geometry
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.clearance import clearances, scene
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.schema.verdicts import FLAGS, Verdict

BATCH = 4096


def apart(robot: AnyRobot, positions: np.ndarray, quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clearance of the cables of a robot from each other.

    Args:
        robot: centred, z down.
        positions: (n, 3) of the mass centre, m.
        quaternions: (n, 4) unit quaternions, scalar first.

    Returns:
        (n,) m, inf where no two cables can meet; (n,) flags of `Verdict`.
    """
    diameter = 0.0 if robot.cable_diameter is None else np.asarray(robot.cable_diameter)
    turns, ends = quaternions if PATTERNS[robot.pattern].is_body else None, None
    pulleys = robot.pulleys
    if pulleys is not None:
        ends = in_batches(lambda x: geometry.exit_points(robot, pulleys, *x), (positions, quaternions), size=BATCH)
    found = clearances(scene(robot, diameter=diameter), positions, turns, ends=ends)
    verdict = np.where(found.clearance > 0.0, 0, Verdict.CABLE_CABLE)
    return found.clearance, np.where(found.is_open, Verdict.UNDECIDED, verdict).astype(FLAGS)
