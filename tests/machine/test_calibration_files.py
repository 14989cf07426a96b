"""`cspr calibrate`: tables of measurements, robot files, mistakes in either."""

import tomllib

import numpy as np
import pytest
from support.commands import cspr, strict_json
from support.prism import PRISM, prism_case

import cspr_jax

ROBOT = f"""# mine
name = "prism"
mass = 1.0
base_points = {PRISM.tolist()}
tension_max = 60.0
cable_speed_max = [1.0, 2, 3.0]
source = "drawn"

[winch]
drum_radius = 0.05
gear_ratio = 5
zero_length = 1.0
direction = [1, -1, 1]
"""
HEAD = "length_1,length_2,length_3,x,y,z"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").write_text(ROBOT, "utf-8")
    return tmp_path


def rows(*columns):
    return [",".join(f"{value:.17g}" for value in row) for row in np.hstack(columns)]


def test_a_table_becomes_a_robot_file(folder):
    """Lengths in millimetres, a gap, a mistake, comments: as arrays in Python, and nothing is overwritten."""
    _, _, readings, seen, _ = prism_case(3, 1e-4)
    readings[7, 2] += 0.05
    lines = ["# measured by hand", "row," + HEAD.replace("length_1", "length_1 [mm]")]
    lines += [f"{k},{text}" for k, text in enumerate(rows(readings * [1000.0, 1.0, 1.0], seen))]
    lines[2 + 4] = ",".join([*lines[2 + 4].split(",")[:3], "", *lines[2 + 4].split(",")[4:]])
    (folder / "m.csv").write_text("\n".join(lines), "utf-8")
    code, out, err = cspr("calibrate", "m.csv", "--robot", "robot.toml", "--json", "-o", "new.toml", "--next", "2")
    assert (code, err) == (0, "")
    found = strict_json(out)
    readings[4, 2] = np.nan
    result = cspr_jax.calibrate(folder / "robot.toml", readings, seen)
    values = {row["name"]: row["value"] for row in found["parameters"]}
    base = np.asarray(result.robot.base_points)
    assert values["spool 2 y"] == pytest.approx(base[1, 1], abs=1e-12)
    assert [(row["row"], row["column"]) for row in found["mistakes"]] == [(10, "length_3")]
    assert len(found["next"]) == 2 and found["uncertainty"]["spool_positions"] < 5e-3
    text = (folder / "new.toml").read_text("utf-8")
    spec, before = tomllib.loads(text), tomllib.loads(ROBOT)
    np.testing.assert_allclose(spec["base_points"], base, atol=1e-12, rtol=0.0)
    assert list(spec) == list(before) and spec | {"base_points": 0} == before | {"base_points": 0}
    assert "# calibrated by cspr_jax" in text and "m.csv" in text and "spool_positions = 0.00" in text
    assert np.asarray(cspr_jax.load_robot(folder / "new.toml").base_points).tolist() == spec["base_points"]
    again = cspr("calibrate", "m.csv", "--robot", "robot.toml", "-o", "new.toml")
    assert again[:2] == (3, "") and "is there already" in again[2]
    code, out, err = cspr("calibrate", "m.csv", "--robot", "robot.toml", "-o", "new.toml", "--replace")
    assert (code, err) == (0, "") and "left out: line 10, length_3" in out and "spool 3 z" in out


def test_a_folder_that_is_not_there_is_seen_before_anything_is_read(folder):
    code, out, err = cspr("calibrate", "none.csv", "--robot", "none.toml", "--device", "cpu", "-o", "no/b.toml")
    assert (code, out) == (4, "") and "no/b.toml" in err and "none" not in err and len(err.splitlines()) == 1, err
    assert not list(folder.glob("no*"))


def test_angles_set_the_zero_of_the_winches(folder):
    spools, offsets, readings, seen, _ = prism_case(4, 0.0)
    angles = 5.0 * np.array([1.0, -1.0, 1.0]) * (readings - 1.0) / 0.05
    (folder / "a.csv").write_text("\n".join([HEAD.replace("length", "angle"), *rows(angles, seen)]), "utf-8")
    code, _, err = cspr("calibrate", "a.csv", "--robot", "robot.toml", "-o", "b.toml")
    assert (code, err) == (0, "")
    robot = cspr_jax.load_robot(folder / "b.toml")
    np.testing.assert_allclose(robot.base_points, spools, atol=1e-10, rtol=0.0)
    np.testing.assert_allclose(robot.winches.zero_length, 1.0 + offsets, atol=1e-10, rtol=0.0)
    np.testing.assert_allclose(robot.winches.gear_ratio, 5.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "m.csv: is empty: must be a line with names of columns, length_1"),
        (f"{HEAD}\n", "m.csv: a header line alone: must be a line with names of columns, length_1"),
        ("length_1,length_2,length_4\n1,1,1", 'line 1, column 3: "length_4": did you mean length_'),
        ("length_1,x,x\n1,1,1", 'line 1, column 3: "x": stands twice'),
        ("length_1,angle_2\n1,1", "line 1: lengths and angles: must be one of them"),
        ("x,y,z\n1,1,1", "line 1: no column length_1 or angle_1: must have 3"),
        ("length_1 [deg],x\n1,1", 'line 1, column 1: "length_1 [deg]": unit "deg": must be "m", "dm"'),
        ("length_1,qw,qx\n1,1,0", "line 1: no column qy: must have qw, qx, qy, qz, or none"),
        (f"{HEAD}\n1,1,1,0,0", "line 2: 5 values: must be 6, as in the header"),
        (f"# a\n{HEAD}\n1,1,1,0,0,one", 'line 3, column 6: z = "one": must be a finite number, or empty'),
        (f"{HEAD}\n1,inf,1,0,0,1", 'line 2, column 2: length_2 = "inf": must be a finite number'),
        ("length_1,qw,qx,qy,qz\n1,1,0,0,", "line 2: qz is empty: must be a number"),
        ("length_1,qw,qx,qy,qz\n1,1,0,1,0", "line 2: quaternion (1, 0, 1, 0) of length 1.41421: must be of length 1"),
        (f"{HEAD}\n,,,0,0,1", "lengths: nothing was measured"),
        ("length_1,length_2,length_3\n1,1,1", "measurements: 3 at most at a pose: must be more than 3"),
    ],
)
def test_wrong_tables_are_refused_in_one_line(folder, text, words):
    (folder / "m.csv").write_text(text, "utf-8")
    code, out, err = cspr("calibrate", "m.csv", "--robot", "robot.toml", "-o", "n.toml")
    assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err
    assert not (folder / "n.toml").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--sigma", "a"], "--sigma: a: must be 1 or 2 or 3 finite numbers > 0, separated by commas"),
        (["--sigma", "1e-4,0"], "--sigma: 1e-4,0: must be 1 or 2 or 3 finite numbers > 0"),
        (["--next", "-3"], "--next: -3: must be an integer from 0 to 1000"),
        (["-o", "n.json"], "-o: n.json: must end in .toml"),
        (["--free", "spools,drum"], 'free = "drum": did you mean drums?'),
        (["--distances", "d.csv"], "d.csv: line 2: second = 9: must be a cable, from 1 to 3"),
        (["--limits", "l.toml", "--next", "2"], "l.toml: unknown key flor"),
    ],
)
def test_wrong_options_are_refused_in_one_line(folder, options, words):
    _, _, readings, seen, _ = prism_case(4, 0.0)
    (folder / "m.csv").write_text("\n".join([HEAD, *rows(readings, seen)]), "utf-8")
    (folder / "d.csv").write_text("first,second,distance,deviation\n1,9,0.6,1e-3\n", "utf-8")
    (folder / "l.toml").write_text("flor = 0.3\n", "utf-8")
    code, out, err = cspr("calibrate", "m.csv", "--robot", "robot.toml", *options)
    assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err
