"""States of splines: SciPy's values and derivatives, and rotations by finite differences."""

import dataclasses

import jax
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.splines import random_spline, states_of


@pytest.mark.parametrize("degree", [3, 5])
def test_states_are_those_of_scipy(degree):
    for seed in range(5):
        spline, table = random_spline(seed, degree=degree)
        times = np.linspace(0.0, table.x[-1], 101)
        found = states_of(spline, times)
        for order, name in enumerate(("position", "velocity", "acceleration")):
            expected = table.derivative(order)(times)[:, :3] if order else table(times)[:, :3]
            np.testing.assert_allclose(getattr(found, name), expected, atol=1e-10 * np.abs(expected).max())
        unit = table(times)[:, 3:]
        unit /= np.linalg.norm(unit, axis=1, keepdims=True)
        np.testing.assert_allclose(found.quaternion, unit, atol=1e-12)
        np.testing.assert_allclose(found.rotation, Rotation.from_quat(np.roll(unit, -1, 1)).as_matrix(), atol=1e-12)


def test_angular_velocity_by_differences():
    spline, table = random_spline(7, tilt=0.5)
    times, step = np.linspace(0.5, table.x[-1] - 0.5, 40), 1e-4
    before, here, after = (states_of(spline, times + shift) for shift in (-step, 0.0, step))
    rotated = Rotation.from_matrix(after.rotation @ np.swapaxes(before.rotation, 1, 2)).as_rotvec()
    np.testing.assert_allclose(here.angular_velocity, rotated / (2.0 * step), atol=1e-6)
    change = (after.angular_velocity - before.angular_velocity) / (2.0 * step)
    np.testing.assert_allclose(here.angular_acceleration, change, atol=1e-5)


def test_breaks_are_knots():
    spline, table = random_spline(3)
    np.testing.assert_allclose(np.asarray(spline.breaks()) * table.x[-1], table.x[1:-1], rtol=1e-14)


@pytest.mark.parametrize(("count", "usual"), [(6, 64), (100, 256), (256, 256), (4097, 4097)])
def test_a_usual_number_of_pieces_is_the_same_motion(count, usual):
    """Bit for bit; with turning or without."""
    spline, _ = random_spline(1, count=count)
    for motion in (spline, dataclasses.replace(spline, quaternion=None)):
        longer = motion.padded()
        assert len(longer.knots) == usual + 1 and longer.duration() == motion.duration()
        if count > 100:
            assert longer is motion
            continue
        tau = np.concatenate([np.linspace(0.0, 1.0, 41), spline.breaks()])
        states = (jax.jit(jax.vmap(one.state))(tau) for one in (motion, longer))
        jax.tree.map(np.testing.assert_array_equal, *states)
