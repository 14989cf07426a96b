"""The six-cable robot: geometry, rotations, wrench balance, motion and ends, beside an oracle and mechanics."""

import dataclasses
import itertools

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import platform as oracle
from support.platforms import (
    EFFECTIVE,
    FROM_REST,
    MSSM,
    Z0,
    cables_at,
    general,
    lowest_and_slopes,
    made,
    ours,
    random_pose,
    stacked,
    states,
)

from cspr_jax.build.robots import kernel_robot
from cspr_jax.config.catalogue import CATALOGUE
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.robot import read_robot
from cspr_jax.errors import InputError
from cspr_jax.families.platforms import platform_segment as segments
from cspr_jax.families.platforms.end_acceleration import endpoint
from cspr_jax.families.platforms.six_cable_proof.screen import CHUNK, smallest_tensions
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.platform_kind import USUAL, PlatformMotionKind
from cspr_jax.numerics.linear import rotations
from cspr_jax.robots.model.platform import platform_robot, separate_pairs
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.reference_pose import reference_pose

PLATFORMS = ("laval-mssm", "nist-robocrane", "fast", "greenline")
AMPLITUDES = {
    "quintic": (named("quintic"), oracle.quintic),
    "effective-c3": (EFFECTIVE, oracle.effective_c3(0.1)),
}
STANDARD = PlatformMotionKind(variable=False)
# As of `endpoint`, whose eager operations would be compiled one by one.
end_of = jax.jit(endpoint)


def soak(*values):
    """Parameters for the soak alone."""
    return pytest.param(*values, marks=pytest.mark.soak)


@pytest.mark.parametrize(
    ("name", "kind"),
    [("effective-c3", USUAL), ("quintic", STANDARD), soak("quintic", USUAL), soak("effective-c3", STANDARD)],
)
def test_motions_are_the_oracle_s(name, kind):
    """Pose, velocity and acceleration of random segments, rest ends and both parities among them."""
    rng, amplitude = np.random.default_rng(1), AMPLITUDES[name]
    tau = np.linspace(0.0, 1.0, 41)
    robot = ours(MSSM)
    for i in range(12):
        p = int(rng.integers(2, 12))
        start, end = random_pose(rng, rest=i % 4 == 0), random_pose(rng, rest=i % 4 == 1)
        beta_hats = tuple(rng.uniform(-6.0, 2.0, 2))
        way = oracle.Segment(start[0], end[0], Z0, start[1], end[1], amplitude=amplitude[1], standard=not kind.variable)
        wanted = oracle.motion(MSSM, way, p, beta_hats, tau)
        segment = made(robot, start, end, Z0, beta_hats, p)
        # The platform of a variable amplitude stands still at every cusp.
        found = states(segment, amplitude[0], p, np.concatenate([tau, np.linspace(0.0, 1.0, p + 1)]), kind=kind)
        found, cusps = (State(*(x[part] for x in found[:6])) for part in (slice(41), slice(41, None)))
        assert float(segments.duration(segment, float(p))) == pytest.approx(wanted.duration, rel=1e-12)
        np.testing.assert_allclose(found.position, wanted.position, atol=1e-11)
        np.testing.assert_allclose(found.velocity, wanted.velocity, atol=1e-10)
        np.testing.assert_allclose(found.acceleration, wanted.acceleration, atol=1e-9)
        np.testing.assert_allclose(found.rotation, wanted.rotation, atol=1e-10)
        np.testing.assert_allclose(found.angular_velocity, wanted.omega, atol=1e-8)
        np.testing.assert_allclose(found.angular_acceleration, wanted.omega_dot, atol=1e-7)
        if kind.variable:
            np.testing.assert_allclose(cusps.velocity, 0.0, atol=1e-11)


@pytest.mark.parametrize("start", [0.0, 1e-13, 1e-9, 1e-5, 0.3, np.pi - 1e-9, np.pi])
def test_angles_near_zero_and_half_a_turn(start):
    """Values, rates and gradients stay finite, and rates are the differences of the orientation."""
    robot, amplitude = ours(MSSM), EFFECTIVE
    for end, p in ((0.0, 4), (1e-9, 3), (2.0, 5), (np.pi, 6)):
        poses = [
            (np.array([0.3, 0.5, 1.2]), np.array([np.cos(a / 2), np.sin(a / 2) * 0.6, 0.0, np.sin(a / 2) * 0.8]))
            for a in (start, end)
        ]
        segment = made(robot, *poses, Z0, (-2.0, -1.0), p)
        # Not at the knots, where an angular acceleration has a corner.
        tau = np.concatenate([[0.0], np.linspace(0.005, 0.995, 60), [1.0]])
        found = states(segment, amplitude, p, tau)
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(found))
        step, time = 1e-6, float(segments.duration(segment, float(p)))
        before, after = (states(segment, amplitude, p, tau[1:-1] + d) for d in (-step, step))
        slope = (np.asarray(after.rotation) - np.asarray(before.rotation)) / (2.0 * step * time)
        omega_cross = np.einsum("nij,nkj->nik", slope, np.asarray(found.rotation)[1:-1])
        omega = np.stack([omega_cross[:, 2, 1], omega_cross[:, 0, 2], omega_cross[:, 1, 0]], axis=1)
        np.testing.assert_allclose(found.angular_velocity[1:-1], omega, atol=2e-7)
        second_derivative = (np.asarray(after.angular_velocity) - np.asarray(before.angular_velocity)) / (
            2.0 * step * time
        )
        np.testing.assert_allclose(found.angular_acceleration[1:-1], second_derivative, atol=2e-5)
        gradient = lowest_and_slopes(_place(Z0, -2.0, -1.0), robot, amplitude, poses, np.asarray(float(p)))
        assert np.isfinite(gradient[0]) and np.isfinite(gradient[1]).all()


def _place(*values):
    return tuple(np.asarray(x) for x in values)


def test_gradients_are_differences():
    """Of the smallest tension with respect to z0 and beta-hat, from rest and between poses."""
    robot, amplitude, rng = ours(MSSM), EFFECTIVE, np.random.default_rng(4)
    for rest in (True, False):
        end, start = random_pose(rng), random_pose(rng)
        if rest:
            start = (np.full(3, np.nan), np.array([1.0, 0.0, 0.0, 0.0]))
        place, rest_of_it = (Z0, -1.0, -1.7), (robot, amplitude, [start, end], np.asarray(7.0))
        found = lowest_and_slopes(_place(*place), *rest_of_it)[1]
        for i in (0, 2):
            h = 1e-6
            shifted = [_place(*(x + s * h * (j == i) for j, x in enumerate(place))) for s in (-1.0, 1.0)]
            low, high = (float(lowest_and_slopes(there, *rest_of_it)[0]) for there in shifted)
            assert float(found[i]) == pytest.approx((high - low) / (2.0 * h), rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("robot", [MSSM, general()])
def test_wrench_balance(robot):
    """Force and moment of the tensions along the cables make the motion: Newton and Euler, cable by cable."""
    rng, cases = np.random.default_rng(2), []
    for _ in range(50):
        position, quaternion = random_pose(rng)
        rotation, (velocity, omega, pull, spin) = oracle.matrix(quaternion), rng.normal(size=(4, 3))
        cases.append(State(position, velocity, pull, rotation, omega, spin))
    found = cables_at(ours(robot), State(*(np.stack(x) for x in zip(*(case[:6] for case in cases), strict=True))))
    columns = found["tension"], found["determinant"], *found["motion"]
    for pose, tension, determinant, length, rate, second_derivative in zip(cases, *columns, strict=True):
        position, velocity, pull, rotation, omega, spin = pose[:6]
        arms = robot.platform @ rotation.T
        cables = position + arms - robot.base
        units = -cables / np.linalg.norm(cables, axis=1)[:, None]
        force = (tension[:, None] * units).sum(0) + robot.mass * np.array([0.0, 0.0, 9.81])
        moment = (tension[:, None] * np.cross(arms, units)).sum(0)
        inertia = rotation @ robot.inertia @ rotation.T
        scale = np.abs(tension).sum()
        np.testing.assert_allclose(force, robot.mass * pull, atol=1e-10 * scale)
        np.testing.assert_allclose(moment, inertia @ spin + np.cross(omega, inertia @ omega), atol=1e-10 * scale)
        ratios = oracle.force_ratios(robot, position, rotation, oracle.wrench(robot, rotation, pull, omega, spin))
        wanted = oracle.tensions(robot, position, rotation, ratios).reshape(6)
        np.testing.assert_allclose(tension, wanted, rtol=1e-8, atol=1e-8 * scale)
        assert np.sign(determinant) == np.sign(np.linalg.det(oracle.jacobian(robot, position, rotation)))
        swing = np.cross(omega, arms)
        speed, acceleration = velocity + swing, pull + np.cross(spin, arms) + np.cross(omega, swing)
        np.testing.assert_allclose(length, np.linalg.norm(cables, axis=1), rtol=1e-12)
        np.testing.assert_allclose(length * rate, (cables * speed).sum(1), atol=1e-11)
        wanted = (speed**2).sum(1) + (cables * acceleration).sum(1)
        np.testing.assert_allclose(length * second_derivative + rate**2, wanted, atol=1e-10)


def test_work_of_the_cables_is_the_change_of_energy():
    """Along a random trajectory, by Gauss' rule arc by arc."""
    rng, robot, amplitude = np.random.default_rng(3), general(5), named("effective-c3", 0.15)
    package, p = ours(robot), 6
    start, end = random_pose(rng), random_pose(rng)
    segment = made(package, start, end, Z0, (-2.0, -1.5), p)
    time = float(segments.duration(segment, float(p)))
    nodes, parts = np.polynomial.legendre.leggauss(40)
    edges = np.unique(np.concatenate([np.linspace(0.0, 1.0, p + 1), [0.15, 0.85], [0.4]]))
    work, last = 0.0, None
    for a, b in itertools.pairwise(edges):
        tau = np.concatenate([[a], 0.5 * (a + b) + 0.5 * (b - a) * nodes, [b]])
        at = states(segment, amplitude, p, tau)
        cables = cables_at(package, at)
        power = -(cables["tension"] * cables["motion"][1]).sum(1)
        work += 0.5 * (b - a) * time * float(parts @ power[1:-1])

        def energy(i, at=at):
            turn, omega = at.rotation[i], at.angular_velocity[i]
            kinetic = (
                robot.mass * float(at.velocity[i] @ at.velocity[i]) + omega @ turn @ robot.inertia @ turn.T @ omega
            )
            return 0.5 * kinetic - robot.mass * 9.81 * float(at.position[i][2])

        last = energy(0) if last is None else last
        assert work == pytest.approx(energy(-1) - last, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("robot", [MSSM, general(1)])
def test_ends(robot):
    """beta-hat and its interval, against the oracle; the ends of segments have the tensions promised."""
    rng, package = np.random.default_rng(6), ours(robot)
    for _ in range(20):
        position, quaternion = random_pose(rng)
        found = end_of(package, position, quaternion, np.asarray(Z0))
        u, v = oracle.deviations(robot, position, quaternion, Z0)
        if robot is MSSM:
            assert float(found.preferred) == pytest.approx(oracle.preferred_beta_hat(u, v), rel=1e-8)
        low, high = oracle.beta_hat_interval(u, v, 9.81 / Z0)
        if low <= high:
            np.testing.assert_allclose([found.lowest, found.highest], [low, high], rtol=1e-8)
        else:
            assert found.lowest > found.highest
        second_derivative = float(rng.uniform(-4.0, 2.0))
        segment = made(package, random_pose(rng), (position, quaternion), Z0, (-1.0, second_derivative), 5)
        at = cables_at(package, states(segment, EFFECTIVE, 5, np.ones(1)))
        promised = np.asarray(found.offset) + second_derivative * np.asarray(found.derivative)
        np.testing.assert_allclose(at["per_length"][0], promised, rtol=1e-7, atol=1e-8)
    rest = end_of(package, *random_pose(rng, rest=True), np.asarray(Z0))
    assert float(rest.preferred) == -1.0


@jax.jit
def _turned(q):
    return rotations.matrix(q), rotations.matrix(rotations.upper(q)), rotations.product(q, rotations.conjugate(q))


@given(*[st.floats(-7.0, 7.0)] * 3)
def test_tilt_and_torsion(azimuth, tilt, torsion):
    q = rotations.from_tilt_torsion(np.array([azimuth, tilt, torsion]))
    assert float(np.linalg.norm(q)) == pytest.approx(1.0, abs=1e-14)
    wanted = oracle.tilt_torsion_matrix(azimuth, tilt, torsion)
    matrix, of_upper, back = _turned(q)
    np.testing.assert_allclose(matrix, wanted, atol=1e-14)
    np.testing.assert_allclose(of_upper, wanted, atol=1e-14)
    np.testing.assert_allclose(back, [1.0, 0.0, 0.0, 0.0], atol=1e-14)


@pytest.mark.parametrize("name", PLATFORMS)
def test_the_catalogue_hangs_still(name):
    """Every six-cable robot of the catalogue is in equilibrium in its reference orientation, with equal tensions."""
    path = CATALOGUE / f"{name}.toml"
    robot_file = read_robot(path)
    robot = kernel_robot(robot_file, TrajectoryKeys(), path)
    span = np.linalg.norm(robot.base_points, axis=1).max()
    for depth in (1.0, 3.0):
        found = reference_pose(robot, depth * span)
        np.testing.assert_allclose(found.tensions, 1.0, atol=2e-3)
        np.testing.assert_allclose(found.rotation, np.eye(3), atol=2e-3)
        assert np.sign(found.determinant) == (1.0 if name == "nist-robocrane" else -1.0)
    assert len(separate_pairs(robot)) == (9 if name in ("laval-mssm", "nist-robocrane") else 12)
    assert "placeholder" in robot_file.source


def test_the_reference_orientation_is_found():
    """A platform described in turned axes, upside down too, is the same robot."""
    rng, plain = np.random.default_rng(8), reference_pose(ours(MSSM), Z0)
    for i in range(6):
        quaternion = rng.normal(size=4)
        turn = oracle.matrix(quaternion / np.linalg.norm(quaternion)) if i else np.diag([1.0, -1.0, -1.0])
        robot = dataclasses.replace(
            MSSM, platform=MSSM.platform @ turn.T, inertia=turn @ MSSM.inertia @ turn.T, com=np.zeros(3)
        )
        found = reference_pose(ours(robot), Z0)
        assert abs(found.determinant) == pytest.approx(abs(plain.determinant), rel=1e-9)
        np.testing.assert_allclose(found.tensions, 1.0, atol=1e-9)
        np.testing.assert_allclose(found.robot.inertia, MSSM.inertia, atol=1e-12)


def changed(**fields):
    robot = {"base_points": MSSM.base, "platform_points": MSSM.platform, "mass": 1.0, "inertia": MSSM.inertia}
    return platform_robot(**(robot | fields))


@pytest.mark.parametrize(
    ("fields", "key"),
    [
        ({"base_points": MSSM.base[:5]}, "base_points"),
        ({"base_points": MSSM.base * [1.0, 0.0, 0.0]}, "base_points"),
        ({"platform_points": np.zeros((6, 3))}, "platform_points"),
        ({"platform_points": MSSM.platform * np.nan}, "platform_points"),
        ({"platform_points": np.tile(MSSM.platform[:1], (6, 1))}, "platform_points"),
        ({"platform_points": MSSM.platform[[0, 0, 2, 3, 4, 5]]}, "platform_points"),
        ({"mass": 0.0}, "mass"),
        ({"inertia": np.eye(2)}, "inertia"),
        ({"inertia": np.diag([1.0, 1.0, 0.0])}, "inertia"),
        ({"inertia": np.diag([1.0, 1.0, 2.1])}, "inertia"),
        ({"inertia": np.eye(3) + np.triu(np.ones((3, 3)), 1)}, "inertia"),
        ({"centre_of_mass": [0.0, 0.0]}, "centre_of_mass"),
    ],
)
def test_robots_that_are_none(fields, key):
    with pytest.raises(InputError, match=key):
        changed(**fields)


def test_robots_that_do_not_hang():
    with pytest.raises(
        InputError, match=r"z0 = .* m\) cable \d is slack: .*: must hang with every cable taut: move centre_of_mass"
    ):
        reference_pose(changed(centre_of_mass=[0.5, 0.0, 0.0]), Z0)
    angles = np.arange(6) * np.pi / 3.0  # every cable straight up and down: nothing holds the platform level
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=1)
    with pytest.raises(
        InputError, match=r"z0 = .* is singular .*: the platform can .*: must be held in all directions"
    ):
        reference_pose(changed(platform_points=ring, base_points=ring), Z0)


def test_joints():
    """Points where cables meet are known as such."""
    assert ours(MSSM).joints == (0, 1, 1, 3, 3, 0)
    assert ours(general(2)).joints == tuple(range(6))


# Standard hypocycloids whose orientations beat with beta_1: what no usual motion has.
OTHERS = PlatformMotionKind(variable=False, plain=True)
KINDS = [USUAL, STANDARD, PlatformMotionKind(plain=True), FROM_REST]


@pytest.mark.quick("robot0-effective-c3-kind0")
@pytest.mark.parametrize(
    ("robot", "name", "kind"),
    [
        (MSSM, "effective-c3", USUAL),
        pytest.param(MSSM, "effective-c3", OTHERS, marks=pytest.mark.thorough),
        (general(2), "effective-c3", FROM_REST),
        *(soak(MSSM, "quintic", kind) for kind in KINDS),
        *(soak(general(2), "effective-c3", kind) for kind in KINDS[:3]),
    ],
)
def test_the_fast_kernel(robot, name, kind):
    """The smallest tension of many segments as the readable functions give it; -inf past a singularity."""
    package, rng, amplitude = ours(robot), np.random.default_rng(9), AMPLITUDES[name][0]
    standing = State(np.array([[0.0, 0.0, Z0]]), *np.zeros((2, 1, 3)), np.eye(3)[None], *np.zeros((2, 1, 3)))
    reference = cables_at(package, standing)["determinant"][0]
    seen = {"regular": 0, "singular": 0}
    for p in (1, 4, 7):
        tau = np.linspace(0.0, 1.0, 4 * CHUNK)
        some = [
            made(
                package,
                random_pose(rng, rest=i % 3 == 0 or kind.from_rest),
                random_pose(rng),
                Z0,
                (-1.0, rng.uniform(-5.0, 1.0)),
                p,
            )
            for i in range(24)
        ]
        batch = stacked([*some, *some[:1] * (64 - len(some))])  # the batch that `conftest` sets: compiled once for all
        found, when = _smallest(package, amplitude, p, tau, batch, kind=kind)
        rough, _ = _smallest(package, amplitude, p, tau, batch, kind=kind, single_precision=True)
        assert rough.dtype == np.float32
        alone, _ = _smallest(package, amplitude, p, np.resize(tau[np.unique(when)], len(tau)), batch, kind=kind)
        assert (alone == found).all()
        for i, segment in enumerate(some):
            at = cables_at(package, states(segment, amplitude, p, tau, kind=kind))
            mu, det = at["per_length"], at["determinant"]
            if (det / reference > 1e-4).all():
                wanted = 6.0 * Z0 / 9.81 * mu.min()
                assert float(found[i]) == pytest.approx(wanted, rel=1e-8, abs=1e-9)
                assert float(rough[i]) == pytest.approx(wanted, rel=0.02, abs=0.02)
                seen["regular"] += 1
            elif (det / reference < -1e-4).any():
                assert float(found[i]) == -np.inf
                seen["singular"] += 1
    assert min(seen.values()) > 5, seen


def _smallest(robot, amplitude, p, tau, batch, **how):
    # Of instants in calls of the length that the first look has, and which of all instants it belongs to.
    parts = [
        smallest_tensions(robot, amplitude, float(p), tau[k : k + CHUNK], batch, **how)
        for k in range(0, len(tau), CHUNK)
    ]
    values, when = (np.stack([np.asarray(part[k]) for part in parts]) for k in (0, 1))
    first = values.argmin(0)
    return values.min(0), np.take_along_axis(when, first[None], 0)[0] + CHUNK * first
