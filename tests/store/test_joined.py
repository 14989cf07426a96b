"""Maps that xarray and dask join: the numbers of the map that they are parts of, in whatever order; or a line."""

import h5py
import numpy as np
import pytest
import xarray as xr
from outputs.test_outputs import made
from support.reading import read_here

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.errors import StoreError

JOINS = {
    "concat": lambda parts: xr.concat(parts, "z", join="exact"),
    "backwards": lambda parts: xr.concat(parts[::-1], "z", join="exact"),
    "merge": lambda parts: xr.merge(parts, compat="no_conflicts", join="outer", combine_attrs="override"),
    "combine_first": lambda parts: parts[1].combine_first(parts[0]).combine_first(parts[2]),
    "transposed": lambda parts: xr.concat(parts, "z", join="exact").transpose("z0", "z", "x", "y"),
    "with_more": lambda parts: xr.concat(parts, "z", join="exact").assign(mine=("x", np.ones(4)), attrs="text"),
    "dask": lambda parts: xr.concat([part.chunk({"x": 2}) for part in parts], "z", join="exact"),
}


@pytest.fixture
def whole(tmp_path, monkeypatch):
    read_here(monkeypatch)
    return made(tmp_path / "whole.h5", {"x": 4, "y": 3, "z": 4, "z0": 1}, proved=1.0, identity="0" * 64)


def parts_of(whole):
    with xr.open_dataset(whole, engine="h5netcdf") as data:
        data.load()
    return [data.isel(z=[1, 3]), data.isel(z=[0]), data.isel(z=[2])]


@pytest.mark.parametrize("join", JOINS)
def test_joins_are_read_as_the_map_that_they_make(whole, tmp_path, join):
    joined = JOINS[join](parts_of(whole))
    joined.to_netcdf(tmp_path / "joined.nc", engine="h5netcdf")
    result, wanted = cspr_jax.open_result(tmp_path / "joined.nc"), cspr_jax.open_result(whole)
    assert list(result.axes) == list(wanted.axes) == ["x", "y", "z", "z0"]
    for name, values in (wanted.axes | wanted.data).items():
        np.testing.assert_array_equal((result.axes | result.data)[name], values)
        assert (result.axes | result.data)[name].dtype == values.dtype
    assert result.settings["axes"]["z"] == wanted.axes["z"].tolist()
    # What was proved of one part, and its sums, are not those of the joined map.
    assert not {"proved", "identity"} & result.attributes.keys() and result.is_map


def test_results_joined_in_python(whole, tmp_path):
    data = cspr_jax.open_result(whole).to_xarray()
    del data.attrs["settings"], data.attrs["base_points"]
    xr.concat([data.isel(x=[0]), data.isel(x=[1, 2, 3])], "x").to_netcdf(tmp_path / "joined.nc", engine="h5netcdf")
    with pytest.raises(StoreError, match="must keep the attributes of one of them: combine_attrs='override'"):
        cspr_jax.open_result(tmp_path / "joined.nc")


def spoiled(name, value):
    return lambda parts: JOINS["concat"](parts).assign_attrs({name: value})


@pytest.mark.parametrize(
    ("join", "words"),
    [
        (lambda parts: xr.concat([*parts, parts[1]], "z"), r"z = 0\.5 is there twice: must be once"),
        (
            lambda parts: xr.merge([parts[0].isel(x=[0, 1]), parts[1], parts[2]], compat="no_conflicts", join="outer"),
            r"12 cells have no arcs: the joined maps must fill their grid",
        ),
        (lambda parts: xr.concat(parts[1:], "run", join="override"), r"arcs has the dimensions run, .*: must be x, y"),
        (lambda parts: xr.concat(parts, "z", combine_attrs="drop"), "combine_attrs='override'"),
        (lambda parts: JOINS["concat"](parts).assign(arcs=lambda data: data.arcs + 0.5), "arcs holds numbers that"),
        (spoiled("settings", "{}"), "settings"),
    ],
    ids=["twice", "holes", "another_axis", "no_attributes", "fractions", "other_settings"],
)
def test_joins_that_make_no_map_are_refused(whole, tmp_path, join, words):
    join(parts_of(whole)).to_netcdf(tmp_path / "joined.nc", engine="h5netcdf")
    with pytest.raises(StoreError, match=words) as error:
        cspr_jax.open_result(tmp_path / "joined.nc")
    assert len(str(error.value).splitlines()) == 1


def test_a_file_of_ours_without_its_seal_stays_refused(whole, tmp_path):
    """As after a disk that was full; a scaled one has other numbers than it seems."""
    (tmp_path / "cut.h5").write_bytes(whole.read_bytes()[:-100])
    with pytest.raises(StoreError, match="it is not whole, or not of cspr"):
        cspr_jax.open_result(tmp_path / "cut.h5")
    JOINS["concat"](parts_of(whole)).to_netcdf(tmp_path / "joined.nc", engine="h5netcdf")
    with h5py.File(tmp_path / "joined.nc", "r+") as file:
        file["margin"].attrs["scale_factor"] = 2.0
    with pytest.raises(StoreError, match="margin has attributes that are none of cspr"):
        cspr_jax.open_result(tmp_path / "joined.nc")


@pytest.mark.thorough
def test_the_command_line_draws_and_reports_joins(whole, tmp_path, capsys):
    JOINS["concat"](parts_of(whole)).to_netcdf(tmp_path / "joined.nc", engine="h5netcdf")
    path = str(tmp_path / "joined.nc")
    assert main(["plot", path, "-o", str(tmp_path / "map.png"), "--dpi", "30"]) == 0
    assert main(["report", path, "-o", str(tmp_path / "page.html"), "--trajectories", "0"]) == 0
    assert (tmp_path / "map.png").stat().st_size > 1000 and "z0" in (tmp_path / "page.html").read_text()
