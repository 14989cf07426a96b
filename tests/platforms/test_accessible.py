"""Accessible and attainable orientations: grids, steps between neighbours beside the oracle, symmetries, tables."""

import itertools
import math

import numpy as np
import pytest
from oracles import platform as oracle
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from support.platforms import FROM_REST, MSSM, checker_of, ours, place

from cspr_jax.families.platforms.beta_hat import end_options
from cspr_jax.families.platforms.orientations import accessible as scans
from cspr_jax.families.platforms.orientations.accessible import DEFINITIONS, accessible
from cspr_jax.families.platforms.orientations.attainable import attainable, attained, rounds
from cspr_jax.families.platforms.orientations.orientation_steps import OrientationSteps
from cspr_jax.numerics.linear.rotations import from_tilt_torsion
from cspr_jax.robots.model.orientation_grids import equal_volume_grid, tilt_torsion_grid
from cspr_jax.robots.statics.symmetries import NONE, alike, folded, symmetries


def rotations(angles):
    return Rotation.from_quat(from_tilt_torsion(angles), scalar_first=True)


def test_the_volume_of_tilt_and_torsion():
    """Random orientations of SO(3) fall into ranges of tilt and torsion as sin(theta) says; the grid's volumes too."""
    some = Rotation.random(200_000, random_state=1).as_quat(scalar_first=True)
    some = np.where(some[:, :1] < 0.0, -some, some)
    tilt = 2.0 * np.arctan2(np.hypot(some[:, 1], some[:, 2]), np.hypot(some[:, 0], some[:, 3]))
    torsion = 2.0 * np.arctan2(some[:, 3], some[:, 0])
    # Halfway between points of the grid.
    most = 11.5 * math.pi / 32.0, 7.5 * math.pi / 32.0
    wanted = (1.0 - math.cos(most[0])) / 2.0 * most[1] / math.pi
    inside = (tilt < most[0]) & (np.abs(torsion) < most[1])
    assert inside.mean() == pytest.approx(wanted, abs=4.0 * math.sqrt(wanted / len(some)))
    grid = tilt_torsion_grid(32)
    near = (grid.angles[:, 1] < most[0]) & (np.abs(grid.angles[:, 2]) < most[1])
    assert grid.volume[near].sum() == pytest.approx(wanted, rel=1e-9)
    assert grid.volume.sum() == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("make", [tilt_torsion_grid, equal_volume_grid])
def test_grids_of_orientations(make):
    """No orientation twice, the reference one first, neighbours near, everything connected."""
    grid, step = make(8), math.pi / 8
    assert np.abs(grid.angles[grid.start]).max() == 0.0
    turns = rotations(grid.angles)
    first, last = grid.neighbours.T
    apart = (turns[first].inv() * turns[last]).magnitude()
    assert apart.min() > 1e-6 and apart.max() <= (1.5 if make is equal_volume_grid else 2.0) * step + 1e-9
    pairs = np.sort(grid.neighbours, axis=1)
    assert len(np.unique(pairs, axis=0)) == len(pairs)
    reached, edge = {grid.start}, [grid.start]
    lists = {i: set() for i in range(len(grid.angles))}
    for a, b in grid.neighbours:
        lists[a].add(int(b))
        lists[b].add(int(a))
    while edge:
        edge = [b for a in edge for b in lists[a] if b not in reached and not reached.add(b)]
    assert len(reached) == len(grid.angles)
    if make is equal_volume_grid:
        assert np.ptp(grid.volume) == 0.0
        # Each of many random orientations is about as near to a cell as the step says.
        some = Rotation.random(500, random_state=2).as_quat(scalar_first=True)
        nearest = np.abs(some @ from_tilt_torsion(grid.angles).T).max(1)
        assert (2.0 * np.arccos(np.clip(nearest, 0, 1))).max() < step


def test_steps_between_neighbours():
    """Regular, cables that meet, the platform: as the oracle says, for random neighbours at a far place."""
    rng, there = np.random.default_rng(3), place(1.5, 0.4)
    angles = np.stack([rng.uniform(-3, 3, 400), rng.uniform(0, 2.2, 400), rng.uniform(-2, 2, 400)], axis=1)
    other = angles + rng.normal(size=angles.shape) * 0.15
    steps = OrientationSteps(ours(MSSM), there)
    samples = steps.at(from_tilt_torsion(np.concatenate([angles, other])))
    found = steps.passable(samples, np.arange(400), np.arange(400, 800))
    seen = {True: 0, False: 0}
    for i, (a, b) in enumerate(zip(angles, other, strict=True)):
        position = np.stack([there, there])
        turns = np.stack([oracle.matrix(from_tilt_torsion(x[None])[0]) for x in (a, b)])
        det = oracle.relative_determinant(MSSM, position, turns, there[2])
        if np.abs(det).min() < 1e-4:
            continue
        vectors = oracle.cable_vectors(MSSM, position, turns)[0]
        met = ((vectors[0] * vectors[1]).sum(-1) <= 0.0).any()
        wanted = det.min() > 0.0 and not met and not np.any(oracle.platform_hit(MSSM, position, turns))
        assert found[i] == wanted, i
        seen[bool(wanted)] += 1
    assert min(seen.values()) > 50


@pytest.mark.parametrize("definition", DEFINITIONS)
def test_symmetric_places_have_equal_sets(definition):
    """The mirror x -> -x and 120 degrees: equal counts for tilt and torsion, equal volumes within a step otherwise."""
    robot = ours(MSSM)
    plain = accessible(robot, place(1.6, 0.3), definition, 8)
    for azimuth in (math.pi - 0.3, 0.3 + 2.0 * math.pi / 3.0):
        other = accessible(robot, place(1.6, azimuth), definition, 8)
        if definition == "equal-volume":
            assert other.volume.sum() == pytest.approx(plain.volume.sum(), rel=0.05)
        else:
            assert len(other.angles) == len(plain.angles)
            assert other.volume.sum() == pytest.approx(plain.volume.sum(), rel=1e-9)


def test_cables_that_lie_in_the_platform():
    """Exactly so at some orientations of this grid: the set is its own mirror image all the same."""
    robot, found = ours(MSSM), []
    for azimuth in (math.pi / 2.0, math.pi / 2.0 + 2.0 * math.pi / 3.0):
        angles = accessible(robot, place(3.0, azimuth), "grid", 16).angles
        phi, theta, sigma = np.round(angles * 16 / math.pi).astype(int).T
        found.append(set(zip(np.where(theta > 0, phi % 32, 0), theta, sigma % 32, strict=True)))
    # phi becomes pi - phi in the cylindrical frame.
    mirrored = {((16 - phi) % 32 if theta else 0, theta, -sigma % 32) for phi, theta, sigma in found[0]}
    assert mirrored == found[0] == found[1]


def test_definitions_agree():
    """On the volume, within what the step lets expect; the scan counts no orientation outside of the other two."""
    robot = ours(MSSM)
    for radius in (0.5, 2.0):
        found = {name: accessible(robot, place(radius, 0.2), name, 16).volume.sum() for name in DEFINITIONS}
        for a, b in itertools.combinations(found.values(), 2):
            assert a == pytest.approx(b, rel=0.06), found


def test_rays_of_a_scan_go_as_far_in_short_legs(monkeypatch):
    """In legs of three steps, the last of one, as in one leg of all sixteen."""
    whole = [accessible(ours(MSSM), place(radius, 0.4), "scan", 8) for radius in (0.0, 1.5)]
    monkeypatch.setattr(scans, "RAY_STEPS", 3)
    for radius, one in zip((0.0, 1.5), whole, strict=True):
        legs = accessible(ours(MSSM), place(radius, 0.4), "scan", 8)
        np.testing.assert_array_equal(legs.angles, one.angles)
        np.testing.assert_array_equal(legs.volume, one.volume)
    assert len(whole[1].angles) > 100


@pytest.mark.thorough
def test_no_way_leads_through_touching_cables():
    """Steps of pi / 12 and pi / 24 have orientations where cables just touch, with gaps of rounding errors."""
    robot, there = ours(MSSM), place(1.5, 0.0)
    plain = accessible(robot, there, "grid", 16).volume.sum()
    for definition, divisions in (("grid", 12), ("equal-volume", 24)):
        assert accessible(robot, there, definition, divisions).volume.sum() == pytest.approx(plain, rel=0.03)


def test_the_accessible_volume_beside_random_orientations():
    """A random roadmap, which knows no grid: its part of 8,000 orientations is the volume, within its error."""
    check_volume(8_000, 24, [place(1.5, 0.0)])


@pytest.mark.soak
def test_the_accessible_volume_beside_random_orientations_all():
    """20,000 orientations, two places."""
    check_volume(20_000, 32, [place(1.5, 0.0), place(3.0, 1.2)])


def check_volume(count, divisions, places):
    """Of so many random orientations, and of the finest grid."""
    robot = ours(MSSM)
    some = Rotation.random(count - 1, random_state=3).as_quat(scalar_first=True)
    every = np.concatenate([np.eye(4)[:1], some])
    step = (8.0 * math.pi**2 / count) ** (1.0 / 3.0)
    tree = cKDTree(np.concatenate([every, -every]))
    pairs = tree.query_pairs(2.0 * math.sin(0.25 * 1.5 * step), output_type="ndarray") % count
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    for there in places:
        steps = OrientationSteps(robot, there)
        samples = steps.at(every)
        way = pairs[steps.passable(samples, *pairs.T)]
        links = coo_matrix((np.ones(len(way), bool), way.T), shape=(count, count))
        part = connected_components(links, directed=False)[1]
        fraction = ((part == part[0]) & steps.regular(samples)).mean()
        error = math.sqrt(fraction * (1.0 - fraction) / count)
        volume = accessible(robot, there, "equal-volume", divisions).volume.sum()
        assert fraction == pytest.approx(volume, abs=3.0 * error)


def test_nothing_is_accessible_above_the_spools():
    for definition in DEFINITIONS:
        assert len(accessible(ours(MSSM), place(1.0, 0.0, -0.5), definition, 8).angles) == 0


@pytest.mark.thorough
def test_attained_orientations():
    """More arcs allowed attain no fewer, and the same numbers where found; margins are positive where attained."""
    robot = ours(MSSM)
    checker = checker_of(kind=FROM_REST)
    there = place(1.5, 0.0)
    inside = accessible(robot, there, "scan", 8)
    many, z0 = np.tile(there, (len(inside.angles), 1)), np.full(len(inside.angles), 1.7)
    found = {p: attainable(checker, many, inside.angles, z0, max_arcs=p, values=4) for p in (3, 8)}
    assert ((found[3].arcs > 0) <= (found[8].arcs > 0)).all() and (found[8].arcs > 0).mean() > 0.8
    assert (found[3].arcs[found[3].arcs > 0] == found[8].arcs[found[3].arcs > 0]).all()
    good = found[8].arcs > 0
    assert (found[8].margin[good] > 0).all() and (found[8].det_margin[good] > 0).all()
    assert (found[8].verdict[~good] != 0).all()


def test_symmetries_of_robots():
    robot = ours(MSSM)
    found = symmetries(robot)
    assert found.fold == 3 and np.degrees(found.mirrors) == pytest.approx([30.0, 90.0, 150.0])
    azimuths = np.radians([10.0, 50.0, 130.0, 170.0, 250.0, -70.0])
    np.testing.assert_allclose(folded(found, azimuths), np.radians(10.0), atol=1e-9)


@pytest.mark.thorough
def test_orientations_that_a_mirror_joins():
    """Each stands for itself or for its mirror image, half of them for all; what is attained is the same."""
    robot, there, mirror = ours(MSSM), place(1.5, math.pi / 2.0), np.diag([-1.0, 1.0, 1.0])
    angles = accessible(robot, there, "scan", 8).angles
    where = np.tile(there[:2], (len(angles), 1))
    stands = alike(symmetries(robot), where, angles)
    assert len(np.unique(stands)) < 0.54 * len(angles)
    turns = rotations(angles + np.array([math.pi / 2.0, 0.0, 0.0])).as_matrix()
    same = np.abs(turns[stands] - turns).max((1, 2)) < 1e-8
    mirrored = np.abs(mirror @ turns[stands] @ mirror - turns).max((1, 2)) < 1e-8
    assert (same | mirrored).all()
    assert (alike(symmetries(robot), where + np.array([0.1, 0.0]), angles) == np.arange(len(angles))).all()
    checker = checker_of(kind=FROM_REST)
    many, z0 = np.tile(there, (len(angles), 1)), np.full(len(angles), 1.7)
    once, twice = (
        attainable(checker, many, angles, z0, max_arcs=8, values=4, symmetry=found)
        for found in (symmetries(robot), NONE)
    )
    assert (once.arcs == twice.arcs).all()
    whether = attained(checker, many, angles, z0, max_arcs=8, values=4, symmetry=symmetries(robot))
    assert (whether == (once.arcs > 0)).all() and whether.any() and not whether.all()
    np.testing.assert_allclose(once.margin[once.arcs > 0], twice.margin[once.arcs > 0], atol=1e-6)


@pytest.mark.parametrize("values", [1, 2, 6, 20])
def test_turns_try_every_value_once(values):
    """The preferred one first."""
    each = rounds(values)
    assert each[0].tolist() == [0]
    assert sorted(np.concatenate(each).tolist()) == list(range(values))


@pytest.mark.thorough
def test_a_dip_beside_a_singularity():
    """A tension that is negative for a thousandth of the motion, near a nearly singular end: four arcs are too few."""
    there, angles = place(1.5, math.pi / 2.0), np.array([[0.67737013, 0.40312747, -1.6689711]])
    checker = checker_of(kind=FROM_REST)
    found = attainable(checker, there[None], angles, np.array([1.7]), max_arcs=8, values=4)
    rotated = from_tilt_torsion(angles[0] + np.array([math.pi / 2.0, 0.0, 0.0]))
    way = (np.array([0.0, 0.0, 1.7]), there, 1.7, np.eye(4)[0], rotated)
    segment = oracle.Segment(*way, amplitude=oracle.effective_c3(0.1))
    checked = {p: oracle.check_motion(MSSM, segment, p, tuple(found.beta_hat[0]), 20001) for p in (4, 5)}
    assert checked[4]["mu_hat_min"] < -0.5 and checked[5]["feasible"]
    assert found.arcs[0] == 5 and found.margin[0] == pytest.approx(checked[5]["mu_hat_min"], abs=1e-4)


@pytest.mark.soak
def test_verdicts_are_the_oracle_s():
    """2,000 random orientations: the smallest number of arcs, over all values of beta-hat, is the oracle's."""
    robot, rng, close, attained = ours(MSSM), np.random.default_rng(21), 0, 0
    checker = checker_of(kind=FROM_REST, batch=1024)
    for radius, azimuth in ((1.5, 0.0), (3.0, 0.0), (1.5, math.pi / 2.0), (2.2, 0.4)):
        there = place(radius, azimuth)
        angles = accessible(robot, there, "scan", 32).angles
        angles = angles[rng.choice(len(angles), 500, replace=False)]
        many, z0 = np.tile(there, (500, 1)), np.full(500, 1.7)
        found = attainable(checker, many, angles, z0, max_arcs=8, values=6)
        rotated = from_tilt_torsion(angles + np.array([azimuth, 0.0, 0.0]))
        values = end_options(robot, many, rotated, z0, 6)[0]
        for i in range(500):
            way = (np.array([0.0, 0.0, 1.7]), there, 1.7, np.eye(4)[0], rotated[i])
            segment, p = oracle.Segment(*way, amplitude=oracle.effective_c3(0.1)), int(found.arcs[i])
            attained += p > 0
            if p:
                assert oracle.check_motion(MSSM, segment, p, tuple(found.beta_hat[i]), 4001)["feasible"], (radius, i)
            for fewer in range(1, p or 9):
                for value in values[i][~np.isnan(values[i])]:
                    # What the oracle's few samples let pass is looked at with many.
                    if oracle.check_motion(MSSM, segment, fewer, (-1.0, value), 301)["feasible"]:
                        checked = oracle.check_motion(MSSM, segment, fewer, (-1.0, value), 40001)
                        close += checked["feasible"]
                        assert not checked["feasible"] or checked["mu_hat_min"] < 1e-4, (radius, i, fewer, value)
    assert close < 3 and 1500 < attained < 2000
