"""Searches from Python: their answers are those of sweeps and plans, and their motions are those of the answers.

In the robot's own axes, and equal to the last bit whatever jax is set to.
"""

import dataclasses
import inspect
import json

import h5py
import jax
import numpy as np
import pytest
from conftest import equilateral
from support.platforms import EFFECTIVE

import cspr_jax
from cspr_jax import cli
from cspr_jax.config.catalogue import CATALOGUE, catalogue_names
from cspr_jax.config.robot import read_robot
from cspr_jax.errors import InputError
from cspr_jax.families.platforms.answers import PlatformMotionAnswers
from cspr_jax.outputs.plan_report import plan_object

PLACES = np.array([[0.5, 0.3, 1.4], [1.2, 0.2, 1.5], [-0.4, 0.6, 1.3]])
TURNS = np.array([[1.0, 0.0, 0.0, 0.0], [np.cos(0.1), np.sin(0.1), 0.0, 0.0], [np.cos(0.05), 0.0, 0.0, np.sin(0.05)]])
SPATIAL = [
    file for file in (read_robot(CATALOGUE / f"{name}.toml") for name in catalogue_names()) if not file.is_planar
]
OF_THREE = [file.name for file in SPATIAL if len(file.base_points) == 3]
SOME = ("prototype",)
FILES = {
    "off-centre": "base_points = [[311.3, -42.8, 7.9], [309.6, -41.9, 8.25], [309.1, -43.8, 8.05]]\nmass = 1.7\n",
    "up": 'z_axis = "up"\nmass = 1.7\nbase_points = [[1.3, 0.2, 3.1], [-0.4, 1.1, 2.75], [-0.9, -0.8, 2.95]]\n',
}
MAX_ARCS = 8


states_reached = jax.jit(jax.vmap(lambda motion, tau: motion.state(tau), (0, None)))
# What other tests of platforms compile for, as a plan writes it.
WRITTEN = {"name": "effective-c3", "epsilon": 0.1}


def reached(answers) -> np.ndarray:
    """Where the motions of answers end."""
    return np.asarray(states_reached(answers.motions(), 1.0).position)


@pytest.mark.parametrize("amplitude", ["quintic", pytest.param("A1", marks=pytest.mark.soak)])
def test_transitions_are_those_of_a_plan(amplitude):
    robot, target = cspr_jax.load_robot("transition-prototype"), [0.9, 0.2, 1.5]
    found = cspr_jax.minimum_oscillations(robot, [target], z0=1.5, amplitude=amplitude)
    plan = cspr_jax.plan(
        {
            "schema": 1,
            "robot": "transition-prototype",
            "family": "transition",
            "amplitude": amplitude,
            "z0": 1.5,
            "pose": [{"rest": True}, {"position": target}],
        }
    )
    assert found.oscillations[0] == plan.answers.oscillations[0] > 0
    assert found.duration[0] == plan.answers.duration[0]
    assert found.margin[0] == pytest.approx(plan.answers.margin[0], rel=1e-9)
    np.testing.assert_allclose(reached(found), [target], atol=1e-12)


@pytest.mark.soak
def test_poses_are_those_of_a_plan():
    """One pose with the preferred beta-hat, as in a plan of one segment that fixes the same."""
    robot = cspr_jax.load_robot("laval-mssm")
    found = cspr_jax.minimum_pose_arcs(robot, PLACES, TURNS, z0=1.4, beta_hat="preferred", amplitude=EFFECTIVE)
    np.testing.assert_allclose(reached(found), PLACES, atol=1e-12)
    rotated = states_reached(found.motions(), 1.0).quaternion
    np.testing.assert_allclose(np.abs(np.sum(np.asarray(rotated) * TURNS, axis=1)), 1.0, atol=1e-12)
    i = 1
    plan = cspr_jax.plan(
        {
            "schema": 1,
            "robot": "laval-mssm",
            "family": "hypocycloid",
            "amplitude": WRITTEN,
            "z0": 1.4,
            "pose": [
                {"rest": True},
                {"position": PLACES[i], "quaternion": TURNS[i], "beta_hat": float(found.beta_hat[i, 1])},
            ],
        }
    )
    assert plan.answers.arcs[0] == found.arcs[i] and plan.answers.duration[0] == found.duration[i]
    assert plan.answers.margin[0] == pytest.approx(found.margin[i], rel=1e-9)
    assert plan.answers.det_margin[0] == pytest.approx(found.det_margin[i], rel=1e-9)


@pytest.mark.thorough
def test_z_up_and_far_away():
    """The same robot with z up, a hundred metres off: the same answers, and motions in its own axes."""
    robot, signs, offset = cspr_jax.load_robot("laval-mssm"), np.array([1.0, -1.0, -1.0]), np.array([100.0, -30.0, 5.0])
    rotated = cspr_jax.platform(
        np.asarray(robot.base_points) * signs + offset,
        np.asarray(robot.platform_points) * signs,
        mass=float(robot.mass),
        inertia=np.asarray(robot.inertia) * np.outer(signs, signs),
        z_axis="up",
    )
    mirrored = TURNS * np.append(1.0, signs)
    here = cspr_jax.minimum_pose_arcs(robot, PLACES, TURNS, z0=1.4, amplitude=EFFECTIVE)
    there = cspr_jax.minimum_pose_arcs(rotated, PLACES * signs + offset, mirrored, z0=1.4, amplitude=EFFECTIVE)
    np.testing.assert_array_equal(here.arcs, there.arcs)
    np.testing.assert_allclose(here.margin, there.margin, rtol=1e-9)
    np.testing.assert_allclose(reached(there), PLACES * signs + offset, atol=1e-10)


@pytest.mark.thorough
def test_attainable_orientations_are_those_of_a_sweep(tmp_path):
    robot, place = cspr_jax.load_robot("laval-mssm"), [0.5, 0.3, 1.4]
    inside, answers = cspr_jax.attainable(robot, place, definition="grid", divisions=4, amplitude=EFFECTIVE)
    assert len(inside.angles) == len(answers.arcs)
    sweep = {
        "schema": 1,
        "map": "attainability",
        "robot": "laval-mssm",
        "axes": {"x": [0.5], "y": [0.3], "z": [1.4]},
        "trajectory": {"family": "hypocycloid", "amplitude": WRITTEN},
        "orientations": {"definition": "grid", "divisions": 4},
    }
    data = cspr_jax.compute_sweep(sweep)
    assert int(data.accessible.item()) == len(inside.angles)
    assert int(data.attainable.item()) == int((answers.arcs > 0).sum())
    volume = cspr_jax.accessible(robot, place, definition="grid", divisions=4).volume.sum()
    assert float(data.accessible_volume.item()) == pytest.approx(volume)


def test_settings_of_jax_do_not_matter():
    """With 64 bits off answers are the same bits, and the settings stay."""
    robot = cspr_jax.load_robot("prototype")
    wanted = cspr_jax.minimum_oscillations(robot, [[0.7, 0.7, 1.7]], z0=1.7)
    with jax.enable_x64(False):
        found = cspr_jax.minimum_oscillations(robot, [[0.7, 0.7, 1.7]], z0=1.7)
        assert not jax.config.read("jax_enable_x64")
    for field in dataclasses.fields(wanted):
        if isinstance(getattr(wanted, field.name), np.ndarray):
            np.testing.assert_array_equal(getattr(wanted, field.name), getattr(found, field.name))


@pytest.mark.parametrize(
    "refused",
    [
        lambda point, mssm: cspr_jax.minimum_oscillations(mssm, PLACES, z0=1.0),
        lambda point, mssm: cspr_jax.minimum_oscillations(point, PLACES, z0=-1.0),
        lambda point, mssm: cspr_jax.minimum_oscillations(point, PLACES, z0=1.0, amplitude="ideal"),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(point, PLACES, z0=1.4),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(mssm, PLACES, TURNS[:2], z0=1.4),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(mssm, PLACES, 2.0 * TURNS, z0=1.4),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(mssm, PLACES, z0=[1.4, 1.5]),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(mssm, PLACES, z0=1.4, amplitude="A1"),
        lambda point, mssm: cspr_jax.accessible(point, PLACES[0]),
        lambda point, mssm: cspr_jax.accessible(mssm, PLACES[0], definition="all"),
        lambda point, mssm: cspr_jax.accessible(mssm, PLACES[0], divisions=5),
        lambda point, mssm: cspr_jax.attainable(mssm, [np.nan, 0.0, 1.0]),
        lambda point, mssm: cspr_jax.attainable(mssm, [0.0, 0.0, -1.0], divisions=4),
        lambda point, mssm: cspr_jax.point_mass([[0, 0, 0], [1, 0, 0]], mass=1.0),
        lambda point, mssm: jax.jit(lambda x: cspr_jax.point_mass(x, mass=1.0).mass)(np.eye(3)),
    ],
)
def test_what_cannot_be_searched_is_refused(refused):
    robots = cspr_jax.load_robot("prototype"), cspr_jax.load_robot("laval-mssm")
    with pytest.raises(InputError) as caught:
        refused(*robots)
    assert "\n" not in str(caught.value) and json.dumps(str(caught.value))


def robot_file(name, folder):
    """A robot of the catalogue by name, or a file of ours by path."""
    if name in OF_THREE:
        return name
    path = folder / f"{name}.toml"
    path.write_text(f'name = "{name}"\n' + FILES[name])
    return str(path)


def grid_about(robot):
    """Targets about and beyond the spools, in the robot's axes: a grid's axes, and z0."""
    base = np.asarray(robot.base_points)
    size, centre = np.linalg.norm(base - base.mean(0), axis=1).max(), base.mean(0)
    down = 1.0 if robot.z_axis == "down" else -1.0
    level = [[float(centre[i] + s * size) for s in (-1.7, -0.3, 0.9, 2.2)] for i in (0, 1)]
    return [*level, [float(centre[2] + down * s * size) for s in (0.4, 1.3, 2.1)]], float(1.6 * size)


def swept(reference, axes, z0, start, floor, folder):
    """The answers of `cspr run` to a grid, flat."""
    lines = [f"{name} = {points}" for name, points in zip("xyz", axes, strict=True)]
    text = f'schema = 1\nmap = "minimum-arcs"\nrobot = "{reference}"\n[axes]\n' + "\n".join(lines)
    text += f"\nz0 = [{z0!r}]\n[trajectory]\nmax_arcs = {MAX_ARCS}\nfrom = {start}\n"
    text += "" if floor is None else f"[limits]\nfloor = {floor}\n"
    (folder / "sweep.toml").write_text(text)
    assert cli.main(["run", str(folder / "sweep.toml"), "-o", str(folder / "run")]) == 0
    with h5py.File(folder / "run" / "sweep.h5") as file:
        return {name: np.asarray(file[name]).ravel() for name in ("arcs", "verdict", "duration", "margin")}


@pytest.mark.parametrize("from_rest", [True, False], ids=["rest", "start"])
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in (*FILES, *SOME) else pytest.mark.soak) for name in (*OF_THREE, *FILES)],
)
def test_python_equals_the_command_line(name, from_rest, tmp_path):
    """Cell by cell, with 64 bits off and strict settings, which stay as the caller has them."""
    reference = robot_file(name, tmp_path)
    with jax.enable_x64(False), jax.numpy_dtype_promotion("strict"), jax.numpy_rank_promotion("raise"):
        robot = cspr_jax.load_robot(reference)
        axes, z0 = grid_about(robot)
        targets = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        start = None if from_rest else targets[16]
        floor = 0.4 if name == "up" else None
        limits = cspr_jax.Limits(floor=floor)
        found = cspr_jax.minimum_arcs(robot, targets, start=start, z0=z0, limits=limits, max_arcs=MAX_ARCS)
        assert not jax.config.read("jax_enable_x64")
        assert jax.config.jax_numpy_dtype_promotion == "strict"
        assert jax.numpy.ones(2).dtype == np.float32
    given = "{ rest = true }" if from_rest else f"{{ position = {targets[16].tolist()} }}"
    wanted = swept(reference, axes, z0, given, floor, tmp_path)
    assert (wanted["arcs"] > 0).any()
    for key, values in wanted.items():
        np.testing.assert_array_equal(getattr(found, key), values, err_msg=key)


def moved(offset):
    """The prototype somewhere else, in numbers as a file holds them."""
    return cspr_jax.point_mass_robot(equilateral(0.26) + offset, mass=0.198)


@pytest.mark.parametrize("far", [1.0, 1e3, 0.99e6])
def test_robots_far_from_the_origin(far):
    """Arcs do not depend on where the origin is; margins only as far as the typed digits carry."""
    rng, offset = np.random.default_rng(5), far * np.array([0.7, -1.0, 0.45])
    targets, start = rng.uniform([-1.1, -1.1, 0.3], [1.1, 1.1, 3.2], (60, 3)), np.array([0.7, 0.7, 3.0])
    targets[:4] = [[0.0, 0.0, 1.7], [-0.7, -0.7, 0.4], [0.35, 0.35, 2.35], [-0.35, -0.35, 1.05]]  # P0; in line with it
    for at in (None, start):
        here = cspr_jax.minimum_arcs(moved(0.0), targets[at is None :], start=at, z0=1.7, max_arcs=MAX_ARCS)
        there = None if at is None else at + offset
        found = cspr_jax.minimum_arcs(
            moved(offset), targets[at is None :] + offset, start=there, z0=1.7, max_arcs=MAX_ARCS
        )
        np.testing.assert_array_equal(found.arcs, here.arcs)
        np.testing.assert_array_equal(found.verdict, here.verdict)
        np.testing.assert_allclose(found.margin, here.margin, rtol=0, atol=max(1e-6, 4e-16 * far / 0.26 * 20.0))


def test_rest_is_recognised_by_meaning():
    """P0 as it is typed with some digits is rest, and 1e-6 of the robot beside it is not."""
    robot = moved(np.array([412.7, -96.1, 33.3]))
    p0 = np.asarray(robot.base_points).mean(0) + np.array([0.0, 0.0, 1.7])
    targets = p0 + np.array([[0.8, 0.3, 0.5], [-0.2, 1.1, -0.4]])
    rest = cspr_jax.minimum_arcs(robot, targets, z0=1.7, max_arcs=MAX_ARCS)
    typed = cspr_jax.minimum_arcs(robot, targets, start=np.round(p0, 10), z0=1.7, max_arcs=MAX_ARCS)
    beside = cspr_jax.minimum_arcs(robot, targets, start=p0 + np.array([2.6e-7, 0.0, 0.0]), z0=1.7, max_arcs=MAX_ARCS)
    np.testing.assert_array_equal(typed.margin, rest.margin)
    assert not np.array_equal(beside.duration, rest.duration)


@pytest.mark.thorough
def test_a_loaded_robot_keeps_its_limits(tmp_path, capsys):
    """A target that the file's largest tension forbids is forbidden in Python too; limits that are given go first."""
    robot, target = cspr_jax.load_robot("laval-large"), [[6.0, 2.0, 5.5]]
    found = cspr_jax.minimum_arcs(robot, target, z0=6.0, max_arcs=MAX_ARCS)
    (tmp_path / "plan.toml").write_text(
        'schema = 1\nrobot = "laval-large"\nz0 = 6.0\nmax_arcs = 8\nsamples = 40\n'
        "[[pose]]\nrest = true\n[[pose]]\nposition = [6.0, 2.0, 5.5]\n"
    )
    assert cli.main(["plan", str(tmp_path / "plan.toml"), "--json"]) == 1
    planned = json.loads(capsys.readouterr().out)["segments"][0]
    assert found.arcs[0] == 0
    assert cspr_jax.Verdict(int(found.verdict[0])).text == planned["verdict"]
    assert planned == plan_object(cspr_jax.plan(tmp_path / "plan.toml"))["segments"][0]
    loose = cspr_jax.Limits(tension_min=0.0, tension_max=1e6, cable_speed_max=1e6, cable_acceleration_max=1e6)
    assert cspr_jax.minimum_arcs(robot, target, z0=6.0, limits=loose, max_arcs=MAX_ARCS).arcs[0] > 0


def test_a_floor_is_in_the_axes_of_the_robot(tmp_path):
    """z up: what lies below z = floor is out of bounds."""
    robot = cspr_jax.load_robot(robot_file("up", tmp_path))
    targets = [[0.9, 0.5, 1.2], [0.9, 0.5, 0.2]]
    found = cspr_jax.minimum_arcs(robot, targets, z0=1.9, limits=cspr_jax.Limits(floor=0.4), max_arcs=MAX_ARCS)
    below = [bool(cspr_jax.Verdict.BELOW_FLOOR & int(v)) for v in found.verdict]
    assert below == [False, True]
    assert found.arcs[0] > 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"targets": [[0.0, np.nan, 1.0]]}, "targets"),
        ({"targets": [[0.0, 0.0, 2e6]]}, "at most 1e6 m"),
        ({"start": [0.0, 1.0]}, "start"),
        ({"start": [0.0, 1.0, np.inf]}, "start"),
        ({"limits": cspr_jax.Limits(tension_max=[1.0, 2.0])}, "limits.tension_max"),
        ({"limits": cspr_jax.Limits(tension_min=3.0, tension_max=2.0)}, "below tension_max"),
        ({"limits": cspr_jax.Limits(cable_speed_max=0.0)}, "limits.cable_speed_max"),
        ({"limits": cspr_jax.Limits(floor=np.nan)}, "limits.floor"),
    ],
)
def test_what_is_no_argument_is_refused(prototype, options, words):
    given = {"targets": [[0.4, 0.1, 1.5]], "z0": 1.7} | options
    with pytest.raises(InputError, match=words):
        cspr_jax.minimum_arcs(prototype, given.pop("targets"), **given)


def test_answers_for_xarray(prototype):
    x, z = np.array([-0.4, 0.1, 0.5]), [1.4, 1.6]
    targets = [[i, 0.2, k] for i in x for k in z]
    answers = cspr_jax.minimum_arcs(prototype, targets, z0=1.7, max_arcs=8)
    flat, found = answers.to_xarray(), answers.to_xarray({"x": x, "z": z})
    assert flat.arcs.dims == ("target",) and found.arcs.dims == ("x", "z")
    np.testing.assert_array_equal(found.margin.values.ravel(), answers.margin)
    assert found.arcs.sel(x=0.1, z=1.6) == answers.arcs[3]
    assert found.duration.attrs["units"] == "s" and found.x.attrs["units"] == "m"
    assert "flag_meanings" in found.verdict.attrs
    for wrong in ({"x": x}, {"x": x, "z": [1.4, 1.6, 1.8]}, {"x": np.zeros((3, 2))}, {}):
        with pytest.raises(InputError, match=r"^dims = .* 6 points"):
            answers.to_xarray(wrong)


@pytest.mark.thorough
def test_answers_between_poses_for_xarray():
    """beta-hat has a value at either end."""
    fields = {name: np.arange(6.0) for name in inspect.signature(PlatformMotionAnswers).parameters}
    answers = PlatformMotionAnswers(**fields | {"beta_hat": np.arange(12.0).reshape(6, 2)})
    found = answers.to_xarray({"tilt": [0.0, 0.1, 0.2], "torsion": [0.0, 0.5]})
    assert found.beta_hat.dims == ("tilt", "torsion", "end") and found.end.values.tolist() == ["start", "target"]
    assert found.beta_hat.sel(tilt=0.2, torsion=0.0, end="target") == 9.0
    assert "target" not in found.beta_hat.attrs["long_name"] and found.det_margin.dims == ("tilt", "torsion")
