"""A run: from a checked sweep to its result, resumed where an earlier process was stopped or killed.

The run directory is its own manifest: progress is stored in the shards alone. Whenever a process dies, the next one
finds verified shards, computes the rest, and ends with the same bytes.
"""

import contextlib
import dataclasses
import math
import os
from collections.abc import Callable, Generator, Iterator
from pathlib import Path

from cspr_jax.errors import ExitCode, RefusedError, StoppedError, StoreError, printable
from cspr_jax.schema.identity import canonical_json, digest
from cspr_jax.store.consolidation import Content, consolidate
from cspr_jax.store.documents import Record
from cspr_jax.store.files.checksum import DamagedError, trailer_of
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import make_folders, publish, refusal
from cspr_jax.store.folder import RunFolder
from cspr_jax.store.reading.isolated import Reader
from cspr_jax.store.shards import Shard, encode
from cspr_jax.sweep import claims
from cspr_jax.sweep.definition import Sweep, attributes, check_disk_space
from cspr_jax.sweep.signals import Stop
from cspr_jax.sweep.work import Computed, Executor


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of a run.

    Fields:
        accept_environment_change: whether shards of another environment may be mixed in.
        prune: whether shards are removed once the result is complete.
        command: words of the command, for run.json.
        tiles: range (first, end) of the tiles to compute; None: all.
    """

    accept_environment_change: bool = False
    prune: bool = False
    command: tuple[str, ...] = ()
    tiles: tuple[int, int] | None = None


@dataclasses.dataclass(frozen=True)
class RunSummary:
    """Result of a run, in numbers.

    Fields:
        result: path of the finished file, or of the directory if only some tiles were requested.
        computed: number of tiles that this run has computed.
        reused: number of tiles that were finished before.
    """

    result: Path
    computed: int
    reused: int


@dataclasses.dataclass
class Hooks:
    """Hooks by which a run reports progress, and learns whether to stop.

    Fields:
        stop: request to end after the tile in progress.
        on_tile: function that is called with the numbers of finished and of all cells.
        warn: function that is called with a line for the user.
    """

    stop: Stop = dataclasses.field(default_factory=Stop)
    on_tile: Callable[[int, int], None] = lambda done, total: None
    warn: Callable[[str], None] = lambda line: None


class Run:
    """Work of one process on a run directory.

    Args:
        directory: folder of the run, which is made if it is absent.
        options: whether environments may differ, shards are kept, and which tiles are computed.
        hooks: hooks by which it reports progress, and learns whether to stop.
    """

    def __init__(
        self,
        sweep: Sweep,
        directory: Path,
        options: Options | None = None,
        hooks: Hooks | None = None,
        disk: Disk | None = None,
    ) -> None:
        """Keep the arguments, without any access to the disk."""
        self._sweep, self._disk = sweep, disk or Disk()
        self._options, self._hooks = options or Options(), hooks or Hooks()
        self._folder, self._reader = RunFolder(directory, sweep.name, self._disk), Reader()
        self._tiling = sweep.grid.tiling

    def finished(self) -> Path | None:
        """The result, if it is complete and undamaged; neither computing nor jax is needed."""
        with self._reader:
            claims.refuse_other_sweep(self._sweep, self._folder, self._reader)
            if not self._folder.result.exists():
                return None
            content = claims.content_at(self._folder.result, self._reader)
        if not isinstance(content, Content):
            if not (self._folder.record.exists() or self._folder.shards.is_dir()):
                raise RefusedError(printable(f"{self._folder.result}: is there, and {content}: choose another -o"))
            return None
        if content.identity != self._sweep.identity:
            raise RefusedError(*claims.differing(self._sweep, self._folder, content.settings))
        if self._options.prune and self._folder.shards.is_dir():
            with self._folder.locked():
                self._prune()
        return self._folder.result

    def go(self, executor: Executor) -> RunSummary:
        """Compute what is missing and publish the result."""
        with self._reader:
            return self._go(executor)

    def _go(self, executor: Executor) -> RunSummary:
        claims.refuse_strangers(self._folder, self._reader)
        check_disk_space(self._sweep, self._folder.path, len(self._folder.shard_names()) / len(self._tiling))
        environment, accept = executor.environment(), self._options.accept_environment_change
        claims.refuse_other_environment(self._folder, environment, accept, self._reader)  # before any file is made
        self._folder.make()
        with self._folder.locked():
            claims.refuse_other_sweep(self._sweep, self._folder, self._reader)
            if (reason := claims.damage(self._folder.record)) is not None:
                self._quarantine(self._folder.record, reason)
            claims.refuse_other_environment(self._folder, environment, accept, self._reader)
            self._folder.remove_leftovers()
            record = claims.own_record(self._sweep, self._folder, environment, self._options.command)
            if self._is_complete():  # another process finished it meanwhile
                if self._options.prune:
                    self._prune()
                return RunSummary(self._folder.result, 0, len(self._tiling))
            make_folders(self._disk, self._folder.shards)
            finished_tiles = self._verified(digest(environment))
            self._folder.note("started", command=list(self._options.command), kept=len(finished_tiles))
            computed = self._compute(executor, finished_tiles, record)
            if len(finished_tiles) + computed < len(self._tiling):
                self._folder.note("finished", computed=computed)
                return RunSummary(self._folder.path, computed, len(finished_tiles))
            self._consolidate(record)
            self._folder.note("finished", computed=computed)
            if self._options.prune:
                self._prune()
        return RunSummary(self._folder.result, computed, len(finished_tiles))

    # -- tiles -----------------------------------------------------------------------------------

    def _quarantine(self, path: Path, reason: str) -> None:
        target = self._folder.set_aside(path)
        self._folder.note("quarantined", file=path.name, reason=reason)
        self._hooks.warn(printable(f"{path}: {reason}: moved to {target} and made again"))

    def _read(self, index: int) -> Shard:
        return self._reader.shard(self._folder.shard(index), self._sweep.layout, index, self._tiling.extent(index))

    def _verified(self, environment: str) -> list[int]:
        # Tiles whose shards exist and are undamaged; other files of these names are set aside.
        finished_tiles = []
        for path, index in self._folder.shard_names().items():
            try:
                if index >= len(self._tiling) or path != self._folder.shard(index):
                    raise DamagedError("it is no tile of this sweep")
                shard = self._read(index)
            except DamagedError as error:
                self._quarantine(path, str(error))
                continue
            if shard.environment != environment and not self._options.accept_environment_change:
                raise RefusedError(f"{path}: was computed in another environment: --accept-environment-change keeps it")
            finished_tiles.append(index)
        return finished_tiles

    def _compute(self, executor: Executor, finished_tiles: list[int], record: Record) -> int:
        done = sum(self._cells(index) for index in finished_tiles)
        self._hooks.on_tile(done, self._sweep.grid.n_cells)
        finished = set(finished_tiles)
        self._hooks.stop.busy, self._hooks.stop.note = True, self._note_stop
        first, end = self._options.tiles or (0, len(self._tiling))
        missing = [index for index in range(first, min(end, len(self._tiling))) if index not in finished]
        with contextlib.closing(_as_generator(executor.tiles(missing, self._hooks.stop))) as tiles:
            for computed in tiles:
                if not self._options.accept_environment_change:
                    claims.refuse_worker(record.environment, computed.environment)
                index = computed.shard.index
                data = encode(self._sweep.layout, computed.shard)
                self._folder.check_held()
                publish(self._disk, self._folder.shard(index), data)
                self._reader.trusted.add(trailer_of(data))
                finished.add(index)
                done += self._cells(index)
                self._folder.note("tile", index=index)
                self._hooks.on_tile(done, self._sweep.grid.n_cells)
        if not finished.issuperset(missing):
            self._stopped(len(finished))
        return len(missing)

    def _cells(self, index: int) -> int:
        return math.prod(self._tiling.extent(index))

    def _note_stop(self) -> None:
        code = self._hooks.stop.code
        with contextlib.suppress(StoreError):  # the note is for information only
            by = {ExitCode.TERMINATED: "SIGTERM", ExitCode.INTERRUPTED: "Ctrl-C"}.get(code) if code else None
            self._folder.note("stopped", by=by)

    def _stopped(self, finished: int) -> None:
        code = self._hooks.stop.code
        self._note_stop()
        line = f"{self._folder.path}: {finished} of {len(self._tiling)} tiles are kept; run it again to go on"
        if code is None:
            raise StoreError(line)
        by = " by SIGTERM" if code is ExitCode.TERMINATED else ""
        raise StoppedError(f"stopped{by}: {line}", code)

    # -- the result ------------------------------------------------------------------------------

    def _consolidate(self, record: Record) -> None:
        path = self._folder.result
        if os.path.lexists(path):
            self._quarantine(path, "it was not whole when the run began")
        facts = {
            **attributes(self._sweep),
            "environment": digest(record.environment),
            "environment_settings": canonical_json(record.environment),
        }
        shards = (self._read(index) for index in range(len(self._tiling)))

        def between() -> None:
            self._folder.check_held()
            if self._hooks.stop:
                self._stopped(len(self._tiling))

        try:
            consolidate(self._disk, path, self._sweep.layout, self._sweep.grid, shards, facts, between=between)
        except DamagedError as error:
            raise StoreError(
                f"{self._folder.shards}: a shard changed while it was read: {error}; run it again"
            ) from error

    def _is_complete(self) -> bool:
        content = claims.content_at(self._folder.result, self._reader)
        return isinstance(content, Content) and content.identity == self._sweep.identity

    def _prune(self) -> None:
        self._folder.check_held()
        for path in self._folder.shard_names():
            try:
                if path.is_file():
                    self._disk.unlink(path)
            except OSError as error:
                raise refusal(path, error) from error


def _as_generator(tiles: Iterator[Computed]) -> Generator[Computed, None, None]:
    # An iterator that can be closed, so that workers end if publishing fails.
    yield from tiles
