"""Plan files: a sequence of poses to be reached."""

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, PrivateAttr, Tag, model_validator
from pydantic.functional_validators import ModelWrapValidatorHandler

from cspr_jax.config.keys.ellipse import ELLIPSE_KEYS, EllipseTable
from cspr_jax.config.keys.free_motions import FreeMotionKeys
from cspr_jax.config.keys.launch import LaunchTable
from cspr_jax.config.keys.limits import LimitTable, Point, Positive
from cspr_jax.config.keys.obstacles import ObstacleKeys
from cspr_jax.config.keys.parameter import OWN_DESCRIPTION, VALUES_DESCRIPTION, ParameterTables, ParameterValues
from cspr_jax.config.keys.path import PathTable
from cspr_jax.config.keys.pose import Pose, Turns
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.missing_cables import DESCRIPTION, MissingCables
from cspr_jax.config.parameters import at_values
from cspr_jax.config.reading import LARGEST_FILE, Table, checked, parse_toml, refuse_other_kinds
from cspr_jax.config.wording import name_of, table_error
from cspr_jax.errors import ConfigError, shown
from cspr_jax.robots.model.tension_rule_table import CENTRED, TENSION_RULES


class DepthRule(Table):
    """Rule that chooses z0."""

    choose: Literal["mean", "conservative", "fastest"] = Field(
        description='"mean" height of the targets, "conservative" (2.58), or "fastest", found by search'
    )


Depth = Annotated[
    Annotated[Positive, Tag("~number")] | Annotated[DepthRule, Tag("~choice")],
    Discriminator(lambda value: "~choice" if isinstance(value, dict | DepthRule) else "~number"),
]


class PlanFile(TrajectoryKeys, LimitTable, ObstacleKeys, FreeMotionKeys):
    """A plan."""

    format_version: Literal[1] = Field(alias="schema", description="version of this format: 1")
    robot: Any = Field(description="a catalogue name, a path to a robot file, or a [robot] table")
    parameters: ParameterValues | None = Field(None, description=VALUES_DESCRIPTION)
    parameter: ParameterTables | None = Field(
        None, description=OWN_DESCRIPTION.format('"z0", "amplitude.epsilon" or "pose[1].position[2]"', "")
    )
    without: MissingCables | None = Field(None, description=DESCRIPTION)
    z0: Depth | None = Field(
        None,
        description='depth of P0 below the centroid, m, or { choose = "mean" | "conservative" | "fastest" }; '
        "transitions may give the inclination instead",
    )
    first_control_point: Point | None = Field(
        None,
        description="bezier: second control point of the first segment, [x, y, z], m; absent: the first pose, from "
        "which the motion then starts without acceleration",
    )
    least: Literal["each", "total"] | None = Field(
        None,
        description='bezier: what the durations "least" minimise: "each", the default, the duration of each segment, '
        'given the segments before it; "total", their sum, by search',
    )
    tensions: Annotated[str, name_of(lambda: TENSION_RULES)] | None = Field(
        None,
        description="more cables than degrees of freedom: rule that chooses the tensions in motion files: "
        + "; ".join(f'"{name}", {row.sentence}' for name, row in TENSION_RULES.items())
        + f' (here 4, about the middles of their ranges); absent: "{CENTRED}"',
    )
    samples: Annotated[int, Field(ge=2, le=1_000_000)] = Field(
        400, description="number of rows per segment in motion files"
    )
    motion: str | None = Field(
        None, min_length=1, description="spline: file of the whole motion, in place of the poses"
    )
    trajectory: str | None = Field(
        None, min_length=1, description="spline: `id` of one of several trajectories that a file of CASPR holds"
    )
    interpolation: Literal["cubic", "quintic", "hermite"] | None = Field(
        None,
        description='spline: curve through the samples: "cubic" (C2, the default), "quintic" (C4), or "hermite", '
        "pieces from the velocities, and accelerations, of all samples",
    )
    ends: Literal["rest", "natural", "periodic"] | None = Field(
        None,
        description='spline: ends of the curve: "rest", the default (velocity 0, of quintics acceleration 0 too), '
        '"natural" or "periodic"',
    )
    point: Literal["mass-centre", "origin"] | None = Field(
        None,
        description='point of a platform whose positions poses and files of motions have: "mass-centre", the default, '
        'or "origin" of its axes; P0, ellipses and paths of their own are always of the mass centre',
    )
    smooth: Positive | None = Field(
        None,
        description="spline: standard deviation of the noise of a file's positions, m, which a smoothing spline takes "
        "off",
    )
    limits: LimitTable | None = Field(
        None, description="[limits], as in a sweep: the same keys as here; give each key in only one of the two places"
    )
    ellipse: EllipseTable | None = Field(
        None,
        description="[ellipse], of a plan that turns on one ellipse alone, in place of the poses; its keys may also "
        "stand in the plan itself",
    )
    turns: Turns | None = Field(None, description="ellipse: turns on the ellipse of the plan (default 1)")
    path: PathTable | None = Field(
        None,
        description="path: [path] with points, a file or an arc, in place of the poses; without, it says how the poses "
        "are joined",
    )
    launch: LaunchTable | None = Field(None, description="bezier, ellipse: [launch] of an object that is released")
    stretch: Annotated[float, Field(ge=1e-6, le=1e9)] | None = Field(
        None, description="spline: factor by which all durations grow (default 1)"
    )
    pose: Annotated[list[Pose], Field(min_length=2, max_length=10_000)] = Field(
        description="the poses in their order, at least two [[pose]] tables; absent with `motion`, `ellipse` or `path`"
    )

    # Samples and splines that replace files, by the names that `motion` gives them.
    _sources: dict[str, Any] = PrivateAttr(default_factory=dict)

    def with_source(self, name: str, source: Any) -> "PlanFile":
        """The plan, with a motion that replaces a file."""
        plan = self.model_copy()
        plan._sources = self._sources | {name: source}
        return plan

    def source(self, name: str) -> Any:
        """The motion that replaces a file."""
        return self._sources.get(name)

    def family_of(self, segment: int) -> str:
        """Family of a segment."""
        return self.pose[segment + 1].family or self.family

    @property
    def families(self) -> tuple[str, ...]:
        """Names of the families in use, in the order of their first segments."""
        return tuple(dict.fromkeys(map(self.family_of, range(len(self.pose) - 1))))

    @property
    def resulting_poses(self) -> tuple[int, ...]:
        """Indices of the poses whose positions follow from a launch, a file, an ellipse or a path."""
        launched = () if self.launch is None else (self.launch.segment + 1,)
        ends = [i for i, pose in enumerate(self.pose) if pose.motion is not None]
        # The first pose of a leg that begins with a file lies where the file begins.
        starts = [i - 1 for i in ends if i == 1 or self.family_of(i - 2) != self.family_of(i - 1)]
        turning = [i for i, pose in enumerate(self.pose) if not pose.rest and self._is_on_ellipse(i)]
        return tuple(sorted({*launched, *ends, *starts, *turning, *self._ends_of_paths()}))

    def _ends_of_paths(self) -> list[int]:
        # Indices of poses whose positions come from paths: ends of paths, and the start of the first path of a leg.
        ends = []
        for i, path in ((i, pose.path) for i, pose in enumerate(self.pose) if pose.path is not None):
            is_first = i == 1 or (i > 1 and self.family_of(i - 2) != "path")
            start = self.pose[i - 1]
            has_start = path.has_start or self.is_one_path
            ends += [i] * (path.has_end or self.is_one_path)
            ends += [i - 1] * (is_first and has_start and start.position is None and not start.rest)
        return ends

    @property
    def is_one_path(self) -> bool:
        """Tell whether the plan is one path, which has points of its own in place of poses."""
        return self.path is not None and self.path.is_whole

    def _is_on_ellipse(self, i: int) -> bool:
        pose = self.pose[i]
        return pose.ellipse is not None or (pose.position is None and i > 0 and self.family_of(i - 1) == "ellipse")

    @property
    def vectors(self) -> dict[str, list[float] | None]:
        """Points and velocities of the plan other than its poses, by their keys."""
        vectors = {"first_control_point": self.first_control_point}
        if self.launch is not None:
            vectors |= {f"launch.{name}": getattr(self.launch, name) for name in ("point", "target", "velocity")}
        return vectors

    @property
    def tension_rule(self) -> str:
        """Rule that chooses the tensions of redundant cables."""
        return self.tensions or CENTRED

    @model_validator(mode="before")
    @classmethod
    def _of_one_file(cls, data: Any) -> Any:
        # A plan of one file becomes a plan of two poses, whose positions come from the file.
        if not isinstance(data, dict):
            return data
        source = {key: data[key] for key in ("motion", "trajectory") if data.get(key) is not None}
        if "trajectory" in source and "motion" not in source:
            raise table_error("trajectory", shown(source["trajectory"]), "beside motion, the file that holds it")
        if source and "pose" in data:
            raise table_error(
                "motion", shown(data["motion"]), "absent beside [[pose]] tables: its file has the whole motion"
            )
        return data | {"pose": [{}, source]} if source else data

    @model_validator(mode="before")
    @classmethod
    def _of_one_ellipse(cls, data: Any) -> Any:
        # A plan of one ellipse becomes a plan of two poses on it.
        if not isinstance(data, dict) or data.get("family") != "ellipse":
            return data
        flat = {name: data[name] for name in ELLIPSE_KEYS if name in data}
        if "pose" in data or not (flat or "ellipse" in data):
            return data
        if "ellipse" in data:  # then the keys of an ellipse outside the table are unknown
            return data | {"pose": [{}, {}]}
        return {name: value for name, value in data.items() if name not in flat} | {"ellipse": flat, "pose": [{}, {}]}

    @model_validator(mode="after")
    def _on_one_ellipse(self) -> "PlanFile":
        if self.ellipse is None:
            if self.turns is not None:
                raise table_error("turns", self.turns, "absent beside [[pose]] tables, which have turns of their own")
            return self
        if len(self.pose) != 2 or any(pose.model_fields_set for pose in self.pose):
            raise table_error("ellipse", "{...}", "absent beside [[pose]] tables, which have ellipses of their own")
        pose = [Pose(ellipse=self.ellipse), Pose(turns=1.0 if self.turns is None else self.turns)]
        return self.model_copy(update={"pose": pose})

    @model_validator(mode="before")
    @classmethod
    def _of_one_path(cls, data: Any) -> Any:
        # A plan of one path becomes a plan of two poses, which the path joins.
        if isinstance(data, dict) and isinstance(data.get("path"), dict) and "pose" not in data:
            return data | {"pose": [{}, {}]}
        return data

    @model_validator(mode="after")
    def _on_one_path(self) -> "PlanFile":
        path = self.path
        has_poses = any(pose.model_fields_set for pose in self.pose)
        if path is None or (has_poses and not path.is_whole):
            return self
        if not path.is_whole:
            raise table_error("path.points", None, "the points of the path, or [[pose]] tables")
        if has_poses:
            key = next(key for key in ("points", "file", "centre") if getattr(path, key) is not None)
            raise table_error(
                f"path.{key}", shown(getattr(path, key)), "absent beside [[pose]] tables, which have the places"
            )
        if path.points is not None and len(path.points) < 2:
            raise table_error("path.points", shown(path.points), "two points or more")
        if path.centre is not None and path.start is None:
            raise table_error("path.start", None, "where the path begins, [x, y, z], m")
        return self.model_copy(update={"pose": [Pose(), Pose(path=path)]})

    @model_validator(mode="after")
    def _first_family(self) -> "PlanFile":
        if self.pose[0].family is not None:
            raise table_error("pose[0].family", self.pose[0].family, "absent: no segment ends at the first pose")
        return self

    @model_validator(mode="after")
    def _launched(self) -> "PlanFile":
        if self.launch is None:
            return self
        last = len(self.pose) - 2
        family = None if self.launch.segment > last else self.family_of(self.launch.segment)
        if family not in ("bezier", "ellipse"):
            allowed = f'from 0 to {last}, a pose from which family = "bezier" or "ellipse" leads on'
            raise table_error("launch.segment", self.launch.segment, allowed)
        end, after = self.pose[self.launch.segment + 1], self.launch.segment + 1
        for key, value in (("position", end.position), ("rest", end.rest or None)):
            if value is not None:
                name = f"pose[{self.launch.segment + 1}].{key}"
                raise table_error(
                    name, value, "absent: the segment of the launch ends where it follows from the launch"
                )
        if family == "ellipse":
            return self
        if after <= last and self.family_of(after) != "bezier":
            allowed = '"bezier": behind the segment of the launch the acceleration goes on'
            raise table_error(f"pose[{after + 1}].family", shown(self.family_of(after)), allowed)
        if self.first_control_point is not None or self.least == "each":
            key = "least" if self.first_control_point is None else "first_control_point"
            raise table_error(
                key,
                shown(getattr(self, key)),
                "cannot be combined with [launch], from which accelerations and durations follow",
            )
        return self

    @model_validator(mode="after")
    def _on_ellipses(self) -> "PlanFile":
        # A launch from an ellipse determines the axes of that ellipse; all other ellipses must have axes.
        of_launch = -1 if self.launch is None else self.launch.segment + 1
        if of_launch > 0 and self.family_of(of_launch - 1) == "ellipse":
            self._check_launch_ellipse(of_launch)
        else:
            of_launch = -1
        tables = {f"pose[{i}].ellipse": pose.ellipse for i, pose in enumerate(self.pose) if i != of_launch}
        for name, table in ({"ellipse": self.ellipse} | tables).items():
            if table is not None and table.half_axes is None and table.radius is None:
                raise table_error(f"{name}.radius", None, "half_axes, or the radius of a circle: one of them")
        return self

    def _check_launch_ellipse(self, i: int) -> None:
        table = self.pose[i].ellipse
        if table is None:
            raise table_error(f"pose[{i}].ellipse", None, "{ centre = [x, y, z] }, whose axes the launch determines")
        for key in ("half_axes", "radius", "normal", "phase"):
            if key in table.model_fields_set:
                value = getattr(table, key)
                raise table_error(f"pose[{i}].ellipse.{key}", value, "absent: the launch determines the ellipse")
        if self.launch is not None and self.launch.release is not None:
            allowed = "absent: the object leaves an ellipse at the end of the segment"
            raise table_error("launch.release", self.launch.release, allowed)

    @model_validator(mode="after")
    def _one_place(self) -> "PlanFile":
        if self.limits is None:
            return self
        limits = {name: getattr(self.limits, name) for name in sorted(self.limits.model_fields_set)}
        for name, value in limits.items():
            if getattr(self, name) is not None:
                raise table_error(
                    f"limits.{name}", value, f"cannot be combined with {name} = {shown(getattr(self, name))}"
                )
        # Move limits from the table [limits] to the plan itself: the rest of the program finds them in one place.
        return self.model_copy(update={"limits": None, **limits})

    @model_validator(mode="wrap")
    @classmethod
    def _at_values(cls, data: Any, handler: ModelWrapValidatorHandler["PlanFile"]) -> "PlanFile":
        return at_values(cls, data, handler, "plan")


def read_plan(text: str, path: Path) -> PlanFile:
    """Read a plan file and check it."""
    return checked_plan(parse_toml(text, path), path)


def plan_of_text(text: str, path: Path) -> PlanFile:
    """Plan that a motion file holds as the text of its plan file, or as JSON where there was no plan file."""
    if len(text) > LARGEST_FILE:
        raise ConfigError(path, f"plan of {len(text)} letters: must be at most {LARGEST_FILE}")
    if not text.startswith("{"):
        return read_plan(text, path)
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(path, f"its plan cannot be read: {error}") from error
    return checked_plan(data, path)


def checked_plan(data: dict[str, Any], file: object) -> PlanFile:
    """Check the parsed content of a plan file."""
    refuse_other_kinds(data, "plan", file)
    return checked(PlanFile, data, file)
