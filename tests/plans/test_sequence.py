"""A family and its map as one folder, from TOML to files, pictures, pages and MuJoCo; legs of several families.

Nothing of the package is touched by the family of this file: motion, leg, map and rows are a folder beside the plan.
"""

import importlib
import json
import shutil
import sys
from contextlib import ExitStack
from pathlib import Path

import h5py
import numpy as np
import pytest
from oracles.pulleys import length
from support.commands import cspr
from support.platforms import state_of

import cspr_jax
from cspr_jax.motion.leg import LegResult
from cspr_jax.schema import map_kinds
from cspr_jax.schema.families import FAMILIES, moving, registered
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.reading.result import open_result

SWEEPS = Path(__file__).parents[2] / "sweeps"
FAMILY = Path(__file__).parents[2] / "docs" / "examples" / "straight_lines"
PLAN = """schema = 1
robot = "prototype"
family = "straight-line"
z0 = 1.7
{more}
[[pose]]
rest = true
[[pose]]
position = [0.1, 0.05, 1.5]
[[pose]]
position = {last}
"""

SWEEP = """schema = 1
map = "line-durations"
robot = "prototype"
[axes]
x = [-0.4, 0.0, 0.3]
y = [0.0, 0.2]
z = [1.2]
z0 = [1.7]
[trajectory]
family = "straight-line"
"""


@pytest.fixture
def lines(tmp_path, monkeypatch):
    """The folder of a family and its map, registered."""
    shutil.copytree(FAMILY, tmp_path / "straight_lines")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    family = importlib.import_module("straight_lines")
    with ExitStack() as rows:
        rows.enter_context(registered(family.FAMILY))
        rows.enter_context(map_kinds.registered(family.KIND, *family.QUANTITIES))
        yield tmp_path
    for name in [name for name in sys.modules if name.partition(".")[0] == "straight_lines"]:
        sys.modules.pop(name)


def planned(folder, *, last: str = "[-0.05, -0.1, 1.6]", more: str = "") -> tuple[int, dict]:
    """Exit code and JSON of a plan of lines."""
    (folder / "plan.toml").write_text(PLAN.format(last=last, more=more))
    code, out, err = cspr("plan", folder / "plan.toml", "--json")
    assert err == ""
    return code, json.loads(out)


def test_a_family_from_file_to_picture(lines):
    code, found = planned(lines)
    assert code == 1 and found["family"] == "straight-line"
    first, second = found["segments"]
    # Sampled alone, nothing is proved: undecided, with its margin.
    assert (first["verdict"], first["arcs"], first["margin_unit"]) == ("undecided", None, "N")
    assert first["margin"] > 0.05
    assert first["duration"] == pytest.approx(np.linalg.norm([0.1, 0.05, 0.2]) / 0.05)
    assert 0.5 < first["tension_min"] / second["tension_min"] < 2.0
    path = lines / "motion.h5"
    assert cspr("plan", lines / "plan.toml", "-o", path, "--anyway")[0] == 1
    with h5py.File(path) as file:
        assert file.attrs["family"] == "straight-line"
        position, time = file["position"][...], file["t"][...]
        np.testing.assert_allclose(position[[0, -1]], [[0.0, 0.0, 1.7], [-0.05, -0.1, 1.6]], atol=1e-12)
        assert time[-1] == pytest.approx(found["total_duration"])
        # Straight: all rows of the first segment lie on the line from its start to its end.
        half = position[time <= first["duration"]]
        across = np.cross(half - half[0], [0.1, 0.05, -0.2])
        assert np.abs(across).max() < 1e-12
    assert open_result(path).attributes["feasible"] == 0
    code, _, err = cspr("plot", path, "-o", lines / "motion.png")
    assert (code, err) == (0, "") and (lines / "motion.png").stat().st_size > 10_000
    code, _, err = cspr("report", lines / "plan.toml", "-o", lines / "motion.html")
    assert (code, err) == (0, "cspr: not proved feasible; the page says so\n")
    assert "prototype" in (lines / "motion.html").read_text()


class Photo(LegResult):
    """What a family may have beyond its motion."""

    key = "photo"

    def to_dict(self):
        return {"focus": np.nan}

    def lines(self):
        return ["one photo"]

    def columns(self):
        return {}


def test_an_outcome_of_a_family(lines, monkeypatch, tmp_path):
    """Reports show what a leg adds to its motion without knowing it."""
    monkeypatch.setattr("straight_lines.leg.Lines.result", lambda *_: Photo())
    assert planned(lines)[1]["photo"] == {"focus": None}
    assert "one photo" in cspr("plan", lines / "plan.toml")[1]


@pytest.mark.thorough
def test_mujoco_plays_a_family(lines):
    """Open loop: the same path, and the same tensions."""
    planned(lines)
    code, out, err = cspr("replay", lines / "plan.toml", "--anyway", "--json")
    assert (code, err) == (1, "")
    deviations = json.loads(out)["largest_deviation"]
    assert deviations["path"]["value"] < 1e-9 and deviations["tension"]["value"] < 1e-9


def test_a_map_of_a_family(lines):
    """From a sweep file to HDF5, a picture and a page."""
    (lines / "durations.toml").write_text(SWEEP)
    code, out, err = cspr("run", lines / "durations.toml", "-o", lines / "run")
    assert (code, err) == (0, "")
    with h5py.File(out.splitlines()[-1]) as file:
        x, y = np.meshgrid([-0.4, 0.0, 0.3], [0.0, 0.2], indexing="ij")
        ways = np.stack([x, y, np.full_like(x, -0.5)], axis=-1)
        np.testing.assert_allclose(file["line_duration"][..., 0, 0], np.linalg.norm(ways, axis=-1) / 0.05, rtol=1e-12)
    for command, suffix in (("plot", ".png"), ("report", ".html")):
        code, _, err = cspr(command, lines / "run", "-o", lines / f"map{suffix}")
        assert (code, err) == (0, "") and (lines / f"map{suffix}").stat().st_size > 10_000


def test_what_a_sample_refutes(lines):
    """A line to beyond the spools is refuted, with the flags of what it breaks."""
    code, found = planned(lines, last="[2.0, 0.0, 1.0]", more="cable_speed_max = 0.01")
    assert code == 1
    assert found["segments"][1]["verdict"] == "slack_cable+cable_too_fast"
    assert found["segments"][1]["margin"] < 0.0 and found["segments"][1]["limit_margin"] < 0.0


def test_it_joins_other_families(lines):
    """A line leads from a target of a hypocycloid only where that ends without acceleration: else one line says so."""
    text = PLAN.format(last="[-0.05, -0.1, 1.6]", more="").replace(
        "[0.1, 0.05, 1.5]", '[0.1, 0.05, 1.5]\nfamily = "hypocycloid-standard"'
    )
    (lines / "plan.toml").write_text(text)
    code, _, err = cspr("plan", lines / "plan.toml")
    assert code == 2 and err.count("\n") == 1
    assert 'pose[2].family = "straight-line": must be one whose acceleration goes on from "hypocycloid-standard"' in err


def test_the_row_is_gone_behind_the_block(tmp_path):
    assert "straight-line" not in FAMILIES
    (tmp_path / "plan.toml").write_text(PLAN.format(last="[0, 0, 1.6]", more=""))
    code, _, err = cspr("plan", tmp_path / "plan.toml")
    assert code == 2 and 'family = "straight-line": must be "hypocycloid-standard", "transition", "hyp' in err


def test_rows_of_the_package():
    lines = ["s-curve", "quintic", "cubic", "bezier"]
    assert moving("2T") == ["transition", *lines, "spline", "ellipse", "path", "free"]
    assert moving("3T") == ["hypocycloid-standard", "transition", *lines, "spline", "ellipse", "path", "free"]
    assert moving("3R3T") == ["hypocycloid-standard", "hypocycloid", "spline", "ellipse", "path", "free"]
    assert moving("2R3T") == ["spline", "path"]
    assert all(row.leg(pattern) for row in FAMILIES.values() for pattern in row.legs)


def assert_continuous(plan) -> None:
    """Position, velocity and acceleration (and turning) go on from each segment to the next, to 1e-9."""
    for before, after in zip(plan.motions[:-1], plan.motions[1:], strict=True):
        last, first = state_of(before, 1.0), state_of(after, 0.0)
        for name in ("position", "velocity", "acceleration", "rotation", "angular_velocity", "angular_acceleration"):
            a, b = getattr(last, name), getattr(first, name)
            if a is not None:
                np.testing.assert_allclose(a, b, atol=1e-9, err_msg=name)


@pytest.mark.thorough
def test_the_example_of_two_families(tmp_path):
    """Its verdicts, and no jump where the families meet."""
    plan = cspr_jax.plan(SWEEPS / "mixed_sequence.toml")
    assert [leg.family for leg in plan.legs] == ["transition", "hypocycloid-standard", "transition"]
    assert plan.feasible and plan.answers.arcs.tolist() == [6, 4, 5, 3, 8]
    assert (plan.answers.margin > plan.answers.margin_bound).all() and (plan.answers.margin_bound > 0.0).all()
    assert_continuous(plan)
    code, out, _ = cspr("plan", SWEEPS / "mixed_sequence.toml", "--json")
    segments = json.loads(out)["segments"]
    assert code == 0 and [s["family"] for s in segments] == [plan.keys.family_of(i) for i in range(5)]
    assert [s["oscillations"] for s in segments] == [3, 2, None, None, 4]
    assert [s["inclination"] is None for s in segments] == [False, False, True, True, False]


@pytest.mark.thorough
def test_each_segment_is_that_of_its_own_family(tmp_path):
    """Answers of a mixed sequence are those that the same pairs of poses have in plans of one family."""
    mixed = cspr_jax.plan(SWEEPS / "mixed_sequence.toml").answers
    head = 'schema = 1\nrobot = "prototype"\nz0 = 1.7\nfamily = "{}"\n[[pose]]\n{}\n[[pose]]\n{}\n'
    a, b = "position = [0.5, 0.3, 1.6]", "position = [-0.6, 0.4, 1.8]"
    pairs = {0: ("transition", "rest = true", a), 2: ("hypocycloid-standard", a, b)}
    for i, (family, start, end) in pairs.items():
        (tmp_path / "one.toml").write_text(head.format(family, start, end))
        own = cspr_jax.plan(tmp_path / "one.toml").answers
        assert (own.arcs[0], own.duration[0]) == (mixed.arcs[i], mixed.duration[i])
        assert own.margin[0] == pytest.approx(mixed.margin[i], rel=1e-12)


@pytest.mark.soak
def test_two_families_of_a_platform(tmp_path):
    """Standard hypocycloids and those of variable amplitude meet at poses, with one beta-hat there."""
    (tmp_path / "plan.toml").write_text(
        'schema = 1\nrobot = "laval-mssm"\nfamily = "hypocycloid"\nz0 = 1.4\n'
        'amplitude = { name = "effective-c3", epsilon = 0.1 }\n[[pose]]\nrest = true\n'
        "[[pose]]\nposition = [0.6, 0.2, 1.4]\ntilt_torsion = [0.3, 0.2, 0.1]\n"
        '[[pose]]\nposition = [-0.5, 0.4, 1.5]\nfamily = "hypocycloid-standard"\n[[pose]]\nrest = true\n'
    )
    plan = cspr_jax.plan(tmp_path / "plan.toml")
    assert [leg.family for leg in plan.legs] == ["hypocycloid", "hypocycloid-standard", "hypocycloid"]
    assert plan.feasible
    ends = [leg.answers.beta_hat for leg in plan.legs]
    assert ends[0][-1, 1] == ends[1][0, 0] and ends[1][-1, 1] == ends[2][0, 0]
    assert_continuous(plan)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("[[pose]]\nrest", '[[pose]]\nfamily = "transition"\nrest'), "pose[0].family"),
        (('family = "transition"', 'family = "transit"'), 'did you mean "transition"?'),
        (('family = "transition"\n\n[[pose]]  # two', 'family = "hypocycloid"\n\n[[pose]]  # two'), "for a point mass"),
        (("z0 = 1.7", "inclination = 0.0"), "inclination: must be absent"),
        (('"quintic"', '"A1"'), "must meet (2.49)"),
    ],
)
def test_mistakes_of_mixed_sequences(tmp_path, change, words):
    text = (SWEEPS / "mixed_sequence.toml").read_text()
    assert change[0] in text
    (tmp_path / "plan.toml").write_text(text.replace(*change, 1))
    code, out, err = cspr("plan", tmp_path / "plan.toml")
    assert (code, out) == (2, "") and err.count("\n") == 1 and words in err


@pytest.mark.thorough
def test_robots_on_pulleys_are_moved_by_any_family(lines):
    """Files and MuJoCo hold the cables over the pulleys; without bounds of its states a motion is not proved."""
    (lines / "wheels.toml").write_text(
        'name = "wheels"\nmass = 0.2\nz_axis = "down"\npulley_radius = [0.01, 0.02, 0.0]\n'
        "base_points = [[0.3, -0.2, 0], [-0.3, -0.2, 0], [0, 0.35, 0]]\n"
    )
    text = PLAN.format(last="[-0.05, -0.1, 1.6]", more="").replace('"prototype"', '"wheels.toml"')
    (lines / "plan.toml").write_text(text)
    plan = cspr_jax.plan(lines / "plan.toml")
    assert all(verdict.text == "undecided" for verdict in map(Verdict, plan.answers.verdict))
    columns = plan.rows()
    robot = cspr_jax.load_robot(lines / "wheels.toml")
    parts = (np.asarray(x) for x in (robot.base_points, robot.pulleys.axes, robot.pulleys.radius))
    parts = list(zip(*parts, strict=True))
    for row in (0, 250, 700):
        place = columns["position"][row]
        exits = [length(*part, place) if part[2] else straight(part[0], place) for part in parts]
        np.testing.assert_allclose(columns["length"][row], [one[0] for one in exits], atol=1e-11)
        pull = -np.array([one[1] for one in exits]).T @ columns["tension"][row]
        np.testing.assert_allclose(pull, 0.2 * (columns["acceleration"][row] - [0.0, 0.0, 9.81]), atol=1e-10)
    found = cspr_jax.replay(lines / "plan.toml", step=0.002, anyway=True)
    assert found.path_deviation.max() < 1e-7 and np.abs(found.tension_deviation).max() < 1e-10


def straight(base, place):
    """Length and direction of a cable without a pulley."""
    way = place - base
    return np.linalg.norm(way), way / np.linalg.norm(way)
