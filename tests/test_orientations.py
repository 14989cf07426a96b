"""Accessible and attainable orientations: grids, steps between neighbours beside the oracle, symmetries, tables."""

import itertools
import json
import math
from pathlib import Path

import jax
import numpy as np
import pytest
from oracles import platform as oracle
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from test_platform import MSSM, ours
from test_pose_plans import cspr

from cspr_jax import orientation_tables
from cspr_jax.amplitudes import named
from cspr_jax.feasibility.limits import Limits
from cspr_jax.feasibility.pose_checks import PoseChecker
from cspr_jax.feasibility.pose_slacks import PoseShared
from cspr_jax.feasibility.sights import Watch
from cspr_jax.feasibility.verdicts import Verdict
from cspr_jax.maps.accessible import DEFINITIONS, accessible
from cspr_jax.maps.attainable import attainable
from cspr_jax.maps.pose_ends import end_options
from cspr_jax.orientations import equal_volume_grid, tilt_torsion_grid
from cspr_jax.plots.reasons import reasons
from cspr_jax.results import open_result
from cspr_jax.rotations import from_tilt_torsion
from cspr_jax.symmetries import NONE, alike, folded, symmetries
from cspr_jax.trajectories.pose_segment import Kind

B = 0.86


@pytest.fixture(autouse=True)
def _64_bits():
    with jax.enable_x64(True):
        yield


def place(radius, azimuth, depth=1.7):
    return np.array([radius * B * math.cos(azimuth), radius * B * math.sin(azimuth), depth])


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
    watch = Watch(ours(MSSM), there)
    sights = watch.at(from_tilt_torsion(np.concatenate([angles, other])))
    found = watch.passable(sights, np.arange(400), np.arange(400, 800))
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


def test_definitions_agree():
    """On the volume, within what the step lets expect; the scan counts no orientation outside of the other two."""
    robot = ours(MSSM)
    for radius in (0.5, 2.0):
        found = {name: accessible(robot, place(radius, 0.2), name, 16).volume.sum() for name in DEFINITIONS}
        for a, b in itertools.combinations(found.values(), 2):
            assert a == pytest.approx(b, rel=0.06), found


def test_no_way_leads_through_touching_cables():
    """Steps of pi / 12 and pi / 24 have orientations where cables just touch, with gaps of rounding errors."""
    robot, there = ours(MSSM), place(1.5, 0.0)
    plain = accessible(robot, there, "grid", 16).volume.sum()
    for definition, divisions in (("grid", 12), ("grid", 24), ("equal-volume", 24)):
        assert accessible(robot, there, definition, divisions).volume.sum() == pytest.approx(plain, rel=0.03)


def test_the_accessible_volume_beside_random_orientations():
    """A random roadmap, which knows no grid: its part of 20,000 orientations is the volume, within its error."""
    count, robot = 20_000, ours(MSSM)
    some = Rotation.random(count - 1, random_state=3).as_quat(scalar_first=True)
    every = np.concatenate([np.eye(4)[:1], some])
    step = (8.0 * math.pi**2 / count) ** (1.0 / 3.0)
    tree = cKDTree(np.concatenate([every, -every]))
    pairs = tree.query_pairs(2.0 * math.sin(0.25 * 1.5 * step), output_type="ndarray") % count
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    for there in (place(1.5, 0.0), place(3.0, 1.2)):
        watch = Watch(robot, there)
        sights = watch.at(every)
        way = pairs[watch.passable(sights, *pairs.T)]
        links = coo_matrix((np.ones(len(way), bool), way.T), shape=(count, count))
        part = connected_components(links, directed=False)[1]
        share = ((part == part[0]) & watch.regular(sights)).mean()
        error = math.sqrt(share * (1.0 - share) / count)
        volume = accessible(robot, there, "equal-volume", 32).volume.sum()
        assert share == pytest.approx(volume, abs=3.0 * error)


def test_nothing_is_accessible_above_the_spools():
    for definition in DEFINITIONS:
        assert len(accessible(ours(MSSM), place(1.0, 0.0, -0.5), definition, 8).angles) == 0


def test_attained_orientations():
    """More arcs allowed attain no fewer, and the same numbers where found; margins are positive where attained."""
    robot = ours(MSSM)
    checker = PoseChecker(PoseShared(robot, Limits(), named("effective-c3", 0.1)), Kind(from_rest=True))
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
    checker = PoseChecker(PoseShared(robot, Limits(), named("effective-c3", 0.1)), Kind(from_rest=True))
    many, z0 = np.tile(there, (len(angles), 1)), np.full(len(angles), 1.7)
    once, twice = (
        attainable(checker, many, angles, z0, max_arcs=8, values=4, found=found) for found in (symmetries(robot), NONE)
    )
    assert (once.arcs == twice.arcs).all()
    np.testing.assert_allclose(once.margin[once.arcs > 0], twice.margin[once.arcs > 0], atol=1e-6)


def test_a_dip_beside_a_singularity():
    """A tension that is negative for a thousandth of the motion, near a nearly singular end: four arcs are too few."""
    robot, there, angles = ours(MSSM), place(1.5, math.pi / 2.0), np.array([[0.67737013, 0.40312747, -1.6689711]])
    checker = PoseChecker(PoseShared(robot, Limits(), named("effective-c3", 0.1)), Kind(from_rest=True))
    found = attainable(checker, there[None], angles, np.array([1.7]), max_arcs=8, values=4)
    turned = from_tilt_torsion(angles[0] + np.array([math.pi / 2.0, 0.0, 0.0]))
    way = (np.array([0.0, 0.0, 1.7]), there, 1.7, np.eye(4)[0], turned)
    segment = oracle.Segment(*way, amplitude=oracle.effective_c3(0.1))
    judged = {p: oracle.check_motion(MSSM, segment, p, tuple(found.beta_hat[0]), 20001) for p in (4, 5)}
    assert judged[4]["mu_hat_min"] < -0.5 and judged[5]["feasible"]
    assert found.arcs[0] == 5 and found.margin[0] == pytest.approx(judged[5]["mu_hat_min"], abs=1e-4)


def test_tables_of_orientations(tmp_path, monkeypatch):
    """Their cells, with a coarse step; options that do not belong are refused."""
    monkeypatch.setattr(orientation_tables, "DIVISIONS", 8)
    code, out, err = cspr("table", "3.3", "--json", "--definition", "grid")
    assert code == 0, err
    cells = json.loads(out)["cells"]
    assert len(cells) == 32 and {c["variant"]["definition"] for c in cells} == {"grid"}
    by = {(c["row"], c["column"]): c for c in cells}
    for row in ("x = 1.5b", "y = 1.5b"):
        share = by[row, "attainable"]["computed"] / by[row, "accessible"]["computed"]
        assert 100.0 * share == pytest.approx(by[row, "proportion"]["computed"])
        assert by[row, "proportion"]["computed"] == pytest.approx(by[row, "proportion"]["published"], abs=4.0)
    code, _, err = cspr("table", "2.1", "--fine")
    assert code == 2 and err == "cspr: --fine: must be absent with table 2.1\n"


SWEEP = """schema = 1
map = "attainability"
robot = "laval-mssm"
[axes]
z = [1.7]
radius = [1.29]
azimuth = [0.2, 0.8471975511965976, 1.5]
[trajectory]
family = "hypocycloid"
amplitude = { name = "effective-c3", epsilon = 0.1 }
max_arcs = 8
[orientations]
divisions = 6
values = 4
"""


def swept(folder, *change):
    (folder / "places.toml").write_text(SWEEP.replace(*change) if change else SWEEP)
    return cspr("run", folder / "places.toml", "-o", folder / "run")


def test_maps_of_places(tmp_path):
    """Cells are what the functions give; the mirrored place has the same numbers."""
    code, out, err = swept(tmp_path)
    assert code == 0, err
    data = {name: values[0, 0] for name, values in open_result(Path(out.split()[-1])).data.items()}
    checker = PoseChecker(PoseShared(ours(MSSM), Limits(), named("effective-c3", 0.1)), Kind(from_rest=True))
    for i, azimuth in enumerate((0.2, 0.8471975511965976, 1.5)):
        there = place(1.5, azimuth)
        inside = accessible(ours(MSSM), there, "scan", 6)
        many, z0 = np.tile(there, (len(inside.angles), 1)), np.full(len(inside.angles), 1.7)
        good = attainable(checker, many, inside.angles, z0, max_arcs=8, values=4).arcs > 0
        assert data["accessible"][i] == len(good) and data["attainable"][i] == good.sum()
        assert data["accessible_volume"][i] == pytest.approx(inside.volume.sum(), rel=1e-9)
        assert data["attainable_fraction"][i] == pytest.approx(good.mean())
    for values in data.values():
        assert values[0] == pytest.approx(values[1], nan_ok=True)  # 0.847 is 60 degrees less 0.2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('"laval-mssm"', '"prototype"'), "must be a platform"),
        (("z = [1.7]", "z = [1.7]\ntilt = [0.1]"), "axes.tilt: must be absent"),
        (("max_arcs = 8", "max_arcs = 8\nfrom = { position = [0.0, 0.1, 1.0] }"), "trajectory.from: must be"),
        (('"hypocycloid"', '"transition"'), "trajectory.family"),
        (("divisions = 6", "divisions = 1"), "orientations.divisions = 1"),
        (("divisions = 6", "divisions = 7"), "orientations.divisions = 7: must be a multiple of 2"),
        (('map = "attainability"', 'map = "orientation-workspace"'), "orientations.values: must be absent"),
        (
            ('map = "attainability"', 'map = "orientation-workspace"\nlimits = { floor = 3.0 }'),
            "limits: must be absent",
        ),
        (('map = "attainability"', 'map = "poses"'), "orientations: must be absent"),
        (("z = [1.7]", "z = [-1.7]"), "every point is above the spool plane"),
    ],
)
def test_mistakes(tmp_path, change, words):
    code, out, err = swept(tmp_path, *change)
    assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err


EACH = """schema = 1
map = "orientations"
robot = {robot}
[axes]
x = [{x}]
y = [{y}]
z = [{z}]
[trajectory]
family = "hypocycloid"
amplitude = {{ name = "effective-c3", epsilon = 0.1 }}
max_arcs = 8
[orientations]
divisions = 6
values = 4
"""


def every_orientation(folder, name, **keys):
    (folder / f"{name}.toml").write_text(EACH.format(**keys))
    code, out, err = cspr("run", folder / f"{name}.toml", "-o", folder / name)
    assert code == 0, err
    return Path(out.split()[-1])


def test_a_map_of_every_orientation(tmp_path):
    """Its cells are those of the functions; in axes turned over phi and sigma are turned around."""
    there = place(1.5, 0.7)
    at = dict(zip("xyz", there, strict=True))
    result = open_result(every_orientation(tmp_path, "down", robot='"laval-mssm"', **at))
    assert list(result.axes) == ["x", "y", "z", "torsion", "tilt_azimuth", "tilt"]
    arcs, verdict = (result.data[name][0, 0, 0] for name in ("arcs", "verdict"))
    assert verdict.shape == (12, 12, 6)
    inside = accessible(ours(MSSM), there, "grid", 6)
    seen = (verdict & Verdict.NOT_ACCESSIBLE.value) == 0
    assert seen[:, :, 1:].sum() + seen[:, 0, 0].sum() == len(inside.angles)
    sigma, phi, theta = (result.axes[name] for name in ("torsion", "tilt_azimuth", "tilt"))
    checker = PoseChecker(PoseShared(ours(MSSM), Limits(), named("effective-c3", 0.1)), Kind(from_rest=True))
    some = np.argwhere(seen)[::7]
    angles = np.array([[phi[j], theta[k], sigma[i]] for i, j, k in some])
    many, z0 = np.tile(there, (len(some), 1)), np.full(len(some), 1.7)
    found = attainable(checker, many, angles, z0, max_arcs=8, values=4)
    assert (found.arcs == arcs[tuple(some.T)]).all() and (found.verdict == verdict[tuple(some.T)]).all()
    assert (arcs > 0).sum() > 0.8 * seen.sum()
    # The same robot, z up: phi becomes -phi, sigma -sigma.
    up = open_result(every_orientation(tmp_path, "up", robot=_turned_over(), x=at["x"], y=-at["y"], z=-at["z"]))
    around, mirrored = -np.arange(12) % 12, np.array([*range(10, -1, -1), 11])
    assert (up.data["arcs"][0, 0, 0][mirrored][:, around] == arcs).all()


def _turned_over():
    over = np.array([1.0, -1.0, -1.0])
    base, points = ((np.asarray(x) * over).tolist() for x in (MSSM.base, MSSM.platform))
    inertia = (np.asarray(MSSM.inertia) * np.outer(over, over)).tolist()
    return (
        f'{{ name = "over", z_axis = "up", base_points = {base}, platform_points = {points}, '
        f"mass = {float(MSSM.mass)}, inertia = {inertia} }}"
    )


def test_pictures_of_every_orientation(tmp_path):
    path = every_orientation(tmp_path, "down", robot='"laval-mssm"', x=1.0, y=0.5, z=1.7)
    for options in (["--envelope"], ["--quantity", "verdict"], ["--envelope", "--at", "x=1.0"], []):
        picture = tmp_path / "picture.png"
        code, _, err = cspr("plot", path, "-o", picture, *options)
        assert code == 0 and picture.stat().st_size > 20_000, err
    for options, words in (
        (["--envelope", "--quantity", "arcs"], "--quantity"),
        (["--envelope", "--at", "tilt=0.1"], "--at"),
        (["--envelope", "--lines", "tilt"], "--lines"),
    ):
        code, _, err = cspr("plot", path, "-o", picture, *options)
        assert code == 2 and words in err and len(err.splitlines()) == 1, err


def test_a_map_of_every_orientation_has_its_own_grid(tmp_path):
    text = EACH.format(robot='"laval-mssm"', x=1.0, y=0.5, z=1.7)
    for change, words in (
        (("divisions = 6", 'divisions = 6\ndefinition = "scan"'), 'orientations.definition = "scan": must be "grid"'),
        (("z = [1.7]", "z = [1.7]\ntilt = [0.1]"), "axes.tilt: must be absent"),
    ):
        (tmp_path / "wrong.toml").write_text(text.replace(*change))
        code, out, err = cspr("run", tmp_path / "wrong.toml", "-o", tmp_path / "run")
        assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err


def test_reasons_are_told_apart():
    """One colour and word a cell, what lies deeper first."""
    flags = [0, Verdict.NO_ARCS | Verdict.SLACK_CABLE, Verdict.SLACK_CABLE | Verdict.SINGULAR, Verdict.NOT_ACCESSIBLE]
    found, words, colours = reasons(np.array([int(flag) for flag in [*flags, Verdict.FEWER_ARCS_UNDECIDED]]))
    assert [words[i] for i in found] == ["feasible", "slack cable", "singular", "not accessible", "feasible"]
    assert len(set(colours)) == len(colours) == 4


def test_a_map_of_what_is_accessible(tmp_path):
    text = SWEEP.replace('"attainability"', '"orientation-workspace"').replace("values = 4\n", "")
    (tmp_path / "places.toml").write_text(text)
    code, out, err = cspr("run", tmp_path / "places.toml", "-o", tmp_path / "run")
    assert code == 0, err
    data = open_result(Path(out.split()[-1])).data
    assert "attainable" not in data and (data["accessible"] > 0).all()


@pytest.mark.soak
def test_verdicts_are_the_oracle_s():
    """2,000 random orientations: the smallest number of arcs, over all values of beta-hat, is the oracle's."""
    robot, rng, close, attained = ours(MSSM), np.random.default_rng(21), 0, 0
    checker = PoseChecker(PoseShared(robot, Limits(), named("effective-c3", 0.1)), Kind(from_rest=True), batch=1024)
    for radius, azimuth in ((1.5, 0.0), (3.0, 0.0), (1.5, math.pi / 2.0), (2.2, 0.4)):
        there = place(radius, azimuth)
        angles = accessible(robot, there, "scan", 32).angles
        angles = angles[rng.choice(len(angles), 500, replace=False)]
        many, z0 = np.tile(there, (500, 1)), np.full(500, 1.7)
        found = attainable(checker, many, angles, z0, max_arcs=8, values=6)
        turned = from_tilt_torsion(angles + np.array([azimuth, 0.0, 0.0]))
        values = end_options(robot, many, turned, z0, 6)[0]
        for i in range(500):
            way = (np.array([0.0, 0.0, 1.7]), there, 1.7, np.eye(4)[0], turned[i])
            segment, p = oracle.Segment(*way, amplitude=oracle.effective_c3(0.1)), int(found.arcs[i])
            attained += p > 0
            if p:
                assert oracle.check_motion(MSSM, segment, p, tuple(found.beta_hat[i]), 4001)["feasible"], (radius, i)
            for fewer in range(1, p or 9):
                for value in values[i][~np.isnan(values[i])]:
                    # What the oracle's few samples let pass is looked at with many.
                    if oracle.check_motion(MSSM, segment, fewer, (-1.0, value), 301)["feasible"]:
                        judged = oracle.check_motion(MSSM, segment, fewer, (-1.0, value), 40001)
                        close += judged["feasible"]
                        assert not judged["feasible"] or judged["mu_hat_min"] < 1e-4, (radius, i, fewer, value)
    assert close < 3 and 1500 < attained < 2000
