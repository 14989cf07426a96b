"""Plans with splines: poses at times, files, other families before and behind; one line for what makes no motion."""

import json

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline
from support.commands import plan, planned

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.schema.families import ANY_PATTERN

POSES = """
[[pose]]
position = [0.0, 0.0, 1.0]
[[pose]]
position = [0.1, 0.05, 0.9]
time = 1.5
{second}
[[pose]]
position = [-0.05, 0.1, 1.1]
time = 3.0
"""
PLAN = 'schema = 1\nrobot = "prototype"\nfamily = "spline"\n{keys}\n' + POSES
PLACES = np.array([[0.0, 0.0, 1.0], [0.1, 0.05, 0.9], [-0.05, 0.1, 1.1]])
TIMES = np.array([0.0, 1.5, 3.0])
FILE = "t,x,y,z\n0,0,0,1\n1.5,0.1,0.05,0.9\n3,-0.05,0.1,1.1\n"


def content(keys: str = "", second: str = "") -> str:
    return PLAN.format(keys=keys, second=second)


def as_dictionary(**keys):
    poses = [{"position": place} | ({"time": time} if time else {}) for place, time in zip(PLACES, TIMES, strict=True)]
    return {"schema": 1, "robot": "prototype", "family": "spline", "pose": poses} | keys


def test_any_pattern():
    assert set(ANY_PATTERN) == set(PATTERNS)


def test_cubic_spline(tmp_path):
    result = cspr_jax.plan(as_dictionary(samples=11))
    assert result.feasible
    rows, curve = result.rows(), CubicSpline(TIMES, PLACES, bc_type="clamped")
    for name, order in (("position", 0), ("velocity", 1), ("acceleration", 2)):
        # At a knot a row belongs to the segment before it or behind it: the third derivative alone jumps.
        np.testing.assert_allclose(rows[name], curve(rows["t"], order), atol=1e-12)
    segments = result.to_dict()["segments"]
    assert [segment["duration"] for segment in segments] == pytest.approx([1.5, 1.5])
    assert all(segment["verdict"] == "feasible" and segment["margin_unit"] == "N" for segment in segments)
    for segment in segments:
        assert 0.0 < segment["margin_bound"] <= segment["margin"] == pytest.approx(segment["tension_min"], rel=0.02)


def test_a_pose_at_rest_ends_a_curve():
    poses = as_dictionary()["pose"]
    poses[1]["rest"] = True
    rows = cspr_jax.plan(as_dictionary(pose=poses, samples=3, interpolation="quintic")).rows()
    np.testing.assert_allclose(rows["velocity"][[0, 2, 3, 5]], 0.0, atol=1e-12)
    np.testing.assert_allclose(rows["acceleration"][[0, 2, 3, 5]], 0.0, atol=1e-9)
    middle = make_interp_spline(TIMES[:2], PLACES[:2], 5, bc_type=([(1, np.zeros(3)), (2, np.zeros(3))],) * 2)
    np.testing.assert_allclose(rows["position"][1], middle(0.75), atol=1e-12)


def test_velocities_at_poses():
    velocities = [[0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, -0.1]]
    poses = [pose | {"velocity": velocity} for pose, velocity in zip(as_dictionary()["pose"], velocities, strict=True)]
    for more in ({}, {"interpolation": "hermite"}):
        rows = cspr_jax.plan(as_dictionary(pose=poses, samples=2, **more)).rows()
        np.testing.assert_allclose(rows["velocity"], np.array(velocities)[[0, 1, 1, 2]], atol=1e-12)


def test_a_file_is_the_same_motion(tmp_path):
    """Alone, as a pose, and behind others."""
    (tmp_path / "own.csv").write_text(FILE)
    expected = planned(tmp_path, content())["segments"]
    whole = 'schema = 1\nrobot = "prototype"\nfamily = "spline"\nmotion = "own.csv"\n'
    segment = planned(tmp_path, whole)["segments"][0]
    assert segment["duration"] == pytest.approx(3.0)
    assert segment["margin"] == pytest.approx(min(part["margin"] for part in expected), rel=0.02)
    poses = [{"position": [0.1, 0.0, 1.0]}, {"position": [0.0, 0.0, 1.0], "time": 2.0}]
    poses.append({"motion": str(tmp_path / "own.csv")})
    answer = cspr_jax.plan(as_dictionary(pose=poses)).to_dict()["segments"]
    assert [part["duration"] for part in answer] == pytest.approx([2.0, 3.0])
    assert answer[1]["margin"] == pytest.approx(segment["margin"])


def test_stretched(tmp_path):
    """Twice as slow: accelerations a quarter, speeds half."""
    once, twice = (cspr_jax.plan(as_dictionary(stretch=factor, samples=5)).rows() for factor in (1.0, 2.0))
    np.testing.assert_allclose(twice["t"], 2.0 * once["t"])
    np.testing.assert_allclose(twice["velocity"], once["velocity"] / 2.0, atol=1e-12)
    np.testing.assert_allclose(twice["acceleration"], once["acceleration"] / 4.0, atol=1e-12)


CHANGE = """schema = 1
robot = "prototype"
z0 = 1.0
[[pose]]
rest = true
[[pose]]
position = [0.1, 0.05, 0.9]
[[pose]]
position = [0.0, 0.05, 0.95]
family = "spline"
time = 2.0
"""


def test_behind_another_family(tmp_path):
    """Velocity and acceleration go on where they are given; else a line says what jumps."""
    code, _, err = plan(tmp_path, CHANGE)
    assert code == 2 and err.count("\n") == 1 and "acceleration" in err and "jumps by" in err
    # A hypocycloid has the acceleration of the swing there, g / z0 towards P0 for the horizontal part and the depth.
    place, rest = np.array([0.1, 0.05, 0.9]), np.array([0.0, 0.0, 1.0])
    at_pose = (-9.81 / 1.0 * (place - rest)).tolist()
    text = CHANGE.replace("0.9]\n", f"0.9]\nacceleration = {at_pose}\n").replace("z0", 'interpolation = "quintic"\nz0')
    answer = planned(tmp_path, text)
    assert [segment["family"] for segment in answer["segments"]] == ["hypocycloid-standard", "spline"]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("time = 3.0", "", "pose[2].time is missing"),
        ("time = 3.0", "time = 1.5", "pose[2].time = 1.5: must be above that of pose[1], 1.5"),
        ("time = 3.0", "time = 3.0\narcs = 3", "pose[2].arcs: must be absent"),
        ("time = 3.0", "time = 3.0\nduration = 3.0", "pose[2].duration: must be absent unless"),
        ("time = 3.0", "time = 3.0\nquaternion = [1, 0, 0, 0]", "pose[2].quaternion: must be absent"),
        ("time = 3.0", 'motion = "own.csv"', "pose[2].position: must be absent where a file leads"),
        ('family = "spline"', 'family = "spline"\ninterpolation = "hermite"', "pose[0].velocity is missing"),
        ('family = "spline"', 'family = "spline"\nmotion = "own.csv"', 'motion = "own.csv": must be absent beside'),
        ('family = "spline"', 'family = "spline"\ninterpolation = "linear"', "interpolation = "),
        ('family = "spline"', 'family = "bezier"', 'pose[1].time: must be absent unless family = "spline" leads to it'),
    ],
)
def test_bad_poses(tmp_path, before, after, words):
    code, out, err = plan(tmp_path, content().replace(before, after))
    assert (code, out) == (2, "") and err.count("\n") == 1 and words in err, err


def test_infeasible_segments_name_the_cable(tmp_path):
    text = content("cable_speed_max = 0.05")
    code, out, _ = plan(tmp_path, text, "--json")
    segment = json.loads(out)["segments"][0]
    assert code == 1 and segment["verdict"] == "cable_too_fast"
    cause = segment["cause"][0]
    assert cause["criterion"] == "cable_too_fast" and cause["needed"] > cause["allowed"] == 0.05
    start, end = segment["failing"][0]
    assert start <= cause["t"] <= end


@pytest.mark.thorough
def test_a_joint_stays(tmp_path):
    """Poses and tables that move the joint of a robot are refused; elsewhere its place is what positions are."""
    ends = np.array([[0.3, 0.0, 0.2], [0.0, 0.3, 0.2], [-0.3, -0.3, 0.2], [0.2, -0.3, 0.2]])
    robot = {"name": "joint", "pattern": "3R", "z_axis": "up", "mass": 1.0, "inertia": (0.1 * np.eye(3)).tolist()}
    robot |= {"base_points": (2.0 * ends).tolist(), "platform_points": ends.tolist(), "centre_of_mass": [0.1, 0.0, 0.3]}
    keys = as_dictionary(robot=robot)
    with pytest.raises(ConfigError, match=r"pose\[0\] to pose\[2\]: positions: they differ by 0.2"):
        cspr_jax.plan(keys)
    turns = [[1.0, 0.0, 0.0, 0.0], [0.96, 0.28, 0.0, 0.0], [0.96, 0.0, 0.28, 0.0]]
    keys["pose"] = [
        pose | {"position": [0.0, 0.1, 0.2], "quaternion": turn} for pose, turn in zip(keys["pose"], turns, strict=True)
    ]
    place, path = np.array([0.0, 0.1, 0.2]), tmp_path / "own.csv"
    table = np.column_stack([TIMES, np.zeros((3, 3)) + place, turns])
    np.savetxt(path, table, delimiter=",", header="t,x,y,z,qw,qx,qy,qz", comments="")
    files = [{**keys, "pose": [], "motion": str(path), "point": point} for point in ("origin", "mass-centre")]
    for each in (keys, *files):
        found = cspr_jax.plan({key: value for key, value in each.items() if value != []})
        rows = found.rows()["position"]
        np.testing.assert_allclose(rows, place + 0.0 * rows, atol=1e-12)


@pytest.mark.thorough
def test_a_spline_between_other_families_read_back(tmp_path):
    """Transitions before it, a fastest line behind it, which sits on its limit; the CSV has the verdict of the plan."""
    text = """
schema = 1
robot = "prototype"
family = "spline"
interpolation = "quintic"
z0 = 1.7
[[pose]]
rest = true
[[pose]]
position = [0.5, 0.3, 1.6]
family = "transition"
[[pose]]
rest = true
family = "transition"
[[pose]]
position = [0.1, 0.05, 1.6]
time = 2.0
[[pose]]
position = [0.0, 0.0, 1.5]
time = 4.0
rest = true
[[pose]]
position = [0.02, 0.01, 1.5]
family = "quintic"
"""
    code, _, err = plan(tmp_path, text, "-o", tmp_path / "motion.csv")
    assert (code, err) == (0, "")
    check = cspr_jax.check("prototype", tmp_path / "motion.csv")
    assert check.feasible and check.duration == pytest.approx(
        cspr_jax.plan(tmp_path / "plan.toml").answers.duration.sum()
    )
