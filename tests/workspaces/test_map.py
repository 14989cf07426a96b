"""Maps of workspaces: what Python says cell by cell, sets of orientations, and mistakes."""

import dataclasses
import math

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.commands import cspr

import cspr_jax
from cspr_jax.numerics.linear.rotations import from_tilt_torsion
from cspr_jax.robots.model.orientation_grids import cone_grid, planar_grid
from cspr_jax.schema.verdicts import Verdict

SWEEP = """
schema = 1
map = "workspace"
robot = "{robot}"
[axes]
x = {{ start = -1.5, stop = 1.5, count = 7 }}
y = [0]
z = {{ start = -1.2, stop = 1.2, count = 5 }}
[workspace]
conditions = {conditions}
{more}
"""


def swept(folder, robot="kntu-planar", conditions='["wrench-feasible", "wrench-closure"]', more="", finer=1):
    text = SWEEP.format(robot=robot, conditions=conditions, more=more)
    for count in (7, 5):
        text = text.replace(f"count = {count} ", f"count = {finer * (count - 1) + 1} ")
    (folder / "w.toml").write_text(text)
    return cspr("run", folder / "w.toml", "-o", folder / "run")


def test_a_map_is_what_python_says(tmp_path):
    """Every cell, both conditions, a turned platform; and its picture."""
    turn = [math.cos(0.1), 0.0, math.sin(0.1), 0.0]
    code, out, error = swept(tmp_path, more=f"orientation = {turn}")
    assert (code, error) == (0, "")
    robot, places = (
        cspr_jax.load_robot("kntu-planar"),
        grid(np.linspace(-1.5, 1.5, 7), [0.0], np.linspace(-1.2, 1.2, 5)),
    )
    turns = np.tile(turn, (len(places), 1))
    held = cspr_jax.workspace(robot, places, turns)
    closed = cspr_jax.workspace(robot, places, turns, condition="wrench-closure")
    with h5py.File(out.strip()) as file:
        np.testing.assert_allclose(file["wrench_margin"][...].ravel(), held.margin, atol=1e-9)
        np.testing.assert_allclose(file["closure_margin"][...].ravel(), closed.margin, atol=1e-9)
        assert (file["verdict"][...].ravel() == held.verdict | closed.verdict).all()
        assert 0 < (file["verdict"][...] == 0).sum() < len(places)
    assert cspr("plot", out.strip(), "-o", tmp_path / "w.png")[0] == 0
    assert cspr("plot", out.strip(), "--quantity", "verdict", "-o", tmp_path / "v.png")[0] == 0


def test_interference_and_the_floor_of_a_map(tmp_path):
    """Cables of the platform on seven meet nowhere at these places; below the floor is no workspace."""
    text = SWEEP.format(robot="caspr-seven", conditions='["interference-free"]', more="[limits]\nfloor = 0.0\n")
    (tmp_path / "w.toml").write_text(text)
    code, out, error = cspr("run", tmp_path / "w.toml", "-o", tmp_path / "run")
    assert code == 0 and "does the robot lack cable_diameter?" in error and len(error.splitlines()) == 1
    with h5py.File(out.strip()) as file:
        clearance, verdict, z = file["clearance"][...], file["verdict"][...], file["z"][...]
    assert (((verdict & Verdict.CABLE_CABLE) != 0) == (clearance <= 0.0)).all()
    robot = cspr_jax.load_robot("caspr-seven")
    lowest = min(0.0, float(np.min(robot.platform_points[:, 2])))  # of the mass centre and the attachment points
    below = np.broadcast_to((z + lowest < 0.0)[None, None], verdict.shape)
    assert (((verdict & Verdict.BELOW_FLOOR) != 0) == below).all()


KNTU = np.linspace(-1.5, 1.5, 7), [0.0], np.linspace(-1.2, 1.2, 5)


@pytest.mark.parametrize("kind", ["inclusion", "total", "maximum", "dextrous"])
def test_sets_of_orientations(tmp_path, kind):
    """Beside every orientation asked from Python; about the orientation that is given."""
    base, tilt, divisions = 0.1, 0.6 if kind in ("inclusion", "total") else math.pi, 16
    more = f'orientation = [{math.cos(0.5 * base)}, 0.0, {math.sin(0.5 * base)}, 0.0]\norientations = "{kind}"\n'
    more += f"divisions = {divisions}\n" + (f"tilt_max = {tilt}\n" if tilt < 3.0 else "")
    code, out, error = swept(tmp_path, conditions='["wrench-feasible"]', more=more)
    assert (code, error) == (0, "")
    places, robot = grid(*KNTU), cspr_jax.load_robot("kntu-planar")
    angles, volume = planar_grid(divisions, tilt)
    inside, margins = [], []
    for angle in angles[:, 1]:
        turn = Rotation.from_euler("y", angle + base).as_quat(scalar_first=True)
        found = cspr_jax.workspace(robot, places, np.tile(turn, (len(places), 1)))
        inside.append(found.verdict == 0)
        margins.append(found.margin)
    with h5py.File(out.strip()) as file:
        verdict, fraction, margin = (
            file[name][...].ravel() for name in ("verdict", "orientation_fraction", "wrench_margin")
        )
    is_total = kind in ("total", "dextrous")
    wanted = np.all(inside, axis=0) if is_total else np.any(inside, axis=0)
    assert ((verdict == 0) == wanted).all() and (kind == "dextrous" or 0 < wanted.sum() < len(wanted))
    np.testing.assert_allclose(fraction, volume @ np.array(inside), atol=1e-12)
    np.testing.assert_allclose(margin, np.min(margins, axis=0) if is_total else np.max(margins, axis=0), atol=1e-7)


def test_orientations_one_by_one_and_axes_of_orientations(tmp_path):
    """Three turns as a list, as an axis, and asked each."""
    turns, robot, places = [-0.3, 0.0, 0.4], cspr_jax.load_robot("kntu-planar"), grid(*KNTU)
    quaternions = [Rotation.from_euler("y", turn).as_quat(scalar_first=True).tolist() for turn in turns]
    more = f'orientations = "total"\nquaternions = {quaternions}'
    out = swept(tmp_path, conditions='["wrench-feasible"]', more=more)[1]
    text = SWEEP.format(robot="kntu-planar", conditions='["wrench-feasible"]', more="").replace(
        "[workspace]", f"tilt = {turns}\n[workspace]"
    )
    (tmp_path / "axis.toml").write_text(text)
    along = cspr("run", tmp_path / "axis.toml", "-o", tmp_path / "other")[1]
    each = [cspr_jax.workspace(robot, places, np.tile(turn, (len(places), 1))).verdict == 0 for turn in quaternions]
    with h5py.File(out.strip()) as file, h5py.File(along.strip()) as axis:
        assert ((file["verdict"][...].ravel() == 0) == np.all(each, axis=0)).all()
        assert ((axis["verdict"][...].reshape(-1, 3) == 0) == np.transpose(each)).all()


@pytest.mark.parametrize(("tilt", "torsion"), [(0.0, 0.0), (0.3, 0.0), (0.7, 0.5), (math.pi, math.pi)])
def test_a_cone_of_orientations(tilt, torsion):
    """Its boundary is there; parts add up, and weigh a mean as the integral does."""
    angles, volume = cone_grid(24, tilt, torsion)
    assert volume.sum() == pytest.approx(1.0) and (volume > 0.0).all()
    assert angles[:, 1].max() == pytest.approx(tilt) and np.abs(angles[:, 2]).max() == pytest.approx(torsion)
    steps = Rotation.from_quat(from_tilt_torsion(angles), scalar_first=True).magnitude()
    assert steps.min() == pytest.approx(0.0, abs=1e-7)
    if tilt:
        mean = 0.5 * (1.0 + math.cos(tilt)) if tilt < math.pi else 0.0
        assert volume @ np.cos(angles[:, 1]) == pytest.approx(mean, abs=0.01)
        assert volume @ np.cos(angles[:, 0]) == pytest.approx(0.0, abs=0.02 + volume[0])


PRISM = """
schema = 1
map = "workspace"
[robot]
name = "square"
mass = 1.0
z_axis = "down"
base_points = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]
[axes]
{axes}
[workspace]
conditions = ["static"]
{more}
"""


def volume_of(folder, name, axes, more=""):
    (folder / f"{name}.toml").write_text(PRISM.format(axes=axes, more=more))
    code, out, error = cspr("run", folder / f"{name}.toml", "-o", folder / name)
    assert (code, error) == (0, "")
    return cspr_jax.workspace_volume(out.strip()), out.strip()


def test_whole_cells_and_the_volume_of_a_prism(tmp_path):
    """A mass hangs still below the square of its spools: 4 m^2 times the height."""
    axes = "x = {{ start = -1.5, stop = 1.5, count = {n} }}\ny = {{ start = -1.5, stop = 1.5, count = {n} }}\nz = {z}"
    z = "{ start = 0.5, stop = 1.0, count = 3 }"
    found, path = volume_of(tmp_path, "coarse", axes.format(n=12, z=z), "prove = true")
    assert found.units == "m3" and found.axes == {} and found.undecided_fraction == 0.0
    assert abs(found.volume - 2.0) <= found.error
    assert found.least <= 2.0 <= found.most and found.least > 1.2
    with h5py.File(path) as file:
        side, x, y = file["cell_side"][...], file["x"][...], file["y"][...]
    half = 0.5 * (x[1] - x[0])
    farther = np.maximum(np.abs(x)[:, None], np.abs(y))
    assert (side[farther + half < 1.0 - 1e-9] == 1).all() and (side[farther - half > 1.0 + 1e-9] == 2).all()
    assert (side[(farther + half > 1.0) & (farther - half < 1.0)] == 0).all()
    finer, _ = volume_of(tmp_path, "fine", axes.format(n=48, z="[0.7]"))
    assert finer.units == "m2" and abs(finer.volume - 4.0) <= finer.error < 0.3
    assert finer.least == 0.0 and finer.proved_fraction == 0.0
    polar, _ = volume_of(
        tmp_path,
        "polar",
        "radius = { start = 0.0, stop = 1.6, count = 41 }\nazimuth = { start = -3.141592653589793, "
        "stop = 3.141592653589793, count = 73 }\nz = [0.7]",
    )
    assert abs(polar.volume - 4.0) <= polar.error < 0.3
    code, out, _ = cspr("volume", path)
    assert code == 0 and out.startswith("2") and "m3" in out and "proved between" in out
    assert "open:" in out and "% cut by the boundary" in out and len(out.splitlines()) == 1
    is_open = sum(found.open_fractions.values())
    assert is_open == pytest.approx(1.0 - found.proved_fraction) and found.open_fractions["boundary"] > 0.0
    assert cspr("volume", tmp_path / "fine.toml")[0] != 0


def test_cells_near_meeting_cables_lengths_and_floors(tmp_path):
    """A cell is on one side only where all positions that were tried are."""
    limits = "prove = true\n[limits]\nfloor = -0.31\ncable_length_max = 1.9"
    out = swept(tmp_path, conditions='["wrench-feasible", "interference-free"]', more=limits, finer=4)[1]
    with h5py.File(out.strip()) as file:
        side, x, z = file["cell_side"][...], file["x"][...], file["z"][...]
    robot, rng = cspr_jax.load_robot("kntu-planar"), np.random.default_rng(0)
    half = np.array([0.5 * (x[1] - x[0]), 0.0, 0.5 * (z[1] - z[0])])
    tried = np.array([[x[i], 0.0, z[k]] for i, _, k in np.ndindex(side.shape)])[:, None]
    corners = np.array([[a, 0.0, b] for a in (-1, 1) for b in (-1, 1)])
    ways = np.concatenate([rng.uniform(-1.0, 1.0, (side.size, 20, 3)), np.tile(corners, (side.size, 1, 1))], axis=1)
    tried = (tried + half * ways).reshape(-1, 3)
    rays = tried[:, None] + np.asarray(robot.platform_points) - np.asarray(robot.base_points)
    is_short = (np.linalg.norm(rays, axis=2) <= 1.9).all(1)
    inside = (cspr_jax.workspace(robot, tried).verdict == 0) & is_short & (tried[:, 2] >= -0.31)
    for value, own in zip(side.ravel(), inside.reshape(side.size, -1), strict=True):
        assert value == 0 or (own.all() if value == 1 else not own.any())
    assert set(np.unique(side)) == {0, 1, 2}


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('orientations = "maximum"\nprove = true', "workspace.prove"),
        ("prove = 1", "workspace.prove"),
    ],
)
def test_what_cannot_be_proved(tmp_path, more, words):
    code, out, error = swept(tmp_path, more=more)
    assert (code, out) == (2, "") and words in error and len(error.splitlines()) == 1


def test_capacity_margins_beside_the_others(tmp_path):
    """Stored where their length is given; what Python says, and on the same side as the margin of the tensions."""
    out = swept(tmp_path, conditions='["wrench-feasible"]', more="capacity_length = 0.3")[1]
    found = cspr_jax.workspace(cspr_jax.load_robot("kntu-planar"), grid(*KNTU), capacity_length=0.3)
    with h5py.File(out.strip()) as file:
        margin, capacity = file["wrench_margin"][...].ravel(), file["capacity_margin"][...].ravel()
    np.testing.assert_allclose(capacity, found.margin, atol=1e-9)
    assert ((capacity > 0.0) == (margin > 0.0)).all() and 0 < (margin > 0.0).sum() < len(margin)
    assert swept(tmp_path, conditions='["static"]', more="capacity_length = 0.3")[0] == 2


def test_cables_that_are_too_long(tmp_path):
    """A cell is outside where one of them exceeds its largest length."""
    robot, places = cspr_jax.load_robot("kntu-planar"), grid(*KNTU)
    out = swept(tmp_path, conditions='["static"]', more="[limits]\ncable_length_max = 1.9")[1]
    rays = places[:, None] + np.asarray(robot.platform_points) - np.asarray(robot.base_points)
    is_long = (np.linalg.norm(rays, axis=2) > 1.9).any(1)
    assert 0 < is_long.sum() < len(is_long)
    with h5py.File(out.strip()) as file:
        assert (((file["verdict"][...].ravel() & Verdict.CABLE_TOO_LONG) != 0) == is_long).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"conditions": '["dexterous"]'}, "workspace.conditions"),
        ({"conditions": '["static", "static"]'}, "workspace.conditions"),
        ({"conditions": "[]"}, "workspace.conditions"),
        ({"more": "wrenches = [[1, 2]]"}, "workspace.wrenches"),
        ({"more": "wrenches = [[1, 2], [1, 2, 3]]"}, "workspace.wrenches"),
        ({"more": "orientation = [1, 1, 0, 0]"}, "workspace.orientation"),
        ({"more": "orientation = [0.8, 0.6, 0, 0]"}, "workspace.orientation"),
        ({"more": "obstacle = 1"}, "workspace.obstacle"),
        ({"conditions": '["static"]', "more": "wrenches = [[0, 0, 0]]"}, "workspace.wrenches"),
        ({"conditions": '["static"]', "more": "[limits]\ntension_max = 9"}, "limits.tension_max"),
        ({"more": "[limits]\ncable_speed_max = 1"}, "limits.cable_speed_max"),
        ({"more": "[limits]\ntension_min = 100"}, "tension_min"),
        ({"more": "[limits]\nuncertainty = { }"}, "limits.uncertainty"),
        (
            {"more": 'orientations = "total"\ntilt_max = 0.2\n[limits.uncertainty]\nspool_positions = 0.01'},
            "limits.uncertainty: cannot be combined with workspace.orientations",
        ),
        (
            {"robot": "prototype", "more": "[limits]\nuncertainty = { mass_centre = 0.01 }"},
            "limits.uncertainty.mass_centre: must be absent: a point mass has no other one",
        ),
        ({"robot": "prototype", "more": "orientation = [1, 0, 0, 0]"}, "workspace.orientation"),
        ({"robot": "nothing"}, "robot"),
        ({"more": 'orientations = "some"'}, "workspace.orientations"),
        ({"more": 'orientations = "total"'}, "workspace.tilt_max"),
        ({"more": 'orientations = "maximum"\ntilt_max = 0.1'}, "workspace.tilt_max"),
        ({"more": "tilt_max = 0.1"}, "workspace.tilt_max"),
        ({"more": "divisions = 8"}, "workspace.divisions"),
        ({"more": 'orientations = "total"\ntilt_max = 4.0'}, "workspace.tilt_max"),
        ({"more": 'orientations = "total"\ntilt_max = 0.2\ntorsion_max = 0.1'}, "workspace.torsion_max"),
        ({"more": 'orientations = "total"\nquaternions = [[0.8, 0.6, 0, 0]]'}, "workspace.quaternions"),
        ({"robot": "prototype", "more": 'orientations = "dextrous"'}, "workspace.orientations"),
        ({"more": "wrench_box = [1, 2]"}, "workspace.wrench_box"),
        ({"more": "wrench_ellipsoid = [-1, 2, 3]"}, "workspace.wrench_ellipsoid"),
        ({"more": "acceleration = -1"}, "workspace.acceleration"),
    ],
)
def test_mistakes_are_one_line(tmp_path, changes, words):
    code, out, error = swept(tmp_path, **changes)
    assert (code, out) == (2, "") and words in error and len(error.splitlines()) == 1
    assert not (tmp_path / "run").exists()


OFF = "[limits.uncertainty]\nspool_positions = 0.03\nmass_centre = 0.04\nmass_factor = 1.2\n"


def test_what_needs_another_orientation_or_pulleys_excludes_an_uncertainty(tmp_path):
    """Axes of orientations; pulleys, and pairs of cables, if their spools are uncertain."""
    text = SWEEP.format(robot="kntu-planar", conditions='["static"]', more=OFF)
    (tmp_path / "axes.toml").write_text(text.replace("[workspace]", "tilt = [0.1]\n[workspace]"))
    pulleys = PRISM.format(axes="x = [0]\ny = [0]\nz = [1]", more=OFF.replace("mass_centre = 0.04\n", ""))
    pulleys = pulleys.replace("mass = 1.0", "mass = 1.0\npulley_radius = 0.01")
    (tmp_path / "pulleys.toml").write_text(pulleys)
    for name, words in {"axes": "axes.tilt: cannot be combined", "pulleys": "spool_positions: must be 0"}.items():
        code, out, error = cspr("run", tmp_path / f"{name}.toml", "-o", tmp_path / "run")
        assert (code, out) == (2, "") and words in error and len(error.splitlines()) == 1
    (tmp_path / "pulleys.toml").write_text(pulleys.replace("spool_positions = 0.03\n", ""))
    assert cspr("run", tmp_path / "pulleys.toml", "-o", tmp_path / "run")[0] == 0


def test_a_map_of_all_robots_holds_for_other_robots_from_python(tmp_path):
    """Robots within the uncertainty, each asked alone."""
    code, out, error = swept(tmp_path, conditions='["wrench-feasible"]', more="prove = true\n" + OFF, finer=2)
    assert (code, error) == (0, "")
    rng, robot = np.random.default_rng(4), cspr_jax.load_robot("kntu-planar")
    places = grid(np.linspace(-1.5, 1.5, 13), [0.0], np.linspace(-1.2, 1.2, 9))
    with h5py.File(out.strip()) as file:
        verdict = file["verdict"][...].ravel()
    answers = cspr_jax.workspace(robot, places)
    is_more = (verdict == Verdict.UNCERTAINTY) | (verdict == Verdict.UNDECIDED)
    assert ((answers.verdict == 0) == ((verdict == 0) | is_more)).all()
    worst = np.full(len(places), np.inf)
    centre = np.zeros(3) if robot.centre_of_mass is None else np.asarray(robot.centre_of_mass)
    for _ in range(30):
        steps = rng.normal(size=(robot.n_cables + 1, 3)) * [1.0, 0.0, 1.0]
        steps /= np.linalg.norm(steps, axis=1, keepdims=True)
        other = dataclasses.replace(
            robot,
            base_points=np.asarray(robot.base_points) + 0.03 * steps[:-1],
            mass=float(robot.mass) * rng.choice([1.0 / 1.2, 1.0, 1.2]),
            centre_of_mass=centre + 0.04 * steps[-1],
        )
        # Tilted by nothing: the origin stays where it is.
        worst = np.minimum(worst, cspr_jax.workspace(other, places).margin)
    assert (worst[verdict == 0] > 0.0).all()


def test_all_masses_that_hang_below_a_square_of_spools_that_are_somewhere(tmp_path):
    """Two spools at most so much nearer to the middle are the worst; the volume says what the described robot has."""
    x = [0.0, 0.5, 0.9, 0.99, 1.05, 1.2]
    more = "prove = true\n" + OFF.replace("mass_centre = 0.04\n", "")
    found, path = volume_of(tmp_path, "square", f"x = {x}\ny = [-0.2, 0.3]\nz = [0.5, 0.7]", more)
    with h5py.File(path) as file:
        verdict, side = file["verdict"][...], file["cell_side"][...]
    wanted = [0, 0, 0, Verdict.UNCERTAINTY, Verdict.WRENCH_INFEASIBLE, Verdict.WRENCH_INFEASIBLE]
    assert (verdict == np.reshape(wanted, (6, 1, 1))).all()
    assert (side[0] == 1).all() and (side[5] == 2).all() and not side[2:4].any()
    code, said, _ = cspr("volume", path)
    width = 0.5 * (1.05 - 0.9)
    assert (
        found.uncertain == pytest.approx(width * 0.5 * 0.2) and f"{found.uncertain:.4g} m3 more" in said and code == 0
    )


def grid(*axes):
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
