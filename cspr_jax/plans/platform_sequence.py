"""Sequences of poses of a platform: orientations, values of beta-hat, and the search along the sequence."""

import itertools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic import rotations
from cspr_jax.config.hints import plan_hints
from cspr_jax.config.plan import PlanFile, Pose
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.trajectory import WITHOUT_BETA_HAT
from cspr_jax.errors import ConfigError
from cspr_jax.feasibility.platform.checker import FEW, MANY, TOUCH, PoseChecker
from cspr_jax.feasibility.platform.end_acceleration import AT_REST, endpoint
from cspr_jax.feasibility.problem import Problem
from cspr_jax.plans.sequence import Sequence
from cspr_jax.problem import given_quaternion, motion_kind, orientations
from cspr_jax.robots.interference import contacts, gaps
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import plane_normal, rest_point
from cspr_jax.robots.wrench_balance import normalised_determinant
from cspr_jax.search.beta_hat import BEYOND, cheapest_path, options
from cspr_jax.search.platform_answers import PoseAnswers, settled
from cspr_jax.search.platform_arcs import Candidates, Found, segments_with, smallest_arcs
from cspr_jax.trajectories.platform_segment import PoseSegment

# Relative determinant below which a pose counts as singular.
SINGULAR = 1e-9
# Up to so many segments compiling for large batches takes longer than it saves.
SOME = 1000


class Poses(Sequence[Problem, PoseAnswers, PoseSegment]):
    """Poses of a platform, joined by the motions of chapter 3; see `Sequence`."""

    def __init__(self, spec: RobotFile, keys: PlanFile, path: Path) -> None:
        """Refuse keys of other families and orientations that are none."""
        if keys.family == "transition":
            raise ConfigError(
                path, 'family = "transition": must be "hypocycloid" or "hypocycloid-standard" for a platform'
            )
        if keys.inclination is not None:
            raise ConfigError(path, 'inclination: must be absent unless family = "transition"')
        if keys.beat in WITHOUT_BETA_HAT:
            for i, pose in enumerate(keys.pose):
                if pose.beta_hat is not None:
                    raise ConfigError(path, f'pose[{i}].beta_hat: must be absent with beat = "{keys.beat}"')
        super().__init__(spec, keys, path)
        self._given = np.array([_orientation(i, pose, path) for i, pose in enumerate(keys.pose)])

    def quaternions(self, z0: float) -> np.ndarray:
        """Orientations in the kernels' axes.

        Args:
            z0: m.

        Returns:
            (n_poses, 4).
        """
        points = self.points(z0)
        angles = np.array([[0.0] * 3 if p.rest else p.tilt_torsion or [0.0] * 3 for p in self.keys.pose])
        turned = orientations(self.frame, points, angles)
        is_given = np.array([pose.rest or pose.tilt_torsion is None for pose in self.keys.pose])
        return np.where(is_given[:, None], self.frame.turned_quaternions(self._given), turned)

    def check_poses(self, problem: Problem) -> None:
        """Refuse poses at which no motion can begin or end.

        Args:
            problem: gives the robot.

        Raises:
            ConfigError: which pose, and why.
        """
        poses = zip(self.points(1.0), self.quaternions(1.0), strict=True)
        hint = "".join(f" ({line})" for line in plan_hints(self.keys, self.spec))
        for i, (position, quaternion) in enumerate(poses):
            if not self.keys.pose[i].rest:
                _check_pose(problem.robot, i, position, quaternion, self.path, hint)

    def answers(self, problem: Problem, points: np.ndarray, z0: np.ndarray) -> PoseAnswers:
        """Smallest numbers of arcs, with the values of beta-hat that give the fewest in sum; see `Sequence.answers`."""
        count, depths = len(self), z0.reshape(-1, len(self))[:, 0]
        points = points.reshape(len(depths), -1, 3)
        quaternions = self.quaternions(float(depths[0]))
        checker = PoseChecker(problem, motion_kind(self.keys), batch=FEW if len(z0) <= SOME else MANY)
        bends = [
            self._bends(problem, own, quaternions, float(depth)) for own, depth in zip(points, depths, strict=True)
        ]
        if len(depths) == 1:
            self._refuse_slack(bends[0])
        # Every pair of values at the ends of every segment, for every depth.
        pairs = [[self._pairs(i, own[i], own[i + 1]) for i in range(count)] for own in bends]
        motion = np.repeat(np.arange(len(z0)), [pair[0].size for own in pairs for pair in own])
        first, last = (np.concatenate([pair[k].ravel() for own in pairs for pair in own]) for k in (0, 1))
        trial = self._candidates(points, quaternions, z0, motion, (first, last))
        fixed = np.tile(self._arcs, len(depths))
        found = smallest_arcs(checker, trial, max_arcs=self._largest, fixed=fixed, beyond=BEYOND)
        path = _best_paths(found.arcs, pairs)
        best = Found(found.arcs[path], found.undecided[path], found.checks.rows(path))
        return settled(checker, trial.rows(path), best, max_arcs=self._largest, fixed=fixed)

    def _pairs(self, i: int, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Values at both ends of segment i, (n_first, n_last) each.
        starts, ends = np.meshgrid(first, last, indexing="ij")
        if self.keys.beat == "beta_f":
            return (starts, starts) if self.keys.pose[i + 1].rest else (ends, ends)
        return starts, ends

    def _candidates(
        self, points: np.ndarray, quaternions: np.ndarray, z0: np.ndarray, motion: np.ndarray, bends: tuple
    ) -> Candidates:
        # The motions are the segments, counted over all depths.
        depth, i = np.divmod(np.arange(len(z0)), len(self))
        start, end = ((points[depth, i + k], quaternions[i + k]) for k in (0, 1))
        return Candidates(start, end, z0, motion, bends)

    def segments(self, problem: Problem, points: np.ndarray, z0: np.ndarray, answers: PoseAnswers) -> PoseSegment:
        """The segments; see `Sequence.segments`."""
        quaternions = self.quaternions(float(z0[0]))
        found = self._candidates(points[None], quaternions, z0, np.arange(len(self)), tuple(answers.beta_hat.T))
        return segments_with(problem.robot, found, answers.tried_arcs)

    def _bends(self, problem: Problem, points: np.ndarray, quaternions: np.ndarray, z0: float) -> list[np.ndarray]:
        # Values of beta-hat to try at each pose; NaN where none keeps every cable taut.
        found = []
        for pose, position, quaternion in zip(self.keys.pose, points, quaternions, strict=True):
            if self.keys.beat in WITHOUT_BETA_HAT:
                found.append(np.zeros(1))
                continue
            if pose.beta_hat is not None or pose.rest:
                found.append(np.array([AT_REST if pose.beta_hat is None else pose.beta_hat]))
                continue
            preferred, lowest, highest = (np.atleast_1d(x) for x in _end(problem.robot, position, quaternion, z0)[2:])
            values = options(preferred, lowest, highest)[0]
            found.append(values[~np.isnan(values)] if not np.isnan(values[0]) else values[:1])
        return found

    def _refuse_slack(self, bends: list[np.ndarray]) -> None:
        for i, values in enumerate(bends):
            if np.isnan(values).any():
                raise ConfigError(
                    self.path, f"pose[{i}]: must be another pose, or z0: no beta_hat keeps every cable taut there"
                )


def _best_paths(arcs: np.ndarray, pairs: list) -> np.ndarray:
    # Which candidate of each segment of each depth, (n_depths * n_segments,).
    places, last = [], 0
    for own in pairs:
        costs, starts = [], []
        for first, _ in own:
            starts.append(last)
            last += first.size
            found = arcs[starts[-1] : last].reshape(first.shape)
            costs.append(np.where(found > 0, found, np.inf))
        steps = itertools.pairwise(cheapest_path(costs))
        for start, cost, step in zip(starts, costs, steps, strict=True):
            places.append(start + int(np.ravel_multi_index(step, cost.shape)))
    return np.array(places)


def _orientation(i: int, pose: Pose, path: Path) -> np.ndarray:
    # Of a pose in the file's axes; that of tilt and torsion follows from the place.
    reference = np.array([1.0, 0.0, 0.0, 0.0])
    if pose.tilt_torsion is not None and pose.quaternion is not None:
        raise ConfigError(path, f"pose[{i}].quaternion: must be absent beside tilt_torsion")
    if pose.rest:
        turned = pose.quaternion is not None and np.abs(np.asarray(pose.quaternion) - reference).max() > 1e-9
        if turned or (pose.tilt_torsion is not None and (pose.tilt_torsion[1] != 0.0 or pose.tilt_torsion[2] != 0.0)):
            raise ConfigError(path, f"pose[{i}]: must have the reference orientation at rest")
        return reference
    return given_quaternion(pose.quaternion, f"pose[{i}].quaternion", path)


# One function for XLA instead of some hundred small ones.
_end = jax.jit(endpoint)


@jax.jit
def _standing(robot: PlatformRobot, position: Array, quaternion: Array, pairs: Array):
    # Depth below the spool plane, determinant over that of the reference orientation in the middle at the same depth,
    # distances between cables.
    where = (position, rotations.matrix(quaternion))
    depth = plane_normal(robot) @ position
    middle = (rest_point(depth), jnp.eye(3))
    apart = jnp.linalg.norm(gaps(robot, pairs, *where), axis=1)
    return depth, normalised_determinant(robot, *where) / normalised_determinant(robot, *middle), apart


def _check_pose(
    robot: PlatformRobot, i: int, position: np.ndarray, quaternion: np.ndarray, path: Path, hint: str
) -> None:
    depth, share, apart = map(np.asarray, _standing(robot, position, quaternion, contacts(robot).pairs))
    if not depth > 0.0:
        raise ConfigError(path, f"pose[{i}].position: must be below the spool plane{hint}")
    if not abs(share) > SINGULAR:
        raise ConfigError(
            path, f"pose[{i}]: must be another orientation: singular there (relative determinant {share:.1g})"
        )
    if apart.min(initial=np.inf) < TOUCH * float(np.linalg.norm(np.asarray(robot.platform_points), axis=1).max()):
        raise ConfigError(path, f"pose[{i}]: must be another orientation: two cables touch there")
