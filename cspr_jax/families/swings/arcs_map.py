"""Maps of smallest numbers of arcs of point masses."""

from typing import Any

import numpy as np

from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError
from cspr_jax.families.swings.arcs import arcs_and_segments, minimum_arcs
from cspr_jax.families.swings.hypocycloid import Hypocycloid, batch_bounds
from cspr_jax.maps.grid_map import PointMassMap
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.limits import has_motor_limits
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.schema.tiles import Grid

_OF_STARTS = ("from_x", "from_y", "from_z", "z0")


class MinimumArcsMap(PointMassMap):
    """The smallest number of arcs to each target; see `GridMap`."""

    proves = True
    any_cables = True
    motors = True

    def __init__(self, robot_file: RobotFile, sweep_file: SweepFile, file: object) -> None:
        """Refuse a planar robot, and build what all tiles use."""
        if robot_file.is_planar:
            raise ConfigError(file, f'robot "{robot_file.name}" is planar: must be one that moves in space in this map')
        super().__init__(robot_file, sweep_file, file)
        self._scene = self._scene_or_none(robot_file)

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        points, max_arcs = (self._starts(cells), self._targets(cells), cells["z0"]), self._keys.trajectory.max_arcs
        settings: dict[str, Any] = {"max_arcs": max_arcs, "dtype": self._keys.run.dtype}
        if self._scene is None and not has_motor_limits(self._problem.limits):
            return minimum_arcs(self._problem, *points, **settings).arrays()
        # Import here: maps without obstacles and winches need no general proof.
        from cspr_jax.verification.bounds.batch import MotionBatch
        from cspr_jax.verification.verifier import Verifier, of_family

        plain = of_family(self._problem)

        def join(rows: np.ndarray, arcs: np.ndarray) -> tuple[Answers, MotionBatch]:
            answers, segments = arcs_and_segments(plain, *(x[rows] for x in points), arcs=arcs, **settings)
            motions = Hypocycloid(segments, self._problem.amplitude, as_float64(answers.tried_arcs))
            return answers, MotionBatch(motions, answers.duration, batch_bounds)

        verifier = Verifier(self._problem, self._scene, intervals=False, are_plans=True)
        return verifier.columns(join, len(cells["z0"]), max_arcs=max_arcs)

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse ends that are all out of reach; see `GridMap.refuse_hopeless`."""
        super().refuse_hopeless(grid)
        self._refuse_out_of_reach(self._starts(self._corners(grid, _OF_STARTS)), "trajectory.from")
        self._refuse_long(grid)

    def _refuse_long(self, grid: Grid) -> None:
        # The point of a product grid that is nearest to a spool is nearest in each coordinate.
        longest = self._problem.limits.cable_length_max
        if longest is None or "radius" in grid.axes:
            return
        base = self._frame.outward(self._problem.robot.base_points)
        for cable in range(len(base)):
            gaps = [np.abs(grid.axes[name] - base[cable, i]).min() for i, name in enumerate("xyz")]
            if np.linalg.norm(gaps) > np.asarray(longest)[cable]:
                raise ConfigError(
                    self._file,
                    f"axes: every target is farther than cable_length_max from spool {cable + 1}: must be some nearer",
                )
