"""Base of maps of launches from given places to landing places."""

from cspr_jax.maps.from_places import FromPlacesMap
from cspr_jax.schema.tiles import Grid

_START = ("from_x", "from_y", "from_z", "z")


class ReleasesMap(FromPlacesMap):
    """The map of slowest releases of a point mass from given places; see `GridMap`."""

    any_cables = True

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse places that are all out of reach, since objects may land anywhere; see `GridMap.refuse_hopeless`."""
        self._refuse_out_of_plane(grid)
        self._refuse_out_of_reach(self._starts(self._corners(grid, _START)), "trajectory.from")
