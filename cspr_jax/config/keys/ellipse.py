"""Keys of harmonic ellipses, in a plan, in one of its poses, or in a sweep; without jax."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from cspr_jax.config.keys.limits import Point, Positive, has_direction
from cspr_jax.config.keys.trajectory import Angle
from cspr_jax.config.reading import Table
from cspr_jax.config.wording import table_error
from cspr_jax.errors.given_numbers import SMALLEST
from cspr_jax.numerics.shapes import Float


class Hertz(Table):
    """A frequency in turns a second."""

    hertz: Positive = Field(description="turns a second, Hz")


def _kind(value: Any) -> str:
    if isinstance(value, str):
        return "~choice"
    return "~hertz" if isinstance(value, dict | Hertz) else "~number"


Frequency = Annotated[
    Annotated[Positive, Tag("~number")]
    | Annotated[Literal["natural", "best", "fastest", "slowest"], Tag("~choice")]
    | Annotated[Hertz, Tag("~hertz")],
    Discriminator(_kind),
]


class OscillationTable(Table):
    """Oscillation of a platform about its orientation, one period for each turn of the ellipse."""

    axis: Point = Field(description="direction [x, y, z] of the axis, fixed axes")
    angle: Angle = Field(description="largest angle, rad")
    phase: Angle = Field(0.0, description="angle of the ellipse at which it is reached, rad")

    @model_validator(mode="after")
    def _has_axis(self) -> "OscillationTable":
        if not has_direction(self.axis):
            raise table_error("axis", self.axis, f"a direction, of length {SMALLEST:g} at least")
        return self


SweepFrequency = Annotated[
    Annotated[Positive, Tag("~number")]
    | Annotated[Literal["natural", "best"], Tag("~choice")]
    | Annotated[Hertz, Tag("~hertz")],
    Discriminator(_kind),
]


class EllipseShape(Table):
    """Dimensions and attitude of an ellipse."""

    half_axes: Annotated[list[Point], Field(min_length=1, max_length=2)] | None = Field(
        None,
        description="[a, b], vectors [x, y, z] each, m; [a] alone: to and fro along a line; absent, like radius, where "
        "a launch determines them",
    )
    radius: Positive | None = Field(None, description="of a circle, in place of half_axes, m")
    normal: Point | None = Field(
        None,
        description="direction [x, y, z] about which the circle turns; absent: z of the robot file, of a planar robot "
        "y",
    )

    @model_validator(mode="after")
    def _one_shape(self) -> "EllipseShape":
        if self.half_axes is not None and self.radius is not None:
            raise table_error("radius", self.radius, "half_axes, or the radius of a circle: one of them")
        if self.half_axes is not None:
            if self.normal is not None:
                raise table_error("normal", self.normal, "absent beside half_axes")
            if not any(has_direction(axis) for axis in self.half_axes):
                raise table_error("half_axes", self.half_axes, f"one or two axes, one of length {SMALLEST:g} at least")
        if self.normal is not None and not has_direction(self.normal):
            raise table_error("normal", self.normal, f"a direction, of length {SMALLEST:g} at least")
        return self

    def axes(self, *, is_planar: bool) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Half-axes, in the axes of the file."""
        if self.half_axes is None:
            radius = 1.0 if self.radius is None else self.radius
            return circle_axes(radius, self.normal, is_planar=is_planar)
        a, b = [np.asarray(axis, float) for axis in (*self.half_axes, [0.0, 0.0, 0.0])][:2]
        return a, b


class EllipseTable(EllipseShape):
    """Harmonic ellipse: centre + a cos(angle) + b sin(angle), with an angle that grows with the frequency."""

    centre: Point = Field(description="centre [x, y, z], m")
    frequency: Frequency = Field(
        "natural",
        description='rad/s, { hertz = ... }, "natural" (of a pendulum from the plane of the spools to the centre), '
        '"best" (the largest margin), "fastest" or "slowest" (within all limits)',
    )
    phase: Angle = Field(0.0, description="angle at which the ellipse is reached, rad; 0: at centre + a")
    oscillation: OscillationTable | None = Field(
        None, description="platforms: oscillation about the orientation of the pose; absent: none"
    )


class SweepEllipse(EllipseShape):
    """Ellipse of every cell of a map."""

    frequency: SweepFrequency = Field(
        "best",
        description="frequency of verdicts and margins where there is no axis of frequencies: rad/s, { hertz = ... }, "
        '"natural" (of a pendulum from the plane of the spools to the centre) or "best" (the largest margin)',
    )


def circle_axes(
    radius: float, normal: Any, *, is_planar: bool
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Half-axes of a circle: the first as near to x, or y, as the normal allows."""
    default = np.eye(3)[1 if is_planar else 2]
    axis = default if normal is None else np.asarray(normal, float)
    axis = axis / np.linalg.norm(axis)
    nearest = np.eye(3)[0 if abs(axis[0]) < 0.9 else 1]
    a = nearest - (nearest @ axis) * axis
    a *= radius / np.linalg.norm(a)
    return a, np.cross(axis, a)


def cell_axes(
    table: SweepEllipse, coordinates: Mapping[str, Any], *, is_planar: bool
) -> tuple[Float[np.ndarray, "... 3"], Float[np.ndarray, "... 3"]]:
    """Half-axes of the ellipses of cells of a map, in the axes of the file."""
    scale = np.asarray(coordinates.get("circle_radius", coordinates.get("scale", 1.0)), float)[..., None]
    tilt, azimuth = (np.asarray(coordinates.get(name, 0.0), float)[..., None] for name in ("tilt", "tilt_azimuth"))
    level = np.concatenate([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=-1)

    def rotated(axis: np.ndarray) -> np.ndarray:
        # Rotate about the level direction.
        along = level * (level @ axis)[..., None]
        return scale * (along + np.cos(tilt) * (axis - along) + np.sin(tilt) * np.cross(level, axis))

    a, b = table.axes(is_planar=is_planar)
    return rotated(a), rotated(b)


# Keys of a plan that is one ellipse.
ELLIPSE_KEYS = tuple(EllipseTable.model_fields)
