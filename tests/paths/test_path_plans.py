"""Plans of paths: what stands in a file becomes the path of the motion, whatever it takes of time."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.commands import plan

import cspr_jax
from cspr_jax.config.catalogue import CATALOGUE
from cspr_jax.config.reading import read_toml
from cspr_jax.errors import ConfigError
from cspr_jax.families.paths import leg
from cspr_jax.runtime import stages

ROBOT = {"schema": 1, "robot": "prototype", "family": "path", "samples": 201}
PLATFORM = ROBOT | {"robot": "cogiro"}
PLACES = [[0.0, 0.0, 1.4], [0.05, 0.0, 1.4], [0.05, 0.05, 1.3], [0.0, 0.05, 1.35]]


def poses(places, **more):
    """Poses at places; keys of pose 2 as `_2`."""
    return [{"position": place} | more.get(f"_{i}", {}) for i, place in enumerate(places)]


def walked(plan):
    """Places of a plan's rows, and the distance between the farthest two in a row."""
    return np.asarray(plan.rows()["position"])


def passes(places, target):
    return float(np.linalg.norm(places - np.asarray(target), axis=1).min())


@pytest.mark.quick("polyline-corner1")
@pytest.mark.parametrize(("kind", "corner"), [("line", {}), ("polyline", {}), ("cubic", {}), ("quintic", {})])
def test_a_path_of_its_own_is_that_between_poses(kind, corner):
    """[path] with points, the same points as poses, and as points of the path of one pose."""
    table = {"kind": kind, "grid": 50}
    whole = cspr_jax.plan(ROBOT | {"path": table | {"points": PLACES}})
    inner = cspr_jax.plan(
        ROBOT | {"pose": poses([PLACES[0], PLACES[-1]], _1={"path": table | {"points": PLACES[1:-1]}})}
    )
    each = cspr_jax.plan(ROBOT | {"path": table, "pose": poses(PLACES)})
    assert [len(x.to_dict()["segments"]) for x in (whole, inner, each)] == [1, 1, 3]
    assert whole.to_dict()["total_duration"] == pytest.approx(each.to_dict()["total_duration"], rel=1e-9)
    np.testing.assert_allclose(walked(whole), walked(inner), atol=1e-12)
    for place in PLACES:
        assert max(passes(walked(x), place) for x in (whole, inner)) < 1e-3 and passes(walked(each), place) < 1e-12
    speeds = np.linalg.norm(each.rows()["velocity"], axis=1)
    at = [int(np.argmin(np.linalg.norm(walked(each) - place, axis=1))) for place in PLACES[1:3]]
    waypoints = kind in ("line", "polyline")
    assert all((speeds[i] < 1e-9) == waypoints for i in at)
    # Velocities are those of the places: the parts of one motion meet.
    times = each.rows()["t"]
    steps = np.diff(walked(each), axis=0) / np.maximum(np.diff(times), 1e-12)[:, None]
    mean = 0.5 * (each.rows()["velocity"][1:] + each.rows()["velocity"][:-1])
    np.testing.assert_allclose(steps[np.diff(times) > 1e-9], mean[np.diff(times) > 1e-9], atol=5e-3)


def test_it_says_how_far_it_is(monkeypatch):
    """How much work begins; the section of all, the time left from the second one on, the round of its proof."""
    heard, amounts = [], []
    monkeypatch.setattr(leg, "MANY_CELLS", 149)
    with stages.heard(heard.append, lambda text: amounts.append((len(heard), text))):
        cspr_jax.plan(ROBOT | {"path": {"kind": "line", "grid": 50}, "pose": poses(PLACES)})
    ((before, amount),) = amounts
    assert amount.startswith("3 parts between stops with 150 cells of their grids")
    assert heard.index("least time, section 1 of 3: proof 1") >= before
    assert any(re.fullmatch(r"least time, section 3 of 3, \d:\d\d:\d\d left: proof 1", line) for line in heard)
    assert heard.index("proof of all sections") > max(i for i, line in enumerate(heard) if "section 3" in line)


def test_blends_and_rest():
    table = {"kind": "polyline", "corner": "blend", "blend_tolerance": 0.005, "grid": 50}
    result = cspr_jax.plan(ROBOT | {"path": table, "pose": poses(PLACES, _2={"rest": True})})
    speeds = np.linalg.norm(result.rows()["velocity"], axis=1)
    assert passes(walked(result), PLACES[1]) == pytest.approx(0.005, rel=1e-6)
    assert passes(walked(result), PLACES[2]) < 1e-12
    middle = int(np.argmin(np.linalg.norm(walked(result) - PLACES[1], axis=1)))
    assert speeds[middle] > 0.01


def test_speeds_at_the_ends():
    """Of the whole plan, and not of its parts; a closed path of a pose comes back."""
    table = {"kind": "cubic", "grid": 50, "start_speed": 0.05, "end_speed": 0.08}
    result = cspr_jax.plan(ROBOT | {"path": table, "pose": poses(PLACES, _2={"rest": True})})
    speeds = np.linalg.norm(result.rows()["velocity"], axis=1)
    middle = int(np.argmin(np.linalg.norm(walked(result) - PLACES[2], axis=1)))
    assert speeds[[0, middle, -1]] == pytest.approx([0.05, 0.0, 0.08], abs=1e-9)
    last = result.to_dict()["segments"][-1]
    assert 0.9 * last["duration"] < last["lower_bound"] <= last["duration"]
    loop = {"kind": "quintic", "closed": True, "points": PLACES[1:], "grid": 50}
    back = cspr_jax.plan(ROBOT | {"pose": [{"position": PLACES[0]}, {"path": loop}]})
    np.testing.assert_allclose(walked(back)[[0, -1]], [PLACES[0], PLACES[0]], atol=1e-12)
    assert all(passes(walked(back), place) < 1e-3 for place in PLACES)


def test_arcs_and_circles():
    centre, start = np.array([0.0, 0.0, 1.4]), np.array([0.06, 0.0, 1.4])
    circle = {"kind": "circle", "centre": centre, "start": start, "grid": 50}
    places = walked(cspr_jax.plan(ROBOT | {"path": circle}))
    np.testing.assert_allclose(np.linalg.norm(places - centre, axis=1), 0.06, atol=1e-5)
    np.testing.assert_allclose(places[[0, -1]], [start, start], atol=1e-12)
    # About z of the file, by the rule of the right hand: from x to y.
    assert passes(places[: len(places) // 2], [0.0, 0.06, 1.4]) < 2e-3
    arc = {"kind": "arc", "centre": centre, "angle": -0.5 * np.pi, "normal": [0.0, 0.0, 2.0], "grid": 50}
    places = walked(cspr_jax.plan(ROBOT | {"pose": [{"position": start}, {"path": arc}]}))
    np.testing.assert_allclose(places[-1], [0.0, -0.06, 1.4], atol=1e-12)
    onward = cspr_jax.plan(ROBOT | {"pose": [{"position": start}, {"path": arc}, {"position": PLACES[0]}]})
    assert onward.to_dict()["segments"][1]["duration"] > 0.0
    assert passes(walked(onward), [0.0, -0.06, 1.4]) < 1e-12


@pytest.mark.thorough
def test_files(tmp_path):
    """A table of points in millimetres, and the same as G-code; z of the file is that of the robot."""
    rows = "\n".join(",".join(f"{1000.0 * x:g}" for x in place) for place in PLACES)
    (tmp_path / "points.csv").write_text(f"# units: mm\nx,y,z\n{rows}\n")
    moves = "\n".join("G1 " + " ".join(f"{a}{1000.0 * x:g}" for a, x in zip("XYZ", p, strict=True)) for p in PLACES)
    (tmp_path / "moves.nc").write_text(f"G21 G90 F600000\n{moves}\n")
    whole = walked(cspr_jax.plan(ROBOT | {"path": {"kind": "polyline", "points": PLACES, "grid": 50}}))
    for kind, name in (("csv", "points.csv"), ("gcode", "moves.nc")):
        path = tmp_path / f"{kind}.toml"
        head = 'schema = 1\nrobot = "prototype"\nfamily = "path"\nsamples = 201\n'
        path.write_text(f'{head}[path]\nkind = "{kind}"\nfile = "{name}"\ngrid = 50\n')
        np.testing.assert_allclose(walked(cspr_jax.plan(path)), whole, atol=1e-12)
        goes_on = (
            f'[[pose]]\nposition = {PLACES[0]}\n[[pose]]\npath = {{ kind = "{kind}", file = "{name}", grid = 50 }}\n'
        )
        path.write_text(head + goes_on)
        np.testing.assert_allclose(walked(cspr_jax.plan(path)), whole, atol=1e-12)


@pytest.mark.thorough
def test_a_platform_turns_on_the_spot():
    """Its place stays, and the turn is the shortest."""
    place, turn = [-0.5, 0.0, 1.0], [np.cos(0.15), 0.0, 0.0, np.sin(0.15)]
    spot = [{"position": place}, {"position": place, "quaternion": turn}]
    rows = cspr_jax.plan(PLATFORM | {"path": {"grid": 30}, "pose": spot}).rows()
    np.testing.assert_allclose(rows["position"], np.tile(place, (201, 1)), atol=1e-12)
    np.testing.assert_allclose(np.abs(rows["quaternion"][-1] @ turn), 1.0, atol=1e-12)
    axis = rows["omega"] / np.maximum(np.linalg.norm(rows["omega"], axis=1), 1e-9)[:, None]
    np.testing.assert_allclose(axis[5:-5], np.tile([0.0, 0.0, 1.0], (191, 1)), atol=1e-6)


@pytest.mark.thorough
def test_orientations_of_platforms(tmp_path):
    places = [[-0.5, 0.0, 1.0], [0.5, 0.0, 1.0], [0.5, 0.6, 1.2]]
    turns = Rotation.from_euler("z", [[0.1], [0.3], [-0.2]])
    units = np.roll(turns.as_quat(), 1, axis=1)
    table = {"kind": "cubic", "grid": 30}
    own = cspr_jax.plan(PLATFORM | {"path": table | {"points": places, "orientations": units}})
    each = [{"position": place, "quaternion": unit} for place, unit in zip(places, units, strict=True)]
    joined = cspr_jax.plan(PLATFORM | {"path": table, "pose": each})
    assert own.feasible and joined.feasible
    for result in (own, joined):
        rows = result.rows()
        for place, unit in zip(places, units, strict=True):
            i = int(np.argmin(np.linalg.norm(rows["position"] - place, axis=1)))
            assert abs(np.dot(rows["quaternion"][i], unit)) > 1.0 - 1e-5
    # G-code keeps the orientation, from which the next path turns on.
    moves = tmp_path / "moves.nc"
    moves.write_text("G91 G1 X100\nY100\n")
    before, after = {"position": places[0], "quaternion": units[1]}, {"position": places[1], "quaternion": units[2]}
    onward = [before, {"path": {"kind": "gcode", "file": str(moves)}}, after]
    rows = cspr_jax.plan(PLATFORM | {"path": {"grid": 30}, "pose": onward}).rows()
    corner = int(np.argmin(np.linalg.norm(rows["position"] - [-0.4, 0.1, 1.0], axis=1)))
    np.testing.assert_allclose(np.abs(rows["quaternion"][: corner + 1] @ units[1]), 1.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(rows["quaternion"][: corner + 4] @ units[1]), 1.0, atol=1e-4)
    assert abs(rows["quaternion"][-1] @ units[2]) == pytest.approx(1.0)


HEAD = 'schema = 1\nrobot = "prototype"\nfamily = "path"\n'
TWO = "[[pose]]\nposition = [0, 0, 1.4]\n[[pose]]\nposition = [0.05, 0, 1.4]\n"
LINE = "points = [[0, 0, 1.4], [0.05, 0, 1.4]]"


def whole(keys):
    return f"{HEAD}[path]\n{keys}\n"


def one(keys, position=True):
    end = "position = [0.05, 0, 1.4]\n" * position
    return f"{HEAD}[[pose]]\nposition = [0, 0, 1.4]\n[[pose]]\n{end}path = {{ {keys} }}\n"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (whole('kind = "spline"'), 'path.kind = "spline": did you mean "line"? must be "line", "polyline", "cubic"'),
        (whole('kind = "lines"'), 'path.kind = "lines": did you mean "line"?'),
        (whole("points = []"), "path.points = []: must be a list of at least 1"),
        (whole("points = [[0, 0, 1]]"), "path.points = [[0.0, 0.0, 1.0]]: must be two points or more"),
        (whole("points = [[0, 0, 1], [0, 0, nan]]"), "path.points[1][2] = nan: must be a finite number"),
        (whole("points = [[0, 0, 1], [0, 1]]"), "path.points[1] = [0, 1]: must be a list of at least 3"),
        (whole("points = [[0, 0, 1], [0, 0, 1]]"), "path.points = [0.0, 0.0, 1.0]: must be another place"),
        (whole('kind = "cubic"'), "path.points is missing: the points of the path, or [[pose]] tables"),
        (whole(LINE) + TWO, "path.points = [[0.0, 0.0, 1.4], [0.05, 0.0, 1.4]]: must be absent beside [[pose]] tables"),
        (whole(f'{LINE}\ncorner = "stop"'), 'path.corner = "stop": must be absent unless kind = "polyline", "csv" or'),
        (whole(f'kind = "polyline"\n{LINE}\ncorner = "blend"'), "path.blend_tolerance is missing: a distance in m"),
        (
            whole(f'kind = "polyline"\n{LINE}\nblend_tolerance = 0.1'),
            'path.blend_tolerance = 0.1: must be absent unless corner = "blend"',
        ),
        (whole(f'{LINE}\nfile = "a.csv"'), 'path.file = "a.csv": must be absent unless kind = "csv" or "gcode"'),
        (whole('kind = "csv"'), "path.file is missing: a path of kind csv needs it"),
        (whole('kind = "csv"\nfile = "no.csv"'), "no.csv: cannot be read: No such file"),
        (whole('kind = "gcode"\nfile = "no.nc"'), "no.nc: cannot be read: No such file"),
        (whole('kind = "circle"\nstart = [0, 0, 1]'), "path.centre is missing: a path of kind circle needs it"),
        (whole('kind = "circle"\ncentre = [0, 0, 1]'), "path.start is missing: where the path begins"),
        (whole('kind = "arc"\ncentre = [0, 0, 1]\nstart = [0.1, 0, 1]'), "path.angle is missing"),
        (
            whole('kind = "arc"\ncentre = [0, 0, 1]\nstart = [0.1, 0, 1]\nangle = 0'),
            "path.angle = 0.0: must be an angle of 1e-09 at least, of either sign",
        ),
        (
            whole('kind = "circle"\ncentre = [0, 0, 1.4]\nstart = [0.1, 0, 1.5]'),
            "path.centre = [0.0, 0.0, 1.4]: must be in a plane with the start",
        ),
        (
            whole('kind = "circle"\ncentre = [0, 0, 1]\nstart = [0.1, 0, 1]\nnormal = [0, 0, 0]'),
            "path.normal = [0.0, 0.0, 0.0]: must be a direction, of length 1e-09 at least",
        ),
        (whole(f"{LINE}\norientations = [[1, 0, 0, 0]]"), "path.orientations: given: must be absent for a point mass"),
        (whole(f"{LINE}\nstart_speed = -1"), "path.start_speed = -1: must be at least 0"),
        (whole(f"{LINE}\ngrid = 1"), "path.grid = 1: must be at least 2"),
        (whole(f"{LINE}\ngrid = 10.5"), "path.grid = 10.5: must be an integer"),
        (whole(f"{LINE}\nramp_time = nan"), "path.ramp_time = nan: must be a finite number"),
        (whole(f"{LINE}\nspeed = 1"), "unknown key path.speed = 1: did you mean"),
        (f"{HEAD}[path]\nclosed = true\n{TWO}", "path.closed = true: must be absent without points"),
        (f"{HEAD}{TWO}arcs = 2\n", 'pose[1].arcs: must be absent with family = "path"'),
        (
            HEAD.replace('"path"', '"spline"') + TWO + "time = 1\n[path]\n",
            'path: must be absent unless family = "path"',
        ),
        (one("points = [[0, 0, 1.4]]"), "pose[1].path.points = [0.0, 0.0, 1.4]: must be another place"),
        (one('kind = "arc", centre = [0.1, 0, 1.4], angle = 1'), "pose[1].position: must be absent: pose[1].path"),
        (
            one('kind = "arc", centre = [0.1, 0, 1.4], start = [0, 0, 1.4], angle = 1', False),
            "pose[1].path.start = [0.0, 0.0, 1.4]: must be absent: the path begins at pose[0]",
        ),
        (one('kind = "line"', False), "pose[1].position is missing"),
        (one("start_speed = 1"), ""),
        (
            f"{HEAD}{TWO}path = {{ end_speed = 1.0 }}\n[[pose]]\nposition = [0, 0.05, 1.4]\n",
            "path.start_speed = 0 at pose[1]: must be 1, the end_speed before it",
        ),
        (
            f"{HEAD}{TWO}path = {{ end_speed = 1.0 }}\n[[pose]]\nposition = [0, 0.05, 1.4]\n"
            "path = { start_speed = 1.0 }\n",
            "path.end_speed = 1 at pose[1]: must be 0: the direction changes there",
        ),
    ],
)
def test_mistakes(tmp_path, text, line):
    code, out, err = plan(tmp_path, text)
    if line:
        assert (code, out) == (2, "") and line in err and err.count("\n") == 1
    else:
        assert code in (0, 1) and err == ""


def test_mistakes_of_files(tmp_path):
    (tmp_path / "a.csv").write_text("x,y,z,qw,qx,qy,qz\n0,0,1.4,1,0,0,0\n0.05,0,1.4,1,0,0,0\n")
    (tmp_path / "b.csv").write_text("x,y,z\n0.01,0,1.4\n0.05,0,1.4\n")
    (tmp_path / "c.csv").write_text("x,y,z\n0.01,0,one\n0.05,0,1.4\n")
    (tmp_path / "d.nc").write_text("G0 X0 Y0 Z1400\nG5 X1\n")
    cases = (
        (whole('kind = "csv"\nfile = "a.csv"'), 'path.file = "a.csv": must be a file without quaternions'),
        (
            one('kind = "csv", file = "b.csv"', False),
            "one that begins where the pose before is, not at [0.01, 0.0, 1.4]",
        ),
        (whole('kind = "csv"\nfile = "c.csv"'), 'c.csv: line 2, column 3: z = "one": must be a finite number'),
        (whole('kind = "gcode"\nfile = "d.nc"'), "d.nc: line 2: G5: must be written as G1, G2 and G3"),
    )
    for text, line in cases:
        code, out, err = plan(tmp_path, text)
        assert (code, out) == (2, "") and line in err and err.count("\n") == 1


def test_a_planar_robot_stays_in_its_plane():
    keys = {"schema": 1, "robot": "boralugoda-planar-two", "family": "path"}
    with pytest.raises(ConfigError, match=r"path.positions: y reaches 0\.1 m"):
        cspr_jax.plan(keys | {"path": {"points": [[0.0, 0.0, 1.0], [0.1, 0.1, 1.0]]}})


@pytest.mark.thorough
def test_a_robot_on_a_joint_turns_along_its_path():
    """The joint stays; the path is that of orientations, and one that moves the joint is refused."""
    ends = np.array([[0.3, 0.0, 0.2], [0.0, 0.3, 0.2], [-0.3, -0.3, 0.2], [0.2, -0.3, 0.2]])
    robot = {"name": "joint", "pattern": "3R", "z_axis": "up", "mass": 1.0, "inertia": 0.1 * np.eye(3)}
    robot |= {"base_points": 2.0 * ends, "platform_points": ends, "centre_of_mass": [0.1, 0.0, 0.3]}
    turns = [[1.0, 0.0, 0.0, 0.0], [0.96, 0.28, 0.0, 0.0], [0.96, 0.0, 0.28, 0.0]]
    place = [0.0, 0.1, 0.2]
    keys = {"schema": 1, "robot": robot, "family": "path", "samples": 101, "path": {"kind": "cubic", "grid": 30}}
    rows = cspr_jax.plan(keys | {"pose": [{"position": place, "quaternion": turn} for turn in turns]}).rows()
    np.testing.assert_allclose(rows["position"], np.tile(place, (len(rows["position"]), 1)), atol=1e-12)
    for turn in turns:
        assert np.abs(rows["quaternion"] @ turn).max() > 1.0 - 1e-6
    with pytest.raises(ConfigError, match=r"path.positions: they differ by 0\.5 m: must be those of the joint"):
        cspr_jax.plan(keys | {"pose": [{"position": place}, {"position": [0.5, 0.1, 0.2]}]})


@pytest.mark.thorough
def test_orientations_of_files_are_those_of_motions(tmp_path):
    """Of the platform's own axes, also where these are turned from the reference ones."""
    robot = read_toml(CATALOGUE / "nist-robocrane.toml")
    turn = Rotation.from_euler("z", 0.3)
    robot |= {"platform_points": turn.apply(robot["platform_points"]), "inertia": np.diag([0.09375, 0.09375, 0.1875])}
    units = np.roll(Rotation.from_euler("z", [[-0.3], [-0.1]]).as_quat(), 1, axis=1)
    rows = np.column_stack([[0.0, 1.0], [[0.0, 0.0, -3.0], [0.2, 0.1, -3.0]], units])
    for name, columns in (("motion", rows), ("path", rows[:, 1:])):
        np.savetxt(tmp_path / f"{name}.csv", columns, delimiter=",")
    keys = {"schema": 1, "robot": robot}
    motion = cspr_jax.plan(keys | {"family": "spline", "motion": str(tmp_path / "motion.csv")})
    path = cspr_jax.plan(keys | {"family": "path", "path": {"kind": "csv", "file": str(tmp_path / "path.csv")}})
    for name in ("position", "quaternion"):
        ends = (result.rows()[name][[0, -1]] for result in (motion, path))
        np.testing.assert_allclose(*ends, atol=1e-12)
