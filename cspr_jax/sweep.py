"""A sweep: from its file to a result file, tile by tile."""

import dataclasses
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax import __version__
from cspr_jax.config.reading import checked, read_toml
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.config.sweep import AxisRange, SweepFile
from cspr_jax.errors import ConfigError, RefusedError, StoreError, one_line, shown
from cspr_jax.identity import FORMAT_VERSION, canonical_json, identity
from cspr_jax.quantities import DEFAULT_STORE
from cspr_jax.store import bytes_needed, new_result, write_text
from cspr_jax.tiles import LARGEST_TILE, Grid, tile_shape

_TARGET = ("x", "y", "z")
_START = ("from_x", "from_y", "from_z")


@dataclasses.dataclass(frozen=True)
class Sweep:
    """A checked sweep.

    Fields:
        file: where it was read.
        keys: its content.
        robot: its robot.
        grid: its axes and tiles.
        store: quantities to keep.
        settings: everything that decides the result's numbers.
    """

    file: Path
    keys: SweepFile
    robot: RobotFile
    grid: Grid
    store: list[str]
    settings: dict[str, Any]

    @property
    def identity(self) -> str:
        """Hash of the settings."""
        return identity(self.settings)


def read_sweep(path: Path) -> Sweep:
    """A sweep file, checked without computing anything.

    Args:
        path: the file.

    Returns:
        the sweep.

    Raises:
        ConfigError: a mistake in it.
    """
    data = read_toml(path)
    keys = checked(SweepFile, data, path)
    robot = resolve_robot(keys.robot, path, path.parent)
    _check_start(keys, path)
    counts = {name: _count(getattr(keys.axes, name)) for name in data["axes"]}
    store = list(keys.run.store or DEFAULT_STORE)
    tile = _tile(keys, tuple(counts.values()), path)
    _check_room(counts, store, keys.run.dtype, path)
    axes = {name: _points(getattr(keys.axes, name)) for name in data["axes"]}
    if not (axes["z0"] > 0.0).all():
        raise ConfigError(path, f"axes.z0 = {shown(float(axes['z0'].min()))}: must be a number > 0")
    settings = keys.model_dump(mode="json", by_alias=True)
    settings |= {"robot": robot.model_dump(mode="json"), "dimensions": list(axes)}
    settings["run"] |= {"tile": list(tile), "store": store}
    return Sweep(path, keys, robot, Grid(axes, tile), store, settings)


def _count(axis: AxisRange | list[float]) -> int:
    return axis.count if isinstance(axis, AxisRange) else len(axis)


def _points(axis: AxisRange | list[float]) -> np.ndarray:
    if isinstance(axis, AxisRange):
        return np.linspace(axis.start, axis.stop, axis.count)
    return np.asarray(axis, float)


def _check_start(keys: SweepFile, path: Path) -> None:
    given = [name for name in _START if getattr(keys.axes, name) is not None]
    start = keys.trajectory.start
    if start is None and len(given) < 3:
        raise ConfigError(
            path,
            "trajectory.from is missing: { position = [x, y, z] }, { rest = true }, or axes from_x, from_y, from_z",
        )
    if start is not None and start.rest and given:
        raise ConfigError(path, f"axes.{given[0]}: must be absent where trajectory.from.rest = true")


def _tile(keys: SweepFile, shape: tuple[int, ...], path: Path) -> tuple[int, ...]:
    tile = keys.run.tile
    if tile is None:
        return tile_shape(shape)
    if len(tile) != len(shape) or float(np.prod(tile, dtype=float)) > LARGEST_TILE:
        raise ConfigError(
            path, f"run.tile = {shown(tile)}: must be {len(shape)} integers whose product is at most {LARGEST_TILE}"
        )
    return tuple(min(t, n) for t, n in zip(tile, shape, strict=True))


def _check_room(counts: dict[str, int], store: list[str], dtype: str, path: Path) -> None:
    needed, free = bytes_needed(tuple(counts.values()), store, dtype), shutil.disk_usage(Path.cwd()).free
    if needed > free:
        cells = " x ".join(str(n) for n in counts.values())
        raise ConfigError(
            path,
            f"axes: a grid of {cells} needs {needed / 1e9:.3g} GB: must fit on the disk ({free / 1e9:.3g} GB free)",
        )


def run_directory(sweep: Sweep) -> Path:
    """Where a sweep's result goes without -o.

    Args:
        sweep: the sweep.

    Returns:
        results/<sweep>-<first 12 digits of its identity>.
    """
    return Path("results") / f"{sweep.file.stem}-{sweep.identity[:12]}"


def run(
    sweep: Sweep, directory: Path, *, on_tile: Callable[[int, int], None] = lambda done, total: None
) -> tuple[Path, bool]:
    """Compute a sweep and publish its result; a finished one is left as it is.

    Args:
        sweep: the sweep.
        directory: the run's own folder; made if absent.
        on_tile: called with cells done and cells in all.

    Returns:
        path of the result file, and whether it had been there before.

    Raises:
        ConfigError: nothing in the grid can be computed.
        RefusedError: the folder belongs to another sweep.
        StoreError: the disk or the folder refuses.
    """
    from cspr_jax.maps.cells import CellMap  # compiled code is loaded only when it is needed

    result = directory / f"{sweep.file.stem}.h5"
    _refuse_other(sweep, directory)
    if result.exists():
        return result, True
    compute = CellMap(sweep.robot, sweep.keys, sweep.file)
    compute.refuse_hopeless(sweep.grid)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{directory}: cannot be made: {error.strerror}") from error
    write_text(directory / "run.json", json.dumps({"identity": sweep.identity, **sweep.settings}, indent=1) + "\n")
    grid, dtype = sweep.grid, sweep.keys.run.dtype
    with new_result(
        result, grid.axes, sweep.store, dtype=dtype, tile=grid.tile, attributes=_attributes(sweep)
    ) as writer:
        done = 0
        on_tile(done, grid.size)
        for place in grid.places():
            shape = tuple(part.stop - part.start for part in place)
            answers = compute(grid.cells(place))
            writer.write(place, {name: answers[name].reshape(shape) for name in sweep.store})
            done += int(np.prod(shape))
            on_tile(done, grid.size)
    return result, False


def _refuse_other(sweep: Sweep, directory: Path) -> None:
    record = directory / "run.json"
    if not record.exists():
        return
    try:
        old = json.loads(record.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise StoreError(f"{record}: cannot be read: {error}") from error
    if old.get("identity") == sweep.identity:
        return
    old.pop("identity", None)
    before, now = _flat(old), _flat(sweep.settings)
    lines = [
        f"{directory}: {key} = {shown(now.get(key))} here, {shown(before.get(key))} there: must be equal, or another -o"
        for key in sorted(before.keys() | now.keys())
        if before.get(key) != now.get(key)
    ]
    if not lines:
        lines = [f"{directory}: holds a run of another format: choose another -o"]
    raise RefusedError("\n".join(one_line(line) for line in lines))


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    if not isinstance(value, dict):
        return {key: value}
    return {k: v for name, inner in value.items() for k, v in _flat(inner, f"{key}.{name}" if key else name).items()}


def _attributes(sweep: Sweep) -> dict[str, Any]:
    robot = sweep.robot
    title = f"Smallest number of arcs, robot {robot.name}, amplitude {sweep.settings['trajectory']['amplitude']}"
    return {
        "Conventions": "CF-1.11",
        "title": title,
        "schema": FORMAT_VERSION,
        "map": sweep.keys.map,
        "identity": sweep.identity,
        "settings": canonical_json(sweep.settings),
        "z_axis": robot.z_axis,
        "robot": robot.name,
        "base_points": np.asarray(robot.base_points),
        "software": f"cspr_jax {__version__}",
    }
