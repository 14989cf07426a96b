"""Sweeps from Python: run into a directory as by `cspr run`, or keeping no files; inspection of runs and results."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cspr_jax.api.arguments.checks import ResultOrPath, checked
from cspr_jax.api.notebooks import Displayed
from cspr_jax.config.parameters import with_values
from cspr_jax.config.reading import json_text, plain_values
from cspr_jax.errors import ConfigError
from cspr_jax.errors.arguments import AnyInteger, File, Parameters, PathNames, TileRange
from cspr_jax.outputs.volumes import WorkspaceVolume, volume_of
from cspr_jax.runtime.processes import check_count
from cspr_jax.runtime.xla import keep_compiled_code as _keep_compiled_code
from cspr_jax.schema import labelled
from cspr_jax.store.reading.result import Result
from cspr_jax.store.reading.result import open_result as _open_result
from cspr_jax.sweep import engine, inspection
from cspr_jax.sweep.definition import Sweep, read_sweep, run_directory, sweep_of
from cspr_jax.sweep.work import Executor

if TYPE_CHECKING:
    import xarray

# Name for errors and files if there is no sweep file; paths are then relative to the current folder.
NAME = Path("sweep")

keep_compiled_code = checked(name="keep_compiled_code", module=__name__)(_keep_compiled_code)


class DisplayedResult(Displayed, Result):
    """Result that shows itself; see `store.reading.result.Result`."""

    def _summary(self) -> list[str]:
        name = self.attributes.get("map") or "motion"
        lines = [f"Result: {name}, robot {self.settings['robot']['name']}" if self._has_robot else f"Result: {name}"]
        for axis, points in self.axes.items():
            unit = self.units.get(axis, "").replace("1", "")
            lines.append(f"  {axis}: {len(points)} from {points.min():.6g} to {points.max():.6g} {unit}".rstrip())
        return [*lines, f"  {', '.join(self.data)}"]

    @property
    def _has_robot(self) -> bool:
        return isinstance(self.settings.get("robot"), dict) and "name" in self.settings["robot"]

    def _drawn_result(self) -> Result:
        return self


@checked()
def open_result(path: str | Path) -> Result:
    """Read a result of `run` or `merge`, or a motion of `Plan.save`, including those of the command line.

    A motion in a .csv file has neither robot nor plan nor segments; it is named after its file. An HDF5 file may come
    from anybody: another process reads it, with limits of memory and time, and checks its content like a sweep file.

    Args:
        path: the file, or the directory of a run.

    Returns:
        the result.

    Raises:
        StoreError: the file is missing, neither HDF5 nor CSV, damaged, or not written by this program; or the run in
            the directory has not finished.
    """
    cell = Path(path)
    result = _open_result(inspection.result_in(cell) if cell.is_dir() else cell)
    return DisplayedResult(**vars(result))


@dataclasses.dataclass(frozen=True)
class Job:
    """A sweep with its run directory and its workers.

    Fields:
        sweep: the sweep.
        directory: directory of the run.
        options: options of the engine.
        hooks: calls for progress, warnings and stops.
        workers: number of processes on this machine; None: the usual number for its kind of map.
        scheduler: address of a dask.distributed scheduler whose workers compute instead; None: none.
    """

    sweep: Sweep
    directory: Path
    options: engine.Options
    hooks: engine.Hooks
    workers: int | None = 1
    scheduler: str | None = None

    def __post_init__(self) -> None:
        """Refuse a wrong number of workers, and tiles that the sweep does not have."""
        check_tiles(self.options.tiles, len(self.sweep.grid.tiling))
        check_count(self.workers)
        if self.scheduler is not None and self.workers not in (1, None):
            raise ConfigError("--workers", f"{self.workers}: cannot be combined with --scheduler")

    @functools.cached_property
    def _run(self) -> engine.Run:
        return engine.Run(self.sweep, self.directory, self.options, self.hooks)

    def finished(self) -> Path | None:
        """Path of the result if it exists and is complete; this does not need jax.

        Returns:
            the path, or None.

        Raises:
            RefusedError: the directory, or the result in it, belongs to another sweep.
            StoreError: shards cannot be removed from the disk.
        """
        return self._run.finished()

    def go(self, prepare: Callable[[], None] = lambda: None) -> Path:
        """Compute the missing tiles.

        Args:
            prepare: called before jax is imported.

        Returns:
            path of the result.

        Raises:
            CsprError: as for `run`.
        """
        with _executor(self, prepare) as executor:  # hints come later, so that a refusal here stands alone
            robot = self.sweep.robot
            from cspr_jax.config.hints import robot_hints, sweep_hints  # loads the keys of plans, which is slow

            for line in [*robot_hints(robot), *sweep_hints(self.sweep.spec, robot)]:
                self.hooks.warn(f"hint: {line}")
            return self._run.go(executor).result


@contextlib.contextmanager
def _executor(job: Job, prepare: Callable[[], None]) -> Iterator[Executor]:
    prepare()
    from cspr_jax.sweep import executors
    from cspr_jax.sweep.tile import TileMap

    tile_map = TileMap(job.sweep)  # refuses a hopeless sweep before files are made
    if job.scheduler is not None:
        from cspr_jax.sweep.distributed import Scheduler

        accept, stop, warn = job.options.accept_environment_change, job.hooks.stop, job.hooks.warn
        workers = Scheduler(job.sweep, job.scheduler, accept_environment_change=accept, stop=stop, warn=warn)
        try:
            yield workers
        finally:
            workers.close()
        return
    count = executors.usual_workers(job.sweep) if job.workers is None else job.workers
    yield executors.ThisProcess(tile_map) if count == 1 else executors.Processes(job.sweep, count)


def checked_sweep(source: str | Path | Mapping[str, Any], parameters: Mapping[str, float] | None = None) -> Sweep:
    """The sweep of a file or dictionary, checked; nothing is computed."""
    if not isinstance(source, Mapping):
        return read_sweep(Path(source), parameters)
    data = with_values(plain_values(source), parameters)
    return sweep_of(data, NAME, text=json_text(data))


@checked()
def run(
    given: File,
    directory: str | Path | None = None,
    *,
    parameters: Parameters = None,
    workers: AnyInteger | None = 1,
    scheduler: str | None = None,
    prune: bool = False,
    accept_environment_change: bool = False,
    tiles: TileRange | None = None,
    on_tile: Callable[[int, int], None] | None = None,
) -> Path:
    """Compute a sweep into an HDF5 result; tiles that an earlier run finished are kept.

    Args:
        given: path of a sweep file, or its content as a dictionary (parsed TOML, which may hold arrays instead of
            lists). Paths in a dictionary are relative to the current folder; its result is named sweep.h5.
        directory: run directory; None: results/<sweep>-<first 12 digits of its identity>.
        parameters: values of parameters of the sweep and of the robot file, by name; they replace those of the sweep.
        workers: number of processes on this machine; None: the usual number for its kind of map. Above 1, a script must
            call this function under `if __name__ == "__main__":`.
        scheduler: address of a dask.distributed scheduler whose workers compute instead.
        prune: whether to remove the files of tiles once the result is complete.
        accept_environment_change: whether to resume even if version, machine or libraries have changed.
        tiles: first and end of the range of tiles to compute, for jobs that each have a directory and that `merge`
            joins; None: all tiles.
        on_tile: called after each tile with the numbers of finished and of all cells.

    Returns:
        the path of the result; if only some tiles were computed, of the directory.

    Raises:
        ConfigError: a mistake in the sweep, or too little space on the disk.
        RefusedError: the directory belongs to another sweep, another process writes there, or the environment changed.
        StoreError: a file cannot be written.
        ResourceError: memory or workers do not suffice.
        SelfCheckError: the computed numbers contradict each other.
    """
    sweep = checked_sweep(given, parameters)
    hooks = engine.Hooks(warn=lambda line: warnings.warn(line, stacklevel=2))
    if on_tile is not None:
        hooks.on_tile = on_tile
    tile_range = None if tiles is None else (int(tiles[0]), int(tiles[1]))
    options = engine.Options(accept_environment_change, prune, tuple(sys.argv), tile_range)
    cell = run_directory(sweep) if directory is None else Path(directory)
    job = Job(sweep, cell, options, hooks, workers, scheduler)
    return job.finished() or job.go()


def check_tiles(tiles: tuple[int, int] | None, count: int) -> None:
    """Refuse a range of tiles that a sweep does not have; its end may be beyond the last tile."""
    if tiles is not None and not 0 <= tiles[0] < min(tiles[1], count):
        raise ConfigError("--tiles", f"{tiles[0]}:{tiles[1]}: must be FIRST:END within the {count} tiles, such as 0:8")


@checked()
def merge(paths: PathNames, directory: str | Path, *, accept_environment_change: bool = False) -> Path:
    """Join maps into one result: parts of one map (`run(..., tiles=...)`), or maps that differ in one axis.

    Args:
        paths: run directories and results; where maps overlap, their cells must agree.
        directory: run directory of the joined map, which can be verified, drawn and reported like any other.
        accept_environment_change: whether to join maps that different versions or machines have computed.

    Returns:
        the path of the result.

    Raises:
        RefusedError: the maps do not fit together, or cells are missing; one line for each reason.
        StoreError: a file cannot be read or written.
    """
    return merged(paths, Path(directory), engine.Options(accept_environment_change, command=tuple(sys.argv)))


def merged(
    paths: Sequence[str | Path], directory: Path, options: engine.Options, hooks: engine.Hooks | None = None
) -> Path:
    """Like `merge`, with options and hooks of a run."""
    from cspr_jax.sweep.merging import Merged, read_part

    parts = [Path(path) for path in paths]
    if any(path.resolve() in (directory.resolve(), *directory.resolve().parents) for path in parts if path.exists()):
        raise ConfigError("-o", f"{directory}: must be another directory than those that are joined")
    tiles = Merged([read_part(path) for path in parts], accept_environment_change=options.accept_environment_change)
    run = engine.Run(tiles.sweep, directory, options, hooks or engine.Hooks())
    return run.finished() or run.go(tiles).result


@checked()
def compute_sweep(given: File) -> xarray.Dataset:
    """Compute a small sweep without keeping files; use `run` for long sweeps, which can then resume.

    Args:
        given: as for `run`.

    Returns:
        the result, as `open_result(...).to_xarray()` returns it.

    Raises:
        ConfigError: a mistake in the sweep, or xarray is not installed.
        CsprError: as for `run`.
    """
    labelled.need_xarray()
    with tempfile.TemporaryDirectory() as folder:
        return open_result(run(given, Path(folder) / "run")).to_xarray()


@checked()
def status(directory: str | Path) -> dict[str, Any]:
    """Progress of a run, which is not changed.

    Returns:
        what `cspr status --json` prints: "identity", "tiles", "shards", "result" and more.

    Raises:
        StoreError: the folder is not a run directory.
    """
    return inspection.status(Path(directory))


@checked()
def verify(path: str | Path) -> dict[str, Any]:
    """Read and check all files of a run, or a result or motion file.

    Args:
        path: a run directory, or a file.

    Returns:
        what `cspr verify --json` prints: counts, and "faults", one line each; there are none if nothing is damaged.

    Raises:
        StoreError: the path is neither a run directory nor a file.
    """
    return inspection.verify(Path(path))


@checked()
def workspace_volume(result: ResultOrPath) -> WorkspaceVolume:
    """Volume of the workspace in a map, or its area if the map is a section.

    Args:
        result: result of a map with verdicts: its file, or what `open_result` or `compute_sweep` returns.

    Returns:
        the volume; its arrays run over the axes that are not coordinates of positions, and have shape () if there are
            none.

    Raises:
        InputError: the result is not a map, has no stored verdicts, or has a single position.
        StoreError: the file is not a result.
    """
    if isinstance(result, Result):
        return volume_of(result)
    if isinstance(result, str | Path):
        return volume_of(open_result(Path(result)))
    data = {str(name): np.asarray(values) for name, values in result.data_vars.items()}
    dims = result["verdict"].dims if "verdict" in data else ()
    axes = {str(name): np.asarray(result[name]) for name in dims}
    return volume_of(Result(axes, data, {}, {}, dict(result.attrs), {}))
