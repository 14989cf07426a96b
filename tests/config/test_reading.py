"""Files that users write: a mistake is one line that names file, key and what is allowed; nothing is written."""

import json
import shutil
import tomllib
import tracemalloc
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.texts import PLAN, SWEEP

from cspr_jax.api.files.imports import import_robot
from cspr_jax.cli import main
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.reading import checked, read_toml
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import ConfigError
from cspr_jax.sweep.definition import read_sweep

ROBOT, Z0, POSE, FROM, AXES = 'robot = "prototype"', "z0 = 1.7", "position = [0.7, 0.7, 3.0]", "from =", "[axes]"
UP_IN_LINE, UP = "[[0, 1, 3], [1, 2, 3], [2, 3, 3]]", "[[0, 1, 3], [2, 1, 3], [1, 4, 3]]"
ON_A_LINE, UPRIGHT = "[[0, 0, 0], [1, 0, 0], [2, 0, 0]]", "[[0, 0, 0], [1, 0, 0], [0, 0, 1]]"


def inline(points: str = "[[0, 0, 0], [1, 0, 0], [0, 1, 0]]", mass: str = "mass = 1.0", more: str = "") -> str:
    return f'robot = {{ name = "r", base_points = {points}, {mass}{more} }}'


# What stands in the good file, what takes its place, and what the line must hold.
PLANS = {
    "unknown": (Z0, f"{Z0}\nquux = 1", "unknown key quux = 1", "allowed: acceleration_max", "z0"),
    "near": (Z0, f"{Z0}\nmax_arc = 3", "unknown key max_arc = 3", "did you mean max_arcs?"),
    "near in a pose": (POSE, "positon = [1, 1, 1]", "pose[1].positon", "did you mean position?"),
    "near in a robot": (ROBOT, inline(mass="mas = 1.0"), "robot.mas = 1.0", "did you mean mass?"),
    "python's name of a key": ("schema = 1", "format_version = 1", "format_version", "schema"),
    "line break in a key": (Z0, f'{Z0}\n"a\\nb\\u2028c" = 1', "unknown key", "allowed"),
    "line break in a value": (ROBOT, 'robot = "a\\nb\\u2028c"', "robot = ", "prototype"),
    "no schema": ("schema = 1\n", "", "schema is missing", "1"),
    "no z0": (f"{Z0}\n", "", "z0 is missing", "depth of P0"),
    "schema 2": ("schema = 1", "schema = 2", "schema = 2", "must be 1"),
    "text for a number": (Z0, 'z0 = "1.7"', 'z0 = "1.7"', "number"),
    "number for true": ("rest = true", "rest = 1", "pose[0].rest = 1", "must be true or false, not a number"),
    "fraction for a count": (Z0, f"{Z0}\nmax_arcs = 2.5", "max_arcs = 2.5", "integer"),
    "date": (Z0, "z0 = 2020-01-01", "z0 = ", "number"),
    "nan": (Z0, "z0 = nan", "z0 = nan", "finite"),
    "inf": (POSE, "position = [0.7, inf, 3.0]", "pose[1].position[1] = inf", "finite"),
    "z0 = 0": (Z0, "z0 = 0", "z0 = 0", "greater than 0"),
    "z0 < 0": (Z0, "z0 = -1.5", "z0 = -1.5", "greater than 0"),
    "z0 chosen how": (Z0, 'z0 = { choose = "fast" }', 'z0.choose = "fast"', "mean", "conservative", "fastest"),
    "family": (Z0, f'{Z0}\nfamily = "splines"', 'family = "splines"', "hypocycloid-standard"),
    "max_arcs = 0": (Z0, f"{Z0}\nmax_arcs = 0", "max_arcs = 0", "must be at least 1"),
    "arcs = 0": (POSE, f"{POSE}\narcs = 0", "pose[1].arcs = 0", "must be at least 1"),
    "two coordinates": (POSE, "position = [0.7, 0.7]", "pose[1].position", "3 values"),
    "no position": (POSE, "arcs = 3", "pose[1].position is missing", "rest = true"),
    "rest off P0": ("rest = true", "rest = true\nposition = [0, 0, 1.8]", "pose[0].position", "P0 = [0.0, 0.0, 1.7]"),
    "one pose": (f"[[pose]]\n{POSE}\n", "", "pose", "at least 2"),
    "mass = 0": (ROBOT, inline(mass="mass = 0"), "robot.mass = 0", "greater than 0"),
    "spools in line": (ROBOT, inline(ON_A_LINE), "robot.base_points", "not on one line"),
    "numbers as typed": (ROBOT, inline(UP_IN_LINE, more=', z_axis = "up"'), "= [[0.0, 1.0, 3.0], [1.0, 2.0, 3.0], [2"),
    "P0 as typed": (
        f"{ROBOT}\n{Z0}\n[[pose]]",
        inline(UP, more=', z_axis = "up"') + f"\n{Z0}\n[[pose]]\nposition = [0, 0, 1]",
        "pose[0].position = [0.0, 0.0, 1.0]",
        "P0 = [1.0, 2.0, 1.3]",
    ),
    "spools far away": (ROBOT, inline("[[0, 1e300, 0], [1, 0, 0], [0, 0, 1]]"), "robot.base_points"),
    "vertical spools": (ROBOT, inline(UPRIGHT), "robot.base_points", "plane is not vertical"),
    "tensions crossed": (Z0, f"{Z0}\ntension_min = 2.0\ntension_max = 2.0", "tension_min", "below tension_max"),
    "two tensions": (
        Z0,
        f"{Z0}\ntension_min = [2.0, 1.0]",
        "tension_min = [2.0, 1.0]",
        ">= 0, or 3: one a cable",
    ),
    "A1": (Z0, f'{Z0}\namplitude = "A1"', 'amplitude = "A1"', "(2.49)", "A''(1) = -12, must be 0"),
    "amplitude": (Z0, f'{Z0}\namplitude = "A4"', 'amplitude = "A4"', "quintic"),
    "polynomial": (Z0, f"{Z0}\namplitude = {{ polynomial = [0, 1] }}", "amplitude", "(2.49)", "A'(0) = 1, must be 0"),
    "overflow": (Z0, f"{Z0}\namplitude = {{ polynomial = [0.0, 1e308, 1e308] }}", "amplitude", "1000000000"),
    "no robot of that name": (ROBOT, 'robot = "prototyp"', 'robot = "prototyp"', "did you mean prototype?"),
    "no robot file": (ROBOT, 'robot = "no/such.toml"', 'robot = "no/such.toml"', "no such file"),
    "zero byte in a path": (ROBOT, 'robot = "a\\u0000b.toml"', "b.toml"),
    "robot = 3": (ROBOT, "robot = 3", "robot = 3", "catalogue name"),
}
for value in ("0.0", "0.6", "-inf", '"better"'):
    named = f'{Z0}\namplitude = {{ name = "effective", epsilon = {value} }}'
    PLANS[f"epsilon {value}"] = (Z0, named, f"amplitude.epsilon = {value}: ", "must be ")
for choice in ("mean", "conservative"):
    named = f'z0 = {{ choose = "{choice}" }}'
    PLANS[f"rest, z0 {choice}"] = (Z0, f"{named}\n[[pose]]\nrest = true\nposition = [0, 0, 1]", "pose[0]", "absent")
    PLANS[f"above, z0 {choice}"] = (Z0, f"{named}\n[[pose]]\nposition = [1, 1, -5]", "z0.choose", "must be a number")
SWEEPS = {
    "near": (AXES, "[run]\ndtyp = 1\n[axes]", "unknown key run.dtyp = 1", "did you mean dtype?"),
    "near axis": ("z0 = [1.7]", "z0 = [1.7]\nfromx = [1.0]", "axes.fromx", "did you mean from_x?"),
    "python's name of a key": (FROM, "start =", "trajectory.start", "from"),
    "map": ("minimum-arcs", "minimum-arc", 'map = "minimum-arc"', 'did you mean "minimum-arcs"?'),
    "no axis": ("z0 = [1.7]\n", "", "axes.z0 is missing", "depth of P0"),
    "count = 0": ("count = 2", "count = 0", "axes.z.count = 0", "must be at least 1"),
    "nan": ("[0.2]", "[nan]", "axes.y[0] = nan", "finite"),
    "infinite range": ("start = 1.0, stop = 2.0", "start = -1e308, stop = 1e308", "axes.z", "1000000"),
    "z0 = 0": ("[1.7]", "[1.7, 0]", "axes.z0 = 0.0", "> 0"),
    "z0 < 0": ("[1.7]", "{ start = -1, stop = 1.7, count = 2 }", "axes.z0 = -1.0", "> 0"),
    "short tile": (AXES, "[run]\ntile = [1, 2]\n[axes]", "run.tile = [1, 2]", "4 integers"),
    "large tile": (AXES, "[run]\ntile = [300, 300, 1, 1]\n[axes]", "run.tile", "65536"),
    "quantity": (AXES, '[run]\nstore = ["arc"]\n[axes]', 'run.store[0] = "arc"', 'did you mean "arcs"?'),
    "quantity twice": (AXES, '[run]\nstore = ["arcs", "arcs"]\n[axes]', "run.store"),
    "epsilon best": (FROM, 'amplitude = { name = "effective", epsilon = "best" }\nfrom =', "epsilon", "a number in"),
    "A1": (FROM, 'amplitude = "A1"\nfrom =', 'trajectory.amplitude = "A1"', "(2.49)", "A''(1) = -12, must be 0"),
    "no start": ("from = { rest = true }", "", "trajectory.from is missing", "rest = true", "from_x"),
    "two starts": ("rest = true", "rest = true, position = [0, 0, 1]", "trajectory.from", "one of them"),
    "rest elsewhere": ("z0 = [1.7]", "z0 = [1.7]\nfrom_x = [1.0]", "axes.from_x", "must be absent"),
    "all above": (
        "start = 1.0, stop = 2.0",
        "start = -2.0, stop = 0.0",
        "axes",
        "in the spool plane or above it",
        "z points down",
    ),
    "starts above": ("rest = true", "position = [0, 0, -1]", "trajectory.from", "above the spool plane"),
    "all below": (AXES, "[limits]\nfloor = 0.9\n[axes]", "axes", "below the floor"),
    "starts below": (AXES, "[limits]\nfloor = 1.6\n[axes]", "trajectory.from", "below the floor"),
    "cables short": (AXES, "[limits]\ncable_length_max = 0.5\n[axes]", "axes", "cable_length_max"),
    "tensions crossed": (AXES, "[limits]\ntension_min = 2\ntension_max = 1\n[axes]", "tension_min", "below"),
}
FILES = {
    "not TOML": (b"z0 = = 1", "is not TOML", "at line 1, column 6"),
    "not UTF-8": (PLAN.encode().replace(b"prototype", b"\xe9"), "is not UTF-8"),
    "2 MB": (b"#" + b"x" * 2_000_000, "file of 2000001 bytes", "at most 1048576"),
    "deep brackets": (b"a = " + b"[" * 9000 + b"]" * 9000, "TOML"),
    "deep dots": (b"a" + b".a" * 2000 + b" = 1\n" + PLAN.encode(), "a"),
    "long integer": (PLAN.replace("1.7", "1" * 5000).encode(), ""),
    "empty": (b"", "is missing"),
}


def refused(capsys, tmp_path, *arguments: str) -> str:
    """The one line of a refused command; nothing else is printed, and the working directory stays as it was."""
    before = sorted(tmp_path.rglob("*"))
    code = main(arguments)
    printed = capsys.readouterr()
    assert code == 2, printed.err
    assert printed.out == ""
    assert len(printed.err.splitlines()) == 1 and printed.err.endswith("\n"), printed.err
    assert printed.err.startswith("cspr: ")
    assert sorted(tmp_path.rglob("*")) == before
    return printed.err


@pytest.mark.parametrize(
    ("command", "good", "row"),
    [pytest.param("plan", PLAN, row, id=f"plan: {name}") for name, row in PLANS.items()]
    + [pytest.param("run", SWEEP, row, id=f"run: {name}") for name, row in SWEEPS.items()],
)
def test_a_mistake_is_one_line(capsys, tmp_path, monkeypatch, command, good, row):
    monkeypatch.chdir(tmp_path)
    old, new, *wanted = row
    assert good.count(old) == 1
    (tmp_path / "in.toml").write_text(good.replace(old, new))
    line = refused(capsys, tmp_path, command, "in.toml")
    for part in wanted:
        assert part in line
    assert any(line.startswith(f"cspr: {name}") for name in ("in.toml: ", "no/such.toml: ", "a"))
    for inner in ("Error", "constrained", "Input should", "valid", "instance", "pydantic", "datetime", "None"):
        assert inner not in line


@pytest.mark.parametrize("command", ["plan", "run"])
@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_no_such_file(capsys, tmp_path, monkeypatch, command, name):
    monkeypatch.chdir(tmp_path)
    content, *wanted = FILES[name]
    (tmp_path / "in.toml").write_bytes(content)
    line = refused(capsys, tmp_path, command, "in.toml")
    assert line.startswith("cspr: in.toml: ") and all(part in line for part in wanted)


@pytest.mark.parametrize("command", ["plan", "run"])
def test_no_file_and_a_directory(capsys, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    assert "none.toml: cannot be read: No such file" in refused(capsys, tmp_path, command, "none.toml")
    assert "folder: is not a file" in refused(capsys, tmp_path, command, "folder")


@pytest.mark.parametrize("count", [10_000_000, 1_000_000_000])
def test_a_grid_that_is_too_large_takes_no_memory(capsys, tmp_path, monkeypatch, count):
    monkeypatch.chdir(tmp_path)
    axes = "".join(f"{name} = {{ start = 0.0, stop = 1.0, count = {count} }}\n" for name in "xyz")
    head, tail = SWEEP.split("x = ")[0], SWEEP[SWEEP.index("z0 = ") :]
    (tmp_path / "in.toml").write_text(head + axes + tail)
    tracemalloc.start()
    line = refused(capsys, tmp_path, "run", "in.toml")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10_000_000
    assert "in.toml: axes" in line and (f"{count} x {count} x {count} x 1" in line or f"count = {count}" in line)


def test_a_mistake_in_a_robot_file_names_that_file(capsys, tmp_path, monkeypatch):
    """Paths are relative to the file that holds them, not to the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "in.toml").write_text(SWEEP.replace('"prototype"', '"./mine.toml"'))
    text = 'name = "mine"\nmass = 2.5\nbase_points = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n'
    (tmp_path / "sub" / "mine.toml").write_text(text)
    assert read_sweep(tmp_path / "sub" / "in.toml").robot.mass == 2.5
    (tmp_path / "sub" / "mine.toml").write_text(text.replace("mass", "mas"))
    line = refused(capsys, tmp_path, "run", "sub/in.toml")
    assert line.startswith("cspr: sub/mine.toml: unknown key mas = 2.5: did you mean mass?")


KEYS = [*PlanFile.model_fields, "schema", "x", "z0", "start", "count", "from", "position", "rest", "polynomial", "a\nb"]
WORDS = [
    "best",
    "mean",
    "quintic",
    "A1",
    "effective",
    "prototype",
    "float32",
    "arcs",
    "x.toml",
    "a/b",
    "a\nb",
    "\u2028",
]
scalars = st.booleans() | st.integers(-(10**25), 10**25) | st.floats() | st.sampled_from(WORDS) | st.text(max_size=6)
keys = st.sampled_from(KEYS) | st.text(max_size=6)
values = st.recursive(scalars, lambda v: st.lists(v, max_size=4) | st.dictionaries(keys, v, max_size=3), max_leaves=6)


def toml(value: object, pair: str = "{} = {}", table: str = "{{{}}}", join: str = ", ") -> str:
    if isinstance(value, dict):
        return table.format(join.join(pair.format(toml(key), toml(inner)) for key, inner in value.items()))
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else str(value).lower()


def tables_in(value: object) -> list[dict]:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return [value] * isinstance(value, dict) + [table for part in inner for table in tables_in(part)]


@st.composite
def broken(draw, good: str) -> str:
    """A good file with keys set, added and taken away in any of its tables, and sometimes a piece of text changed."""
    data = tomllib.loads(good)
    for _ in range(draw(st.integers(1, 3))):
        table = draw(st.sampled_from(tables_in(data)))
        key = draw(st.sampled_from(sorted(table)) if table and draw(st.booleans()) else keys)
        if key in table and draw(st.booleans()):
            del table[key]
        else:
            table[key] = draw(values)
    text, cut, piece = toml(data, table="{}", join="\n"), draw(st.integers(0, 2000)), draw(st.text(max_size=3))
    return text[:cut] + piece + text[cut + draw(st.integers(0, 5)) :] if cut < len(text) else text


def read_plan(path):
    keys = checked(PlanFile, read_toml(path), path)
    return resolve_robot(keys.robot, path, path.parent)


@pytest.mark.parametrize(("good", "read"), [(PLAN, read_plan), (SWEEP, read_sweep)], ids=["plan", "sweep"])
def test_only_one_line_config_errors_escape(tmp_path, monkeypatch, good, read):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(total=2_000_000))
    path, outcomes = tmp_path / "in.toml", []

    @settings(max_examples=200)
    @given(text=broken(good))
    def check(text):
        path.write_text(text, "utf-8")
        try:
            read(path)
            outcomes.append("")
        except ConfigError as error:
            outcomes.append(str(error))
            assert len(str(error).splitlines()) == 1

    check()
    assert all(any(kind in text for text in outcomes) for kind in ("unknown key", "must be", "is missing", "not TOML"))


def test_numbers_of_thousands_of_digits(tmp_path):
    """In words of this program, not in those of Python's limit."""
    number = "1" * 5000
    (tmp_path / "plan.toml").write_text(f"schema = 1\nsamples = {number}\n")
    (tmp_path / "robot.json").write_text(f'{{"name": "one",\n "mass": {number}}}')
    for name, read in (("plan.toml", read_toml), ("robot.json", import_robot)):
        with pytest.raises(ConfigError, match=rf"{name}: line 2: a number of 5000 digits: must have at most 4300$"):
            read(tmp_path / name)
