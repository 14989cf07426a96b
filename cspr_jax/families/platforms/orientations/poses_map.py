"""Maps of smallest numbers of arcs of platforms to poses."""

from functools import partial
from typing import Any

import numpy as np

from cspr_jax.build.orientations import given_quaternion, orientations
from cspr_jax.build.problems import motion_kind
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.platforms.answers import PlatformMotionAnswers
from cspr_jax.families.platforms.arcs import Candidates, segments_with
from cspr_jax.families.platforms.checkers import pose_checker
from cspr_jax.families.platforms.end_acceleration import AT_REST
from cspr_jax.families.platforms.motion_checker import MANY
from cspr_jax.families.platforms.platform_segment import PlatformMotion, batch_bounds
from cspr_jax.families.platforms.pose_targets import Poses, pose_arcs, rest_poses, start_beta_hat
from cspr_jax.maps.grid_map import PlatformMap
from cspr_jax.motion.limits import has_motor_limits
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots.statics.reference_pose import reference_pose
from cspr_jax.schema.quantities import TILT_TORSION
from cspr_jax.schema.tiles import Grid


class PosesMap(PlatformMap):
    """The smallest number of arcs to each pose; see `GridMap`."""

    proves = True
    any_cables = True
    motors = True

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Refuse a start whose quaternion is no orientation."""
        super().__init__(robot_file, spec, file)
        start = spec.trajectory.start
        self._quaternion = given_quaternion(
            None if start is None else start.quaternion, "trajectory.from.quaternion", file
        )
        from_rest = start is None or start.rest
        self._scene = self._scene_or_none(robot_file)
        self._is_verified = self._scene is not None or has_motor_limits(self._problem.limits)
        plain = self._problem
        if self._is_verified:
            from cspr_jax.verification.verifier import of_family  # maps without these need no general proof

            plain = of_family(plain)
        self._checker = pose_checker(plain, motion_kind(spec.trajectory, from_rest=from_rest), batch=MANY)

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        z0, targets = np.asarray(cells["z0"], float), self._targets(cells)
        angles = np.stack([cells.get(name, np.zeros(len(z0))) for name in TILT_TORSION], axis=1)
        starts, beta_hats = self._starts(z0)
        ends = (targets, orientations(self._frame, targets, angles))
        cell = np.arange(len(z0))
        motions = Candidates(starts, ends, z0, cell, (beta_hats, beta_hats))
        columns = self._clear(motions) if self._is_verified else self._answers(motions).arrays()
        return columns | {"beta_hat": columns["beta_hat"][:, 1]}

    def _answers(self, motions: Candidates, arcs: np.ndarray | None = None) -> PlatformMotionAnswers:
        trajectory = self._keys.trajectory
        how: dict[str, Any] = {name: getattr(trajectory, name) for name in ("beta_hat", "beat", "max_arcs")}
        return pose_arcs(self._checker, motions, fixed=arcs, **how)

    def _clear(self, motions: Candidates) -> dict[str, np.ndarray]:
        # Return the columns of motions with obstacles or winches, which are proved as those of a plan are. Import here:
        # maps without these need no general proof.
        from cspr_jax.verification.bounds.batch import MotionBatch
        from cspr_jax.verification.verifier import Verifier

        kind = self._checker.kind._replace(from_rest=False)

        def join(rows: np.ndarray, arcs: np.ndarray) -> tuple[PlatformMotionAnswers, MotionBatch]:
            cases = motions.motions(rows)
            answers = self._answers(cases, arcs)
            chosen = cases._replace(beta_hats=(answers.beta_hat[:, 0], answers.beta_hat[:, 1]))
            segments = segments_with(self._problem.robot, chosen, answers.tried_arcs)
            each = PlatformMotion(segments, self._problem.amplitude, as_float64(answers.tried_arcs), kind)
            return answers, MotionBatch(each, answers.duration, partial(batch_bounds, kind=kind), orders=4)

        verifier = Verifier(self._problem, self._scene, intervals=False, are_plans=True)
        return verifier.columns(join, len(motions.z0), max_arcs=self._keys.trajectory.max_arcs)

    def _starts(self, z0: np.ndarray) -> tuple[Poses, np.ndarray]:
        # Return the poses at the starts, and the values of beta-hat at them.
        start, count = self._keys.trajectory.start, len(z0)
        if start is None or start.position is None:
            return rest_poses(z0), np.full(count, AT_REST)
        position = np.tile(self._frame.inward(start.position), (count, 1))
        rotated = np.tile(self._frame.rotated_quaternions(self._quaternion), (count, 1))
        if start.tilt_torsion is not None:
            rotated = orientations(self._frame, position, np.tile(start.tilt_torsion, (count, 1)))
        beta_hat = start.beta_hat
        beta_hats = (
            start_beta_hat(self._checker, (position, rotated), z0) if beta_hat is None else np.full(count, beta_hat)
        )
        return (position, rotated), beta_hats

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse targets that are all out of reach, and a robot that cannot rest; see `GridMap.refuse_hopeless`."""
        if self._is_redundant:  # the side of the spools and a singular reference do not matter
            return
        super().refuse_hopeless(grid)
        errors = []
        for z0 in grid.axes["z0"]:
            try:
                reference_pose(self._problem.robot, float(z0))
            except InputError as error:
                errors.append(error)
        if len(errors) == len(grid.axes["z0"]):
            raise ConfigError(self._file, f"robot.{errors[0]}") from errors[0]
