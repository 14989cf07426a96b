"""Pictures whose marks fall together, and pictures for columns of papers: what is drawn, from its artists."""

import dataclasses
import itertools

import numpy as np
import pytest
from matplotlib.figure import Figure

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.plots.motions import summary
from cspr_jax.outputs.plots.motions.ends import draw_ends, entries_of_ends, segment_rows
from cspr_jax.outputs.plots.style.options import with_widths
from cspr_jax.outputs.plots.style.scene import box_in_space, set_space, words_in_space
from cspr_jax.outputs.plots.style.style import in_style, laid_out, style_of

REFERENCE = "results/reference/minimum_arcs.h5"


@pytest.fixture(scope="module")
def reference(pytestconfig):
    return cspr_jax.open_result(pytestconfig.rootpath / REFERENCE)


def test_start_way_points_and_end_are_seen_where_they_fall_together():
    """Each mark is smaller than the one behind it, and a legend names those that are drawn."""
    path, time = np.zeros((5, 3)), np.linspace(0.0, 1.0, 5)
    rows = segment_rows({"segment_end": np.array([0.5, 1.0])}, time)
    assert rows.tolist() == [0, 2, 4] and segment_rows({}, time).tolist() == [0, 4]
    panel = Figure().subplots()
    draw_ends(panel, path, rows, (0, 1))
    sizes, layers = ([line.get_markersize() for line in panel.lines], [line.get_zorder() for line in panel.lines])
    assert sizes == sorted(sizes, reverse=True) and layers == sorted(layers) and len(set(sizes)) == 3
    # A diamond or a square lies within the mark before it, its corners too.
    assert all(small * np.sqrt(2.0) < large for large, small in itertools.pairwise(sizes))
    assert list(entries_of_ends(rows)) == ["start", "way-points", "end"]
    assert list(entries_of_ends(rows[[0, -1]])) == list(entries_of_ends(np.arange(99))) == ["start", "end"]


@pytest.mark.parametrize(
    ("words", "width"),
    [
        (["--column"], 8.89),
        (["--column", "ieee"], 8.89),
        (["--column", "elsevier"], 9.0),
        (["--column", "85mm"], 8.5),
        (["--column=8.5cm"], 8.5),
        (["--page"], 17.5),
        (["--page", "ieee"], 18.1),
        (["--page", "7in"], 17.78),
    ],
)
def test_widths_of_columns_and_pages(words, width):
    """A width may follow the option; a file that follows is a file."""
    for before, behind in ((["plot", "a.h5"], []), (["plot"], ["a.h5"])):
        joined = with_widths([*before, *words, *behind])
        (preset,) = [word[2:].replace("=", " ") for word in joined if word.startswith("--")]
        assert style_of(None, None, None, preset).width == pytest.approx(width)
        assert [word for word in joined if not word.startswith("--")] == [*before, *behind]
    assert with_widths(["x", "--", "--column"]) == ["x", "--", "--column"]


def test_other_widths_are_refused(capsys):
    for words in (["--column", "8.5"], ["--column", "1cm"], ["--page", "9000mm"], ["--column=acm"]):
        assert main(["plot", REFERENCE, *words]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"cspr: --{words[0].strip('-').split('=')[0]}: ") and "ieee, elsevier" in line
    with pytest.raises(ConfigError, match="one of column, page"):
        style_of(None, None, None, "side")


@pytest.mark.thorough
@pytest.mark.ci("4.0-4")
@pytest.mark.parametrize("count", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("stretched", [0.25, 4.0])
def test_sections_of_a_column_name_their_axes(reference, count, stretched):
    """Flat and high ones; each vertical axis has its name within the picture, and the panels have most of the width."""
    z = reference.axes["z"][:count]
    x, y = reference.axes["x"] * stretched, reference.axes["y"]
    data = {name: values[:, :, :count] for name, values in reference.data.items()}
    result = dataclasses.replace(reference, axes=reference.axes | {"x": x, "y": y, "z": z}, data=data)
    for quantity in ("arcs", "verdict", "margin"):
        figure = cspr_jax.plot(result, quantity=quantity, preset="column")
        figure.draw_without_rendering()
        panels = [panel for panel in figure.axes if panel.get_visible() and panel.get_label() != "<colorbar>"]
        first = min(panel.get_position().x0 for panel in panels)
        for panel in panels:
            is_left = panel.get_position().x0 < first + 0.01
            assert panel.get_ylabel() == ("y (m)" if is_left else "")
            box = panel.yaxis.label.get_window_extent()
            assert not is_left or (box.x0 >= 0.0 and box.y0 >= 0.0 and box.y1 <= figure.bbox.height)
            low, high = panel.get_xlim()
            ticks = [tick for tick in panel.xaxis.get_major_ticks() if low <= tick.get_loc() <= high]
            labels = [tick.label1.get_window_extent() for tick in ticks if tick.label1.get_visible()]
            assert not any(one.overlaps(other) for one, other in itertools.pairwise(labels))
        last = max(panel.get_position().x1 for panel in panels)
        assert stretched < 1.0 or last - first > 0.7


@pytest.mark.quick("None-size0", "column-size2")
@pytest.mark.parametrize("size", [(3.0, 0.2, 0.2), (0.2, 3.0, 0.3), (0.2, 0.3, 4.0), (1.0, 1.0, 1.0)])
@pytest.mark.parametrize("preset", [None, "column"])
def test_boxes_in_space_are_within_the_picture(size, preset):
    style = style_of(None, None, None, preset)
    with in_style(style):
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        panel = figure.add_subplot(projection="3d", computed_zorder=False)
        set_space(panel, np.array([np.zeros(3), size]), is_down=False)
        figure.suptitle("title")
        laid_out(figure, style)
        figure.draw_without_rendering()
        for box in (box_in_space(panel), *words_in_space(panel)):
            assert box.x0 >= -0.5 and box.y0 >= -0.5
            assert box.x1 <= figure.bbox.width + 0.5 and box.y1 <= figure.bbox.height + 0.5


@pytest.mark.parametrize("preset", [None, "column"])
def test_letters_of_a_table_keep_their_size(preset):
    """Rows do not meet, however long the verdicts."""
    style = style_of(None, None, None, preset)
    verdict = "a cable touches the platform, 2 more"
    cells = [[f"{k} of 30", "12", "10.25", "0.01234", verdict] for k in range(summary.SEGMENTS)]
    with in_style(style):
        is_narrow = preset == "column"
        height = (summary.NARROW_LINE if is_narrow else summary.LINE) * (1 + sum(map(summary._lines, cells)))
        figure = Figure(figsize=(7.2, height), layout="constrained")
        summary._draw_table(figure.subplots(), cells)
        laid_out(figure, style)
        figure.draw_without_rendering()
        (table,) = figure.axes[0].tables
        assert {cell.get_fontsize() for cell in table.get_celld().values()} == {0.95 * style.font_size}
        for cell in table.get_celld().values():
            text = cell.get_text().get_window_extent()
            assert text.height <= cell.get_window_extent().height + 1.0
            assert text.width <= cell.get_window_extent().width + 1.0
