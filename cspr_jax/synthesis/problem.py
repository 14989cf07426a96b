"""A design file as a problem: robots, measures, objectives and requirements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from cspr_jax.config.design import FRAME, HALL, PARAMETERS, ROBOT, TASKS, DesignFile, QuantityKeys
from cspr_jax.errors import ConfigError, InputError, demand, shown
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.maps.grid_map import RobotsApartError
from cspr_jax.synthesis.evaluations import Evaluator
from cspr_jax.synthesis.measures.frames import FrameMeasure, HallMeasure, ParametersMeasure, RobotMeasure
from cspr_jax.synthesis.measures.groups import GroupedSpace, GroupMeasure, TaskPart, grouped
from cspr_jax.synthesis.measures.maps import MapMeasure
from cspr_jax.synthesis.measures.measure import Measure
from cspr_jax.synthesis.measures.plans import PlanMeasure
from cspr_jax.synthesis.measures.workspaces import WorkspaceMeasure
from cspr_jax.synthesis.questions import Question, question_of
from cspr_jax.synthesis.space import RobotSpace, space_of

Groups = Sequence[Sequence[str]]


class DesignProblem:
    """A checked design file, with the measures of its robots.

    Fields:
        design: the file.
        file: its path.
        space: its robots, with one setting each.

    Raises:
        ConfigError: a mistake in the robot, a map or a plan, or a quantity that is not there.
    """

    def __init__(self, design: DesignFile, content: Mapping[str, Any], file: Path) -> None:
        """Make the measures, which check what they are asked for."""
        self.design, self.file, self.space = design, file, space_of(design, content, file)
        self._content = content
        self._tables: list[tuple[str, QuantityKeys]] = [(f"objective[{i}]", x) for i, x in enumerate(design.objective)]
        self._tables += [(f"requirement[{i}]", x) for i, x in enumerate(design.requirement)]
        self._measures = dict[tuple[str, bool], Measure]()
        for key, table in self._tables:
            for name in self._names_of(table.of):
                self._check(key, name, table)
        self._check_tasks()
        self._check_bounds()

    def _check_bounds(self) -> None:
        # At the bounds of each parameter of the file alone its maps and plans must be valid.
        for i, table in enumerate(self.space.of_file):
            if table.name not in self.space.names:
                continue
            k = self.space.names.index(table.name)
            for bound in ("lower", "upper"):
                values = list(self.space.first.values)
                values[k] = getattr(table, bound)
                try:
                    for measure in self._measures.values():
                        measure.check_at(self.space.first._replace(values=tuple(values)))
                except ConfigError as error:
                    allowed = f"must be a value that gives valid maps and plans ({error.lines[0]})"
                    raise ConfigError(self.file, f"parameter[{i}].{bound} = {shown(values[k])}: {allowed}") from error

    def _names_of(self, name: str) -> list[str]:
        # Names of the maps, plans and other tables that a name stands for.
        return self.tasks if name == TASKS else [name]

    def _check(self, key: str, name: str, table: QuantityKeys) -> None:
        proves = _proves(table)
        try:
            if (name, proves) not in self._measures:
                self._measures[name, proves] = self._measure(name, proves=proves)
            self._measures[name, proves].check(table.quantity)
            if proves:
                self._measures[name, proves].check_proofs()
        except InputError as error:
            raise ConfigError(self.file, f"{key}.{error}") from error

    def _check_tasks(self) -> None:
        reconfigure = self.design.reconfigure
        if reconfigure is None:
            return
        for i, name in enumerate(reconfigure.parameters):
            if name not in self.space.of_robot:
                allowed = f"{did_you_mean(name, self.space.of_robot)}one of {', '.join(self.space.of_robot)}"
                raise ConfigError(self.file, f"reconfigure.parameters[{i}] = {shown(name)}: {demand(allowed)}")
        for key, table in self._tables:
            if table.of in (*self.design.maps, *self.design.plans) and table.of not in reconfigure.tasks:
                raise ConfigError(self.file, f"{key}.of = {shown(table.of)}: must be one of reconfigure.tasks")
            if key.startswith("objective") and table.of in reconfigure.tasks:
                raise ConfigError(self.file, f"{key}.of = {shown(table.of)}: must be {TASKS}, all of them")

    def _measure(self, name: str, *, proves: bool) -> Measure:
        design, space = self.design, self.space
        if name in design.plans:
            return PlanMeasure(space, name, self._file_of("plans", name))
        if name in design.maps:
            names = {name, *((TASKS,) if design.reconfigure and name in design.reconfigure.tasks else ())}
            quantities = [table.quantity for _, table in self._tables if table.of in names]
            path = self._file_of("maps", name)
            # A full cell holds its corners, so that they must be feasible, too, where full cells are to be proved.
            try:
                return WorkspaceMeasure(space, name, quantities, path, has_corners=proves)
            except RobotsApartError:
                return MapMeasure(space, name, quantities, path, has_corners=proves)
        if name == HALL and design.hall is not None:
            return HallMeasure(space, design.hall)
        of_robot: dict[str, Callable[[RobotSpace], Measure]] = {
            FRAME: FrameMeasure,
            ROBOT: RobotMeasure,
            PARAMETERS: ParametersMeasure,
        }
        return of_robot[name](space)

    def _file_of(self, table: str, name: str) -> Path:
        # Errors about keys of a table of the design name it.
        return Path(self._content["files"].get(f"{table}.{name}", f"{self.file}: {table}.{name}"))

    def evaluator(self) -> Evaluator:
        """The evaluator of robots with one setting."""
        return self._with(self.space, lambda table: self._measures[table.of, _proves(table)])

    def evaluator_of(self, groups: Groups) -> Evaluator:
        """The evaluator of robots with a setting for each group of tasks; tasks in no group are left out."""
        space = self.grouped_space(groups)
        return self._with(space, lambda table: self._of_groups(space, table))

    def grouped_space(self, groups: Groups) -> GroupedSpace:
        """Robots with a setting for each group of tasks."""
        reconfigure = self.design.reconfigure
        return grouped(self.space, reconfigure.parameters if reconfigure else [], groups)

    @property
    def tasks(self) -> list[str]:
        """Tasks between which robots may be set anew, in their order; none without such."""
        return list(self.design.reconfigure.tasks) if self.design.reconfigure else []

    def _of_groups(self, space: GroupedSpace, table: QuantityKeys) -> Measure | None:
        group_of = {task: k for k, group in enumerate(space.groups) for task in group}
        names, proves = self._names_of(table.of), _proves(table)
        if names[0] in (*self.design.maps, *self.design.plans):
            tasks = [name for name in names if name in group_of]
            words = tasks if table.of == TASKS else [""] * len(tasks)
            parts = [TaskPart(w, self._measures[t, proves], group_of[t]) for w, t in zip(words, tasks, strict=True)]
            return GroupMeasure(space, parts) if parts else None
        return GroupMeasure(
            space, [TaskPart("", self._measures[table.of, proves], k) for k in range(len(space.groups))]
        )

    def _with(self, space: RobotSpace, measure_of: Callable[[QuantityKeys], Measure | None]) -> Evaluator:
        questions = list[Question]()
        for key, table in self._tables:
            measure = measure_of(table)
            if measure is not None:
                of_plan = all(name in self.design.plans for name in self._names_of(table.of))
                questions.append(question_of(table, key, measure, of_plan=of_plan))
        count = len(self.design.objective)
        return Evaluator(space, questions[:count], questions[count:])


def _proves(table: QuantityKeys) -> bool:
    return bool(getattr(table, "prove", False))
