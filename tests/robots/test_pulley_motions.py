"""Cables behind pulleys in motion: lengths, rates and tensions against a root finder, and their bounds over blocks."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles.pulleys import length
from scipy.interpolate import CubicSpline
from support.splines import random_spline, spline_of

import cspr_jax
from cspr_jax.robots import cables
from cspr_jax.robots.bounds import state_bounds
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.pulleys import exits
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.cable_lengths import moved_lengths
from cspr_jax.robots.statics.kernel_axes import centred
from robots.test_patterns import INERTIAL, MATRIX, made, state_of

S = np.linspace(-1.0, 1.0, 17)
# Swivel axes in the axes of a file whose z points down; upwards the cables leave over the top.
AXES = {"up": None, "down": [0.0, 0.0, 1.0], "aslant": [0.4, -0.7, -0.9], "level": [-0.8, 0.6, 0.0]}
MOVED = jax.jit(moved_lengths)
TENSIONS = jax.jit(cables.tensions)


def wheels(pattern="3T", count=3, axes=None, radius=None):
    """A robot with pulleys of several sizes."""
    robot = made(pattern, count)
    sizes = np.linspace(0.02, 0.15, count) if radius is None else radius
    if axes is not None and PATTERNS[pattern].is_planar:
        axes = np.array(axes) * [1.0, 0.0, 1.0]
    return cspr_jax.with_cables(robot, pulley_radius=sizes, pulley_axes=axes)


@pytest.mark.parametrize("name", AXES)
def test_lengths_rates_and_accelerations_are_those_of_a_root_finder(name):
    """By differences of fourth order along random cubics."""
    rng, step = np.random.default_rng(5), 4e-3
    for _ in range(6):
        robot = wheels(axes=AXES[name])
        place, velocity, acceleration, jerk = rng.normal(size=(4, 3, 3)) * [[[1.0]], [[1.5]], [[2.0]], [[1.0]]]
        place += [0.0, 0.0, 1.5]

        def at(t, cable, place=place, velocity=velocity, acceleration=acceleration, jerk=jerk, robot=robot):
            target = (place + t * (velocity + t * (acceleration / 2.0 + t * jerk / 6.0)))[cable]
            parts = robot.base_points, robot.pulleys.axes, robot.pulleys.radius
            return length(*(np.asarray(part)[cable] for part in parts), target)[0]

        found = MOVED(robot, *map(jnp.asarray, (place, velocity, acceleration)))
        for cable in range(3):
            far, near, here, after, beyond = (at(k * step, cable) for k in (-2, -1, 0, 1, 2))
            rate = (far - 8.0 * near + 8.0 * after - beyond) / (12.0 * step)
            second_derivative = (-far + 16.0 * near - 30.0 * here + 16.0 * after - beyond) / (12.0 * step**2)
            wanted = here, rate, second_derivative
            for value, number, close in zip(found, wanted, (1e-11, 1e-7, 1e-6), strict=True):
                assert float(value[cable]) == pytest.approx(number, abs=close * max(1.0, abs(number)))


def test_rates_are_the_derivatives_of_lengths():
    """Of a platform whose pose is a spline, by jax."""
    robot = centred(wheels("3R3T", 6, AXES["aslant"]))[0]
    spline, table = random_spline(3, middle=(0.1, 0.2, 1.4), size=0.3, tilt=0.2)
    duration = float(table.x[-1])

    def value(tau):
        return cables.cable_motion(robot, spline.state(tau))

    @jax.jit
    @jax.vmap
    def derivatives(tau):
        values, slopes = jax.jvp(value, (tau,), (1.0,))
        return values, [slope / duration for slope in slopes[:2]]

    (_, rate, second_derivative), (by_length, by_rate) = derivatives(np.linspace(0.01, 0.99, 300))
    np.testing.assert_allclose(by_length, rate, atol=1e-12)
    np.testing.assert_allclose(by_rate, second_derivative, atol=1e-10)


def test_pulleys_of_no_size_are_none():
    """In values and derivatives, also where cables run along their axes; other pulleys do not change these cables."""
    bare, rng = made("3T", 3), np.random.default_rng(1)
    above = np.asarray(bare.base_points) + np.array([[0.0, 0.0, 1.3], [0.0, 0.0, -0.7], [0.3, 0.2, 1.0]])
    points = wheels(radius=[0.0, 0.0, 0.1])

    @jax.jit
    @partial(jax.grad, argnums=(0, 1))
    def derivatives(targets, robot, moving):
        return sum(jnp.sum(values[:2]) for values in moved_lengths(robot, targets, *moving))

    for targets in (above, rng.normal(size=(3, 3)) + np.array([0.0, 0.0, 2.0])):
        moving = rng.normal(size=(2, 3, 3))
        pairs = (map(np.asarray, MOVED(robot, targets, *moving)) for robot in (points, bare))
        for one, other in zip(*pairs, strict=True):
            np.testing.assert_allclose(one[:2], other[:2], rtol=1e-14)
        slopes = [jax.tree.map(np.asarray, derivatives(targets, robot, moving)) for robot in (points, bare)]
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes[0]))
        np.testing.assert_allclose(slopes[0][0][:2], slopes[1][0][:2], atol=1e-12)
    at = state_of("3T", rng)
    none = wheels(radius=[0.0, 0.0, 0.0])
    np.testing.assert_allclose(TENSIONS(none, at), TENSIONS(bare, at), rtol=1e-12)


# Each pattern compiles kernels of its own.
QUICK = ("2T", "3R3T")


@pytest.mark.quick("3R3T")
@pytest.mark.parametrize(
    "pattern",
    [pattern if pattern in QUICK else pytest.param(pattern, marks=pytest.mark.thorough) for pattern in PATTERNS],
)
def test_tensions_balance_any_pattern(pattern):
    """On as many cables as degrees of freedom, behind pulleys; their derivatives are finite."""
    robot = wheels(pattern, PATTERNS[pattern].dof)
    at = state_of(pattern, np.random.default_rng(7))
    force, matrix, wrench = (np.asarray(f(robot, at)) for f in (TENSIONS, MATRIX, INERTIAL))
    np.testing.assert_allclose(matrix @ force, wrench, atol=1e-9 * np.abs(wrench).max())
    slopes = jax.jit(jax.grad(lambda robot, at: jnp.sum(cables.tensions(robot, at))))(robot, at)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes))
    assert np.abs(slopes.pulleys.radius).max() > 0.0


def exits_of(robot, state):
    """Points at which cables leave, (3, n_cables)."""
    if robot.pulleys is None:
        return jnp.asarray(robot.base_points).T
    arms = robot.platform_points @ state.rotation.T if PATTERNS[robot.pattern].is_body else np.zeros((1, 3))
    targets = jnp.broadcast_to(state.position[None] + arms, robot.base_points.shape)
    return exits(robot.base_points, robot.pulleys.axes, robot.pulleys.radius, targets).point.T


@jax.jit
def exact(robot, spline, taus):
    """Lengths, rates, accelerations and wrench matrices at instants."""

    def one(tau):
        state = spline.state(tau)
        return *cables.cable_motion(robot, state), robot.wrench_matrix(state), exits_of(robot, state)

    return jax.vmap(jax.vmap(one))(taus)


@jax.jit
def bounds_of(robot, states):
    """Their bounds over blocks."""

    def one(state):
        known = state_bounds.cable_bounds(robot, state)
        matrix, _ = state_bounds.balance_bounds(robot, state, known)
        return known.length, known.rate, known.acceleration, matrix, known.exit.each(jnp.transpose)

    return jax.vmap(one)(states)


def bounded(robot, spline, middles, half: float):
    """Values at instants of blocks, and bounds over these blocks."""
    times = middles[:, None] + half * S
    values = exact(robot, spline, times / spline.knots[-1])
    return [np.asarray(value) for value in values], bands_of(robot, spline, middles, half)


def bands_of(robot, spline, middles, half: float):
    return jax.tree.map(np.asarray, bounds_of(robot, spline.bounds(middles - half, middles + half)))


def excess(values, bands):
    """How far values leave their bands, each over its size, where these are known."""
    over = []
    for value, band in zip(values, bands, strict=True):
        s = S.reshape(1, -1, *(1,) * (value.ndim - 2))
        beyond = np.abs(value - band.middle[:, None] - band.linear[:, None] * s) - band.radius[:, None]
        over.append(np.nanmax(beyond) / np.nanmax(np.abs(value)))
    return np.array(over)


PLACES = {"3T": 0.0, "2T": 0.0, "1R2T": 0.2, "3R3T": 0.2}
CASES = [("3T", name) for name in AXES] + [
    pytest.param(pattern, name, marks=pytest.mark.thorough)
    for pattern in ("2T", "1R2T", "3R3T")
    for name in ("up", "aslant")
]


def flat(spline, pattern):
    """The same motion in the plane of a planar robot."""
    if not PATTERNS[pattern].is_planar:
        return spline
    position = np.asarray(spline.position) * [1.0, 0.0, 1.0]
    turning = None if spline.quaternion is None else np.asarray(spline.quaternion) * [1.0, 0.0, 1.0, 0.0]
    return dataclasses.replace(spline, position=position, quaternion=turning)


@pytest.mark.parametrize(("pattern", "name"), CASES)
def test_bounds_contain_what_they_bound(pattern, name):
    """At all instants of all blocks, and bands shrink with the square of their length."""
    robot = centred(wheels(pattern, PATTERNS[pattern].dof + (pattern == "3R3T"), AXES[name]))[0]
    for seed in range(3):
        spline, table = random_spline(seed, middle=(0.1, 0.2, 0.9), size=0.5, tilt=PLACES[pattern])
        spline, radii = flat(spline, pattern), []
        middles = np.random.default_rng(seed).uniform(0.2, float(table.x[-1]) - 0.2, 60)
        # No block crosses a knot, where the bounds of a jerk that jumps do not shrink so fast.
        middles = middles[np.abs(middles[:, None] - table.x).min(1) > 0.01]
        for half in (0.1, 0.01, 0.005):
            values, bands = bounded(robot, spline, np.resize(middles, 60), half)
            assert (excess(values, bands) < 1e-13).all()
            assert all(np.isfinite(band.radius).all() for band in bands[:3]) or half == 0.1
            radii.append([np.median(band.radius[np.isfinite(band.radius) & (band.radius > 1e-9)]) for band in bands])
        shrunk = np.array(radii[1]) / np.array(radii[2])
        assert ((shrunk > 3.5) & (shrunk < 4.5)).all()


def test_bounds_of_pulleys_of_no_size_are_those_of_points():
    spline, table = random_spline(0, middle=(0.1, 0.2, 0.9), size=0.5, tilt=0.0)
    middles = np.linspace(0.1, float(table.x[-1]) - 0.1, 60)
    robots = centred(wheels(radius=[0.0, 0.1, 0.0]))[0], centred(made("3T", 3))[0]
    for one, other in zip(*(bands_of(robot, spline, middles, 0.1) for robot in robots), strict=True):
        for leaf, wanted in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
            np.testing.assert_allclose(leaf[..., [0, 2]], wanted[..., [0, 2]], rtol=1e-11, atol=1e-15)


def test_nothing_is_known_within_a_pulley_or_on_its_axis():
    """Motions straight through both: known before and behind, nowhere wrong."""
    robot = centred(wheels(radius=[0.1] * 3, axes=[0.0, 0.0, 1.0]))[0]
    base = np.asarray(robot.base_points)[0]
    for ends in ([[0.6, 0.0, 0.02], [-0.6, 0.0, 0.02]], [[0.5, 0.2, 0.7], [-0.5, -0.2, 0.7]]):
        table = CubicSpline([0.0, 2.0], base + np.array(ends), bc_type="clamped")
        values, bands = bounded(robot, spline_of(table, turns=False), np.arange(0.5, 64.0) / 32.0, 1.0 / 64.0)
        unknown = np.isnan(bands[0].radius[:, 0])
        assert unknown[31:33].all() and not unknown[[0, 1, 62, 63]].any()
        assert np.isnan(values[0][unknown][:, :, 0]).any() == (ends[0][2] < 0.1)
        for value, band in zip(values[:3], bands[:3], strict=True):
            beyond = np.abs(value[..., 0] - band.middle[:, None, 0] - band.linear[:, None, 0] * S) - band.radius[:, :1]
            assert np.nanmax(beyond) < 1e-12 * np.nanmax(np.abs(value))
            assert np.isfinite(value[~unknown]).all()


def test_a_state_within_a_pulley_has_no_tensions():
    robot = wheels(radius=[0.2] * 3)
    inside = np.asarray(robot.base_points)[0] + [0.1, 0.1, 0.0]
    still = np.zeros(3)
    assert np.isnan(TENSIONS(robot, State(*map(jnp.asarray, (inside, still, still))))).all()
