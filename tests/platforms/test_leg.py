"""Plans of a six-cable platform: verdicts beside the oracle, symmetries, Table 3.2, motions, mistakes."""

import csv
import dataclasses
import itertools
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import platform as oracle
from support.commands import cspr, plan
from support.platforms import (
    CHECKED,
    FROM_REST,
    MSSM,
    SHORT,
    Z0,
    checker_of,
    limits_of,
    made,
    margin_of,
    ours,
    random_pose,
    stacked,
)

import cspr_jax
from cspr_jax.families.platforms.arcs import Candidates, smallest_arcs
from cspr_jax.families.platforms.beta_hat import LARGEST, cheapest_path, options
from cspr_jax.families.platforms.platform_segment import motion
from cspr_jax.families.platforms.six_cable_proof import pose_proof
from cspr_jax.families.platforms.six_cable_proof.checker import PlatformChecker
from cspr_jax.families.platforms.six_cable_proof.slacks import pose_slacks
from cspr_jax.motion.amplitudes import named
from cspr_jax.published import table_3_2
from cspr_jax.robots.contacts.interference import cable_directions, cables_cross, contacts, gaps, platform_hit
from cspr_jax.schema.verdicts import Verdict


@pytest.fixture(scope="module")
def checker():
    """Of the MSSM, with the function that has no jumps."""
    return checker_of()


def checked(checker, cases):
    """Checks of motions (start, end, values of beta-hat, number of arcs), all at once."""
    some = [made(checker.problem.robot, start, end, Z0, beta_hats, p) for start, end, beta_hats, p in cases]
    return checker.check(stacked(some), np.array([p for *_, p in cases]))


def near_pose(rng):
    position = np.array([*rng.uniform(-1.3, 1.3, 2), rng.uniform(0.9, 1.8)])
    return position, oracle.pose_quaternion(position, rng.uniform([-np.pi, 0.0, -1.2], [np.pi, 1.3, 1.2]))


def random_cases(seed, count, *, lowest, highest, arcs):
    """Motions between near poses."""
    rng = np.random.default_rng(seed)
    return [
        (near_pose(rng), near_pose(rng), tuple(rng.uniform(lowest, highest, 2)), int(rng.integers(*arcs)))
        for _ in range(count)
    ]


def test_verdicts_are_the_oracle_s(checker):
    """Of random motions, at 4001 samples; margins and distances too, where the motion is not singular."""
    check_verdicts(checker, 9)


@pytest.mark.soak
def test_verdicts_are_the_oracle_s_all(checker):
    check_verdicts(checker, 48)


def check_verdicts(checker, count):
    """Beside the oracle."""
    rng, cases, seen = np.random.default_rng(11), [], set()
    for i in range(count):
        p = int(rng.integers(2, 10))
        start, end = random_pose(rng, rest=True) if i % 2 else near_pose(rng), near_pose(rng)
        cases.append((start, end, (-1.0 if i % 2 else rng.uniform(-6.0, 1.0), rng.uniform(-6.0, 1.0)), p))
    found = checked(checker, cases)
    for i, (start, end, beta_hats, p) in enumerate(cases):
        segment = oracle.Segment(start[0], end[0], Z0, start[1], end[1], amplitude=oracle.effective_c3(0.1))
        wanted = oracle.check_motion(MSSM, segment, p, beta_hats, 4001)
        verdict = Verdict(int(found.verdict[i]))
        seen |= {flag for flag in Verdict if flag & verdict} | ({None} if verdict == 0 else set())
        assert (verdict == 0) == wanted["feasible"], (i, verdict.text)
        assert bool(verdict & Verdict.CABLE_CABLE) == wanted["cable_cable"]
        assert bool(verdict & Verdict.CABLE_PLATFORM) == wanted["cable_platform"]
        if wanted["det_min"] > 0.0:
            assert found.slack[i, 0] == pytest.approx(wanted["mu_hat_min"], rel=2e-3, abs=2e-3)
            assert found.slack[i, 0] <= wanted["mu_hat_min"] + 1e-9
        if wanted["feasible"]:  # samples of arcs alone would miss it by more
            assert found.slack[i, 0] == pytest.approx(wanted["mu_hat_min"], abs=2e-5)
        assert found.gap[i] == pytest.approx(wanted["cable_distance_min"], abs=2e-4)
    assert {None, Verdict.SLACK_CABLE, Verdict.SINGULAR} <= seen


@pytest.mark.soak
def test_verdicts_do_not_change_with_more_blocks(checker, monkeypatch):
    cases = random_cases(12, 40, lowest=-5.0, highest=0.0, arcs=(3, 9))
    before = checked(checker, cases)
    for name, parts in (("tension_proof.FROM_REST", 7), ("tension_proof.BETWEEN", 19), ("pose_proof.PARTS", 9)):
        monkeypatch.setattr(f"cspr_jax.families.platforms.six_cable_proof.{name}", parts)
    after = checked(checker, cases)
    np.testing.assert_array_equal(after.verdict, before.verdict)
    regular = after.slack[:, 1] > 0.0
    np.testing.assert_allclose(after.slack[regular], before.slack[regular], atol=1e-6)
    np.testing.assert_allclose(after.gap[regular], before.gap[regular], atol=1e-6)
    assert regular.sum() > 10


@jax.jit
def everything(problem, pairs, segment, arcs, tau):
    """All criteria, the vectors between cables, and the directions of cables, by the readable functions."""

    def one(t):
        pose = motion(segment, problem.amplitude, arcs, t)
        where = (problem.robot, pose.position, pose.rotation)
        slack = pose_slacks(problem, pose, problem.robot.gravity / segment.rate, segment.regular)
        return slack, gaps(problem.robot, pairs, *where[1:]), cable_directions(*where)

    return jax.vmap(one)(tau)


@pytest.mark.soak
def test_verdicts_against_dense_samples(checker):
    """5,000 random motions against 20,001 samples: the same verdict, but where it is undecided."""
    rng, cases = np.random.default_rng(16), []
    for i in range(5000):
        p = int(rng.integers(2, 13))
        start = random_pose(rng, rest=True) if i % 2 else near_pose(rng)
        cases.append((start, near_pose(rng), (-1.0 if i % 2 else rng.uniform(-8.0, 2.0), rng.uniform(-8.0, 2.0)), p))
    robot, near = checker.problem.robot, contacts(checker.problem.robot)
    some = [made(robot, start, end, Z0, beta_hats, p) for start, end, beta_hats, p in cases]
    verdicts = checked(checker, cases).verdict
    tau, good = np.linspace(0.0, 1.0, 20_001), 0
    for i, (segment, (*_, p), verdict) in enumerate(zip(some, cases, verdicts, strict=True)):
        if verdict & Verdict.UNDECIDED:
            continue
        found = everything(checker.problem, jnp.asarray(near.pairs), segment, float(p), tau)
        slack, gap, direction = (np.asarray(x) for x in found)
        dense = (slack > 0.0).all() and not cables_cross(gap[:-1], gap[1:]).any()
        dense = dense and not platform_hit(near.sides, near.normal, direction[:-1], direction[1:]).any()
        assert (verdict == 0) == dense, (i, Verdict(int(verdict)).text, slack.min(0))
        good += dense
    assert ((verdicts & Verdict.UNDECIDED) != 0).sum() < 5 and good > 500, good


@pytest.mark.thorough
def test_blocks_are_halved_where_cables_turn(checker, monkeypatch):
    """With one block an arc what interferes is still what it is with four; which contact is found first may differ."""
    cases = random_cases(17, 60, lowest=-8.0, highest=1.0, arcs=(2, 6))
    flags = Verdict.CABLE_CABLE.value | Verdict.CABLE_PLATFORM.value
    before = checked(checker, cases).verdict & flags
    monkeypatch.setattr(pose_proof, "PARTS", 1)
    np.testing.assert_array_equal((checked(checker, cases).verdict & flags) > 0, before > 0)
    assert (before > 0).sum() > 3


@pytest.mark.thorough
def test_what_stays_undecided_is_said(checker, monkeypatch):
    """A smaller number of arcs that cannot be told leaves a flag; where nothing else is found, it is the answer."""
    start, end = (random_pose(np.random.default_rng(1), rest=True), (np.array([1.0, 0.0, 1.4]), np.eye(4)[0]))
    one = Candidates(*jax.tree.map(lambda x: np.asarray(x)[None], (start, end, Z0, 0, (-1.0, -1.0))))
    plain = smallest_arcs(checker, one, max_arcs=8)
    p = int(plain.arcs[0])
    assert p > 0 and not plain.undecided.any()
    whole = PlatformChecker.check

    def unsure(self, segments, arcs, **keys):
        found = whole(self, segments, arcs, **keys)
        at_first = np.where(arcs == p, Verdict.UNDECIDED.value, found.verdict)
        return dataclasses.replace(found, verdict=at_first)

    monkeypatch.setattr(PlatformChecker, "check", unsure)
    found = smallest_arcs(checker, one, max_arcs=p)
    assert found.arcs[0] == 0 and found.undecided[0] == p
    more = smallest_arcs(checker, one, max_arcs=p + 4)
    assert more.arcs[0] > p and more.undecided[0] == p


def rotated(pose, angle):
    c, s = np.cos(angle), np.sin(angle)
    half = np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
    position = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ pose[0]
    return position, oracle.product(oracle.product(half, pose[1]), oracle.conjugate(half))


def mirrored(pose):
    return pose[0] * [-1.0, 1.0, 1.0], pose[1] * [1.0, 1.0, -1.0, -1.0]


@pytest.mark.soak
def test_symmetries_of_the_mssm():
    """A third of a turn, the mirror x -> -x, and time reversed change no verdict and no margin."""
    checker = checker_of(amplitude=named("quintic"), batch=256)
    cases = random_cases(13, 12, lowest=-5.0, highest=0.0, arcs=(3, 9))
    plain, third = checked(checker, cases), 2.0 * np.pi / 3.0
    regular = plain.slack[:, 1] > 0.0
    assert regular.sum() > 3
    for others in (
        [(rotated(start, third), rotated(end, third), beta_hats, p) for start, end, beta_hats, p in cases],
        [(mirrored(start), mirrored(end), beta_hats, p) for start, end, beta_hats, p in cases],
        [(end, start, beta_hats[::-1], p) for start, end, beta_hats, p in cases],
    ):
        other = checked(checker, others)
        np.testing.assert_array_equal(other.verdict, plain.verdict)
        np.testing.assert_allclose(other.slack[regular], plain.slack[regular], atol=1e-7)
        np.testing.assert_allclose(other.gap[regular], plain.gap[regular], atol=1e-7)


@pytest.mark.thorough
def test_limits_of_a_platform():
    """Each limit, set to just beyond and just within what a motion asks for, the others loose but there."""
    rng = np.random.default_rng(14)
    start, end = random_pose(rng, rest=True), (np.array([0.9, 0.6, 1.3]), np.array([1.0, 0.0, 0.0, 0.0]))
    segment = oracle.Segment(start[0], end[0], Z0, start[1], end[1], amplitude=oracle.effective_c3(0.1))
    motion = oracle.motion(MSSM, segment, 5, (-1.0, -1.0), np.linspace(0, 1, 4001))
    where = MSSM, motion.position, motion.rotation
    pull = oracle.wrench(MSSM, motion.rotation, motion.acceleration, motion.omega, motion.omega_dot)
    tensions = oracle.tensions(*where, oracle.force_ratios(*where, pull))
    cables, arms = oracle.cables(*where), MSSM.platform @ np.swapaxes(motion.rotation, 1, 2)
    omega, omega_dot = motion.omega[:, None], motion.omega_dot[:, None]
    pace = motion.velocity[:, None] + np.cross(omega, arms)
    second_derivative = (
        motion.acceleration[:, None] + np.cross(omega_dot, arms) + np.cross(omega, np.cross(omega, arms))
    )
    lengths = np.linalg.norm(cables, axis=-1)
    speeds = (cables * pace).sum(-1) / lengths
    bends = ((pace * pace + cables * second_derivative).sum(-1) - speeds**2) / lengths
    values = {
        "tension_min": tensions.min(),
        "tension_max": tensions.max(),
        "floor": motion.position[:, 2].max(),
        "cable_length_max": lengths.max(),
        "cable_speed_max": np.abs(speeds).max(),
        "cable_acceleration_max": np.abs(bends).max(),
    }
    loose = {row.name: values[row.name] * (2.0 if row.sense == "most" else 0.5) for row in CHECKED}
    for row in CHECKED:
        for factor, broken in ((0.999, row.sense == "most"), (1.001, row.sense == "least")):
            limits = limits_of(**loose | {row.name: values[row.name] * factor})
            found = checked(checker_of(kind=FROM_REST, limits=limits), [(start, end, (-1.0, -1.0), 5)])
            assert Verdict(int(found.verdict[0])) == (row.flag if broken else 0), row.name


def test_vectors_between_cables_and_hits():
    """Against the oracle, pair by pair and step by step."""
    robot, rng = ours(MSSM), np.random.default_rng(15)
    near = contacts(robot)
    pairs = oracle.colliding_pairs(MSSM)
    order = [[tuple(pair) for pair in near.pairs.tolist()].index(pair) for pair in pairs]
    poses = [random_pose(rng) for _ in range(300)]
    position = np.array([p for p, _ in poses])
    rotation = np.array([oracle.matrix(q) for _, q in poses])
    vectors, of_cables = (
        jax.jit(jax.vmap(lambda p, r: gaps(robot, near.pairs, p, r))),
        jax.jit(jax.vmap(lambda p, r: cable_directions(robot, p, r))),
    )
    found = np.asarray(vectors(position, rotation))[:, order]
    shortest, _ = oracle.cable_vectors(MSSM, position, rotation)
    lengths = np.linalg.norm(np.asarray(shortest).reshape(found.shape), axis=-1)
    np.testing.assert_allclose(np.linalg.norm(found, axis=2), lengths, atol=1e-9)
    step = np.array([np.cos(0.1), *(np.sin(0.1) * np.array([0.6, 0.0, 0.8]))])
    after = np.array([oracle.matrix(oracle.product(q, step)) for _, q in poses])
    seen = [np.asarray(of_cables(position, r)) for r in (rotation, after)]
    hits = platform_hit(near.sides, near.normal, *seen).any(1)
    wanted = [
        bool(np.any(oracle.platform_hit(MSSM, np.stack([p, p]), np.stack([a, b]))))
        for p, a, b in zip(position, rotation, after, strict=True)
    ]
    assert hits.tolist() == wanted and 3 < sum(wanted) < 200


@given(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(-30.0, 30.0))
def test_values_of_beta_hat(preferred, low, high):
    """All within the interval, the preferred one first if it is, the others by their distance from the first."""
    found = options(np.array([preferred]), np.array([low]), np.array([high]))[0]
    assert np.isnan(found).all() or not np.isnan(found[0])
    found = found[~np.isnan(found)]
    if not len(found):
        assert not low < high or not max(low, -LARGEST) < min(high, LARGEST)
        return
    assert ((found >= low) & (found <= high)).all()
    if low < preferred < high:
        assert found[0] == preferred
    gaps_to_first = np.abs(found[1:] - found[0])
    assert (np.diff(gaps_to_first) >= -1e-9).all()


@given(st.integers(1, 4), st.integers(0, 10_000))
def test_the_cheapest_path(segments, seed):
    """Against all paths: fewest infeasible segments, then the smallest sum."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 4, segments + 1)
    costs = [
        np.where(rng.random((a, b)) < 0.3, np.inf, rng.integers(1, 9, (a, b)).astype(float))
        for a, b in itertools.pairwise(sizes)
    ]

    def price(path):
        values = [cost[i, j] for cost, (i, j) in zip(costs, itertools.pairwise(path), strict=True)]
        return sum(np.isinf(v) for v in values), sum(v for v in values if np.isfinite(v))

    best = min(price(path) for path in itertools.product(*(range(n) for n in sizes)))
    assert price(cheapest_path(costs)) == best


def cells_of_table_3_2():
    code, out, _ = cspr("table", "3.2", "--json")
    assert code == 0
    return json.loads(out)["cells"]


@pytest.mark.thorough
def test_table_3_2(monkeypatch):
    """Every printed row, with the function that has no jumps; pose 2 as printed has none."""
    monkeypatch.setattr(table_3_2, "_AMPLITUDES", {"effective-c3 0.1": {"name": "effective-c3", "epsilon": 0.1}})
    check_table_3_2(cells_of_table_3_2())


@pytest.mark.soak
def test_table_3_2_in_full():
    """A_eff gives the printed rows too; the quintic of the text needs more."""
    cells = cells_of_table_3_2()
    check_table_3_2(cells)
    assert {c["variant"]["amplitude"] for c in cells} == {"quintic", "effective 0.1", "effective-c3 0.1"}


def check_table_3_2(cells):
    """Printed beside computed."""
    assert all(cell["published"] is not None for cell in cells)
    for cell in cells:
        amplitude, pose = cell["variant"]["amplitude"], cell["variant"]["pose_2"]
        if pose != "pi/3" and cell["row"] in "12":
            assert cell["computed"] is None  # pose 2 as printed cannot be reached, nor left
        elif amplitude != "quintic" and cell["row"] == "5":  # printed 13: fewer arcs do
            assert (cell["column"], cell["published"], cell["computed"]) in (
                ("p", 13, 7),
                ("T", 15.4236, pytest.approx(8.2986, abs=1e-3)),
            )
        elif amplitude != "quintic":
            assert cell["computed"] == pytest.approx(cell["published"], abs=1e-3 if cell["column"] == "T" else 0)
        elif cell["column"] == "p":
            assert cell["computed"] == {"0": 12, "1": 9, "2": 9, "3": 12, "6": 5}.get(cell["row"])
    found = [c["computed"] for c in cells if c["column"] == "p" and c["variant"]["pose_2"] == "pi/3"]
    assert found[-7:] == [8, 9, 9, 12, 9, 7, 4]


@pytest.mark.thorough
def test_a_free_beta_hat_needs_no_more_arcs(tmp_path):
    free = "\n".join(line for line in SHORT.splitlines() if not line.startswith("beta_hat"))
    found = [json.loads(plan(tmp_path, text, "--json")[1]) for text in (SHORT, free)]
    assert found[1]["feasible"] and found[1]["total_duration"] <= found[0]["total_duration"] + 1e-9
    ends = [s["beta_hat"] for s in found[1]["segments"]]
    assert ends[0][1] == ends[1][0] and ends[0][0] == ends[1][1] == -1.0


@pytest.mark.thorough
def test_the_motion(tmp_path):
    """Columns, the oracle's numbers, and no jump of acceleration, angular acceleration and tension between segments."""
    code, out, err = plan(tmp_path, SHORT, "--json", "-o", tmp_path / "motion.csv")
    found = json.loads(out)
    assert (code, err) == (0, "") and [s["cable_interference"] for s in found["segments"]] == [False, False]
    lines = (tmp_path / "motion.csv").read_text().splitlines()
    heads, *rows = csv.reader(line for line in lines if line[0] != "#")
    vectors = [f"{n}_{k}" for n in ("position", "velocity", "acceleration") for k in "xyz"]
    turns = [*(f"quaternion_{k}" for k in "wxyz"), *(f"{n}_{k}" for n in ("omega", "omega_dot") for k in "xyz")]
    of_cables = [f"{n}_{k}" for n in ("length", "rate", "tension") for k in range(1, 7)]
    assert heads == ["t", *vectors, *turns, *of_cables, "binding", "binding_cable"]
    table = dict(zip(heads, np.array(rows, float).T, strict=True))
    tau, target = np.linspace(0.0, 1.0, 400), np.array([0.0, 1.732, 1.7])
    orientation = oracle.pose_quaternion(target, (np.pi / 2, -np.pi / 6, 0.0))
    rest = np.array([0.0, 0.0, 1.4]), np.array([1.0, 0.0, 0.0, 0.0])
    for i, segment in enumerate(found["segments"]):
        ends = (rest, (target, orientation))[:: 1 if i == 0 else -1]
        made_of = oracle.Segment(
            ends[0][0], ends[1][0], 1.4, ends[0][1], ends[1][1], amplitude=oracle.effective_c3(0.1)
        )
        wanted = oracle.motion(MSSM, made_of, segment["arcs"], segment["beta_hat"], tau)
        part = {name: column[400 * i : 400 * (i + 1)] for name, column in table.items()}
        for name, values in (("position", wanted.position), ("acceleration", wanted.acceleration)):
            np.testing.assert_allclose(np.stack([part[f"{name}_{k}"] for k in "xyz"], 1), values, atol=1e-8)
        np.testing.assert_allclose(np.stack([part[f"omega_dot_{k}"] for k in "xyz"], 1), wanted.omega_dot, atol=1e-7)
        turn = np.stack([part[f"quaternion_{k}"] for k in "wxyz"], 1)
        np.testing.assert_allclose([oracle.matrix(q) for q in turn], wanted.rotation, atol=1e-9)
        lowest = min(part[f"tension_{k}"].min() for k in range(1, 7))
        assert 0.0 < segment["tension_min"] <= lowest + 1e-9 and segment["tension_min"] > 0.95 * lowest
    for name in (*vectors, *(f"omega_dot_{k}" for k in "xyz"), *(f"tension_{k}" for k in range(1, 7))):
        assert table[name][399] == pytest.approx(table[name][400], abs=1e-8), name


@pytest.mark.thorough
def test_margins_beside_samples(tmp_path):
    """Of a segment from Python: its samples do not lie below the refined margin, and come near it."""
    (tmp_path / "plan.toml").write_text(SHORT)
    plan = cspr_jax.plan(tmp_path / "plan.toml")
    smallest = np.minimum(plan.answers.margin[0], plan.answers.det_margin[0])
    found = float(margin_of(plan.problem, plan.motions[0], 4000))
    assert smallest - 1e-9 <= found <= smallest + 1e-3


def test_an_upward_z_axis(tmp_path):
    """The same robot and poses described with z up: a rotation by half a turn about x."""
    base, platform = (np.round(x * [1.0, -1.0, -1.0], 15).tolist() for x in (MSSM.base, MSSM.platform))
    robot = f'{{ name = "up", mass = 1.0, z_axis = "up", base_points = {base}, platform_points = {platform}, '
    robot += f"inertia = {MSSM.inertia.tolist()} }}"
    text = SHORT.replace('"laval-mssm"', robot).replace("[0.0, 1.732, 1.7]", "[0.0, -1.732, -1.7]")
    down, q = SHORT, oracle.pose_quaternion([0.0, 1.732, 1.7], (np.pi / 2, -np.pi / 6, 0.0))
    old = next(line for line in text.splitlines() if line.startswith("tilt_torsion"))
    text = text.replace(old, f"quaternion = {(q * [1, 1, -1, -1]).tolist()}")
    found = [json.loads(plan(tmp_path, t, "--json")[1]) for t in (down, text)]
    for a, b in zip(found[0]["segments"], found[1]["segments"], strict=True):
        assert a["arcs"] == b["arcs"] and a["margin"] == pytest.approx(b["margin"], rel=1e-6)
        assert a["z_lowest"] == pytest.approx(-b["z_lowest"])


@pytest.mark.soak
def test_jumps_are_named(tmp_path):
    text = SHORT.replace('"effective-c3"', '"effective"')
    code, _, err = plan(tmp_path, text)
    assert code == 0 and "jump" in err and len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('"hypocycloid"', '"transition"'), 'family = "transition": must be'),
        (("tilt_torsion", "quaternion = [1.0, 0.0, 0.0, 0.0]\ntilt_torsion"), "cannot be combined with tilt_torsion"),
        (("rest = true", "rest = true\ntilt_torsion = [0.0, 0.1, 0.0]"), "reference orientation at rest"),
        (("rest = true", "rest = true\nposition = [0.1, 0.0, 1.4]"), "must be P0"),
        (("[0.0, 1.732, 1.7]", "[0.0, 1.732, -0.1]"), "pose[1].position: must be below the spool plane"),
        (("[1.5707963267948966, -0.5235987755982988, 0.0]", "[0.0, 0.0, 1.5707963267948966]"), "singular there"),
        (("beta_hat = -14.6701", "beta_hat = -1000.0"), "beta_hat = -1000.0"),
        (('"laval-mssm"', '"prototype"'), "for a point mass"),
    ],
)
def test_mistakes(tmp_path, change, words):
    assert change[0] in SHORT
    code, out, err = plan(tmp_path, SHORT.replace(*change, 1), "-o", tmp_path / "motion.csv")
    assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err
    assert not (tmp_path / "motion.csv").exists()


def test_quaternions_that_are_not_unit(tmp_path):
    old = next(line for line in SHORT.splitlines() if line.startswith("tilt_torsion"))
    good = SHORT.replace(old, "quaternion = [0.9659258262890683, 0.0, -0.25881904510252074, 0.0000005]")
    assert plan(tmp_path, good)[0] == 0
    bad = SHORT.replace(old, "quaternion = [0.97, 0.0, -0.25881904510252074, 0.0]")
    code, _, err = plan(tmp_path, bad)
    assert code == 2 and "must have length 1" in err


ROBOT = 'base_points = {base}\nplatform_points = {platform}\ninertia = {inertia}\nmass = 1.0\nname = "mine"\n'


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("inertia = ", "# "), "inertia is missing: a rigid platform has it beside platform_points"),
        (("name", "planar = true\nname"), "planar = true: must be false, or absent, for a rigid platform"),
        (("name", "centre_of_mass = [0.6, 0.0, 0.0]\nname"), "is slack: it would need "),
        (("[[0.003", "[[-0.003"), "positive definite"),
    ],
)
def test_robot_files_that_are_wrong(tmp_path, change, words):
    text = ROBOT.format(base=MSSM.base.tolist(), platform=MSSM.platform.tolist(), inertia=MSSM.inertia.tolist())
    assert change[0] in text
    (tmp_path / "robot.toml").write_text(text.replace(*change, 1))
    code, _, err = plan(tmp_path, SHORT.replace('"laval-mssm"', '"robot.toml"'))
    assert code == 2 and words in err and len(err.splitlines()) == 1, err
