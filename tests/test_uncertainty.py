"""Verdicts about all robots within an uncertainty, against robots that the oracles simulate one by one."""

import dataclasses
import json

import h5py
import jax
import numpy as np
import pytest
from oracles import platform as oracle
from support.other_robots import displaced, on_balls, ratios, worst_robot
from support.platforms import FROM_REST, stacked
from support.random_motions import ROBOTS, motions_of, problem_of, quintic

from cspr_jax import least_time, load_robot, minimum_arcs
from cspr_jax.cli import main
from cspr_jax.errors import InputError
from cspr_jax.feasibility.blocks import parts_of_arcs
from cspr_jax.feasibility.enclosures import influence
from cspr_jax.feasibility.platform.checker import PoseChecker
from cspr_jax.feasibility.platform.enclosures import Robustness
from cspr_jax.feasibility.platform.motions import rows as some_of
from cspr_jax.feasibility.point_mass.enclosures import tolerated_by_point_masses
from cspr_jax.feasibility.problem import Problem
from cspr_jax.feasibility.uncertainty import closer_changes, demands_of, deviations, worst
from cspr_jax.feasibility.uncertainty import tensions as tensions_of
from cspr_jax.robots.limits import Limits, Uncertainty
from cspr_jax.robots.point_mass import point_mass_robot
from cspr_jax.search.point_mass_arcs import arcs_and_segments
from cspr_jax.trajectories.amplitudes import named
from cspr_jax.trajectories.hypocycloid import motion as point_motion
from cspr_jax.trajectories.platform_segment import Kind

BETWEEN = Kind()
SPOOLS, CENTRE = 0.004, 0.006
BALLS = Uncertainty(np.asarray(SPOOLS), np.asarray(CENTRE), np.asarray(1.0))
TAUTEN = np.array([[0.5, 0.0, 0.0], [-0.3, 0.45, 0.0], [-0.2, -0.45, 0.0]])


def uncertain(**numbers):
    given = {"spool_positions": 0.0, "mass_centre": 0.0, "mass_factor": 1.0} | numbers
    return Uncertainty(**{name: np.asarray(value) for name, value in given.items()})


def feasible_motions(name, kind, count, limits, seed=0):
    """Motions that are feasible as planned: the oracle's, the package's, numbers of arcs."""
    robot, rng = ROBOTS[name], np.random.default_rng(seed)
    drawn = motions_of(rng, robot, kind, count)
    segments, arcs = stacked([own[3] for own in drawn]), np.array([own[1] for own in drawn])
    without = dataclasses.replace(limits, uncertainty=None)
    checks = PoseChecker(problem_of(robot, without), kind, batch=64).check(segments, arcs, margins=False)
    which = np.flatnonzero(checks.verdict == 0)
    return [drawn[i] for i in which], some_of(segments, which), arcs[which]


def oracle_motion(robot, own, tau):
    segment, arcs, beta, _ = own
    segment = dataclasses.replace(segment, amplitude=quintic)
    return oracle.motion(robot, segment, arcs, beta, np.asarray(tau))


def distance_of_cables(robot, motion):
    return np.linalg.norm(oracle.cable_vectors(robot, motion.position, motion.rotation)[0], axis=2).min()


SOAK = pytest.mark.soak
MANY = [(robot, kind) for robot in ROBOTS for kind in (FROM_REST, BETWEEN)]


@pytest.mark.parametrize(
    ("name", "kind", "count", "robots"),
    [
        ("mssm", FROM_REST, 30, 2),
        ("general", BETWEEN, 100, 2),
        *(pytest.param(*own, 1000, 30, marks=SOAK) for own in MANY),
    ],
)
def test_no_robot_within_a_proved_multiple_of_the_uncertainty_fails(name, kind, count, robots):
    robot, limits = ROBOTS[name], Limits(uncertainty=BALLS)
    drawn, segments, arcs = feasible_motions(name, kind, count, limits)
    robustness = Robustness(problem_of(robot, limits), kind, batch=64, count_instants=lambda _: None)
    found = robustness.tolerated(segments, arcs)
    rng = np.random.default_rng(1)
    assert (found.proved > 0.0).mean() > 0.9
    assert (found.proved <= found.refuted).all()
    assert np.median(found.proved / found.refuted) > 0.6
    for own, proved in zip(drawn, found.proved, strict=True):
        motion = oracle_motion(robot, own, np.linspace(0.0, 1.0, 201))
        planned = ratios(robot, motion)
        # At random on the balls, and the worst to first order where tensions are least.
        others = [
            dataclasses.replace(
                robot, base=robot.base + on_balls(rng, (6,), proved * SPOOLS), com=on_balls(rng, (), proved * CENTRE)
            )
            for _ in range(robots)
        ]
        places = [(int(np.argmin(planned[:, k])), k) for k in range(6)]
        others += [worst_robot(robot, motion, *at, proved * SPOOLS, proved * CENTRE) for at in places]
        for other in others:
            assert (ratios(other, motion) > 0.0).all()
            assert distance_of_cables(other, motion) > 0.0


def test_a_robot_that_refutes_a_multiple_fails_in_the_oracle_too():
    robot, limits = ROBOTS["mssm"], Limits(uncertainty=BALLS)
    drawn, segments, arcs = feasible_motions("mssm", FROM_REST, 30, limits)
    problem = problem_of(robot, limits)
    robustness = Robustness(problem, FROM_REST, batch=64, count_instants=lambda _: None)
    refuted, fails = robustness.tolerated(segments, arcs).refuted, []
    for i, own in enumerate(drawn):
        one, only = some_of(segments, [i]), arcs[[i]]
        blocks = parts_of_arcs(only, np.zeros(0), 64)
        known = robustness.enclosure(one, only, blocks)
        found = influence(known)
        bad = worst(known, found, demands_of(problem, np.full(len(blocks.row), float(one.rate[0]) / 6)))
        spools, centre = 1.02 * refuted[i] * SPOOLS * bad.spools[0], 1.02 * refuted[i] * CENTRE * bad.centre[0]
        mu, lengths = tensions_of(known, spools, centre)
        k = int(np.argmin(mu.min(1)))
        motion = oracle_motion(robot, own, [0.5 * (blocks.start[k] + blocks.stop[k])])
        other = displaced(robot, spools[k] @ motion.rotation[0].T, centre[k])
        assert ratios(other, motion)[0] == pytest.approx(mu[k], rel=1e-9, abs=1e-12)
        assert np.linalg.norm(oracle.cables(other, motion.position, motion.rotation)[0], axis=1) == pytest.approx(
            lengths[k]
        )
        # It is the worst one to first order, by differences.
        by_differences = worst_robot(
            robot, motion, 0, int(np.argmin(mu[k])), 1.02 * refuted[i] * SPOOLS, 1.02 * refuted[i] * CENTRE
        )
        assert ratios(by_differences, motion)[0] == pytest.approx(mu[k], rel=1e-3, abs=1e-4)
        fails.append(mu[k].min() < 0.0)
    # Else what fails are contacts, or the instant is between these.
    assert np.mean(fails) > 0.5


@pytest.mark.parametrize(("spools", "centre"), [(0.004, 0.0), (0.0, 0.006), (0.004, 0.006)])
@pytest.mark.parametrize(("name", "kind"), [("mssm", FROM_REST), ("general", BETWEEN)])
def test_no_robot_deviates_more_than_is_bounded(name, kind, spools, centre):
    """At random instants of blocks, feasible motions or not; and the bounds are not far off."""
    robot, rng = ROBOTS[name], np.random.default_rng(4)
    drawn = motions_of(rng, robot, kind, 20)
    segments, arcs = stacked([own[3] for own in drawn]), np.array([own[1] for own in drawn])
    problem = problem_of(robot, Limits(uncertainty=BALLS))
    robustness = Robustness(problem, kind, batch=64, count_instants=lambda _: None)
    blocks = parts_of_arcs(arcs, np.zeros(0), 512)
    blocks = blocks.some(rng.choice(len(blocks.row), 200, replace=False))
    known = robustness.enclosure(segments, arcs, blocks)
    found, sizes = influence(known), [np.full(200, x) for x in (spools, centre)]
    off = deviations(known, found, *sizes)
    sound = np.isfinite(off).all(1) & (known.low > 0.0).all(1)
    # Of each block the largest smallest tensions, as parts of the planned ones, that are proved to be kept.
    least, most = np.full_like(known.low, -np.inf), np.full_like(known.low, np.inf)
    for part in np.linspace(0.0, 0.99, 12):
        tried = part * np.where(sound[:, None], known.low, 0.0)
        changes = closer_changes(known, found, *sizes, np.where(np.isfinite(off), off, 0.0), tried, upwards=True)
        kept = sound & (known.low - changes.down > tried).all(1)
        least[kept] = tried[kept]
        most = np.where(np.isfinite(changes.up), np.minimum(most, changes.up), most)
    bad = worst(known, found, demands_of(problem, np.asarray(segments.rate)[blocks.row] / 6))
    reached = []
    for k in np.flatnonzero(sound):
        tau = rng.uniform(blocks.start[k], blocks.stop[k], 4)
        motion = oracle_motion(robot, drawn[blocks.row[k]], tau)
        planned = ratios(robot, motion)
        lengths = np.linalg.norm(oracle.cables(robot, motion.position, motion.rotation), axis=2)
        assert (planned >= known.low[k] - 1e-9 * known.high[k]).all()
        assert (planned <= known.high[k] * (1.0 + 1e-9)).all()
        turn = motion.rotation[0]
        others = [displaced(robot, on_balls(rng, (6,), spools), on_balls(rng, (), centre)) for _ in range(4)]
        others += [displaced(robot, spools * bad.spools[i, k] @ turn.T, centre * bad.centre[i, k]) for i in (0, 1)]
        for other in others:
            more = np.linalg.norm(oracle.cables(other, motion.position, motion.rotation), axis=2)
            # Tensions over planned lengths: a spool that moves along its ray changes none.
            change = ratios(other, motion) * more / lengths - planned
            slack = (planned + off[k]) * (1.0 / np.sqrt(1.0 - (spools / lengths) ** 2) - 1.0) + 1e-9 * known.high[k]
            assert (change >= -off[k] - 1e-9 * known.high[k]).all()
            assert (change <= off[k] + slack).all()
            reached.append((np.abs(change) / off[k]).max())
            assert (planned + change >= least[k] - 1e-9 * known.high[k]).all()
            assert (change <= most[k] + slack).all()
    # They are not far off.
    proved = sound & (known.low - off > 0.2 * known.low).all(1)
    kept = least[proved] / (known.low[proved] - off[proved])
    assert len(reached) > 200
    assert np.quantile(reached, 0.9) > 0.5
    assert np.median(kept) > 0.8


def test_verdicts_are_those_of_the_multiples():
    limits = Limits(uncertainty=BALLS)
    _, segments, arcs = feasible_motions("mssm", FROM_REST, 40, limits)
    robustness = Robustness(problem_of(ROBOTS["mssm"], limits), FROM_REST, batch=64, count_instants=lambda _: None)
    whole, short = robustness.tolerated(segments, arcs), robustness.tolerated(segments, arcs, whole=False)
    assert ((short.proved >= 1.0) | (whole.proved < 1.001)).all()
    assert ((short.refuted > 1.0) | (short.proved == 0.0)).all()
    assert not ((short.refuted <= 1.0) & (whole.proved >= 1.0)).any()
    assert (short.proved >= 1.0).any()
    assert (short.refuted <= 1.0).any()
    # Twice the uncertainty, half the multiple.
    twice = Limits(uncertainty=uncertain(spool_positions=2 * SPOOLS, mass_centre=2 * CENTRE))
    half = Robustness(problem_of(ROBOTS["mssm"], twice), FROM_REST, batch=64, count_instants=lambda _: None)
    assert half.tolerated(segments, arcs).proved == pytest.approx(0.5 * whole.proved, rel=0.03)


LEVELS = np.array([[0.9, 0.3, 1.3], [0.2, -0.8, 1.0], [-0.7, 0.5, 0.8], [0.4, 0.4, 1.2], [-1.2, -0.3, 1.1]])


def point_masses(limits, amplitude="quintic"):
    """Motions from one point, feasible as planned."""
    problem = Problem(point_mass_robot((TAUTEN - TAUTEN.mean(0)).tolist(), mass=0.3), limits, named(amplitude))
    planned = problem._replace(limits=dataclasses.replace(limits, uncertainty=None))
    starts = np.tile([0.3, 0.1, 1.1], (len(LEVELS), 1))
    answers, segments = arcs_and_segments(planned, starts, LEVELS, np.ones(len(LEVELS)), max_arcs=30)
    assert (answers.arcs > 0).all()
    return problem, segments, answers


def states(problem, segments, arcs, i, samples=2001):
    own = some_of(segments, i)
    tau = np.linspace(0.0, 1.0, samples)
    return jax.vmap(lambda t: point_motion(own, problem.amplitude, np.asarray(float(arcs[i])), t))(tau)


def tensions(base, mass, position, acceleration):
    """Of a point mass by a solver, N."""
    rays = np.asarray(position)[:, None] - base
    units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    force = np.asarray(acceleration) - [0.0, 0.0, 9.81]
    return mass * np.linalg.solve(-np.swapaxes(units, 1, 2), force[..., None])[..., 0]


def test_no_point_mass_within_a_proved_multiple_fails():
    limits = Limits(uncertainty=uncertain(spool_positions=0.01))
    problem, segments, answers = point_masses(limits)
    found = tolerated_by_point_masses(problem, segments, answers.arcs)
    base, rng = np.asarray(problem.robot.base_points), np.random.default_rng(0)
    assert np.median(found.proved / found.refuted) > 0.9
    for i, (proved, refuted) in enumerate(zip(*found, strict=True)):
        position, _, acceleration = states(problem, segments, answers.arcs, i, 601)
        for _ in range(50):
            other = base + on_balls(rng, (3,), proved * 0.01)
            assert tensions(other, 0.3, position, acceleration).min() > 0.0
        # The multiples are no formality: a search for bad robots comes near to a slack cable.
        some = position[::4], acceleration[::4]
        worst = min(tensions(base + own, 0.3, *some).min() for own in climbed(base, *some, 0.01 * refuted))
        assert worst < 0.25 * tensions(base, 0.3, *some).min()


def climbed(base, position, acceleration, radius):
    """Displacements of a length that lower the least tension, step by step."""
    rng = np.random.default_rng(5)
    for _ in range(8):
        own = on_balls(rng, (3,), radius)
        for _ in range(15):
            slope = np.zeros((3, 3))
            for j, i in np.ndindex(3, 3):
                step = np.zeros((3, 3))
                step[j, i] = 1e-7
                both = [tensions(base + own + s * step, 0.3, position, acceleration).min() for s in (1.0, -1.0)]
                slope[j, i] = both[0] - both[1]
            own = -radius * slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-300)
        yield own


def test_a_factor_of_the_mass_is_that_of_the_tensions():
    """T is proportional to the mass: the multiple follows from the extremes of the planned tensions."""
    factor = 1.05
    without = point_masses(Limits())
    extremes = []
    for i in range(len(LEVELS)):
        position, _, acceleration = states(*without[:2], without[2].arcs, i, 20_001)
        own = tensions(np.asarray(without[0].robot.base_points), 0.3, position, acceleration)
        extremes.append((own.min(), own.max()))
    low, high = np.array(extremes).T
    limits = Limits(
        np.full(3, 0.5 * low.min()), np.full(3, 1.7 * high.max()), uncertainty=uncertain(mass_factor=factor)
    )
    problem, segments, answers = point_masses(limits)
    assert (answers.arcs == without[2].arcs).all()
    found = tolerated_by_point_masses(problem, segments, answers.arcs)
    expected = np.minimum(np.log(low / (0.5 * low.min())), np.log(1.7 * high.max() / high)) / np.log(factor)
    assert found.proved == pytest.approx(expected, rel=0.015)
    assert (found.proved <= expected * (1.0 + 1e-5)).all()
    assert (found.refuted >= expected * (1.0 - 1e-4)).all()


def test_a_limit_of_lengths_gives_way_by_as_much_as_spools_move():
    without = point_masses(Limits())
    longest = []
    for i in range(len(LEVELS)):
        position = states(*without[:2], without[2].arcs, i)[0]
        rays = np.asarray(position)[:, None] - np.asarray(without[0].robot.base_points)
        longest.append(np.linalg.norm(rays, axis=2).max())
    limits = Limits(cable_length_max=np.full(3, max(longest) + 0.002), uncertainty=uncertain(spool_positions=0.001))
    problem, segments, answers = point_masses(limits)
    i = int(np.argmax(longest))
    found = tolerated_by_point_masses(problem, segments, answers.arcs)
    assert 0.98 * 2.0 < found.proved[i] <= 2.01
    assert found.refuted[i] == pytest.approx(2.0, rel=0.01)


def test_speeds_and_accelerations_of_other_robots_keep_their_limits():
    without = point_masses(Limits())
    base, rng = np.asarray(without[0].robot.base_points), np.random.default_rng(3)

    def fastest(spools, i):
        position, velocity, acceleration = map(np.asarray, states(*without[:2], without[2].arcs, i, 601))
        rays = position[:, None] - spools
        lengths = np.linalg.norm(rays, axis=2)
        rate = np.einsum("nki,ni->nk", rays, velocity) / lengths
        bend = (np.sum(velocity**2, axis=1)[:, None] + np.einsum("nki,ni->nk", rays, acceleration) - rate**2) / lengths
        return np.abs(rate).max(), np.abs(bend).max()

    planned = np.array([fastest(base, i) for i in range(len(LEVELS))])
    speed, bend = 1.05 * planned.max(0)
    limits = Limits(
        cable_speed_max=np.full(3, speed),
        cable_acceleration_max=np.full(3, bend),
        uncertainty=uncertain(spool_positions=0.01),
    )
    problem, segments, answers = point_masses(limits)
    found = tolerated_by_point_masses(problem, segments, answers.arcs)
    assert (found.proved > 0.3).all()
    assert (found.proved / found.refuted).min() > 0.5
    for i, proved in enumerate(found.proved):
        for _ in range(30):
            own = fastest(base + on_balls(rng, (3,), proved * 0.01), i)
            assert own[0] <= speed * (1.0 + 1e-5)
            assert own[1] <= bend * (1.0 + 1e-5)


SWEEP = """
schema = 1
map = "minimum-arcs"
robot = "prototype"
[axes]
x = [0.0, 0.3, 0.9]
y = [0.2]
z = [1.0]
z0 = [1.0]
[trajectory]
family = "hypocycloid-standard"
from = {{ rest = true }}
amplitude = "quintic"
[limits]
uncertainty = {uncertainty}
"""


def run(tmp_path, uncertainty, name="sweep"):
    file = tmp_path / f"{name}.toml"
    file.write_text(SWEEP.format(uncertainty=uncertainty), "utf-8")
    code = main(["run", str(file), "-o", str(tmp_path / name)])
    return code, tmp_path / name / f"{name}.h5"


def test_a_map_of_tolerated_multiples(tmp_path):
    _, small = run(tmp_path, "{ spool_positions = 1e-5 }", "small")
    _, large = run(tmp_path, "{ spool_positions = 0.02 }", "large")
    assert small.exists(), list(tmp_path.rglob("*"))
    with h5py.File(small) as one, h5py.File(large) as other:
        few, many = one["arcs"][()].ravel(), other["arcs"][()].ravel()
        # Robots that may be worse need as many arcs or more, and stand the whole of their uncertainty.
        assert ((many >= few) | (many == 0)).all()
        assert (many > few).any()
        assert (other["tolerated"][()].ravel()[many > 0] >= 1.0).all()
        assert (one["tolerated"][()] <= one["not_tolerated"][()]).all()
        same = (few == many).ravel()
        ratio = one["tolerated"][()].ravel()[same] / other["tolerated"][()].ravel()[same]
        assert ratio == pytest.approx(2000.0, rel=0.3) or (one["tolerated"][()].ravel()[same] == 1000.0).any()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("{ spool_positions = -0.1 }", "limits.uncertainty.spool_positions = -0.1"),
        ("{ mass_factor = 0.5 }", "limits.uncertainty.mass_factor = 0.5"),
        ("{ }", "at least one of its keys"),
        ("{ spools = 1.0 }", "spools"),
        ("{ mass_centre = 0.01 }", "a point mass has no other one"),
    ],
)
def test_what_is_no_uncertainty_is_refused(tmp_path, capsys, given, said):
    code, result = run(tmp_path, given)
    words = capsys.readouterr().err
    assert code == 2 and not result.exists()
    assert said in words and "Traceback" not in words and len(words.strip().splitlines()) == 1


def test_maps_that_prove_nothing_about_other_robots_refuse_an_uncertainty(tmp_path, capsys):
    file = tmp_path / "lines.toml"
    text = SWEEP.format(uncertainty="{ spool_positions = 0.1 }").replace('"minimum-arcs"', '"transition-envelopes"')
    text = text.replace("hypocycloid-standard", "transition").replace("z0 = [1.0]", "z0 = [1.0]\ntau = [0.5]")
    file.write_text(text, "utf-8")
    assert main(["run", str(file), "-o", str(tmp_path / "out")]) == 2
    assert "limits.uncertainty: must be absent in this map" in capsys.readouterr().err


PLAN = """
schema = 1
robot = "prototype"
family = "{family}"
amplitude = "quintic"
z0 = 1.0
[limits]
uncertainty = {{ spool_positions = {spools} }}
[[pose]]
rest = true
[[pose]]
position = [0.5, 0.3, 1.0]
arcs = {arcs}
"""


def plan_of(tmp_path, capsys, **keys):
    file = tmp_path / "plan.toml"
    text = PLAN.format(**keys)
    file.write_text(text.replace("arcs = 1\n", ""), "utf-8")
    code = main(["plan", str(file), "--json"])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.parametrize(("family", "arcs"), [("hypocycloid-standard", 14), ("transition", 14)])
def test_a_plan_says_what_it_stands(tmp_path, capsys, family, arcs):
    _, said, _ = plan_of(tmp_path, capsys, family=family, arcs=arcs, spools=0.001)
    segment = json.loads(said)["segments"][0]
    multiple = segment["tolerated"]
    assert 1.0 < multiple <= segment["not_tolerated"]
    # Beyond it the same motion is infeasible, and only for this.
    beyond = 1.02 * 0.001 * segment["not_tolerated"]
    _, said, _ = plan_of(tmp_path, capsys, family=family, arcs=arcs, spools=beyond)
    other = json.loads(said)["segments"][0]
    assert other["arcs"] is None and "uncertainty" in other["verdict"]
    assert other["margin"] == segment["margin"] > 0.0


def test_families_that_know_no_uncertainty_say_so(tmp_path, capsys):
    code, _, said = plan_of(tmp_path, capsys, family="s-curve", arcs=1, spools=0.001)
    assert code == 2
    assert "uncertainty" in said and "transition" in said


def test_numbers_that_are_none_are_refused_from_python():
    robot = load_robot("prototype")
    for given in (5, Uncertainty(spool_positions=-0.1), Uncertainty(mass_centre=0.1)):
        with pytest.raises(InputError, match="uncertainty"):
            minimum_arcs(robot, [[0.3, 0.0, 1.0]], z0=1.0, limits=Limits(uncertainty=given))
    hall = load_robot("boralugoda-rectangle")
    with pytest.raises(InputError, match="must be absent but for the families"):
        least_time(hall, [[15, 28, 3]], start=[1, 20, 7], limits=Limits(uncertainty=uncertain(spool_positions=0.1)))


POSES = """
schema = 1
robot = "laval-mssm"
family = "hypocycloid"
amplitude = { name = "effective-c3", epsilon = 0.1 }
z0 = 1.7
[limits]
uncertainty = { spool_positions = 0.001, mass_centre = 0.001, mass_factor = 1.1 }
[[pose]]
rest = true
[[pose]]
position = [0.9, 0.3, 1.7]
tilt_torsion = [0.3, 0.3, 0.1]
"""


def test_a_plan_of_poses_says_what_it_stands(tmp_path, capsys):
    file = tmp_path / "plan.toml"
    file.write_text(POSES, "utf-8")
    assert main(["plan", str(file), "--json"]) == 0
    segment = json.loads(capsys.readouterr().out)["segments"][0]
    assert 1.0 < segment["tolerated"] <= segment["not_tolerated"] < 1.2 * segment["tolerated"]
