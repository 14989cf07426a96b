"""Motions in CSV: read back as they were written, checked, and drawn with the plan beside them."""

import json
import re
from csv import DictReader

import numpy as np
import pytest
from plans.test_planning import SHORT
from support.commands import plan

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import StoreError
from cspr_jax.outputs.plots.motions.motion_source import robot_and_plan
from cspr_jax.outputs.plots.robots.robot_along import moving
from cspr_jax.schema.quantities import TRAJECTORY

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
    """One line of names and then numbers: no reader needs an option beyond the comma."""
    path, result = folder / "motion.csv", cspr_jax.open_result(folder / "motion.csv")
    table = np.column_stack([result.axes["t"], *(result.data[name] for name in TRAJECTORY if name in result.data)])
    np.testing.assert_array_equal(np.loadtxt(path, delimiter=",", skiprows=1, comments=None), table)
    np.testing.assert_array_equal(
        np.genfromtxt(path, delimiter=",", names=True)["tension_2"], result.data["tension"][:, 1]
    )
    with path.open(newline="") as file:
        np.testing.assert_array_equal(
            [[float(row["t"]), *map(float, list(row.values())[1:])] for row in DictReader(file)], table
        )
    frame = pytest.importorskip("pandas").read_csv(path)
    assert list(frame)[:2] == ["t", "position_x"]
    np.testing.assert_array_equal(frame.to_numpy(float), table)


UP = """schema = 1
family = "quintic"
samples = 40
[robot]
name = "lab triangle"
base_points = [[0.0, 0.0, 4.0], [3.0, 0.0, 4.0], [1.5, 2.6, 4.0]]
mass = 1.5
z_axis = "up"
[[pose]]
position = [1.5, 0.9, 2.0]
[[pose]]
position = [1.6, 0.8, 1.7]
"""


@pytest.fixture(scope="module")
def upward(tmp_path_factory):
    folder = tmp_path_factory.mktemp("upward")
    assert plan(folder, UP, "-o", str(folder / "motion.csv"))[0] == 0
    (folder / "robot.toml").write_text("\n".join(UP.split("[robot]\n")[1].split("[[pose]]")[0].splitlines()))
    return folder


def is_inverted(path, **given):
    figure = cspr_jax.plot(path, **given)
    panel = next(axes for axes in figure.axes if axes.get_ylabel() == "z (m)")
    return panel.yaxis_inverted(), figure.get_suptitle()


@pytest.mark.thorough
def test_where_z_points(folder, upward):
    """The work of the cables tells it; robot, plan or an option do; so does a comment of an earlier version."""
    down, up = folder / "motion.csv", upward / "motion.csv"
    assert "#" not in up.read_text() and cspr_jax.open_result(up).attributes["z_axis"] == "up"
    assert is_inverted(down)[0] and not is_inverted(up)[0] and "z axis up" in is_inverted(up)[1]
    assert is_inverted(up, z_axis="down")[0] and not is_inverted(up, robot=upward / "robot.toml")[0]
    head, *rows = up.read_text().splitlines(keepends=True)
    earlier = upward / "earlier.csv"
    for axis in ("up", "down"):
        earlier.write_text("".join([head, f"# z: {axis}\n# units: m rad s\n", *rows]))
        result = cspr_jax.open_result(earlier)
        assert result.attributes["z_axis"] == axis and len(result.axes["t"]) == len(rows)
    earlier.write_text("".join([head, "# z: left\n", *rows]))
    with pytest.raises(StoreError, match="z_axis = "):
        cspr_jax.open_result(earlier)


@pytest.mark.thorough
def test_a_level_motion_does_not_tell(upward):
    head, *rows = upward.joinpath("motion.csv").read_text().splitlines()
    names, level = head.split(","), upward / "level.csv"
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[names.index("velocity_z")] = "0.0"
    level.write_text("\n".join([head, *map(",".join, cells)]) + "\n")
    assert "z_axis" not in cspr_jax.open_result(level).attributes
    assert "not known" in is_inverted(level)[1]


def test_the_robot_beside_a_table(upward, capsys):
    """Its axes, its spools and its limits are drawn; one whose cables are others is refused."""
    table, robot = str(upward / "motion.csv"), str(upward / "robot.toml")
    for command, output in (("plot", "summary.svg"), ("report", "page.html")):
        more = ["--quantity", "summary"] if command == "plot" else []
        assert main([command, table, "--robot", robot, *more, "-o", str(upward / output)]) == 0
        assert "lab triangle" in (upward / output).read_text()
        for words, said in (
            (["--robot", "prototype"], "is not that of"),
            (["--robot", "nobody"], 'robot = "nobody"'),
            (["--robot", robot, "--z-axis", "up"], "--z-axis: must be absent with --robot"),
        ):
            assert main([command, table, *words, "-o", str(upward / f"no{output}")]) == 2
            error = capsys.readouterr().err
            assert said in error and error.count("\n") == 1 and not (upward / f"no{output}").exists()


@pytest.mark.thorough
def test_a_motion_of_the_users_own_is_drawn_with_its_robot(upward, capsys):
    own, robot = upward / "own.csv", str(upward / "robot.toml")
    own.write_text("t,x,y,z\n0,1.5,0.9,2\n1,1.55,0.85,1.9\n2,1.6,0.8,1.7\n")
    assert main(["plot", str(own), "-o", str(upward / "no.svg")]) == 4
    assert "needs its robot, --robot" in capsys.readouterr().err
    assert main(["report", str(own), "--robot", robot, "-o", str(upward / "own.html")]) == 0
    inverted, title = is_inverted(own, robot=robot)
    assert not inverted and title.startswith("lab triangle")
    tension = cspr_jax.check(robot, own).plan.to_result().data["tension"]
    np.testing.assert_array_equal(tension, cspr_jax.check(robot, own).plan.rows()["tension"])


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


@pytest.mark.thorough
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
