"""`cspr bench`: what it says, and that the versions which it times compute the same."""

import shutil
from pathlib import Path

import jax
import numpy as np
import pytest
from oracles import point_mass
from outputs.test_outputs import cspr, strict_json

from cspr_jax import load_robot
from cspr_jax.bench import ellipses, forward_kinematics, motions, paths, six_cables, three_cables, timing, workspaces
from cspr_jax.cli import main
from cspr_jax.errors import SelfCheckError
from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.swings.proof import screen
from cspr_jax.numerics.elementary import double_precision

ROOT = Path(__file__).parents[2]
with_compiler = pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")


@pytest.mark.parametrize(
    "kernels",
    [None, pytest.param(ROOT / "benchmarks", marks=[with_compiler, pytest.mark.thorough])],
)
def test_bench(capsys, small_bench, kernels):
    options = ["--kernels", str(kernels)] if kernels else []
    found = strict_json(cspr(capsys, "bench", "--json", *options))
    assert found["schema"] == 1 and found["cores"] >= 1 and jax.devices()[0].platform in found["device"]
    for name, key in (("six_cable", "checks_per_second"), ("three_cable", "three_cable")):
        assert set(found[key]) == {"float32", "float64", "numpy"}
        assert all(rate > 0 for rate in found[key].values())
        for dtype in ("float32", "float64"):
            assert found["ratio_to_numpy"][name][dtype] == found[key][dtype] / found[key]["numpy"]
            if kernels:
                assert found["ratio_to_hand_written"][name][dtype] == found[key][dtype] / found["hand_written"][name]
    assert found["taut_share"]["float32"] == found["taut_share"]["float64"]
    assert (found["hand_written"] is None) == (kernels is None)
    assert 300 < found["operations_per_check"] < 900
    assert found["workspaces"]["8 cables"]["first_s"] == 1.0
    assert all(rate > 0 for row in found["ellipses"].values() for rate in row.values())
    assert found["motions"] == {"3 cables, 10001 rows": 12.0} and found["paths"] == {"3 cables": 500.0}
    text = cspr(capsys, "bench", *options)
    assert "x NumPy" in text and "proofs of motions a second" in text
    assert "least times along paths a second\n  3 cables " in text
    assert "poses from lengths of cables a second\n  3 cables " in text


@pytest.fixture
def few_poses(monkeypatch):
    """Sizes with which rates of workspaces take seconds."""
    for name, few in (("BATCHES", 1), ("FEW_BATCHES", 1), ("TENSIONS", 64), ("PAIRS_BATCH", 64), ("SAMPLE", 2)):
        monkeypatch.setattr(workspaces, name, few)
    monkeypatch.setattr(timing, "REPEATS", 1)


def test_the_rate_of_four_cables(few_poses):
    rate, first = workspaces.margin_rate(
        workspaces._four_cables(), "wrench-feasible", "float32", by_null_space=False, batches=1
    )
    assert rate > 0.0 and first > 0.0


@pytest.mark.soak
def test_rates_of_workspaces(few_poses):
    found = workspaces.rates()
    assert len(found) == 8 and all(x > 0 for row in found.values() for x in row.values())
    assert len(workspaces.lines(found)) == 9 and "first" in workspaces.lines(found)[1]


def test_the_rate_of_poses_from_lengths(monkeypatch):
    """Poses are those of the lengths, else it is no rate."""
    monkeypatch.setattr(timing, "REPEATS", 1)
    assert forward_kinematics.rate(motions.THREE, 64) > 0.0
    monkeypatch.setattr(forward_kinematics, "CLOSE", 0.0)
    with pytest.raises(SelfCheckError, match="a pose of the bench is not that of its lengths"):
        forward_kinematics.rate(motions.THREE, 64)


@pytest.mark.thorough
def test_the_rate_of_records(monkeypatch):
    """What is timed is decided, else it is no rate."""
    monkeypatch.setattr(timing, "REPEATS", 1)
    monkeypatch.setattr(motions, "ROWS", 101)
    assert motions.record_rate() > 0.0
    monkeypatch.setattr(motions, "THREE", motions.THREE._replace(tensions=(1e-300, np.nan)))
    with pytest.raises(SelfCheckError, match="neither proved nor refuted"):
        motions.record_rate()


@pytest.mark.soak
def test_rates_of_motions(monkeypatch):
    monkeypatch.setattr(timing, "REPEATS", 1)
    monkeypatch.setattr(motions, "TOGETHER", 3)
    found = motions.rates()
    assert len(found) == 2 and all(rate > 0.0 for rate in found.values()) and len(motions.lines(found)) == 3


def test_the_rate_of_paths(monkeypatch):
    """What is timed has motions, else it is no rate."""
    for name, few in (("TOGETHER", 2), ("CELLS", 40)):
        monkeypatch.setattr(paths, name, few)
    monkeypatch.setattr(timing, "REPEATS", 1)
    region = paths.REGIONS["3 cables"]
    assert paths.rate(region) > 0.0 and paths.lines({"3 cables": 5.0})[1].split()[-1] == "5"
    with pytest.raises(SelfCheckError, match="cannot be run along"):
        paths.rate(region._replace(tensions=(3.9, 4.0)))


@with_compiler
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"six_cables.cpp": None}, "six_cables.cpp"),
        pytest.param({"six_cables.cpp": "int"}, "must accept it", marks=pytest.mark.thorough),
        ({"CXX": "no-such-compiler"}, "no-such-compiler: must be a C++ compiler"),
        pytest.param({"CXX": "c++ -D"}, "must accept it", marks=pytest.mark.thorough),
        ({"six_cables.cpp": 'extern "C" void six_cables() {}'}, "must agree"),
        ({"three_cables.cpp": "void three_cables() {}"}, "must define three_cables"),
        pytest.param(
            {"three_cables.cpp": 'int far(); extern "C" int three_cables() { return far(); }'},
            "must define three_cables",
            marks=pytest.mark.thorough,
        ),
    ],
)
def test_kernels_that_are_wrong(capsys, small_bench, tmp_path, monkeypatch, change, words):
    for path in (ROOT / "benchmarks").glob("*.[ch]*"):
        shutil.copy(path, tmp_path)
    for name, text in change.items():
        if name == "CXX":
            monkeypatch.setenv(name, text)
        elif text is None:
            (tmp_path / name).unlink()
        else:
            (tmp_path / name).write_text(text)
    assert main(["bench", "--json", "--kernels", str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert not out and words in err and err.count("\n") == 1


def test_the_numpy_version_of_the_six_cable_check(small_bench):
    """Against the package, trajectory by trajectory."""
    given = six_cables.work(60)
    found = six_cables._numpy_checks(given)
    for batch in six_cables.batches(given):
        wanted = np.asarray(six_cables.tensions(given.robot, batch, single_precision=False))[: batch.real]
        mine = found[given.arcs == batch.arcs] * 6.0 * six_cables.TARGET[2] / float(given.robot.gravity)
        np.testing.assert_allclose(mine, wanted, rtol=1e-8, atol=1e-9)


def test_the_numpy_version_of_the_three_cable_check():
    base, ends = np.asarray(load_robot("prototype").base_points), np.array([[-1.1, 0.2, 1.2]])
    found, tau = three_cables._numpy_checks(base, ends), (np.arange(screen.SAMPLES) + 0.5) / screen.SAMPLES
    for arcs in range(1, 31):
        _, place, _, acceleration = point_mass.motion([0.7, 0.7, 3.0], ends[0], [0, 0, 1.7], 9.81, arcs, tau)
        wanted = point_mass.pseudotensions(base, place, acceleration, 9.81).min()
        assert found[0, arcs - 1] == pytest.approx(wanted, rel=1e-9), arcs


def test_the_numpy_version_of_ellipses():
    case = ellipses.work(500)
    with double_precision():
        margins = harmonics.of_many(harmonics.least_margin, case.hull, case.ellipse, case.frequency)
        ends = harmonics.of_many(harmonics.frequency_interval, case.hull, case.ellipse)
    assert 100 < (margins > 0.0).sum() < 400 and np.isnan(ends[0]).any()
    np.testing.assert_allclose(ellipses.numpy_margins(case), margins, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(ellipses.numpy_intervals(case), ends, rtol=1e-9, atol=1e-7)
