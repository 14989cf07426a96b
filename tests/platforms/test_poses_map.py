"""Maps of poses of a platform beside plans of the same poses; the fast forms beside the readable ones; mistakes."""

import functools
import itertools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import platform as oracle
from support.commands import cspr, plan
from support.platforms import (
    EFFECTIVE,
    FROM_REST,
    HEAD,
    INSTANTS,
    MSSM,
    SHORT,
    Z0,
    general,
    limits_of,
    made,
    ours,
    random_pose,
    stacked,
    states,
)

from cspr_jax.families.platforms.platform_segment import motion
from cspr_jax.families.platforms.platform_segment_lanes import phase_lanes, state
from cspr_jax.families.platforms.six_cable_proof.checker import slacks_at
from cspr_jax.families.platforms.six_cable_proof.pose_proof import cables_beside
from cspr_jax.families.platforms.six_cable_proof.slacks import moving_slacks, order, pose_slacks, static_slacks
from cspr_jax.motion.platform_kind import USUAL, PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.plans import choices, planning
from cspr_jax.robots.contacts import interference, interference_lanes
from cspr_jax.robots.model.limits import NO_LIMITS
from cspr_jax.robots.model.platform import rays as rays_of
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.wrench_lanes import cable_lanes
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.reading.result import open_result

REST = "{ rest = true }"
POSE = "{ position = [0.6, -0.4, 1.5], tilt_torsion = [0.3, 0.4, -0.2], beta_hat = -2.0 }"
SWEEP = """schema = 1
map = "poses"
robot = "laval-mssm"
[axes]
x = [0.9, -0.5]
y = [0.8]
z = [1.4]
tilt_azimuth = [0.5, -1.2]
tilt = [0.6]
torsion = [0.0, 0.5]
z0 = [1.7]
[trajectory]
family = "hypocycloid"
amplitude = {{ name = "effective-c3", epsilon = 0.1 }}
max_arcs = 12
from = {start}
{more}
"""
# Many motions break each of them.
TIGHT = {
    "tension_min": 0.01,
    "tension_max": 3.0,
    "floor": 2.0,
    "cable_length_max": 3.0,
    "cable_speed_max": 2.5,
    "cable_acceleration_max": 9.0,
}


def swept(folder, start=REST, more="", change=("", "")):
    (folder / "poses.toml").write_text(SWEEP.format(start=start, more=more).replace(*change))
    return cspr("run", folder / "poses.toml", "-o", folder / "run")


@pytest.mark.parametrize("start", [REST, pytest.param(POSE, marks=pytest.mark.soak)])
def test_cells_are_plans(tmp_path, start):
    """Arcs, duration, beta-hat and margins of each cell as `cspr plan` gives them."""
    code, out, err = swept(tmp_path, start)
    assert code == 0, err
    result = open_result(Path(out.split()[-1]))
    first = "[[pose]]\nrest = true\n" if start == REST else "[[pose]]\n" + start[2:-2].replace("], ", "]\n") + "\n"
    head = HEAD.replace("z0 = 1.4", "z0 = 1.7").replace("max_arcs = 20", "max_arcs = 12")
    cells = itertools.product(*(range(len(result.axes[name])) for name in result.axes))
    for cell in cells:
        at = {name: float(result.axes[name][i]) for name, i in zip(result.axes, cell, strict=True)}
        last = f"[[pose]]\nposition = [{at['x']}, {at['y']}, {at['z']}]\n"
        last += f"tilt_torsion = [{at['tilt_azimuth']}, {at['tilt']}, {at['torsion']}]\n"
        (tmp_path / "plan.toml").write_text(head + first + last)
        answers = planning.plan(tmp_path / "plan.toml").answers
        assert result.data["arcs"][cell] == answers.arcs[0] and result.data["verdict"][cell] == answers.verdict[0]
        for name in ("duration", "margin", "det_margin", "cable_distance"):
            assert result.data[name][cell] == pytest.approx(getattr(answers, name)[0], rel=1e-6, abs=1e-9), name
        assert result.data["beta_hat"][cell] == pytest.approx(answers.beta_hat[0, 1], rel=1e-9)
    assert (result.data["arcs"] > 0).any()
    unsure = Verdict.UNDECIDED.value | Verdict.FEWER_ARCS_UNDECIDED.value
    assert result.attributes["proved"] == 1.0 - ((result.data["verdict"] & unsure) != 0).mean()


def test_mirrored_cells(tmp_path):
    """x -> -x, with the tilt and the torsion mirrored, is the same problem for the MSSM."""
    _, out, _ = swept(tmp_path, change=("x = [0.9, -0.5]", "x = [0.9]"))
    plain = open_result(Path(out.split()[-1])).data
    # phi becomes pi - phi in the cylindrical frame.
    change = f"x = [-0.9]\ny = [0.8]\nz = [1.4]\ntilt_azimuth = [{np.pi - 0.5}, {np.pi + 1.2}]\ntilt = [0.6]\n"
    change += "torsion = [0.0, -0.5]"
    text = SWEEP.format(start=REST, more="")
    begin, end = text.index("x = ["), text.index("\nz0 = ")
    (tmp_path / "mirror.toml").write_text(text[:begin] + change + text[end:])
    _, out, err = cspr("run", tmp_path / "mirror.toml", "-o", tmp_path / "mirror")
    mirrored = open_result(Path(out.split()[-1])).data
    assert (mirrored["arcs"] == plain["arcs"]).all(), err
    for name in ("duration", "margin", "det_margin", "cable_distance", "beta_hat"):
        np.testing.assert_allclose(mirrored[name], plain[name], rtol=1e-6, atol=1e-8, err_msg=name)


slacks_of, gaps_of = jax.jit(pose_slacks), jax.jit(interference.gaps)
directions_of = jax.jit(interference.cable_directions)


@pytest.mark.thorough
def test_lanes_are_the_readable_slacks():
    """Every criterion with every limit, and distances between cables, at instants of random motions from rest."""
    package, rng, p = ours(MSSM), np.random.default_rng(3), 5
    limits, tau = limits_of(**TIGHT), rng.uniform(0.0, 1.0, 2 * INSTANTS)
    problem, near = Problem(package, limits, EFFECTIVE), interference.contacts(package)
    motions = [
        made(package, random_pose(rng, rest=True), random_pose(rng), Z0, tuple(rng.uniform(-5, 1, 2)), p)
        for _ in range(12)
    ]
    which = np.arange(len(tau)) % len(motions)
    items = stacked([motions[i] for i in which]), np.full(len(tau), float(p)), tau
    pairs = tuple((int(i), int(j)) for i, j in near.pairs)
    *found, nearest = (np.asarray(x) for x in slacks_at(problem, items, pairs=pairs, kind=FROM_REST))
    seen = 0
    for i, segment in enumerate(motions):
        some = np.flatnonzero(which == i)
        at = states(segment, EFFECTIVE, p, tau[some])
        for place, *leaves in zip(some, *at[:6], strict=True):
            pose = State(*leaves)
            wanted = np.asarray(slacks_of(problem, pose, np.asarray(Z0), segment.regular))
            if abs(wanted[1]) > 1e-3:
                np.testing.assert_allclose([x[place] for x in found], wanted, rtol=1e-7, atol=1e-8)
                seen += 1
            gaps = np.asarray(gaps_of(package, near.pairs, pose.position, pose.rotation))
            assert nearest[place] == pytest.approx(np.linalg.norm(gaps, axis=1).min(), abs=1e-9)
    assert seen > 40


def test_cables_beside_the_middles_of_blocks():
    """As vectors in fixed axes and as the platform sees them, between poses: as the readable functions give them."""
    package, rng, p = ours(MSSM), np.random.default_rng(8), 5
    middle, off = rng.uniform(0.2, 0.8, INSTANTS), rng.uniform(-0.05, 0.05, INSTANTS)
    # Beside a knot the polynomial of the middle goes on.
    off = np.where((middle + off < 0.1) | (middle + off > 0.9), 0.0, off)
    some = [made(package, random_pose(rng), random_pose(rng), Z0, tuple(rng.uniform(-5, 1, 2)), p) for _ in middle]
    items = stacked(some), np.full(INSTANTS, float(p)), middle, off
    rays, seen = cables_beside(Problem(package, NO_LIMITS, EFFECTIVE), items, kind=USUAL)
    own = np.asarray(seen) / np.linalg.norm(seen, axis=2, keepdims=True)
    for segment, t, found, along in zip(some, middle + off, np.asarray(rays), own, strict=True):
        pose = states(segment, EFFECTIVE, p, [t])
        where = pose.position[0], pose.rotation[0]
        np.testing.assert_allclose(found, rays_of(package, *where)[0], atol=1e-9)
        np.testing.assert_allclose(along, directions_of(package, *where), atol=1e-9)


@functools.partial(jax.jit, static_argnames="pairs")
def as_lanes(problem, batch, p, t, *, pairs):
    """Slacks (n_criteria, n), vectors between cables and directions of cables of motions, by the fast forms."""
    instant = phase_lanes(problem.amplitude, batch.sense, p, t)
    here = state(batch, p, instant, USUAL)
    cables = cable_lanes(problem.robot, here.position, here.rotation)
    slacks = moving_slacks(problem, batch, p, instant, USUAL) + static_slacks(problem, batch, here, cables)
    gaps = interference_lanes.gaps(problem.robot.base_points, pairs, cables)
    return jnp.stack(slacks), *interference_lanes.as_arrays(
        gaps, interference_lanes.cable_directions(cables, here.rotation)
    )


@jax.jit
def as_read(problem, batch, p, t, *, pairs):
    """The same by the readable functions, slacks (n, n_criteria) in their own order."""

    def one(segment, arcs, tau):
        pose = motion(segment, problem.amplitude, arcs, tau)
        where = (problem.robot, pose.position, pose.rotation)
        slacks = pose_slacks(problem, pose, problem.robot.gravity / segment.rate, segment.regular)
        return slacks, interference.gaps(problem.robot, pairs, *where[1:]), interference.cable_directions(*where)

    return jax.vmap(one)(batch, p, t)


@pytest.mark.soak
@pytest.mark.parametrize("robot", [MSSM, general(2)])
def test_lanes_are_the_readable_slacks_all(robot):
    """Every criterion with every limit, and what meets, at random instants of random motions."""
    package, rng = ours(robot), np.random.default_rng(3)
    limits = limits_of(**TIGHT)
    problem, near = Problem(package, limits, EFFECTIVE), interference.contacts(package)
    p, count = np.full(12, 5.0), 12
    batch = stacked(
        made(package, random_pose(rng), random_pose(rng), Z0, tuple(rng.uniform(-5, 1, 2)), 5) for _ in range(count)
    )
    pairs, seen = tuple((int(i), int(j)) for i, j in near.pairs), 0
    for tau in np.linspace(0.03, 0.97, 9):
        t = np.full(count, tau)
        found, gaps, directions = (np.asarray(x) for x in as_lanes(problem, batch, p, t, pairs=pairs))
        wanted, wanted_gaps, wanted_directions = (
            np.asarray(x) for x in as_read(problem, batch, p, t, pairs=np.asarray(near.pairs))
        )
        some = np.abs(wanted[:, 1]) > 1e-3
        np.testing.assert_allclose(found[order(limits)].T[some], wanted[some], rtol=1e-7, atol=1e-8)
        seen += some.sum()
        np.testing.assert_allclose(gaps, wanted_gaps, atol=1e-9)
        own = directions / np.linalg.norm(directions, axis=2, keepdims=True)
        np.testing.assert_allclose(own, wanted_directions, atol=1e-9)
    assert seen > 40


def test_time_functions_of_the_rotation():
    """beta_1 is a cosine, beta_0 has no angular acceleration at the ends, beta_f one at both."""
    robot, p = ours(MSSM), 4
    start, end = random_pose(np.random.default_rng(6), rest=True), random_pose(np.random.default_rng(7))
    tau = np.array([0.0, 0.3, 1.0])
    segment = made(robot, start, end, Z0, (0.0, 0.0), p)
    still = states(segment, EFFECTIVE, p, tau)
    np.testing.assert_allclose(still.angular_acceleration[[0, 2]], 0.0, atol=1e-9)
    plain = states(segment, EFFECTIVE, p, tau, kind=PlatformMotionKind(variable=False, plain=True))
    angle = 2.0 * np.arccos(np.clip(abs(end[1][0]), 0.0, 1.0))
    wanted = np.cos(np.abs(angle * oracle.effective_c3(0.1)(tau)[0] * np.cos(np.pi * p * tau)))
    np.testing.assert_allclose((np.trace(plain.rotation, axis1=1, axis2=2) - 1.0) / 2.0, wanted, atol=1e-9)


@pytest.mark.parametrize("beat", ["beta_f", "beta_0", pytest.param("beta_1", marks=pytest.mark.soak)])
def test_beats_in_plans_and_maps(tmp_path, beat):
    """Both take them; beta_f has one beta-hat a segment, beta_0 none, beta_1 that of a cosine."""
    text = f'beat = "{beat}"\n' + SHORT.replace("beta_hat = -14.6701\n", "").split("[[pose]]", 1)[0]
    parts = ["rest = true\n", "position = [0.0, 1.2, 1.5]\ntilt_torsion = [1.0, 0.3, 0.1]\n"]
    (tmp_path / "plan.toml").write_text(text + "".join("[[pose]]\n" + part for part in parts))
    answers = planning.plan(tmp_path / "plan.toml").answers
    assert answers.arcs[0] > 0 and answers.beta_hat[0, 0] == answers.beta_hat[0, 1]
    if beat == "beta_0":
        assert answers.beta_hat[0, 0] == 0.0
    if beat == "beta_1":
        assert answers.beta_hat[0, 0] == pytest.approx(-1.0)  # a transition from rest has theta_h = pi p
        return  # its map would compile everything once more
    code, out, err = swept(tmp_path, more=f'beat = "{beat}"')
    assert code == 0 and (open_result(Path(out.split()[-1])).data["arcs"] > 0).any(), err


@pytest.mark.thorough
def test_chosen_depth_and_epsilon(tmp_path, monkeypatch):
    """The fastest z0 of few is no slower than others, nor the best epsilon of few; both are feasible."""
    monkeypatch.setattr(choices, "DEPTHS", 40)
    monkeypatch.setattr(choices, "EPSILONS", np.array([0.02, 0.1, 0.3]))
    check_choices(tmp_path)


@pytest.mark.soak
def test_chosen_depth_and_epsilon_all(tmp_path):
    check_choices(tmp_path)


def check_choices(tmp_path):
    """Beside plans with given values."""
    target = "[[pose]]\nposition = [0.3, 1.4, 1.5]\ntilt_torsion = [1.0, 0.4, 0.2]\n"
    plain = HEAD + "[[pose]]\nrest = true\n" + target
    totals = []
    for z0 in ("1.4", "1.5", "1.6", '{ choose = "mean" }', '{ choose = "fastest" }'):
        (tmp_path / "plan.toml").write_text(plain.replace("z0 = 1.4", f"z0 = {z0}"))
        found = planning.plan(tmp_path / "plan.toml")
        totals.append(found.answers.duration.sum() if found.answers.arcs[0] else np.inf)
    assert totals[-1] <= min(totals[:-1]) + 1e-9
    (tmp_path / "plan.toml").write_text(plain.replace("epsilon = 0.1", 'epsilon = "best"'))
    best = planning.plan(tmp_path / "plan.toml")
    assert best.answers.arcs[0] > 0 and best.answers.duration.sum() <= totals[0] + 1e-9


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('"laval-mssm"', '"prototype"'), "must be a platform"),
        (('"hypocycloid"', '"transition"'), 'must be "hypocycloid"'),
        (("z0 = [1.7]", ""), "z0"),
        (("tilt = [0.6]", "tilt = [0.6]\ninclination = [0.0]"), "axes.inclination: must be absent"),
        (("tilt = [0.6]", "tilt = [0.6]\ntau = [0.5]"), "axes.tau: must be absent"),
        (("z = [1.4]", "z = [-1.4]"), "every point is above the spool plane"),
        ((REST, "{ rest = true, beta_hat = 1.0 }"), "{ rest = true } alone"),
        (
            ("{ rest = true }", "{ position = [0.0, 0.1, 1.4], quaternion = [1.0, 0.1, 0.0, 0.0] }"),
            "must have length 1",
        ),
        (("max_arcs = 12", 'max_arcs = 12\nbeta_hat = "best"'), "beta_hat"),
        (("max_arcs = 12", 'max_arcs = 12\nbeat = "beta_1"\nbeta_hat = 1.0'), "must be absent with beat"),
        (("z0 = [1.7]", 'z0 = [1.7]\n[run]\nstore = ["oscillations"]'), "run.store"),
    ],
)
def test_mistakes(tmp_path, change, words):
    code, out, err = swept(tmp_path, change=change)
    assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err
    assert not (tmp_path / "run").exists()


def test_mistakes_of_plans(tmp_path):
    """A time function without a free beta-hat refuses one; a point mass refuses all."""
    code, _, err = plan(tmp_path, 'beat = "beta_0"\n' + SHORT)
    assert code == 2 and 'beta_hat: must be absent with beat = "beta_0"' in err
    point = SHORT.replace('"laval-mssm"', '"prototype"').replace('"hypocycloid"', '"hypocycloid-standard"')
    code, _, err = plan(tmp_path, 'beat = "beta_0"\n' + point)
    assert code == 2 and "must be absent for a point mass" in err


@pytest.mark.thorough
def test_pictures(tmp_path):
    """Planes of positions, and polar sections of orientations, are drawn whatever the order of the axes."""
    _, out, _ = swept(tmp_path, change=("tilt = [0.6]", "tilt = [0.3, 0.6]"))
    for at in ((), ("--at", "x=0.9")):
        code, path, err = cspr("plot", out.split()[-1], "-o", tmp_path / "picture.png", *at)
        assert code == 0 and Path(path.strip()).stat().st_size > 10_000, err
