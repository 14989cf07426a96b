"""Maps of workspaces as measures: robots as lanes of kernels, and derivatives of margins along facet normals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.maps.grid_map import RobotsApartError
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.schema.quantities import ARRANGEMENT, PARAMETER
from cspr_jax.sweep.robots import robot_at
from cspr_jax.synthesis.measures.maps import MapMeasure, with_verdicts
from cspr_jax.synthesis.measures.measure import SMALLEST_FACET, Columns
from cspr_jax.synthesis.space import Point, RobotSpace
from cspr_jax.workspaces.map_over_robots import WorkspacesOfRobots

# Number of cells whose robots are lanes at a time.
AT_ONCE = 1 << 21
# Facets of a cell that may become its smallest one.
FACETS = 6
_OF_CABLES = ("wrench_margin", "closure_margin")


class WorkspaceMeasure(MapMeasure):
    """A map of workspaces of robots that can be lanes.

    Raises:
        RobotsApartError: they cannot.
    """

    is_exact = True

    def __init__(
        self, space: RobotSpace, name: str, quantities: Sequence[str], path: Path, *, has_corners: bool = False
    ) -> None:
        """Prepare the kernels from samples of the robots."""
        super().__init__(space, name, quantities, path, has_corners=has_corners)
        sweep = self.sweep
        if self._moves or sweep.kind.name != "workspace" or len(set(self.slacks()) & set(_OF_CABLES)) != 1:
            raise RobotsApartError

        def robot(values: Mapping[str, float]):
            return robot_at(space.robot_file, sweep.spec, sweep.kind, values, sweep.file)

        self._numbers = np.array(space.arrangements, float)
        axes = dict(sweep.grid.axes)
        for variable in space.variables:
            if variable.name in space.of_robot:
                axes[PARAMETER + variable.name] = np.linspace(variable.lower, variable.upper, 3)
        if len(space.arrangements) > 1 or space.arrangements[0]:
            axes[ARRANGEMENT] = self._numbers
        try:
            with double_precision():
                self._lanes = WorkspacesOfRobots(robot, sweep.spec, sweep.file, axes, screens=True)
        except ConfigError as error:  # some values give no robot
            raise RobotsApartError from error
        self._axes = [name for name in axes if name not in sweep.grid.axes]
        self._margin = next(name for name in self.slacks() if name in _OF_CABLES)

    def _cells_of(self, points: Sequence[Point], cells: Int[np.ndarray, "m"]) -> dict[str, np.ndarray]:
        # Coordinates and robots of the same cells of all points.
        columns = {name: np.tile(values[cells], len(points)) for name, values in self.cells.items()}
        for axis in self._axes:
            i = None if axis == ARRANGEMENT else self.space.names.index(axis.removeprefix(PARAMETER))
            values = [point.arrangement if i is None else point.values[i] for point in points]
            columns[axis] = np.repeat(np.array(values, float), len(cells))
        return columns

    def many(self, points: Sequence[Point]) -> list[Columns | None]:
        """Columns of many robots, as lanes; see `Measure.many`."""
        count, result = self.sweep.grid.n_cells, list[Columns | None]()
        together = max(AT_ONCE // count, 1)
        for start in range(0, len(points), together):
            part = points[start : start + together]
            with double_precision():
                answers = self._lanes(self._cells_of(part, np.arange(count)))
            columns_of_points = {name: answers[name].reshape(len(part), count) for name in self.sweep.store}
            result += [
                with_verdicts({name: values[i] for name, values in columns_of_points.items()}) for i in range(len(part))
            ]
        return result

    def elements(self, point: Point, quantity: str, cells: Int[np.ndarray, "m"]) -> Int[np.ndarray, "n 2"]:
        """The facets of each cell with the smallest margins; see `Measure.elements`."""
        if quantity != self._margin:
            return super().elements(point, quantity, cells)
        values, _ = self._facets(point, cells)
        order = np.argsort(values, axis=0)[:FACETS]
        pairs = np.stack([order, np.broadcast_to(cells, order.shape)], axis=-1)
        return pairs.reshape(-1, 2)

    def at(
        self, point: Point, quantity: str, elements: Int[np.ndarray, "m 2"]
    ) -> tuple[Float[np.ndarray, "m"], Float[np.ndarray, "m k"]]:
        """Margins along facet normals with exact derivatives; see `Measure.at`."""
        if quantity != self._margin:
            return super().at(point, quantity, elements)
        cells, indices = np.unique(elements[:, 1], return_inverse=True)
        values, derivatives = self._facets(point, cells)
        facets, columns = elements[:, 0], indices.ravel()
        chosen = np.where(facets == SMALLEST_FACET, values.argmin(0)[columns], facets), columns
        return values[chosen], derivatives[:, *chosen].T

    def _facets(self, point: Point, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Margins (f, m) and derivatives (k, f, m) by fractions of all variables; robots that differ in a part of them.
        with double_precision():
            values, by_parameters = self._lanes.facets(self._cells_of([point], cells))
        names = [axis.removeprefix(PARAMETER) for axis in self._lanes.parameter_axes]
        derivatives = np.zeros((len(self.space.names), *values.shape))
        ranges = self.space.upper - self.space.lower
        for name, derivative in zip(names, by_parameters, strict=True):
            i = self.space.names.index(name)
            derivatives[i] = derivative * ranges[i]
        return values, np.where(np.isfinite(derivatives), derivatives, 0.0)

    def _detail(self, point: Point, quantity: str, element: np.ndarray) -> str:
        # Words for the cables that are at a limit.
        if quantity != self._margin:
            return super()._detail(point, quantity, element)
        cells = element[1:]
        facet = int(element[0])
        if facet == SMALLEST_FACET:
            facet = int(self._facets(point, cells)[0].argmin())
        with double_precision():
            low, high = self._lanes.limits_of_facet(self._cells_of([point], cells), facet)
        return ", ".join(filter(None, (_cables(low, "smallest"), _cables(high, "largest"))))


def _cables(cables: list[int], end: str) -> str:
    if not cables:
        return ""
    *others, last = map(str, cables)
    names = f"cables {', '.join(others)} and {last} at their" if others else f"cable {last} at its"
    return f"{names} {end} tension"
