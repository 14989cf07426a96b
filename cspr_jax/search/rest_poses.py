"""Poses at rest against all conditions of a workspace, and sets of orientations at places. Arrays in, answers out."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.feasibility.workspace import geometry
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.limits import Limits
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.search.workspace_cells import WorkspaceCells
from cspr_jax.search.workspace_clearances import apart
from cspr_jax.search.workspace_questions import CLOSURE
from cspr_jax.search.workspaces import WorkspaceSearch, mass_centres

MARGINS = ("wrench_margin", "closure_margin", "clearance")
BATCH = 4096
# Rounding of distances, m: far above what coordinates below 1e6 m have, far below what anybody measures.
CLOSE = 1e-9
# Poses that are answered at a time, where each place has many orientations.
AT_ONCE = 1 << 19

Answers = dict[str, np.ndarray]
OrientationSet = Literal["inclusion", "total"]


@dataclasses.dataclass(frozen=True)
class RestPoses:
    """Conditions that a pose at rest is to meet.

    Fields:
        robot: centred, z down.
        searches: by condition, what is asked of the cables.
        is_apart: whether no two cables may meet.
        limits: floor and largest cable lengths, kernels' axes; tensions are those of the searches.
    """

    robot: AnyRobot
    searches: Mapping[Any, WorkspaceSearch]
    is_apart: bool
    limits: Limits

    def __call__(self, origins: np.ndarray, quaternions: np.ndarray) -> Answers:
        """Whether poses meet all conditions.

        Args:
            origins: (n, 3) of the platform frame, kernels' coordinates, m.
            quaternions: (n, 4) unit quaternions, scalar first.

        Returns:
            (n,) verdict, and each of `MARGINS`, NaN where nobody asks.
        """
        places, count = mass_centres(self.robot, origins, quaternions), len(origins)
        found: Answers = {name: np.full(count, np.nan) for name in MARGINS}
        verdict = np.zeros(count, FLAGS)
        for condition, asked in self.searches.items():
            answers = asked(places, quaternions)
            verdict |= answers.verdict
            name = "closure_margin" if condition == CLOSURE else "wrench_margin"
            found[name] = np.fmin(found[name], answers.margin)
        if self.is_apart:
            found["clearance"], flags = apart(self.robot, places, quaternions)
            verdict |= flags
        return {"verdict": verdict | self._limited(places, quaternions), **found}

    def sides(self, origins: np.ndarray, half: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Which cells, at one orientation, are proved to lie wholly on one side of the workspace.

        While a robot moves by a distance without a turn, its heights, the lengths of its cables and the distances
        between them change by no more than that.

        Args:
            origins: (n, 3) of the platform frame at the centres of the cells, kernels' coordinates, m.
            half: (n, 3) half sizes of the cells, m.
            quaternion: (4,) unit quaternion, scalar first.

        Returns:
            (n,) 0: neither is proved; 1: inside; 2: outside, as `schema.meanings.CELL_SIDES` has them.
        """
        turns = np.repeat(quaternion[None], len(origins), axis=0)
        places, reach = mass_centres(self.robot, origins, turns), np.linalg.norm(half, axis=1)
        inside, outside = np.ones(len(origins), bool), np.zeros(len(origins), bool)
        for asked in self.searches.values():
            kept, lost = WorkspaceCells(self.robot, asked.asked)(places, half, quaternion, asked(places, turns))
            inside, outside = inside & kept, outside | lost
        slacks = list[np.ndarray]()
        if self.is_apart:
            slacks.append(apart(self.robot, places, turns)[0])
        if self.limits.floor is not None:
            slacks.append(float(self.limits.floor) - places[:, 2])
        if self.limits.cable_length_max is not None:
            slacks.append((np.asarray(self.limits.cable_length_max) - self._lengths(places, turns)).min(1))
        for slack in slacks:
            inside, outside = inside & (slack > reach + CLOSE), outside | (slack < -reach - CLOSE)
        return np.where(inside, 1, np.where(outside, 2, 0)).astype(np.int16)

    def _lengths(self, places: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        poses = places, quaternions
        return in_batches(lambda x: geometry.cable_lengths(self.robot, *x), poses, size=BATCH)

    def _limited(self, places: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        verdict = np.zeros(len(places), FLAGS)
        if self.limits.floor is not None:
            verdict |= np.where(places[:, 2] > float(self.limits.floor), Verdict.BELOW_FLOOR, 0).astype(FLAGS)
        if self.limits.cable_length_max is not None:
            is_long = (self._lengths(places, quaternions) > np.asarray(self.limits.cable_length_max)).any(1)
            verdict |= np.where(is_long, Verdict.CABLE_TOO_LONG, 0).astype(FLAGS)
        return verdict


def over_orientations(
    ask: Callable[[np.ndarray, np.ndarray], Answers],
    origins: np.ndarray,
    orientations: np.ndarray,
    volume: np.ndarray,
    kind: OrientationSet,
) -> Answers:
    """Whether places belong to the workspace of a set of orientations.

    Args:
        ask: of poses, as `RestPoses` is.
        origins: (n, 3) m.
        orientations: (k, 4) unit quaternions, scalar first.
        volume: (k,) part of the set that each stands for.
        kind: "inclusion": some of the orientations is inside; "total": every one is.

    Returns:
        (n,) verdict: where it is not 0, the flags of the most orientations that stand in the way; margins of the best
        orientation, or of the worst; and orientation_fraction, the part of the set that is inside.
    """
    parts, count = list[Answers](), len(orientations)
    step = max(1, AT_ONCE // count)
    for start in range(0, len(origins), step):
        some = origins[start : start + step]
        found = ask(np.repeat(some, count, axis=0), np.tile(orientations, (len(some), 1)))
        parts.append(_of_places({name: values.reshape(-1, count) for name, values in found.items()}, volume, kind))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _of_places(every: Answers, volume: np.ndarray, kind: OrientationSet) -> Answers:
    # (n_places, n_orientations) each.
    verdict = every["verdict"]
    inside, is_open = verdict == 0, verdict == Verdict.UNDECIDED
    if kind == "inclusion":
        best, is_met = np.fmax.reduce, inside.any(1)
        may_be = ~is_met & is_open.any(1)
    else:
        best, is_met = np.fmin.reduce, inside.all(1)
        may_be = ~is_met & (inside | is_open).all(1)
    flags = np.where(is_met, 0, np.where(may_be, Verdict.UNDECIDED.value, _most_frequent(verdict)))
    found = {name: best(every[name], axis=1) for name in MARGINS}
    return {"verdict": flags.astype(FLAGS), **found, "orientation_fraction": inside @ volume}


def _most_frequent(verdict: np.ndarray) -> np.ndarray:
    # Of each row the flags that most of those have that are not inside.
    values = np.unique(verdict[verdict != 0])
    if len(values) == 0:
        return np.zeros(len(verdict), FLAGS)
    return values[np.argmax([(verdict == value).sum(1) for value in values], axis=0)]
