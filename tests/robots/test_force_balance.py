"""The force balance at one instant: tensions, pseudotensions, cable lengths and their derivatives."""

import itertools

import jax
import numpy as np
import pytest
from conftest import equilateral
from oracles import point_mass as oracle

from cspr_jax.robots.model import point_mass
from cspr_jax.robots.statics import force_balance

N = 200
TENSIONS, PSEUDO = jax.jit(jax.vmap(force_balance.tensions)), jax.jit(jax.vmap(force_balance.pseudotensions))
CABLES = jax.jit(jax.vmap(force_balance.cable_motion))
CABLES_ALONG = jax.jit(jax.vmap(force_balance.cable_motion, in_axes=(None, 0, 0, 0)))


@pytest.fixture(scope="module")
def states():
    """Random triangles of both labellings, and points below them: robots, positions, velocities, accelerations."""
    rng = np.random.default_rng(11)
    angles = np.array([0.0, 2.1, 4.2]) + rng.uniform(-0.6, 0.6, (N, 3))
    bases = np.stack([np.cos(angles), np.sin(angles), rng.uniform(-0.4, 0.4, (N, 3))], 2)
    bases[::2] = bases[::2, ::-1]
    bases = rng.uniform(0.3, 2.0, (N, 1, 1)) * bases + rng.normal(size=(N, 1, 3))
    depth = rng.uniform(0.2, 3.0, N)
    across = rng.normal(size=(N, 2))
    normal = np.stack([oracle.plane_normal(base) for base in bases])
    level = bases.mean(1) + np.c_[across, -(across * normal[:, :2]).sum(1)]  # in the spools' plane
    position = level + depth[:, None] * np.array([0.0, 0.0, 1.0])
    robot = point_mass.PointMassRobot(bases, rng.uniform(0.1, 30.0, N), rng.uniform(1.6, 12.0, N))
    return robot, position, rng.normal(size=(N, 3)), 4.0 * rng.normal(size=(N, 3))


def test_tensions_against_a_linear_solve(states):
    """Newtons that a winch would be sized by: any triangle, mass and gravity, pushes unclipped."""
    robot, position, _, acceleration = states
    found = np.asarray(TENSIONS(robot, position, acceleration))
    for i in range(N):
        base, mass, g = robot.base_points[i], robot.mass[i], robot.gravity[i]
        wanted = oracle.tensions(base, mass, position[i], acceleration[i], g)[0]
        np.testing.assert_allclose(found[i], wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())
    assert (found < 0).any()
    assert (found > 0).any()


def test_forces_balance(states):
    """(2.2): the cables' pulls and the weight must add up to mass times acceleration."""
    robot, position, _, acceleration = states
    pull = np.asarray(TENSIONS(robot, position, acceleration))
    rays = robot.base_points - position[:, None]
    force = (pull[:, :, None] * rays / np.linalg.norm(rays, axis=2, keepdims=True)).sum(1)
    force[:, 2] += robot.mass * robot.gravity
    size = np.abs(pull).max(1, keepdims=True)
    np.testing.assert_allclose(force / size, robot.mass[:, None] * acceleration / size, rtol=0, atol=1e-12)


def test_hanging_still():
    """A mass below the centroid of level spools pulls on three cables alike: f = m g rho / (3 z)."""
    robot = point_mass.point_mass_robot(equilateral(0.26), mass=0.198)
    below, still = np.array([0.0, 0.0, 1.7]), np.zeros(3)
    wanted = 0.198 * 9.81 * np.hypot(0.26, 1.7) / (3 * 1.7)
    np.testing.assert_allclose(jax.jit(force_balance.tensions)(robot, below, still), wanted, rtol=1e-13)
    wanted = np.sqrt(3.0) / 2.0 * 9.81 * 0.26**2  # the constant of (2.51)
    np.testing.assert_allclose(jax.jit(force_balance.pseudotensions)(robot, below, still), wanted)


def test_pseudotensions_have_the_sign_of_tensions(states):
    """(2.10): a wrong sign would call pushing cables taut."""
    robot, position, _, acceleration = states
    pseudo = np.asarray(PSEUDO(robot, position, acceleration))
    pull = np.asarray(TENSIONS(robot, position, acceleration))
    assert np.array_equal(np.sign(pseudo), np.sign(pull))
    for i in range(N):
        base, g = robot.base_points[i], robot.gravity[i]
        wanted = oracle.pseudotensions(base, position[i], acceleration[i], g)[0]  # as printed: of either sign
        np.testing.assert_allclose(np.abs(pseudo[i]), np.abs(wanted), rtol=0, atol=1e-11 * np.abs(wanted).max())


def test_labels_do_not_matter(states):
    """Spools numbered the other way round are the same robot: values follow their cables, with their sign."""
    robot, position, velocity, acceleration = states
    for order in itertools.permutations(range(3)):
        other = point_mass.PointMassRobot(robot.base_points[:, order], robot.mass, robot.gravity)
        for function in (TENSIONS, PSEUDO):
            wanted = np.asarray(function(robot, position, acceleration))[:, order]
            found = np.asarray(function(other, position, acceleration))
            size = np.abs(wanted).max(1, keepdims=True)
            np.testing.assert_allclose(found / size, wanted / size, rtol=0, atol=1e-12)
        wanted = np.stack(CABLES(robot, position, velocity, acceleration))[:, :, order]
        np.testing.assert_allclose(CABLES(other, position, velocity, acceleration), wanted, rtol=1e-13, atol=1e-13)


def test_above_the_spools_a_hanging_mass_must_push():
    """Tensions change sign across the spool plane, pseudotensions do not: that is why eta is a criterion."""
    robot = point_mass.point_mass_robot(equilateral(1.0), mass=2.0)
    tensions, pseudotensions = jax.jit(force_balance.tensions), jax.jit(force_balance.pseudotensions)
    for z, sign in ((0.4, 1.0), (-0.4, -1.0)):
        at = np.array([0.1, -0.05, z])
        assert (np.sign(tensions(robot, at, np.zeros(3))) == sign).all()
        assert (np.sign(pseudotensions(robot, at, np.zeros(3))) == 1.0).all()
    assert not np.isfinite(tensions(robot, np.array([0.1, -0.05, 0.0]), np.zeros(3))).any()


def test_cable_lengths_and_rates_against_the_reference(states):
    """Lengths, rates and accelerations drive the winches."""
    robot, position, velocity, acceleration = states
    lengths, rates, bends = (np.asarray(v) for v in CABLES(robot, position, velocity, acceleration))
    for i in range(N):
        state = robot.base_points[i], position[i], velocity[i], acceleration[i]
        np.testing.assert_allclose(lengths[i], oracle.cable_lengths(*state[:2])[0], rtol=1e-13)
        np.testing.assert_allclose(rates[i], oracle.cable_rates(*state[:3])[0], atol=1e-12)
        np.testing.assert_allclose(bends[i], oracle.cable_accelerations(*state)[0], atol=1e-11)


def test_cable_rates_are_derivatives_of_lengths(states):
    """Along a smooth path: a lost centrifugal term would show here."""
    robot = jax.tree.map(lambda leaf: leaf[0], states[0])
    below = robot.base_points.mean(0) + np.array([0.0, 0.0, 1.5])
    rng = np.random.default_rng(12)
    slope, second_derivative, jerk = rng.normal(size=(3, 3))

    def lengths_at(t):
        t = np.asarray(t)[:, None]
        p = below + slope * t + second_derivative * t**2 / 2 + jerk * t**3 / 6
        return [
            np.asarray(v)
            for v in CABLES_ALONG(
                robot, p, slope + second_derivative * t + jerk * t**2 / 2, second_derivative + jerk * t
            )
        ]

    t, step = np.linspace(-0.3, 0.3, 13), 1e-4
    (length, rate, acceleration), after, before = lengths_at(t), lengths_at(t + step), lengths_at(t - step)
    assert (length > 0).all()
    np.testing.assert_allclose((after[0] - before[0]) / (2 * step), rate, atol=1e-6)
    np.testing.assert_allclose((after[1] - before[1]) / (2 * step), acceleration, atol=1e-6)
