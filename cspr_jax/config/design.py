"""Design files: which robot is best, among those that parameters and arrangements of the cables give; without jax."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from cspr_jax.config.keys.limits import Point
from cspr_jax.config.keys.obstacles import Obstacles
from cspr_jax.config.keys.parameter import MAX_PARAMETERS, Arrangements, ParameterTable, Value
from cspr_jax.config.parameters import check_parameters
from cspr_jax.config.reading import Table, checked, read_toml, refuse_other_kinds
from cspr_jax.config.wording import table_error
from cspr_jax.errors import ConfigError, shown
from cspr_jax.errors.suggestions import did_you_mean

MAX_QUESTIONS, MAX_TABLES, MAX_TASKS = 100, 20, 10
# Tables of quantities beside maps and plans.
FRAME, HALL, ROBOT, PARAMETERS, TASKS = "frame", "hall", "robot", "parameters", "tasks"
_RESERVED = (FRAME, HALL, ROBOT, PARAMETERS, TASKS)
_NAME = r"^[A-Za-z][A-Za-z0-9_-]*$"
Reduction = Literal["smallest", "largest", "mean", "sum"]
LONGEST_NAME = 60
Name = Annotated[str, Field(pattern=_NAME, max_length=LONGEST_NAME)]
_OF = f"a name of [maps] or [plans], or {', '.join(_RESERVED)}"


class QuantityKeys(Table):
    """A number that a robot has."""

    of: str = Field(description=f"which table it comes from: {_OF}")
    quantity: str = Field(
        description="of a map: fraction, that of its feasible cells, feasible (1 or 0), or a dataset of it; of "
        "a plan: feasible, or a field of its segments in JSON; of frame: extent_x, extent_y, extent_z, volume of "
        "the spools' box; of hall: clearance of the spools; of robot: a number of its file, such as mass; of "
        "parameters: a name"
    )
    reduce: Reduction | None = Field(
        None,
        description="how the values of cells or segments become one; absent: margins and smallest values by the "
        "smallest, durations and arcs of plans by the sum, all others by the largest",
    )

    @model_validator(mode="after")
    def _needs_no_reduction(self) -> "QuantityKeys":
        if self.quantity in ("feasible", "fraction") and self.reduce is not None:
            raise table_error("reduce", self.reduce, f"absent: {self.quantity} is one number of all cells")
        return self


class ObjectiveTable(QuantityKeys):
    """A number that is to be as large or as small as can be."""

    goal: Literal["largest", "smallest"] = Field(description="whether more or less is better")


class RequirementTable(QuantityKeys):
    """A number that robots must have."""

    lower: Value | None = Field(None, description="smallest value that is allowed")
    upper: Value | None = Field(None, description="largest value that is allowed")
    prove: bool = Field(
        False,
        description="of a map of workspaces, feasible: prove it for whole cells, boxes half-way to the next points, "
        "not for its points alone",
    )

    @model_validator(mode="after")
    def _has_bound(self) -> "RequirementTable":
        is_plain = self.quantity == "feasible"
        if is_plain and (self.lower, self.upper) != (None, None):
            raise table_error("lower", self.lower, "absent, as upper is: feasible is required to be 1")
        if not is_plain and self.lower is None and self.upper is None:
            raise table_error("lower", None, "a requirement needs it, or upper, or both")
        for name in ("lower", "upper"):
            value = getattr(self, name)
            if self.quantity == "fraction" and value is not None and not 0.0 <= value <= 1.0:
                raise table_error(name, value, "from 0 to 1: a fraction of cells")
        if self.lower is not None and self.upper is not None and not self.lower <= self.upper:
            raise table_error("upper", self.upper, f"a number >= lower, {shown(self.lower)}")
        if self.prove and not is_plain:
            raise table_error("prove", True, 'absent: quantity is not "feasible"')
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value that are allowed."""
        if self.quantity == "feasible":
            return 1.0, float("inf")
        low, high = self.lower, self.upper
        return (-float("inf") if low is None else low), (float("inf") if high is None else high)


class Hall(Table):
    """The hall in which the spools are, and the bodies in it."""

    corners: Annotated[list[Point], Field(min_length=2, max_length=2)] | None = Field(
        None, description="least and largest corner [x, y, z] of the hall, axes of the robot file, m"
    )
    obstacle: Obstacles | None = Field(None, description="[[hall.obstacle]], bodies in which no spool may be")

    @model_validator(mode="after")
    def _has_walls(self) -> "Hall":
        if self.corners is None and not self.obstacle:
            raise table_error("corners", None, "a hall needs it, or [[hall.obstacle]], or both")
        if self.corners is not None and any(low >= high for low, high in zip(*self.corners, strict=True)):
            raise table_error(
                "corners", self.corners, "[least, largest], each coordinate of the first below the second's"
            )
        return self


class ReconfigureKeys(Table):
    """Parameters that may differ from task to task, such as positions of spools on rails."""

    parameters: Annotated[list[str], Field(min_length=1, max_length=MAX_PARAMETERS)] = Field(
        description="parameters of the robot file that may be set anew before a task"
    )
    tasks: Annotated[list[Name], Field(min_length=2, max_length=MAX_TASKS)] = Field(
        description='maps and plans in the order in which they are done; of = "tasks" means all of them'
    )


class SearchKeys(Table):
    """How much is tried."""

    screen: Annotated[int, Field(ge=1, le=10_000_000)] | None = Field(
        None, description="number of robots of a Sobol sequence that are tried at first; absent: 16 for each parameter"
    )
    starts: Annotated[int, Field(ge=1, le=1000)] = Field(
        4, description="number of the best of them from which local searches start"
    )
    front: Annotated[int, Field(ge=2, le=1000)] = Field(
        9, description="two objectives: number of robots of the Pareto front"
    )
    generations: Annotated[int, Field(ge=1, le=100_000)] = Field(
        20, description="objectives that jump, such as numbers of arcs: generations of differential evolution"
    )


class DesignFile(Table):
    """A design: a robot with parameters, what is better, and what is required."""

    format_version: Literal[1] = Field(alias="schema", description="version of this format: 1")
    robot: Any = Field(description="a catalogue name, a path to a robot file, or a [robot] table; with [[parameter]]")
    parameters: Annotated[list[str], Field(min_length=1, max_length=MAX_PARAMETERS)] | None = Field(
        None, description="parameters that are searched for; absent: all of the robot file and of this file"
    )
    arrangements: Arrangements | None = Field(
        None, description='platforms: arrangements of the cables that are tried, "all" or a list, as axes.arrangement'
    )
    parameter: Annotated[list[ParameterTable], Field(min_length=1, max_length=MAX_PARAMETERS)] | None = Field(
        None,
        description='[[parameter]]: parameters that move numbers of this file, such as "plans.lift.z0" and '
        '"maps.floor.axes.z0[0]"',
    )
    maps: dict[str, dict[str, Any]] = Field(
        {}, description='[maps.NAME]: { file = "SWEEP.toml" }, or the keys of a sweep; the robot is that of the design'
    )
    plans: dict[str, dict[str, Any]] = Field(
        {}, description='[plans.NAME]: { file = "PLAN.toml" }, or the keys of a plan; the robot is that of the design'
    )
    hall: Hall | None = Field(None, description="where spools may be")
    reconfigure: ReconfigureKeys | None = Field(
        None, description="parameters with a value for each task, or for tasks in a row; as few changes as can be"
    )
    objective: Annotated[list[ObjectiveTable], Field(min_length=1, max_length=2)] = Field(
        description="one objective, or two, of which a Pareto front is found"
    )
    requirement: Annotated[list[RequirementTable], Field(max_length=MAX_QUESTIONS)] = Field(
        [], description="requirements, all of which the robots meet that are written"
    )
    search: SearchKeys = Field(SearchKeys(), description="how much is tried")

    @model_validator(mode="after")
    def _moves(self) -> "DesignFile":
        if self.parameter:
            tables = {"maps": self.maps, "plans": self.plans}
            check_parameters(self.parameter, {table: movable(tables[table]) for table in tables})
        return self

    @model_validator(mode="after")
    def _names(self) -> "DesignFile":
        for table in ("maps", "plans"):
            if len(getattr(self, table)) > MAX_TABLES:
                raise table_error(table, f"{len(getattr(self, table))} tables", f"at most {MAX_TABLES}")
            for name in getattr(self, table):
                if not re.fullmatch(_NAME, name) or len(name) > LONGEST_NAME:
                    raise table_error(f"{table}.{name}", "a table", "a name of letters, digits, _ and -")
                if name in _RESERVED or (table == "plans" and name in self.maps):
                    raise table_error(
                        f"{table}.{name}", "a table", f"another name than {', '.join(_RESERVED)} and maps"
                    )
        if len(self.objective) == 2 and self.objective[0] == self.objective[1]:
            raise table_error("objective[1]", "a table", "another objective than the first")
        names = [*self.maps, *self.plans, *_RESERVED]
        for key in ("objective", "requirement"):
            for i, one in enumerate(getattr(self, key)):
                if one.of not in names:
                    allowed = f"{did_you_mean(one.of, names)}one of {', '.join(names)}"
                    raise table_error(f"{key}[{i}].of", shown(one.of), allowed)
                absent = {HALL: (self.hall, "hall"), TASKS: (self.reconfigure, "reconfigure")}
                value, needed = absent.get(one.of, (one, ""))
                if value is None:
                    raise table_error(f"{key}[{i}].of", one.of, f"another table: there is no [{needed}]")
        return self

    @model_validator(mode="after")
    def _are_tasks(self) -> "DesignFile":
        if self.reconfigure is None:
            return self
        names = [*self.maps, *self.plans]
        for i, name in enumerate(self.reconfigure.tasks):
            if name not in names or name in self.reconfigure.tasks[:i]:
                allowed = f"{did_you_mean(name, names)}one of {', '.join(names)}, each once"
                raise table_error(f"reconfigure.tasks[{i}]", shown(name), allowed)
        if len(self.objective) > 1:
            raise table_error("objective", f"{len(self.objective)} tables", "one beside [reconfigure]")
        return self


def movable(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Maps or plans without keys whose numbers do not move."""
    return {name: {key: value for key, value in spec.items() if key != "schema"} for name, spec in tables.items()}


def read_design(path: Path) -> tuple[DesignFile, dict[str, Any]]:
    """A design file, checked, and its content with that of the files of its maps and plans."""
    return checked_design(read_toml(path), path)


def checked_design(data: dict[str, Any], path: Path) -> tuple[DesignFile, dict[str, Any]]:
    """A parsed design file, checked, and its content with that of the files of its maps and plans."""
    refuse_other_kinds(data, "design", path)
    # Parameters may move numbers of files that are read only then.
    checked(DesignFile, {key: value for key, value in data.items() if key != "parameter"}, path)
    full = {**data, **{table: _with_files(data.get(table, {}), table, path) for table in ("maps", "plans")}}
    files = {
        f"{table}.{name}": str(path.parent / spec["file"])
        for table in ("maps", "plans")
        for name, spec in data.get(table, {}).items()
        if "file" in spec
    }
    return checked(DesignFile, full, path), full | {"files": files}


def _with_files(tables: dict[str, Any], key: str, path: Path) -> dict[str, Any]:
    contents = {}
    for name, table in tables.items():
        for other in ("robot", "parameters"):
            if other in table:
                raise ConfigError(path, f"{key}.{name}.{other}: must be absent: that of the design counts")
        if "file" not in table:
            contents[name] = {"schema": 1, **table}
            continue
        if len(table) > 1 or not isinstance(table["file"], str):
            raise ConfigError(path, f'{key}.{name}: must be {{ file = "FILE.toml" }} alone, or keys without file')
        inner = read_toml(path.parent / table["file"])
        contents[name] = {
            other: value for other, value in inner.items() if other not in ("robot", "parameters", "parameter")
        }
    return contents
