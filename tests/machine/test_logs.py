"""Logs of machines: what was put into synthetic ones is found again; tables are read, and mistakes told."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.config.cable_logs import read_cable_log
from cspr_jax.errors import ConfigError
from cspr_jax.machine.logs import delay, disagreement
from cspr_jax.outputs.logs import log_report
from cspr_jax.outputs.plots.pages.logs import log_content

PLACES = [([0.0, 0.0, 1.2], 0.0), ([0.1, 0.05, 1.1], 1.5), ([0.0, 0.1, 1.3], 3.0)]
WIDE = [([0.0, 0.0, 2.0], 0.0), ([1.0, 0.5, 2.2], 3.0), ([0.0, -0.6, 1.8], 6.0)]


def _spec(robot, places):
    poses = [{"position": position, "time": time} for position, time in places]
    return {"schema": 1, "robot": robot, "family": "spline", "pose": poses}


@pytest.fixture(scope="module")
def planned():
    """A plan of three cables, and its rows."""
    spec = _spec("prototype", PLACES)
    return spec, cspr_jax.plan(spec).rows(500.0)


def _played(rows, rng, *, late, noise=1e-4):
    """Times, lengths and tensions of a machine that plays rows late, at unequal steps, at rest before and behind."""
    times = np.arange(-0.2, rows["t"][-1] + 0.5, 0.01)
    times = times + rng.uniform(-0.003, 0.003, len(times))
    columns = {
        name: np.stack([np.interp(times - late, rows["t"], column) for column in rows[name].T], axis=1)
        for name in ("length", "tension")
    }
    return times, columns["length"] + noise * rng.normal(size=columns["length"].shape), columns["tension"]


def _written(path, times, lengths, tensions=None, name="length"):
    count = lengths.shape[1]
    heads = ["t", *(f"{name}_{k + 1}" for k in range(count))]
    table = [times[:, None], lengths]
    if tensions is not None:
        heads += [f"tension_{k + 1}" for k in range(count)]
        table.append(tensions)
    lines = ["# recorded", ",".join(heads)]
    for row in np.concatenate(table, axis=1):
        lines.append(",".join("" if np.isnan(value) else repr(float(value)) for value in row))
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("late", [0.0537, -0.031])
def test_delay_and_errors_of_three_cables(planned, tmp_path, late):
    spec, rows = planned
    rng = np.random.default_rng(1)
    times, lengths, _ = _played(rows, rng, late=late)
    lengths[40, 1] = np.nan
    found = cspr_jax.compare_log(_written(tmp_path / "log.csv", times, lengths), spec)
    assert abs(found.delay.value - late) < 4.0 * found.delay.deviation < 0.004
    assert len(found.rows) == len(times) - 1 and found.within_tolerance and found.angle_errors is None
    assert found.position_errors.max() < 0.002 < found.position_errors_before.max()
    assert np.abs(found.delay.offsets).max() < 5e-5
    assert "cannot be told" in " ".join(found.lines()) and found.to_dict()["disagreeing_cable"] is None


def test_without_noise_the_delay_is_exact(planned, tmp_path):
    spec, rows = planned
    times, lengths, _ = _played(rows, np.random.default_rng(2), late=0.0421, noise=0.0)
    found = cspr_jax.compare_log(_written(tmp_path / "log.csv", times, lengths), spec)
    # Rows at 500 Hz are interpolated by straight lines here.
    assert abs(found.delay.value - 0.0421) < 1e-5 and found.position_errors.max() < 1e-5


@pytest.mark.thorough
def test_deviation_of_the_delay_is_that_of_many_logs():
    """Monte Carlo of white noise."""
    times, rng = np.linspace(0.0, 5.0, 400), np.random.default_rng(3)

    def planned(at):
        return np.stack([np.sin(1.3 * at), 0.5 * np.cos(2.0 * at)], axis=1)

    def rate(at):
        return np.stack([1.3 * np.cos(1.3 * at), -np.sin(2.0 * at)], axis=1)

    clean = planned(times - 0.1)
    found = [delay.delay_of(times, clean + 0.01 * rng.normal(size=clean.shape), planned, rate, 0.5) for _ in range(60)]
    errors, deviations = np.array([one.value for one in found]) - 0.1, np.array([one.deviation for one in found])
    assert abs(errors.mean()) < 3.0 * errors.std() / np.sqrt(60.0)
    assert abs(np.median(deviations) / errors.std() - 1.0) < 0.3


def test_a_periodic_motion_has_several_delays():
    times = np.linspace(0.0, 20.0, 1000)

    def planned(at):
        return np.sin(2.0 * np.pi * at)[:, None]

    def rate(at):
        return 2.0 * np.pi * np.cos(2.0 * np.pi * at)[:, None]

    found = delay.delay_of(times, planned(times - 0.2), planned, rate, 1.1)
    assert np.isclose((found.value - 0.2) % 1.0, 0.0, atol=1e-9) or np.isclose((found.value - 0.2) % 1.0, 1.0)
    assert np.isfinite(found.rival) and np.isclose(abs(found.rival - found.value), 1.0, atol=1e-6)


def test_a_robot_at_rest_has_no_delay():
    still = np.tile([1.0, 2.0], (50, 1))
    found = delay.delay_of(
        np.arange(50.0), still + 0.01, lambda at: still[: len(at)], lambda at: 0.0 * still[: len(at)], 1.0
    )
    assert np.isnan(found.value) and np.allclose(found.offsets, 0.01)


@pytest.mark.thorough
def test_the_cable_that_disagrees(tmp_path):
    spec = _spec("cogiro", WIDE)
    rows = cspr_jax.plan(spec).rows(500.0)
    times, lengths, tensions = _played(rows, np.random.default_rng(4), late=0.05)
    lengths[:, 2] += 0.003
    is_slack = (times > 1.0) & (times < 1.4)
    tensions[is_slack, 5] = 0.0
    lengths[is_slack, 5] += 0.02  # a slack cable says nothing of the others
    found = cspr_jax.compare_log(_written(tmp_path / "log.csv", times, lengths, tensions), spec, tolerance=0.02)
    assert abs(found.delay.value - 0.05) < 5e-4 and found.within_tolerance
    table = found.to_dict()
    assert table["disagreeing_cable"] == 2 and "cable 3 disagrees" in table["disagreement"]
    assert abs(table["cables"][2]["constant_error"] - 0.003) < 1e-4
    assert abs(table["cables"][2]["offset"] - 0.003) < 5e-5
    ((start, end),) = table["cables"][5]["slack"]
    assert abs(start - 1.0) < 0.02 and abs(end - 1.4) < 0.02
    assert all(not row["slack"] for row in table["cables"] if row["cable"] != 5)
    expected = np.interp(times[is_slack] - 0.05, rows["t"], rows["tension"][:, 5]).max()
    assert table["cables"][5]["tension_shortfall"] == pytest.approx(expected, rel=1e-3)
    beyond = cspr_jax.compare_log(tmp_path / "log.csv", spec, tolerance=1e-4)
    assert not beyond.within_tolerance and "beyond the tolerance" in " ".join(beyond.lines())


def test_one_error_among_random_null_vectors():
    """An error of one cable explains all by itself, that of two does not; a slack cable is found in its rows."""
    rng = np.random.default_rng(5)
    matrices = rng.normal(size=(300, 6, 9))
    null = disagreement.null_vectors(matrices)
    np.testing.assert_allclose(np.einsum("nij,njr->nir", matrices, null), 0.0, atol=1e-12)
    lengths = np.einsum("nji,nj->ni", matrices, rng.normal(size=(300, 6)))  # of displacements
    one = lengths + 0.01 * np.eye(9)[4]
    found = disagreement.disagreement_of(null, one)
    assert found.cable == 4 and np.isclose(found.errors[4], 0.01) and np.isclose(found.fractions[4], 1.0)
    assert disagreement.disagreement_of(null, lengths + 0.01 * (np.eye(9)[4] - np.eye(9)[1])).cable is None
    longer = lengths + 0.02 * np.eye(9)[7] * ((np.arange(300) >= 100) & (np.arange(300) < 150))[:, None]
    rows = disagreement.longer_rows(null, longer, 1e-3)
    # In some rows another cable would explain it about as well: these name none.
    assert rows[:, 7].sum() == rows.sum() > 15 and not rows[:100].any() and not rows[150:].any()
    inside = np.isin(np.arange(300), [*range(100, 120), *range(121, 150), 200])
    assert disagreement.intervals(np.arange(300.0), inside) == [(100.0, 149.0), (200.0, 200.0)]


def test_a_log_of_one_cable_and_one_without_poses():
    """A mass on a guide; and lengths of which no pose is known: dashes in texts, None in JSON, never within."""
    times = np.arange(4.0)
    one = {"robot": "lift", "family": "line", "times": times, "rows": np.arange(4), "n_spare": 0, "lengthened": [[]]}
    one |= {"delay": delay.Delay(np.nan, np.nan, np.nan, np.array([0.01]), False), "length_errors": np.ones((4, 1))}
    one |= {"position_errors_before": np.ones(4), "position_errors": np.array([0.001, np.nan, 0.003, 0.002])}
    one |= {"angle_errors": None, "is_found": np.ones(4, bool), "residuals": np.zeros((4, 1)), "disagreement": None}
    one |= {"tensions": None, "planned_tensions": np.ones((4, 1)), "slack": None, "tolerance": 0.01}
    log = log_report.ComparedLog(**one)
    table = json.loads(json.dumps(log_report.log_object(log), allow_nan=False))
    assert table["disagreeing_cable"] is None and table["delay"] is None and not log.within_tolerance
    assert table["position_error"] == {"rms": pytest.approx(0.00216024689947), "largest": 0.003, "t": 2.0}
    assert "cable 1" not in table["disagreement"] and "cannot be told" in log_report.log_lines(log)[1]
    page = log_content(log_report.ComparedLog(**one | {"tensions": np.ones((4, 1)), "slack": [[(1.0, 2.0)]]}))
    assert [chart["axis"] for chart in page["charts"]] == ["position error (mm)", "length error (mm)", "tension (N)"]
    assert page["charts"][2]["intervals"] == [{"words": "cable 1 slack", "start": 1.0, "end": 2.0}]
    assert page["charts"][2]["unit"] == "N" and page["charts"][0]["levels"] == [{"words": "tolerance", "value": 10.0}]
    nothing = np.full(4, np.nan)
    lost = log_report.ComparedLog(**one | {"position_errors": nothing, "angle_errors": nothing})
    table = json.loads(json.dumps(log_report.log_object(lost), allow_nan=False))
    assert table["angle_error"] == table["position_error"] == {"rms": None, "largest": None, "t": None}
    assert "- mm rms, largest - mm at - s after" in " ".join(log_report.log_lines(lost))


def test_a_cable_that_sticks_for_a_while_stands_out_beside_the_plan(planned, tmp_path):
    spec, rows = planned
    times, lengths, _ = _played(rows, np.random.default_rng(9), late=0.02)
    sticks = (times > 1.0) & (times < 1.6)
    lengths[sticks, 1] = lengths[np.argmax(sticks), 1]
    found = cspr_jax.compare_log(_written(tmp_path / "log.csv", times, lengths), spec)
    largest = found.to_dict()["cables"][1]["largest"]
    assert (
        f"; beside the plan cable 2 is off by up to {1000.0 * abs(largest):.4g} mm" in found.to_dict()["disagreement"]
    )
    # With a spare cable, of which no constant error explains what is left.
    errors = np.array([[0.001, 0.3, 0.001, 0.0], [0.001, 0.0, 0.0, 0.0]])
    spare = disagreement.Disagreement(np.zeros(4), np.full(4, 0.1), None, 0.05)
    log = {"robot": "r", "family": "spline"}
    log |= {"times": np.arange(2.0), "rows": np.arange(2), "n_spare": 1, "lengthened": [[]] * 4, "disagreement": spare}
    log |= {"delay": delay.Delay(0.01, np.inf, np.nan, np.zeros(4), False), "length_errors": errors}
    log |= {"angle_errors": None, "is_found": np.ones(2, bool), "residuals": errors, "tensions": None}
    log |= {"planned_tensions": np.ones((2, 4)), "slack": None, "tolerance": None}
    log |= {"position_errors": np.ones(2), "position_errors_before": np.ones(2)}
    lines = log_report.log_lines(log_report.ComparedLog(**log))
    assert lines[1] == "delay: 10 ms late, standard deviation unknown"
    assert lines[3].startswith(
        "no constant error of one cable explains the 50 mm rms that no pose explains; beside the"
    )
    assert lines[3].endswith("cable 2 is off by up to 300 mm at 0 s, others by up to 1 mm")


def test_poses_from_angles_say_that_they_leave_out_the_stretch(tmp_path, capsys):
    robot = tmp_path / "elastic.toml"
    spools = "[[0.2, -0.1, 0.0], [-0.2, -0.1, 0.0], [0.0, 0.3, 0.0]]"
    keys = f'name = "e"\nmass = 1.0\nbase_points = {spools}\n'
    robot.write_text(keys + "axial_stiffness = 1e4\n[winch]\ndrum_radius = 0.02\nzero_length = 1.0\n")
    assert main(["locate", str(robot), "--angles", "5,5,5"]) == 0
    assert "angles give their unstretched lengths, so that the poses leave out the stretch" in capsys.readouterr().out
    assert main(["locate", str(robot), "--angles=-50,5,5"]) == 2
    assert "--angles: angles[0, 0] = -50.0: must be an angle that gives a length > 0" in capsys.readouterr().err
    assert main(["locate", str(robot), "--lengths", "1,1,-1"]) == 2
    assert "--lengths: lengths[0, 2] = -1.0: must be a length > 0" in capsys.readouterr().err
    assert main(["locate", "prototype", "--angles", "1,2,3"]) == 2
    assert "--angles: angles: given: must be absent: the robot has no [winch]" in capsys.readouterr().err


@pytest.mark.parametrize("with_tensions", [False, True])
def test_stretch_is_added_to_angles_of_elastic_cables(tmp_path, with_tensions):
    """Set points that are played perfectly, 40 ms late, are no error."""
    robot = {"name": "e", "mass": 2.0, "base_points": [[0.9, -0.5, 0.0], [-0.9, -0.5, 0.0], [0.0, 1.0, 0.0]]}
    robot |= {"axial_stiffness": 1e4, "winch": {"drum_radius": 0.02, "zero_length": 1.0}}
    places = [([0.0, 0.0, 1.2], 0.0), ([0.1, 0.05, 1.1], 1.5), ([0.0, 0.1, 1.3], 3.0)]
    plan = cspr_jax.plan(_spec(robot, places))
    points = plan.setpoints(100.0)
    tensions = points.tension if with_tensions else None
    log = _written(tmp_path / "log.csv", points.t + 0.04, points.angle, tensions, name="angle")
    found = cspr_jax.compare_log(log, plan)
    assert found.delay.value == pytest.approx(0.04, abs=1e-4)
    inside = (found.times[found.rows] > 0.1) & (found.times[found.rows] < 2.9)
    # Without the stretch, some 1.5 mm are missing.
    assert np.abs(found.position_errors[inside]).max() < 3e-5
    whose = "measured" if with_tensions else "planned"
    assert f"to which {whose} tensions add the stretch" in " ".join(found.warnings)


def test_angles_of_motors_are_logs(planned, tmp_path):
    spec, rows = planned
    winch = {"drum_radius": 0.02, "gear_ratio": 3.0, "zero_length": 1.0, "direction": [1, -1, 1]}
    robot = {"name": "wound", "mass": 0.198, "winch": winch}
    robot["base_points"] = np.asarray(cspr_jax.load_robot("prototype").base_points).tolist()
    times, lengths, _ = _played(rows, np.random.default_rng(6), late=0.02)
    angles = np.array([1.0, -1.0, 1.0]) * 3.0 * (lengths - 1.0) / 0.02
    path = _written(tmp_path / "log.csv", times, angles, name="angle")
    found = cspr_jax.compare_log(path, spec | {"robot": robot})
    assert abs(found.delay.value - 0.02) < 1e-3 and found.position_errors.max() < 0.002
    with pytest.raises(ConfigError, match=r"log.csv: angles: given: must be absent: the robot has no \[winch\]"):
        cspr_jax.compare_log(path, spec)


def test_angles_and_tensions_of_all_cables_of_pairs(tmp_path):
    """Six columns of a platform that three winches move: as three, and one slack cable of a pair is seen."""
    spec = tomllib.loads((Path(cspr_jax.__file__).parent / "catalogue" / "launch-robot.toml").read_text("utf-8"))
    spec["winch"] = {"drum_radius": 0.02, "zero_length": 0.8, "direction": [1, 1, -1, -1, 1, 1]}
    plan = _spec(spec, [([0.0, 0.0, -0.8], 0.0), ([0.05, 0.02, -0.75], 1.5), ([0.0, 0.05, -0.85], 3.0)])
    rows = cspr_jax.plan(plan).rows(500.0)
    rows["tension"] = rows["tension_each"]
    times, lengths, tensions = _played(rows, np.random.default_rng(8), late=0.03)
    angles = np.repeat([1.0, -1.0, 1.0] * (lengths - 0.8) / 0.02, 2, axis=1)
    is_slack = (times > 1.0) & (times < 1.4)
    tensions[is_slack, 3] = 0.0
    found = cspr_jax.compare_log(_written(tmp_path / "log.csv", times, angles, tensions, name="angle"), plan)
    three = cspr_jax.compare_log(_written(tmp_path / "three.csv", times, angles[:, ::2], name="angle"), plan)
    assert abs(found.delay.value - 0.03) < 1e-3 and found.delay.value == three.delay.value
    table = found.to_dict()["cables"]
    assert [len(row["slack"]) for row in table] == [0, 1, 0]
    np.testing.assert_allclose(table[1]["slack"][0], [1.0, 1.4], atol=0.02)
    np.testing.assert_allclose(found.tensions[~is_slack], found.planned_tensions[~is_slack], rtol=0.02)
    with pytest.raises(ConfigError, match=r"log.csv: columns: 4 of lengths or angles: must be 3, one a cable, or 6$"):
        cspr_jax.compare_log(_written(tmp_path / "log.csv", times, angles[:, :4], name="angle"), plan)


def test_tables_of_all_kinds(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("# a\n\nt [ms];length_2 (mm);Length1 [m];note\n0;1000,5;1,2;x\n# b\n10;;1,3;y\n")
    log = read_cable_log(path, 2)
    np.testing.assert_allclose(log.times, [0.0, 0.01])
    np.testing.assert_allclose(log.lengths, [[1.2, 1.0005], [1.3, np.nan]])
    assert log.lines.tolist() == [4, 6] and log.angles is None and log.tensions is None
    path.write_text('t_ms,length_1/mm,"length_2",note\n0,1e3,2,"a, b"\n5,NaN,3 # c\n'.replace(" # c", ",d # c"))
    log = read_cable_log(path, 2)
    np.testing.assert_allclose(log.times, [0.0, 0.005])
    np.testing.assert_allclose(log.lengths, [[1.0, 2.0], [np.nan, 3.0]])
    path.write_text("t\tangle_1 [deg]\ttension_1 [kN]\n0\t180\t0.1\n")
    log = read_cable_log(path)
    np.testing.assert_allclose([log.angles[0, 0], log.tensions[0, 0]], [np.pi, 100.0])


HEAD = "t,length_1,length_2,length_3\n"
MISTAKES = {
    "no number": ("t1,length_1,length_2,length_3\n0,1,1,1\n", "line 1: no column t: must have t, length_1"),
    "cell": (HEAD + "0,1,1,1\n1,1,abc,1\n", 'line 3, column 3: length_2 = "abc": must be a finite number, or empty'),
    "underscore": (HEAD + "0,1,1_0,1\n", 'line 2, column 3: length_2 = "1_0": must be a finite number, or empty'),
    "digits": (HEAD + "0,1,١,1\n", 'line 2, column 3: length_2 = "١": must be a finite number, or empty'),
    "count": (HEAD + "0,1,1\n", "line 2: 3 values: must be 4, as in the header"),
    "times": (HEAD + "1,1,1,1\n1,1,1,1\n", "line 3: t = 1: must be more than 1, the time before it"),
    "no time": ("length_1,length_2,length_3\n1,1,1\n", "line 1: no column t: must have t, length_1"),
    "no length": ("t,x\n0,1\n", "line 1: no column length_1 or angle_1: must have t, length_1"),
    "missing": ("t,length_1,length_3\n0,1,1\n", "line 1: columns length_1, length_3: must be length_1 to length_3"),
    "twice": ("t,length_1,length_1\n0,1,1\n", 'line 1, column 3: "length_1": stands twice: must stand once'),
    "unit": (
        "t,length_1 [N],length_2,length_3\n0,1,1,1\n",
        'line 1, column 2: "length_1 [N]": unit "N": must be "m", "dm", "cm"',
    ),
    "empty": ("", "is empty: must be a line with names of columns, t, length_1"),
    "gap in time": (HEAD + ",1,1,1\n", "line 2: t is empty: must be a time in each row"),
    "infinite": (HEAD + "0,1,inf,1\n", 'line 2, column 3: length_2 = "inf": must be a finite number'),
    "negative": (
        HEAD + "0,1,,1\n1,1,-1,2\n",
        "line 3: a length of 0 or less: 1 such rows are left out: must have a row with",
    ),
    "gaps": (HEAD + "0,1,,1\n1,1,,2\n", "every row has gaps: must have a row with numbers for all cables"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_one_line(name, tmp_path, capsys):
    text, line = MISTAKES[name]
    path, plan = tmp_path / "log.csv", tmp_path / "plan.toml"
    path.write_text(text)
    plan.write_text('schema = 1\nrobot = "prototype"\nfamily = "spline"\n' + _tables(PLACES))
    assert main(["log", str(path), "--plan", str(plan)]) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1 and f"{path}: {line}" in told[0], told


def _tables(places):
    return "".join(f"[[pose]]\nposition = {position}\ntime = {time}\n" for position, time in places)


def test_commands(planned, tmp_path, capsys):
    _, rows = planned
    times, lengths, tensions = _played(rows, np.random.default_rng(7), late=0.05)
    path, plan = _written(tmp_path / "log.csv", times, lengths, tensions), tmp_path / "plan.toml"
    plan.write_text('schema = 1\nrobot = "prototype"\nfamily = "spline"\n' + _tables(PLACES))
    assert main(["log", str(path), "--plan", str(plan), "--json", "-o", str(tmp_path / "page.html")]) == 0
    table = json.loads(capsys.readouterr().out)
    assert abs(table["delay"] - 0.05) < 1e-3 and len(table["cables"]) == 3
    assert 'id="charts-side"' in (tmp_path / "page.html").read_text()
    assert main(["log", str(path), "--plan", str(plan), "--tolerance", "1e-6"]) == 1
    assert "beyond the tolerance of 0.001 mm" in capsys.readouterr().out
    poses = tmp_path / "poses.csv"
    assert main(["locate", "prototype", str(path), "-o", str(poses)]) == 0
    written = np.genfromtxt(poses, delimiter=",", names=True)
    assert len(written) == len(times) and np.abs(written["z"] - 1.2).max() < 0.15
    capsys.readouterr()
    assert main(["locate", "prototype", "--lengths", "1.2,1.25,1.3", "--all", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["complete"] and found["count"] == [2] and len(found["solutions"][0]["position"]) == 2
    assert main(["locate", "prototype", "--lengths", "0.1,0.1,0.1"]) == 1
    assert "misses them by up to 0.16 m" in capsys.readouterr().out
    bad = tmp_path / "bad.csv"
    bad.write_text("length_1,length_2,length_3\n1.2,1.2,1.2\n\n1.2,-0.1,1.2\n")
    for words, line in (
        ([str(bad)], f"{bad}: line 4: length_2 = -0.1: must be a length > 0, at most 1e6 m"),
        (["--lengths", "1,2"], "--lengths: 2 numbers: must be 3, one a cable"),
        (["--lengths", "1,x,3"], "--lengths: 1,x,3: must be finite numbers"),
        ([], "--lengths: missing: one of a file, --lengths and --angles"),
        (["--lengths", "1,1,1", "--start", "1,2"], "--start: 1,2: must be 3 or 7 finite numbers"),
        (["--lengths", "1,1,1", "--angles", "1,1,1"], "--lengths and --angles: given: one of"),
    ):
        assert main(["locate", "prototype", *words]) == 2
        assert line in capsys.readouterr().err
