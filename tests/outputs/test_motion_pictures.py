"""Pictures of motions: in space, tensions with their limits, a page, and several motions in one."""

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from plans.test_planning import SHORT
from support.commands import plan
from swings.test_transition_leg import text as transition_text

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.outputs.plots.motions.motion_pictures import MOTION_PICTURES
from cspr_jax.outputs.plots.style.fitting import share_of_panels, with_minus
from cspr_jax.outputs.plots.style.labels import cable_names
from cspr_jax.outputs.plots.style.scene import FILLS, box_in_space, colours_of_tension, words_in_space
from outputs.test_outputs import panels

LIMITED = f"{SHORT}\n[limits]\ntension_min = 0.02\ncable_speed_max = 9.0\ntension_max = 1.5\n"


@pytest.fixture(scope="module")
def motions(tmp_path_factory):
    """A plan with limits, and one of another family."""
    folder = tmp_path_factory.mktemp("motions")
    assert plan(folder, LIMITED, "-o", str(folder / "first.h5"))[0] == 0
    bezier = SHORT.replace("hypocycloid-standard", "bezier")
    assert plan(folder, bezier, "-o", str(folder / "second.h5"), "--anyway")[0] == 1
    return folder


def drawn(figures, *words: str):
    assert main(["plot", *words]) == 0
    return figures.pop()


@pytest.mark.thorough
def test_the_trajectory_in_space(motions, figures, capsys):
    figure = drawn(figures, str(motions / "first.h5"), "--quantity", "trajectory")
    result = cspr_jax.open_result(motions / "first.h5")
    space = panels(figure)[0]
    path = np.array(space.lines[0].get_data_3d()).T
    np.testing.assert_array_equal(path, result.data["position"])
    cables = [c for c in space.collections if isinstance(c, Line3DCollection)]
    rows = [0, *np.searchsorted(result.axes["t"], result.data["segment_end"] - 1e-6)]
    assert len(cables) == len(rows) == 3
    largest = result.data["tension"].max()
    for some, row in zip(cables, rows, strict=True):
        ends = np.array(some._segments3d)
        np.testing.assert_allclose(ends[:, 0], result.attributes["base_points"])
        np.testing.assert_allclose(ends[:, 1], np.tile(result.data["position"][row], (3, 1)))
        wanted = [to_rgba(c) for c in colours_of_tension()(result.data["tension"][row] / largest)]
        np.testing.assert_allclose(some.get_colors(), wanted)
    # z points down in the file and upward it is drawn: nothing is mirrored if two axes are turned.
    rotated = [getattr(space, f"get_{axis}lim")()[0] > getattr(space, f"get_{axis}lim")()[1] for axis in "xyz"]
    assert rotated == [False, True, True]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "path",
        "start",
        "way-points",
        "end",
        "cables",
        "spools, by cable",
    ]
    assert [text.get_text().strip() for text in space.texts] == ["1", "2", "3"]


def test_tensions_with_their_limits(motions, figures, capsys):
    figure = drawn(figures, str(motions / "first.h5"), "--quantity", "tensions")
    tension = cspr_jax.open_result(motions / "first.h5").data["tension"]
    panel = panels(figure)[0]
    band = panel.collections[0].get_paths()[0].vertices
    assert band[:, 1].min() == tension.min() and band[:, 1].max() == tension.max()
    levels = [
        line.get_ydata()[0] for line in panel.lines if len(line.get_xdata()) == 2 and line.get_linestyle() == "--"
    ]
    assert levels == [0.02, 1.5]
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["range", *(f"cable {k}" for k in (1, 2, 3)), "smallest", "at least 0.02 N", "at most 1.5 N"]
    looks = {(line.get_color(), line.get_linestyle()) for line in panel.lines[:3]}
    assert len(looks) == 3
    title = figure.get_suptitle()
    assert f"smallest {tension.min():.4g} N" in title and f"largest {tension.max():.4g} N" in title
    _, cable = np.unravel_index(tension.argmin(), tension.shape)
    assert f"cable {cable + 1}, t = " in title.split(";")[0]


def test_a_limit_far_away_is_written(motions, tmp_path, figures, capsys):
    assert plan(tmp_path, LIMITED.replace("= 1.5", "= 50.0"), "-o", str(tmp_path / "far.h5"))[0] == 0
    panel = panels(drawn(figures, str(tmp_path / "far.h5"), "--quantity", "tensions"))[0]
    assert "at most 50 N (above)" in panel.get_legend_handles_labels()[1] and panel.get_ylim()[1] < 5.0


def test_a_plan_on_a_page(motions, figures, capsys):
    figure = drawn(figures, str(motions / "first.h5"), "--quantity", "summary")
    result = cspr_jax.open_result(motions / "first.h5")
    table = next(panel.tables[0] for panel in figure.axes if panel.tables)
    cells = {place: cell.get_text().get_text() for place, cell in table.get_celld().items()}
    for k in range(2):
        assert [cells[k + 1, j] for j in (0, 1, 4)] == [f"{k + 1}", f"{result.data['segment_arcs'][k]}", "feasible"]
        assert float(cells[k + 1, 3]) == pytest.approx(result.data["segment_tension_margin"][k], rel=1e-3)
    rates = next(panel for panel in figure.axes if panel.get_ylabel() == "cable speed (m/s)")
    np.testing.assert_array_equal(rates.lines[1].get_ydata(), result.data["rate"][:, 1])


@pytest.mark.thorough
def test_several_motions_in_one_picture(motions, figures, capsys):
    files = [str(motions / f"{name}.h5") for name in ("first", "second")]
    figure = drawn(figures, *files)
    results = [cspr_jax.open_result(file) for file in files]
    by_label = {panel.get_ylabel(): panel for panel in figure.axes}
    for k, result in enumerate(results):
        smallest = by_label["smallest tension (N)"].lines[k].get_ydata()
        np.testing.assert_array_equal(smallest, result.data["tension"].min(1))
        np.testing.assert_array_equal(by_label["y (m)"].lines[k].get_ydata(), result.data["position"][:, 1])
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    ends = [f"{result.axes['t'][-1]:.4g} s" for result in results]
    assert names == [f"hypocycloid-standard, {ends[0]}", f"bezier, {ends[1]}, not proved feasible"]
    same = drawn(figures, files[0], files[0])
    assert len(same.legends[0].get_texts()) == 2
    assert main(["plot", *files, "--quantity", "tensions"]) == 2
    assert "absent with several motions" in capsys.readouterr().err
    assert main(["plot", *[files[0]] * 7]) == 2
    assert "at most 6 in one picture" in capsys.readouterr().err


def test_a_wrong_picture_names_those_there_are(motions, capsys):
    assert main(["plot", str(motions / "first.h5"), "--quantity", "landing"]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "one of trajectory, tensions, summary, acceleration for this motion" in line
    assert main(["plot", str(motions / "first.h5"), "--quantity", "tensions", "--at", "t=1"]) == 2
    assert "absent for a motion but with --quantity acceleration" in capsys.readouterr().err


@pytest.mark.ci("svg-summary", "png-tensions", "pdf-tensions")
@pytest.mark.quick("svg-tensions")
@pytest.mark.parametrize("quantity", ["summary", "tensions"])
@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_the_same_motion_gives_the_same_bytes(motions, tmp_path, capsys, ending, quantity):
    files = [tmp_path / f"{k}.{ending}" for k in range(2)]
    for file in files:
        cspr_jax.plot(motions / "first.h5", quantity=quantity, dpi=60, output=file)
    assert files[0].read_bytes() == files[1].read_bytes()


def test_each_row_is_offered_by_the_command_line(capsys):
    with pytest.raises(SystemExit):
        main(["plot", "--help"])
    shown = " ".join(capsys.readouterr().out.split())
    assert all(name in shown for name in MOTION_PICTURES)


def test_pairs_of_cables_are_named_so():
    """Where two cables share a winch, a column of tensions is a pair's."""
    columns = {"tension": np.ones((4, 3))}
    assert cable_names(columns) == ["cable 1", "cable 2", "cable 3"]
    assert cable_names(columns | {"tension_each": np.ones((4, 6))}) == ["pair 1", "pair 2", "pair 3"]


@pytest.mark.thorough
def test_several_motions_of_a_planar_robot_have_no_view_from_above(tmp_path, figures, capsys):
    file = str(tmp_path / "motion.h5")
    assert plan(tmp_path, transition_text("transition-planar"), "-o", file)[0] == 0
    figure = drawn(figures, file, file)
    assert figure.axes[0].get_ylabel() == "z (m)" and len(figure.axes) == 3
    assert len(figure.legends[0].get_texts()) == 2


@pytest.mark.ci("summary-size4", "trajectory-size2")
@pytest.mark.quick("trajectory-size0")
@pytest.mark.parametrize(
    ("quantity", "size"),
    [
        ("trajectory", []),
        ("summary", ["--column"]),
        *(
            pytest.param(*case, marks=pytest.mark.thorough)
            for case in (
                ("trajectory", ["--column"]),
                ("trajectory", ["--page", "--no-title"]),
                ("summary", []),
                ("summary", ["--page", "--no-title"]),
            )
        ),
    ],
)
def test_a_robot_in_space_fills_its_place(motions, figures, capsys, size, quantity):
    """All of it and of its letters is in the picture, one scale holds for all axes, and no two words meet."""
    figure = drawn(figures, str(motions / "first.h5"), "--quantity", quantity, *size)
    figure.draw_without_rendering()
    space = next(panel for panel in figure.axes if panel.name == "3d")
    place = space.get_gid()
    assert place == FILLS
    boxes = [*words_in_space(space), box_in_space(space)]
    union = Bbox.union(boxes)
    assert figure.bbox.padded(1.0).count_contains([union.min, union.max]) == 2
    sizes = [abs(np.subtract(*getattr(space, f"get_{axis}lim")())) for axis in "xyz"]
    np.testing.assert_allclose(space._box_aspect / sizes, (space._box_aspect / sizes)[0])
    words = words_in_space(space)
    assert not any(one.overlaps(other) for k, one in enumerate(words) for other in words[:k])


@pytest.mark.thorough
def test_presets_and_titles(motions, figures, capsys):
    """A title of a narrow picture has one line; none is drawn if none is wanted, but what is not proved is said."""
    for words, width in ((["--column"], 8.89), (["--page"], 17.5)):
        for quantity in ("tensions", "summary", "trajectory"):
            figure = drawn(figures, str(motions / "first.h5"), "--quantity", quantity, *words)
            assert figure.get_figwidth() * 2.54 == pytest.approx(width)
            title = figure.suptitle(figure.get_suptitle())
            assert width > 12.0 or "\n" not in title.get_text()
            assert title.get_window_extent().width <= figure.bbox.width
            figure.draw_without_rendering()
            assert share_of_panels(figure) >= 0.5
    assert drawn(figures, str(motions / "first.h5"), "--no-title").get_suptitle() == ""
    for words in (["--no-title"], ["--column"]):
        figure = drawn(figures, str(motions / "second.h5"), *words)
        assert "NOT PROVED FEASIBLE" in figure.get_suptitle()
    assert main(["plot", str(motions / "first.h5"), "--column", "--size", "10x10"]) == 2
    assert "cannot be combined with --column" in capsys.readouterr().err


@pytest.mark.thorough
def test_speeds_have_their_limits(motions, figures, capsys):
    figure = drawn(figures, str(motions / "first.h5"), "--quantity", "summary")
    rates = next(panel for panel in figure.axes if panel.get_ylabel() == "cable speed (m/s)")
    assert rates.get_legend().get_texts()[0].get_text().startswith("at most 9 m/s")


def test_negative_numbers_have_a_minus_sign():
    assert with_minus("from -3.5 to -.5 m, e-3, rig-2, 1e-05") == "from \u22123.5 to \u2212.5 m, e-3, rig-2, 1e-05"
