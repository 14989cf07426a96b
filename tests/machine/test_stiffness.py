"""Stiffness and natural frequencies: against the energy of springs in long doubles, closed forms, and symmetries."""

import dataclasses

import numpy as np
import pytest
import scipy.linalg
from oracles.elastic_cables import Hanging
from scipy.spatial.transform import Rotation
from support.cable_robots import any_robot

import cspr_jax
from cspr_jax.errors import InputError
from cspr_jax.robots.model.limits import Limits

G = 9.81
AREA = 2e4  # N, EA
AXES = {"1T": [2], "2T": [0, 2], "3T": [0, 1, 2], "1R2T": [0, 2, 4], "3R3T": list(range(6)), "3R": [3, 4, 5]}


def robots(pattern, count, *, seed=1, radius=None):
    """A robot, its file's numbers, and a pose."""
    rng = np.random.default_rng(seed)
    given = any_robot(rng, pattern, count)
    place, matrix = given.pose(rng)
    is_body = pattern in ("1R2T", "2R3T", "3R3T", "3R")
    numbers = {"mass": given.mass, "gravity": G, "z_axis": "up", "pattern": pattern}
    if is_body:
        axes = Rotation.from_rotvec([0.3, 0.5, -0.2]).as_matrix()
        moments = [0.1, 0.1, 0.1] if pattern in ("1R2T", "2R3T") else [0.3, 0.5, 0.6]
        tensor = given.mass * axes @ np.diag(moments) @ axes.T
        numbers |= {"inertia": tensor, "centre_of_mass": given.arm}
        robot = cspr_jax.platform(given.base, given.platform, **numbers)
    else:
        robot = cspr_jax.point_mass(given.base, **numbers)
    stiff = AREA * rng.uniform(0.5, 2.0, count)
    pulleys = {} if radius is None else {"pulley_radius": radius * rng.uniform(0.5, 1.5, count)}
    robot = cspr_jax.with_cables(robot, axial_stiffness=stiff, **pulleys)
    tensions = rng.uniform(10.0, 60.0, count)
    points = given.platform @ matrix.T if is_body else np.zeros((count, 3))
    arm = matrix @ np.asarray(given.arm)
    hanging = Hanging(
        given.base, points, stiff, tensions, given.mass, -G, place, arm if pattern == "3R" else np.zeros(3)
    )
    if radius is not None:
        hanging.radius = np.asarray(robot.pulleys.radius)
        hanging.axes = np.tile([0.0, 0.0, 1.0], (count, 1))
    quaternion = np.roll(Rotation.from_matrix(matrix).as_quat(), 1)[None] if is_body else None
    return robot, hanging, (place[None], quaternion)


def _compared(pattern, count, **more):
    robot, hanging, pose = robots(pattern, count, **more)
    found = cspr_jax.stiffness(robot, *pose, tensions=hanging.tensions)
    directions = np.asarray(found.twists[0])
    if pattern in AXES:
        np.testing.assert_array_equal(directions, np.eye(6)[AXES[pattern]])
    expected = hanging.stiffness_matrix(directions)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found.matrix[0], expected, atol=1e-8 * scale)
    np.testing.assert_allclose(found.matrix, found.elastic + found.geometric, atol=1e-12 * scale)
    np.testing.assert_allclose(found.unstretched_lengths[0], hanging.unstretched().astype(float), rtol=1e-13)
    # Without the tensions' part the comparison fails.
    assert pattern == "1T" or np.abs(found.elastic[0] - expected).max() > 1e-4 * scale
    return robot, hanging, found


@pytest.mark.parametrize(("pattern", "count"), [("3R3T", 7), ("3R", 4)])
def test_second_derivatives_of_the_energy(pattern, count):
    """Any tensions, not only those of an equilibrium."""
    _compared(pattern, count)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("pattern", "count"), [("1T", 1), ("1T", 3), ("2T", 4), ("3T", 3), ("3T", 4), ("1R2T", 4), ("2R3T", 6), ("3R3T", 6)]
)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_pattern(pattern, count, seed):
    _compared(pattern, count, seed=seed)


@pytest.mark.parametrize(
    ("pattern", "count"),
    [("3T", 3), *(pytest.param(*row, marks=pytest.mark.thorough) for row in [("3R3T", 8), ("1R2T", 4), ("3R", 4)])],
)
def test_with_pulleys(pattern, count):
    """The arc stretches, too."""
    _compared(pattern, count, radius=0.12)


def test_at_rest_it_is_the_derivative_of_the_wrench():
    """Minus the derivative of force and moment, which is not symmetric elsewhere; moments about the moved centre."""
    robot = cspr_jax.with_cables(cspr_jax.load_robot("cogiro"), axial_stiffness=1e5)
    place, turn = np.array([0.4, -0.3, 1.6]), Rotation.from_rotvec([0.02, -0.03, 0.05])
    found = cspr_jax.stiffness(robot, place[None], np.roll(turn.as_quat(), 1)[None], point="mass-centre")
    base, stiff = np.asarray(robot.base_points), np.asarray(robot.axial_stiffness)
    inner = np.asarray(robot.platform_points)

    def wrench(twist):
        arms = (Rotation.from_rotvec(twist[3:]) * turn).apply(inner)
        rays = base - (place + twist[:3] + arms)
        length = np.linalg.norm(rays, axis=1)
        pulls = (stiff * (length / found.unstretched_lengths[0] - 1.0) / length)[:, None] * rays
        weight = [0.0, 0.0, -float(robot.mass) * float(robot.gravity)]
        return np.concatenate([pulls.sum(0) + weight, np.cross(arms, pulls).sum(0)])

    assert np.abs(wrench(np.zeros(6))).max() < 1e-8  # of 4900 N
    step, matrix = 1e-5, np.empty((6, 6))
    for k, unit in enumerate(np.eye(6)):
        matrix[:, k] = -(wrench(step * unit) - wrench(-step * unit)) / (2.0 * step)
    np.testing.assert_allclose(found.matrix[0], matrix, atol=1e-7 * np.abs(matrix).max())
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-7 * np.abs(matrix).max())
    frequencies = cspr_jax.natural_frequencies(
        robot, place[None], np.roll(turn.as_quat(), 1)[None], point="mass-centre"
    )
    squares, _ = scipy.linalg.eigh(0.5 * (matrix + matrix.T), found.mass[0])
    np.testing.assert_allclose(frequencies.squares[0], squares, rtol=1e-5)


def test_modes():
    """Modal mass 1, and what they solve; the mass matrix is that of a body about its mass centre."""
    robot, _, pose = robots("3R3T", 7)
    held = cspr_jax.stiffness(robot, *pose, tensions=30.0)
    found = cspr_jax.natural_frequencies(robot, *pose, tensions=30.0)
    turn = Rotation.from_quat(np.roll(pose[1][0], -1)).as_matrix()
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = float(robot.mass) * np.eye(3), turn @ np.asarray(robot.inertia) @ turn.T
    np.testing.assert_allclose(held.mass[0], mass, atol=1e-12)
    shapes = np.concatenate([found.displacements, found.rotations], axis=2)[0]
    np.testing.assert_allclose(shapes @ mass @ shapes.T, np.eye(6), atol=1e-10)
    scale = np.abs(found.squares[0]).max()
    np.testing.assert_allclose(shapes @ held.matrix[0] @ shapes.T, np.diag(found.squares[0]), atol=1e-9 * scale)


def test_frames_and_orders_do_not_matter():
    """The order of cables, an azimuth, and the direction of z."""
    robot, _, (place, quaternion) = robots("3R3T", 7)
    tensions = np.linspace(20.0, 50.0, 7)
    expected = cspr_jax.natural_frequencies(robot, place, quaternion, tensions=tensions).frequencies
    order = np.random.default_rng(5).permutation(7)
    base, inner, stiff = (np.asarray(x) for x in (robot.base_points, robot.platform_points, robot.axial_stiffness))
    same = dataclasses.replace(
        robot, base_points=base[order], platform_points=inner[order], axial_stiffness=stiff[order]
    )
    found = cspr_jax.natural_frequencies(same, place, quaternion, tensions=tensions[order]).frequencies
    np.testing.assert_allclose(found, expected, rtol=1e-11)
    about = Rotation.from_rotvec([0.0, 0.0, 1.1])
    turned = (about * Rotation.from_quat(np.roll(quaternion[0], -1))).as_quat()
    far = np.array([30.0, -20.0, 5.0])
    moved = dataclasses.replace(robot, base_points=about.apply(base) + far)
    found = cspr_jax.natural_frequencies(moved, about.apply(place) + far, np.roll(turned, 1)[None], tensions=tensions)
    np.testing.assert_allclose(found.frequencies, expected, rtol=1e-10)
    # Half a turn about x: z down.
    flip = np.array([1.0, -1.0, -1.0])
    down = dataclasses.replace(
        robot,
        base_points=base * flip,
        platform_points=inner * flip,
        inertia=np.asarray(robot.inertia) * flip[:, None] * flip,
        z_axis="down",
    )
    turned = quaternion * np.array([1.0, 1.0, -1.0, -1.0])
    other = cspr_jax.stiffness(down, place * flip, turned, tensions=tensions)
    one = cspr_jax.stiffness(robot, place, quaternion, tensions=tensions)
    both = np.tile(flip, 2)
    np.testing.assert_allclose(other.matrix[0], one.matrix[0] * both[:, None] * both, atol=1e-7)
    np.testing.assert_allclose(other.twists, one.twists)


def test_one_vertical_cable():
    """A mass on a guide: sqrt(EA / (l0 m)), the spring stretched by its weight."""
    robot = cspr_jax.with_cables(cspr_jax.point_mass([[0.0, 0.0, 0.0]], mass=2.0, pattern="1T"), axial_stiffness=5e3)
    depth = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 3.0]])
    slack = depth[:, 2] / (1.0 + 2.0 * G / 5e3)
    found = cspr_jax.natural_frequencies(robot, depth)
    np.testing.assert_allclose(found.frequencies[:, 0], np.sqrt(5e3 / slack / 2.0), rtol=1e-14)
    np.testing.assert_allclose(found.tensions, 2.0 * G)


@pytest.mark.parametrize("radius", [0.8, 0.1, 1e-5])
def test_three_cables_from_a_level_triangle(radius):
    """In closed form; nearly parallel cables are one pendulum: sqrt(g / z0)."""
    angles = 2.0 * np.pi * np.arange(3) / 3.0
    spools = radius * np.c_[np.cos(angles), np.sin(angles), np.zeros(3)]
    mass, depth, area = 0.7, 1.5, 900.0
    robot = cspr_jax.with_cables(cspr_jax.point_mass(spools, mass=mass), axial_stiffness=area)
    found = cspr_jax.natural_frequencies(robot, [[0.0, 0.0, depth]])
    length = np.hypot(radius, depth)
    sine, cosine = radius / length, depth / length
    force = mass * G / (3.0 * cosine)
    spring, string = (area + force) / length, force / length
    level = 1.5 * (spring * sine**2 + string * (1.0 + cosine**2))
    upright = 3.0 * (spring * cosine**2 + string * sine**2)
    expected = np.sqrt(np.sort([level, level, upright]) / mass)
    np.testing.assert_allclose(found.frequencies[0], expected, rtol=1e-9)
    if radius < 1e-3:
        np.testing.assert_allclose(found.frequencies[0, :2], np.sqrt(G / depth), rtol=1e-6)


def test_a_platform_on_parallel_cables():
    """It sways as a pendulum, and turns as one on three strings, by tensions alone: sqrt(m g r^2 / (I l))."""
    angles = np.repeat(2.0 * np.pi * np.arange(3) / 3.0, 2) + np.tile([0.0, 0.4], 3)
    ring = np.c_[np.cos(angles), np.sin(angles), np.zeros(6)]
    mass, depth, radius, inertia, area = 6.0, 2.0, 0.3, np.diag([0.2, 0.2, 0.35]), 1e6
    robot = cspr_jax.platform(radius * ring, radius * ring, mass=mass, inertia=inertia)
    robot = cspr_jax.with_cables(robot, axial_stiffness=area)
    force = mass * G / 6.0
    found = cspr_jax.natural_frequencies(robot, [[0.0, 0.0, depth]], tensions=force)
    spring = 6.0 * (area + force) / depth
    sway, yaw = np.sqrt(G / depth), np.sqrt(mass * G * radius**2 / (inertia[2, 2] * depth))
    np.testing.assert_allclose(found.frequencies[0, :3], np.sort([sway, sway, yaw]), rtol=1e-7)
    # Tensions add a little to the stiffness against tilting.
    tilt = 0.5 * spring * radius**2 / inertia[0, 0]
    np.testing.assert_allclose(found.squares[0, 3:], np.sort([spring / mass, tilt, tilt]), rtol=2e-4)


def test_slack_and_unstable_poses():
    """Outside of the spools a cable would push; a mass above soft cables falls over."""
    angles = 2.0 * np.pi * np.arange(3) / 3.0
    spools = np.c_[np.cos(angles), np.sin(angles), np.zeros(3)]
    robot = cspr_jax.with_cables(cspr_jax.point_mass(spools, mass=1.0), axial_stiffness=1e4)
    found = cspr_jax.natural_frequencies(robot, [[0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    assert np.isfinite(found.frequencies[0]).all() and np.isnan(found.frequencies[1:]).all()
    assert np.isnan(cspr_jax.stiffness(robot, [[3.0, 0.0, 1.0]]).matrix).all()
    joint = cspr_jax.platform(
        2.0 * spools + [0.0, 0.0, 1.0],
        spools,
        mass=5.0,
        inertia=np.eye(3),
        centre_of_mass=[0.0, 0.0, -2.0],
        pattern="3R",
    )
    joint = cspr_jax.with_cables(joint, axial_stiffness=10.0)
    unstable = cspr_jax.natural_frequencies(joint, [[0.0, 0.0, 0.0]], tensions=0.1)
    assert unstable.squares[0, 0] < 0.0 and unstable.frequencies[0, 0] == 0.0


MASS = cspr_jax.point_mass([[1.0, 0.0, 0.0], [-1.0, 0.5, 0.0], [0.0, -1.0, 0.0]], mass=1.0)
ELASTIC = cspr_jax.with_cables(MASS, axial_stiffness=1e4)


@pytest.mark.parametrize(
    ("robot", "more", "line"),
    [
        (MASS, {}, "axial_stiffness: missing: must be given, in N"),
        (ELASTIC, {"tensions": [1.0, 2.0]}, "tensions"),
        (ELASTIC, {"tensions": -1.0}, "tensions"),
        (ELASTIC, {"rule": "central"}, "rule"),
        (ELASTIC, {"quaternions": [[1.0, 0.0, 0.0, 0.0]]}, "quaternions: a point mass has none"),
        ("prototype", {}, "robot"),
    ],
)
def test_mistakes(robot, more, line):
    for function in (cspr_jax.stiffness, cspr_jax.natural_frequencies):
        with pytest.raises(InputError, match=line) as error:
            function(robot, [[0.0, 0.0, 1.0]], **more)
        assert "\n" not in str(error.value)


def test_tensions_of_redundant_cables_are_within_limits_of_motors():
    """At rest those of torque are limits of tension, in the worse direction of friction."""
    spools = [[1.2, 0.0, 0.0], [0.4, 1.1, 0.05], [-1.0, 0.7, 0.0], [-0.9, -0.7, 0.0], [0.3, -1.2, 0.1]]
    drum = {"drum_radius": 0.02, "gear_ratio": 2.0, "efficiency": 0.9, "friction": 0.005}
    largest = np.array([4.0, 5.0, 6.0, 4.0, 6.0])
    plain, limited = (
        cspr_jax.point_mass(spools, mass=1.0, limits=Limits(tension_min=np.full(5, 0.5), tension_max=high))
        for high in (np.full(5, 30.0), largest)
    )
    torque = largest * drum["drum_radius"] / (drum["gear_ratio"] * drum["efficiency"]) + drum["friction"]
    of_motors, of_tensions, free = (
        cspr_jax.natural_frequencies(
            cspr_jax.with_cables(robot, axial_stiffness=1e4, winch=drum | more), [[0.1, 0.0, 1.5], [0.0, -0.2, 1.2]]
        )
        for robot, more in ((plain, {"motor_torque_max": torque}), (limited, {}), (plain, {}))
    )
    np.testing.assert_allclose(of_motors.tensions, of_tensions.tensions, rtol=1e-9)
    np.testing.assert_allclose(of_motors.frequencies, of_tensions.frequencies, rtol=1e-9)
    assert (of_motors.tensions < largest).all() and not np.allclose(free.tensions, of_motors.tensions, rtol=0.01)
