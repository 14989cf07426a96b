"""Leg of the fastest lines between poses, straight or deflected, from which searches of other families begin."""

import numpy as np

from cspr_jax.build.orientations import pose_quaternions
from cspr_jax.build.scenes import scene_of
from cspr_jax.config.keys.path import GRID, MAP_GRID, SAME_PLACE, PathTable
from cspr_jax.curves.files import kept_to, placed_inward
from cspr_jax.curves.interpolation import continuous
from cspr_jax.families.paths.batch import least_times
from cspr_jax.families.paths.geometry.path_specs import path_through
from cspr_jax.families.paths.geometry.section import Section, SectionSettings
from cspr_jax.families.paths.least_time.discrete import discretes
from cspr_jax.families.paths.least_time.jumping import jumping_motions
from cspr_jax.families.paths.least_time.timed import cell_times
from cspr_jax.motion.answers import Answers, replaced
from cspr_jax.motion.leg import Leg
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem, search_problem
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.proved_answers import proved_answers

DEFLECTION = 0.1  # deflection of lines, over their length
RAMP_TIME = 0.05  # s; accelerations ramp in this time if poses prescribe them, else they jump


class FastestLines(Leg):
    """Poses joined by the fastest lines that are proved: straight, or deflected to all sides; see `Leg`."""

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses; see `Leg.join`."""
        frame, spec = self.waypoints.frame, self.waypoints.plan_file
        scene = scene_of(problem.robot, self.waypoints.robot_file, frame, spec, self.waypoints.path, trajectory=spec)
        positions, units = np.array(frame.outward(self.waypoints.points(z0))), None
        if isinstance(problem.robot, PlatformRobot):
            units = continuous(frame.rotated_quaternions(pose_quaternions(self.waypoints, self.waypoints.points(z0))))
        lines = [
            self._lines(positions[i : i + 2], None if units is None else units[i : i + 2]) for i in range(len(self))
        ]
        asks = spec.end_accelerations not in (None, "free") or any(pose.rest for pose in self.waypoints.poses)
        ramp_time = RAMP_TIME if asks else 0.0
        left = [_in_order(problem, candidates) for candidates in lines]
        first = [candidates[0].curve for candidates in lines]
        answers, motions = proved_answers(problem, first, scene), list[Motion](first)
        answers.verdict[:] = Verdict.UNDECIDED  # replaced where a line is found
        while unproved := [k for k, candidates in enumerate(left) if candidates and answers.verdict[k]]:
            times = least_times(problem, scene, [[left[k].pop(0)] for k in unproved], GRID, ramp_time)
            answers = replaced(answers, np.array(unproved), times.answers, np.arange(len(unproved)))
            for k, motion in zip(unproved, times.motions, strict=True):
                motions[k] = motion
        return answers, motions

    def _lines(self, ends: np.ndarray, units: np.ndarray | None) -> list[Section]:
        # Return sections in the axes of the kernels, first the straight one, then deflected ones, from positions (2, 3)
        # in the axes of the robot file.
        straight = path_through(PathTable(kind="line"), ends, units).sections()
        turning = None
        if units is not None:
            turning = np.stack([units[0], units.sum(0) / np.linalg.norm(units.sum(0)), units[1]])
        curves = [
            path_through(PathTable(kind="quintic"), np.stack([ends[0], point, ends[1]]), turning).sections()
            for point in _beside(ends, len(PATTERNS[self.waypoints.robot_file.own_pattern].forces))
        ]
        return [self._placed(section) for section in (*straight, *(section for one in curves for section in one))]

    def _placed(self, section: Section) -> Section:
        curve = kept_to(self.waypoints.robot_file.own_pattern, section.curve, is_planar=False)
        return section._replace(curve=placed_inward(curve, self.waypoints.frame, np.array(IDENTITY)))


def _in_order(problem: Problem, lines: list[Section]) -> list[Section]:
    # Return the lines along which a motion runs on a grid, the fastest first.
    paths = discretes(search_problem(problem), lines, [SectionSettings(MAP_GRID, 0.0)] * len(lines))
    runs = [motion.run for motion in jumping_motions(paths)]
    times = [
        np.inf if run is None else cell_times(run, path.grid.width).sum() for run, path in zip(runs, paths, strict=True)
    ]
    return [lines[k] for k in np.argsort(times, kind="stable").tolist() if np.isfinite(times[k])]


def _beside(ends: np.ndarray, dimensions: int) -> list[np.ndarray]:
    # Return points (3,) on both sides of the middle of a line with these ends (2, 3): in its vertical plane and across.
    along, middle = ends[1] - ends[0], ends.mean(0)
    length = float(np.linalg.norm(along))
    if length <= SAME_PLACE:
        return []
    level = np.array([-along[1], along[0], 0.0]) if np.hypot(*along[:2]) > SAME_PLACE else np.array([0.0, 1.0, 0.0])
    level /= np.linalg.norm(level)
    across = [np.cross(level, along) / length, level][: dimensions - 1]
    return [middle + sign * DEFLECTION * length * side for side in across for sign in (1.0, -1.0)]
