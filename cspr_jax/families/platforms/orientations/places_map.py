"""Maps of places: which orientations a platform can take there, and which of them it attains from rest."""

import numpy as np

from cspr_jax.build.problems import motion_kind
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import Orientations, SweepFile
from cspr_jax.families.platforms.answers import PlatformMotionAnswers
from cspr_jax.families.platforms.checkers import pose_checker
from cspr_jax.families.platforms.motion_checker import MANY
from cspr_jax.families.platforms.orientations.accessible import Accessible, accessible_sets
from cspr_jax.families.platforms.orientations.attainable import VALUES, attainable
from cspr_jax.maps.grid_map import PlatformMap
from cspr_jax.motion.limits import limits_set
from cspr_jax.robots.statics.symmetries import NONE, folded, symmetries
from cspr_jax.schema.quantities import REFUSALS
from cspr_jax.schema.verdicts import FLAGS, NO_REASON, SENTENCES, Verdict

# Digits of a place, m, up to which two cells are at the same one.
DIGITS = 12


class OrientationWorkspaceMap(PlatformMap):
    """The accessible orientations of each place; see `GridMap`."""

    any_cables = True

    def __init__(self, robot_file: RobotFile, keys: SweepFile, file: object) -> None:
        """Find the robot's symmetries."""
        super().__init__(robot_file, keys, file)
        self._orientations = keys.orientations or Orientations()
        # Limits may differ from cable to cable.
        self._alike = NONE if limits_set(self._problem.limits) else symmetries(self._problem.robot)

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`. Places that symmetries join are computed once."""
        places, depths = self._targets(cells), self._depths(cells)
        radius, azimuth = np.hypot(places[:, 0], places[:, 1]), np.arctan2(places[:, 1], places[:, 0])
        azimuth = folded(self._alike, azimuth)
        places = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), places[:, 2]], axis=1)
        distinct, inverse = np.unique(np.round(np.c_[places, depths], DIGITS), axis=0, return_inverse=True)
        answers = self._places(distinct[:, :3], distinct[:, 3])
        return {name: values[inverse.ravel()] for name, values in answers.items()}

    def _depths(self, cells: dict[str, np.ndarray]) -> np.ndarray:
        # Return z0; where none is given, that of horizontal transitions. Accessible orientations do not need it.
        depth = self._targets(cells)[:, 2]
        return np.asarray(cells.get("z0", depth), float)

    def _places(self, places: np.ndarray, z0: np.ndarray) -> dict[str, np.ndarray]:
        return _of_sets(*(self._sets(places, k) for k in (1, 2)))

    def _sets(self, places: np.ndarray, coarser: int) -> list[Accessible]:
        definition, divisions = self._orientations.definition or "scan", self._orientations.divisions
        return accessible_sets(self._problem.robot, [(place, divisions // coarser) for place in places], definition)

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        volume = answers["accessible_volume"]
        return {
            "a volume outside of [0, 1]": ~((volume >= 0.0) & (volume <= 1.0)),
            "orientations without a volume": (answers["accessible"] > 0) & ~(volume > 0.0),
        }


class AttainabilityMap(OrientationWorkspaceMap):
    """The accessible orientations of each place, and which of them are attained; see `GridMap`."""

    def __init__(self, robot_file: RobotFile, keys: SweepFile, file: object) -> None:
        """Build the checker of motions from rest."""
        super().__init__(robot_file, keys, file)
        kind = motion_kind(keys.trajectory, from_rest=True)
        self._checker = pose_checker(self._problem, kind, batch=MANY)

    def _attainable(
        self, places: np.ndarray, angles: np.ndarray, z0: np.ndarray, *, margins: bool
    ) -> PlatformMotionAnswers:
        # Search for motions to orientations of (n, 3) angles at (n, 3) places, both in the kernels' axes.
        values, maximum = self._orientations.values or VALUES, self._keys.trajectory.max_arcs
        arguments = self._checker, places, angles, z0
        return attainable(*arguments, max_arcs=maximum, values=values, symmetry=self._alike, margins=margins)

    def _places(self, places: np.ndarray, z0: np.ndarray) -> dict[str, np.ndarray]:
        fine, coarse = (self._sets(places, k) for k in (1, 2))
        # Compute all places with both steps together, so that batches are full.
        sets = [*fine, *coarse]
        counts = [len(inside.angles) for inside in sets]
        place_index = np.repeat(np.tile(np.arange(len(places)), 2), counts)
        place_index = np.where((z0 > 0.0)[place_index], place_index, -1)
        verdicts, arcs = np.full(len(place_index), Verdict.NO_ARCS.value), np.zeros(len(place_index), int)
        valid = np.flatnonzero(place_index >= 0)
        if len(valid):
            angles = np.concatenate([inside.angles for inside in sets])[valid]
            answers = self._attainable(places[place_index[valid]], angles, z0[place_index[valid]], margins=False)
            verdicts[valid], arcs[valid] = answers.verdict, answers.arcs
        waypoints = np.cumsum(counts)[:-1]
        pieces = zip(sets, np.split(arcs, waypoints), np.split(verdicts, waypoints), strict=True)
        rows = [_of_attained(*piece) for piece in pieces]
        columns = {name: np.array([row[name] for row in rows[: len(places)]]) for name in rows[0]}
        columns["main_reason"] = columns["main_reason"].astype(FLAGS)
        rough = np.array([row["attainable_fraction"] for row in rows[len(places) :]])
        error = np.abs(columns["attainable_fraction"] - rough)
        return _of_sets(fine, coarse) | columns | {"attainable_error": error}

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        more = answers["attainable"] > answers["accessible"]
        return super().contradictions(answers) | {"more orientations attainable than accessible": more}

    def undecided(self, answers: dict[str, np.ndarray]) -> int | None:
        """Number of places of which some orientation stays undecided; see `GridMap.undecided`."""
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
    # Summarise the orientations of one place; values are NaN where nothing is accessible.
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
