"""Limits of robots, plans and sweeps, and the kinds of numbers that these files hold."""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    PlainSerializer,
    Tag,
    create_model,
    model_validator,
)

from cspr_jax.config.reading import Table
from cspr_jax.config.wording import table_error
from cspr_jax.errors.given_numbers import LARGEST, SMALLEST
from cspr_jax.schema.limits import LIMITS, UNCERTAINTIES

# Squares and cubes of larger numbers could overflow; no robot is near them. `robots.model.point_mass`, which needs jax,
# has the same bounds.
LARGEST_LENGTH = 1e6
MAX_CABLES = 1000
Coordinate = Annotated[float, Field(ge=-LARGEST_LENGTH, le=LARGEST_LENGTH)]
Point = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]
MatrixRow = Annotated[list[Annotated[float, Field(ge=-1e18, le=1e18)]], Field(min_length=3, max_length=3)]


def _not_tiny(value: float) -> float:
    if 0.0 < abs(value) < SMALLEST:
        raise table_error("", value, f"at least {SMALLEST:g}")
    return value


NotTiny = AfterValidator(_not_tiny)
Positive = Annotated[float, Field(gt=0, le=LARGEST), NotTiny]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST), NotTiny]


def has_direction(vector: Sequence[float]) -> bool:
    """Tell whether a vector is long enough to have a direction."""
    return math.hypot(*vector) >= SMALLEST


def _infinite(value: Any) -> Any:
    # JSON has no infinity: results and lists keep the word.
    return math.inf if value == "inf" else value


def _bounded(value: float) -> float:
    if value > 1e9 and not math.isinf(value):
        raise ValueError("at most 1e9, or inf")
    return value


Bound = Annotated[
    float,
    Field(gt=0, allow_inf_nan=True),
    BeforeValidator(_infinite),
    AfterValidator(_bounded),
    NotTiny,
    PlainSerializer(lambda value: "inf" if math.isinf(value) else value, when_used="json"),
]


def _variant(value: Any) -> str:
    return "~each" if isinstance(value, list) else "~one"


def _variant_of_vectors(value: Any) -> str:
    return "~each" if isinstance(value, list) and value and isinstance(value[0], list) else "~one"


def one_or_each(one: Any, each: Any, variant: Callable[[Any], str] = _variant) -> Any:
    """Type of one value for all cables, or of a list with one per cable."""
    many = Annotated[list[each], Field(min_length=1, max_length=MAX_CABLES), Tag("~each")]
    return Annotated[Annotated[one, Tag("~one")] | many, Discriminator(variant)]


Direction = Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=3, max_length=3)]
# A function makes these types, which mypy cannot check: they are Any.
PerCable: Any = one_or_each(Positive, Positive)
NotNegativePerCable: Any = one_or_each(NotNegative, NotNegative)
TensionPerCable: Any = one_or_each(Positive, Bound)
PerCableDirection: Any = one_or_each(Direction, Direction, _variant_of_vectors)


def _limit_keys(*, of_robots: bool) -> dict[str, Any]:
    # Keys at the top of robot files, or those that only plans and sweeps have there.
    fields: dict[str, Any] = {}
    for limit in LIMITS:
        if (limit.per_cable and not limit.of_winch) == of_robots:
            kind = Coordinate if limit.is_height else NotNegativePerCable if limit.from_zero else PerCable
            kind = kind if limit.per_cable or limit.is_height else Positive
            kind = TensionPerCable if limit.name == "tension_max" else kind
            text = f"{limit.description}{', one number, or one per cable' * limit.per_cable}, {limit.unit}"
            fields[limit.name] = (kind | None, Field(None, description=text))
    return fields


# A base class whose fields are the rows of `schema.limits.LIMITS`; Any, since mypy does not know it.
_Cables: Any = create_model("_Cables", __base__=Table, **_limit_keys(of_robots=True))


class LimitKeys(_Cables):
    """Limits beyond taut cables; those of a plan or a sweep override those of the robot file."""


def _uncertainty_keys() -> dict[str, Any]:
    return {
        uncertainty.name: (
            Annotated[float, Field(ge=uncertainty.smallest, le=uncertainty.largest)],
            Field(uncertainty.smallest, description=f"{uncertainty.description}, {uncertainty.unit}"),
        )
        for uncertainty in UNCERTAINTIES
    }


_Uncertainties: Any = create_model("_Uncertainties", __base__=Table, **_uncertainty_keys())
_Heights: Any = create_model("_Heights", __base__=LimitKeys, **_limit_keys(of_robots=False))


class UncertaintyTable(_Uncertainties):
    """Uncertainty of the robot: motions must be feasible for every robot within it."""

    @model_validator(mode="after")
    def _beyond_least(self) -> "UncertaintyTable":
        if all(getattr(self, uncertainty.name) == uncertainty.smallest for uncertainty in UNCERTAINTIES):
            raise ValueError("at least one of its keys beyond its smallest value, else nothing is uncertain")
        return self


class LimitTable(_Heights):
    """Limits of all motions of the file."""

    uncertainty: UncertaintyTable | None = Field(
        None,
        description="hypocycloids, transitions, splines and workspaces: feasible then means feasible for every robot "
        "within this uncertainty",
    )

    tension_margin: NotNegative | None = Field(
        None, description="distance that tensions keep from both ends of their range, N"
    )

    if TYPE_CHECKING:
        floor: float | None = None
