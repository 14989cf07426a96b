"""Orientations on ellipses: kinematics against derivatives, bounds against samples, natural frequencies of rotation."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.motions import states_along

import cspr_jax
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.motion import EllipseMotion, integral, with_turns
from cspr_jax.families.ellipses.rotation import Rotation, turn_between
from cspr_jax.families.ellipses.rotation_frequencies import rotation_frequencies
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear import rotations
from cspr_jax.robots.model.limits import NO_LIMITS
from cspr_jax.robots.statics.kernel_axes import prepared

TIME = 9.3


def unit(rng, size):
    vector = rng.normal(size=size)
    return vector / np.linalg.norm(vector)


@pytest.fixture(scope="module")
def motion():
    rng = np.random.default_rng(7)

    def ellipse():
        return Ellipse(*(as_float64(rng.normal(0.0, 0.5, 3)) for _ in range(3)))

    law = with_turns(named("quintic"), 0.6)
    turn = turn_between(unit(rng, 4), unit(rng, 4))
    rotation = Rotation(
        as_float64(unit(rng, 4)), turn, as_float64(unit(rng, 3)), as_float64([0.1, 0.3]), as_float64([0.4, -0.2])
    )
    return EllipseMotion(
        ellipse(), ellipse(), as_float64([2.0, 1.5]), as_float64(0.3), law, integral(law), as_float64(TIME), rotation
    )


def test_rates_are_derivatives(motion):
    @jax.jit
    def at(t):
        def rotation(t):
            return motion.state(t / TIME).rotation

        def spin(t):
            turning = jax.jacfwd(rotation)(t) @ rotation(t).T
            return 0.5 * jnp.stack(
                [turning[2, 1] - turning[1, 2], turning[0, 2] - turning[2, 0], turning[1, 0] - turning[0, 1]]
            )

        def place(t):
            return motion.state(t / TIME).position

        rates = jax.jacfwd(place)(t), jax.jacfwd(jax.jacfwd(place))(t), spin(t), jax.jacfwd(spin)(t)
        return rates, motion.state(t / TIME)

    for t in (0.0, 1.2, 4.4, 5.58, 7.0, TIME):
        rates, state = at(jnp.asarray(t))
        fields = (state.velocity, state.acceleration, state.angular_velocity, state.angular_acceleration)
        for value, field in zip(rates, fields, strict=True):
            np.testing.assert_allclose(value, field, atol=1e-13)
        np.testing.assert_allclose(rotations.matrix(state.quaternion), state.rotation, atol=1e-14)


def test_bounds_hold_all_states(motion):
    start = np.linspace(0.0, TIME - 0.1, 64)
    bounds, states = motion.bounds(start, start + 0.1), partial(states_along, motion)
    for fraction in np.linspace(0.0, 1.0, 7):
        state = states((start + 0.1 * fraction) / TIME)
        for name, band in bounds._asdict().items():
            line = band.middle + (2.0 * fraction - 1.0) * band.linear
            assert (np.abs(np.asarray(getattr(state, name)) - line) <= band.radius).all(), name
    assert np.asarray(bounds.rotation.radius).max() < 0.01


def test_ends_are_those_of_the_ellipses(motion):
    state_at = jax.jit(motion.state)
    for ellipse, w, phase, tau in (
        (motion.first, 2.0, 0.3, 0.0),
        (motion.last, 1.5, 0.3 + 0.6 * TIME * 1.75 + 0.4 * TIME * 1.5, 1.0),
    ):
        state, (cosine, sine) = state_at(jnp.asarray(tau)), (np.cos(phase), np.sin(phase))
        outward = ellipse.cosine * cosine + ellipse.sine * sine
        np.testing.assert_allclose(state.position, ellipse.centre + outward, atol=1e-12)
        np.testing.assert_allclose(state.velocity, w * (ellipse.sine * cosine - ellipse.cosine * sine), atol=1e-12)
        np.testing.assert_allclose(state.acceleration, -(w**2) * outward, atol=1e-12)


def test_turns_between_orientations():
    rng, product, matrix = np.random.default_rng(3), jax.jit(rotations.product), jax.jit(rotations.matrix)
    for start, end in [(unit(rng, 4), unit(rng, 4)) for _ in range(20)] + [(np.eye(4)[0], np.eye(4)[0])]:
        turn = turn_between(start, end)
        angle = np.linalg.norm(turn)
        assert angle <= np.pi
        axis = turn / angle if angle else np.eye(3)[0]
        between = np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) * axis])
        np.testing.assert_allclose(matrix(product(between, start)), matrix(end), atol=1e-13)


def test_rotation_at_a_natural_frequency_needs_no_other_tensions():
    robot, _ = prepared(cspr_jax.load_robot("laval-mssm"))
    rng = np.random.default_rng(5)
    inertia = np.diag([0.004, 0.005, 0.008])
    robot = dataclasses.replace(robot, inertia=as_float64(inertia))
    problem, place = Problem(robot, NO_LIMITS, named("quintic")), np.array([0.05, -0.1, 0.9])
    rotated = np.asarray(rotations.matrix(jnp.asarray(unit(rng, 4) * 0.05 + np.array([0.95, 0.0, 0.0, 0.0]))))
    rotated = np.linalg.qr(rotated)[0] * np.sign(np.diag(np.linalg.qr(rotated)[1]))
    natural = rotation_frequencies(problem, place, rotated)
    assert (np.diff(natural.frequencies) > 0.0).all()
    nothing = np.zeros(3)
    rest = densities(robot, place, rotated, nothing, nothing, nothing)
    for frequency, mode in zip(natural.frequencies, natural.modes, strict=True):
        changes = []
        for size in (1e-4, 2e-4):
            shift, delta = size * mode[:3], size * mode[3:]
            pulls = -(frequency**2) * shift, -(frequency**2) * delta
            change = densities(robot, place + shift, rotated, delta, *pulls) - rest
            changes.append(np.abs(change).max() / rest.max())
        # What changes at all is of second order.
        assert changes[0] < 1e-6
        assert 3.0 < changes[1] / changes[0] < 5.0


def densities(robot, place, rotation, delta, pull, acceleration):
    """Tensions over lengths of a platform turned by a small vector, with two accelerations: plain NumPy."""
    angle = np.linalg.norm(delta)
    if angle:
        x, y, z = delta / angle
        skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        rotation = (np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * skew @ skew) @ rotation
    arms = np.asarray(robot.platform_points) @ rotation.T
    rays = np.asarray(robot.base_points) - place - arms
    matrix = np.concatenate([rays.T, np.cross(arms, rays).T])
    inertia = rotation @ np.asarray(robot.inertia) @ rotation.T
    force = float(robot.mass) * (pull - np.array([0.0, 0.0, float(robot.gravity)]))
    wrench = np.concatenate([force, inertia @ acceleration])
    return np.linalg.solve(matrix, wrench)
