"""Six cables in three parallel pairs, and the equivalent point mass on three cables.

The cables of a pair run from A and A' to B and B' with A - A' = B - B', and one winch keeps them equally long: a
parallelogram, so that the platform only translates. With the mass centre P on the line through B and B', at
B + lambda (B' - B), the moments of a pair about P vanish if and only if its tension is shared 1 - lambda to lambda. All
forces then act at P, along cables that leave from A + lambda (A' - A) (Machines 11 (2), 2023, 224, section 2.2, which
gives lambda = 1/2; any lambda follows in the same way).

NumPy alone, since files are checked without jax.
"""

import dataclasses

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.robots.spool_plane import is_on_line, is_vertical

COUNT = 6
# Tolerance, as part of the size (the largest distance of a spool from the centroid of all): for cables of a pair to be
# parallel, and for the mass centre to lie on the line between them; as part of this line, the distance that the mass
# centre must keep from its ends.
TOLERANCE = 1e-6
# Below this determinant of unit moments cables let the platform turn; and how far around the spools this is tested.
SMALLEST_MOMENTS = 1e-6
_PLACES = np.array([[0.3, 0.2, 1.0], [-0.5, 0.4, 0.7], [0.1, -0.7, -1.1]])
ALLOWED = "must be six cables in three parallel pairs, with the mass centre between the points of each pair"


@dataclasses.dataclass(frozen=True)
class ParallelPairs:
    """Three pairs of parallel cables.

    Fields:
        cables: (3, 2) numbers of the cables from 0 on; pairs are in the order of their first cables.
        shares: (3, 2) share of each cable in the tension of its pair, which is the tension of the equivalent's cable; 1
            in sum.
        exit_points: (3, 3) spools of the equivalent, in the axes of the spools, m.
    """

    cables: np.ndarray
    shares: np.ndarray
    exit_points: np.ndarray

    def tensions(self, of_pairs) -> np.ndarray:
        """Tensions of all cables.

        Args:
            of_pairs: (..., 3) tensions of the equivalent's cables, N.

        Returns:
            (..., 6) in the order of the robot's cables, N.
        """
        pulls = np.asarray(of_pairs, float)
        each = np.empty((*pulls.shape[:-1], COUNT))
        each[..., self.cables] = pulls[..., None] * self.shares
        return each

    def bound(self, of_cables, *, is_tension: bool, is_least: bool) -> np.ndarray:
        """Limits of the pairs with which all cables keep their limits.

        Args:
            of_cables: () or (6,) limits of the cables.
            is_tension: whether the limits are on tensions, which the cables of a pair share; all other quantities are
                the same for both cables.
            is_least: whether they are lower limits.

        Returns:
            (3,) limits of the equivalent's cables: the tighter of the two in each pair.
        """
        limits = np.broadcast_to(np.asarray(of_cables, float), (COUNT,))[self.cables]
        limits = limits / self.shares if is_tension else limits
        return limits.max(1) if is_least else limits.min(1)


def parallel_pairs(base_points, platform_points) -> ParallelPairs:
    """The three pairs of a robot.

    Args:
        base_points: (n_cables, 3) points at which the cables leave their spools, m.
        platform_points: (n_cables, 3) points at which they are attached, from the mass centre, in axes parallel to
            those of the spools; m.

    Returns:
        the pairs.

    Raises:
        InputError: cables that are no such pairs, a mass centre that is not between the points of a pair, spools of the
            equivalent on a line or in a vertical plane, or pairs that let the platform turn.
    """
    base, platform = np.asarray(base_points, float), np.asarray(platform_points, float)
    if len(base) != COUNT:
        raise _fault(f"{len(base)} cables")
    room = TOLERANCE * float(np.linalg.norm(base - base.mean(0), axis=1).max())
    cables = _matched(base - platform, room)
    shares = np.array([_shares(platform, first, second, room) for first, second in cables.tolist()])
    exits = (shares[:, :, None] * base[cables]).sum(1)
    if is_on_line(exits):
        raise _fault("the three cables of the equivalent leave from points on one line, or from the same one")
    if is_vertical(exits):
        raise _fault("the three cables of the equivalent leave from a vertical plane")
    _refuse_turning(exits, platform[cables[:, 1]] - platform[cables[:, 0]])
    return ParallelPairs(cables, shares, exits)


def _fault(words: str) -> InputError:
    return InputError("platform_points", None, ALLOWED, fault=words)


def _matched(offsets: np.ndarray, room: float) -> np.ndarray:
    # Cables of a pair have the same offset A - B. Of the fifteen ways to match six cables, take the one that fits best.
    apart = np.linalg.norm(offsets[:, None] - offsets, axis=2)
    misses = {way: max(apart[pair] for pair in way) for way in _ways(tuple(range(COUNT)))}
    way = min(misses, key=lambda known: misses[known])
    if not misses[way] <= room:
        first, second = max(way, key=lambda pair: apart[pair])
        raise _fault(
            f"cables {first + 1} and {second + 1} are not parallel: base_points[{first}] - base_points[{second}] and "
            f"platform_points[{first}] - platform_points[{second}] differ by {misses[way]:.3g} m (at most {room:.2g} m)"
        )
    return np.array(way)


def _ways(left: tuple[int, ...]) -> list[tuple[tuple[int, int], ...]]:
    if not left:
        return [()]
    first, *others = left
    return [
        ((first, other), *rest)
        for other in others
        for rest in _ways(tuple(cable for cable in others if cable != other))
    ]


def _shares(platform: np.ndarray, first: int, second: int, room: float) -> tuple[float, float]:
    # Return the shares with which the moments of both cables about the mass centre are in balance.
    along = platform[second] - platform[first]
    square = float(along @ along)
    if not np.sqrt(square) > room:
        raise _fault(f"cables {first + 1} and {second + 1} are attached at the same point")
    place = float(-platform[first] @ along) / square
    beside = float(np.linalg.norm(platform[first] + place * along))
    names = f"platform_points[{first}] and platform_points[{second}]"
    if not beside <= room:
        raise _fault(f"the mass centre lies {beside:.3g} m beside the line of {names} (at most {room:.2g} m)")
    if not TOLERANCE < place < 1.0 - TOLERANCE:
        raise _fault(
            f"the mass centre does not lie between {names}: it is {place:.3g} of the way from one to the other"
        )
    return 1.0 - place, place


def _refuse_turning(exits: np.ndarray, along: np.ndarray) -> None:
    # The moment of a pair is `along` x cable. If the lines of the spools meet in one point O, all moments are normal to
    # the line from O to the platform, wherever it is, so that it can turn about this line; otherwise, as a rule, they
    # are not.
    size = np.linalg.norm(exits - exits.mean(0), axis=1).max()
    for place in exits.mean(0) + size * _PLACES:
        cables = place - exits
        units = [rows / np.linalg.norm(rows, axis=1, keepdims=True) for rows in (along, cables)]
        if abs(np.linalg.det(np.cross(*units))) > SMALLEST_MOMENTS:
            return
    raise _fault("the pairs let the platform turn, as where the lines between their spools are parallel or meet")
