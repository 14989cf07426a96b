"""Platforms that swing among obstacles: verdicts and clearances beside dense samples of cables and platform."""

from types import SimpleNamespace

import numpy as np
import pytest
from oracles import motion_clearance
from oracles.clearance import corners

import cspr_jax
from cspr_jax.robots.shapes import rotation_matrix
from cspr_jax.schema.verdicts import Verdict

SIX = {
    "schema": 1,
    "robot": "laval-mssm",
    "family": "hypocycloid-standard",
    "z0": 1.4,
    "pose": [{"rest": True}, {"position": [0.3, 0.2, 1.3], "tilt_torsion": [0.3, 0.3, 0.2], "arcs": 4}],
    "platform_box": [[-0.16, -0.18, -0.01], [0.16, 0.09, 0.05]],
    "samples": 600,
}
EIGHT = {
    "schema": 1,
    "robot": "cogiro",
    "family": "hypocycloid",
    "amplitude": {"name": "effective-c3", "epsilon": 0.3},
    "z0": 4.0,
    "pose": [{"rest": True}, {"position": [1.5, 1.0, 1.6], "tilt_torsion": [0.3, 0.1, 0.2]}],
    "platform_box": [[-0.5, -0.5, -0.4], [0.5, 0.5, 0.0]],
    "samples": 300,
}
CASES = {
    "six": SIX,
    "variable": SIX | {"family": "hypocycloid", "amplitude": {"name": "effective-c3", "epsilon": 0.1}},
    "eight": EIGHT,
}


def clearances(plan, ball):
    """Of the cables (n, n_cables) and of the platform (n,) from a ball, at all rows."""
    file, rows = plan.robot_file, plan.rows()
    centre = np.array(file.centre_of_mass or (0.0, 0.0, 0.0))
    rotation = np.array([rotation_matrix(q) for q in rows["quaternion"]])
    state = SimpleNamespace(position=rows["position"], rotation=rotation)
    attached = rows["position"][:, None] + (np.array(file.platform_points) - centre) @ np.swapaxes(rotation, 1, 2)
    leaving = np.broadcast_to(np.array(file.base_points), attached.shape)
    low, high = np.array(plan.keys.platform_box)
    box = 0.5 * (low + high) + corners(0.5 * (high - low)[None])[0]
    robot = {"platform_points": box, "centre_of_mass": centre, "cable_diameter": np.max(file.cable_diameter or 0.0)}
    cables = SimpleNamespace(leaving=leaving, attachments=attached)
    return motion_clearance.cables_and_obstacle(robot, cables, ball), motion_clearance.platform_and_obstacle(
        robot, state, ball
    )


def near(plan, way, along):
    """A point beside the place of the platform in the middle of the motion, or on its way to a spool."""
    place = plan.rows()["position"][len(plan.rows()["t"]) // 2]
    return (1.0 - along) * place + along * np.array(plan.robot_file.base_points[0]) + way


@pytest.mark.thorough
@pytest.mark.parametrize("name", CASES)
def test_a_ball_beside_a_platform_and_one_beside_a_cable(name):
    """A little smaller than the space that the samples show it is proved to keep clear, a little larger it is met."""
    keys = CASES[name]
    free = cspr_jax.plan(keys)
    assert free.feasible
    size = float(np.ptp(np.array(free.robot_file.base_points), axis=0).max())
    up = 1.0 if free.robot_file.z_axis == "up" else -1.0
    beneath, beside = near(free, [0.0, 0.0, -0.25 * up * size], 0.0), near(free, [0.03 * size, 0.02 * size, 0.0], 0.6)
    for centre, is_cable in ((beneath, False), (beside, True)):
        cables, platform = clearances(free, {"centre": centre, "radius": 0.0})
        assert (cables.min() < platform.min()) == is_cable
        space = min(cables.min(), platform.min())
        for radius, meets in ((space - 1e-3 * size, False), (space + 1e-3 * size, True)):
            ball = {"kind": "sphere", "centre": centre.tolist(), "radius": radius, "name": "ball"}
            plan = cspr_jax.plan(keys | {"obstacle": [ball]})
            assert Verdict(int(plan.answers.verdict[0])) == (Verdict.OBSTACLE if meets else Verdict.FEASIBLE)
            proof = plan.legs[0].answers.proofs[0]
            obstacles = [row.flag == Verdict.OBSTACLE for row in proof.criteria]
            assert proof.proof.high[obstacles].min() == pytest.approx(space - radius, abs=5e-5 * size)
            assert proof.proof.low[obstacles].min() <= space - radius + 1e-9
            if meets:
                (cause,) = plan.causes[0]
                assert (cause.criterion, cause.obstacle) == ("obstacle", "ball")
                assert cause.cables == ((int(cables.min(0).argmin()),) if is_cable else ())
