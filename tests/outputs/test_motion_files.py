"""Motion files: what they say of themselves, checked again, drawn, and marked where they are not feasible."""

import csv
import json
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from plans.test_planning import SHORT
from support.commands import plan

import cspr_jax
from cspr_jax import __version__
from cspr_jax.cli import main
from cspr_jax.outputs import motion_files
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.files.checksum import with_trailer
from cspr_jax.store.files.netcdf import LAYOUT
from outputs.test_outputs import panels

# The second segment, which needs six arcs, ends above the spools.
HARD = SHORT.replace("position = [0.0, -1.1, 1.7]", "position = [0.0, -1.1, -0.2]")


@pytest.fixture(scope="module")
def motions(tmp_path_factory):
    """A plan that is feasible and one that is not, as HDF5."""
    folder = tmp_path_factory.mktemp("motions")
    assert HARD != SHORT
    assert plan(folder, SHORT, "-o", str(folder / "good.h5"))[::2] == (0, "")
    code, _, err = plan(folder, HARD, "-o", str(folder / "hard.h5"), "--anyway")
    assert code == 1 and len(err.splitlines()) == 1 and "hard.h5: not proved feasible" in err
    return folder


def test_a_motion_says_what_it_is(motions):
    good, hard = (cspr_jax.open_result(motions / f"{name}.h5") for name in ("good", "hard"))
    known = good.attributes
    assert (known["software"], known["schema"], known["feasible"]) == (f"cspr_jax {__version__}", 2, 1)
    assert (known["plan"], known["family"]) == (SHORT, "hypocycloid-standard")
    robot = cspr_jax.load_robot("prototype")
    np.testing.assert_allclose(known["base_points"], robot.base_points)
    assert json.loads(known["robot_settings"])["base_points"] == known["base_points"].tolist()
    ends = good.data["segment_end"]
    np.testing.assert_array_equal(good.data["segment_start"], [0.0, ends[0]])
    assert good.data["segment"].tolist() == [1, 2] and ends[-1] == pytest.approx(good.axes["t"][-1], rel=1e-14)
    assert good.data["segment_arcs"].tolist() == good.data["segment_tried_arcs"].tolist() == [5, 6]
    assert not good.data["segment_verdict"].any() and (good.data["segment_margin"] > 0.0).all()
    assert hard.attributes["feasible"] == 0 and "not proved feasible" in hard.attributes["title"]
    assert hard.data["segment_arcs"].tolist() == [5, 0] and hard.data["segment_tried_arcs"][1] > 0
    assert Verdict(int(hard.data["segment_verdict"][1])) & Verdict.NO_ARCS
    with h5py.File(motions / "hard.h5") as file:
        assert file["segment_end"].dims[0][0] == file["segment"]
        assert "slack_cable" in file["segment_verdict"].attrs["flag_meanings"]


def test_verify(motions, tmp_path, capsys):
    assert main(["verify", str(motions / "good.h5")]) == 0
    assert capsys.readouterr().out == f"{motions / 'good.h5'}: rows 800, segments 2, feasible True\n"
    assert main(["verify", str(motions / "hard.h5"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["rows"], found["segments"], found["feasible"], found["faults"]) == (800, 2, False, [])
    data = bytearray((motions / "good.h5").read_bytes())
    for place in (100, len(data) // 2, len(data) - 200):
        spoiled = bytearray(data)
        spoiled[place] ^= 1
        (tmp_path / "bad.h5").write_bytes(spoiled)
        for command in ("verify", "plot"):
            assert main([command, str(tmp_path / "bad.h5")]) == 4
            line = capsys.readouterr().err
            assert len(line.splitlines()) == 1 and "its bytes have changed" in line


@pytest.mark.thorough
def test_pictures_are_marked(motions, figures, capsys):
    assert [main(["plot", str(motions / f"{name}.h5")]) for name in ("good", "hard")] == [0, 0]
    good, hard = (figure.get_suptitle() for figure in figures)
    assert "FEASIBLE" not in good and "NOT PROVED FEASIBLE: segment 2" in hard
    end = cspr_jax.open_result(motions / "good.h5").data["segment_end"][0]
    lines = [line.get_xdata() for line in panels(figures[0])[2].lines]
    assert [end, end] in [list(xs) for xs in lines]


def test_rows_of_a_motion_that_is_not_feasible(tmp_path):
    """A last column says which rows are of a segment that is proved feasible."""
    output = tmp_path / "hard.csv"
    code, _, err = plan(tmp_path, HARD, "-o", str(output))
    assert (code, output.exists()) == (1, False) and "--anyway" in err and len(err.splitlines()) == 1
    assert plan(tmp_path, HARD, "-o", str(output), "--anyway", "--rate", "20")[0] == 1
    heads, *rows = csv.reader(line for line in output.read_text("utf-8").splitlines() if line[0] != "#")
    assert heads[:4] == ["t", "position_x", "position_y", "position_z"]
    assert heads[-4:] == ["tension_3", "binding", "binding_cable", "feasible"]
    end = cspr_jax.plan(tmp_path / "plan.toml").answers.duration[0]
    assert {row[-1] for row in rows if float(row[0]) < end} == {"1"}
    assert {row[-1] for row in rows if float(row[0]) >= end} == {"0"}
    code, _, err = plan(tmp_path, SHORT, "--anyway")
    assert code == 2 and err == "cspr: --anyway: must be absent without -o, --mjcf or --animate\n"
    assert plan(tmp_path, SHORT, "-o", str(output), "--anyway", "--rate", "20")[::2] == (0, "")
    assert output.read_text("utf-8").splitlines()[0].endswith("tension_3,binding,binding_cable")


def test_a_row_at_a_border_is_of_both_segments():
    plan = SimpleNamespace(answers=SimpleNamespace(duration=[1.0, 2.0, 1.0]), is_feasible=np.array([True, False, True]))
    flags = motion_files._feasible_rows(plan, np.array([0.0, 0.5, 1.0, 2.0, 3.0, 3.5, 4.0]))
    assert flags.tolist() == [True, True, False, False, False, True, True]


@pytest.mark.thorough
def test_motions_of_the_version_before(motions, tmp_path, figures, capsys):
    """They have neither version nor plan, spools nor segments."""
    path = tmp_path / "old.h5"
    with h5py.File(motions / "good.h5") as new, h5py.File(path, "w", libver=LAYOUT) as old:
        for name in ("Conventions", "robot", "mass", "z_axis", "z0"):
            old.attrs.create(name, new.attrs[name], dtype=new.attrs.get_id(name).dtype)
        for name in new:
            if not name.startswith("segment"):
                old[name] = new[name][...]
    path.write_bytes(with_trailer(path.read_bytes()))
    assert main(["plot", str(path)]) == 0 and len(panels(figures[0])) == 3
    assert main(["verify", str(path)]) == 0
    assert capsys.readouterr().out.endswith("old.h5: rows 800\n")
