"""Keys of parameters in robot, plan and sweep files, and of their values in plans and sweeps."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from cspr_jax.config.keys.limits import MAX_CABLES
from cspr_jax.config.reading import Table
from cspr_jax.config.wording import table_error
from cspr_jax.errors import shown
from cspr_jax.schema.quantities import PARAMETER_NAME

LARGEST_VALUE = 1e12
MAX_PARAMETERS, MAX_MOVES = 100, 10_000
MAX_ARRANGEMENTS = 10_000_000

Value = Annotated[float, Field(ge=-LARGEST_VALUE, le=LARGEST_VALUE)]
# Values that a plan or a sweep gives to its own parameters and to those of its robot.
ParameterValues = Annotated[dict[str, Value], Field(min_length=1, max_length=MAX_PARAMETERS)]
VALUES_DESCRIPTION = (
    "{ NAME = value, ... }: values of parameters of this file and of the robot file; all others stay as in the files; "
    "of any platform `arrangement`, the number of the permutation that leads its cables to their attachment points"
)
Cable = Annotated[int, Field(ge=0, lt=MAX_CABLES)]
Number = Annotated[int, Field(ge=0, le=LARGEST_VALUE)]
# Arrangements of the cables along an axis of a sweep.
Arrangements = Annotated[
    Annotated[Literal["all"], Tag("~all")]
    | Annotated[list[Number], Field(min_length=1, max_length=MAX_ARRANGEMENTS, fail_fast=True), Tag("~numbers")]
    | Annotated[
        list[Annotated[list[Cable], Field(max_length=MAX_CABLES)]],
        Field(min_length=1, max_length=MAX_ARRANGEMENTS, fail_fast=True),
        Tag("~lists"),
    ],
    Discriminator(lambda value: "~all" if isinstance(value, str) else _kind_of_list(value)),
]


def _kind_of_list(value: object) -> str:
    return "~lists" if isinstance(value, list) and value and isinstance(value[0], list) else "~numbers"


class ParameterTable(Table):
    """A parameter: a number between bounds, and the numbers of the file that move with it."""

    name: Annotated[str, Field(pattern=f"^{PARAMETER_NAME}$")] = Field(
        description="name, of letters, digits, _ and -; `--set NAME=VALUE` and axes of sweeps use it"
    )
    value: Value = Field(description="value at which the numbers are those of the file")
    lower: Value = Field(description="smallest value")
    upper: Value = Field(description="largest value")
    unit: Annotated[str, Field(max_length=30)] = Field("1", description="unit of the value, for people")
    moves: Annotated[dict[str, Value], Field(min_length=1, max_length=MAX_MOVES)] = Field(
        description="the numbers that move, each by a multiple of the change of the value: "
        '{ "base_points[0][0]" = 0.5, "mass" = 1 }; "scale" is a factor, 1 in the file, by which base_points move away '
        'from their centroid, and "platform_scale" one by which platform_points move away from the origin; '
        '"parameter.NAME" is the value of another parameter'
    )

    @model_validator(mode="after")
    def _is_inside(self) -> "ParameterTable":
        if not self.lower < self.upper:
            raise table_error("upper", self.upper, f"a number > lower, {shown(self.lower)}")
        if not self.lower <= self.value <= self.upper:
            raise table_error("value", self.value, f"from lower to upper, {shown(self.lower)} to {shown(self.upper)}")
        for target, multiple in self.moves.items():
            if multiple == 0.0:
                raise table_error("moves", f"{target} = 0", "numbers that are not 0, so that it moves something")
        return self


ParameterTables = Annotated[list[ParameterTable], Field(min_length=1, max_length=MAX_PARAMETERS)]
# Parameters of plans and sweeps.
OWN_DESCRIPTION = (
    "[[parameter]], as in robot files but without scales: named numbers that move numbers of this file, such as {}, "
    "not those of [robot]{}"
)
