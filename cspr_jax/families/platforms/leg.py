"""Leg of poses of a platform, chapter 3: orientations, values of beta-hat, and the choice of motions."""

import itertools
from pathlib import Path
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.build.orientations import given_quaternion, orientations
from cspr_jax.config.hints import plan_hints
from cspr_jax.config.keys.pose import Pose
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.platforms.answers import PlatformMotionAnswers, settled
from cspr_jax.families.platforms.arcs import Candidates, FewestArcs, refused_by_limits, smallest_arcs
from cspr_jax.families.platforms.beta_hat import BEYOND, cheapest_path, options
from cspr_jax.families.platforms.checkers import pose_checker
from cspr_jax.families.platforms.end_acceleration import AT_REST
from cspr_jax.families.platforms.motion_checker import FEW, MANY, TOUCH, MotionChecker
from cspr_jax.families.platforms.platform_segment import PlatformMotion, PlatformSegment
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.motion.leg import Leg, each
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.robots.contacts.interference import contacts, gaps
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.statics.reference_pose import reference_pose
from cspr_jax.robots.statics.wrench_balance import determinant_ratio, is_regular
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.families import WITHOUT_BETA_HAT
from cspr_jax.verification.fewest_limits import Refused

# The third derivative of the amplitude function jumps at a knot if it changes by more than this fraction of its largest
# value.
JUMP = 1e-6
NEAR_KNOT = 1e-12  # distance from a knot at which both sides are compared
_JUMPS = 'amplitude {}: accelerations and tensions jump where its third derivative does; "effective-c3" has no jump'
# Arcs added to those of a motion that only limits refuse: more than any sequence of feasible motions has.
REFUSED = 100_000
# For up to this many segments, compiling for large batches takes longer than it saves.
FEW_SEGMENTS = 1000


class _Poses(Leg):
    # Poses of a platform, joined by hypocycloids of variable amplitude or by standard ones, as `variable` says.

    step = 1
    variable: ClassVar[bool]

    def __init__(self, waypoints: Waypoints) -> None:
        """Refuse keys of other families and quaternions that are no orientations."""
        spec, path = waypoints.plan_file, waypoints.path
        if spec.inclination is not None:
            raise ConfigError(path, 'inclination: must be absent unless family = "transition"')
        if spec.beat in WITHOUT_BETA_HAT:
            for i, pose in enumerate(waypoints.poses):
                if pose.beta_hat is not None:
                    raise ConfigError(path, f'{waypoints.name(i)}.beta_hat: must be absent with beat = "{spec.beat}"')
        super().__init__(waypoints)
        self._kind = PlatformMotionKind(variable=self.variable, plain=spec.beat == "beta_1")
        self._given = np.array([_orientation(waypoints.name(i), pose, path) for i, pose in enumerate(waypoints.poses)])

    def _quaternions(self, points: np.ndarray) -> np.ndarray:
        # Return orientations (n_poses, 4) in the kernels' axes; azimuths of tilts count from the vertical plane through
        # the centroid and the point.
        poses, frame = self.waypoints.poses, self.waypoints.frame
        angles = np.array([[0.0] * 3 if p.rest else p.tilt_torsion or [0.0] * 3 for p in poses])
        is_given = np.array([pose.rest or pose.tilt_torsion is None for pose in poses])
        return np.where(is_given[:, None], frame.rotated_quaternions(self._given), orientations(frame, points, angles))

    def check(self, problem: Problem) -> None:
        """Refuse poses at which no motion can start or end; see `Leg.check`."""
        waypoints = self.waypoints
        points = waypoints.points(1.0)
        hint = "".join(f" ({line})" for line in plan_hints(waypoints.plan_file, waypoints.robot_file))
        for i, (position, quaternion) in enumerate(zip(points, self._quaternions(points), strict=True)):
            # On more than six cables only the margin of tensions decides about poses.
            if not waypoints.poses[i].rest and _is_determined(problem):
                _check_pose(problem.robot, waypoints.name(i), position, quaternion, waypoints.path, hint)

    def join(self, problem: Problem, z0: float) -> tuple[PlatformMotionAnswers, list[Motion]]:
        """Join the poses; see `Leg.join`."""
        try:
            if _is_determined(problem):
                reference_pose(problem.robot, z0)
        except InputError as error:
            raise ConfigError(self.waypoints.path, self.waypoints.robot_file.typed(error)) from error
        answers, segments = self._search(problem, np.array([z0]), is_final=True)
        pairs = zip(each(segments, len(self)), answers.tried_arcs, strict=True)
        return answers, [
            PlatformMotion(segment, problem.amplitude, as_float64(arcs), self._kind) for segment, arcs in pairs
        ]

    def answers(self, problem: Problem, depths: np.ndarray) -> PlatformMotionAnswers:
        """Answers for many depths; see `Leg.answers`."""
        return self._search(problem, depths, is_final=False)[0]

    def warnings(self, problem: Problem) -> list[str]:
        """Warn of tensions that jump; see `Leg.warnings`."""
        return [_JUMPS.format(problem.amplitude.name)] if self.variable and _jumps(problem.amplitude) else []

    def _search(
        self, problem: Problem, depths: np.ndarray, *, is_final: bool
    ) -> tuple[PlatformMotionAnswers, PlatformSegment]:
        # Choose the values of beta-hat with the smallest total number of arcs.
        count, z0 = len(self), np.repeat(depths, len(self))
        points = self.waypoints.points(depths)
        quaternions = self._quaternions(points[0])
        checker = pose_checker(problem, self._kind, batch=FEW if len(z0) <= FEW_SEGMENTS else MANY)
        beta_hats = [
            self._beta_hats(checker, positions, quaternions, float(depth))
            for positions, depth in zip(points, depths, strict=True)
        ]
        if len(depths) == 1:
            self._refuse_slack(beta_hats[0])
        # Try every pair of values at the ends of every segment, for every depth.
        pairs = [[self._pairs(i, values[i], values[i + 1]) for i in range(count)] for values in beta_hats]
        motion = np.repeat(np.arange(len(z0)), [pair[0].size for of_depth in pairs for pair in of_depth])
        first, last = (np.concatenate([pair[k].ravel() for of_depth in pairs for pair in of_depth]) for k in (0, 1))
        trial = self._candidates(points, quaternions, z0, motion, (first, last))
        fixed, largest = np.tile(self.waypoints.arcs, len(depths)), self.waypoints.max_arcs
        of_trials = smallest_arcs(checker, trial, max_arcs=largest, fixed=fixed, beyond=BEYOND)
        refused = self._refused(checker, trial, of_trials, fixed)
        path = _best_paths(of_trials.arcs, refused.arcs, pairs)
        best = FewestArcs(of_trials.arcs[path], of_trials.undecided[path], of_trials.checks.take(path))
        why = Refused(refused.arcs[path], refused.broken[path])
        chosen = trial.take(path)
        return settled(checker, chosen, best, refused=why, max_arcs=largest, fixed=fixed, is_final=is_final)

    def _refused(self, checker: MotionChecker, trial: Candidates, of_trials: FewestArcs, fixed: np.ndarray) -> Refused:
        # Find candidates that only limits refuse, in segments where no candidate is feasible or nearly feasible.
        is_open = np.ones(len(trial.z0), bool)
        is_open[trial.motion[(of_trials.arcs > 0) | (of_trials.undecided > 0)]] = False
        open_candidates, count = np.flatnonzero(is_open[trial.motion]), len(trial.motion)
        part = refused_by_limits(checker, trial.take(open_candidates), max_arcs=self.waypoints.max_arcs, fixed=fixed)
        refused = Refused(np.zeros(count, int), np.zeros((count, len(checker.flags)), bool))
        refused.arcs[open_candidates], refused.broken[open_candidates] = part.arcs, part.broken
        return refused

    def _pairs(self, i: int, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Return the values at both ends of segment i, (n_first, n_last) each.
        starts, ends = np.meshgrid(first, last, indexing="ij")
        if self.waypoints.plan_file.beat == "beta_f":
            return (starts, starts) if self.waypoints.poses[i + 1].rest else (ends, ends)
        return starts, ends

    def _candidates(
        self, points: np.ndarray, quaternions: np.ndarray, z0: np.ndarray, motion: np.ndarray, beta_hats: tuple
    ) -> Candidates:
        # Segments of all depths are numbered consecutively.
        depth, i = np.divmod(np.arange(len(z0)), len(self))
        start, end = ((points[depth, i + k], quaternions[i + k]) for k in (0, 1))
        return Candidates(start, end, z0, motion, beta_hats)

    def _beta_hats(
        self, checker: MotionChecker, points: np.ndarray, quaternions: np.ndarray, z0: float
    ) -> list[np.ndarray]:
        # Return the values of beta-hat to try at each pose; NaN where none keeps every cable taut.
        tries: list[np.ndarray] = []
        waypoints, changes = self.waypoints, self._changes()
        for i, (pose, position, quaternion) in enumerate(zip(waypoints.poses, points, quaternions, strict=True)):
            if waypoints.plan_file.beat in WITHOUT_BETA_HAT:
                tries.append(np.zeros(1))
                continue
            if pose.beta_hat is not None or pose.rest:
                tries.append(np.array([AT_REST if pose.beta_hat is None else pose.beta_hat]))
                continue
            end = checker.end_interval(position, quaternion, z0)
            preferred, lowest, highest = (np.atleast_1d(x) for x in end)
            values = options(preferred, lowest, highest)[0]
            if np.isnan(values[0]) and not _is_determined(checker.problem):
                values[0] = end[0]  # the verdict says why
            is_one = np.isnan(values[0]) or i in changes
            tries.append(values[:1] if is_one else values[~np.isnan(values)])
        return tries

    def _changes(self) -> set[int]:
        # Return the poses where the family changes: there both families take the value tried first, so that
        # accelerations are continuous.
        ends = {0: self.waypoints.first > 0, len(self): self.waypoints.last < len(self.waypoints.plan_file.pose) - 1}
        return {i for i, changes in ends.items() if changes}

    def _refuse_slack(self, beta_hats: list[np.ndarray]) -> None:
        for i, values in enumerate(beta_hats):
            if np.isnan(values).any():
                name = self.waypoints.name(i)
                raise ConfigError(
                    self.waypoints.path,
                    f"{name}: must be another pose, or z0: no beta_hat keeps every cable taut there",
                )


class StandardPoses(_Poses):
    """Poses of a platform, joined by standard hypocycloids; see `Leg`."""

    variable = False


class VariablePoses(_Poses):
    """Poses of a platform, joined by hypocycloids of variable amplitude; see `Leg`."""

    variable = True


def _best_paths(arcs: np.ndarray, refused: np.ndarray, pairs: list) -> np.ndarray:
    # Choose a candidate for each segment at each depth, (n_depths * n_segments,). Among failing candidates, prefer
    # those that only limits refuse.
    arcs = np.where(arcs > 0, arcs, np.where(refused > 0, refused + REFUSED, 0))
    chosen, last = [], 0
    for of_depth in pairs:
        costs, starts = [], []
        for first, _ in of_depth:
            starts.append(last)
            last += first.size
            counts = arcs[starts[-1] : last].reshape(first.shape)
            costs.append(np.where(counts > 0, counts, np.inf))
        steps = itertools.pairwise(cheapest_path(costs))
        for start, cost, step in zip(starts, costs, steps, strict=True):
            chosen.append(start + int(np.ravel_multi_index(step, cost.shape)))
    return np.array(chosen)


def _orientation(name: str, pose: Pose, path: Path) -> np.ndarray:
    # Return the orientation of a pose in the file's axes; an orientation by tilt and torsion follows from the position.
    reference = np.array(IDENTITY)
    if pose.tilt_torsion is not None and pose.quaternion is not None:
        raise ConfigError(path, f"{name}.quaternion: cannot be combined with tilt_torsion")
    if pose.rest:
        rotated = pose.quaternion is not None and np.abs(np.asarray(pose.quaternion) - reference).max() > 1e-9
        if rotated or (pose.tilt_torsion is not None and (pose.tilt_torsion[1] != 0.0 or pose.tilt_torsion[2] != 0.0)):
            raise ConfigError(path, f"{name}: must have the reference orientation at rest")
        return reference
    return given_quaternion(pose.quaternion, f"{name}.quaternion", path)


def _is_determined(problem: Problem) -> bool:
    # Tell whether the motion determines the tensions, and the determinant of a reference pose tells what is singular.
    return problem.robot.n_cables == problem.robot.dof


@persistent_jit
def _standing(robot: PlatformRobot, position: Array, quaternion: Array, pairs: Array):
    # Return the depth below the spool plane, the determinant over that of the reference orientation in the middle at
    # the same depth, and the distances between cables.
    where = (position, rotations.matrix(quaternion))
    depth = plane_normal(robot) @ position
    distances = jnp.linalg.norm(gaps(robot, pairs, *where), axis=1)
    return depth, determinant_ratio(robot, *where), distances


def _check_pose(
    robot: PlatformRobot, name: str, position: np.ndarray, quaternion: np.ndarray, path: Path, hint: str
) -> None:
    depth, fraction, distances = map(np.asarray, _standing(robot, position, quaternion, contacts(robot).pairs))
    if not depth > 0.0:
        raise ConfigError(path, f"{name}.position: must be below the spool plane{hint}")
    if not is_regular(abs(fraction)):
        raise ConfigError(
            path, f"{name}: must be another orientation: singular there (relative determinant {fraction:.1g})"
        )
    if distances.min(initial=np.inf) < TOUCH * float(np.linalg.norm(np.asarray(robot.platform_points), axis=1).max()):
        raise ConfigError(path, f"{name}: must be another orientation: two cables touch there")


def _jumps(amplitude: Amplitude) -> bool:
    # Tell whether A''' jumps between pieces; use NumPy, since small jax operations would each be compiled.
    knots = np.asarray(amplitude.knots)
    before, after = (np.asarray(derivatives(amplitude, knots + s, order=3)[3]) for s in (-NEAR_KNOT, NEAR_KNOT))
    return bool((np.abs(after - before) > JUMP * float(amplitude.largest[3])).any())
