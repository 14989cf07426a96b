"""Table 3.4 of the thesis: smallest part of the accessible orientations of a place that is attained, in an annulus."""

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from cspr_jax.platforms import attainable
from cspr_jax.published.chapter_1 import Key
from cspr_jax.published.chapter_3 import (
    DIVISIONS,
    EVERY,
    RADIUS,
    TableSettings,
    accessible_there,
    attained_there,
    checker_of,
    sizes,
    variant,
)
from cspr_jax.robots.symmetries import folded, symmetries
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
    """Smallest part of the orientations of a place that horizontal transitions attain, in each of many annuli.

    Other values of beta-hat than the preferred one are tried only at places that could have the smallest one.

    Args:
        attained: gives those of sets that some values of beta-hat attain, as `chapter_3.attained` does.
        annuli: sets of the places of each, as there.
        values: of beta-hat that there are.

    Returns:
        a part an annulus.
    """
    preferred, some, rest = attainable.turns(values)
    sets = [one for annulus in annuli for one in annulus]
    owner = np.repeat(np.arange(len(annuli)), [len(annulus) for annulus in annuli])
    good = attained(sets, preferred)
    shares = np.array([own.mean() for own in good])
    smallest = np.ones(len(annuli))
    # All values at the place of each annulus with the smallest share so far; then, turn by turn, where less is attained
    # than there. All annuli at once: no process waits for the end of one.
    every, rising = np.arange(len(sets)), np.argsort(shares, kind="stable")
    only = rising[np.unique(owner[rising], return_index=True)[1]]
    for which, tried in ((only, some), (only, rest), (every, some), (every, rest)):
        left = which[shares[which] < smallest[owner[which]]].tolist()
        if left:
            found = attained([(sets[k][0], sets[k][1][~good[k]]) for k in left], tried)
            for k, own in zip(left, found, strict=True):
                good[k][~good[k]] = own
                shares[k] = good[k].mean()
        if tried is rest:
            np.minimum.at(smallest, owner[which], shares[which])
    return smallest.tolist()


def table_3_4(choice: TableSettings, workers: int = 1) -> dict[Key, float | None]:
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
        for amplitude, definition in itertools.product(choice.amplitudes, choice.definitions):

            def attained(sets: Sets, tried: np.ndarray, amplitude: str = amplitude) -> list[np.ndarray]:
                return spread(partial(attained_there, amplitude, choice, tried), sets, sizes(sets))

            with within(f"{amplitude}, {definition}"):
                asked = [[(place, divisions) for place in _places(amplitude, depth)] for depth in _DEPTHS]
                every = list(itertools.chain(*asked))
                inside = iter(spread(partial(accessible_there, amplitude, definition), every, [1] * len(every)))
                annuli = [[(place, next(inside).angles) for place, _ in annulus] for annulus in asked]
                smallest = smallest_proportions(attained, annuli, choice.values)
            for depth, part in zip(_DEPTHS, smallest, strict=True):
                cells[f"{depth:g}", "proportion", variant(definition, amplitude)] = 100.0 * part
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


PRINTED = {"1": "81.7", "1.4": "88.0", "1.7": "91.4", "2": "92.8", "2.4": "95.1"}
PUBLISHED: dict[Key, str] = {(row, "proportion", name): value for name in EVERY for row, value in PRINTED.items()}
