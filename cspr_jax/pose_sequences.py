"""Sequences of poses of a platform: orientations, values of beta-hat, and the search along the sequence."""

import dataclasses
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax import problem, rotations
from cspr_jax.config.plan import PlanFile, Pose
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, shown
from cspr_jax.feasibility.endpoints import AT_REST, endpoint
from cspr_jax.feasibility.interference import contacts, gaps
from cspr_jax.feasibility.pose_checks import TOUCH, PoseChecker
from cspr_jax.feasibility.pose_slacks import PoseShared
from cspr_jax.feasibility.verdicts import Verdict
from cspr_jax.maps.answers import Answers
from cspr_jax.maps.bends import cheapest_path, options
from cspr_jax.maps.minimum_pose_arcs import Ends, best_candidate, segments_between, smallest_arcs
from cspr_jax.robots import centroid, plane_normal
from cspr_jax.sequences import Sequence
from cspr_jax.trajectories.pose_segment import PoseSegment
from cspr_jax.wrenches import conditioning

# Relative determinant below which a pose counts as singular.
SINGULAR = 1e-9


@dataclasses.dataclass(frozen=True)
class PoseAnswers(Answers):
    """One answer a segment between poses.

    Fields:
        beta_hat: (n, 2) at both ends.
        regularity: (n,) smallest determinant over its value at rest in P0.
        cable_distance: (n,) smallest distance between cables that can meet, m.
    """

    beta_hat: np.ndarray
    regularity: np.ndarray
    cable_distance: np.ndarray


class Poses(Sequence[PoseShared, PoseAnswers, PoseSegment]):
    """Poses of a platform, joined by the motions of chapter 3; see `Sequence`."""

    def __init__(self, spec: RobotFile, keys: PlanFile, path: Path) -> None:
        """Refuse keys of other families and orientations that are none."""
        if keys.family == "transition":
            raise ConfigError(
                path, 'family = "transition": must be "hypocycloid" or "hypocycloid-standard" for a platform'
            )
        if keys.inclination is not None:
            raise ConfigError(path, 'inclination: must be absent unless family = "transition"')
        super().__init__(spec, keys, path)
        self._given = [_orientation(i, pose, path) for i, pose in enumerate(keys.pose)]

    @property
    def variable(self) -> bool:
        """Whether positions are hypocycloids of variable amplitude."""
        return self.keys.family == "hypocycloid"

    def quaternions(self, robot, z0: float) -> np.ndarray:
        """Orientations in the kernels' axes.

        Args:
            robot: gives the centroid.
            z0: m.

        Returns:
            (n_poses, 4).
        """
        signs = problem.axis_signs(self.spec)
        own = (self.points(robot, z0) - np.asarray(centroid(robot))) * signs
        found = []
        for pose, given, place in zip(self.keys.pose, self._given, own, strict=True):
            if pose.tilt_torsion is not None and not pose.rest:
                azimuth, tilt, torsion = pose.tilt_torsion
                towards = np.arctan2(place[1], place[0])  # (3.98)
                given = np.asarray(rotations.from_tilt_torsion(*map(jnp.asarray, (azimuth + towards, tilt, torsion))))
            found.append(given * np.concatenate([[1.0], signs]))
        return np.array(found)

    def answers(self, shared: PoseShared, points: np.ndarray, z0: np.ndarray) -> PoseAnswers:
        """Smallest numbers of arcs, with the values of beta-hat that give the fewest in sum; see `Sequence.answers`."""
        depth, checker = float(z0[0]), PoseChecker(shared, variable=self.variable)
        poses = list(zip(points, self.quaternions(shared.robot, depth), strict=True))
        bends = [self._bends(shared, i, *pose, depth) for i, pose in enumerate(poses)]
        found = []
        for i in range(len(self)):
            ends = Ends(poses[i], poses[i + 1], bends[i], bends[i + 1])
            fixed = int(self._arcs[i])
            found.append(smallest_arcs(checker, ends, depth, max_arcs=self._largest, fixed=fixed))
        path = cheapest_path([np.where(f.arcs > 0, f.arcs, np.inf) for f in found])
        chosen = np.array([bend[k] for bend, k in zip(bends, path, strict=True)])
        arcs, doubtful = (
            np.array([values[i][path[i], path[i + 1]] for i in range(len(self))])
            for values in ([f.arcs for f in found], [f.doubtful for f in found])
        )
        tried = arcs.copy()
        for k in np.flatnonzero(arcs == 0):
            i = int(k)
            ends = Ends(poses[i], poses[i + 1], chosen[i : i + 1], chosen[i + 1 : i + 2])
            tried[i] = int(self._arcs[i]) or best_candidate(checker, ends, depth, max_arcs=self._largest)
        segments = self._between(shared, poses, chosen, depth, tried)
        checks = checker.check(segments, tried)
        none = np.where(doubtful, Verdict.UNDECIDED.value, checks.verdict | Verdict.NO_ARCS.value)
        verdict = np.where(arcs > 0, np.where(doubtful, Verdict.FEWER_ARCS_UNDECIDED.value, 0), none)
        return PoseAnswers(
            arcs,
            tried,
            verdict.astype(np.uint16),
            checker.durations(segments, tried),
            np.minimum(checks.slack[:, 0], checks.slack[:, 2]),
            np.full(len(self), np.nan),
            checks.slack[:, 3:].min(1, initial=np.inf),
            np.full(len(self), np.nan),
            np.stack([chosen[:-1], chosen[1:]], axis=1),
            checks.slack[:, 1],
            checks.gap,
        )

    def segments(self, shared: PoseShared, points: np.ndarray, z0: np.ndarray, answers: PoseAnswers) -> PoseSegment:
        """The segments; see `Sequence.segments`."""
        depth = float(z0[0])
        poses = list(zip(points, self.quaternions(shared.robot, depth), strict=True))
        bends = np.append(answers.beta_hat[:, 0], answers.beta_hat[-1, 1])
        return self._between(shared, poses, bends, depth, answers.tried_arcs)

    def _between(self, shared: PoseShared, poses: list, chosen: np.ndarray, z0: float, arcs: np.ndarray) -> PoseSegment:
        found = [
            segments_between(
                shared.robot,
                Ends(poses[i], poses[i + 1], chosen[i : i + 1], chosen[i + 1 : i + 2]),
                z0,
                int(p),
            )
            for i, p in enumerate(arcs)
        ]
        return jax.tree.map(lambda *leaves: np.concatenate(leaves), *found)

    def _bends(self, shared: PoseShared, i: int, position: np.ndarray, quaternion: np.ndarray, z0: float) -> np.ndarray:
        pose = self.keys.pose[i]
        _check_pose(shared, i, position, quaternion, z0, self.path)
        if pose.beta_hat is not None:
            return np.array([pose.beta_hat])
        if pose.rest:
            return np.array([AT_REST])
        found = endpoint(shared.robot, jnp.asarray(position), jnp.asarray(quaternion), jnp.asarray(z0))
        values = options(float(found.preferred), float(found.lowest), float(found.highest))
        if not len(values):
            raise ConfigError(
                self.path, f"pose[{i}]: must be another pose, or z0: no beta_hat keeps every cable taut there"
            )
        return values


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
    if pose.quaternion is None:
        return reference
    given = np.asarray(pose.quaternion)
    size = float(np.linalg.norm(given))
    if abs(size - 1.0) > rotations.UNIT_TOLERANCE:
        raise ConfigError(
            path, f"pose[{i}].quaternion = {shown(pose.quaternion)}: must have length 1 (it has {size:.7g})"
        )
    return given / size


def _check_pose(
    shared: PoseShared, i: int, position: np.ndarray, quaternion: np.ndarray, z0: float, path: Path
) -> None:
    robot, where = shared.robot, (jnp.asarray(position), rotations.matrix(jnp.asarray(quaternion)))
    if not plane_normal(robot) @ (where[0] - centroid(robot)) > 0.0:
        raise ConfigError(path, f"pose[{i}].position: must be below the spool plane")
    share = float(conditioning(robot, *where)) / float(shared.conditioning)
    if not abs(share) > SINGULAR:
        raise ConfigError(
            path, f"pose[{i}]: must be another orientation: singular there (relative determinant {share:.1g})"
        )
    near = contacts(robot)
    apart = float(np.linalg.norm(gaps(robot, jnp.asarray(near.pairs), *where), axis=1).min(initial=np.inf))
    if apart < TOUCH * float(np.linalg.norm(np.asarray(robot.platform_points), axis=1).max()):
        raise ConfigError(path, f"pose[{i}]: must be another orientation: two cables touch there")
