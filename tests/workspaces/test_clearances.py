"""Maps of workspaces among obstacles: distances beside NumPy's, whole cells, speeds of cables, and mistakes."""

import json
from pathlib import Path

import h5py
import jax
import numpy as np
import pytest
from oracles import clearance as oracle
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from support.commands import cspr, refuse_sweep

import cspr_jax
from cspr_jax.robots.cables import with_cables
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.model.point_mass import guided_robot, point_mass_robot
from cspr_jax.robots.model.pulleys import exits
from cspr_jax.schema.meanings import NEAREST_BODIES
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.sweep.definition import read_sweep
from cspr_jax.workspaces.cells.shifts import shifts
from cspr_jax.workspaces.cells.speeds import cable_speeds
from cspr_jax.workspaces.poses import geometry
from cspr_jax.workspaces.poses.geometry import mass_centres

ROOT = Path(__file__).parents[2]
DIAMETER, CENTRE = 0.03, np.array([0.03, -0.02, 0.05])
# Six cables, and a platform whose mass centre is not the origin of its frame; z up, far from the origin of its axes.
ORIGIN = np.array([5.0, -3.0, 1.0])
BASE = np.array([[-2, -2, 2], [2, -2, 2.1], [2, 2, 1.9], [-2, 2, 2], [-2.3, -2.2, 2.2], [-0.2, 2.1, 2.3]]) + ORIGIN
POINTS = np.array(
    [[-0.3, -0.2, 0.1], [0.3, -0.25, 0.1], [0.3, 0.2, 0.12], [-0.25, 0.2, 0.1], [0.1, -0.2, -0.15], [-0.1, 0.2, -0.15]]
)
TURN = Rotation.from_rotvec([0.2, -0.1, 0.3])
BOX_TURN = Rotation.from_rotvec([0.3, 0.5, -0.2])
BALL, BALL_RADIUS = np.add(ORIGIN, [0.9, 0.3, 0.9]), 0.25
ROD, ROD_RADIUS = np.add(ORIGIN, [[-1.5, -0.9, -0.4], [-0.8, -1.0, 1.2]]), 0.08
BLOCK, BLOCK_SIZE = np.add(ORIGIN, [-0.4, 1.2, 0.7]), np.array([0.5, 0.3, 0.9])
HOUSE = np.array([[-0.32, -0.27, -0.16], [0.32, 0.22, 0.13]])
AXES = [
    np.linspace(-0.6, 0.6, 4) + ORIGIN[0],
    np.linspace(-0.5, 0.5, 3) + ORIGIN[1],
    np.array([-0.4, 0.5, 1.4]) + ORIGIN[2],
]


KINDS = ("sphere", "cylinder", "box")


def turned_over(points, z_axis):
    """What z up calls so, in axes with z down: half a turn about x."""
    return np.asarray(points) * ([1.0, 1.0, 1.0] if z_axis == "up" else [1.0, -1.0, -1.0])


def quaternion(turn, z_axis):
    w, x, y, z = turn.as_quat(scalar_first=True).tolist()
    return [w, x, y, z] if z_axis == "up" else [w, x, -y, -z]


def file_of(z_axis="up", shape="box", obstacles=KINDS, axes=AXES, base=BASE, robot="", more="", end=""):
    """A sweep of the robot, everything in its axes."""

    def row(points):
        return json.dumps((turned_over(points, z_axis) + 0.0).tolist())

    low, high = np.sort(turned_over(HOUSE, z_axis), axis=0)
    shapes = {
        "box": f"platform_box = {json.dumps([low.tolist(), high.tolist()])}",
        "hull": "platform_hull = true",
        "none": "",
    }
    tables = {
        "sphere": f"centre = {row(BALL)}\nradius = {BALL_RADIUS}",
        "cylinder": f"start = {row(ROD[0])}\nend = {row(ROD[1])}\nradius = {ROD_RADIUS}",
        "box": f"centre = {row(BLOCK)}\nsize = {BLOCK_SIZE.tolist()}\nquaternion = {quaternion(BOX_TURN, z_axis)}",
    }
    x, y, z = axes if z_axis == "up" else (axes[0], -axes[1], -axes[2])
    return f"""schema = 1
map = "workspace"
[robot]
name = "house"
mass = 2.0
z_axis = "{z_axis}"
inertia = [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]
base_points = {row(base)}
platform_points = {row(POINTS)}
centre_of_mass = {row(CENTRE)}
cable_diameter = {DIAMETER}
{robot}
[axes]
x = {x.tolist()}
y = {y.tolist()}
z = {z.tolist()}
[workspace]
conditions = ["interference-free"]
orientation = {quaternion(TURN, z_axis)}
{shapes[shape]}
{more}
{"".join(f'[[workspace.obstacle]]{chr(10)}kind = "{kind}"{chr(10)}{tables[kind]}{chr(10)}' for kind in obstacles)}
{end}
"""


def swept(folder, text):
    (folder / "w.toml").write_text(text)
    code, out, error = cspr("run", folder / "w.toml", "-o", folder / "run")
    assert (code, error) == (0, "")
    with h5py.File(out.strip()) as file:
        return {name: data[...] for name, data in file.items()}


def grid(*axes):
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)


def wide(row, like):
    return np.broadcast_to(np.asarray(row, float), like.shape)


def gap(corners, others):
    """Of two convex bodies, the largest distance of the origin beyond a face of all differences of their corners."""
    return ConvexHull((corners[:, None] - others[None]).reshape(-1, 3)).equations[:, 3].max()


def distances(places, shape, base=BASE, obstacles=(0, 1, 2)):
    """Of cables from each other, cables and platform from obstacles, cables from the platform; z up; 0 where they meet.

    The last two may be less than 0 of platform and obstacle alone.
    """
    turn = TURN.as_matrix()
    ends = places[:, None] + POINTS @ turn.T
    rays = [base[..., i, :] - ends[:, i] for i in range(6)]
    pairs = [oracle.segments(ends[:, i], rays[i], ends[:, j], rays[j]) for i in range(6) for j in range(i)]
    cables = np.min(pairs, axis=0) - DIAMETER
    outer, own = np.full(len(places), np.inf), np.full(len(places), np.inf)
    solid = ConvexHull(POINTS) if shape == "hull" else None
    half, middle = 0.5 * (HOUSE[1] - HOUSE[0]), HOUSE.mean(0)
    corners = POINTS if shape == "hull" else middle + oracle.corners(half[None])[0]
    leave = max(10.0 * DIAMETER, 0.01 * np.ptp(corners, axis=0).max())

    def from_platform(start, ray):
        # Platform axes.
        if shape == "box":
            return oracle.outside_box(start - middle, ray, wide(half, start))
        far = oracle.outside_triangles(start, ray, POINTS[solid.simplices])
        points = start[:, None] + np.linspace(0, 1, 401)[None, :, None] * ray[:, None]
        depth = (points @ solid.equations[:, :3].T + solid.equations[:, 3]).max(2).min(1)
        return np.where(depth <= 0.0, 0.0, far)

    for i in range(6):
        apart = [
            oracle.point_to_segment(wide(BALL, places), ends[:, i], rays[i]) - BALL_RADIUS,
            oracle.segments(wide(ROD[0], places), wide(ROD[1] - ROD[0], places), ends[:, i], rays[i]) - ROD_RADIUS,
            oracle.outside_box(
                (ends[:, i] - BLOCK) @ BOX_TURN.as_matrix(),
                rays[i] @ BOX_TURN.as_matrix(),
                wide(0.5 * BLOCK_SIZE, places),
            ),
        ]
        for k in obstacles:
            outer = np.minimum(outer, apart[k] - 0.5 * DIAMETER)
        if shape != "none":
            unit = rays[i] / np.linalg.norm(rays[i], axis=1)[:, None]
            inner = from_platform(wide(POINTS[i], places) + leave * unit @ turn, (rays[i] - leave * unit) @ turn)
            own = np.minimum(own, inner - 0.5 * DIAMETER)
    if shape != "none" and len(obstacles):
        ball, start = (BALL - places) @ turn, (ROD[0] - places) @ turn
        outer = np.minimum(outer, from_platform(ball, np.zeros_like(ball)) - BALL_RADIUS)
        outer = np.minimum(outer, from_platform(start, wide((ROD[1] - ROD[0]) @ turn, start)) - ROD_RADIUS)
        block = BLOCK + oracle.corners(0.5 * BLOCK_SIZE[None])[0] @ BOX_TURN.as_matrix().T
        outer = np.minimum(outer, [gap((block - place) @ turn, corners) for place in places])
    return cables.astype(float), outer.astype(float), own.astype(float)


@pytest.mark.parametrize(
    ("z_axis", "shape", "obstacles"),
    [
        ("up", "box", KINDS),
        ("down", "box", KINDS),
        ("down", "none", KINDS),
        pytest.param("down", "hull", (), marks=pytest.mark.thorough),
        pytest.param("up", "hull", KINDS, marks=pytest.mark.soak),
    ],
)
def test_clearances_are_those_of_numpy(tmp_path, z_axis, shape, obstacles):
    """In a robot's own axes, whichever way z points; reasons and what is nearest follow."""
    data = swept(tmp_path, file_of(z_axis, shape, obstacles))
    wanted = distances(grid(*AXES), shape, obstacles=range(len(obstacles)))
    names = (
        ["clearance_cables"] + ["clearance_obstacles"] * bool(obstacles) + ["clearance_platform"] * (shape != "none")
    )
    wanted = [far for far in wanted if np.isfinite(far).any()]
    assert {name for name in data if name.startswith("clearance_")} == {*names}
    assert {"nearest_bodies", "clearance"} < set(data) and "speed_margin" not in data
    for name, far in zip(names, wanted, strict=True):
        found = data[name].ravel()
        # Where they meet NumPy knows no depth.
        apart = far > -0.5 * DIAMETER
        np.testing.assert_allclose(found[apart], far[apart], rtol=0, atol=1e-9)
        assert (found[~apart] <= -0.5 * DIAMETER + 1e-9).all()
    verdict = data["verdict"].ravel()
    flags = {"clearance_cables": Verdict.CABLE_CABLE, "clearance_obstacles": Verdict.OBSTACLE}
    for name, far in zip(names, wanted, strict=True):
        flag = flags.get(name, Verdict.CABLE_PLATFORM)
        assert (((verdict & flag) != 0) == (far <= 0.0)).all() and 0 < (far <= 0.0).sum() < len(far)
    least = np.min([data[name] for name in names], axis=0)
    np.testing.assert_array_equal(data["clearance"], least)
    assert (verdict == 0).any()
    words = np.array(NEAREST_BODIES)[data["nearest_bodies"]]
    for word in np.unique(words):
        name = {"two cables": "clearance_cables", "cable and platform": "clearance_platform"}
        of = data[name.get(word, "clearance_obstacles")]
        np.testing.assert_array_equal(of[words == word], data["clearance"][words == word])
    assert len(np.unique(words)) >= 2


def cells_of(folder, text):
    """Sides of cells, and places all over each: its middle, corners, and others."""
    data, rng = swept(folder, text), np.random.default_rng(0)
    axes = [np.sort(data[name]) for name in "xyz"]
    half = np.array([0.5 * (axis[1] - axis[0]) for axis in axes])
    steps = np.r_[np.zeros((1, 3)), oracle.corners(np.ones((1, 3)))[0], rng.uniform(-1.0, 1.0, (3, 3))]
    places = grid(*axes)[:, None] + half * steps
    return data["cell_side"].ravel(), places


FINE = [np.linspace(0.2, 0.55, 8) + 5.0, np.array([-3.1, -3.05]), np.linspace(0.1, 0.4, 5) + 1.0]
# Its cables are apart from each other there, and one is near the platform.
FREE = np.r_[BASE[:4], [np.add(ORIGIN, [-0.8, -2.2, 2.2])], BASE[5:]]


@pytest.mark.thorough
@pytest.mark.parametrize("shape", ["none", "box", pytest.param("hull", marks=pytest.mark.soak)])
def test_whole_cells_among_obstacles(tmp_path, shape):
    """A cell is on one side only where all positions that were tried are; so are some near the platform."""
    side, places = cells_of(tmp_path, file_of(shape=shape, axes=FINE, base=FREE, more="prove = true"))
    far = np.min(distances(places.reshape(-1, 3), shape, FREE), axis=0).reshape(places.shape[:2])
    assert (far[side == 1] > 0.0).all() and (far[side == 2] <= 0.0).all()
    assert min((side == number).sum() for number in (0, 1, 2)) > 1


CAROCA = """schema = 1
map = "workspace"
[robot]
name = "CAROCA"
z_axis = "up"
base_points = [
    [1.659, -2.85, 3.221], [1.35, -3.159, 3.221], [-1.35, -3.159, 3.221], [-1.659, -2.85, 3.221],
    [-1.659, 2.85, 3.221], [-1.35, 3.159, 3.221], [1.359, 3.159, 3.221], [1.659, 2.85, 3.221],
]
platform_points = [
    [0.16, 0.14, 0.105], [-0.13, -0.21, -0.105], [0.13, -0.21, 0.105], [-0.16, 0.14, -0.105],
    [-0.16, -0.14, 0.105], [0.13, 0.21, -0.105], [-0.13, 0.21, 0.105], [0.16, -0.14, -0.105],
]
mass = 150.0
inertia = [[6.5, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 22.5]]
[axes]
x = [-0.15, 0.0, 0.15]
y = [-0.25, 0.0, 0.25]
z = [1.0, 1.2]
[workspace]
conditions = ["interference-free"]
prove = true
"""


def test_cells_that_reach_farther_than_the_clearance_are_proved(tmp_path):
    """As wide as a map of 25 x 25 x 17 cells has them, of a robot with eight cables."""
    (tmp_path / "w.toml").write_text(CAROCA)
    code, out, error = cspr("run", tmp_path / "w.toml", "-o", tmp_path / "run")
    assert code == 0 and "does the robot lack cable_diameter?" in error
    with h5py.File(out.strip()) as file:
        side, clearance = file["cell_side"][...], file["clearance"][...]
        assert (file["cell_open"][...][side != 0] == 0).all()
    assert (clearance < np.linalg.norm([0.075, 0.125, 0.1])).all() and (side == 1).mean() > 0.8


@pytest.mark.thorough
def test_cells_of_a_robot_with_pulleys(tmp_path):
    """Distances are those of where the cables leave; cells are proved though that moves."""
    wheel = "pulley_radius = 0.15"
    text = file_of(shape="none", axes=FINE, base=FREE, obstacles=("sphere",), robot=wheel, more="prove = true")
    side, places = cells_of(tmp_path, text)
    targets = places.reshape(-1, 1, 3) + POINTS @ TURN.as_matrix().T
    up = np.broadcast_to([0.0, 0.0, 1.0], targets.shape)
    spools = exits(np.broadcast_to(FREE, targets.shape), up, np.full(targets.shape[:2], 0.15), targets).point
    every = distances(places.reshape(-1, 3), "none", np.asarray(spools), [0])
    cables, outer, _ = (far.reshape(places.shape[:2]) for far in every)
    with h5py.File(tmp_path / "run" / "w.h5") as file:
        np.testing.assert_allclose(file["clearance_cables"][...].ravel(), cables[:, 0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(file["clearance_obstacles"][...].ravel(), outer[:, 0], rtol=0, atol=1e-9)
    far = np.minimum(cables, outer)
    assert (far[side == 1] > 0.0).all() and (far[side == 2] <= 0.0).all()
    assert set(np.unique(side)) == {0, 1, 2}


def test_exits_move_no_more_than_is_said():
    """On pulleys: far from them, right below them and beside them; nowhere do bounds of cells lie too low."""
    rng, radius = np.random.default_rng(3), 0.2
    plain = point_mass_robot([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]], mass=1.0, z_axis="down")
    robot = with_cables(plain, pulley_radius=radius)
    middles = np.r_[rng.uniform(-2.0, 2.0, (200, 3)), rng.uniform(-0.4, 0.4, (200, 3))]
    reach = 10.0 ** rng.uniform(-3, -0.5, 400)
    found = shifts(robot, middles, np.tile([1.0, 0.0, 0.0, 0.0], (400, 1)), reach)
    steps = rng.normal(size=(400, 50, 3))
    steps *= (reach[:, None] * rng.uniform(0.5, 1.0, (400, 50)) / np.linalg.norm(steps, axis=2))[..., None]

    def exit_of(points):
        up = np.broadcast_to([0.0, 0.0, -1.0], points.shape)
        return jax.jit(exits)(np.zeros_like(points), up, np.full(points.shape[:-1], radius), points)

    before, after = exit_of(middles[:, None] + 0.0 * steps), exit_of(middles[:, None] + steps)
    for name, bound in (("point", found.exits), ("direction", found.units[:, 0])):
        moved = np.linalg.norm(np.asarray(getattr(after, name)) - np.asarray(getattr(before, name)), axis=2)
        moved = np.where(np.isnan(moved), 0.0, moved).max(1)
        assert (moved <= bound + 1e-9).all() and (moved > 0.5 * bound).sum() > 20


STORED = ["verdict", "cell_side", "speed_margin", "length_margin"]


def speeds_of(places, speed, angular_speed, base=BASE):
    """Greatest speeds of the cables, (n, 6), of velocities of the origin of the platform frame; z up."""
    arms = POINTS @ TURN.as_matrix().T
    rays = base - (places[:, None] + arms)
    units = rays / np.linalg.norm(rays, axis=2)[..., None]
    return speed * np.linalg.norm(units, axis=2) + angular_speed * np.linalg.norm(np.cross(arms, units), axis=2)


@pytest.mark.parametrize("z_axis", ["up", "down"])
def test_speeds_of_cables(tmp_path, z_axis):
    """Of the robot whose mass centre is not the origin of its frame; whole cells, too."""
    most = 1.0 + np.array([0.1, 0.115, 0.14, 0.13, 0.15, 0.12])
    asked = "prove = true\nspeed = 1.0\nangular_speed = 0.5"
    limits = f"[limits]\ncable_speed_max = {most.tolist()}\ncable_length_max = 9.0"
    text = file_of(z_axis, "none", (), more=asked, end=f"{limits}\n[run]\nstore = {json.dumps(STORED)}")
    data, slack = swept(tmp_path, text), most - speeds_of(grid(*AXES), 1.0, 0.5)
    np.testing.assert_allclose(data["speed_margin"].ravel(), slack.min(1), rtol=0, atol=1e-9)
    rays = BASE - (grid(*AXES)[:, None] + POINTS @ TURN.as_matrix().T)
    np.testing.assert_allclose(data["length_margin"].ravel(), 9.0 - np.linalg.norm(rays, axis=2).max(1), atol=1e-9)
    fast = (data["verdict"].ravel() & Verdict.CABLE_TOO_FAST) != 0
    assert (fast == (slack < 0.0).any(1)).all() and 0 < fast.sum() < len(fast)


def test_whole_cells_of_speeds(tmp_path):
    """Half of the places are too fast: cells on either side are proved, those between are not."""
    axes = [np.linspace(-1.0, 1.0, 20) + 5.0, np.array([-3.0, -2.9]), np.linspace(0.0, 1.2, 12) + 1.0]
    most = float(np.median(speeds_of(grid(*axes), 1.0, 0.5, FREE).max(1)))
    asked, limits = "prove = true\nspeed = 1.0\nangular_speed = 0.5", f"[limits]\ncable_speed_max = {most}"
    side, places = cells_of(tmp_path, file_of("up", "none", (), axes, FREE, more=asked, end=limits))
    slack = (most - speeds_of(places.reshape(-1, 3), 1.0, 0.5, FREE).max(1)).reshape(places.shape[:2])
    assert (slack[side == 1] >= 0.0).all() and (slack[side == 2] < 0.0).all()
    assert set(np.unique(side)) == {0, 1, 2}


@pytest.mark.quick("2R3T", "pulleys")
@pytest.mark.parametrize("pattern", ["1T", "2R3T", "3R", "pulleys"])
def test_no_velocity_needs_a_faster_cable(pattern):
    """Finite differences of the lengths along many velocities: none is faster, and the fastest nearly are."""
    rng, most, step = np.random.default_rng(5), 10.0, 1e-6
    rod = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, -0.3], [0.0, 0.0, 0.1], [0.0, 0.0, 0.2], [0.0, 0.0, -0.1]])
    common = {"mass": 1.0, "z_axis": "down"}
    if pattern == "1T":
        robot = guided_robot(np.array([[-1.0, 0.0, -2.0], [1.0, 0.2, -2.0], [0.0, 1.0, -1.5]]), **common)
    else:
        points, base = (rod, BASE[:5] - ORIGIN) if pattern == "2R3T" else (POINTS, BASE - ORIGIN)
        kind = "3R3T" if pattern == "pulleys" else pattern
        centre = [0.0, 0.0, 0.05] if pattern == "2R3T" else CENTRE
        robot = platform_robot(
            base * [1.0, 1.0, -1.0], points, inertia=np.diag([0.1] * 3), centre_of_mass=centre, pattern=kind, **common
        )
    robot = with_cables(robot, pulley_radius=0.1) if pattern == "pulleys" else robot
    asked = cable_speeds(robot, np.asarray(most), speed=0.0 if pattern == "3R" else 1.0, angular_speed=0.5)
    place, turn = np.zeros((1, 3)), TURN.as_quat(scalar_first=True)[None]
    fastest = most - asked.margins(place, turn)[0]
    move, spin = (x / np.linalg.norm(x, axis=1)[:, None] for x in rng.normal(size=(2, 4096, 3)))
    move[:], spin[:] = (0.0 if pattern == "3R" else 1.0) * move, (0.0 if pattern == "1T" else 0.5) * spin
    if pattern == "1T":
        move = np.array([[0.0, 0.0, 1.0]]) * np.sign(move[:, 2:])
    if pattern == "2R3T":
        line = TURN.apply([0.0, 0.0, 1.0])
        spin -= (spin @ line)[:, None] * line
        spin *= 0.5 / np.linalg.norm(spin, axis=1)[:, None]

    def lengths(sign):
        turns = (Rotation.from_rotvec(sign * step * spin) * TURN).as_quat(scalar_first=True)
        at = mass_centres(robot, sign * step * move, turns)
        return np.asarray(geometry.cable_lengths(robot, at, turns))

    rates = np.abs(lengths(1.0) - lengths(-1.0)) / (2.0 * step)
    assert (rates <= fastest + 1e-6).all() and (rates.max(0) > 0.9 * fastest).all()


def test_sets_of_orientations_among_obstacles(tmp_path):
    """Two orientations, asked each and as a set: the better one's clearance, and what is nearest there."""
    turns = [quaternion(Rotation.identity(), "up"), quaternion(Rotation.from_rotvec([0.0, 0.0, 0.5]), "up")]
    (tmp_path / "set").mkdir()
    text = file_of("up", "box", ("sphere",), more=f'orientations = "inclusion"\nquaternions = {turns}')
    data = swept(tmp_path / "set", text)
    each = []
    for k, turn in enumerate(turns):
        (tmp_path / f"{k}").mkdir()
        together = Rotation.from_quat(turn, scalar_first=True) * TURN
        one = file_of("up", "box", ("sphere",)).replace(f"{quaternion(TURN, 'up')}", f"{quaternion(together, 'up')}")
        each.append(swept(tmp_path / f"{k}", one))
    better = np.argmax([one["clearance"] for one in each], axis=0)
    for name in ("clearance", "nearest_bodies"):
        wanted = np.where(better == 0, each[0][name], each[1][name])
        np.testing.assert_allclose(data[name], wanted, rtol=0, atol=1e-12)
    assert ((data["verdict"] == 0) == (np.max([one["clearance"] for one in each], axis=0) > 0.0)).all()
    assert {*better.ravel()} == {0, 1} and len(np.unique(data["nearest_bodies"])) >= 2


@pytest.mark.thorough
def test_results_with_obstacles_are_read_and_drawn(tmp_path):
    """Their settings hold tables in lists; words and reasons have colours."""
    data = swept(tmp_path, file_of("down", "none"))
    found = cspr_jax.open_result(tmp_path / "run" / "w.h5")
    np.testing.assert_array_equal(found.data["nearest_bodies"], data["nearest_bodies"])
    assert [table["kind"] for table in found.settings["workspace"]["obstacle"]] == list(KINDS)
    for name in ("nearest_bodies", "verdict", "clearance_obstacles"):
        path = tmp_path / f"{name}.png"
        assert cspr("plot", tmp_path / "run" / "w.h5", "--quantity", name, "-o", path)[0] == 0 and path.exists()


def test_what_nobody_asks_changes_no_identity():
    """The identity of a sweep without obstacles, whose file holds the columns of its conditions alone."""
    sweep = read_sweep(ROOT / "sweeps" / "workspace.toml")
    assert sweep.identity.startswith("0c659540a640a2f6") and "nearest_bodies" not in sweep.store


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"end": "[[workspace.obstacle]]\nkind = 'ball'"}, "workspace.obstacle[3].kind"),
        ({"end": "[[workspace.obstacle]]\nkind = 'sphere'\nradius = 1.0"}, "workspace.obstacle[3].centre is missing"),
        ({"shape": "box", "more": "platform_hull = true"}, "workspace.platform_hull = true: cannot be combined with"),
        ({"shape": "none", "more": "platform_hull = false"}, "workspace.platform_hull = false: must be true, a list"),
        ({"shape": "none", "more": "platform_hull = 3"}, "workspace.platform_hull = 3"),
        ({"shape": "none", "more": "platform_hull = [[0, 0, 0]]"}, "workspace.platform_hull"),
        ({"shape": "none", "more": "platform_box = [[0, 0, 1], [0, 0, 0]]"}, "workspace.platform_box"),
        ({"end": "[limits]\ncable_speed_max = 1.0"}, "limits.cable_speed_max: must be absent without workspace.speed"),
        ({"more": "speed = 1.0"}, "workspace.speed: must be absent without limits.cable_speed_max"),
        ({"more": "angular_speed = 1.0"}, "workspace.angular_speed: must be absent without limits.cable_speed_max"),
        ({"more": "speed = 0.0"}, "workspace.speed"),
        ({"end": "[limits]\ncable_acceleration_max = 1.0"}, "limits.cable_acceleration_max"),
    ],
)
def test_mistakes_are_one_line(tmp_path, changes, words):
    refuse_sweep(tmp_path, file_of(**changes), words)


@pytest.mark.parametrize(
    ("robot", "lines", "words"),
    [
        ("prototype", "platform_box = [[0, 0, 0], [1, 1, 1]]", "workspace.platform_box: must be absent: a point mass"),
        ("prototype", "angular_speed = 1.0", "workspace.angular_speed: must be absent: a point mass does not turn"),
        ("kntu-planar", "platform_hull = true", "workspace.platform_hull = true: must be points"),
        ("kntu-planar", "conditions = ['static']\nobstacle = []", "interference-free"),
        (
            "kntu-planar",
            "conditions = ['static']\nplatform_hull = true",
            "workspace.platform_hull = true: must be absent",
        ),
    ],
)
def test_mistakes_of_other_robots(tmp_path, robot, lines, words):
    asked = lines if "conditions" in lines else f'conditions = ["interference-free"]\n{lines}'
    limits = "[limits]\ncable_speed_max = 1.0" if "speed" in lines else ""
    text = f'schema = 1\nmap = "workspace"\nrobot = "{robot}"\n[axes]\nx = [0]\ny = [0]\nz = [1]\n[workspace]\n'
    refuse_sweep(tmp_path, f"{text}{asked}\n{limits}\n", words)
