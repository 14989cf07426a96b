"""How pictures look: words, degrees, ticks, marks, colours, and the bytes of their files."""

import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from support.reading import read_here

from cspr_jax.outputs.plots.style.colours import NONE_COLOUR, scale_of
from cspr_jax.outputs.plots.style.fitting import FEWER_TICKS, thin_ticks
from cspr_jax.store.files.netcdf import make_datasets, new_hdf5
from outputs.test_outputs import cspr, panels


@pytest.fixture(autouse=True)
def files_are_read_here(monkeypatch):
    """By this process; how another one reads them is for reliability/test_hostile_results.py."""
    read_here(monkeypatch)


TRIANGLE = [[0.3, -0.2, 0.1], [-0.3, -0.2, 0.1], [0.0, 0.4, 0.1]]
MSSM = [point for point in TRIANGLE for _ in range(2)]


def made(path: Path, axes: dict, data: dict | None = None, kind: str = "minimum-arcs", **given) -> Path:
    """A map with invented numbers, or these ones."""
    axes = {name: np.atleast_1d(np.asarray(points, float)) for name, points in axes.items()}
    shape = tuple(len(points) for points in axes.values())
    data = data or {"arcs": 1 + np.arange(np.prod(shape)).reshape(shape) % 5}
    trajectory = given.pop("trajectory", {"from": {"rest": True}})
    known = {"map": kind, "robot": "robot", "z_axis": "down", "base_points": np.array(given.pop("base", TRIANGLE))}
    robot = {"mass": 1.0, "base_points": TRIANGLE, "z_axis": given.get("z_axis", "down")}
    settings = {
        "schema": 1,
        "map": kind,
        "robot": robot | {"name": given.get("robot", "robot")},
        "axes": {name: points.tolist() for name, points in axes.items()},
        "trajectory": trajectory,
        "dimensions": list(axes),
    }
    with new_hdf5(path, known | {"settings": json.dumps(settings)} | given) as file:
        make_datasets(file, axes, list(data), dtype="float64", tile=shape)
        for name, values in data.items():
            file[name][...] = np.broadcast_to(values, shape)
    return path


GRID = {"x": np.linspace(-1.0, 1.0, 5), "y": np.linspace(-1.0, 1.0, 5), "z": [1.0, 1.5, 2.0], "z0": [1.4]}


def bar(figure):
    return next(panel for panel in figure.axes if panel.get_label() == "<colorbar>")


def ticks(panel) -> list[str]:
    panel.get_figure().draw_without_rendering()
    return [text.get_text() for text in panel.get_yticklabels()]


def words(figure) -> list[str]:
    """Of its legend."""
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def marked(panel) -> dict[str, tuple]:
    """Where a panel has P0 and a start or target."""
    names = {"P": "P0", "o": "end"}
    return {
        names[line.get_marker()]: tuple(np.ravel(line.get_xydata()))
        for line in panel.lines
        if isinstance(line.get_marker(), str) and line.get_marker() in names
    }


def test_spools_p0_and_start_stand_where_they_are(capsys, tmp_path, figures):
    """P0 is at 0.1 + 1.4 = 1.5 m, the start at 2.1 m: nearest to 2 m, within half a step."""
    start = {"from": {"position": [0.5, -0.5, 2.1]}}
    path = made(tmp_path / "map.h5", GRID, trajectory=start, base=MSSM)
    cspr(capsys, "plot", path)
    low, middle, high = panels(figures[0])
    assert [marked(panel) for panel in (low, middle, high)] == [
        {},
        {"P0": pytest.approx((0.0, 0.0))},
        {"end": (0.5, -0.5)},
    ]
    assert words(figures[0]) == ["spools", "P0", "start"]
    for panel in (low, middle, high):
        ring = panel.lines[1].get_xydata()
        np.testing.assert_allclose(ring, np.array(TRIANGLE)[[0, 1, 2, 0], :2])
        assert panel.get_xlim() == (-1.25, 1.25)
    shape = figures[0].legends[0].legend_handles[0].get_marker().vertices
    np.testing.assert_allclose(shape[:, 0] * 0.6, ring[:, 0])  # not turned, not stretched
    np.testing.assert_allclose(np.diff(shape[:, 1]) * 0.6, np.diff(ring[:, 1]))
    # From the side: P0 in the middle section alone, the start in none but its own; the spools are above all cells.
    cspr(capsys, "plot", path, "--at", "y=0")
    cspr(capsys, "plot", path, "--at", "y=-0.5")
    side, beside = (panels(figure)[0] for figure in figures[1:])
    assert marked(side) == {"P0": pytest.approx((0.0, 1.5))} and marked(beside) == {"end": (0.5, 2.1)}
    assert (words(figures[1]), words(figures[2])) == (["P0"], ["start"])
    assert side.get_ylim() == (2.25, 0.75)


@pytest.mark.thorough
def test_what_lies_elsewhere_is_not_marked(capsys, tmp_path, figures):
    """The start half a metre below the only section; beyond the lowest one; P0 upward of z = up."""
    for k, (z, height) in enumerate((([1.5], 2.0), ([1.0, 1.2, 1.4], 2.0), ([0.1, 1.2, 1.4], 1.6))):
        start = {"from": {"position": [0.5, -0.5, height]}}
        cspr(capsys, "plot", made(tmp_path / f"{k}.h5", GRID | {"z": z}, trajectory=start))
        assert not any("end" in marked(panel) for panel in panels(figures[k]))
    up = made(tmp_path / "up.h5", GRID | {"z": [-1.3, -1.0]}, z_axis="up")
    cspr(capsys, "plot", up)
    assert [list(marked(panel)) for panel in panels(figures[3])] == [["P0"], []]
    cspr(capsys, "plot", up, "--at", "y=0")
    assert marked(panels(figures[4])[0]) == {"P0": pytest.approx((0.0, -1.3))}
    assert not panels(figures[4])[0].yaxis_inverted() and panels(figures[4])[0].get_ylim()[1] < 0.0


@pytest.mark.parametrize(
    ("base", "sides"),
    [
        ([[0.5, 0.0, 0.1], [-0.5, 0.0, 0.1]], 2),
        ([[np.cos(a), np.sin(a), 0.1] for a in np.arange(6) * np.pi / 3.0], 6),
        ([[np.cos(a), np.sin(a), 0.1] for a in np.array([0, 3, 1, 4, 2, 5]) * np.pi / 3.0], 0),  # their order crosses
    ],
)
def test_other_spools_have_their_own_shape(capsys, tmp_path, figures, base, sides):
    cspr(capsys, "plot", made(tmp_path / "map.h5", GRID, base=base), "--at", "z=1")
    (panel,) = panels(figures[0])
    last = panel.lines[-1]
    assert words(figures[0]) == ["spools"]
    assert len(last.get_xydata()) == (sides + 1 if sides else 6)
    assert (last.get_marker() == "s") == (sides < 3) and (last.get_linewidth() > 0.0) == (sides > 0)


@pytest.mark.thorough
@pytest.mark.parametrize("quantity", ["arcs", "margin"])
def test_sections_are_moved_to_what_is_marked(capsys, tmp_path, figures, quantity):
    """Of 30 heights six are shown; P0 at 1.7 m and the start at 3.0 m are among them, for every quantity."""
    axes = {"x": [-1.0, 1.0], "y": [-1.0, 1.0], "z": np.linspace(0.3, 3.2, 30), "z0": [1.6]}
    arcs = np.ones((2, 2, 30, 1), int)
    path = made(
        tmp_path / "map.h5", axes, {"arcs": arcs, "margin": arcs * 0.5}, trajectory={"from": {"position": [1, 1, 3]}}
    )
    cspr(capsys, "plot", path, "--quantity", quantity)
    titles = [panel.get_title() for panel in panels(figures[-1])]
    assert titles == ["z = 0.3 m", "z = 0.9 m", "z = 1.7 m", "z = 2 m", "z = 2.6 m", "z = 3 m"]


def test_a_vertical_half_plane_and_a_view_from_above(capsys, tmp_path, figures):
    axes = {"radius": np.linspace(0.0, 1.0, 6), "azimuth": [0.0, 0.5 * np.pi], "z": np.linspace(0.0, 2.0, 9)}
    path = made(tmp_path / "map.h5", axes | {"z0": [1.4]})
    cspr(capsys, "plot", path, "--at", "azimuth=1.57")
    (panel,) = panels(figures[0])
    # A spool at 90 degrees and radius 0.4; those behind are projected to the other side, out of the picture.
    np.testing.assert_allclose(panel.lines[1].get_xydata(), [[-0.2, 0.1], [0.4, 0.1], [-0.2, 0.1]])
    assert marked(panel) == {"P0": pytest.approx((0.0, 1.5))} and words(figures[0]) == ["spools", "P0"]
    cspr(capsys, "plot", path, "--at", "z=1.5")
    (panel,) = panels(figures[1])
    assert panel.name == "polar" and "azimuth (°), outward: radius (m)" in figures[1].get_suptitle()
    np.testing.assert_allclose(panel.lines[1].get_xydata()[2], [0.5 * np.pi, 0.4])


def test_angles_are_degrees_and_axes_have_words(capsys, tmp_path, figures):
    turns = {"tilt_azimuth": [0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi], "tilt": [0.8], "torsion": [-0.4, 0.0, 0.4]}
    path = made(tmp_path / "map.h5", GRID | {"z": [1.5]} | turns, kind="poses")
    cspr(capsys, "plot", path, "--at", "torsion=0")
    assert [panel.get_title() for panel in panels(figures[0])] == [
        f"azimuth of the tilt = {angle}°" for angle in ("0", "90", "180", "\u221290")
    ]
    assert "from rest, torsion = 0°, z = 1.5 m" in figures[0].get_suptitle()
    assert "tilt = 45.84°" in figures[0].get_suptitle() and "rad" not in figures[0].get_suptitle()
    cspr(capsys, "plot", path, "--at", "x=0", "--at", "y=0")
    (panel,) = panels(figures[1])
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("torsion (°)", "azimuth of the tilt (°)") or (
        panel.get_xlabel(),
        panel.get_ylabel(),
    ) == ("azimuth of the tilt (°)", "torsion (°)")
    figures[1].draw_without_rendering()
    around = panel.xaxis if panel.get_xlabel().startswith("azimuth") else panel.yaxis
    shown = {
        round(tick): text.get_text() for tick, text in zip(around.get_ticklocs(), around.get_ticklabels(), strict=True)
    }
    assert shown[180] == "180" and shown[270] == "\u221290"


def test_an_orientation_plane_has_no_label_on_its_head(capsys, tmp_path, figures):
    azimuth = (np.arange(8) - 4) * np.pi / 4.0
    axes = {
        "x": [0.1],
        "y": [0.0],
        "z": [1.5],
        "torsion": [0.0],
        "tilt_azimuth": azimuth,
        "tilt": np.arange(1, 5) * 0.3,
    }
    verdict = np.zeros((1, 1, 1, 1, 8, 4), np.uint32)
    path = made(tmp_path / "map.h5", axes, {"verdict": verdict}, kind="orientations", trajectory={})
    cspr(capsys, "plot", path)
    (panel,) = panels(figures[0])
    figures[0].draw_without_rendering()
    assert [text.get_text() for text in panel.get_xticklabels()][-3:] == ["\u2212135°", "\u221290°", "\u221245°"]
    outward = [text.get_text() for text in panel.texts]
    assert outward == ["30°", "60°"] and panel.get_ylim()[1] == pytest.approx(np.degrees(1.35))
    assert "outward: tilt (°)" in figures[0].get_suptitle() and "from rest" in figures[0].get_suptitle()
    three = made(
        tmp_path / "three.h5",
        axes | {"torsion": np.arange(-2, 3) * 0.3},
        {"verdict": np.zeros((1, 1, 1, 5, 8, 4), np.uint32)},
        kind="orientations",
        trajectory={},
    )
    cspr(capsys, "plot", three, "--envelope")
    for panel in panels(figures[1]):
        assert panel.get_zlabel() == "torsion (°)" and panel.zaxis.label.get_rotation() == 90.0
    assert "from rest" not in figures[1].get_suptitle()


@pytest.mark.quick("minimum-oscillations-oscillations-True", "transition-envelopes-lower_envelope-False")
@pytest.mark.parametrize(
    ("kind", "quantity", "rest"),
    [
        ("minimum-oscillations", "oscillations", True),
        ("transition-envelopes", "lower_envelope", False),
        ("orientation-workspace", "accessible", False),
        ("attainability", "accessible_volume", False),
        ("attainability", "attainable_fraction", True),
        ("minimum-arcs", "arcs", False),
    ],
)
def test_from_rest_is_said_of_motions_alone(capsys, tmp_path, figures, kind, quantity, rest):
    path = made(tmp_path / "map.h5", GRID, {quantity: np.ones(1)}, kind=kind, trajectory={})
    cspr(capsys, "plot", path, "--quantity", quantity)
    assert ("from rest" in figures[0].get_suptitle()) == rest


@pytest.mark.thorough
def test_none_only_where_there_is_some(capsys, tmp_path, figures):
    arcs = np.full((5, 5, 3, 1), 3)
    arcs[0, 0] = 7
    some = arcs.copy()
    some[4, 4] = 0
    for k, data in enumerate((arcs, some)):
        cspr(capsys, "plot", made(tmp_path / f"{k}.h5", GRID, {"arcs": data}))
    assert ticks(bar(figures[0])) == ["3", "4", "5", "6", "7"]
    assert ticks(bar(figures[1])) == ["none", "3", "4", "5", "6", "7"]
    mesh = panels(figures[1])[0].collections[0]
    assert to_hex(mesh.cmap(mesh.norm(0))) == NONE_COLOUR != to_hex(mesh.cmap(mesh.norm(3)))
    cspr(capsys, "plot", tmp_path / "1.h5", "--at", "x=1", "--at", "z=1")
    figures[2].draw_without_rendering()
    axis = panels(figures[2])[0].yaxis
    low, high = axis.get_view_interval()
    shown = [axis.get_major_formatter()(tick, 0) for tick in axis.get_ticklocs() if low < tick < high]
    assert shown == ["none", "1", "2", "3"]


def test_a_few_large_cells_do_not_use_up_the_colours():
    usual = np.tile(np.arange(1, 11), 60)
    scale = scale_of(np.append(usual, [90, 400]))
    assert (scale.extend, scale.beyond) == ("max", "up to 400") and scale.norm.vmax == 10.5
    assert len({scale.colours(scale.norm(count)) for count in (*range(1, 11), 90)}) == 11
    assert scale.ticks[1] == [str(count) for count in range(1, 11)]
    scale = scale_of(np.append(usual / 10.0, [50.0, np.inf, np.nan]))
    assert (scale.norm.vmin, scale.norm.vmax, scale.extend, scale.missing) == (0.1, 1.0, "max", True)
    scale = scale_of(np.append(usual / 10.0, -50.0))
    assert (scale.norm.vmin, scale.norm.vmax, scale.extend, scale.beyond) == (0.1, 1.0, "min", "down to -50")
    scale = scale_of(np.append(usual / 10.0, [-np.inf, np.inf]))
    assert (scale.extend, scale.beyond) == ("both", "")
    assert scale_of(np.append(usual / 10.0, [-50.0, -np.inf])).beyond == "down to -50"
    for even in (usual, np.arange(1, 40), usual / 10.0, np.array([1, 2, 40])):
        assert scale_of(even).extend == "neither" and scale_of(even).norm.vmax >= even.max()


def test_counts_have_whole_ticks_and_missing_values_a_word(capsys, tmp_path, figures):
    found = np.linspace(0.0, 2.0, 25).reshape(5, 5, 1, 1)
    data = {"accessible": np.round(found), "mean_arcs": np.where(found > 1.5, np.nan, found)}
    path = made(tmp_path / "map.h5", GRID | {"z": [1.5]}, data, kind="attainability", trajectory={})
    cspr(capsys, "plot", path, "--quantity", "accessible")
    assert ticks(bar(figures[0])) == ["0", "1", "2"]
    cspr(capsys, "plot", path, "--quantity", "mean_arcs")
    assert "no value" in words(figures[1]) and "no value" not in words(figures[0])


def test_lines_are_named_by_what_tells_them_apart(capsys, tmp_path, figures):
    """Thesis Fig. 1.9: the amplitude functions; of one and the same function, the files."""
    axes = {"tau": np.linspace(0.0, 1.0, 5), "x": [1.0], "y": [0.0], "z": [1.0]}
    functions = {"a": "A1", "b": "A2", "c": {"name": "effective", "epsilon": 0.06}}
    for name, amplitude in functions.items():
        made(
            tmp_path / f"{name}.h5",
            axes,
            {"lower_envelope": np.ones(1)},
            kind="transition-envelopes",
            trajectory={"amplitude": amplitude},
        )
    made(tmp_path / "_d$x.h5", axes, {"lower_envelope": np.ones(1)}, kind="transition-envelopes", trajectory={})
    names = [tmp_path / f"{name}.h5" for name in functions]
    cspr(capsys, "plot", *names)
    cspr(capsys, "plot", names[0], tmp_path / "_d$x.h5")
    found = [[text.get_text() for text in panels(figure)[0].get_legend().get_texts()] for figure in figures]
    assert found == [["A1", "A2", "effective, epsilon = 0.06"], ["a", "_d$x"]]
    assert panels(figures[0])[0].get_xlabel() == "normalised time"


HOSTILE = r"$x_1^2 \frac{ _a ^ \alpha $ % # ~ & {" + "\n\x00"


def test_names_are_drawn_letter_by_letter(capsys, tmp_path):
    """A dollar sign, a backslash and the like are no mathematics, and a line break is none; long names are cut."""
    path = made(tmp_path / "map.h5", GRID | {"z": [1.5]}, robot=HOSTILE[:-1])
    cspr(capsys, "plot", path, "-o", tmp_path / "a.svg")
    text = (tmp_path / "a.svg").read_text("utf-8")
    assert re.search(r"<text[^>]*>\$x_1\^2 \\frac\{ _a \^ \\alpha \$ % # ~ &amp; \{\\n", text)
    long = made(tmp_path / "long.h5", GRID | {"z": [1.5]}, robot="long" * 50)
    cspr(capsys, "plot", long, "-o", tmp_path / "b.svg")
    assert max(map(len, re.findall(r">([^<>]*long[^<>]*)<", (tmp_path / "b.svg").read_text("utf-8")))) < 80


@pytest.mark.thorough
def test_letters_stay_letters_and_bytes_stay_the_same(capsys, tmp_path, monkeypatch):
    """TrueType in PDF, text in SVG, nothing of the day, and nothing of the user's own settings of matplotlib."""
    path = made(tmp_path / "map.h5", GRID | {"z": [1.5, 2.5]})
    for ending in ("pdf", "svg", "png"):
        cspr(capsys, "plot", path, "-o", tmp_path / f"a.{ending}")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    for key, value in (("font.size", 20.0), ("axes.facecolor", "red"), ("pdf.fonttype", 3), ("savefig.dpi", 30)):
        monkeypatch.setitem(__import__("matplotlib").rcParams, key, value)
    for ending in ("pdf", "svg", "png"):
        cspr(capsys, "plot", path, "-o", tmp_path / f"b.{ending}")
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()
    pdf, svg = (tmp_path / "a.pdf").read_bytes(), (tmp_path / "a.svg").read_text("utf-8")
    assert b"/Type0" in pdf and b"/FontFile2" in pdf and b"/Type3" not in pdf and b"/CreationDate" not in pdf
    assert re.search(r"<text[^>]*>z = 1.5 m</text>", svg) and "<dc:date>" not in svg


def test_size_resolution_and_letters(capsys, tmp_path, monkeypatch):
    path = made(tmp_path / "map.h5", GRID)
    cspr(capsys, "plot", path, "-o", tmp_path / "a.png", "--size", "25.4x12.7", "--dpi", "50", "--font-size", "7")
    head = (tmp_path / "a.png").read_bytes()[16:24]
    assert (int.from_bytes(head[:4], "big"), int.from_bytes(head[4:], "big")) == (500, 250)
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *args, **options: drawn.append(self))
    cspr(capsys, "plot", path, "--font-size", "7")
    assert {text.get_fontsize() for text in (panels(drawn[0])[0].title, panels(drawn[0])[-1].xaxis.label)} == {7.0}


def test_numbers_of_ticks_do_not_meet(monkeypatch):
    """In all panels; where they do not meet, one layout tells for as many panels as there are."""
    figure, layouts, lay_out = Figure(figsize=(6.0, 2.0), layout="constrained"), [], Figure.draw_without_rendering
    monkeypatch.setattr(Figure, "draw_without_rendering", lambda self: layouts.append(lay_out(self)))
    drawn = figure.subplots(1, 3, width_ratios=(1, 2, 1))
    for panel in drawn:
        panel.set_xlim(1000.5, 1001.5)
    thin_ticks(figure)
    for panel in drawn:
        shown = [tick for tick in panel.xaxis.get_major_ticks() if 1000.5 <= tick.get_loc() <= 1001.5]
        boxes = [tick.label1.get_window_extent() for tick in shown]
        assert len(boxes) >= 2 and not any(one.overlaps(other) for one, other in itertools.pairwise(boxes))
    assert 1 < len(layouts) <= len(FEWER_TICKS)
    layouts.clear()
    thin_ticks(figure)
    assert len(layouts) == 1


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--size", "16"], ["--size", '"16"', "WIDTHxHEIGHT"]),
        (["--size", "3x10"], ["--size", "4 to 120"]),
        (["--size", "nanx10"], ["--size", "cm"]),
        (["--size", "-16x10"], ["--size"]),
        (["--dpi", "nan"], ["--dpi", "nan", "30 to 1200"]),
        (["--dpi", "1"], ["--dpi", "30 to 1200"]),
        (["--dpi", "1200", "--size", "100x100"], ["--dpi", "at most 253 for 100x100 cm"]),
        (["--font-size", "0"], ["--font-size", "4 to 40"]),
        (["--size", "5x5", "--font-size", "40"], ["--size", "larger, or --font-size smaller"]),
    ],
)
def test_sizes_that_cannot_be(capsys, tmp_path, arguments, told):
    path = made(tmp_path / "map.h5", GRID)
    if arguments[1].startswith("-"):
        arguments = [f"{arguments[0]}={arguments[1]}"]
    line = cspr(capsys, "plot", path, *arguments, code=2)
    assert all(word in line for word in told), line
    assert [file.name for file in tmp_path.iterdir()] == ["map.h5"]


@pytest.mark.thorough
def test_titles_stand_clear_of_panels(capsys, tmp_path, figures):
    """Of sections, whose upper row has ticks below, and of polar ones, which have angles around."""
    tilts = {"tilt_azimuth": (np.arange(8) - 4) * np.pi / 4.0, "tilt": np.arange(1, 4) * 0.3}
    for k, axes in enumerate((GRID | {"z": [1.0, 1.2, 1.5, 2.0]}, {"z": [1.0, 1.2, 1.5, 2.0]} | tilts)):
        cspr(capsys, "plot", made(tmp_path / f"{k}.h5", axes, kind="poses"))
        figures[k].draw_without_rendering()
        every = panels(figures[k])
        inner = [panel.get_window_extent() for panel in every]
        inner += [text.get_window_extent() for panel in every for text in panel.get_xticklabels() if text.get_text()]
        titles = [panel.title.get_window_extent() for panel in every]
        titles.append(figures[k].suptitle(figures[k].get_suptitle()).get_window_extent())
        assert len(titles) == 5 and not any(title.overlaps(box) for title in titles for box in inner)


def test_long_titles_are_broken(capsys, tmp_path, figures):
    path = made(tmp_path / "map.h5", GRID | {"z": [1.5]})
    cspr(capsys, "plot", path, "--size", "12x12", "--font-size", "16")
    title = figures[0].suptitle(figures[0].get_suptitle())
    assert title.get_text().count("\n") > 1 and title.get_window_extent().width <= figures[0].bbox.width


def test_a_narrow_title_has_one_line(capsys, tmp_path, figures):
    path = made(tmp_path / "map.h5", GRID | {"z": [1.5]}, robot="a robot with a name of many letters")
    for words in (["--size", "8x12"], ["--column"]):
        cspr(capsys, "plot", path, *words)
        title = figures[-1]._suptitle
        assert "\n" not in title.get_text() and title.get_window_extent().width <= figures[-1].bbox.width
    cspr(capsys, "plot", path, "--page", "--no-title")
    assert figures[-1].get_suptitle() == "" and figures[-1].get_figwidth() * 2.54 == pytest.approx(17.5)


@pytest.mark.thorough
def test_panels_side_by_side_follow_from_the_width(capsys, tmp_path, figures):
    path = made(tmp_path / "map.h5", GRID | {"z": [1.0, 1.2, 1.4, 1.6, 1.8, 2.0]})
    for words, side_by_side in (([], 3), (["--page"], 3), (["--column"], 2), (["--size", "6x30"], 1)):
        cspr(capsys, "plot", path, *words)
        figures[-1].draw_without_rendering()
        every = panels(figures[-1])
        assert len({round(panel.get_position().x0, 3) for panel in every}) == side_by_side
        for panel in every:
            low, high = panel.get_window_extent().x0, panel.get_window_extent().x1
            boxes = [text.get_window_extent() for text in panel.get_xticklabels() if text.get_text()]
            boxes = [box for box in boxes if low <= (box.x0 + box.x1) / 2 <= high]
            assert all(a.x1 < b.x0 for a, b in itertools.pairwise(boxes))
