"""Maps of workspaces: whether a robot of any pattern on any number of cables can hold each place."""

import numpy as np
from jax import Array

from cspr_jax.arithmetic.frames import frame_of
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.config.workspace import WorkspaceTable
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.maps.grid_map import GridMap
from cspr_jax.problem import build_limits, build_robot, centred, given_quaternion
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.tiles import Grid
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.search.workspace_clearances import apart
from cspr_jax.search.workspace_questions import CLOSURE, FEASIBLE, question, required_wrenches
from cspr_jax.search.workspaces import WorkspaceSearch, mass_centres

INTERFERENCE = "interference-free"
# Limits of poses at rest: others belong to motions.
TENSIONS = ("tension_min", "tension_max")
HELD = (*TENSIONS, "floor")


class WorkspaceMap(GridMap):
    """The workspace of a robot, at one orientation; see `GridMap`."""

    def __init__(self, spec: RobotFile, keys: SweepFile, file: object) -> None:
        """Refuse what the robot cannot be asked."""
        self._keys, self._file = keys, file
        self._frame, self._z_axis = frame_of(spec.base_points, spec.z_axis), spec.z_axis
        self._asked = keys.workspace or WorkspaceTable()
        for limit in LIMITS:
            if getattr(keys.limits, limit.name) is None:
                continue
            if limit.name not in HELD:
                raise ConfigError(file, f"limits.{limit.name}: must be absent in this map, whose cells are at rest")
            if limit.name in TENSIONS and FEASIBLE not in self._asked.conditions:
                allowed = f'must be absent: "{FEASIBLE}" is not among workspace.conditions'
                raise ConfigError(file, f"limits.{limit.name}: {allowed}")
        self._limits = build_limits(spec, keys.limits, file)
        self._robot = centred(build_robot(spec, keys.trajectory, file))[0]
        row = PATTERNS[self._robot.pattern]
        if self._asked.orientation is not None and not row.is_body:
            raise ConfigError(file, f"workspace.orientation: must be absent: {spec.kind} has none")
        given = given_quaternion(self._asked.orientation, "workspace.orientation", file)
        if row.is_planar and given[[1, 3]].any():
            raise ConfigError(file, "workspace.orientation: must turn about y: that of a planar robot")
        self._turn = self._frame.turned_quaternions(given[None])[0]
        try:
            names = [name for name in self._asked.conditions if name != INTERFERENCE]
            self._searches = {name: self._search(name) for name in names}
        except InputError as error:
            raise ConfigError(file, f"workspace.{error}") from error

    def _search(self, name: str) -> WorkspaceSearch:
        loads = None
        if name == FEASIBLE:
            asked = self._asked
            given = {"points": asked.wrenches, "box": asked.wrench_box, "ellipsoid": asked.wrench_ellipsoid}
            loads = required_wrenches(self._robot, self._frame, **given, acceleration=asked.acceleration)
        return WorkspaceSearch(self._robot, question(self._robot, name, self._limits, loads))

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        places = mass_centres(self._robot, self._targets(cells), self._turn[None])
        turns = np.tile(self._turn, (len(places), 1))
        verdict = np.zeros(len(places), np.uint16)
        found = {name: np.full(len(places), np.nan) for name in ("wrench_margin", "closure_margin", "clearance")}
        for condition, asked in self._searches.items():
            answers = asked(places, turns)
            verdict |= answers.verdict
            name = "closure_margin" if condition == CLOSURE else "wrench_margin"
            found[name] = np.fmin(found[name], answers.margin)
        if INTERFERENCE in self._asked.conditions:
            found["clearance"], flags = apart(self._robot, places, turns)
            verdict |= flags
        floor: Array | None = self._limits.floor
        if floor is not None:
            verdict |= np.where(places[:, 2] > float(floor), Verdict.BELOW_FLOOR, 0).astype(np.uint16)
        return {"verdict": verdict, **found}

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse places out of a planar robot's plane; see `GridMap.refuse_hopeless`."""
        row = PATTERNS[self._robot.pattern]
        if row.is_planar and ("y" not in grid.axes or (grid.axes["y"] != 0.0).any()):
            raise ConfigError(self._file, "axes.y: must be [0] for a planar robot")

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        inside = answers["verdict"] == 0
        margins = ("wrench_margin", "closure_margin", "clearance")
        return {f"a cell inside with a {name} below zero": inside & (answers[name] < 0.0) for name in margins}
