"""Maps of smallest numbers of oscillations of transitions from rest."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.families.swings.transitions.oscillations import best_inclinations, minimum_oscillations, transitions_to
from cspr_jax.families.swings.transitions.transition import depth_for
from cspr_jax.maps.grid_map import PointMassMap

# Depth for targets above the spools, which have no P0 below them: their verdict does not depend on it.
_ANY_DEPTH = 1.0


class MinimumOscillationsMap(PointMassMap):
    """The smallest number of oscillations to each target; see `GridMap`."""

    proves = True
    any_cables = True

    def __init__(self, robot_file: RobotFile, sweep_file: SweepFile, file: object) -> None:
        """Build what all tiles use; amplitude functions for bounds are allowed where tensions have envelopes."""
        super().__init__(robot_file, sweep_file, file, for_bounds=len(robot_file.base_points) == robot_file.dof)

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        targets = self._targets(cells)
        z0 = self._depths(cells, targets)
        segments = transitions_to(self._problem, targets, z0)
        return vars(minimum_oscillations(self._problem, segments, z0, max_arcs=self._keys.trajectory.max_arcs))

    def _depths(self, cells: dict[str, np.ndarray], targets: np.ndarray) -> np.ndarray:
        if "z0" in cells:
            return cells["z0"]
        setting = self._keys.trajectory.inclination
        if "inclination" in cells:
            inclination = cells["inclination"]
        elif isinstance(setting, float):
            inclination = np.full(len(targets), setting)
        else:
            inclination = best_inclinations(self._problem, targets, max_arcs=self._keys.trajectory.max_arcs)
        points = (jnp.asarray(targets), jnp.asarray(inclination))
        z0 = np.asarray(jax.vmap(partial(depth_for, self._problem.robot))(*points))
        return np.where(z0 > 0.0, z0, _ANY_DEPTH)
