"""Keys of paths that a motion runs along in the least time, in a plan or in one of its poses; without jax."""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from cspr_jax.config.keys.limits import NotNegative, Point, Positive, has_direction
from cspr_jax.config.keys.trajectory import Angle, Quaternion
from cspr_jax.config.reading import Table
from cspr_jax.config.wording import either, table_error
from cspr_jax.errors import shown
from cspr_jax.errors.given_numbers import SMALLEST
from cspr_jax.schema.limits import LARGEST_GRID

# Keys of the shape of a path, with the kinds that take them.
_ALL = ("line", "polyline", "cubic", "quintic", "arc", "circle", "csv", "gcode")
_KINDS = {
    "points": ("line", "polyline", "cubic", "quintic"),
    "file": ("csv", "gcode"),
    "interpolation": ("csv",),
    "centre": ("arc", "circle"),
    "start": ("arc", "circle"),
    "normal": ("arc", "circle"),
    "angle": ("arc",),
    "orientations": _ALL,
    "closed": ("line", "polyline", "cubic", "quintic", "csv"),
    "corner": ("polyline", "csv", "gcode"),
    "blend_tolerance": ("polyline", "csv", "gcode"),
}
_NEEDED = {"arc": ("centre", "angle"), "circle": ("centre",), "csv": ("file",), "gcode": ("file",)}
GRID, RAMP_TIME = 500, 0.1
# Positions closer together than this are the same, m.
SAME_PLACE = 1e-9
# Number of intervals of a path's grid in maps, which time many paths.
MAP_GRID = 200
MAX_POINTS = 100_000
GridSize = Annotated[int, Field(ge=2, le=LARGEST_GRID)]


class PathTable(Table):
    """Path that a motion follows in the least time."""

    kind: Literal["line", "polyline", "cubic", "quintic", "arc", "circle", "csv", "gcode"] = Field(
        "line",
        description='"line", straight lines with a stop at every point, the default; "polyline", straight lines; '
        '"cubic" (C2) or "quintic" (C4), a spline through the points; "arc"; "circle"; "csv", a file of points; '
        '"gcode", a file of G-code',
    )
    points: Annotated[list[Point], Field(min_length=1, max_length=MAX_POINTS)] | None = Field(
        None,
        description="points [x, y, z], m: of a plan all of them, of a pose those between the pose before and this one",
    )
    file: str | None = Field(None, min_length=1, description="csv, gcode: the file, from the folder of the plan")
    interpolation: Literal["polyline", "cubic", "quintic"] | None = Field(
        None, description='csv: path through the points of the file, by its kind; absent: "polyline"'
    )
    centre: Point | None = Field(None, description="arc, circle: centre [x, y, z], m")
    start: Point | None = Field(
        None, description="arc, circle: where it begins, [x, y, z], m; of a pose absent: at the pose before"
    )
    normal: Point | None = Field(
        None,
        description="arc, circle: direction [x, y, z] about which it turns, by the rule of the right hand; absent: z "
        "of the robot file, of a planar robot y",
    )
    angle: Angle | None = Field(None, description="arc: by which it turns, rad; negative: the other way")
    orientations: Annotated[list[Quaternion], Field(min_length=1, max_length=MAX_POINTS)] | None = Field(
        None,
        description="platforms: unit quaternions [w, x, y, z], one for each point (arc, circle: for start and end), or "
        "one for all; absent: those of the poses, else the reference orientation",
    )
    closed: bool | None = Field(None, description="whether the path ends where it begins (default false)")
    corner: Literal["stop", "blend"] | None = Field(
        None,
        description='polyline, csv, gcode: at corners "stop", the default, or "blend", a curve in place of each of '
        "them, continuous in direction and curvature",
    )
    blend_tolerance: Positive | None = Field(
        None, description="largest distance of a blended path from the corner, m; needed to blend"
    )
    start_speed: NotNegative | None = Field(None, description="speed where the path begins, m/s (default 0)")
    end_speed: NotNegative | None = Field(None, description="speed where the path ends, m/s (default 0)")
    grid: GridSize | None = Field(
        None, description=f"number of cells into which each part of the path without a stop is cut (default {GRID})"
    )
    ramp_time: NotNegative | None = Field(
        None,
        description=f"time in which accelerations, and so tensions, rise and fall, s (default {RAMP_TIME}); 0: they "
        "jump",
    )

    @model_validator(mode="after")
    def _of_its_kind(self) -> "PathTable":
        for key, kinds in _KINDS.items():
            value = getattr(self, key)
            if value is not None and self.kind not in kinds:
                raise table_error(key, shown(value), f"absent unless kind = {either(kinds)}")
        for key in _NEEDED.get(self.kind, ()):
            if getattr(self, key) is None:
                raise table_error(key, None, f"a path of kind {self.kind} needs it")
        for key in ("orientations", "closed") if self.kind in _KINDS["points"] and self.points is None else ():
            if getattr(self, key) is not None:
                raise table_error(key, shown(getattr(self, key)), "absent without points")
        if self.angle is not None and abs(self.angle) < SMALLEST:
            raise table_error("angle", self.angle, f"an angle of {SMALLEST:g} at least, of either sign")
        if self.normal is not None and not has_direction(self.normal):
            raise table_error("normal", self.normal, f"a direction, of length {SMALLEST:g} at least")
        if (self.corner == "blend") != (self.blend_tolerance is not None):
            if self.blend_tolerance is None:
                raise table_error("blend_tolerance", None, 'a distance in m, with corner = "blend"')
            raise table_error("blend_tolerance", self.blend_tolerance, 'absent unless corner = "blend"')
        if self.corner is not None and self.interpolation in ("cubic", "quintic"):
            raise table_error("corner", shown(self.corner), 'absent unless interpolation = "polyline"')
        return self

    @property
    def is_whole(self) -> bool:
        """Tell whether the table defines the path itself, and not only how poses are joined."""
        return self.points is not None or self.kind in _NEEDED

    @property
    def has_end(self) -> bool:
        """Tell whether the table says where the path ends, so that no pose is needed there."""
        return self.kind in _NEEDED or bool(self.closed)

    @property
    def has_start(self) -> bool:
        """Tell whether the table says where the path begins."""
        return self.file is not None or self.start is not None

    @property
    def curve(self) -> str:
        """Kind of the curve through the points, whether they stand in the table or in a file."""
        return (self.interpolation or "polyline") if self.kind == "csv" else self.kind

    def beside(self, plan: "PathTable | None") -> "PathTable":
        """Table of a pose, completed by what the plan says about all paths."""
        common: dict[str, Any] = {} if plan is None else {name: getattr(plan, name) for name in ("grid", "ramp_time")}
        return self.model_copy(update={name: value for name, value in common.items() if getattr(self, name) is None})


class TargetPath(Table):
    """Path from the start to each target of a map."""

    lift: Positive | None = Field(
        None,
        description="height, m, by which paths go straight up from the start, then straight across to above the "
        "target, and down to it; absent: straight lines",
    )
    blend_tolerance: Positive | None = Field(
        None,
        description="largest distance of a path from the corners above start and target, m, with lift; absent: stops "
        "there",
    )
    grid: GridSize | None = Field(
        None, description=f"number of cells into which each part of a path without a stop is cut (default {MAP_GRID})"
    )
    ramp_time: NotNegative | None = Field(
        None, description=f"time in which accelerations rise and fall, s (default {RAMP_TIME}); 0: they jump"
    )

    @model_validator(mode="after")
    def _blends_a_lift(self) -> "TargetPath":
        if self.lift is None and self.blend_tolerance is not None:
            raise table_error(
                "blend_tolerance", self.blend_tolerance, "absent without lift: straight lines have no corners"
            )
        return self

    def between(self, start: Sequence[float], end: Sequence[float], z_axis: str) -> PathTable | None:
        """Path from the start to a target, as a table of a plan."""
        options: dict[str, Any] = {
            "grid": MAP_GRID if self.grid is None else self.grid,
            "ramp_time": RAMP_TIME if self.ramp_time is None else self.ramp_time,
        }
        stays = math.dist(start, end) <= SAME_PLACE
        if self.lift is None:
            return None if stays else PathTable(kind="line", **options)
        rise = self.lift if z_axis == "up" else -self.lift
        above = [[float(x), float(y), float(z) + rise] for x, y, z in ([start] if stays else [start, end])]
        if self.blend_tolerance is not None:
            options |= {"corner": "blend", "blend_tolerance": self.blend_tolerance}
        return PathTable(kind="polyline", points=above, **options)
