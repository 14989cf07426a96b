"""Maps of transitions: whole numbers of oscillations by the envelopes and by the true tensions."""

import jax
import numpy as np
import pytest
from conftest import equilateral
from support.commands import cspr, refuse_sweep

from cspr_jax.families.swings.transitions.oscillations import best_inclinations, minimum_oscillations, transitions_to
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import planar_robot, point_mass_robot
from cspr_jax.robots.statics import force_balance
from cspr_jax.store.reading.result import open_result

A1 = np.polynomial.Polynomial((0, 0, 0, 4, -3))
SPATIAL = point_mass_robot(equilateral(0.693), mass=0.129)
PLANAR = planar_robot([[0.693, 0.0, 0.0], [-0.693, 0.0, 0.0]], mass=0.129)


def balance(base, p, acceleration):
    """Tension per length of each cable, by a general solver; p (m, 3)."""
    rays = np.asarray(base)[None] - p[:, None]
    axes = [0, 2] if len(base) == 2 else [0, 1, 2]
    pulled = (acceleration - np.array([0.0, 0.0, 9.81]))[:, axes]
    return np.linalg.solve(rays[:, :, axes].transpose(0, 2, 1), pulled[..., None])[..., 0]


def smallest_pull(base, target, z0, n, samples=20_001):
    """Smallest tension per length along a transition with A1, from (1.20) and (1.29) alone."""
    tau = np.linspace(0.0, 1.0, samples)
    omega = 2.0 * np.pi * n
    time = np.sqrt((omega**2 - A1.deriv(2)(1.0)) * z0 / 9.81)
    swing = A1(tau) * np.cos(omega * tau)
    second_derivative = A1.deriv(2)(tau) * np.cos(omega * tau) - 2.0 * omega * A1.deriv()(tau) * np.sin(omega * tau)
    second_derivative = (second_derivative - omega**2 * swing) / time**2
    center = np.array([0.0, 0.0, z0])
    u = np.asarray(target) - center
    return balance(base, center + swing[:, None] * u, second_derivative[:, None] * u).min()


@pytest.mark.parametrize("robot", [SPATIAL, pytest.param(PLANAR, marks=pytest.mark.thorough)])
def test_whole_oscillations_against_the_force_balance(robot):
    """The number found is taut, one fewer is not; the envelopes never allow fewer than that."""
    rng = np.random.default_rng(4)
    count, z0 = 12, 1.7
    targets = np.stack([rng.uniform(-2.5, 2.5, count), rng.uniform(-2.5, 2.5, count), rng.uniform(0.3, 3.0, count)], 1)
    if robot is PLANAR:
        targets[:, 1] = 0.0
    problem, depth = Problem(robot, Limits(), named("A1")), np.full(count, z0)
    found = minimum_oscillations(problem, transitions_to(problem, targets, depth), depth)
    assert (found.oscillations > 0).all() and (found.oscillations <= found.envelope_oscillations).all()
    assert (found.oscillations < found.envelope_oscillations).any()
    for target, n in zip(targets, found.oscillations, strict=True):
        assert smallest_pull(robot.base_points, target, z0, n) > 0.0
        for fewer in range(1, n):
            assert smallest_pull(robot.base_points, target, z0, fewer) < 1e-9
    assert (found.margin_bound <= found.margin + 1e-9).all() and (found.margin > 0.0).all()


def test_planar_tensions():
    rng = np.random.default_rng(5)
    for base in (PLANAR.base_points, PLANAR.base_points[::-1]):
        robot = planar_robot(base, mass=0.4)
        p, a = rng.normal(size=(2, 50, 3)) * np.array([1.0, 0.0, 1.0])
        p[:, 2] = 0.2 + np.abs(p[:, 2])
        wanted = balance(base, p, a)
        for i in range(50):
            length = np.linalg.norm(np.asarray(base) - p[i], axis=1)
            force = jax.jit(force_balance.tensions)(robot, p[i], a[i])
            np.testing.assert_allclose(force, 0.4 * wanted[i] * length, rtol=1e-9, atol=1e-9)
            kappa = np.asarray(jax.jit(force_balance.pseudotensions)(robot, p[i], a[i]))
            assert (np.sign(kappa) == np.sign(wanted[i])).all()


def real(robot, targets, z0, name="quintic"):
    problem = Problem(robot, Limits(), named(name))
    depth = np.broadcast_to(np.asarray(z0, float), len(targets)).copy()
    return minimum_oscillations(problem, transitions_to(problem, targets, depth), depth, max_arcs=2)


@pytest.mark.soak
def test_symmetries():
    """Planar: as many to either side and at either inclination. Spatial: twelve-fold, with the best inclination too."""
    x = np.linspace(0.1, 3.0, 20)
    for v in (0.0, 0.4, 0.8):
        sides = [
            real(PLANAR, np.stack([s * x, 0.0 * x, np.full(20, 2.0 * (1.0 + w))], 1), 2.0)
            for s, w in ((1, v), (-1, v), (1, -v))
        ]
        for other in sides[1:]:
            np.testing.assert_allclose(other.least_oscillations, sides[0].least_oscillations, rtol=1e-9)
    radius = np.linspace(0.4, 3.0, 12)
    angle = 0.23
    first = second = None
    for turn in range(6):
        for mirror in (1.0, -1.0):
            bearing = mirror * angle + turn * np.pi / 3.0 + np.pi / 2.0
            points = np.stack([radius * np.cos(bearing), radius * np.sin(bearing), np.full(12, 2.0)], 1)
            level = real(SPATIAL, points, 2.0).least_oscillations
            v = np.abs(best_inclinations(Problem(SPATIAL, Limits(), named("quintic")), points))
            first, second = (level, v) if first is None else (first, second)
            np.testing.assert_allclose(level, first, rtol=1e-9)
            np.testing.assert_allclose(v, second, atol=1e-6)


@pytest.mark.thorough
def test_symmetries_at_a_fixed_inclination():
    """Six-fold, and the opposite target at the opposite inclination."""
    z0, radius, angle = 2.0, np.linspace(0.4, 3.0, 12), 0.23
    for v in (-0.7, -0.2, 0.5):

        def at(bearing, v):
            level = np.stack([radius * np.cos(bearing), radius * np.sin(bearing)], 1)
            return real(SPATIAL, np.column_stack([level, np.full(12, z0 * (1.0 + v))]), z0, "A1").least_oscillations

        first = at(np.pi / 2.0 + angle, v)
        for turn, mirror in ((1, 1.0), (2, 1.0), (0, -1.0), (2, -1.0)):
            bearing = np.pi / 2.0 + mirror * angle + turn * 2.0 * np.pi / 3.0
            np.testing.assert_allclose(at(bearing, v), first, rtol=1e-9)
            np.testing.assert_allclose(at(bearing + np.pi, -v), first, rtol=1e-9)
        assert np.abs(at(np.pi / 2.0 + angle + np.pi, v) - first).max() > 0.01


SWEEP = """schema = 1
map = "minimum-oscillations"
robot = "transition-prototype"
[axes]
x = [0.5, 1.0, 2.0]
y = [-1.0, 1.5]
z = [-0.5, 2.0]
[trajectory]
family = "transition"
amplitude = "A1"
inclination = "best"
"""


@pytest.mark.thorough
def test_a_sweep_with_the_best_inclination(tmp_path):
    path = tmp_path / "best.toml"
    path.write_text(SWEEP)
    code, _, err = cspr("run", path, "-o", tmp_path / "run")
    assert (code, err) == (0, "")
    data = open_result(tmp_path / "run" / "best.h5").data
    below = data["oscillations"][:, :, 1]
    assert (below > 0).all() and (data["oscillations"][:, :, 0] == 0).all()  # above the spools
    assert (data["inclination_gain"][:, :, 1] >= -1e-12).all() and (data["inclination_gain"][:, :, 1] > 0.01).any()
    np.testing.assert_allclose(data["used_z0"] * (1.0 + data["used_inclination"]), np.full((3, 2, 2), [-0.5, 2.0]))
    assert (data["least_oscillations"][:, :, 1] <= data["envelope_oscillations"][:, :, 1]).all()
    assert cspr("plot", tmp_path / "run" / "best.h5", "--quantity", "least_oscillations")[0] == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('inclination = "best"', ""), "must be one of them"),
        (('inclination = "best"', "inclination = 1.0"), "trajectory.inclination = 1.0"),
        (('family = "transition"', ""), 'must be "transition"'),
        (("[axes]", "[axes]\nz0 = [1.0]"), "must be one of them"),
        (("[axes]", "[axes]\nfrom_x = [1.0]"), "axes.from_x: must be absent"),
        (('"A1"', "{ polynomial = [0, 1] }"), "must meet (1.27) and (1.28)"),
        (("transition-prototype", "transition-planar"), "axes.y: must be [0]"),
        (('map = "minimum-oscillations"', 'map = "minimum-arcs"'), 'must be "hypocycloid-standard"'),
        (('inclination = "best"', 'inclination = "best"\n[run]\nstore = ["arcs"]'), "run.store: arcs: must be one of"),
    ],
)
def test_mistakes(tmp_path, change, words):
    assert change[0] in SWEEP
    refuse_sweep(tmp_path, SWEEP.replace(*change), words)


def test_the_ideal_function_bounds_horizontal_transitions():
    """(1.104): nothing needs less than A = tau does, which needs w_max / pi."""
    targets = np.stack([np.linspace(0.5, 3.0, 10), np.linspace(-1.0, 2.0, 10), np.full(10, 2.0)], 1)
    ideal = real(SPATIAL, targets, 2.0, "ideal").least_oscillations
    base = np.array(
        [targets[:, 1] - 3**0.5 * targets[:, 0], targets[:, 1] + 3**0.5 * targets[:, 0], -2 * targets[:, 1]]
    )
    np.testing.assert_allclose(ideal, np.abs(base / 0.693).max(0) / np.pi, rtol=1e-9)
    assert (real(SPATIAL, targets, 2.0).least_oscillations > ideal).all()
