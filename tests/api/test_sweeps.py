"""Sweeps from Python: those of the command, from a path and from a dictionary; what is there is kept."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from outputs.test_outputs import cspr, made, strict_json
from support.folder import ROBOT, SWEEP, folder, same, values

import cspr_jax
from cspr_jax.errors import RefusedError
from cspr_jax.schema.quantities import AXES, QUANTITIES

__all__ = ["folder"]  # a fixture


def test_runs(folder, capsys):
    """The same values from the command, a path, a dictionary, and in memory; what is there is kept."""
    cspr(capsys, "run", "sweep.toml", "-o", "told")
    told = values("told/sweep.h5")
    data = tomllib.loads(SWEEP)
    data["axes"]["x"] = np.array([0.1, 0.3])
    seen = []
    assert cspr_jax.run("sweep.toml", "path") == Path("path/sweep.h5")
    path = cspr_jax.run(data, on_tile=lambda done, total: seen.append((done, total)))
    assert seen == [(0, 4), (2, 4), (4, 4)] and path.parent.parent == Path("results")
    for result in ("path/sweep.h5", path):
        same(values(result), told)
        assert cspr_jax.open_result(result).attributes["identity"] == cspr_jax.status("told")["identity"]
    assert cspr_jax.run(data, on_tile=lambda *_: pytest.fail("computed again")) == path
    computed = cspr_jax.compute_sweep(data)
    same({name: computed[name].values for name in computed.variables}, told)
    assert not list(folder.glob("run*"))
    cspr_jax.run("sweep.toml", "path", prune=True)
    assert cspr_jax.status("path")["shards"] == 0


def test_an_interrupted_run_goes_on(folder):
    def interrupt(done, total):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cspr_jax.run("sweep.toml", "run", on_tile=interrupt)
    assert cspr_jax.status("run")["shards"] == 1
    seen = []
    cspr_jax.run("sweep.toml", "run", on_tile=lambda done, total: seen.append(done))
    assert seen == [2, 4]


def test_status_and_verify(folder, capsys):
    path = cspr_jax.run("sweep.toml", "run")
    assert cspr_jax.status("run") == strict_json(cspr(capsys, "status", "run", "--json"))
    for place in ("run", str(path)):
        assert cspr_jax.verify(place) == strict_json(cspr(capsys, "verify", place, "--json"))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert len(cspr_jax.verify(path)["faults"]) == 1


def test_a_map_for_xarray(tmp_path):
    """As xarray itself reads the file, but for what is never told apart."""
    xarray = pytest.importorskip("xarray")
    path = made(tmp_path / "map.h5")
    found = cspr_jax.open_result(path).to_xarray()
    with xarray.open_dataset(path, engine="h5netcdf", decode_timedelta=False) as wanted:
        xarray.testing.assert_equal(found, wanted)
        for name in found.variables:
            assert found[name].attrs.keys() == wanted[name].attrs.keys(), name
            assert found[name].attrs["units"] == (AXES | QUANTITIES)[name].units
    assert found.arcs.dims == ("x", "y", "z", "z0") and found.attrs["robot"] == "prototype"
    assert found.arcs.sel(x=1.5, y=0.5, z=0.5, z0=1.7) == 40


def test_another_sweep_in_the_directory(folder):
    cspr_jax.run("sweep.toml", "run")
    data = tomllib.loads(SWEEP)
    data["axes"]["y"] = [0.1]
    with pytest.raises(RefusedError, match=r"axes\.y"):
        cspr_jax.run(data, "run")


def test_hints_and_quarantines_are_warnings(folder):
    """What the command line says on stderr."""
    Path("mine.toml").write_text(ROBOT.replace("0.3, 0, 0", "3000, 0, 0").replace("-0.2, 0.3", "-2000, 3000"))
    data = tomllib.loads(SWEEP)
    with pytest.warns(UserWarning, match="hint: .*millimetres"):
        cspr_jax.run(data, "run")
