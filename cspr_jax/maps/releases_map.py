"""Base of maps of launches from given positions to landing points."""

from cspr_jax.maps.from_positions import FromPositionsMap
from cspr_jax.schema.tiles import Grid

_START = ("from_x", "from_y", "from_z", "z")


class ReleasesMap(FromPositionsMap):
    """A map of the slowest releases of a point mass from given positions; see `GridMap`."""

    any_cables = True

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse a grid whose starts are all out of reach; objects may land anywhere; see `GridMap.refuse_hopeless`."""
        self._refuse_out_of_reach(self._starts(self._corners(grid, _START)), "trajectory.from")
