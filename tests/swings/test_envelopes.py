"""Envelopes of transitions along time, the closed forms of A = tau, and polar axes."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.amplitudes import of_one_shape
from support.commands import cspr, refuse_sweep

from cspr_jax.families.swings.proof.margins import margins
from cspr_jax.families.swings.transitions import envelope_oscillations as counts
from cspr_jax.families.swings.transitions import zero_tension
from cspr_jax.families.swings.transitions.envelopes import lower_envelope, proved_envelope
from cspr_jax.families.swings.transitions.oscillations import transition_margins, transitions_to
from cspr_jax.motion.amplitudes import derivatives, named
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.store.reading.result import open_result

CURVES = {"A1": (0, 0, 0, 4, -3), "A2": (0, 0, 0, 10, -15, 6), "A3": (0, 0, 0, 6, -7, 2)}
SWEEP = """schema = 1
map = "transition-envelopes"
robot = "transition-planar"
[axes]
inclination = [-0.6, -0.2, 0.0, 0.2, 0.6]
tau = { start = 0.0, stop = 1.0, count = 201 }
cable = [1, 2]
x = [2.772]
y = [0.0]
z = [2.0]
[trajectory]
family = "transition"
amplitude = "A1"
"""


LEAST, BEST = jax.jit(counts.least_oscillations), jax.jit(counts.best_inclination)
LOWER = jax.jit(jax.vmap(lower_envelope, (None, None, None, None, 0)))
IDEAL, IDEAL_BEST = jax.jit(zero_tension.least_oscillations), jax.jit(zero_tension.best_inclination)
IDEAL_OF_MANY, PROVED = jax.jit(jax.vmap(zero_tension.least_oscillations, (None, 0))), jax.jit(proved_envelope)


def run(folder, text, name="sweep"):
    (folder / f"{name}.toml").write_text(text)
    code, _, err = cspr("run", folder / f"{name}.toml", "-o", folder / name)
    assert (code, err) == (0, "")
    return open_result(folder / name / f"{name}.h5")


@pytest.mark.parametrize("name", CURVES)
def test_horizontal_transitions_as_printed(name):
    """(1.53), from its own letters, on 20,001 instants; and no envelope below zero at that number, (1.50)."""
    curve, tau = np.polynomial.Polynomial(CURVES[name]), np.linspace(0.0, 1.0, 20_001)
    a, s, end = curve(tau), curve.deriv()(tau), curve.deriv(2)(1.0)
    c = curve.deriv(2)(tau) - a * end
    for w in (0.5, 2.0, 4.0, 12.0):
        printed = (2 * w**2 * s**2 + end + w * np.sqrt(4 * w**2 * s**4 + 4 * end * s**2 + c**2 + 0j).real) / (
            4 * np.pi**2
        )
        amplitude = of_one_shape(named(name))
        found = float(LEAST(amplitude, np.array([w, -w, 0.3 * w]), 0.0))
        assert found == pytest.approx(math.sqrt(max(printed.max(), 0.0)), rel=1e-7, abs=1e-4)
        at = np.asarray(LOWER(amplitude, w, 0.0, found, np.linspace(0.0, 1.0, 101)))
        assert at.min() > -1e-9 and (found == 0.0 or at.min() < 0.01)


def test_the_envelope_is_the_worst_phase():
    """Of 1 - C cos + S sin as the phase runs through everything."""
    rng, amplitude = np.random.default_rng(3), of_one_shape(named("A1"))
    for w, v, n, tau in rng.uniform([-2.0, -0.9, 1.0, 0.0], [2.0, 0.9, 5.0, 1.0], (20, 4)):
        curve = np.polynomial.Polynomial(CURVES["A1"])
        a, s, b, end = curve(tau), curve.deriv()(tau), curve.deriv(2)(tau), curve.deriv(2)(1.0)
        omega, phase = 4 * np.pi**2 * n**2 - end, np.linspace(0.0, 2 * np.pi, 40_001)
        worst = (
            1
            - ((v + w) * (b - a * end) / omega - v * a) * np.cos(phase)
            + 4 * np.pi * n * (v + w) * s / omega * np.sin(phase)
        )
        (found,) = LOWER(amplitude, w, v, n, np.array([tau]))
        assert float(found) == pytest.approx(worst.min(), abs=1e-7)


@pytest.mark.thorough
def test_a_sweep_of_envelopes(tmp_path):
    """N_1(v) = N_2(-v), (1.49); the largest N is the number squared; without names the worst cable."""
    result = run(tmp_path, SWEEP)
    squared, envelope, least = (
        result.data[key][..., 0, 0, 0] for key in ("squared_oscillations", "lower_envelope", "least_oscillations")
    )
    np.testing.assert_allclose(squared[:, :, 0], squared[::-1, :, 1], rtol=1e-9, atol=1e-12)
    highest = squared.max((1, 2))
    np.testing.assert_allclose(least[:, 0, 0] ** 2, highest, rtol=2e-3)
    assert (least[:, 0, 0] ** 2 >= highest * (1.0 - 1e-12)).all()
    assert (envelope > -1e-9).all() and (envelope.min((1, 2)) < 0.01).all()
    np.testing.assert_allclose(envelope[:, 0], 1.0, atol=1e-12)
    whole = run(tmp_path, SWEEP.replace("cable = [1, 2]\n", ""), "whole")
    np.testing.assert_allclose(whole.data["squared_oscillations"][..., 0, 0, 0], squared.max(2), rtol=1e-12)
    np.testing.assert_allclose(whole.data["lower_envelope"][..., 0, 0, 0], envelope.min(2), rtol=1e-12, atol=1e-12)
    assert cspr("verify", tmp_path / "whole")[0] == 0
    output = tmp_path / "lines.png"
    chosen = ("--quantity", "squared_oscillations", "--lines", "tau")
    assert cspr("plot", tmp_path / "sweep" / "sweep.h5", *chosen, "-o", output)[0] == 0 and output.exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("tau = { start = 0.0, stop = 1.0, count = 201 }\n", ""), "axes.tau is missing"),
        (("stop = 1.0, count", "stop = 1.5, count"), "axes.tau = 1.005: must be a number in [0, 1]"),
        (("[1, 2]", "[1, 3]"), "axes.cable: must be numbers of cables, from 1 to 2"),
        (("[1, 2]", "[1.5]"), "axes.cable = 1.5: must be a whole number"),
        (("x = [2.772]\ny = [0.0]", "radius = [2.772]\nazimuth = [0.0]"), "axes.y: must be [0]"),
        (("x = [2.772]\n", ""), "axes: y: must be x and y, or radius and azimuth"),
        (("x = [2.772]\n", "x = [2.772]\nradius = [1.0]\n"), "axes: x, y, radius: must be"),
        (('"transition-envelopes"', '"minimum-oscillations"'), "axes.tau: must be absent"),
        (("[trajectory]", '[run]\nstore = ["margin"]\n[trajectory]'), "run.store: margin: must be one of"),
    ],
)
def test_mistakes(tmp_path, change, words):
    assert change[0] in SWEEP
    refuse_sweep(tmp_path, SWEEP.replace(*change), words)


A_IS_TAU = of_one_shape(named("ideal"))


@pytest.mark.thorough
@settings(max_examples=40)
@given(st.floats(0.05, 6.0), st.floats(0.0, 1.0), st.sampled_from([-1.0, 1.0]), st.floats(-0.95, 0.95))
def test_closed_forms_of_the_zero_tension_function(r, xi, sigma, v):
    """(1.115) to (1.118) as printed, and the search that knows nothing of them."""
    w = np.array([2 * sigma * r - sigma * r * xi, sigma * r * xi, -2 * sigma * r])  # (1.114)
    found = float(IDEAL(w, v))
    assert found == pytest.approx(float(LEAST(A_IS_TAU, w, v)), rel=1e-9)
    best, least = (float(x) for x in IDEAL_BEST(w))
    near = r**2 * xi <= 1.0
    assert best == pytest.approx(sigma * r * xi / 2 if near else sigma / (2 * r), abs=1e-12)  # (1.117)
    printed = (4 - xi) * r / math.sqrt(4 - r**2 * xi**2) if near else math.sqrt(4 * r**2 - 1)
    assert least == pytest.approx(printed / math.pi, rel=1e-12)  # (1.118)
    searched = IDEAL_OF_MANY(w, np.linspace(-0.99, 0.99, 199))
    assert least <= float(searched.min()) * (1.0 + 1e-12)
    assert float(BEST(A_IS_TAU, w)[1]) == pytest.approx(least, rel=3e-8)  # a kink


@pytest.mark.thorough
def test_polar_axes(tmp_path):
    """The same targets by x and y and by radius and azimuth; the map of A = tau has the closed forms' numbers."""
    head = """schema = 1
map = "minimum-oscillations"
[robot]
name = "aside"
mass = 1.0
z_axis = "AXIS"
base_points = [[1.0, -0.3, 0.1], [-0.2, -0.4, 0.0], [0.3, 1.0, -0.1]]
[axes]
z = [DEPTH]
z0 = [1.3]
TARGETS
[trajectory]
family = "transition"
"""
    radius, azimuth = np.array([0.4, 1.5]), np.array([-2.0, 0.3, 1.6])
    middle = np.array([1.1 / 3.0, 0.1])
    for axis, depth in (("down", 1.6), ("up", -1.6)):
        text = head.replace("AXIS", axis).replace("DEPTH", str(depth))
        polar = f"radius = {radius.tolist()}\nazimuth = {azimuth.tolist()}"
        found = run(tmp_path, text.replace("TARGETS", polar), f"polar_{axis}").data["least_oscillations"][0, 0]
        # Every target's x and y are on axes of a second grid.
        x = (middle[0] + radius[:, None] * np.cos(azimuth)).ravel()
        y = (middle[1] + radius[:, None] * np.sin(azimuth)).ravel()
        level = f"x = {sorted(x.tolist())}\ny = {sorted(y.tolist())}"
        grid = run(tmp_path, text.replace("TARGETS", level), f"level_{axis}").data["least_oscillations"][0, 0]
        same = grid[np.searchsorted(np.sort(x), x), np.searchsorted(np.sort(y), y)]
        np.testing.assert_allclose(same, found.ravel(), rtol=1e-9)


@pytest.mark.parametrize("name", ["A1", "A2", "A3", "effective", "effective-c3"])
def test_what_envelopes_prove(name):
    """No envelope of 20,001 instants goes below the bound, which is close to it; nor does the depth."""
    amplitude = of_one_shape(named(name, 0.08 if name.startswith("effective") else None))
    rng, close = np.random.default_rng(6), []
    a, s, b = (np.asarray(x) for x in derivatives(amplitude, jnp.linspace(0.0, 1.0, 20_001), order=2))
    for _ in range(25):
        w = rng.normal(size=2) * rng.choice([0.5, 2.0, 6.0])
        w, v = np.array([*w, -w.sum()]), rng.uniform(-0.95, 0.95)
        n = float(LEAST(amplitude, w, v)) * rng.uniform(0.9, 1.5) + 0.2
        omega, load = (2.0 * np.pi * n) ** 2 - b[-1], v + np.array([*w, -v])[:, None]
        envelope = 1.0 - np.hypot(load * (b - a * b[-1]) / omega - v * a, 4.0 * np.pi * n * load * s / omega)
        bound = float(PROVED(amplitude, w, v, n))
        assert bound <= envelope.min() + 1e-12
        close.append(envelope.min() - bound)
    assert np.median(close) < 0.01


@pytest.mark.quick("A1")
@pytest.mark.parametrize("name", ["A1", "quintic", "effective"])
def test_margins_of_transitions_from_two_functions(name, tilted):
    """The same as from the slack of each cable and the depth, where feasible and where not."""
    problem = Problem(tilted, Limits(), of_one_shape(named(name, 0.1 if name == "effective" else None)))
    rng = np.random.default_rng(7)
    targets = rng.uniform([-4.0, -4.0, 0.2], [4.0, 4.0, 3.4], (150, 3))
    segments, arcs = transitions_to(problem, targets, np.full(150, 1.6)), 2 * rng.integers(1, 9, 150)
    found, wanted = transition_margins(problem, segments, arcs), margins(problem, segments, arcs)
    assert 25 < (wanted.min(1) > 0.0).sum() < 125
    np.testing.assert_allclose(found.min(1), wanted.min(1), atol=1e-9, rtol=1e-9)
    negative = wanted.min(1) <= 0.0
    np.testing.assert_array_equal(found[negative], wanted[negative])
