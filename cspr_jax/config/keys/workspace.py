"""The [workspace] table of sweeps: conditions that a pose must meet to belong to the workspace."""

import math
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from cspr_jax.config.keys.limits import NotTiny
from cspr_jax.config.keys.obstacles import ObstacleKeys, Obstacles
from cspr_jax.config.keys.trajectory import Quaternion
from cspr_jax.config.reading import Table
from cspr_jax.config.wording import table_error

Condition = Literal["static", "wrench-feasible", "wrench-closure", "interference-free"]
Component = Annotated[float, Field(ge=-1e12, le=1e12)]
Speed = Annotated[float, Field(gt=0.0, le=1e6), NotTiny]
HalfWidths = Annotated[list[Annotated[float, Field(ge=0.0, le=1e12)]], Field(min_length=1, max_length=6)]


class PoseConditions(Table):
    """Conditions of poses, and of sets of orientations."""

    conditions: Annotated[list[Condition], Field(min_length=1, max_length=4)] = Field(
        ["wrench-feasible"],
        description='"static": taut cables hold the weight; "wrench-feasible": tensions within their limits supply '
        'all wrenches; "wrench-closure": cables that are pulled hard enough resist every wrench; "interference-free": '
        "no two cables meet, nor a cable or the platform the bodies of obstacle, platform_box and platform_hull",
    )
    orientation: Quaternion | None = Field(
        None, description="orientation of a platform, a unit quaternion, scalar first; absent: that of the robot file"
    )
    orientations: Literal["inclusion", "total", "maximum", "dextrous"] | None = Field(
        None,
        description='map the places at which a platform can have some orientation ("inclusion") or every one ("total") '
        'of the set of tilt_max and torsion_max or of quaternions; some ("maximum") or every one ("dextrous") of all '
        "orientations; absent: one orientation, or those of the axes",
    )
    tilt_max: Annotated[float, Field(ge=0.0, le=math.pi)] | None = Field(
        None,
        description="inclusion, total: largest tilt from orientation, or largest rotation of a planar platform, rad",
    )
    torsion_max: Annotated[float, Field(ge=0.0, le=math.pi)] | None = Field(
        None, description="with tilt_max: largest absolute torsion, rad; absent: 0"
    )
    quaternions: Annotated[list[Quaternion], Field(min_length=1, max_length=100_000)] | None = Field(
        None, description="inclusion, total: list of the orientations, in place of tilt_max"
    )
    divisions: Annotated[int, Field(ge=2, le=128)] | None = Field(
        None, description="sets of orientations: their step is pi / divisions; absent: 12"
    )
    prove: bool | None = Field(
        None,
        description="true: prove that whole cells, boxes half-way to the next points, lie inside or outside; "
        "only for one orientation",
    )
    wrenches: Annotated[list[list[Component]], Field(min_length=1, max_length=64)] | None = Field(
        None,
        description="wrench-feasible: wrenches that the cables must supply, forces, N, then moments about the mass "
        "centre, or the joint, N m; as many numbers each as degrees of freedom; absent: the wrench that holds the "
        "weight",
    )

    wrench_box: HalfWidths | None = Field(
        None, description="wrench-feasible: half widths of a box of wrenches about each of `wrenches`, N and N m"
    )
    wrench_ellipsoid: HalfWidths | None = Field(
        None, description="wrench-feasible: semi-axes of an ellipsoid of wrenches about each of `wrenches`, N and N m"
    )
    acceleration: Annotated[float, Field(ge=0.0, le=1e6)] | None = Field(
        None,
        description="wrench-feasible: radius of a ball of accelerations of the mass centre that the cables must give "
        "in addition, m/s^2",
    )

    capacity_length: Annotated[float, Field(gt=0.0, le=1e6), NotTiny] | None = Field(
        None,
        description="wrench-feasible: also store capacity margins, with moments divided by this length, m (any for "
        "point masses)",
    )

    @field_validator("conditions")
    @classmethod
    def _once(cls, names: list[str]) -> list[str]:
        if len(set(names)) < len(names):
            raise ValueError("a list without repetitions")
        return names

    @model_validator(mode="after")
    def _one_set(self) -> "PoseConditions":
        is_of_some = self.orientations in ("inclusion", "total")
        for name in ("tilt_max", "quaternions"):
            if getattr(self, name) is not None and not is_of_some:
                raise table_error(
                    name, getattr(self, name), 'absent: workspace.orientations is neither "inclusion" nor "total"'
                )
        if is_of_some and (self.tilt_max is None) == (self.quaternions is None):
            raise table_error(
                "tilt_max", self.tilt_max, f'given, or quaternions, one of them, with "{self.orientations}"'
            )
        if self.prove and self.orientations is not None:
            raise table_error("prove", True, "cannot be combined with workspace.orientations")
        if self.torsion_max is not None and self.tilt_max is None:
            raise table_error("torsion_max", self.torsion_max, "absent without tilt_max")
        if self.divisions is not None and (self.orientations is None or self.quaternions is not None):
            raise table_error("divisions", self.divisions, "absent: there is no set of orientations to divide")
        return self

    @model_validator(mode="after")
    def _somebody_asks(self) -> "PoseConditions":
        for name in ("wrenches", "wrench_box", "wrench_ellipsoid", "acceleration", "capacity_length"):
            if getattr(self, name) is not None and "wrench-feasible" not in self.conditions:
                raise table_error(name, getattr(self, name), 'absent: "wrench-feasible" is not among the conditions')
        return self


class WorkspaceTable(ObstacleKeys, PoseConditions):
    """Conditions of the workspace; a pose meets all of them."""

    obstacle: Obstacles | None = Field(
        None, description="interference-free: [[workspace.obstacle]], bodies fixed in space that nothing may meet"
    )
    point: Literal["mass-centre", "origin"] | None = Field(
        None,
        description='point of a platform whose places x, y, z are: "origin" of its axes, the default, or '
        '"mass-centre", as in plans',
    )
    speed: Speed | None = Field(
        None,
        description="with cable_speed_max: speed that the origin of the platform frame, or the point mass, must be "
        "able to have in every direction in which it can move, m/s",
    )
    angular_speed: Speed | None = Field(
        None,
        description="with cable_speed_max: angular speed that the platform must be able to have about every axis about "
        "which it can turn, together with speed, rad/s",
    )

    @model_validator(mode="after")
    def _interference_asks(self) -> "WorkspaceTable":
        for name in ("obstacle", "platform_box", "platform_hull"):
            if getattr(self, name) is not None and "interference-free" not in self.conditions:
                value = self.model_dump(include={name}, exclude_none=True)[name]
                raise table_error(name, value, 'absent: "interference-free" is not among the conditions')
        return self
