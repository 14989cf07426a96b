"""Motions retimed: the planned path in less time, within all limits, not below the lower bound; what stays, and why."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.spatial import cKDTree
from support.commands import cspr, plan, strict_json
from support.motions import states_along

import cspr_jax
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.numerics.elementary import double_precision

ROOT = Path(__file__).parents[2]
# The largest tension and cable speed of the whole sequence of Table 2.1, rounded up.
LIMITS = {"tension_max": 1.6, "cable_speed_max": 3.85}
POSES = [[-1.1, -1.1, 0.5], [-1.1, -0.9, 1.5]]
KEYS = {"schema": 1, "robot": "prototype", "family": "hypocycloid-standard", "amplitude": "quintic", "z0": 1.7}


def hypocycloid(places=POSES, **keys):
    return cspr_jax.plan(KEYS | {"limits": LIMITS, "pose": [{"position": place} for place in places]} | keys)


def states(motion, count: int):
    with double_precision():
        return states_along(motion, np.linspace(0.0, 1.0, count))


def distance(before, after, count: int = 400_001) -> float:
    """Largest distance of a motion from a polyline through many places of another one, m."""
    line, places = (np.asarray(states(*pair).position) for pair in ((before, count), (after, 20_001)))
    # Where the path crosses itself the nearest place may lie on the other branch.
    nearest = cKDTree(line).query(places, 8)[1]
    apart, places = np.full(nearest.shape, np.inf), places[:, None]
    for start in (np.maximum(nearest - 1, 0), np.minimum(nearest, count - 2)):
        a, step = line[start], line[start + 1] - line[start]
        square = np.sum(step**2, axis=2)
        fraction = np.clip(np.sum((places - a) * step, axis=2) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
        apart = np.minimum(apart, np.linalg.norm(a + fraction[..., None] * step - places, axis=2))
    return float(apart.min(1).max())


def check_limits(retimed, limits=LIMITS) -> None:
    rows = retimed.rows(rate=2000.0)
    assert rows["tension"].min() > 0.0
    assert rows["tension"].max() < limits["tension_max"]
    if "cable_speed_max" in limits:
        assert np.abs(rows["rate"]).max() < limits["cable_speed_max"]


@pytest.fixture(scope="module")
def swing():
    planned = hypocycloid()
    return planned, cspr_jax.retime(planned)


@pytest.mark.thorough
def test_hypocycloid_that_almost_turns_back(swing):
    planned, retimed = swing
    (segment,) = retimed.to_dict()["segments"]
    assert segment["verdict"] == "feasible"
    assert segment["retimed"]
    assert segment["planned_duration"] == planned.answers.duration[0]
    assert segment["lower_bound"] <= segment["duration"] < 0.97 * segment["planned_duration"]
    assert segment["gap"] == pytest.approx(1.0 - segment["lower_bound"] / segment["duration"])
    assert segment["gap"] < 0.003
    assert segment["gain"] == pytest.approx(1.0 - segment["duration"] / segment["planned_duration"])
    assert distance(planned.motions[0], retimed.motions[0]) < 1e-7
    assert segment["path_deviation"] < 1e-7
    check_limits(retimed)


def test_ends_stay(swing):
    planned, retimed = swing
    before, after = (states(result.motions[0], 2) for result in swing)
    np.testing.assert_allclose(after.position, before.position, atol=1e-12)
    np.testing.assert_allclose(after.velocity, 0.0, atol=1e-12)
    np.testing.assert_array_equal(retimed.points, planned.points)


@pytest.mark.thorough
def test_reversal(swing):
    backwards = cspr_jax.retime(hypocycloid(POSES[::-1]))
    assert backwards.answers.duration == pytest.approx(swing[1].answers.duration, rel=1e-3)
    assert backwards.details(0)["lower_bound"] == pytest.approx(swing[1].details(0)["lower_bound"], rel=1e-3)


def test_table_and_files(swing, tmp_path):
    text = "\n".join(str(cell) for column in swing[1].to_table().columns for cell in (column.header, *column.cells))
    for head in ("planned (s)", "gain (%)", "least (s)", "3.5"):
        assert head in text
    path = swing[1].save(tmp_path / "retimed.h5")
    duration = float(swing[1].answers.duration[0])
    assert cspr_jax.open_result(path).to_xarray()["t"].values[-1] == pytest.approx(duration)


TIMES = np.array([0.0, 2.0, 4.0, 6.0])
PLACES = np.array([[0.0, 0.0, 1.5], [0.2, 0.1, 1.3], [-0.1, 0.2, 1.4], [0.0, -0.1, 1.5]])


@pytest.mark.thorough
def test_checked_spline():
    curve = make_interp_spline(TIMES, PLACES, 5, bc_type=([(1, [0.0] * 3), (2, [0.0] * 3)],) * 2)
    checked = cspr_jax.check("prototype", curve, limits={"tension_max": 1.6})
    retimed = cspr_jax.retime(checked, grid=300)
    assert retimed.feasible
    shown = retimed.to_dict()
    assert shown["lower_bound"] <= shown["duration"] < 0.6 * shown["planned_duration"] == pytest.approx(3.6)
    assert distance(checked.plan.motions[0], retimed.plan.motions[0]) < 1e-6
    check_limits(retimed.plan, {"tension_max": 1.6})
    assert any(line.startswith("retimed: 6 s -> ") and "shorter)" in line for line in retimed.lines())


def test_speeds_at_moving_ends_stay():
    checked = cspr_jax.check("prototype", TIMES, PLACES, ends="natural", limits={"tension_max": 1.6})
    retimed = cspr_jax.retime(checked, grid=300)
    assert retimed.duration < checked.duration
    before, after = (states(one.plan.motions[0], 2) for one in (checked, retimed))
    np.testing.assert_allclose(after.velocity, before.velocity, atol=1e-6)


def test_passing_a_pose():
    poses = [{"position": place.tolist(), "time": float(time)} for place, time in zip(PLACES, TIMES, strict=True)]
    planned = cspr_jax.plan(
        {"schema": 1, "robot": "prototype", "family": "spline", "interpolation": "quintic"}
        | {"limits": {"tension_max": 1.6}, "pose": poses}
    )
    retimed = cspr_jax.retime(planned, grid=300)
    assert retimed.feasible
    assert (retimed.answers.duration < planned.answers.duration).all()
    for before, after in zip(retimed.motions, retimed.motions[1:], strict=False):
        ends = states(before, 2), states(after, 2)
        for name, tolerance in (("position", 1e-9), ("velocity", 1e-6)):
            np.testing.assert_allclose(getattr(ends[0], name)[1], getattr(ends[1], name)[0], atol=tolerance)
    np.testing.assert_allclose(states(retimed.motions[0], 2).position[1], PLACES[1], atol=1e-7)
    assert np.linalg.norm(states(retimed.motions[0], 2).velocity[1]) > 0.2


def test_what_is_not_faster_stays():
    """Motions without ramps are faster than those with long ones, which stay."""
    keys = {"schema": 1, "robot": "prototype", "family": "path", "limits": {"tension_max": 1.6}}
    line = {"points": [[0.0, 0.0, 1.5], [0.2, 0.0, 1.4]], "ramp_time": 0.0, "grid": 100}
    planned = cspr_jax.plan(keys | {"path": line})
    again = cspr_jax.retime(planned, ramp_time=0.3, grid=100)
    assert "retime: as planned, since no faster motion is proved: to 1" in again.warnings
    np.testing.assert_array_equal(again.answers.duration, planned.answers.duration)
    np.testing.assert_array_equal(*(states(one.motions[0], 9).position for one in (planned, again)))
    segment = again.to_dict()["segments"][0]
    assert again.feasible
    assert (segment["gain"], segment["retimed"], segment["path_deviation"]) == (0.0, False, 0.0)
    assert segment["lower_bound"] == pytest.approx(planned.details(0)["lower_bound"], rel=2e-3)


def test_what_no_speed_makes_feasible_stays():
    """A straight line far outside of the footprint, from stop to stop."""
    places = np.array([[0.9, 0.0, 1.0], [1.0, 0.1, 1.0]])
    checked = cspr_jax.check("prototype", np.array([0.0, 9.0]), places, limits={"tension_max": 1.6})
    retimed = cspr_jax.retime(checked, grid=50)
    assert not retimed.feasible
    assert retimed.duration == checked.duration == pytest.approx(9.0)
    assert retimed.plan.details(0)["retimed"] is False


def test_long_ramps_are_told(swing):
    """Where a path all but turns back outside the footprint there are none."""
    assert "retime: ramp_time = 0.1 s: no ramps of that length were found: accelerations jump" in swing[1].warnings


@pytest.mark.thorough
def test_time_that_nothing_bounds(tmp_path):
    """Cables from four corners can pull as hard in all directions as one likes."""
    corners = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 2.0], [-1.0, 0.0, 2.0]]
    robot = tmp_path / "square.toml"
    robot.write_text(f'name = "square"\nbase_points = {corners}\nplanar = true\nmass = 1.0\n')
    places = np.array([[0.0, 0.0, 1.0], [0.2, 0.0, 1.1], [0.3, 0.0, 0.9]])
    line = "retime: no limit bounds the time of the motion to 1: give tension_max or a limit of speeds"
    for limits, is_told in ({}, True), ({"speed_max": 3.0, "tension_max": 100.0}, False):
        checked = cspr_jax.check(robot, np.array([0.0, 1.0, 2.0]), places, limits=limits)
        assert (line in cspr_jax.retime(checked, grid=100).plan.warnings) == is_told


@pytest.mark.thorough
def test_command(tmp_path):
    text = 'schema = 1\nrobot = "prototype"\nfamily = "spline"\n[limits]\ntension_max = 1.6\n'
    text += "".join(f"[[pose]]\nposition = {PLACES[i].tolist()}\ntime = {TIMES[i]}\n" for i in range(2))
    code, out, err = plan(tmp_path, text, "--retime", "--grid", 200, "--json", "-o", tmp_path / "motion.csv")
    (segment,) = strict_json(out)["segments"]
    assert code == 0
    assert "as planned" not in err
    assert segment["lower_bound"] <= segment["duration"] < segment["planned_duration"]
    last = (tmp_path / "motion.csv").read_text().splitlines()[-1]
    assert float(last.split(",")[0]) == pytest.approx(segment["duration"])
    code, out, err = cspr("check", tmp_path / "motion.csv", "--robot", "prototype", "--retime", "--grid", 200, "--json")
    assert strict_json(out)["retimed"]["planned_duration"] == pytest.approx(segment["duration"])


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--grid", 3), "--grid: must be absent without --retime"),
        (("--retime", "--grid", 1), "--grid: 1: must be a whole number from 2 to 100000"),
        (("--retime", "--ramp-time", "nan"), "--ramp-time: nan: must be a number >= 0, in s"),
    ],
)
def test_mistakes(tmp_path, arguments, line):
    code, _, err = plan(tmp_path, "", *arguments)
    assert (code, err) == (2, f"cspr: {line}\n")


@pytest.mark.thorough
def test_launches_have_their_time():
    planned = cspr_jax.plan(ROOT / "sweeps" / "launch.toml")
    with pytest.raises(ConfigError, match="must be absent for a plan that launches an object"):
        cspr_jax.retime(planned)
    with pytest.raises(InputError, match="plan"):
        cspr_jax.retime(3)


@pytest.mark.parametrize(
    ("count", "fraction"),
    [
        # Motions all but turn back, within 1e-10 m: whether that is proved depends on rounding, and so on the code.
        pytest.param(5, 0.96, marks=pytest.mark.thorough),
        pytest.param(7, 0.89, marks=pytest.mark.soak),  # as users run it
    ],
)
def test_table_2_1(count, fraction):
    keys = tomllib.loads((ROOT / "sweeps" / "table_2_1.toml").read_text("utf-8")) | {"limits": LIMITS}
    planned = cspr_jax.plan(keys)
    retimed = cspr_jax.retime(planned)
    assert retimed.feasible
    is_retimed = retimed.answers.is_retimed
    assert is_retimed.sum() >= count
    assert (retimed.answers.duration[is_retimed] < 0.98 * planned.answers.duration[is_retimed]).all()
    assert retimed.answers.duration.sum() < fraction * planned.answers.duration.sum()
    for before, after, segment in zip(planned.motions, retimed.motions, retimed.to_dict()["segments"], strict=True):
        assert not segment["retimed"] or 0.975 * segment["duration"] <= segment["lower_bound"] <= segment["duration"]
        assert segment["path_deviation"] < 1e-6
        assert distance(before, after) < 1e-6
    check_limits(retimed)


@pytest.mark.thorough
def test_platform_that_turns():
    """Places and orientations of the retimed motion are those of the planned one."""
    half = np.array([0.0, 0.06, -0.05, 0.0])
    turns = np.stack([np.cos(half), 0.6 * np.sin(half), 0.0 * half, 0.8 * np.sin(half)], axis=1)
    poses = [
        {"position": [0.1 * k, 0.05 * k**2, 2.0 + 0.1 * k], "quaternion": turn.tolist(), "time": 2.0 * k}
        for k, turn in enumerate(turns)
    ]
    keys = {"schema": 1, "robot": "laval-mssm", "family": "spline", "interpolation": "quintic"}
    planned = cspr_jax.plan(keys | {"limits": {"tension_max": 200.0}, "pose": poses})
    retimed = cspr_jax.retime(planned, grid=300)
    assert retimed.feasible
    assert (retimed.answers.duration < planned.answers.duration).all()
    for before, after in zip(planned.motions, retimed.motions, strict=True):
        line, places = (
            np.concatenate([np.asarray(state.position), np.asarray(state.quaternion)], axis=1)
            for state in (states(before, 100_001), states(after, 2_001))
        )
        line = np.concatenate([line, line * np.where(np.arange(7) < 3, 1.0, -1.0)])
        assert cKDTree(line).query(places)[0].max() < 2e-5
