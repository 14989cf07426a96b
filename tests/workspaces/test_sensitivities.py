"""Sensitivity to errors of the cable lengths: against displaced robots, in closed form, and the map."""

import itertools

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation
from support.commands import cspr, refuse_sweep
from support.pairs import made, random_pairs

import cspr_jax
from cspr_jax.errors import InputError
from cspr_jax.numerics.linear.rotations import matrix
from cspr_jax.sweep.definition import read_sweep
from cspr_jax.workspaces.sensitivity_map import SensitivityMap

N = 24
SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=6)))
STEP = 1e-6
SWEEP = """schema = 1
map = "sensitivity"
robot = "{robot}"
[axes]
x = [-0.4, 0.0, 0.7]
y = {y}
z = [{z}, {deeper}]
"""


def places_of(given_robot, seed):
    rng = np.random.default_rng(seed)
    return given_robot["exits"].mean(0) + rng.uniform([-1.5, -1.5, 0.3], [1.5, 1.5, 2.5], (N, 3))


def displaced(base, points, place, turn, errors):
    """Displacement and turn, over the largest error, of a platform whose cables are too long by so much."""
    lengths = np.linalg.norm(place + points @ turn.T - base, axis=1)

    def miss(pose):
        points_now = points @ (Rotation.from_rotvec(pose[3:] * STEP).as_matrix() @ turn).T
        return (np.linalg.norm(place + pose[:3] * STEP + points_now - base, axis=1) - lengths) / STEP - errors

    pose = fsolve(miss, np.zeros(6), xtol=1e-10)
    return np.linalg.norm(pose[:3]), np.linalg.norm(pose[3:])


@pytest.mark.parametrize("name", ["laval-mssm", "launch-robot"])
def test_sensitivities_are_those_of_displaced_platforms(name):
    """No matrix here: poses are solved for, with every corner of the errors; tilted, and as the robot stands."""
    robot = cspr_jax.load_robot(name)
    down = 1.0 if robot.z_axis == "down" else -1.0
    place, quaternion = np.array([0.3, -0.2, 0.9 * down]), np.array([0.97, 0.1, -0.05, 0.2])
    quaternion /= np.linalg.norm(quaternion)
    turns = [np.eye(3), np.asarray(matrix(jax.numpy.asarray(quaternion)))]
    found = cspr_jax.sensitivity(robot, [place, place], [[1.0, 0.0, 0.0, 0.0], quaternion])
    plain = cspr_jax.sensitivity(robot, [place])
    for i, turn in enumerate(turns):
        base, points = np.asarray(robot.base_points), np.asarray(robot.platform_points)
        moves = np.array([displaced(base, points, place, turn, signs) for signs in SIGNS[:32]])
        np.testing.assert_allclose([found.sigma_p[i], found.sigma_r[i]], moves.max(0), rtol=3e-5)
    np.testing.assert_allclose([plain.sigma_p[0], plain.sigma_r[0]], [found.sigma_p[0], found.sigma_r[0]], rtol=1e-12)


@settings(max_examples=10)
@given(st.integers(0, 2**20))
def test_the_closed_form_is_that_of_all_six_rows(seed):
    """Random pairs: any shares and directions. Below the square root of 3 there is none."""
    given_robot = random_pairs(seed)
    robot, places = made(given_robot), places_of(given_robot, seed)
    closed = cspr_jax.sensitivity(robot, places)
    whole = cspr_jax.sensitivity(robot, places, np.tile([1.0, 0.0, 0.0, 0.0], (N, 1)))
    good = whole.sigma_r < 1e3
    assert good.sum() > N // 2
    np.testing.assert_allclose(closed.sigma_p[good], whole.sigma_p[good], rtol=1e-9)
    np.testing.assert_allclose(closed.sigma_r[good], whole.sigma_r[good], rtol=1e-9)
    of_three = cspr_jax.sensitivity(cspr_jax.three_cable_equivalent(robot), places)
    np.testing.assert_allclose(of_three.sigma_p, closed.sigma_p, rtol=1e-9)
    assert np.isnan(of_three.sigma_r).all() and (closed.sigma_p >= np.sqrt(3.0) - 1e-12).all()


def test_three_winches_move_it_as_far_as_six_and_do_not_turn_it():
    """Errors that are equal in a pair: the same largest displacement, no turn."""
    given_robot = random_pairs(4)
    place = given_robot["exits"].mean(0) + np.array([0.3, 0.2, 1.4])
    base, points = given_robot["base"], given_robot["platform"] - given_robot["centre"]
    signs = np.empty((8, 6))
    signs[:, given_robot["pairs"]] = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))[:, :, None]
    moves = np.array([displaced(base, points, place, np.eye(3), errors) for errors in signs])
    found = cspr_jax.sensitivity(made(given_robot), [place])
    np.testing.assert_allclose(moves[:, 0].max(), found.sigma_p[0], rtol=3e-5)
    assert moves[:, 1].max() < 1e-4 * found.sigma_r[0]


def test_no_displacement_is_smaller_than_the_errors():
    """A translation changes no length by more than itself, so sigma_p >= 1; at least d over the root of n cables."""
    rng = np.random.default_rng(2)
    platform = cspr_jax.sensitivity(cspr_jax.load_robot("laval-mssm"), rng.uniform([-2, -2, 0.2], [2, 2, 3], (200, 3)))
    assert (platform.sigma_p >= np.sqrt(1.5)).all()
    three = cspr_jax.sensitivity(cspr_jax.load_robot("prototype"), rng.uniform([-2, -2, 0.01], [2, 2, 3], (200, 3)))
    assert (three.sigma_p >= np.sqrt(3.0)).all()
    # Cables at right angles reach the bound.
    corner = cspr_jax.point_mass(np.eye(3) * 2.0, mass=1.0, z_axis="up")
    np.testing.assert_allclose(cspr_jax.sensitivity(corner, [[0.0, 0.0, 0.0]]).sigma_p, np.sqrt(3.0), rtol=1e-14)
    planar = cspr_jax.point_mass([[-1, 0, 0], [1, 0, 0]], mass=1.0, planar=True)
    found = cspr_jax.sensitivity(planar, [[0.0, 0.0, 1.0], [0.2, 0.0, 2.0]])
    np.testing.assert_allclose(found.sigma_p[0], np.sqrt(2.0), rtol=1e-14)
    assert found.sigma_p[1] > np.sqrt(2.0) and np.isnan(found.sigma_r).all()


def test_the_box_of_the_text():
    """(32) and (33): on z = 0 nothing is held; the largest values of the rest are those that theory.md gives."""
    robot = cspr_jax.load_robot("launch-robot")
    plane = cspr_jax.sensitivity(robot, [[0.5, 0.1, 0.0], [0.0, 0.0, 0.0], [0.1, 0.0, -1e-3]])
    assert np.isinf(plane.sigma_p[:2]).all() and np.isinf(plane.sigma_r[:2]).all() and plane.sigma_p[2] > 100.0
    axes = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41), np.linspace(-1, -0.1, 10), indexing="ij")
    found = cspr_jax.sensitivity(robot, np.stack(axes, -1).reshape(-1, 3))
    np.testing.assert_allclose([found.sigma_p.max(), found.sigma_r.max()], [80.98, 718.4], rtol=1e-4)
    np.testing.assert_allclose([found.sigma_p.min(), found.sigma_r.min()], [1.83, 20.8], rtol=1e-2)
    error = cspr_jax.encoder_error(26.75e-3, 2048)
    assert round(1e3 * error, 3) == 0.082
    far, rotated = found.errors(error)
    np.testing.assert_allclose(far, found.sigma_p * error)
    np.testing.assert_allclose(rotated, found.sigma_r * error)


def test_mistakes():
    robot, hall = cspr_jax.load_robot("launch-robot"), cspr_jax.load_robot("boralugoda-rectangle")
    found = cspr_jax.sensitivity(robot, [[0.0, 0.0, -0.5]])
    for call, words in (
        (lambda: cspr_jax.sensitivity(hall, [[1.0, 1.0, 1.0]]), "4 points: must be 3"),
        (lambda: cspr_jax.sensitivity("launch-robot", [[1.0, 1.0, 1.0]]), "a point mass or a platform"),
        (lambda: cspr_jax.sensitivity(robot, [[1.0, 1.0]]), "positions"),
        (lambda: cspr_jax.sensitivity(robot, [[0.0, 0.0, -1.0]], [[2.0, 0, 0, 0]]), "orientations"),
        (
            lambda: cspr_jax.sensitivity(cspr_jax.load_robot("prototype"), [[0.0, 0.0, 1.0]], [[1.0, 0, 0, 0]]),
            "a point mass has none",
        ),
        (lambda: found.errors(-1.0), "cable_error"),
        (lambda: cspr_jax.encoder_error(0.02, 0), "pulses"),
    ):
        with pytest.raises(InputError, match=words):
            call()


@pytest.mark.parametrize(
    ("name", "y", "depths"),
    [
        ("launch-robot", [0.1, 0.5], (-0.5, -0.9)),
        ("laval-mssm", [0.1, 0.5], (0.5, 0.9)),
        ("prototype", [0.1, 0.5], (0.5, 0.9)),
        ("transition-planar", [0.0], (0.5, 0.9)),
    ],
)
def test_the_map_is_what_python_says(tmp_path, name, y, depths):
    (tmp_path / "s.toml").write_text(SWEEP.format(robot=name, y=y, z=depths[0], deeper=depths[1]))
    assert cspr("run", tmp_path / "s.toml", "-o", tmp_path / "run")[0] == 0
    result = cspr_jax.open_result(tmp_path / "run" / "s.h5")
    grid = np.stack(np.meshgrid(*result.axes.values(), indexing="ij"), -1).reshape(-1, 3)
    wanted = cspr_jax.sensitivity(cspr_jax.load_robot(name), grid)
    np.testing.assert_allclose(result.data["sigma_p"].ravel(), wanted.sigma_p, rtol=1e-12)
    np.testing.assert_allclose(result.data["sigma_r"].ravel(), wanted.sigma_r, rtol=1e-12)
    assert result.units["sigma_p"] == "m m-1" and result.units["sigma_r"] == "rad m-1"


def test_its_picture(tmp_path, figures):
    (tmp_path / "s.toml").write_text(SWEEP.format(robot="launch-robot", y=[0.0, 0.4], z=-0.2, deeper=-0.6))
    assert cspr("run", tmp_path / "s.toml", "-o", tmp_path / "run")[0] == 0
    assert cspr("plot", tmp_path / "run" / "s.h5", "-o", tmp_path / "s.png")[0] == 0
    assert figures[0].get_suptitle().startswith("launch-robot: sensitivity of the position")
    label = " ".join(figures[0].axes[-1].get_ylabel().split())
    assert label.startswith("sensitivity of the position (m/m)")


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_positions_of_the_origin(angle):
    """Of a platform whose file's axes are, or are not, those of its reference orientation."""
    mssm, axes = cspr_jax.load_robot("laval-mssm"), Rotation.from_euler("z", angle)
    centre, inertia = np.array([0.02, -0.01, 0.03]), axes.as_matrix() @ np.asarray(mssm.inertia) @ axes.as_matrix().T
    points, arm = axes.apply(np.asarray(mssm.platform_points)), axes.apply(centre)
    robot = cspr_jax.platform(mssm.base_points, points, mass=1.0, inertia=inertia, centre_of_mass=arm, z_axis="down")
    places = np.random.default_rng(0).uniform([-0.3, -0.3, 1.0], [0.3, 0.3, 1.6], (6, 3))
    turns = Rotation.from_rotvec(0.2 * Rotation.random(6, random_state=1).as_rotvec())
    quaternions = turns.as_quat(scalar_first=True)
    of_origin = cspr_jax.sensitivity(robot, places, quaternions, point="origin")
    of_centre = cspr_jax.sensitivity(robot, places + turns.apply(centre), quaternions)
    np.testing.assert_allclose(of_origin.sigma_p, of_centre.sigma_p, rtol=1e-9)
    np.testing.assert_allclose(of_origin.sigma_r, of_centre.sigma_r, rtol=1e-9)
    assert np.abs(cspr_jax.sensitivity(robot, places, quaternions).sigma_p - of_centre.sigma_p).max() > 0.01


@pytest.mark.parametrize("z_axis", ["down", "up"])
def test_a_map_of_places_of_the_origin(tmp_path, z_axis):
    """That of the mass centre beside it, of a robot whose reference orientation is that of its file."""
    mssm, sign = cspr_jax.load_robot("laval-mssm"), 1.0 if z_axis == "down" else -1.0
    turn = np.diag([1.0, sign, sign])
    centre = turn @ [0.02, -0.01, 0.0]
    robot = {name: (np.asarray(getattr(mssm, name)) @ turn).tolist() for name in ("base_points", "platform_points")}
    robot |= {"name": "shifted", "mass": 1.0, "inertia": np.asarray(mssm.inertia).tolist()}
    robot |= {"z_axis": z_axis, "centre_of_mass": centre.tolist()}
    axes = {"x": np.array([-0.4, 0.7]), "y": np.array([0.1, 0.5]), "z": np.array([0.5, 0.9]) * sign}

    def sigmas(name, shift, **keys):
        moved = {axis: (points + shift[i]).tolist() for i, (axis, points) in enumerate(axes.items())}
        keys |= {"schema": 1, "map": "sensitivity", "robot": robot, "axes": moved}
        result = cspr_jax.open_result(cspr_jax.run(keys, tmp_path / name))
        return np.stack([result.data["sigma_p"], result.data["sigma_r"]])

    beside = sigmas("centre", centre)
    np.testing.assert_allclose(sigmas("origin", np.zeros(3), point="origin"), beside, rtol=1e-9)
    plain = sigmas("plain", np.zeros(3))
    np.testing.assert_array_equal(sigmas("named", np.zeros(3), point="mass-centre"), plain)
    assert np.abs(plain - beside).max() > 0.01


@pytest.mark.parametrize(
    ("robot", "y", "words"),
    [("boralugoda-rectangle", [0.1], "4 points: must be 3 in this map"), ("transition-planar", [0.1], "axes.y")],
)
def test_sweeps_that_are_refused(tmp_path, robot, y, words):
    refuse_sweep(tmp_path, SWEEP.format(robot=robot, y=y, z=0.5, deeper=0.9), words)


def test_numbers_that_contradict_each_other_are_noticed(tmp_path):
    (tmp_path / "s.toml").write_text(SWEEP.format(robot="prototype", y=[0.0], z=0.5, deeper=0.9))
    sweep = read_sweep(tmp_path / "s.toml")
    known = SensitivityMap(sweep.robot, sweep.spec, sweep.file)
    answers = {"sigma_p": np.array([2.0, 0.5, np.nan, np.inf]), "sigma_r": np.array([1.0, np.nan, -1.0, np.inf])}
    faults = known.contradictions(answers)
    assert [list(cells) for cells in faults.values()] == [[False, True, True, False], [False, False, True, False]]
