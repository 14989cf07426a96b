"""Six cables in three parallel pairs: found or refused, moved as a point mass, with the tensions of all six."""

import csv
import json

import h5py
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.commands import cspr, plan, planned
from support.pairs import LAUNCH_BASE, LAUNCH_PLATFORM, made, random_pairs

import cspr_jax
from cspr_jax.build.robots import build_limits
from cspr_jax.config.catalogue import CATALOGUE
from cspr_jax.config.equivalents import as_moved, no_equivalent
from cspr_jax.config.keys.limits import LimitTable
from cspr_jax.config.robot import RobotFile, read_robot
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.robots.model.parallel_pairs import parallel_pairs
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics import force_balance, wrench_balance
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.map_kinds import MAP_KINDS

N = 32
PLAN = """schema = 1
robot = {robot}
family = "{family}"
z0 = 0.6
samples = 9
{limits}
[[pose]]
rest = true
[[pose]]
position = [0.15, 0.05, -0.6]
"""
SWEEP = """schema = 1
map = "{kind}"
robot = {robot}
[axes]
x = [-0.3, 0.2]
y = [0.1]
z = [-0.6]
"""


@jax.jit
def tensions_of_six(robot, positions, accelerations):
    """Of the whole wrench balance, and the normalised determinant."""

    def one(place, acceleration):
        zero, turn = jnp.zeros(3), jnp.eye(3)
        state = State(place, zero, acceleration, turn, zero, zero)
        return wrench_balance.tensions(robot, state), wrench_balance.normalised_determinant(robot, place, turn)

    return jax.vmap(one)(positions, accelerations)


TENSIONS_OF_THREE = jax.jit(jax.vmap(force_balance.tensions, in_axes=(None, 0, 0)))


def checked(given_robot, seed):
    """How many well-conditioned places and accelerations were compared; tensions of six from six and from three."""
    rng, robot = np.random.default_rng(seed), made(given_robot)
    positions = given_robot["exits"].mean(0) + rng.uniform([-1.5, -1.5, 0.3], [1.5, 1.5, 2.5], (N, 3))
    accelerations = 5.0 * rng.normal(size=(N, 3))
    wanted, determinant = (np.asarray(x) for x in tensions_of_six(robot, positions, accelerations))
    pairs = parallel_pairs(robot.base_points, robot.platform_points)
    of_pairs = np.asarray(TENSIONS_OF_THREE(cspr_jax.three_cable_equivalent(robot), positions, accelerations))
    good = np.abs(determinant) > 1e-2
    scale = np.abs(wanted).max(1, keepdims=True)
    np.testing.assert_allclose((pairs.tensions(of_pairs) / scale)[good], (wanted / scale)[good], rtol=0, atol=1e-9)
    return int(good.sum())


@settings(max_examples=12)
@given(st.integers(0, 2**20))
def test_tensions_of_six_are_shares_of_those_of_three(seed):
    """Any directions, any places of the mass centre, any order: the platform's own balance says the same."""
    robot = random_pairs(seed)
    pairs = parallel_pairs(robot["base"], robot["platform"] - robot["centre"])
    np.testing.assert_array_equal(np.sort(pairs.cables, axis=1)[:, 0], pairs.cables[:, 0])
    assert {frozenset(pair) for pair in pairs.cables.tolist()} == {frozenset(pair) for pair in robot["pairs"].tolist()}
    for k, (pair, place) in enumerate(zip(robot["pairs"], robot["places"], strict=True)):
        row = int(np.flatnonzero((pairs.cables == pair[0]).any(1))[0])
        np.testing.assert_allclose(pairs.exit_points[row], robot["exits"][k], atol=1e-12)
        np.testing.assert_allclose(pairs.fractions[row][pairs.cables[row] == pair[0]], 1.0 - place, atol=1e-12)
    checked(robot, seed)


def test_the_comparison_sees_most_places():
    assert sum(checked(random_pairs(seed), seed) for seed in range(4)) > 2 * N


def test_cables_of_a_pair_have_one_length():
    robot = random_pairs(3)
    equivalent = cspr_jax.three_cable_equivalent(made(robot))
    place = robot["exits"].mean(0) + np.array([0.4, -0.3, 1.2])
    lengths = np.linalg.norm(place + robot["platform"] - robot["centre"] - robot["base"], axis=1)
    pairs = parallel_pairs(robot["base"], robot["platform"] - robot["centre"])
    of_three = np.linalg.norm(place - equivalent.base_points, axis=1)
    np.testing.assert_allclose(lengths[pairs.cables], np.stack([of_three] * 2, 1), rtol=1e-12)


def test_the_launch_robot():
    """(30) and (31), in the catalogue and from Python."""
    robot = cspr_jax.load_robot("launch-robot")
    assert (robot.n_cables, robot.z_axis, float(robot.mass), float(robot.gravity)) == (6, "up", 1.0, 9.80665)
    own = cspr_jax.parallel_pair_robot(0.35, 0.09, mass=1.0, gravity=9.80665, z_axis="up")
    for one in (robot, own):
        np.testing.assert_allclose(one.base_points, LAUNCH_BASE, atol=1e-15)
        np.testing.assert_allclose(one.platform_points, LAUNCH_PLATFORM, atol=1e-15)
        np.testing.assert_allclose(one.inertia, 0.25 * 0.09**2 * np.diag([1.0, 1.0, 2.0]), rtol=1e-12)
    equivalent = cspr_jax.three_cable_equivalent(robot)
    middles = [LAUNCH_BASE[i : i + 2].mean(0) for i in (0, 2, 4)]
    np.testing.assert_allclose(equivalent.base_points, middles, atol=1e-15)
    assert (equivalent.z_axis, equivalent.name, equivalent.dof) == ("up", "launch-robot", 3)
    assert "placeholder" in read_robot(CATALOGUE / "launch-robot.toml").source
    assert next(row for row in cspr_jax.list_robots() if row["name"] == "launch-robot")["fault"] is None
    with pytest.raises(InputError, match="platform_radius"):
        cspr_jax.parallel_pair_robot(0.35, 0.0, mass=1.0)


def deviation(cable, by):
    base = LAUNCH_BASE.copy()
    base[cable] += by
    return base, LAUNCH_PLATFORM


def radial():
    """The lines between the spools of the pairs meet in one point."""
    angles = np.array([0.0, 2.0, 4.0]) * np.pi / 3.0
    rays = np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
    points = (np.array([[-0.1], [0.1]]) * rays[:, None]).reshape(6, 3)
    return np.repeat(rays, 2, axis=0) + points, points


WRONG = {
    "bent": (deviation(3, [0.0, 0.0, 1e-3]), "cables 3 and 4 are not parallel: base_points[2] - base_points[3] and "),
    "beside": ((LAUNCH_BASE, LAUNCH_PLATFORM + 0.01 * np.eye(3)[0]), "the mass centre lies 0.00866 m beside the"),
    "above": ((LAUNCH_BASE, LAUNCH_PLATFORM + 0.2 * np.eye(3)[2]), "the mass centre lies 0.2 m beside the line of"),
    "line": ((LAUNCH_BASE * [1, 0, 0] + LAUNCH_PLATFORM * [0, 1, 0], LAUNCH_PLATFORM), "points on one line"),
    "turning": (radial(), "the pairs let the platform turn"),
    "seven": ((np.vstack([LAUNCH_BASE, [0, 0, 1]]), np.vstack([LAUNCH_PLATFORM, [0, 0, 1]])), "7 cables"),
}


@pytest.mark.parametrize("name", WRONG)
def test_other_robots_are_refused_with_the_reason(name):
    (base, platform), reason = WRONG[name]
    with pytest.raises(InputError) as caught:
        parallel_pairs(base, platform)
    assert reason in str(caught.value) and "\n" not in str(caught.value)


def test_the_mass_centre_must_lie_between():
    robot = random_pairs(5)
    first, second = robot["pairs"][1]
    along = robot["platform"][second] - robot["platform"][first]
    change = np.zeros((6, 3))
    change[[first, second]] = along
    with pytest.raises(InputError, match="does not lie between platform_points"):
        parallel_pairs(robot["base"] + change, robot["platform"] - robot["centre"] + change)
    with pytest.raises(InputError, match="a vertical plane"):
        squeezed = robot["exits"] * [1.0, 1e-9, 1.0] - robot["exits"]
        change[robot["pairs"]] = squeezed[:, None]
        parallel_pairs(robot["base"] + change * (change != along), robot["platform"] - robot["centre"])


def inline(base, platform=None, **more) -> str:
    """A robot as an inline table."""
    keys = {"name": "launch-robot", "base_points": np.asarray(base).tolist(), "mass": 1.0, "gravity": 9.80665}
    keys |= {"z_axis": "up"} | more
    if platform is not None:
        keys |= {"platform_points": np.asarray(platform).tolist(), "inertia": (0.1 * np.eye(3)).tolist()}
    return "{ " + ", ".join(f"{key} = {json.dumps(value)}" for key, value in keys.items()) + " }"


def test_the_key_is_checked_when_the_file_is_read(tmp_path):
    """One line says why not; where the key is absent, the family asks."""
    wrong = inline(*deviation(3, [0.0, 1e-3, 0.0]), translation_only=True)
    code, _, err = plan(tmp_path, PLAN.format(robot=wrong, family="transition", limits=""))
    assert code == 2 and len(err.splitlines()) == 1
    assert "robot.translation_only = true: must be absent: cables 3 and 4 are not parallel" in err and "0.001 m" in err
    code, _, err = plan(tmp_path, PLAN.format(robot='"laval-mssm"', family="transition", limits=""))
    assert code == 2 and len(err.splitlines()) == 1
    families = ("hypocycloid-standard", "hypocycloid", "spline", "ellipse", "path", "free")
    names = " or ".join(f'"{name}"' for name in families)
    assert f'must be {names} for a platform ("laval-mssm")' in err
    assert "nor do three parallel pairs of cables keep it from turning: cables" in err
    (tmp_path / "sweep.toml").write_text(SWEEP.format(kind="feasible-acceleration", robot='"laval-mssm"'))
    code, _, err = cspr("run", tmp_path / "sweep.toml", "-o", tmp_path / "run")
    assert code == 2 and "must be a point mass in this map; nor do three parallel pairs" in err
    mass = inline(np.eye(3), translation_only=True)
    code, _, err = plan(tmp_path, PLAN.format(robot=mass, family="transition", limits=""))
    assert code == 2 and "translation_only = true: must be absent: it has no platform_points" in err


def test_what_moves_platforms_alone_refuses_it(tmp_path):
    code, _, err = plan(tmp_path, PLAN.format(robot='"launch-robot"', family="hypocycloid", limits=""))
    assert code == 2 and 'for a platform that only translates ("launch-robot")' in err
    text = SWEEP.format(kind="poses", robot='"launch-robot"') + 'z0 = [0.6]\n[trajectory]\nfamily = "hypocycloid"\n'
    (tmp_path / "sweep.toml").write_text(text)
    code, _, err = cspr("run", tmp_path / "sweep.toml", "-o", tmp_path / "run")
    assert code == 2 and '"launch-robot" is a platform that only translates: must be a platform' in err


def test_without_the_key_it_stays_a_platform_where_platforms_move():
    robot = read_robot(CATALOGUE / "launch-robot.toml")
    free = RobotFile(**{key: value for key, value in robot.model_dump().items() if key != "translation_only"})
    for name, family in FAMILIES.items():
        assert as_moved(robot, [family.legs]).dof == 3, name
        assert as_moved(free, [family.legs]).dof == (6 if "3R3T" in family.legs else 3), name
    assert as_moved(free, [FAMILIES["hypocycloid-standard"].legs, FAMILIES["transition"].legs]).dof == 3
    moved = as_moved(free, [("2T", "3T")])
    assert moved.name == "launch-robot" and moved.settings == robot.settings
    assert free.settings == {key: value for key, value in robot.settings.items() if key != "translation_only"}
    mssm = read_robot(CATALOGUE / "laval-mssm.toml")
    assert as_moved(mssm, [("2T", "3T")]) is mssm and "are not parallel" in no_equivalent(mssm)
    assert {kind.patterns for kind in MAP_KINDS.values()} == {(), ("3T",), ("2T", "3T"), ("3R3T",)}


THREE = inline([LAUNCH_BASE[i : i + 2].mean(0) for i in (0, 2, 4)])


@pytest.mark.parametrize("family", [pytest.param("transition", marks=pytest.mark.soak), "s-curve"])
def test_a_plan_is_that_of_the_equivalent(tmp_path, family):
    limits = "" if family == "transition" else "max_acceleration = 2.0"
    text = PLAN.replace("z0 = 0.6\n", "" if family == "s-curve" else "z0 = 0.6\n")
    text = text.replace("rest = true", "position = [0.0, 0.0, -0.6]") if family == "s-curve" else text
    found = planned(tmp_path, text.format(robot='"launch-robot"', family=family, limits=limits))
    wanted = planned(tmp_path, text.format(robot=THREE, family=family, limits=limits))
    assert found["robot"] == wanted["robot"] == "launch-robot" and found["feasible"]
    for name in ("duration", "margin", "tension_min", "tension_max"):
        np.testing.assert_allclose(found["segments"][0][name], wanted["segments"][0][name], rtol=1e-6)


@pytest.mark.thorough
def test_a_motion_file_has_the_tensions_of_all_six(tmp_path):
    """Those of the platform's own balance; of the three pairs beside them."""
    (tmp_path / "plan.toml").write_text(PLAN.format(robot='"launch-robot"', family="transition", limits=""))
    code, out, err = cspr("plan", tmp_path / "plan.toml", "-o", tmp_path / "m.h5")
    assert (code, err) == (0, "") and "tensions of the pairs of cables 1-2, 3-4, 5-6" in out
    assert cspr("plan", tmp_path / "plan.toml", "-o", tmp_path / "m.csv")[0] == 0
    with h5py.File(tmp_path / "m.h5") as file:
        data = {name: file[name][...] for name in ("position", "acceleration", "tension", "tension_each")}
        dims = [dim.label or next(iter(dim.keys())) for dim in file["tension_each"].dims]
        assert file["tension_each"].attrs["units"] == "N" and dims == ["t", "each"]
    assert data["tension"].shape == (9, 3) and data["tension_each"].shape == (9, 6)
    robot, signs = cspr_jax.load_robot("launch-robot"), np.array([1.0, -1.0, -1.0])
    down = made(
        {"base": robot.base_points * signs, "platform": robot.platform_points * signs, "centre": np.zeros(3)},
        mass=1.0,
        gravity=9.80665,
    )
    wanted, _ = tensions_of_six(down, data["position"] * signs, data["acceleration"] * signs)
    np.testing.assert_allclose(data["tension_each"], wanted, rtol=1e-9)
    rows = list(csv.DictReader(line for line in (tmp_path / "m.csv").read_text().splitlines() if line[0] != "#"))
    np.testing.assert_allclose([float(row["tension_each_4"]) for row in rows], data["tension_each"][:, 3], rtol=1e-12)
    assert cspr("verify", tmp_path / "m.h5")[0] == 0
    read = cspr_jax.open_result(tmp_path / "m.h5").to_xarray()
    assert read.tension_each.dims == ("t", "each") and "each" not in read.tension.dims


@pytest.mark.thorough
def test_its_pictures(tmp_path, figures):
    """The robot that the file keeps is moved as it was when it was planned."""
    assert plan(tmp_path, PLAN.format(robot='"launch-robot"', family="transition", limits=""), "-o", tmp_path / "m.h5")
    assert cspr("plot", tmp_path / "m.h5", "-o", tmp_path / "m.png")[0] == 0
    assert cspr("plot", tmp_path / "m.h5", "--quantity", "acceleration", "-o", tmp_path / "a.png")[0] == 0
    assert [text.get_text() for text in figures[0].axes[2].get_legend().get_texts()] == ["pair 1", "pair 2", "pair 3"]


def test_limits_of_six_cables_bound_the_pairs():
    """Each pair is held by the cable whose limit over its share is tighter; lengths and speeds by the smaller."""
    robot = random_pairs(8)
    pairs = parallel_pairs(robot["base"], robot["platform"] - robot["centre"])
    rng = np.random.default_rng(1)
    low, high, long = rng.uniform(0.1, 1.0, 6), rng.uniform(50.0, 90.0, 6), rng.uniform(5.0, 9.0, 6)
    limits = cspr_jax.Limits(tension_min=low, tension_max=high, cable_length_max=long, floor=np.asarray(4.0))
    found = cspr_jax.three_cable_equivalent(made(robot, limits=limits)).limits
    for k, pair in enumerate(pairs.cables):
        fraction = pairs.fractions[k]
        assert found.tension_min[k] == max(low[pair] / fraction) and found.tension_max[k] == min(high[pair] / fraction)
        assert found.cable_length_max[k] == min(long[pair])
    assert float(found.floor) == 4.0 and found.cable_speed_max is None
    # The same of a file: its own, and over them those of a plan; one number is each cable's.
    keys = {"name": "r", "base_points": robot["base"], "platform_points": robot["platform"], "mass": 1.7}
    keys |= {"inertia": 0.1 * np.eye(3), "centre_of_mass": robot["centre"], "tension_max": high, "tension_min": 0.2}
    plain = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in keys.items()}
    robot_file = RobotFile(**plain, translation_only=True).equivalent()
    of_file = build_limits(robot_file, LimitTable(cable_length_max=long.tolist(), floor=4.0), "plan")
    np.testing.assert_allclose(of_file.tension_max, found.tension_max, rtol=1e-12)
    np.testing.assert_allclose(of_file.cable_length_max, found.cable_length_max, rtol=1e-12)
    np.testing.assert_allclose(of_file.tension_min, 0.2 / pairs.fractions.min(1), rtol=1e-12)
    np.testing.assert_allclose(of_file.floor, 4.0 - robot["exits"].mean(0)[2], rtol=1e-12)
    with pytest.raises(ConfigError, match=r"tension_max = \[1.0, 2.0, 3.0\]: must be .* or 6: one a cable"):
        build_limits(robot_file, LimitTable(tension_max=[1.0, 2.0, 3.0]), "plan")
    high[pairs.cables[1, 0]] = 1.01 * low[pairs.cables[1, 0]]
    low[pairs.cables[1, 1]] = 40.0
    with pytest.raises(InputError, match="of the pair of cables"):
        cspr_jax.three_cable_equivalent(made(robot, limits=cspr_jax.Limits(tension_min=low, tension_max=high)))


@pytest.mark.parametrize("kind", ["feasible-acceleration", "least-time"])
def test_a_sweep_is_that_of_the_equivalent(tmp_path, kind):
    more = '[trajectory]\nfamily = "s-curve"\nmax_acceleration = 2.0\nfrom = { position = [0.0, 0.0, -0.7] }\n'
    files = []
    for name, robot in (("six", '"launch-robot"'), ("three", THREE)):
        (tmp_path / f"{name}.toml").write_text(SWEEP.format(kind=kind, robot=robot) + more * (kind == "least-time"))
        code, _, err = cspr("run", tmp_path / f"{name}.toml", "-o", tmp_path / name)
        assert (code, err) == (0, "")
        files.append(cspr_jax.open_result(tmp_path / name / f"{name}.h5"))
    for name, wanted in files[1].data.items():
        np.testing.assert_allclose(files[0].data[name], wanted, rtol=1e-9, atol=1e-12)
    assert files[0].attributes["base_points"].shape == (3, 3)
    settings_of = files[0].settings["robot"]
    assert len(settings_of["base_points"]) == 6 and settings_of["translation_only"] is True
    if kind == "least-time":
        with h5py.File(tmp_path / "six" / "six.h5") as file:
            assert file["active_up"].attrs["flag_meanings"] == "none cables_1_2 cables_1_3 cables_2_3 max_acceleration"
