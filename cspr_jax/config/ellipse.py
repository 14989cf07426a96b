"""Keys of harmonic ellipses, in a plan or in one of its poses."""

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from cspr_jax.config.limits import Point, Positive
from cspr_jax.config.reading import Table
from cspr_jax.config.trajectory import Angle
from cspr_jax.config.wording import fault


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
    """Oscillation of a platform about its orientation, once a turn."""

    axis: Point = Field(description="direction [x, y, z] of the axis, fixed axes")
    angle: Angle = Field(description="largest angle, rad")
    phase: Angle = Field(0.0, description="angle of the ellipse at which it is reached, rad")

    @model_validator(mode="after")
    def _has_axis(self) -> "OscillationTable":
        if not any(self.axis):
            raise fault("axis", self.axis, "a direction that is not zero")
        return self


class EllipseTable(Table):
    """Harmonic ellipse: centre + a cos(angle) + b sin(angle), with an angle that grows with the frequency."""

    centre: Point = Field(description="centre [x, y, z], m")
    half_axes: Annotated[list[Point], Field(min_length=1, max_length=2)] | None = Field(
        None,
        description="[a, b], vectors [x, y, z] each, m; [a] alone: to and fro along a line; absent, like radius, where "
        "a launch determines them",
    )
    radius: Positive | None = Field(None, description="of a circle, in place of half_axes, m")
    normal: Point | None = Field(
        None,
        description="direction [x, y, z] about which the circle turns; absent: z of the file, of a planar robot y",
    )
    frequency: Frequency = Field(
        "natural",
        description='rad/s, { hertz = ... }, "natural" (of a pendulum from the plane of the spools to the centre), '
        '"best" (the largest margin), "fastest" or "slowest" (within all limits)',
    )
    phase: Angle = Field(0.0, description="angle at which the ellipse is reached, rad; 0: at centre + a")
    oscillation: OscillationTable | None = Field(
        None, description="platforms: oscillation about the orientation of the pose; absent: none"
    )

    @model_validator(mode="after")
    def _one_shape(self) -> "EllipseTable":
        if self.half_axes is not None and self.radius is not None:
            raise fault("radius", self.radius, "half_axes, or the radius of a circle: one of them")
        if self.half_axes is not None:
            if self.normal is not None:
                raise fault("normal", self.normal, "absent beside half_axes")
            if not any(any(axis) for axis in self.half_axes):
                raise fault("half_axes", self.half_axes, "one or two axes of which at least one is not zero")
        if self.normal is not None and not any(self.normal):
            raise fault("normal", self.normal, "a direction that is not zero")
        return self


# Keys of a plan that is one ellipse.
WHOLE = tuple(EllipseTable.model_fields)
