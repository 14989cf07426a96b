"""One motion from Python: states, margins and gradients, in the axes of the robot."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.platforms import margin_of, state_of

import cspr_jax
from cspr_jax.api.families.motions import (
    hypocycloid,
    make_problem,
    platform_motion,
    sampled_margin,
    slacks,
    tensions,
    transition,
)
from cspr_jax.errors import InputError

FAR = np.array([120.0, -40.0, 7.0])
TARGET = np.array([-0.6, 0.4, 1.8])
STEP = 1e-6


@functools.partial(jax.jit, static_argnames="arcs")
def moving(robot, start, end, z0, *, arcs):
    """A hypocycloid, in one piece: eager operations would be compiled one by one."""
    return hypocycloid(robot, start, end, z0=z0, arcs=arcs)


def point_mass(z_axis="down", offset=FAR):
    signs = np.array([1.0, 1.0, 1.0]) if z_axis == "down" else np.array([1.0, -1.0, -1.0])
    points = np.array([[1.3, 0.2, -0.1], [-0.4, 1.1, 0.25], [-0.9, -0.8, 0.05]])
    return cspr_jax.point_mass_robot(points * signs + offset, mass=1.7, z_axis=z_axis), signs


def of_point_mass(base_points, z0, target):
    """Sampled margin of a hypocycloid of four arcs, as a function of what it depends on."""
    robot = dataclasses.replace(point_mass()[0], base_points=base_points)
    problem = make_problem(robot, limits=cspr_jax.Limits(cable_length_max=np.full(3, 4.0)))
    motion = hypocycloid(robot, FAR + np.array([0.7, 0.3, 1.6]), FAR + target, z0=z0, arcs=4)
    return sampled_margin(problem, motion)


def of_platform(base_points, z0, target):
    """Sampled margin of a motion of four arcs of the MSSM, from rest to a tilted pose."""
    robot = dataclasses.replace(cspr_jax.load_robot("laval-mssm"), base_points=base_points)
    rotated = (np.array([1.0, 0.0, 0.0, 0.0]), np.array([np.cos(0.1), np.sin(0.1), 0.0, 0.0]))
    motion = platform_motion(robot, None, target, z0=z0, arcs=4, orientations=rotated, beta_hat=(-1.0, -1.3))
    return sampled_margin(make_problem(robot), motion)


CASES = {
    "point mass": (of_point_mass, lambda: np.asarray(point_mass()[0].base_points), 1.7, TARGET),
    "platform": (
        of_platform,
        lambda: np.asarray(cspr_jax.load_robot("laval-mssm").base_points),
        1.4,
        np.array([0.5, 0.3, 1.35]),
    ),
}


@pytest.mark.thorough
@pytest.mark.parametrize("case", ["point mass", pytest.param("platform", marks=pytest.mark.thorough)])
def test_gradients_are_those_of_finite_differences(case):
    """With respect to every coordinate of the spools and of the target, and to z0."""
    function, spools, z0, target = CASES[case]
    given = [np.asarray(x) for x in (spools(), z0, target)]
    # One function for both: compiling takes longer than computing.
    both = jax.jit(jax.value_and_grad(function, argnums=(0, 1, 2)))
    found = jax.tree.map(np.asarray, both(*given)[1])
    for i, (gradient, argument) in enumerate(zip(found, given, strict=True)):
        for place in np.ndindex(argument.shape):
            ends = []
            for sign in (1.0, -1.0):
                moved = list(given)
                moved[i] = argument.copy()
                moved[i][place] += sign * STEP
                ends.append(float(both(*moved)[0]))
            slope = (ends[0] - ends[1]) / (2.0 * STEP)
            assert float(gradient[place]) == pytest.approx(slope, rel=1e-5, abs=1e-6), (i, place)
        assert np.abs(np.asarray(gradient)).max() > 1e-3


@pytest.mark.parametrize("z_axis", ["down", "up"])
def test_margin_and_state_of_answers(z_axis):
    """The motion of the number of arcs found has the margin, duration and ends of the answers."""
    robot, signs = point_mass(z_axis)
    start, target = FAR + np.array([0.2, -0.1, 1.5]) * signs, FAR + TARGET * signs
    answers = cspr_jax.minimum_arcs(robot, [target], start=start, z0=1.7)
    motion = moving(robot, start, target, 1.7, arcs=int(answers.arcs[0]))
    assert float(motion.duration()) == pytest.approx(answers.duration[0], rel=1e-12)
    assert float(margin_of(make_problem(robot), motion, 20_000)) == pytest.approx(answers.margin[0], abs=1e-6)
    for tau, place in ((0.0, start), (1.0, target)):
        state = state_of(motion, tau)
        np.testing.assert_allclose(state.position, place, atol=1e-12)
        np.testing.assert_allclose(state.velocity, 0.0, atol=1e-12)


def test_derivatives_of_states():
    """Velocity and acceleration are the derivatives of the position in time, in axes that point up."""
    robot, signs = point_mass("up")
    motion = moving(robot, FAR + np.array([0.2, -0.1, 1.5]) * signs, FAR + TARGET * signs, 1.7, arcs=5)
    tau, time = jnp.asarray(0.37), float(motion.duration())

    def position(t):
        return motion.state(t).position

    slope, second_derivative = jax.jit(lambda t: (jax.jacfwd(position)(t), jax.jacfwd(jax.jacfwd(position))(t)))(tau)
    state = state_of(motion, 0.37)
    np.testing.assert_allclose(slope / time, state.velocity, rtol=1e-9)
    np.testing.assert_allclose(second_derivative / time**2, state.acceleration, rtol=1e-8)


def test_tensions_balance_the_motion():
    """The pulls along the cables and the weight give the mass its acceleration, z up or down."""
    for z_axis in ("down", "up"):
        robot, signs = point_mass(z_axis)
        motion = transition(robot, FAR + np.array([0.7, 0.2, 1.6]) * signs, z0=1.6, oscillations=3)
        state = state_of(motion, 0.61)
        rays = np.asarray(robot.base_points) - np.asarray(state.position)
        pull = np.asarray(tensions(robot, state)) @ (rays / np.linalg.norm(rays, axis=1)[:, None])
        weight = 1.7 * 9.81 * np.array([0.0, 0.0, signs[2]])
        np.testing.assert_allclose(pull + weight, 1.7 * np.asarray(state.acceleration), rtol=1e-9)


def test_slacks_are_mapped_and_compiled():
    robot = cspr_jax.load_robot("prototype")
    problem, z0 = make_problem(robot), np.array([1.4, 1.7, 2.0])
    targets = np.asarray(TARGET)[None] + np.arange(3.0)[:, None] * 0.1

    @jax.jit
    @jax.vmap
    def lowest(target, depth):
        motion = hypocycloid(robot, None, target, z0=depth, arcs=5)
        return jnp.min(slacks(problem, motion, 0.4))

    found = lowest(targets, z0)
    for value, target, depth in zip(found, targets, z0, strict=True):
        motion = hypocycloid(robot, None, target, z0=depth, arcs=5)
        assert float(np.min(slacks(problem, motion, 0.4))) == pytest.approx(float(value), abs=1e-12)


def test_what_is_no_motion_is_refused():
    robot, platform = cspr_jax.load_robot("prototype"), cspr_jax.load_robot("laval-mssm")
    for refused in (
        lambda: hypocycloid(platform, TARGET, TARGET, z0=1.0, arcs=2),
        lambda: platform_motion(robot, TARGET, TARGET, z0=1.0, arcs=2),
        lambda: hypocycloid(robot, TARGET, TARGET, z0=1.0, arcs=2, amplitude="A1"),
        lambda: transition(robot, TARGET, z0=1.0, oscillations=2, amplitude="ideal"),
        lambda: make_problem(robot, amplitude="quartic"),
    ):
        with pytest.raises(InputError):
            refused()


SAMPLES = {
    "cubic": ({}, 1),
    "natural": ({"ends": "natural"}, 1),
    "periodic": ({"ends": "periodic"}, 1),
    "quintic": ({"interpolation": "quintic"}, 1),
    "hermite": ({}, 2),
    "hermite of accelerations": ({}, 3),
}


@pytest.mark.quick("natural", "quintic", "hermite of accelerations")
@pytest.mark.parametrize("kind", SAMPLES)
def test_splines_are_differentiated_by_their_samples(kind):
    """What jax traces gives the same motion as numbers do, and its derivative: it is linear in them."""
    options, count = SAMPLES[kind]
    robot, signs = point_mass("up")
    times = np.array([0.0, 0.4, 0.9, 1.7, 2.2])
    rng = np.random.default_rng(7)
    arrays = [FAR + np.array([0.1, 0.2, 1.5]) * signs + 0.1 * rng.normal(size=(5, 3)), *rng.normal(size=(2, 5, 3))]
    if kind == "periodic":
        arrays[0][-1] = arrays[0][0]
    names = ("positions", "velocities", "accelerations")[:count]

    def states(*given):
        motion = cspr_jax.spline(robot, times, **dict(zip(names, given, strict=True)), **options)
        return jax.vmap(motion.state)(np.linspace(0.0, 1.0, 7))

    plain, traced = states(*arrays[:count]), jax.jit(states)(*arrays[:count])
    for one, other in zip(jax.tree.leaves(plain), jax.tree.leaves(traced), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)
    along = [rng.normal(size=(5, 3)) for _ in range(count)]
    along[0][-1] = along[0][0]
    _, found = jax.jit(lambda *given: jax.jvp(states, *given))(tuple(arrays[:count]), tuple(along))
    moved = states(*(a + b for a, b in zip(arrays, along, strict=False)))
    for one, other, slope in zip(*(jax.tree.leaves(x) for x in (plain, moved, found)), strict=True):
        np.testing.assert_allclose(np.subtract(other, one), slope, rtol=0, atol=1e-8)
