"""Poses of plans and cells of workspaces whose places are those of the origin of a platform, or of its mass centre."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import cspr_jax
from cspr_jax.config.plan import checked_plan
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import ConfigError
from cspr_jax.motion.limits import lowest_depth
from cspr_jax.plans.given_points import with_mass_centres
from cspr_jax.robots.model.state import State
from cspr_jax.workspaces.static_poses import RestPoses

PLAN = Path("plan.toml")
CENTRE = [0.03, -0.02, 0.05]
RING = 0.5 * np.pi + 2.0 * np.pi * np.arange(3) / 3.0
CORNERS = np.stack([np.cos(RING), np.sin(RING), 0.0 * RING], axis=1)
ROBOT = {
    "name": "eccentric",
    "base_points": np.repeat(CORNERS, 2, axis=0).tolist(),
    "platform_points": (0.3 * (-CORNERS[[2, 1, 0, 2, 1, 0]]) + [0.0, 0.0, 0.02]).tolist(),
    "mass": 2.0,
    "inertia": [[0.02, 0.0, 0.0], [0.0, 0.03, 0.0], [0.0, 0.0, 0.04]],
    "centre_of_mass": CENTRE,
}
QUATERNION = np.array([0.9, 0.1, -0.2, 0.3]) / np.linalg.norm([0.9, 0.1, -0.2, 0.3])


@pytest.mark.parametrize("z_axis", ["down", "up"])
def test_poses_of_the_origin_are_those_of_the_mass_centre(z_axis):
    """The mass centre lies R c from the origin, where R also turns the platform from its axes to its reference."""
    sign = 1.0 if z_axis == "down" else -1.0
    place = [0.1, 0.05, sign * 1.2]
    poses = [{"position": place}, {"position": place, "quaternion": QUATERNION.tolist()}, {"rest": True}]
    data = {"schema": 1, "family": "spline", "point": "origin", "robot": ROBOT, "pose": poses}
    keys = checked_plan(data, PLAN)
    robot_file = resolve_robot(ROBOT | {"z_axis": z_axis}, PLAN, Path())
    level, rotated, rest = with_mass_centres(robot_file, keys, PLAN).pose
    arm = np.array(level.position) - place
    assert np.linalg.norm(arm) == pytest.approx(np.linalg.norm(CENTRE)) and rest.position is None
    expected = Rotation.from_quat(np.roll(QUATERNION, -1)).apply(arm)
    np.testing.assert_allclose(np.array(rotated.position) - place, expected, atol=1e-12)
    for point in ("mass-centre", None):
        same = checked_plan(data | {"point": point}, PLAN)
        assert with_mass_centres(robot_file, same, PLAN).pose == same.pose


def test_what_is_always_of_the_mass_centre_is_refused():
    poses = [{"position": [0.0, 0.0, 1.2]}, {"position": [0.1, 0.0, 1.2], "velocity": [0.1, 0.0, 0.0]}]
    keys = checked_plan({"schema": 1, "family": "spline", "point": "origin", "robot": ROBOT, "pose": poses}, PLAN)
    with pytest.raises(ConfigError, match=r'point = "origin": must be "mass-centre" with pose\[1\]\.velocity'):
        with_mass_centres(resolve_robot(ROBOT, PLAN, Path()), keys, PLAN)


def robot_of(numbers):
    names = ("mass", "inertia", "centre_of_mass")
    return cspr_jax.platform(numbers["base_points"], numbers["platform_points"], **{k: numbers[k] for k in names})


def test_cells_of_workspaces_and_the_floor():
    """Origins and mass centres R c apart; the floor is that of the lowest attachment point, or of the mass centre."""
    robot = robot_of(ROBOT)
    places, units = np.array([[0.1, 0.05, 1.2], [0.0, 0.0, 1.0]]), np.stack([QUATERNION, [1.0, 0.0, 0.0, 0.0]])
    turns = Rotation.from_quat(np.roll(units, -1, axis=1))
    limits = cspr_jax.Limits(floor=1.25)
    of_origins = RestPoses(robot, {}, None, limits)
    of_centres = dataclasses.replace(of_origins, of_mass_centre=True)
    points = np.array([turn.apply([*ROBOT["platform_points"], CENTRE]) for turn in turns])
    lowest = places[:, 2] + points[..., 2].max(1)
    margins = of_origins(places, units)["floor_margin"]
    np.testing.assert_allclose(margins, 1.25 - lowest, atol=1e-12)
    same = of_centres(places + turns.apply(CENTRE), units)["floor_margin"]
    np.testing.assert_allclose(same, margins, atol=1e-12)
    for place, turn, depth in zip(places + turns.apply(CENTRE), turns, lowest, strict=True):
        state = State(place, np.zeros(3), np.zeros(3), np.asarray(turn.as_matrix()))
        assert float(lowest_depth(robot, state)) == pytest.approx(depth, abs=1e-12)
