"""Trajectories of CASPR: its laws between points, its joints, and one line for what is not read."""

import itertools
import json
import math

import numpy as np
import pytest
from scipy.interpolate import BPoly
from scipy.spatial.transform import Rotation

import cspr_jax
from config.test_formats import BODIES, PLAIN
from cspr_jax.cli import main
from cspr_jax.config.motions import caspr
from cspr_jax.errors import ConfigError

QUINTIC = "quintic_spline_trajectory"


def point(time, **values):
    return (
        f"<point{time}>" + "".join(f"<{tag}>{' '.join(map(str, v))}</{tag}>" for tag, v in values.items()) + "</point>"
    )


def element(points, kind=QUINTIC, name="one", definition="relative", more=""):
    head = f'<{kind} id="{name}" time_definition="{definition}" time_step="0.01"{more}>'
    return f"{head}<points>{''.join(points)}</points></{kind}>"


def written(folder, *elements, joint="SPATIAL_EULER_XYZ", **more):
    (folder / "hub_bodies.xml").write_text(BODIES.format(**(PLAIN | {"joint": joint} | more)))
    text = '<?xml version="1.0"?><!DOCTYPE trajectories SYSTEM "../nowhere.dtd"><trajectories><joint_trajectories>'
    path = folder / "hub_trajectories.xml"
    path.write_text(text + "".join(elements) + "</joint_trajectories></trajectories>")
    return path


def still(time, q):
    return point(time, q=q, q_dot=[0] * len(q), q_ddot=[0] * len(q))


def values(pieces, table, times, order=0):
    curve = BPoly(np.moveaxis(table, 1, 0), pieces.knots)
    return (curve.derivative(order) if order else curve)(times)


def rotated(pieces, times):
    return Rotation.from_quat(values(pieces, pieces.quaternion, times), scalar_first=True)


# CoGiRo's trajectory general_1 (github.com/darwinlau/CASPR, CoGiRo_trajectories.xml).
COGIRO = [[-3.0, -1.0, 2.0, -0.5, 0.2, 0.3], [2.0, -3.0, 4.0, 0.2, -0.1, 0.1], [4.0, 2.0, 3.0, 0.5, 0.2, -0.2]]


def smooth(fraction):
    return fraction**3 * (10.0 - 15.0 * fraction + 6.0 * fraction**2)


def test_a_platform_moves_and_turns_about_one_axis_from_point_to_point(tmp_path):
    """By 10 s^3 - 15 s^4 + 6 s^5 of the way, and of the angle; R = Rx Ry Rz."""
    points = [still(' time="2.0"' * (k > 0), q) for k, q in enumerate(COGIRO)]
    pieces = caspr.read(written(tmp_path, element(points)))
    assert (pieces.knots[0], pieces.knots[-1], pieces.z_axis) == (0.0, 4.0, "up")
    for k, (first, last) in enumerate(itertools.pairwise(COGIRO)):
        fraction = np.linspace(0.0, 1.0, 41)
        times = np.minimum(2.0 * k + 2.0 * fraction, 4.0)
        move, (start, end) = smooth(fraction), Rotation.from_euler("XYZ", [first[3:], last[3:]])
        expected = np.array(first[:3]) + move[:, None] * (np.array(last) - first)[:3]
        np.testing.assert_allclose(values(pieces, pieces.position, times), expected, atol=1e-13)
        turn = start * Rotation.from_rotvec(move[:, None] * (start.inv() * end).as_rotvec())
        assert (rotated(pieces, times).inv() * turn).magnitude().max() < 1e-10
    lengths = np.linalg.norm(values(pieces, pieces.quaternion, np.linspace(0.0, 4.0, 999)), axis=1)
    assert np.abs(lengths - 1.0).max() < 1e-10


def test_laws(tmp_path):
    """Lines, cubics with rates, cubics with mean rates, and parabolic blends, of a planar robot and its angle."""
    q = np.array([[0.3, 0.5, 0.0], [0.7, 0.1, 0.2], [0.4, 0.3, -0.1]])
    at = ("", ' time="5.0"', ' time="11.0"')
    rates = [[0.0, 0.1, 0.0], [0.2, 0.0, 0.1], [0.0, 0.0, 0.0]]
    cubic = [point(t, q=x, q_dot=v) for t, x, v in zip(at, q, rates, strict=True)]
    plain = [point(t, q=x) for t, x in zip(at, q, strict=True)]
    mean = [cubic[0], plain[1], cubic[2]]
    blends = [plain[0], plain[1], plain[2].replace('"11.0"', '"11.0" blend_time="1.5"')]
    path = written(
        tmp_path,
        element(plain, "linear_spline_trajectory", "line", "absolute"),
        element(cubic, "cubic_spline_trajectory", "cubic", "absolute"),
        element(mean, "cubic_spline_average_velocity_trajectory", "mean", "absolute"),
        element(blends, "parabolic_blend_trajectory", "blend", "absolute", ' blend_time_default="0.5"'),
        joint="PLANAR_XZ",
    )
    times = np.linspace(0.0, 11.0, 221)
    middle = ((q[1] - q[0]) / 5.0 + (q[2] - q[1]) / 6.0) / 2.0
    knots = np.array([0.0, 5.0, 11.0])

    def hermite(slopes):
        return BPoly.from_derivatives(knots, np.stack([q, slopes], axis=1))(times)

    def blend(t):
        k = int(t >= 5.0)
        width, part, since, step = (5.0, 0.5, t, q[1] - q[0]) if k == 0 else (6.0, 1.5, t - 5.0, q[2] - q[1])
        second_derivative = step / (part * (width - part))
        if since < part:
            return q[k] + second_derivative * since**2 / 2.0
        if since < width - part:
            return q[k] + second_derivative * part**2 / 2.0 + second_derivative * part * (since - part)
        return q[k + 1] - second_derivative * (width - since) ** 2 / 2.0

    expected = {
        "line": np.stack([np.interp(times, knots, column) for column in q.T], axis=1),
        "cubic": hermite(rates),
        "mean": hermite([rates[0], middle, rates[2]]),
        "blend": np.stack([blend(t) for t in times]),
    }
    for name, poses in expected.items():
        pieces = caspr.read(path, name)
        places = np.stack([poses[:, 0], 0.0 * times, poses[:, 1]], axis=1)
        np.testing.assert_allclose(values(pieces, pieces.position, times), places, atol=1e-13)
        angles = rotated(pieces, times).as_rotvec()
        np.testing.assert_allclose(angles, np.outer(poses[:, 2], [0.0, 1.0, 0.0]), atol=1e-10)


@pytest.mark.parametrize(
    ("joint", "q", "place", "turn"),
    [
        ("PLANAR_XY", [1.0, 2.0, 0.3], [1.0, 0.0, 2.0], [0.0, -0.3, 0.0]),
        ("PLANAR_XZ", [1.0, 2.0, 0.3], [1.0, 0.0, 2.0], [0.0, 0.3, 0.0]),
        ("PLANAR_YZ", [1.0, 2.0, 0.3], [1.0, 0.0, 2.0], [0.0, -0.3, 0.0]),
        ("P_XZ", [1.0, 2.0], [1.0, 0.0, 2.0], None),
        ("P_YZ", [1.0, 2.0], [1.0, 0.0, 2.0], None),
        ("P_XY", [1.0, 2.0], [1.0, 0.0, 2.0], None),
        ("T_XYZ", [1.0, 2.0, 3.0], [1.5, 2.25, 4.0], None),
        ("S_EULER_XYZ", [0.1, 0.2, 0.3], [0.0, 0.0, 0.0], "XYZ"),
        ("S_FIXED_XYZ", [0.1, 0.2, 0.3], [0.0, 0.0, 0.0], "xyz"),
    ],
)
def test_joints(tmp_path, joint, q, place, turn):
    """Poses come into the axes and from the origin of the robot file that the model becomes."""
    location = {"T_XYZ": "0.5 0.25 1", "S_EULER_XYZ": "0.5 0.25 1"}.get(joint, "0 0 0")
    path = written(tmp_path, element([still("", q), still(' time="1"', q)]), joint=joint, location=location)
    pieces = caspr.read(path)
    np.testing.assert_allclose(pieces.position[0, 0], place, atol=1e-15)
    if turn is None:
        assert pieces.quaternion is None
    else:
        expected = Rotation.from_euler(turn, q) if isinstance(turn, str) else Rotation.from_rotvec(turn)
        assert (rotated(pieces, [0.0])[0].inv() * expected).magnitude() < 1e-12


def test_a_long_turn_is_divided_until_it_fits(tmp_path):
    """An angle of many turns of a planar robot; the error is measured between the parts."""
    path = written(tmp_path, element([still("", [0, 1, 0]), still(' time="1"', [0, 1, 40])]), joint="PLANAR_XZ")
    pieces, times = caspr.read(path), np.linspace(0.0, 1.0, 3001)
    half = 20.0 * smooth(times)
    expected = np.stack([np.cos(half), 0.0 * half, np.sin(half), 0.0 * half], axis=1)
    assert np.abs(values(pieces, pieces.quaternion, times) - expected).max() < 2.0 * caspr.TURN_ERROR
    second_derivative = math.sqrt(np.abs(values(pieces, pieces.quaternion, times, 2)).max())
    assert second_derivative == pytest.approx(np.abs(20.0 * np.gradient(smooth(times), times)).max(), rel=1e-2)


def test_turns_and_pieces_have_a_bound(tmp_path):
    """A file of some hundred kB cannot ask for gigabytes of polynomial pieces."""
    for joint, far in (("PLANAR_XZ", [0, 0, 3e5]), ("SPATIAL_EULER_XYZ", [0, 0, 0, 0, -3e5, 0])):
        path = written(tmp_path, element([still("", [0] * len(far)), still(' time="1"', far)]), joint=joint)
        with pytest.raises(ConfigError, match=r"point 2.q: an angle of 300000 rad: must be at most 300 turns, 1884.96"):
            caspr.read(path)
    points = [still(' time="1"' * (k > 0), [0, 0, 1800 * (k % 2)]) for k in range(500)]
    with pytest.raises(ConfigError, match=r"points: 500 of them: must turn by less .* 100000 polynomial pieces"):
        caspr.read(written(tmp_path, element(points), joint="PLANAR_XZ"))


def test_one_of_several_trajectories_is_checked(tmp_path, capsys):
    """By `--trajectory`, by the key of plans and of their poses, and from Python; else their names are listed."""
    ways = {"up": [[0.1, 0, -1.0], [0.1, 0, -0.9]], "down": [[0, 0, -1.0], [0, 0.1, -1.1]]}
    elements = [
        element([still(' time="4"' * k, q) for k, q in enumerate(points)], name=name) for name, points in ways.items()
    ]
    path = written(tmp_path, *elements, joint="T_XYZ")
    assert main(["check", str(path), "--robot", "prototype", "--trajectory", "down", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["feasible"] and shown["duration"] == 4.0
    plan = 'schema = 1\nrobot = "prototype"\nfamily = "spline"\n'
    one = f'motion = "{path.name}"\ntrajectory = "down"\n'
    (tmp_path / "whole.toml").write_text(plan + one)
    (tmp_path / "poses.toml").write_text(plan + f"[[pose]]\n[[pose]]\n{one}")
    for name in ("whole.toml", "poses.toml"):
        motion = cspr_jax.plan(tmp_path / name).motions[0]
        np.testing.assert_allclose(motion.state(1.0).position[1], -0.1, atol=1e-12)
    cases = [
        (["check", str(path), "--robot", "prototype"], 'trajectory = (missing): must be "up" or "down"'),
        (["check", str(path), "--robot", "prototype", "--trajectory", "dwn"], "did you mean down?"),
    ]
    for name, text, line in (
        ("lone", plan + 'trajectory = "up"\n', "trajectory"),
        (
            "pose",
            plan + '[[pose]]\nposition = [0, 0, 1]\n[[pose]]\ntime = 1.0\nposition = [0, 0, 1]\ntrajectory = "up"\n',
            "beside motion",
        ),
        ("both", plan + f'{one}[[pose]]\n[[pose]]\nmotion = "{path.name}"\n', "absent beside [[pose]]"),
    ):
        (tmp_path / f"{name}.toml").write_text(text)
        cases.append((["plan", str(tmp_path / f"{name}.toml")], line))
    for words, line in cases:
        assert main(words) == 2
        error = capsys.readouterr().err
        assert line in error and error.count("\n") == 1


ONE, TWO = still("", [0] * 6), still(' time="1"', [1] * 6)


@pytest.mark.parametrize(
    ("elements", "name", "line"),
    [
        (
            [element([ONE, TWO]), element([ONE, TWO], name="two")],
            None,
            'trajectory = (missing): must be "one" or "two"',
        ),
        ([element([ONE, TWO])], "onne", 'trajectory = "onne": did you mean one? must be "one"'),
        ([], None, "no trajectories"),
        (['<file_trajectory id="one" filename="a.traj"/>'], None, '<file_trajectory>: must be "linear_spline'),
        ([element([ONE])], None, "1 points: must be two or more"),
        ([element([ONE, ONE])], None, 'point 2.time = "": must be a finite number'),
        ([element([ONE, TWO, TWO], definition="absolute")], None, "point 3.time = 1: must be greater than 1"),
        (
            [element([ONE, TWO], definition="other")],
            None,
            'time_definition = "other": must be "relative" or "absolute"',
        ),
        ([element([ONE, still(' time="1"', [1] * 5)])], None, "point 2.q: 5 numbers: must be 6"),
        ([element([ONE, TWO.replace("1 1", "1 nan", 1)])], None, 'point 2.q = "nan": must be a finite number'),
        ([element([ONE, point(' time="1"', q=[1] * 6)])], None, "point 2: 0 elements <q_dot>: must be one"),
        (
            [element([ONE, point(' time="1"', q=[1] * 6, q_dot=[0, 0, 0, 0, 0, 1], q_ddot=[0] * 6)])],
            None,
            "rates of angles: must be 0",
        ),
        (
            [element([ONE, TWO], "parabolic_blend_trajectory", more=' blend_time_default="0.5"')],
            None,
            "point 2.blend_time_default = 0.5: must be greater than 0, and less than 0.5",
        ),
    ],
)
def test_faults(tmp_path, elements, name, line):
    with pytest.raises(ConfigError) as caught:
        caspr.read(written(tmp_path, *elements), name)
    assert line in str(caught.value) and "\n" not in str(caught.value)


def test_a_file_needs_its_bodies(tmp_path):
    path = written(tmp_path, element([ONE, TWO]))
    (tmp_path / "hub_bodies.xml").rename(tmp_path / "bodies.xml")
    with pytest.raises(ConfigError, match=r"no such file beside it: hub_bodies\.xml"):
        caspr.read(path)
    assert len(caspr.read(path, bodies=tmp_path / "bodies.xml").knots) > 2
