"""Poses of plan files."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from cspr_jax.config.keys.ellipse import EllipseTable
from cspr_jax.config.keys.launch import Seconds
from cspr_jax.config.keys.limits import Point
from cspr_jax.config.keys.path import PathTable
from cspr_jax.config.keys.trajectory import BetaHat, FamilyName, Quaternion, TiltTorsion
from cspr_jax.config.reading import Table
from cspr_jax.schema.limits import LARGEST_MAX_ARCS

LARGEST_TIME = 1e9
Vector = Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=3, max_length=3)]
Duration = Annotated[
    Annotated[Seconds, Tag("~number")] | Annotated[Literal["least"], Tag("~least")],
    Discriminator(lambda value: "~least" if isinstance(value, str) else "~number"),
]

Turns = Annotated[float, Field(ge=0.0, le=1e6)]


class Pose(Table):
    """One pose of the sequence."""

    position: Point | None = Field(
        None,
        description="target [x, y, z], m; of a platform that of its mass centre, unless the plan's `point` says "
        "otherwise; a rest pose may leave it out",
    )
    rest: bool = Field(False, description="true: at rest in P0, below the centroid of the spools")
    tilt_torsion: TiltTorsion | None = Field(
        None,
        description="platform: orientation [phi, theta, sigma], Z_phi X_theta Z_(sigma - phi), rad; phi from the "
        "direction of the target seen from the vertical through the centroid",
    )
    quaternion: Quaternion | None = Field(
        None,
        description="platform: orientation [w, x, y, z], a unit quaternion, in place of tilt_torsion; it counts "
        "from the reference orientation",
    )
    beta_hat: BetaHat | None = Field(
        None,
        description="platform: beta-hat at this pose, which fixes its angular acceleration, thesis (3.81); absent: "
        "found by search",
    )
    arcs: Annotated[int, Field(ge=1, le=LARGEST_MAX_ARCS)] | None = Field(
        None,
        description="number of arcs of the segment that ends here; 2 n for n oscillations; absent: found by search",
    )
    duration: Duration | None = Field(
        None, description='bezier: duration of the segment that ends here, s, or "least", the default'
    )
    family: FamilyName | None = Field(
        None, description="family of the segment that ends here, in place of the plan's; not at the first pose"
    )
    time: Annotated[float, Field(ge=-LARGEST_TIME, le=LARGEST_TIME)] | None = Field(
        None,
        description="spline: time of this pose, s; of a leg's first pose 0 where it is absent. Only differences "
        "between poses count",
    )
    velocity: Vector | None = Field(
        None,
        description="spline, free: velocity at this pose, m/s; of inner poses of splines with interpolation = "
        '"hermite" alone; absent: as `ends` says, and of free motions 0',
    )
    acceleration: Vector | None = Field(None, description="spline: acceleration at this pose, m/s^2, likewise")
    motion: str | None = Field(
        None,
        min_length=1,
        description="spline: file of the motion that ends at this pose, in place of poses with times",
    )
    trajectory: str | None = Field(
        None, min_length=1, description="spline: `id` of one of several trajectories that a file of CASPR holds"
    )
    ellipse: EllipseTable | None = Field(
        None,
        description="ellipse: ellipse that is reached at this pose; absent, and not at rest: that of the pose before",
    )
    turns: Turns | None = Field(
        None,
        description="ellipse: turns on the ellipse of this pose once it is reached (default 0, where the pose before "
        "has the same ellipse 1)",
    )
    path: PathTable | None = Field(
        None, description="path: path from the pose before to this one; absent: as [path] of the plan says"
    )
