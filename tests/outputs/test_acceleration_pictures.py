"""Pictures of accelerations: the feasible ones at an instant, those along straight lines, names of their bounds."""

import itertools
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.colors import to_hex
from support.reading import read_here

import cspr_jax
from cspr_jax.families.lines.durations import names_of
from cspr_jax.families.lines.map import LeastTimeMap
from cspr_jax.motion.given_limits import limits_over
from cspr_jax.outputs.plots.motions.half_planes import WINDOW, Plane, Window, section
from cspr_jax.outputs.plots.style.colours import NONE_COLOUR
from cspr_jax.robots.model.limits import Limits
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.meanings import line_bounds, value_attributes
from cspr_jax.schema.quantities import QUANTITIES, SEGMENTS, TRAJECTORY
from cspr_jax.store.files.netcdf import describe, dtype_of, new_hdf5
from outputs.test_outputs import cspr, panels
from outputs.test_pictures import GRID, bar, made, ticks

GRAVITY = 9.81
NAMES = MAP_KINDS["least-time"].quantities


@pytest.fixture(autouse=True)
def files_are_read_here(monkeypatch):
    """By this process; how another one reads them is for reliability/test_hostile_results.py."""
    read_here(monkeypatch)


def robot_of(points, z_axis="up", **others) -> dict:
    planar = all(point[1] == 0.0 for point in points)
    return {"name": "robot", "base_points": points, "mass": 10.0, "z_axis": z_axis, "planar": planar} | others


PLANAR = robot_of([[0.0, 0.0, 30.0], [45.0, 0.0, 30.0]])
RECTANGLE = robot_of([[0.0, 0.0, 30.0], [45.0, 0.0, 30.0], [45.0, 30.0, 30.0], [0.0, 30.0, 30.0]])


def motion(path: Path, robot: dict, poses, rows: dict, ends=(1.0,), **plan) -> Path:
    """A motion file with these rows; what is not given is zero."""
    count, cables = len(rows["t"]), len(robot["base_points"])
    keys = {"schema": 1, "robot": robot, "family": "s-curve", "pose": [{"position": list(p)} for p in poses]} | plan
    known = {"robot": robot["name"], "robot_settings": json.dumps(robot), "plan": json.dumps(keys), "mass": 10.0}
    shapes = {"position": 3, "acceleration": 3, "tension": cables}
    columns = {name: np.zeros((count, width)) for name, width in shapes.items()} | rows
    waypoints = np.asarray(ends, float)
    segments = {
        "segment": np.arange(1, len(waypoints) + 1),
        "segment_start": [0.0, *waypoints[:-1]],
        "segment_end": waypoints,
    }
    with new_hdf5(path, known | {"z_axis": robot["z_axis"], "base_points": np.array(robot["base_points"])}) as file:
        for table, values in ((TRAJECTORY, columns), (SEGMENTS, segments)):
            for name, data in values.items():
                kind = "float64" if table[name].kind == "float" else table[name].kind
                describe(file.create_dataset(name, data=np.asarray(data, kind)), table[name])
    return path


def level_motion(path: Path, robot: dict, place, accelerations, **plan) -> Path:
    """At one place, an instant a second."""
    rows = {"t": np.arange(len(accelerations), dtype=float), "acceleration": np.array(accelerations, float)}
    return motion(path, robot, [place, place], rows | {"position": np.tile(place, (len(accelerations), 1))}, **plan)


def corners_of(panel) -> np.ndarray:
    return np.unique(np.round(panel.patches[0].get_xy(), 9), axis=0)


def margin_of(panel) -> np.ndarray:
    """Both ends of the line of the margin."""
    return next(line for line in panel.lines if line.get_zorder() == 3.5).get_xydata()


@pytest.mark.parametrize("z_axis", ["up", "down"])
def test_a_planar_robot_between_its_tensions(capsys, tmp_path, figures, z_axis):
    """The parallelogram of the tensions, upward whichever way z points; the plan's limits stand over the robot's."""
    up = np.array([1.0, 1.0, 1.0 if z_axis == "up" else -1.0])
    robot = robot_of((np.array(PLANAR["base_points"]) * up).tolist(), z_axis, tension_min=1.0, tension_max=150.0)
    place, asked = np.array([15.0, 0.0, 5.0]), np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 1.0], [-1.0, 0.0, 0.5]])
    path = level_motion(tmp_path / "a.h5", robot, (place * up).tolist(), asked * up, tension_min=5.0)
    cspr(capsys, "plot", path, "--quantity", "acceleration")
    (panel,) = panels(figures[0])
    rays = np.array(PLANAR["base_points"]) - place
    rays = (rays / np.linalg.norm(rays, axis=1, keepdims=True))[:, [0, 2]]
    every = [np.array([a, b]) @ rays / 10.0 - [0.0, GRAVITY] for a, b in itertools.product((5.0, 150.0), repeat=2)]
    np.testing.assert_allclose(corners_of(panel), np.unique(np.round(every, 9), axis=0), atol=1e-8)
    # The distance from the nearest of the four sides, by hand: here that along which cable 2 is at 5 N.
    normals = rays[:, ::-1] * [1.0, -1.0]
    slacks = {}
    for k, other in ((0, 1), (1, 0)):
        for tension in (5.0, 150.0):
            inward = normals[k] * np.sign(normals[k] @ rays[other]) * (1.0 if tension == 5.0 else -1.0)
            slacks[k, tension] = (asked[:, [0, 2]] - tension * rays[other] / 10.0 + [0.0, GRAVITY]) @ inward
    margins = np.min(list(slacks.values()), axis=0)
    tight = int(margins.argmin())
    face = min(slacks, key=lambda key: slacks[key][tight])
    title = figures[0].get_suptitle()
    assert f"t = {tight} s (smallest margin)" in title and f"z axis {z_axis}" in title
    assert f"margin {margins[tight]:.3g} m/s² to the face of cable {face[0] + 1}" in title
    assert ("(largest tension)" in title) == (face[1] == 150.0)
    side = margin_of(panel)
    assert np.linalg.norm(np.diff(side, axis=0)) == pytest.approx(margins[tight], rel=1e-9)
    np.testing.assert_allclose(side[0], asked[tight, [0, 2]])
    assert (panel.get_xlabel(), panel.get_ylabel()) == (
        "level acceleration, along x (m/s²)",
        "upward acceleration (m/s²)",
    )
    cspr(capsys, "plot", path, "--quantity", "acceleration", "--at", "t=0.9")
    title = figures[1].get_suptitle()
    assert "t = 1 s (nearest to 0.9 s)" in title and f"margin {margins[1]:.3g} m/s²" in title


@pytest.mark.thorough
def test_a_spatial_robot_in_three_sections(capsys, tmp_path, figures):
    """Its cone, above the mass a rectangle like that of its spools; outside the margin is negative."""
    place, inside, outside = [10.0, 20.0, 6.0], [0.5, -1.0, -0.7], [15.0, -1.0, -0.7]
    path = level_motion(tmp_path / "a.h5", RECTANGLE, place, [inside, outside])
    robot = cspr_jax.point_mass(RECTANGLE["base_points"], mass=10.0, z_axis="up")
    wanted = cspr_jax.available_accelerations(robot, [place]).margin(np.array([inside]))[0]
    cspr(capsys, "plot", path, "--quantity", "acceleration", "--at", "t=0")
    level, along, across = panels(figures[0])
    rays = np.array(RECTANGLE["base_points"]) - place
    met = rays[:, :2] * (inside[2] + GRAVITY) / rays[:, 2:]
    np.testing.assert_allclose(corners_of(level), np.unique(np.round(met, 9), axis=0), atol=1e-8)
    assert sorted(text.get_text() for text in level.texts) == ["1", "2", "3", "4"]
    assert f"margin {wanted:.3g} m/s²" in figures[0].get_suptitle() and level.get_title().endswith("−0.7 m/s²")
    assert f"azimuth −{np.degrees(np.arctan2(1.0, 0.5)):.3g}°" in along.get_xlabel()
    assert np.linalg.norm(np.diff(margin_of(across), axis=0)) == pytest.approx(wanted, rel=1e-9)
    for panel in (level, along, across):
        point = next(x for x in panel.lines if x.get_zorder() == 4.0).get_xydata()[0]
        assert panel.patches[0].get_path().contains_point(point) and panel.get_aspect() == 1.0
    cspr(capsys, "plot", path, "--quantity", "acceleration")
    assert "t = 1 s" in figures[1].get_suptitle() and "margin −" in figures[1].get_suptitle()
    # At rest there is no direction to follow: one vertical section shows all.
    rest = level_motion(tmp_path / "b.h5", RECTANGLE, place, [[0.0, 0.0, 0.0]])
    cspr(capsys, "plot", rest, "--quantity", "acceleration")
    assert [panel.get_title() for panel in panels(figures[2])] == [
        "level, upward acceleration 0 m/s²",
        "vertical, across the nearest face",
    ]


def test_sections_hold_what_they_should():
    """Of random sets: a point of the window is in the polygon if it keeps every inequality; sides bear their face."""
    rng = np.random.default_rng(3)
    window = Window(np.array([-3.0, -2.0]), np.array([3.0, 2.0]))
    for _ in range(30):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        plane = Plane(rng.normal(size=3), turn[0], turn[1])
        normals, offsets = rng.normal(size=(5, 3)), np.append(rng.uniform(-2.0, 0.5, 4), -np.inf)
        corners, owners = section(plane, normals, offsets, window)
        asked = rng.uniform(window.low, window.high, (200, 2))
        beside = plane.point @ turn[2] * turn[2]
        slacks = (beside + asked @ turn[:2]) @ normals[:4].T - offsets[:4]
        sides = np.roll(corners, -1, axis=0) - corners
        ways = asked[:, None] - corners[None]
        is_in = (sides[:, 0] * ways[..., 1] - sides[:, 1] * ways[..., 0] >= 0.0).all(1) & (len(corners) > 2)
        clear = np.abs(slacks).min(axis=1) > 1e-9
        np.testing.assert_array_equal(is_in[clear], (slacks >= 0.0).all(1)[clear])
        for k, owner in enumerate(owners):
            if owner != WINDOW:
                ends = beside + corners[[k, (k + 1) % len(corners)]] @ turn[:2]
                np.testing.assert_allclose(ends @ normals[owner], offsets[owner], atol=1e-12)


def test_acceleration_over_the_way(capsys, tmp_path, figures):
    """Two lines, whose common place has a row of each; s'' is the acceleration over the length."""
    poses = np.array([[1.0, 20.0, 7.0], [4.0, 24.0, 7.0], [4.0, 24.0, 17.0]])
    parts = [np.linspace(0.0, 1.0, 5) ** 2, np.linspace(0.0, 1.0, 4)]
    lines = np.diff(poses, axis=0)
    position = np.concatenate([poses[k] + parts[k][:, None] * lines[k] for k in range(2)])
    bounds = [np.array([-np.inf, 3.0, 5.0]), np.array([-2.0, -1.0, 4.0])]
    rows = {
        "t": np.array([0.0, 1.0, 2.0, 3.0, 4.0, 4.0, 5.0, 6.0, 7.0]),
        "position": position,
        "path_acceleration": np.repeat(bounds, [5, 4], axis=0),
    }
    path = motion(tmp_path / "a.h5", RECTANGLE, poses, rows, (4.0, 7.0), max_acceleration=3.5)
    cspr(capsys, "plot", path, "--quantity", "path_acceleration")
    every = panels(figures[0])
    assert [panel.get_title() for panel in every] == ["segment 1: 5 m in 4 s", "segment 2: 10 m in 3 s"]
    for k, (panel, length) in enumerate(zip(every, (5.0, 10.0), strict=True)):
        _, largest, actual = panel.lines[:3]
        np.testing.assert_allclose(actual.get_xydata(), np.c_[parts[k], np.full(len(parts[k]), bounds[k][1] / length)])
        np.testing.assert_allclose(largest.get_ydata(), bounds[k][2] / length)
        assert panel.get_xlabel() == "part of the way s"
    assert every[0].get_ylabel() == "acceleration s'' (1/s²)"
    assert {line.get_ydata()[0] for line in every[0].lines if line.get_label() == "largest allowed"} == {0.7, -0.7}
    words = [text.get_text() for text in figures[0].legends[0].get_texts()]
    assert words == ["feasible", "least feasible", "largest feasible", "of the motion", "largest allowed"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ["--quantity", "tension"],
            [
                "--quantity",
                '"tension"',
                "one of trajectory, tensions, summary, acceleration for this motion, or absent",
            ],
        ),
        (["--quantity", "path_acceleration"], ["one of trajectory, tensions, summary, acceleration for this motion"]),
        (["--quantity", "acceleration", "--at", "x=1"], ["--at", '"x"', "one of t"]),
        (["--quantity", "acceleration", "--at", "t=9"], ["--at", "t=9", "t in [0, 1]"]),
        (["--at", "t=0"], ["--at", "absent for a motion but with --quantity acceleration"]),
        (["--quantity", "acceleration", "--lines", "t"], ["--lines", "absent for a motion"]),
        (["--quantity", "acceleration", "--envelope"], ["--envelope"]),
    ],
)
def test_a_picture_that_is_asked_wrongly(capsys, tmp_path, arguments, told):
    path = level_motion(tmp_path / "a.h5", PLANAR, [15.0, 0.0, 5.0], np.zeros((2, 3)))
    line = cspr(capsys, "plot", path, *arguments, code=2)
    assert all(word in line for word in told), line


def test_a_file_that_lacks_what_is_needed(capsys, tmp_path):
    """A map, a motion of an earlier version, a plan that cannot be read, a platform, a mass between its spools."""
    six = np.random.default_rng(0).normal(size=(6, 3)).tolist()
    platform = {"name": "six", "base_points": six, "platform_points": six, "inertia": np.eye(3).tolist(), "mass": 10.0}
    ask = ("--quantity", "acceleration")
    assert '"acceleration"' in cspr(capsys, "plot", made(tmp_path / "map.h5", GRID), *ask, code=2)
    path = level_motion(tmp_path / "a.h5", PLANAR, [15.0, 0.0, 5.0], np.zeros((2, 3)))
    faults = (
        ({"plan": None}, "keeps no robot and no plan"),
        ({"robot_settings": None}, "keeps no robot and no plan"),
        ({"plan": "{"}, "its plan cannot be read"),
        ({"plan": "schema = 2"}, "schema = 2"),
    )
    given = {"plan": None, "robot_settings": None}
    for k, (changes, told) in enumerate(faults):
        with h5py.File(path) as file:
            given = {name: file.attrs[name] for name in given} | changes
            rows = {name: file[name][...] for name in ("t", "position", "acceleration")}
        other = motion(tmp_path / f"{k}.h5", PLANAR, [[0.0] * 3] * 2, rows)
        with h5py.File(other) as file:
            known = {name: value for name, value in file.attrs.items() if name not in given}
            columns = {name: file[name][...] for name in file}
        with new_hdf5(other, known | {name: text for name, text in given.items() if text is not None}) as file:
            for name, values in columns.items():
                file[name] = values
        assert told in cspr(capsys, "plot", other, *ask, code=2)
    some = level_motion(tmp_path / "six.h5", platform | {"z_axis": "up"}, [0.0, 0.0, 5.0], np.zeros((1, 3)))
    assert '"acceleration" of a platform: must be' in cspr(capsys, "plot", some, *ask, code=2)
    high = level_motion(tmp_path / "high.h5", PLANAR, [15.0, 0.0, 30.0], np.zeros((1, 3)))
    assert "the cables span" in cspr(capsys, "plot", high, *ask, code=2)


@pytest.mark.parametrize(
    "limits", [{}, {"tension_min": 0.0, "cable_speed_max": 3.0}, {"tension_min": 1.0, "tension_max": 99.0}]
)
@pytest.mark.parametrize("name", ["boralugoda-rectangle", "boralugoda-planar-three", "prototype"])
def test_bounds_have_their_names(name, limits):
    """Those of the search, from 1 on, whatever the robot and its limits."""
    robot = cspr_jax.load_robot(name)
    spec = {"base_points": np.asarray(robot.base_points).tolist(), "planar": robot.dof == 2}
    every = line_bounds({"robot": spec, "limits": limits})
    assert every == ("none", *names_of(robot, limits_over(robot, Limits(**limits))))
    attributes = value_attributes(QUANTITIES["active_up"], {"robot": spec, "limits": limits})
    assert attributes["flag_values"].tolist() == list(range(len(every))) and attributes["flag_values"].dtype == np.int16
    assert attributes["flag_meanings"].replace("_", " ").replace(",", "").split("none ")[1].startswith("cables 1")
    assert len(attributes["flag_meanings"].split()) == len(every)
    assert (
        value_attributes(QUANTITIES["arcs"], {"robot": spec}) == value_attributes(QUANTITIES["active_up"], None) == {}
    )


def test_bounds_are_named_in_pictures(capsys, tmp_path, figures):
    """Colours of their own, the same in every picture; grey for none. Files of earlier versions lack the names."""
    number = np.array([[0, 1, 4], [3, 3, 0]])
    axes = {"x": [0.0, 1.0], "y": [0.0, 1.0, 2.0], "z": [3.0]}
    data = {"active_up": number[:, :, None], "active_down": np.full((2, 3, 1), 4)}
    path = made(tmp_path / "a.h5", axes, data, kind="least-time")
    for quantity in data:
        cspr(capsys, "plot", path, "--quantity", quantity)
    cspr(capsys, "plot", path, "--quantity", "active_up", "--at", "x=0")
    assert ticks(bar(figures[0])) == ["none", "cables 1, 2", "cables 2, 3", "max_acceleration"]
    assert ticks(bar(figures[1])) == ["max_acceleration"]
    assert ticks(panels(figures[2])[0]) == ["none", "cables 1, 2", "max_acceleration"]
    up, down = (panels(figure)[0].collections[0] for figure in figures[:2])
    np.testing.assert_array_equal(up.get_array().reshape(3, 2).T, [[0, 1, 3], [2, 2, 0]])
    assert to_hex(up.cmap(up.norm(0))) == NONE_COLOUR
    assert up.cmap(up.norm(3)) == down.cmap(down.norm(0)) and len({up.cmap(up.norm(k)) for k in range(4)}) == 4


def test_bounds_are_named_in_files(tmp_path, monkeypatch):
    """As CF has it: for every reader, xarray among them."""
    known = {"duration": 2.0, "duration_ratio": 2.0, "verdict": 0, "active_up": 6, "active_down": 3}
    monkeypatch.setattr(
        LeastTimeMap,
        "__call__",
        lambda self, cells: {name: np.full(2, known.get(name, 1), dtype_of(name, "float64")) for name in NAMES},
    )
    sweep = {
        "schema": 1,
        "map": "least-time",
        "robot": "boralugoda-rectangle",
        "axes": {"x": [15.0, 60.0], "y": [28.0], "z": [3.0]},
        "trajectory": {"family": "s-curve", "max_acceleration": 10.0, "from": {"position": [1.0, 20.0, 7.0]}},
    }
    found = cspr_jax.open_result(cspr_jax.run(sweep, tmp_path / "run"))
    with h5py.File(tmp_path / "run" / "sweep.h5") as file:
        kept = dict(file["active_up"].attrs)
    data = found.to_xarray()
    for attributes in (kept, data.active_up.attrs):
        words = attributes["flag_meanings"]
        words = (words.decode() if isinstance(words, bytes) else words).split()
        assert words[0] == "none" and words[-1] == "max_acceleration" and len(words) == 8
        assert attributes["flag_values"].tolist() == list(range(8))
    assert [words[int(data[name][0, 0, 0])] for name in ("active_up", "active_down")] == ["cables_3_4", "cables_1_4"]
