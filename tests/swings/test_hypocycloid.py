"""The hypocycloid segment: boundary conditions, derivatives, both forms of the motion, degenerate cases, limits."""

from functools import partial

import jax
import numpy as np
import pytest
from conftest import TILTED, equilateral
from oracles import point_mass as oracle

from cspr_jax.families.swings import hypocycloid
from cspr_jax.families.swings.proof.slacks import normalised_pseudotensions, swing_state
from cspr_jax.motion.amplitudes import derivatives, from_polynomial, named
from cspr_jax.robots.model import point_mass

N = 120
TAU = np.sort(np.r_[0.0, 1.0, np.random.default_rng(0).uniform(0.0, 1.0, 39)])
QUINTIC, EFFECTIVE = named("quintic"), named("effective", 0.2)
AMPLITUDES = [(QUINTIC, oracle.quintic), (EFFECTIVE, partial(oracle.effective, epsilon=0.2))]
DOWN, OFFSET = np.array([0.0, 0.0, 1.0]), np.array([0.5, -0.7, 0.4])


def one_swing(segment, amplitude, arcs, tau):
    c, d = hypocycloid.swing(segment, derivatives(amplitude, tau, order=2), arcs, tau)
    return segment.center + segment.plane @ c, segment.rate * segment.plane @ (d - c)


def along(function):
    """Over segments, and over the same instants for each."""
    return jax.jit(jax.vmap(jax.vmap(function, in_axes=(None, None, None, 0)), in_axes=(0, None, 0, None)))


SEGMENTS = jax.jit(jax.vmap(lambda *given: hypocycloid.segment(*given[:4], odd=given[4])))
MOTION, SWING, KAPPA = along(hypocycloid.motion), along(one_swing), along(normalised_pseudotensions)
DURATION = jax.jit(jax.vmap(hypocycloid.duration))
INFINITY = jax.jit(jax.vmap(hypocycloid.feasibility_at_infinity, in_axes=(0, None)))
ETA = along(lambda *arguments: swing_state(*arguments).eta)
LIMIT = jax.jit(jax.vmap(jax.vmap(hypocycloid.limit_of_many_arcs, (None, None, 0)), (0, None, None)))


class Batch:
    """Robots, points and arcs, with their segments: padded to N, so that functions compile once."""

    def __init__(self, bases, starts, ends, z0, arcs, gravity=9.81):
        self.n = np.shape(starts)[0]
        shapes = (bases, (3, 3)), (starts, (3,)), (ends, (3,)), (z0, ()), (arcs, ()), (gravity, ())
        whole = [np.broadcast_to(np.asarray(v), (self.n, *shape))[np.arange(N) % self.n] for v, shape in shapes]
        self.bases, self.starts, self.ends, self.z0, self.arcs, self.gravity = whole
        self.center = self.bases.mean(1) + self.z0[:, None] * DOWN
        robot = point_mass.PointMassRobot(self.bases, np.ones(N), self.gravity.astype(float))
        self.segments = SEGMENTS(robot, self.starts, self.ends, self.z0.astype(float), self.arcs % 2 == 1)
        self.p = self.arcs.astype(float)

    def motion(self, tau=TAU, amplitude=QUINTIC):
        return [np.asarray(v)[: self.n] for v in MOTION(self.segments, amplitude, self.p, tau)]

    def duration(self):
        return np.asarray(DURATION(self.segments, self.p))[: self.n]

    def reference(self, i, tau=TAU, amplitude=oracle.quintic):
        settings = {"z0": self.z0[i], "normal": oracle.plane_normal(self.bases[i])}
        points = self.starts[i], self.ends[i], self.center[i]
        return oracle.motion(*points, self.gravity[i], int(self.arcs[i]), tau, amplitude, **settings)


@pytest.fixture(scope="module")
def general():
    """Tilted triangles of either labelling, and points all around p0."""
    rng = np.random.default_rng(1)
    angles = np.array([0.0, 2.1, 4.2]) + rng.uniform(-0.6, 0.6, (N, 3))
    bases = np.stack([np.cos(angles), np.sin(angles), rng.uniform(-0.4, 0.4, (N, 3))], 2)
    bases[::2] = bases[::2, ::-1]
    bases = rng.uniform(0.3, 2.0, (N, 1, 1)) * (bases - bases.mean(1, keepdims=True))
    z0 = rng.uniform(0.8, 4.0, N)
    center = bases.mean(1) + z0[:, None] * DOWN
    starts, ends = center + rng.normal(size=(N, 3)), center + rng.normal(size=(N, 3))
    return Batch(bases, starts, ends, z0, rng.integers(1, 31, N), rng.uniform(1.6, 12.0, N))


def test_boundary_conditions(general):
    """(2.40), (2.41): otherwise the effector misses the target, arrives moving, or the forces jump."""
    position, velocity, acceleration = general.motion(np.array([0.0, 1.0]))
    targets = np.stack([general.starts, general.ends], 1)
    np.testing.assert_allclose(position, targets, atol=1e-11)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-10)
    rate = (general.gravity / general.z0)[:, None, None]  # (2.26)
    np.testing.assert_allclose(acceleration, -rate * (targets - general.center[:, None]), atol=1e-9)
    rope, gravity = targets - general.bases.mean(1)[:, None], general.gravity[:, None, None] * DOWN
    np.testing.assert_allclose(np.cross(rope, acceleration - gravity), 0.0, atol=1e-8)  # (2.16)


@pytest.mark.parametrize("amplitude", [QUINTIC, EFFECTIVE], ids=["quintic", "effective"])
def test_velocity_and_acceleration_are_derivatives(general, amplitude):
    """A velocity or acceleration that is not the path's derivative makes tensions fiction."""
    tau = np.array([0.07, 0.3141, 0.5, 0.77, 0.93])
    time, step = general.duration()[:, None, None], 1e-4
    moved = [general.motion(tau + k * step, amplitude) for k in (-2, -1, 1, 2)]
    _, velocity, acceleration = general.motion(tau, amplitude)
    for order, exact in ((0, velocity), (1, acceleration)):
        a, b, c, d = (m[order] for m in moved)
        slope = (a - 8.0 * b + 8.0 * c - d) / (12.0 * step * time)
        assert np.abs(slope - exact).max() < 2e-7 * np.abs(exact).max()


@pytest.mark.parametrize(("amplitude", "theirs"), AMPLITUDES, ids=["quintic", "effective"])
def test_against_the_independent_implementation(general, amplitude, theirs):
    """Position, velocity, acceleration and duration as somebody else derived them from the print."""
    found, duration = general.motion(amplitude=amplitude), general.duration()
    for i in range(N):
        wanted = general.reference(i, amplitude=theirs)
        assert duration[i] == pytest.approx(wanted[0], rel=1e-12)
        for mine, printed in zip(found, wanted[1:], strict=True):
            np.testing.assert_allclose(mine[i], printed, rtol=0, atol=1e-10 * (1.0 + np.abs(printed).max()))


def test_closed_form_is_the_printed_motion(general):
    """Verdicts come from the closed form, trajectories from the printed one: they must be one motion."""
    position, _, acceleration = general.motion()
    mine = SWING(general.segments, QUINTIC, general.p, TAU)
    for found, printed in zip(mine, (position, acceleration), strict=True):
        size = np.abs(printed).max((1, 2), keepdims=True)
        assert (np.abs(np.asarray(found) - printed) / size).max() < 1e-12


def test_normalised_pseudotensions(general):
    """The closed form of (2.12) to (2.14) decides every verdict: any robot, any tilt, any labelling."""
    found, eta = (np.asarray(f(general.segments, QUINTIC, general.p, TAU)) for f in (KAPPA, ETA))
    for i in range(N):
        _, position, _, acceleration = general.reference(i)
        base, center = general.bases[i], general.center[i]
        wanted = oracle.normalised_pseudotensions(base, center, position, acceleration, general.gravity[i])
        np.testing.assert_allclose(found[i], wanted, rtol=0, atol=1e-11 * (1.0 + np.abs(wanted).max()))
        np.testing.assert_allclose(eta[i], oracle.height_ratio(base, position, center), rtol=0, atol=1e-11)


@pytest.mark.parametrize("base", [equilateral(0.26), TILTED], ids=["level", "tilted"])
def test_rest_ends_swing_on_a_straight_line(base):
    """c = r cos(theta tau) with theta = (-1)^(p-1) p pi; an odd number's first swing goes away from the target."""
    center, arcs = base.mean(0) + 1.7 * DOWN, np.array([1, 2, 3, 6, 9])
    rest, away = np.tile(center, (5, 1)), np.tile(center + OFFSET, (5, 1))
    radius, shape = np.linalg.norm(OFFSET), oracle.quintic(TAU)[0]
    theta = (-1.0) ** (arcs - 1) * np.pi * arcs
    for starts, ends, r, sign in ((rest, away, radius * shape, (-1.0) ** arcs), (away, rest, radius * (1 - shape), 1)):
        batch = Batch(base, starts, ends, 1.7, arcs)
        line = (sign * np.ones(5))[:, None] * r * np.cos(theta[:, None] * TAU)
        np.testing.assert_allclose(batch.motion()[0] - center, line[:, :, None] * OFFSET / radius, atol=1e-12)
        np.testing.assert_allclose(batch.duration(), np.pi * arcs * np.sqrt(1.7 / 9.81), rtol=1e-13)


DEGENERATE = [  # start and end from p0, arcs
    (OFFSET, 1.6 * OFFSET, 4),  # psi = 0
    (OFFSET, OFFSET, 2),
    (OFFSET, -0.8 * OFFSET, 5),  # psi = pi
    (OFFSET, -0.8 * OFFSET, 1),
    (OFFSET, 1.6 * OFFSET, 3),  # psi = 0, and the plane is free
    (OFFSET, OFFSET, 5),
    (OFFSET, -0.8 * OFFSET, 2),  # psi = pi, and the plane is free
    (0.9 * DOWN, 0.3 * DOWN, 2),  # below the centroid
    (0.9 * DOWN, 0.3 * DOWN, 3),
    (-0.6 * DOWN, 0.4 * DOWN, 2),
    (0.5 * DOWN, OFFSET, 4),
    (0.0 * DOWN, 0.0 * DOWN, 1),  # at rest
]
STRAIGHT, FREE = slice(0, 4), slice(4, 7)


@pytest.mark.parametrize("base", [equilateral(0.26), TILTED], ids=["level", "tilted"])
def test_points_on_one_line(base):
    """Where the points do not fix the plane: no NaN, targets still met, the plane that was agreed."""
    starts, ends, arcs = (np.array(column) for column in zip(*DEGENERATE, strict=True))
    center = base.mean(0) + 1.7 * DOWN
    batch = Batch(base, center + starts, center + ends, 1.7, arcs)
    found, plane = batch.motion(), np.asarray(batch.segments.plane)
    for i in range(len(arcs)):
        for mine, wanted in zip(found, batch.reference(i)[1:], strict=True):
            np.testing.assert_allclose(mine[i], wanted, rtol=0, atol=1e-11, err_msg=str(DEGENERATE[i]))
    np.testing.assert_allclose(found[0][:, [0, -1]], center + np.stack([starts, ends], 1), atol=1e-13)
    np.testing.assert_allclose(np.swapaxes(plane, 1, 2) @ plane, np.tile(np.eye(2), (N, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(plane[FREE, :, 1] @ oracle.plane_normal(base), 0.0, atol=1e-13)  # least inclined
    np.testing.assert_allclose(np.cross(found[0][STRAIGHT] - center, OFFSET), 0.0, atol=1e-12)
    ray = Batch(base, np.tile(center + OFFSET, (2, 1)), center + np.array([[1.5], [1.0]]) * OFFSET, 1.7, 1)
    np.testing.assert_array_equal(ray.duration(), 0.0)  # one arc on one ray, or none at all: no trajectory


@pytest.mark.parametrize("psi", [1e-3, 1e-6, np.pi - 1e-3, np.pi - 1e-6])
def test_nearly_on_one_line(psi):
    """Cancellation: the arctangent must keep its digits where the arc cosine has lost them."""
    points = 1.7 * DOWN + 0.9 * np.array([[1.0, 0.0, 0.0], [np.cos(psi), np.sin(psi) * 0.6, np.sin(psi) * 0.8]])
    starts, ends = np.repeat(points, 8, axis=0).reshape(2, 8, 3)
    batch = Batch(equilateral(0.26), starts, ends, 1.7, np.arange(1, 9))
    position, _, acceleration = batch.motion()
    for i in range(8):
        duration, wanted, _, second_derivative = batch.reference(i)
        assert batch.duration()[i] == pytest.approx(duration, rel=1e-9)
        np.testing.assert_allclose(position[i], wanted, atol=2e-15 / np.sin(psi))
        np.testing.assert_allclose(acceleration[i], second_derivative, atol=1e-13 / np.sin(psi))


def test_feasibility_at_infinity(general):
    """(2.55), and its values in Table 2.1: the first answer a planner looks at."""
    found = np.asarray(INFINITY(general.segments, QUINTIC))
    for i in range(N):
        line = general.bases[i], general.starts[i], general.ends[i], general.z0[i]
        wanted = oracle.feasibility_at_infinity(*line, int(general.arcs[i]))
        assert float(found[i]) == pytest.approx(wanted, abs=1e-12)
    points = np.array([(0.7, 0.7, 3), (-1.1, -1.1, 0.5), (-1.1, -0.9, 1.5), (0.8, 0.5, 1.5)])
    printed = INFINITY(Batch(equilateral(0.26), points[:-1], points[1:], 1.7, 2).segments, QUINTIC)
    np.testing.assert_allclose(np.asarray(printed)[:3], [-0.1557, -0.1416, 0.2057], atol=5e-5)
    overshooting = from_polynomial([0, 0, 0, 10 + 40, -15 - 120, 6 + 120, -40])  # quintic + 40 (t - t^2)^3
    far = np.asarray(INFINITY(general.segments, overshooting)) - 1.0
    radii = [np.linalg.norm(p - general.center, axis=1) for p in (general.starts, general.ends)]
    shape = np.asarray(derivatives(overshooting, np.linspace(0.0, 1.0, 20_001), order=0)[0])
    worst = np.abs(radii[0] + (radii[1] - radii[0]) * shape[:, None]).max(0)  # the largest radius on the way
    np.testing.assert_allclose(far, (found - 1.0) * worst / np.maximum(*radii), rtol=1e-7)


def test_margins_of_many_arcs_approach_the_limit(general):
    """The exact limit: it explains feasible segments whose (2.55) is negative."""
    tau = np.linspace(0.0, 1.0, 20_001)
    some = jax.tree.map(lambda leaf: leaf[:16], general.segments)
    parity = general.arcs[:16] % 2
    limit, gaps = np.asarray(LIMIT(some, QUINTIC, tau)).min(1), []
    for arcs in (50, 200, 800):
        p = arcs + parity.astype(float)
        kappa, eta = KAPPA(some, QUINTIC, p, tau), ETA(some, QUINTIC, p, tau)
        gaps.append(np.abs(np.minimum(np.asarray(kappa).min((1, 2)), np.asarray(eta).min(1)) - limit))
    assert (gaps[2] < 0.03 * (1.0 + np.abs(limit))).all()
    assert gaps[2].mean() < 0.3 * gaps[1].mean() < 0.1 * gaps[0].mean()
