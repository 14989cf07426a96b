"""The best point of an axis, such as z0, for each cell of a map: against a search written apart, drawn, on pages."""

import json
import re

import numpy as np
import pytest
from matplotlib.colors import to_hex
from outputs.test_outputs import cspr, panels
from outputs.test_pictures import GRID, bar, made, marked, ticks
from support.reading import read_here

import cspr_jax
from cspr_jax.api.files.reports import report
from cspr_jax.errors import InputError
from cspr_jax.outputs.plots.style.colours import NONE_COLOUR
from cspr_jax.schema.best import best_of
from cspr_jax.schema.columns import Columns
from cspr_jax.schema.quantities import EVERY
from cspr_jax.schema.verdicts import Verdict

DEPTHS = np.array([1.9, 1.0, 1.4, 1.2])
SLACK = (Verdict.SLACK_CABLE | Verdict.NO_ARCS).value
OPEN, FEWER = Verdict.UNDECIDED.value, Verdict.FEWER_ARCS_UNDECIDED.value


@pytest.fixture(autouse=True)
def files_are_read_here(monkeypatch):
    """By this process."""
    read_here(monkeypatch)


def random_map(path, depths=DEPTHS, axis="z0"):
    """Cells of every kind, with many ties, margins that are not known among them."""
    random = np.random.default_rng(7)
    axes = {"x": [0.0, 1.0, 2.0, 3.0], axis: depths, "y": np.arange(5.0), "z": np.arange(4.0)}
    shape = tuple(len(points) for points in axes.values())
    flags = random.choice(
        [0, FEWER, OPEN, SLACK, SLACK | Verdict.CABLE_TOO_FAST.value], shape, p=[0.2, 0.1, 0.1, 0.5, 0.1]
    )
    passed = (flags & ~FEWER) == 0
    data = {
        "arcs": np.where(passed, random.integers(1, 4, shape), 0).astype(np.int16),
        "tried_arcs": random.integers(1, 9, shape).astype(np.int16),
        "verdict": flags.astype(np.uint32),
        "margin": random.choice([np.nan, -0.1, 0.2, 0.2, 0.3], shape),
        "duration": random.choice([1.0, 2.0], shape),
    }
    return cspr_jax.open_result(made(path, axes, data)), data


def best_by_search(flags, arcs, margins, durations):
    """Of one cell: its point, and its verdict, candidate by candidate."""
    feasible = [k for k, flag in enumerate(flags) if flag & ~FEWER == 0]
    unsure = [k for k, flag in enumerate(flags) if flag == OPEN]
    best = None
    for k in feasible or unsure or range(len(flags)):
        score = (arcs[k] if feasible else 0, -np.inf if np.isnan(margins[k]) else margins[k], durations[k])
        if best is None or (score[0], -score[1], score[2]) < (best[1][0], -best[1][1], best[1][2]):
            best = k, score
    verdict = int(flags[best[0]])
    if feasible and arcs[best[0]] > 1 and any(flag & (OPEN | FEWER) for flag in flags):
        verdict |= FEWER
    return best[0], verdict, bool(feasible)


def test_every_cell_has_its_best_point(tmp_path):
    """Fewest arcs of those that are feasible, then the largest margin; undecided only where none is feasible."""
    result, data = random_map(tmp_path / "map.h5")
    found = result.best("z0")
    assert list(found.axes) == ["x", "y", "z"] and list(result.axes) == ["x", "z0", "y", "z"]
    assert set(found.data) == {*data, "best_z0"} and found.units["best_z0"] == "m"
    kinds = set()
    for i, j, k in np.ndindex(4, 5, 4):
        columns = [data[name][i, :, j, k].tolist() for name in ("verdict", "arcs", "margin", "duration")]
        place, verdict, feasible = best_by_search(*columns)
        kinds.add((feasible, verdict == OPEN, bool(verdict & FEWER)))
        assert found.data["verdict"][i, j, k] == verdict
        for name in set(data) - {"verdict"}:
            np.testing.assert_equal(found.data[name][i, j, k], data[name][i, place, j, k])
        np.testing.assert_equal(found.data["best_z0"][i, j, k], DEPTHS[place] if feasible else np.nan)
        assert found.coordinates((i, j, k)) == {"x": i, "y": j, "z": k, "z0": DEPTHS[place]}
    assert len(kinds) == 4  # feasible surely with the fewest arcs and not, undecided, none


def test_several_axes_are_one_choice(tmp_path):
    """The best over z0 and z in either order: as good, from a point that has these numbers."""
    result, data = random_map(tmp_path / "map.h5")
    both = [result.best("z0", "z"), result.best("z").best("z0")]
    for name in ("arcs", "margin", "verdict"):
        np.testing.assert_array_equal(both[0].data[name], both[1].data[name])
    for found in both:
        for index in np.ndindex(4, 5):
            place = found.coordinates(index)
            where = index[0], int(np.argmax(place["z0"] == DEPTHS)), index[1], int(place["z"])
            assert all(
                np.array_equal(found.data[name][index], data[name][where], equal_nan=True)
                for name in ("arcs", "margin")
            )


def test_margins_and_whole_cells_of_workspaces(tmp_path):
    """The largest margin; a whole cell is inside for some tilt, and outside only for every one."""
    margins = np.array([[-3.0, 2.0, -np.inf], [-3.0, -1.0, -2.0], [5.0, -1.0, 7.0]])
    verdicts = np.where(margins > 0.0, 0, Verdict.WRENCH_INFEASIBLE.value).astype(np.uint32)
    sides = np.array([[2, 0, 2], [2, 2, 2], [1, 2, 0]], np.int16)
    data = {"verdict": verdicts, "wrench_margin": margins, "cell_side": sides}
    data = {name: values[:, None, None] for name, values in data.items()}
    axes = {"x": [0.0, 1.0, 2.0], "y": [0.0], "z": [1.0], "tilt": [0.0, 0.5, 1.0]}
    result = cspr_jax.open_result(made(tmp_path / "map.h5", axes, data, "workspace")).best("tilt")
    found = {name: values.ravel().tolist() for name, values in result.data.items()}
    assert found["wrench_margin"] == [2.0, -1.0, 7.0] and found["cell_side"] == [0, 2, 1]
    np.testing.assert_array_equal(found["best_tilt"], [0.5, np.nan, 1.0])


@pytest.mark.parametrize(
    ("kind", "name", "values", "best"),
    [
        ("sensitivity", "sigma_p", [3.0, 1.5, np.inf], 1),
        ("least-time", "duration", [np.nan, 2.0, 1.5], 2),
        ("attainability", "attainable_fraction", [0.2, 0.9, np.nan], 1),
        ("launch-range", "release_speed", [4.0, np.nan, 3.0], 2),
        ("minimum-oscillations", "oscillations", [0, 3, 2], 2),
        ("feasible-acceleration", "acceleration_margin", [-1.0, 0.5, 0.2], 1),
    ],
)
def test_each_kind_of_map_has_its_own_best(tmp_path, kind, name, values, best):
    axes = {"x": [0.0], "y": [0.0], "z": [1.0, 2.0, 3.0]}
    data = {name: np.array(values, np.int16 if EVERY[name].kind == "int16" else float)}
    found = cspr_jax.open_result(made(tmp_path / "map.h5", axes, data, kind)).best("z")
    assert found.data["best_z"] == best + 1 and found.data[name] == values[best]


def test_answers_at_their_best_depth():
    """Of a search from Python whose targets are a product with z0: what a map says."""

    class Answers(Columns):
        def __init__(self) -> None:
            self.arcs, self.margin = np.array([4, 0, 2, 2, 0, 0]), np.array([0.5, -0.5, 0.1, 0.2, -0.2, -0.1])
            self.verdict = np.where(self.arcs > 0, 0, SLACK)
            self.beta_hat = np.arange(12.0).reshape(6, 2)

    found = Answers().best("z0", {"target": range(2), "z0": [1.0, 1.5, 2.0]})
    assert found["arcs"].tolist() == [2, 2] and found["margin"].tolist() == [0.1, 0.2]
    assert found["best_z0"].tolist() == [2.0, 1.0] and found["beta_hat"].tolist() == [[4.0, 5.0], [6.0, 7.0]]
    with pytest.raises(InputError, match="must be one of target, z0"):
        Answers().best("z", {"target": range(2), "z0": [1.0, 1.5, 2.0]})
    with pytest.raises(InputError, match="whose product has 6 points"):
        Answers().best("z0", {"target": range(4), "z0": [1.0, 1.5, 2.0]})


def test_a_picture_says_what_it_chose(capsys, tmp_path, figures):
    """The axis in words, a colour for each of its points, no P0, which is not one place."""
    path = tmp_path / "map.h5"
    shape = (5, 5, 3, 4)
    arcs = np.zeros(shape, np.int16)
    arcs[:3] = 1 + np.arange(4)[::-1]
    made(path, GRID | {"z0": DEPTHS}, {"arcs": arcs})
    cspr(capsys, "plot", path, "--best", "z0")
    cspr(capsys, "plot", path, "--best", "z0", "--quantity", "best_z0")
    assert figures[0].get_suptitle().splitlines() == [
        "robot: smallest number of arcs",
        "from rest, best z0 of 4 (1 to 1.9 m), z axis down",
    ]
    for panel in panels(figures[0]):
        assert marked(panel) == {} and panel.collections[0].get_array().reshape(5, 5)[0].tolist() == [1, 1, 1, 0, 0]
    mesh = panels(figures[1])[0].collections[0]
    cells = mesh.get_array().reshape(5, 5)
    assert cells[0].tolist() == [1.2, 1.2, 1.2, None, None] and ticks(bar(figures[1])) == ["1", "1.2", "1.4", "1.9"]
    colours = [to_hex(mesh.cmap(mesh.norm(depth))) for depth in sorted(DEPTHS)]
    assert len({*colours, NONE_COLOUR}) == 5
    assert figures[1].legends[0].get_texts()[0].get_text() == "no value"


@pytest.mark.thorough
def test_a_picture_says_that_it_shows_the_first(capsys, tmp_path, figures):
    """Of an axis for which it has no room, and that nobody fixed."""
    path = made(tmp_path / "map.h5", GRID | {"z0": DEPTHS})
    cspr(capsys, "plot", path)
    cspr(capsys, "plot", path, "--at", "z0=1.4")
    titles = [figure.get_suptitle().splitlines()[1] for figure in figures]
    assert titles == ["from rest, z0 = 1.9 m (the first of 4), z axis down", "from rest, z0 = 1.4 m, z axis down"]
    turns = {"tilt_azimuth": [0.0, 2.0, 4.0], "tilt": [0.0, 0.3, 0.6], "torsion": [-0.1, 0.1]}
    orientations = {"x": [0.0], "y": [0.0], "z": [1.0]} | turns | {"z0": DEPTHS}
    data = {"verdict": np.zeros((1, 1, 1, 3, 3, 2, 4), np.uint32)}
    cspr(capsys, "plot", made(tmp_path / "o.h5", orientations, data, "orientations"), "--envelope")
    assert "z0 = 1.9 m (the first of 4)" in figures[2].get_suptitle()
    space = {"x": np.arange(3.0), "y": np.arange(3.0), "z": [1.0], "tilt": [0.3, 0.6]}
    verdicts = np.zeros((3, 3, 1, 2), np.uint32)
    verdicts[1:] = Verdict.WRENCH_INFEASIBLE.value
    two = [made(tmp_path / f"{name}.h5", space, {"verdict": verdicts}, "workspace") for name in "ab"]
    cspr(capsys, "plot", *two, "--at", "tilt=0.6", "-o", tmp_path / "two.png")
    cspr(capsys, "plot", *two, "--best", "tilt", "-o", tmp_path / "best.png")
    assert "best tilt of 2 (17.2 to 34.4°)" in figures[4].get_suptitle()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--best", "z9"], '--best = "z9": must be one of x, y, z, z0'),
        (["--best", "z0", "--best", "z0"], '--best = "z0": must be one of x, y, z'),
        (["--best", "z0", "--at", "z0=1.4"], '--at = "z0": did you mean z? must be one of x, y, z'),
        (
            ["--best", "z0", "--lines", "z0"],
            '--lines = "z0": did you mean z? must be one of two or more axes that vary',
        ),
        (["--quantity", "best_z0"], '--quantity = "best_z0": must be one of arcs'),
    ],
)
def test_what_cannot_be_chosen(capsys, tmp_path, options, told):
    path = made(tmp_path / "map.h5", GRID | {"z0": DEPTHS})
    assert told in cspr(capsys, "plot", path, *options, code=2)
    if "--best" in options and "--lines" not in options and "--at" not in options:
        assert told in cspr(capsys, "report", path, *options, code=2)
    assert sorted(tmp_path.iterdir()) == [path]


def test_instants_and_cables_are_no_choice(tmp_path):
    axes = {"x": [0.0], "y": [0.0], "z": [1.0], "z0": [1.0, 2.0], "tau": [0.0, 1.0], "cable": [1.0, 2.0]}
    result = cspr_jax.open_result(
        made(tmp_path / "map.h5", axes, {"lower_envelope": np.ones((1, 1, 1, 2, 2, 2))}, "transition-envelopes")
    )
    for axis in ("tau", "cable"):
        with pytest.raises(InputError, match="must be one of x, y, z, z0"):
            result.best(axis)
    with pytest.raises(InputError, match="no stored quantity says which cell is better"):
        best_of({"feasible_at_infinity": np.ones(2)}, "z0", np.arange(2.0), 0)


@pytest.mark.thorough
def test_a_page_of_the_best_points(tmp_path):
    """Its cells are those of the reduced map, and motions of cells start from P0 at the depth chosen."""
    axes = {"x": [0.2, 0.4], "y": [0.0, 0.1], "z": [1.0], "z0": [1.0, 1.5]}
    arcs = np.array([[2, 3], [3, 2], [0, 0], [2, 0]], np.int16).reshape(2, 2, 1, 2)
    verdict = np.where(arcs > 0, 0, SLACK).astype(np.uint32)
    path = made(tmp_path / "map.h5", axes, {"arcs": arcs, "verdict": verdict})
    chosen = [{"x": 0.2, "y": 0.1}]
    assert report(path, tmp_path / "p.html", trajectories=0, cells=chosen, best="z0", quantity="best_z0") == []
    text = (tmp_path / "p.html").read_text("utf-8")
    content = json.loads(re.search(r'id="content">(.*?)</script>', text, re.DOTALL)[1])
    assert [axis["name"] for axis in content["map"]["axes"]] == ["z", "y", "x"]
    assert content["map"]["quantities"][0]["label"] == "best depth of P0 below the centroid (m)"
    assert "best z0 of 2 (1 to 1.5 m)" in content["map"]["notes"]
    (motion,) = content["motions"]
    assert motion["title"] == "x = 0.2 m, y = 0.1 m, z0 = 1.5 m"


def test_best_points_for_xarray(tmp_path):
    pytest.importorskip("xarray")
    found = random_map(tmp_path / "map.h5")[0].best("z0").to_xarray()
    assert found.attrs["best_over"] == "z0" and found.best_z0.dims == ("x", "y", "z")
    assert found.best_z0.attrs["units"] == "m" and found.best_z0.attrs["long_name"].startswith("best depth of P0")
