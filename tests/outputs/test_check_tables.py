"""Tables and JSON of checks and plans: inequalities in the axes of the robot file, units of margins, rows over time."""

import json

import numpy as np
import pytest
from support.commands import cspr, strict_json

import cspr_jax
from cspr_jax.cli.command import print_table
from cspr_jax.outputs import plan_report
from cspr_jax.outputs.plots.pages.motions import motion_content

BASE = np.array([[0.0, 0.0, 4.0], [3.0, 0.0, 4.0], [1.5, 2.6, 4.0]])
PLACES = np.array([[1.5, 0.8, 2.0], [1.6, 0.8, 2.1], [1.7, 0.8, 2.2]])
TURN = np.array([1.0, -1.0, -1.0])


def checked(z_axis, floor):
    turn = np.ones(3) if z_axis == "up" else TURN
    robot = cspr_jax.point_mass(BASE * turn, mass=1.5, z_axis=z_axis)
    return cspr_jax.check(robot, [0.0, 1.0, 2.0], PLACES * turn, limits={"floor": floor * turn[2], "speed_max": 5.0})


@pytest.mark.parametrize("z_axis", ["up", "down"])
@pytest.mark.parametrize("floor", [0.3, 2.05])
def test_the_floor_is_below(z_axis, floor, capsys):
    check = checked(z_axis, floor)
    assert check.feasible is (floor < 2.0)
    for row in check.demands.values():
        if row["allowed"] is None:
            continue
        holds = row["value"] >= row["allowed"] if row["sense"] == "at least" else row["value"] <= row["allowed"]
        assert holds or row is check.demands["floor"]
        margins = [row[name] - row["allowed"] for name in ("value", "bound")]
        assert row["sense"] in ("at least", "at most") and (margins[1] <= margins[0]) is (row["sense"] == "at least")
    row = check.demands["floor"]
    assert row["sense"] == ("at least" if z_axis == "up" else "at most")
    assert (row["value"] >= row["allowed"]) is (check.feasible == (z_axis == "up"))
    assert row["allowed"] == pytest.approx(floor if z_axis == "up" else -floor)
    assert all(cause["needed"] == row["value"] and cause["allowed"] == row["allowed"] for cause in check.cause)
    print_table(check.to_table())
    line = next(line for line in capsys.readouterr().out.splitlines() if "lowest z" in line)
    sign = "≥" if z_axis == "up" else "≤"
    assert line.count(sign) == 2 and f"{sign} {row['allowed']:.5g}" in line


ROBOT = """name = "lab triangle"
base_points = [[0.0, 0.0, 4.0], [3.0, 0.0, 4.0], [1.5, 2.6, 4.0]]
mass = 1.5
z_axis = "up"
"""


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    (folder / "robot.toml").write_text(ROBOT)
    np.savetxt(folder / "own.csv", np.c_[[0.0, 1.0, 2.0], PLACES], delimiter=",", header="t,x,y,z", comments="")
    return folder


def test_rows_in_json(own):
    """With --rate, JSON has the rows, or the file that -o names; both are those of the CSV."""
    words = ["check", own / "own.csv", "--robot", own / "robot.toml", "--rate", "10"]
    code, out, err = cspr(*words, "--json")
    found = strict_json(out)
    rows, check = found["rows"], cspr_jax.check(own / "robot.toml", own / "own.csv")
    assert (code, err, found["units"]["tension"]) == (0, "", "N") and len(rows["t"]) == 21
    assert rows == {name: values.tolist() for name, values in check.plan.rows(10.0).items()}
    assert found["last_step"] == pytest.approx(0.1)
    code, out, err = cspr(*words, "-o", own / "out.json")
    assert (code, err) == (0, "") and "the last row" not in out
    written = json.loads((own / "out.json").read_text())
    assert written["rows"] == rows and (written["z_axis"], written["robot"]) == ("up", "lab triangle")
    assert written["feasible"] is True and written["units"] == found["units"]
    assert "rows" not in strict_json(cspr(*words, "--json", "-o", own / "out.csv")[1])
    assert cspr(*words)[0] == 2 and "without -o, --setpoints or --json" in cspr(*words)[2]


def test_rows_of_what_is_not_feasible(own):
    (own / "limits.toml").write_text("floor = 2.1")
    words = ["check", own / "own.csv", "--robot", own / "robot.toml", "--limits", own / "limits.toml", "--rate", "7"]
    code, out, err = cspr(*words, "--json")
    assert code == 1 and strict_json(out)["rows"] is None and "--anyway gives them" in err
    assert len(strict_json(cspr(*words, "--json", "--anyway")[1])["rows"]["t"]) == 15
    code, out, err = cspr(*words, "-o", own / "no.json")
    assert code == 1 and not (own / "no.json").exists() and "--anyway writes it" in err


def test_the_last_row_is_on_the_grid_or_said(own):
    words = ["check", own / "own.csv", "--robot", own / "robot.toml", "-o", own / "out.csv", "--rate"]
    assert "the last row" not in cspr(*words[:-1])[1]
    for rate, is_said in ((5, False), (7.3, True)):
        out, t = cspr(*words, rate)[1], np.loadtxt(own / "out.csv", delimiter=",", skiprows=1)[:, 0]
        assert (f"{t[-1] - t[-2]:.6g} s after the one before" in out) is is_said
        step = strict_json(cspr(*words, rate, "--json")[1])["last_step"]
        assert step == pytest.approx(t[-1] - t[-2]) and (step < (1.0 - 1e-6) / rate) is is_said


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (8.0, 9.4, "retimed: 8 s -> 9.4 s (18 % longer)"),
        (8.0, 9.36, "retimed: 8 s -> 9.36 s (17 % longer)"),
        (2.0, 0.5, "retimed: 2 s -> 0.5 s (75 % shorter)"),
        (2.0, 1.99, "retimed: 2 s -> 1.99 s (0.5 % shorter)"),
        (2.0, 2.0, "retimed: 2 s -> 2 s (as long)"),
    ],
)
def test_what_running_along_again_has_made(before, after, words):
    assert plan_report.retimed_words(before, after) == words


def heads(plan):
    return [str(column.header) for column in plan.to_table().columns]


@pytest.mark.thorough
def test_margins_are_newtons(own):
    """Of segments in the table and JSON, in motion files, and so in pages."""
    keys = {"schema": 1, "robot": str(own / "robot.toml"), "samples": 30}
    poses = [{"position": PLACES[0].tolist()}, {"position": PLACES[2].tolist()}]
    spline = {"family": "spline", "pose": [poses[0], poses[1] | {"time": 2.0}]}
    for family, unit in ((spline, "N"), ({"family": "quintic", "pose": poses}, "m/s^2")):
        plan = cspr_jax.plan(keys | family)
        (segment,) = plan.to_dict()["segments"]
        assert segment["margin_unit"] == unit and "margin (N)" in heads(plan)
        result = plan.to_result()
        content = motion_content("", result.axes | result.data, result.data, plan.robot_file, plan.keys)
        assert content["segments"][0]["margin"] == segment["tension_margin"] == plan.tension_margin[0]
