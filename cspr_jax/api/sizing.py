"""Sizes of motors from Python, as by `cspr size`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import jax
import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.checks import Check
from cspr_jax.api.files.pictured import Pictured
from cspr_jax.api.plans import Plan, plan
from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.missing_cables import ANY_ONE
from cspr_jax.config.reading import checked as checked_keys
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.config.sweep import SweepFile, sweep_spec
from cspr_jax.errors import ConfigError
from cspr_jax.errors.arguments import Kind, Positive
from cspr_jax.machine.sizing import MotionDemands, holding_demands, joint_cycle, motor_demands, winding_curves
from cspr_jax.motion.motion import Motion
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs.machine.sizing_report import WITH_FACTOR, size_object, size_table, worst
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.quantities import is_of_robot
from cspr_jax.workspaces.map import WorkspaceMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cspr_jax.store.reading.result import Result

FACTOR = 1.5
PlansOrResults = Annotated[
    str | Path | Mapping[str, Any] | Plan | Check | Sequence[Any],
    Kind(
        "a plan, a check, a workspace, the file of one, or several",
        (str, Path, Mapping, Sequence, Plan, Check),
        ("axes",),
    ),
]
# Limits that tables and pictures show beside the demands.
SHOWN = ("motor_torque_max", "motor_speed_max", "motor_power_max", "motor_torque_rms_max")


@dataclasses.dataclass(frozen=True)
class Sizes(Pictured):
    """Peaks of the motors of a robot along motions, and the smallest motors that reach them.

    Fields:
        robot: name of the robot.
        factor: safety factor on torque, speed, power and root mean square of the torque.
        each: demands of each plan or workspace, by name.
        joint: largest demands of all of them; root mean squares and energies over all of them in turn.
        limits: (n,) limits and line of the motors where the robot has them, by name; "line" is (2, n): stall torque and
            no-load speed.
        curves: winding speeds and torques along each plan, "speed" (k, n) rad/s and "torque" (k, n) N m, by name.
    """

    robot: str
    factor: float
    each: dict[str, MotionDemands]
    joint: MotionDemands
    limits: dict[str, np.ndarray]
    curves: dict[str, dict[str, np.ndarray]]

    def to_dict(self) -> dict[str, Any]:
        """The sizes as plain values, for JSON.

        Returns:
            what `cspr size --json` prints.
        """
        return size_object(self.robot, self.factor, self.each, self.joint, self.limits)

    def to_table(self) -> Any:
        """The sizes as the table that `cspr size` prints.

        Returns:
            a table of the package rich.
        """
        return size_table(self.to_dict())

    @property
    def required(self) -> dict[str, np.ndarray]:
        """Smallest motors that do it, with the safety factor: (n,) by the names of the fields of the demands."""
        return {name: self.factor * worst(self.each.values(), name) for name in WITH_FACTOR}

    def _figure(self) -> Figure:
        from cspr_jax.outputs.plots.machine.torque_speed import torque_speed_figure  # loads matplotlib

        return torque_speed_figure(self.robot, self.curves, self.required, self.factor, self.limits)


@checked()
def size(given: PlansOrResults, *, factor: Positive = FACTOR) -> Sizes:
    """Find the smallest motors that do plans, or hold a robot at rest all over a workspace.

    Torques at standstill are the worse of both directions of friction. Plans need not be feasible.

    Args:
        given: a plan, its file or dictionary, a check, or a finished map of a workspace, whose poses at rest inside
            are held; or several of one robot.
        factor: safety factor on torque, speed, power and root mean square of the torque.

    Returns:
        the demands on each motor: largest torque, speed, power and braking power, root mean square of the torque over
        the cycle (1e-6), energy given and energy taken back.

    Raises:
        ConfigError: a robot without winches, other robots or winches, a plan without a finite motion, a map of
            another kind, or a mistake in a file.
    """
    is_single = isinstance(given, str | Path | Mapping | Plan | Check) or hasattr(given, "axes")
    sources: list[Any] = [given] if is_single or not isinstance(given, Sequence) else list(given)
    if not sources:
        raise ConfigError("given", "[]: must be one plan or result, or more")
    with double_precision():
        items = [_source(one, k) for k, one in enumerate(sources)]
        first = items[0]
        for other in items[1:]:
            if not _are_same(other.robot, first.robot):
                raise ConfigError(other.name, f"must have the winches of {first.name}: sizes are of one machine")
        names = [_unique(source.name, [other.name for other in items[:k]]) for k, source in enumerate(items)]
        each = {name: source.peaks() for name, source in zip(names, items, strict=True)}
        curves = {n: source.curves() for n, source in zip(names, items, strict=True) if isinstance(source, _Motions)}
        limits = _limits(first.robot, first.limits)
    return Sizes(first.robot_file.name, float(factor), each, joint_cycle(list(each.values())), limits, curves)


@dataclasses.dataclass(frozen=True)
class _Motions:
    # Motions of a plan or a check.
    name: str
    plan: Plan

    @property
    def robot_file(self) -> RobotFile:
        return self.plan.robot_file

    @property
    def robot(self) -> AnyRobot:
        return self.plan.problem.robot

    @property
    def limits(self) -> Limits:
        return self.plan.problem.limits

    @property
    def _motions(self) -> list[Motion]:
        return [motion for leg in self.plan.legs for motion in leg.motions]

    def peaks(self) -> MotionDemands:
        samples = self.plan.demands.samples.tolist()
        of_motors = motor_demands(self.robot, self.limits, self._motions, samples, self.plan.keys.tension_rule)
        integrals = np.stack([of_motors.torque_rms, of_motors.energy, of_motors.regenerated_energy])
        if not np.isfinite(integrals).all():
            raise ConfigError(self.name, "must be another motion: torques are infinite, or jump too often for a mean")
        return of_motors

    def curves(self) -> dict[str, np.ndarray]:
        speed, torque = winding_curves(self.robot, self.limits, self._motions, self.plan.keys.tension_rule)
        return {"speed": speed, "torque": torque}


@dataclasses.dataclass(frozen=True)
class _StaticPoses:
    # Poses at rest inside of a workspace.
    name: str
    robot_file: RobotFile
    robot: AnyRobot
    limits: Limits
    positions: np.ndarray
    quaternions: np.ndarray

    def peaks(self) -> MotionDemands:
        return holding_demands(self.robot, self.limits, self.positions, self.quaternions)


def _source(item: Any, k: int) -> _Motions | _StaticPoses:
    if hasattr(item, "axes"):
        return _workspace(item, f"result {k + 1}")
    if isinstance(item, str | Path) and Path(item).suffix != ".toml":
        from cspr_jax.outputs.plots.selection import result_at  # loads matplotlib
        from cspr_jax.store.reading.result import open_result  # plans load no results

        return _workspace(open_result(result_at(Path(item))), str(item))
    if isinstance(item, Plan | Check):
        planned = item.plan if isinstance(item, Check) else item
        name = str(planned.keys.motion or f"motion {k + 1}")
    else:
        planned, name = plan(item), f"plan {k + 1}" if isinstance(item, Mapping) else str(item)
    _check_winches(planned.robot_file, name)
    if not np.isfinite(planned.answers.duration).all():
        raise ConfigError(name, "must have a motion in every segment; see its verdict")
    return _Motions(name, planned)


def _unique(name: str, earlier: list[str]) -> str:
    return f"{name} ({earlier.count(name) + 1})" if name in earlier else name


def _are_same(one: AnyRobot, other: AnyRobot) -> bool:
    # Tell whether two robots have the same number of cables on the same winches, however their files write them.
    leaves, kinds = zip(*(jax.tree.flatten(robot.winches) for robot in (one, other)), strict=True)
    return one.n_cables == other.n_cables and kinds[0] == kinds[1] and all(map(np.array_equal, *leaves))


def _check_winches(robot_file: RobotFile, name: str) -> None:
    if robot_file.winch is None:
        raise ConfigError(name, f"robot {robot_file.name}: must have [winch]: motors are sized for its drums")


def _workspace(result: Result, name: str) -> _StaticPoses:
    settings = sweep_spec(result.settings)
    if settings.get("map") != "workspace":
        kind = f'a map "{settings["map"]}"' if settings else "a motion"
        raise ConfigError(name, f'{kind}: must be a plan, or a finished map "workspace"; for motions give --robot too')
    spec = checked_keys(SweepFile, settings, Path(name))
    if not {"static", "wrench-feasible"} & set(spec.workspace.conditions if spec.workspace else ()):
        raise ConfigError(name, 'workspace.conditions: must hold "static" or "wrench-feasible": poses that cables hold')
    for axis in filter(is_of_robot, result.axes):
        raise ConfigError(name, f"axes.{axis}: must be absent: motors are sized for one robot")
    if spec.without == ANY_ONE:
        allowed = "must be absent or list cables: motors are sized for one robot"
        raise ConfigError(name, f'without = "{ANY_ONE}": {allowed}')
    patterns = [MAP_KINDS["workspace"].patterns]
    robot_file = as_moved(
        resolve_robot(spec.robot, Path(name), Path(), spec.parameters), patterns, spec.without, Path(name)
    )
    _check_winches(robot_file, name)
    inside = np.nonzero(np.asarray(result.data["verdict"]) == 0)
    if not len(inside[0]):
        raise ConfigError(name, "must have cells inside of the workspace: there is nothing to hold")
    cells = {axis: points[index] for (axis, points), index in zip(result.axes.items(), inside, strict=True)}
    robot, limits, positions, quaternions = WorkspaceMap(robot_file, spec, Path(name)).at_rest(cells)
    return _StaticPoses(name, robot_file, robot, limits, positions, quaternions)


def _limits(robot: AnyRobot, limits: Limits) -> dict[str, np.ndarray]:
    values = {name: getattr(limits, name, None) for name in SHOWN}
    shown = {name: np.asarray(value) for name, value in values.items() if value is not None}
    winches = robot.winches
    if winches is not None and winches.stall_torque is not None and winches.no_load_speed is not None:
        shown["line"] = np.stack([np.asarray(winches.stall_torque), np.asarray(winches.no_load_speed)])
    return shown
