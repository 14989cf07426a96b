"""Table 3.4 of the thesis: smallest part of the accessible orientations of a place that is attained, in an annulus."""

import itertools
import math
from collections.abc import Callable
from functools import partial

import numpy as np

from cspr_jax.published.chapter_1 import Key
from cspr_jax.published.chapter_3 import (
    DIVISIONS,
    EVERY,
    RADIUS,
    Choice,
    accessible_there,
    attained_there,
    checker_of,
    sizes,
    variant,
)
from cspr_jax.robots.symmetries import folded, symmetries
from cspr_jax.runtime.processes import Spread
from cspr_jax.runtime.stages import within
from cspr_jax.search import attainable

_DEPTHS = (1.0, 1.4, 1.7, 2.0, 2.4)
_RADII, _AZIMUTHS = (1.5, 2.0, 2.5, 3.0), np.radians(np.arange(0.0, 61.0, 10.0))
Sets = list[tuple[np.ndarray, np.ndarray]]


def smallest_proportion(attained: Callable[[Sets, np.ndarray], list[np.ndarray]], sets: Sets) -> float:
    """Smallest part of the orientations of a place that horizontal transitions attain.

    Other values of beta-hat than the preferred one are tried only at places that could have the smallest one.

    Args:
        attained: gives those of sets that some values of beta-hat attain, as `chapter_3.attained` does.
        sets: of each place, as there.

    Returns:
        the part.
    """
    preferred, some, rest = attainable.turns()
    good = attained(sets, preferred)
    shares = np.array([own.mean() for own in good])
    smallest = 1.0
    # All values at the place with the smallest share so far; then, turn by turn, where less is attained than there.
    every, only = list(range(len(sets))), [int(shares.argmin())]
    for which, tried in ((only, some), (only, rest), (every, some), (every, rest)):
        left = [k for k in which if shares[k] < smallest]
        if left:
            found = attained([(sets[k][0], sets[k][1][~good[k]]) for k in left], tried)
            for k, own in zip(left, found, strict=True):
                good[k][~good[k]] = own
                shares[k] = good[k].mean()
        if tried is rest:
            smallest = min(smallest, float(shares[which].min()))
    return smallest


def table_3_4(choice: Choice, workers: int = 1) -> dict[Key, float | None]:
    """Smallest proportions in an annulus, at five heights.

    Args:
        choice: definitions, amplitude functions, step.
        workers: processes.

    Returns:
        cells, in percent.
    """
    cells: dict[Key, float | None] = {}
    divisions = DIVISIONS * choice.finer
    with Spread(workers) as spread:
        for amplitude, definition, depth in itertools.product(choice.amplitudes, choice.definitions, _DEPTHS):

            def attained(sets: Sets, tried: np.ndarray, amplitude: str = amplitude) -> list[np.ndarray]:
                return spread(partial(attained_there, amplitude, tried), sets, sizes(sets))

            with within(f"{amplitude}, {definition}, z = {depth:g}"):
                asked = [(place, divisions) for place in _places(amplitude, depth)]
                inside = spread(partial(accessible_there, amplitude, definition), asked, [1] * len(asked))
                angles = [(place, own.angles) for (place, _), own in zip(asked, inside, strict=True)]
                smallest = smallest_proportion(attained, angles)
            cells[f"{depth:g}", "proportion", variant(definition, amplitude)] = 100.0 * smallest
    return cells


def _places(amplitude: str, depth: float) -> list[np.ndarray]:
    # Those of the annulus that no symmetry of the robot makes another one of.
    robot = checker_of(amplitude).problem.robot
    azimuths = np.unique(np.round(folded(symmetries(robot), _AZIMUTHS), 9))
    return [
        np.array([RADIUS * radius * math.cos(azimuth), RADIUS * radius * math.sin(azimuth), depth])
        for radius in _RADII
        for azimuth in azimuths
    ]


_PRINTED = {"1": "81.7", "1.4": "88.0", "1.7": "91.4", "2": "92.8", "2.4": "95.1"}
PUBLISHED: dict[Key, str] = {(row, "proportion", name): value for name in EVERY for row, value in _PRINTED.items()}
