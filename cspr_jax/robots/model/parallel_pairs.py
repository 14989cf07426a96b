"""Six cables in three parallel pairs, and the equivalent point mass on three cables.

The cables of a pair run from A and A' to B and B' with A - A' = B - B', and one winch keeps them equally long: they
form a parallelogram, so that the platform only translates. With the mass centre P on the line through B and B', at
B + lambda (B' - B), the moment of a pair about P vanishes if and only if its tensions have the ratio of 1 - lambda to
lambda. All forces then act at P, along cables that leave from A + lambda (A' - A) (Machines 11 (2), 2023, 224, section
2.2, for lambda = 1/2; any lambda follows in the same way).

NumPy alone, since files are checked without jax.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.spool_plane import is_on_line, is_vertical

COUNT = 6
# Tolerance of the tests that cables of a pair are parallel and that the mass centre lies on the line between their
# attachment points, over the largest distance of a spool from the centroid; and smallest distance of the mass centre
# from the ends of this line, over its length.
SAME_LINE = 1e-6
# Below this determinant of unit moments the cables do not prevent rotations of the platform.
SMALLEST_MOMENTS = 1e-6
# Positions at which the determinant is tested, from the centroid of the spools, over their radius.
_POSITIONS = np.array([[0.3, 0.2, 1.0], [-0.5, 0.4, 0.7], [0.1, -0.7, -1.1]])
ALLOWED = "must be six cables in three parallel pairs, with the mass centre between the points of each pair"


@dataclasses.dataclass(frozen=True)
class ParallelPairs:
    """Three pairs of parallel cables.

    Fields:
        cables: (3, 2) indices of the cables; pairs are in the order of their first cables.
        fractions: (3, 2) tension of each cable over the tension of its pair, which is that of the equivalent's cable;
            the sum of each pair is 1.
        exit_points: (3, 3) spools of the equivalent robot, in the axes of the spools, m.
    """

    cables: np.ndarray
    fractions: np.ndarray
    exit_points: np.ndarray

    def tensions(self, of_pairs) -> Float[np.ndarray, "... 6"]:
        """Tensions of all cables, from tensions of the pairs."""
        tensions = np.asarray(of_pairs, float)
        each = np.empty((*tensions.shape[:-1], COUNT))
        each[..., self.cables] = tensions[..., None] * self.fractions
        return each

    def bound(self, of_cables, *, is_tension: bool, is_least: bool) -> Float[np.ndarray, "3"]:
        """Limits of the pairs that make all cables keep their own limits."""
        limits = np.broadcast_to(np.asarray(of_cables, float), (COUNT,))[self.cables]
        limits = limits / self.fractions if is_tension else limits
        return limits.max(1) if is_least else limits.min(1)


def parallel_pairs(base_points, platform_points) -> ParallelPairs:
    """The three pairs of a robot."""
    base, platform = np.asarray(base_points, float), np.asarray(platform_points, float)
    if len(base) != COUNT:
        raise _error(f"{len(base)} cables")
    tolerance = SAME_LINE * float(np.linalg.norm(base - base.mean(0), axis=1).max())
    cables = _matched(base - platform, tolerance)
    fractions = np.array([_tension_fractions(platform, first, second, tolerance) for first, second in cables.tolist()])
    exits = (fractions[:, :, None] * base[cables]).sum(1)
    if is_on_line(exits):
        raise _error("the three cables of the equivalent leave from points on one line, or from the same one")
    if is_vertical(exits):
        raise _error("the three cables of the equivalent leave from a vertical plane")
    _refuse_turning(exits, platform[cables[:, 1]] - platform[cables[:, 0]])
    return ParallelPairs(cables, fractions, exits)


def _error(words: str) -> InputError:
    return InputError("platform_points", None, ALLOWED, problem=words)


def _matched(offsets: np.ndarray, tolerance: float) -> np.ndarray:
    # Cables of a pair have the same offset A - B. Of the fifteen matchings of six cables take the best one.
    distances = np.linalg.norm(offsets[:, None] - offsets, axis=2)
    misses = {matching: max(distances[pair] for pair in matching) for matching in _matchings(tuple(range(COUNT)))}
    best = min(misses, key=lambda matching: misses[matching])
    if not misses[best] <= tolerance:
        first, second = max(best, key=lambda pair: distances[pair])
        raise _error(
            f"cables {first + 1} and {second + 1} are not parallel: base_points[{first}] - base_points[{second}] and "
            f"platform_points[{first}] - platform_points[{second}] differ by {misses[best]:.3g} m "
            f"(at most {tolerance:.2g} m)"
        )
    return np.array(best)


def _matchings(left: tuple[int, ...]) -> list[tuple[tuple[int, int], ...]]:
    if not left:
        return [()]
    first, *others = left
    return [
        ((first, other), *rest)
        for other in others
        for rest in _matchings(tuple(cable for cable in others if cable != other))
    ]


def _tension_fractions(platform: np.ndarray, first: int, second: int, tolerance: float) -> tuple[float, float]:
    # Fractions of the tensions with which the moments of both cables about the mass centre cancel.
    along = platform[second] - platform[first]
    square = float(along @ along)
    if not np.sqrt(square) > tolerance:
        raise _error(f"cables {first + 1} and {second + 1} are attached at the same point")
    fraction = float(-platform[first] @ along) / square
    beside = float(np.linalg.norm(platform[first] + fraction * along))
    names = f"platform_points[{first}] and platform_points[{second}]"
    if not beside <= tolerance:
        raise _error(f"the mass centre lies {beside:.3g} m beside the line of {names} (at most {tolerance:.2g} m)")
    if not SAME_LINE < fraction < 1.0 - SAME_LINE:
        raise _error(
            f"the mass centre does not lie between {names}: it is {fraction:.3g} of the way from one to the other"
        )
    return 1.0 - fraction, fraction


def _refuse_turning(exits: np.ndarray, along: np.ndarray) -> None:
    # The moment of a pair is `along` x cable. If the lines of the spools of all pairs meet in one point O, all moments
    # are normal to the line from O to the platform at every position, so that the platform can turn about this line;
    # otherwise they usually are not.
    radius = np.linalg.norm(exits - exits.mean(0), axis=1).max()
    for position in exits.mean(0) + radius * _POSITIONS:
        cables = position - exits
        units = [vectors / np.linalg.norm(vectors, axis=1, keepdims=True) for vectors in (along, cables)]
        if abs(np.linalg.det(np.cross(*units))) > SMALLEST_MOMENTS:
            return
    raise _error("the pairs let the platform turn, as where the lines between their spools are parallel or meet")
