"""Splines through samples: SciPy's curves, ends, continuity, and one line for samples that are none."""

import inspect

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline
from support.motions import states_along

from cspr_jax.curves.interpolation import continuous, interpolated
from cspr_jax.errors import InputError

TIMES = np.array([1.0, 1.7, 2.0, 3.1, 3.5, 4.4])
PLACES = np.random.default_rng(3).normal(size=(6, 3))


def values(spline, times):
    return list(states_along(spline, (times - TIMES[0]) / float(spline.duration()))[:3])


def check_same(spline, curve):
    times = np.linspace(TIMES[0], TIMES[-1], 57)
    for order, found in enumerate(values(spline, times)):
        expected = curve.derivative(order)(times) if order else curve(times)
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(("ends", "condition"), [("rest", "clamped"), ("natural", "natural")])
def test_cubic(ends, condition):
    check_same(interpolated(TIMES, PLACES, ends=ends), CubicSpline(TIMES, PLACES, bc_type=condition))


def test_quintic():
    still = [(order, np.zeros(3)) for order in (1, 2)]
    check_same(
        interpolated(TIMES, PLACES, interpolation="quintic"),
        make_interp_spline(TIMES, PLACES, 5, bc_type=(still, still)),
    )
    free = [(order, np.zeros(3)) for order in (3, 4)]
    natural = interpolated(TIMES, PLACES, interpolation="quintic", ends="natural")
    check_same(natural, make_interp_spline(TIMES, PLACES, 5, bc_type=(free, free)))


@pytest.mark.parametrize("kind", ["cubic", "quintic"])
def test_periodic(kind):
    closed = np.concatenate([PLACES[:-1], PLACES[:1]])
    spline = interpolated(TIMES, closed, interpolation=kind, ends="periodic")
    first, last = (np.concatenate([part[i] for part in values(spline, TIMES[[0, -1]])]) for i in (0, 1))
    np.testing.assert_allclose(first, last, atol=1e-8 * np.abs(first).max())
    with pytest.raises(InputError, match="ends"):
        interpolated(TIMES, PLACES, interpolation=kind, ends="periodic")


@pytest.mark.parametrize("kind", ["cubic", "quintic"])
def test_a_whole_turn_is_periodic(kind):
    """Its quaternion comes back with the other sign; speeds are those of the start."""
    times, angles = np.linspace(0.0, 4.0, 13), np.linspace(0.0, 2.0 * np.pi, 13)
    none = np.zeros_like(angles)
    turn = np.stack([np.cos(0.5 * angles), none, none, np.sin(0.5 * angles)], axis=1)
    spline = interpolated(times, np.zeros((13, 3)), turn, interpolation=kind, ends="periodic")
    found = states_along(spline, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(found.rotation[0], found.rotation[2], atol=1e-9)
    np.testing.assert_allclose(found.angular_velocity, [[0.0, 0.0, 0.5 * np.pi]] * 3, atol=1e-2)
    np.testing.assert_allclose(found.angular_velocity[0], found.angular_velocity[2], atol=1e-9)
    with pytest.raises(InputError, match="orientation"):
        interpolated(times, np.zeros((13, 3)), turn[:, [0, 1, 2, 3]] + 0.1 * angles[:, None], ends="periodic")


def test_hermite_takes_the_derivatives_as_they_are():
    rates, bends = np.random.default_rng(4).normal(size=(2, 6, 3))
    for more in ({}, {"accelerations": bends}):
        spline = interpolated(TIMES, PLACES, velocities=rates, interpolation="hermite", **more)
        found = values(spline, TIMES)
        np.testing.assert_allclose(found[0], PLACES, atol=1e-12)
        np.testing.assert_allclose(found[1], rates, atol=1e-11)
        if more:
            np.testing.assert_allclose(found[2], bends, atol=1e-10)


def test_signs_of_quaternions_do_not_matter():
    rng = np.random.default_rng(5)
    rotations = np.array([1.0, 0.0, 0.0, 0.0]) + 0.3 * rng.normal(size=(6, 4))
    signs = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0])[:, None]
    spline = interpolated(TIMES, PLACES, rotations)
    other = interpolated(TIMES, PLACES, 3.0 * signs * rotations)
    np.testing.assert_allclose(spline.quaternion, other.quaternion, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(continuous(rotations), axis=1), 1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"times": TIMES[[0, 2, 1, 3, 4, 5]]}, "times[2] = 1.7: must be more than times[1] = 2.0"),
        ({"times": TIMES[[0, 1, 1, 3, 4, 5]]}, "times[2] = 1.7: must be more than times[1] = 1.7"),
        ({"times": np.append(TIMES[:-1], np.nan)}, "finite"),
        ({"positions": PLACES[:-1]}, "(6, 3)"),
        ({"positions": np.where(np.arange(6)[:, None] == 4, np.nan, PLACES)}, "positions[4]"),
        ({"quaternions": np.eye(6, 4)}, "quaternions[4]"),
        ({"interpolation": "linear"}, '"cubic" or "quintic" or "hermite"'),
        ({"times": TIMES[:2], "positions": PLACES[:2], "interpolation": "quintic", "ends": "natural"}, "ends"),
        ({"ends": "open"}, '"rest" or "natural" or "periodic"'),
        ({"velocities": PLACES}, "velocities"),
        ({"interpolation": "hermite"}, 'must be "cubic" or "quintic" for samples without velocities'),
        ({"times": np.arange(6) * 1e-150}, "times[1] = 1e-150: must be 1e-12 s or more behind"),
        ({"accelerations": PLACES}, "accelerations"),
    ],
)
def test_samples_that_are_none(change, words):
    bare = inspect.unwrap(interpolated)  # shapes are compared in the soak, and these are wrong
    with pytest.raises(InputError) as error:
        bare(**{"times": TIMES, "positions": PLACES} | change)
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("ends", ["rest", "natural"])
def test_derivatives_at_ends(ends):
    """Those that are prescribed hold at their end alone; `ends` decides about what is left."""
    velocity, acceleration = np.array([0.3, -1.0, 2.0]), np.array([1.0, 4.0, -2.0])
    nothing = np.full(3, np.nan)
    cubic = interpolated(TIMES, PLACES, ends=ends, end_velocities=np.stack([velocity, nothing]))
    condition = (1, np.zeros(3)) if ends == "rest" else (2, np.zeros(3))
    check_same(cubic, CubicSpline(TIMES, PLACES, bc_type=((1, velocity), condition)))
    quintic = interpolated(
        TIMES,
        PLACES,
        interpolation="quintic",
        ends=ends,
        end_velocities=np.stack([nothing, velocity]),
        end_accelerations=np.stack([nothing, acceleration]),
    )
    others = [(order, np.zeros(3)) for order in ((1, 2) if ends == "rest" else (3, 4))]
    check_same(quintic, make_interp_spline(TIMES, PLACES, 5, bc_type=(others, [(1, velocity), (2, acceleration)])))
