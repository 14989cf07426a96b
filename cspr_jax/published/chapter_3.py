"""Table 3.3 of the thesis: accessible orientations of a position, and how many of them are attained.

One process or several find and try sets of orientations; Table 3.4 (`table_3_4`) uses them too.
"""

import dataclasses
import functools
import itertools
from functools import partial
from pathlib import Path

import numpy as np

from cspr_jax.build.robots import kernel_robot
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.robot import resolve_robot
from cspr_jax.families.platforms.motion_checker import MANY
from cspr_jax.families.platforms.orientations import attainable
from cspr_jax.families.platforms.orientations.accessible import DEFINITIONS, Accessible, accessible_sets
from cspr_jax.families.platforms.six_cable_proof.checker import PlatformChecker
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.published.chapter_1 import Key
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.reference_pose import aligned
from cspr_jax.robots.statics.symmetries import symmetries
from cspr_jax.runtime.processes import Spread
from cspr_jax.runtime.stages import within

RADIUS = 0.86  # b of (3.95), m
MAX_ARCS = 20
DIVISIONS = 32  # steps of angles are pi / DIVISIONS
TOGETHER = 1_000_000  # orientations tried at a time; a batch may exceed it, as positions are not split
AMPLITUDES: dict[str, tuple[str, float | None]] = {
    "quintic": ("quintic", None),
    "effective": ("effective", 0.1),
    "effective-c3": ("effective-c3", 0.1),
}
POSITIONS = {"x = 1.5b": (1.5, 0.0), "x = 3b": (3.0, 0.0), "y = 1.5b": (0.0, 1.5), "y = 3b": (0.0, 3.0)}
DEPTH = 1.7


@dataclasses.dataclass(frozen=True)
class TableSettings:
    """Settings of a table of orientations.

    Fields:
        definitions: definitions of the accessible set, of `families.platforms.orientations.accessible.DEFINITIONS`.
        amplitudes: names of amplitude functions, of `AMPLITUDES`.
        finer: factor by which the step is finer than pi / 32.
        max_arcs: largest number of arcs tried.
        values: number of values of beta-hat tried at each orientation.
    """

    definitions: tuple[str, ...] = ("scan",)
    amplitudes: tuple[str, ...] = ("effective-c3",)
    finer: int = 1
    max_arcs: int = MAX_ARCS
    values: int = attainable.VALUES


USUAL = TableSettings()


def variant(definition: str, amplitude: str) -> str:
    """Name of the settings with which a cell is computed."""
    epsilon = AMPLITUDES[amplitude][1]
    return f"amplitude = {amplitude}{f' {epsilon:g}' if epsilon else ''}; definition = {definition}"


@functools.lru_cache(maxsize=len(AMPLITUDES))
def checker_of(amplitude: str) -> PlatformChecker:
    """Checker of the motions of the tables."""
    current = Path(__file__)
    robot = kernel_robot(resolve_robot("laval-mssm", current, current.parent), TrajectoryKeys(), "laval-mssm")
    problem = Problem(aligned(robot)[0], Limits(), named(*AMPLITUDES[amplitude]))
    return PlatformChecker(problem, PlatformMotionKind(from_rest=True), batch=MANY)


def attained(
    checker: PlatformChecker,
    sets: list[tuple[np.ndarray, np.ndarray]],
    *,
    choice: TableSettings = USUAL,
    tried: np.ndarray | None = None,
) -> list[np.ndarray]:
    """Orientations that horizontal transitions attain; positions are relative to the centroid of the spools."""
    orientation_counts = [len(angles) for _, angles in sets]
    positions = np.repeat([position for position, _ in sets], orientation_counts, axis=0)
    symmetry = symmetries(checker.problem.robot)
    orientations = np.concatenate([angles for _, angles in sets])
    z0 = positions[:, 2]
    good = attainable.attained(
        checker,
        positions,
        orientations,
        z0,
        tried=tried,
        symmetry=symmetry,
        max_arcs=choice.max_arcs,
        values=choice.values,
    )
    return np.split(good, np.cumsum(orientation_counts)[:-1])


def accessible_there(amplitude: str, definition: str, grids: list[tuple[np.ndarray, int]]) -> list[Accessible]:
    """Accessible orientations of positions; any process can call it."""
    with double_precision():
        return accessible_sets(checker_of(amplitude).problem.robot, grids, definition)


def attained_there(
    amplitude: str, choice: TableSettings, tried: np.ndarray | None, sets: list[tuple[np.ndarray, np.ndarray]]
) -> list[np.ndarray]:
    """Orientations that horizontal transitions attain; any process can call it."""
    run = np.cumsum(orientation_counts(sets)) // TOGETHER
    with double_precision():
        groups = [[sets[k] for k in np.flatnonzero(run == number)] for number in np.unique(run)]
        return [good for group in groups for good in attained(checker_of(amplitude), group, choice=choice, tried=tried)]


def orientation_counts(sets: list[tuple[np.ndarray, np.ndarray]]) -> list[int]:
    """Numbers of orientations, which decide how sets are divided among processes."""
    return [len(angles) for _, angles in sets]


def table_3_3(choice: TableSettings, workers: int = 1) -> dict[Key, float | None]:
    """Counts and proportions at four positions; errors are differences from results with the double step."""
    cells: dict[Key, float | None] = {}
    # The step of the table, and its double for the errors.
    steps = [DIVISIONS * choice.finer, DIVISIONS * choice.finer // 2]
    positions = [np.array([x * RADIUS, y * RADIUS, DEPTH]) for x, y in POSITIONS.values()]
    with Spread(workers) as spread:
        for amplitude, definition in itertools.product(choice.amplitudes, choice.definitions):
            with within(f"{amplitude}, {definition}"):
                # Submit all sets together, so that batches are full.
                requests = [(position, n) for n in steps for position in positions]
                sets = spread(partial(accessible_there, amplitude, definition), requests, [n**3 for _, n in requests])
                angles = [(position, inside.angles) for (position, _), inside in zip(requests, sets, strict=True)]
                masks = spread(partial(attained_there, amplitude, choice, None), angles, orientation_counts(angles))
            rows = [_cells(inside, good) for inside, good in zip(sets, masks, strict=True)]
            for row, fine, coarse in zip(POSITIONS, rows[: len(positions)], rows[len(positions) :], strict=True):
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


PRINTED = {
    "x = 1.5b": ("27610", "26816", "97.1"),
    "x = 3b": ("32141", "29375", "91.4"),
    "y = 1.5b": ("25788", "25482", "98.8"),
    "y = 3b": ("30290", "28383", "93.7"),
}
EVERY = [variant(definition, amplitude) for definition in DEFINITIONS for amplitude in AMPLITUDES]
PUBLISHED: dict[Key, str] = {
    (row, column, name): value
    for name in EVERY
    for row, cells in PRINTED.items()
    for column, value in zip(("accessible", "attainable", "proportion"), cells, strict=True)
}
