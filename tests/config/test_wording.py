"""What the program says of a mistake: in the user's words and numbers, with what to change. Nothing here needs jax."""

import math
import pickle
import re

import pytest
from support.texts import PLAN, SWEEP

from cspr_jax.config import hints, wording
from cspr_jax.config.plan import PlanFile, read_plan
from cspr_jax.config.reading import checked, read_text
from cspr_jax.config.robot import RobotFile, read_robot, resolve_robot
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.errors.suggestions import nearest
from cspr_jax.sweep.definition import read_sweep

SPOOLS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
RING = [[math.cos(angle), math.sin(angle), 0.0] for angle in range(6)]
HEXAGON = [[math.cos(k * math.pi / 3.0), math.sin(k * math.pi / 3.0), 0.0] for k in range(6)]
BODY = {"platform_points": RING, "inertia": [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]}
ROBOT = 'name = "mine"\nmass = 2.5\nbase_points = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n'
# Words of the library that checks files, and of Python.
FOREIGN = re.compile(r"\bvalid\b|Input|instance|dictionary|should|boolean|tuple|pydantic|~|datetime|None|True|False")


def robot(**keys):
    """A robot file's content."""
    return {"name": "r", "mass": 1.0, "base_points": SPOOLS} | keys


def line_of(model, data) -> str:
    """The one line that a mistake gives."""
    with pytest.raises(ConfigError) as caught:
        checked(model, data, "in.toml")
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value).removeprefix("in.toml: ")


SUPPORTED = ("2 (planar = true)", "3 (a point mass)", "6 (a rigid platform, with platform_points and inertia)")


@pytest.mark.parametrize(
    ("count", "more"),
    [(0, {}), (1, {}), (2, {}), (0, {"planar": True}), (1, {"planar": True}), (0, BODY), (3, BODY), (5, BODY)],
)
def test_fewer_cables_than_freedoms(count, more):
    line = line_of(RobotFile, robot(base_points=[[i, i * i, 0.0] for i in range(count)], **more))
    assert line.startswith(f"base_points = {count} points: must be at least")
    assert all(text in line for text in SUPPORTED)


def test_more_cables_than_any_robot_has():
    line = line_of(RobotFile, robot(base_points=SPOOLS * 400))
    assert line.startswith("base_points = [[") and "must be a list of at most 1000 values, not 1200" in line


@pytest.mark.parametrize(
    ("keys", "wanted"),
    [
        ({"base_points": SPOOLS[:2]}, ("base_points = 2 points", "must be at least 3 (a point mass)", *SUPPORTED)),
        (BODY, ("base_points = 3 points", "must be at least 6", *SUPPORTED)),
        (BODY | {"base_points": [*RING, [0.0, 0.0, 1.0]]}, ("platform_points = 6 points: must be 7, as many as base",)),
        ({"tension_max": [1.0, 2.0]}, ("tension_max = [1.0, 2.0]: must be a number > 0, or 3: one a cable",)),
        ({"pattern": "3T", "planar": True}, ('pattern = "3T": must be "2T", or absent: as the other keys say',)),
        ({"pattern": "3R3T"}, ('pattern = "3R3T": must be "1T" or "2T" or "3T", or absent',)),
        (
            BODY | {"base_points": RING, "pattern": "3T"},
            ('pattern = "3T": must be "1R2T" or "2R3T" or "3R3T" or "3R"',),
        ),
        (
            {"pattern": "1T", "base_points": []},
            (
                "base_points = 0 points",
                "must be at least 1 (a point mass on a",
            ),
        ),
        ({"tension_max": [1.0, 2e9, 1.0]}, ("tension_max[1] = 2000000000.0: must be at most 1e9, or inf",)),
        ({"tension_max": [1.0, float("nan"), 1.0]}, ("tension_max[1] = nan: must be",)),
        ({"pulley_axes": [0.0, 0.0, 1.0]}, ("pulley_axes = [0.0, 0.0, 1.0]: must be absent without pulley_radius",)),
        ({"pulley_radius": [0.1]}, ("pulley_radius = [0.1]: must be a number >= 0, or 3: one a cable",)),
        (
            {"pulley_radius": 0.1, "pulley_axes": [[0, 0, 1]]},
            (
                "pulley_axes",
                "must be",
            ),
        ),
        ({"pattern": "4T"}, ('pattern = "4T": must be ', "3R3T")),
        ({"base_points": RING, "platform_points": RING}, ("inertia is missing", "beside platform_points")),
        ({"base_points": RING, "inertia": BODY["inertia"]}, ("platform_points is missing", "beside inertia")),
        ({"centre_of_mass": [0.0, 0.0, 0.1]}, ("centre_of_mass = [0.0, 0.0, 0.1]", "absent without platform_points")),
        (BODY | {"base_points": RING, "planar": True}, ("planar = true: must be false, or absent",)),
        (
            {"planar": True, "base_points": [[0.0, 0.0, 3.0], [1.0, 0.0, 3.25]], "z_axis": "up"},
            ("spools at heights z = 3 and 3.25", "level in a planar robot", "the same z"),
        ),
    ],
)
def test_robots_that_do_not_fit_together(keys, wanted):
    line = line_of(RobotFile, robot(**keys))
    assert all(text in line for text in wanted), line


def test_level_planar_spools_are_taken():
    for z2 in (3.0, 3.0 + 1e-12):
        keys = robot(planar=True, base_points=[[-1.0, 0.0, 3.0], [1.0, 0.0, z2]])
        assert checked(RobotFile, keys, "in.toml").planar


def test_numbers_are_shown_as_typed():
    """A file with z up is turned for the kernels; its errors are not."""
    robot_file = checked(
        RobotFile, robot(z_axis="up", base_points=[[0.0, 1.0, 3.0], [1.0, 2.0, 3.0], [2.0, 3.0, 3.0]]), "in"
    )
    rotated = [[x, -y, -z] for x, y, z in robot_file.base_points]
    line = robot_file.typed(InputError("base_points", rotated, "three spools that are not on one line"))
    assert line.startswith("robot.base_points = [[0.0, 1.0, 3.0], ") and line.endswith("not on one line")
    assert robot_file.typed(InputError("gravity", -1.0, "> 0")) == "robot.gravity = -1.0: must be > 0"
    assert (
        robot_file.typed(InputError("base_points", 0, "must be so", problem="is so"))
        == "robot.base_points: is so: must be so"
    )


@pytest.mark.parametrize(
    ("given", "allowed", "wanted"),
    [
        ("max_tension", ["tension_min", "tension_max", "floor"], "tension_max"),
        ("tension_maximum", ["tension_min", "tension_max"], "tension_max"),
        ("minTension", ["tension_min", "tension_max"], "tension_min"),
        ("cable.length", ["cable_length_max", "cable_speed_max"], "cable_length_max"),
        ("max-velocity", ["cable_length_max", "cable_speed_max"], "cable_speed_max"),
        ("start", ["amplitude", "family", "from"], "from"),
        ("height", ["tension_max", "floor"], "floor"),
        ("height", ["z0", "floor"], None),
        ("ground", ["z0", "floor"], "floor"),
        ("arcs_max", ["max_arcs", "samples"], "max_arcs"),
        ("positon", ["position", "rest"], "position"),
        ("Mass", ["mass", "name"], "mass"),
        ("fromx", ["from_x", "from_y", "x"], "from_x"),
        ("quux", ["position", "rest"], None),
        ("", ["position"], None),
        ("position" * 10_000, ["position"], None),
        ("\u2028", ["position"], None),
    ],
)
def test_suggestions_go_by_words_then_by_letters(given, allowed, wanted):
    assert nearest(given, allowed) == wanted


def plan_line(tmp_path, text) -> str:
    path = tmp_path / "in.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        keys = read_plan(path.read_text(), path)
        resolve_robot(keys.robot, path, tmp_path)
    return str(caught.value).removeprefix(f"{path}: ")


def sweep_line(tmp_path, text) -> str:
    path = tmp_path / "in.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_sweep(path)
    return str(caught.value).removeprefix(f"{path}: ")


FROM, LIMITS = "from = { rest = true }", "[trajectory]"


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        (FROM, 'from = "rest"', ('from = "rest": did you mean from = { rest = true }? must be a table, not a string',)),
        (FROM, "from = [0.1, 0.2, 1.0]", ("must be a table, not a list: { position = [x, y, z] } or { rest = true }",)),
        (FROM, 'from = { rest = "true" }', ("did you mean true, without quotes? must be true or false",)),
        (FROM, 'start = "rest"', ("unknown key trajectory.start", "did you mean from?")),
        (
            FROM,
            f"{FROM}\ntension_max = 3.0",
            ("unknown key trajectory.tension_max", "did you mean limits.tension_max?"),
        ),
        (FROM, f"{FROM}\nschema = 1", ("did you mean schema above the first [table]?",)),
        (LIMITS, "[limits]\nmax_tension = 3\n[trajectory]", ("limits.max_tension = 3: did you mean tension_max?",)),
        ("z0 = [1.7]", "z0 = 1.7", ("axes.z0 = 1.7: did you mean [1.7]? must be a list",)),
        ("z0 = [1.7]", 'z0 = ["1.7"]', ('axes.z0[0] = "1.7": did you mean 1.7, without quotes? must be a number',)),
        ("schema = 1", "schema = 2", ("schema = 2: must be 1, the version of the format",)),
        ("schema = 1", 'schema = "1"\nquux = 1', ('schema = "1": must be 1,', "(and 1 more: --all-errors shows them)")),
        ("minimum-arcs", "minimum_arc", ('did you mean "minimum-arcs"? must be "minimum-arcs", ',)),
        (LIMITS, "[limits]\ntension_min = { a = [1, true] }\n[trajectory]", ("= { a = [1, true] }: must be a number",)),
    ],
)
def test_sweeps(tmp_path, old, new, wanted):
    assert SWEEP.count(old) == 1
    line = sweep_line(tmp_path, SWEEP.replace(old, new))
    assert all(text in line for text in wanted), line
    assert not FOREIGN.search(line), line


def keys_of(model, at=()):
    """Every key of a file, as a path of keys."""
    for name, field in model.model_fields.items():
        path = (*at, field.alias or name)
        yield path
        for table in wording._tables_in(field.annotation):
            yield from keys_of(table, path)


@pytest.mark.parametrize("model", [PlanFile, SweepFile, RobotFile])
def test_no_key_answers_in_the_words_of_a_library(model):
    """Every key with values of every type: whatever is refused is refused in words of TOML."""
    seen = 0
    for path in keys_of(model):
        for value in ("rest", "", 3, 2.5, True, [1], ["a"], [], {"a": 1}, {}, [[1]], [{}], -1e30, 10**400):
            data = value
            for key in reversed(path):
                data = {key: [data] if key == "pose" and isinstance(data, dict) else data}
            try:
                checked(model, data, "in.toml")
            except ConfigError as error:
                assert not [line for line in error.lines if FOREIGN.search(line)], path
                seen += len(error.lines)
    assert seen > 100


PIECES = {"sweep": SWEEP, "plan": PLAN, "robot": ROBOT}


@pytest.mark.parametrize("given", PIECES)
@pytest.mark.parametrize("wanted", PIECES)
def test_a_file_of_another_kind(tmp_path, given, wanted):
    (tmp_path / "in.toml").write_text(PIECES[given])
    read = {"sweep": read_sweep, "plan": lambda path: read_plan(path.read_text(), path), "robot": read_robot}[wanted]
    if given == wanted:
        read(tmp_path / "in.toml")
        return
    with pytest.raises(ConfigError) as caught:
        read(tmp_path / "in.toml")
    line = str(caught.value)
    assert f"in.toml: is a {given} file (it has " in line and f"must be a {wanted} file" in line
    command = {"sweep": "`cspr run`", "plan": "`cspr plan`", "robot": 'robot = "FILE.toml"'}[given]
    assert command in line and len(line.splitlines()) == 1


def test_all_errors(tmp_path):
    text = PLAN.replace("z0 = 1.7", "z0 = -1.0\nmax_arcs = 0\nquux = 1")
    (tmp_path / "in.toml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_plan((tmp_path / "in.toml").read_text(), tmp_path / "in.toml")
    error = caught.value
    assert str(error) == f"{error.lines[0]} (and 2 more: --all-errors shows them)"
    keys = [line.removeprefix(f"{tmp_path / 'in.toml'}: ").split(" = ")[0] for line in error.lines]
    assert keys == ["unknown key quux", "max_arcs", "z0"]
    copy = pickle.loads(pickle.dumps(error))
    assert (str(copy), copy.lines) == (str(error), error.lines)


def test_a_very_long_key():
    line = line_of(PlanFile, {"k" * 10_000: 1})
    assert line.startswith("unknown key kkk") and "...: allowed" in line.replace(" = 1", "") and len(line) < 1000


def test_a_file_with_very_many_faults():
    with pytest.raises(ConfigError) as caught:
        checked(PlanFile, {f"k{i}": 1 for i in range(5000)}, "in.toml")
    assert len(caught.value.lines) == 1001 and caught.value.lines[-1] == "in.toml: and 4003 more"


def test_limits_of_a_plan_have_a_table(tmp_path):
    path = tmp_path / "in.toml"
    table = "[limits]\ntension_max = 5.0\nfloor = 3.5\ncable_length_max = [3.0, 3.0, 4.0]\n[[pose]]\nrest"
    path.write_text(PLAN.replace("[[pose]]\nrest", table))
    keys = read_plan(path.read_text(), path)
    flat = PLAN.replace("z0 =", "tension_max = 5.0\nfloor = 3.5\ncable_length_max = [3.0, 3.0, 4.0]\nz0 =")
    path.write_text(flat)
    assert keys.model_dump() == read_plan(path.read_text(), path).model_dump()
    assert (keys.tension_max, keys.floor, keys.tension_min) == (5.0, 3.5, None)


@pytest.mark.parametrize(("key", "first", "second"), [("tension_max", "5.0", "6.0"), ("floor", "-1.0", "-1.0")])
def test_one_limit_in_two_places(tmp_path, key, first, second):
    text = PLAN.replace("z0 =", f"{key} = {first}\nz0 =").replace(
        "[[pose]]\nrest", f"[limits]\n{key} = {second}\n[[pose]]\nrest"
    )
    line = plan_line(tmp_path, text)
    assert line == f"limits.{key} = {second}: cannot be combined with {key} = {first}"


def test_a_small_tile_is_blamed_only_where_the_usual_one_would_do(tmp_path):
    large = "x = { start = 0.0, stop = 1.0, count = 9_999_999 }"
    text = SWEEP.replace("x = [0.1, 0.2]", large).replace("[axes]", "[run]\ntile = [2, 1, 1, 1]\n[axes]")
    line = sweep_line(tmp_path, text)
    assert line.startswith("run.tile = [2, 1, 1, 1]: 10000000 tiles: must be so large") and "or absent" in line


def test_a_grid_that_is_too_large_names_its_axes(tmp_path):
    large = "{ start = 0.0, stop = 1.0, count = 1_000_000 }"
    text = SWEEP.replace("x = [0.1, 0.2]", f"x = {large}").replace("y = [0.2]", f"y = {large}")
    line = sweep_line(tmp_path, text)
    assert "tile" not in line and "must be at most" in line
    assert line.startswith("axes: a grid of 1000000 x 1000000 x 2 x 1 (x, y, z, z0), most along x, ")
    # As many bytes as fit, but more cells than tiles of the largest size hold.
    text = text.replace(
        "y = { start = 0.0, stop = 1.0, count = 1_000_000 }", "y = { start = 0.0, stop = 1.0, count = 7000 }"
    )
    line = sweep_line(tmp_path, text + '[run]\nstore = ["arcs"]\n')
    assert "is too large: must be at most 5600000000 cells; fewer points, or several sweeps" in line


def spec_of(**keys):
    return checked(RobotFile, robot(**keys), "in.toml")


def scaled(points, factor):
    return [[factor * x for x in point] for point in points]


@pytest.mark.parametrize(
    ("keys", "wanted"),
    [
        ({}, []),
        ({"base_points": scaled(SPOOLS, 1000.0)}, ["are these millimetres?"]),
        ({"base_points": scaled(SPOOLS, 150.0)}, []),  # a camera over a stadium
        ({"base_points": scaled(SPOOLS, 600.0), "mass": 30_000.0}, []),  # the cabin of a radio telescope
        (BODY | {"base_points": RING}, []),
        (BODY | {"base_points": RING, "inertia": scaled(BODY["inertia"], 1e6)}, ["do the units fit?"]),  # kg mm^2
        (BODY | {"base_points": RING, "platform_points": scaled(RING, 1e3)}, ["do the units fit?"]),
    ],
)
def test_hints_about_units(keys, wanted):
    found = hints.robot_hints(spec_of(**keys))
    assert len(found) == len(wanted) and all(text in line for text, line in zip(wanted, found, strict=True))


def test_the_catalogue_gives_no_hint_but_two():
    """Of all robots two have their mass centre outside the hull of their points, as their sources give them."""
    from cspr_jax.config.catalogue import CATALOGUE, catalogue_names

    lines = {name: hints.robot_hints(read_robot(CATALOGUE / f"{name}.toml")) for name in catalogue_names()}
    outside = {"greenline": "0.005 m outside the hull", "ipanema-1-iros": "0.25 m outside the hull"}
    assert {name for name, said in lines.items() if said} == set(outside)
    assert all(len(lines[name]) == 1 and words in lines[name][0] for name, words in outside.items())


@pytest.mark.parametrize(
    ("keys", "distance"),
    [
        ({"centre_of_mass": [0.0, 0.0, 0.0]}, None),
        ({"centre_of_mass": [0.0, 0.86, 0.0]}, None),  # the middle of a side is at 0.866
        ({"centre_of_mass": [0.0, 1.0, 0.0]}, "0.134 m"),
        ({"centre_of_mass": [0.0, 0.0, -0.2]}, "0.2 m"),
        ({"centre_of_mass": [4.0, 0.0, 4.0]}, "5 m"),
        (
            {
                "platform_points": [[p[0], p[1], (-1.0) ** k] for k, p in enumerate(HEXAGON)],
                "centre_of_mass": [0, 0, 0.9],
            },
            None,
        ),
        ({"platform_points": [[p[0], 7.0, p[1]] for p in HEXAGON], "pattern": "1R2T"}, None),  # y counts for nothing
        (
            {"platform_points": [[p[0], 0.0, p[1]] for p in HEXAGON], "pattern": "1R2T", "centre_of_mass": [2, 0, 0]},
            "1 m",
        ),
        (
            {"platform_points": [[p[0], p[1], 1.0] for p in HEXAGON], "pattern": "3R", "centre_of_mass": [0, 0, 0.5]},
            None,
        ),
        (
            {"platform_points": [[p[0], p[1], 1.0] for p in HEXAGON], "pattern": "3R", "centre_of_mass": [0, 0, 1.5]},
            "0.5 m",
        ),
        ({"platform_points": [[0.5] * 3] * 6, "pattern": "3R", "centre_of_mass": [0, 0, 0]}, None),
    ],
)
def test_hints_about_the_mass_centre(keys, distance):
    """Distances by hand; outside of the points' hull, or that of the points and the joint."""
    found = hints.robot_hints(spec_of(**BODY | {"base_points": RING, "platform_points": HEXAGON, "mass": 0.1} | keys))
    assert [line for line in found if "hull" not in line] == []
    assert len(found) == (distance is not None)
    assert distance is None or (f": {distance} outside the hull of platform_points" in found[0]), found


@pytest.mark.parametrize(
    ("z_axis", "spools", "targets", "other"),
    [
        ("down", 3.0, (1.0, 2.0), "up"),
        ("down", 3.0, (1.0, 3.5), None),
        ("up", 0.0, (1.0, 2.0), "down"),
        ("up", 3.0, (1.0, 2.0), None),
        ("down", 0.0, (), None),
    ],
)
def test_hints_about_the_z_axis(z_axis, spools, targets, other):
    robot_file = spec_of(z_axis=z_axis, base_points=[[x, y, spools] for x, y, _ in SPOOLS])
    text = hints.forgotten_axis(robot_file, [[0.0, 0.0, z] for z in targets])
    assert text == "" if other is None else (f"z points {z_axis}" in text and f'z_axis = "{other}"' in text)


def test_values_are_shown_as_toml():
    assert shown({"rest": True, "at": [1, 2.5, "a"]}) == '{ rest = true, at = [1, 2.5, "a"] }'
    deep = [[[[[1]]]]]
    assert shown(deep) == "[[[...]]]" and shown({}) == "{}" and shown([]) == "[]"
    assert shown(list(range(10**5))).endswith("11, ...]") and shown("x" * 99) == f'"{"x" * 56}...'
    assert shown(10**9000) == "a very large integer"


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("name = \u201chall\u201d", 'did you mean " in place of U+201C, left double quotation mark?'),
        ('name = "hall\u201d', 'did you mean " in place of U+201D, right double quotation mark?'),
        ("name = \u2018hall\u2019", "did you mean ' in place of U+2018"),
        ("mass = \u22121.5", "did you mean - in place of U+2212, minus sign?"),
        ("base_points = [[0, \u20131, 0]]", "did you mean - in place of U+2013, en dash?"),
        ("mass\u00a0= 1.5", "did you mean a plain space in place of U+00A0, no-break space?"),
        ("mass =\u00a01.5", "did you mean a plain space in place of U+00A0, no-break space?"),
        ("mass = 1.5\u202f", "did you mean a plain space in place of U+202F"),
        ("\u200bmass = 1.5", "it holds U+200B, zero width space, which cannot be seen"),
        ("[robot\u200b]", "it holds U+200B, zero width space, which cannot be seen"),
        ("\u201cname\u201d = 1", 'did you mean " in place of U+201C'),
        ("mass = 1 x  # it\u2019s", None),
        ('name = "it\u2019s" x', None),
        ("source = 'a \u2212 b' = 1", None),
    ],
)
@pytest.mark.parametrize("before", ["", "# one \u201cquoted\u201d word\nz_axis = 'up'\n"])
def test_look_alikes_in_toml(tmp_path, before, line, wanted):
    """A character that only looks like one of TOML's is named, but not where it may stand."""
    (tmp_path / "in.toml").write_text(before + line + "\n")
    with pytest.raises(ConfigError) as caught:
        read_robot(tmp_path / "in.toml")
    text = str(caught.value)
    assert "is not TOML: " in text and len(text.splitlines()) == 1
    assert wanted in text if wanted else "U+" not in text, text


def test_look_alikes_in_strings_that_should_be_numbers():
    line = line_of(RobotFile, robot(mass="\u22121.5"))
    assert "did you mean - in place of U+2212, minus sign? must be a number, not a string" in line


@pytest.mark.parametrize("given", PIECES)
def test_marks_and_line_breaks_of_other_systems(tmp_path, given):
    """A byte order mark is no part of the text; line breaks may be those of Windows."""
    (tmp_path / "in.toml").write_bytes(b"\xef\xbb\xbf" + PIECES[given].replace("\n", "\r\n").encode())
    path = tmp_path / "in.toml"
    read = {"sweep": read_sweep, "plan": lambda path: read_plan(read_text(path), path), "robot": read_robot}[given]
    keys = read(path)
    path.write_text(PIECES[given])
    again = read(path)
    assert (keys.identity, keys.text) == (again.identity, again.text) if given == "sweep" else keys == again


@pytest.mark.parametrize(
    ("data", "wanted"),
    [
        (ROBOT.encode("utf-16"), "is UTF-16 text: save it as UTF-8"),
        (ROBOT.encode("utf-16-le"), "is UTF-16 text: save it as UTF-8"),
        (ROBOT.encode("utf-16-be"), "is UTF-16 text: save it as UTF-8"),
        (ROBOT.encode("utf-32"), "is UTF-32 text: save it as UTF-8"),
        (ROBOT.encode("utf-32-be"), "is UTF-32 text: save it as UTF-8"),
        (f'{ROBOT}source = "L\xf6ffel"'.encode("latin-1"), "is not UTF-8 text: byte 0xF6 in line 4: save it as UTF-8"),
    ],
)
def test_other_encodings_of_toml(tmp_path, data, wanted):
    (tmp_path / "in.toml").write_bytes(data)
    with pytest.raises(ConfigError) as caught:
        read_robot(tmp_path / "in.toml")
    assert str(caught.value) == f"{tmp_path / 'in.toml'}: {wanted}"


def test_files_whose_names_differ_in_capitals(tmp_path):
    """Disks of other systems do not tell them apart."""
    (tmp_path / "Robots").mkdir()
    (tmp_path / "Robots" / "Hall.toml").write_text(ROBOT)
    (tmp_path / "Robots" / "Hall_cables.xml").write_text("")
    for name in ("robots/Hall.toml", "Robots/hall.toml", "Robots/HALL_cables.xml"):
        with pytest.raises(ConfigError) as caught:
            resolve_robot(name, "plan.toml", tmp_path)
        there = "Robots" if name[0] == "r" else f"Robots/{'Hall_cables.xml' if 'xml' in name else 'Hall.toml'}"
        assert f": no such file: {tmp_path / there} is there, which differs in capitals: must be" in str(caught.value)
    with pytest.raises(ConfigError, match=r"hall\.toml is there, which differs in capitals"):
        (tmp_path / "hall.toml").write_text("")
        read_robot(tmp_path / "HALL.toml")
    with pytest.raises(ConfigError, match="no such file: must be"):
        resolve_robot("nowhere/at/all.toml", "plan.toml", tmp_path)
