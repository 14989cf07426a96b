"""Table of the kinds of maps: what each requires of a sweep file, its quantities, and the class that computes it.

A kind from outside of the package consists of a subclass of `maps.grid_map.GridMap`, its row, and rows of its own
quantities; the module that defines them passes the rows to `register`. They are valid in the process that has imported
this module, for all that `cspr_jax.cli.main` does there. Other processes that compute tiles, and workers of a
scheduler, get the row with the sweep and import the class by its name, "module:Class": they must find that module.
"""

import contextlib
import dataclasses
import importlib
from collections.abc import Iterator, Mapping
from typing import Any, Literal

from cspr_jax.errors import InputError
from cspr_jax.schema import map_columns as columns
from cspr_jax.schema.families import ANY_PATTERN
from cspr_jax.schema.plugins import ExtensibleRows
from cspr_jax.schema.quantities import (
    MOTION_CLEARANCE,
    OF_ELLIPSES,
    OF_PATHS,
    POSE_VERDICT,
    QUANTITIES,
    Quantity,
    row_of,
)
from cspr_jax.schema.quantities import register as register_quantity
from cspr_jax.schema.tiles import LARGEST_TILE, ORDINARY_COST, CellCost


@dataclasses.dataclass(frozen=True)
class MapKind:
    """A kind of map. Keys of sweep files are dotted, such as "axes.tau".

    Fields:
        name: name in sweep files.
        title: title of its results.
        description: a phrase for the reference.
        implementation: "module:Class" of its `maps.grid_map.GridMap`.
        over_robots: the same of one for many robots at once; empty: each robot needs a map of its own.
        quantities: its quantities, all of them rows of `schema.quantities.QUANTITIES`.
        stored: quantities that are stored by default.
        stored_with: for some keys, quantities that are stored in addition if the key is given. So a key that is newer
            than its map does not change what older sweeps store, nor their identities.
        only_with: for some quantities, keys without which they have no values: they are stored only if one of these is
            given. A condition of a workspace counts as a key, too: "workspace.conditions.static".
        rows: rows of quantities with descriptions for this kind; names, units and types are those of the table.
        planned: whether a cell is the motion of a plan of two poses, which `plans.cell_plan` writes.
        pictured: quantities of which a picture shows, by default, the first one that is stored.
        motionless: quantities that belong to a position or a time, not to a motion.
        families: trajectory families that it takes; none: its cells are positions, without a motion.
        start: start of its motions. "rest": at rest in P0, `trajectory.from` says so or is absent; "point": given by
            `trajectory.from` or the axes from_x, from_y and from_z; "pose": given by `trajectory.from`, with an
            orientation or without; at rest in P0 where it is absent.
        needs: keys that must be given.
        takes: further keys that may be given, of those that only some kinds have.
        one_of: keys of which exactly one must be given.
        limits: rows of `schema.limits.LIMITS` that it takes where it takes limits; none: all.
        definitions: definitions of the accessible set that it takes.
        is_over_orientations: whether its grid has axes over all orientations in addition to those of the sweep file.
        cells: largest number of cells of a tile, by default.
        cost: cost of a cell, by which a run is divided into tiles.
        patterns: patterns of motion of the robots that it moves, rows of `robots.model.patterns`, by which
            `config.equivalents` chooses a robot or its equivalent; none: its class takes robots as in their files.
        by_processes: whether the command line uses several processes for its tiles by default, since much of the work
            is outside of XLA, where threads of one process wait for each other.
        variants: rows of the same name for further trajectory families.
    """

    name: str
    title: str
    description: str
    implementation: str
    quantities: tuple[str, ...]
    stored: tuple[str, ...]
    families: tuple[str, ...]
    start: Literal["rest", "point", "pose"] = "rest"
    pictured: tuple[str, ...] = ()
    motionless: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()
    one_of: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    definitions: tuple[str, ...] = ("grid", "scan", "equal-volume")
    is_over_orientations: bool = False
    over_robots: str = ""
    cells: int = LARGEST_TILE
    cost: CellCost = ORDINARY_COST
    patterns: tuple[str, ...] = ()
    stored_with: tuple[tuple[str, tuple[str, ...]], ...] = ()
    only_with: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = ()
    rows: tuple[Quantity, ...] = ()
    planned: bool = False
    by_processes: bool = False
    variants: tuple["MapKind", ...] = ()

    @property
    def forms(self) -> tuple["MapKind", ...]:
        """The row and its variants."""
        return (self, *self.variants)

    def of(self, family: str) -> "MapKind":
        """The row of a trajectory family."""
        return next((form for form in self.forms if family in form.families), self)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that may be given, of those that only some kinds have."""
        return (*self.needs, *self.takes, *self.one_of)

    def keys_of(self, quantity: str) -> tuple[str, ...]:
        """Keys without which a quantity has no values."""
        return next((keys for names, keys in self.only_with if quantity in names), ())

    def load(self) -> Any:
        """Import the class that computes this kind of map."""
        return _imported(self.implementation)

    def load_over_robots(self) -> Any:
        """Import the class that computes maps of many robots at once; None: there is none."""
        return _imported(self.over_robots) if self.over_robots else None


def _imported(implementation: str) -> Any:
    module, _, name = implementation.partition(":")
    return getattr(importlib.import_module(module), name)


_DEPTHS = ("axes.z0", "axes.inclination", "trajectory.inclination")
_OF_PLATFORMS = ("hypocycloid", "hypocycloid-standard")

_KINDS: dict[str, MapKind] = {
    kind.name: kind
    for kind in (
        MapKind(
            name="minimum-arcs",
            title="Smallest number of arcs",
            description="smallest number of arcs to each target",
            implementation="cspr_jax.families.swings.arcs_map:MinimumArcsMap",
            cost=CellCost(seconds=6e-5, limits=0.05),
            quantities=("arcs", "tried_arcs", *columns.COMMON, *columns.TOLERATED, "clearance"),
            stored=("arcs", "verdict", "duration", "margin", "feasible_at_infinity"),
            pictured=("arcs",),
            families=("hypocycloid-standard",),
            planned=True,
            patterns=("3T",),
            start="point",
            needs=("axes.z0",),
            takes=("axes.from_x", "axes.from_y", "axes.from_z", "limits", "limits.uncertainty", "obstacle"),
            stored_with=(*columns.UNCERTAIN, ("obstacle", ("clearance",))),
            only_with=((("clearance",), ("obstacle",)),),
            rows=(MOTION_CLEARANCE,),
        ),
        MapKind(
            name="minimum-oscillations",
            title="Smallest number of oscillations",
            description="smallest number of oscillations of a transition from rest to each target",
            implementation="cspr_jax.families.swings.transitions.oscillations_map:MinimumOscillationsMap",
            cost=CellCost(seconds=1e-4, limits=0.05, uncertainty=0.3),
            quantities=columns.OF_OSCILLATIONS,
            stored=columns.OSCILLATIONS_STORED,
            pictured=("oscillations",),
            families=("transition",),
            planned=True,
            patterns=("2T", "3T"),
            takes=("limits", "limits.uncertainty"),
            stored_with=columns.UNCERTAIN,
            one_of=_DEPTHS,
        ),
        MapKind(
            name="transition-envelopes",
            title="Envelopes of the pseudotensions along transitions",
            description="oscillations required at each time of a transition from rest to each target",
            implementation="cspr_jax.families.swings.transitions.envelopes_map:TransitionEnvelopesMap",
            quantities=columns.OF_INSTANTS,
            stored=columns.OF_INSTANTS,
            pictured=("lower_envelope",),
            motionless=columns.OF_INSTANTS,
            families=("transition",),
            patterns=("2T", "3T"),
            needs=("axes.tau",),
            takes=("axes.cable", "limits"),
            limits=("floor",),
            one_of=_DEPTHS,
        ),
        MapKind(
            name="poses",
            title="Smallest number of arcs to poses",
            description="smallest number of arcs of a platform to each pose",
            implementation="cspr_jax.families.platforms.orientations.poses_map:PosesMap",
            cost=CellCost(seconds=1.5e-3, limits=5.0, uncertainty=5.0),
            quantities=(*columns.OF_POSES, "clearance"),
            stored=columns.POSES_STORED,
            pictured=("arcs",),
            families=_OF_PLATFORMS,
            planned=True,
            patterns=("3R3T",),
            by_processes=True,
            start="pose",
            needs=("axes.z0",),
            takes=(
                *("axes.tilt_azimuth", "axes.tilt", "axes.torsion", "trajectory.beta_hat", "trajectory.beat"),
                *("limits", "limits.uncertainty", *columns.OBSTACLE_KEYS),
            ),
            stored_with=(*columns.UNCERTAIN, *((key, ("clearance",)) for key in columns.OBSTACLE_KEYS)),
            only_with=((("clearance",), columns.OBSTACLE_KEYS),),
            rows=(MOTION_CLEARANCE,),
        ),
        MapKind(
            name="orientations",
            title="Smallest number of arcs to accessible orientations",
            description="smallest number of arcs of a platform from rest to each orientation accessible at each place",
            implementation="cspr_jax.families.platforms.orientations.orientations_map:OrientationsMap",
            cost=CellCost(seconds=3e-4, limits=5.0, uncertainty=5.0),
            quantities=columns.OF_POSES,
            stored=columns.POSES_STORED,
            pictured=("arcs",),
            families=_OF_PLATFORMS,
            planned=True,
            patterns=("3R3T",),
            by_processes=True,
            takes=("axes.z0", "orientations", "orientations.values", "limits", "limits.uncertainty"),
            stored_with=columns.UNCERTAIN,
            definitions=("grid",),
            is_over_orientations=True,
        ),
        MapKind(
            name="orientation-workspace",
            title="Accessible orientations",
            description="orientations of a platform that are accessible at each place",
            implementation="cspr_jax.families.platforms.orientations.orientations_map:OrientationWorkspaceMap",
            cost=CellCost(orientation=3e-6),
            quantities=columns.OF_POSITIONS,
            stored=columns.OF_POSITIONS,
            pictured=("accessible_volume",),
            motionless=columns.OF_POSITIONS,
            families=_OF_PLATFORMS,
            patterns=("3R3T",),
            by_processes=True,
            takes=("orientations",),
            cells=64,
        ),
        MapKind(
            name="attainability",
            title="Accessible and attainable orientations",
            description="orientations of a platform that are accessible at each place, and attained from rest",
            implementation="cspr_jax.families.platforms.orientations.orientations_map:AttainabilityMap",
            cost=CellCost(orientation=6e-5, limits=5.0, uncertainty=5.0),
            quantities=(*columns.OF_POSITIONS, *columns.OF_ATTAINED),
            stored=(*columns.OF_POSITIONS, *columns.OF_ATTAINED),
            pictured=("attainable_fraction", "accessible_volume"),
            motionless=columns.OF_POSITIONS,
            families=_OF_PLATFORMS,
            patterns=("3R3T",),
            by_processes=True,
            takes=("axes.z0", "orientations", "orientations.values", "limits", "limits.uncertainty"),
            cells=16,
        ),
        MapKind(
            name="feasible-acceleration",
            title="Feasible accelerations",
            description="accelerations that a point mass on any number of cables can have at each place",
            implementation="cspr_jax.workspaces.accelerations_map:FeasibleAccelerationMap",
            cost=CellCost(limits=0.0),
            quantities=columns.OF_ACCELERATIONS,
            stored=columns.OF_ACCELERATIONS,
            rows=(POSE_VERDICT,),
            pictured=("acceleration_margin",),
            motionless=columns.OF_ACCELERATIONS,
            families=(),
            patterns=("2T", "3T"),
            takes=("limits",),
            limits=("tension_min", "tension_max"),
        ),
        MapKind(
            name="least-time",
            title="Least durations along straight lines",
            description="least duration of the S-model along the straight line to each target, beside the least of all",
            implementation="cspr_jax.families.lines.map:LeastTimeMap",
            cost=CellCost(limits=2.0),
            quantities=columns.OF_LINES,
            stored=columns.OF_LINES,
            pictured=("duration",),
            families=("s-curve",),
            planned=True,
            patterns=("2T", "3T"),
            start="point",
            takes=("axes.from_x", "axes.from_y", "axes.from_z", "trajectory.max_acceleration", "limits"),
            variants=(
                MapKind(
                    name="least-time",
                    title="Least durations along paths",
                    description="least duration of all motions along the path to each target, and a lower bound of it",
                    implementation="cspr_jax.families.paths.map:PathsMap",
                    cost=CellCost(seconds=0.5),
                    quantities=(*columns.OF_PATHS, *columns.TOLERATED, "clearance"),
                    stored=columns.OF_PATHS,
                    pictured=("duration",),
                    families=("path",),
                    planned=True,
                    patterns=ANY_PATTERN,
                    start="pose",
                    takes=(
                        *("axes.from_x", "axes.from_y", "axes.from_z", "trajectory.path"),
                        *("limits", "limits.uncertainty", *columns.OBSTACLE_KEYS),
                    ),
                    stored_with=(*columns.UNCERTAIN, *((key, ("clearance",)) for key in columns.OBSTACLE_KEYS)),
                    only_with=((("clearance",), columns.OBSTACLE_KEYS),),
                    rows=OF_PATHS,
                ),
                MapKind(
                    name="least-time",
                    title="Least durations of free motions",
                    description="least duration of all motions to each target that a search finds, and a lower bound",
                    implementation="cspr_jax.families.free.map:FreeMap",
                    cost=CellCost(seconds=1.0),
                    quantities=(*columns.OF_PATHS, *columns.TOLERATED, "clearance"),
                    stored=columns.OF_PATHS,
                    pictured=("duration",),
                    families=("free",),
                    planned=True,
                    patterns=ANY_PATTERN,
                    by_processes=True,
                    start="pose",
                    takes=(
                        *("axes.from_x", "axes.from_y", "axes.from_z", "axes.z0"),
                        *("limits", "limits.uncertainty", *columns.OBSTACLE_KEYS),
                    ),
                    stored_with=(*columns.UNCERTAIN, *((key, ("clearance",)) for key in columns.OBSTACLE_KEYS)),
                    only_with=((("clearance",), columns.OBSTACLE_KEYS),),
                    rows=OF_PATHS,
                ),
            ),
        ),
        MapKind(
            name="launch-range",
            title="Range of launches",
            description="least speed with which an object, released on one Bezier segment, reaches each landing place",
            implementation="cspr_jax.families.beziers.launches.launch_range_map:LaunchRangeMap",
            cost=CellCost(seconds=2e-2),
            quantities=columns.OF_LAUNCHES,
            stored=columns.OF_LAUNCHES,
            pictured=("release_speed",),
            families=("bezier",),
            patterns=("2T", "3T"),
            start="point",
            takes=("axes.from_x", "axes.from_y", "axes.from_z", "launch", "limits"),
            cells=1024,
        ),
        MapKind(
            name="swing-range",
            title="Range of throws from swings",
            description="least speed with which an object that is released from an ellipse reaches each landing place",
            implementation="cspr_jax.families.ellipses.swing_range_map:SwingRangeMap",
            cost=CellCost(seconds=3e-3),
            quantities=columns.OF_SWINGS,
            stored=columns.OF_SWINGS,
            pictured=("release_speed",),
            families=("ellipse",),
            patterns=("2T", "3T"),
            start="point",
            takes=("axes.from_x", "axes.from_y", "axes.from_z", "launch", "limits"),
            limits=("floor",),
            cells=1024,
        ),
        MapKind(
            name="ellipse",
            title="Feasible frequencies of ellipses",
            description="frequencies, margins and verdicts of turns on an ellipse about each centre",
            implementation="cspr_jax.families.ellipses.map:EllipseMap",
            cost=CellCost(seconds=2e-6, limits=1.0),
            quantities=columns.OF_ELLIPSES,
            stored=columns.ELLIPSES_STORED,
            stored_with=(("limits", columns.OF_LIMITED_ELLIPSES),),
            rows=OF_ELLIPSES,
            pictured=("margin", "verdict"),
            motionless=columns.OF_ELLIPSES,
            families=("ellipse",),
            cells=16384,
            planned=True,
            patterns=("2T", "3T"),
            takes=columns.ELLIPSE_KEYS,
        ),
        MapKind(
            name="sensitivity",
            title="Sensitivity to errors of the cable lengths",
            description="largest displacement, and turn of a platform, that errors of the cable lengths cause",
            implementation="cspr_jax.workspaces.sensitivity_map:SensitivityMap",
            cost=CellCost(seconds=1e-6),
            quantities=columns.OF_LENGTHS,
            stored=columns.OF_LENGTHS,
            pictured=("sigma_p",),
            motionless=columns.OF_LENGTHS,
            families=(),
            takes=("point",),
        ),
        MapKind(
            name="workspace",
            title="Workspace",
            description="poses that a robot of any pattern can hold, or places at which it can hold sets of them",
            implementation="cspr_jax.workspaces.map:WorkspaceMap",
            over_robots="cspr_jax.workspaces.map_over_robots:WorkspacesOfRobots",
            cost=CellCost(seconds=2e-6, limits=0.0, uncertainty=0.0),
            quantities=columns.WORKSPACE_QUANTITIES,
            stored=columns.WORKSPACES_STORED,
            stored_with=columns.WORKSPACES_STORED_WITH,
            only_with=columns.WORKSPACES_ONLY_WITH,
            rows=(POSE_VERDICT,),
            pictured=("wrench_margin", "closure_margin", "clearance", "verdict"),
            motionless=columns.WORKSPACE_QUANTITIES,
            families=(),
            takes=("workspace", "limits", "limits.uncertainty", "axes.tilt_azimuth", "axes.tilt", "axes.torsion"),
            limits=("tension_min", "tension_max", "floor", "cable_length_max", "cable_speed_max"),
        ),
    )
}
MAP_KINDS: ExtensibleRows[MapKind] = ExtensibleRows(
    _KINDS, "cspr_jax.maps", lambda module: register(module.KIND, *module.QUANTITIES)
)


def quantity_of(kind: object, name: str, settings: Mapping[str, Any] | None = None) -> Quantity:
    """The row of a quantity, with the description of a kind of map if it has one; see `row_of` for settings."""
    forms = MAP_KINDS[kind].forms if isinstance(kind, str) and kind in MAP_KINDS else ()
    return next((row for form in forms for row in form.rows if row.name == name), None) or row_of(name, settings)


def register(kind: MapKind, *quantities: Quantity) -> None:
    """Add a kind of map from outside of the package; a second time changes nothing."""
    if MAP_KINDS.get(kind.name, kind) != kind:
        raise InputError("map", kind.name, "a name that no other kind of map has")
    for name in kind.quantities:
        if name not in QUANTITIES and name not in [quantity.name for quantity in quantities]:
            raise InputError("quantities", name, "a row of schema.quantities.QUANTITIES")
    rows = [("stored", kind.stored), ("pictured", kind.pictured), ("motionless", kind.motionless)]
    rows += [("stored_with", names) for _, names in kind.stored_with]
    rows += [("only_with", names) for names, _ in kind.only_with]
    for key, names in [*rows, ("rows", tuple(row.name for row in kind.rows))]:
        for name in names:
            if name not in kind.quantities:
                raise InputError(key, name, "one of the quantities of the map")
    for quantity in quantities:
        register_quantity(quantity)
    MAP_KINDS[kind.name] = kind


@contextlib.contextmanager
def registered(kind: MapKind, *quantities: Quantity) -> Iterator[None]:
    """Add a kind of map for as long as a block lasts; see `register`."""
    register(kind, *quantities)
    try:
        yield
    finally:
        del MAP_KINDS[kind.name]
        for quantity in quantities:
            del QUANTITIES[quantity.name]


def kinds_with(key: str) -> list[str]:
    """Kinds that take a key that only some kinds have."""
    return [kind.name for kind in MAP_KINDS.values() if any(key in form.keys for form in kind.forms)]
