"""Poses at rest, and sets of orientations, tested for all conditions of a workspace; arrays in, answers out."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Literal

import numpy as np

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.contacts.contact_bodies import shape_corners
from cspr_jax.robots.elasticity.natural_frequencies import modes_in, rest_poses
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.schema.verdicts import FLAGS, OPEN, Verdict, conjunction
from cspr_jax.workspaces.cells.speeds import CableSpeeds
from cspr_jax.workspaces.clearances import at_rest, flags, nearest_bodies
from cspr_jax.workspaces.poses import geometry
from cspr_jax.workspaces.poses.geometry import mass_centres
from cspr_jax.workspaces.requirements import CLOSURE
from cspr_jax.workspaces.search import Poses, WorkspaceSearch
from cspr_jax.workspaces.search_over_robots import RobotRows

CLEARANCES = {"clearance_cables": "cables", "clearance_obstacles": "obstacles", "clearance_platform": "platform"}
MARGINS = (
    *("wrench_margin", "closure_margin", "capacity_margin"),
    *("clearance", *CLEARANCES, "floor_margin", "length_margin", "speed_margin"),
)
NEAREST = "nearest_bodies"
FREQUENCY = "natural_frequency_min"
BATCH = 4096
# Number of poses that are tested at a time where each position has many orientations.
AT_ONCE = 1 << 19

PoseColumns = dict[str, np.ndarray]
OrientationSet = Literal["inclusion", "total"]


@dataclasses.dataclass(frozen=True)
class RestPoses:
    """Conditions that a pose at rest must meet.

    Fields:
        robot: robot, centred, z down.
        searches: searches of all conditions on the cables.
        around: bodies that must not touch, cables included; None: contacts do not count.
        limits: floor and largest cable lengths, kernels' axes; the searches have limits of tensions.
        speeds: required velocities of the effector; None: speeds do not count.
        capacity: search for the capacity margin, which does not affect verdicts; None: it is not requested.
        of_mass_centre: whether positions are of the mass centre instead of the origin of the platform frame.
        elastic: whether natural frequencies on elastic cables are requested; they do not affect verdicts.
    """

    robot: AnyRobot
    searches: Mapping[Any, WorkspaceSearch]
    around: Scene | None
    limits: Limits
    speeds: CableSpeeds | None = None
    capacity: WorkspaceSearch | None = None
    of_mass_centre: bool = False
    elastic: bool = False

    @property
    def first_margin(self) -> str:
        """The first of `MARGINS` that is requested; every map of a workspace has one of these."""
        capacity = () if self.capacity is None else ("capacity_margin",)
        names = {margin_name(condition) for condition in self.searches} | {*capacity, "clearance"}
        return next(name for name in MARGINS if name in names)

    @property
    def allowances(self) -> dict[str, float]:
        """Distances by which margins of poses that are inside may be below zero, since limits may be touched."""
        forces = max((search.allowance for search in self.searches.values()), default=0.0)
        result = {"wrench_margin": forces, "capacity_margin": forces}
        if self.limits.floor is not None:
            result["floor_margin"] = TOUCHED * float(spool_radius(self.robot))
        if self.limits.cable_length_max is not None:
            result["length_margin"] = TOUCHED * float(np.max(self.limits.cable_length_max))
        if self.speeds is not None:
            result["speed_margin"] = TOUCHED * float(np.max(self.speeds.maximum))
        return result

    def origins(
        self, positions: Float[np.ndarray, "n 3"], quaternions: Float[np.ndarray, "n 4"]
    ) -> Float[np.ndarray, "n 3"]:
        """Origins of the platform frame."""
        if not self.of_mass_centre:
            return positions
        return positions - mass_centres(self.robot, np.zeros_like(positions), quaternions)

    def __call__(
        self,
        positions: Float[np.ndarray, "n 3"],
        quaternions: Float[np.ndarray, "n 4"],
        robots: RobotRows | None = None,
    ) -> PoseColumns:
        """Tell whether poses meet all conditions; `robots` are those of the poses, where the searches have several."""
        origins = self.origins(positions, quaternions)
        centres, count = mass_centres(self.robot, origins, quaternions), len(origins)
        columns: PoseColumns = {name: np.full(count, np.nan) for name in MARGINS}
        verdict = np.zeros(count, FLAGS)
        for condition, search in self.searches.items():
            if robots is None:
                answers = search(centres, quaternions)
            else:
                answers = search.answers(Poses(centres, quaternions, None, robots))
            verdict |= answers.verdict
            name = margin_name(condition)
            columns[name] = np.fmin(columns[name], answers.margin)
        if self.capacity is not None:
            columns["capacity_margin"] = self.capacity(centres, quaternions).margin
        columns[FREQUENCY] = self._lowest_frequencies(centres, quaternions)
        columns[NEAREST] = np.zeros(count, np.int16)
        if self.around is not None:
            distances = at_rest(self.robot, self.around, centres, quaternions)
            columns |= {"clearance": distances.clearance, NEAREST: nearest_bodies(self.around, distances)}
            columns |= {name: getattr(distances, of) for name, of in CLEARANCES.items()}
            verdict |= flags(distances)
        for name, flag, slack, missed in self.limited(origins, quaternions):
            verdict |= np.bitwise_or.reduce(np.where(slack < -missed, flag, 0).astype(FLAGS), axis=1)
            columns[name] = slack.min(1)
        return {"verdict": conjunction(verdict), **columns}

    def _lowest_frequencies(self, centres: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        if not self.elastic:
            return np.full(len(centres), np.nan)
        states, tensions = rest_poses(self.robot, centres, quaternions, self.limits)
        return modes_in(self.robot, states, tensions).frequencies[:, 0]

    def _lengths(self, positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        poses = positions, quaternions
        return in_batches(lambda x: geometry.cable_lengths(self.robot, *x), poses, batch_size=BATCH)

    def _depths(self, positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        # Depths (n, k) of the mass centre, or joint, of the attachment points and of the corners of the shape.
        robot = self.robot
        if not isinstance(robot, PlatformRobot):
            return positions[:, 2:]
        points = np.concatenate([np.zeros((1, 3)), np.asarray(robot.platform_points)])
        corners = None if self.around is None else shape_corners(robot, self.around)
        points = points if corners is None else np.concatenate([points, corners])
        w, x, y, z = quaternions.T
        lowest_row = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)
        return positions[:, 2:] + lowest_row @ points.T

    def limited(
        self, origins: Float[np.ndarray, "n 3"], quaternions: Float[np.ndarray, "n 4"]
    ) -> Iterator[tuple[str, Verdict | np.ndarray, np.ndarray, np.ndarray]]:
        """Quantity, flag or flags, slacks and allowance of each limit."""
        if self.limits.floor is not None:
            centres = mass_centres(self.robot, origins, quaternions)
            slack, radius = float(self.limits.floor) - self._depths(centres, quaternions), spool_radius(self.robot)
            yield "floor_margin", Verdict.BELOW_FLOOR, slack, TOUCHED * np.asarray(radius)
        if self.limits.cable_length_max is not None:
            longest = np.asarray(self.limits.cable_length_max)
            slack = longest - self._lengths(mass_centres(self.robot, origins, quaternions), quaternions)
            yield "length_margin", Verdict.CABLE_TOO_LONG, slack, TOUCHED * longest
        if self.speeds is not None:
            slack = self.speeds.margins(origins, quaternions)
            yield "speed_margin", self.speeds.flags, slack, TOUCHED * self.speeds.maximum


def margin_name(condition: str) -> str:
    """Name of the margin of a condition on the cables."""
    return "closure_margin" if condition == CLOSURE else "wrench_margin"


def over_orientations(
    ask: Callable[[np.ndarray, np.ndarray], PoseColumns],
    origins: Float[np.ndarray, "n 3"],
    orientations: Float[np.ndarray, "k 4"],
    volume: Float[np.ndarray, "k"],
    kind: OrientationSet,
) -> PoseColumns:
    """Tell whether positions belong to the workspace of a set of orientations.

    The column "inside" (n, k) tells which orientations of the set each position has.
    """
    parts, count = list[PoseColumns](), len(orientations)
    step = max(1, AT_ONCE // count)
    for start in range(0, len(origins), step):
        positions = origins[start : start + step]
        columns = ask(np.repeat(positions, count, axis=0), np.tile(orientations, (len(positions), 1)))
        parts.append(
            _over_positions({name: values.reshape(-1, count) for name, values in columns.items()}, volume, kind)
        )
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _over_positions(columns: PoseColumns, volume: np.ndarray, kind: OrientationSet) -> PoseColumns:
    # Reduce columns (n_positions, n_orientations) to columns (n_positions,) about the set.
    verdict = columns["verdict"]
    inside = verdict == 0
    is_open = ~inside & ((verdict & ~FLAGS(OPEN.value)) == 0)
    if kind == "inclusion":
        best, is_met = np.fmax.reduce, inside.any(1)
        may_be = ~is_met & is_open.any(1)
    else:
        best, is_met = np.fmin.reduce, inside.all(1)
        may_be = ~is_met & (inside | is_open).all(1)
    # A refuted set gets the reasons of its refuted orientations, even if other orientations are open.
    reasons = np.where(is_met, 0, _most_frequent(np.where(is_open == may_be[:, None], verdict, 0)))
    best_values = {name: best(columns[name], axis=1) for name in (*MARGINS, FREQUENCY) if name in columns}
    at = (columns["clearance"] == best_values["clearance"][:, None]).argmax(1)
    best_values[NEAREST] = columns[NEAREST][np.arange(len(at)), at]
    values = {"verdict": reasons.astype(FLAGS), **best_values, "inside": inside}
    return values | {"orientation_fraction": inside @ volume}


def _most_frequent(verdict: np.ndarray) -> np.ndarray:
    # Most frequent flags of each row among its nonzero entries.
    values = np.unique(verdict[verdict != 0])
    if len(values) == 0:
        return np.zeros(len(verdict), FLAGS)
    return values[np.argmax([(verdict == value).sum(1) for value in values], axis=0)]
