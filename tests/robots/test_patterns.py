"""Robots of every pattern of motion: wrenches against virtual work and point masses, pulleys against a root finder."""

import dataclasses
import itertools
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import platform as oracle
from oracles.pulleys import length

import cspr_jax
from cspr_jax.build.robots import error_at_rest
from cspr_jax.cli import main
from cspr_jax.config.robot import read_robot
from cspr_jax.errors import InputError
from cspr_jax.motion.given_limits import limits_over
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.model import pulleys
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line, platform_robot
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.map_kinds import MAP_KINDS

BOX = np.array(list(itertools.product((-2.0, 2.1), (-1.5, 1.6), (0.0, 3.0))))[[1, 7, 3, 4, 6, 0, 2, 5]]
SMALL = np.array([[0.3, -0.2, 0.1], [-0.3, 0.2, 0.1], [0.2, 0.3, -0.1], [-0.2, -0.3, 0.1]])
CORNERS = np.r_[SMALL, -1.1 * SMALL]
FLAT = BOX * np.array([1.0, 0.0, 1.0]) + np.c_[np.linspace(0.0, 0.3, 8), np.zeros(8), np.zeros(8)]
LINE = np.array([0.2, -0.1, 0.4])
MATRIX = jax.jit(lambda robot, at: robot.wrench_matrix(at))
INERTIAL = jax.jit(lambda robot, at: robot.inertial_wrench(at))
ACROSS = jax.jit(across_line)
EXITS = jax.jit(pulleys.exits)
# A body of point masses has its mass centre and inertia by sums.
MASSES = np.array([0.5, 0.7, 0.3, 0.9])
PLACES = np.array([[0.1, 0.0, 0.2], [-0.2, 0.3, 0.0], [0.3, -0.1, 0.1], [0.0, 0.1, -0.3]])


def body(places):
    centre = MASSES @ places / MASSES.sum()
    arms = places - centre
    tensor = np.einsum("k,kij->ij", MASSES, [(a @ a) * np.eye(3) - np.outer(a, a) for a in arms])
    return {"mass": MASSES.sum(), "inertia": tensor, "centre_of_mass": centre}


RODS = np.linspace(-1.0, 1.2, 4)[:, None] * LINE
PLACED = {"1R2T": PLACES * [1.0, 0.0, 1.0], "2R3T": RODS, "3R3T": PLACES, "3R": PLACES}
ATTACHED = {
    "1R2T": CORNERS * [1.0, 0.0, 1.0],
    "2R3T": np.linspace(-0.9, 1.0, 8)[:, None] * LINE,
    "3R3T": CORNERS,
    "3R": CORNERS,
}


def made(pattern, count=8, **more):
    if not PATTERNS[pattern].is_body:
        base = FLAT[:count] if pattern == "2T" else BOX[:count]
        return cspr_jax.point_mass(base, mass=1.7, pattern=pattern, **more)
    base = FLAT[:count] if pattern == "1R2T" else BOX[:count]
    return cspr_jax.platform(base, ATTACHED[pattern][:count], pattern=pattern, **body(PLACED[pattern]), **more)


def state_of(pattern, rng):
    place, velocity, acceleration, omega, spin = rng.normal(size=(5, 3))
    place, turn = np.array([0.1, 0.2, 1.4]) + 0.1 * place, np.array([1.0, 0.2, -0.3, 0.1])
    if pattern in ("1R2T", "2T"):
        place[1] = velocity[1] = acceleration[1] = 0.0
        omega, spin, turn = omega * [0, 1, 0], spin * [0, 1, 0], np.array([1.0, 0.0, 0.25, 0.0])
    if pattern == "3R":
        velocity, acceleration = np.zeros(3), np.zeros(3)
    rotation = oracle.matrix(turn / np.linalg.norm(turn))
    return State(*map(jnp.asarray, (place, velocity, acceleration, rotation, omega, spin)))


def directions(robot, rotation):
    """Velocities and angular velocities of the degrees of freedom, fixed axes."""
    row, still, eye = PATTERNS[robot.pattern], np.zeros(3), np.eye(3)
    moves = [(eye[i], still) for i in row.forces] + [(still, eye[i]) for i in row.moments]
    if row.along_line:
        moves += [(still, rotation @ axis) for axis in np.asarray(ACROSS(robot)).T]
    return moves


def lengths(robot, position, rotation):
    points = position + (np.asarray(robot.platform_points) @ rotation.T if isinstance(robot, PlatformRobot) else 0.0)
    points = np.broadcast_to(points, robot.base_points.shape)
    if robot.pulleys is None:
        return np.linalg.norm(points - np.asarray(robot.base_points), axis=1)
    wheels = zip(robot.base_points, robot.pulleys.axes, robot.pulleys.radius, points, strict=True)
    return np.array([length(*map(np.asarray, one))[0] for one in wheels])


@pytest.mark.quick("2T-False", "3T-True", "1R2T-True", "2R3T-False", "3R3T-True")
@pytest.mark.parametrize("wheels", [False, True])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_wrenches_are_those_of_virtual_work(pattern, wheels):
    """A unit tension does the work by which its cable becomes shorter."""
    robot, rng = made(pattern), np.random.default_rng(3)
    if wheels:
        axis = rng.normal(size=(8, 3)) * [1.0, 0.0 if pattern in ("2T", "1R2T") else 1.0, 1.0]
        robot = cspr_jax.with_cables(robot, pulley_radius=np.linspace(0.02, 0.09, 8), pulley_axes=axis)
    at = state_of(pattern, rng)
    with double_precision():
        matrix = np.asarray(MATRIX(robot, at))
    position, rotation, step = np.asarray(at.position), np.asarray(at.rotation), 1e-6
    moves = directions(robot, rotation)
    assert matrix.shape == (robot.dof, 8) and len(moves) == robot.dof == PATTERNS[pattern].dof
    for row, (velocity, omega) in zip(matrix, moves, strict=True):
        ends = []
        for sign in (1.0, -1.0):
            turn = oracle.matrix(np.r_[1.0, 0.5 * sign * step * omega])
            ends.append(lengths(robot, position + sign * step * velocity, turn @ rotation))
        np.testing.assert_allclose(row, (ends[1] - ends[0]) / (2.0 * step), atol=2e-8)


@pytest.mark.parametrize("pattern", ATTACHED)
def test_inertial_wrenches_are_those_of_point_masses(pattern):
    robot, at = made(pattern), state_of(pattern, np.random.default_rng(4))
    with double_precision():
        found = np.asarray(INERTIAL(robot, at))
    rotation, omega, spin = (np.asarray(x) for x in (at.rotation, at.angular_velocity, at.angular_acceleration))
    about = np.zeros(3) if pattern == "3R" else np.asarray(robot.centre_of_mass)
    arms = (PLACED[pattern] - about) @ rotation.T
    pull = np.asarray(at.acceleration) + np.cross(spin, arms) + np.cross(omega, np.cross(omega, arms))
    forces = MASSES[:, None] * (pull - [0.0, 0.0, 9.81])
    force, moment = forces.sum(0), np.cross(arms, forces).sum(0)
    wanted = [force @ velocity + moment @ turn for velocity, turn in directions(robot, rotation)]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


@pytest.mark.quick("1T", "3R3T")
@pytest.mark.parametrize("pattern", PATTERNS)
def test_any_pattern_is_loaded_from_a_file(tmp_path, pattern):
    """With the fewest cables or more; it keeps its weight, and its wrenches do not depend on where z points."""
    count = PATTERNS[pattern].dof
    robot = made(pattern, count + (pattern == "2T"), z_axis="up")
    keys = {"name": "r", "base_points": np.asarray(robot.base_points).tolist(), "mass": float(robot.mass)}
    keys |= {"pattern": pattern, "z_axis": "up"}
    if PATTERNS[pattern].is_body:
        parts = body(PLACED[pattern])
        keys |= {name: np.asarray(parts[name]).tolist() for name in ("inertia", "centre_of_mass")}
        keys["platform_points"] = ATTACHED[pattern][:count].tolist()
    path = tmp_path / "robot.toml"
    wheels = "cable_diameter = 0.004\npulley_radius = 0.05\n"
    path.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items()) + wheels)
    loaded = cspr_jax.load_robot(path)
    assert (loaded.pattern, loaded.dof) == (pattern, count) and float(loaded.cable_diameter) == 0.004
    np.testing.assert_array_equal(loaded.pulleys.axes, [[0.0, 0.0, 1.0]] * loaded.n_cables)
    bare = dataclasses.replace(loaded, pulleys=None, cable_diameter=None)
    for before, after in zip(jax.tree.leaves(robot), jax.tree.leaves(bare), strict=True):
        np.testing.assert_allclose(after, before, atol=1e-15)
    own, frame = centred(loaded)
    at = state_of(pattern, np.random.default_rng(0))
    signs = np.asarray(frame.signs)
    rotated = signs[:, None] * np.asarray(at.rotation) * signs
    moved = at._replace(position=jnp.asarray(frame.inward(at.position)), rotation=jnp.asarray(rotated))
    with double_precision():
        pair = np.asarray(MATRIX(loaded, at)), np.asarray(MATRIX(own, moved))
    np.testing.assert_allclose(np.abs(pair[0]), np.abs(pair[1]), atol=1e-12)
    if pattern not in ("2T", "3T", "3R3T"):
        assert "not known" not in (error_at_rest(read_robot(path)) or "")


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"pattern": "2R3T"}, 'points on one line, and not all the same: "2R3T"'),
        ({"platform_points": ATTACHED["2R3T"]}, 'all on one line: pattern = "2R3T", a rod'),
        ({"pattern": "1R2T"}, "points with y = 0: the plane of a planar robot"),
        ({"pattern": "1R2T", "platform_points": ATTACHED["1R2T"]}, "base_points.*points with y = 0"),
        ({"pattern": "2R3T", "platform_points": ATTACHED["2R3T"]}, "a point on the line of platform_points"),
        ({"pattern": "3T"}, 'pattern = "3T": must be "1R2T"'),
        ({"pattern": "3R", "inertia": np.diag([1.0, 1.0, 0.0])}, "positive definite"),
    ],
)
def test_bodies_that_do_not_fit_their_pattern(change, line):
    keys = body(PLACES) | {"platform_points": CORNERS} | change
    with pytest.raises(InputError, match=line):
        cspr_jax.platform(BOX, keys.pop("platform_points"), **keys)


def test_what_only_rigid_platforms_have_is_refused_in_one_line(tmp_path, capsys):
    """Families, maps and searches know 2T, 3T and 3R3T; what else a robot may be they say in one line."""
    assert {name for row in FAMILIES.values() for name in row.legs} <= set(PATTERNS)
    assert {name for row in MAP_KINDS.values() for name in row.patterns} <= set(PATTERNS)
    bodies = "platform_points = [[0.1, 0, 0], [-0.1, 0, 0], [0, 0, 0.2]]\ninertia = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    flat = "base_points = [[1, 0, 3], [-1, 0, 3], [0, 0, 0]]"
    three = "base_points = [[1, 0, 3], [-1, 0, 3], [0, 2, 3]]"
    plan = (
        'schema = 1\nrobot = "r.toml"\nfamily = "{family}"\n{z0}[[pose]]\n{first}\n[[pose]]\nposition = [0.1, 0, 1]\n'
    )
    sweep = 'schema = 1\nmap = "{kind}"\nrobot = "r.toml"\n[axes]\nx = [0.1]\ny = [0.0]\nz = [1.0]\n{more}'
    for robot, wanted in (
        (
            f'{flat}\npattern = "1R2T"\n{bodies}',
            ('must be "spline" or "path" or "free" for a planar platform', 'pattern = "1R2T": must be "2T"'),
        ),
        (
            f'{three}\npattern = "3R"\n{bodies}',
            ('must be "spline" or "path" for a platform on a', 'pattern = "3R": must be "2T"'),
        ),
        (f"{three}\npulley_radius = 0.1", (None, "pulley_radius: pulleys: must be absent")),
        (f"{three}\ntension_max = [inf, 5.0, 5.0]", ("tension_max = [inf, 5.0, 5.0]: must be finite",) * 2),
    ):
        (tmp_path / "r.toml").write_text(f'name = "r"\nmass = 1.0\nz_axis = "up"\n{robot}\n')
        (tmp_path / "p.toml").write_text(plan.format(family="s-curve", z0="", first="position = [0, 0, 1]"))
        (tmp_path / "s.toml").write_text(sweep.format(kind="sensitivity", more=""))
        for words, line in zip(
            (["plan", "p.toml"], ["run", "s.toml", "-o", str(tmp_path / "run")]), wanted, strict=True
        ):
            if line is None:
                continue  # plans know pulleys
            code = main([words[0], str(tmp_path / words[1]), *words[2:]])
            err = capsys.readouterr().err.strip()
            assert code == 2 and line in err and len(err.splitlines()) == 1, err
            assert not (tmp_path / "run").exists()
    for pattern in ("1R2T", "3R", "1T", "2R3T"):
        robot = made(pattern, PATTERNS[pattern].dof)
        for ask in (
            lambda robot: cspr_jax.minimum_arcs(robot, np.array([[0.5, 0.0, 1.0]]), z0=1.4),
            lambda robot: cspr_jax.sensitivity(robot, np.array([[0.5, 0.0, 1.0]])),
            lambda robot: cspr_jax.available_accelerations(robot, np.array([[0.5, 0.0, 1.0]])),
            lambda robot: cspr_jax.minimum_pose_arcs(
                robot, np.array([[0.5, 0.0, 1.0]]), np.array([[1.0, 0, 0, 0]]), z0=1.0
            ),
            cspr_jax.make_problem,
            cspr_jax.three_cable_equivalent,
        ):
            with pytest.raises(InputError):
                ask(robot)


def test_infinite_tensions_are_kept(tmp_path):
    path = tmp_path / "r.toml"
    path.write_text(f'name = "r"\nmass = 1.0\nbase_points = {BOX[:4].tolist()}\ntension_max = [inf, 5.0, 6.0, inf]\n')
    robot, robot_file = cspr_jax.load_robot(path), read_robot(path)
    assert np.asarray(robot.limits.tension_max).tolist() == [np.inf, 5.0, 6.0, np.inf]
    settings = json.loads(json.dumps(robot_file.settings, allow_nan=False))
    assert (
        settings["tension_max"] == ["inf", 5.0, 6.0, "inf"]
        and type(robot_file)(**settings).tension_max == robot_file.tension_max
    )
    limits = limits_over(robot, Limits(tension_min=1.0), any_tensions=True)
    assert np.asarray(limits.tension_max)[0] == np.inf
    with pytest.raises(InputError, match="must be finite, or absent"):
        limits_over(robot, None)


def test_pulleys_are_those_of_a_root_finder():
    """Points on all sides of the pulleys; the free cable touches, and the length changes along its direction."""
    rng = np.random.default_rng(11)
    entry, axis, target = rng.normal(size=(3, 200, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    radius = rng.uniform(0.0, 0.3, 200)
    with double_precision():
        found = jax.tree.map(np.asarray, EXITS(entry, axis, radius, target))
        lanes = jax.jit(pulleys.exit_lanes)(*(tuple(x.T) for x in (entry, axis)), radius, tuple(target.T))
        total = jax.jit(jax.grad(lambda to: jnp.sum(sum(pulleys.exits(entry, axis, radius, to)[2:]))))
        rates = np.asarray(total(target))
    lanes = pulleys.Exit(*(np.stack(part, axis=-1) for part in lanes[:2]), *map(np.asarray, lanes[2:]))
    for one, other in zip(found, lanes, strict=True):
        np.testing.assert_allclose(other, one, atol=1e-13)
    high = ((target - entry) * axis).sum(1)
    wide = np.linalg.norm(target - entry - high[:, None] * axis, axis=1)
    outside = np.hypot(wide - radius, high) > radius
    assert outside.sum() > 150 and np.isnan(found.free[~outside]).all()
    for k in np.flatnonzero(outside):
        total, along, point = length(entry[k], axis[k], radius[k], target[k])
        assert found.wrapped[k] + found.free[k] == pytest.approx(total, abs=1e-11)
        np.testing.assert_allclose(found.direction[k], along, atol=1e-9)
        np.testing.assert_allclose(found.point[k], point, atol=1e-9)
    np.testing.assert_allclose(rates[outside], found.direction[outside], atol=1e-9)


def test_small_pulleys_are_points():
    entry, target = np.array([[0.0, 0.0, 2.0]]), np.array([[1.0, 0.5, 0.3]])
    ray = target - entry
    for radius in (0.0, 1e-9):
        with double_precision():
            found = EXITS(entry, np.array([[0.0, 0.0, 1.0]]), np.array([radius]), target)
        assert float(found.free[0] + found.wrapped[0]) == pytest.approx(np.linalg.norm(ray), abs=3e-9)
        np.testing.assert_allclose(found.direction, ray / np.linalg.norm(ray), atol=3e-9)
    with double_precision():  # straight above the pulley nothing is wrapped
        found = EXITS(entry, np.array([[0.0, 0.0, 1.0]]), np.array([0.1]), entry + np.array([0, 0, 0.5]))
    assert float(found.free[0]) == pytest.approx(0.5) and abs(float(found.wrapped[0])) < 1e-12


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"pulley_radius": -0.1}, "pulley_radius = -0.1: must be a number >= 0, in m, or 8"),
        ({"pulley_radius": [0.1, 0.2]}, "pulley_radius = .* or 8: one a cable"),
        ({"pulley_radius": 0.1, "pulley_axes": [0, 0, 0]}, "pulley_axes = .*: must be vectors that are not zero"),
        ({"pulley_radius": 0.1, "pulley_axes": [[0, 0, 1]] * 3}, "pulley_axes = .*: must be a vector"),
        ({"pulley_axes": [0, 0, 1]}, "pulley_axes = .*: must be absent without pulley_radius"),
        ({"cable_diameter": -1.0}, "cable_diameter = -1.0: must be a number >= 0"),
    ],
)
def test_cables_that_are_none(given, line):
    with pytest.raises(InputError, match=line):
        cspr_jax.with_cables(made("3R3T"), **given)


@pytest.mark.thorough
def test_a_rigid_platform_is_as_before():
    """Its wrench has forces first, then moments about the mass centre, whatever the origin of its axes."""
    robot, at = made("3R3T"), state_of("3R3T", np.random.default_rng(2))
    parts = body(PLACES)
    moved = platform_robot(BOX, CORNERS - parts["centre_of_mass"], mass=parts["mass"], inertia=parts["inertia"])
    with double_precision():
        np.testing.assert_allclose(MATRIX(robot, at), MATRIX(moved, at), atol=1e-14)
        np.testing.assert_allclose(INERTIAL(robot, at), INERTIAL(moved, at), atol=1e-12)
