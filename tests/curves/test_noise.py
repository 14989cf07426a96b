"""Noise is told where it spoils accelerations, and nowhere else; smoothing takes off what is said."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cspr_jax.config.motions.table import MotionTable
from cspr_jax.curves.noise import noise_notes, noise_of
from cspr_jax.curves.smoothing import smoothed
from cspr_jax.errors import InputError


def least_jerk(t, duration):
    fraction = np.clip(t / duration, 0.0, 1.0)
    return fraction**3 * (10.0 - 15.0 * fraction + 6.0 * fraction**2)


def trapezoid(t, second_derivative, ramp):
    """Speed up, go on, slow down, each for as long, and rest; its acceleration jumps."""
    way = second_derivative * ramp * ramp
    down = 1.5 * way + second_derivative * ramp * (t - 2.0 * ramp) - 0.5 * second_derivative * (t - 2.0 * ramp) ** 2
    pieces = [0.5 * second_derivative * t * t, 0.5 * way + second_derivative * ramp * (t - ramp), down, 2.0 * way]
    return np.select([t < ramp, t < 2.0 * ramp, t < 3.0 * ramp, t >= 3.0 * ramp], pieces)


def to_and_fro(t):
    """Coordinates that lie on a grid by design, at these rates."""
    way = trapezoid(t % 1.5, 4.0, 0.5)
    return np.where((t // 1.5) % 2 == 0, way, 2.0 - way)


MOTIONS = {
    "least jerk": lambda t: np.stack([least_jerk(t, 5.0), 2.0 * least_jerk(t - 1.0, 3.0), 0 * t + 2.0], axis=1),
    "trapezoid": lambda t: np.stack([trapezoid(t, 0.9731, 1.03), 0 * t, 2.0 + trapezoid(t, 0.3137, 1.03)], axis=1),
    "to and fro": lambda t: np.stack([to_and_fro(t), 0 * t, 0 * t + 1.0], axis=1),
    "circle": lambda t: np.stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t), 0 * t + 2.0], axis=1),
    "fast": lambda t: 0.3 * np.stack([np.cos(9.4 * t), np.sin(9.4 * t), 7.0 + np.sin(8 * t)], axis=1),
    "slow": lambda t: 0.05 * np.stack([np.cos(0.5 * t), np.sin(0.5 * t), 0 * t + 2.0], axis=1),
    "mostly at rest": lambda t: np.stack([least_jerk(t - 8.0, 1.0), 0 * t, 0 * t + 2.0], axis=1),
}


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("rate", [10, 25, 100, pytest.param(1000, marks=pytest.mark.thorough)])
def test_clean_motions_and_fine_rounding_raise_no_alarm(name, rate):
    times = np.arange(0.0, 10.0 + 1e-9, 1.0 / rate)
    places = MOTIONS[name](times)
    assert noise_notes(MotionTable(times, places)) == []
    decimals = {10: 4, 25: 5, 100: 6, 1000: 9}[rate]
    assert noise_notes(MotionTable(times, np.round(places, decimals))) == []


@pytest.mark.parametrize("name", [name for name in MOTIONS if name != "to and fro"])
@pytest.mark.parametrize(("rate", "decimals"), [(100, 4), (1000, 4), (1000, 6)])
def test_rounding_is_noise(name, rate, decimals):
    times = np.arange(0.0, 10.0 + 1e-9, 1.0 / rate)
    found = noise_notes(MotionTable(times, np.round(MOTIONS[name](times), decimals)))
    if (name, rate) == ("fast", 100) or (name, rate) == ("circle", 100):
        return  # it adds little to accelerations of 26 and 39 m/s^2
    assert len(found) == 1 and f"since they are rounded to {10.0**-decimals:g}: smooth the record" in found[0]


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize(
    ("rate", "deviation"),
    [(25, 3e-3), (100, 1e-3), *(pytest.param(1000, x, marks=pytest.mark.thorough) for x in (1e-5, 1e-3))],
)
def test_noise_is_told_with_its_size(name, rate, deviation):
    rng = np.random.default_rng(5)
    times = np.arange(0.0, 10.0 + 1e-9, 1.0 / rate)
    places = MOTIONS[name](times) + deviation * rng.normal(size=(len(times), 3))
    found = noise_of(times, places)
    assert found is not None and found.step == 0.0
    assert found.deviation == pytest.approx(deviation, rel=0.6)
    (line,) = noise_notes(MotionTable(times, places))
    jumps = np.linalg.norm(np.diff(CubicSpline(times, places)(times, 2), axis=0), axis=1)
    assert line.startswith(f"accelerations jump by {np.median(jumps[jumps > 0.3]):.2g}"[:-2]) or "e+" in line
    assert "(--smooth " in line and "or give fewer samples" in line


def test_times_that_jitter():
    rng = np.random.default_rng(6)
    times = np.cumsum(0.001 * rng.uniform(0.6, 1.4, size=5000))
    places = MOTIONS["circle"](times)
    assert noise_of(times, places) is None
    found = noise_of(times, places + 1e-4 * rng.normal(size=places.shape))
    assert found.deviation == pytest.approx(1e-4, rel=0.6)


def test_way_points_are_no_noise():
    rng = np.random.default_rng(7)
    for count in (5, 40, 200):
        times = np.cumsum(rng.uniform(0.3, 2.0, size=count))
        assert noise_notes(MotionTable(times, rng.normal(size=(count, 3)))) == []


def test_orientations():
    rng = np.random.default_rng(8)
    times = np.arange(0.0, 5.0, 0.01)
    turns = np.stack([np.cos(times / 2), np.sin(times / 2), 0 * times, 0 * times], axis=1)
    still = np.ones((len(times), 3))
    assert noise_notes(MotionTable(times, still, turns)) == []
    noisy = turns + 0.5e-3 * rng.normal(size=turns.shape)
    (line,) = noise_notes(MotionTable(times, still, noisy / np.linalg.norm(noisy, axis=1, keepdims=True)))
    assert line.startswith("angular accelerations jump by") and "rad/s^2" in line
    assert noise_notes(MotionTable(times, still, turns + 1e-6 * rng.normal(size=turns.shape)), radius=0.1) == []


def test_smoothing_finds_the_motion():
    """What it takes off is the stated deviation; what it leaves is far nearer to the motion, and without noise."""
    rng = np.random.default_rng(9)
    times = np.arange(0.0, 4.0, 0.004)
    places = MOTIONS["circle"](times)
    turns = np.stack([np.cos(times / 2), np.sin(times / 2), 0 * times, 0 * times], axis=1)
    noisy = places + 1e-3 * rng.normal(size=places.shape)
    table = MotionTable(
        times, noisy, turns + 1e-3 * rng.normal(size=turns.shape), ends="natural", interpolation="hermite"
    )
    found = smoothed(table, 1e-3, angle=2e-3)
    assert (found.interpolation, found.ends, found.velocities) == ("cubic", "natural", None)
    taken = found.positions - noisy
    # The third coordinate does not move but for noise.
    assert np.sqrt(np.mean(taken**2)) == pytest.approx(1e-3, rel=0.02)
    assert np.sqrt(np.mean((found.positions - places) ** 2)) < 5e-4
    assert np.sqrt(np.mean((found.quaternions - turns) ** 2)) < 3e-4
    second_derivative = CubicSpline(times, found.positions)(times[50:-50], 2)
    np.testing.assert_allclose(np.linalg.norm(second_derivative, axis=1), 4.0 * np.pi**2, rtol=0.1)
    assert noise_notes(found) == []
    size = np.sqrt(np.mean(np.sum(taken**2, axis=1)))
    assert found.notes[0].startswith(f"smoothing moved positions by {size:.2g} m in the root mean square")
    assert found.notes[1].startswith("smoothing moved orientations by")


@pytest.mark.parametrize(
    ("deviation", "line"),
    [
        (0.0, "smooth = 0.0: must be a number > 0"),
        (np.nan, "smooth"),
        (9.0, "less than 0.41 m, by which rest at one place misses the positions"),
    ],
)
def test_smoothing_faults(deviation, line):
    times = np.arange(0.0, 4.0, 0.01)
    with pytest.raises(InputError) as caught:
        smoothed(MotionTable(times, MOTIONS["circle"](times)[:, [0, 0, 0]] * 0.58), deviation)
    assert line in str(caught.value)


def test_rounding_of_slow_motions():
    """Their differences of any order are mostly 0, but their accelerations jump with each step."""
    times = np.arange(0.0, 10.0, 0.001)
    line = np.outer(times, [0.0071, 0.0, 0.0])
    assert noise_notes(MotionTable(times, line)) == []
    (note,) = noise_notes(MotionTable(times, np.round(line, 4)))
    assert "since they are rounded to 0.0001" in note
