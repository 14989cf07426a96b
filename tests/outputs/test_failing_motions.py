"""Obstacles, platforms' shapes and intervals of failure in files, pictures, films and pages of motions."""

import re

import h5py
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.proj3d import proj_transform
from scipy.spatial import ConvexHull

import cspr_jax
from cspr_jax.config.plan import checked_plan
from cspr_jax.config.robot import resolve_robot
from cspr_jax.numerics.bounds.intervals import united
from cspr_jax.outputs.motion_files import failures
from cspr_jax.outputs.plots.films import film as films
from cspr_jax.outputs.plots.robots.obstacles import COLOUR, lines_on, points_of
from cspr_jax.outputs.plots.robots.robot_along import moving
from cspr_jax.outputs.plots.style.style import Style, in_style
from cspr_jax.robots.model import shapes
from cspr_jax.schema.verdicts import Verdict
from outputs.test_pages import content_of

OBSTACLES = [
    {"kind": "sphere", "centre": [0.4, 0.2, 1.5], "radius": 0.1},
    {"kind": "box", "centre": [0.0, 0.5, 1.2], "size": [0.3, 0.1, 0.2], "quaternion": [0.8, 0.6, 0.0, 0.0]},
]
POSES = [
    {"position": [0.0, 0.0, 1.0]},
    {"position": [0.1, 0.05, 0.9], "time": 0.6},
    {"position": [-0.05, 0.1, 1.1], "time": 1.2},
]
BALL, BOX = shapes.sphere([0.4, 0.2, 1.5], 0.1), shapes.box([0.0, 0.5, 1.2], [0.3, 0.1, 0.2], [0.8, 0.6, 0.0, 0.0])
PLAN = {"schema": 1, "robot": "prototype", "family": "spline", "pose": POSES, "samples": 40}
LIMIT = 0.2  # m/s of cables
SLACK, FAST = "slack_cable", "cable_too_fast"
# Criteria that each chart shows; those that none of a picture shows are in its chart of tensions.
CHARTS = {
    None: {"tension": (SLACK, FAST), "acceleration": ()},
    "tensions": {"tension": (SLACK, FAST)},
    "summary": {"tension": (SLACK,), "cable speed": (FAST,)},
}


def first_face(area: Poly3DCollection) -> np.ndarray:
    """Corners of the first face; versions of matplotlib keep them under different names."""
    return np.array(area._faces[0]) if hasattr(area, "_faces") else area._vec[:3, area._segslices[0]].T


def assert_bodies_are_shown(space):
    """Each body covers the area of its corners in the picture, and has its lines in space."""

    def seen(points):
        return np.stack(proj_transform(*points.T, space.get_proj())[:2], axis=1)

    areas = [area for area in space.collections if isinstance(area, Poly3DCollection)]
    lines = [part for part in space.collections if isinstance(part, Line3DCollection)]
    lines = [part for part in lines if to_hex(part.get_color()[0]) == COLOUR]
    assert len(areas) == len(lines) == 2
    np.testing.assert_allclose(np.linalg.norm(first_face(areas[0]) - BALL.centre, axis=1), BALL.radius, rtol=0.01)
    for body, area, drawn in zip((BALL, BOX), areas, lines, strict=True):
        face, whole = seen(first_face(area)), seen(points_of(body))
        sizes = [ConvexHull(points).volume for points in (face, whole, np.concatenate([face, whole]))]
        np.testing.assert_allclose(sizes, sizes[0], rtol=1e-3)
        for line, expected in zip(drawn._segments3d, lines_on(body), strict=True):
            np.testing.assert_allclose(line, expected)


@pytest.fixture(scope="module")
def plan():
    return cspr_jax.plan(PLAN | {"obstacle": OBSTACLES, "limits": {"cable_speed_max": LIMIT}})


@pytest.fixture(scope="module")
def file(plan, tmp_path_factory):
    return plan.save(tmp_path_factory.mktemp("failing") / "motion.h5", anyway=True)


def test_files_keep_the_intervals_of_failure(plan, file):
    """Those of all segments, since the start of the plan; exactly there the motion is too fast, or a cable slack."""
    result = cspr_jax.open_result(file)
    failing = result.data["failing"]
    assert len(failing) >= 2 and (np.diff(failing.reshape(-1)) > 0.0).all()
    time = result.axes["t"]
    inside = ((time[:, None] >= failing[:, 0]) & (time[:, None] <= failing[:, 1])).any(1)
    fails = (np.abs(result.data["rate"]).max(1) > LIMIT) | (result.data["tension"].min(1) < 0.0)
    np.testing.assert_array_equal(inside, fails)
    table = result.to_xarray()["failing"]
    assert table.dims == ("failure", "edge") and table["edge"].values.tolist() == ["start", "end"]
    assert table["failure"].values.tolist() == list(range(1, len(failing) + 1))


def intervals_of(plan, criteria):
    """Intervals in which some criteria fail, (m, 2) s since the start of the plan."""
    starts = np.cumsum(plan.answers.duration) - plan.answers.duration
    rows = [
        start + np.reshape(plan.details(i)["failing_by_criterion"].get(name, ()), (-1, 2))
        for i, start in enumerate(starts)
        for name in criteria
    ]
    return united(np.concatenate([np.empty((0, 2)), *rows]))


def test_failures_are_told_by_criterion(plan, file):
    """Exactly where a cable is too fast the one fails, where one is slack the other; and rows say what binds."""
    result = cspr_jax.open_result(file)
    time, data = result.axes["t"], result.data
    broken = {FAST: np.abs(data["rate"]).max(1) > LIMIT, SLACK: data["tension"].min(1) < 0.0}
    flags = {name: Verdict[name.upper()].value for name in broken}
    for name, expected in broken.items():
        intervals = data["criterion_failing"][data["criterion_flag"] == flags[name]]
        np.testing.assert_allclose(united(intervals), intervals_of(plan, (name,)))
        inside = ((time[:, None] >= intervals[:, 0]) & (time[:, None] <= intervals[:, 1])).any(1)
        np.testing.assert_array_equal(inside, expected)
    np.testing.assert_array_equal(data["failing"], intervals_of(plan, broken))
    # The smallest slack, over the limit, or of tensions over the weight a cable.
    weight = result.attributes["mass"] * 9.81 / 3.0
    slack = np.concatenate([data["tension"] / weight, 1.0 - np.abs(data["rate"]) / LIMIT], axis=1)
    depth = (data["position"][:, 2] if result.attributes["z_axis"] == "down" else -data["position"][:, 2])[:, None]
    assert (depth > 0.5).all()
    nearest = slack.argmin(1)
    np.testing.assert_array_equal(data["binding_cable"], nearest % 3 + 1)
    np.testing.assert_array_equal(data["binding"], np.where(nearest < 3, flags[SLACK], flags[FAST]))


def test_other_files_have_no_such_intervals(tmp_path):
    slow = [pose | {"time": 5.0 * pose["time"]} if "time" in pose else pose for pose in POSES]
    feasible = cspr_jax.plan(PLAN | {"pose": slow})
    assert feasible.feasible and failures(feasible) == {}
    with h5py.File(feasible.save(tmp_path / "motion.h5")) as written:
        assert not {"failure", "failing", "edge"} & set(written)


def shaded(panel):
    """Intervals of time that are shaded over the whole height of a panel, behind its lines."""
    areas = [area for area in panel.collections if isinstance(area, PolyCollection) and area.get_label() == "fails"]
    for area in areas:
        assert area.get_transform() == panel.get_xaxis_transform() and area.get_visible()
        assert area.get_facecolor()[0][3] > 0.1 and area.get_zorder() < min(line.get_zorder() for line in panel.lines)
    bands = np.array([path.vertices[:4] for area in areas for path in area.get_paths()])
    np.testing.assert_array_equal(np.sort(bands[..., 1], axis=1), np.tile([0.0, 0.0, 1.0, 1.0], (len(bands), 1)))
    assert (np.ptp(bands[..., 0], axis=1) > 0.0).all()
    return np.stack([bands[..., 0].min(1), bands[..., 0].max(1)], axis=1)


@pytest.mark.quick("tensions")
@pytest.mark.parametrize("quantity", [None, "tensions", "summary"])
def test_pictures_over_time_shade_them(plan, file, quantity):
    figure = cspr_jax.plot(file, quantity=quantity)
    over_time = [panel for panel in figure.axes if panel.get_xlabel() == "time (s)"]
    assert over_time
    for panel in over_time:
        own = CHARTS[quantity][panel.get_ylabel().split(" (")[0].split("\n")[0]]
        expected = intervals_of(plan, own)
        assert len(expected) or not own
        np.testing.assert_allclose(shaded(panel) if own else np.empty((0, 2)), expected)
        assert own or not any(isinstance(area, PolyCollection) for area in panel.collections)
    legends = [*figure.legends, *filter(None, (panel.get_legend() for panel in figure.axes))]
    assert sum(text.get_text() == "fails" for legend in legends for text in legend.get_texts()) == 1


@pytest.mark.quick("trajectory")
@pytest.mark.parametrize("quantity", ["trajectory", "summary"])
def test_pictures_in_space_have_the_obstacles(file, quantity):
    figure = cspr_jax.plot(file, quantity=quantity)
    space = next(panel for panel in figure.axes if panel.name == "3d")
    assert_bodies_are_shown(space)
    for body in (BALL, BOX):
        for axis, values in zip("xyz", points_of(body).T, strict=True):
            low, high = sorted(getattr(space, f"get_{axis}lim")())
            assert low < values.min() and values.max() < high
    assert "obstacles" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_lines_lie_on_the_surfaces():
    ball, stick = shapes.sphere([1.0, 2.0, 3.0], 0.5), shapes.cylinder([0.0, 0.0, 0.0], [1.0, 2.0, 2.0], 0.25)
    assert len(lines_on(ball)) == 3 and len(lines_on(stick)) == 2
    for line in lines_on(ball):
        np.testing.assert_allclose(np.linalg.norm(line - ball.centre, axis=1), 0.5)
    flat = [np.ptp(line, axis=0).argmin() for line in lines_on(ball)]
    assert sorted(flat) == [0, 1, 2] and all(np.ptp(line, axis=0).min() < 1e-12 for line in lines_on(ball))
    for line, end in zip(lines_on(stick), (stick.start, stick.end), strict=True):
        np.testing.assert_allclose(np.linalg.norm(line - end, axis=1), 0.25)
        np.testing.assert_allclose((line - end) @ (stick.end - stick.start), 0.0, atol=1e-12)
    edges = np.diff(lines_on(shapes.box([0.0, 0.0, 0.0], [1.0, 2.0, 3.0])), axis=1)[:, 0]
    np.testing.assert_allclose(np.sort(np.abs(edges).sum(1)), [1.0] * 4 + [2.0] * 4 + [3.0] * 4)
    assert ((edges != 0.0).sum(1) == 1).all()


def test_films_have_both(plan):
    columns = plan.rows(100.0) | failures(plan)
    with in_style(Style()):
        picture = films._Picture("film", columns, plan.robot_file, plan.keys, np.arange(2))
    space = picture.figure.axes[0]
    over_time = next(panel for panel in picture.figure.axes if panel.get_xlabel() == "time (s)")
    assert_bodies_are_shown(space)
    np.testing.assert_allclose(shaded(over_time), failures(plan)["failing"])


def test_pages_of_plans_and_of_their_files_have_both(plan, file, tmp_path):
    contents = []
    for source in (plan, file):
        cspr_jax.report(source, tmp_path / "page.html")
        contents.append(content_of(tmp_path / "page.html")["motions"][0])
    for content in contents:
        np.testing.assert_allclose(content["failing"], failures(plan)["failing"])
        said = dict(content["facts"])["fails"]
        assert re.match(r"\d\.\d{6} to \d\.\d{6} s, ", said)
        assert "cable" in content["segments"][0]["verdict"] and "needs" in content["segments"][0]["verdict"]
        ball, box = content["bodies"]
        corners = np.array(ball["corners"])[np.array(ball["triangles"])].reshape(-1, 3)
        np.testing.assert_allclose(np.linalg.norm(corners - OBSTACLES[0]["centre"], axis=1), 0.1, rtol=1e-6)
        assert len(box["corners"]) == 8 and len(box["triangles"]) == 12 and len(box["lines"]) == 12


@pytest.mark.parametrize(
    "shape", [{"platform_box": [[-0.6, -0.5, -0.1], [0.6, 0.5, 1.0]]}, {"platform_hull": True}, {}]
)
def test_a_platform_has_its_shape(shape):
    """From its mass centre, whose position a motion holds."""
    robot_file = resolve_robot("cogiro", "", None)
    keys = checked_plan({"schema": 1, "robot": "cogiro", "pose": [{"rest": True}, {"rest": True}]} | shape, "plan")
    turn = np.array([[0.6, 0.0, 0.0, 0.8]])
    columns = {"position": np.array([[1.0, 2.0, 3.0]]), "quaternion": turn}
    corners = moving(columns, robot_file, np.arange(1), keys).corners[0]
    own = np.array(robot_file.platform_points)
    if "platform_box" in shape:
        low, high = np.array(shape["platform_box"])
        own = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    placed = (own - robot_file.centre_of_mass) @ shapes.rotation_matrix(turn[0]).T + columns["position"]
    np.testing.assert_allclose(np.unique(corners.round(9), axis=0), np.unique(placed.round(9), axis=0))


RING = 0.5 * np.pi + 2.0 * np.pi * np.arange(3) / 3.0
CORNERS = np.stack([np.cos(RING), np.sin(RING), 0.0 * RING], axis=1)
TURN = shapes.rotation_matrix(np.array([0.9, 0.1, -0.2, np.sqrt(1.0 - 0.81 - 0.01 - 0.04)]))


def six_cables(turn, z_axis):
    """A platform that hangs on two cables from each corner, its axes turned from those in which it hangs."""
    signs = np.array([1.0, 1.0, 1.0] if z_axis == "down" else [1.0, -1.0, -1.0])
    own = (0.3 * (-CORNERS[[2, 1, 0, 2, 1, 0]]) + [0.0, 0.0, 0.02]) @ turn.T
    inertia = turn @ np.diag([0.02, 0.03, 0.04]) @ turn.T
    return {
        "name": "turned",
        "z_axis": z_axis,
        "base_points": (np.repeat(CORNERS, 2, axis=0) * signs).tolist(),
        "platform_points": (own * signs).tolist(),
        "mass": 2.0,
        "inertia": (0.5 * (inertia + inertia.T) * np.outer(signs, signs)).tolist(),
        "centre_of_mass": (turn @ [0.0, 0.0, 0.05] * signs).tolist(),
    }


@pytest.mark.parametrize("z_axis", ["down", "up"])
def test_six_cables_are_drawn_where_they_are_whatever_the_axes_of_the_file(z_axis):
    """Orientations of a motion count from that in which the platform hangs, not from the axes of its file."""
    columns = {"position": np.array([[0.1, 0.2, 1.3]]), "quaternion": np.array([[0.96, 0.0, 0.28, 0.0]])}
    plain, rotated = (resolve_robot(six_cables(turn, z_axis), "", None) for turn in (np.eye(3), TURN))
    expected, drawn = (moving(columns, robot_file, np.arange(1)) for robot_file in (plain, rotated))
    np.testing.assert_allclose(drawn.attached, expected.attached, atol=1e-9)
    np.testing.assert_allclose(
        np.unique(drawn.corners[0].round(6), axis=0), np.unique(expected.corners[0].round(6), axis=0)
    )


@pytest.mark.thorough
def test_drawn_cables_have_the_lengths_of_the_motion(tmp_path):
    """From the mass centre and from the origin of the axes, and with the robot beside a table."""
    poses = [
        {"position": [0.0, 0.0, 1.2]},
        {"position": [0.1, 0.05, 1.3], "time": 3.0, "quaternion": [0.96, 0.28, 0.0, 0.0]},
    ]
    data = {"schema": 1, "family": "spline", "robot": six_cables(TURN, "down"), "pose": poses}
    for point in ("mass-centre", "origin"):
        cspr_jax.plan(data | {"point": point}).save(tmp_path / "motion.csv")
        result = cspr_jax.open_result(tmp_path / "motion.csv")
        robot = moving(result.data, resolve_robot(data["robot"], "", None), np.arange(len(result.axes["t"])))
        length = np.linalg.norm(robot.attached - robot.base, axis=2)
        np.testing.assert_allclose(length, result.data["length"], atol=1e-7)
