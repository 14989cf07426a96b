"""Maps of smallest numbers of arcs to all orientations of places."""

import math

import numpy as np

from cspr_jax.families.platforms.orientations.accessible import accessible
from cspr_jax.families.platforms.orientations.places_map import DIGITS, AttainabilityMap
from cspr_jax.maps.grid_map import PlatformMap
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.quantities import QUANTITIES, TILT_TORSION
from cspr_jax.schema.verdicts import FLAGS, Verdict

# These quantities have no value where nothing is accessible.
FLOATS = tuple(name for name in MAP_KINDS["orientations"].quantities if QUANTITIES[name].kind == "float")


class OrientationsMap(AttainabilityMap):
    """The smallest number of arcs to each orientation of tilt and torsion; see `GridMap`."""

    proves = True
    undecided = PlatformMap.undecided

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        places, z0 = self._targets(cells), self._depths(cells)
        # An axis of the file turned over turns phi and sigma around.
        angles = self._frame.rotated_angles(np.stack([cells[name] for name in TILT_TORSION], axis=1))
        rows, count = np.flatnonzero(self._accessible(places, angles) & (z0 > 0.0)), len(z0)
        results = {name: np.full(count, np.nan) for name in FLOATS}
        results |= {"arcs": np.zeros(count, int), "tried_arcs": np.zeros(count, int)}
        results["verdict"] = np.full(count, Verdict.NOT_ACCESSIBLE.value, FLAGS)
        if len(rows):
            answers = self._attainable(places[rows], angles[rows], z0[rows], margins=True)
            columns = vars(answers) | {"beta_hat": answers.beta_hat[:, 1]}
            for name, values in results.items():
                values[rows] = columns[name]
        return results

    def _accessible(self, places: np.ndarray, angles: np.ndarray) -> np.ndarray:
        # Tell which orientations are accessible, (n,); their angles are points of the grid of orientations.
        divisions = self._orientations.divisions
        distinct, inverse = np.unique(np.round(places, DIGITS), axis=0, return_inverse=True)
        index, inside = _index(angles, divisions), np.zeros(len(places), bool)
        for k, place in enumerate(distinct):
            free = np.zeros((2 * divisions, divisions, 2 * divisions), bool)
            free[_index(accessible(self._problem.robot, place, "grid", divisions).angles, divisions)] = True
            free[:, 0] = free[0, 0]  # without a tilt, its azimuth means nothing
            is_here = inverse.ravel() == k
            inside[is_here] = free[tuple(i[is_here] for i in index)]
        return inside

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        return PlatformMap.contradictions(self, answers)


def _index(angles: np.ndarray, divisions: int) -> tuple[np.ndarray, ...]:
    # Find the places of (phi, theta, sigma) on the grid.
    phi, theta, sigma = np.round(angles.T * (divisions / math.pi)).astype(int)
    return phi % (2 * divisions), theta, sigma % (2 * divisions)
