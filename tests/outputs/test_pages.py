"""Pages to explore: their content against what is stored, and in a real browser."""

import dataclasses
import html
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.spatial.transform import Rotation
from support.browsers import opened, shown, started, unpacked

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.config.plan import checked_plan
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.plots.pages.maps import informative_cells, map_content, order_of
from cspr_jax.outputs.plots.pages.motions import motion_content
from cspr_jax.outputs.plots.pages.page import packed, page_of

SWEEP = {
    "schema": 1,
    "map": "minimum-arcs",
    "robot": "prototype",
    "axes": {"y": [0.6, 0.0, 0.3, 1.4], "x": [-0.3, 0.1, 0.5], "z0": [1.3, 1.7], "z": [1.2]},
    "trajectory": {"family": "hypocycloid-standard", "from": {"rest": True}, "max_arcs": 6},
    "limits": {"tension_max": 4.0},
}
PLAN = {
    "schema": 1,
    "robot": "prototype",
    "family": "transition",
    "z0": 1.2,
    "tension_min": 0.1,
    "pose": [{"rest": True}, {"position": [0.5, 0.2, 1.2], "arcs": 10}, {"rest": True}],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(scope="module")
def result(folder):
    return cspr_jax.open_result(cspr_jax.run(SWEEP, folder / "run"))


@pytest.fixture(scope="module")
def page(result, folder):
    path = folder / "map.html"
    assert cspr_jax.report(result, path, trajectories=3, cells=[{"x": 0.11, "y": 0.3, "z0": 1.7}]) == []
    return path


def content_of(path):
    text = path.read_text("utf-8")
    return json.loads(re.search(r'<script type="application/json" id="content">(.*?)</script>', text, re.DOTALL)[1])


@pytest.mark.thorough
@settings(max_examples=40, deadline=None)
@given(
    arrays.arrays(st.sampled_from([np.int16, np.uint32, np.float64]), st.integers(0, 30), elements=None)
    | arrays.arrays(np.uint8, 5)
)
def test_packed_values_are_the_same(values):
    values = np.clip(values, -1e9, 1e9) if values.dtype.kind == "f" else values // 4
    with np.errstate(all="ignore"):
        wanted = values.astype(np.float32) if values.dtype.kind == "f" else values
    np.testing.assert_array_equal(unpacked(packed(values)), wanted)


def test_every_cell_of_a_page_has_its_stored_values(result, page):
    found = content_of(page)["map"]
    names, points = order_of(result)
    assert names[-2:] == ["y", "x"]
    assert [axis["values"] for axis in found["axes"]] == [sorted(result.axes[name]) for name in names]
    quantities = {own["name"]: own for own in found["quantities"]}
    assert set(quantities) == set(result.data)
    assert found["quantities"][0]["name"] == "arcs"
    for name, own in quantities.items():
        values = unpacked(own["values"]).reshape(found["shape"])
        for index in np.ndindex(*found["shape"]):
            place = dict(zip(names, (own[i] for own, i in zip(points, index, strict=True)), strict=True))
            stored = result.data[name][tuple(place[axis] for axis in result.axes)]
            if name == "verdict":
                entry = found["reasons"]["entries"][unpacked(found["reasons"]["values"]).reshape(found["shape"])[index]]
                assert set(entry["text"].split(", ")) == set(
                    cspr_jax.Verdict(int(stored)).text.replace("_", " ").split("+")
                )
            else:
                np.testing.assert_allclose(values[index], stored, rtol=1e-6)


def test_motions_of_cells_are_theirs(result, page):
    content = content_of(page)
    found, names = content["map"], order_of(result)[0]
    assert len(content["cells"]) == len(content["motions"]) == 4
    duration = next(own for own in found["quantities"] if own["name"] == "duration")
    durations = unpacked(duration["values"])
    for flat, number in content["cells"].items():
        motion = content["motions"][number]
        t, path = unpacked(motion["t"]), unpacked(motion["path"]).reshape(-1, 3)
        assert t[-1] == pytest.approx(durations[int(flat)], rel=1e-6)
        index = np.unravel_index(int(flat), found["shape"])
        place = {name: axis["values"][i] for name, axis, i in zip(names, found["axes"], index, strict=True)}
        np.testing.assert_allclose(path[-1], [place["x"], place["y"], place["z"]], atol=1e-6)
        np.testing.assert_allclose(path[0], [0.0, 0.0, place["z0"]], atol=1e-6)
        attached = unpacked(motion["attached"]).reshape(-1, 3, 3)
        np.testing.assert_allclose(attached, np.repeat(path[:, None], 3, axis=1))
        assert motion["limits"] == {"tension": [{"words": "largest allowed", "value": 4.0}], "rate": [], "length": []}
        # Taut, and between them the forces carry weight and inertia at rest.
        tension = unpacked(motion["tension"]).reshape(-1, 3)
        units = np.array(motion["base"]) - path[0]
        units /= np.linalg.norm(units, axis=1, keepdims=True)
        np.testing.assert_allclose(tension[0] @ units, [0.0, 0.0, -0.198 * 9.81], atol=1e-3)


def test_a_platform_s_points_turn_with_it():
    rng, count = np.random.default_rng(3), 9
    robot_file = resolve_robot("laval-mssm", Path("plan"), Path())
    quaternion = Rotation.random(count, rng=rng).as_quat(scalar_first=True)
    position = rng.uniform(-1.0, 1.0, (count, 3))
    columns = {"t": np.arange(count) / 8.0, "position": position, "quaternion": quaternion}
    columns["tension"] = rng.uniform(size=(count, 6))
    keys = checked_plan({"schema": 1, "robot": "laval-mssm", "pose": [{"rest": True}, {"rest": True}]}, "plan")
    found = motion_content("motion", columns, {}, robot_file, keys)
    attached = unpacked(found["attached"]).reshape(count, 6, 3)
    own = np.array(robot_file.platform_points)
    for row in range(count):
        rotated = position[row] + Rotation.from_quat(quaternion[row], scalar_first=True).apply(own)
        np.testing.assert_allclose(attached[row], rotated, atol=1e-6)
    # The edges join points of the platform, and all of these.
    corners = unpacked(found["corners"]).reshape(count, 2 * found["edges"], 3)
    gaps = np.linalg.norm(corners[:, :, None] - attached[:, None], axis=3)
    assert gaps.min(2).max() < 1e-6
    assert gaps.min(1).max() < 1e-6


def test_the_same_result_gives_the_same_page(result, page, folder):
    again = folder / "again.html"
    cspr_jax.report(result, again, trajectories=3, cells=[{"x": 0.11, "y": 0.3, "z0": 1.7}])
    assert again.read_bytes() == page.read_bytes()


def test_telling_cells_are_feasible_and_differ():
    rng = np.random.default_rng(0)
    verdict = rng.integers(0, 2, (7, 5, 3)).astype(np.uint32)
    data = {"arcs": rng.integers(1, 5, verdict.shape), "margin": rng.uniform(size=verdict.shape)}
    for count in (0, 1, 12, 1000):
        cells = informative_cells(data, verdict, count)
        assert len(cells) == len(set(cells)) == min(count, int((verdict == 0).sum()))
        assert all(verdict[cell] == 0 for cell in cells)
    least = np.where(verdict == 0, data["margin"], np.inf)
    assert np.unravel_index(np.argmin(least), verdict.shape) in informative_cells(data, verdict, 12)


def test_a_large_map_is_a_page_below_twenty_megabytes(result):
    """Numbers without any order, the worst for compression, of the quantities that such a map stores."""
    rng, shape = np.random.default_rng(0), (200, 200, 20, 1)
    axes = dict(zip(("x", "y", "z", "z0"), (np.arange(n) / 100.0 for n in shape), strict=True))
    data = {
        "arcs": rng.integers(0, 30, shape).astype(np.int16),
        "verdict": (rng.integers(0, 2, shape) * 513).astype(np.uint32),
        **{name: rng.uniform(size=shape) for name in ("duration", "margin", "feasible_at_infinity")},
    }
    content, left = map_content(dataclasses.replace(result, axes=axes, data=data))
    charts = 6_000_000
    assert len(json.dumps(content)) + charts < 20_000_000
    assert set(left) | {own["name"] for own in content["quantities"]} == set(data)
    assert {"arcs", "verdict", "duration", "margin"}.isdisjoint(left)


@pytest.mark.parametrize(
    ("choices", "said"),
    [
        ({"output": "page.pdf"}, "must end in .html"),
        ({"trajectories": -1}, "--trajectories: -1: must be an integer from 0 to"),
        ({"quantity": "speed"}, 'quantity = "speed": must be one of arcs'),
        ({"cells": [{"q": 1.0}]}, '--cell = "q": must be one of'),
        ({"cells": [{"x": 9.0}]}, "must be x in"),
    ],
)
def test_what_a_page_cannot_show_is_refused(result, folder, choices, said):
    output = folder / choices.pop("output", "no.html")
    with pytest.raises(ConfigError, match=re.escape(said)):
        cspr_jax.report(result, output, **choices)
    assert not output.exists()


def test_the_command_writes_beside_the_result(result, folder, monkeypatch, capsys):
    """From the run's own folder, too; mistakes are one line."""
    monkeypatch.chdir(folder / "run")
    assert main(["report", ".", "--trajectories", "0"]) == 0
    assert capsys.readouterr().out == "sweep.html\n"
    assert (folder / "run" / "sweep.html").exists()
    assert main(["report", ".", "--cell", "x"]) == 2
    assert capsys.readouterr().err == 'cspr: --cell: "x": must be AXIS=VALUE, such as z=1.7\n'


def test_cells_of_places_have_no_motions(folder, capsys):
    sweep = {"schema": 1, "map": "workspace", "robot": "prototype", "workspace": {"conditions": ["wrench-feasible"]}}
    sweep["axes"] = {"x": [0.0, 0.1], "y": [0.0, 0.1], "z": [1.0]}
    path = cspr_jax.run(sweep, folder / "static")
    assert cspr_jax.report(path, folder / "static.html") == []
    assert content_of(folder / "static.html")["motions"] == []
    with pytest.raises(ConfigError, match="whose cells do not move"):
        cspr_jax.report(path, folder / "no.html", cells=[{"x": 0.1}])


@pytest.mark.thorough
def test_a_motion_file_is_a_page_too(folder):
    plan = cspr_jax.plan(PLAN)
    file = plan.save(folder / "motion.h5")
    assert cspr_jax.report(file, folder / "motion.html") == []
    motion = content_of(folder / "motion.html")["motions"][0]
    assert [part["arcs"] for part in motion["segments"]] == [10, 6]
    assert motion["limits"]["tension"] == [{"words": "smallest allowed", "value": 0.1}]
    np.testing.assert_allclose(
        unpacked(motion["tension"]).reshape(-1, 3).min(), plan.rows()["tension"].min(), rtol=1e-4
    )


# Where a cell is on the screen.
PLACE = """([row, column]) => {
    const node = document.getElementById("map"), box = node.getBoundingClientRect();
    const { xaxis, yaxis } = node._fullLayout;
    return [box.left + xaxis._offset + xaxis.d2p(node.data[0].x[column]),
        box.top + yaxis._offset + yaxis.d2p(node.data[0].y[row])];
}"""
BROWSER = pytest.mark.skipif(shutil.which("chromium") is None, reason="chromium is not installed")


@pytest.mark.thorough
@BROWSER
def test_a_map_in_a_browser(result, page):
    """Nothing goes wrong; slider, hover, keys and clicks show what is stored."""
    with opened(page) as (tab, told):
        assert tab.inner_text("#title") == "prototype: smallest number of arcs"
        content = content_of(page)
        before = tab.evaluate("JSON.stringify(document.getElementById('map').data[0].z)")
        tab.focus("#sliders input")
        tab.keyboard.press("ArrowRight" if tab.input_value("#sliders input") == "0" else "ArrowLeft")
        after = tab.evaluate("JSON.stringify(document.getElementById('map').data[0].z)")
        assert before != after
        z0 = [1.3, 1.7][int(tab.input_value("#sliders input"))]
        assert f"z0 = {z0} m" in tab.inner_text("#sliders")
        # Each cell's colour is its stored number of arcs; none is blank.
        y, x = (np.argsort(result.axes[name]) for name in ("y", "x"))
        stored = result.data["arcs"][:, :, [1.3, 1.7].index(z0), 0][np.ix_(y, x)]
        assert json.loads(after) == [[int(n) or None for n in row] for row in stored]
        row, column = map(int, np.argwhere(stored > 0)[-1])
        duration = result.data["duration"][y[row], x[column], [1.3, 1.7].index(z0), 0]
        tab.mouse.move(*tab.evaluate(PLACE, [row, column]))
        tab.wait_for_selector("#tip", state="visible")
        hover = tab.text_content("#tip")
        assert f"smallest number of arcs: {stored[row, column]}" in hover
        assert float(re.search(r"duration: ([\d.]+) s", hover)[1]) == pytest.approx(duration, rel=1e-5)
        # Keys move the cell, and Enter shows a motion where there is one.
        tab.evaluate("chooseCell(0, 0)")
        tab.focus("#map")
        for key in ("ArrowRight", "ArrowUp", "ArrowUp"):
            tab.keyboard.press(key)
        assert "y\t0.6 m\nx\t0.1 m" in tab.inner_text("#cell")
        tab.keyboard.press("n")
        tab.wait_for_function("content.cells[flatCell()] !== undefined")
        place = tab.inner_text("#cell")
        assert "Enter or click shows it" in place
        tab.keyboard.press("Enter")
        number = tab.evaluate("content.cells[flatCell()]")
        tab.wait_for_function(f"motion.own.title === content.motions[{number}].title")
        assert len(content["motions"]) == 4
        # So does a click: on another one, in the slice of the named cell.
        flat = next(int(own) for own, k in content["cells"].items() if k == 0)
        index, row, column = map(int, np.unravel_index(flat, content["map"]["shape"])[1:])
        tab.evaluate(f"map.index[1] = {index}; drawMap()")
        tab.mouse.move(*tab.evaluate(PLACE, [row, column]))
        tab.wait_for_function("document.getElementById('tip').textContent.includes('click: its motion')")
        tab.mouse.down()
        tab.mouse.up()
        tab.wait_for_function("motion.own.title === content.motions[0].title")
        assert tab.evaluate("flatCell()") == flat
        assert told == []


@pytest.mark.thorough
@BROWSER
def test_a_plan_in_a_browser(folder):
    """The time moves robot and tensions; both themes; it plays to its end."""
    path = folder / "plan.html"
    cspr_jax.report(cspr_jax.plan(PLAN), path)
    with opened(path) as (tab, told):
        assert tab.is_hidden("#map-side")
        first = tab.evaluate("JSON.stringify(document.getElementById('robot').data[0].x)")
        tab.focus("#time")
        tab.keyboard.press("End")
        last = tab.evaluate("motion.own.count") - 1
        assert tab.evaluate("motion.row") == last
        total = tab.evaluate("motion.own.t[motion.own.count - 1]")
        assert tab.inner_text("#clock") == f"{total:.2f} of {total:.2f} s"
        assert tab.evaluate("document.getElementById('tensions').layout.shapes[0].x0") == pytest.approx(total)
        tab.keyboard.press("PageDown")
        assert 0 < tab.evaluate("motion.row") < last
        assert tab.evaluate("JSON.stringify(document.getElementById('robot').data[0].x)") != first
        paper = tab.evaluate("getComputedStyle(document.body).backgroundColor")
        tab.click("#theme")
        assert tab.evaluate("getComputedStyle(document.body).backgroundColor") != paper
        tab.evaluate(f"setRow({last} - 12)")
        tab.click("#play")
        tab.wait_for_function(f"motion.row === {last} && motion.playing === null")
        assert told == []


# Names that end a script element, open a comment in it, stand where a part of the page belongs, or are program code.
HOSTILE = [
    "<!-- scripts -->",
    "<!-- content -->",
    "<!-- charts --><!-- style -->",
    "<!-- title -->",
    "<!-- version -->",
    "<!-- other -->",
    "<!--<script>",
    "<!--<script><!--<script>",
    "<!--",
    "-->",
    "--!><script>",
    "<script>",
    "<script>alert(1)</script>",
    "</script>",
    "</SCRIPT >",
    "</script\t/><script>throw 1</script>",
    "</title><script>throw 1</script>",
    "</style><style>body{display:none}</style>",
    "<img src=x onerror=throw(1)>",
    "<svg onload=throw(1)>",
    "<![CDATA[<x>]]>",
    "<?php ?>",
    '"}</script>',
    "\\u003c/script\\u003e",
    "\\",
    "\\1 \\g<0> $& $1",
    "&lt;b&gt; &amp; &#60;",
    "`${throw 1}`",
    "line\u2028separator \u2029 \u202e turned",
    "{{ x }} %s {0}",
]


def hostile_page(name: str) -> str:
    return page_of(f"Motion of {name}", {"title": f"Motion of {name}", "map": None, "motions": [], "cells": {}})


@pytest.mark.parametrize("name", HOSTILE)
def test_a_name_leaves_a_page_whole(name):
    """All parts of the page are there, each once, and its content is read back as it was."""
    page, usual = hostile_page(name), hostile_page("rig")
    content = re.search(r'<script type="application/json" id="content">(.*?)</script>', page, re.DOTALL)[1]
    assert json.loads(content)["title"] == f"Motion of {name}" and "<" not in content
    title = re.search("<title>(.*?)</title>", page, re.DOTALL)[1]
    assert html.unescape(title) == f"Motion of {name}"
    rest, usual_rest = (
        re.sub("<title>.*?</title>", "", text, flags=re.DOTALL).replace(own, "")
        for text, own in (
            (page, content),
            (usual, re.search(r'id="content">(.*?)</script>', usual, re.DOTALL)[1]),
        )
    )
    assert rest == usual_rest


@pytest.mark.thorough
@BROWSER
def test_hostile_names_in_a_browser(folder):
    with started() as browser:
        for number, name in enumerate(HOSTILE):
            path = folder / f"hostile_{number}.html"
            path.write_text(hostile_page(name), "utf-8")
            with shown(browser, path) as (tab, told):
                assert tab.text_content("#title") == f"Motion of {name}"
                assert tab.evaluate("document.title.replace(/\\s+/g, ' ')") == " ".join(f"Motion of {name}".split())
                assert tab.evaluate("getComputedStyle(document.body).display") == "block"
                assert told == []


def test_a_page_of_a_workspace_has_spools_and_no_motions(folder):
    sweep = {"schema": 1, "map": "workspace", "robot": "prototype", "workspace": {"conditions": ["wrench-feasible"]}}
    sweep["axes"] = {"x": [0.0, 0.1], "y": [0.0, 0.1], "z": [1.0, 1.2]}
    cspr_jax.report(cspr_jax.run(sweep, folder / "spools"), folder / "spools.html")
    content = content_of(folder / "spools.html")["map"]
    base = np.array(resolve_robot("prototype", "", Path()).base_points)
    plane = [axis["name"] for axis in content["axes"][-2:]]
    for key, name in zip(("up", "across"), plane, strict=True):
        np.testing.assert_array_equal(content["spools"][key], base[:, "xyz".index(name)])
    # What it was not asked for has no values, and is not listed.
    assert all(np.isfinite(unpacked(q["values"])).any() for q in content["quantities"])
    assert {q["name"] for q in content["quantities"]} == {"verdict", "wrench_margin"}


@pytest.mark.thorough
@BROWSER
def test_a_workspace_in_a_browser(folder):
    """Its outline parts cells inside from others, and no key for motions is offered."""
    sweep = {"schema": 1, "map": "workspace", "robot": "prototype", "workspace": {"conditions": ["wrench-feasible"]}}
    sweep["axes"] = {"x": [-0.4, -0.1, 0.0, 0.1, 0.4], "y": [-0.3, 0.0, 0.5], "z": [1.0]}
    path = cspr_jax.run(sweep, folder / "outlined")
    cspr_jax.report(path, folder / "outlined.html")
    inside = cspr_jax.open_result(path).data["verdict"][:, :, 0].T == 0
    padded = np.pad(inside.astype(int), 1)
    edges = sum(int(np.abs(np.diff(padded, axis=axis)).sum()) for axis in (0, 1))
    with opened(folder / "outlined.html") as (tab, told):
        keys = tab.inner_text(".keys")
        assert "cell" in keys and not any(word in keys for word in ("motion", "play", "Enter", "slice"))
        assert "motion" not in tab.inner_text("#cell")
        line = tab.evaluate("outline(reasonsHere()).x")
        assert edges > 0 and len(line) == 3 * edges
        assert told == []


def test_a_page_says_robot_limits_and_duration(folder):
    keys = checked_plan(PLAN | {"tension_max": 9.0, "cable_speed_max": 40.0, "floor": 3.0}, "plan")
    robot_file = resolve_robot("prototype", "", Path())
    rows = {name: np.zeros((3, width)) for name, width in {"position": 3, "length": 3, "rate": 3, "tension": 3}.items()}
    motion = motion_content("motion", {"t": np.array([0.0, 1.0, 2.5])} | rows, {}, robot_file, keys)
    said = dict(motion["facts"])
    assert said["robot"].startswith("prototype, point mass of 0.198 kg on 3 cables")
    assert said["limits"] == ("tension at least 0.1 and at most 9 N, floor at z = 3 m, cable speed at most 40 m/s")
    assert said["duration"] == "2.5 s"
    assert motion["limits"]["rate"] == [{"words": "largest allowed", "value": 40.0}]
    assert motion["cables"] == ["cable 1", "cable 2", "cable 3"]
    unknown = motion_content("motion", {"t": np.array([0.0, 1.0, 2.5])} | rows, {}, None, None)
    assert unknown["base"] == [] and "--plan" in dict(unknown["facts"])["robot"]
