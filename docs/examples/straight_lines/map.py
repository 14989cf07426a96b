"""Map of the durations of straight lines from P0."""

import numpy as np

from cspr_jax.maps.grid_map import PointMassMap
from cspr_jax.robots.model.point_mass import rest_point
from straight_lines.motion import SPEED


class LineDurationsMap(PointMassMap):
    """Duration of the line from P0 to each target."""

    def __call__(self, cells):
        """Return one array a quantity."""
        ways = self._targets(cells) - np.asarray(rest_point(cells["z0"]))
        return {"line_duration": np.linalg.norm(ways, axis=1) / SPEED}

    def contradictions(self, answers):
        """Name what cannot be."""
        return {"a negative duration": answers["line_duration"] < 0.0}
