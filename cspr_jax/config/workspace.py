"""The [workspace] table of sweeps: what a pose must meet to belong to the workspace."""

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from cspr_jax.config.reading import Table
from cspr_jax.config.trajectory import Quaternion
from cspr_jax.config.wording import fault

Condition = Literal["static", "wrench-feasible", "wrench-closure", "interference-free"]
Component = Annotated[float, Field(ge=-1e12, le=1e12)]
Sizes = Annotated[list[Annotated[float, Field(ge=0.0, le=1e12)]], Field(min_length=1, max_length=6)]


class WorkspaceTable(Table):
    """Conditions of the workspace; a pose meets all of them."""

    conditions: Annotated[list[Condition], Field(min_length=1, max_length=4)] = Field(
        ["wrench-feasible"],
        description='"static": taut cables hold the weight; "wrench-feasible": tensions within their limits supply '
        'all wrenches; "wrench-closure": cables that are pulled hard enough resist every wrench; "interference-free": '
        "no two cables meet",
    )
    orientation: Quaternion | None = Field(
        None, description="orientation of a platform, a unit quaternion, scalar first; absent: that of its file"
    )
    wrenches: Annotated[list[list[Component]], Field(min_length=1, max_length=64)] | None = Field(
        None,
        description="wrench-feasible: what the cables must supply, forces, N, then moments about the mass centre, or "
        "the joint, N m; as many numbers each as degrees of freedom; absent: what holds the weight still",
    )

    wrench_box: Sizes | None = Field(
        None, description="wrench-feasible: half widths of a box of wrenches about each of these, N and N m"
    )
    wrench_ellipsoid: Sizes | None = Field(
        None, description="wrench-feasible: semi-axes of an ellipsoid of wrenches about each of these, N and N m"
    )
    acceleration: Annotated[float, Field(ge=0.0, le=1e6)] | None = Field(
        None,
        description="wrench-feasible: radius of a ball of accelerations of the mass centre that the cables must give "
        "beside, m/s^2",
    )

    @field_validator("conditions")
    @classmethod
    def _once(cls, names: list[str]) -> list[str]:
        if len(set(names)) < len(names):
            raise ValueError("a list without repetitions")
        return names

    @model_validator(mode="after")
    def _somebody_asks(self) -> "WorkspaceTable":
        for name in ("wrenches", "wrench_box", "wrench_ellipsoid", "acceleration"):
            if getattr(self, name) is not None and "wrench-feasible" not in self.conditions:
                raise fault(name, None, 'absent: "wrench-feasible" is not among the conditions')
        return self
