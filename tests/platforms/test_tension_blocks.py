"""Proofs about tensions: bounds in complex time, on blocks, for rounding, and verdicts against dense samples.

The oracle is NumPy's version of the printed formulas: it knows complex time too.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import platform as oracle
from support.platforms import FROM_REST, Z0, limits_of, stacked
from support.random_motions import BATCH, QUINTIC, ROBOTS, drawn, jets, motions_of, problem_of

from cspr_jax.families.platforms import platform_segment_lanes
from cspr_jax.families.platforms.six_cable_proof import complex_bounds, tension_blocks
from cspr_jax.families.platforms.six_cable_proof import tension_proof as proof
from cspr_jax.families.platforms.six_cable_proof.tension_proof import Certifier, determinant_at_rest
from cspr_jax.motion.platform_kind import USUAL, PlatformMotionKind
from cspr_jax.numerics.bounds import chebyshev
from cspr_jax.numerics.linear import packed_arrays
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.schema.limits import LIMITS
from cspr_jax.verification.bounds.blocks import Blocks

STANDARD = PlatformMotionKind(variable=False, plain=True)
G = 9.81


@partial(jax.jit, static_argnames="kind")
def _reach(segments, arcs, middles, axes, *, kind):
    middle = complex_bounds.middle_of(QUINTIC, middles)
    return complex_bounds.ellipse_bounds(segments, arcs, middle, axes, kind)


def reach_breaks(count, seed, kind, robot):
    """The largest value over its bound, of each quantity, over points of ellipses around blocks."""
    rng = np.random.default_rng(seed)
    segments, theirs, arcs, betas = drawn(rng, robot, kind, count)
    width = rng.uniform(0.02, 0.3, count) / arcs
    middle, rho = rng.uniform(width, 1.0 - width), rng.uniform(1.0, 4.0, count)
    axes = 0.5 * width * (rho + 1.0 / rho), 0.5 * width * (rho - 1.0 / rho)
    found = [np.asarray(x) for x in _reach(segments, arcs.astype(float), middle, axes, kind=kind)]
    worst = np.zeros(len(found))
    for i, (segment, p, beta) in enumerate(zip(theirs, arcs, betas, strict=True)):
        angle, inward = rng.uniform(0.0, 2.0 * np.pi, 48), np.sqrt(rng.uniform(0.0, 1.0, 48))
        inward[:24] = 1.0
        tau = middle[i] + inward * (axes[0][i] * np.cos(angle) + 1j * axes[1][i] * np.sin(angle))
        # Where the oracle's series in (1 - q_0) / 2 has converged, by terms that are not so large that nothing but
        # rounding is left of their sum.
        tau = tau[np.abs(1.0 - oracle.envelope(segment, int(p), tau)[0, :, 0]) < 1.4]
        place, q, turns = jets(robot, segment, int(p), beta, tau)
        place, q = (x[:, (np.abs(q[0]).max(1) < 100.0) & (np.abs(turns) < 5.0)] for x in (place, q))
        turn = oracle.matrix(q[0])
        omega, spin = (2.0 * oracle.product(x, oracle.conjugate(q[0]))[:, 1:] for x in q[1:])
        size = partial(np.linalg.norm, axis=1)
        norms = [np.linalg.norm(x, 2, axis=(1, 2)) for x in (turn, np.cross(omega[:, None, :], turn, axisb=1).mT)]
        values = size(place[1]), size(place[2]), *norms, size(omega), size(spin)
        worst = np.maximum(worst, [np.max(v, initial=0.0) / b[i] for v, b in zip(values, found, strict=True)])
    return worst


@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_bounds_in_complex_time_hold(kind):
    """Speeds, accelerations, turns: no point of an ellipse goes beyond its bound, and some come near."""
    worst = reach_breaks(64, 1, kind, ROBOTS["mssm"])
    assert (worst <= 1.0 + 1e-9).all(), worst
    assert (worst > 0.3).all(), worst


@pytest.mark.soak
@pytest.mark.parametrize("kind", [USUAL, FROM_REST, STANDARD._replace(plain=False)])
def test_bounds_in_complex_time_hold_for_many(kind):
    """The same for many motions and two robots."""
    for name, robot in ROBOTS.items():
        worst = reach_breaks(4000, 7, kind, robot)
        assert (worst <= 1.0 + 1e-9).all(), (name, worst)


def test_interpolation_is_bounded():
    """Remainders of functions with poles beside the axis; Bernstein coefficients give the polynomial."""
    x, far = chebyshev.nodes(), np.linspace(-1.0, 1.0, 301)
    own = np.polynomial.polynomial.Polynomial.fit(x, 1.0 / (1.3 + x), chebyshev.DEGREE, domain=[-1.0, 1.0])
    radii = np.array([1.2, 1.5, 1.9])
    sizes = 1.0 / (1.3 - chebyshev.semi_axes(radii)[:, 0])
    remainder = (sizes * chebyshev.remainders(radii)).min()
    error = np.abs(own(far) - 1.0 / (1.3 + far)).max()
    assert 0.001 * remainder < error <= remainder
    coefficients = chebyshev.bernstein() @ (x**3 - 0.2 * x)
    assert coefficients.min() <= (far**3 - 0.2 * far).min() <= coefficients.min() + 0.05
    assert coefficients[0] == pytest.approx(-0.8, abs=1e-12) and coefficients[-1] == pytest.approx(0.8, abs=1e-12)


def sampled(robot, segment, p, beta, tau, limits):
    """Smallest slacks at instants by the oracle: of taut cables, of the determinant, of limits on the motion."""
    m = oracle.motion(robot, segment, p, beta, tau)
    right = oracle.wrench(robot, m.rotation, m.acceleration, m.omega, m.omega_dot, G)
    mu = oracle.force_ratios(robot, m.position, m.rotation, right)
    jacobian = oracle.jacobian(robot, m.position, m.rotation)
    rest = oracle.jacobian(robot, np.array([[0.0, 0.0, Z0]]), np.eye(3)[None])
    every = [6.0 * Z0 / G * mu.min(1), np.linalg.det(jacobian) / np.linalg.det(rest)[0]]
    if limits is not None:
        # Limits may be touched.
        limits = {name: value * (1.0 + TOUCHED * (-1) ** (name == "tension_min")) for name, value in limits.items()}
        length = np.linalg.norm(oracle.cables(robot, m.position, m.rotation), axis=2)
        force, weight = robot.mass * mu * length, robot.mass * G / 6.0
        velocity = np.concatenate([m.velocity, m.omega], axis=1)
        rate = np.einsum("nij,nj->ni", jacobian, velocity) / length
        every += [((force - limits["tension_min"]) / weight).min(1), ((limits["tension_max"] - force) / weight).min(1)]
        # As it is proved: with the sign of the slack.
        every += [((length / Z0) ** 2 * (1.0 - (rate / limits["cable_speed_max"]) ** 2)).min(1)]
    return np.array(every)


TIGHT = {"tension_min": 0.3, "tension_max": 4.0, "cable_speed_max": 2.0}


def certifier_of(problem, kind):
    """A certifier whose work is not counted."""
    return Certifier(problem, kind, batch=BATCH, count_samples=lambda count: None)


def bounds_of(certifier, problem, segments, arcs, blocks, *, order=0, margins=False, reduced=False):
    """Bounds on blocks, one a motion."""
    motions = segments, arcs, determinant_at_rest(problem, segments)
    return certifier.bounds(order, blocks, motions, margins=margins, reduced=reduced)


def block_breaks(count, seed, kind, robot, limits):
    """Bounds on random blocks against dense samples: how often broken, and how near."""
    rng = np.random.default_rng(seed)
    segments, theirs, arcs, betas = drawn(rng, robot, kind, count)
    bounds = None if limits is None else limits_of(**limits)
    problem = problem_of(robot, bounds)
    start = rng.uniform(0.0, 0.97, count)
    stop = np.minimum(start + rng.uniform(0.05, 0.4, count) / arcs, 1.0)
    # As margins need them, and as verdicts do, from rounded values.
    found, rough = (
        bounds_of(
            certifier_of(problem, kind), problem, segments, arcs, Blocks(np.arange(count), start, stop), reduced=x
        )
        for x in (False, True)
    )
    broken, gaps = 0, []
    # The oracle has no limit on accelerations, which is tried against differences of rates below.
    which = list(range(2 if limits is None else 5))
    for i, (segment, p, beta) in enumerate(zip(theirs, arcs, betas, strict=True)):
        least = sampled(robot, segment, int(p), beta, np.linspace(start[i], stop[i], 65), limits)[which].min(1)
        bound = np.maximum(found.bound[which, i], rough.bound[which, i])
        broken += int((bound > least + 1e-9 * np.abs(least)).any() and least[1] > 0.0)
        gaps.append(least - found.bound[which, i])
    return broken, np.array(gaps)


@pytest.mark.ci("from rest")
@pytest.mark.quick("from rest")
@pytest.mark.parametrize(
    "kind", [pytest.param(USUAL, marks=pytest.mark.thorough), FROM_REST], ids=["between", "from rest"]
)
def test_bounds_on_blocks_hold(kind):
    """No sample between the nodes is below the bound of its block."""
    broken, gaps = block_breaks(128, 3, kind, ROBOTS["general"], TIGHT)
    assert not broken
    assert np.median(gaps[:, 1][np.isfinite(gaps[:, 1])]) < 0.1


def test_rounding_of_values_is_allowed_for():
    """Where verdicts alone are wanted: at least what float32 can change of the smallest of kappa."""
    rng, robot, count = np.random.default_rng(8), ROBOTS["general"], 128
    segments, _, arcs, _ = drawn(rng, robot, FROM_REST, count)
    problem, start = problem_of(robot, limits_of(**TIGHT)), rng.uniform(0.0, 0.9, count)
    blocks = Blocks(np.arange(count), start, start + 0.1 / arcs)
    whole, rough = (
        bounds_of(certifier_of(problem, FROM_REST), problem, segments, arcs, blocks, reduced=x) for x in (False, True)
    )
    kappa = (whole.nodes[:, 0] * whole.nodes[:, 1]).max(0)
    more = rough.allowed - whole.allowed
    known = (whole.nodes[:, 1] > 0.0).all(0) & (kappa > 0.05) & (whole.allowed < 1e-3)
    assert known.sum() > 20 and (more[known] > 2.9 * packed_arrays.SINGLE_ERROR * kappa[known]).all()
    np.testing.assert_array_equal(whole.rounding[known] < 1e-6, rough.rounding[known] < 1e-6)


@pytest.mark.soak
@pytest.mark.parametrize("name", list(ROBOTS))
@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_bounds_on_many_blocks_hold(kind, name):
    """100,000 stretches in all."""
    for seed in range(5):
        assert not block_breaks(5000, 100 + seed, kind, ROBOTS[name], TIGHT if seed % 2 else None)[0]


def verdict_breaks(count, seed, kind, robot, instants):
    """Proofs of random motions: contradicted by samples, undecided, proved."""
    some = motions_of(np.random.default_rng(seed), robot, kind, count)
    arcs = np.array([p for _, p, _, _ in some])
    proof = certifier_of(problem_of(robot), kind).prove(stacked([x[3] for x in some]), arcs)
    contradicted = 0
    for i, (segment, p, beta, _) in enumerate(some):
        least = sampled(robot, segment, p, beta, np.linspace(0.0, 1.0, instants), None)
        low = least.min(1)
        contradicted += bool(proof.is_proved[i] and not (low > 0.0).all())
        contradicted += bool(proof.is_proved[i] and (proof.bound[i] > low + 1e-9).any())
        if proof.is_refuted[i]:
            at = sampled(robot, segment, p, beta, proof.refuted_tau[i : i + 1], None).min()
            # Between samples of a motion that is refuted there may be no sign of it, but not for long.
            contradicted += bool(not at < 0.0 or low.min() > 1e-3)
    undecided = ~proof.is_proved & ~proof.is_refuted
    return contradicted, int(undecided.sum()), int(proof.is_proved.sum())


@pytest.mark.thorough
@pytest.mark.parametrize(
    "kind", [USUAL, pytest.param(FROM_REST, marks=pytest.mark.thorough)], ids=["between", "from rest"]
)
def test_proofs_agree_with_samples(kind):
    """No proof is contradicted, refutations name an instant, and little is undecided."""
    contradicted, undecided, proved = verdict_breaks(40, 5, kind, ROBOTS["mssm"], 2001)
    assert contradicted == 0 and undecided == 0 and proved > 3


@pytest.mark.soak
@pytest.mark.parametrize("name", list(ROBOTS))
@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_proofs_agree_with_many_samples(kind, name):
    """1,000 motions of each robot and kind, 20,001 instants."""
    contradicted, undecided, _ = verdict_breaks(1000, 11, kind, ROBOTS[name], 20_001)
    assert contradicted == 0 and undecided < 5


def test_taut_cables_pass_no_singularity():
    """The lemma: the vertical row of the balance is sum of N_k times the heights of rays = det J (g - a_z)."""
    rng, robot = np.random.default_rng(2), ROBOTS["general"]
    for segment, p, beta, _ in motions_of(rng, robot, USUAL, 8):
        tau = np.linspace(0.0, 1.0, 101)
        m = oracle.motion(robot, segment, p, beta, tau)
        right = oracle.wrench(robot, m.rotation, m.acceleration, m.omega, m.omega_dot, G)
        mu = oracle.force_ratios(robot, m.position, m.rotation, right)
        heights = oracle.cables(robot, m.position, m.rotation)[:, :, 2]
        assert np.allclose((mu * heights).sum(1), G - m.acceleration[:, 2], rtol=1e-9, atol=1e-8)


@pytest.mark.thorough
def test_every_order_of_the_cables_gives_the_same_bounds():
    """Orders that are tried where rounding keeps a block open."""
    rng, robot = np.random.default_rng(4), ROBOTS["general"]
    segments, _, arcs, _ = drawn(rng, robot, USUAL, 16)
    problem = problem_of(robot, limits_of(**TIGHT))
    certifier, start = certifier_of(problem, USUAL), rng.uniform(0.0, 0.9, 16)
    blocks = Blocks(np.arange(16), start, start + 0.2 / arcs)
    every = [bounds_of(certifier, problem, segments, arcs, blocks, order=k, margins=True) for k in range(proof.ORDERS)]
    good = every[0].rounding < 1e-8
    for other in every[1:]:
        both = good & (other.rounding < 1e-8)
        assert both.sum() > 5
        pair = [np.nan_to_num(x.bound[:, both], neginf=-1e9) for x in (every[0], other)]
        np.testing.assert_allclose(*pair, rtol=1e-6, atol=1e-6)
        # Of quotients where what they are divided by is not rounding.
        nodes = (x.nodes[:, :, both].transpose(1, 0, 2)[:, every[0].nodes[:, 1, both] > 0.1] for x in (every[0], other))
        np.testing.assert_allclose(*nodes, rtol=1e-6, atol=1e-6)


def precise(robot, segment, p, beta, tau):
    """Slacks of taut cables times D, and D, with a mantissa of 64 bits: (n, 6) and (n,)."""
    (place, _, second_derivative), q, _ = jets(robot, segment, p, beta, tau.astype(np.longdouble))
    squared = np.longdouble(oracle.plan(robot, segment, p)[2]) ** 2
    omega, spin = (2 * oracle.product(x, oracle.conjugate(q[0]))[:, 1:] for x in q[1:])
    turn = oracle.matrix(q[0])
    rays = place[:, None] + robot.platform @ turn.mT - robot.base
    arms = robot.platform @ turn.mT
    inertia = turn @ robot.inertia @ turn.mT / robot.mass
    acceleration_matrix = [(inertia @ x[:, :, None])[:, :, 0] for x in (spin, omega)]
    force, moment = (
        second_derivative / squared - [0, 0, G],
        (acceleration_matrix[0] + np.cross(omega, acceleration_matrix[1])) / squared,
    )
    # The tension of cable k pulls along -rho_k.
    columns = np.concatenate([rays, np.cross(arms, rays)], axis=2).mT
    right = -np.concatenate([force, moment], axis=1)
    standing = robot.platform - robot.base
    standing[:, 2] += Z0
    rest = np.concatenate([standing, np.cross(robot.platform, standing)], axis=1)
    size = determinant(rest[None].astype(np.longdouble))
    numerators = []
    for k in range(6):
        one = columns.copy()
        one[:, :, k] = right
        numerators.append(determinant(one))
    return 6 * Z0 / G * np.stack(numerators, axis=1) / size[:, None], determinant(columns) / size


def determinant(matrices):
    """Of (n, m, m), by elimination with pivots, in the precision of the entries."""
    a, found = matrices.copy(), np.ones(len(matrices), matrices.dtype)
    every = np.arange(len(a))
    for k in range(a.shape[1]):
        pivot = k + np.abs(a[:, k:, k]).argmax(1)
        found = found * np.where(pivot == k, 1, -1)
        a[every, k], a[every, pivot] = a[every, pivot], a[every, k].copy()
        found = found * a[:, k, k]
        a[:, k + 1 :] -= a[:, k + 1 :, k : k + 1] / a[:, k : k + 1, k : k + 1] * a[:, k : k + 1]
    return found


@partial(jax.jit, static_argnames="kind")
def _values(problem, items, *, kind):
    return tension_blocks._interpolated(problem, jnp.ones(()), items, kind=kind, margins=False).values


def rounding_used(count, seed, kind, robot):
    """The largest errors of smallest values at the nodes, as parts of what is allowed for them."""
    rng, x = np.random.default_rng(seed), chebyshev.nodes()
    segments, theirs, arcs, betas = drawn(rng, robot, kind, count)
    start = rng.uniform(0.0, 0.9, count)
    blocks, problem = Blocks(np.arange(count), start, start + 0.2 / arcs), problem_of(robot)
    found = bounds_of(certifier_of(problem, kind), problem, segments, arcs, blocks)
    items = segments, arcs.astype(float), determinant_at_rest(problem, segments), *blocks[1:]
    values = np.asarray(_values(problem, items, kind=kind))
    tau, used = blocks.times(x[:, None]), []
    for i, (segment, p, beta) in enumerate(zip(theirs, arcs, betas, strict=True)):
        kappa, fraction = precise(robot, segment, int(p), beta, tau[:, i])
        allowed = found.rounding[i] / chebyshev.LEBESGUE
        is_taut = (found.nodes[:, 1, i] > 1e-3) & np.isfinite(found.nodes[:, 0, i])
        off = np.abs(values[:, :6, i].min(1) - kappa.min(1))[is_taut]
        used += [*(off / allowed).astype(float)]
        assert np.allclose(values[:, 6, i], fraction.astype(float), rtol=1e-8, atol=1e-8)
    return np.array(used)


@pytest.mark.soak
@pytest.mark.parametrize("name", list(ROBOTS))
@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_values_at_nodes_are_wrong_by_a_tenth_of_what_is_allowed(kind, name, monkeypatch):
    """Beside numbers with a mantissa of 64 bits; what coefficients add is taken off."""
    jax.clear_caches()
    monkeypatch.setattr(tension_blocks, "COEFFICIENTS", 0.0)
    used = rounding_used(1000, 17, kind, ROBOTS[name])
    jax.clear_caches()
    assert len(used) > 1000 and used.max() < 0.1, used.max()


def flat_instants(robot, segment, p, beta):
    """Instants at which the first, third and fifth cable pass through one plane."""

    def volume(tau):
        m = oracle.motion(robot, segment, p, beta, tau)
        return np.linalg.det(oracle.cables(robot, m.position, m.rotation)[:, ::2])

    tau = np.linspace(0.02, 0.98, 201)
    sign = np.sign(volume(tau))
    which = np.flatnonzero(sign[1:] != sign[:-1])
    low, high = tau[which], tau[which + 1]
    for _ in range(60 if len(which) else 0):
        middle = 0.5 * (low + high)
        is_before = np.sign(volume(middle)) == sign[which]
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    return 0.5 * (low + high)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("limits", "least"), [(None, True), pytest.param(TIGHT, False, marks=pytest.mark.thorough)], ids=["verdicts", "all"]
)
def test_slacks_at_nodes_are_no_lower_than_they_are(limits, least):
    """Where three cables lie in one plane they are rounding, which must not refute."""
    rng, robot, count = np.random.default_rng(12), ROBOTS["mssm"], 120
    segments, theirs, arcs, betas = drawn(rng, robot, USUAL, count)
    flat = [flat_instants(robot, *one) for one in zip(theirs, arcs.tolist(), betas, strict=True)]
    row = np.repeat(np.arange(count), [len(x) for x in flat])
    # The middle is a node.
    middle, half = np.concatenate(flat), 1e-4 / arcs[row]
    problem, blocks = problem_of(robot, limits and limits_of(**limits)), Blocks(row, middle - half, middle + half)
    found = bounds_of(certifier_of(problem, USUAL), problem, segments, arcs, blocks, reduced=least)
    tau, doubtful = blocks.times(chebyshev.nodes()[:, None]), 0
    for i, k in enumerate(row):
        true = sampled(robot, theirs[k], int(arcs[k]), betas[k], tau[:, i], limits)
        if (true[1] > 0.0).all():
            # The smallest alone, or all nodes.
            mine, true = found.nodes[:, :, i].T[: len(true)], true.min(1, keepdims=True) if least else true
            assert not (mine < true - 1e-9 * (1.0 + np.abs(true))).any(), (i, mine, true)
            doubtful += found.rounding[i] > 1.0
    assert doubtful > 10


@partial(jax.jit, static_argnames="kind")
def _rests(problem, items, *, kind):
    segments, arcs, regular, start, stop = items
    middle, half = complex_bounds.middle_of(problem.amplitude, 0.5 * (start + stop)), 0.5 * (stop - start)
    z0 = problem.robot.gravity / segments.rate
    block = tension_blocks._Block(segments, platform_segment_lanes.squared_duration(segments, arcs), regular, z0)
    now = complex_bounds.phase_beside(middle, segments.sense, arcs, 0.0 * half)
    lengths = tension_blocks._lengths(problem.robot, platform_segment_lanes.state(segments, arcs, now, kind))
    radii, every = np.array(chebyshev.RADII), []
    for (along, aside), factor in zip(chebyshev.semi_axes(radii), chebyshev.remainders(radii), strict=True):
        bounds = complex_bounds.ellipse_bounds(segments, arcs, middle, (along * half, aside * half), kind)
        sizes = jnp.stack(tension_blocks._magnitude_bounds(problem, block, bounds, along * half, lengths)[:7])
        every.append(jnp.where(jnp.isnan(sizes), jnp.inf, sizes * factor))
    return jnp.min(jnp.stack(every), axis=0)


def remainders_used(count, seed, kind, robot):
    """The largest part that polynomials leave out, over what is allowed for it, of the tensions times D and of D."""
    rng, x = np.random.default_rng(seed), chebyshev.nodes()
    segments, theirs, arcs, betas = drawn(rng, robot, kind, count)
    start = rng.uniform(0.0, 0.5, count)
    blocks, problem = Blocks(np.arange(count), start, start + rng.uniform(0.2, 0.8, count) / arcs), problem_of(robot)
    standing = determinant_at_rest(problem, segments)
    rests = np.asarray(_rests(problem, (segments, arcs.astype(float), standing, *blocks[1:]), kind=kind))
    far, used = np.linspace(-1.0, 1.0, 101), 0.0
    for i, (segment, p, beta) in enumerate(zip(theirs, arcs, betas, strict=True)):
        at_nodes, between = (
            np.column_stack(precise(robot, segment, int(p), beta, blocks.times(places[:, None])[:, i])).astype(float)
            for places in (x, far)
        )
        fit = np.polynomial.chebyshev.chebfit(x, at_nodes, chebyshev.DEGREE)
        off = np.abs(np.polynomial.chebyshev.chebval(far, fit).T - between).max(0)
        off = np.where(off > 1e-9 * np.abs(at_nodes).max(0), off, 0.0)
        used = max(used, float((off / rests[:, i]).max()))
    return used


@pytest.fixture
def few_nodes(monkeypatch):
    """Polynomials of so low a degree that they leave out more than rounding does."""

    def forget():
        chebyshev.nodes.cache_clear()
        chebyshev.bernstein.cache_clear()
        jax.clear_caches()

    monkeypatch.setattr(chebyshev, "DEGREE", 8)
    forget()
    yield
    monkeypatch.undo()
    forget()


@pytest.mark.thorough
@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
@pytest.mark.usefixtures("few_nodes")
def test_polynomials_leave_out_less_than_is_allowed(kind):
    """Of random blocks, by numbers with a mantissa of 64 bits; the allowance is coarse, but not by any amount."""
    used = remainders_used(24, 41, kind, ROBOTS["general"])
    assert 1e-11 < used < 1.0, used


@pytest.mark.soak
@pytest.mark.parametrize("fault", ["rounded polynomial", "less growth", "no wrench", "remainder"])
def test_planted_errors_in_bounds_are_found(monkeypatch, request, fault):
    """Bounds that are too small are broken by some block or point."""
    jax.clear_caches()
    if fault in ("no wrench", "remainder"):
        request.getfixturevalue("few_nodes")
    if fault == "less growth":
        whole = complex_bounds.ellipse_bounds

        def less(*given):
            found = whole(*given)
            return found._replace(omega=0.5 * found.omega, angular_acceleration=0.5 * found.angular_acceleration)

        monkeypatch.setattr(complex_bounds, "ellipse_bounds", less)
        assert (reach_breaks(200, 1, USUAL, ROBOTS["mssm"]) > 1.0).any()
    elif fault == "rounded polynomial":
        monkeypatch.setattr(chebyshev, "bernstein", lambda: np.eye(chebyshev.DEGREE + 1))
        assert block_breaks(400, 3, USUAL, ROBOTS["general"], None)[0]
    elif fault == "no wrench":
        whole = tension_blocks._magnitude_bounds
        monkeypatch.setattr(tension_blocks, "_magnitude_bounds", lambda *given: [1e-11 * x for x in whole(*given)])
        assert remainders_used(24, 41, USUAL, ROBOTS["general"]) > 1.0
    else:
        plain = chebyshev.remainders
        monkeypatch.setattr(chebyshev, "remainders", lambda radii: plain(radii) * radii ** (-3.0 * chebyshev.DEGREE))
        assert remainders_used(24, 41, USUAL, ROBOTS["general"]) > 1.0
    jax.clear_caches()


def test_every_limit_on_the_motion_has_a_row():
    """What `schema.limits` calls a quantity of the motion can be proved."""
    names = {row.quantity for row in LIMITS if row.of_motion and not row.of_winch}
    assert names == set(tension_blocks.QUANTITIES)
