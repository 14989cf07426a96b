"""Maps as measures: datasets of a sweep at the robot of a point."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.config.reading import checked, json_text
from cspr_jax.config.sweep import SweepFile, axis_points, cell_widths
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.numerics.batches import in_threads, short_batches
from cspr_jax.numerics.shapes import Int
from cspr_jax.schema.quantities import QUANTITIES, is_of_robot
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.sweep.checks import is_asked
from cspr_jax.sweep.definition import Sweep, sweep_of
from cspr_jax.sweep.robots import robot_of
from cspr_jax.sweep.tile import TileMap
from cspr_jax.synthesis.measures.measure import FEASIBLE, FRACTION, Columns, Measure
from cspr_jax.synthesis.space import Point, RobotSpace, UnsuitableRobotError
from cspr_jax.workspaces.map import WorkspaceMap

# Ends of cells nearer to each other than this fraction of the extent are one.
SAME = 1e-9
# Margins of maps of motions; those of workspaces are `workspaces.static_poses.MARGINS`.
_MARGINS = ("margin", "limit_margin", "det_margin", "acceleration_margin")
# Beginnings of names of datasets that count orientations of a set.
_OF_SETS = ("accessible", "attainable", "orientation", "undecided")
_SLACKS = (
    *_MARGINS,
    *("wrench_margin", "closure_margin", "clearance", "floor_margin", "length_margin", "speed_margin"),
)


class MapMeasure(Measure):
    """Datasets of a map, a value for each cell; `feasible`, 1 or 0; and `fraction`, the mean of these."""

    def __init__(
        self, space: RobotSpace, name: str, quantities: Sequence[str], path: Path, *, has_corners: bool = False
    ) -> None:
        """Check the sweep at the robot of the file, and store what is asked for; corners of cells may be cells, too."""
        super().__init__(space)
        self._name, self._path, self._has_corners = name, path, has_corners
        self._asked = list[str]()
        self._moves = space.moves("maps", name)
        self.sweep = self._sweep(space.first)
        for axis in filter(is_of_robot, self.sweep.grid.axes):
            raise ConfigError(path, f"axes.{axis}: must be absent: the design has the robots")
        for quantity in quantities:
            self.check(quantity)
        self._asked = [quantity for quantity in quantities if quantity not in (FEASIBLE, FRACTION)]
        self.sweep = self._sweep(space.first)

    def check_at(self, point: Point) -> None:
        """Refuse keys that parameters of the design have moved so that they are none; see `Measure.check_at`."""
        if self._moves:
            self._sweep(point)

    def check_proofs(self) -> None:
        """Refuse proofs of a map that has none."""
        if self.sweep.kind.name != "workspace":
            raise InputError("prove", True, "absent: it is no map of a workspace")
        if self.space.moves("maps", self._name, "axes"):
            raise InputError("prove", True, "absent: parameters move its axes, so that there are no fixed cells")
        TileMap(self._sweep(self.space.first, proves=True))

    def sides(self, point: Point) -> Int[np.ndarray, "n"]:
        """Which side each full cell is proved to be on, in maps of workspaces: 1 inside, 2 outside, 0 open."""
        sweep = self._sweep(point, proves=True)
        return self._values(point, sweep)["cell_side"]

    def _sweep(self, point: Point, *, proves: bool = False) -> Sweep:
        spec = self.space.table_at(point, "maps", self._name)
        if proves:
            spec |= {"workspace": {**spec.get("workspace", {}), "prove": True}}
        elif self._has_corners:
            spec |= {"axes": _with_corners(checked(SweepFile, spec | {"robot": ""}, self._path))}
        run = {key: value for key, value in spec.get("run", {}).items() if key not in ("store", "dtype")}
        data = spec | {"robot": self.space.robot_file.full.model_dump(mode="json", exclude_none=True), "run": run}
        sweep = sweep_of(data, self._path, text=json_text(spec))
        names = {*self._asked, "verdict", *self._margins_of(sweep), *(["cell_side"] if proves else [])}
        names_to_store = [name for name in sweep.kind.quantities if name in names]
        if not names_to_store:  # before it is known what is asked for
            return sweep
        run["store"] = names_to_store
        return sweep_of(data, self._path, text=json_text(spec))

    def _margins_of(self, sweep: Sweep) -> list[str]:
        names = [name for name in _SLACKS if name in sweep.kind.quantities]
        conditions = {name: sweep.kind.keys_of(name) for name in names}
        return [
            name
            for name in names
            if not conditions[name] or any(is_asked(sweep.spec, sweep.robot, k) for k in conditions[name])
        ]

    def check(self, quantity: str) -> None:
        """Refuse what is no dataset of the map; see `Measure.check`."""
        has_verdicts = "verdict" in self.sweep.kind.quantities
        names = [*((FEASIBLE, FRACTION) if has_verdicts else ()), *self.sweep.kind.quantities]
        if quantity not in names:
            hint = did_you_mean(quantity, names)
            raise InputError("quantity", quantity, f"{hint}one of {', '.join(names)}")
        if quantity not in (FEASIBLE, FRACTION):
            row = QUANTITIES[quantity]
            if row.meanings or row.unflagged:
                raise InputError("quantity", quantity, "another one: its numbers stand for words")
            conditions = self.sweep.kind.keys_of(quantity)
            if conditions and not any(is_asked(self.sweep.spec, self.sweep.robot, key) for key in conditions):
                raise InputError("quantity", quantity, f"another one without {' or '.join(conditions)} in the map")

    def slacks(self) -> tuple[str, ...]:
        """Margins of the map; see `Measure.slacks`."""
        return tuple(self._margins_of(self.sweep))

    def jumps(self, quantity: str) -> bool:
        """Tell whether a dataset holds counts, or fractions of counts; see `Measure.jumps`."""
        counts = (FEASIBLE, FRACTION, "mean_arcs", "largest_tilt")
        return quantity in counts or quantity.startswith(_OF_SETS) or QUANTITIES[quantity].kind != "float"

    def _columns(self, point: Point) -> Columns:
        return with_verdicts(self._values(point, self._sweep_at(point)))

    def _sweep_at(self, point: Point) -> Sweep:
        try:
            return self._sweep(point) if self._moves else self.sweep
        except ConfigError as error:
            raise UnsuitableRobotError(str(error)) from error

    def _values(self, point: Point, sweep: Sweep) -> Columns:
        robot_file = self.space.robot_at(point)
        try:
            sweep = dataclasses.replace(sweep, robot=robot_of(robot_file, sweep.spec, sweep.kind, self._path))
            tiles = TileMap(sweep)
            parts = [tiles(index).shard.values for index in range(len(sweep.grid.tiling))]
        except ConfigError as error:
            raise UnsuitableRobotError(str(error)) from error
        return _joined(sweep, parts)

    def words(self, point: Point, quantity: str, element: Int[np.ndarray, "2"]) -> str:
        """The cell, with the two nearest bodies of a clearance; see `Measure.words`."""
        at = ", ".join(f"{axis} = {values[element[1]]:.4g}" for axis, values in self.cells_at(point).items())
        detail = self._detail(point, quantity, element)
        return f"at {at}" + (f" ({detail})" if detail else "")

    def _detail(self, point: Point, quantity: str, element: np.ndarray) -> str:
        # Words for what decides an element; empty where nothing more is known.
        sweep = self._sweep_at(point)
        if quantity != "clearance" or sweep.kind.name != "workspace":
            return ""
        robot_file = robot_of(self.space.robot_at(point), sweep.spec, sweep.kind, self._path)
        cell = {name: values[element[1:]] for name, values in self.cells_at(point).items()}
        return nearest_words(WorkspaceMap(robot_file, sweep.spec, self._path), cell)

    def many(self, points: Sequence[Point]) -> list[Columns | None]:
        """Columns of many robots, side by side in threads; see `Measure.many`."""
        with short_batches():
            return in_threads(self._columns_or_none, list(points))

    @cached_property
    def cells(self) -> dict[str, np.ndarray]:
        """Coordinates of all cells at the values of the file."""
        return _cells_of(self.sweep)

    def cells_at(self, point: Point) -> dict[str, np.ndarray]:
        """Coordinates of all cells at a point."""
        return _cells_of(self._sweep_at(point)) if self._moves else self.cells


def _cells_of(sweep: Sweep) -> dict[str, np.ndarray]:
    return sweep.grid.cells(tuple(slice(0, len(points)) for points in sweep.grid.axes.values()))


def nearest_words(workspace: WorkspaceMap, cell: dict[str, np.ndarray]) -> str:
    """The two nearest bodies at the first of some cells, in words; cables count from 0 on, as in files."""
    pair = workspace.nearest(cell)
    if pair is None:
        return ""
    if pair.kind == "cables":
        return f"cables {pair.cable} and {pair.other}"
    body = f"obstacle {pair.other}" if pair.other >= 0 else "the platform"
    return f"cable {pair.cable} and {body}" if pair.cable >= 0 else f"the platform and {body}"


def _with_corners(spec: SweepFile) -> dict[str, Any]:
    # Axes with the ends of the full cells, which reach half-way to the farther neighbour of a point.
    axes = spec.axes.model_dump(exclude_none=True)
    for name in filter(axes.__contains__, "xyz"):
        points = np.sort(axis_points(spec.axes.named(name)))
        half = 0.5 * cell_widths(points)
        ends = np.sort(np.concatenate([points - half, points, points + half]))
        is_new = np.diff(ends, prepend=-np.inf) > SAME * np.ptp(ends)
        axes[name] = ends[is_new].tolist()
    return axes


def with_verdicts(columns: Columns) -> Columns:
    """Columns with `feasible` and `fraction` beside `verdict`, where there is one."""
    if "verdict" not in columns:
        return columns
    inside = ((columns["verdict"] & ~FLAGS(Verdict.FEWER_ARCS_UNDECIDED)) == 0).astype(float)
    return {**columns, FEASIBLE: inside, FRACTION: inside}


def _joined(sweep: Sweep, parts: list[dict[str, np.ndarray]]) -> Columns:
    shape, tiling = sweep.grid.shape, sweep.grid.tiling
    columns = {name: np.empty(shape, part.dtype) for name, part in parts[0].items()}
    for index, part in enumerate(parts):
        for name, values in part.items():
            columns[name][tiling.slices(index)] = values
    return {name: values.ravel() for name, values in columns.items()}
