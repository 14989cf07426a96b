"""Verdicts that hold between samples: the bounds they rest on, and their agreement with a dense reference."""

import dataclasses
import itertools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TILTED, equilateral
from oracles import point_mass as oracle
from support.amplitudes import of_one_shape

from cspr_jax.families.swings import hypocycloid
from cspr_jax.families.swings.proof import criteria, margins
from cspr_jax.families.swings.proof import verdicts as proof
from cspr_jax.families.swings.proof.blocks import blocks
from cspr_jax.families.swings.proof.limit_slacks import least_lengths, motion_bounds
from cspr_jax.families.swings.proof.slacks import interval_bounds, row_bounds, swing_state, taut_bounds
from cspr_jax.families.swings.proof.verdicts import SMALL, prove, tolerance
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.tolerances import SMALLEST_MARGIN
from cspr_jax.robots.model import point_mass
from cspr_jax.robots.model.limits import NO_LIMITS, Limits

COUNT, SOAK_COUNT = 200, 20_000
SAMPLES = 20_001
Z0 = 1.7
BASES = {"prototype": equilateral(0.26), "tilted": TILTED}
MASS = {"prototype": 0.198, "tilted": 1.7}
ROBOTS = {name: point_mass.point_mass_robot(base, mass=MASS[name]) for name, base in BASES.items()}
QUINTIC, EFFECTIVE, SMOOTH = named("quintic"), named("effective", 0.2), named("effective-c3", 0.2)
PRINTED = {"quintic": (QUINTIC, oracle.quintic), "effective": (EFFECTIVE, partial(oracle.effective, epsilon=0.2))}
SEGMENTS = jax.jit(jax.vmap(lambda *given: hypocycloid.segment(*given[:4], odd=given[4]), in_axes=(None, 0, 0, 0, 0)))


def segments_of(name, starts, ends, arcs):
    found = SEGMENTS(ROBOTS[name], starts, ends, np.full(len(arcs), Z0), arcs % 2 == 1)
    return jax.tree.map(np.asarray, found)


def random_points(rng, name, n):
    """Points near and far, some above the spools, some at rest, some on one circle around p0; and arcs."""
    centre = BASES[name].mean(0)
    far = {"prototype": 1.1, "tilted": 1.8}[name]
    starts, ends = (centre + rng.uniform([-far, -far, -0.1], [far, far, 3.2], (n, 3)) for _ in range(2))
    rest = centre + np.array([0.0, 0.0, Z0])
    starts[::17], ends[1::17] = rest, rest
    ends[2::17] = rest + (starts[2::17] - rest) * np.array([-1.0, 1.0, 1.0])
    return starts, ends, rng.integers(1, 13, n)


def spread_points(rng, name, n):
    """As above, but half of them from near p0 to far away in few arcs: there every term of a bound counts."""
    starts, ends, arcs = random_points(rng, name, n)
    half, rest = n // 2, BASES[name].mean(0) + np.array([0.0, 0.0, Z0])
    starts[:half] = rest + (starts[:half] - rest) * rng.uniform(0.0, 0.4, (half, 1))
    ends[:half] = rest + (ends[:half] - rest) * rng.uniform(1.0, 30.0, (half, 1))
    arcs[:half] = rng.integers(1, 4, half)
    return starts, ends, arcs


def instants(function):
    return jax.jit(jax.vmap(jax.vmap(function, (None, None, None, None, None, 0)), (None, None, None, 0, 0, 0)))


def kappa_eta(robot, limits, amplitude, segment, arcs, tau):
    now = swing_state(segment, amplitude, arcs, tau)
    return jnp.stack([*now.kappa, now.eta])


def kappa_eta_bounds(segment, amplitude, arcs, start, stop):
    over = interval_bounds(segment, amplitude, arcs, start, stop)
    each = zip(taut_bounds(segment, arcs, over), row_bounds(segment, arcs, over, segment.tilt), strict=True)
    return jnp.stack([jnp.append(kappa, eta) for kappa, eta in each])


KAPPA_ETA, SLACKS = instants(kappa_eta), instants(lambda *given: jnp.stack(criteria.slacks(*given)))
KAPPA_ETA_BOUNDS = jax.jit(jax.vmap(kappa_eta_bounds, (0, None, 0, 0, 0)))
CURVATURES = jax.jit(jax.vmap(lambda *given: jnp.stack(criteria.curvatures(*given)), (None, None, None, 0, 0, 0, 0)))


def random_intervals(rng, amplitude, n):
    """Intervals of very different lengths without a knot inside, and 17 instants of each."""
    edges = np.r_[0.0, amplitude.knots, 1.0]
    piece = rng.integers(0, len(edges) - 1, n)
    low, high = edges[piece], np.nextafter(edges[piece + 1], 0.0)
    width = 10.0 ** rng.uniform(-3.0, -0.7, n) * (high - low)
    start = low + (high - low - width) * rng.choice([0.0, 1.0, 0.5, 0.2, 0.8], n)
    return start, start + width, start[:, None] + width[:, None] * np.linspace(0.0, 1.0, 17)


def differences(values, tau):
    """Divided differences of samples (n, 17, m): each is a value of the first or second derivative; and their error."""
    step = (tau[:, 1] - tau[:, 0])[:, None, None]
    error = 2e-14 * (1.0 + np.abs(values).max(1, keepdims=True))
    return np.diff(values, axis=1) / step, np.diff(values, 2, axis=1) / step**2, error / step, error / step**2


@pytest.mark.parametrize("name", BASES)
@pytest.mark.parametrize("amplitude", [QUINTIC, EFFECTIVE, SMOOTH], ids=lambda a: a.name)
def test_bounds_of_each_cable_hold_and_are_sharp(name, amplitude):
    """Of every kappa_k and of eta: value, slope and curvature; too small proves falsehoods, too large nothing."""
    rng, n = np.random.default_rng(21), 3000
    starts, ends, arcs = spread_points(rng, name, n)
    segments, p, same = segments_of(name, starts, ends, arcs), arcs.astype(float), of_one_shape(amplitude)
    start, stop, tau = random_intervals(rng, amplitude, n)
    values = np.asarray(KAPPA_ETA(None, None, same, segments, p, tau)) - 1.0
    slope, second_derivative, slope_error, bend_error = differences(values, tau)
    bounds = np.asarray(KAPPA_ETA_BOUNDS(segments, same, p, start, stop))
    for j, (found, error) in enumerate(((values, 1e-12), (slope, slope_error), (second_derivative, bend_error))):
        bound = bounds[:, j]
        assert (np.abs(found) <= bound[:, None] * (1.0 + 1e-9) + error).all()
        assert ((np.abs(found).max(1) / np.maximum(bound, 0.1)).max(0) > 0.97).all()


LIMIT = {
    "tension_min": 0.1,
    "tension_max": 3.0,
    "floor": 3.0,
    "cable_length_max": 2.5,
    "cable_speed_max": 3.0,
    "cable_acceleration_max": 9.0,
}
REACH = {key: -1e6 if key == "tension_min" else 1e6 for key in LIMIT}


def limits_of(values, k=None):
    """The given limits, others out of reach; of cable k alone, or of all three."""
    far = {key: np.full(3, REACH[key]) for key in LIMIT}
    own = {key: np.where((np.arange(3) == k) | (k is None), value, far[key]) for key, value in values.items()}
    return Limits(**{key: np.asarray(v[0] if key == "floor" else v) for key, v in (far | own).items()})


@pytest.mark.thorough
@pytest.mark.parametrize("name", BASES)
def test_curvature_bounds_of_limits_hold(name):
    """Cable by cable: a bound that is too small lets a cable snap between samples. Only f'' <= M is needed."""
    rng, n, robot, same = np.random.default_rng(22), 2000, ROBOTS[name], of_one_shape(EFFECTIVE)
    starts, ends, arcs = spread_points(rng, name, n)
    segments, p = segments_of(name, starts, ends, arcs), arcs.astype(float)
    start, stop, tau = random_intervals(rng, EFFECTIVE, n)
    sharpest = np.zeros(8)
    for scale, k in itertools.product((0.2, 1.0, 5.0), (None, 0, 1, 2)):
        values = {key: scale * value for key, value in LIMIT.items()}
        bounds = np.asarray(CURVATURES(robot, limits_of(values), same, segments, p, start, stop))
        slacks = np.asarray(SLACKS(robot, limits_of(values, k), same, segments, p, tau))
        below = (slacks[:, :, 1] > 0.01).all(1)  # elsewhere a limit out of reach is not
        _, second_derivative, _, error = differences(slacks, tau)
        assert (second_derivative <= bounds[:, None] * (1.0 + 1e-9) + error)[below].all()
        clear = error[:, 0] < 1e-3 * bounds
        sharpest = np.maximum(sharpest, np.where(clear, second_derivative.max(1) / bounds, 0.0)[below].max(0))
    assert (sharpest > [0.97, 0.97, 0.8, 0.8, 0.97, 0.6, 0.45, 0.45]).all()


LEAST_LENGTHS = jax.jit(
    jax.vmap(
        lambda robot, segment, amplitude, arcs, start, stop: jnp.stack(
            least_lengths(
                robot,
                segment,
                (over := interval_bounds(segment, amplitude, arcs, start, stop)),
                motion_bounds(segment, arcs, over)[0],
                row_bounds(segment, arcs, over, segment.tilt),
            )
        ),
        (None, 0, None, 0, 0, 0),
    )
)
POSITIONS = instants(lambda _, __, amplitude, segment, p, t: hypocycloid.motion(segment, amplitude, p, t)[0])


@pytest.mark.parametrize("name", BASES)
def test_no_cable_is_shorter_than_its_bound(name):
    """Over whole arcs and short intervals: a bound that is too large makes curvatures too small."""
    rng, n, robot, same = np.random.default_rng(28), 2000, ROBOTS[name], of_one_shape(QUINTIC)
    starts, ends, arcs = random_points(rng, name, n)
    segments, p = segments_of(name, starts, ends, arcs), arcs.astype(float)
    width = 10.0 ** rng.uniform(-3.0, 0.0, n)
    start = (1.0 - width) * rng.uniform(size=n)
    tau = start[:, None] + width[:, None] * np.linspace(0.0, 1.0, 129)
    places = np.asarray(POSITIONS(None, None, same, segments, p, tau))
    lengths = np.linalg.norm(places[:, :, None] - np.asarray(robot.base_points), axis=-1).min(1)
    bounds = np.asarray(LEAST_LENGTHS(robot, segments, same, p, start, start + width))
    moves = np.isfinite(lengths).all(1)
    assert (bounds <= lengths * (1.0 + 1e-12))[moves].all()
    is_wide = moves & (width > 0.3)
    assert (bounds[is_wide] > 0.2 * lengths[is_wide]).mean() > 0.4


def dense_margin(name, start, end, arcs, printed):
    """The reference's margin at 20,001 samples; at a million where that is too close to zero to tell."""
    segment = BASES[name], start, end, Z0, 9.81, int(arcs), printed
    margin = oracle.margin(*segment, samples=SAMPLES)
    return margin if abs(margin) > 1e-4 else oracle.margin(*segment, samples=1_000_001)


def check_random_segments(count, seed):
    rng, fraction = np.random.default_rng(seed), count // 4
    for name, amplitude in itertools.product(BASES, PRINTED):
        starts, ends, arcs = random_points(rng, name, fraction)
        mine, theirs = PRINTED[amplitude]
        proof = prove(Problem(ROBOTS[name], Limits(), mine), segments_of(name, starts, ends, arcs), arcs)
        dense = np.array([dense_margin(name, *segment, theirs) for segment in zip(starts, ends, arcs, strict=True)])
        assert np.array_equal(proof.feasible, dense > 0)
        assert np.array_equal(proof.infeasible, dense < 0)
        assert 0.2 < proof.feasible.mean() < 0.8
        assert (proof.bound.min(1) <= dense + 1e-12).all()
        assert (proof.sampled.min(1) >= dense - 1e-4 * (1.0 + np.abs(dense))).all()


def test_verdicts_agree_with_dense_samples():
    """The product's promise: no verdict of these may differ from the independent reference's."""
    check_random_segments(COUNT, 23)


@pytest.mark.soak
def test_verdicts_agree_with_dense_samples_in_full():
    """The same, fifty times as many."""
    check_random_segments(SOAK_COUNT, 24)


ATTAINED = {
    "tension_min": "tension_min",
    "tension_max": "tension_max",
    "floor": "z_max",
    "cable_length_max": "length_max",
    "cable_speed_max": "speed_max",
    "cable_acceleration_max": "cable_acceleration_max",
}


def within(key, attained, limit):
    return attained > limit if key == "tension_min" else attained < limit


@pytest.mark.thorough
def test_verdicts_with_limits_agree_with_dense_samples():
    """Each limit alone at a value that parts the feasible segments, then all of them together."""
    rng, name, n = np.random.default_rng(25), "prototype", 60
    starts, ends, arcs = random_points(rng, name, n)
    segments = segments_of(name, starts, ends, arcs)
    points = list(zip(starts, ends, arcs, strict=True))
    taut = np.array([dense_margin(name, *segment, oracle.quintic) for segment in points]) > 0
    found = [oracle.limits(BASES[name], MASS[name], a, b, Z0, 9.81, int(p), samples=5_001) for a, b, p in points]
    met, chosen = {}, {}
    for key, attained in ATTAINED.items():
        values = np.array([f[attained] for f in found])
        order = np.sort(values[taut])
        chosen[key] = order[len(order) // 2 - 1 : len(order) // 2 + 1].mean()  # between two segments
        met[key] = taut & within(key, values, chosen[key])
    generous = {key: (0.3 if key == "tension_min" else 1.3) * value for key, value in chosen.items()}
    passed = taut & np.array([all(within(key, f[ATTAINED[key]], generous[key]) for key in ATTAINED) for f in found])
    for values, wanted in [({key: chosen[key]}, met[key]) for key in met] + [(generous, passed)]:
        proof = prove(Problem(ROBOTS[name], limits_of(values), QUINTIC), segments, arcs)
        assert np.array_equal(proof.feasible, wanted), values
        assert np.array_equal(proof.infeasible, ~wanted), values
        assert 5 < wanted.sum() < taut.sum()


def test_undecided_only_within_the_tolerance():
    """Closing in on a margin of zero: infeasible, undecided, feasible in this order, the band as narrow as stated."""
    name, end, arcs, n = "prototype", np.array([-1.1, -0.9, 1.5]), 2, 257
    problem = Problem(ROBOTS[name], Limits(), QUINTIC)
    low, high = 0.2, 0.6  # z of the start; it is 0.5 in Table 2.1
    for _ in range(5):
        z = np.linspace(low, high, n)
        starts = np.c_[np.full((n, 2), -1.1), z]
        segments, many = segments_of(name, starts, np.tile(end, (n, 1)), np.full(n, arcs)), np.full(n, arcs)
        proof = prove(problem, segments, many)
        verdict = proof.feasible.astype(int) - proof.infeasible.astype(int)
        assert verdict[0] == -1
        assert verdict[-1] == 1
        assert (np.diff(verdict) >= 0).all()
        low, high = z[np.flatnonzero(verdict == -1)[-1]], z[np.flatnonzero(verdict == 1)[0]]
    assert (verdict == 0).sum() > n // 2
    near = float(jax.jit(tolerance)(QUINTIC, jax.tree.map(lambda leaf: np.asarray(leaf)[0], segments), float(arcs)))
    assert 1e-9 <= near < 1.1e-9
    for edge, sign in ((low, -1.0), (high, 1.0)):
        start = np.array([-1.1, -1.1, edge])
        margin = oracle.margin(BASES[name], start, end, Z0, 9.81, arcs, oracle.quintic, samples=1_000_001)
        assert 0.8 * near < sign * margin < 2.0 * near


def extended_kappa_eta(segment, amplitude, arcs, tau):
    """The closed form of the module `hypocycloid`, (n, samples, 4), in extended precision."""
    exact = {f.name: np.asarray(getattr(segment, f.name), np.longdouble) for f in dataclasses.fields(segment)}
    one = {key: value[:, None] for key, value in exact.items() if value.ndim == 1}
    pi, p = np.longdouble("3.14159265358979323846264338327950288"), arcs.astype(np.longdouble)[:, None]
    curve = np.polynomial.Polynomial(np.asarray(amplitude.coefficients)[0].astype(np.longdouble))
    span, tau = one["end_radius"] - one["start_radius"], tau.astype(np.longdouble)
    r, ratio = one["start_radius"] + span * curve(tau), one["precession"] / p
    period = (pi * p) ** 2 * (1 - ratio) * (1 + ratio)
    rho, radial_rate = span * curve.deriv(2)(tau) / period, 2 * one["sense"] * span * curve.deriv(1)(tau) / (pi * p)
    fast, slow = one["sense"] * pi * p * tau, one["sense"] * pi * one["precession"] * tau
    c_r, c_t = r * np.cos(fast), ratio * r * np.sin(fast)
    d_r, d_t = rho * np.cos(fast) - radial_rate * np.sin(fast), ratio * (rho + 2 * r) * np.sin(fast)
    c, d = (
        (np.cos(slow) * a + np.sin(slow) * b, np.cos(slow) * b - np.sin(slow) * a) for a, b in ((c_r, c_t), (d_r, d_t))
    )
    eta = 1 + exact["tilt"][:, :1] * c[0] + exact["tilt"][:, 1:] * c[1]
    coupling, twist = exact["coupling"][..., None], exact["twist"][..., None]
    force = (
        coupling[:, :, 0] * d[0][:, None]
        + coupling[:, :, 1] * d[1][:, None]
        + twist * (c[0] * d[1] - c[1] * d[0])[:, None]
    )
    return np.stack([*np.moveaxis(eta[:, None] + force, 1, 0), eta], -1)


@pytest.mark.parametrize("name", BASES)
def test_rounding_stays_below_a_tenth_of_the_tolerance(name):
    """Verdicts near zero are right only if the tolerance covers what float64 loses."""
    rng, n = np.random.default_rng(26), 500
    starts, ends, _ = random_points(rng, name, n)
    arcs = rng.integers(1, 31, n)
    close = np.array([np.cos(1e-3), np.sin(1e-3), 0.0]) * 0.8  # one arc between neighbours: the largest terms of all
    center = BASES[name].mean(0) + np.array([0.0, 0.0, Z0])
    starts[:50], ends[:50], arcs[:50] = (
        center + np.array([0.8, 0.0, 0.0]),
        center + close * rng.uniform(0.8, 1.2, (50, 1)),
        1,
    )
    segments, tau = segments_of(name, starts, ends, arcs), rng.uniform(0.0, 1.0, (n, 60))
    found = np.asarray(KAPPA_ETA(None, None, of_one_shape(QUINTIC), segments, arcs.astype(float), tau))
    error = np.abs(found - extended_kappa_eta(segments, QUINTIC, arcs, tau)).max((1, 2))
    lanes = jax.jit(jax.vmap(tolerance, (None, 0, 0)))
    allowed = np.asarray(lanes(QUINTIC, segments, arcs.astype(float))) - SMALLEST_MARGIN
    assert (error < 0.1 * allowed).all()
    assert (allowed < 1e-4 * (1.0 + np.abs(found).max((1, 2)))).all()


@pytest.mark.thorough
def test_arithmetic_that_limits_share_is_done_once():
    """XLA counts operations: with six limits, of a first look 2.3 times as many as without, of margins 5 times."""
    robot, p = ROBOTS["prototype"], np.full(SMALL, 3.0)
    ends = np.tile([0.3, 0.2, 1.9], (SMALL, 1))
    segments, table = segments_of("prototype", 0.5 * ends, ends, p.astype(int)), blocks(QUINTIC, 3)
    operations = {}
    for limits in (NO_LIMITS, limits_of(LIMIT)):
        problem, groups = Problem(robot, limits, QUINTIC), criteria.counts(robot, limits)
        look = jax.jit(proof._first_pass.__wrapped__).lower(problem, *table, (segments, p))
        functions = margins.Functions(criteria.smooth_slacks, groups)
        minima = jax.jit(margins._minima.__wrapped__, static_argnames="functions")
        lowered = look, minima.lower(functions, problem, *table, 1.0, (segments, p))
        operations[len(groups)] = [case.compile().cost_analysis()["flops"] for case in lowered]
    without, limited = operations[min(operations)], operations[max(operations)]
    assert limited[0] < 2.5 * without[0] and limited[1] < 6.0 * without[1]
