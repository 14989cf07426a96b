"""Maps of the orientations that a platform can have at positions, of those that it attains, and of the arcs to each."""

import math

import numpy as np

from cspr_jax.build.problems import motion_kind
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import Orientations, SweepFile
from cspr_jax.families.platforms.answers import PlatformMotionAnswers
from cspr_jax.families.platforms.checkers import pose_checker
from cspr_jax.families.platforms.motion_checker import MANY
from cspr_jax.families.platforms.orientations.accessible import Accessible, accessible, accessible_sets
from cspr_jax.families.platforms.orientations.attainable import VALUES, attainable
from cspr_jax.maps.grid_map import PlatformMap
from cspr_jax.motion.limits import limits_set
from cspr_jax.robots.statics.symmetries import NONE, folded, symmetries
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.quantities import QUANTITIES, REFUSALS, TILT_TORSION
from cspr_jax.schema.verdicts import FLAGS, NO_REASON, SENTENCES, Verdict

# Positions count as equal if they agree to this many decimals of a metre.
DIGITS = 12


class OrientationWorkspaceMap(PlatformMap):
    """The accessible orientations at each position; see `GridMap`."""

    any_cables = True

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Find the robot's symmetries."""
        super().__init__(robot_file, spec, file)
        self._orientations = spec.orientations or Orientations()
        # Limits may differ from cable to cable, which breaks symmetries.
        self._alike = NONE if limits_set(self._problem.limits) else symmetries(self._problem.robot)

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; symmetric positions are computed once; see `GridMap.__call__`."""
        positions, depths = self._targets(cells), self._depths(cells)
        radius, azimuth = np.hypot(positions[:, 0], positions[:, 1]), np.arctan2(positions[:, 1], positions[:, 0])
        azimuth = folded(self._alike, azimuth)
        positions = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), positions[:, 2]], axis=1)
        distinct, inverse = np.unique(np.round(np.c_[positions, depths], DIGITS), axis=0, return_inverse=True)
        answers = self._at_positions(distinct[:, :3], distinct[:, 3])
        return {name: values[inverse.ravel()] for name, values in answers.items()}

    def _depths(self, cells: dict[str, np.ndarray]) -> np.ndarray:
        # Return z0; if it is not given, that of horizontal transitions. Accessible orientations do not depend on it.
        depth = self._targets(cells)[:, 2]
        return np.asarray(cells.get("z0", depth), float)

    def _at_positions(self, positions: np.ndarray, z0: np.ndarray) -> dict[str, np.ndarray]:
        return _of_sets(*(self._sets(positions, k) for k in (1, 2)))

    def _sets(self, positions: np.ndarray, coarser: int) -> list[Accessible]:
        definition, divisions = self._orientations.definition or "scan", self._orientations.divisions
        return accessible_sets(
            self._problem.robot, [(position, divisions // coarser) for position in positions], definition
        )

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        volume = answers["accessible_volume"]
        return {
            "a volume outside of [0, 1]": ~((volume >= 0.0) & (volume <= 1.0)),
            "orientations without a volume": (answers["accessible"] > 0) & ~(volume > 0.0),
        }


class AttainabilityMap(OrientationWorkspaceMap):
    """The accessible orientations at each position, and which of them are attained; see `GridMap`."""

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Build the checker of motions from rest."""
        super().__init__(robot_file, spec, file)
        kind = motion_kind(spec.trajectory, from_rest=True)
        self._checker = pose_checker(self._problem, kind, batch=MANY)

    def _attainable(
        self, positions: np.ndarray, angles: np.ndarray, z0: np.ndarray, *, margins: bool
    ) -> PlatformMotionAnswers:
        # Search for motions to orientations, (n, 3) angles, at (n, 3) positions, both in the kernels' axes.
        values, maximum = self._orientations.values or VALUES, self._keys.trajectory.max_arcs
        arguments = self._checker, positions, angles, z0
        return attainable(*arguments, max_arcs=maximum, values=values, symmetry=self._alike, margins=margins)

    def _at_positions(self, positions: np.ndarray, z0: np.ndarray) -> dict[str, np.ndarray]:
        fine, coarse = (self._sets(positions, k) for k in (1, 2))
        # Compute all positions with both steps in one call, so that batches are full.
        sets = [*fine, *coarse]
        counts = [len(inside.angles) for inside in sets]
        position_index = np.repeat(np.tile(np.arange(len(positions)), 2), counts)
        position_index = np.where((z0 > 0.0)[position_index], position_index, -1)
        verdicts, arcs = np.full(len(position_index), Verdict.NO_ARCS.value), np.zeros(len(position_index), int)
        valid = np.flatnonzero(position_index >= 0)
        if len(valid):
            angles = np.concatenate([inside.angles for inside in sets])[valid]
            answers = self._attainable(
                positions[position_index[valid]], angles, z0[position_index[valid]], margins=False
            )
            verdicts[valid], arcs[valid] = answers.verdict, answers.arcs
        waypoints = np.cumsum(counts)[:-1]
        pieces = zip(sets, np.split(arcs, waypoints), np.split(verdicts, waypoints), strict=True)
        summaries = [_of_attained(*piece) for piece in pieces]
        columns = {name: np.array([summary[name] for summary in summaries[: len(positions)]]) for name in summaries[0]}
        columns["main_reason"] = columns["main_reason"].astype(FLAGS)
        rough = np.array([summary["attainable_fraction"] for summary in summaries[len(positions) :]])
        error = np.abs(columns["attainable_fraction"] - rough)
        return _of_sets(fine, coarse) | columns | {"attainable_error": error}

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        more = answers["attainable"] > answers["accessible"]
        return super().contradictions(answers) | {"more orientations attainable than accessible": more}

    def undecided(self, answers: dict[str, np.ndarray]) -> int | None:
        """Number of positions with at least one undecided orientation; see `GridMap.undecided`."""
        return int((answers["undecided_fraction"] > 0.0).sum())


def _of_sets(fine: list[Accessible], coarse: list[Accessible]) -> dict[str, np.ndarray]:
    volume, rough = (np.array([inside.volume.sum() for inside in sets]) for sets in (fine, coarse))
    return {
        "accessible": np.array([len(inside.angles) for inside in fine], float),
        "accessible_points": np.array([inside.of_points for inside in fine]),
        "accessible_volume": volume,
        "accessible_error": np.abs(volume - rough),
        "largest_tilt": np.array([inside.angles[:, 1].max(initial=0.0) for inside in fine]),
    }


def _of_attained(inside: Accessible, arcs: np.ndarray, verdicts: np.ndarray) -> dict[str, float]:
    # Summarise the orientations at one position; values are NaN where no orientation is accessible.
    count, good = len(arcs), arcs > 0
    if not count:
        names = ("attainable_fraction", "attainable_volume", "mean_arcs", "undecided_fraction", *REFUSALS)
        return {"attainable": 0.0, "main_reason": 0, **dict.fromkeys(names, np.nan)}
    refused = {flag: float((~good & ((verdicts & flag) != 0)).mean()) for flag in SENTENCES if flag not in NO_REASON}
    main = max(refused, key=lambda flag: refused[flag])
    return {
        "attainable": float(good.sum()),
        "attainable_fraction": float(good.mean()),
        "attainable_volume": float(inside.volume[good].sum() / inside.volume.sum()),
        "mean_arcs": float(arcs[good].mean()) if good.any() else np.nan,
        "undecided_fraction": float(((verdicts & Verdict.UNDECIDED.value) != 0).mean()),
        "main_reason": main.value if refused[main] > 0.0 else 0,
        **{name: refused[flag] for name, flag in REFUSALS.items()},
    }


# Quantities without a value where no orientation is accessible.
FLOATS = tuple(name for name in MAP_KINDS["orientations"].quantities if QUANTITIES[name].kind == "float")


class OrientationsMap(AttainabilityMap):
    """The smallest number of arcs to each orientation of tilt and torsion; see `GridMap`."""

    proves = True
    undecided = PlatformMap.undecided

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        positions, z0 = self._targets(cells), self._depths(cells)
        # If z points up in the file, phi and sigma change their signs.
        angles = self._frame.rotated_angles(np.stack([cells[name] for name in TILT_TORSION], axis=1))
        accessible_cells, count = np.flatnonzero(self._accessible(positions, angles) & (z0 > 0.0)), len(z0)
        results = {name: np.full(count, np.nan) for name in FLOATS}
        results |= {"arcs": np.zeros(count, int), "tried_arcs": np.zeros(count, int)}
        results["verdict"] = np.full(count, Verdict.NOT_ACCESSIBLE.value, FLAGS)
        if len(accessible_cells):
            answers = self._attainable(
                positions[accessible_cells], angles[accessible_cells], z0[accessible_cells], margins=True
            )
            columns = answers.arrays() | {"beta_hat": answers.beta_hat[:, 1]}
            for name, values in results.items():
                values[accessible_cells] = columns[name]
        return results

    def _accessible(self, positions: np.ndarray, angles: np.ndarray) -> np.ndarray:
        # Tell which orientations are accessible, (n,); their angles are on the grid of orientations.
        divisions = self._orientations.divisions
        distinct, inverse = np.unique(np.round(positions, DIGITS), axis=0, return_inverse=True)
        index, inside = _index(angles, divisions), np.zeros(len(positions), bool)
        for k, position in enumerate(distinct):
            free = np.zeros((2 * divisions, divisions, 2 * divisions), bool)
            free[_index(accessible(self._problem.robot, position, "grid", divisions).angles, divisions)] = True
            free[:, 0] = free[0, 0]  # without a tilt, its azimuth has no meaning
            is_there = inverse.ravel() == k
            inside[is_there] = free[tuple(i[is_there] for i in index)]
        return inside

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        return PlatformMap.contradictions(self, answers)


def _index(angles: np.ndarray, divisions: int) -> tuple[np.ndarray, ...]:
    # Find the indices of (phi, theta, sigma) on the grid.
    phi, theta, sigma = np.round(angles.T * (divisions / math.pi)).astype(int)
    return phi % (2 * divisions), theta, sigma % (2 * divisions)
