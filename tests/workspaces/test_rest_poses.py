"""Several conditions of a workspace: one that is broken decides, pictures count all, files hold what is asked."""

import h5py
import numpy as np
import pytest
from outputs.test_workspace_pictures import result
from support.commands import cspr

import cspr_jax
from cspr_jax.outputs.plots.pages.maps import map_content
from cspr_jax.outputs.plots.style.word_ticks import reasons
from cspr_jax.schema.verdicts import Verdict, conjunction
from cspr_jax.workspaces.static_poses import MARGINS as COLUMNS
from cspr_jax.workspaces.static_poses import over_orientations

OUT, OPEN, NAN = Verdict.WRENCH_INFEASIBLE.value, Verdict.UNDECIDED.value, Verdict.NOT_FINITE.value
AXES = {"x": np.linspace(-1.0, 1.0, 3), "y": np.linspace(-1.0, 1.0, 4), "z": [1.0]}
BOTH = {"conditions": ["wrench-feasible", "wrench-closure"]}


def test_one_broken_condition_decides():
    """In verdicts, and in pictures and pages of files whose cells still hold both flags."""
    flags = np.array([0, OPEN, OUT, OPEN | OUT, NAN | OUT, OPEN | NAN], np.uint32)
    assert conjunction(flags).tolist() == [0, OPEN, OUT, OUT, OUT, OPEN | NAN]
    numbers, words, _ = reasons(flags, "inside")
    assert [words[n] for n in numbers] == ["inside", "undecided", *["wrench infeasible"] * 3, "undecided"]
    given = result(AXES, {"verdict": np.full((3, 4, 1), OPEN | OUT, np.uint32)}, BOTH)
    (entry,) = map_content(given)[0]["reasons"]["entries"]
    assert (entry["word"], entry["text"]) == ("wrench infeasible", "wrench infeasible")


@pytest.mark.parametrize(
    ("kind", "verdicts", "wanted"),
    [
        ("total", [OPEN, OPEN, OUT, 0], OUT),
        ("total", [OPEN, OPEN, 0, 0], OPEN),
        ("inclusion", [OPEN, OUT, OUT, OUT], OPEN),
        ("inclusion", [NAN, OUT, OUT, OUT], NAN),
        ("inclusion", [OPEN, 0, OUT, OUT], 0),
    ],
)
def test_of_a_set_what_is_refuted_is_not_undecided(kind, verdicts, wanted):
    """However many of its orientations are undecided."""

    def ask(places, turns):
        numbers = {name: np.zeros(len(places)) for name in (*COLUMNS, "nearest_bodies")}
        return numbers | {"verdict": np.array(verdicts, np.uint32)}

    found = over_orientations(ask, np.zeros((1, 3)), np.zeros((4, 4)), np.full(4, 0.25), kind)
    assert found["verdict"].tolist() == [wanted]


def test_a_picture_counts_all_conditions():
    """With several margins it is the verdict; of one margin what others exclude is hatched; the title names them."""
    verdict = np.zeros((3, 4, 1), np.uint32)
    verdict[0], verdict[1, 0] = OUT, Verdict.OBSTACLE.value
    data = {"verdict": verdict, "wrench_margin": np.ones((3, 4, 1)), "closure_margin": np.ones((3, 4, 1))}
    figure = cspr_jax.plot(result(AXES, data, BOTH))
    title = figure.get_suptitle()
    assert "verdict" in title.splitlines()[0] or "verdict" in figure.axes[-1].get_ylabel()
    assert "wrench-feasible 1 to 50 N" in title and "wrench-closure" in title
    assert map_content(result(AXES, data, BOTH))[0]["quantities"][0]["name"] == "verdict"
    figure = cspr_jax.plot(result(AXES, data, BOTH), quantity="wrench_margin")
    (patch,) = figure.axes[0].patches
    assert patch.get_hatch() and len(patch.get_path().vertices) == 5 * 5
    assert "excluded by other conditions" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_an_infinite_deficit_has_no_colour_of_the_scale():
    data = {"verdict": np.full((3, 4, 1), Verdict.SINGULAR.value), "wrench_margin": np.full((3, 4, 1), -np.inf)}
    figure = cspr_jax.plot(result(AXES, data))
    assert figure.axes[0].collections[0].get_array().mask.all()
    assert figure.legends[0].get_texts()[0].get_text() == "−∞: the cables do not span the wrench"


SWEEP = """schema = 1
map = "workspace"
robot = "kntu-planar"
[axes]
x = [0.0, 0.1]
y = [0]
z = [0.0]
[workspace]
conditions = ["wrench-closure"]
"""


def test_files_hold_what_is_asked(tmp_path):
    """No column of another condition, not in words either; a floor has a margin; words are those of poses."""
    path = tmp_path / "w.toml"
    path.write_text(SWEEP + "[limits]\nfloor = -1.0\n")
    code, out, error = cspr("run", path, "-o", tmp_path / "run")
    assert (code, error) == (0, "")
    with h5py.File(out.strip()) as file:
        assert {name for name in file if name not in "xyz"} == {"verdict", "closure_margin", "floor_margin"}
        assert "amplitude" not in file.attrs["title"] and "wrench-closure" in file.attrs["title"]
        assert file["verdict"].attrs["long_name"] == "verdict of the pose"
        np.testing.assert_allclose(file["floor_margin"][...], 1.0, atol=1e-12)
    path.write_text(SWEEP + '[run]\nstore = ["verdict", "wrench_margin"]\n')
    code, out, error = cspr("run", path, "-o", tmp_path / "other")
    assert code == 2 and "run.store: wrench_margin: must be absent without" in error


OBSTACLES = [
    {"kind": "sphere", "centre": [0.0, 0.0, 1.2], "radius": 0.25},
    {"kind": "box", "corners": [[-0.5, -0.2, 2.0], [0.0, 0.4, 2.5]]},
    {"kind": "cylinder", "start": [0.5, 0.5, 0.0], "end": [0.5, 0.5, 3.0], "radius": 0.1},
]
CLOSED = {"conditions": ["wrench-closure"]}
AMONG = {"conditions": ["interference-free"], "obstacle": OBSTACLES}


def test_obstacles_are_drawn():
    """In a section each that it cuts in true size, the others as shadows; in space; among outlines; in the title."""
    data = {"verdict": np.where(np.arange(12) % 4 == 1, 0, OUT), "clearance": np.ones(12)}
    figure = cspr_jax.plot(result(AXES, data, AMONG))
    shapes = [p.get_xy() for p in figure.axes[0].patches if p.get_facecolor()[3] and not p.get_hatch()]
    assert [np.ptp(xy, axis=0) for xy in shapes] == [pytest.approx([0.3, 0.3], rel=0.01), pytest.approx([0.2, 0.2])]
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"obstacle", "obstacle beside the section"} < set(words) and "3 obstacles" in figure.get_suptitle()
    several = cspr_jax.plot([result(AXES, data, AMONG), result(AXES, data, AMONG)])
    assert "obstacle" in [text.get_text() for text in several.legends[0].get_texts()]
    deep = {name: np.repeat(values, 2) for name, values in data.items()}
    solid = cspr_jax.plot(result(AXES | {"z": [1.0, 2.0]}, deep, AMONG), solid=True)
    assert "obstacles" in [text.get_text() for text in solid.legends[0].get_texts()]


def test_obstacles_are_on_pages():
    """What each height cuts of them, across and upward, and the outlines of all."""
    numbers = {"verdict": np.zeros(24, np.uint32), "clearance": np.ones(24)}
    content = map_content(result(AXES | {"z": [1.0, 2.2]}, numbers, AMONG))[0]
    own, names = content["obstacles"], [axis["name"] for axis in content["axes"]]
    assert names == ["z", "y", "x"] and own["axis"] == 0
    sphere, box, cylinder = own["bodies"]
    assert sphere["cuts"][1]["up"] == [] and not box["cuts"][0]["up"] and cylinder["cuts"][0]["up"]
    assert np.ptp(sphere["cuts"][0]["across"]) == pytest.approx(0.3, rel=0.01)
    for kind in (box["cuts"][1], box["shadow"]):
        assert (min(kind["across"]), max(kind["across"])) == (-0.5, 0.0)
        assert (min(kind["up"]), max(kind["up"])) == (-0.2, 0.4)
    assert np.ptp(sphere["shadow"]["up"]) == pytest.approx(0.5, rel=0.01)
    assert cylinder["shadow"]["up"][0] == cylinder["shadow"]["up"][-1]
    assert map_content(result(AXES, {"verdict": np.zeros(12, np.uint32)}, CLOSED))[0]["obstacles"] is None


@pytest.mark.parametrize("by", [None, "y"])
def test_lines_mark_what_other_conditions_exclude(by):
    """With a cross each, and one legend; a map of one condition has none."""
    verdict = np.where(np.arange(12) % 4 == 1, OUT, 0)
    data = {"verdict": verdict.astype(np.uint32), "wrench_margin": np.ones(12), "closure_margin": -np.ones(12)}
    how = {"at": {"x": 0.0}} if by is None else {"lines": by}
    figure = cspr_jax.plot(result(AXES, data, BOTH), quantity="wrench_margin", **how)
    crosses = [line for line in figure.axes[0].lines if line.get_marker() == "x"]
    assert [line.get_xdata().tolist() for line in crosses] == [[AXES["y"][1]]] if by is None else [[-1.0, 0.0, 1.0]]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["excluded by other conditions"]
    plain = cspr_jax.plot(result(AXES, data, BOTH), quantity="closure_margin", **how)
    assert not plain.legends and "x" not in [line.get_marker() for line in plain.axes[0].lines]


def test_outlines_are_those_of_the_volumes():
    """A margin of another scale moves no outline: half-way between points, in a band of all that may be inside."""
    points = {"x": np.linspace(0.0, 3.0, 4), "y": np.linspace(0.0, 3.0, 4), "z": [1.0]}
    verdict = np.full((4, 4, 1), OUT)
    verdict[1:3, 1:3] = 0
    inside = verdict == 0
    results = [
        result(points, {"verdict": verdict, "wrench_margin": np.where(inside, 100.0, -1.0)}),
        result(
            points,
            {"verdict": verdict, "closure_margin": np.where(inside, 0.1, -1.0)},
            {"conditions": ["wrench-closure"]},
        ),
    ]
    panel = cspr_jax.plot(results).axes[0]
    lines = [line.get_xydata() for line in panel.lines if len(line.get_xydata()) > 6]
    np.testing.assert_array_equal(lines[0], lines[1])
    assert lines[0].min() == 0.5 and lines[0].max() == 2.5
    bands = [patch for patch in panel.patches if patch.get_alpha()]
    assert len(bands) == 2 and all(band.get_path().get_extents().bounds == (0.0, 0.0, 3.0, 3.0) for band in bands)
