"""Straight lines in plans, maps, tables and Python: the least time and its verdicts, and what is refused."""

import json

import jax
import numpy as np
import pytest
from oracles import lines as oracle
from support.commands import cspr, plan, planned, refuse_sweep

import cspr_jax
from cspr_jax.errors import InputError
from cspr_jax.families.lines.durations import names_of
from cspr_jax.families.lines.s_model import LONGER
from cspr_jax.published import boralugoda
from cspr_jax.schema.verdicts import Verdict

T, P = 4.37688606, 2.23955703  # by brute force, of section 4


PLAN = """schema = 1
robot = "boralugoda-rectangle"
family = "s-curve"
max_acceleration = 10.0
[[pose]]
position = [1.0, 20.0, 7.0]
[[pose]]
position = [15.0, 28.0, 3.0]
"""


def test_the_plan_of_the_text(tmp_path):
    for rule in ("optimum", "thesis"):
        answer = planned(tmp_path, PLAN.replace("max_acc", f'rule = "{rule}"\nmax_acc', 1))
        (segment,) = answer["segments"]
        assert answer["feasible"] and answer["z0"] is None and answer["amplitude"] is None
        assert segment["duration"] == pytest.approx(T * (1.0 + LONGER), abs=1e-8)
        assert segment["acceleration_time"] == pytest.approx(P, abs=1e-7)
        assert segment["least_duration"] == pytest.approx(3.10085856, abs=1e-8)
        assert segment["active"] == ["cables 3, 4", "cables 1, 4"] and segment["verdict"] == "feasible"
        assert segment["arcs"] is None and segment["tried_arcs"] is None and segment["beta_hat"] is None
        assert 0.0 < segment["margin_bound"] <= segment["margin"] < 1e-6


@pytest.mark.thorough
def test_a_plan_of_several_lines_and_its_rows(tmp_path):
    text = PLAN + '[[pose]]\nposition = [40.0, 4.0, 12.0]\nfamily = "quintic"\n[[pose]]\nposition = [9.0, 9.0, 9.0]\n'
    path = tmp_path / "motion.csv"
    code, out, err = plan(tmp_path, text, "-o", path)
    assert (code, err) == (0, "") and "held back by" in out and "cables 3, 4" in out
    rows = np.genfromtxt(path, delimiter=",", names=True)
    position = np.stack([rows[f"position_{x}"] for x in "xyz"], axis=1)
    acceleration = np.stack([rows[f"acceleration_{x}"] for x in "xyz"], axis=1)
    tension = np.stack([rows[f"tension_{k}"] for k in range(1, 5)], axis=1)
    assert tension.min() > -1e-6
    rays = oracle.BASE[None] - position[:, None]
    forces = (rays / np.linalg.norm(rays, axis=2, keepdims=True) * tension[..., None]).sum(1)
    assert forces == pytest.approx(10.0 * (acceleration + np.array([0, 0, oracle.GRAVITY])), abs=1e-8)
    for row, place in ((0, [1, 20, 7]), (399, [15, 28, 3]), (799, [40, 4, 12]), (-1, [9, 9, 9])):
        assert position[row] == pytest.approx(place, abs=1e-9)
        speed = [rows[f"velocity_{x}"][row] for x in "xyz"]
        assert speed == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("place", "verdict"),
    [
        ("[50.0, 28.0, 3.0]", "slack_cable"),
        ("[15.0, 28.0, 31.0]", "slack_cable+above_spools"),
        ("[15.0, 30.0, 3.0]", "undecided"),
    ],
)
def test_no_motion_at_all_is_a_verdict(tmp_path, place, verdict):
    answer = planned(tmp_path, PLAN.replace("[15.0, 28.0, 3.0]", place), code=1)
    (segment,) = answer["segments"]
    assert segment["verdict"] == verdict and not answer["feasible"]
    assert segment["duration"] is None and segment["active"] == []
    code, out, err = plan(tmp_path, PLAN.replace("[15.0, 28.0, 3.0]", place))
    assert code == 1 and "nan" not in out and err == ""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[15.0, 28.0, 3.0]", "[1.0, 20.0, 7.0]", "pose[1].position"),
        ("max_acceleration = 10.0", "", "max_acceleration is missing"),
        ("max_acceleration = 10.0", "max_acceleration = -1", "max_acceleration"),
        ('family = "s-curve"', 'family = "quintic"\nrule = "thesis"', "rule: must be absent"),
        ('family = "s-curve"', 'family = "s-curve"\nrule = "best"', "rule"),
        ('family = "s-curve"', 'family = "s-curve"\ninclination = 0.1', "inclination"),
        ("position = [15.0, 28.0, 3.0]", "position = [15.0, 28.0, 3.0]\narcs = 2", "pose[1].arcs"),
        ("position = [15.0, 28.0, 3.0]", "rest = true", "z0 is missing"),
        ('"boralugoda-rectangle"', '"laval-mssm"', "family"),
        (
            'robot = "boralugoda-rectangle"\n',
            "rule = 'thesis'\n"
            "robot = { name = 'x', mass = 1, z_axis='up', base_points = [[0,0,30],[45,0,30],[45,30,31],[0,30,30]] }\n",
            "one plane",
        ),
    ],
)
def test_bad_plans(tmp_path, old, new, words):
    text = PLAN.replace(old, new, 1)
    if words.startswith("max_acceleration is"):
        text = text.replace("[15.0, 28.0, 3.0]", "[1.0, 20.0, 9.0]")
    code, out, err = plan(tmp_path, text)
    assert (code, out) == (2, "") and words in err and err.count("\n") == 1


def test_a_key_of_lines_is_refused_elsewhere(tmp_path):
    text = (
        'schema = 1\nrobot = "prototype"\nz0 = 1.7\n{}\n[[pose]]\nrest = true\n[[pose]]\nposition = [0.1, 0.1, 2.0]\n'
    )
    for key in ("max_acceleration = 3.0", 'rule = "optimum"'):
        code, _, err = plan(tmp_path, text.format(key))
        assert code == 2 and "must be absent unless family" in err and err.count("\n") == 1


@pytest.mark.soak
def test_a_line_leads_to_a_transition(tmp_path):
    """A sequence mixes families where position, velocity and acceleration meet: at rest in P0."""
    text = """schema = 1
robot = "boralugoda-triangle"
family = "s-curve"
max_acceleration = 8.0
z0 = 12.0
[[pose]]
position = [20.0, 5.0, 15.0]
[[pose]]
rest = true
[[pose]]
position = [25.0, 14.0, 18.0]
family = "transition"
"""
    answer = planned(tmp_path, text)
    assert answer["feasible"] and [one["family"] for one in answer["segments"]] == ["s-curve", "transition"]
    assert answer["segments"][0]["arcs"] is None and answer["segments"][1]["arcs"] > 0
    code, _, err = plan(tmp_path, text.replace("rest = true", "position = [22.0, 9.0, 18.5]"))
    assert code == 2 and err.count("\n") == 1


def test_tables_of_the_text():
    """Every printed cell of Table 4.3 to its last digit, with the boundaries of five decimals that the text has."""
    cells, seen = boralugoda.table_4_3(), 0
    for (row, column, reading), printed in boralugoda.PUBLISHED["4.3"].items():
        if reading == boralugoda.ROUNDED and row != "search":
            digits = len(printed.partition(".")[2])
            assert round(cells[row, column, reading], digits) == float(printed), (row, column)
            seen += 1
    assert seen == 1240 and len(cells) == 2 * (31 * 40 + 2)
    # The text says 4.35, where its own Max_a is positive.
    for reading in (boralugoda.EXACT, boralugoda.ROUNDED):
        assert (cells["search", "T", reading], cells["search", "p", reading]) == (4.4, 2.25)
        assert cells["T=4.35", "Max_a p=2.25", reading] > 0.0
    over, under = oracle.table_4_3(boralugoda.PERIODS, boralugoda.TIMES)
    for i, time in enumerate(boralugoda.TIMES):
        for j, p in enumerate(boralugoda.PERIODS):
            assert cells[f"T={time:.2f}", f"Max_a p={p:.2f}", boralugoda.ROUNDED] == pytest.approx(over[i, j], abs=2e-6)
            assert cells[f"T={time:.2f}", f"Max_b p={p:.2f}", boralugoda.ROUNDED] == pytest.approx(
                under[i, j], abs=2e-5
            )


def test_other_tables_of_the_text():
    code, out, err = cspr("table", "4.1", "--json")
    assert (code, err) == (0, "")
    cells = {(cell["row"], cell["column"]): cell["computed"] for cell in json.loads(out)["cells"]}
    assert cells["Solution 4", "T"] == pytest.approx(T, abs=1e-8)
    assert cells["Solution 4", "p"] == pytest.approx(P, abs=1e-8)
    assert cells["Solution 3", "T"] == -cells["Solution 4", "T"]
    assert cells["Solution 1", "imaginary T"] == pytest.approx(-0.138, abs=5e-4)
    # The text gives T and p one sign.
    assert cells["Solution 1", "imaginary p"] == pytest.approx(7.774, abs=5e-4)
    law = boralugoda.table_4_2()
    # Each reading misses one of the eight printed numbers by one in its last digit, and each another one.
    misses = {key: law[key] for key, text in boralugoda.PUBLISHED["4.2"].items() if round(law[key], 3) != float(text)}
    assert len(law) == len(boralugoda.PUBLISHED["4.2"]) == 16
    assert misses == {
        ("3.308 <= t <= 4.377", "intercept", boralugoda.EXACT_TIMES): pytest.approx(-1.75125, abs=5e-6),
        ("2.240 <= t < 3.308", "intercept", boralugoda.ROUNDED_TIMES): pytest.approx(0.89650, abs=5e-6),
    }
    for i, t in enumerate((0.5, 1.5, 2.5, 4.0)):
        row = boralugoda.RANGES[i]
        value = law[row, "slope", boralugoda.EXACT_TIMES] * t + law[row, "intercept", boralugoda.EXACT_TIMES]
        assert value == pytest.approx(oracle.s_curve(np.array([t]), P, T)[2][0], abs=1e-7)


SWEEP = """schema = 1
map = "least-time"
robot = "boralugoda-rectangle"
[axes]
x = [-1, 15, 40]
y = [28, 20]
z = [3, 7, 31]
[trajectory]
family = "s-curve"
max_acceleration = 10
from = { position = [15, 20, 7] }
"""


def test_the_map_is_plans(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SWEEP, "utf-8")
    code, out, err = cspr("run", path, "-o", tmp_path / "out")
    assert (code, err) == (0, "")
    data = cspr_jax.open_result(out.strip()).to_xarray()
    for x in (-1, 15, 40):
        for y in (28, 20):
            for z in (3, 7, 31):
                here = data.sel(x=x, y=y, z=z)
                if (x, y, z) == (15, 20, 7):  # where it starts
                    assert here.verdict == 0 and here.duration == 0.0
                    continue
                text = PLAN.replace("[1.0, 20.0, 7.0]", "[15, 20, 7]").replace("[15.0, 28.0, 3.0]", f"[{x}, {y}, {z}]")
                (segment,) = planned(tmp_path, text, code=int(here.verdict.item() != 0))["segments"]
                assert Verdict(here.verdict.item()).text == segment["verdict"]
                if here.verdict == 0:
                    for name in ("duration", "acceleration_time", "least_duration"):
                        assert here[name].item() == pytest.approx(segment[name], rel=1e-12)
                    names = names_of(cspr_jax.load_robot("boralugoda-rectangle"), cspr_jax.Limits())
                    active = [names[here[side].item() - 1] for side in ("active_up", "active_down")]
                    assert list(dict.fromkeys(active)) == segment["active"]
                else:
                    assert np.isnan(here.duration) and segment["duration"] is None and here.active_up == 0
    code, _, err = cspr("plot", out.strip(), "-o", tmp_path / "a.png", "--at", "z=3")
    assert (code, err) == (0, "")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("from = { position = [15, 20, 7] }", "from = { rest = true }", "trajectory.from"),
        ("from = { position = [15, 20, 7] }", "", "trajectory.from"),
        ('family = "s-curve"', 'family = "quintic"', "trajectory.family"),
        ("max_acceleration = 10", "max_acceleration = 0", "max_acceleration"),
        ("max_acceleration = 10", 'rule = "thesis"', "trajectory.rule"),
        ("[axes]", "[limits]\ntension_min = -1\n[axes]", "limits"),
    ],
)
def test_bad_sweeps(tmp_path, old, new, words):
    refuse_sweep(tmp_path, SWEEP.replace(old, new, 1), words)


def test_from_python():
    robot = cspr_jax.load_robot("boralugoda-rectangle")
    answers = cspr_jax.least_time(robot, [[15, 28, 3], [50, 1, 1]], start=[1, 20, 7], max_acceleration=10)
    assert answers.duration[0] == pytest.approx(T, abs=1e-7) and answers.verdict.tolist() == [0, 1]
    data = answers.to_xarray()
    assert data.least_duration.attrs["units"] == "s" and data.sizes == {"target": 2}
    line = cspr_jax.straight_line(robot, [1, 20, 7], [15, 28, 3], duration=T, acceleration_time=P)
    s, pace, second_derivative = (x[0] for x in oracle.s_curve(np.array([1.7]), P, T))
    state, way = line.state(1.7 / T), np.array([14.0, 8.0, -4.0])
    for own, wanted in zip(
        state[:3], (np.array([1.0, 20.0, 7.0]) + s * way, pace * way, second_derivative * way), strict=True
    ):
        assert own == pytest.approx(wanted, abs=1e-9)
    assert cspr_jax.tensions(robot, state).shape == (4,) and float(cspr_jax.tensions(robot, state).min()) > 0.0

    def height(duration):
        return cspr_jax.straight_line(robot, [1, 20, 7], [15, 28, 3], duration=duration).state(0.2).acceleration[2]

    step = (height(4.0 + 1e-5) - height(4.0 - 1e-5)) / 2e-5
    assert jax.grad(height)(4.0) == pytest.approx(float(step), rel=1e-7)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"max_acceleration": 0.0}, "max_acceleration"),
        ({"start": [1, 2]}, "start"),
        ({"start": [[1, 2, 3]] * 3}, "start"),
        ({"targets": [[1, np.inf, 3]]}, "targets"),
    ],
)
def test_bad_arguments(given, words):
    robot = cspr_jax.load_robot("boralugoda-rectangle")
    with pytest.raises(InputError, match=words):
        cspr_jax.least_time(robot, **{"targets": [[1, 1, 1]], "start": [2, 2, 2]} | given)
    with pytest.raises(InputError, match="law"):
        cspr_jax.straight_line(robot, [1, 1, 1], [2, 2, 2], duration=1.0, law="septic")
    with pytest.raises(InputError, match="point mass"):
        cspr_jax.least_time(cspr_jax.load_robot("laval-mssm"), [[1, 1, 1]], start=[2, 2, 2])


@pytest.mark.thorough
def test_what_a_reviewer_broke(tmp_path):
    """Spools as places, limits of the robot itself, floors of tilted planes, ends that are one place, fastest z0."""
    robot = cspr_jax.load_robot("boralugoda-rectangle")
    at_spool = cspr_jax.available_accelerations(robot, [[0, 0, 30], [45, 30, 30]])
    assert (at_spool.margin([0, 0, 0]) <= 0.0).all() and (at_spool.verdict([5, 5, -50]) & Verdict.SINGULAR).all()
    limited = cspr_jax.point_mass(
        oracle.BASE, mass=10.0, z_axis="up", limits=cspr_jax.Limits(tension_max=np.full(4, 20.0))
    )
    answers = cspr_jax.least_time(limited, [oracle.END], start=oracle.START, max_acceleration=10.0)
    assert answers.verdict.tolist() == [Verdict.OVER_TENSION.value] and np.isnan(answers.duration[0])
    near = cspr_jax.least_time(
        robot, [[20, 20, 5]] * 2, start=[[22, 15, 30 - 3e-12], [22, 15, 30 - 1e-6]], max_acceleration=10
    )
    assert near.duration[0] == pytest.approx(near.duration[1], rel=1e-4) and np.isfinite(near.rest_margin).all()
    above = cspr_jax.least_time(robot, [[20, 15, 32]], start=[20, 15, 7], max_acceleration=10.0)
    assert above.verdict[0] & Verdict.ABOVE_SPOOLS and np.isnan(above.rest_margin[0])
    tilted = "robot = { name = 'x', mass = 1, z_axis='up', base_points = [[0,0,10],[10,0,15],[10,8,15],[0,8,10]] }\n"
    text = PLAN.replace('robot = "boralugoda-rectangle"', tilted + "floor = FLOOR").replace(
        "[1.0, 20.0, 7.0]", "[9, 4, 13.4]"
    )
    text = text.replace("[15.0, 28.0, 3.0]", "[9, 6, 13]")
    assert planned(tmp_path, text.replace("FLOOR", "100.0"), code=1)["segments"][0]["verdict"] == "below_floor"
    assert planned(tmp_path, text.replace("FLOOR", "0.0"))["segments"][0]["verdict"] == "feasible"
    assert planned(tmp_path, PLAN.replace("[[pose]]", "tension_min = 0.0\n[[pose]]", 1))["feasible"]
    code, _, err = plan(tmp_path, PLAN.replace("[15.0, 28.0, 3.0]", "[1, 20, 7.000000000000004]"))
    assert code == 2 and "pose[1].position: must be another" in err and err.count("\n") == 1
    outside = PLAN.replace("[15.0, 28.0, 3.0]", "[-1, 20, 3]")
    code, _, err = plan(tmp_path, outside, "--anyway", "-o", tmp_path / "x.csv", "--rate", 100)
    assert code == 2 and err.count("\n") == 1 and "not written" in err
    rest = PLAN.replace("position = [15.0, 28.0, 3.0]", "rest = true")
    times = [
        planned(tmp_path, rest.replace("family", f'z0 = {{ choose = "{rule}" }}\nfamily', 1))["total_duration"]
        for rule in ("fastest", "mean")
    ]
    assert times[0] <= times[1] * 1.01  # by search over a grid
    for line in ("x = [10]\ny = [0]\nz = [10]", "x = [10]\ny = [0]\nz = [10]\nfrom_y = [8]"):
        sweep = SWEEP.replace("rectangle", "planar-two").replace("x = [-1, 15, 40]\ny = [28, 20]\nz = [3, 7, 31]", line)
        sweep = sweep if "from_y" in line else sweep.replace("[15, 20, 7]", "[5, 12, 7]")
        (tmp_path / "s.toml").write_text(sweep.replace("[15, 20, 7]", "[15, 0, 7]"), "utf-8")
        code, _, err = cspr("run", tmp_path / "s.toml", "-o", tmp_path / "out")
        assert code == 2 and "y" in err and err.count("\n") == 1
