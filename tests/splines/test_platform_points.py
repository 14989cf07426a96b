"""Motions of the origin of a platform's axes: files, pictures and tables hold that point, and are read back as it."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation
from support.commands import cspr

import cspr_jax
from cspr_jax.config.catalogue import CATALOGUE
from cspr_jax.config.robot import RobotFile
from cspr_jax.outputs.plots.robots.robot_along import moving

TIMES = np.linspace(0.0, 4.0, 9)
# Axes of the platform in its file, from those in which it hangs level: the orientation at rest is not the identity.
AXES = Rotation.from_euler("XYZ", [0.4, -0.2, 0.7])


def six_cables(z_axis: str) -> dict:
    robot = tomllib.loads((CATALOGUE / "nist-robocrane.toml").read_text())
    turn = np.array([1.0, 1.0, 1.0] if z_axis == "up" else [1.0, -1.0, -1.0])
    robot["base_points"] = (np.array(robot["base_points"]) * turn).tolist()
    points = np.array(robot["platform_points"]) * turn
    robot |= {"platform_points": AXES.apply(points).tolist(), "centre_of_mass": AXES.apply([0.02, 0.01, 0.05]).tolist()}
    robot["inertia"] = (AXES.as_matrix() @ np.array(robot["inertia"]) @ AXES.as_matrix().T).tolist()
    return robot | {"z_axis": z_axis}


def eight_cables(_: str) -> dict:
    return tomllib.loads((CATALOGUE / "cogiro.toml").read_text())


def written(path: Path, robot: dict) -> None:
    rows = [f"{key} = {json.dumps(value)}" for key, value in robot.items() if not isinstance(value, dict)]
    path.write_text("\n".join(rows))


CASES = [
    pytest.param((six_cables, "up", AXES.inv()), id="six, up"),
    pytest.param((six_cables, "down", AXES.inv()), id="six, down", marks=pytest.mark.thorough),
    pytest.param((eight_cables, "up", Rotation.identity()), id="eight", marks=pytest.mark.thorough),
]


@pytest.fixture(scope="module", params=CASES)
def checked(request, tmp_path_factory):
    make, z_axis, level = request.param
    folder, robot = tmp_path_factory.mktemp("points"), make(z_axis)
    written(folder / "robot.toml", robot)
    sign, phase = (1.0 if z_axis == "up" else -1.0), np.sin(np.pi * TIMES / 4.0) ** 2
    places = np.stack([0.3 * phase, -0.2 * phase, sign * (0.9 + 0.2 * phase)], axis=1)
    turns = Rotation.from_rotvec(np.outer(phase, [0.05, -0.1, 0.08])) * level
    quaternions = np.roll(turns.as_quat(), 1, axis=1)
    table = np.column_stack([TIMES, places, quaternions])
    np.savetxt(folder / "own.csv", table, delimiter=",", header="t,x,y,z,qw,qx,qy,qz", comments="")
    words = ["--robot", folder / "robot.toml", "--point", "origin"]
    found = [
        cspr("check", folder / "own.csv", *words, "-o", folder / f"out.{end}", "--anyway") for end in ("csv", "h5")
    ]
    return folder, robot, places, turns, words, found


@pytest.mark.thorough
def test_what_was_given_comes_back(checked):
    folder, robot, places, turns, _, found = checked
    assert "files hold the positions of the origin of the platform's axes" in found[0][1]
    table, file = (cspr_jax.open_result(folder / f"out.{end}") for end in ("csv", "h5"))
    assert table.attributes["point"] == file.attributes["point"] == "origin"
    for result in (table, file):
        t, data = result.axes["t"], result.data
        np.testing.assert_allclose(CubicSpline(t, data["position"])(TIMES), places, atol=1e-6)
        given = Rotation.from_quat(np.roll(CubicSpline(t, data["quaternion"])(TIMES), -1, axis=1))
        assert (given * turns.inv()).magnitude().max() < 1e-6
        np.testing.assert_allclose(CubicSpline(t, data["position"])(t, 1), data["velocity"], atol=1e-4)
        np.testing.assert_allclose(CubicSpline(t, data["velocity"])(t[5:-5], 1), data["acceleration"][5:-5], atol=1e-3)
        rotated = Rotation.from_quat(np.roll(data["quaternion"], -1, axis=1))
        centre = data["position"] + rotated.apply(robot["centre_of_mass"])
        np.testing.assert_allclose(data["mass_centre"], centre, atol=1e-12)
        np.testing.assert_array_equal(data["mass_centre"], table.data["mass_centre"])


@pytest.mark.thorough
def test_the_round_trip(checked):
    """With the same options, and without them, for the files say whose positions they hold."""
    folder, _, _, _, words, found = checked
    codes = [found[0][0]]
    for end in ("csv", "h5"):
        for options in (words, words[:2]):
            codes.append(cspr("check", folder / f"out.{end}", *options)[0])
    assert set(codes) == {0}


@pytest.mark.ci("six, down")
@pytest.mark.thorough
def test_pictures_are_of_that_point(checked):
    folder, robot, _, _, words, _ = checked
    result = cspr_jax.open_result(folder / "out.h5")
    drawn = moving(result.data, RobotFile(**robot), np.arange(len(result.axes["t"])))
    lengths = np.linalg.norm(drawn.attached - drawn.base, axis=2)
    np.testing.assert_allclose(lengths, result.data["length"], atol=1e-9)
    assert "origin of the platform" in cspr_jax.plot(folder / "out.csv").get_suptitle()
    assert (
        "origin of the platform" in cspr_jax.plot(folder / "out.csv", robot=words[1], quantity="summary").get_suptitle()
    )
    check = cspr_jax.check(words[1], folder / "own.csv", point="origin")
    np.testing.assert_array_equal(check.plan.rows()["mass_centre"], result.data["mass_centre"])
    assert check.to_dict()["point"] == "origin" and check.plan.to_dict()["point"] == "origin"
