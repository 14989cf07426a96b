"""A kind of map: distances from the spools."""

import numpy as np

from cspr_jax.maps.grid_map import PointMassMap
from cspr_jax.schema.map_kinds import MapKind
from cspr_jax.schema.quantities import Quantity


class SpoolDistancesMap(PointMassMap):
    """Smallest distance of each target from a spool."""

    def __call__(self, cells):
        spools = np.asarray(self._problem.robot.base_points)
        distances = np.linalg.norm(self._targets(cells)[:, None] - spools, axis=2)
        return {"spool_distance": distances.min(1), "nearest_spool": distances.argmin(1) + 1}

    def contradictions(self, answers):
        return {"a negative distance": answers["spool_distance"] < 0.0}


QUANTITIES = (
    Quantity("spool_distance", "m", "distance from the nearest spool", "Smallest distance of the target from a spool."),
    Quantity("nearest_spool", "1", "nearest spool", "Number of that spool, from 1 on.", "int16"),
)
KIND = MapKind(
    name="spool-distances",
    title="Distances from the spools",
    description="distance of each target from the nearest spool",
    implementation="spool_distances:SpoolDistancesMap",
    quantities=("spool_distance", "nearest_spool"),
    stored=("nearest_spool", "spool_distance"),
    pictured=("spool_distance",),
    motionless=("spool_distance", "nearest_spool"),
    families=("hypocycloid-standard",),
    cells=8,
)
