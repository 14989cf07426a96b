"""Plans through the command line: JSON, tables and motions, beside printed numbers and the NumPy oracle."""

import csv
import tomllib
from pathlib import Path

import jax
import numpy as np
import pytest
import xarray
from oracles import point_mass
from support.commands import plan, planned, strict_json

from cspr_jax.plans import choices

ROOT = Path(__file__).parents[2]
SEQUENCE = (ROOT / "sweeps" / "table_2_1.toml").read_text("utf-8")
FREE = SEQUENCE.replace("floor = 3.5\n", "")
BASE = 0.26 * np.array([[np.sqrt(0.75), -0.5, 0.0], [-np.sqrt(0.75), -0.5, 0.0], [0.0, 1.0, 0.0]])
MASS, G, P0 = 0.198, 9.81, np.array([0.0, 0.0, 1.7])
TARGETS = np.array([pose["position"] for pose in tomllib.loads(SEQUENCE)["pose"] if "position" in pose])
POSES = np.vstack([P0, TARGETS, P0])
FIELDS = {
    *("from", "to", "arcs", "tried_arcs", "oscillations", "duration", "tension_min", "tension_max", "mu_min"),
    *("det_sign_constant", "cable_interference", "platform_interference", "verdict", "beta_hat"),
    *("feasible_at_infinity", "samples"),
}
HEAD, *PARTS = FREE.split("[[pose]]\n")
# The two segments from (-0.6, 0.1, 1.9) on, and the one from (-1.1, -0.9, 1.5) on.
SHORT, ONE = ("[[pose]]\n".join([HEAD, *PARTS[first:last]]) for first, last in ((5, 8), (3, 5)))


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """The JSON of Table 2.1's sequence, from a process in which jax still has 32 bits."""
    jax.config.update("jax_enable_x64", False)
    try:
        return planned(tmp_path_factory.mktemp("table"), SEQUENCE)
    finally:
        jax.config.update("jax_enable_x64", True)


@pytest.fixture(scope="module")
def free(tmp_path_factory):
    """The same without a floor; its motion as CSV and as HDF5."""
    folder = tmp_path_factory.mktemp("free")
    found = planned(folder, FREE)
    assert plan(folder, FREE, "-o", str(folder / "motion.csv"))[::2] == (0, "")
    assert plan(folder, FREE, "-o", str(folder / "motion.h5"))[::2] == (0, "")
    assert sorted(path.name for path in folder.iterdir()) == ["motion.csv", "motion.h5", "plan.toml"]
    return found, folder


def columns(path: Path) -> dict[str, np.ndarray]:
    """A motion file by name: t (n,), "binding" and "binding_cable" (n,), the rest (n, 3)."""
    heads, *rows = csv.reader(line for line in path.read_text("utf-8").splitlines() if line[0] != "#")
    names = ("position", "velocity", "acceleration", "length", "rate", "tension")
    parts = [f"{n}_{k}" for n in names for k in ("xyz" if n in names[:3] else "123")]
    assert heads == ["t", *parts, "binding", "binding_cable"]
    table = np.array(rows, float)
    binding = {"binding": table[:, -2], "binding_cable": table[:, -1]}
    return {"t": table[:, 0], **{name: table[:, 3 * i + 1 : 3 * i + 4] for i, name in enumerate(names)}, **binding}


def oracle_motion(i: int, arcs: int, tau: np.ndarray):
    """Duration, position, velocity, acceleration of segment i."""
    return point_mass.motion(POSES[i], POSES[i + 1], P0, G, arcs, tau)


def test_fields_of_the_json(printed):
    head = {"schema": 1, "robot": "prototype", "family": "hypocycloid-standard", "z0": 1.7, "z_axis": "down"}
    assert head | {"gravity": 9.81, "feasible": True} == {key: printed[key] for key in (*head, "gravity", "feasible")}
    assert len(printed["segments"]) == 8
    for i, segment in enumerate(printed["segments"]):
        assert set(segment) >= FIELDS
        assert (segment["from"], segment["to"], segment["verdict"]) == (i, i + 1, "feasible")
        assert segment["tried_arcs"] == segment["arcs"] and segment["det_sign_constant"] is True
        assert segment["samples"] >= max(400, 64 * segment["arcs"])
        assert all(segment[key] is None for key in ("oscillations", "beta_hat", "cable_interference"))
    assert printed["total_duration"] == pytest.approx(sum(s["duration"] for s in printed["segments"]), rel=1e-12)


def test_published_rows(printed):
    """The three rows of Table 2.1 that are known; the errata put the spread of g inside the rounding of T."""
    for segment, arcs, duration, infinity in zip(
        printed["segments"][1:4], (5, 2, 5), (6.54, 2.61, 6.54), (-0.1557, -0.1416, 0.2057), strict=True
    ):
        assert segment["arcs"] == arcs
        assert segment["duration"] == pytest.approx(duration, abs=0.01)
        assert segment["feasible_at_infinity"] == pytest.approx(infinity, abs=1e-4)


def test_numbers_of_each_segment_are_the_oracle_s(printed):
    for i, segment in enumerate(printed["segments"]):
        arcs = segment["arcs"]
        assert arcs == point_mass.smallest_arcs(BASE, POSES[i], POSES[i + 1], 1.7, G, 30, samples=4001)
        wanted = point_mass.limits(BASE, MASS, POSES[i], POSES[i + 1], 1.7, G, arcs)
        keys = {"z_lowest": "z_max", "cable_length_max": "length_max", "cable_speed_max": "speed_max"}
        for key in ("tension_min", "tension_max", "mu_min", "cable_acceleration_max", *keys):
            assert segment[key] == pytest.approx(wanted[keys.get(key, key)], rel=2e-5, abs=2e-5), (i, key)
        margin = point_mass.margin(BASE, POSES[i], POSES[i + 1], 1.7, G, arcs)
        assert segment["margin_bound"] <= segment["margin"] == pytest.approx(margin, abs=5e-6)
        assert segment["duration"] == pytest.approx(oracle_motion(i, arcs, [0.0])[0], rel=1e-12)


def test_a_plan_that_is_not_feasible(tmp_path):
    output = tmp_path / "motion.csv"
    code, out, err = plan(tmp_path, FREE.replace("max_arcs = 30", "max_arcs = 1"), "--json", "-o", str(output))
    found = strict_json(out)
    assert (code, found["feasible"]) == (1, False)
    assert len(err.splitlines()) == 1 and str(output) in err
    assert not output.exists()
    for segment in found["segments"]:
        assert (segment["arcs"], segment["tried_arcs"]) == (None, 1)
        assert set(segment["verdict"].split("+")) == {"no_arcs", "slack_cable"}
        assert segment["margin"] < 0.0 and segment["duration"] > 0.0 and segment["limit_margin"] is None
    code, out, _ = plan(tmp_path, FREE.replace("max_arcs = 30", "max_arcs = 1"))
    assert code == 1 and "no_arcs" in out and "none found" in out


@pytest.mark.thorough
def test_a_fixed_number_of_arcs(tmp_path, free):
    """Section 2.9: the segment from the third to the fourth target with 7 arcs instead of 5 has more tension."""
    place = "position = [0.8, 0.5, 1.5]\n"
    found = planned(tmp_path, FREE.replace(place, f"{place}arcs = 7\n"))
    before, after = free[0]["segments"], found["segments"]
    assert [s["arcs"] for s in after] == [s["arcs"] + 2 * (s["from"] == 3) for s in before]
    assert after[3]["margin"] > before[3]["margin"] and after[3]["tension_min"] > before[3]["tension_min"]
    code, out, _ = plan(tmp_path, FREE.replace(place, f"{place}arcs = 1\n"), "--json")
    segment = strict_json(out)["segments"][3]
    assert (code, segment["arcs"], segment["tried_arcs"]) == (1, None, 1)


@pytest.mark.thorough
def test_z0_that_is_chosen(tmp_path, free):
    """Section 2.9: the mean height is 1.7 m; the conservative z0 goes down to 4.757 m (errata: printed 4.74)."""
    found = {}
    for how in ("mean", "conservative", "fastest"):
        found[how] = planned(tmp_path, FREE.replace("z0 = 1.7", f'z0 = {{ choose = "{how}" }}'))
    assert found["mean"]["z0"] == pytest.approx(1.7, abs=1e-12)
    assert found["mean"]["total_duration"] == pytest.approx(free[0]["total_duration"], rel=1e-9)
    squares = (TARGETS**2).sum(1)
    assert found["conservative"]["z0"] == pytest.approx((squares / (2 * TARGETS[:, 2])).max(), rel=2e-6)
    assert found["conservative"]["z0"] == pytest.approx(2.67, abs=0.001)
    assert max(s["z_lowest"] for s in found["conservative"]["segments"]) == pytest.approx(4.757, abs=0.01)
    assert min(s["feasible_at_infinity"] for s in found["conservative"]["segments"]) > 0.0
    assert found["fastest"]["total_duration"] < 0.99 * found["mean"]["total_duration"]


BEST = ONE.replace('"quintic"', '{ name = "effective", epsilon = "best" }')


@pytest.mark.thorough
def test_a_better_epsilon_makes_a_plan_shorter(tmp_path, monkeypatch):
    durations = []
    for candidates in ((0.2, 0.05), (0.2, 0.1, 0.05)):
        monkeypatch.setattr(choices, "EPSILONS", np.array(candidates))
        durations.append(planned(tmp_path, BEST)["segments"][0]["duration"])
    assert durations[1] < durations[0] - 1.0


@pytest.mark.thorough
def test_the_best_epsilon(tmp_path, monkeypatch):
    """The shortest plan of all epsilons, with the largest margin among equals; nothing is compiled for one of them."""
    plain, compiled = ONE.replace('"quintic"', '{ name = "effective", epsilon = EPS }'), []
    jax.monitoring.register_event_duration_secs_listener(lambda event, *_, **__: compiled.append(event))
    plans = {epsilon: planned(tmp_path, plain.replace("EPS", str(epsilon))) for epsilon in (0.05, 0.1, 0.2)}
    durations, margins = ({e: p["segments"][0][key] for e, p in plans.items()} for key in ("duration", "margin"))
    assert durations[0.1] < durations[0.05] - 1.0 and durations[0.05] == durations[0.2]
    assert margins[0.1] < margins[0.2] < margins[0.05]
    for candidates, wanted in (((0.2, 0.05, 0.1), 0.1), ((0.2, 0.05), 0.05)):
        monkeypatch.setattr(choices, "EPSILONS", np.array(candidates))
        assert planned(tmp_path, plain.replace("EPS", '"best"')) == plans[wanted]
    for candidates in ([0.21, 0.06, 0.11], [0.22, 0.07, 0.12]):
        compiled.clear()
        monkeypatch.setattr(choices, "EPSILONS", np.array(candidates))
        planned(tmp_path, plain.replace("EPS", '"best"'))
    assert not [event for event in compiled if "backend_compile" in event]


def test_the_motion_as_csv(free):
    found, folder = free
    motion, start = columns(folder / "motion.csv"), 0.0
    assert len(motion["t"]) == 8 * 400
    for i, segment in enumerate(found["segments"]):
        part = {name: column[400 * i : 400 * (i + 1)] for name, column in motion.items()}
        tau = np.linspace(0.0, 1.0, 400)
        np.testing.assert_allclose(part["t"], start + tau * segment["duration"], rtol=1e-12, atol=1e-12)
        _, position, velocity, acceleration = oracle_motion(i, segment["arcs"], tau)
        for name, wanted in (("position", position), ("velocity", velocity), ("acceleration", acceleration)):
            np.testing.assert_allclose(part[name], wanted, atol=1e-9, err_msg=name)
        np.testing.assert_allclose(part["position"][[0, -1]], POSES[i : i + 2], atol=1e-12)
        np.testing.assert_allclose(part["velocity"][[0, -1]], 0.0, atol=1e-12)
        start += segment["duration"]
    place = (BASE, motion["position"])
    np.testing.assert_allclose(motion["length"], point_mass.cable_lengths(*place), rtol=1e-12)
    np.testing.assert_allclose(motion["rate"], point_mass.cable_rates(*place, motion["velocity"]), atol=1e-12)
    tension = point_mass.tensions(BASE, MASS, motion["position"], motion["acceleration"], G)
    np.testing.assert_allclose(motion["tension"], tension, rtol=1e-9, atol=1e-10)
    assert tension.min() > 0.0 and tension.min() == pytest.approx(min(s["tension_min"] for s in found["segments"]), 0.1)


def test_the_motion_as_hdf5(free):
    found, folder = free
    motion = columns(folder / "motion.csv")
    with xarray.open_dataset(folder / "motion.h5", engine="h5netcdf") as data:
        assert data["position"].dims == ("t", "axis") and data["tension"].dims == ("t", "cable")
        assert [str(name) for name in data["axis"].values] == ["x", "y", "z"]
        assert data["cable"].values.tolist() == [1, 2, 3]
        assert data["tension"].attrs["units"] == "N" and data["t"].attrs["units"] == "s"
        assert (data.attrs["robot"], data.attrs["z_axis"], data.attrs["z0"]) == ("prototype", "down", found["z0"])
        for name, column in motion.items():
            np.testing.assert_array_equal(data[name].values, column)


def test_rows_at_a_rate(tmp_path):
    output = tmp_path / "motion.csv"
    assert plan(tmp_path, SHORT, "--rate", "40", "-o", str(output))[::2] == (0, "")
    segments, motion = planned(tmp_path, SHORT)["segments"], columns(output)
    total = sum(s["duration"] for s in segments)
    ticks = [*np.arange(np.ceil(total * 40)) / 40, total]
    np.testing.assert_allclose(motion["t"], ticks, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(motion["position"][-1], POSES[7], atol=1e-12)
    start = 0.0
    for i, segment in enumerate(segments):
        inside = (motion["t"] >= start - 1e-9) & (motion["t"] < start + segment["duration"] - 1e-9)
        tau = (motion["t"][inside] - start) / segment["duration"]
        np.testing.assert_allclose(motion["position"][inside], oracle_motion(5 + i, segment["arcs"], tau)[1], atol=1e-9)
        start += segment["duration"]
    for rate in ("0", "-5", "nan", "inf", "1e12"):
        code, _, err = plan(tmp_path, SHORT, "--rate", rate, "-o", str(tmp_path / "other.csv"))
        assert code == 2 and err.startswith("cspr: --rate: ") and len(err.splitlines()) == 1
    assert not (tmp_path / "other.csv").exists()


@pytest.mark.parametrize(("name", "code"), [("motion.txt", 2), ("motion", 2), ("none/motion.csv", 4), ("none/m.h5", 4)])
def test_outputs_that_cannot_be_written(tmp_path, name, code):
    for blocker in (None, tmp_path / "none"):
        if blocker:
            blocker.write_text("a file where a folder should be")
        found, _, err = plan(tmp_path, SHORT, "-o", str(tmp_path / name))
        assert found == code, err
        assert err.startswith("cspr: ") and len(err.splitlines()) == 1 and name in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["none", "plan.toml"]


def test_an_upward_z_axis_mirrors_a_downward_one(tmp_path, printed):
    """The same sequence described with z up: positions, floor and z_lowest change sign, nothing else."""
    robot = f'{{ name = "prototype", mass = {MASS}, z_axis = "up", base_points = {(BASE * [1, 1, -1]).tolist()} }}'
    text = SEQUENCE.replace('"prototype"', robot).replace("floor = 3.5", "floor = -3.5")
    for x, y, z in TARGETS.tolist():
        old = next(line for line in SEQUENCE.splitlines() if line.startswith(f"position = [{x}, {y}, {z}]"))
        text = text.replace(old, f"position = [{x}, {y}, {-z}]")
    found = planned(tmp_path, text)
    assert found["z_axis"] == "up" and found["z0"] == 1.7
    for up, down in zip(found["segments"], printed["segments"], strict=True):
        for key, value in down.items():
            wanted = -value if key == "z_lowest" else value
            assert up[key] == (pytest.approx(wanted, rel=1e-9) if isinstance(value, float) else wanted), key
    output = tmp_path / "up.csv"
    assert plan(tmp_path, text, "-o", str(output))[0] == 0
    motion = columns(output)
    np.testing.assert_allclose(motion["position"][400], TARGETS[0] * [1, 1, -1], atol=1e-12)
    place = (BASE * [1, 1, -1], motion["position"])
    np.testing.assert_allclose(motion["rate"], point_mass.cable_rates(*place, motion["velocity"]), atol=1e-12)
    tension = point_mass.tensions(place[0], MASS, place[1], motion["acceleration"], -G)
    np.testing.assert_allclose(motion["tension"], tension, rtol=1e-9, atol=1e-10)


def test_the_table_for_people(tmp_path):
    code, out, err = plan(tmp_path, SHORT)
    assert (code, err) == (0, "")
    rows = [line for line in out.splitlines() if "feasible" in line]
    for row, place, arcs in zip(rows, ("(0.1, -0.6, 1.8)", "(0, -1.1, 1.7)"), "56", strict=True):
        assert place in row and arcs in row.split("│")[3]
    assert "total 14.36 s" in out and "z down" in out


def test_limits_in_a_table_of_their_own(tmp_path, printed):
    text = SEQUENCE.replace("floor = 3.5\n", "").replace("[[pose]]", "[limits]\nfloor = 3.5\n[[pose]]", 1)
    assert planned(tmp_path, text) == printed


def test_hints_go_to_stderr_and_change_nothing_else(tmp_path):
    """Spools in millimetres, and below everything, as z was meant to point up: both are computed, and asked about."""
    points = (1000.0 * BASE + [0.0, 0.0, 10.0]).tolist()
    robot = f'{{ name = "mm", mass = 0.198, base_points = {points} }}'
    code, out, err = plan(tmp_path, SEQUENCE.replace('"prototype"', robot), "--json")
    assert (code, strict_json(out)["feasible"]) == (1, False)
    units, axis = err.splitlines()
    assert units.startswith(
        "cspr: hint: robot.base_points: spools 450.333 m apart, for a mass of 0.198 kg: are these mill"
    )
    assert axis.startswith("cspr: hint: pose: every target is above every spool: ") and 'z_axis = "up"?' in axis


def test_all_errors(tmp_path):
    text = ONE.replace("max_arcs = 30", "max_arcs = 0\nmax_tension = 3.0")
    line = "unknown key max_tension = 3.0: did you mean tension_max? allowed: acceleration_max,"
    for arguments, count in (((), 1), (("--all-errors",), 2)):
        code, out, err = plan(tmp_path, text, *arguments)
        assert (code, out, len(err.splitlines())) == (2, "", count) and line in err
        assert ("(and 1 more: --all-errors shows them)" in err) == (count == 1)
    assert err.endswith("plan.toml: max_arcs = 0: must be at least 1\n")
