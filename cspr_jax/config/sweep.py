"""Sweep files: a map over a grid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    Discriminator,
    Field,
    SerializerFunctionWrapHandler,
    Tag,
    field_validator,
    model_serializer,
    model_validator,
)
from pydantic.functional_validators import ModelWrapValidatorHandler

from cspr_jax.config.keys.ellipse import SweepEllipse
from cspr_jax.config.keys.launch import LaunchSearch
from cspr_jax.config.keys.limits import Coordinate, LimitTable, Point
from cspr_jax.config.keys.obstacles import ObstacleKeys, Obstacles
from cspr_jax.config.keys.parameter import (
    OWN_DESCRIPTION,
    VALUES_DESCRIPTION,
    Arrangements,
    ParameterTables,
    ParameterValues,
)
from cspr_jax.config.keys.path import TargetPath
from cspr_jax.config.keys.trajectory import BetaHat, Quaternion, TiltTorsion, TrajectoryKeys
from cspr_jax.config.keys.workspace import WorkspaceTable
from cspr_jax.config.missing_cables import ANY_ONE, DESCRIPTION, MissingCables
from cspr_jax.config.parameters import at_values
from cspr_jax.config.reading import Table
from cspr_jax.config.wording import either, name_of, table_error
from cspr_jax.numerics.shapes import Float
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.quantities import ARRANGEMENT, PARAMETER, PARAMETER_NAME, QUANTITIES
from cspr_jax.schema.tiles import LARGEST_TILE

LARGEST_COUNT = 10_000_000
# Settings of a run that follow from keys and robot: names of all axes, and number of arrangements.
RESOLVED = ("dimensions", "arrangements")


class AxisRange(Table):
    """Equidistant points."""

    start: Coordinate = Field(description="first point")
    stop: Coordinate = Field(description="last point, included")
    count: Annotated[int, Field(ge=1, le=LARGEST_COUNT)] = Field(description="number of points, at least 1")

    @model_validator(mode="after")
    def _spread(self) -> "AxisRange":
        if self.count > 1 and self.start == self.stop:
            raise ValueError("a range whose stop differs from its start when count > 1")
        return self


Axis = Annotated[
    Annotated[AxisRange, Tag("~range")]
    | Annotated[list[Coordinate], Field(min_length=1, max_length=LARGEST_COUNT, fail_fast=True), Tag("~values")],
    Discriminator(lambda value: "~range" if isinstance(value, dict | AxisRange) else "~values"),
]


def axis_points(axis: AxisRange | list[float]) -> Float[np.ndarray, "n"]:
    """Points of an axis."""
    if isinstance(axis, AxisRange):
        return np.linspace(axis.start, axis.stop, axis.count)
    return np.array(axis, float)


def cell_widths(points: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """Extents of the full cells about sorted points: the distance to the farther neighbour of each."""
    gaps = np.diff(points)
    return np.maximum(np.append(gaps, 0.0), np.append(0.0, gaps)) if len(points) else points


_OF_TARGETS = (
    "{} of the targets, m: {{ start, stop, count }} or a list; of a platform those of its mass centre, in workspaces "
    "of the origin of its axes, unless point or workspace.point says otherwise"
)
_OF_STARTS = "{} of the start points, m, in place of trajectory.from"


class Axes(Table):
    """Axes of the grid, which is their product; their order is that of the dimensions of the result."""

    x: Axis | None = Field(None, description=_OF_TARGETS.format("x"))
    y: Axis | None = Field(None, description=_OF_TARGETS.format("y"))
    radius: Axis | None = Field(
        None,
        description="distance of the targets from the vertical through the centroid, m; with azimuth, in place of x "
        "and y",
    )
    azimuth: Axis | None = Field(
        None, description="direction of the targets seen from the vertical through the centroid, from x to y, rad"
    )
    z: Axis = Field(description=_OF_TARGETS.format("z"))
    circle_radius: Axis | None = Field(None, description="ellipse: radius of circles, m; all >= 0")
    scale: Axis | None = Field(
        None, description="ellipse: factor of the half-axes, or of the radius, of [ellipse]; all >= 0; absent: 1"
    )
    tilt_azimuth: Axis | None = Field(
        None, description="poses, workspace, ellipse: angle phi of tilt and torsion, rad; absent: 0"
    )
    tilt: Axis | None = Field(
        None, description="poses, workspace, ellipse: angle theta of tilt and torsion, rad; absent: 0"
    )
    torsion: Axis | None = Field(None, description="poses, workspace: angle sigma of tilt and torsion, rad; absent: 0")
    z0: Axis | None = Field(None, description="depth of P0 below the centroid of the spools, m; all > 0")
    inclination: Axis | None = Field(None, description="inclination v of transitions, in place of z0; all in ]-1, 1[")
    tau: Axis | None = Field(None, description="normalised times of transition-envelopes, in [0, 1]")
    cable: Axis | None = Field(
        None, description="cables of transition-envelopes, from 1 on; absent: the worst cable at each time"
    )
    frequency: Axis | None = Field(
        None, description="ellipse: frequencies of verdicts and margins, rad/s; all > 0; absent: ellipse.frequency"
    )
    from_x: Axis | None = Field(None, description=_OF_STARTS.format("x"))
    from_y: Axis | None = Field(None, description=_OF_STARTS.format("y"))
    from_z: Axis | None = Field(None, description=_OF_STARTS.format("z"))
    parameter: dict[Annotated[str, Field(pattern=f"^{PARAMETER_NAME}$")], Axis] | None = Field(
        None,
        description='"parameter.NAME": values of a parameter of the robot file, so that cells are of different robots',
    )

    arrangement: Arrangements | None = Field(
        None,
        description='platforms: arrangements of the cables, "all" but symmetric copies, a list of permutations such as '
        "[1, 0, 2, 3] (the cable of spool 0 ends in attachment point 1), or a list of their numbers",
    )

    @model_validator(mode="before")
    @classmethod
    def _of_parameters(cls, data: Any) -> Any:
        # TOML takes a name in quotes, "parameter.width", as one key, and one without quotes as a table.
        if not isinstance(data, dict):
            return data
        named = {name: axis for name, axis in data.items() if name.startswith(PARAMETER)}
        if not named:
            return data
        table = data.get("parameter")
        axes = {name.removeprefix(PARAMETER): axis for name, axis in named.items()}
        others = {name: axis for name, axis in data.items() if name not in named}
        return others | {"parameter": {**(table if isinstance(table, dict) else {}), **axes}}

    @model_validator(mode="after")
    def _are_parameters(self) -> "Axes":
        if self.parameter and ARRANGEMENT in self.parameter:
            raise table_error(f"{PARAMETER}{ARRANGEMENT}", "an axis", f"called {ARRANGEMENT} alone")
        return self

    @model_serializer(mode="wrap")
    def _named(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        axes = dump(self)
        parameters = axes.pop("parameter", None) or {}
        return axes | {PARAMETER + name: axis for name, axis in parameters.items()}

    def named(self, name: str) -> Any:
        """An axis by its name, or None."""
        if name.startswith(PARAMETER):
            return (self.parameter or {}).get(name.removeprefix(PARAMETER))
        return getattr(self, name)


def sweep_spec(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a sweep file among the settings that a run has recorded."""
    return {key: value for key, value in settings.items() if key not in RESOLVED}


def axis_names(axes: Mapping[str, Any]) -> list[str]:
    """Names of the axes of a parsed file, in its order."""
    parts = [
        [PARAMETER + inner for inner in axis] if name == "parameter" and isinstance(axis, Mapping) else [name]
        for name, axis in axes.items()
    ]
    return [name for names in parts for name in names]


BetaHatChoice = Annotated[
    Annotated[BetaHat, Tag("~number")] | Annotated[Literal["preferred"], Tag("~preferred")],
    Discriminator(lambda value: "~preferred" if isinstance(value, str) else "~number"),
]


class From(Table):
    """Start of every segment."""

    position: Point | None = Field(None, description="start point [x, y, z], m; of a platform that of its mass centre")
    rest: bool = Field(False, description="true: at rest in P0")
    tilt_torsion: TiltTorsion | None = Field(None, description="poses: orientation at the start, as in a plan")
    quaternion: Quaternion | None = Field(
        None, description="poses: orientation at the start, in place of tilt_torsion; path, free: at the targets, too"
    )
    beta_hat: BetaHat | None = Field(None, description="poses: beta-hat at the start; absent: the preferred one (3.91)")

    @property
    def is_pose(self) -> bool:
        """Tell whether the table says more than a position."""
        return any(key is not None for key in (self.tilt_torsion, self.quaternion, self.beta_hat))

    @model_validator(mode="after")
    def _one(self) -> "From":
        if self.rest == (self.position is not None):
            raise ValueError("{ position = [x, y, z] } or { rest = true }, one of them")
        if self.rest and self.is_pose:
            raise ValueError("{ rest = true } alone: the reference orientation, and beta-hat -1")
        if self.tilt_torsion is not None and self.quaternion is not None:
            raise ValueError("tilt_torsion or quaternion, one of them")
        return self


class SweepTrajectory(TrajectoryKeys):
    """The trajectory of every cell."""

    start: From | None = Field(
        None,
        alias="from",
        description="{ position = [x, y, z] } or { rest = true }; or axes from_x, from_y and from_z",
    )
    beta_hat: BetaHatChoice | None = Field(
        None,
        description='poses: beta-hat at the targets, a number, or "preferred" (3.91); absent: several are tried, the '
        "preferred one first",
    )
    path: TargetPath | None = Field(
        None,
        description="path: { lift, blend_tolerance, grid, ramp_time } of the paths; absent: straight lines",
    )


class Orientations(Table):
    """Orientations at each position."""

    definition: Literal["grid", "scan", "equal-volume"] | None = Field(
        None,
        description='how the accessible set is sampled: "grid" of tilt and torsion, "scan" (Bonev, as in the '
        'thesis), or "equal-volume"; absent: "scan", except in map = "orientations", which has only "grid"',
    )
    divisions: Annotated[int, Field(ge=4, le=128, multiple_of=2)] = Field(
        32,
        description="number of steps in pi: the step is pi / divisions; even, since errors are estimated with twice "
        "the step",
    )
    values: Annotated[int, Field(ge=1, le=100)] | None = Field(
        None,
        description="orientations, attainability: number of values of beta-hat tried at each orientation; absent: 20",
    )


class RunTable(Table):
    """Settings of the computation, and the quantities to keep."""

    dtype: Literal["float64", "float32"] = Field(
        "float64", description="type of stored numbers and of the screen; verdicts use float64 either way"
    )
    tile: Annotated[list[Annotated[int, Field(ge=1, le=LARGEST_TILE)]], Field(min_length=1, fail_fast=True)] | None = (
        Field(None, description="shape of a tile, the block of cells computed at a time, one number per axis")
    )
    store: Annotated[list[Annotated[str, name_of(lambda: QUANTITIES)]], Field(min_length=1, fail_fast=True)] | None = (
        Field(None, description="quantities to store; see `cspr quantities`")
    )

    @field_validator("store")
    @classmethod
    def _once(cls, names: list[str] | None) -> list[str] | None:
        if names is not None and len(set(names)) < len(names):
            raise ValueError("a list without repetitions")
        return names


WithoutInSweeps = Annotated[
    Annotated[MissingCables, Tag("~cables")] | Annotated[Literal["any-one"], Tag("~any")],
    Discriminator(lambda value: "~any" if isinstance(value, str) else "~cables"),
]


class _SweepKeys(Table):
    # Keys of a sweep except those of obstacles, so that the reference lists obstacles last.

    format_version: Literal[1] = Field(alias="schema", description="version of this format: 1")
    map: Annotated[str, name_of(lambda: MAP_KINDS)] = Field(description=f"kind of map: {either(MAP_KINDS)}")
    robot: Any = Field(description="a catalogue name, a path to a robot file, or a [robot] table")
    parameters: ParameterValues | None = Field(None, description=VALUES_DESCRIPTION)
    parameter: ParameterTables | None = Field(
        None,
        description=OWN_DESCRIPTION.format('"trajectory.amplitude.epsilon" or "limits.tension_max"', " and [axes]"),
    )
    without: WithoutInSweeps | None = Field(
        None,
        description=f'{DESCRIPTION}; workspaces: "{ANY_ONE}", each single cable gone in turn, all must be feasible',
    )
    axes: Axes = Field(
        description="[axes] x, y (or radius, azimuth), z and z0 (or inclination), each { start, stop, count } or a list"
    )
    trajectory: SweepTrajectory = Field(
        default_factory=SweepTrajectory,
        description="[trajectory] with family, amplitude, max_arcs and from; not for maps whose cells are places",
    )
    orientations: Orientations | None = Field(
        None,
        description="[orientations] of maps of orientations, orientation-workspace and attainability: definition, "
        "divisions, values",
    )
    launch: LaunchSearch | None = Field(
        None,
        description="[launch] of launch-range, swing-range: bounds within which releases are searched, and effort of "
        "the search",
    )
    ellipse: SweepEllipse | None = Field(
        None,
        description='[ellipse] of map = "ellipse": half_axes or radius, unless axes.circle_radius has radii; normal, '
        "frequency",
    )
    workspace: WorkspaceTable | None = Field(
        None, description='[workspace] of map = "workspace": conditions, orientation, wrenches'
    )
    point: Literal["mass-centre", "origin"] | None = Field(
        None,
        description='sensitivity: point of a platform whose places x, y, z are: "mass-centre", the default, or '
        '"origin" of its axes; workspaces have workspace.point',
    )
    limits: LimitTable = Field(default_factory=LimitTable, description="[limits] of all motions of the file")
    run: RunTable = Field(default_factory=RunTable, description="[run] dtype, tile, store")


class SweepFile(ObstacleKeys, _SweepKeys):
    """A sweep."""

    obstacle: Obstacles | None = Field(
        None,
        description="maps of arcs: [[obstacle]], bodies fixed in space that no motion may meet; workspaces have "
        "[[workspace.obstacle]]",
    )

    @model_validator(mode="wrap")
    @classmethod
    def _at_values(cls, data: Any, handler: ModelWrapValidatorHandler["SweepFile"]) -> "SweepFile":
        return at_values(cls, data, handler, "sweep")
