"""What plans tell of paths: bounds, what binds, and, where there is no motion, the place and the limits that meet."""

import json
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.commands import plan

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.families.paths.least_time.constraints import path_half_planes
from cspr_jax.families.paths.least_time.refusals import half_plane_names
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.outputs.plots.motions.phase_planes import phase_plane_figure
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.state import State
from cspr_jax.schema.verdicts import CRITERIA, Verdict

SPOOLS = np.array([[0.22516660498395405, -0.13, 0.0], [-0.22516660498395405, -0.13, 0.0], [0.0, 0.26, 0.0]])
MASS, GRAVITY, LEAST, LARGEST = 0.198, 9.81, 0.1, 4.0
CORNER = [[-0.1, -0.1, 1.0], [0.05, -0.05, 1.1], [0.05, 0.05, 1.0]]
OUTSIDE = [[0.0, -0.9, 1.0], [0.1, -0.9, 1.1]]


def planned(**path):
    keys = {"schema": 1, "robot": "prototype", "family": "path", "tension_min": LEAST, "tension_max": LARGEST}
    return cspr_jax.plan(keys | {"path": {"grid": 60, "ramp_time": 0.0, "kind": "line"} | path})


def tensions_for(place: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Tensions that give an acceleration, by the balance of forces, z down."""
    ways = SPOOLS - place
    pulls = (ways / np.linalg.norm(ways, axis=1, keepdims=True)).T
    return np.linalg.solve(pulls, MASS * (acceleration - np.array([0.0, 0.0, GRAVITY])))


@pytest.mark.thorough
def test_names_of_half_planes():
    robot = cspr_jax.load_robot("prototype")
    limits = Limits(tension_min=LEAST, tension_max=LARGEST, cable_acceleration_max=5.0)
    place, rate, second_derivative = (
        np.array([0.05, -0.03, 1.0]),
        np.array([0.6, 0.0, 0.8]),
        np.array([0.2, 1.0, -0.15]),
    )
    state = State(jnp.asarray(place), jnp.asarray(rate), jnp.asarray(second_derivative))
    rows = jax.tree.map(np.asarray, path_half_planes(robot, limits, state, jnp.asarray(jnp.inf)))
    names = half_plane_names(Problem(robot, limits, named("quintic")), state, rows.u, rows.x)
    assert len(names) == len(rows.u) == 12
    for (flag, cable), u, x, most in list(zip(names, rows.u, rows.x, rows.bound, strict=True))[:6]:
        speed = 0.7  # squared; any one
        values = tensions_for(place, rate * (most - x * speed) / u + second_derivative * speed)
        limit = {Verdict.SLACK_CABLE: LEAST, Verdict.OVER_TENSION: LARGEST}[flag]
        assert values[cable] == pytest.approx(limit, abs=1e-9)
    assert sorted(names[:6]) == sorted(
        (flag, k) for flag in (Verdict.SLACK_CABLE, Verdict.OVER_TENSION) for k in range(3)
    )
    assert names[6:] == [(Verdict.CABLE_OVER_ACCELERATION, k) for k in range(3)] * 2


@pytest.fixture(scope="module")
def stopping():
    """A plan of two lines with a stop between them, in one segment."""
    return planned(points=CORNER)


@pytest.mark.thorough
def test_bounds_of_sections_with_a_stop_between_them(stopping):
    (segment,) = stopping.to_dict()["segments"]
    first, last = segment["sections"]
    assert segment["verdict"] == "feasible"
    assert segment["duration"] == pytest.approx(first["duration"] + last["duration"], abs=1e-12)
    assert segment["lower_bound"] == pytest.approx(first["lower_bound"] + last["lower_bound"], abs=1e-12)
    for part in (segment, first, last):
        assert part["gap"] == pytest.approx(1.0 - part["lower_bound"] / part["duration"], abs=1e-12)
        assert 0.0 < part["gap"] < 0.02
    assert [part["segments"] for part in (first, last)] == [[0, 0], [0, 0]]
    lengths = np.linalg.norm(np.diff(CORNER, axis=0), axis=1)
    assert [part["length"] for part in (first, last)] == pytest.approx(lengths, rel=1e-9)
    assert all(part["ramp_time"] == 0.0 and part["ramp_cost"] is None for part in (first, last))


def check_shares(result) -> None:
    """Shares of segments against rows: a limit binds within 1 % of the weight of it."""
    rows, start = result.rows(rate=2000.0), 0.0
    near = rows["tension"] < LEAST + 0.01 * MASS * GRAVITY
    for segment in result.to_dict()["segments"]:
        inside = (rows["t"] >= start) & (rows["t"] < start + segment["duration"])
        start += segment["duration"]
        shares = {(row["criterion"], row["cable"]): row["share"] for row in segment["binding"]}
        assert sum(shares.values()) <= 1.0
        assert list(shares.values()) == sorted(shares.values(), reverse=True)
        for k in range(3):
            assert shares.get(("slack_cable", k), 0.0) == pytest.approx(near[inside, k].mean(), abs=0.06)


def test_what_binds(stopping):
    check_shares(stopping)


def test_jumps_and_ramps(stopping):
    with_ramps = planned(points=CORNER[:2], ramp_time=0.05)
    (section,) = with_ramps.to_dict()["segments"][0]["sections"]
    assert section["ramp_time"] == pytest.approx(0.05)
    assert section["jumps"] == 0
    assert 0.0 < section["ramp_cost"] < 0.1
    # From rest, to rest, and where it begins to brake.
    assert stopping.to_dict()["segments"][0]["sections"][0]["jumps"] >= 3


def test_section_through_poses():
    keys = {"schema": 1, "robot": "prototype", "family": "path", "tension_min": LEAST, "tension_max": LARGEST}
    poses = [{"position": place} for place in (*CORNER, [0.0, 0.1, 1.0])]
    poses[-1]["path"] = {"kind": "line"}
    result = cspr_jax.plan(keys | {"path": {"grid": 60, "ramp_time": 0.0, "kind": "quintic"}, "pose": poses})
    first, second, line = result.to_dict()["segments"]
    assert first["lower_bound"] is None and second["lower_bound"] is None
    assert first["sections"] == []
    (section,) = second["sections"]
    assert section["segments"] == [0, 1]
    assert section["duration"] == pytest.approx(first["duration"] + second["duration"], abs=1e-12)
    assert section["lower_bound"] < section["duration"]
    assert line["lower_bound"] == line["sections"][0]["lower_bound"]
    check_shares(result)
    shares = [sum(row["share"] for row in part["binding"]) for part in (first, second, section)]
    mean = (shares[0] * first["duration"] + shares[1] * second["duration"]) / section["duration"]
    assert shares[2] == pytest.approx(mean, abs=1e-9)


@pytest.fixture(scope="module")
def outside():
    """A plan between two places outside of the spools' triangle, in which nothing can rest."""
    return planned(points=OUTSIDE)


def test_place_that_no_speed_passes(outside):
    (segment,) = outside.to_dict()["segments"]
    cause = segment["cause"][0]
    place, way = np.array(cause["position"]), np.diff(OUTSIDE, axis=0)[0]
    assert (cause["criterion"], cause["cable"], cause["needs"]) == ("slack_cable", 2, True)
    assert cause["against"] == {"criterion": "over_tension", "cable": 0}
    assert cause["unit"] == "m/s^2"
    assert place == pytest.approx(OUTSIDE[0] + cause["s"] * way / np.linalg.norm(way), abs=1e-9)
    # As a body that stands still there is pushed by as much, each of the two tensions is at its limit.
    ahead = np.array(OUTSIDE[1])
    for name, limit, cable in (("needed", LEAST, 2), ("allowed", LARGEST, 0)):
        values = tensions_for(ahead, cause[name] * way / np.linalg.norm(way))
        assert values[cable] == pytest.approx(limit, abs=1e-3)
    assert cause["needed"] > cause["allowed"]
    # Nor can it stand still there.
    values = tensions_for(place, np.zeros(3))
    assert (cause["still"]["cable"], cause["still"]["allowed"]) == (int(values.argmin()), LEAST)
    assert cause["still"]["needed"] == pytest.approx(values.min(), abs=1e-6)
    words = f"cable 3 has a tension of {values.min():.4g} N, at least {LEAST:g} needed; no path speed passes"
    assert outside.causes[0][0].text.startswith("cannot stand still at (0.1, -0.9, 1.1): ") and words in (
        outside.causes[0][0].text
    )


def test_one_vocabulary_of_criteria(stopping):
    (segment,) = stopping.to_dict()["segments"]
    for row in segment["binding"]:
        words = CRITERIA[Verdict[row["criterion"].upper()]].words
        assert row["words"] == f"{words} of cable {row['cable'] + 1}"


def test_too_much_work_is_refused_before_it_begins(tmp_path):
    """Three thousand moves to and fro, each with a stop: more than a proof looks at."""
    lines = ["G0 X0 Y0 Z1000", *(f"G1 X{100 * (k % 2 == 0)} F6000" for k in range(3000))]
    (tmp_path / "a.nc").write_text("\n".join(lines))
    keys = {"schema": 1, "robot": "prototype", "family": "path"}
    with pytest.raises(ConfigError, match=r"path\.grid: 3,000 parts between stops: 180,000 cells: must be 100,000"):
        cspr_jax.plan(keys | {"path": {"kind": "gcode", "file": str(tmp_path / "a.nc"), "grid": 60}})


def test_refused_speed_at_an_end():
    way = {"points": [[0.0, 0.0, 1.0], OUTSIDE[0]]}
    (cause,) = planned(**way).to_dict()["segments"][0]["cause"]
    # It is the other end at which the robot cannot rest.
    values = tensions_for(np.array(OUTSIDE[0]), np.zeros(3))
    assert cause["still"]["needed"] == pytest.approx(values.min(), abs=1e-6)
    assert cause["still"]["position"] == pytest.approx(OUTSIDE[0], abs=1e-9)
    low, high = cause["speeds"]
    assert (cause["end"], cause["needed"], cause["allowed"], cause["unit"]) == ("start", 0.0, low, "m/s")
    for speed, is_possible in ((1.02 * low, True), (0.98 * low, False), (0.98 * high, True), (1.02 * high, False)):
        (segment,) = planned(**way, start_speed=speed).to_dict()["segments"]
        assert (segment["lower_bound"] is not None) == is_possible


def test_text(tmp_path, outside):
    text = """schema = 1
robot = "prototype"
family = "path"
tension_min = 0.1
tension_max = 4.0
[path]
grid = 60
ramp_time = {ramp_time}
points = {points}
"""
    code, out, err = plan(tmp_path, text.format(points=CORNER, ramp_time=0.02))
    words = " ".join(out.split())
    assert "at least (s)" in out and "gap (%)" in out
    assert "binds: smallest tension of cable" in words and "% of the time)" in words
    assert "ramps of 0.02 s cost" in words and not err
    line = outside.causes[0][0].text
    assert "no path speed passes s = 0.14" in line
    assert "the smallest tension of cable 3 needs" in line and "the largest tension of cable 1 allows" in line
    code, out, err = plan(tmp_path, text.format(points=OUTSIDE, ramp_time=0.0))
    assert code == 1
    assert line in " ".join(out.split())
    assert "the numbers are those of a slow one" in " ".join(out.split())


def test_phase_plane_in_files_and_pictures(tmp_path, stopping, outside):
    file, sections = tmp_path / "motion.h5", stopping.to_dict()["segments"][0]["sections"]
    stopping.save(file)
    result = cspr_jax.open_result(file)
    data, (low, high, speed, cap) = result.data, result.data["path_speed"].T
    assert data["segment_lower_bound"] == pytest.approx([sum(section["lower_bound"] for section in sections)])
    assert np.unique(data["path_section"]).tolist() == [1, 2]
    # The accelerations of the motion change within cells, those of the sets do not.
    assert (low <= speed + 1e-9).all() and (speed <= 1.01 * high + 1e-9).all() and (speed <= cap).all()
    for number, section in enumerate(sections, start=1):
        rows = data["path_section"] == number
        assert np.ptp(data["path_coordinate"][rows]) == pytest.approx(section["length"], rel=1e-9)
        # Time along the path by the path speeds: midpoints of cells, the speed being a root at the ends.
        time = (2.0 * np.diff(data["path_coordinate"][rows]) / (speed[rows][1:] + speed[rows][:-1])).sum()
        assert time == pytest.approx(section["duration"], rel=1e-3)
    names = {(row["criterion"], row["cable"] + 1) for section in sections for row in section["binding"]}
    binds = data["path_binds"] != 0
    rows = zip(data["path_binds"][binds].tolist(), data["path_binding_cable"][binds].tolist(), strict=True)
    assert {(Verdict(flag).text, cable) for flag, cable in rows} == names
    panel = phase_plane_figure(result).axes[0]
    words = panel.get_legend_handles_labels()[1]
    assert "the end can be reached" in words and "stop" in words
    assert {f"smallest tension of cable {cable}" for _, cable in names} <= set(words)
    outside.save(file, anyway=True)
    # The cause is in m/s^2, and its flag of tensions, in N.
    assert np.isnan(cspr_jax.open_result(file).data["segment_needed"]).all()
    words = phase_plane_figure(cspr_jax.open_result(file)).axes[0].get_legend_handles_labels()[1]
    assert "no path speed passes" in words and "motion, nothing binds" not in words


def test_page(tmp_path, stopping):
    cspr_jax.report(stopping, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text("utf-8")
    content = json.loads(re.search(r'id="content">(.*?)</script>', text, re.DOTALL)[1])["motions"][0]
    count = len(content["paths"]["s"])
    assert {len(content["paths"][name]) for name in ("least", "largest", "actual", "binds", "sections")} == {count}
    assert "smallest tension of cable 3" in content["paths"]["binds"]
    assert "proved" in dict(content["facts"])["least time"]
