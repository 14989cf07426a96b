"""Leg of paths: poses joined by the fastest motion along lines, splines, arcs and files of points or G-code."""

import dataclasses
import itertools
from typing import NamedTuple

import numpy as np

from cspr_jax.build.orientations import pose_quaternions
from cspr_jax.build.robots import build_robot
from cspr_jax.build.scenes import scene_of_leg
from cspr_jax.config.keys.path import GRID, RAMP_TIME, PathTable
from cspr_jax.curves.files import kept_to, placed_inward, reference_of
from cspr_jax.curves.spline import Spline, chained, part
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.paths.answers import PathAnswers, SectionAnswer, feeds_of
from cspr_jax.families.paths.fastest_lines import FastestLines
from cspr_jax.families.paths.geometry.path_specs import FileAxes, PathEnds, PathSpec, path_of, path_through
from cspr_jax.families.paths.geometry.section import Section, SectionSettings
from cspr_jax.families.paths.least_time.least_time import TOGETHER, LeastTime, least_times_along
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.leg import Leg
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.linear.rotations import CONJUGATE
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.runtime.stages import amount, stage
from cspr_jax.verification.proved_answers import proved_answers

# Directions of a motion that continues through a pose may differ by this much.
SAME_DIRECTION = 1e-6
# Up to this many sections are solved one by one, more of them together.
FEW = 16
# Largest number of cells in the grids of all sections, as proofs handle no more blocks.
MOST_CELLS = 100_000
# Numbers of cells above this are announced before the work starts.
MANY_CELLS = 10_000


class PathRun(NamedTuple):
    """Consecutive poses that one path joins.

    Fields:
        first: index of the first pose within the leg.
        last: index of the last pose within the leg.
        table: table of the path that joins them.
    """

    first: int
    last: int
    table: PathTable


class Ride(NamedTuple):
    """Section of a path, with settings of its motion.

    Fields:
        section: section in the axes of the kernels.
        settings: settings of the motion along it.
        segments: (k - 1,) indices of the segments between its k knots.
    """

    section: Section
    settings: SectionSettings
    segments: np.ndarray


class Paths(Leg):
    """Poses joined along paths in the least time; see `Leg`."""

    def __init__(self, waypoints: Waypoints) -> None:
        """Refuse keys of other families, and values that both a path and its poses give."""
        super().__init__(waypoints)
        self._notes: list[str] = []
        self._refuse("arcs", "beta_hat")
        for i, pose in enumerate(waypoints.poses):
            if i and pose.path is not None and not waypoints.plan_file.is_one_path:
                self._check_path(i, pose.path)

    @classmethod
    def for_searches(cls, waypoints: Waypoints) -> Leg:
        """Leg of straight lines between poses, for searches; paths of the plan are ignored; see `Leg.for_searches`."""
        return FastestLines(waypoints)

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses; see `Leg.join`."""
        waypoints = self.waypoints
        scene = scene_of_leg(problem.robot, waypoints)
        parts: list[list[Spline]] = [[] for _ in range(len(self))]
        through = np.empty(len(self), object)
        through[:] = [[] for _ in range(len(self))]
        rides = self._rides(problem, z0)
        sections, settings = [ride.section for ride in rides], [ride.settings for ride in rides]
        along = least_times_along(problem, sections, settings, TOGETHER if len(rides) > FEW else 1)
        for ride, fastest in zip(rides, along, strict=True):
            for segment, motion in cut(fastest, ride):
                parts[segment].append(motion)
            section = section_answer(fastest, ride, waypoints.first)
            for segment in range(section.ends[0], section.ends[1] + 1):
                through[segment].append(section)
        motions = [chained(splines) for splines in parts]
        feeds = [feeds_of(sections, segment) for segment, sections in enumerate(through)]
        stage("proof of all sections")
        answers = proved_answers(problem, motions, scene, feeds)
        columns = {field.name: getattr(answers, field.name) for field in dataclasses.fields(answers)}
        paths = PathAnswers(**columns, sections=through)
        self._notes = [*self._notes, *paths.notes()]
        return paths, list(motions)

    def warnings(self, problem: Problem) -> list[str]:
        """Notes about files, and warnings of ramps shorter than requested; see `Leg.warnings`."""
        return self._notes

    def _rides(self, problem: Problem, z0: float) -> list[Ride]:
        # Return sections of all paths, in the axes of the kernels, and notes about their files.
        waypoints, rides = self.waypoints, list[Ride]()
        self._notes, cells = [], 0
        positions = np.array(waypoints.frame.outward(waypoints.points(z0)))
        units = None
        if isinstance(problem.robot, PlatformRobot):
            units = waypoints.frame.rotated_quaternions(pose_quaternions(waypoints, waypoints.points(z0)))
        for run in self._runs:
            try:
                spec = self._path_spec(run, positions, units)
                cells += _cells(spec, GRID if run.table.grid is None else run.table.grid)
                sections = [self._placed(section, spec) for section in spec.sections()]
            except InputError as error:
                raise ConfigError(waypoints.path, f"{self._key(run)}.{error}") from error
            self._notes += spec.notes
            positions[run.last] = spec.parts[-1].position[-1]
            if units is not None:
                units[run.last] = spec.quaternions[-1][-1]
            count = sum(len(section.knots) - 1 for section in sections)
            segments = np.full(count, run.first) if run.table.is_whole else np.arange(run.first, run.last)
            rides += _settled(run, sections, segments)
        self._check_going_on(rides)
        if cells > MANY_CELLS:
            amount(f"{_parts(len(rides))} with {cells:,} cells of their grids: their least times and proofs begin")
        return rides

    @property
    def _runs(self) -> list[PathRun]:
        # A path ends at a pose that rests, that has a path of its own, or whose next pose has one.
        poses, spec, first, runs = self.waypoints.poses, self.waypoints.plan_file, 0, list[PathRun]()
        usual = PathTable() if spec.path is None or spec.is_one_path else spec.path
        for i, pose in enumerate(poses[1:], start=1):
            following = poses[i + 1] if i < len(self) else None
            ends = following is None or following.path is not None or pose.rest
            if pose.path is not None:
                runs.append(PathRun(i - 1, i, pose.path.beside(spec.path)))
            elif ends:
                # Speeds are given only at the ends of the leg.
                inner = ["start_speed"] * (first > 0) + ["end_speed"] * (i < len(self))
                runs.append(PathRun(first, i, usual.model_copy(update=dict.fromkeys(inner))))
            if pose.path is not None or ends:
                first = i
        return runs

    def _key(self, run: PathRun) -> str:
        return (
            "path"
            if self.waypoints.poses[run.last].path is None or self.waypoints.plan_file.is_one_path
            else (f"{self.waypoints.name(run.last)}.path")
        )

    def _path_spec(self, run: PathRun, positions: np.ndarray, units: np.ndarray | None) -> PathSpec:
        # Return the path that joins the poses of a run, in the axes of the robot file.
        waypoints, table = self.waypoints, run.table
        if not table.is_whole:
            chosen = slice(run.first, run.last + 1)
            return path_through(table, positions[chosen], None if units is None else units[chosen])
        robot_file = waypoints.robot_file
        if table.orientations is not None and units is None:
            raise InputError("orientations", None, "must be absent for a point mass", problem="given")
        has_start = not waypoints.plan_file.is_one_path and not (
            run.first == 0 and table.has_start and waypoints.poses[0].position is None and not waypoints.poses[0].rest
        )
        ends = PathEnds(
            positions[run.first] if has_start else None,
            None if waypoints.plan_file.is_one_path or table.has_end else positions[run.last],
            *(() if units is None else (units[run.first], units[run.last])),
        )
        if has_start and table.start is not None:
            raise InputError("start", table.start, f"absent: the path begins at {waypoints.name(run.first)}")
        turning = np.array(IDENTITY)
        if table.kind == "csv" and units is not None:
            reference = reference_of(build_robot(robot_file, waypoints.plan_file, waypoints.path))
            turning = waypoints.frame.rotated_quaternions(reference * CONJUGATE)
        axes = FileAxes(robot_file.z_axis, np.eye(3)[1 if robot_file.is_planar else 2], turning)
        return path_of(table, ends, waypoints.path.parent, axes)

    def _placed(self, section: Section, spec: PathSpec) -> Section:
        # Convert the section to the axes of the kernels, and to the plane or the guide of the robot.
        curve = kept_to(self.waypoints.robot_file.own_pattern, section.curve, is_planar=spec.is_planar)
        return section._replace(curve=placed_inward(curve, self.waypoints.frame, np.array(IDENTITY)))

    def _check_path(self, i: int, table: PathTable) -> None:
        waypoints, pose, name = self.waypoints, self.waypoints.poses[i], self.waypoints.name(i)
        has_orientation = pose.quaternion is not None or pose.tilt_torsion is not None
        if table.has_end and (pose.position is not None or pose.rest):
            key = "rest" if pose.position is None else "position"
            raise ConfigError(waypoints.path, f"{name}.{key}: must be absent: {name}.path decides where it ends")
        if table.kind == "gcode" and has_orientation:
            raise ConfigError(waypoints.path, f"{name}: must have no orientation: that of the pose before stays")
        if table.orientations is not None and table.points is None:
            raise ConfigError(waypoints.path, f"{name}.path.orientations: must be absent: the poses have them")

    def _check_going_on(self, rides: list[Ride]) -> None:
        # Refuse a motion that passes a pose with a jump of speed or direction.
        for before, after in itertools.pairwise(rides):
            one, other = before.settings.end_speed, after.settings.start_speed
            name = f"{self.waypoints.name(int(after.segments[0]))}"
            if one != other:
                raise ConfigError(
                    self.waypoints.path,
                    f"path.start_speed = {other:g} at {name}: must be {one:g}, the end_speed before it",
                )
            directions = [_direction(before.section.curve, -1), _direction(after.section.curve, 0)]
            if one and np.abs(directions[1] - directions[0]).max() > SAME_DIRECTION:
                raise ConfigError(
                    self.waypoints.path, f"path.end_speed = {one:g} at {name}: must be 0: the direction changes there"
                )


def _parts(count: int) -> str:
    return f"{count:,} {'part' if count == 1 else 'parts'} between stops"


def _cells(spec: PathSpec, grid: int) -> int:
    # Count the cells of the grids of a path. Refuse more than a proof can handle, before the work takes hours.
    cells = sum(max(grid, len(path.s) - 1) for path in spec.parts)
    if cells > MOST_CELLS:
        error = f"{_parts(len(spec.parts))}: {cells:,} cells"
        allowed = f'must be {MOST_CELLS:,} at most: blend corners (corner = "blend"), a smaller grid, or several plans'
        raise InputError("grid", None, allowed, problem=error)
    return cells


def _direction(curve: Spline, piece: int) -> np.ndarray:
    # Return the unit vector of the direction at the start of the first piece, or at the end of the last one.
    step = np.diff(np.asarray(curve.position)[piece], axis=0)[piece]
    return step / (np.linalg.norm(step) or 1.0)


def _settled(run: PathRun, sections: list[Section], segments: np.ndarray) -> list[Ride]:
    # Return the sections of a path with their settings; the motion is at rest between them.
    table, rides, first = run.table, list[Ride](), 0
    grid = GRID if table.grid is None else table.grid
    ramp_time = RAMP_TIME if table.ramp_time is None else table.ramp_time
    for i, section in enumerate(sections):
        start = (table.start_speed or 0.0) * (i == 0)
        end = (table.end_speed or 0.0) * (i == len(sections) - 1)
        last = first + len(section.knots) - 1
        rides.append(Ride(section, SectionSettings(grid, ramp_time, start, end), segments[first:last]))
        first = last
    return rides


def section_answer(fastest: LeastTime, ride: Ride, before: int = 0) -> SectionAnswer:
    """Motion along a section, with the segments that its cells belong to."""
    middles = 0.5 * (fastest.coordinate[1:] + fastest.coordinate[:-1])
    parts = np.clip(np.searchsorted(ride.section.knots, middles) - 1, 0, len(ride.segments) - 1)
    return SectionAnswer(fastest, ride.segments[parts], ride.settings.ramp_time, before)


def cut(fastest: LeastTime, ride: Ride) -> list[tuple[int, Spline]]:
    """Parts of a motion along a section, cut at poses, with the indices of their segments."""
    changes = np.flatnonzero(np.diff(ride.segments)) + 1
    knots = [0.0, *ride.section.knots[changes].tolist(), float(ride.section.knots[-1])]
    indices = [int(np.argmin(np.abs(fastest.coordinate - knot))) for knot in knots]
    numbers = ride.segments[[0, *changes.tolist()]].tolist()
    return [
        (number, part(fastest.motion, *pair)) for number, pair in zip(numbers, itertools.pairwise(indices), strict=True)
    ]
