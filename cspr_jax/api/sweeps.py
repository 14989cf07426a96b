"""Sweeps from Python: run into a directory as `cspr run` does it, or computed in memory; runs and results looked at."""

import contextlib
import dataclasses
import functools
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cspr_jax.api.argument_checks import checked
from cspr_jax.config.hints import robot_hints, sweep_hints
from cspr_jax.config.mappings import plain, text_of
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.volumes import WorkspaceVolume, volume_of
from cspr_jax.runtime.processes import check_count
from cspr_jax.runtime.xla import keep_compiled_code as _keep_compiled_code
from cspr_jax.schema import labelled
from cspr_jax.store.result import Result
from cspr_jax.store.result import open_result as _open_result
from cspr_jax.sweep import engine, inspection
from cspr_jax.sweep.definition import Sweep, read_sweep, run_directory, sweep_of
from cspr_jax.sweep.work import Executor

if TYPE_CHECKING:
    import xarray

# Errors and files are named after this where there is no sweep file; paths are relative to the current folder.
NAME = Path("sweep")

keep_compiled_code = checked(_keep_compiled_code, "keep_compiled_code", __name__)
open_result = checked(_open_result, "open_result", __name__)


@dataclasses.dataclass(frozen=True)
class Job:
    """A sweep, where it goes, and who computes it.

    Fields:
        sweep: the sweep.
        directory: of the run.
        options: how it goes on.
        hooks: what it tells and asks.
        workers: processes on this machine; None: as many as are usual for its kind of map.
        scheduler: address of a dask.distributed scheduler, whose workers compute instead; None: none.
    """

    sweep: Sweep
    directory: Path
    options: engine.Options
    hooks: engine.Hooks
    workers: int | None = 1
    scheduler: str | None = None

    def __post_init__(self) -> None:
        """Refuse workers that cannot be."""
        check_count(self.workers)
        if self.scheduler is not None and self.workers not in (1, None):
            raise ConfigError("--workers", f"{self.workers}: cannot be combined with --scheduler")

    @functools.cached_property
    def _run(self) -> engine.Run:
        return engine.Run(self.sweep, self.directory, self.options, self.hooks)

    def finished(self) -> Path | None:
        """The result, if it is there and whole; jax is not needed.

        Returns:
            its path, or None.

        Raises:
            RefusedError: the directory, or the result in it, belongs to another sweep.
            StoreError: the disk refuses to remove shards.
        """
        return self._run.finished()

    def go(self, prepare: Callable[[], None] = lambda: None) -> Path:
        """Compute what is missing.

        Args:
            prepare: called before jax is imported.

        Returns:
            path of the result.

        Raises:
            CsprError: as `run` does.
        """
        with _executor(self, prepare) as executor:  # refuses in one line, so hints come after it
            robot = self.sweep.robot
            for line in [*robot_hints(robot), *sweep_hints(self.sweep.keys, robot)]:
                self.hooks.warn(f"hint: {line}")
            return self._run.go(executor).result


@contextlib.contextmanager
def _executor(job: Job, prepare: Callable[[], None]) -> Iterator[Executor]:
    prepare()
    from cspr_jax.sweep import executors
    from cspr_jax.sweep.tile import TileMap

    tile_map = TileMap(job.sweep)  # refuses a hopeless sweep before anything is made
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


def checked_sweep(source: str | Path | Mapping[str, Any]) -> Sweep:
    """A sweep, checked without computing anything.

    Args:
        source: path of a sweep file, or what it holds.

    Returns:
        the sweep.

    Raises:
        ConfigError: a mistake in it.
    """
    if not isinstance(source, Mapping):
        return read_sweep(Path(source))
    data = plain(source)
    return sweep_of(data, NAME, text=text_of(data))


@checked
def run(
    given: str | Path | Mapping[str, Any],
    directory: str | Path | None = None,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    prune: bool = False,
    accept_environment_change: bool = False,
    on_tile: Callable[[int, int], None] | None = None,
) -> Path:
    """Compute a sweep into an HDF5 result; what an earlier run has left there is kept, and only the rest computed.

    Args:
        given: path of a sweep file, or what it holds: parsed TOML, in which arrays are lists, too. A dictionary's paths
            are relative to the current folder, and its result is named sweep.h5.
        directory: of the run; None: results/<sweep>-<first 12 digits of its identity>.
        workers: processes on this machine; above 1, a script calls it under `if __name__ == "__main__":`.
        scheduler: address of a dask.distributed scheduler, whose workers compute instead.
        prune: whether to remove the shards once the result is complete.
        accept_environment_change: whether to resume despite another version, machine or library.
        on_tile: called with cells done and cells in all, after each tile.

    Returns:
        path of the result.

    Raises:
        ConfigError: a mistake in the sweep, or too little room on the disk.
        RefusedError: the directory belongs to another sweep, another process writes there, or the environment changed.
        StoreError: the disk or the folder refuses.
        ResourceError: memory or workers do not suffice.
        SelfCheckError: the computed numbers contradict each other.
    """
    sweep = checked_sweep(given)
    hooks = engine.Hooks(warn=lambda line: warnings.warn(line, stacklevel=2))
    if on_tile is not None:
        hooks.on_tile = on_tile
    options = engine.Options(accept_environment_change, prune, tuple(sys.argv))
    place = run_directory(sweep) if directory is None else Path(directory)
    job = Job(sweep, place, options, hooks, workers, scheduler)
    return job.finished() or job.go()


@checked
def compute_sweep(given: str | Path | Mapping[str, Any]) -> "xarray.Dataset":
    """Compute a small sweep and keep no file; `run` is for those that take long, since it can resume.

    Args:
        given: as for `run`.

    Returns:
        the result, as `open_result(...).to_xarray()` gives it.

    Raises:
        ConfigError: a mistake in the sweep, or xarray is not installed.
        CsprError: as `run` does.
    """
    labelled.need_xarray()
    with tempfile.TemporaryDirectory() as folder:
        return open_result(run(given, Path(folder) / "run")).to_xarray()


@checked
def status(directory: str | Path) -> dict[str, Any]:
    """How far a run has come, without touching it.

    Returns:
        what `cspr status --json` prints: "identity", "tiles", "shards", "result" and more.

    Raises:
        StoreError: no run directory.
    """
    return inspection.status(Path(directory))


@checked
def verify(path: str | Path) -> dict[str, Any]:
    """Read again everything of a run, or of a result or motion file, and check it.

    Args:
        path: a run directory, or a file.

    Returns:
        what `cspr verify --json` prints: counts, and "faults", one line each; none where all is whole.

    Raises:
        StoreError: neither a run directory nor a file.
    """
    return inspection.verify(Path(path))


@checked
def workspace_volume(result: "Result | xarray.Dataset | str | Path") -> WorkspaceVolume:
    """Volume of the workspace that a map has found, or its area where the map is a section.

    Args:
        result: of a sweep of a map with verdicts: its file, what `open_result` or `compute_sweep` gave.

    Returns:
        the volume; arrays over the axes that are no coordinates of places, () without any.

    Raises:
        InputError: no map, no stored verdicts, or a single place.
        StoreError: no result file.
    """
    if isinstance(result, Result):
        return volume_of(result)
    if isinstance(result, str | Path):
        return volume_of(open_result(Path(result)))
    data = {str(name): np.asarray(values) for name, values in result.data_vars.items()}
    dims = result["verdict"].dims if "verdict" in data else ()
    axes = {str(name): np.asarray(result[name]) for name in dims}
    return volume_of(Result(axes, data, {}, {}, dict(result.attrs), {}))
