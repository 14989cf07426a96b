"""Maps of workspaces: whether a robot of any pattern on any number of cables can hold each pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from cspr_jax.build.orientations import given_quaternion
from cspr_jax.build.robots import build_limits, build_robot
from cspr_jax.build.scenes import build_scene
from cspr_jax.config.keys.workspace import WorkspaceTable
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile, axis_points, cell_widths
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.maps.grid_map import GridMap
from cspr_jax.motion.given_limits import static_limits
from cspr_jax.motion.limits import are_of_motors, search_limits
from cspr_jax.numerics.linear.frames import Frame, frame_of
from cspr_jax.numerics.linear.rotations import from_tilt_torsion, products
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import ContactPair, Scene
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.orientation_grids import cone_grid, equal_volume_grid, planar_grid
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.quantities import TILT_TORSION
from cspr_jax.schema.tiles import Grid
from cspr_jax.workspaces.all_robots import AllRobots, mass_searches
from cspr_jax.workspaces.cells.speeds import CableSpeeds, cable_speeds
from cspr_jax.workspaces.clearances import at_rest
from cspr_jax.workspaces.poses.geometry import mass_centres
from cspr_jax.workspaces.requirements import FEASIBLE, Requirement, check_cables, required_wrenches, requirement
from cspr_jax.workspaces.search import WorkspaceSearch
from cspr_jax.workspaces.search_over_robots import RobotRows
from cspr_jax.workspaces.static_cells import RestCells
from cspr_jax.workspaces.static_poses import FREQUENCY, MARGINS, OrientationSet, RestPoses, over_orientations

INTERFERENCE = "interference-free"
TENSIONS = ("tension_min", "tension_max")
SPEED = "cable_speed_max"
# Default number of parts into which sets of orientations divide pi.
DIVISIONS = 12


class WorkspaceMap(GridMap):
    """The workspace of a robot: of poses, or of positions with sets of orientations; see `GridMap`."""

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Refuse conditions that do not apply to the robot."""
        self._keys, self._file = spec, file
        self._frame, self._z_axis = frame_of(robot_file.base_points, robot_file.z_axis), robot_file.z_axis
        self._workspace = spec.workspace or WorkspaceTable()
        self._refuse_unused()
        limits = build_limits(robot_file, spec.limits, file)
        self._robot = centred(build_robot(robot_file, spec.trajectory, file))[0]
        accelerates, moves = bool(self._workspace.acceleration), bool(self._speed_keys)
        try:
            self._limits = static_limits(self._robot, limits, accelerates=accelerates, moves=moves)
        except InputError as error:
            raise ConfigError(file, str(error)) from error
        self._row = PATTERNS[self._robot.pattern]
        if not self._row.is_body:
            for name in ("orientation", "orientations"):
                if getattr(self._workspace, name) is not None:
                    raise ConfigError(file, f"workspace.{name}: must be absent: {robot_file.kind} has none")
        self._quaternion = self._unit_quaternions([self._workspace.orientation], "workspace.orientation")
        self._samples, self._volume = self._orientation_set()
        try:
            check_cables(self._robot)
        except InputError as error:
            raise ConfigError(file, str(error)) from error
        try:
            names = [name for name in self._workspace.conditions if name != INTERFERENCE]
            searches = {name: WorkspaceSearch(self._robot, self._condition(name, self._robot)) for name in names}
            length, capacity = self._workspace.capacity_length, None
            if length is not None:
                capacity = WorkspaceSearch(self._robot, self._condition(FEASIBLE, self._robot, length))
            all_robots = self._all_robots(robot_file, names)
        except InputError as error:
            raise ConfigError(file, f"workspace.{error}") from error
        around, speeds = self._around(robot_file), self._speeds(robot_file, limits)
        is_centre = self._workspace.point == "mass-centre"
        is_elastic = FREQUENCY in (spec.run.store or ())
        self._poses = RestPoses(self._robot, searches, around, self._limits, speeds, capacity, is_centre, is_elastic)
        self._cells = None
        if self._workspace.prove or all_robots is not None:
            self._cells = RestCells(self._poses, self._quaternion[0], all_robots)

    def _refuse_unused(self) -> None:
        for name in TENSIONS:
            if getattr(self._keys.limits, name) is not None and FEASIBLE not in self._workspace.conditions:
                allowed = f'must be absent: "{FEASIBLE}" is not among workspace.conditions'
                raise ConfigError(self._file, f"limits.{name}: {allowed}")

    def _around(self, robot_file: RobotFile) -> Scene | None:
        if INTERFERENCE not in self._workspace.conditions:
            return None
        return build_scene(self._robot, robot_file, self._frame, self._workspace, self._file, at="workspace.")

    @property
    def _speed_keys(self) -> list[str]:
        return [name for name in ("speed", "angular_speed") if getattr(self._workspace, name) is not None]

    def _speeds(self, robot_file: RobotFile, limits: Limits) -> CableSpeeds | None:
        workspace, speed_keys = self._workspace, self._speed_keys
        if not speed_keys:
            if getattr(self._keys.limits, SPEED) is not None:
                allowed = "must be absent without workspace.speed and workspace.angular_speed: cells are at rest"
                raise ConfigError(self._file, f"limits.cable_speed_max: {allowed}")
            return None
        for name, has in (("speed", not self._row.is_jointed), ("angular_speed", self._row.is_body)):
            if name in speed_keys and not has:
                why = "turns about its joint alone" if self._row.is_jointed else "does not turn"
                raise ConfigError(self._file, f"workspace.{name}: must be absent: {robot_file.kind} {why}")
        searched = search_limits(self._robot, limits)
        if searched.cable_speed_max is None:
            why = "limits.cable_speed_max or motor_speed_max"
            raise ConfigError(self._file, f"workspace.{speed_keys[0]}: must be absent without {why}")
        speed, angular_speed = workspace.speed or 0.0, workspace.angular_speed or 0.0
        maximum, of_motors = np.asarray(searched.cable_speed_max), are_of_motors(limits, searched)
        return cable_speeds(self._robot, maximum, of_motors, speed=speed, angular_speed=angular_speed)

    def _unit_quaternions(self, quaternions: Sequence[list[float] | None], key: str) -> np.ndarray:
        # Quaternions (k, 4) in the kernels' axes.
        units = np.stack([given_quaternion(one, key, self._file) for one in quaternions])
        if self._row.is_planar and units[:, [1, 3]].any():
            raise ConfigError(self._file, f"{key}: must turn about y: that of a planar robot")
        return self._frame.rotated_quaternions(units)

    def _orientation_set(self) -> tuple[np.ndarray | None, np.ndarray]:
        # Orientations (k, 4) of the set, and the fraction of the set that each represents; None without a set.
        workspace = self._workspace
        if workspace.orientations is None:
            return None, np.ones(1)
        if workspace.quaternions is not None:
            quaternions = self._unit_quaternions(workspace.quaternions, "workspace.quaternions")
            return products(quaternions, self._quaternion), np.full(len(quaternions), 1.0 / len(quaternions))
        divisions = workspace.divisions or DIVISIONS
        tilt = math.pi if workspace.tilt_max is None else workspace.tilt_max
        if self._row.is_planar:
            if workspace.torsion_max is not None:
                raise ConfigError(self._file, "workspace.torsion_max: must be absent for a planar robot")
            angles, volume = planar_grid(divisions, tilt)
        elif workspace.tilt_max is None:
            grid = equal_volume_grid(divisions)
            angles, volume = grid.angles, grid.volume
        else:
            angles, volume = cone_grid(divisions, tilt, workspace.torsion_max or 0.0)
        return products(self._frame.rotated_quaternions(from_tilt_torsion(angles)), self._quaternion), volume

    def _all_robots(self, robot_file: RobotFile, conditions: Sequence[str]) -> AllRobots | None:
        # All robots within the uncertainty; None without an uncertainty.
        uncertainty, workspace = self._limits.uncertainty, self._workspace
        if uncertainty is None:
            return None
        if self._samples is not None:
            allowed = "cannot be combined with workspace.orientations: one sweep for each workspace.orientation"
            raise ConfigError(self._file, f"limits.uncertainty: {allowed}")
        is_in_pairs = robot_file.translation_only or robot_file.pairs is not None
        if uncertainty.spool_positions and (is_in_pairs or self._robot.pulleys is not None):
            allowed = "must be 0 on pairs of cables and with pulleys; mass_factor and mass_centre are known there"
            raise ConfigError(self._file, f"limits.uncertainty.spool_positions: {allowed}")
        if not self._row.is_body and uncertainty.mass_centre:
            allowed = "must be absent: a point mass has no other one"
            raise ConfigError(self._file, f"limits.uncertainty.mass_centre: {allowed}")
        searches = {}
        for name in conditions:
            is_given = name == FEASIBLE and workspace.wrenches is not None
            acceleration = (workspace.acceleration or 0.0) if name == FEASIBLE else 0.0
            ask = partial(self._condition, name)
            searches[name] = mass_searches(
                self._robot, uncertainty, ask, has_weight=not is_given, acceleration=acceleration
            )
        return AllRobots(float(uncertainty.spool_positions), searches)

    def sample(self) -> tuple[AnyRobot, Frame, dict[str, Requirement]]:
        """Robot, axes, and requirements of the conditions on the cables."""
        return self._robot, self._frame, {name: search.requirement for name, search in self._poses.searches.items()}

    def _condition(self, name: str, robot: AnyRobot, capacity_length: float | None = None) -> Requirement:
        # Requirement of a condition on a robot.
        loads = None
        if name == FEASIBLE:
            workspace = self._workspace
            loads = required_wrenches(
                robot,
                self._frame,
                points=workspace.wrenches,
                box=workspace.wrench_box,
                ellipsoid=workspace.wrench_ellipsoid,
                acceleration=workspace.acceleration,
            )
        return requirement(robot, name, self._limits, loads, capacity_length)

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        answers = self.with_orientations(cells)
        del answers["inside"]
        return answers

    @property
    def first_margin(self) -> str:
        """The margin that tells which cable's loss is the worst."""
        return self._poses.first_margin

    def fraction(self, inside: Bool[np.ndarray, "n k"]) -> Float[np.ndarray, "n"]:
        """Part of the set of orientations, by volume, that is inside at each position."""
        return inside @ self._volume

    def with_orientations(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers, and in "inside" (n, k) which orientations of the set, or the one orientation, each cell has."""
        if self._samples is not None:
            positions = self._targets(cells)
            kind: OrientationSet = "total" if self._workspace.orientations in ("total", "dextrous") else "inclusion"
            set_answers = over_orientations(self._poses, positions, self._samples, self._volume, kind)
            return set_answers | dict.fromkeys(("cell_side", "cell_open"), np.zeros(len(positions), np.int16))
        positions, quaternions = self._poses_of(cells)
        answers = self._poses(positions, quaternions, self._robots_of(cells))
        sides, reasons = np.zeros((2, len(positions)), np.int16)
        if self._cells is not None:
            answers["verdict"] = self._cells.verdicts(positions, answers["verdict"])
            if self._workspace.prove:
                sides, reasons = self._cells(positions, self._half_sizes(cells))
        inside = answers["verdict"] == 0
        answers |= {"inside": inside[:, None], "orientation_fraction": inside.astype(float)}
        return answers | {"cell_side": sides, "cell_open": reasons}

    def _robots_of(self, cells: dict[str, np.ndarray]) -> RobotRows | None:
        # Robots of the cells, where the map has several.
        return None

    def _poses_of(self, cells: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        # Positions and quaternions of the cells of a map of poses.
        positions = self._targets(cells)
        quaternions = np.repeat(self._quaternion, len(positions), axis=0)
        if any(name in cells for name in TILT_TORSION):
            angles = np.stack([cells.get(name, np.zeros(len(positions))) for name in TILT_TORSION], axis=1)
            if self._row.is_planar:
                angles[:, 0] = 0.5 * math.pi
            quaternions = products(self._frame.rotated_quaternions(from_tilt_torsion(angles)), quaternions)
        return positions, quaternions

    def at_rest(self, cells: dict[str, np.ndarray]) -> tuple[AnyRobot, Limits, np.ndarray, np.ndarray]:
        """Robot, limits, positions of the mass centre and quaternions of the cells of a map of poses."""
        if self._samples is not None:
            raise ConfigError(self._file, "workspace.orientations must be absent: each cell must be one pose")
        positions, quaternions = self._poses_of(cells)
        origins = self._poses.origins(positions, quaternions)
        return self._robot, self._limits, mass_centres(self._robot, origins, quaternions), quaternions

    def nearest(self, cells: dict[str, np.ndarray]) -> ContactPair | None:
        """The two bodies that are nearest to each other at the first cell; None where contacts do not count."""
        around = self._poses.around
        if around is None:
            return None
        robot, _, centres, quaternions = self.at_rest(cells)
        nearest = int(at_rest(robot, around, centres[:1], quaternions[:1]).nearest[0])
        return around.contact_pairs[nearest] if nearest < len(around.contact_pairs) else None

    def _half_sizes(self, cells: dict[str, np.ndarray]) -> np.ndarray:
        # Half of the extents (n, 3) of the cells: half of the distance to the farther neighbour along each axis.
        half_sizes = []
        for name in "xyz":
            points = np.sort(axis_points(getattr(self._keys.axes, name)))
            half_sizes.append(0.5 * cell_widths(points)[np.searchsorted(points, cells[name])])
        return np.stack(half_sizes, axis=1)

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse axes of orientations that do not fit the robot or the keys; see `GridMap.refuse_hopeless`."""
        row = self._row
        turning = [name for name in TILT_TORSION if name in grid.axes]
        if turning and not row.is_body:
            raise ConfigError(self._file, f"axes.{turning[0]}: must be absent: a point mass has no orientation")
        if turning and self._samples is not None:
            raise ConfigError(self._file, f"axes.{turning[0]}: cannot be combined with workspace.orientations")
        if self._limits.uncertainty is not None and turning:
            allowed = "cannot be combined with limits.uncertainty: one sweep for each workspace.orientation"
            raise ConfigError(self._file, f"axes.{turning[0]}: {allowed}")
        if self._workspace.prove and (turning or "radius" in grid.axes):
            name = turning[0] if turning else "radius"
            raise ConfigError(self._file, f"axes.{name}: cannot be combined with workspace.prove")
        if row.is_planar and turning not in ([], ["tilt"]):
            raise ConfigError(self._file, f"axes.{turning[0]}: must be tilt alone for a planar robot, about y")

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        inside = answers["verdict"] == 0
        side = answers["cell_side"]
        allowances = self._poses.allowances
        claims = {
            f"a cell inside with a {name} below zero": inside & (answers[name] < -allowances.get(name, 0.0))
            for name in MARGINS
        }
        return claims | {"a cell proved to be on the other side": (side == 1) & ~inside | (side == 2) & inside}
