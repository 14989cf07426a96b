"""What the other commands print and draw, and the package from Python."""

import json
from pathlib import Path

import h5py
import jax
import matplotlib.colors
import numpy as np
import pytest
from reliability.support import go, sweep_of
from support.reading import read_here

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.errors import ConfigError, InputError, StoreError
from cspr_jax.outputs.plan_report import plan_object
from cspr_jax.outputs.plots.draw import _map_figure
from cspr_jax.outputs.plots.maps.sections import NONE_COLOUR
from cspr_jax.schema.quantities import AXES, FAILURES, FLIGHT, PATHS, QUANTITIES, SEGMENTS, TRAJECTORY, flag_attributes
from cspr_jax.schema.verdicts import SENTENCES
from cspr_jax.store.files.netcdf import make_datasets, new_hdf5
from cspr_jax.store.reading.result import Result

ROOT = Path(__file__).parents[2]
SHAPE = {"x": 5, "y": 4, "z": 8, "z0": 1}
PLAN = """schema = 1
robot = "prototype"
z0 = 1.7
[[pose]]
position = [-1.1, -1.1, 0.5]
[[pose]]
position = [-1.1, -0.9, 1.5]
"""


@pytest.fixture(autouse=True)
def files_are_read_here(monkeypatch):
    """By this process; how another one reads them is for reliability/test_hostile_results.py."""
    read_here(monkeypatch)


def cspr(capsys, *arguments: object, code: int = 0) -> str:
    """Standard output of a command, or its one line of error."""
    found = main([str(argument) for argument in arguments])
    printed = capsys.readouterr()
    assert found == code, printed.err
    if code:
        assert printed.err.startswith("cspr: ") and len(printed.err.splitlines()) == 1, printed.err
    return printed.err if code else printed.out


def strict_json(text: str) -> object:
    assert text.count("\n") == 1
    return json.loads(text, parse_constant=lambda word: pytest.fail(word))


def test_table_2_1(capsys):
    found = strict_json(cspr(capsys, "table", "2.1", "--json"))
    assert (found["schema"], found["table"]) == (1, "2.1")
    cells = {(cell["row"], cell["column"]): cell for cell in found["cells"]}
    assert set(cells) == {(str(row), name) for row in range(1, 7) for name in ("feasible_at_infinity", "p", "T")}
    printed = {
        "1": (-0.1557, 5, 6.54),
        "2": (-0.1416, 2, 2.61),
        "3": (0.2057, 5, 6.54),
        "4": (0.8208, 5, 6.53),
        "5": (0.8494, 5, 6.52),
        "6": (0.5425, 6, 7.85),
    }
    for row, values in printed.items():
        for name, close, value in zip(("feasible_at_infinity", "p", "T"), (5e-5, 0, 0.005), values, strict=True):
            assert cells[row, name]["published"] == value
            assert cells[row, name]["computed"] == pytest.approx(value, abs=close)
    people = cspr(capsys, "table", "2.1")
    assert all(text in people for text in ("-0.1557 / -0.1557", "5 / 5", "6.54 / 6.54", "7.85 / 7.85", "published"))
    assert "!=" not in people.partition("Each cell")[0] and len([x for x in people.splitlines() if x[:1] == "│"]) == 6
    assert "\n2.1  Dion-Gauvin" in cspr(capsys, "table", "--list")
    assert "must be one of 1.1, " in cspr(capsys, "table", "9.9", code=2)
    assert "must be one of 1.1, " in cspr(capsys, "table", code=2)


def test_robots(capsys):
    found = {robot["name"]: robot for robot in strict_json(cspr(capsys, "robots", "--json"))}
    assert {"prototype", "cdpyr-3t", "laval-large", "transition-prototype"} <= set(found)
    assert found["prototype"]["mass"] == 0.198 and len(found["prototype"]["base_points"]) == 3
    assert "placeholder" in found["laval-large"]["source"]
    people = cspr(capsys, "robots")
    assert all(name in people for name in found) and "placeholder" in people
    for name in found:
        robot = cspr_jax.load_robot(name)
        assert float(robot.mass) == found[name]["mass"]


def test_quantities(capsys):
    found = {(row["group"], row["name"]): row for row in strict_json(cspr(capsys, "quantities", "--json"))}
    tables = {"axis": AXES, "map": QUANTITIES, "motion": TRAJECTORY, "segment": SEGMENTS}
    tables |= {"flight": FLIGHT, "failure": FAILURES, "path": PATHS}
    assert set(found) == {(group, name) for group, table in tables.items() for name in table}
    assert found["map", "duration"]["units"] == "s" and found["motion", "tension"]["units"] == "N"
    people = cspr(capsys, "quantities")
    assert all(name in people for _, name in found)


def test_verdicts_have_names_and_sentences():
    assert set(SENTENCES) == {flag for flag in cspr_jax.Verdict if flag}
    assert cspr_jax.Verdict(0).text == "feasible" and cspr_jax.Verdict(513).text == "slack_cable+no_arcs"
    flags = flag_attributes()
    assert len(flags["flag_masks"]) == len(set(flags["flag_masks"])) == len(flags["flag_meanings"].split())


def settings_of(axes: dict[str, list[float]]) -> dict[str, object]:
    """Settings of a sweep over these axes."""
    robot = {"name": "prototype", "mass": 0.2, "base_points": (np.eye(3) * 0.3).tolist(), "z_axis": "down"}
    start = {"from": {"position": [0.7, 0.7, 3.0]}}
    return {
        "schema": 1,
        "map": "minimum-arcs",
        "robot": robot,
        "axes": axes,
        "trajectory": start,
        "dimensions": list(axes),
    }


def made(path: Path, sizes: dict[str, int] = SHAPE, **attributes: object) -> Path:
    """A map with invented numbers: arcs 10 x + y + z from 0 on, margins from -2 up."""
    axes = {name: np.linspace(0.5, 1.5, size) if size > 1 else np.array([1.7]) for name, size in sizes.items()}
    index = np.indices(tuple(sizes.values()))
    arcs = sum(i * w for i, w in zip(index, (10, 1, 1, 0), strict=True))
    known = {"map": "minimum-arcs", "robot": "prototype", "z_axis": "down", "base_points": np.eye(3) * 0.3}
    known["settings"] = json.dumps(settings_of({name: points.tolist() for name, points in axes.items()}))
    store, tile = ["arcs", "margin"], tuple(sizes.values())
    with new_hdf5(path, known | attributes) as file:
        make_datasets(file, axes, store, dtype="float64", tile=tile)
        file["arcs"][...], file["margin"][...] = arcs, arcs / 4.0 - 2.0
    return path


def panels(figure) -> list:
    return [panel for panel in figure.axes if panel.get_visible() and panel.get_label() != "<colorbar>"]


@pytest.mark.thorough
def test_a_map_is_drawn_as_six_sections(capsys, tmp_path, figures):
    cspr(capsys, "plot", made(tmp_path / "map.h5"))
    figure = figures[0]
    drawn = panels(figure)
    assert [panel.get_title() for panel in drawn] == [
        f"z = {z:.3g} m" for z in np.linspace(0.5, 1.5, 8)[[0, 1, 3, 4, 6, 7]]
    ]
    assert {panel.get_xlabel() for panel in drawn} == {"", "x (m)"} and drawn[-1].get_xlabel() == "x (m)"
    assert {panel.get_ylabel() for panel in drawn} == {"", "y (m)"} and drawn[0].get_ylabel() == "y (m)"
    title = figure.get_suptitle()
    assert all(word in title for word in ("prototype", "arcs", "from (0.7, 0.7, 3) m", "z0 = 1.7 m", "z axis down"))
    for panel, k in zip(drawn, (0, 1, 3, 4, 6, 7), strict=True):
        mesh = panel.collections[0]
        wanted = 10 * np.arange(5)[None, :] + np.arange(4)[:, None] + k
        np.testing.assert_array_equal(mesh.get_array().reshape(4, 5), wanted)
        np.testing.assert_allclose(mesh.get_coordinates()[0, [0, -1], 0], [0.375, 1.625])
        assert mesh.norm.vmin < 0 and mesh.norm.vmax > 50
        assert matplotlib.colors.to_hex(mesh.cmap(mesh.norm(0))) == NONE_COLOUR
        assert len({mesh.cmap(mesh.norm(count)) for count in range(51)}) == 51
    bar = next(panel for panel in figure.axes if panel.get_label() == "<colorbar>")
    assert bar.get_ylabel() == "smallest number of arcs"
    assert [label.get_text() for label in bar.get_yticklabels()][:2] == ["none", "5"]


def test_a_section_of_another_quantity(capsys, tmp_path, figures):
    path = made(tmp_path / "map.h5")
    cspr(capsys, "plot", path, "--quantity", "margin", "--at", "z=1.09")
    (panel,) = panels(figures[0])
    mesh = panel.collections[0]
    np.testing.assert_allclose(mesh.get_array().reshape(4, 5)[2, 3], (30 + 2 + 4) / 4 - 2)
    assert (mesh.norm.vmin, mesh.norm.vmax) == ((0 + 0 + 4) / 4 - 2, (40 + 3 + 4) / 4 - 2)
    assert "z = 1.071 m" in figures[0].get_suptitle()
    cspr(capsys, "plot", path, "--at", "x=0.5")
    assert [panel.get_xlabel() for panel in panels(figures[1])][-1] == "y (m)"
    assert len(panels(figures[1])) == 1 and panels(figures[1])[0].get_ylabel() == "z (m)"


def test_a_map_over_one_axis_is_a_line(capsys, tmp_path, figures):
    cspr(capsys, "plot", made(tmp_path / "map.h5"), "--at", "x=1.5", "--at", "y=0.5")
    (panel,) = panels(figures[0])
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("z (m)", "smallest number of arcs")
    np.testing.assert_array_equal(panel.lines[0].get_ydata(), 40 + np.arange(8))
    assert "x = 1.5 m, y = 0.5 m" in figures[0].get_suptitle()
    line = cspr(capsys, "plot", made(tmp_path / "dot.h5", dict.fromkeys(SHAPE, 1)), code=2)
    assert "more than one point" in line and not figures[1:]


@pytest.mark.thorough
def test_lines(capsys, tmp_path, figures):
    """One line for each point of an axis, a panel for each of the next; several results in one picture."""
    path = made(tmp_path / "map.h5")
    cspr(capsys, "plot", path, "--at", "z=0.5", "--lines", "y")
    (panel,) = panels(figures[0])
    assert [line.get_label() for line in panel.lines] == [f"y = {y:.3g} m" for y in np.linspace(0.5, 1.5, 4)]
    for k, line in enumerate(panel.lines):
        np.testing.assert_array_equal(line.get_ydata(), 10 * np.arange(5) + k)
    assert len({(line.get_color(), line.get_linestyle()) for line in panel.lines}) == 4
    cspr(capsys, "plot", path, "--lines", "x")
    assert [p.get_title() for p in panels(figures[1])] == [
        f"z = {z:.3g} m" for z in np.linspace(0.5, 1.5, 8)[[0, 1, 3, 4, 6, 7]]
    ]
    other = made(tmp_path / "other.h5")
    cspr(capsys, "plot", path, other, "--at", "x=1.5", "--at", "y=0.5", "--quantity", "margin")
    (panel,) = panels(figures[2])
    assert [line.get_label() for line in panel.lines] == ["map", "other"]
    np.testing.assert_array_equal(panel.lines[1].get_ydata(), (40 + np.arange(8)) / 4.0 - 2.0)
    for arguments, words in (
        ((path, "--lines", "z0"), "--lines"),
        ((path, "--lines", "w"), "--lines"),
        ((path, other), "maps over one axis"),
        ((path, other, "--lines", "y"), "--lines"),
        ((path,) * 7 + ("--at", "x=1", "--at", "y=1"), "at most 6"),
    ):
        assert words in cspr(capsys, "plot", *arguments, code=2)
    assert len(figures) == 3


def test_a_map_over_five_axes_says_which_section_it_is(capsys, tmp_path, figures):
    cspr(capsys, "plot", made(tmp_path / "map.h5", {"x": 3, "y": 3, "z": 2, "z0": 2}))
    assert len(panels(figures[0])) == 2 and "z0 = 0.5 m" in figures[0].get_suptitle()


def test_a_motion_is_drawn(capsys, tmp_path, figures):
    (tmp_path / "plan.toml").write_text(PLAN)
    cspr(capsys, "plan", tmp_path / "plan.toml", "-o", tmp_path / "motion.h5")
    cspr(capsys, "plot", tmp_path / "motion.h5")
    labels = [(panel.get_xlabel(), panel.get_ylabel()) for panel in panels(figures[0])]
    assert labels == [("x (m)", "y (m)"), ("x (m)", "z (m)"), ("time (s)", "tension (N)")]
    tension = cspr_jax.open_result(tmp_path / "motion.h5").data["tension"]
    for k, line in enumerate(panels(figures[0])[2].lines[:3]):
        np.testing.assert_array_equal(line.get_ydata(), tension[:, k])
    assert panels(figures[0])[1].yaxis_inverted() and "z axis down" in figures[0].get_suptitle()


@pytest.mark.quick("a.svg-<?xml")
@pytest.mark.parametrize(("name", "start"), [("a.png", b"\x89PNG"), ("a.pdf", b"%PDF"), ("a.svg", b"<?xml")])
def test_pictures_are_files(capsys, tmp_path, name, start):
    path = made(tmp_path / "map.h5", {"x": 3, "y": 3, "z": 1, "z0": 1})
    assert cspr(capsys, "plot", path, "-o", tmp_path / name) == f"{tmp_path / name}\n"
    assert (tmp_path / name).read_bytes().startswith(start)
    if name == "a.png":
        assert cspr(capsys, "plot", path) == f"{path.with_suffix('.png')}\n"
        assert path.with_suffix(".png").read_bytes() == (tmp_path / name).read_bytes()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--quantity", "arc"], 2, ["--quantity", '"arc"', "arcs, margin"]),
        (["--at", "w=1"], 2, ["--at", '"w"', "x, y, z, z0"]),
        (["--at", "z"], 2, ["--at", "AXIS=VALUE"]),
        (["--at", "z=low"], 2, ["--at", "AXIS=VALUE"]),
        (["--at", "z=nan"], 2, ["--at"]),
        (["-o", "picture.bmp2"], 2, ["picture.bmp2", "png"]),
        (["-o", "none/picture.png"], 4, ["none/picture.png", "cannot be written"]),
    ],
)
def test_a_plot_that_is_asked_wrongly(capsys, tmp_path, monkeypatch, arguments, code, words):
    monkeypatch.chdir(tmp_path)
    line = cspr(capsys, "plot", made(Path("map.h5")), *arguments, code=code)
    assert all(word in line for word in words)
    assert [path.name for path in tmp_path.iterdir()] == ["map.h5"]


def test_the_path_that_is_printed_is_there(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    main(["plot", str(made(Path("map.h5"))), "-o", "picture"])
    assert all(Path(line).is_file() for line in capsys.readouterr().out.splitlines())


def spoil(path: Path, how: str) -> None:
    """Damage a result file, or put another file in its place."""
    content = bytearray(made(path).read_bytes())
    if how in ("text", "truncated", "empty"):
        path.write_bytes({"text": b"schema = 1\n", "truncated": content[: len(content) // 2], "empty": b""}[how])
    elif how == "flipped":
        with h5py.File(path) as file:
            place = file["arcs"].id.get_chunk_info(0)
        content[place.byte_offset + place.size // 2] ^= 0x10
        path.write_bytes(content)
    else:
        with h5py.File(path, "w" if how == "foreign" else "a") as file:
            if how == "foreign":
                file["image"] = np.zeros((4, 4))
            else:
                del file.attrs["map"]


@pytest.mark.parametrize("how", ["text", "truncated", "empty", "flipped", "foreign", "no map"])
def test_a_damaged_or_foreign_file(capsys, tmp_path, how):
    spoil(tmp_path / "map.h5", how)
    assert str(tmp_path / "map.h5") in cspr(capsys, "plot", tmp_path / "map.h5", code=4)
    assert not (tmp_path / "map.png").exists()


def test_a_file_that_is_not_there(capsys, tmp_path):
    assert "none.h5" in cspr(capsys, "plot", tmp_path / "none.h5", code=4)
    assert f"{tmp_path}: " in cspr(capsys, "plot", tmp_path, "-o", tmp_path / "a.png", code=4)
    with pytest.raises(StoreError):
        cspr_jax.open_result(tmp_path / "none.h5")


def test_ten_lines_of_python(tmp_path):
    """What the README shows, in a process in which jax has 32 bits; the caller's setting stays."""
    jax.config.update("jax_enable_x64", False)
    try:
        robot = cspr_jax.load_robot("prototype")
        targets = np.array([[-1.1, -1.1, 0.5], [0.0, 0.0, -0.5]])
        answers = cspr_jax.minimum_arcs(robot, targets, start=np.array([0.7, 0.7, 3.0]), z0=1.7)
        assert answers.arcs.tolist() == [5, 0] and answers.duration.dtype == np.float64
        assert cspr_jax.Verdict(int(answers.verdict[1])) & cspr_jax.Verdict.ABOVE_SPOOLS
        (tmp_path / "plan.toml").write_text(PLAN)
        found = plan_object(cspr_jax.plan(tmp_path / "plan.toml"))
        assert (found["feasible"], found["segments"][0]["arcs"]) == (True, 2)
        assert not jax.config.read("jax_enable_x64")
    finally:
        jax.config.update("jax_enable_x64", True)
    result = cspr_jax.open_result(str(made(tmp_path / "map.h5")))
    assert result.data["arcs"].shape == tuple(SHAPE.values()) and list(result.axes) == list(SHAPE)
    assert result.units["x"] == "m" and result.is_map


def test_public_names():
    for name in cspr_jax.__all__:
        assert getattr(cspr_jax, name) is not None
    assert cspr_jax.amplitude("effective", 0.1).name
    with pytest.raises(AttributeError, match="minimal_arcs"):
        _ = cspr_jax.minimal_arcs


@pytest.mark.parametrize(
    "changed",
    [
        {"targets": np.zeros(3)},
        {"targets": np.zeros((2, 2))},
        {"targets": np.zeros((0, 3))},
        {"targets": np.array([[0.0, np.nan, 1.0]])},
        {"start": np.zeros(2)},
        {"start": np.array([0.0, 0.0, np.inf])},
        {"z0": -1.0},
        {"z0": np.nan},
        {"z0": np.inf},
        {"z0": np.array([1.7, 1.7, 1.7])},
        {"max_arcs": 0},
        {"amplitude": cspr_jax.amplitude("A1")},
    ],
)
def test_arguments_that_do_not_fit(prototype, changed):
    arguments = {"targets": np.array([[0.1, 0.2, 1.5], [0.3, 0.1, 1.2]]), "z0": 1.7} | changed
    with pytest.raises(InputError, match="must be") as raised:
        cspr_jax.minimum_arcs(prototype, arguments.pop("targets"), **arguments)
    assert str(raised.value).startswith(next(iter(changed)))


def test_robots_that_do_not_fit(tmp_path):
    with pytest.raises(InputError, match="base_points"):
        cspr_jax.point_mass_robot(np.zeros((4, 3)), mass=1.0)
    with pytest.raises(InputError, match="mass"):
        cspr_jax.point_mass_robot(np.eye(3), mass=np.inf)
    with pytest.raises(ConfigError, match="did you mean prototype"):
        cspr_jax.load_robot("prototyp")
    text = 'name = "up"\nmass = 1\nz_axis = "up"\nbase_points = [[0, 0, 1], [1, 0, 1], [0, 2, 1]]\n'
    (tmp_path / "up.toml").write_text(text)
    robot = cspr_jax.load_robot(tmp_path / "up.toml")
    assert (robot.base_points.tolist(), robot.z_axis) == ([[0, 0, 1], [1, 0, 1], [0, 2, 1]], "up")


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("z=77", '"z=77": must be z in [0.5, 1.5]'),
        ("z=0.4999", "must be z in [0.5, 1.5]"),
        ("z=1.5001", "must be z in [0.5, 1.5]"),
        ("z0=1.6", '"z0=1.6": must be z0 = 1.7'),
        ("tilt=0", '"tilt": must be one of x, y, z, z0'),
    ],
)
def test_a_value_out_of_its_axis_is_refused(capsys, tmp_path, asked, words):
    assert words in cspr(capsys, "plot", made(tmp_path / "map.h5"), "--at", asked, code=2)
    assert not (tmp_path / "map.png").exists()


def test_the_nearest_value_is_named(capsys, tmp_path, figures):
    """Between two values; not where the difference is rounding, at the ends too."""
    path = made(tmp_path / "map.h5")
    for asked, words, said in (
        ("z=0.6", "z = 0.6429 m (nearest to 0.6 m)", True),
        ("z=1.5000000001", "z = 1.5 m", False),
        ("z=0.4999999999", "z = 0.5 m", False),
        ("z0=1.7", "z0 = 1.7 m", False),
    ):
        cspr(capsys, "plot", path, "--at", asked)
        title = figures[-1].get_suptitle()
        assert words in title and ("nearest" in title) == said


def test_all_quantities_of_a_file_are_cut_at_the_same_slices(tmp_path, figures):
    """Where only some orientations are accessible, what is drawn of one is drawn of the others."""
    axes = {"torsion": 9, "tilt_azimuth": 4, "tilt": 3}
    points = {name: np.linspace(0.0, 1.0, count) for name, count in axes.items()}
    verdict = np.full(tuple(axes.values()), cspr_jax.Verdict.NOT_ACCESSIBLE.value, np.uint32)
    verdict[1:8] = cspr_jax.Verdict.SLACK_CABLE.value
    arcs = np.zeros(verdict.shape, np.int16)
    arcs[4, :, :2], verdict[4, :, :2] = 3, 0
    data = {"verdict": verdict, "arcs": arcs, "margin": np.where(arcs > 0, 0.5, np.nan)}
    units = dict.fromkeys([*axes, *data], "1")
    result = Result(points, data, units, {name: name for name in units}, {"robot": "r", "map": "orientations"}, {})
    shown = {}
    for name in data:
        figure = _map_figure(result, name, {}, None)
        shown[name] = [panel.get_title() for panel in panels(figure)], panels(figure)[0].get_ylim()
    assert shown["verdict"] == shown["arcs"] == shown["margin"] and len(shown["arcs"][0]) == 6
    del data["verdict"]
    assert [panel.get_title() for panel in panels(_map_figure(result, "arcs", {}, None))] == ["torsion = 0.5"]


def test_a_run_directory_is_drawn(capsys, tmp_path, figures):
    """Its result; one line where it has none."""
    sweep = sweep_of(tmp_path / "s", tiles=4)
    go(sweep, tmp_path / "run")
    result = tmp_path / "run" / "small.h5"
    assert cspr(capsys, "plot", tmp_path / "run") == f"{result.with_suffix('.png')}\n"
    assert "prototype" in figures[0].get_suptitle()
    result.unlink()
    assert "holds no finished result" in cspr(capsys, "plot", tmp_path / "run", code=4)
    result.symlink_to(made(tmp_path / "elsewhere.h5"))
    assert "holds no finished result" in cspr(capsys, "plot", tmp_path / "run", code=4)
    assert "is not a run directory" in cspr(capsys, "plot", tmp_path / "s", code=4)
    assert len(figures) == 1
