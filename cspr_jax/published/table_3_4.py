"""Table 3.4 of the thesis: smallest fraction of the accessible orientations of a position that is attained."""

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from cspr_jax.families.platforms.orientations import attainable
from cspr_jax.published.chapter_1 import Key
from cspr_jax.published.chapter_3 import (
    DIVISIONS,
    EVERY,
    RADIUS,
    TableSettings,
    accessible_there,
    attained_there,
    checker_of,
    orientation_counts,
    variant,
)
from cspr_jax.robots.statics.symmetries import folded, symmetries
from cspr_jax.runtime.processes import Spread
from cspr_jax.runtime.stages import within

_DEPTHS = (1.0, 1.4, 1.7, 2.0, 2.4)
_RADII, _AZIMUTHS = (1.5, 2.0, 2.5, 3.0), np.radians(np.arange(0.0, 61.0, 10.0))
Sets = list[tuple[np.ndarray, np.ndarray]]


def smallest_proportions(
    attained: Callable[[Sets, np.ndarray], list[np.ndarray]],
    annuli: Sequence[Sets],
    values: int = attainable.VALUES,
) -> list[float]:
    """Smallest fraction of the orientations of a position that horizontal transitions attain, in each of many annuli.

    Values of beta-hat other than the preferred one are tried only where a position may have the smallest fraction.
    """
    preferred, likely, rest = attainable.rounds(values)
    sets = [one for annulus in annuli for one in annulus]
    owner = np.repeat(np.arange(len(annuli)), [len(annulus) for annulus in annuli])
    good = attained(sets, preferred)
    proportions = np.array([mask.mean() for mask in good])
    smallest = np.ones(len(annuli))
    # Try all values at the position of each annulus with the smallest fraction so far; then, in rounds, at those where
    # less is attained. All annuli go together, so that no process waits for the end of one.
    all_sets, rising = np.arange(len(sets)), np.argsort(proportions, kind="stable")
    only = rising[np.unique(owner[rising], return_index=True)[1]]
    for candidates, tried in ((only, likely), (only, rest), (all_sets, likely), (all_sets, rest)):
        left = candidates[proportions[candidates] < smallest[owner[candidates]]].tolist()
        if left:
            masks = attained([(sets[k][0], sets[k][1][~good[k]]) for k in left], tried)
            for k, mask in zip(left, masks, strict=True):
                good[k][~good[k]] = mask
                proportions[k] = good[k].mean()
        if tried is rest:
            np.minimum.at(smallest, owner[candidates], proportions[candidates])
    return smallest.tolist()


def table_3_4(choice: TableSettings, workers: int = 1) -> dict[Key, float | None]:
    """Smallest fractions in an annulus, at five heights."""
    cells: dict[Key, float | None] = {}
    divisions = DIVISIONS * choice.finer
    with Spread(workers) as spread:
        for amplitude, definition in itertools.product(choice.amplitudes, choice.definitions):

            def attained(sets: Sets, tried: np.ndarray, amplitude: str = amplitude) -> list[np.ndarray]:
                return spread(partial(attained_there, amplitude, choice, tried), sets, orientation_counts(sets))

            with within(f"{amplitude}, {definition}"):
                requests = [
                    [(position, divisions) for position in _annulus_positions(amplitude, depth)] for depth in _DEPTHS
                ]
                positions = list(itertools.chain(*requests))
                inside = iter(spread(partial(accessible_there, amplitude, definition), positions, [1] * len(positions)))
                annuli = [[(position, next(inside).angles) for position, _ in annulus] for annulus in requests]
                smallest = smallest_proportions(attained, annuli, choice.values)
            for depth, part in zip(_DEPTHS, smallest, strict=True):
                cells[f"{depth:g}", "proportion", variant(definition, amplitude)] = 100.0 * part
    return cells


def _annulus_positions(amplitude: str, depth: float) -> list[np.ndarray]:
    # Return one position of the annulus for each set of positions that symmetries of the robot map onto each other.
    robot = checker_of(amplitude).problem.robot
    azimuths = np.unique(np.round(folded(symmetries(robot), _AZIMUTHS), 9))
    return [
        np.array([RADIUS * radius * math.cos(azimuth), RADIUS * radius * math.sin(azimuth), depth])
        for radius in _RADII
        for azimuth in azimuths
    ]


PRINTED = {"1": "81.7", "1.4": "88.0", "1.7": "91.4", "2": "92.8", "2.4": "95.1"}
PUBLISHED: dict[Key, str] = {(row, "proportion", name): value for name in EVERY for row, value in PRINTED.items()}
