"""Joined maps: parts of one map give the bytes of one run; whatever does not fit together is refused in words."""

import dataclasses
import re

import numpy as np
import pytest
from reliability.support import Crash, FaultyDisk, Paper, go, sweep_of
from support import toy

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.errors import ConfigError, RefusedError, StoreError
from cspr_jax.schema.map_kinds import registered
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.sweep.definition import sweep_of_settings
from cspr_jax.sweep.engine import Options, Run
from cspr_jax.sweep.merging import Merged, read_part
from cspr_jax.sweep.signals import Stop

TILES = 6


@pytest.fixture
def kind():
    with registered(toy.KIND, *toy.QUANTITIES):
        yield


def written(folder, name="map", **changes):
    """A sweep file of the toy map, with other lines in place of some."""
    text = toy.SWEEP
    for key, value in changes.items():
        text, count = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
        assert count == 1
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


def test_tiles_computed_apart_give_the_bytes_of_one_run(tmp_path, kind, capsys):
    """As a job array does it, with an end beyond the last tile; the joined map is a run like any other."""
    sweep = str(written(tmp_path))
    parts = [str(tmp_path / name) for name in "abc"]
    for part, tiles in zip(parts, ("0:2", "1:4", "4:99"), strict=True):
        assert main(["run", sweep, "-o", part, "--tiles", tiles]) == 0
        assert capsys.readouterr().out.splitlines()[-1] == part
    assert main(["merge", *parts, "-o", str(tmp_path / "joined")]) == 0
    joined = capsys.readouterr().out.splitlines()[-1]
    whole = cspr_jax.run(sweep, tmp_path / "whole")
    assert (
        joined == str(tmp_path / "joined" / "map.h5")
        and whole.read_bytes() == (tmp_path / "joined/map.h5").read_bytes()
    )
    assert cspr_jax.open_result(tmp_path / "joined").data.keys() == {"toy_distance"}
    report = cspr_jax.verify(tmp_path / "joined")
    assert (
        report["faults"] == []
        and report["shards"] == TILES
        and cspr_jax.status(tmp_path / "joined")["result"] == joined
    )
    assert cspr_jax.merge(parts, tmp_path / "joined") == tmp_path / "joined/map.h5"  # nothing left to do
    # What it joins may be results, of pruned runs too; the sweep file may be gone.
    (tmp_path / "map.toml").unlink()
    again = cspr_jax.merge([joined, whole.parent], tmp_path / "again")
    np.testing.assert_array_equal(
        cspr_jax.open_result(again).data["toy_distance"], cspr_jax.open_result(whole).data["toy_distance"]
    )


def test_a_run_of_some_tiles_goes_on_with_the_others(tmp_path, kind):
    sweep, directory = written(tmp_path), tmp_path / "run"
    assert cspr_jax.run(sweep, directory, tiles=(2, 4)) == directory
    assert cspr_jax.run(sweep, directory, tiles=(0, 3)) == directory and cspr_jax.status(directory)["shards"] == 4
    path = cspr_jax.run(sweep, directory, tiles=(4, 6))
    assert path.read_bytes() == cspr_jax.run(sweep, tmp_path / "whole").read_bytes()


@pytest.mark.parametrize("tiles", ["3:3", "4:2", "6:8", "-1:2"])
def test_tiles_that_are_none_are_refused(tmp_path, kind, tiles, capsys):
    assert main(["run", str(written(tmp_path)), "-o", str(tmp_path / "run"), f"--tiles={tiles}"]) == 2
    assert f"--tiles: {tiles}: must be FIRST:END within the 6 tiles" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    with pytest.raises(SystemExit) as end:
        main(["run", str(written(tmp_path)), "--tiles", "3"])
    assert end.value.code == 2 and "--tiles: 3: must be FIRST:END" in capsys.readouterr().err


def test_missing_tiles_are_named_and_nothing_is_written(tmp_path, kind):
    sweep = written(tmp_path)
    parts = [cspr_jax.run(sweep, tmp_path / str(k), tiles=(k, k + 1)) for k in (0, 3)]
    with pytest.raises(RefusedError, match=re.escape("tiles 1:3, 4:6 of 6 (24 cells) are in none of them")):
        cspr_jax.merge(parts, tmp_path / "joined")
    assert not (tmp_path / "joined").exists()
    with pytest.raises(StoreError, match=r"0: holds no finished result: run the sweep to its end"):
        cspr_jax.open_result(parts[0])


@pytest.mark.thorough
def test_maps_that_differ_in_one_axis(tmp_path, kind):
    """Overlapping, interleaved, of other tiles, as a range: each cell is what one map has there."""
    files = [
        written(tmp_path, "a", x="[0.0, 0.1, 0.4]", tile="[3, 1, 2]"),
        written(tmp_path, "b", x="[0.3, 0.1]"),
        written(tmp_path, "c", x="{ start = 0.2, stop = 0.5, count = 2 }"),
    ]
    parts = [cspr_jax.run(file, tmp_path / file.stem) for file in files]
    joined = cspr_jax.open_result(cspr_jax.merge(parts, tmp_path / "joined"))
    whole = cspr_jax.open_result(cspr_jax.run(written(tmp_path, "whole"), tmp_path / "whole"))
    assert list(joined.axes) == ["x", "y", "z"]
    for name, points in whole.axes.items():
        np.testing.assert_allclose(joined.axes[name], points, rtol=0, atol=1e-15)
    np.testing.assert_allclose(joined.data["toy_distance"], whole.data["toy_distance"], rtol=1e-12)
    assert joined.settings["axes"]["x"] == joined.axes["x"].tolist()
    assert sweep_of_settings(joined.settings, tmp_path / "a.toml").identity == joined.attributes["identity"]
    assert cspr_jax.verify(tmp_path / "joined")["faults"] == []


class DoubtfulMap(toy.ToyMap):
    """Verdicts that are open at some x."""

    proves = True

    def contradictions(self, answers):
        return {}

    def __call__(self, cells):
        return {"verdict": np.where(cells["x"] > 0.25, Verdict.UNDECIDED, Verdict(0)).astype(np.uint32)}


@pytest.mark.thorough
def test_a_joined_map_says_how_much_is_proved_if_all_its_parts_do(tmp_path):
    columns = dict.fromkeys(("quantities", "stored", "pictured", "motionless"), ("verdict",))
    with registered(dataclasses.replace(toy.KIND, implementation=f"{__name__}:DoubtfulMap", **columns)):
        files = [written(tmp_path, "a", x="[0.0, 0.1, 0.4]"), written(tmp_path, "b", x="[0.1, 0.2, 0.3, 0.5]")]
        parts = [read_part(cspr_jax.run(file, tmp_path / file.stem)) for file in files]
        pruned = cspr_jax.run(files[1], tmp_path / "pruned", prune=True).parent
        assert (
            cspr_jax.open_result(cspr_jax.merge([tmp_path / "a", pruned], tmp_path / "c")).attributes["proved"] == 0.5
        )
        silent = dataclasses.replace(parts[1], says_proved=False)
        for others, undecided in ((parts[1], [6, 6, 6]), (silent, [None] * 3)):
            joined = Merged([parts[0], others])
            shards = [tile.shard for tile in joined.tiles(range(len(joined.sweep.grid.tiling)), Stop())]
            assert [shard.undecided for shard in shards if shard.values["verdict"].any()] == undecided


@pytest.mark.thorough
def test_joined_directories_are_drawn_and_reported(tmp_path, kind, capsys):
    parts = [
        cspr_jax.run(written(tmp_path, name, x=x), tmp_path / name) for name, x in (("a", "[0.0]"), ("b", "[0.1, 0.3]"))
    ]
    folder = cspr_jax.merge(parts, tmp_path / "joined").parent
    assert main(["plot", str(folder), "-o", str(tmp_path / "map.png"), "--dpi", "30"]) == 0
    assert main(["report", str(folder), "-o", str(tmp_path / "page.html"), "--trajectories", "0"]) == 0
    assert capsys.readouterr().err == "" and all((tmp_path / name).stat().st_size for name in ("map.png", "page.html"))


def test_what_does_not_fit_is_told_line_by_line(tmp_path, kind):
    first = cspr_jax.run(written(tmp_path, "a"), tmp_path / "a")
    other = cspr_jax.run(written(tmp_path, "b", robot='"laval-large"', y="[0.2]", x="[0.7]"), tmp_path / "b")
    with pytest.raises(RefusedError) as error:
        cspr_jax.merge([first, other], tmp_path / "joined")
    lines = error.value.args
    assert lines[0] == "axes x, y differ: must be one of them at most"
    assert any(line.startswith(f"{other}: robot.name = ") and line.endswith("must be equal") for line in lines)
    assert all(len(line.splitlines()) == 1 for line in lines) and not (tmp_path / "joined").exists()


def test_cells_that_do_not_agree_are_refused(tmp_path, kind):
    part = read_part(cspr_jax.run(written(tmp_path), tmp_path / "a").parent)
    assert Merged([part, part]).sweep.identity == part.sweep.identity
    data = {name: values.copy() for name, values in part.data.items()}
    data["toy_distance"][2, 1, 0] += 1e-3
    with pytest.raises(RefusedError, match=r"a: toy_distance: 1 cells differ from those of .*a: must agree"):
        Merged([part, dataclasses.replace(part, data=data)])
    here = part.environment | {"jax": "0.0"}
    with pytest.raises(RefusedError, match=r'jax = "0.0" here, .* --accept-environment-change joins them'):
        Merged([part, dataclasses.replace(part, environment=here)])
    Merged([part, dataclasses.replace(part, environment=here)], accept_environment_change=True)


def test_what_is_no_map_is_refused(tmp_path, kind):
    file = cspr_jax.run(written(tmp_path), tmp_path / "a")
    (tmp_path / "empty").mkdir()
    for path in (tmp_path / "empty", tmp_path / "none"):
        with pytest.raises(StoreError, match=path.name):
            cspr_jax.merge([file, path], tmp_path / "joined")
    with pytest.raises(ConfigError, match=r"-o: .*: must be another directory"):
        cspr_jax.merge([file.parent, file], file.parent)
    with pytest.raises(ValueError, match="two run directories or results"):
        cspr_jax.merge([file], tmp_path / "joined")
    shard = tmp_path / "a" / "shards" / "00001.h5"
    shard.write_bytes(shard.read_bytes()[:-80])
    with pytest.raises(StoreError, match=r"00001.h5: .*run the sweep again"):
        cspr_jax.merge([file.parent, file], tmp_path / "joined")


@pytest.mark.ci("half-20", "ENOSPC-20")
@pytest.mark.quick("half-20", "power-45")
@pytest.mark.parametrize("at", [3, 20, 45, 70, pytest.param(None, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("mode", ["before", "half", "power", "ENOSPC"])
def test_a_merge_that_dies_goes_on(tmp_path, at, mode):
    """With the machine off, or a full disk: the next one ends with the bytes of one run."""
    sweep = sweep_of(tmp_path)
    for name, tiles in (("a", (0, 5)), ("b", (4, 12))):
        Run(sweep, tmp_path / name, Options(tiles=tiles)).go(Paper(sweep))
    whole = go(sweep, tmp_path / "whole").result.read_bytes()
    parts = [read_part(tmp_path / name) for name in "ab"]
    crashes = 0
    for call in (at,) if at is not None else range(0, 90, 2):
        tiles, directory = Merged(parts), tmp_path / f"joined{call}"
        try:
            Run(tiles.sweep, directory, disk=FaultyDisk(call, mode)).go(tiles)
        except (Crash, StoreError):
            crashes += 1
        assert Run(tiles.sweep, directory).go(tiles).result.read_bytes() == whole
    assert crashes == 1 if at is not None else crashes > 10
