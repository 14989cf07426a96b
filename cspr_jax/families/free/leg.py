"""Leg of free motions: poses joined by the fastest motions that a search finds."""

import dataclasses
import time
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from cspr_jax.build.orientations import pose_quaternions
from cspr_jax.build.scenes import scene_of_leg
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.families.free.closed_forms import ClosedForm, closed_forms
from cspr_jax.families.free.free_motion import FreeMotion, free_motion
from cspr_jax.families.free.no_slower import can_be_faster, fits, lines_instead, no_slower, no_slower_than_lines
from cspr_jax.families.free.poses import FreePoses, divided
from cspr_jax.families.free.problem import FreeSettings
from cspr_jax.families.free.search.time_bounds import time_bounds
from cspr_jax.families.free.static_poses import OF_POSITIONS, first_refused
from cspr_jax.motion.answers import Answers, joined
from cspr_jax.motion.leg import Leg
from cspr_jax.motion.motion import Motion, states_at
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import rest_point
from cspr_jax.runtime.stages import stage
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.verdicts import Verdict

LEVELS = ("tension", "margin")
STOPPED = "the search was stopped before its end: more starts might have led to a better motion"
DIVIDED = (
    "{} and {} lie on opposite sides of singular poses (determinants {:.3g} and {:.3g}): every motion between them "
    "passes one, at which the cables cannot carry every wrench, so nothing is sought"
)
FOLLOWED = 'the search found nothing faster than family = "{}", whose motions these are'
LINES = 'the search found nothing faster than a line in its least time, as of family = "{}", which leads to {}{}'
# Accelerations count as jumping where they change at once by more than this fraction of the largest one.
JUMPING, JUMP = "; accelerations jump along it", 0.01
MISSED = "the search found no motion that keeps all limits; the numbers are those of the last one that it looked at"


@dataclasses.dataclass(frozen=True)
class FreeAnswers(Answers):
    """Answers of free motions.

    Fields:
        objective: the row of `objectives.OBJECTIVES`.
        energy: (n,) integral of the sum of the squares of the tensions, N^2 s.
        lower_bound: (n,) lower bound of the time of all motions between both poses, s; NaN for none.
        source: (n,) family that each motion comes from.
    """

    objective: str
    energy: np.ndarray
    lower_bound: np.ndarray
    source: np.ndarray

    def details(self, i: int) -> dict[str, Any]:
        """The objective, and a lower bound of the time of all motions; see `Answers.details`."""
        details = super().details(i) | {"objective": self.objective, "energy": float(self.energy[i])}
        details["source"] = str(self.source[i])
        bound = float(self.lower_bound[i])
        if np.isnan(bound):
            return details
        gap = {"gap": 1.0 - bound / float(self.duration[i])} if self.objective == "time" else {}
        return details | {"lower_bound": bound} | gap


class FreeMotions(Leg):
    """Poses joined by the fastest motions that a search finds; see `Leg`."""

    def __init__(self, waypoints: Waypoints) -> None:
        """Refuse keys of other families, and accelerations that do not fit the poses."""
        super().__init__(waypoints)
        self._notes: list[str] = []
        self._others: Sequence[Leg] = ()
        self._lines: Sequence[Leg] = ()
        self._refuse("arcs", "beta_hat")
        accelerations = waypoints.plan_file.end_accelerations
        if isinstance(accelerations, list) and len(accelerations) != len(waypoints.plan_file.pose):
            raise ConfigError(
                waypoints.path,
                f"end_accelerations = {shown(accelerations)}: must be one [x, y, z] for each of the "
                f"{len(waypoints.plan_file.pose)} poses",
            )
        if accelerations == "swing" and waypoints.plan_file.z0 is None:
            raise ConfigError(
                waypoints.path, 'z0 is missing: depth of P0, m, about which end_accelerations = "swing" are'
            )
        if waypoints.plan_file.objective in LEVELS and waypoints.plan_file.duration_max is None:
            why = f'which objective = "{waypoints.plan_file.objective}" needs: the slower a motion, the better it is'
            raise ConfigError(waypoints.path, f"duration_max is missing: longest duration of a segment, s, {why}")

    def begin_with(self, others: Sequence[Leg]) -> None:
        """Let searches also start from motions of other families; see `Leg.begin_with`."""
        self._others, self._lines = (
            [leg for leg in others if FAMILIES[leg.waypoints.family].precedes_searches is first]
            for first in (False, True)
        )

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses; see `Leg.join`."""
        waypoints = self.waypoints
        scene = scene_of_leg(problem.robot, waypoints)
        poses = self._poses(problem, z0)
        if not len(divided(problem, poses)):
            self._refuse_poses(problem, scene, poses)
        # If all accelerations at poses are given, segments can be searched one by one.
        is_separate = waypoints.plan_file.together is False or not np.isnan(poses.accelerations[1:-1]).any()
        try:
            parts = (self._separate if is_separate else self._together)(problem, scene, poses)
        except InputError as error:
            raise ConfigError(waypoints.path, str(error)) from error
        if any(part.is_stopped for part in parts):
            self._notes.append(f'family = "free": {STOPPED}')
        sources = [family for part in parts for family in part.families or [None] * len(part.motions)]
        motions = [motion for part in parts for motion in part.motions]
        self._notes += [f'family = "free": {line}' for line in self._said(sources, motions)]
        sides = divided(problem, poses)
        for i, *ends in sides.tolist():
            self._notes.append(
                f'family = "free": {DIVIDED.format(waypoints.name(int(i)), waypoints.name(int(i) + 1), *ends)}'
            )
        if not len(sides) and not all(part.is_optimal or part.answers.feasible.all() for part in parts):
            self._notes.append(f'family = "free": {MISSED}')
        answers = joined([part.answers for part in parts])
        columns = {field.name: getattr(answers, field.name) for field in dataclasses.fields(answers)}
        is_still = np.array([not (poses.velocities[i : i + 2]).any() for i in range(len(self))])
        bounds = np.where(is_still, time_bounds(problem, motions), np.nan)
        energy = np.concatenate([part.energy for part in parts])
        source = np.array([family or waypoints.family for family in sources])
        columns |= {"objective": self._settings.objective, "energy": energy, "lower_bound": bounds, "source": source}
        return FreeAnswers(**columns), list(motions)

    def _refuse_poses(self, problem: Problem, scene: Scene, poses: FreePoses) -> None:
        # Refuse poses that no motion can have.
        refused = first_refused(problem, scene, poses, self.waypoints.frame)
        if refused is None:
            return
        i, cause = refused
        position, is_place = self.waypoints.poses[i].position, bool(Verdict[cause.criterion.upper()] & OF_POSITIONS)
        key = f"{self.waypoints.name(i)}.position = {shown(position)}"
        if position is None or (self.waypoints.poses[i].rest and not is_place):
            key = f"{self.waypoints.name(i)}.rest = true"
        allowed = "must be one that a motion can have" if is_place else "must be where the robot can stand still"
        raise ConfigError(self.waypoints.path, f"{key}: {allowed}: {cause.text}")

    def _said(self, sources: list[str | None], motions: list[Spline]) -> list[str]:
        # Return lines that say which motions are from other families; only straight lines replace single segments.
        lines = []
        for family in dict.fromkeys(source for source in sources if source):
            indices = [i for i, source in enumerate(sources) if source == family]
            names, jumps = (
                ", ".join(self.waypoints.name(i + 1) for i in indices),
                [motions[i].jumps(JUMP) for i in indices],
            )
            is_line = FAMILIES[family].precedes_searches
            why = JUMPING if any(map(len, jumps)) else ""
            lines.append(LINES.format(family, names, why) if is_line else FOLLOWED.format(family))
        return lines

    @property
    def _settings(self) -> FreeSettings:
        # The search time counts from now on.
        spec = self.waypoints.plan_file
        until = np.inf if spec.search_time is None else time.monotonic() + spec.search_time
        return FreeSettings(spec.objective or "time", spec.duration_max, spec.starts, until)

    def warnings(self, problem: Problem) -> list[str]:
        """Warn of a search that found nothing or was stopped; see `Leg.warnings`."""
        return self._notes

    def _together(self, problem: Problem, scene: Scene, poses: FreePoses) -> list[FreeMotion]:
        lines, others = (partial(closed_forms, legs, problem, poses) for legs in (self._lines, self._others))
        return [self._no_slower(problem, scene, poses, poses, lines, others)]

    def _separate(self, problem: Problem, scene: Scene, poses: FreePoses) -> list[FreeMotion]:
        # Each segment starts with the acceleration at the end of the previous one, except after lines, where it jumps.
        parts, accelerations = list[FreeMotion](), poses.accelerations.copy()
        lines, others = (cache(partial(closed_forms, legs, problem, poses)) for legs in (self._lines, self._others))
        for i in range(len(self)):
            quaternions = None if poses.quaternions is None else poses.quaternions[i : i + 2]
            ends = poses.positions[i : i + 2], quaternions, poses.velocities[i : i + 2]
            segment, requested = (
                FreePoses(*ends, each[i : i + 2].copy(), poses.z0) for each in (accelerations, poses.accelerations)
            )
            forms = partial(_of_segment, lines, i), partial(_of_segment, others, i)
            parts.append(self._no_slower(problem, scene, segment, requested, *forms))
            is_line = any(parts[-1].families) and FAMILIES[str(parts[-1].families[0])].precedes_searches
            if is_line or i + 1 == len(self):
                continue
            end = states_at(parts[-1].motions[0], np.ones(1))
            turning = [] if quaternions is None else [end.angular_acceleration]
            accelerations[i + 1] = np.concatenate([end.acceleration, *turning], axis=1)[0]
        return parts

    def _no_slower(
        self,
        problem: Problem,
        scene: Scene,
        poses: FreePoses,
        requested: FreePoses,
        lines: Callable[[], list[ClosedForm]],
        others: Callable[[], list[ClosedForm]],
    ) -> FreeMotion:
        # Compute lines first, since they take little time; compute other families only where they can help.
        settings = self._settings
        if len(divided(problem, poses)):
            return free_motion(problem, scene, poses, settings)
        stage("free motion: lines")
        straight = lines()
        usable = [line for line in straight if fits(line, problem, requested, settings).all()]
        if usable and time.monotonic() > settings.until:
            return lines_instead(problem, scene, poses, settings, usable[0])
        free = None
        try:
            free = free_motion(problem, scene, poses, settings, None, (), straight)
            free = no_slower_than_lines(free, problem, scene, requested, settings, straight)
            if not free.is_stopped and can_be_faster(free, problem, poses, settings):
                free = self._from_others(problem, scene, poses, settings, free, others())
        except KeyboardInterrupt:
            if not usable and (free is None or not free.answers.feasible.all()):
                raise
            free = lines_instead(problem, scene, poses, settings, usable[0]) if free is None else free
            free = dataclasses.replace(free, is_stopped=True)
        return no_slower_than_lines(free, problem, scene, requested, settings, straight)

    def _from_others(
        self,
        problem: Problem,
        scene: Scene,
        poses: FreePoses,
        settings: FreeSettings,
        free: FreeMotion,
        forms: list[ClosedForm],
    ) -> FreeMotion:
        # Search from other families' motions as well, and use these motions where nothing faster is found.
        is_proved = bool(free.answers.feasible.all())
        if any(not is_proved or form.duration.sum() < free.duration for form in forms):
            further = free_motion(problem, scene, poses, settings, free, forms)
            free = further if further.answers.feasible.all() or not is_proved else free
        return no_slower(free, problem, scene, poses, settings, forms)

    def _poses(self, problem: Problem, z0: float) -> FreePoses:
        # Return the poses in the axes of the kernels.
        waypoints = self.waypoints
        positions, quaternions = np.asarray(waypoints.points(z0)), None
        if isinstance(problem.robot, PlatformRobot):
            quaternions = pose_quaternions(waypoints, positions)
        accelerations = np.full((len(positions), 3 if quaternions is None else 6), np.nan)
        requested = waypoints.plan_file.end_accelerations
        if requested == "swing":
            accelerations[:] = 0.0
            accelerations[:, :3] = -float(problem.robot.gravity) / z0 * (positions - rest_point(z0))
        elif isinstance(requested, list):
            accelerations[:] = 0.0
            accelerations[:, :3] = waypoints.frame.rotated(
                np.array(requested[waypoints.first : waypoints.last + 1], float)
            )
        accelerations[[pose.rest for pose in waypoints.poses]] = 0.0
        rates = np.array([pose.velocity or (0.0, 0.0, 0.0) for pose in waypoints.poses])
        middle = z0 if np.isfinite(z0) else float(positions[:, 2].mean())
        return FreePoses(positions, quaternions, waypoints.frame.rotated(rates), accelerations, middle)


def _of_segment(forms: Callable[[], list[ClosedForm]], i: int) -> list[ClosedForm]:
    return [form.segment(i) for form in forms()]
