"""Tables 3.3 and 3.4 of the thesis: accessible orientations of a place, and how many of them are attainable."""

import dataclasses
import math
from pathlib import Path

import numpy as np

from cspr_jax.config.robot import resolve_robot
from cspr_jax.config.trajectory import TrajectoryKeys
from cspr_jax.feasibility.platform.checker import PoseChecker
from cspr_jax.feasibility.platform.motion_checker import MANY
from cspr_jax.feasibility.problem import Problem
from cspr_jax.problem import kernel_robot
from cspr_jax.published.chapter_1 import Key
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.reference_pose import aligned
from cspr_jax.robots.symmetries import folded, symmetries
from cspr_jax.runtime.stages import within
from cspr_jax.search import attainable
from cspr_jax.search.accessible import DEFINITIONS, Accessible, accessible_sets
from cspr_jax.trajectories.amplitudes import named
from cspr_jax.trajectories.platform_segment import Kind

RADIUS = 0.86  # b of (3.95), m
MAX_ARCS = 20
DIVISIONS = 32  # of pi
AMPLITUDES: dict[str, tuple[str, float | None]] = {
    "quintic": ("quintic", None),
    "effective": ("effective", 0.1),
    "effective-c3": ("effective-c3", 0.1),
}
PLACES = {"x = 1.5b": (1.5, 0.0), "x = 3b": (3.0, 0.0), "y = 1.5b": (0.0, 1.5), "y = 3b": (0.0, 3.0)}
DEPTH = 1.7
_DEPTHS = (1.0, 1.4, 1.7, 2.0, 2.4)
_RADII, _AZIMUTHS = (1.5, 2.0, 2.5, 3.0), np.radians(np.arange(0.0, 61.0, 10.0))


@dataclasses.dataclass(frozen=True)
class Choice:
    """Settings of a table of orientations.

    Fields:
        definitions: of the accessible set, of `search.accessible.DEFINITIONS`.
        amplitudes: of `AMPLITUDES`.
        finer: how many times as fine the step is as pi / 32.
    """

    definitions: tuple[str, ...] = ("scan",)
    amplitudes: tuple[str, ...] = ("effective-c3",)
    finer: int = 1


def variant(definition: str, amplitude: str) -> str:
    """Settings with which a cell was computed.

    Args:
        definition: of the accessible set.
        amplitude: key of `AMPLITUDES`.

    Returns:
        the words.
    """
    epsilon = AMPLITUDES[amplitude][1]
    return f"amplitude = {amplitude}{f' {epsilon:g}' if epsilon else ''}; definition = {definition}"


def checker_of(amplitude: str) -> PoseChecker:
    """Checker of the tables' motions.

    Args:
        amplitude: key of `AMPLITUDES`.

    Returns:
        the checker, of motions of the MSSM from rest.
    """
    here = Path(__file__)
    robot = kernel_robot(resolve_robot("laval-mssm", here, here.parent), TrajectoryKeys(), "laval-mssm")
    problem = Problem(aligned(robot)[0], Limits(), named(*AMPLITUDES[amplitude]))
    return PoseChecker(problem, Kind(from_rest=True), batch=MANY)


def attained(
    checker: PoseChecker, sets: list[tuple[np.ndarray, np.ndarray]], *, tried: np.ndarray | None = None
) -> list[np.ndarray]:
    """Orientations that horizontal transitions attain; the centroid of the spools is the origin.

    Args:
        checker: of `checker_of`.
        sets: of each set its place (3,), m, and its orientations (n, 3): tilt and torsion in the cylindrical frame,
            rad.
        tried: which values of beta-hat, as for `search.attainable.attained`.

    Returns:
        (n,) of each.
    """
    sizes = [len(angles) for _, angles in sets]
    places = np.repeat([place for place, _ in sets], sizes, axis=0)
    symmetry = symmetries(checker.problem.robot)
    every = np.concatenate([angles for _, angles in sets])
    z0 = places[:, 2]
    good = attainable.attained(checker, places, every, z0, max_arcs=MAX_ARCS, tried=tried, symmetry=symmetry)
    return np.split(good, np.cumsum(sizes)[:-1])


def smallest_proportion(checker: PoseChecker, sets: list[tuple[np.ndarray, np.ndarray]]) -> float:
    """Smallest part of the orientations of a place that horizontal transitions attain.

    Other values of beta-hat than the preferred one are tried only at places that could have the smallest one.

    Args:
        checker: of `checker_of`.
        sets: as for `attained`.

    Returns:
        the part.
    """
    preferred, some, rest = attainable.turns()
    good = attained(checker, sets, tried=preferred)
    shares = np.array([own.mean() for own in good])
    smallest = 1.0
    # All values at the place with the smallest share so far; then, turn by turn, where less is attained than there.
    every, only = list(range(len(sets))), [int(shares.argmin())]
    for which, tried in ((only, some), (only, rest), (every, some), (every, rest)):
        left = [k for k in which if shares[k] < smallest]
        if left:
            found = attained(checker, [(sets[k][0], sets[k][1][~good[k]]) for k in left], tried=tried)
            for k, own in zip(left, found, strict=True):
                good[k][~good[k]] = own
                shares[k] = good[k].mean()
        if tried is rest:
            smallest = min(smallest, float(shares[which].min()))
    return smallest


def table_3_3(choice: Choice) -> dict[Key, float | None]:
    """Counts and proportions at four places; errors are differences from twice the step.

    Args:
        choice: definitions, amplitude functions, step.

    Returns:
        cells; proportions, volumes (accessible of SO(3), attainable of that) and errors in percent.
    """
    cells: dict[Key, float | None] = {}
    # The step of the table, and twice that for the errors.
    steps = [DIVISIONS * choice.finer, DIVISIONS * choice.finer // 2]
    for amplitude in choice.amplitudes:
        checker = checker_of(amplitude)
        for definition in choice.definitions:
            places = [np.array([x * RADIUS, y * RADIUS, DEPTH]) for x, y in PLACES.values()]
            with within(f"{amplitude}, {definition}"):
                # All at once: full batches.
                asked = [(place, n) for n in steps for place in places]
                sets = accessible_sets(checker.problem.robot, asked, definition)
                angles = [(place, inside.angles) for (place, _), inside in zip(asked, sets, strict=True)]
                masks = attained(checker, angles)
            every = [_cells(inside, good) for inside, good in zip(sets, masks, strict=True)]
            for row, fine, coarse in zip(PLACES, every[: len(places)], every[len(places) :], strict=True):
                errors = {f"{column}, error": abs(fine[column] - coarse[column]) for column in list(fine)[2:]}
                cells |= {(row, column, variant(definition, amplitude)): x for column, x in (fine | errors).items()}
    return cells


def _cells(inside: Accessible, good: np.ndarray) -> dict[str, float]:
    return {
        "accessible": float(len(good)),
        "attainable": float(good.sum()),
        "proportion": 100.0 * good.mean(),
        "accessible volume": 100.0 * inside.volume.sum(),
        "attainable volume": 100.0 * inside.volume[good].sum() / inside.volume.sum(),
    }


def table_3_4(choice: Choice) -> dict[Key, float | None]:
    """Smallest proportions in an annulus, at five heights.

    Args:
        choice: definitions, amplitude functions, step.

    Returns:
        cells, in percent.
    """
    cells: dict[Key, float | None] = {}
    for amplitude in choice.amplitudes:
        checker = checker_of(amplitude)
        robot = checker.problem.robot
        azimuths = np.unique(np.round(folded(symmetries(robot), _AZIMUTHS), 9))
        divisions = DIVISIONS * choice.finer
        for definition in choice.definitions:
            for depth in _DEPTHS:
                places = [
                    np.array([RADIUS * radius * math.cos(azimuth), RADIUS * radius * math.sin(azimuth), depth])
                    for radius in _RADII
                    for azimuth in azimuths
                ]
                with within(f"{amplitude}, {definition}, z = {depth:g}"):
                    sets = accessible_sets(robot, [(place, divisions) for place in places], definition)
                    angles = [(place, inside.angles) for place, inside in zip(places, sets, strict=True)]
                    smallest = smallest_proportion(checker, angles)
                cells[f"{depth:g}", "proportion", variant(definition, amplitude)] = 100.0 * smallest
    return cells


_PRINTED = {
    "x = 1.5b": ("27610", "26816", "97.1"),
    "x = 3b": ("32141", "29375", "91.4"),
    "y = 1.5b": ("25788", "25482", "98.8"),
    "y = 3b": ("30290", "28383", "93.7"),
}
_PRINTED_SMALLEST = {"1": "81.7", "1.4": "88.0", "1.7": "91.4", "2": "92.8", "2.4": "95.1"}
_EVERY = [variant(definition, amplitude) for definition in DEFINITIONS for amplitude in AMPLITUDES]
PUBLISHED: dict[str, dict[Key, str]] = {
    "3.3": {
        (row, column, name): value
        for name in _EVERY
        for row, cells in _PRINTED.items()
        for column, value in zip(("accessible", "attainable", "proportion"), cells, strict=True)
    },
    "3.4": {(row, "proportion", name): value for name in _EVERY for row, value in _PRINTED_SMALLEST.items()},
}
