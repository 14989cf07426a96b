"""Leg of ellipses: poses on ellipses and at rest, joined by transfers and turns."""

import dataclasses
import itertools
import math
from typing import Any, cast

import jax.numpy as jnp
import numpy as np

from cspr_jax.build.orientations import pose_quaternions
from cspr_jax.build.scenes import scene_of_leg
from cspr_jax.config.keys.ellipse import EllipseTable, Hertz
from cspr_jax.config.keys.pose import Pose
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.frequencies import chosen_frequency
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import SpoolHull, formula_hull
from cspr_jax.families.ellipses.motion import EllipseMotion, turning
from cspr_jax.families.ellipses.releases import Release, ReleaseRequirement, chosen_release
from cspr_jax.families.ellipses.rotation_frequencies import rotation_frequencies
from cspr_jax.families.ellipses.transfers import (
    Transfer,
    Turning,
    between,
    rotation_between,
    smallest_transfer,
    step_of,
)
from cspr_jax.launch.flight import parabola_of
from cspr_jax.launch.landings import Throw
from cspr_jax.launch.launch_result import LaunchResult, launch_result
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.leg import JoinedLeg, Leg
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.proved_answers import answers_of, verify_all_robots


@dataclasses.dataclass(frozen=True)
class EllipseAnswers(Answers):
    """Answers of segments that end on ellipses or at rest; margins are distances of tensions from their limits, N.

    Fields:
        of_ellipses: (n,) details of the ellipse on which each segment ends; if it ends at rest, on which it starts.
        flight_time: (n,) time of flight of an object that is released at the end of the segment, s; NaN if none is.
    """

    of_ellipses: np.ndarray
    flight_time: np.ndarray

    def details(self, i: int) -> dict[str, Any]:
        """Frequencies, and details of proofs; see `Answers.details`."""
        return super().details(i) | self.of_ellipses[i]


class Ellipses(Leg):
    """Poses on ellipses and at rest; see `Leg`."""

    step = 1

    def __init__(self, waypoints: Waypoints) -> None:
        """Refuse poses that are neither on an ellipse nor at rest."""
        super().__init__(waypoints)
        for i, pose in enumerate(waypoints.poses):
            self._check_pose(i, pose)
        launch, count = waypoints.plan_file.launch, len(waypoints)
        # Index of the pose of the release, if it is in this leg.
        of_launch = 0 if launch is None else launch.segment - waypoints.first + 1
        self._of_launch = of_launch if 0 < of_launch <= count else None
        if self._of_launch and waypoints.robot_file.is_platform:
            raise ConfigError(waypoints.path, f"launch: must be absent for {waypoints.robot_file.kind}")

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses; see `Leg.join`."""
        waypoints = self.waypoints
        scene = scene_of_leg(problem.robot, waypoints)
        turnings = self._turnings(problem, z0, scene)
        transfers: list[Transfer] = []
        current = turnings[0]
        for i, last in enumerate(turnings[1:], start=1):
            transfers.append(self._transfer(problem, i, current, last, scene))
            turns = self._turns(i, current, last)
            current = dataclasses.replace(last, phase=last.phase + 2.0 * math.pi * turns)
        return self._answers(problem, turnings, transfers, scene), [transfer.motion for transfer in transfers]

    def result(self, problem: Problem, joined: JoinedLeg, tension_min: np.ndarray, start: float) -> LaunchResult | None:
        """Release at the end of a segment, and flight of the object; see `Leg.result`."""
        table, frame = self.waypoints.plan_file.launch, self.waypoints.frame
        if table is None or self._of_launch is None:
            return None
        at, answers = self._of_launch - 1, cast(EllipseAnswers, joined.answers)
        motion = cast(EllipseMotion, joined.motions[at])
        # An object released late leaves the next segment; after the last one, the same ellipse.
        after = (
            joined.motions[at + 1]
            if at + 1 < len(self)
            else turning(motion.last, motion.frequencies[1], as_float64(0.0), 1.0)
        )
        return launch_result(
            table,
            frame,
            problem.robot,
            Throw((motion, after), np.asarray(motion.time), np.asarray(frame.inward(table.target))),
            time=start + float(answers.duration[: at + 1].sum()),
            flight_time=float(answers.flight_time[at]),
            tension_min=float(tension_min[at]),
            half_axes=frame.rotated(np.stack([motion.last.cosine, motion.last.sine])),
        )

    def _release(self, problem: Problem, before: Turning, scene: Scene) -> Release:
        waypoints, table, i = self.waypoints, self.waypoints.plan_file.launch, self._of_launch or 0
        ellipse = waypoints.poses[i].ellipse
        if table is None or ellipse is None:
            raise ValueError("no launch")
        gravity, centre = float(problem.robot.gravity), np.asarray(waypoints.frame.inward(ellipse.centre))
        parabola = parabola_of(table, waypoints.frame, gravity, waypoints.path)
        requirement = ReleaseRequirement(problem, scene, parabola, centre, waypoints.poses[i].turns or 0.0)
        fixed, step = int(waypoints.arcs[i - 1]), 1 if before.rests else 2
        arcs = range(fixed, fixed + 1) if fixed else range(step, waypoints.max_arcs + 1, step)
        rule = ellipse.frequency
        rule = 2.0 * math.pi * rule.hertz if isinstance(rule, Hertz) else rule
        try:
            return chosen_release(requirement, before, rule, table.choose, arcs)
        except InputError as error:
            raise ConfigError(waypoints.path, f"{waypoints.name(i)}.ellipse.{error}") from error

    def _check_pose(self, i: int, pose: Pose) -> None:
        waypoints, name = self.waypoints, self.waypoints.name(i)
        if pose.beta_hat is not None and i:
            raise ConfigError(waypoints.path, f'{name}.beta_hat: must be absent with family = "ellipse"')
        has_oscillation = pose.ellipse is not None and pose.ellipse.oscillation is not None
        if has_oscillation and not waypoints.robot_file.is_platform:
            key = self._key(i, "oscillation")
            raise ConfigError(waypoints.path, f"{key}: must be absent for {waypoints.robot_file.kind}")
        if pose.ellipse is not None and waypoints.robot_file.is_planar:
            self._check_plane(i, pose.ellipse)
        if pose.rest and pose.ellipse is not None:
            raise ConfigError(waypoints.path, f"{name}.ellipse: must be absent at rest")
        if pose.rest and pose.turns is not None and i:
            raise ConfigError(waypoints.path, f"{name}.turns = {pose.turns:g}: must be absent at rest")
        # Adjacent families need the position of the pose that they share.
        is_shared = (i == 0 and waypoints.first > 0) or (
            i == len(waypoints) and waypoints.last < len(waypoints.plan_file.pose) - 1
        )
        if pose.position is not None and not pose.rest and not is_shared:
            raise ConfigError(waypoints.path, f"{name}.position = {shown(pose.position)}: must be absent on an ellipse")
        before = waypoints.poses[i - 1] if i else None
        if not pose.rest and pose.ellipse is None and (before is None or before.rest):
            raise ConfigError(waypoints.path, f"{name}.ellipse is missing: the ellipse, or rest = true")
        if pose.rest and before is not None and before.rest:
            raise ConfigError(waypoints.path, f"{name}.rest = true: must follow an ellipse, not another rest")

    def _key(self, i: int, name: str) -> str:
        # Return the name of a key of an ellipse for messages.
        return (
            f"ellipse.{name}"
            if self.waypoints.plan_file.ellipse is not None
            else f"{self.waypoints.name(i)}.ellipse.{name}"
        )

    def _check_plane(self, i: int, table: EllipseTable) -> None:
        axes = table.half_axes or []
        for key, vectors in (("centre", [table.centre]), ("half_axes", axes)):
            if any(vector[1] != 0.0 for vector in vectors):
                value = shown(getattr(table, key))
                raise ConfigError(
                    self.waypoints.path, f"{self._key(i, key)} = {value}: must have y = 0: a planar robot"
                )
        if table.normal is not None and (table.normal[0] != 0.0 or table.normal[2] != 0.0):
            value = shown(table.normal)
            raise ConfigError(
                self.waypoints.path, f"{self._key(i, 'normal')} = {value}: must be along y: a planar robot"
            )

    def _turnings(self, problem: Problem, z0: float, scene: Scene) -> list[Turning]:
        # Return the ellipse of each pose, with the angle at which the motion arrives.
        waypoints, turnings = self.waypoints, list[Turning]()
        centres = waypoints.points(z0)
        for i, pose in enumerate(waypoints.poses):
            if pose.ellipse is not None:
                centres[i] = waypoints.frame.inward(pose.ellipse.centre)
        is_platform = isinstance(problem.robot, PlatformRobot)
        quaternions = pose_quaternions(waypoints, centres) if is_platform else [None] * len(centres)
        for i, (pose, quaternion) in enumerate(zip(waypoints.poses, quaternions, strict=True)):
            if pose.rest:
                nothing = np.zeros(3)
                turnings.append(Turning(Ellipse(centres[i], nothing, nothing), quaternion=quaternion))
            elif pose.ellipse is None:
                turnings.append(self._continued(turnings[i - 1], i))
            elif i == self._of_launch:
                turnings.append(self._release(problem, turnings[i - 1], scene))
            else:
                ellipse = self._ellipse(pose.ellipse)
                turn = Turning(ellipse, 1.0, pose.ellipse.phase, quaternion, **self._oscillation(pose.ellipse))
                turnings.append(dataclasses.replace(turn, frequency=self._frequency(problem, turn, i, scene)))
            self._check_axes(turnings, i)
        return turnings

    def _oscillation(self, table: EllipseTable) -> dict[str, np.ndarray]:
        if table.oscillation is None:
            return {}
        axis, phase = self.waypoints.frame.rotated(table.oscillation.axis), table.oscillation.phase
        parts = table.oscillation.angle * np.array([math.cos(phase), math.sin(phase)])
        return {"axis": axis / np.linalg.norm(axis), "oscillation": parts}

    def _check_axes(self, turnings: list[Turning], i: int) -> None:
        # Two oscillations must have the same axis, so that one angle can change into the other.
        before, after = turnings[max(i - 1, 0)], turnings[i]
        if before.oscillation.any() and after.oscillation.any() and not np.allclose(before.axis, after.axis):
            key = self._key(i, "oscillation.axis")
            raise ConfigError(
                self.waypoints.path, f"{key}: must be that of {self.waypoints.name(i - 1)}, or rest between"
            )

    def _continued(self, before: Turning, i: int) -> Turning:
        turns = self.waypoints.poses[i - 1].turns if i > 1 else None
        return dataclasses.replace(before, phase=before.phase + 2.0 * math.pi * (turns or 0.0))

    def _ellipse(self, table: EllipseTable) -> Ellipse:
        frame = self.waypoints.frame
        a, b = table.axes(is_planar=self.waypoints.robot_file.is_planar)
        return Ellipse(frame.inward(table.centre), frame.rotated(a), frame.rotated(b))

    def _frequency(self, problem: Problem, turning: Turning, i: int, scene: Scene) -> float:
        table = self.waypoints.poses[i].ellipse
        rule = "natural" if table is None else table.frequency
        if isinstance(rule, Hertz):
            return 2.0 * math.pi * rule.hertz
        if isinstance(rule, float):
            return rule
        try:
            return chosen_frequency(problem, turning.ellipse, rule, scene, rotation_between(turning, turning))
        except InputError as error:
            raise ConfigError(self.waypoints.path, f"{self._key(i, '')}{error}") from error

    def _turns(self, i: int, first: Turning, last: Turning) -> float:
        pose = self.waypoints.poses[i]
        if pose.turns is not None:
            return pose.turns
        return 0.0 if last.rests or step_of(first, last) else 1.0

    def _transfer(self, problem: Problem, i: int, first: Turning, last: Turning, scene: Scene) -> Transfer:
        waypoints, turns, step = self.waypoints, self._turns(i, first, last), step_of(first, last)
        arcs = int(waypoints.arcs[i - 1])
        if arcs % max(step, 1) or (arcs and not step):
            allowed = "absent on one and the same ellipse" if not step else "even between two ellipses"
            raise ConfigError(waypoints.path, f"{waypoints.name(i)}.arcs = {arcs}: must be {allowed}")
        if not arcs and step > waypoints.max_arcs:
            raise ConfigError(
                waypoints.path, f"max_arcs = {waypoints.max_arcs}: must be at least {step} between two ellipses"
            )
        if not step and not turns and not between(first, last):
            key = "turns" if waypoints.plan_file.ellipse is not None else f"{waypoints.name(i)}.turns"
            raise ConfigError(waypoints.path, f"{key} = 0: must be above 0 on one and the same ellipse")
        return smallest_transfer(problem, first, last, turns, scene, arcs=arcs, max_arcs=waypoints.max_arcs)

    def _answers(
        self, problem: Problem, turnings: list[Turning], transfers: list[Transfer], scene: Scene
    ) -> EllipseAnswers:
        hull = formula_hull(problem.robot)
        motions = [transfer.motion for transfer in transfers]
        plain = answers_of(
            [transfer.proof for transfer in transfers], np.array([float(motion.duration()) for motion in motions])
        )
        verify_all_robots(problem, plain, motions, scene)
        arcs, verdict = np.array([transfer.arcs for transfer in transfers]), np.array(plain.verdict, FLAGS)
        free = (self.waypoints.arcs == 0) & (arcs > 0)
        broken = (verdict != 0) & (verdict != Verdict.UNDECIDED.value)
        verdict[free & broken] |= Verdict.NO_ARCS.value
        doubtful = np.array([transfer.fewer_undecided for transfer in transfers]) & (verdict == 0)
        is_feasible = verdict == 0
        verdict[doubtful] |= Verdict.FEWER_ARCS_UNDECIDED.value
        details = np.empty(len(transfers), object)
        details[:] = [
            _details(problem, hull, first if last.rests else last, self.waypoints.frame)
            for first, last in itertools.pairwise(turnings)
        ]
        changed = {"arcs": np.where(is_feasible, arcs, 0), "tried_arcs": arcs, "verdict": verdict}
        columns = {field.name: getattr(plain, field.name) for field in dataclasses.fields(plain)}
        flights = np.array([turn.flight_time if isinstance(turn, Release) else np.nan for turn in turnings[1:]])
        return EllipseAnswers(**columns | changed, of_ellipses=details, flight_time=flights)


def _details(problem: Problem, hull: SpoolHull | None, turning: Turning, frame: Frame) -> dict[str, Any]:
    details: dict[str, Any] = {"frequency": turning.frequency}
    if turning.quaternion is not None:
        rotation = np.asarray(rotations.matrix(jnp.asarray(turning.quaternion)))
        natural = rotation_frequencies(problem, np.asarray(turning.ellipse.centre), rotation)
        modes = frame.rotated(natural.modes.reshape(3, 2, 3)).reshape(3, 6).tolist()
        details |= {"rotation_frequencies": natural.frequencies.tolist(), "rotation_modes": modes}
    if hull is None:
        return details
    batch = Ellipse(*(np.asarray(array)[None] for array in turning.ellipse))
    low, high = (float(x[0]) for x in harmonics.of_many(harmonics.frequency_interval, hull, batch))
    margins = harmonics.of_many(harmonics.least_margin, hull, batch, np.array([turning.frequency]))
    intervals = [] if math.isnan(low) else [[low, high]]
    return details | {"frequency_intervals": intervals, "pseudotension_margin": float(margins[0])}
