"""The motion on an ellipse: places and derivatives, z up and down, bounds, words for frequencies, proofs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import ellipses as oracle
from support.ellipses import ellipses, triangle
from support.motions import states_along

import cspr_jax
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.transfers import Turning, motion_between
from cspr_jax.motion import amplitudes

GRAVITY = 9.81
CENTRE, A, B = np.array([0.2, -0.1, 2.0]), np.array([0.5, 0.1, 0.2]), np.array([-0.2, 0.4, -0.1])
UP = np.array([1.0, -1.0, -1.0])


def robot(z_axis="down"):
    spools = np.array([[1.0, 0.2, 0.1], [-0.6, 1.1, -0.2], [-0.7, -0.9, 0.05]])
    return cspr_jax.point_mass(spools if z_axis == "down" else spools * UP, mass=0.8, gravity=GRAVITY, z_axis=z_axis)


@pytest.mark.parametrize("z_axis", [pytest.param("down", marks=pytest.mark.thorough), "up"])
def test_places_and_derivatives(z_axis):
    turns, frequency, phase = 1.7, 2.3, 0.4
    axes = UP if z_axis == "up" else np.ones(3)
    centre, a, b = (axes * x for x in (CENTRE, A, B))
    motion = cspr_jax.ellipse(robot(z_axis), centre, a, b, frequency=frequency, phase=phase, turns=turns)
    duration = float(motion.duration())
    assert duration == pytest.approx(turns * 2.0 * np.pi / frequency, rel=1e-14)
    tau = np.linspace(0.0, 1.0, 101)
    state = states_along(motion, tau)
    exact_states = oracle.states(centre, a, b, frequency, phase + frequency * duration * tau)
    for found, exact in zip(state[:3], exact_states, strict=True):
        np.testing.assert_allclose(found, exact[0], atol=1e-12)
    for value, slope in ((0, 1), (1, 2)):
        rate = jax.jit(jax.vmap(jax.jacfwd(lambda t, k=value: motion.state(t)[k])))(jnp.asarray(tau))
        np.testing.assert_allclose(rate / duration, state[slope], atol=1e-11)


def test_derivatives_and_angles_between_ellipses():
    last = Turning(Ellipse(CENTRE + 0.3, 1.4 * A, 0.6 * B), 2.9, 1.1)
    motion = motion_between(amplitudes.named("quintic"), Turning(Ellipse(CENTRE, A, B), 2.3, 0.4), last, 2, 0.25)
    duration, tau = float(motion.duration()), np.linspace(0.0, 1.0, 101)
    state = states_along(motion, tau)
    for value, slope in ((0, 1), (1, 2)):
        rate = jax.jit(jax.vmap(jax.jacfwd(lambda t, k=value: motion.state(t)[k])))(jnp.asarray(tau))
        np.testing.assert_allclose(rate / duration, state[slope], atol=1e-10)
    np.testing.assert_allclose(state[0][0], CENTRE + A * np.cos(0.4) + B * np.sin(0.4), atol=1e-12)
    exact = oracle.states(*last.ellipse, 2.9, np.array([1.1 + 0.5 * np.pi]))
    for found, own in zip(state[:3], exact, strict=True):
        np.testing.assert_allclose(found[-1], own[0, 0], atol=1e-11)
    # From the one angle to the other at the mean pace, and a quarter of a turn.
    assert duration == pytest.approx((1.1 - 0.4) / 2.6 + 0.5 * np.pi / 2.9, rel=1e-12)


def test_bounds_contain_samples():
    motion = cspr_jax.ellipse(robot(), CENTRE, A, B, frequency=2.3, phase=0.4, turns=3.0).motion
    rng = np.random.default_rng(0)
    start = np.concatenate([[0.0], rng.uniform(0.0, 0.9, 63)])
    end = start + np.concatenate([[1.0], rng.uniform(1e-6, 0.1, 63)])
    bounds = motion.bounds(float(motion.duration()) * start, float(motion.duration()) * end)
    fraction = np.linspace(0.0, 1.0, 41)
    state = states_along(motion, start[:, None] + (end - start)[:, None] * fraction)
    for band, found in zip(bounds[:3], state[:3], strict=True):
        line = band.middle[:, None] + (2.0 * fraction[:, None] - 1.0) * np.asarray(band.linear)[:, None]
        assert (np.abs(found - line) <= np.asarray(band.radius)[:, None]).all()
        # Short blocks have narrow bands: the height of an arc.
        assert (np.asarray(band.radius)[1:] < 60.0 * ((end - start)[1:, None] * 3.0 * np.pi) ** 2 + 1e-12).all()


@pytest.mark.thorough
def test_words_for_frequencies():
    rng = np.random.default_rng(1)
    spools, checked = triangle(rng), 0
    made = cspr_jax.point_mass(spools, mass=1.0, gravity=GRAVITY)
    many = ellipses(rng, spools, GRAVITY, 16, above=False)[:3]
    for centre, a, b, ends in zip(*many, cspr_jax.ellipse_frequencies(made, *many), strict=True):
        if len(ends) == 0 or ends[0, 0] == 0.0 or checked == 1:
            continue
        checked += 1
        # Of one turn each.
        rate = {
            word: 2.0 * np.pi / float(cspr_jax.ellipse(made, centre, a, b, frequency=word).duration())
            for word in ("natural", "slowest", "best", "fastest")
        }
        low, high = ends[0]
        assert rate["natural"] == pytest.approx(np.sqrt(GRAVITY / oracle.depths(spools, centre)), rel=1e-12)
        assert low < rate["slowest"] < low * (1.0 + 3e-5) and high * (1.0 - 3e-5) < rate["fastest"] < high
        frequencies = np.append(np.linspace(low, high, 401), rate["best"])
        margins = cspr_jax.ellipse_margins(made, np.tile(centre, (402, 1)), a, b, frequencies)
        assert margins[-1] >= margins[:-1].max()
        # What a proof can tell from infeasible.
        for word in ("slowest", "fastest"):
            assert cspr_jax.check(made, cspr_jax.ellipse(made, centre, a, b, frequency=word)).feasible
    assert checked == 1


def compare_checks(rng, triangles, each):
    """Proofs of whole motions agree with samples; how many were feasible and not."""
    counts = [0, 0]
    for _ in range(triangles):
        spools = triangle(rng)
        made = cspr_jax.point_mass(spools, mass=1.0, gravity=GRAVITY)
        for centre, a, b, frequency in zip(*ellipses(rng, spools, GRAVITY, each), strict=True):
            if not (np.abs(a).any() or np.abs(b).any()):
                continue
            found = cspr_jax.check(made, cspr_jax.ellipse(made, centre, a, b, frequency=frequency))
            margin = oracle.margins(spools, GRAVITY, centre, a, b, frequency)[1].min()
            is_feasible = oracle.depths(spools, centre) > 0.0 and margin > 0.0
            assert found.verdict != "undecided" and found.feasible == is_feasible
            counts[int(is_feasible)] += 1
    return counts


@pytest.mark.thorough
def test_proofs_agree_with_samples():
    assert min(compare_checks(np.random.default_rng(2), 3, 16)) > 8


def test_a_proof_agrees_with_samples():
    assert min(compare_checks(np.random.default_rng(3), 1, 4)) >= 1
