"""Keys that plans and sweeps share: the trajectory family, its amplitude function, gravity."""

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from cspr_jax.config.keys.limits import Positive
from cspr_jax.config.reading import Table
from cspr_jax.config.wording import name_of
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.limits import LARGEST_MAX_ARCS

Angle = Annotated[float, Field(ge=-100.0, le=100.0)]
Component = Annotated[float, Field(ge=-1.1, le=1.1)]
TiltTorsion = Annotated[list[Angle], Field(min_length=3, max_length=3)]
Quaternion = Annotated[list[Component], Field(min_length=4, max_length=4)]
BetaHat = Annotated[float, Field(ge=-100, le=100)]


RotationLaw = Literal["beta_ff", "beta_f", "beta_0", "beta_1"]


class NamedAmplitude(Table):
    """An amplitude function with a parameter."""

    name: Literal["effective", "effective-c3"] = Field(description='"effective" (1.110) or "effective-c3"')
    epsilon: Annotated[
        Annotated[float, Field(ge=1e-3, le=0.5), Tag("~number")] | Annotated[Literal["best"], Tag("~best")],
        Discriminator(lambda value: "~best" if isinstance(value, str) else "~number"),
    ] = Field(description='length of the curved ends, from 0.001 to 0.5, or "best" (plans only)')


class PolynomialAmplitude(Table):
    """A user's own amplitude function."""

    polynomial: Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=1, max_length=20)] = Field(
        description="coefficients c0, c1, ... of c0 + c1 tau + c2 tau^2 + ..."
    )


def _kind(value: Any) -> str:
    if isinstance(value, dict | Table):
        return (
            "~polynomial"
            if "polynomial" in (value if isinstance(value, dict) else value.model_fields_set)
            else "~named"
        )
    return "~plain"


AmplitudeKey = Annotated[
    Annotated[Literal["A1", "quintic", "A2", "A3", "ideal"], Tag("~plain")]
    | Annotated[NamedAmplitude, Tag("~named")]
    | Annotated[PolynomialAmplitude, Tag("~polynomial")],
    Discriminator(_kind),
]


Inclination = Annotated[
    Annotated[float, Field(gt=-1.0, lt=1.0), Tag("~number")] | Annotated[Literal["best"], Tag("~best")],
    Discriminator(lambda value: "~best" if isinstance(value, str) else "~number"),
]


FamilyName = Annotated[str, name_of(lambda: FAMILIES)]


class TrajectoryKeys(Table):
    """Keys of the trajectory that plans and sweeps share."""

    family: FamilyName = Field(
        "hypocycloid-standard",
        description="trajectory family: " + "; ".join(f'"{row.name}", {row.description}' for row in FAMILIES.values()),
    )
    amplitude: AmplitudeKey = Field(
        "quintic",
        description='amplitude function: "quintic" (A2), "A1", "A3", { name = "effective" or "effective-c3", '
        "epsilon = ... }, { polynomial = [...] }; it must meet (2.49), which A1 and A3 do not, or, for transitions, "
        '(1.27) and (1.28), which they do; "ideal" (A = tau) serves for bounds in maps of transitions',
    )
    beat: RotationLaw | None = Field(
        None,
        description='platforms: time function of the rotation: "beta_ff" (3.93), the default, with a beta-hat for '
        'each end; "beta_f" (3.68), with the beta-hat of the target at both ends, or of the start on the way to rest; '
        '"beta_0" (3.67), without angular acceleration at the ends; "beta_1" (3.66), a cosine',
    )
    inclination: Inclination | None = Field(
        None, description='transitions: inclination v, a number in ]-1, 1[, or "best"; in place of z0'
    )
    max_arcs: Annotated[int, Field(ge=1, le=LARGEST_MAX_ARCS)] = Field(
        30, description="largest number of arcs that is tried; two arcs are one oscillation"
    )
    max_acceleration: Positive | None = Field(
        None,
        description="straight lines: largest magnitude of the acceleration, m/s^2; absent: only taut cables bound it",
    )
    rule: Literal["optimum", "thesis"] | None = Field(
        None,
        description='s-curve: rule that finds the time of acceleration p and the duration T: "optimum", the default, '
        'the least T; "thesis", the rule of Boralugoda\'s text, with Q3 and Q7 on their lines',
    )
    gravity: Positive | None = Field(None, description="gravity, m/s^2, in place of the robot file's (default 9.81)")

    @property
    def families(self) -> tuple[str, ...]:
        """Names of the families in use."""
        return (self.family,)

    @property
    def takes_amplitude(self) -> bool:
        """Tell whether a family in use takes an amplitude function, rather than a time law of its own."""
        return any(FAMILIES[name].takes_amplitude for name in self.families)
