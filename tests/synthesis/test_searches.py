"""Searches: fronts, fractions, numbers that jump, arrangements; and their directories, stopped and resumed."""

import json
import signal
import subprocess
import sys
import time
import tomllib

import numpy as np
import pytest

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.config.formats.writing import robot_text
from cspr_jax.config.reading import read_toml
from cspr_jax.errors import RefusedError, StoreError
from cspr_jax.synthesis.evaluations import front_of
from tests.synthesis.problems import (
    BODY,
    EIGHT,
    FEASIBLE,
    MARGIN,
    PLANAR,
    PROBLEMS,
    RECTANGLE,
    design,
    objective,
    parameter,
)

WIDE = objective("frame", "extent_x", "smallest")
BOTH = PROBLEMS["planar margin"] | {"objective": [MARGIN, WIDE], "requirement": [FEASIBLE], "search": {"front": 4}}
LEFT_OUT = ("LOCK", "identity.json")


def files_of(directory):
    """Bytes of all files that a search writes."""
    return {path.name: path.read_bytes() for path in sorted(directory.iterdir()) if path.name not in LEFT_OUT}


def test_fronts_of_pairs():
    random = np.random.default_rng(0)
    for _ in range(20):
        values = random.integers(0, 6, (30, 2)).astype(float)
        surpassed = [any((other >= one).all() and (other > one).any() for other in values) for one in values]
        kept = front_of(values)
        assert not np.logical_and(kept, surpassed).any()
        assert {tuple(one) for one in values[kept]} == {tuple(one) for one in values[~np.array(surpassed)]}


def test_the_front_of_two_objectives(tmp_path):
    result = cspr_jax.design(BOTH, tmp_path / "out")
    margins, widths = np.array([robot.values[:2] for robot in result.robots]).T
    assert len(result.robots) == 4 and result.feasible
    assert (np.diff(margins) < 0).all() and (np.diff(widths) < 0).all()
    assert margins[0] == pytest.approx(4.466455, rel=1e-5) and margins[-1] == pytest.approx(0.0, abs=1e-6)
    # Robots of the files are those of the results, and meet what is said.
    for robot in result.robots:
        path = tmp_path / "out" / f"{robot.name}.toml"
        spools = np.asarray(cspr_jax.load_robot(path).base_points)
        assert np.ptp(spools[:, 0]) == pytest.approx(robot.values[1], rel=1e-12)
        sweep = RECTANGLE | {"schema": 1, "robot": str(path), "run": {"store": ["verdict", "wrench_margin"]}}
        data = cspr_jax.open_result(cspr_jax.run(sweep, tmp_path / robot.name)).data
        assert data["verdict"].max() == 0 and data["wrench_margin"].min() == pytest.approx(robot.values[0], abs=1e-9)
    numbers = json.loads((tmp_path / "out" / "design.json").read_text())
    assert numbers == result.to_dict() and numbers["complete"]
    assert [one["name"] for one in numbers["robots"]] == [robot.name for robot in result.robots]


def test_a_fraction_of_cells(tmp_path):
    wide = RECTANGLE | {
        "axes": {"x": {"start": -2, "stop": 2, "count": 21}, "y": [0], "z": {"start": 0.5, "stop": 1.5, "count": 11}}
    }
    data = design(PLANAR, objective("places", "fraction", "largest"), maps={"places": wide}, search={"generations": 3})
    best = cspr_jax.design(data, tmp_path / "out").best
    x, z = np.meshgrid(np.linspace(-2, 2, 21), np.linspace(0.5, 1.5, 11))
    fractions = []
    for half in np.linspace(0.5, 4.0, 1401):
        weight = 2.0 * 9.81 / (2.0 * half * z)
        tensions = weight * (half - x) * np.hypot(x + half, z), weight * (half + x) * np.hypot(half - x, z)
        fractions.append(np.mean((np.minimum(*tensions) >= 1.0) & (np.maximum(*tensions) <= 30.0)))
    assert best.values[0] == pytest.approx(max(fractions))


@pytest.mark.parametrize("bounds", [{"upper": 0.5}, {"lower": 0.0}, {"lower": 0.4, "upper": 0.9}], ids=str)
def test_fractions_as_requirements(tmp_path, bounds):
    data = design(PLANAR, WIDE, [{"of": "places", "quantity": "fraction", **bounds}], maps={"places": RECTANGLE})
    result = cspr_jax.design(data | {"search": {"screen": 16, "generations": 2}}, tmp_path / "out")
    assert result.feasible and bounds.get("lower", 0.0) <= result.best.values[1] <= bounds.get("upper", 1.0)


def test_a_fraction_leaves_the_worst_cells_out(tmp_path):
    """The smallest width with which 16 of 20 places are held, by tensions in closed form."""
    requirement = {"of": "places", "quantity": "fraction", "lower": 0.8}
    best = cspr_jax.design(design(PLANAR, WIDE, [requirement], maps={"places": RECTANGLE}), tmp_path / "out").best
    x, z = np.meshgrid(np.linspace(-0.8, 0.8, 5), np.linspace(0.5, 1.5, 4))
    for half in np.linspace(0.5, 1.0, 50_001):
        weight = 2.0 * 9.81 / (2.0 * half * z)
        tensions = weight * (half - x) * np.hypot(x + half, z), weight * (half + x) * np.hypot(half - x, z)
        if np.mean((np.minimum(*tensions) >= 1.0) & (np.maximum(*tensions) <= 30.0)) >= 0.8:
            break
    assert best.values == (pytest.approx(2.0 * half, abs=3e-5), pytest.approx(0.8))


def test_the_front_of_a_fraction(tmp_path):
    """Neither objective is surpassed by another robot of the front; numbers that jump need no derivatives."""
    data = design(PLANAR, WIDE, maps={"places": RECTANGLE}, search={"screen": 16, "generations": 2, "front": 4})
    data["objective"] = [objective("places", "fraction", "largest"), WIDE]
    result = cspr_jax.design(data, tmp_path / "out")
    fractions, widths = np.array([robot.values for robot in result.robots]).T
    assert (np.diff(fractions) < 0).all() and (np.diff(widths) < 0).all() and fractions[0] == 1.0


def test_margins_without_end_are_the_best(tmp_path):
    """Cables without a largest tension hold a body between upper and lower spools with any margin."""
    drop = parameter("drop", 0.2, 0.1, 4.0, {"base_points[2][2]": 1, "base_points[3][2]": 1})
    points = [[-2, 0, 0], [2, 0, 0], [2, 0, 0], [-2, 0, 0]]
    robot = BODY | {"base_points": points, "parameter": [drop]}
    places = {"map": "workspace", "axes": {"x": [0], "y": [0], "z": [1.0]}, "limits": {"tension_min": 1}}
    result = cspr_jax.design(design(robot, MARGIN, maps={"places": places}), tmp_path / "out")
    assert result.best.values[0] == np.inf and not result.best.sensitivities.holdings


def prices_of(result):
    return {one.by: one.price for one in result.best.sensitivities.holdings}


def test_prices_are_changes_of_the_objective(tmp_path):
    """A smaller width needs a smaller bound, and costs nothing else."""
    result = cspr_jax.design(design(PLANAR, WIDE, maps={"places": RECTANGLE}), tmp_path / "out")
    assert prices_of(result) == {"its lower bound, 1": pytest.approx(1.0)}
    largest = objective("frame", "extent_x", "largest")
    result = cspr_jax.design(design(PLANAR, largest, maps={"places": RECTANGLE}), tmp_path / "largest")
    assert prices_of(result) == {"its upper bound, 8": pytest.approx(1.0)}


def test_words_name_cells_that_parameters_move(tmp_path):
    moves = {"maps.places.axes.x.start": -1, "maps.places.axes.x.stop": 1}
    half = parameter("half", 0.8, 0.1, 0.8, moves)
    data = PROBLEMS["planar margin"] | {"parameter": [half], "search": {"screen": 8, "starts": 1}}
    best = cspr_jax.design(data, tmp_path / "out").best
    assert best.parameters["half"] == pytest.approx(0.1)
    words = [one.by for one in best.sensitivities.holdings if "at x = " in one.by]
    assert words and all(abs(float(text.partition("x = ")[2].partition(",")[0])) <= 0.1 for text in words)


def test_robots_that_some_values_do_not_give(tmp_path):
    """A parameter moves another one, and both together pass its bounds: then robots are no lanes."""
    chain = parameter("chain", 0.0, -0.2, 0.2, {"parameter.width": 4.0})
    data = PROBLEMS["planar margin"] | {"robot": PLANAR | {"parameter": [*PLANAR["parameter"], chain]}}
    best = cspr_jax.design(data | {"search": {"screen": 16, "starts": 1}}, tmp_path / "out").best
    assert best.values[0] == pytest.approx(4.466455, rel=1e-3)


def test_a_search_that_is_stopped_at_once(tmp_path):
    result = cspr_jax.design(PROBLEMS["planar width"], tmp_path / "out", stopped=lambda: True)
    assert not result.to_dict()["complete"] and result.best.parameters["width"] == 2.0
    assert cspr_jax.design(PROBLEMS["planar width"], tmp_path / "out").to_dict()["complete"]


def test_long_names_and_short_tables(tmp_path):
    data = PROBLEMS["planar width"] | {"robot": PLANAR | {"name": "n" * 200}}
    cspr_jax.design(data, tmp_path / "out")
    assert cspr_jax.load_robot(tmp_path / "out" / "best.toml").name.endswith("n-best")
    before = files_of(tmp_path / "out")
    (tmp_path / "out" / "evaluations.csv").write_bytes(b"wid")
    cspr_jax.design(data, tmp_path / "out")
    assert files_of(tmp_path / "out") == before


def test_arrangements_beside_parameters(tmp_path):
    """The best arrangement is found among all that are listed, with the parameters that suit it."""
    plain = EIGHT | {"parameter": EIGHT["parameter"][1:2]}
    data = PROBLEMS["eight margin"] | {"robot": plain, "search": {"screen": 8, "starts": 2}}
    alone = [cspr_jax.design(data | {"arrangements": [number]}, tmp_path / str(number)).best for number in (0, 9)]
    both = cspr_jax.design(data | {"arrangements": [0, 9]}, tmp_path / "both").best
    best = max(alone, key=lambda robot: robot.values[0])
    assert alone[0].values[0] != pytest.approx(alone[1].values[0], rel=0.01)
    assert both.arrangement == best.arrangement and both.values[0] == pytest.approx(best.values[0], rel=1e-6)
    order = tomllib.loads((tmp_path / "both" / "best.toml").read_text())["platform_points"]
    assert len(order) == 8


@pytest.mark.parametrize("count", [5, 40])
def test_a_stopped_search_goes_on_to_the_same_files(tmp_path, count):
    cspr_jax.design(BOTH, tmp_path / "at once")
    asked = iter(range(10_000))
    stopped = cspr_jax.design(BOTH, tmp_path / "twice", stopped=lambda: next(asked) > count)
    assert not stopped.to_dict()["complete"]
    cspr_jax.design(BOTH, tmp_path / "twice")
    assert files_of(tmp_path / "at once") == files_of(tmp_path / "twice")


def test_directories_of_others_are_refused(tmp_path):
    cspr_jax.design(PROBLEMS["planar width"], tmp_path / "out")
    before = files_of(tmp_path / "out")
    with pytest.raises(RefusedError, match="belongs to another design, or to an older state of this one"):
        cspr_jax.design(PROBLEMS["planar margin"], tmp_path / "out")
    assert files_of(tmp_path / "out") == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("mine")
    with pytest.raises(RefusedError, match="has files of others"):
        cspr_jax.design(PROBLEMS["planar width"], tmp_path / "mine")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def test_damaged_tables(tmp_path):
    """The end of a line that was not finished is computed again; other damage is told."""
    cspr_jax.design(PROBLEMS["planar width"], tmp_path / "out")
    table, before = tmp_path / "out" / "evaluations.csv", files_of(tmp_path / "out")
    table.write_bytes(before["evaluations.csv"][:-7])
    cspr_jax.design(PROBLEMS["planar width"], tmp_path / "out")
    assert files_of(tmp_path / "out") == before
    table.write_bytes(before["evaluations.csv"].replace(b"0.0", b"zero", 1))
    with pytest.raises(StoreError, match=r"evaluations.csv: line \d+: is no evaluation"):
        cspr_jax.design(PROBLEMS["planar width"], tmp_path / "out")


def written(tmp_path, data):
    """A design file."""
    path = tmp_path / "file.toml"
    path.write_text(robot_text(data))
    assert read_toml(path) == data
    return path


def test_the_command(tmp_path, capsys):
    path = written(tmp_path, PROBLEMS["planar width"])
    assert main(["design", str(path), "-o", str(tmp_path / "out"), "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["robots"][0]["feasible"] and "screened 17 robots" in printed.err
    impossible = PROBLEMS["planar width"] | {
        "requirement": [FEASIBLE, {"of": "frame", "quantity": "extent_x", "upper": 1.5}]
    }
    assert main(["design", str(written(tmp_path, impossible)), "-o", str(tmp_path / "none")]) == 1
    assert "no robot meets all requirements" in capsys.readouterr().out
    page = (tmp_path / "out" / "design.html").read_text()
    assert "<svg" in page and "width is held by places.wrench_margin" in page and "<script" not in page


@pytest.mark.thorough
def test_interrupts_keep_the_best_robot(tmp_path):
    data = PROBLEMS["three fraction"] | {"search": {"generations": 100_000}}
    path = written(tmp_path, data)
    command = [sys.executable, "-m", "cspr_jax", "design", str(path), "-o", str(tmp_path / "out")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        while "local search 1" not in process.stderr.readline():
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        error = process.stderr.read()
    assert process.returncode == 130 and "Traceback" not in error
    assert "out holds the best robot so far; run it again to go on" in error
    assert cspr_jax.load_robot(tmp_path / "out" / "best.toml").n_cables == 3
    assert not json.loads((tmp_path / "out" / "design.json").read_text())["complete"]
