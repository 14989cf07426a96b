"""Bezier segments in plans: accelerations that go on, durations that are given, least, or least in total; refusals."""

import json

import h5py
import numpy as np
import pytest
from oracles import beziers as oracle
from support.commands import cspr, plan, planned

import cspr_jax

# The places of (34), z up.
PLACES = [[0, 0, -0.5], [-0.05, -0.05, -0.7], [0.1, 0.15, -0.8], [-0.1, -0.3, -1.2], [0.23, 0.07, -1.16]]
HEAD = 'schema = 1\nrobot = "launch-robot"\nfamily = "bezier"\n'


def text(durations, *, more="", places=PLACES):
    """Of a plan through places; one duration a segment, None where none is given."""
    poses = [f"[[pose]]\nposition = {list(place)}\n" for place in places]
    for i, time in enumerate(durations, start=1):
        poses[i] += "" if time is None else f"duration = {time!r}\n"
    return HEAD + more + "".join(poses).replace("'", '"')


def test_accelerations_go_on(tmp_path):
    answer = planned(tmp_path, text([0.9, 0.8, 1.1, 1.5], more="first_control_point = [0.01, 0, -0.49]\n"))
    control = np.array([segment["control_points"] for segment in answer["segments"]])
    times = np.array([segment["duration"] for segment in answer["segments"]])
    np.testing.assert_allclose(control[0, 1], [0.01, 0.0, -0.49], atol=1e-15)
    np.testing.assert_allclose(control[:, 0], PLACES[:-1], atol=1e-15)
    np.testing.assert_allclose(control[:, 2], PLACES[1:], atol=1e-15)
    for i in range(3):  # (15)
        wanted = control[i, 2] + (control[i, 1] - control[i, 2]) * (times[i + 1] / times[i]) ** 2
        np.testing.assert_allclose(control[i + 1, 1], wanted, atol=1e-13)
    assert plan(tmp_path, (tmp_path / "plan.toml").read_text(), "-o", tmp_path / "m.h5", "--anyway")[0] == 0
    with h5py.File(tmp_path / "m.h5") as file:
        t, acceleration, velocity = (file[name][...] for name in ("t", "acceleration", "velocity"))
        starts = np.searchsorted(t, np.cumsum(times)[:-1])
        assert np.abs(velocity[starts]).max() < 1e-9
        for i, row in enumerate(starts):
            after = oracle.states(control[i + 1], times[i + 1], 8)[2][0]
            np.testing.assert_allclose(acceleration[row], after, atol=1e-9)
        # Six tensions, as pairs share them, from the balance of forces.
        assert file["tension"].shape[1] == 3 and file["tension_each"].shape[1] == 6
        first = t <= times[0]
        spools = np.array([[0.35, 0, 0], [-0.175, 0.30310889132455354, 0], [-0.175, -0.30310889132455354, 0]])
        down = np.array([1.0, 1.0, -1.0])
        pulls = oracle.tensions(spools, 1.0, 9.80665, file["position"][first] * down, acceleration[first] * down)
        np.testing.assert_allclose(file["tension"][first], pulls, atol=1e-9)
        np.testing.assert_allclose(file["tension_each"][first], np.repeat(pulls, 2, axis=1) / 2.0, atol=1e-9)


def test_one_segment_after_the_other(tmp_path):
    """Each with the least duration that keeps its cables taut; what is said of the durations holds."""
    (first,) = planned(tmp_path, text([None], places=PLACES[:2]))["segments"]
    robot = cspr_jax.three_cable_equivalent(cspr_jax.load_robot("launch-robot"))
    (alone,) = cspr_jax.bezier_durations(robot, PLACES[:1], PLACES[1:2])
    assert first["duration"] == first["least_duration"] == alone[0, 0]
    assert first["taut_durations"] == [[alone[0, 0], None]] and first["verdict"] == "feasible"
    assert 0.0 < first["margin_bound"] < first["margin"] < 1e-12
    second = planned(tmp_path, text([0.75, 1.0], places=PLACES[:3]))["segments"][1]
    ((low, high),) = second["taut_durations"]
    assert low < 1.0 < high and second["verdict"] == "feasible"
    for time, code in ((low * 0.999, 1), (low * 1.001, 0), (high * 0.999, 0), (high * 1.001, 1)):
        planned(tmp_path, text([0.75, time], places=PLACES[:3]), code=code)
    code, out, err = plan(tmp_path, text([None], places=PLACES[:2]))
    assert (code, err) == (0, "") and "taut for T (s)" in out and "∞" in out and "cables 1-2, 3-4, 5-6" in out


@pytest.mark.thorough
@pytest.mark.parametrize(
    "limit",
    [
        "tension_min = 0.5",
        pytest.param("tension_max = 3.0", marks=pytest.mark.soak),
        pytest.param("cable_speed_max = 0.4", marks=pytest.mark.soak),
        pytest.param("cable_acceleration_max = 3.0", marks=pytest.mark.soak),
    ],
)
def test_the_least_duration_under_limits(tmp_path, limit):
    (free,) = planned(tmp_path, text([None], places=PLACES[:2]))["segments"]
    (held,) = planned(tmp_path, text([None], places=PLACES[:2], more=f"{limit}\n"))["segments"]
    assert held["duration"] > free["duration"] and held["verdict"] == "feasible"
    assert 0.0 < held["limit_margin"] < 1e-6
    faster = planned(tmp_path, text([held["duration"] * (1.0 - 1e-6)], places=PLACES[:2], more=f"{limit}\n"), code=1)
    assert faster["segments"][0]["verdict"] != "feasible"


@pytest.mark.thorough
def test_the_least_total(tmp_path):
    """No sequence near it is shorter and taut; a duration that is given stays."""
    answer = planned(tmp_path, text([None] * 4, more='least = "total"\n'))
    times = np.array([segment["duration"] for segment in answer["segments"]])
    assert answer["feasible"] and answer["total_duration"] == pytest.approx(3.94033, abs=1e-4)
    robot = cspr_jax.three_cable_equivalent(cspr_jax.load_robot("launch-robot"))
    points, rng = np.array(PLACES, float), np.random.default_rng(0)
    tried = times * np.exp(rng.normal(size=(4000, 4)) * np.repeat([0.3, 0.03, 0.003, 0.0003], 1000)[:, None])
    tried = tried[tried.sum(1) < times.sum() * (1.0 - 1e-7)]
    middle, feasible = np.broadcast_to(points[0], (len(tried), 3)), np.ones(len(tried), bool)
    for i in range(4):
        first, last = (np.broadcast_to(points[j], (len(tried), 3)) for j in (i, i + 1))
        feasible &= cspr_jax.bezier_verdicts(robot, first, middle, last, durations=tried[:, i]).feasible
        if i < 3:
            middle = last + (middle - last) * (tried[:, i + 1] / tried[:, i])[:, None] ** 2
    assert len(tried) > 1000 and not feasible.any()
    given = planned(tmp_path, text([None, 1.1, None, None], more='least = "total"\n'))
    assert given["segments"][1]["duration"] == 1.1 and given["total_duration"] > answer["total_duration"]


@pytest.mark.thorough
@pytest.mark.parametrize("least", ["each", pytest.param("total", marks=pytest.mark.soak)])
def test_slow_winches(tmp_path, least):
    """However slow the cables, there is a duration."""
    body = text([None], places=PLACES[:2], more=f'least = "{least}"\ncable_speed_max = 0.003\n')
    answer = planned(tmp_path, body)
    assert answer["feasible"] and answer["total_duration"] > 50.0


def test_without_a_feasible_duration_the_nearest_is_shown(tmp_path):
    """A start without acceleration to beyond the footprint: there is none, whatever the duration."""
    (segment,) = planned(tmp_path, text([None], places=[[0, 0, -0.6], [0.9, 0, -0.6]]), code=1)["segments"]
    assert segment["taut_durations"] == [] and segment["least_duration"] is None
    assert "slack_cable" in segment["verdict"] and segment["margin"] < 0.0


@pytest.mark.thorough
def test_it_joins_other_families(tmp_path):
    """A line ends without acceleration, and so a segment may start behind it; a segment ends with one."""
    body = text([None, None], places=[*PLACES[:2], [0.05, 0.02, -0.8]])
    second = body.replace("-0.7]", '-0.7]\nfamily = "s-curve"').replace(
        "[[pose]]", "max_acceleration = 3.0\n[[pose]]", 1
    )
    answer = planned(tmp_path, second)
    assert [segment["family"] for segment in answer["segments"]] == ["s-curve", "bezier"] and answer["feasible"]
    code, _, err = plan(tmp_path, body.replace("-0.8]", '-0.8]\nfamily = "s-curve"'))
    assert code == 2 and "acceleration goes on" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (("duration = 1.0", "duration = 0.0"), "pose[1].duration = 0"),
        (("duration = 1.0", 'duration = "most"'), 'must be "least"'),
        (("duration = 1.0", "duration = nan"), "pose[1].duration"),
        (("duration = 1.0", "arcs = 3"), "pose[1].arcs"),
        (("duration = 1.0", "rest = true"), "pose[1].rest = true"),
        (("-0.7]", "-0.7]\nduration = 2\nfamily = 's-curve'"), "pose[1].duration"),
        (('"bezier"', '"bezier"\nfirst_control_point = [0, 1]'), "first_control_point"),
        (('"bezier"', '"bezier"\nleast = "all"'), "least"),
        (('"bezier"', '"bezier"\nmax_acceleration = 2.0'), "max_acceleration"),
        (('"bezier"', '"quintic"\nleast = "total"'), "least"),
        (("[-0.05, -0.05, -0.7]", "[0, 0, -0.5]"), "pose[1].position"),
        (('"launch-robot"', '"laval-mssm"'), "parallel"),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path, change, line):
    body = text([1.0], places=PLACES[:2])
    changed = body.replace(*change)
    if "duration = 2\n" in changed:
        changed = changed.replace("duration = 1.0\n", "")
    assert changed != body
    code, out, err = plan(tmp_path, changed, "-o", tmp_path / "m.h5")
    assert code == 2 and out == "" and err.count("\n") == 1 and line in err, err
    assert not (tmp_path / "m.h5").exists()


def test_every_duration_is_given_and_the_total_is_to_be_least(tmp_path):
    code, _, err = plan(tmp_path, text([1.0], places=PLACES[:2], more='least = "total"\n'))
    assert code == 2 and 'least = "total"' in err


@pytest.mark.thorough
def test_answers_for_xarray(tmp_path):
    (tmp_path / "plan.toml").write_text(text([1.0, None], places=PLACES[:3]))
    data = cspr_jax.plan(tmp_path / "plan.toml").answers.to_xarray()
    assert data.control_points.dims == ("target", "control_point", "axis")
    np.testing.assert_allclose(data.control_points.sel(control_point="end"), PLACES[1:3])
    assert cspr("plan", tmp_path / "plan.toml", "-o", tmp_path / "m.h5")[0] == 0
    assert cspr("plot", tmp_path / "m.h5", "-o", tmp_path / "m.png")[0] == 0
    assert (
        json.loads(cspr("plan", tmp_path / "plan.toml", "--json")[1])["segments"][0]["control_points"][0] == PLACES[0]
    )
