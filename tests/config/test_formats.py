"""Robots of other programs: what is read of them, what is refused, and that nothing is expanded, fetched or run."""

import json
import re
import tomllib

import numpy as np
import pytest
import yaml
from scipy.optimize import nnls

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.config.formats.table import FORMATS
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError

BODIES = """<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE bodies_system SYSTEM "../../nowhere/bodies.dtd">
<bodies_system><links><link_rigid num="1" name="hub">
<joint type="{joint}" q_initial="0"/>
<physical><mass>{mass}</mass><com_location>{centre}</com_location><end_location>0 0 0</end_location>
<inertia ref="{ref}"><Ixx>{I[0]}</Ixx><Iyy>{I[1]}</Iyy><Izz>{I[2]}</Izz><Ixy>{I[3]}</Ixy>
<Ixz>{I[4]}</Ixz><Iyz>{I[5]}</Iyz>
</inertia></physical>
<parent><num>{parent}</num><location>{location}</location></parent></link_rigid>{more}</links></bodies_system>
"""
PLAIN = {
    "joint": "SPATIAL_EULER_XYZ",
    "mass": "2.5",
    "centre": "0.1 0.0 0.05",
    "ref": "com",
    "I": ("0.2", "0.3", "0.4", "0.01", "0.02", "-0.03"),
    "parent": "0",
    "location": "0 0 0",
    "more": "",
}
BASE = [[-3.0, -2, 4], [3, -2, 4.1], [3, 2, 4], [-3, 2, 4], [-3, -2, 0], [3, -2, 0], [3, 2.2, 0], [-3, 2, 0]]
ENDS = [[-0.3, -0.2, 0.1], [0.3, -0.2, 0.1], [0.3, 0.2, 0.1], [-0.3, 0.2, 0.1]]
ENDS += [[0.3, 0.2, -0.1], [-0.3, 0.2, -0.1], [-0.3, -0.2, -0.1], [0.3, -0.2, -0.1]]


def words(point):
    return " ".join(map(str, point))


def attachment(link, point):
    return f"<attachment><link>{link}</link><location>{words(point)}</location></attachment>"


def wheel(point, axis="0 0 1", radius="0.05"):
    return (
        f"<base_rotating_pulley><fixed_location>{words(point)}</fixed_location><pulley_radius>{radius}</pulley_radius>"
        f"<cable_entry_vector>{axis}</cable_entry_vector></base_rotating_pulley>"
    )


def cable(first, second, reference="joint", limits=(1, 500), name="c", tag="cable_ideal"):
    low, high = limits
    return (
        f'<{tag} name="{name}" attachment_reference="{reference}"><properties><force_min>{low}</force_min>'
        f"<force_max>{high}</force_max></properties><attachments>{first}{second}</attachments></{tag}>"
    )


def plain_cables(base=BASE, ends=ENDS, **more):
    return "".join(
        cable(attachment(0, a), attachment(1, b), name=f"c{k}", **more)
        for k, (a, b) in enumerate(zip(base, ends, strict=True))
    )


def caspr(folder, cables=None, sets="", default="main", doctype="", name="hub", **body):
    text = plain_cables() if cables is None else cables
    folder.mkdir(exist_ok=True)
    (folder / f"{name}_bodies.xml").write_text(BODIES.format(**(PLAIN | body)))
    head = '<?xml version="1.0"?>' + (doctype or '<!DOCTYPE cables SYSTEM "../cables.dtd">')
    text = f'{head}<cables default_cable_set="{default}"><cable_set id="main">{text}</cable_set>{sets}</cables>'
    (folder / f"{name}_cables.xml").write_text(text)
    return folder / f"{name}_cables.xml"


CDPYR = {
    "name": "eight",
    "frame": {"anchors": [{"position": a} for a in reversed(BASE)]},
    "platforms": [
        {
            "motion_pattern": {"translation": 3, "rotation": 3},
            "anchors": [{"position": b} for b in ENDS],
            "center_of_gravity": [0.1, 0.0, 0.05],
            "inertia": {"linear": np.diag([2.5] * 3).tolist(), "angular": np.diag([0.3, 0.4, 0.5]).tolist()},
        }
    ],
    "cables": [{"name": "rope", "diameter": 0.006}],
    "kinematic_chains": [{"frame_anchor": 7 - k, "platform_anchor": k, "cable": 0} for k in range(8)],
}
WIREX = """<?xml version="1.0"?><models version="0.31"><robot name="wires" motionpattern="{pattern}"><geometry>{chains}
</geometry><platform id="1" mass="2.5" motionpattern="{pattern}">
<inertiatensor Ixx="0.2" Iyy="0.3" Izz="0.4"/><centerofgravity x="0.1" y="0" z="0.05"/></platform></robot>
<cable id="1" name="rope" radius="0.003"/></models>
"""


def chain(base, end, radius=0.0, more="", platform=1):
    ends = ("".join(f'{key}="{x}" ' for key, x in zip("xyz", point, strict=True)) for point in (base, end))
    first, second = ends
    return (
        f'<chain id="1" platform_id="{platform}" cable_id="1"><base {first} radius="{radius}" {more}/>'
        f"<platform {second}/></chain>"
    )


def wirex(folder, chains=None, pattern="3R3T"):
    text = "".join(chain(a, b) for a, b in zip(BASE, ENDS, strict=True)) if chains is None else chains
    (folder / "robot.wcrfx").write_text(WIREX.format(chains=text, pattern=pattern))
    return folder / "robot.wcrfx"


def written(folder, kind, data=CDPYR):
    text = json.dumps(data) if kind == "json" else yaml.safe_dump(data)
    (folder / f"robot.{kind}").write_text(text)
    return folder / f"robot.{kind}"


@pytest.mark.parametrize("kind", ["caspr", "json", "yaml", "wcrfx"])
def test_a_platform_is_the_same_whatever_wrote_it(tmp_path, kind, capsys):
    """Geometry, mass and mass centre; what is written reads back to the same robot; plans and Python take the file."""
    path = caspr(tmp_path) if kind == "caspr" else wirex(tmp_path) if kind == "wcrfx" else written(tmp_path, kind)
    found = cspr_jax.import_robot(path)
    robot = found.robot
    assert (robot.pattern, robot.n_cables, robot.z_axis, float(robot.gravity)) == ("3R3T", 8, "up", 9.81)
    np.testing.assert_array_equal(robot.base_points, BASE)
    np.testing.assert_allclose(robot.platform_points, np.array(ENDS) - [0.1, 0.0, 0.05], atol=1e-15)
    np.testing.assert_array_equal(robot.centre_of_mass, [0.1, 0.0, 0.05])
    assert float(robot.mass) == 2.5 and found.warnings == ()
    assert main(["import", str(path), "-o", str(tmp_path / "out.toml")]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "out.toml")
    assert RobotFile(**tomllib.loads((tmp_path / "out.toml").read_text())) == RobotFile(**found.keys)
    for again in (cspr_jax.load_robot(tmp_path / "out.toml"), cspr_jax.load_robot(path)):
        for name in ("base_points", "platform_points", "inertia", "mass", "centre_of_mass"):
            np.testing.assert_array_equal(getattr(again, name), getattr(robot, name))
    assert main(["import", str(path)]) == 0
    assert capsys.readouterr().out == (tmp_path / "out.toml").read_text()
    plan = f'schema = 1\nrobot = "{path.name}"\nfamily = "s-curve"\nz0 = 1.0\n'
    plan += "[[pose]]\nrest = true\n[[pose]]\nposition = [0, 0, 1]\n"
    (tmp_path / "plan.toml").write_text(plan)
    assert main(["plan", str(tmp_path / "plan.toml")]) == 2
    wanted = (
        'must be "hypocycloid-standard" or "hypocycloid" or "spline" or "ellipse" or "path" or "free" for a platform'
    )
    assert f'{wanted} ("{found.keys["name"]}")' in capsys.readouterr().err


def test_caspr_bodies(tmp_path):
    """Tensions, inertia about joint or mass centre, points from either, pulleys, sets; the file of bodies will do."""
    path = caspr(tmp_path)
    robot = cspr_jax.import_robot(tmp_path / "hub_bodies.xml").robot
    np.testing.assert_array_equal(robot.inertia, [[0.2, 0.01, 0.02], [0.01, 0.3, -0.03], [0.02, -0.03, 0.4]])
    assert np.asarray(robot.limits.tension_max).tolist() == [500.0] * 8
    arm, mass = np.array([0.1, 0.0, 0.05]), 2.5
    moved = np.asarray(robot.inertia) + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    parts = tuple(str(moved[a, b]) for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    np.testing.assert_allclose(
        cspr_jax.import_robot(caspr(tmp_path, ref="joint", I=parts)).robot.inertia, robot.inertia, atol=1e-14
    )
    other = cspr_jax.import_robot(caspr(tmp_path, plain_cables(reference="com"))).robot
    np.testing.assert_allclose(other.platform_points, ENDS, atol=1e-15)
    some = wheel(BASE[0]), *(attachment(0, a) for a in BASE[1:])
    text = "".join(
        cable(a, attachment(1, b), limits=(0, "inf" if k else 9e9))
        for k, (a, b) in enumerate(zip(some, ENDS, strict=True))
    )
    text = text.replace("<force_max>inf", "<force_max>80", 1)
    sets = f'<cable_set id="other">{text}</cable_set>'
    path = caspr(tmp_path, sets=sets)
    assert cspr_jax.import_robot(path).robot.pulleys is None
    for found in (cspr_jax.import_robot(path, "other").robot, cspr_jax.load_robot(f"{path}#other")):
        assert np.asarray(found.pulleys.radius).tolist() == [0.05] + [0.0] * 7
        assert np.asarray(found.limits.tension_max).tolist() == [np.inf, 80.0] + [np.inf] * 6


@pytest.mark.parametrize(
    ("joint", "turn"), [("PLANAR_XZ", [0, 1, 2]), ("PLANAR_XY", [0, 2, 1]), ("PLANAR_YZ", [1, 0, 2])]
)
def test_caspr_planar_robots_come_into_the_plane_of_x_and_z(tmp_path, joint, turn):
    """Their moments stay; in a level plane there is no weight."""
    base, ends = np.array(BASE[:4]) * [1, 0, 1] + [[0, 0, k] for k in range(4)], np.array(ENDS[:4]) * [1, 0, 1]
    away = np.eye(3)[1] * 0.7  # along the normal, with its joint
    place = words((np.array(away))[turn])
    text = plain_cables((base + away)[:, turn].tolist(), ends[:, turn].tolist())
    diagonal = np.array([0.2, 0.35, 0.4])[turn]
    tensor = (*map(str, diagonal), "0", "0", "0")
    robot = cspr_jax.import_robot(caspr(tmp_path, text, joint=joint, centre="0 0 0", location=place, I=tensor)).robot
    assert robot.pattern == "1R2T" and float(robot.inertia[1, 1]) == 0.35
    np.testing.assert_allclose(robot.base_points, base, atol=1e-15)
    np.testing.assert_allclose(robot.platform_points, ends, atol=1e-15)
    assert float(robot.gravity) == (1e-9 if joint == "PLANAR_XY" else 9.81)


def test_caspr_points_rods_and_joints(tmp_path):
    """A body that only translates is a point mass; one that turns about a joint has that at the origin."""
    ends = [[0.1, 0.0, 0.2]] * 8
    robot = cspr_jax.import_robot(caspr(tmp_path, plain_cables(ends=ENDS), joint="T_XYZ")).robot
    assert robot.pattern == "3T"
    np.testing.assert_allclose(robot.base_points, np.array(BASE) - ENDS, atol=1e-15)
    robot = cspr_jax.import_robot(caspr(tmp_path, joint="S_EULER_XYZ", location="0.5 0.25 1")).robot
    assert robot.pattern == "3R"
    np.testing.assert_allclose(robot.base_points, np.array(BASE) - [0.5, 0.25, 1.0], atol=1e-15)
    np.testing.assert_array_equal(robot.platform_points, ENDS)
    np.testing.assert_array_equal(robot.centre_of_mass, [0.1, 0.0, 0.05])
    line = (np.linspace(-1.0, 1.0, 8)[:, None] * [0.1, 0.2, 0.3]).tolist()
    found = cspr_jax.import_robot(caspr(tmp_path, plain_cables(ends=line), centre="0 0 0"))
    assert found.robot.pattern == "2R3T" and "on one line" in found.warnings[0]
    found = cspr_jax.import_robot(caspr(tmp_path, plain_cables(ends=ends), centre="0.1 0 0.2"))
    assert found.robot.pattern == "3T" and "a point mass" in found.warnings[0]


def test_what_is_missing_is_marked(tmp_path):
    zero = ("0",) * 6
    found = cspr_jax.import_robot(caspr(tmp_path, mass="0", I=zero, centre="0 0 0"))
    assert found.keys["source"].startswith("placeholder mass of 1 kg; placeholder inertia of a uniform sphere")
    radius = np.linalg.norm(ENDS[0])
    np.testing.assert_allclose(found.robot.inertia, 0.4 * radius**2 * np.eye(3), rtol=1e-12)
    found = cspr_jax.import_robot(caspr(tmp_path, I=("1", "1", "9", "0", "0", "0")))
    assert "no real body" in found.warnings[0] and found.keys["source"].startswith("placeholder inertia")
    springs = plain_cables(tag="cable_linear_spring")
    assert cspr_jax.import_robot(caspr(tmp_path, springs)).warnings == (
        "cables are taken as rigid: cable_linear_spring",
    )


BOMB = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10 if k else "ha" * 10}">' for k in range(12))
SECRET = '<!DOCTYPE cables [<!ENTITY leak SYSTEM "file:///etc/hostname">]>'


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"doctype": f"<!DOCTYPE cables [{BOMB}]>", "default": "&e11;"}, "declares XML entities: must be without"),
        ({"doctype": SECRET, "default": "&leak;"}, "declares XML entities: must be without"),
        ({"doctype": '<!DOCTYPE cables [<!ENTITY % p SYSTEM "http://localhost:9/p"> %p;]>'}, "declares XML entities"),
        ({"doctype": "<cables", "default": "x"}, "is not XML"),
        ({"default": "gone"}, 'default_cable_set = "gone": must be "main"'),
        ({"joint": "R_X"}, 'joint.type = "R_X": must be "SPATIAL_EULER_XYZ"'),
        ({"more": "<link_rigid/>"}, "links: 2 links: must be one"),
        ({"parent": "1"}, "parent.num: must be 0, the base"),
        ({"mass": "nan"}, 'physical.mass = "nan": must be a finite number'),
        ({"mass": "heavy"}, 'physical.mass = "heavy": must be a finite number'),
        ({"mass": "-1"}, "physical.mass = -1: must be a number >= 0"),
        ({"centre": "0 0"}, 'physical.com_location = "0 0": must be three numbers'),
        ({"centre": "0 0 inf"}, 'physical.com_location = "inf": must be a finite number'),
        ({"ref": "end"}, 'inertia.ref = "end": must be "com" or "joint"'),
        ({"cables": ""}, "no cables: must be one or more"),
        ({"cables": plain_cables(BASE[:5], ENDS[:5])}, "base_points = 5 points: must be at least 6"),
        (
            {"cables": plain_cables().replace("<link>1", "<link>2", 1)},
            'cable 1 ("c0"): attachments on links 0, 2: must be one',
        ),
        (
            {"cables": plain_cables() + cable(attachment(0, BASE[0]), "")},
            "attachments on links 0: must be one attachment",
        ),
        (
            {"cables": plain_cables().replace("joint", "end", 1)},
            '.attachment_reference = "end": must be "com" or "joint"',
        ),
        ({"cables": plain_cables(limits=("nan", 5))}, 'cable 1 ("c0").force_min = "nan": must be a finite number'),
        ({"cables": plain_cables(limits=(5, 5))}, "tension_min = [5"),
        ({"cables": plain_cables(tag="rope")}, "<rope>: must be a cable, such as <cable_ideal>"),
        (
            {"cables": cable(wheel(BASE[0]).replace("base_rot", "screw_base_rot"), attachment(1, ENDS[0]))},
            "<screw_base_rotating_pulley>: must be one attachment on link 0, or a <base_rotating_pulley>",
        ),
        ({"joint": "PLANAR_XZ"}, 'cable 1 ("c0") leaves the plane of a planar robot: must lie in it'),
        ({"name": "", "cables": None}, "must be named NAME_bodies.xml or NAME_cables.xml"),
    ],
)
def test_caspr_files_that_are_refused(tmp_path, change, line, capsys):
    """One line that names the file; exit code 2; nothing is written."""
    path = caspr(tmp_path / "model", **change)
    assert main(["import", str(path), "-o", str(tmp_path / "out.toml")]) == 2
    err = capsys.readouterr().err
    assert line in err and err.count("\n") == 1 and str(tmp_path / "model") in err and len(err) < 800, err
    assert not (tmp_path / "out.toml").exists()


def test_files_that_are_none(tmp_path, capsys):
    path = caspr(tmp_path)
    cases = [
        (["--set", "mian"], path, '--set = "mian": did you mean main? must be "main"'),
        ([], tmp_path / "gone_cables.xml", "gone_cables.xml: no such file"),
        ([], tmp_path / "robot.urdf", "must end in .xml, .json, .yaml, .yml, .wcrfx"),
        (["--set", "a"], written(tmp_path, "json"), '--set = "a": must be absent: only models of CASPR'),
        (["-o", "robot.xml"], path, "-o: robot.xml: must end in .toml"),
    ]
    (tmp_path / "alone_cables.xml").write_text(path.read_text())
    cases.append(([], tmp_path / "alone_cables.xml", "no such file beside it: alone_bodies.xml"))
    (tmp_path / "HUB_cables.xml").write_text(path.read_text())
    words = f"no such file beside it: HUB_bodies.xml: {tmp_path / 'hub_bodies.xml'} is there, which differs in capitals"
    cases.append(([], tmp_path / "HUB_cables.xml", words))
    words = f"no such file: {tmp_path / 'hub_bodies.xml'} is there, which differs in capitals"
    cases.append(([], tmp_path / "Hub_bodies.xml", words))
    (tmp_path / "big.json").write_text(" " * (1 << 20) + "{}")
    cases.append(([], tmp_path / "big.json", "must be at most 1048576"))
    for more, file, line in cases:
        assert main(["import", str(file), *more]) == 2
        err = capsys.readouterr().err
        assert line in err and err.count("\n") == 1, err
    with pytest.raises(ConfigError, match="no such file: must be a catalogue name"):
        cspr_jax.load_robot(tmp_path / "gone.json")
    assert {row.name for row in FORMATS} == {"CASPR", "cdpyr", "WireX"}


def changed(**more):
    return CDPYR | more


PLATFORM = CDPYR["platforms"][0]


@pytest.mark.parametrize(
    ("data", "line"),
    [
        ([1, 2], "the file = [1, 2]: must be a table"),
        ({}, "platforms is missing: a robot of cdpyr has it"),
        (changed(platforms=[PLATFORM] * 2), "platforms: 2 platforms: must be one"),
        (changed(platforms=[PLATFORM | {"motion_pattern": "4R"}]), 'platforms[0].motion_pattern = "4R": must be "1T"'),
        (changed(platforms=[PLATFORM | {"motion_pattern": {"rotation": [1]}}]), "platforms[0].motion_pattern"),
        (changed(frame={"anchors": "x"}), "frame.anchors: must be a list of 1 to 1000 tables"),
        (
            changed(frame={"anchors": [{"position": [1, 2]}] * 8}),
            "frame.anchors[7].position = [1, 2]: must be 3 finite",
        ),
        (changed(frame={"anchors": [{"position": [1, 2, float("nan")]}] * 8}), "must be 3 finite numbers"),
        (changed(frame={"anchors": [{"position": [1, 2, float("inf")]}] * 8}), "must be 3 finite numbers"),
        (
            changed(kinematic_chains=[{"frame_anchor": 8, "platform_anchor": 0}]),
            "frame_anchor = 8: must be a number from 0 to 7",
        ),
        (changed(kinematic_chains=[{"frame_anchor": True, "platform_anchor": 0}]), "frame_anchor = true: must be"),
        (
            changed(kinematic_chains=[{"frame_anchor": 0, "platform_anchor": 0}]),
            "base_points = 1 points: must be at least 6",
        ),
        (changed(cables=[{"diameter": "thick"}]), 'cables[0].diameter = "thick": must be a finite number'),
    ],
)
@pytest.mark.parametrize("kind", ["json", "yaml"])
def test_cdpyr_files_that_are_refused(tmp_path, kind, data, line, capsys):
    assert main(["import", str(written(tmp_path, kind, data))]) == 2
    err = capsys.readouterr().err
    assert line in err and err.count("\n") == 1 and len(err) < 800, err


MERGES = f"a: &a {{{', '.join(f'k{k}: 1' for k in range(2000))}}}\nb:\n  <<: [{', '.join(['*a'] * 2000)}]\n"


def test_yaml_runs_nothing_and_expands_nothing(tmp_path, capsys):
    bomb = "a: &a [x, x, x]\n" + "".join(
        f"{chr(98 + k)}: &{chr(98 + k)} [{', '.join(['*' + chr(97 + k)] * 9)}]\n" for k in range(9)
    )
    for text, line in (
        (bomb, "stand for more than 1000000 values"),
        ("a: &a [*a]", "or for themselves"),
        (f"!!python/object/apply:os.system ['touch {tmp_path}/ran']", "is not YAML: "),
        ("[" * 5000, "nested too deeply"),
        ("a: [1", "is not YAML: "),
        ("a: !!int ''", "is not YAML: "),
        ("a: !!bool x", "is not YAML: "),
        ("a: !!timestamp x", "is not YAML: "),
        (f"a: {':'.join('1' * 400)}.5", "is not YAML: int too large"),
        (f"a: {':'.join('1' * 10000)}", "is not YAML: a value of 19999 characters: must be at most 10000"),
        ("[" + "1," * (3 << 17) + "]", "parts"),
        (MERGES, "its mappings have too many keys"),
        ("a: &a x\n<<: [1]", "is not YAML: "),
        ("\n".join(f"{(2**61 - 1) * k}: 1" for k in range(2000)), "its mappings have too many keys"),
        ("? [a]\n: 1", "is not YAML: "),
        ("\x00", "is not YAML: "),
        ("", "the file = "),
    ):
        (tmp_path / "robot.yaml").write_text(text)
        assert main(["import", str(tmp_path / "robot.yaml")]) == 2
        err = capsys.readouterr().err
        assert line in err and err.count("\n") == 1 and len(err) < 800, err
    (tmp_path / "robot.json").write_text("[" * 100000)
    assert main(["import", str(tmp_path / "robot.json")]) == 2
    assert not (tmp_path / "ran").exists()


def test_cdpyr_patterns(tmp_path):
    """In a plane x and y, with y up; on a line x. A point counts by its force alone."""
    flat = (np.array(BASE[:4]) * [1, 0, 0] + [[0, 2.0 * k, 0] for k in range(4)]).tolist()
    for pattern, (rotation, translation) in {"1R2T": (1, 2), "2T": (0, 2), "1T": (0, 1)}.items():
        ends = [{"position": [x, y, 0.0]} for x, y, _ in ENDS[:4]]
        data = changed(
            frame={"anchors": [{"position": a, "pulley": {"radius": 0.1}} for a in flat]},
            platforms=[{"motion_pattern": {"translation": translation, "rotation": rotation}, "anchors": ends}],
            kinematic_chains=[{"frame_anchor": k, "platform_anchor": k, "cable": 0} for k in range(4)],
        )
        found = cspr_jax.import_robot(written(tmp_path, "json", data))
        assert found.robot.pattern == pattern and float(found.robot.cable_diameter) == 0.006
        base, arms = np.array(flat), np.array([end["position"] for end in ends])
        if pattern == "1T":
            np.testing.assert_allclose(found.robot.base_points[:, 2], (base - arms)[:, 0], atol=1e-15)
            assert found.robot.pulleys is not None
            continue
        shift = arms if pattern == "2T" else 0.0
        np.testing.assert_allclose(found.robot.base_points, (base - shift)[:, [0, 2, 1]], atol=1e-15)
        assert found.robot.pulleys is None and "pulleys that swivel out of its plane are left out" in found.warnings
        assert "placeholder mass of 1 kg" in found.keys["source"]


def test_pulleys_of_cdpyr_and_wirex(tmp_path):
    """They swivel about the z axis of their anchor; diameters are twice the radius in WireX."""
    turn = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    anchors = [{"position": a, "dcm": turn, "pulley": {"radius": 0.1, "dcm": turn}} for a in reversed(BASE)]
    first = cspr_jax.import_robot(written(tmp_path, "json", changed(frame={"anchors": anchors}))).robot
    np.testing.assert_allclose(first.pulleys.axes, [[0.0, 0.0, -1.0]] * 8, atol=1e-15)
    text = "".join(chain(a, b, 0.1, 'a13="0" a23="-1" a33="0"') for a, b in zip(BASE, ENDS, strict=True))
    second = cspr_jax.import_robot(wirex(tmp_path, text)).robot
    np.testing.assert_allclose(second.pulleys.axes, [[0.0, -1.0, 0.0]] * 8, atol=1e-15)
    assert float(second.cable_diameter) == 0.006 and np.asarray(second.pulleys.radius).tolist() == [0.1] * 8


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"chains": ""}, "geometry: 0 chains to 0 platforms: must be one platform"),
        ({"chains": chain(BASE[0], ENDS[0]) + chain(BASE[1], ENDS[1], platform=2)}, "2 chains to 2 platforms"),
        ({"pattern": "9T"}, 'motionpattern = "9T": must be "1T"'),
        ({"chains": chain(["x", 0, 0], ENDS[0])}, 'chain 1.base.x = "x": must be a finite number'),
        ({"chains": "<chain/>"}, "chain 1: 0 elements <base>: must be one"),
    ],
)
def test_wirex_files_that_are_refused(tmp_path, given, line, capsys):
    assert main(["import", str(wirex(tmp_path, **given))]) == 2
    err = capsys.readouterr().err
    assert line in err and err.count("\n") == 1, err


def defaults(folder, mass="25.000000", centre=("0.000000", "1.000000", "0.200000"), tensor='Ixx="14"', version="0.31"):
    """A file as the library of WireX writes it."""
    text = wirex(folder).read_text().replace('version="0.31"', f'version="{version}"').replace('"2.5"', f'"{mass}"')
    text = text.replace('Ixx="0.2" Iyy="0.3" Izz="0.4"', tensor)
    x, y, z = centre
    text = text.replace('x="0.1" y="0" z="0.05"', f'x="{x}" y="{y}" z="{z}"')
    (folder / "robot.wcrfx").write_text(text)
    return folder / "robot.wcrfx"


TENSOR = 'Ixx="2.000000" Ixy="0.000000" Iyy="3.000000" Izz="4.000000"'


@pytest.mark.parametrize(("version", "tensor"), [("0.31", 'Ixx="14"'), ("0.32", TENSOR)])
def test_wirex_defaults_are_placeholders(tmp_path, version, tensor):
    """Its library writes these into every file: its own tensors, mass and mass centre; other values are read."""
    found = cspr_jax.import_robot(defaults(tmp_path, tensor=tensor, version=version))
    mean = np.mean(ENDS, axis=0)
    np.testing.assert_allclose(found.robot.centre_of_mass, mean, atol=1e-9)
    radius = np.linalg.norm(np.array(ENDS) - mean, axis=1).max()
    np.testing.assert_allclose(found.robot.inertia, 0.4 * 25.0 * radius**2 * np.eye(3), rtol=1e-8)
    assert float(found.robot.mass) == 25.0
    words = "placeholder mass of 25 kg; placeholder mass centre at the mean of the platform's points; placeholder inert"
    assert found.keys["source"].startswith(words)
    (line,) = found.warnings
    assert line.endswith("default of WireX: the mass of 25 kg, the mass centre [0.0, 1.0, 0.2], the inertia tensor")
    found = cspr_jax.import_robot(defaults(tmp_path, mass="130", tensor=tensor, version=version))
    assert float(found.robot.mass) == 130.0 and found.keys["source"].startswith("placeholder mass centre")
    found = cspr_jax.import_robot(defaults(tmp_path, centre=("0", "0", "0.02"), tensor=tensor, version=version))
    np.testing.assert_array_equal(found.robot.centre_of_mass, [0.0, 0.0, 0.02])
    assert found.keys["source"].startswith("placeholder mass of 25 kg; placeholder inertia")
    own = 'Ixx="0.2" Iyy="0.3" Izz="0.4"'
    found = cspr_jax.import_robot(defaults(tmp_path, centre=("0", "0", "0.02"), tensor=own, version=version))
    assert found.warnings == () and found.keys["source"] == "WireX robot robot.wcrfx"
    np.testing.assert_allclose(found.robot.inertia, np.diag([0.2, 0.3, 0.4]), atol=1e-15)


def test_wirex_points_have_no_placeholders_of_bodies(tmp_path):
    path = defaults(tmp_path)
    path.write_text(path.read_text().replace("3R3T", "3T"))
    found = cspr_jax.import_robot(path)
    assert found.keys["source"] == "placeholder mass of 25 kg; WireX robot robot.wcrfx"


def loaded(folder, *applications, place="</robot>", more=""):
    text = "".join(f'<application name="a" {keys}/>' for keys in applications)
    path = wirex(folder)
    path.write_text(path.read_text().replace(place, text + place).replace('radius="0.003"', f'radius="0.003" {more}'))
    return path


def test_wirex_loads_are_limits(tmp_path, capsys):
    """Wherever the application stands; of several all hold; zero is a largest load that is not known."""
    both = 'min_cable_load="40.000000" max_cable_load="1000.000000"'
    for place in ("</robot>", "</models>"):
        keys = cspr_jax.import_robot(loaded(tmp_path, both, place=place)).keys
        assert (keys["tension_min"], keys["tension_max"]) == (40.0, 1000.0)
    keys = cspr_jax.import_robot(loaded(tmp_path, both, 'min_cable_load="50" max_cable_load="700"')).keys
    assert (keys["tension_min"], keys["tension_max"]) == (50.0, 700.0)
    keys = cspr_jax.import_robot(loaded(tmp_path, 'min_cable_load="0" max_cable_load="0.000000"')).keys
    assert "tension_min" not in keys and "tension_max" not in keys
    assert cspr_jax.import_robot(loaded(tmp_path, more='minimum_load="3"')).keys["tension_min"] == 3.0
    for keys, line in (
        ('min_cable_load="-1"', 'application.min_cable_load = "-1": must be a number >= 0'),
        ('max_cable_load="much"', 'application.max_cable_load = "much": must be a finite number'),
        ('min_cable_load="50" max_cable_load="40"', "tension_min = "),
    ):
        assert main(["import", str(loaded(tmp_path, keys))]) == 2
        err = capsys.readouterr().err
        assert line in err and err.count("\n") == 1, err
    assert cspr_jax.import_robot(defaults(tmp_path, mass="3", version="0.4")).warnings[0].startswith('version = "0.4"')


COGIRO = (  # base and platform points, as the file of WireX has them, m
    ([-7.175, -5.244, 5.462], [0.503, -0.493, 0.0]),
    ([-7.316, -5.103, 5.472], [-0.51, 0.351, 0.998]),
    ([-7.303, 5.236, 5.476], [-0.503, -0.27, 0.0]),
    ([-7.161, 5.373, 5.485], [0.496, 0.356, 1.0]),
    ([7.182, 5.348, 5.488], [-0.503, 0.493, 0.0]),
    ([7.323, 5.206, 5.499], [0.5, -0.34, 0.999]),
    ([7.302, -5.133, 5.489], [0.502, 0.275, 0.0]),
    ([7.161, -5.27, 5.497], [-0.505, -0.346, 0.998]),
)


def test_static_workspace_of_wirex_cogiro(tmp_path):
    """All of 12 x 8 x 3 m, by least squares with tensions >= 0; with the library's mass centre less than a half."""
    path = defaults(tmp_path)
    chains = "".join(chain(base, end) for base, end in COGIRO)
    path.write_text(re.sub("<geometry>.*</geometry>", f"<geometry>{chains}</geometry>", path.read_text(), flags=re.S))
    robot = cspr_jax.import_robot(path).keys
    base, ends = np.array(robot["base_points"]), np.array(robot["platform_points"])
    grid = np.stack(np.meshgrid(np.arange(-5.5, 6), np.arange(-3.5, 4), np.arange(1.5, 4), indexing="ij"), -1)

    def held(place, centre):
        along = base - place - ends
        along /= np.linalg.norm(along, axis=1)[:, None]
        wrenches = np.vstack([along.T, np.cross(ends - centre, along).T])
        return nnls(wrenches, [0.0, 0.0, 25.0 * 9.81, 0.0, 0.0, 0.0])[1] < 1e-6

    places = grid.reshape(-1, 3)  # cells of 1 m^3
    assert sum(held(place, robot["centre_of_mass"]) for place in places) == 288
    assert sum(held(place, [0.0, 1.0, 0.2]) for place in places) < 130


def encoded(folder, encoding, declared=None):
    """A model of CASPR with a name that is not ASCII."""
    for name in ("bodies", "cables"):
        path = folder / f"hub_{name}.xml"
        text = path.read_text().replace("c0", "Stra\xdfe \xfc").partition("?>")[2].lstrip()
        head = f'<?xml version="1.0" encoding="{declared or encoding}"?>' if declared != "" else ""
        path.write_bytes((head + text).encode(encoding, "xmlcharrefreplace" if encoding == "ascii" else "strict"))
    return folder / "hub_cables.xml"


@pytest.mark.parametrize(
    ("encoding", "declared"),
    [
        *((name, None) for name in ("utf-8", "ISO-8859-1", "iso-8859-15", "windows-1252", "cp1252", "UTF-16", "ascii")),
        *(("utf-16", "utf-8"), ("utf-16", ""), ("utf-16-le", ""), ("utf-16-be", ""), ("utf-16-le", None)),
        *(("utf-8-sig", ""), ("utf-8-sig", "UTF-8"), ("utf-8-sig", "ISO-8859-1")),
    ],
)
def test_xml_in_its_declared_encoding(tmp_path, encoding, declared):
    """What a mark at the start says outweighs the declaration, as Windows often writes another one."""
    caspr(tmp_path)
    found = cspr_jax.import_robot(encoded(tmp_path, encoding, declared))
    assert "# cables: Stra\xdfe \xfc, c1" in found.to_toml() and found.warnings == ()


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (b'<?xml version="1.0" encoding="nonsense"?><cables/>', 'encoding = "nonsense": must be UTF-8, UTF-16, or'),
        (b'<?xml version="1.0" encoding="shift_jis"?><cables/>', 'encoding = "shift_jis": must be UTF-8, UTF-16, or'),
        (b'<?xml version="1.0" encoding="idna"?><cables/>', 'encoding = "idna": must be UTF-8, UTF-16, or'),
        (b'<?xml version="1.0" encoding="hex"?><cables/>', 'encoding = "hex": must be UTF-8, UTF-16, or'),
        (b'<?xml version="1.0" encoding="' + b"x" * 99999 + b'"?><cables/>', 'encoding = "xxx'),
        (b'<?xml version="1.0" encoding="UTF-16"?><cables/>', "is not XML: "),
        (b'<?xml version="1.0" encoding="UTF-8"?>\n<cables a="\xfc"/>', "is not UTF-8 text: byte 0xFC in line 2"),
        (b'<cables a="\xfc"/>', "is not UTF-8 text: byte 0xFC in line 1"),
        (b'<?xml version="1.0" encoding="us-ascii"?><cables a="\xfc"/>', "is not XML: "),
        (b'<?xml version="1.0" encoding="cp1252"?><cables a="\x81"/>', "is not XML: "),
        ("<cables/>".encode("utf-32"), "is not XML: "),
        (b"\xff\xfe<\0a\0", "is not XML: "),
        (b"", "is not XML: "),
        ("<cables n=\u201cx\u201d/>".encode(), 'did you mean " in place of U+201C'),
        (f"<!DOCTYPE cables [{BOMB}]><cables>&e11;</cables>".encode("utf-16"), "declares XML entities"),
        (f'<?xml version="1.0" encoding="latin1"?>{SECRET}<cables>&leak;</cables>'.encode(), "declares XML entities"),
    ],
)
def test_xml_in_hostile_encodings(tmp_path, data, line, capsys):
    path = caspr(tmp_path)
    path.write_bytes(data)
    assert main(["import", str(path)]) == 2
    err = capsys.readouterr().err
    assert line in err and err.count("\n") == 1 and len(err) < 500, err


@pytest.mark.parametrize("kind", ["json", "yaml"])
def test_marks_and_look_alikes_in_json_and_yaml(tmp_path, kind, capsys):
    path = written(tmp_path, kind)
    plain, text = cspr_jax.import_robot(path).keys, path.read_text()
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert cspr_jax.import_robot(path).keys == plain
    cases = [(text.encode("utf-16"), "is UTF-16 text: save it as UTF-8")]
    if kind == "json":
        cases.append((text.replace('"name"', "\u201cname\u201d").encode(), 'did you mean " in place of U+201C'))
        cases.append((text.replace("-3.0", "\u22123.0").encode(), "did you mean - in place of U+2212"))
    else:
        cases.append((text.replace("-3.0", "\u22123.0").encode(), "finite numbers: did you mean - in place of U+2212"))
        cases.append((text.replace("frame_anchor: 7", "frame_anchor: \u22127").encode(), "did you mean - in place of"))
    for data, line in cases:
        path.write_bytes(data)
        assert main(["import", str(path)]) == 2
        err = capsys.readouterr().err
        assert line in err and err.count("\n") == 1, err


def test_look_alikes_in_numbers_of_xml(tmp_path, capsys):
    path = caspr(tmp_path, plain_cables(base=[["\u22123", -2, 4], *BASE[1:]]))
    assert main(["import", str(path)]) == 2
    err = capsys.readouterr().err
    assert 'location = "\u22123": must be a finite number: did you mean - in place of U+2212, minus sign?' in err
