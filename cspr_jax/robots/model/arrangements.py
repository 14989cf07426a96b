"""Arrangements of cables: which attachment point the cable of each spool has; without jax.

The arrangement p leads the cable of spool i to attachment point p[i]. Arrangements of n cables have the numbers 0 to
n! - 1, in lexicographic order; 0 is that of the robot file.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float, Int

# Largest number of cables of which all arrangements are listed: 362,880.
MAX_CABLES_OF_ALL = 9
# Largest number of cables of which all numbers of arrangements are float64 numbers: 18! < 2^53.
MAX_CABLES_OF_NUMBERS = 18
# Points fall together if their distance is at most this fraction of the largest coordinate.
SAME = 1e-9


class Symmetry(NamedTuple):
    """Spools and attachment points on which a symmetry of frame and platform puts those of the robot.

    Fields:
        spools: (n,) spool i comes to lie on spool `spools[i]`.
        attachments: (n,) attachment points, likewise.
    """

    spools: np.ndarray
    attachments: np.ndarray


def arrangement_of(number: int, count: int) -> list[int]:
    """The arrangement of a number."""
    left, arrangement = list(range(count)), list[int]()
    for i in range(count, 0, -1):
        index, number = divmod(number, math.factorial(i - 1))
        arrangement.append(left.pop(index))
    return arrangement


def numbers_of(arrangements: Int[np.ndarray, "m n"]) -> Int[np.ndarray, "m"]:
    """Numbers of arrangements."""
    count = arrangements.shape[1]
    numbers = np.zeros(len(arrangements), np.int64)
    for i in range(count - 1):
        smaller = (arrangements[:, i + 1 :] < arrangements[:, i : i + 1]).sum(1)
        numbers += smaller * math.factorial(count - 1 - i)
    return numbers


def distinct_arrangements(count: int, symmetries: Sequence[Symmetry]) -> Int[np.ndarray, "m"]:
    """Numbers of all arrangements but those that symmetries make of one with a smaller number."""
    permutations = np.array(list(itertools.permutations(range(count))))
    images = []
    for symmetry in symmetries:
        image = np.empty_like(permutations)
        image[:, symmetry.spools] = symmetry.attachments[permutations]
        images.append(numbers_of(image))
    smallest = np.arange(len(permutations))
    while True:
        before = smallest
        for image in images:
            smallest = np.minimum(smallest, smallest[image])
        if np.array_equal(smallest, before):
            return np.flatnonzero(smallest == np.arange(len(permutations)))


def symmetries_of(
    spools: Float[np.ndarray, "n 3"],
    attachments: Float[np.ndarray, "n 3"],
    centre_of_mass: Float[np.ndarray, "3"],
    inertia: Float[np.ndarray, "3 3"],
    groups: Sequence[object],
    *,
    is_planar: bool,
    has_turns: bool,
) -> list[Symmetry]:
    """Symmetries that generate all others: points that fall together and, if asked for, turns and mirrors.

    `groups` has equal entries for spools whose cables have equal numbers; turns are about the vertical.
    """
    middle = spools.mean(0)
    of_spools, names = spools - middle, [groups.index(group) for group in groups]
    extent = max(np.abs(of_spools).max(), np.abs(attachments).max()) * SAME
    result = []
    for turn in _turns(of_spools, extent, is_planar=is_planar) if has_turns else ():
        stays = np.abs(turn @ centre_of_mass - centre_of_mass).max() <= extent
        spread = np.abs(turn @ inertia @ turn.T - inertia).max()
        images = _images(of_spools, turn, extent), _images(attachments, turn, extent)
        if not stays or spread > SAME * np.abs(inertia).max() or images[0] is None or images[1] is None:
            continue
        if all(names[i] == names[j] for i, j in enumerate(images[0])):
            result.append(Symmetry(images[0], images[1]))
    same = np.arange(len(spools))
    result += [
        Symmetry(swap, same) for swap in _swaps(of_spools, extent) if all(names[i] == names[swap[i]] for i in same)
    ]
    return [*result, *(Symmetry(same, swap) for swap in _swaps(attachments, extent))]


def _turns(points: np.ndarray, extent: float, *, is_planar: bool) -> Iterator[np.ndarray]:
    # Turns about the vertical and mirrors that put the outermost point on a point of its height.
    if is_planar:
        yield np.diag([-1.0, 1.0, 1.0])
        return
    radius, angle = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    first = int(radius.argmax())
    if radius[first] <= extent:
        return
    is_image = (np.abs(radius - radius[first]) <= extent) & (np.abs(points[:, 2] - points[first, 2]) <= extent)
    for j in np.flatnonzero(is_image):
        for sign in (1.0, -1.0):
            by = angle[j] - sign * angle[first]
            cosine, sine = math.cos(by), math.sin(by)
            yield np.array([[cosine, -sign * sine, 0.0], [sine, sign * cosine, 0.0], [0.0, 0.0, 1.0]])


def _images(points: np.ndarray, turn: np.ndarray, extent: float) -> np.ndarray | None:
    # Points on which those of a set come to lie; None where one lies on none.
    from scipy.optimize import linear_sum_assignment  # most files have no arrangements, and load quickly

    distances = np.linalg.norm((points @ turn.T)[:, None] - points, axis=2)
    rows, columns = linear_sum_assignment(distances)
    return columns if distances[rows, columns].max() <= 4.0 * extent else None


def _swaps(points: np.ndarray, extent: float) -> Iterator[np.ndarray]:
    # Exchanges of two points that fall together.
    for i, j in itertools.combinations(range(len(points)), 2):
        if np.abs(points[i] - points[j]).max() <= extent:
            swap = np.arange(len(points))
            swap[[i, j]] = j, i
            yield swap
