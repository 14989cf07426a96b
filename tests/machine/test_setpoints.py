"""Set points: read back from files to the poses of the plan, by an oracle of cables, drums and motors apart."""

import json

import numpy as np
import pytest
import yaml
from oracles import any_motion
from oracles.sampled_motion import State
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from support.commands import cspr

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.setpoints import formats
from cspr_jax.outputs.setpoints.formats import LINES, points_of
from cspr_jax.schema.setpoints import LARGEST_RATE, SETPOINT_FORMATS
from cspr_jax.store.reading.setpoints import read_set_points

WINCH = {
    "gear_ratio": 5.0,
    "motor_inertia": 2e-5,
    "friction": 0.01,
    "viscous_friction": 3e-5,
    "efficiency": 0.9,
    "zero_length": 1.0,
    "encoder_counts": 4096.0,
}
DIAMETER = 0.002
THREE = [[0.9, 0.0, 0.0], [-0.6, 0.9, 0.0], [-0.3, -0.9, 0.1]]
PLANE = [[-1.0, 0.0, 2.0], [0.2, 0.0, 2.0], [1.0, 0.0, 2.0]]
CORNERS = [[1.0, 1.0, 2.0], [-1.0, 1.0, 2.0], [-1.0, -1.0, 2.2], [1.0, -1.0, 2.0]]


def _winches(n):
    drums = {"drum_radius": [0.02 + 0.005 * k for k in range(n)], "direction": [(-1.0) ** k for k in range(n)]}
    return WINCH | drums | {"layer_turns": 7.5, "cable_length": 9.0}


def _robot(folder, kind, **more):
    """Path of a robot file."""
    keys = {"name": kind, "mass": 0.5, "cable_diameter": DIAMETER}
    if kind == "space":
        keys |= {"base_points": THREE, "pulley_radius": 0.03}
    elif kind == "plane":
        keys |= {"base_points": PLANE, "planar": True, "z_axis": "up", "tension_min": 0.2, "tension_max": 40.0}
    else:
        keys |= {"base_points": CORNERS, "z_axis": "up", "tension_min": 0.2, "tension_max": 40.0}
    keys |= more
    winch = _winches(len(keys["base_points"]))
    lines = [f"{key} = {json.dumps(value)}" for key, value in keys.items()]
    path = folder / f"{kind}.toml"
    path.write_text("\n".join([*lines, "[winch]", *(f"{key} = {value}" for key, value in winch.items())]))
    return path


def _way(kind):
    times = np.array([0.0, 0.7, 1.3, 2.0, 2.603])
    points = np.array([[0.1, 0.0, 0.9], [0.25, 0.1, 1.0], [0.0, 0.2, 1.1], [-0.1, 0.0, 1.0], [0.1, 0.0, 0.9]])
    if kind == "plane":
        points[:, 1] = 0.0
    return times, points


def _checked(folder, kind, **more):
    return cspr_jax.check(_robot(folder, kind, **more), *_way(kind), interpolation="quintic").plan


@pytest.fixture(scope="module")
def plans(tmp_path_factory):
    """Feasible plans: a point mass behind pulleys, and one on redundant cables in the plane."""
    folder = tmp_path_factory.mktemp("robots")
    found = {kind: _checked(folder, kind) for kind in ("space", "plane")}
    assert all(plan.feasible for plan in found.values())
    return found


def _oracle_robot(kind):
    robot = {"platform_points": None, "pulley_radius": None, "mass": 0.5, "gravity": 9.81}
    if kind == "space":
        pulleys = {"pulley_radius": np.full(3, 0.03), "pulley_axes": np.array([[0.0, 0.0, -1.0]] * 3)}
        return robot | pulleys | {"base_points": THREE, "z_axis": "down", "pattern": "3T"}
    if kind == "plane":
        return robot | {"base_points": PLANE, "z_axis": "up", "pattern": "2T"}
    return robot | {"base_points": CORNERS, "z_axis": "up", "pattern": "3T"}


def _lengths(kind, positions, velocities=0.0, accelerations=0.0):
    """Lengths of the cables, and two derivatives, by the oracle."""
    count, still = len(positions), np.zeros_like(positions)
    moving = (still + velocities, still + accelerations)
    state = State(positions, *moving, np.tile(np.eye(3), (count, 1, 1)), still, still)
    found = any_motion.cables(_oracle_robot(kind), state)
    return found.lengths, found.rates, found.accelerations


def _of_angle(winch, k, angle):
    """Radius and length at an angle of a motor, unwinding layer by layer."""
    radius, turns, total = winch["drum_radius"][k], winch["layer_turns"], winch["cable_length"]

    def wound(length):
        left, on_drum, r = total - length, 0.0, radius
        while left >= (full := 2.0 * np.pi * r * turns):
            left, on_drum, r = left - full, on_drum + 2.0 * np.pi * turns, r + DIAMETER
        return on_drum + left / r

    drum = wound(winch["zero_length"]) - angle / (winch["direction"][k] * winch["gear_ratio"])
    length, r = total, radius
    while drum >= 2.0 * np.pi * turns:
        length, drum, r = length - 2.0 * np.pi * r * turns, drum - 2.0 * np.pi * turns, r + DIAMETER
    return r, length - drum * r


def _pose(kind, lengths, near):
    """Position whose cables have these lengths."""
    free = [0, 2] if kind == "plane" else [0, 1, 2]

    def at(x):
        point = np.array(near, float)
        point[free] = x
        return point

    def error(x):
        return _lengths(kind, at(x)[None])[0][0] - lengths

    found = least_squares(error, np.array(near)[free] + 0.01, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return at(found.x)


@pytest.mark.parametrize("kind", ["space", "plane", pytest.param("corners", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("ending", [".csv", ".json", ".yaml"])
def test_files_read_back_give_the_poses_of_the_plan(tmp_path, plans, kind, ending):
    plan = plans[kind] if kind in plans else _checked(tmp_path, kind)
    points = read_set_points(plan.save_setpoints(tmp_path / f"points{ending}", 50.0))
    rows, winch = plan.rows(50.0), _winches(plan.problem.robot.n_cables)
    assert np.array_equal(points["t"][:-1], np.arange(len(rows["t"]) - 1) / 50.0) and len(points["t"]) == 132
    for i in (0, 17, 64, 100, len(rows["t"]) - 1):
        lengths = np.array([_of_angle(winch, k, angle)[1] for k, angle in enumerate(points["angle"][i])])
        np.testing.assert_allclose(_pose(kind, lengths, rows["position"][i]), rows["position"][i], atol=1e-9)
    # Way points lie on ticks: set points are those of the very instants.
    np.testing.assert_allclose(rows["position"][[35, 65, 100]], _way(kind)[1][1:4], atol=1e-9)


# A platform hangs on six cables in three near pairs.
RING = [
    [0.0, 0.86, 0.02],
    [0.0, 0.84, 0.01],
    [-0.71, -0.4, -0.02],
    [-0.78, -0.45, 0.0],
    [0.68, -0.44, -0.04],
    [0.72, -0.45, -0.01],
]
PLATE = [
    [0.154, 0.097, -0.001],
    [-0.136, 0.08, 0.004],
    [-0.141, 0.087, -0.007],
    [-0.009, -0.178, 0.002],
    [-0.01, -0.175, -0.002],
    [0.155, 0.089, 0.004],
]


@pytest.mark.thorough
@pytest.mark.parametrize("pulley_radius", [None, 0.03])
def test_files_read_back_give_the_poses_of_a_platform(tmp_path, pulley_radius):
    """Positions and orientations that least squares find for the lengths on the drums."""
    robot = {"base_points": RING, "platform_points": PLATE, "centre_of_mass": [0.01, -0.02, 0.03]}
    keys = robot | {"inertia": (0.01 * np.eye(3)).tolist(), "z_axis": "down", "tension_min": 0.05}
    keys |= {"pulley_radius": pulley_radius} if pulley_radius else {}
    path = _robot(tmp_path, "platform", **keys)
    if pulley_radius:
        robot |= {"pulley_radius": np.full(6, pulley_radius), "pulley_axes": np.array([[0.0, 0.0, -1.0]] * 6)}
    times, points = _way("platform")
    turns = Rotation.from_rotvec([[0, 0, 0], [0.1, 0, 0.05], [0, 0.12, 0], [0.05, -0.05, 0.1], [0, 0, 0]])
    quaternions = turns.as_quat(scalar_first=True)
    points = [0.4, 0.4, 1.0] * points + [0.0, 0.0, 0.3]
    plan = cspr_jax.check(path, times, points, quaternions, interpolation="quintic").plan
    rows, winch = plan.rows(50.0), _winches(6)
    angles = read_set_points(plan.save_setpoints(tmp_path / "points.csv", 50.0))["angle"]

    def lengths(x):
        rotation = Rotation.from_rotvec(x[3:]).as_matrix()[None]
        state = State(x[None, :3], *np.zeros((2, 1, 3)), rotation, *np.zeros((2, 1, 3)))
        return any_motion.cables(robot, state).lengths[0]

    # Rows count orientations from one that the package chooses, the motion and the lengths from that of the file.
    relative = Rotation.from_quat(rows["quaternion"], scalar_first=True)
    absolute = relative * relative[0].inv() * turns[0]
    assert (absolute[[35, 65, 100]] * turns[1:4].inv()).magnitude().max() < 1e-9
    for i in (0, 17, 64, 100, len(rows["t"]) - 1):
        wanted = np.array([_of_angle(winch, k, angle)[1] for k, angle in enumerate(angles[i])])
        turn = absolute[i]
        start = np.concatenate([rows["position"][i], turn.as_rotvec()]) + 0.01
        found = least_squares(lambda x, wanted=wanted: lengths(x) - wanted, start, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        np.testing.assert_allclose(found[:3], rows["position"][i], atol=1e-9)
        assert (Rotation.from_rotvec(found[3:]) * turn.inv()).magnitude() < 1e-9


def _friction_side(speed):
    return np.where(np.abs(speed) > 1e-6, np.sign(speed), 0.0)


@pytest.mark.parametrize("kind", ["space", "plane"])
def test_speeds_and_torques_are_those_of_the_oracle(plans, kind):
    """Exactly at the instants: the oracle takes the states of the plan's rows, and nothing is interpolated."""
    points, rows, winch = plans[kind].setpoints(50.0), plans[kind].rows(50.0), _winches(3)
    states = (rows[name] for name in ("position", "velocity", "acceleration"))
    _, rates, accelerations = _lengths(kind, *states)
    radii = np.array([[_of_angle(winch, k, angle)[0] for k, angle in enumerate(row)] for row in points.angle])
    speed, change = (-5.0 * each / radii for each in (rates, accelerations))
    side = _friction_side(speed)
    torque = radii * rows["tension"] / 5.0 * 0.9**-side + 2e-5 * change + side * 0.01 + 3e-5 * speed
    growing = -np.array(winch["direction"])
    np.testing.assert_allclose(points.speed, growing * speed, atol=1e-8)
    np.testing.assert_allclose(points.motor_acceleration, growing * change, atol=1e-7)
    moving = np.abs(speed).min(1) > 1e-3
    assert moving.sum() > 100
    np.testing.assert_allclose(points.torque[moving], (growing * torque)[moving], atol=1e-9)
    # First and last at rest: the motors hold the cables, without friction.
    for i in (0, -1):
        assert not points.speed[i].any() and not points.motor_acceleration[i].any()
        np.testing.assert_allclose(points.torque[i], growing * (radii * rows["tension"])[i] / 5.0, atol=1e-9)


@pytest.mark.parametrize("kind", ["space", pytest.param("corners", marks=pytest.mark.thorough)])
def test_drums_of_elastic_cables_pay_out_unstretched_lengths(tmp_path, kind):
    """Speeds and accelerations against differences of the lengths, which come from the planned tensions."""
    plan = _checked(tmp_path, kind, axial_stiffness=300.0)
    points, rows = plan.setpoints(1000.0), plan.rows(1000.0)
    expected = _lengths(kind, rows["position"])[0] / (1.0 + rows["tension"] / 300.0)
    np.testing.assert_allclose(points.length, expected, atol=1e-9)
    assert np.abs(_lengths(kind, rows["position"])[0] - points.length).min() > 1e-4
    n = slice(2, -3)
    rate, change = (
        (each[:-4] - 8.0 * each[1:-3] + 8.0 * each[3:-1] - each[4:])[: len(points.t[n])] / 0.012
        for each in (points.length, points.rate)
    )
    inner = np.ones(len(rate), bool)
    for end in (0.0, *_way(kind)[0]):  # the fourth derivative of a quintic is continuous, the fifth jumps
        inner &= np.abs(points.t[n] - end) > 0.01
    # The rule that chooses tensions of redundant cables has kinks, where differences tell nothing.
    share = 1.0 if kind == "space" else 0.95
    for found, differences, close in ((points.rate, rate, 1e-6), (points.acceleration, change, 1e-4)):
        assert (np.abs(found[n] - differences)[inner] <= close).mean() >= share


def test_trajectories_of_joints_have_the_fields_of_the_message(tmp_path, plans):
    paths = [plans["space"].save_setpoints(tmp_path / f"points{ending}", 7.0) for ending in (".json", ".yaml")]
    message = json.loads(paths[0].read_text())
    assert yaml.safe_load(paths[1].read_text()) == message
    assert set(message) == {"header", "joint_names", "points"} and message["joint_names"][2] == "winch_3"
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    stamps = [point["time_from_start"] for point in message["points"]]
    assert stamps[8] == {"sec": 1, "nanosec": 142857143} and stamps[-1] == {"sec": 2, "nanosec": 603000000}
    fields = {"positions", "velocities", "accelerations", "effort", "time_from_start"}
    assert all(set(point) == fields and len(point["effort"]) == 3 for point in message["points"])


def test_counts_are_whole_and_nearest(tmp_path, plans):
    path = plans["space"].save_setpoints(tmp_path / "points.txt", 50.0)
    assert path.read_text().splitlines()[0] == "# cycle time 0.02 s"
    found, points = read_set_points(path), plans["space"].setpoints(50.0)
    assert np.array_equal(found["count"], np.rint(points.angle * 4096.0 / (2.0 * np.pi)))
    assert np.abs(found["count_rate"] - points.speed * 4096.0 / (2.0 * np.pi)).max() <= 0.5
    assert np.array_equal(found["torque"], points.torque)
    # The motion ends between two cycles, and rests in the last one.
    assert found["t"][-1] == pytest.approx(2.62) and len(found["t"]) == len(points.t)


def test_robots_without_winches_have_lengths_and_tensions(tmp_path):
    robot = cspr_jax.point_mass(THREE, mass=0.5)
    plan = cspr_jax.check(robot, *_way("space"), interpolation="quintic").plan
    rows = plan.rows(20.0)
    for ending in (".csv", ".json"):
        points = read_set_points(plan.save_setpoints(tmp_path / f"points{ending}", 20.0))
        for name, of_rows in (("length", "length"), ("rate", "rate"), ("tension", "tension")):
            np.testing.assert_allclose(points[name], rows[of_rows], atol=1e-12)
    assert (tmp_path / "points.csv").read_text().splitlines()[0].split(",")[:3] == ["t", "length_1", "length_2"]
    with pytest.raises(ConfigError, match="needs winch"):
        plan.save_setpoints(tmp_path / "points.txt")
    assert not (tmp_path / "points.txt").exists()


def test_rates_are_bounded(plans, monkeypatch):
    np.testing.assert_array_equal(plans["space"].setpoints(0.5).t, [0.0, 2.0, 2.603])
    for rate in (0.0, np.nextafter(LARGEST_RATE, np.inf)):
        with pytest.raises(ConfigError, match=r"--rate: .*: must be a number > 0, at most 1e\+06, in Hz"):
            points_of(plans["space"], rate)
    monkeypatch.setattr(formats, "LARGEST_NUMBERS", 395)
    # 131 instants on ticks and the end, of 3 axes each.
    assert len(plans["space"].setpoints(50.0).t) == 132
    with pytest.raises(ConfigError, match="--rate: 52 Hz: must give at most 131 set points of 3 axes"):
        plans["space"].setpoints(52.0)


def test_every_format_is_written_and_read():
    assert set(SETPOINT_FORMATS) == set(LINES)


def test_the_command_refuses_in_one_line(tmp_path):
    motion, robot = tmp_path / "way.csv", tmp_path / "r.toml"
    times, points = _way("space")
    rows = "\n".join(",".join(map(str, (t, *p))) for t, p in zip(times, points, strict=True))
    motion.write_text(f"t,x,y,z\n{rows}\n")
    robot.write_text(f'name = "r"\nmass = 0.5\nbase_points = {THREE}\n[winch]\ndrum_radius = 0.02\n')
    end = " or ".join(SETPOINT_FORMATS)
    for arguments, words in (
        (["--setpoints", tmp_path / "a.xml"], f"--setpoints: {tmp_path / 'a.xml'}: must end in {end}"),
        (["--setpoints", tmp_path / "a.csv", "--rate", "-1"], "--rate: -1"),
        (["--setpoints", tmp_path / "a.csv", "--rate", "1e7"], "--rate: 1e+07: must be a number > 0, at most 1e+06"),
        (["--setpoints", motion], "must be another name: the motion is there"),
    ):
        code, out, err = cspr("check", motion, "--robot", robot, *arguments)
        assert (code, out, len(err.splitlines())) == (2, "", 1) and words in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r.toml", "way.csv"]


def test_nothing_is_written_for_motions_that_are_not_proved(tmp_path):
    times, points = _way("space")
    robot = _robot(tmp_path, "space", cable_length_max=1.2)
    plan = cspr_jax.check(robot, times, points, interpolation="quintic").plan
    assert not plan.feasible
    with pytest.raises(ConfigError, match="motors get proved motions alone"):
        plan.save_setpoints(tmp_path / "points.csv")
    assert list(tmp_path.iterdir()) == [robot] and len(plan.setpoints(10.0).t) == 28


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "t,angle_1\n0,x\n", "must hold only numbers"),
        ("a.csv", "t,angle_2\n0,1\n", "heads must be t, and names with the numbers of cables"),
        ("a.csv", "t,angle_1\n0\n", "must be a header line and rows of as many numbers"),
        ("a.json", "{", "no JSON"),
        ("a.yaml", "a: [", "no YAML"),
        ("a.json", '{"points": []}', "must be a JointTrajectory"),
        (
            "a.json",
            '{"joint_names": ["winch_1"], "points": [{"time_from_start": {"sec": "1", "nanosec": 0}}]}',
            "must be a J",
        ),
        ("a.json", '{"joint_names": ["winch_1"], "points": [{"time_from_start": {"sec": 1}}]}', "must be a JointTraj"),
        ("a.txt", "t\n1\n", "the first line must be # cycle time"),
        ("a.txt", "# cycle time x s\ncount_1\n1\n", "the first line must be # cycle time, a number > 0, s"),
        ("a.txt", "# cycle time 1.2.3 s\ncount_1\n1\n", "the first line must be # cycle time"),
        ("a.txt", "# cycle time 0 s\ncount_1\n1\n", "the first line must be # cycle time"),
        ("a.csv", "t,angle_1\n0,nan\n", "must hold only finite numbers"),
        ("a.xml", "", "must end in"),
    ],
)
def test_wrong_files_are_refused(tmp_path, name, text, words):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(ConfigError, match=words) as caught:
        read_set_points(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
