"""Pictures of workspaces: the surface and the outlines part the points as their verdicts do; the robot; mistakes."""

import itertools

import numpy as np
import pytest
from matplotlib.colors import to_hex
from scipy.spatial.transform import Rotation
from support.reading import read_here

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.plots.maps import solid
from cspr_jax.outputs.plots.maps.boundary import BoundarySides, boundary, outlines
from cspr_jax.outputs.plots.style.labels import COLOURS
from cspr_jax.schema.quantities import EVERY
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.reading.result import Result
from outputs.test_outputs import cspr, panels
from outputs.test_pictures import made, words

OUTSIDE, FLOOR = Verdict.WRENCH_INFEASIBLE.value, Verdict.BELOW_FLOOR.value
CUBE = np.array(list(itertools.product((-0.2, 0.2), (-0.1, 0.1), (0.0, 0.3))))
ROBOT = {
    "name": "eight",
    "base_points": (np.array([10.0, 12.0, -6.0]) * CUBE + [0.0, 0.0, 2.5]).tolist(),
    "platform_points": CUBE.tolist(),
    "inertia": np.eye(3).tolist(),
    "mass": 10.0,
    "tension_min": 1.0,
    "tension_max": 50.0,
}


def result(axes: dict, data: dict, table: dict | None = None, robot: dict | None = None, **more) -> Result:
    """A map of a workspace with these numbers, in memory."""
    robot = robot or ROBOT | {"z_axis": "down"}
    axes = {name: np.atleast_1d(np.asarray(points, float)) for name, points in axes.items()}
    settings = {"schema": 1, "map": "workspace", "robot": robot, "workspace": table or {}} | more
    known = {"map": "workspace", "robot": robot["name"], "z_axis": robot.get("z_axis", "down")}
    known["base_points"] = np.array(robot["base_points"])
    shape = tuple(map(len, axes.values()))
    data = {name: np.asarray(values).reshape(shape) for name, values in data.items()}
    names = [*axes, *data]
    units, labels = ({name: getattr(EVERY[name], key) for name in names} for key in ("units", "long_name"))
    return Result(axes, data, units, labels, known, settings)


def grid(points: list[np.ndarray]) -> np.ndarray:
    return np.stack(np.meshgrid(*points, indexing="ij"), axis=-1)


def random_sides(rng, shape, kind: str) -> BoundarySides:
    """Points inside and outside at random, or a ball with a bite, with two margins in different units."""
    points = [np.sort(rng.uniform(0.0, 1.0, n)) * (1.0 + k) for k, n in enumerate(shape)]
    if kind == "noise":
        every = rng.normal(size=(2, *shape)) + 0.7
    else:
        places = grid(points) / (1.0 + np.arange(len(shape)))
        every = np.stack([0.4 - np.linalg.norm(places - 0.5, axis=-1), places[..., 0] + places[..., 1] - 0.6])
    every = every * np.array([1.0, 1000.0]).reshape(-1, *[1] * len(shape))
    return BoundarySides(points, np.where((every > 0.0).all(0), 0, OUTSIDE), list(every))


def winding(corners: np.ndarray, pieces: np.ndarray, places: np.ndarray) -> np.ndarray:
    """How often triangles go around places: sums of solid angles (van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(corners[pieces] - places[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    high = np.einsum("pti,pti->pt", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("pti,pti->pt", x, y) for x, y in ((a, b), (b, c), (c, a)))
    return np.arctan2(high, la * lb * lc + ab * lc + bc * la + ca * lb).sum(1) / (2.0 * np.pi)


def volume(corners: np.ndarray, pieces: np.ndarray) -> float:
    """Of what triangles enclose, by the divergence theorem."""
    a, b, c = np.moveaxis(corners[pieces], 1, 0)
    return float(np.einsum("ti,ti->t", a, np.cross(b, c)).sum() / 6.0)


def inner(shape) -> np.ndarray:
    """Points that are not at the end of a grid, where the surface passes through points."""
    found = np.zeros(shape, bool)
    found[(slice(1, -1),) * len(shape)] = True
    return found


@pytest.mark.parametrize("kind", ["noise", "ball"])
def test_the_surface_parts_the_points_as_their_verdicts_do(kind):
    """It goes once around every point inside and around no point outside; every edge has a triangle on both sides."""
    rng = np.random.default_rng(5)
    for shape in ((6, 5, 7), (2, 4, 3), (9, 8, 7)):
        sides = random_sides(rng, shape, kind)
        found = boundary(sides)
        places, is_in = grid(sides.points), sides.verdict == 0
        asked = inner(shape) | ~is_in
        np.testing.assert_allclose(winding(found.corners, found.pieces, places[asked]), is_in[asked], atol=1e-6)
        edges = np.concatenate([found.pieces[:, [k, (k + 1) % 3]] for k in range(3)])
        ways, counts = np.unique(edges, axis=0, return_counts=True)
        back = np.unique(edges[:, ::-1], axis=0)
        assert np.array_equal(ways, back) and (counts.max(initial=1) == 1 or kind == "noise")
        low, high = places.reshape(-1, 3).min(0), places.reshape(-1, 3).max(0)
        ends = found.corners[found.pieces[found.is_end]]
        assert ((ends == low).all(1) | (ends == high).all(1)).any(1).all()
        assert not ((found.corners[found.pieces[~found.is_end]] == low).all(1)).any()


def test_the_surface_lies_where_margins_are_zero():
    """A corner cut off a cube, exactly; of two planes the first on every edge; half-way where no margin tells."""
    points = [np.linspace(0.0, 1.0, n) for n in (5, 6, 8)]
    places = grid(points)
    margin = 0.93 - places.sum(-1)
    found = boundary(BoundarySides(points, np.where(margin > 0.0, 0, OUTSIDE), [margin]))
    assert volume(found.corners, found.pieces) == pytest.approx(0.93**3 / 6.0, rel=1e-12)
    wall = found.corners[np.unique(found.pieces[~found.is_end])]
    np.testing.assert_allclose(wall.sum(1), 0.93, atol=1e-12)
    pair = [0.61 - places[..., 0], 1e3 * (0.35 - places[..., 1])]
    found = boundary(BoundarySides(points, np.where(np.min(pair, axis=0) > 0.0, 0, OUTSIDE), pair))
    beside = np.stack([0.61 - found.corners[:, 0], 0.35 - found.corners[:, 1]])
    assert (beside > -1e-12).all()
    np.testing.assert_allclose(beside[:, np.unique(found.pieces[~found.is_end])].min(0), 0.0, atol=1e-12)
    half = np.where(places[..., 2] > 0.5, FLOOR, 0)
    unknown, endless, beyond = np.full(half.shape, np.nan), np.where(half, -1.0, np.inf), np.where(half, -0.1, 0.9)
    for margins in ([], [unknown], [endless], [beyond]):
        found = boundary(BoundarySides(points, half, margins))
        assert volume(found.corners, found.pieces) == pytest.approx(0.5, rel=1e-9)


def test_the_surface_encloses_the_volume():
    """Of a ball with a bite: by margins nearer to the true volume than the grid leaves open, without them as near."""
    points = [np.linspace(-1.0, 1.0, n) for n in (17, 19, 21)]
    places = grid(points)
    margin = 0.8 - np.linalg.norm(places, axis=-1)
    data = {"verdict": np.where(margin > 0.0, 0, OUTSIDE), "wrench_margin": margin}
    told = cspr_jax.workspace_volume(result(dict(zip("xyz", points, strict=True)), data))
    exact = 4.0 / 3.0 * np.pi * 0.8**3
    found = boundary(BoundarySides(points, data["verdict"], [margin]))
    assert volume(found.corners, found.pieces) == pytest.approx(exact, rel=0.02)
    assert abs(volume(found.corners, found.pieces) - told.volume) < told.error < 0.5 * exact
    plain = boundary(BoundarySides(points, data["verdict"], []))
    assert abs(volume(plain.corners, plain.pieces) - told.volume) < 0.2 * told.error


@pytest.mark.parametrize("kind", ["noise", "ball"])
def test_outlines_part_the_points_as_their_verdicts_do(kind):
    """A ray in no direction of the grid crosses them an odd number of times from points inside alone."""
    rng = np.random.default_rng(6)
    for shape in ((7, 9), (2, 5), (12, 4), (20, 17)):
        sides = random_sides(rng, shape, kind)
        lines = outlines(sides)
        places, is_in = grid(sides.points), sides.verdict == 0
        asked = inner(shape) | ~is_in
        ends = [np.stack([line[:-1], line[1:]], axis=1) for line, _ in lines]
        start, stop = np.moveaxis(np.concatenate(ends), 1, 0)
        ray = np.array([0.7310585, 0.1234567])
        across = np.array([-ray[1], ray[0]])
        sided = [(end - places[asked][:, None]) @ across for end in (start, stop)]
        part = sided[0] / (sided[0] - sided[1])
        met = start + part[..., None] * (stop - start)
        hits = (sided[0] * sided[1] < 0.0) & ((met - places[asked][:, None]) @ ray > 0.0)
        np.testing.assert_array_equal(hits.sum(1) % 2 == 1, is_in[asked])
        for line, is_end in lines:
            on = [np.isin(line[:, k], sides.points[k]) for k in range(2)]
            assert (on[0] | on[1]).all()
            assert (line[0] == line[-1]).all() or all(at_the_end(sides, line[k]) for k in (0, -1))
            if not is_end:
                for corner in line:
                    assert {0, OUTSIDE} <= set(beside(sides, corner)) or at_the_end(sides, corner)


def beside(sides: BoundarySides, corner: np.ndarray) -> list[int]:
    """Verdicts of the two points between which a corner lies, on an edge of the grid."""
    index = [np.searchsorted(points, x) for points, x in zip(sides.points, corner, strict=True)]
    ranges = [
        [i] if i < len(points) and points[i] == x else [i - 1, i]
        for i, points, x in zip(index, sides.points, corner, strict=True)
    ]
    return [int(sides.verdict[place]) for place in itertools.product(*ranges)]


def at_the_end(sides: BoundarySides, corner: np.ndarray) -> bool:
    return any(x in (points[0], points[-1]) for points, x in zip(sides.points, corner, strict=True))


AXES = {"x": np.linspace(-1.5, 1.5, 7), "y": np.linspace(-1.2, 1.2, 6)[::-1], "z": np.linspace(0.5, 2.0, 5)}


def ball(axes=AXES, centre=(0.2, 0.1, 1.3), size=0.8, **more) -> Result:
    """A workspace that is a ball, over axes in the order that they have."""
    points = {name: np.atleast_1d(points) for name, points in axes.items()}
    places = np.meshgrid(*points.values(), indexing="ij")
    at = dict(zip(points, places, strict=True))
    margin = size - np.sqrt(sum((at[name] - x) ** 2 for name, x in zip("xyz", centre, strict=True)))
    return result(axes, {"verdict": np.where(margin > 0.0, 0, OUTSIDE), "wrench_margin": margin}, **more)


@pytest.fixture
def drawn(monkeypatch):
    """What is put into a picture in space: triangles with their layer, and lines."""
    found: dict[str, list] = {"triangles": [], "lines": []}

    def recorder(name, kind):
        def call(parts, **look):
            found[name].append((np.array(parts), look))
            return kind(parts, **look)

        return call

    monkeypatch.setattr(solid, "Poly3DCollection", recorder("triangles", solid.Poly3DCollection))
    monkeypatch.setattr(solid, "Line3DCollection", recorder("lines", solid.Line3DCollection))
    return found


@pytest.mark.parametrize("z_axis", ["down", "up"])
def test_a_solid_is_its_surface_with_the_robot_in_it(drawn, z_axis):
    """What faces the eye lies before the robot; cables run from the spools to the turned platform at the centroid."""
    turn = Rotation.from_euler("zyx", [0.4, -0.2, 0.3])
    table = {"orientation": turn.as_quat(scalar_first=True).tolist(), "conditions": ["wrench-feasible", "static"]}
    angles = {"tilt_azimuth": [0.3], "tilt": [0.1, 0.2], "torsion": [-0.5]}
    mixed = {name: (AXES | angles)[name] for name in ("tilt", "z", "torsion", "y", "x", "tilt_azimuth")}
    given = ball(mixed, table=table, robot=ROBOT | {"z_axis": z_axis})
    given.data["verdict"][0] = OUTSIDE
    figure = cspr_jax.plot(given, solid=True, at={"tilt": 0.2})
    (panel,) = figure.axes
    behind, before, platform = (parts for parts, _ in drawn["triangles"])
    sides = BoundarySides(
        [np.sort(AXES[a]) for a in "xyz"], *(parts_of(given, name) for name in ("verdict", "wrench_margin"))
    )
    wanted = boundary(sides._replace(margins=[sides.margins]))
    every = np.concatenate([behind, before])
    assert volume(every.reshape(-1, 3), np.arange(3 * len(every)).reshape(-1, 3)) == pytest.approx(
        volume(wanted.corners, wanted.pieces)
    )
    normals = [np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0]) for part in (behind, before)]
    panel.figure.draw_without_rendering()
    nearer = [depth(panel, normal) - depth(panel, 0.0 * normal) for normal in normals]
    assert (nearer[0] >= -1e-12).all() and (nearer[1] < 0.0).all()
    tilted = Rotation.from_euler("ZXZ", [0.3, 0.2, -0.5 - 0.3]) * turn
    centroid = grid(sides.points)[sides.verdict == 0].mean(0)
    cables = next(parts for parts, look in drawn["lines"] if look["colors"] == solid.CABLES)
    np.testing.assert_allclose(cables[:, 0], ROBOT["base_points"])
    np.testing.assert_allclose(cables[:, 1], centroid + tilted.apply(CUBE), atol=1e-12)
    assert volume_of_hull(platform) == pytest.approx(0.4 * 0.2 * 0.3)
    assert (panel.zaxis_inverted(), panel.yaxis_inverted()) == ((z_axis == "down"),) * 2 and not panel.xaxis_inverted()
    sizes = [abs(np.diff(limits)[0]) for limits in (panel.get_xlim(), panel.get_ylim(), panel.get_zlim())]
    np.testing.assert_allclose(panel._box_aspect / panel._box_aspect[0], np.array(sizes) / sizes[0])
    told = cspr_jax.workspace_volume(given)
    title = figure.get_suptitle()
    assert "eight: workspace, wrench-feasible 1 to 50 N, static, orientation (" in title
    assert f"volume {told.volume[1, 0, 0]:.1f} ± {told.error[1, 0, 0]:.1f} m³" in title
    assert "tilt = 11.46°" in title and f"z axis {z_axis}" in title
    assert [panel.get_xlabel(), panel.get_ylabel(), panel.get_zlabel()] == ["x (m)", "y (m)", "z (m)"]


def parts_of(given: Result, name: str) -> np.ndarray:
    """Of the second tilt, over x, rising y and z."""
    return given.data[name][1, :, 0, ::-1, :, 0].transpose(2, 1, 0)


def depth(panel, places: np.ndarray) -> np.ndarray:
    """Distance from the eye, but for a constant."""
    return (np.c_[places, np.ones(len(places))] @ panel.get_proj().T)[:, 2]


def volume_of_hull(triangles: np.ndarray) -> float:
    """Of triangles that may turn either way, around their middle."""
    away = triangles - triangles.reshape(-1, 3).mean(0)
    return float(np.abs(np.linalg.det(away)).sum() / 6.0)


def test_the_robot_stands_in_a_workspace_without_its_middle(drawn):
    """Of a shell the nearest point inside; a point mass is a point; a grid that ends too early has grey walls."""
    mass = {key: ROBOT[key] for key in ("name", "base_points", "mass")}
    axes = {"x": np.linspace(-1.0, 1.0, 9), "y": np.linspace(-1.0, 1.0, 9), "z": np.linspace(1.0, 3.0, 9)}
    places = grid(list(axes.values()))
    far = np.linalg.norm(places - [0.05, 0.0, 2.0], axis=-1)
    data = {"verdict": np.where((far < 0.9) & (far > 0.5), 0, OUTSIDE)}
    figure = cspr_jax.plot(result(axes, data, {"conditions": ["static"]}, mass), solid=True)
    cables = next(parts for parts, look in drawn["lines"] if look["colors"] == solid.CABLES)
    assert len(np.unique(cables[:, 1], axis=0)) == 1
    (place,) = np.unique(cables[:, 1], axis=0)
    assert 0.5 < np.linalg.norm(place - [0.05, 0.0, 2.0]) < 0.55
    assert words(figure) == ["workspace", "cables", "spools"]
    full = cspr_jax.plot(result(axes, {"verdict": np.zeros(far.shape, int)}, None, mass), solid=True)
    assert words(full) == ["workspace", "end of the grid", "cables", "spools"]
    assert "volume 8 m³" in full.get_suptitle() and "wrench-feasible above 0 N" in full.get_suptitle()


HIGH = AXES | {"z": np.linspace(0.5, 2.75, 7)}
SHAPES = {"static": ball(HIGH, size=1.0, table={"conditions": ["static"]}), "own": ball(HIGH, size=0.6)}


@pytest.mark.thorough
def test_workspaces_are_compared_by_their_outlines():
    """Of each result in its colour, at heights where something is inside; words say what each has to meet."""
    figure = cspr_jax.plot(list(SHAPES.values()))
    every = panels(figure)
    assert [panel.get_title() for panel in every] == [f"z = {z:g} m" for z in (0.5, 0.875, 1.25, 1.62, 2.0)]
    assert words(figure)[:2] == ["static", "wrench-feasible 1 to 50 N"]
    for panel, k in zip(every, range(5), strict=True):
        for one, colour in zip(SHAPES.values(), COLOURS, strict=False):
            lines = [line.get_xydata() for line in panel.lines if to_hex(line.get_color()) == colour.lower()]
            sides = BoundarySides(
                [AXES["x"], AXES["y"][::-1]], *(one.data[n][:, ::-1, k] for n in ("verdict", "wrench_margin"))
            )
            wanted = outlines(sides._replace(margins=[]))  # half-way, as volumes count: scales of margins differ
            assert len(lines) == len(wanted)
            for found, (line, _) in zip(lines, wanted, strict=True):
                np.testing.assert_array_equal(found, line)
    assert any(len(panel.lines) > 2 for panel in every)
    upright = cspr_jax.plot(list(SHAPES.values()), at={"y": 0.3})
    (panel,) = panels(upright)
    assert (panel.get_xlabel(), panel.get_ylabel(), panel.yaxis_inverted()) == ("x (m)", "z (m)", True)
    assert "y = 0.24 m (nearest to 0.3 m)" in upright.get_suptitle()
    near = cspr_jax.plot([ball(robot=ROBOT | {"base_points": CUBE.tolist()})] * 2)
    assert words(near) == [f"wrench-feasible 1 to 50 N (result {k})" for k in (1, 2)] + [
        "spools",
        "band: step of the grid",
    ]
    # Over one axis they are lines, as other maps.
    lines = panels(cspr_jax.plot(list(SHAPES.values()), at={"y": 0.24, "z": 1.25}))[0]
    assert lines.get_ylabel() == "margin of the tensions (N)"


@pytest.mark.thorough
def test_what_is_asked_is_said():
    """Numbers of conditions, limits over those of the robot, and sets of orientations."""
    axes = {"x": [0.0, 1.0], "y": [0.0, 1.0], "z": [1.0, 2.0]}
    asked = (
        ({"acceleration": 0.5, "wrenches": [[0.0] * 6] * 2}, {}, "1 to 50 N, 2 wrenches, accelerations up to 0.5 m/s²"),
        ({"wrench_box": [10.0, 5.0]}, {"tension_max": 99.0}, "1 to 99 N, box of wrenches ±(10, 5)"),
        ({"conditions": ["wrench-closure"]}, {"floor": 2.0}, "wrench-closure, floor at z = 2 m"),
        ({"orientations": "total", "tilt_max": 0.5 * np.pi}, {}, "1 to 50 N, every tilt up to 90°"),
        ({"orientations": "maximum"}, {"cable_length_max": 9.0}, "cables up to 9 m, some orientation"),
    )
    for table, limits, text in asked:
        given = result(axes, {"verdict": np.zeros(8, int)}, table, limits=limits)
        assert text in cspr_jax.plot(given, solid=True).get_suptitle()


@pytest.mark.ci("svg")
@pytest.mark.thorough
@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_the_same_data_give_the_same_bytes(tmp_path, ending):
    for name, given in (("solid", ball()), ("compared", list(SHAPES.values()))):
        first, second = (tmp_path / f"{name}{k}.{ending}" for k in range(2))
        for path in (first, second):
            cspr_jax.plot(given, solid=name == "solid", output=path, dpi=60)
        assert first.read_bytes() == second.read_bytes() and first.stat().st_size > 3000


POLAR = {"radius": [0.1, 0.5], "azimuth": [0.0, 1.0], "z": [1.0, 2.0]}
ROUND = result(POLAR, {"verdict": np.zeros(8, int)})
ELSEWHERE = result({"x": [0.0, 1.0], "y": [0.0, 1.0], "z": [1.1, 2.0]}, {"verdict": np.zeros(8, int)})
FLAT = result({"x": [0.0, 1.0], "y": [0.0, 1.0], "z": [1.0]}, {"verdict": np.zeros(4, int)})
EMPTY = result({"x": [0.0, 1.0], "y": [0.0, 1.0], "z": [1.0, 2.0]}, {"verdict": np.full(8, OUTSIDE)})
OTHER = ball(robot=ROBOT | {"base_points": CUBE.tolist()})


@pytest.mark.parametrize(
    ("given", "choices", "told"),
    [
        (ROUND, {"solid": True}, "two points or more of each of x, y and z"),
        (FLAT, {"solid": True}, "two points or more of each of x, y and z"),
        ([ball(), ball()], {"solid": True}, "of one result"),
        (EMPTY, {"solid": True}, "nothing is inside"),
        (ball(table={"orientation": [0.0] * 4}), {"solid": True}, "workspace.orientation"),
        (ball(), {"solid": True, "at": {"z": 1.0}}, "--at"),
        (ball(), {"solid": True, "at": {"tilt": 1.0}}, "one of x, y, z"),
        (ball(), {"solid": True, "quantity": "verdict"}, "absent with --solid"),
        (ball(), {"solid": True, "envelope": True}, "absent with --solid"),
        (ball(), {"solid": True, "lines": "x"}, "absent with --solid"),
        ([ROUND, ROUND], {}, "two or three of x, y and z"),
        ([ball(), ELSEWHERE], {}, "z of result 2"),
        ([ball(), FLAT], {}, "over x, y, z, as result 1"),
        ([ball(), ball()], {"quantity": "wrench_margin"}, "maps over one axis"),
        ([ball(), OTHER], {}, "spools"),
        ([ball()] * 7, {}, "at most 6"),
    ],
)
def test_a_picture_that_is_asked_wrongly(given, choices, told):
    with pytest.raises(ConfigError) as caught:
        cspr_jax.plot(given, **choices)
    assert told in str(caught.value) and len(str(caught.value).splitlines()) == 1


@pytest.mark.thorough
def test_the_command_line_draws_them(capsys, tmp_path, monkeypatch, figures):
    """A solid, several results, a map without a solid; a margin that nobody asks for is no picture."""
    read_here(monkeypatch)
    axes = {"x": np.linspace(-1.0, 1.0, 5), "y": np.linspace(-1.0, 1.0, 5), "z": [1.0, 1.5, 2.0]}
    data = {"verdict": np.tile([[[OUTSIDE]], [[0]], [[0]], [[0]], [[OUTSIDE]]], (1, 5, 3)).astype(np.uint16)}
    data |= {"wrench_margin": np.full((5, 5, 3), np.nan), "closure_margin": np.ones((5, 5, 3))}
    path = made(tmp_path / "a.h5", axes, data, kind="workspace", trajectory={})
    cspr(capsys, "plot", path, "--solid")
    cspr(capsys, "plot", path, path, "--at", "z=1.5")
    cspr(capsys, "plot", path)
    assert [figure.get_suptitle().splitlines()[0] for figure in figures] == [
        "robot: workspace, wrench-feasible above 0 N",
        "robot: workspaces",
        "robot: margin of wrench closure",
    ]
    assert "--solid" in cspr(capsys, "plot", made(tmp_path / "b.h5", axes | {"z0": [1.0]}), "--solid", code=2)


@pytest.mark.thorough
def test_a_legend_that_is_too_wide_is_broken(tmp_path):
    """Nothing is cut off, also in a narrow picture."""
    for size in ((30.0, 12.0), (9.0, 12.0)):
        figure = cspr_jax.plot(list(SHAPES.values()), at={"z": 1.25}, size=size, output=tmp_path / "a.png")
        (legend,) = figure.legends
        assert legend.get_window_extent().width <= figure.bbox.width
        assert legend.get_texts()[0].get_text() == "static" and len(legend.get_texts()) == 4
