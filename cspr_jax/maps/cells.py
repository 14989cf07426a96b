"""Cells of a sweep: coordinates of a grid to the quantities of a result file."""

import numpy as np

from cspr_jax import problem
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError
from cspr_jax.feasibility.certificate import Shared
from cspr_jax.maps.minimum_arcs import minimum_arcs
from cspr_jax.robots import centroid, plane_normal
from cspr_jax.tiles import Grid


class CellMap:
    """The map of a sweep, ready to compute tiles.

    Args:
        spec: the robot.
        keys: the sweep.
        file: named in errors.

    Raises:
        ConfigError: the robot, the amplitude function or the limits cannot be used.
    """

    def __init__(self, spec: RobotFile, keys: SweepFile, file: object) -> None:
        """Build what all tiles share."""
        self._keys, self._file, self._signs = keys, file, problem.axis_signs(spec)
        if spec.planar:
            raise ConfigError(file, f'robot "{spec.name}" is planar: must have three cables in this map')
        robot = problem.build_robot(spec, keys.trajectory, file)
        amplitude = problem.build_amplitude(keys.trajectory, file, at="trajectory.")
        limits = problem.build_limits(spec, keys.limits, keys.limits.floor, file)
        self._shared = Shared(robot, limits, amplitude)
        self._centre = np.asarray(centroid(robot))

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile.

        Args:
            cells: (n,) coordinates for each axis, in the file's axes.

        Returns:
            (n,) for each quantity.
        """
        starts, ends = self._points(cells)
        answers = minimum_arcs(
            self._shared, starts, ends, cells["z0"], max_arcs=self._keys.trajectory.max_arcs, dtype=self._keys.run.dtype
        )
        return vars(answers)

    def _points(self, cells: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        # Start and end of each cell, in the kernels' axes.
        ends = np.stack([cells["x"], cells["y"], cells["z"]], axis=1) * self._signs
        start = self._keys.trajectory.start
        if start is not None and start.rest:
            starts = np.tile(self._centre, (len(ends), 1))
            starts[:, 2] += cells["z0"]
            return starts, ends
        fixed = start.position if start is not None and start.position is not None else [0.0, 0.0, 0.0]
        columns = [cells.get(f"from_{name}", np.full(len(ends), fixed[i])) for i, name in enumerate("xyz")]
        return np.stack(columns, axis=1) * self._signs, ends

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse a grid in which no cell has both ends below the spools and within the limits.

        Args:
            grid: the grid.

        Raises:
            ConfigError: what is wrong with all of them.
        """
        lows = {name: np.array([points.min(), points.max()]) for name, points in grid.axes.items()}
        corners = Grid(lows, tuple(2 for _ in lows))
        starts, ends = self._points(corners.cells(tuple(slice(0, 2) for _ in lows)))
        normal = np.asarray(plane_normal(self._shared.robot))
        floor = self._shared.limits.floor
        for points, key in ((ends, "axes"), (starts, "trajectory.from")):
            if not ((points - self._centre) @ normal > 0.0).any():
                raise ConfigError(self._file, f"{key}: every point is above the spool plane: must be some below it")
            if floor is not None and not (points[:, 2] <= np.asarray(floor)).any():
                raise ConfigError(self._file, f"{key}: every point is below the floor: must be some above it")
        self._refuse_long(grid)

    def _refuse_long(self, grid: Grid) -> None:
        # The nearest point of a product grid to a spool is nearest in each coordinate.
        longest = self._shared.limits.cable_length_max
        if longest is None:
            return
        base = np.asarray(self._shared.robot.base_points) * self._signs
        for cable in range(3):
            gaps = [np.abs(grid.axes[name] - base[cable, i]).min() for i, name in enumerate("xyz")]
            if np.linalg.norm(gaps) > np.asarray(longest)[cable]:
                raise ConfigError(
                    self._file,
                    f"axes: every target is farther than cable_length_max from spool {cable + 1}: must be some nearer",
                )
