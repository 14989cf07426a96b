"""What is one row: a kind of map with a quantity of its own, and a robot of the catalogue, each from file to answer.

Nothing of the package is touched. What this process registers, `cspr` does in this process; a process that computes
tiles gets the row with the sweep and imports the class by its name.
"""

import importlib
import json
import pickle
import sys
from pathlib import Path

import h5py
import matplotlib.image
import numpy as np
import pytest
from support.commands import cspr

from cspr_jax.config import catalogue
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.schema.map_kinds import MAP_KINDS, MapKind, register, registered
from cspr_jax.schema.quantities import AXES, QUANTITIES, Quantity
from cspr_jax.store.reading.result import open_result
from cspr_jax.sweep.definition import read_sweep

MODULE = (Path(__file__).parents[2] / "docs" / "examples" / "spool_distances.py").read_text("utf-8")
SWEEP = """schema = 1
map = "spool-distances"
robot = "prototype"
[axes]
x = { start = -0.5, stop = 0.5, count = 6 }
y = [-0.3, 0.0, 0.4]
z = [1.1]
[trajectory]
"""


@pytest.fixture
def sweep(tmp_path, monkeypatch):
    """A sweep of a kind of map that a module beside it registers."""
    (tmp_path / "spool_distances.py").write_text(MODULE)
    (tmp_path / "distances.toml").write_text(SWEEP)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    module = importlib.import_module("spool_distances")
    with registered(module.KIND, *module.QUANTITIES):
        yield tmp_path / "distances.toml"
    sys.modules.pop("spool_distances")


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.thorough)])
def test_a_kind_of_map_from_file_to_picture(sweep, tmp_path, workers):
    code, out, err = cspr("run", sweep, "-o", tmp_path / "run", "--workers", workers)
    assert (code, err) == (0, "")
    path = tmp_path / "run" / "distances.h5"
    assert out.splitlines()[-1] == str(path)
    with h5py.File(path) as file:
        assert file.attrs["map"] == "spool-distances"
        assert file.attrs["title"].startswith("Distances from the spools, robot prototype")
        data = file["spool_distance"]
        assert (data.attrs["units"], data.attrs["long_name"]) == ("m", "distance from the nearest spool")
        assert data.shape == (6, 3, 1) and np.prod(data.chunks) <= 8 and file["nearest_spool"].dtype == np.int16
        found = data[...]
    spools = np.array(resolve_robot("prototype", "", tmp_path).base_points)
    targets = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 6), [-0.3, 0.0, 0.4], [1.1], indexing="ij"), axis=-1)
    wanted = np.linalg.norm(targets[..., None, :] - spools, axis=-1).min(-1)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
    assert open_result(path).units["spool_distance"] == "m"
    assert cspr("verify", tmp_path / "run")[0] == 0
    assert json.loads(cspr("status", tmp_path / "run", "--json")[1])["result"]


def test_its_picture(sweep, tmp_path, figures):
    assert cspr("run", sweep, "-o", tmp_path / "run")[0] == 0
    result = tmp_path / "run" / "distances.h5"
    assert cspr("plot", result, "-o", tmp_path / "map.png")[0] == 0
    assert figures[0].get_suptitle().startswith("prototype: distance from the nearest spool\n")
    assert "from rest" not in figures[0].get_suptitle()
    assert figures[0].axes[-1].get_ylabel() == "distance from the nearest spool (m)"


def test_its_picture_is_a_file(sweep, tmp_path):
    assert cspr("run", sweep, "-o", tmp_path / "run")[0] == 0
    picture = tmp_path / "map.png"
    assert cspr("plot", tmp_path / "run", "--quantity", "nearest_spool", "-o", picture)[0] == 0
    assert np.ptp(matplotlib.image.imread(picture)) > 0.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("z = [1.1]", "z = [1.1]\nz0 = [1.0]"), "axes.z0: must be absent in this map"),
        (("z = [1.1]", "z = [1.1]\ntau = [0.5]"), 'axes.tau: must be absent in this map; it is for map = "transition-'),
        (("[trajectory]", '[trajectory]\nfamily = "transition"'), 'must be "hypocycloid-standard" in this map'),
        (("[trajectory]", '[run]\nstore = ["arcs"]\n[trajectory]'), "must be one of spool_distance, nearest_spool in"),
        (("[trajectory]", '[run]\nstore = ["spool_distanc"]\n[trajectory]'), 'did you mean "spool_distance"?'),
        (("spool-distances", "spool-distance"), 'did you mean "spool-distances"? must be "minimum-arcs", "minimum-osc'),
        (("spool-distances", "spool-distance"), '"workspace" or "spool-distances"'),
        (("z = [1.1]", "z = [-1.1]"), "every point is above the spool plane"),
    ],
)
def test_its_mistakes(sweep, tmp_path, change, words):
    assert change[0] in SWEEP
    sweep.write_text(SWEEP.replace(*change))
    code, out, err = cspr("run", sweep, "-o", tmp_path / "run")
    assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err


def test_what_knows_it(sweep):
    """Its quantities are listed; a sweep takes its row along to where nobody has registered it."""
    listed = {row["name"]: row for row in json.loads(cspr("quantities", "--json")[1])}
    assert (listed["spool_distance"]["group"], listed["spool_distance"]["units"]) == ("map", "m")
    kind = MAP_KINDS["spool-distances"]
    assert pickle.loads(pickle.dumps(read_sweep(sweep))).kind == kind
    register(kind, *(QUANTITIES[name] for name in kind.quantities))  # again: nothing changes
    assert MAP_KINDS["spool-distances"] is kind


def test_rows_are_gone_behind_the_block(tmp_path):
    (tmp_path / "distances.toml").write_text(SWEEP)
    own = Quantity("spool_distance", "m", "", "")
    names = ("spool_distance",)
    with registered(MapKind("spool-distances", "", "", "a:B", names, names, ("hypocycloid-standard",)), own):
        assert read_sweep(tmp_path / "distances.toml").store == ["spool_distance"]
    assert "spool-distances" not in MAP_KINDS and "spool_distance" not in QUANTITIES
    with pytest.raises(ConfigError, match='map = "spool-distances": '):
        read_sweep(tmp_path / "distances.toml")


def test_rows_that_do_not_fit_are_refused():
    kind = MAP_KINDS["minimum-arcs"]
    given = {"title": "", "description": "", "implementation": "a:B", "families": ()}
    for row, own, words in (
        (MapKind(name=kind.name, quantities=("arcs",), stored=("arcs",), **given), (), "map = "),
        (MapKind(name="other", quantities=("length",), stored=("length",), **given), (), "quantities = "),
        (MapKind(name="other", quantities=("arcs",), stored=("margin",), **given), (), "stored = "),
        (
            MapKind(name="other", quantities=("arcs",), stored=("arcs",), **given),
            (Quantity("arcs", "m", "arcs", "Others."),),
            "quantity = ",
        ),
        (
            MapKind(name="other", quantities=("x",), stored=("x",), **given),
            (Quantity("x", "m", "", ""),),
            "quantity = ",
        ),
    ):
        with pytest.raises(InputError, match=words):
            register(row, *own)
    assert "other" not in MAP_KINDS and QUANTITIES["arcs"].units == "1" and AXES["x"].long_name


def test_rows_of_the_package_fit():
    """Every kind gives what it stores and shows, and its class is named like it."""
    for name, kind in MAP_KINDS.items():
        register(kind)
        parts = "".join(part.capitalize() for part in name.split("-"))
        assert kind.load().__name__ == f"{parts}Map"


@pytest.mark.thorough
def test_a_robot_is_one_file(tmp_path, monkeypatch):
    """A file in the catalogue's folder is listed, and plans use it by its name."""
    folder = tmp_path / "catalogue"
    folder.mkdir()
    (folder / "toy.toml").write_text(
        'name = "toy"\nbase_points = [[0.3, 0.0, 0.0], [-0.2, 0.25, 0.0], [-0.1, -0.25, 0.0]]\nmass = 0.5\n'
        'tension_max = 40.0\nsource = "a test"\n'
    )
    monkeypatch.setattr(catalogue, "CATALOGUE", folder)
    code, out, err = cspr("robots", "--json")
    (robot,) = json.loads(out)
    assert (code, err) == (0, "") and (robot["name"], robot["mass"], robot["fault"]) == ("toy", 0.5, None)
    (tmp_path / "plan.toml").write_text(
        'schema = 1\nrobot = "toy"\nz0 = 1.2\n[[pose]]\nposition = [0.0, 0.0, 1.2]\nrest = true\n'
        "[[pose]]\nposition = [0.05, 0.02, 1.2]\n"
    )
    code, out, err = cspr("plan", tmp_path / "plan.toml", "--json")
    found = json.loads(out)
    assert (code, err) == (0, "") and found["robot"] == "toy" and found["feasible"]
