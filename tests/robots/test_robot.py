"""Robots of any number of cables: what they are, their wrenches, and what needs as many cables as freedoms."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TILTED, equilateral
from oracles import platform as oracle

import cspr_jax
from cspr_jax.build.robots import error_at_rest
from cspr_jax.cli import main
from cspr_jax.config.catalogue import CATALOGUE, REST_ERRORS, catalogue_names
from cspr_jax.config.keys.limits import LimitKeys, LimitTable
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile, read_robot
from cspr_jax.errors import InputError
from cspr_jax.families.swings.proof import limit_slacks
from cspr_jax.motion.limits import Values, scales, slack, values
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.search import minima
from cspr_jax.robots.model.limits import Limits, Uncertainty
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.model.point_mass import planar_robot, plane_normal, point_mass_robot
from cspr_jax.robots.model.robot import check_determined
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.winch_numbers import WINCH_LIMITS
from cspr_jax.robots.statics import force_balance, wrench_balance
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.limits import LIMITS, UNCERTAINTIES

RNG = np.random.default_rng(5)
RING = np.array([[np.cos(a), np.sin(a), 0.1 * np.sin(3.0 * a)] for a in np.arange(8) * 0.7])
BODY = {"mass": 2.0, "inertia": np.diag([0.02, 0.03, 0.04])}


def platform(n_cables, **more):
    rotated = 0.3 * RING[:n_cables] @ oracle.matrix(np.array([0.9, 0.1, -0.2, 0.3])).T
    return platform_robot(2.0 * RING[:n_cables], rotated, **BODY, **more)


ROBOTS = {
    "planar": planar_robot([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], mass=0.4),
    "planar of four": planar_robot([[1, 0, -1], [-1, 0, -0.8], [-1.1, 0, 1], [0.9, 0, 1.2]], mass=0.4),
    "three": point_mass_robot(TILTED, mass=0.7),
    "four": point_mass_robot(RING[:4], mass=0.7),
    "eight": point_mass_robot(RING, mass=0.7),
    "six": platform(6),
    "seven": platform(7),
    "platform of eight": platform(8),
}


def state(robot, rng):
    """A random state below the spools."""
    place = np.array([0.2, 0.3, 1.3]) + 0.2 * rng.normal(size=3)
    velocity, acceleration, omega, spin = rng.normal(size=(4, 3))
    if robot.dof == 2:
        place[1] = velocity[1] = acceleration[1] = 0.0
    if robot.dof < 6:
        return State(*map(jnp.asarray, (place, velocity, acceleration)))
    rotation = oracle.matrix(np.array([0.9, 0.2, 0.1, -0.1]))
    return State(*map(jnp.asarray, (place, velocity, acceleration, rotation, omega, spin)))


@jax.jit
def wrenches(robot, at):
    """Wrench matrix, wrench and tensions; of more cables than freedoms no tensions."""
    pull = tensions(robot, at) if robot.n_cables == robot.dof else None
    return robot.wrench_matrix(at), robot.inertial_wrench(at), pull


def tensions(robot, at):
    if robot.dof == 6:
        return wrench_balance.tensions(robot, at)
    return force_balance.tensions(robot, at.position, at.acceleration)


@pytest.mark.parametrize("name", ROBOTS)
def test_wrenches(name):
    """W t = w: of as many cables as freedoms with the tensions that the balance gives, of more with the least ones."""
    robot, rng = ROBOTS[name], np.random.default_rng(1)
    for _ in range(5):
        at = state(robot, rng)
        matrix, wrench, pull = jax.tree.map(np.asarray, wrenches(robot, at))
        assert matrix.shape == (robot.dof, robot.n_cables) and wrench.shape == (robot.dof,)
        if pull is None:
            pull = np.linalg.lstsq(matrix, wrench, rcond=None)[0]
        np.testing.assert_allclose(matrix @ pull, wrench, atol=1e-11 * (1.0 + np.abs(pull).sum()))
        rays = np.asarray(robot.base_points) - np.asarray(at.position)
        if robot.dof == 6:
            rays = rays - np.asarray(robot.platform_points) @ np.asarray(at.rotation).T
        units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        force = units.T[[0, 2]] if robot.dof == 2 else units.T
        np.testing.assert_allclose(matrix[:3], force, atol=1e-14)


@pytest.mark.parametrize("name", ROBOTS)
def test_freedoms_are_known_when_compiled(name):
    """What a robot is does not come from the shape of its arrays, and stays when it is changed or mapped over."""
    robot = ROBOTS[name]
    many = jax.tree.map(lambda leaf: np.stack([leaf, leaf]), robot)
    assert (many.dof, many.n_cables) == (robot.dof, robot.n_cables)
    assert dataclasses.replace(robot, mass=jnp.asarray(2.0)).dof == robot.dof
    assert jax.eval_shape(lambda robot: jnp.zeros(robot.dof), robot).shape == (robot.dof,)


@pytest.mark.parametrize("name", [name for name, robot in ROBOTS.items() if robot.n_cables > robot.dof])
def test_tensions_need_as_many_cables_as_freedoms(name):
    """More cables share a wrench in many ways: no number is given for one of them."""
    robot = ROBOTS[name]
    for refused in (check_determined, lambda robot: jax.eval_shape(tensions, robot, state(robot, RNG))):
        with pytest.raises(InputError, match=rf"base_points: {robot.n_cables} points: must be {robot.dof} \(what"):
            refused(robot)


def test_the_plane_of_many_spools():
    """The least-squares plane; of spools in one plane it is that plane, however many."""
    slope = np.array([0.2, -0.1])
    points = np.c_[RING[:, :2], RING[:, :2] @ slope]
    points -= points.mean(0)
    wanted = [*-slope, 1.0]
    for count in (3, 5, 8):
        some = points[:count] - points[:count].mean(0)
        np.testing.assert_allclose(plane_normal(point_mass_robot(some, mass=1.0)), wanted, atol=1e-12)
    line = np.array([[x, 0.0, 0.3 * x] for x in (-1.0, -0.5, 0.5, 1.0)])
    np.testing.assert_allclose(plane_normal(planar_robot(line, mass=1.0)), [-0.3, 0.0, 1.0], atol=1e-12)


LINE = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [3.0, 3.0, 3.0]]
UPRIGHT = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    ("make", "points", "line"),
    [
        (point_mass_robot, equilateral(1.0)[:2], "base_points: 2 points: must be 3 or more, one a cable"),
        (planar_robot, [[1.0, 0.0, 0.0]], "base_points: 1 points: must be 2 or more, one a cable"),
        (point_mass_robot, LINE, "not on one line"),
        (point_mass_robot, UPRIGHT, "plane is not vertical"),
        (point_mass_robot, np.zeros((3, 2)), "three coordinates"),
        (planar_robot, [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], "not on a vertical line"),
        (planar_robot, [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, 2.0]], "not on a vertical line"),
        (planar_robot, [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.1]], "two spools on a level line"),
        (planar_robot, [[1.0, 0.0, 0.0], [-1.0, 0.1, 0.0]], "points with y = 0"),
        (lambda points, mass: point_mass_robot(points, mass=mass, pattern="3R"), RING[:3], 'pattern = "3R": must be'),
        (lambda points, mass: platform_robot(points, RING[:6], **BODY), RING[:5], "base_points: 5 points: must be 6"),
        (lambda points, mass: platform_robot(points, RING[:6], **BODY), RING, "platform_points: 6 points: must be 8"),
        (lambda points, mass: platform_robot(RING, points, **BODY), np.tile(RING[0], (8, 1)), "or coincident"),
    ],
)
def test_geometry_that_is_none(make, points, line):
    with pytest.raises(InputError, match=line):
        make(points, mass=1.0)


def test_what_is_singular():
    """One rule: what is beyond a singularity, or no number, is not regular either; the reference pose is."""
    found = wrench_balance.is_regular(np.array([1.0, 2e-6, 1e-7, -1e-7, -1.0, np.nan]))
    assert found.tolist() == [True, True, False, False, False, False]
    fraction = jax.jit(wrench_balance.determinant_ratio)(ROBOTS["six"], np.array([0.0, 0.0, 1.2]), np.eye(3))
    assert float(fraction) == pytest.approx(1.0)


def test_cylindrical_frames_turn_with_their_place():
    """(3.98): a tilt towards the vertical axis is one, wherever the place lies; a turn about it moves both alike."""
    places, angle = np.array([[1.0, 0.2, 1.0], [-0.3, 0.8, 2.0], [-1.0, -1.0, 1.0]]), 0.7
    rotated = places @ rotations.about_vertical(angle).T
    shift = rotations.cylindrical_frames(rotated) - rotations.cylindrical_frames(places)
    np.testing.assert_allclose(np.cos(shift[:, 0] - angle), 1.0, atol=1e-14)
    assert (shift[:, 1:] == 0.0).all()


def test_golden_sections_find_a_minimum():
    def function(x):
        return abs(x - 0.3) + 0.1 * x**2

    left, right = minima.inner_points(0.0, 1.0)
    bracket = minima.Bracket(0.0, 1.0, left, right, *map(float, function(np.array([left, right]))))
    step = jax.jit(lambda bracket: minima.golden_step(function, bracket))
    for _ in range(40):
        bracket, value = jax.tree.map(float, step(bracket))
    assert float(bracket.low) <= 0.3 + 1e-9 and float(bracket.high) >= 0.3 - 1e-9
    assert float(bracket.high - bracket.low) == pytest.approx(minima.GOLDEN**40, rel=1e-6, abs=1e-15)
    assert float(value) == pytest.approx(0.009, abs=1e-7)


SPOOLS = [[-2.0, -2.0, 3.0], [2.0, -2.0, 3.1], [2.0, 2.0, 3.0], [-2.0, 2.0, 2.9]]
BOX = [*SPOOLS, *([x, y, 0.0] for x, y, _ in SPOOLS)]
CORNERS = [[0.1 * x, 0.1 * y, 0.05 * z] for x, y, z in BOX]
FILES = {
    "four": ("3T", SPOOLS, ""),
    "three planar": ("2T", [[-1, 0, 2], [1, 0, 2.5], [0, 0, 0]], "planar = true"),
    "seven": ("3R3T", BOX[:7], f"platform_points = {CORNERS[:7]}"),
    "eight": ("3R3T", BOX, f"platform_points = {CORNERS}"),
    "eight on a mass": ("3T", BOX, ""),
}
ENVELOPES = """schema = 1
map = "transition-envelopes"
robot = "robot.toml"
[axes]
x = [0.5]
y = [0.0]
z = [1.4]
z0 = [1.4]
tau = [0.0, 0.5, 1.0]
[trajectory]
family = "transition"
"""


def written(folder, name):
    pattern, points, more = FILES[name]
    body = "inertia = [[0.02, 0, 0], [0, 0.03, 0], [0, 0, 0.04]]" if pattern == "3R3T" else ""
    each = [round(0.1 * (k + 1), 1) for k in range(len(points))]
    text = f"""name = "{name}"\nbase_points = {points}\nmass = 2.0\nz_axis = "up"\npattern = "{pattern}"\n{more}\n{body}
tension_min = {each}\ntension_max = 90.0\ncable_speed_max = 3.0\n"""
    (folder / "robot.toml").write_text(text)
    return folder / "robot.toml", each


@pytest.mark.quick("four", "eight on a mass")
@pytest.mark.parametrize("name", FILES)
def test_files_of_any_number_of_cables_load(tmp_path, name):
    """With their limits, in the file's axes; what a plan or a map would need more for says so in one line."""
    path, each = written(tmp_path, name)
    robot, (pattern, points, _) = cspr_jax.load_robot(path), FILES[name]
    assert (robot.n_cables, robot.z_axis, robot.dof) == (len(points), "up", {"2T": 2, "3T": 3, "3R3T": 6}[pattern])
    np.testing.assert_array_equal(robot.base_points, points)
    np.testing.assert_array_equal(robot.limits.tension_min, each)
    np.testing.assert_array_equal(robot.limits.tension_max, [90.0] * len(points))
    assert "not known" not in (error_at_rest(read_robot(path)) or "")
    at, is_platform = state(robot, RNG), pattern == "3R3T"
    own = centred(robot)[0]
    assert jax.eval_shape(own.wrench_matrix, at).shape == (robot.dof, len(points))
    if not is_platform:
        with pytest.raises(InputError, match=f"base_points: {len(points)} points: must be {robot.dof}"):
            cspr_jax.make_problem(robot)


@pytest.mark.parametrize("name", ["four", "three planar", "eight on a mass"])
def test_maps_of_more_cables_say_that_they_do_not_exist(tmp_path, name, capsys):
    """Envelopes are those of pseudotensions; maps of swings exist: `swings.test_redundant_arcs`."""
    path, _ = written(tmp_path, name)
    count, freedoms = len(FILES[name][1]), 2 if "planar" in name else 3
    (tmp_path / "sweep.toml").write_text(ENVELOPES)
    code = main(["run", str(tmp_path / "sweep.toml"), "-o", str(tmp_path / "run")])
    line = capsys.readouterr().err.strip()
    wanted = f'{path}: base_points: {count} points: must be {freedoms} for family "transition" (it does not exist yet'
    assert code == 2 and wanted in line and len(line.splitlines()) == 1, line
    assert not (tmp_path / "run").exists()


def test_an_inline_robot_of_more_cables_is_named_where_it_stands(tmp_path, capsys):
    inline = f'{{ name = "r", base_points = {SPOOLS}, mass = 1.0 }}'
    (tmp_path / "sweep.toml").write_text(ENVELOPES.replace('"robot.toml"', inline))
    assert main(["run", str(tmp_path / "sweep.toml"), "-o", str(tmp_path / "run")]) == 2
    assert "sweep.toml: robot.base_points: 4 points: must be 3 for family" in capsys.readouterr().err


def test_a_limit_is_one_row():
    """Keys in files, fields of `Limits`, closed forms of point masses and values of a state: of each row one."""
    names, other = [row.name for row in LIMITS], {"uncertainty"}
    assert {field.name for field in dataclasses.fields(Limits)} - other == set(names)
    assert set(limit_slacks.CLOSED) == {row.name for row in LIMITS if not row.of_winch}
    assert set(LimitTable.model_fields) - other - {"tension_margin"} == set(names) <= set(PlanFile.model_fields)
    assert {field.name for field in dataclasses.fields(Uncertainty)} == {row.name for row in UNCERTAINTIES}
    own = {row.name for row in LIMITS if row.per_cable and not row.of_winch}
    assert set(LimitKeys.model_fields) == own <= set(RobotFile.model_fields)
    assert {row.name for row in LIMITS if row.of_winch} == {row.name for row in WINCH_LIMITS}
    assert {row.quantity for row in LIMITS if not row.of_winch} == set(Values._fields)
    assert len({(row.quantity, row.sense) for row in LIMITS}) == len(names)


@pytest.mark.parametrize("name", ["planar", "three", "six"])
def test_slacks_of_limits_have_the_sign_of_the_limit(name):
    """Of a value just inside of each limit, and just outside."""
    robot, rng = ROBOTS[name], np.random.default_rng(7)
    now = jax.tree.map(np.asarray, jax.jit(values)(robot, state(robot, rng)))
    scale = scales(robot.n_cables, robot.mass * robot.gravity, 1.3)

    @jax.jit
    def slacks(now, fraction):
        limits = {
            row: (value := getattr(now, row.quantity)) - fraction * abs(value) * (1.0 if row.sense == "least" else -1.0)
            for row in LIMITS
            if not row.of_winch
        }
        return {row.name: slack(row, limit, getattr(now, row.quantity), scale) for row, limit in limits.items()}

    for fraction in (-0.1, 0.1):
        for row, found in slacks(now, fraction).items():
            assert (np.sign(found) == np.sign(fraction)).all(), row


@pytest.mark.thorough
@pytest.mark.parametrize("name", catalogue_names())
def test_the_list_of_the_catalogue_knows_who_cannot_hang_taut(name):
    """It is stored, since the list is to answer at once."""
    assert error_at_rest(read_robot(CATALOGUE / f"{name}.toml")) == REST_ERRORS.get(name)
