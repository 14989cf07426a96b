"""Tables of obstacles in sweep and plan files, and keys of the platform's shape; without jax."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from cspr_jax.config.keys.limits import Coordinate, NotTiny, Point
from cspr_jax.config.reading import Table
from cspr_jax.config.wording import table_error
from cspr_jax.errors import InputError
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.tolerances import UNIT_NORM
from cspr_jax.robots.model import shapes

MAX_OBSTACLES, MAX_CORNERS = 1000, 1000
Extent = Annotated[float, Field(ge=0.0, le=shapes.LARGEST_LENGTH)]
Radius = Annotated[float, Field(gt=0.0, le=shapes.LARGEST_LENGTH), NotTiny]
EdgeLengths = Annotated[list[Extent], Field(min_length=3, max_length=3)]
Component = Annotated[float, Field(ge=-1.1, le=1.1)]
Quaternion = Annotated[list[Component], Field(min_length=4, max_length=4)]
Corners = Annotated[list[Point], Field(min_length=2, max_length=2)]
Points = Annotated[list[Point], Field(min_length=4, max_length=MAX_CORNERS)]
HullOf = Annotated[
    Annotated[bool, Tag("~true")] | Annotated[Points, Tag("~points")],
    Discriminator(lambda value: "~points" if isinstance(value, list) else "~true"),
]

# Required and optional keys of each kind of obstacle.
_KEYS_OF_KIND: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "sphere": (("centre", "radius"), ()),
    "cylinder": (("start", "end", "radius"), ()),
    "box": ((), ("corners", "centre", "size", "quaternion")),
}


class ObstacleTable(Table):
    """An obstacle fixed in space."""

    kind: Literal["sphere", "cylinder", "box"] = Field(description='shape: "sphere", "cylinder" or "box"')
    name: str | None = Field(None, min_length=1, max_length=200, description="name of the obstacle; absent: its kind")
    centre: Point | None = Field(None, description="sphere, box: centre [x, y, z], axes of the robot file, m")
    radius: Radius | None = Field(None, description="sphere, cylinder: radius, m")
    start: Point | None = Field(None, description="cylinder: one end of its axis, [x, y, z], m")
    end: Point | None = Field(
        None, description="cylinder: the other end of its axis, m; half a ball of its radius lies beyond both ends"
    )
    size: EdgeLengths | None = Field(None, description="box: lengths of its edges along its own axes, m")
    quaternion: Quaternion | None = Field(
        None, description="box: orientation, scalar first (default [1, 0, 0, 0], along the axes of the robot file)"
    )
    corners: Corners | None = Field(
        None,
        description="box along the axes: [[x, y, z], [x, y, z]], least and largest corner, m; in place of centre and "
        "size",
    )

    @model_validator(mode="after")
    def _of_its_kind(self) -> "ObstacleTable":
        needed, allowed = _KEYS_OF_KIND[self.kind]
        for name in needed:
            if getattr(self, name) is None:
                raise table_error(name, None, f"a {self.kind} needs it")
        for name in ("centre", "radius", "start", "end", "size", "quaternion", "corners"):
            if getattr(self, name) is not None and name not in (*needed, *allowed):
                raise table_error(name, getattr(self, name), f"absent: a {self.kind} has none")
        if self.kind == "box":
            self._check_box()
        return self

    def _check_box(self) -> None:
        if self.corners is None:
            for name in ("centre", "size"):
                if getattr(self, name) is None:
                    raise table_error(name, None, "a box needs centre and size, or corners")
        else:
            for name in ("centre", "size", "quaternion"):
                if getattr(self, name) is not None:
                    raise table_error(name, getattr(self, name), "cannot be combined with corners")
            _check_corners("corners", self.corners)
        if self.quaternion is not None and not _is_unit(self.quaternion):
            raise table_error("quaternion", self.quaternion, "a unit quaternion, scalar first")

    def shape(self) -> shapes.Obstacle:
        """The shape."""
        name = self.name or self.kind
        if self.kind == "sphere" and self.radius is not None:
            return shapes.sphere(self.centre, self.radius, name=name)
        if self.kind == "cylinder" and self.radius is not None:
            return shapes.cylinder(self.start, self.end, self.radius, name=name)
        if self.corners is not None:
            return shapes.box_between(*self.corners, name=name)
        return shapes.box(self.centre, self.size, self.quaternion or IDENTITY, name=name)


Obstacles = Annotated[list[ObstacleTable], Field(max_length=MAX_OBSTACLES)]


class PlatformShapeKeys(Table):
    """Shape of the platform, which its cables must not touch."""

    platform_box: Corners | None = Field(
        None,
        description="the platform's box, [[x, y, z], [x, y, z]], least and largest, platform axes, m; cables must not "
        "meet it, nor it obstacles; if platform_hull is absent too, the shape is ignored",
    )
    platform_hull: HullOf | None = Field(
        None,
        description="in place of platform_box: points whose convex hull is the platform's shape, platform axes, m; "
        "true: the points where the cables are attached",
    )

    @model_validator(mode="after")
    def _one_shape(self) -> "PlatformShapeKeys":
        if self.platform_box is not None and self.platform_hull is not None:
            raise table_error("platform_hull", self.platform_hull, "cannot be combined with platform_box")
        if self.platform_box is not None:
            _check_corners("platform_box", self.platform_box)
        if self.platform_hull is False:
            raise table_error("platform_hull", False, "true, a list of points, or absent")
        if isinstance(self.platform_hull, list):
            try:
                shapes.hull(self.platform_hull)
            except InputError as error:
                raise table_error(
                    "platform_hull", self.platform_hull, "four points or more, not all in a plane"
                ) from error
        return self

    def body(
        self,
        centre_of_mass: Sequence[Coordinate] = (0.0, 0.0, 0.0),
        platform_points: Sequence[Sequence[Coordinate]] = (),
    ) -> shapes.Body | None:
        """The shape."""
        if self.platform_box is not None:
            low, high = ([x - c for x, c in zip(corner, centre_of_mass, strict=True)] for corner in self.platform_box)
            return shapes.box_between(low, high, name="platform")
        if self.platform_hull is not None:
            hull_points = self.platform_hull if isinstance(self.platform_hull, list) else platform_points
            points = [[x - c for x, c in zip(point, centre_of_mass, strict=True)] for point in hull_points]
            return shapes.hull(points, name="platform")
        return None


class ObstacleKeys(PlatformShapeKeys):
    """Bodies that a robot must not touch while it moves."""

    obstacle: Obstacles | None = Field(None, description="[[obstacle]], bodies fixed in space that nothing may meet")

    @property
    def bodies(self) -> list[shapes.Obstacle]:
        """The obstacles, in the axes of the robot file."""
        return [table.shape() for table in self.obstacle or ()]

    @property
    def obstacle_keys(self) -> tuple[str, ...]:
        """Names of the keys of obstacles and shapes that are given."""
        return tuple(name for name in ObstacleKeys.model_fields if getattr(self, name) is not None)


def _check_corners(key: str, corners: list[list[float]]) -> None:
    if any(low > high for low, high in zip(*corners, strict=True)):
        raise table_error(key, corners, "[least, largest], no coordinate of the first above the second's")


def _is_unit(quaternion: list[float]) -> bool:
    return abs(sum(x * x for x in quaternion) ** 0.5 - 1.0) <= UNIT_NORM
