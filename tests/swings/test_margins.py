"""The reported margin is the smallest slack of the motion itself, not of some samples of it."""

import itertools
from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TILTED, equilateral
from oracles import point_mass as oracle

from cspr_jax.families.swings import hypocycloid
from cspr_jax.families.swings.proof import criteria
from cspr_jax.families.swings.proof.margins import margins
from cspr_jax.families.swings.proof.verdicts import SMALL, prove
from cspr_jax.motion.amplitudes import from_pieces, named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import vertex
from cspr_jax.robots.model import point_mass
from cspr_jax.robots.model.limits import Limits

N, Z0 = 40, 1.7
BASES = {"prototype": equilateral(0.26), "tilted": TILTED}
ROBOTS = {name: point_mass.point_mass_robot(base, mass=0.8) for name, base in BASES.items()}
QUINTIC, EFFECTIVE = named("quintic"), named("effective", 0.2)
PRINTED = {"quintic": (QUINTIC, oracle.quintic), "effective": (EFFECTIVE, partial(oracle.effective, epsilon=0.2))}
SEGMENTS = jax.jit(jax.vmap(lambda *given: hypocycloid.segment(*given[:4], odd=given[4]), in_axes=(None, 0, 0, 0, 0)))


def random_segments(name, seed, n=N):
    rng, centre = np.random.default_rng(seed), BASES[name].mean(0)
    starts, ends = (centre + rng.uniform([-1.1, -1.1, 0.2], [1.1, 1.1, 3.2], (n, 3)) for _ in range(2))
    arcs = rng.integers(1, 13, n)
    segments = SEGMENTS(ROBOTS[name], starts, ends, np.full(n, Z0), arcs % 2 == 1)
    return starts, ends, arcs, jax.tree.map(np.asarray, segments)


def reference(base, start, end, arcs, printed):
    """The independent implementation's margin: the smallest of 20,001 samples of each criterion, zoomed in thrice."""
    center, normal = base.mean(0) + np.array([0.0, 0.0, Z0]), oracle.plane_normal(base)

    def values(tau):
        _, position, _, second_derivative = oracle.motion(
            start, end, center, 9.81, int(arcs), tau, printed, z0=Z0, normal=normal
        )
        kappa = oracle.normalised_pseudotensions(base, center, position, second_derivative, 9.81)
        return np.c_[kappa, oracle.height_ratio(base, position, center)]

    whole = np.linspace(0.0, 1.0, 20_001)
    found, smallest = values(whole), []
    for k in range(4):
        tau, column = whole, found[:, k]
        for _ in range(3):
            i = int(np.argmin(column))
            tau = np.linspace(tau[max(i - 1, 0)], tau[min(i + 1, len(tau) - 1)], 101)
            column = values(tau)[:, k]
        smallest.append(min(column.min(), found[:, k].min()))
    return min(smallest)


CASES = list(itertools.product(BASES, PRINTED))


@cache
def measured(name, amplitude):
    """Margins, proof, and the reference's margins."""
    starts, ends, arcs, segments = random_segments(name, CASES.index((name, amplitude)))
    mine, theirs = PRINTED[amplitude]
    problem = Problem(ROBOTS[name], Limits(), mine)
    wanted = [reference(BASES[name], *s, theirs) for s in zip(starts, ends, arcs, strict=True)]
    return margins(problem, segments, arcs), prove(problem, segments, arcs), np.array(wanted)


QUICK = [
    pytest.param(*case, marks=() if case[0] == "tilted" else pytest.mark.thorough, id="-".join(case)) for case in CASES
]


@pytest.mark.parametrize(("name", "amplitude"), QUICK)
def test_margins_lie_between_what_is_proved_and_what_is_sampled(name, amplitude):
    """A margin below the proved bound, or above a sample of the certificate, belongs to another motion."""
    found, proof, wanted = measured(name, amplitude)
    assert (found >= proof.bound - 1e-12).all()
    assert (found <= proof.sampled + 1e-12).all()
    assert (found.min(1) >= wanted - 1e-9 * (1.0 + np.abs(wanted))).all()


@pytest.mark.parametrize(("name", "amplitude"), QUICK)
def test_margins_are_the_true_minima(name, amplitude):
    """The stated margin must not depend on where the samples lie: 1e-5, where samples alone err by 1e-3."""
    found, _, wanted = measured(name, amplitude)
    np.testing.assert_allclose(found.min(1), wanted, rtol=1e-5, atol=1e-5)


def test_margins_do_not_depend_on_where_the_samples_lie():
    """The same function in pieces puts every sample elsewhere."""
    quintic = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)
    in_pieces = from_pieces("quintic in pieces", (0.237, 0.611), (0.0, 0.0, 0.0), (quintic, quintic, quintic))
    _, _, arcs, segments = random_segments("prototype", 9, 200)
    one, other = (margins(Problem(ROBOTS["prototype"], Limits(), a), segments, arcs) for a in (QUINTIC, in_pieces))
    np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-5)


def test_margins_of_limits():
    """Every limit's column, against many samples; its sign, height and length against the independent reference."""
    name, limit = "prototype", {"tension_min": 0.5, "tension_max": 9.0, "cable_length_max": 2.4}
    limit |= {"cable_speed_max": 4.0, "cable_acceleration_max": 8.0}
    limits = Limits(**{key: np.full(3, value) for key, value in limit.items()}, floor=np.asarray(3.1))
    problem = Problem(ROBOTS[name], limits, QUINTIC)
    starts, ends, arcs, segments = random_segments(name, 7)
    found = margins(problem, segments, arcs)
    assert found.shape == (N, len(criteria.flags(limits))) == (N, 8)
    at = jax.vmap(
        jax.vmap(lambda s, p, t: jnp.stack(criteria.slacks(*problem, s, p, t)), (None, None, 0)), (0, 0, None)
    )
    dense = np.asarray(jax.jit(at)(segments, arcs.astype(float), np.linspace(0.0, 1.0, 4001))).min(1)
    assert (found <= dense + 1e-3 * (1.0 + np.abs(dense))).all()
    assert (found >= dense - 1e-3 * (1.0 + np.abs(dense))).all()
    for i in range(N):
        extremes = oracle.limits(BASES[name], 0.8, starts[i], ends[i], Z0, 9.81, int(arcs[i]), samples=10_001)
        assert found[i, 4] == pytest.approx((3.1 - extremes["z_max"]) / Z0, abs=1e-4)
        assert found[i, 5] == pytest.approx((2.4**2 - extremes["length_max"] ** 2) / (2.0 * Z0**2), abs=1e-4)
        left = {6: 4.0 - extremes["speed_max"], 7: 8.0 - extremes["cable_acceleration_max"]}
        if found[i, 1] > 0.0:
            left |= {2: extremes["tension_min"] - 0.5, 3: 9.0 - extremes["tension_max"]}
        assert all((found[i, column] > 0.0) == (value > 0.0) for column, value in left.items())


@pytest.mark.thorough
@pytest.mark.parametrize(
    "wide",
    [
        {"tension_max": 60.0, "cable_speed_max": 9.0, "cable_length_max": 4.4},
        {"tension_max": 6e3, "cable_length_max": 44.0},
    ],
    ids=["limits are nearest", "the depth is nearer than limits"],
)
def test_many_segments_with_limits_have_the_margins_of_few(wide):
    """Two numbers are refined where all slacks are positive, and one for each criterion elsewhere."""
    limits = Limits(**{key: np.full(3, value) for key, value in wide.items()})
    problem, count = Problem(ROBOTS["prototype"], limits, QUINTIC), 3 * SMALL
    _, _, arcs, segments = random_segments("prototype", 8, count)
    many = margins(problem, segments, arcs)
    rows = np.split(np.arange(count), 3)
    few = np.concatenate([margins(problem, jax.tree.map(lambda leaf, k=k: leaf[k], segments), arcs[k]) for k in rows])
    is_met = (few > 0.0).all(1)
    assert 20 < is_met.sum() < count - 20
    for columns in (slice(None, 2), slice(2, None)):
        np.testing.assert_allclose(many[:, columns].min(1), few[:, columns].min(1), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(many[~is_met], few[~is_met], rtol=1e-12, atol=1e-13)


def test_order_of_the_segments_does_not_matter():
    """Segments are sorted by arcs inside: answers must come back in the caller's order."""
    problem = Problem(ROBOTS["prototype"], Limits(), QUINTIC)
    _, _, arcs, segments = random_segments("prototype", 5)
    mixed = np.random.default_rng(6).permutation(N)
    shuffled = jax.tree.map(lambda leaf: leaf[mixed], segments)
    assert np.array_equal(margins(problem, shuffled, arcs[mixed]), margins(problem, segments, arcs)[mixed])
    one, other = prove(problem, segments, arcs), prove(problem, shuffled, arcs[mixed])
    for field in ("feasible", "infeasible", "sampled", "bound"):
        assert np.array_equal(getattr(one, field)[mixed], getattr(other, field))


def test_vertex_of_a_parabola():
    """The step of the refinement: exact for parabolas, and within the samples otherwise."""
    found = jax.jit(vertex)
    for place in (-0.9, -0.2, 0.0, 0.7):
        left, middle, right = ((x - place) ** 2 for x in (-1.0, 0.0, 1.0))
        assert float(found(left, middle, right)[0]) == pytest.approx(place)
    assert float(found(0.0, 1.0, 1.5)[0]) == -1.0  # bent down: an end
    assert float(found(6.25, 2.25, 0.25)[0]) == 1.0  # beyond: clipped
