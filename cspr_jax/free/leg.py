"""Leg of free motions: poses joined by the fastest motions that are found between them."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np

from cspr_jax.build.orientations import pose_quaternions
from cspr_jax.build.scenes import scene_of
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.free.free_motion import FreeMotion, free_motion
from cspr_jax.free.poses import FreePoses
from cspr_jax.free.time_bounds import time_bounds
from cspr_jax.motions.answers import Answers, joined
from cspr_jax.motions.leg import Leg
from cspr_jax.motions.motion import Motion
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.proved_answers import ProvedAnswers
from cspr_jax.motions.waypoints import Waypoints
from cspr_jax.robots.clearance import Scene
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import rest_point

MISSED = "the search found no motion that keeps all limits; the numbers are those of the last one that it looked at"


@dataclasses.dataclass(frozen=True)
class FreeAnswers(ProvedAnswers):
    """Answers of free motions.

    Fields:
        lower_bound: (n,) of the time of all motions between both poses, s.
    """

    lower_bound: np.ndarray

    def details(self, i: int) -> dict[str, Any]:
        """The quantity that was sought, and a time that no motion undercuts; see `Answers.details`."""
        bound = float(self.lower_bound[i])
        return super().details(i) | {
            "objective": "time",
            "lower_bound": bound,
            "gap": 1.0 - bound / float(self.duration[i]),
        }


class FreeMotions(Leg):
    """Poses joined by the fastest motions that are found between them; see `Leg`."""

    def __init__(self, stops: Waypoints) -> None:
        """Refuse keys of other families, and accelerations that do not fit the poses."""
        super().__init__(stops)
        self._notes: list[str] = []
        self._refuse("arcs", "beta_hat")
        accelerations = stops.keys.end_accelerations
        if isinstance(accelerations, list) and len(accelerations) != len(stops.keys.pose):
            raise ConfigError(
                stops.path,
                f"end_accelerations = {shown(accelerations)}: must be one [x, y, z] for each of the "
                f"{len(stops.keys.pose)} poses",
            )
        if accelerations == "swing" and stops.keys.z0 is None:
            raise ConfigError(stops.path, 'z0 is missing: depth of P0, m, about which end_accelerations = "swing" are')

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses; see `Leg.join`."""
        stops = self.stops
        scene = scene_of(problem.robot, stops.robot_file, stops.frame, stops.keys, stops.path, trajectory=stops.keys)
        poses = self._poses(problem, z0)
        # Segments have nothing in common if all accelerations are known.
        is_separate = stops.keys.together is False or not np.isnan(poses.accelerations[1:-1]).any()
        try:
            parts = (self._separate if is_separate else self._together)(problem, scene, poses)
        except InputError as error:
            raise ConfigError(stops.path, str(error)) from error
        if not all(part.is_optimal for part in parts):
            self._notes = [f'family = "free": {MISSED}']
        answers = joined([part.answers for part in parts])
        columns = {field.name: getattr(answers, field.name) for field in dataclasses.fields(answers)}
        motions = [motion for part in parts for motion in part.motions]
        return FreeAnswers(**columns, lower_bound=time_bounds(problem, motions)), list(motions)

    def warnings(self, problem: Problem) -> list[str]:
        """A search that has found nothing; see `Leg.warnings`."""
        return self._notes

    def _together(self, problem: Problem, scene: Scene, poses: FreePoses) -> list[FreeMotion]:
        return [free_motion(problem, scene, poses)]

    def _separate(self, problem: Problem, scene: Scene, poses: FreePoses) -> list[FreeMotion]:
        # Each segment begins with the acceleration with which the one before ends.
        parts, accelerations = list[FreeMotion](), poses.accelerations.copy()
        for i in range(len(self)):
            quaternions = None if poses.quaternions is None else poses.quaternions[i : i + 2]
            pair = FreePoses(poses.positions[i : i + 2], quaternions, accelerations[i : i + 2], poses.z0)
            parts.append(free_motion(problem, scene, pair))
            end = parts[-1].motions[0].state(jnp.asarray(1.0))
            turning = [] if quaternions is None else [np.asarray(end.angular_acceleration)]
            accelerations[i + 1] = np.concatenate([np.asarray(end.acceleration), *turning])
        return parts

    def _poses(self, problem: Problem, z0: float) -> FreePoses:
        # The poses in the axes of the kernels.
        stops = self.stops
        positions, quaternions = np.asarray(stops.points(z0)), None
        if isinstance(problem.robot, PlatformRobot):
            quaternions = pose_quaternions(stops, positions)
        accelerations = np.full((len(positions), 3 if quaternions is None else 6), np.nan)
        known = stops.keys.end_accelerations
        if known == "swing":
            accelerations[:] = 0.0
            accelerations[:, :3] = -float(problem.robot.gravity) / z0 * (positions - rest_point(z0))
        elif isinstance(known, list):
            accelerations[:] = 0.0
            accelerations[:, :3] = stops.frame.turned(np.array(known[stops.first : stops.last + 1], float))
        accelerations[[pose.rest for pose in stops.poses]] = 0.0
        return FreePoses(
            positions, quaternions, accelerations, z0 if np.isfinite(z0) else float(positions[:, 2].mean())
        )
