"""Tables 3.3 and 3.4 of the thesis: accessible orientations of a place, and how many of them are attainable."""

import dataclasses
import math
from pathlib import Path

import numpy as np

from cspr_jax import problem
from cspr_jax.amplitudes import named
from cspr_jax.config.robot import resolve_robot
from cspr_jax.config.trajectory import TrajectoryKeys
from cspr_jax.feasibility.limits import Limits
from cspr_jax.feasibility.pose_checks import MANY, PoseChecker
from cspr_jax.feasibility.pose_slacks import PoseShared
from cspr_jax.maps.accessible import DEFINITIONS, accessible
from cspr_jax.maps.attainable import attainable
from cspr_jax.reference_pose import aligned
from cspr_jax.symmetries import folded, symmetries
from cspr_jax.trajectories.pose_segment import Kind
from cspr_jax.transition_tables import Key

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
    """What a table of orientations is computed with.

    Fields:
        definitions: of the accessible set, of `maps.accessible.DEFINITIONS`.
        amplitudes: of `AMPLITUDES`.
        finer: how many times as fine the step is as pi / 32.
    """

    definitions: tuple[str, ...] = ("scan",)
    amplitudes: tuple[str, ...] = ("effective-c3",)
    finer: int = 1


def variant(definition: str, amplitude: str) -> str:
    """How a cell was computed.

    Args:
        definition: of the accessible set.
        amplitude: key of `AMPLITUDES`.

    Returns:
        the words.
    """
    epsilon = AMPLITUDES[amplitude][1]
    return f"amplitude = {amplitude}{f' {epsilon:g}' if epsilon else ''}; definition = {definition}"


def checker_of(amplitude: str) -> PoseChecker:
    """What checks the tables' motions.

    Args:
        amplitude: key of `AMPLITUDES`.

    Returns:
        the checker, of motions of the MSSM from rest.
    """
    here = Path(__file__)
    robot = problem.build_platform(resolve_robot("laval-mssm", here, here.parent), TrajectoryKeys(), "laval-mssm")
    shared = PoseShared(aligned(robot)[0], Limits(), named(*AMPLITUDES[amplitude]))
    return PoseChecker(shared, Kind(from_rest=True), batch=MANY)


def attained(checker: PoseChecker, place: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Which orientations horizontal transitions attain; the centroid of the spools is the origin.

    Args:
        checker: of `checker_of`.
        place: (3,) m.
        angles: (n, 3) tilt and torsion in the cylindrical frame, rad.

    Returns:
        (n,).
    """
    places, z0 = np.tile(place, (len(angles), 1)), np.full(len(angles), place[2])
    found = symmetries(checker.shared.robot)
    return attainable(checker, places, angles, z0, max_arcs=MAX_ARCS, found=found).arcs > 0


def table_3_3(choice: Choice) -> dict[Key, float | None]:
    """Counts and proportions at four places; errors are differences from twice the step.

    Args:
        choice: definitions, amplitude functions, step.

    Returns:
        cells; proportions, volumes (accessible of SO(3), attainable of that) and errors in percent.
    """
    found: dict[Key, float | None] = {}
    for amplitude in choice.amplitudes:
        checker = checker_of(amplitude)
        for definition in choice.definitions:
            for row, (x, y) in PLACES.items():
                place, name = np.array([x * RADIUS, y * RADIUS, DEPTH]), variant(definition, amplitude)
                fine, coarse = (_cells(checker, place, definition, DIVISIONS * choice.finer // k) for k in (1, 2))
                errors = {f"{column}, error": abs(fine[column] - coarse[column]) for column in list(fine)[2:]}
                found |= {(row, column, name): value for column, value in (fine | errors).items()}
    return found


def _cells(checker: PoseChecker, place: np.ndarray, definition: str, divisions: int) -> dict[str, float]:
    inside = accessible(checker.shared.robot, place, definition, divisions)
    good, volume = attained(checker, place, inside.angles), inside.volume
    return {
        "accessible": float(len(good)),
        "attainable": float(good.sum()),
        "proportion": 100.0 * good.mean(),
        "accessible volume": 100.0 * volume.sum(),
        "attainable volume": 100.0 * volume[good].sum() / volume.sum(),
    }


def table_3_4(choice: Choice) -> dict[Key, float | None]:
    """Smallest proportions in an annulus, at five heights.

    Args:
        choice: definitions, amplitude functions, step.

    Returns:
        cells, in percent.
    """
    found: dict[Key, float | None] = {}
    for amplitude in choice.amplitudes:
        checker = checker_of(amplitude)
        robot = checker.shared.robot
        azimuths = np.unique(np.round(folded(symmetries(robot), _AZIMUTHS), 9))
        for definition in choice.definitions:
            for depth in _DEPTHS:
                shares = []
                for radius in _RADII:
                    for azimuth in azimuths:
                        level = RADIUS * radius * np.array([math.cos(azimuth), math.sin(azimuth)])
                        place = np.append(level, depth)
                        inside = accessible(robot, place, definition, DIVISIONS * choice.finer)
                        shares.append(float(attained(checker, place, inside.angles).mean()))
                found[f"{depth:g}", "proportion", variant(definition, amplitude)] = 100.0 * min(shares)
    return found


_PRINTED = {"x = 1.5b": (27610, 26816, 97.1), "y = 1.5b": (25788, 25482, 98.8)}
_EVERY = [variant(definition, amplitude) for definition in DEFINITIONS for amplitude in AMPLITUDES]
PUBLISHED: dict[str, dict[Key, float]] = {
    "3.3": {
        (row, column, name): value
        for name in _EVERY
        for row, cells in _PRINTED.items()
        for column, value in zip(("accessible", "attainable", "proportion"), cells, strict=True)
    },
    "3.4": {("2", "proportion", name): 92.8 for name in _EVERY},
}
