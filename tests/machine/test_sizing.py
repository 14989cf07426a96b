"""Sizes of motors: balance of energy, dense samples, poses at rest, and integrals of functions with jumps."""

import json

import numpy as np
import pytest
from oracles import any_motion
from oracles.sampled_motion import State
from support.commands import cspr, strict_json

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.numerics.quadrature import integrals
from cspr_jax.outputs.plots.machine.torque_speed import torque_speed_figure

SPOOLS = [[0.9, 0.0, 0.0], [-0.6, 0.9, 0.0], [-0.3, -0.9, 0.1]]
RADII = np.array([0.02, 0.025, 0.03])
WINCH = {
    "drum_radius": RADII.tolist(),
    "gear_ratio": 5.0,
    "motor_inertia": 2e-5,
    "friction": 0.01,
    "viscous_friction": 3e-5,
    "efficiency": 0.9,
    "motor_stall_torque": 0.2,
    "motor_no_load_speed": 300.0,
}
TIMES = np.array([0.0, 0.7, 1.3, 2.0, 2.6])
POINTS = np.array([[0.1, 0.0, 0.9], [0.25, 0.1, 1.0], [0.0, 0.2, 1.1], [-0.1, 0.0, 1.0], [0.0, -0.1, 1.2]])


def _file(folder, name="r", winch=WINCH):
    keys = [f"{key} = {value}" for key, value in winch.items()]
    path = folder / f"{name}.toml"
    path.write_text("\n".join([f'name = "{name}"\nmass = 0.5\nbase_points = {json.dumps(SPOOLS)}', "[winch]", *keys]))
    return path


@pytest.fixture(scope="module")
def checks(tmp_path_factory):
    """A motion from rest to rest, and the same backwards."""
    robot = _file(tmp_path_factory.mktemp("robots"))
    ways = [POINTS, POINTS[::-1]]
    return [cspr_jax.check(robot, TIMES, way, interpolation="quintic") for way in ways]


@pytest.fixture(scope="module")
def sized(checks):
    """The sizes of the first motion."""
    return cspr_jax.size(checks[0], factor=2.0)


@pytest.fixture(scope="module")
def winding(checks):
    """Times, winding speeds, loads of the motors by the cables and torques, in NumPy, from dense rows."""
    rows = checks[0].plan.rows(20000.0)
    still, count = np.zeros_like(rows["position"]), len(rows["t"])
    moving = (rows[name] for name in ("position", "velocity", "acceleration"))
    state = State(*moving, np.broadcast_to(np.eye(3), (count, 3, 3)), still, still)
    found = any_motion.cables({"base_points": SPOOLS, "platform_points": None}, state)
    speed, change = -5.0 * found.rates / RADII, -5.0 * found.accelerations / RADII
    load, side = RADII * rows["tension"] / 5.0, np.sign(speed)
    side[[0, -1]] = side[[1, -2]]  # it begins and ends at rest
    torque = load * 0.9**-side + 2e-5 * change + side * 0.01 + 3e-5 * speed
    return rows["t"], speed, load, torque


def _integral(times, values):
    return np.sum(0.5 * np.diff(times)[:, None] * (values[1:] + values[:-1]), axis=0)


def _integral_of_jumps(times, values, speed):
    """The same of values that jump where a motor turns back: each side of the jump holds up to it."""
    first, last = speed[:-1], speed[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        before = np.where(first * last < 0.0, first / (first - last), 0.5)
    return np.sum(np.diff(times)[:, None] * (before * values[:-1] + (1.0 - before) * values[1:]), axis=0)


def test_energy_is_balanced(sized, winding):
    """Energy that motors give and do not get back: work on the load, friction, and losses of the gears."""
    times, speed, load, _ = winding
    lifted = -0.5 * 9.81 * (POINTS[-1, 2] - POINTS[0, 2])  # z down
    friction = _integral(times, 0.01 * np.abs(speed) + 3e-5 * speed**2).sum()
    gears = _integral(times, np.abs(load * speed) * np.where(speed > 0.0, 1.0 / 0.9 - 1.0, 0.1)).sum()
    given = float(np.sum(sized.joint.energy - sized.joint.regenerated_energy))
    assert given == pytest.approx(lifted + friction + gears, rel=1e-6) and gears > 0.1 * abs(lifted)


def test_largest_values_are_those_of_dense_samples(sized, winding):
    _, speed, _, torque = winding
    power = torque * speed
    for name, values in (
        ("torque", np.abs(torque)),
        ("speed", np.abs(speed)),
        ("power", power),
        ("braking_power", -power),
    ):
        dense, found = values.max(0), getattr(sized.joint, name)
        assert (found >= dense * (1.0 - 1e-9)).all() and (found <= dense * (1.0 + 1e-3)).all(), name


def test_root_mean_squares_are_those_of_dense_samples(sized, winding):
    times, speed, _, torque = winding
    rms = np.sqrt(_integral_of_jumps(times, torque**2, speed) / times[-1])
    np.testing.assert_allclose(sized.joint.torque_rms, rms, rtol=1e-6)
    for name, values in (("energy", torque * speed), ("regenerated_energy", -torque * speed)):
        np.testing.assert_allclose(getattr(sized.joint, name), _integral(times, values.clip(min=0.0)), rtol=1e-6)


def test_several_motions_are_one_cycle(checks, sized):
    both, back = cspr_jax.size(checks, factor=2.0), cspr_jax.size(checks[1])
    for name in ("torque", "speed", "power", "braking_power"):
        worst = np.maximum(getattr(sized.joint, name), getattr(back.joint, name))
        np.testing.assert_array_equal(getattr(both.joint, name), worst)
        np.testing.assert_array_equal(both.required[name], 2.0 * worst)
    square = 0.5 * (sized.joint.torque_rms**2 + back.joint.torque_rms**2)
    np.testing.assert_allclose(both.joint.torque_rms, np.sqrt(square), rtol=1e-12)
    np.testing.assert_allclose(both.joint.energy, sized.joint.energy + back.joint.energy, rtol=1e-12)
    assert both.joint.duration == pytest.approx(5.2) and len(both.each) == 2
    worst = np.maximum(sized.joint.torque_rms, back.joint.torque_rms)
    np.testing.assert_array_equal(both.required["torque_rms"], 2.0 * worst)
    overall = both.to_dict()
    assert overall["required"]["torque_rms"] == pytest.approx(2.0 * worst.max())
    assert overall["overall"]["energy"] == pytest.approx(both.joint.energy.sum())


def test_integrals_of_functions_with_jumps_and_kinks():
    def functions(x):
        jump = np.where(x > 1.0 / 3.0, np.exp(x), -2.0)
        return np.stack([jump, np.abs(x - 0.7), np.sqrt(x), np.zeros_like(x), np.cos(50.0 * x)], axis=1)

    exact = [np.e - np.exp(1.0 / 3.0) - 2.0 / 3.0, 0.5 * (0.49 + 0.09), 2.0 / 3.0, 0.0, np.sin(50.0) / 50.0]
    found = integrals(functions, np.array([0.0, 0.2, 1.0]), 1e-9)
    np.testing.assert_allclose(found, exact, rtol=1e-9, atol=1e-15)


def test_integrals_of_rounding_noise_end():
    counts = []

    def functions(x):
        counts.append(x.size)
        noise = 1e-17 * np.sin(1e12 * x)
        return np.stack([noise, 1.0 + noise, 1e-3 * np.exp(x)], axis=1)

    found = integrals(functions, np.array([0.0, 1.0]), 1e-9, floor=np.full(3, 1e-6))
    np.testing.assert_allclose(found, [0.0, 1.0, 1e-3 * (np.e - 1.0)], rtol=1e-9, atol=1e-15)
    assert sum(counts) < 1000
    endless = integrals(lambda x: np.stack([np.sin(1e12 * x), x], axis=1), np.array([0.0, 1.0]), 1e-9)
    assert np.isnan(endless[0]) and endless[1] == pytest.approx(0.5, rel=1e-12)


def test_a_motor_whose_cable_keeps_its_length_holds_it(tmp_path):
    """On a level circle about the vertical line through a spool its cable has one length, and its rate is rounding."""
    keys = {"drum_radius": 0.02, "gear_ratio": 5.0, "efficiency": 0.9, "friction": 0.01, "motor_inertia": 1e-5}
    spools = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]
    robot = {"name": "circle", "mass": 1.0, "base_points": spools, "winch": keys}
    circle = {"centre": [0.0, 0.0, 1.3], "radius": 0.2, "frequency": 0.5}
    found = cspr_jax.size({"schema": 1, "family": "ellipse", "robot": robot, "ellipse": circle}).joint
    angle = np.linspace(0.0, 2.0 * np.pi, 401)[:-1]
    turning = 0.2 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    away = np.array(spools) - (turning + np.array([0.0, 0.0, 1.3]))[:, None]
    lengths = np.linalg.norm(away, axis=2, keepdims=True)
    force = -0.25 * turning - np.array([0.0, 0.0, 9.81])
    tensions = np.linalg.solve(np.swapaxes(away / lengths, 1, 2), force[..., None])[:, 0, 0]
    load = 0.02 * tensions / 5.0
    torque = np.maximum(load / 0.9 + 0.01, np.abs(load * 0.9 - 0.01))
    assert (found.speed[0], found.energy[0], found.regenerated_energy[0]) == (0.0, 0.0, 0.0) and found.speed[1] > 10.0
    # Equidistant samples of a periodic function integrate it.
    assert found.torque_rms[0] == pytest.approx(np.sqrt(np.mean(torque**2)), rel=1e-9)
    assert found.torque[0] == pytest.approx(torque.max(), rel=1e-6)


def test_sizes_are_of_one_robot(tmp_path):
    robot = """{ name = "four", mass = 1, base_points = [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.1]],
  winch = { drum_radius = 0.02 } }""".replace("\n", "")
    axes = "x = [-0.1, 0.1]\ny = [0.0]\nz = [1.0]\n"
    head = f'schema = 1\nmap = "workspace"\nrobot = {robot}\n'
    body = f'[limits]\ntension_max = 30.0\n[axes]\n{axes}[workspace]\nconditions = ["wrench-feasible"]\n'
    paths = []
    for name, words in (("any", 'without = "any-one"\n'), ("one", "without = [1]\n"), ("full", "")):
        (tmp_path / f"{name}.toml").write_text(head + words + body)
        code, _, err = cspr("run", tmp_path / f"{name}.toml", "-o", tmp_path / name)
        assert code == 0, err
        paths.append(tmp_path / name / f"{name}.h5")
    with pytest.raises(ConfigError, match='without = "any-one": must be absent or list cables'):
        cspr_jax.size(paths[0])
    with pytest.raises(ConfigError, match=r"must have the winches of .*full"):
        cspr_jax.size([paths[2], paths[1]])


def test_poses_at_rest_are_held_by_the_worse_friction(tmp_path):
    robot = _file(tmp_path)
    axes = "x = [-0.2, 0.1, 5.0]\ny = [0.0, 0.1]\nz = [0.8, 1.2]\n"
    conditions = '[workspace]\nconditions = ["static"]\n'
    text = f'schema = 1\nmap = "workspace"\nrobot = "{robot}"\n[axes]\n{axes}{conditions}'
    (tmp_path / "w.toml").write_text(text)
    assert cspr("run", tmp_path / "w.toml", "-o", tmp_path / "run")[0] == 0
    code, out, err = cspr("size", tmp_path / "run" / "w.h5", "--json")
    assert (code, err) == (0, "")
    found = strict_json(out)
    inside = np.array([[x, y, z] for x in (-0.2, 0.1) for y in (0.0, 0.1) for z in (0.8, 1.2)])
    still = np.zeros_like(inside)
    state = State(inside, still, still, np.tile(np.eye(3), (len(inside), 1, 1)), still, still)
    oracle = {"base_points": SPOOLS, "platform_points": None, "mass": 0.5, "gravity": 9.81, "z_axis": "down"}
    matrix, wrench = any_motion.balance(oracle | {"pattern": "3T"}, state, any_motion.cables(oracle, state))
    tensions = np.linalg.solve(matrix, wrench[..., None])[..., 0]
    expected = (RADII * tensions / 5.0 / 0.9 + 0.01).max(0)
    np.testing.assert_allclose([axis["torque"] for axis in found["axes"]], expected, rtol=1e-9)
    assert found["overall"]["torque_rms"] is None and found["required"]["torque"] == pytest.approx(1.5 * expected.max())


def test_the_command_prints_a_table_and_draws(tmp_path, checks):
    motion, robot = tmp_path / "way.csv", _file(tmp_path)
    rows = "\n".join(",".join(map(str, (t, *p))) for t, p in zip(TIMES, POINTS, strict=True))
    motion.write_text(f"# interpolation = quintic\nt,x,y,z\n{rows}\n")
    code, out, err = cspr("size", motion, "--robot", robot, "-o", tmp_path / "size.png")
    assert (code, err) == (0, "") and "rms torque" in out and "times 1.5" in out and "the motor's line" in out
    assert (tmp_path / "size.png").read_bytes().startswith(b"\x89PNG")


def test_pictures_show_lines_and_limits(sized):
    limits = sized.limits | {name: np.full(3, 0.15) for name in ("motor_torque_max",)}
    limits |= {"motor_speed_max": np.full(3, 200.0), "motor_power_max": np.full(3, 8.0)}
    figure = torque_speed_figure("r", sized.curves, sized.required, 2.0, limits)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words[1:] == ["2 times it", "2 times the largest", "line of the motor", "limits", "limit of power"]
    for k, panel in enumerate(figure.axes):
        box = panel.lines[2].get_xydata()
        np.testing.assert_allclose(box.max(0), [sized.required["speed"][k], sized.required["torque"][k]])


def test_what_has_no_size_is_refused_in_one_line(tmp_path, checks):
    bare = tmp_path / "bare.toml"
    bare.write_text(f'name = "bare"\nmass = 0.5\nbase_points = {json.dumps(SPOOLS)}')
    plan = cspr_jax.check(bare, TIMES, POINTS, interpolation="quintic")
    with pytest.raises(ConfigError, match=r"robot bare: must have \[winch\]"):
        cspr_jax.size(plan)
    other = cspr_jax.check(_file(tmp_path, winch=WINCH | {"gear_ratio": 6.0}), TIMES, POINTS, interpolation="quintic")
    with pytest.raises(ConfigError, match="must have the winches of"):
        cspr_jax.size([checks[0], other])
    with pytest.raises(ConfigError, match="must be one plan or result"):
        cspr_jax.size([])
    through = np.stack([0.0 * TIMES, 0.0 * TIMES, 0.5 - 0.4 * TIMES], axis=1)  # cables without a slope cannot hold it
    with pytest.raises(ConfigError, match="must be another motion: torques are infinite"):
        cspr_jax.size(cspr_jax.check(_file(tmp_path), TIMES, through, interpolation="quintic"))
    for arguments, words in (
        (["a.toml", "--factor", "0"], "--factor: 0: must be a number > 0"),
        (["a.toml", "-o", "picture"], "-o: picture: must end in"),
        ([tmp_path / "none.toml"], "none.toml"),
    ):
        code, out, err = cspr("size", *arguments)
        assert code in (2, 4) and out == "" and len(err.splitlines()) == 1 and words in err, err
