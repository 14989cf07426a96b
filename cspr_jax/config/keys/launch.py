"""The [launch] tables of plans, which release an object along a segment, and of maps of such launches."""

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from cspr_jax.config.keys.limits import Coordinate, Point, Positive
from cspr_jax.config.reading import Table
from cspr_jax.config.wording import table_error

ErrorMagnitude = Annotated[float, Field(ge=0.0, le=1e3)]
Seconds = Annotated[float, Field(ge=1e-6, le=1e6)]


class ErrorTable(Table):
    """Errors of a launch, from which the scatter of landing points is computed."""

    release: ErrorMagnitude = Field(0.0, description="standard deviation of the time of release, s")
    cable_length: ErrorMagnitude = Field(
        0.0, description="standard deviation of the length of each cable at the release, m"
    )
    cable_speed: ErrorMagnitude = Field(0.0, description="standard deviation of the rate of each cable's length, m/s")
    encoder: ErrorMagnitude = Field(
        0.0, description="largest error of each cable's length due to the resolution of its encoder, m"
    )
    throws: Annotated[int, Field(ge=2, le=1_000_000)] = Field(10_000, description="number of throws in the sample")
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(0, description="seed of the random sample")


class LaunchTable(Table):
    """Launch of an object."""

    segment: Annotated[int, Field(ge=0)] = Field(
        description="number, from 0 on, of the pose at which the segment of the release starts. bezier: the next pose "
        "has no position, since the launch determines it; ellipse: the object leaves at the end of the segment, and "
        "the next pose has an ellipse without axes, which the launch determines"
    )
    target: Point = Field(description="where the object is to arrive, [x, y, z], m")
    point: Point | None = Field(None, description="place of the release, [x, y, z], m; absent: velocity determines it")
    velocity: Point | None = Field(
        None,
        description="velocity at the target, [x, y, z], m/s; absent: point and the time of the flight determine it",
    )
    time: Seconds | None = Field(None, description="time of the flight, s; absent: `choose` finds it")
    choose: Literal["energy", "time"] | None = Field(
        None,
        description='in place of time: "energy", the least kinetic energy at the release, or "time", the earliest '
        "landing, by search",
    )
    release: Seconds | None = Field(
        None, description="bezier: time of the release after the start of the segment, s; absent: chosen by search"
    )

    errors: ErrorTable | None = Field(None, description="[launch.errors], errors whose scatter is computed")

    @model_validator(mode="after")
    def _one_parabola(self) -> "LaunchTable":
        if self.point is None and self.velocity is None:
            raise table_error("point", None, "the place of the release, or velocity at the target: one of them")
        if self.point is not None and self.velocity is not None:
            for name in ("time", "choose"):
                if getattr(self, name) is not None:
                    raise table_error(
                        name, getattr(self, name), "cannot be combined with point and velocity, which tell it"
                    )
            return self
        if (self.time is None) == (self.choose is None):
            allowed = 'a time of flight, or choose = "energy" or "time": one of them'
            raise table_error("time", self.time, allowed)
        return self


Interval = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
_OF_RELEASES = "least and largest {} of the release, [least, largest], m; absent: {}"
_ASIDE = "from twice the robot's size on one side of the centroid of the spools to as far on the other"


class LaunchSearch(Table):
    """Bounds within which maps of launches search for a release."""

    release_x: Interval | None = Field(None, description=_OF_RELEASES.format("x", _ASIDE))
    release_y: Interval | None = Field(None, description=_OF_RELEASES.format("y", _ASIDE))
    release_z: Interval | None = Field(
        None, description=_OF_RELEASES.format("z", "from the centroid down to four times the robot's size below it")
    )
    max_duration: Positive | None = Field(
        None,
        description="longest duration of a segment that is tried, s; absent: 40 times the root of the robot's size "
        "over gravity",
    )
    population: Annotated[int, Field(ge=16, le=512)] = Field(
        64, description="number of launches that the search of a cell improves; twice as many take four times as long"
    )

    @field_validator("release_x", "release_y", "release_z")
    @classmethod
    def _ordered(cls, ends: list[float] | None) -> list[float] | None:
        if ends is not None and not ends[0] <= ends[1]:
            raise ValueError("[least, largest], the first not above the second")
        return ends
