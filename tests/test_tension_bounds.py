"""Proofs about tensions: bounds in complex time, on blocks, for rounding, and verdicts against dense samples.

The oracle is NumPy's version of the printed formulas: it knows complex time too.
"""

import dataclasses
from functools import partial

import jax
import numpy as np
import pytest
from oracles import platform as oracle
from support.platforms import FROM_REST, MSSM, Z0, general, limits_of, made, ours, random_pose, stacked

from cspr_jax.arithmetic import chebyshev
from cspr_jax.feasibility.platform import certificate, tension_blocks
from cspr_jax.feasibility.platform.certificate import Certifier
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.reference_pose import aligned
from cspr_jax.schema.limits import LIMITS
from cspr_jax.trajectories import platform_reach
from cspr_jax.trajectories.amplitudes import named
from cspr_jax.trajectories.platform_segment import USUAL, Kind

QUINTIC = named("quintic")
STANDARD = Kind(variable=False, plain=True)
BATCH = 64
G = 9.81


def turned(robot):
    """An oracle's robot in the axes of its reference orientation."""
    mine = aligned(ours(robot))[0]
    return dataclasses.replace(robot, platform=np.asarray(mine.platform_points), inertia=np.asarray(mine.inertia))


ROBOTS = {"mssm": turned(MSSM), "general": turned(general())}


def quintic(tau):
    """The jet of A, at complex times too."""
    every = [np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])]
    for _ in range(3):
        every.append(every[-1].deriv())
    return np.array([one(tau) for one in every])


def drawn(rng, robot, kind, count):
    """Random motions: segments of the package and of the oracle, numbers of arcs, values of beta-hat."""
    ours_, theirs, arcs, betas = [], [], [], []
    for _ in range(count):
        p = int(rng.integers(2, 13))
        start, end = random_pose(rng, rest=kind.from_rest), random_pose(rng)
        beta = (-1.0 if kind.from_rest else rng.uniform(-9.0, 1.0), rng.uniform(-9.0, 1.0))
        segment = oracle.Segment(start[0], end[0], Z0, start[1], end[1], quintic, standard=not kind.variable)
        ours_.append(made(ours(robot), start, end, Z0, beta, p))
        theirs.append(segment)
        arcs.append(p)
        betas.append(beta)
    return stacked(ours_), theirs, np.array(arcs), betas


def jets(robot, segment, p, beta, tau):
    """Position and quaternion with derivatives in tau, which may be complex: (3, n, 3) and (3, n, 4)."""
    theta, cusps, _ = oracle.plan(robot, segment, p)
    seconds = beta[0] * theta**2 * (cusps - 1), beta[1] * theta**2 * (cusps - 1)
    env = oracle.envelope(segment, p, tau)
    return oracle.translation(robot, segment, p, tau), oracle.orientation_jet(env, oracle.beta_ff(tau, p, seconds))


@partial(jax.jit, static_argnames="kind")
def _reach(segments, arcs, middles, axes, *, kind):
    middle = platform_reach.middle_of(QUINTIC, middles)
    return platform_reach.reach(segments, arcs, middle, axes, kind)


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
        place, q = jets(robot, segment, int(p), beta, tau)
        turn = oracle.matrix(q[0])
        omega, spin = (2.0 * oracle.product(x, oracle.conjugate(q[0]))[:, 1:] for x in q[1:])
        size = partial(np.linalg.norm, axis=1)
        norms = [np.linalg.norm(x, 2, axis=(1, 2)) for x in (turn, np.cross(omega[:, None, :], turn, axisb=1).mT)]
        values = size(place[1]), size(place[2]), *norms, size(omega), size(spin)
        worst = np.maximum(worst, [np.max(v) / bounds[i] for v, bounds in zip(values, found, strict=True)])
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


def problem_of(robot, limits=None):
    return Problem(aligned(ours(robot))[0], limits or Limits(), QUINTIC)


def sampled(robot, segment, p, beta, tau, limits):
    """Smallest slacks at instants by the oracle: of taut cables, of the determinant, of limits on the motion."""
    m = oracle.motion(robot, segment, p, beta, tau)
    right = oracle.wrench(robot, m.rotation, m.acceleration, m.omega, m.omega_dot, G)
    mu = oracle.force_ratios(robot, m.position, m.rotation, right)
    jacobian = oracle.jacobian(robot, m.position, m.rotation)
    rest = oracle.jacobian(robot, np.array([[0.0, 0.0, Z0]]), np.eye(3)[None])
    every = [6.0 * Z0 / G * mu.min(1), np.linalg.det(jacobian) / np.linalg.det(rest)[0]]
    if limits is not None:
        length = np.linalg.norm(oracle.cables(robot, m.position, m.rotation), axis=2)
        force, weight = robot.mass * mu * length, robot.mass * G / 6.0
        velocity = np.concatenate([m.velocity, m.omega], axis=1)
        rate = np.einsum("nij,nj->ni", jacobian, velocity) / length
        every += [((force - limits["tension_min"]) / weight).min(1), ((limits["tension_max"] - force) / weight).min(1)]
        # As it is proved: with the sign of the slack.
        every += [((length / Z0) ** 2 * (1.0 - (rate / limits["cable_speed_max"]) ** 2)).min(1)]
    return np.array(every)


TIGHT = {"tension_min": 0.3, "tension_max": 4.0, "cable_speed_max": 2.0}


def block_breaks(count, seed, kind, robot, limits):
    """Bounds on random blocks against dense samples: how often broken, and how near."""
    rng = np.random.default_rng(seed)
    segments, theirs, arcs, betas = drawn(rng, robot, kind, count)
    bounds = None if limits is None else limits_of(**limits)
    problem = problem_of(robot, bounds)
    certifier = Certifier(problem, kind, batch=BATCH)
    start = rng.uniform(0.0, 0.97, count)
    stop = np.minimum(start + rng.uniform(0.05, 0.4, count) / arcs, 1.0)
    blocks = certificate.Blocks(np.arange(count), start, stop)
    standing = certificate._standing(problem, segments)
    found = certifier._bounds(0, blocks, (segments, arcs, standing), margins=False)
    broken, gaps = 0, []
    # The oracle has no limit on accelerations, which is tried against differences of rates below.
    which = list(range(2 if limits is None else 5))
    for i, (segment, p, beta) in enumerate(zip(theirs, arcs, betas, strict=True)):
        least = sampled(robot, segment, int(p), beta, np.linspace(start[i], stop[i], 65), limits)[which].min(1)
        broken += int((found.bound[which, i] > least + 1e-9 * np.abs(least)).any() and least[1] > 0.0)
        gaps.append(least - found.bound[which, i])
    return broken, np.array(gaps)


@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_bounds_on_blocks_hold(kind):
    """No sample between the nodes is below the bound of its block."""
    broken, gaps = block_breaks(128, 3, kind, ROBOTS["general"], TIGHT)
    assert not broken
    assert np.median(gaps[:, 1][np.isfinite(gaps[:, 1])]) < 0.1


@pytest.mark.soak
@pytest.mark.parametrize("name", list(ROBOTS))
@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_bounds_on_many_blocks_hold(kind, name):
    """100,000 stretches in all."""
    for seed in range(5):
        assert not block_breaks(5000, 100 + seed, kind, ROBOTS[name], TIGHT if seed % 2 else None)[0]


def motions_of(rng, robot, kind, count):
    """Motions as the searches ask for them: with the preferred values of beta-hat, and arcs that may do."""
    some = []
    for _ in range(count):
        p = int(rng.integers(3, 16))
        start, end = random_pose(rng, rest=kind.from_rest), random_pose(rng)
        segment = oracle.Segment(start[0], end[0], Z0, start[1], end[1])
        beta = oracle.end_beta_hats(robot, segment)
        beta = (-1.0 if kind.from_rest else beta[0], beta[1])
        some.append((segment, p, beta, made(ours(robot), start, end, Z0, beta, p)))
    return some


def verdict_breaks(count, seed, kind, robot, instants):
    """Proofs of random motions: contradicted by samples, undecided, proved."""
    some = motions_of(np.random.default_rng(seed), robot, kind, count)
    certifier = Certifier(problem_of(robot), kind, batch=BATCH)
    arcs = np.array([p for _, p, _, _ in some])
    proof = certifier.prove(stacked([x[3] for x in some]), arcs)
    contradicted = 0
    for i, (segment, p, beta, _) in enumerate(some):
        least = sampled(robot, segment, p, beta, np.linspace(0.0, 1.0, instants), None)
        low = least.min(1)
        contradicted += bool(proof.is_proved[i] and not (low > 0.0).all())
        contradicted += bool(proof.is_proved[i] and (proof.bound[i] > low + 1e-9).any())
        at = sampled(robot, segment, p, beta, proof.instant[i : i + 1], None).min()
        contradicted += bool(proof.is_refuted[i] and not at < 0.0)
        # Between samples of a motion that is refuted there may be no sign of it, but not for long.
        contradicted += bool(proof.is_refuted[i] and low.min() > 1e-3)
    undecided = ~proof.is_proved & ~proof.is_refuted
    return contradicted, int(undecided.sum()), int(proof.is_proved.sum())


@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_proofs_agree_with_samples(kind):
    """No proof is contradicted, refutations name an instant, and little is undecided."""
    contradicted, undecided, proved = verdict_breaks(48, 5, kind, ROBOTS["mssm"], 2001)
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


def test_every_order_of_the_cables_gives_the_same_bounds():
    """Orders that are tried where rounding keeps a block open."""
    rng, robot = np.random.default_rng(4), ROBOTS["general"]
    segments, _, arcs, _ = drawn(rng, robot, USUAL, 16)
    problem = problem_of(robot, limits_of(**TIGHT))
    certifier = Certifier(problem, USUAL, batch=BATCH)
    start = rng.uniform(0.0, 0.9, 16)
    blocks = certificate.Blocks(np.arange(16), start, start + 0.2 / arcs)
    standing = certificate._standing(problem, segments)
    every = [
        certifier._bounds(k, blocks, (segments, arcs, standing), margins=True) for k in range(len(certifier._orders))
    ]
    assert len(every) == certificate.ORDERS
    good = every[0].rounding < 1e-8
    for other in every[1:]:
        both = good & (other.rounding < 1e-8)
        assert both.sum() > 5
        pair = [np.nan_to_num(x.bound[:, both], neginf=-1e9) for x in (every[0], other)]
        np.testing.assert_allclose(*pair, rtol=1e-6, atol=1e-6)
        assert np.allclose(other.nodes[:, :, both], every[0].nodes[:, :, both], rtol=1e-7, atol=1e-8)


@pytest.mark.soak
@pytest.mark.parametrize("fault", ["rounded polynomial", "less growth", "no wrench", "remainder"])
def test_planted_errors_in_bounds_are_found(monkeypatch, fault):
    """Bounds that are too small are broken by some block or point."""
    jax.clear_caches()
    if fault == "less growth":
        whole = platform_reach.reach
        monkeypatch.setattr(
            platform_reach,
            "reach",
            lambda *a: (lambda r: r._replace(omega=0.5 * r.omega, spin=0.5 * r.spin))(whole(*a)),
        )
        assert (reach_breaks(200, 1, USUAL, ROBOTS["mssm"]) > 1.0).any()
        return
    if fault == "remainder":
        monkeypatch.setattr(chebyshev, "remainders", lambda radii: 0.0 * radii)
        monkeypatch.setattr(tension_blocks, "ROUNDING", 0.0)
    elif fault == "no wrench":
        whole = tension_blocks._sizes
        monkeypatch.setattr(tension_blocks, "_sizes", lambda *a: [1e-6 * x for x in whole(*a)])
    else:
        monkeypatch.setattr(chebyshev, "bernstein", lambda: np.eye(chebyshev.DEGREE + 1))
    assert block_breaks(2000, 3, USUAL, ROBOTS["general"], None)[0]
    jax.clear_caches()


def test_every_limit_on_the_motion_has_a_row():
    """What `schema.limits` calls a quantity of the motion can be proved."""
    names = {row.quantity for row in LIMITS if row.of_motion}
    assert names == set(tension_blocks.QUANTITIES)
