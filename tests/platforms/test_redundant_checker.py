"""Plans of platforms on more cables than six: margins beside linear programs, tensions by rules, verdicts, mistakes."""

import dataclasses
import itertools
import json

import jax
import numpy as np
import pytest
from oracles import workspaces as oracle
from support.commands import cspr, plan

import cspr_jax
from cspr_jax.build.robots import load_robot
from cspr_jax.config.reading import read_toml
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.platforms.beta_hat import LARGEST
from cspr_jax.families.platforms.redundant import redundant_checker
from cspr_jax.families.platforms.redundant.redundant_checker import RedundantChecker
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.given_limits import limits_over
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs import example_files, motion_files
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.tension_rule_table import TENSION_RULES
from cspr_jax.robots.statics.kernel_axes import prepared
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification import attained
from cspr_jax.verification.proved_answers import proof_of

EXAMPLE = example_files.folder() / "cogiro.toml"
LOW, HIGH, GRAVITY = 100.0, 5000.0, 9.81
FALLING = np.array([0.0, 0.0, -GRAVITY])
# Rows of a segment: of finite differences of fourth order, some 3e-3 s apart.
ROWS = 801
POSE = {"position": [1.5, 1.0, 1.6], "tilt_torsion": [0.3, 0.1, 0.2], "arcs": 1}
FIXED = {"schema": 1, "robot": "cogiro", "family": "hypocycloid", "z0": 4.0, "samples": 50}
FIXED |= {"amplitude": {"name": "effective-c3", "epsilon": 0.3}}  # compiled for the example


@pytest.fixture(scope="module")
def robot():
    """CoGiRo as its file has it: points from the mass centre, and the rest."""
    keys = read_toml(cspr_jax.config.catalogue.CATALOGUE / "cogiro.toml")
    points = np.array(keys["platform_points"]) - np.array(keys["centre_of_mass"])
    return np.array(keys["base_points"]), points, keys["mass"], np.array(keys["inertia"])


@pytest.fixture(scope="module")
def example():
    """The example, its numbers of arcs given, with many rows."""
    keys = read_toml(EXAMPLE)
    for pose in keys["pose"][1:]:
        pose.setdefault("arcs", 1)
    return cspr_jax.plan(keys | {"samples": ROWS})


@pytest.fixture(scope="module")
def rows(example):
    """Of each segment its rows."""
    table = example.rows()
    return [{name: values[i * ROWS : (i + 1) * ROWS] for name, values in table.items()} for i in range(3)]


def rotation(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def differences(values, step):
    """First and second derivatives in the middle of five."""
    first = np.tensordot([1.0, -8.0, 0.0, 8.0, -1.0], values, 1) / (12.0 * step)
    second = np.tensordot([-1.0, 16.0, -30.0, 16.0, -1.0], values, 1) / (12.0 * step**2)
    return first, second


def wrench_of(robot, table, k):
    """What the cables must supply at a row, z up, by differences of the poses around it."""
    _, _, mass, inertia = robot
    near, step = slice(k - 2, k + 3), table["t"][1] - table["t"][0]
    turns = np.array([rotation(q) for q in table["quaternion"][near]])
    acceleration = differences(table["position"][near], step)[1]
    slope, second_derivative = differences(turns, step)
    spin = turns[2] @ inertia @ turns[2].T
    # R' R^T is the cross product with omega, and R'' R^T = [omega'] + [omega]^2.
    acceleration_matrix = slope @ turns[2].T
    change = second_derivative @ turns[2].T - acceleration_matrix @ acceleration_matrix
    omega, alpha = (
        np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / 2.0 for m in (acceleration_matrix, change)
    )
    moment = spin @ alpha + np.cross(omega, spin @ omega)
    return np.concatenate([mass * (acceleration - FALLING), moment])


def matrix_of(robot, table, k):
    return oracle.full_wrench_matrix(*robot[:2], table["position"][k], rotation(table["quaternion"][k]))


def room(tension):
    """How far all tensions keep from their limits."""
    return np.minimum(tension - LOW, HIGH - tension).min(1)


@pytest.mark.thorough
def test_margins_are_those_of_linear_programs(robot, example, rows):
    """Along the path, with wrenches from differences of poses; the least of a segment is the plan's."""
    for table, segment in zip(rows, example.to_dict()["segments"], strict=True):
        for k in range(3, ROWS - 3, 113):
            matrix, wrench = matrix_of(robot, table, k), wrench_of(robot, table, k)
            expected = oracle.tension_margin(matrix, wrench[None], LOW, HIGH)
            assert room(table["tension"][k : k + 1])[0] == pytest.approx(expected, abs=1e-4)
        least = room(table["tension"]).min()
        assert least - 0.01 < segment["tension_margin"] <= least + 1e-8
        assert segment["margin"] == pytest.approx(segment["tension_margin"] * 8 / (robot[2] * GRAVITY), rel=1e-9)
        assert segment["verdict"] == "feasible" and segment["tension_margin"] > 0.0


def test_the_motion_of_a_plan_is_proved_to_its_margin(example):
    margin, bound = example.answers.margin, example.answers.margin_bound
    assert (bound > 0.0).all() and (bound <= margin).all()
    np.testing.assert_allclose(bound, margin, rtol=0.02)


@pytest.mark.thorough
def test_what_no_proof_closes_is_undecided(monkeypatch):
    """Samples alone make no motion feasible."""
    keys = FIXED | {"pose": [{"rest": True}, POSE]}

    def unproved(problem, motion):
        full = proof_of(problem, motion)
        return full._replace(proof=dataclasses.replace(full.proof, low=np.full_like(full.proof.low, -1.0)))

    monkeypatch.setattr(redundant_checker, "proof_of", unproved)
    monkeypatch.setattr(attained, "proof_of", lambda problem, motion, scene: unproved(problem, motion))
    monkeypatch.setattr(attained, "has_exact", lambda: False)
    planned = cspr_jax.plan(keys)
    assert planned.answers.verdict.tolist() == [Verdict.UNDECIDED.value] and not planned.feasible
    assert planned.answers.margin_bound[0] < 0.0


def test_tensions_give_the_wrench(robot, rows):
    """To 1e-9 of the load, as the residual in the file says."""
    load = robot[2] * GRAVITY
    for table in rows:
        assert table["tension_residual"].shape == (ROWS,)
        assert table["tension_residual"].max() < 1e-9
        turns = np.array([rotation(q) for q in table["quaternion"][::100]])
        for k, turn in zip(range(0, ROWS, 100), turns, strict=True):
            spin, omega = turn @ robot[3] @ turn.T, table["omega"][k]
            force = robot[2] * (table["acceleration"][k] - FALLING)
            moment = spin @ table["omega_dot"][k] + np.cross(omega, spin @ omega)
            left = matrix_of(robot, table, k) @ table["tension"][k] - np.concatenate([force, moment])
            assert np.abs(left).max() < 1e-9 * load


def test_distances_between_cables_are_those_of_segments(robot, example, rows):
    """At some rows the nearest cables are nowhere nearer than the plan says, and about as near somewhere."""
    base, points = robot[:2]
    for table, segment in zip(rows, example.to_dict()["segments"], strict=True):
        nearest = np.inf
        for k in range(0, ROWS, 40):
            ends = table["position"][k] + points @ rotation(table["quaternion"][k]).T
            for i, j in itertools.combinations(range(8), 2):
                nearest = min(nearest, oracle.segment_distance(base[i], ends[i], base[j], ends[j]))
        assert nearest - 2e-3 < segment["cable_distance_min"] <= nearest + 1e-9
        assert segment["cable_interference"] is False and segment["platform_interference"] is None


@pytest.mark.thorough
def test_limits_that_are_too_tight_refuse_and_infinite_ones_do_not(example):
    """The verdict says what is wrong and by how much; without largest tensions nothing changes here."""
    free = cspr_jax.plan(FIXED | {"pose": [{"rest": True}, POSE]})
    tight = cspr_jax.plan(FIXED | {"pose": [{"rest": True}, POSE], "tension_min": 300.0})
    unbounded = cspr_jax.plan(FIXED | {"pose": [{"rest": True}, POSE], "tension_max": [np.inf] * 8})
    assert free.feasible and not tight.feasible
    assert tight.to_dict()["segments"][0]["verdict"] == "no_arcs+wrench_infeasible"
    assert tight.to_dict()["segments"][0]["tension_margin"] < -20.0
    assert unbounded.answers.margin == pytest.approx(free.answers.margin, rel=1e-9)
    assert example.feasible


@pytest.mark.thorough
def test_cables_that_cross_are_refused():
    """A platform that turns by half a turn."""
    rotated = POSE | {"tilt_torsion": [0.0, 0.0, 3.0]}
    found = cspr_jax.plan(FIXED | {"pose": [{"rest": True}, rotated], "tension_max": [np.inf] * 8})
    assert Verdict(int(found.answers.verdict[0])) & Verdict.CABLE_CABLE
    assert found.to_dict()["segments"][0]["cable_interference"] is True


def end_margin(robot, position, quaternion, z0, beta_hat, low, high):
    """At an end, z down and from the centroid of the spools, by a linear program."""
    base, points, mass, inertia = robot
    eta, turn = GRAVITY / z0, rotation(quaternion)
    angle = 2.0 * np.arctan2(np.linalg.norm(quaternion[1:]), quaternion[0])
    axis = quaternion[1:] / np.linalg.norm(quaternion[1:])
    moment = turn @ inertia @ turn.T @ (beta_hat * eta * angle * axis)
    wrench = np.concatenate([-mass * eta * position, moment])
    matrix = oracle.full_wrench_matrix(base, points, position, turn)
    return oracle.tension_margin(matrix, wrench[None], low, high)


@pytest.mark.parametrize("low", [100.0, 190.0])
def test_beta_hat_of_the_largest_margin(low):
    """The preferred value has the largest margin, and at the ends of the interval there is none left."""
    own = load_robot("cogiro")
    with double_precision():
        kernel, _ = prepared(own)
        problem = Problem(kernel, limits_over(own, Limits(tension_min=low, tension_max=430.0)), named("quintic"))
        position, quaternion = np.array([1.5, -1.0, 3.8]), np.array([0.99, 0.1, -0.05, 0.08])
        quaternion /= np.linalg.norm(quaternion)
        best, lowest, highest = RedundantChecker(problem).end_interval(position, quaternion, 4.0)
    numbers = [np.asarray(x) for x in (kernel.base_points, kernel.platform_points, kernel.mass, kernel.inertia)]

    def margin(value):
        return end_margin(numbers, position, quaternion, 4.0, value, low, 430.0)

    assert -LARGEST < best < LARGEST and lowest < best < highest
    assert margin(best) > max(margin(best - 0.01), margin(best + 0.01))
    for value in (lowest, highest):
        assert margin(value) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"tensions": "middle"}, 'tensions = "middle": must be "least-norm", "centred", "closed-form"'),
        ({"tensions": 3}, "tensions = 3: must be"),
        ({"tensions": "closed-form", "tension_max": [np.inf] * 8}, "without tension_max of every cable"),
        ({"tension_max": [np.inf] * 7}, "tension_max"),
        ({"robot": "fast", "tensions": "centred"}, 'tensions = "centred": must be absent: on 6 cables'),
        ({"robot": "kntu-planar"}, 'must be "spline" or "path" or "free" for a planar platform'),
        ({"family": "s-curve"}, 'family = "s-curve": must be'),
    ],
)
def test_mistakes_are_one_line(change, error):
    with pytest.raises(ConfigError) as caught:
        cspr_jax.plan(FIXED | {"pose": [{"rest": True}, POSE]} | change)
    assert error in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.thorough
def test_files_hold_residuals_and_pictures_limits(example, tmp_path):
    """HDF5, CSV and xarray; the picture names the rule and draws the smallest tension."""
    path = example.save(tmp_path / "motion.h5")
    result = cspr_jax.open_result(path)
    assert result.data["tension_residual"].shape == (3 * ROWS,) and result.data["tension"].shape == (3 * ROWS, 8)
    assert example.to_xarray()["tension_residual"].dims == ("t",)
    head = example.save(tmp_path / "motion.csv").read_text().partition("\n")[0].split(",")
    assert head[-4:] == ["tension_8", "tension_residual", "binding", "binding_cable"]
    figure = cspr_jax.plot(path)
    panel = next(axes for axes in figure.axes if axes.get_ylabel().startswith("tension (N)"))
    assert panel.get_ylabel() == "tension (N)\ncentred"
    named = {text.get_text() for text in panel.get_legend().get_texts()}
    assert {"at least 100 N", "at most 5000 N (above)"} <= named
    assert any(np.allclose(line.get_ydata(), LOW) for line in panel.lines)


def by_rule(example, rule, high=HIGH):
    keys = example.keys.model_copy(update={"tensions": rule})
    given = Limits(tension_min=np.full(8, LOW), tension_max=np.full(8, high))
    problem = example.problem._replace(limits=given)
    with double_precision():
        return motion_files.rows(dataclasses.replace(example, keys=keys, problem=problem))


@pytest.mark.thorough
def test_closed_form_is_the_nearest_to_the_middles(robot, example):
    """Another rule: the projection of the middles; where that leaves the limits, those of least norm."""
    high, is_within = 700.0, []
    table = by_rule(example, "closed-form", high)
    for k in range(0, 3 * ROWS, 300):
        matrix = matrix_of(robot, table, k)
        wrench = matrix @ table["tension"][k]  # as the residual says
        middle = np.full(8, 0.5 * (LOW + high))
        nearest = middle + np.linalg.lstsq(matrix, wrench - matrix @ middle, rcond=None)[0]
        is_within.append((nearest >= LOW).all() and (nearest <= high).all())
        expected = nearest if is_within[-1] else np.linalg.lstsq(matrix, wrench, rcond=None)[0]
        np.testing.assert_allclose(table["tension"][k], expected, atol=1e-6)
    assert any(is_within)
    assert table["tension_residual"].max() < 1e-9


@pytest.mark.soak
@pytest.mark.parametrize("rule", TENSION_RULES)
def test_every_rule_gives_the_wrench(example, rows, rule):
    """Exact ones within their limits, none farther from the limits than the centred one."""
    table = by_rule(example, rule)
    centred = np.concatenate([own["tension"] for own in rows])
    assert table["tension_residual"].max() < 1e-9
    assert (room(table["tension"]) <= room(centred) + 1e-6).all()
    if TENSION_RULES[rule].is_exact:
        assert (room(table["tension"]) > -1e-6).all()


@pytest.mark.soak
def test_the_example_is_feasible_and_a_rule_that_misses_says_so(tmp_path):
    """With arcs by search, from the command line."""
    code, out, err = cspr("plan", EXAMPLE, "--json")
    assert (code, err) == (0, "") and json.loads(out)["feasible"]
    text = EXAMPLE.read_text().replace('"centred"', '"closed-form"')
    code, out, err = plan(tmp_path, text)
    assert code == 0 and 'tensions = "closed-form": finds none within their limits' in err


@pytest.mark.soak
def test_one_motion_from_python_is_that_of_the_plan():
    """Its states, and its tensions by a rule."""
    own = cspr_jax.load_robot("cogiro")
    found = cspr_jax.plan(FIXED | {"pose": [{"rest": True}, POSE], "samples": 3, "tensions": "least-norm"})
    table, place = found.rows(), found.motions[0].state(np.asarray(1.0))
    with double_precision():
        swing = cspr_jax.platform_motion(
            own,
            None,
            POSE["position"],
            z0=4.0,
            arcs=1,
            orientations=([1.0, 0.0, 0.0, 0.0], place.quaternion),
            beta_hat=found.answers.beta_hat[0],
            amplitude=found.problem.amplitude,
        )
        state = jax.jit(swing.state)(0.5)
        pull = jax.jit(lambda at: cspr_jax.tensions(own, at, "least-norm"))(state)
    np.testing.assert_allclose(state.position, table["position"][1], atol=1e-12)
    np.testing.assert_allclose(state.quaternion, table["quaternion"][1], atol=1e-12)
    np.testing.assert_allclose(pull, table["tension"][1], rtol=1e-9)


@pytest.mark.parametrize("rule", ["middle", "closed-form"])
def test_rules_that_cannot_be_used_are_refused(rule):
    """None of that name; no largest tension."""
    robot = dataclasses.replace(load_robot("cogiro"), limits=Limits())
    swing = cspr_jax.straight_line(load_robot("prototype"), [0, 0, 1.0], [0.1, 0, 1.0], duration=1.0)
    with pytest.raises(InputError, match=f'^rule = "{rule}": must be '):
        cspr_jax.tensions(robot, swing.state(0.5), rule)


@pytest.mark.soak
def test_point_masses_on_more_cables_take_the_key(tmp_path):
    """Least norm: no longer than the centred ones, and the same wrench."""
    text = (example_files.folder() / "straight_line.toml").read_text()
    assert "tensions" not in text
    found = {}
    for rule in ("centred", "least-norm"):
        (tmp_path / "plan.toml").write_text(text.replace("schema = 1", f'schema = 1\ntensions = "{rule}"'))
        found[rule] = cspr_jax.plan(tmp_path / "plan.toml").rows()
    sizes = {rule: np.linalg.norm(table["tension"], axis=1) for rule, table in found.items()}
    assert (sizes["least-norm"] <= sizes["centred"] + 1e-9).all()
    assert (sizes["least-norm"] < sizes["centred"] - 1e-3).any()
    assert max(table["tension_residual"].max() for table in found.values()) < 1e-9
