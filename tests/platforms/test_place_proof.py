"""Proofs about contacts and limits on the pose: bounds on blocks, meetings, and verdicts against dense samples."""

import dataclasses
from functools import partial

import numpy as np
import pytest
from oracles import platform as oracle
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from support.platforms import FROM_REST, MSSM, USUAL, Z0, general, limits_of, stacked
from support.random_motions import BATCH, ROBOTS, drawn, motions_of, problem_of, rotated

from cspr_jax.families.platforms.six_cable_proof import cable_contacts
from cspr_jax.families.platforms.six_cable_proof.cable_contacts import CablesOfStep
from cspr_jax.families.platforms.six_cable_proof.pose_blocks import STEPS, pose_blocks
from cspr_jax.families.platforms.six_cable_proof.pose_proof import PARTS, PoseCertifier
from cspr_jax.numerics.batches import in_batches
from cspr_jax.robots.contacts.interference import contacts, platform_hit
from cspr_jax.robots.contacts.interference_lanes import residual

# Spools far from level: the plane through them rises by 80 degrees.
STEEP = rotated(dataclasses.replace(MSSM, base=MSSM.base @ Rotation.from_euler("x", 80, degrees=True).as_matrix().T))
TIGHT = {"floor": 2.0, "cable_length_max": 3.0}
FINE = 33
# The oracle knows only flat platforms.
FLAT = {"mssm": ROBOTS["mssm"], "slanted": rotated(dataclasses.replace(general(), platform=MSSM.platform))}


def below_spools(robot, position):
    """Depth below the plane of least squares through the spools, along the vertical, (n,)."""
    slope, *_ = np.linalg.lstsq(robot.base[:, :2], robot.base[:, 2], rcond=None)
    return position[:, 2] - position[:, :2] @ slope


def seen(robot, segment, p, beta, tau):
    """By the oracle: distances between cables, slacks of depth and limits, cables as the platform sees them."""
    m = oracle.motion(robot, segment, p, beta, tau)
    shortest, _ = oracle.cable_vectors(robot, m.position, m.rotation)
    lines = oracle.cables(robot, m.position, m.rotation)
    lengths = np.linalg.norm(lines, axis=2)
    points = m.position[:, None] + np.einsum("nij,kj->nki", m.rotation, robot.platform)
    depth = np.maximum(m.position[:, 2], points[:, :, 2].max(1))  # of all of the platform
    slacks = np.array(
        [
            below_spools(robot, m.position) / Z0,
            (TIGHT["floor"] - depth) / Z0,
            (1.0 - lengths / TIGHT["cable_length_max"]).min(1),
        ]
    )
    return np.linalg.norm(shortest, axis=2).min(1), slacks, -np.einsum("nki,nij->nkj", lines, m.rotation)


def sector_distance(sides, normal, vectors):
    """Distance of vectors (n, n_cables, 3) from the sectors of their corners, over many directions of these."""
    one, two = sides[:, 0], sides[:, 1]
    along = np.where(np.linalg.norm(two, axis=1, keepdims=True) > 0.0, two, np.linalg.svd(normal[None])[2][1])
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normal, along)
    # Counterclockwise from the second side to the first, or all around.
    turn = np.arctan2((one * across).sum(1), (one * along).sum(1))
    turn = np.where((one == 0.0).all(1), 2.0 * np.pi, np.mod(turn, 2.0 * np.pi))
    angle = turn[:, None] * np.linspace(0.0, 1.0, 81)
    spokes = np.cos(angle)[..., None] * along[:, None] + np.sin(angle)[..., None] * across[:, None]
    along = np.maximum(np.einsum("nki,ksi->nsk", vectors, spokes), 0.0)
    rest = vectors[:, None] - along[..., None] * spokes.transpose(1, 0, 2)[None]
    return np.linalg.norm(rest, axis=3).min((1, 2))


def block_breaks(count, seed, kind, robot):
    """Bounds on random blocks against dense samples: how many are broken, how many blocks are clear."""
    rng = np.random.default_rng(seed)
    segments, theirs, arcs, betas = drawn(rng, robot, kind, count)
    problem = problem_of(robot, limits_of(**TIGHT))
    near = contacts(problem.robot)
    start = rng.uniform(0.0, 0.95, count)
    stop = np.minimum(start + rng.uniform(0.05, 0.5, count) / arcs, 1.0)
    pairs = tuple((int(i), int(j)) for i, j in near.pairs)
    kernel = partial(pose_blocks, problem, (near.sides, near.normal), np.ones(()), pairs=pairs, kind=kind, margins=True)
    found = in_batches(kernel, (segments, arcs.astype(float), start, stop), batch_size=BATCH, axis=-1)
    broken = 0
    for i, (segment, p, beta) in enumerate(zip(theirs, arcs, betas, strict=True)):
        tau = np.linspace(start[i], stop[i], STEPS * (FINE - 1) + 1)
        apart, slacks, vectors = seen(robot, segment, int(p), beta, tau)
        broken += bool((found.slacks[:, i] > slacks.min(1) + 1e-12).any())
        broken += bool(found.clear[i] > 0.0 and found.clear[i] > apart.min() + 1e-12)
        off = sector_distance(near.sides, near.normal, vectors).min()
        broken += bool(found.clear[i] > 0.0 and found.clear[i] > off + 1e-12)
        assert np.allclose(found.nodes[:, -1, i], apart[:: FINE - 1], atol=1e-9)
        broken += bool(not np.allclose(found.nodes[:, :3, i].T, slacks[:, :: FINE - 1], rtol=1e-9, atol=1e-9))
    return broken, float((found.clear > 0.0).mean())


@pytest.mark.thorough
@pytest.mark.parametrize(
    "kind", [USUAL, pytest.param(FROM_REST, marks=pytest.mark.thorough)], ids=["between", "from rest"]
)
def test_bounds_on_blocks_hold(kind):
    """Distances, depths and lengths between the instants; most blocks are seen to be clear."""
    broken, clear = block_breaks(64, 21, kind, ROBOTS["mssm"])
    assert not broken and clear > 0.3


@pytest.mark.thorough
def test_bounds_of_depth_hold_below_steep_spools():
    """Depth is along the vertical, to a plane whose normal is longer than 1 where its vertical part is 1."""
    assert not block_breaks(192, 21, FROM_REST, STEEP)[0]


@pytest.mark.soak
@pytest.mark.parametrize("name", [*ROBOTS, "steep"])
@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_bounds_on_many_blocks_hold(kind, name):
    """30,000 stretches in all."""
    assert not block_breaks(5000, 31, kind, (ROBOTS | {"steep": STEEP})[name])[0]


def happens_near(robot, segment, p, beta, tau):
    """Whether something meets, or is above the spools, within a step of halved blocks of an instant."""
    step = 1.0 / (2 * PARTS * STEPS * p)
    m = oracle.motion(robot, segment, p, beta, np.clip(tau + np.linspace(-step, step, 65), 0.0, 1.0))
    crossed = oracle.cables_cross(oracle.cable_vectors(robot, m.position, m.rotation)[0]).any()
    hit = oracle.platform_hit(robot, m.position, m.rotation).any()
    return crossed or hit or not (below_spools(robot, m.position) > 0.0).all()


def verdict_breaks(count, seed, kind, robot, instants):
    """Proofs of random motions: contradicted by samples, undecided, met or hit, clear."""
    some = motions_of(np.random.default_rng(seed), robot, kind, count)
    problem = problem_of(robot)
    certifier = PoseCertifier(problem, kind, batch=BATCH, count_samples=lambda count: None)
    proof = certifier.prove(stacked([x[3] for x in some]), np.array([x[1] for x in some]))
    contradicted = 0
    for i, (segment, p, beta, _) in enumerate(some):
        m = oracle.motion(robot, segment, p, beta, np.linspace(0.0, 1.0, instants))
        shortest, _ = oracle.cable_vectors(robot, m.position, m.rotation)
        crossed = bool(oracle.cables_cross(shortest).any())
        hit = bool(oracle.platform_hit(robot, m.position, m.rotation).any())
        is_below = bool((below_spools(robot, m.position) > 0.0).all())
        contradicted += bool(proof.is_proved[i]) and (crossed or hit or not is_below)
        contradicted += bool(proof.is_refuted[i]) and not happens_near(robot, segment, p, beta, proof.refuted_tau[i])
        contradicted += (bool(proof.met[i]) and not crossed) + (bool(proof.hit[i]) and not hit)
    undecided = ~(proof.is_proved | proof.is_refuted)
    return contradicted, int(undecided.sum()), int((proof.met | proof.hit).sum()), int(proof.is_proved.sum())


@pytest.mark.thorough
@pytest.mark.parametrize(
    "kind", [pytest.param(USUAL, marks=pytest.mark.thorough), FROM_REST], ids=["between", "from rest"]
)
def test_proofs_agree_with_samples(kind):
    """What is proved to be clear is, what is proved to meet does, and nothing else happens."""
    contradicted, undecided, meet, clear = verdict_breaks(32, 23, kind, ROBOTS["mssm"], 4001)
    assert contradicted == 0 and undecided <= 1 and meet > 3 and clear > 5


@pytest.mark.soak
@pytest.mark.parametrize("name", list(FLAT))
@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_proofs_agree_with_many_samples(kind, name):
    """1,000 motions of each robot and kind, 20,001 instants."""
    contradicted, undecided, _, _ = verdict_breaks(1000, 29, kind, FLAT[name], 20_001)
    assert contradicted == 0 and undecided < 5


def cables_from(first, last, deviation, steps=2):
    """Two cables of one block whose rays go straight from the first ones to the last ones, in equal steps."""
    rays = np.linspace(first, last, steps + 1)[:, None]
    return CablesOfStep(rays, rays, np.full((1, 2), deviation), np.full(1, deviation))


def test_cables_that_meet():
    """Two cables pass through each other; beyond their ends they do not, nor where they may bend by more."""
    base, pairs = np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 0.0]]), np.array([[0, 1]])
    first = np.array([[2.0, 0.0, 0.1], [0.0, 2.0, 0.0]])
    last = np.array([[2.0, 0.0, -0.1], [0.0, 2.0, 0.0]])
    for meets, cables in (
        (True, cables_from(first, last, 0.1, steps=3)),
        (False, cables_from(first, last, 1.5, steps=3)),
        (False, cables_from(first * 0.4, last * 0.4, 0.1, steps=3)),
        (False, cables_from(first, first, 0.1)),
        # Exactly in one plane at an instant: no sign changes beyond rounding, in this step or in that.
        (False, cables_from(first, last, 0.0, steps=2)),
    ):
        assert (cable_contacts.cables_meet(base, pairs, cables) >= 0).tolist() == [meets]


def test_cables_in_wide_steps():
    """A cable that sweeps past the end of another within a step is not said to meet it."""
    base, pairs = np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 0.0]]), np.array([[0, 1]])
    low, high = np.array([[2.0, 0.0, -0.1], [0.0, 2.0, 0.0]]), np.array([[2.0, 0.0, 0.1], [0.0, 2.0, 0.0]])
    for shift, meets in ((0.0, True), (1.5, False), (-1.5, False)):
        moved = high + np.array([[0.0, 0.0, 0.0], [shift, 0.0, 0.0]])
        assert cable_contacts.cables_meet(base, pairs, cables_from(low, moved, 0.0, steps=1)).tolist() == [meets - 1]


def test_cables_on_the_platform():
    """A cable falls through its corner's sector; beside the sector it does not count."""
    sides = np.array([[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]] * 2)
    normal = np.array([0.0, 0.0, 1.0])
    high, low = np.array([[1.0, 0.5, 0.1]] * 2), np.array([[1.0, 0.5, -0.1]] * 2)
    beside = high * [-1.0, 1.0, 1.0], low * [-1.0, 1.0, 1.0]
    for hits, cables in (
        (True, cables_from(high, low, 0.2, steps=3)),
        (False, cables_from(high, low, 0.6, steps=3)),
        (False, cables_from(*beside, 0.2, steps=3)),
    ):
        assert (cable_contacts.cables_hit(sides, normal, cables) >= 0).tolist() == [hits]


def test_what_touches_in_a_wide_step_stays_in_the_sector():
    """Straight from inside to inside: a chord of the sector; from inside to outside: nothing is known."""
    sides = np.array([[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]])
    normal = np.array([0.0, 0.0, 1.0])
    high, near, far = (np.array([[1.0, y, z]]) for y, z in ((0.9, 0.1), (0.7, -0.1), (-0.5, -0.1)))
    for last, hits in ((near, True), (far, False)):
        cables = cables_from(high, last, 0.0, steps=1)
        assert (cable_contacts.cables_hit(sides, normal, cables) >= 0).tolist() == [hits]


# Six points of a flat platform: one on an edge, one inside, two that coincide.
FLAT_POINTS = np.array([[0.3, 0.0], [0.1, 0.3], [-0.3, 0.1], [-0.1, 0.2], [0.05, 0.15], [0.3, 0.0]])


def test_sectors_are_those_of_the_convex_hull():
    """Along which directions a point of the platform has the platform beside it, by another library's hull."""
    rng, axes = np.random.default_rng(3), Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    hull = ConvexHull(FLAT_POINTS).equations
    robot = problem_of(rotated(dataclasses.replace(MSSM, platform=np.c_[FLAT_POINTS, np.zeros(6)] @ axes.T))).robot
    near, points = contacts(robot), np.asarray(robot.platform_points)
    # In the robot's axes, which are others than those of the drawing.
    plane = np.linalg.lstsq(FLAT_POINTS - FLAT_POINTS.mean(0), points - points.mean(0), rcond=None)[0]
    for k in range(6):
        for angle in rng.uniform(0.0, 2.0 * np.pi, 60):
            flat = np.array([np.cos(angle), np.sin(angle)])
            inside = bool(((FLAT_POINTS[k] + 1e-6 * flat) @ hull[:, :2].T + hull[:, 2] <= 1e-12).all())
            direction = flat @ plane
            sides = [[side[i] for i in range(3)] for side in near.sides[k]]
            left = np.array(residual(sides, list(near.normal), list(direction)))
            assert (np.linalg.norm(left) < 1e-9) == inside, (k, angle)
            # A cable that falls through the plane in this direction.
            steps = direction + np.array([[0.01], [-0.01]]) * near.normal
            every = np.tile(near.normal, (2, 1, 6, 1))
            every[:, 0, k] = steps
            cables = CablesOfStep(np.zeros((2, 1, 6, 3)), every, np.zeros((1, 6)), np.zeros(1))
            hits = bool(cable_contacts.cables_hit(near.sides, near.normal, cables)[0] == 0)
            crossed = bool(platform_hit(near.sides, near.normal, every[0, 0], every[1, 0])[k])
            # What moves by 0.02 in between proves nothing beside the edges.
            edges = [np.cross(side, direction) @ near.normal / np.linalg.norm(side) for side in near.sides[k] if k != 4]
            assert crossed == inside and (hits == inside or np.abs(edges).min() < 0.02)
    kinds = [np.linalg.norm(np.cross(*side)) > 1e-9 for side in near.sides]
    assert kinds == [True, True, True, False, False, True] and not near.sides[4].any() and near.sides[3].any()
