"""Motions in CSV: read back as they were written, checked, and drawn with the plan beside them."""

import json
import re

import numpy as np
import pytest
from plans.test_planning import SHORT
from support.commands import plan

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import StoreError
from cspr_jax.outputs.plots.motion_source import robot_and_plan
from cspr_jax.outputs.plots.robot_along import moving

PLATFORM = """schema = 1
robot = "cogiro"
family = "hypocycloid"
amplitude = { name = "effective-c3", epsilon = 0.3 }
z0 = 4.0
samples = 30
[[pose]]
rest = true
[[pose]]
position = [1.5, 1.0, 1.6]
tilt_torsion = [0.3, 0.1, 0.2]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")
    (folder / "plan.toml").write_text(SHORT)
    for ending in ("csv", "h5"):
        assert plan(folder, SHORT, "-o", str(folder / f"motion.{ending}"))[0] == 0
    return folder


def changed(folder, change):
    path = folder / "changed.csv"
    path.write_bytes(change((folder / "motion.csv").read_bytes()))
    return path


def test_columns_come_back_as_they_were(folder):
    table, file = (cspr_jax.open_result(folder / f"motion.{ending}") for ending in ("csv", "h5"))
    np.testing.assert_array_equal(table.axes["t"], file.axes["t"])
    of_rows = [name for name in file.data if not name.startswith("segment")]
    assert sorted(table.data) == sorted(of_rows)
    for name in of_rows:
        np.testing.assert_array_equal(table.data[name], file.data[name])
    assert table.attributes["robot"] == "motion"
    assert (table.units, table.labels)[0]["tension"] == "N"


def test_other_tools_read_the_same_table(folder):
    """The first line names the columns, and comments below it say units and axes."""
    lines = (folder / "motion.csv").read_text().splitlines()
    assert lines[0].startswith("t,position_x") and lines[1:3] == ["# z: down", "# units: m rad s"]
    own = np.genfromtxt(folder / "motion.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(own["tension_2"], cspr_jax.open_result(folder / "motion.csv").data["tension"][:, 1])


def test_a_table_is_verified(folder, capsys):
    assert main(["verify", str(folder / "motion.csv"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["faults"] == [] and report["rows"] == len(cspr_jax.open_result(folder / "motion.csv").axes["t"])


@pytest.mark.parametrize(
    "change",
    [
        lambda text: b"\xef\xbb\xbf" + text,
        lambda text: text.replace(b"\n", b"\r\n"),
        lambda text: (
            b"\n".join(line + (b",feasible" if k == 0 else b",1") for k, line in enumerate(text.splitlines())) + b"\n"
        ),
    ],
)
def test_what_spreadsheets_add_is_read(folder, change):
    table = cspr_jax.open_result(changed(folder, change))
    np.testing.assert_array_equal(table.data["tension"], cspr_jax.open_result(folder / "motion.csv").data["tension"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: b"", "column "),
        (lambda text: text.split(b"\n")[0] + b"\n", "no rows"),
        (lambda text: text[:-1], "its last line is cut off"),
        (lambda text: text[:-40] + b"\n", "its rows cannot be read"),
        (lambda text: text.replace(b"position_x", b"place_x"), 'column "place_x"'),
        (lambda text: text.replace(b"position_z,", b""), "no column position_z"),
        (lambda text: text.replace(b"tension_1,tension_2", b"tension_2,tension_1"), 'column "tension_2"'),
        (lambda text: text.replace(b"t,position_x", b"time,position_x"), 'column "time"'),
        (lambda text: re.sub(rb"\n([^,]+),[^,]+", rb"\n\1,x", text, count=1), "its rows cannot be read"),
        (lambda text: re.sub(rb"\n([^,]+),[^,]+", rb"\n\1,nan", text, count=1), "position holds numbers"),
        (lambda text: re.sub(rb"\n([^,]+),[^,]+", rb"\n\1,1e99", text, count=1), "position holds numbers"),
        (lambda text: re.sub(rb"\n([^,]+),", rb"\n1e6,", text, count=1), "its time runs backwards"),
        (lambda text: re.sub(rb"\n([^,]+),[^,]+", rb"\n\1", text, count=1), "its rows cannot be read"),
        (lambda text: text.replace(b"\n", b",2\n").replace(b",2\n", b",feasible\n", 1), "feasible holds another"),
        (lambda text: b"\xff\xfe" + text, "cannot be read"),
        (lambda text: b"\x89HDF\r\n" + text, "cannot be read"),
    ],
)
def test_damage_is_one_line(folder, capsys, change, said):
    path = changed(folder, change)
    with pytest.raises(StoreError, match=re.escape(said)):
        cspr_jax.open_result(path)
    for command in (["verify", str(path)], ["plot", str(path)], ["report", str(path)]):
        assert main(command) == 4
        out, error = capsys.readouterr()
        assert out == "" and said in error and str(path) in error and error.count("\n") == 1
    assert not path.with_suffix(".png").exists() and not path.with_suffix(".html").exists()


def test_pictures_of_a_table(folder, capsys):
    """What the columns hold alone; robot and limits with the plan."""
    table, words = str(folder / "motion.csv"), ["--plan", str(folder / "plan.toml")]
    assert main(["plot", table, "-o", str(folder / "over_time.svg")]) == 0
    assert main(["plot", table, "--quantity", "summary", "-o", str(folder / "no.svg")]) == 2
    assert "--plan FILE.toml" in capsys.readouterr().err and not (folder / "no.svg").exists()
    assert main(["plot", table, "--quantity", "summary", *words, "-o", str(folder / "summary.svg")]) == 0
    assert "prototype" in (folder / "summary.svg").read_text()


def test_a_page_of_a_table(folder, capsys):
    table = str(folder / "motion.csv")
    assert main(["report", table, "-o", str(folder / "alone.html")]) == 0
    assert main(["report", table, "--plan", str(folder / "plan.toml"), "-o", str(folder / "planned.html")]) == 0
    alone, planned = ((folder / f"{name}.html").read_text("utf-8") for name in ("alone", "planned"))
    assert '"base":[],' in alone and "on 3 cables" in planned


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PLATFORM, "has 8 cables"),
        (SHORT.replace('"prototype"', '"boralugoda-triangle"'), "is not that of"),
        (SHORT.replace("[[pose]]", "[[poses]]"), "poses"),
    ],
)
def test_the_plan_of_another_robot_is_refused(folder, capsys, text, said):
    (folder / "other.toml").write_text(text)
    for command in ("plot", "report"):
        output = folder / ("no.png" if command == "plot" else "no.html")
        words = [command, str(folder / "motion.csv"), "--plan", str(folder / "other.toml"), "-o", str(output)]
        assert main(words) == 2
        error = capsys.readouterr().err
        assert said in error and "other.toml" in error and error.count("\n") == 1
        assert not output.exists()


def test_a_plan_goes_with_tables_alone(folder, capsys):
    assert main(["plot", str(folder / "motion.h5"), "--plan", str(folder / "plan.toml")]) == 2
    assert "--plan" in capsys.readouterr().err


@pytest.mark.thorough
def test_the_platform_stands_where_its_cables_end(tmp_path):
    """Also where the mass centre, whose position a motion holds, is not the origin of the platform's points."""
    assert plan(tmp_path, PLATFORM, "-o", str(tmp_path / "motion.h5"))[0] == 0
    result = cspr_jax.open_result(tmp_path / "motion.h5")
    robot_file, _ = robot_and_plan(result, "motion.h5", "trajectory")
    assert np.linalg.norm(resolve_robot("cogiro", "", tmp_path).centre_of_mass) > 0.1
    robot = moving(result.data, robot_file, np.arange(len(result.axes["t"])))
    np.testing.assert_allclose(
        np.linalg.norm(robot.attached - robot.base, axis=2), result.data["length"], rtol=0.0, atol=1e-9
    )
