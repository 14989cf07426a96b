"""Keys of free motions in a plan."""

from typing import Annotated, Literal

from pydantic import Field

from cspr_jax.config.keys.limits import Point, Positive
from cspr_jax.config.reading import Table


class FreeMotionKeys(Table):
    """Keys that only plans of free motions have."""

    objective: Literal["time", "energy", "tension", "margin"] | None = Field(
        None,
        description='free: what the motion is the best in: "time" (the default) and "energy", the integral of the sum '
        'of the squares of the tensions, are least; "tension", the largest one as a fraction of tension_max, is least; '
        '"margin" of all tensions is largest',
    )
    duration_max: Positive | None = Field(
        None, description='free: longest duration of a segment, s; needed with objective = "tension" and "margin"'
    )
    end_accelerations: Literal["free", "swing"] | list[Point] | None = Field(
        None,
        description='free: accelerations at the poses: "free" (the default), "swing", those of swings about P0, so '
        "that hypocycloids can precede and follow, or one [x, y, z] for each pose, m/s^2; 0 where rest = true",
    )
    together: bool | None = Field(
        None,
        description="free: whether all poses that the family joins are passed in the least time together (true, the "
        "default), or one segment after the other is",
    )
    starts: Annotated[int, Field(ge=1, le=64)] | None = Field(
        None,
        description="free: number of motions from which the search of a segment begins (default 8, in a plane 6): "
        "lines, curved lines, and swings of 1, 2, ... arcs",
    )
    search_time: Positive | None = Field(
        None,
        description="free: time after which the search ends, s, of each segment with together = false; the best motion "
        "so far is proved",
    )
