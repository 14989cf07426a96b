"""A sweep: its checked file, and everything that determines its result."""

import dataclasses
import functools
import itertools
import math
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax import __version__
from cspr_jax.config.keys.workspace import WorkspaceTable
from cspr_jax.config.missing_cables import without_cables
from cspr_jax.config.parameters import with_values
from cspr_jax.config.reading import checked, parse_toml, read_text, refuse_other_kinds
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.config.sweep import AxisRange, Orientations, SweepFile, axis_names, sweep_spec
from cspr_jax.errors import ConfigError, shown
from cspr_jax.schema.identity import FORMAT_VERSION, canonical_json, identity
from cspr_jax.schema.map_kinds import MAP_KINDS, MapKind
from cspr_jax.schema.quantities import ARRANGEMENT
from cspr_jax.schema.tiles import LARGEST_TILE, Grid, Tiling, tile_shape
from cspr_jax.store.files.netcdf import bytes_needed, dtype_of
from cspr_jax.store.shards import Layout
from cspr_jax.sweep.checks import check_map, check_points, check_store, is_asked, is_given
from cspr_jax.sweep.robots import arrangement_axis, axes_of, check_robots, robot_of
from cspr_jax.sweep.tile_sizes import tile_cells

# Largest number of tiles, each of which is a file.
LARGEST_TILES = 100_000
LARGEST_RESULT = 1 << 46  # bytes; the free space on the disk is checked when a run starts
LONGEST_NAME = 200  # bytes, so that file systems accept names that are made from it
# Maps of fewer cells are finished before a GPU has compiled its code. Maps with more seconds per cell are searches and
# proofs of many short steps, each of which a GPU has to launch (docs/performance.md, GPU).
MIN_FOR_GPU, MAX_SECONDS_FOR_GPU = 100_000, 1e-3


@dataclasses.dataclass(frozen=True)
class Sweep:
    """A checked sweep.

    Fields:
        file: path of its file.
        kind: kind of its map.
        spec: content of the file.
        robot: its robot, or the equivalent that its map moves; see `config.equivalents`.
        grid: its axes and tiles.
        store: quantities to store.
        settings: everything that determines the numbers of the result.
        text: text of the file, as it was read.
        types: NumPy name of the type of each stored quantity, for processes without rows from outside of the package.
    """

    file: Path
    kind: MapKind
    spec: SweepFile
    robot: RobotFile
    grid: Grid
    store: list[str]
    settings: dict[str, Any]
    text: str
    types: dict[str, str]

    @functools.cached_property
    def identity(self) -> str:
        """Hash of the settings."""
        return identity(self.settings)

    @property
    def name(self) -> str:
        """Name of the file, without its ending."""
        return self.file.stem

    @property
    def prefers_cpu(self) -> bool:
        """Tell whether a GPU would take longer than the CPU."""
        is_stepwise = self.kind.by_processes or self.kind.cost.seconds > MAX_SECONDS_FOR_GPU
        return is_stepwise or self.grid.n_cells < MIN_FOR_GPU

    @functools.cached_property
    def layout(self) -> Layout:
        """Layout that all shards share."""
        return Layout(self.identity, self.store, self.spec.run.dtype)


def read_sweep(path: Path, parameters: Mapping[str, float] | None = None) -> Sweep:
    """Read a sweep file, with more values of parameters, and check it, without computing anything."""
    if len(os.fsencode(path.stem)) > LONGEST_NAME:
        raise ConfigError(path, f"a name of {len(os.fsencode(path.stem))} bytes: must be at most {LONGEST_NAME}")
    text = read_text(path)
    return sweep_of(with_values(parse_toml(text, path), parameters), path, text=text)


def sweep_of(data: dict[str, Any], path: Path, *, text: str) -> Sweep:
    """Check the parsed content of a sweep file, without computing anything."""
    refuse_other_kinds(data, "sweep", path)
    spec = checked(SweepFile, data, path)
    robot = resolve_robot(spec.robot, path, path.parent, spec.parameters, spec.parameter)
    kind = MAP_KINDS[spec.map].of(spec.trajectory.family)
    check_map(kind, spec, path)
    robot = robot_of(robot, spec, kind, path)
    orientation_axes = _orientation_axes(spec) if kind.is_over_orientations else {}
    names = axis_names(data["axes"])
    known_axes = arrangement_axis(spec, robot, path) | orientation_axes
    counts = {name: 0 if name in known_axes else _count(spec.axes.named(name)) for name in names}
    counts |= {name: len(points) for name, points in known_axes.items()}
    check_store(kind, spec, robot, path)
    store = list(spec.run.store or _usual(kind, spec, robot))
    shape = tuple(counts.values())
    usual = tile_shape(shape, tile_cells(kind, spec, math.prod(shape)))
    tile = usual if spec.run.tile is None else _tile(spec.run.tile, shape, path)
    _check_size(counts, tile, usual, bytes_needed(shape, store, spec.run.dtype), path)
    axes = axes_of(spec, names, robot, path)
    check_points(axes, kind, robot, path)
    check_robots(robot, spec, kind, axes, path)
    axes |= orientation_axes
    # Leave out keys that are not given, so that keys of later versions do not change old identities.
    settings = spec.model_dump(mode="json", by_alias=True, exclude_none=True)
    settings |= {"robot": robot.settings, "dimensions": list(axes)}
    settings |= {"arrangements": len(axes[ARRANGEMENT])} if spec.axes.arrangement == "all" else {}
    settings["run"] |= {"tile": list(tile), "store": store}
    types = {name: dtype_of(name, spec.run.dtype) for name in store}
    return Sweep(path, kind, spec, robot, Grid(axes, tile), store, settings, text, types)


def sweep_of_settings(settings: dict[str, Any], file: Path, text: str = "") -> Sweep:
    """The sweep that a run has recorded, even if its file has changed or is gone."""
    spec = checked(SweepFile, sweep_spec(settings), file)
    kind = MAP_KINDS[spec.map].of(spec.trajectory.family)
    robot = without_cables(checked(RobotFile, settings["robot"], file, at="robot"), spec.without, file)
    over_orientations = _orientation_axes(spec) if kind.is_over_orientations else {}
    file_axes = axes_of(spec, axis_names(settings["axes"]), robot, file)
    axes = {name: (file_axes | over_orientations)[name] for name in settings["dimensions"]}
    check_points(file_axes, kind, robot, file)
    run = settings["run"]
    types = {name: dtype_of(name, spec.run.dtype) for name in run["store"]}
    return Sweep(file, kind, spec, robot, Grid(axes, tuple(run["tile"])), list(run["store"]), settings, text, types)


def _usual(kind: MapKind, spec: SweepFile, robot: RobotFile) -> list[str]:
    # Quantities that are stored by default.
    more = [names for key, names in kind.stored_with if is_given(spec, key)]
    names = dict.fromkeys((*kind.stored, *itertools.chain(*more)))
    needed = {name: kind.keys_of(name) for name in names}
    return [name for name in names if not needed[name] or any(is_asked(spec, robot, key) for key in needed[name])]


def _count(axis: AxisRange | list[float]) -> int:
    return axis.count if isinstance(axis, AxisRange) else len(axis)


def _orientation_axes(spec: SweepFile) -> dict[str, np.ndarray]:
    count = (spec.orientations or Orientations()).divisions
    step = math.pi / count
    return {
        "torsion": np.arange(1 - count, count + 1) * step,
        "tilt_azimuth": np.arange(2 * count) * step,
        "tilt": np.arange(count) * step,
    }


def _tile(tile: list[int], shape: tuple[int, ...], path: Path) -> tuple[int, ...]:
    if len(tile) != len(shape) or float(np.prod(tile, dtype=float)) > LARGEST_TILE:
        raise ConfigError(
            path, f"run.tile = {shown(tile)}: must be {len(shape)} integers whose product is at most {LARGEST_TILE}"
        )
    return tuple(min(t, n) for t, n in zip(tile, shape, strict=True))


def _check_size(counts: dict[str, int], tile: tuple[int, ...], usual: tuple[int, ...], needed: int, path: Path) -> None:
    # Check before memory is allocated; `check_disk_space` compares with the free space when the run starts.
    shape, label = tuple(counts.values()), f"axes: {_cells_of(counts)}"
    if needed > LARGEST_RESULT:
        raise ConfigError(path, f"{label} needs {needed / 1e9:.3g} GB: must be at most {LARGEST_RESULT / 1e9:.3g} GB")
    tiles = len(Tiling(shape, tile))
    if tiles <= LARGEST_TILES:
        return
    if len(Tiling(shape, usual)) <= LARGEST_TILES:
        raise ConfigError(
            path,
            f"run.tile = {shown(list(tile))}: {tiles} tiles: must be so large that there are at most {LARGEST_TILES}, "
            f"or absent: then it is {list(usual)}",
        )
    maximum = LARGEST_TILES * math.prod(usual)
    raise ConfigError(path, f"{label} is too large: must be at most {maximum} cells; fewer points, or several sweeps")


def check_disk_space(sweep: Sweep, directory: Path, done: float) -> None:
    """Refuse a sweep whose files would not fit on the disk."""
    folder = next(path for path in (directory, *Path(os.path.abspath(directory)).parents) if path.is_dir())
    needed = bytes_needed(sweep.grid.shape, sweep.store, sweep.spec.run.dtype) * (1.0 - 0.5 * done)
    free = shutil.disk_usage(folder).free
    if needed > free:
        counts = {name: len(points) for name, points in sweep.grid.axes.items()}
        raise ConfigError(
            sweep.file,
            f"axes: {_cells_of(counts)} needs {needed / 1e9:.3g} GB: must fit on the disk ({free / 1e9:.3g} GB free)",
        )


def _cells_of(counts: dict[str, int]) -> str:
    # Words for the numbers of points, and for the axis with the most.
    largest = max(counts, key=lambda name: counts[name])
    cells = f"{' x '.join(str(n) for n in counts.values())} ({', '.join(counts)})"
    return f"a grid of {cells}, most along {largest},"


def run_directory(sweep: Sweep) -> Path:
    """Default directory of a sweep's result, without -o."""
    return Path("results") / f"{sweep.file.stem}-{sweep.identity[:12]}"


def attributes(sweep: Sweep) -> dict[str, Any]:
    """Attributes of a result file, from its sweep."""
    robot, words = sweep.robot, [sweep.kind.title, f"robot {sweep.robot.name}"]
    if "workspace" in sweep.kind.takes:
        words += (sweep.spec.workspace or WorkspaceTable()).conditions
    # Motions on one ellipse have no amplitude function.
    if sweep.kind.families and sweep.spec.trajectory.takes_amplitude and "ellipse" not in sweep.kind.takes:
        words.append(f"amplitude {sweep.settings['trajectory']['amplitude']}")
    return {
        "Conventions": "CF-1.11",
        "title": ", ".join(words),
        "schema": FORMAT_VERSION,
        "map": sweep.kind.name,
        "identity": sweep.identity,
        "settings": canonical_json(sweep.settings),
        "z_axis": robot.z_axis,
        "robot": robot.name,
        "base_points": np.asarray(robot.base_points),
        "software": f"cspr_jax {__version__}",
    }
