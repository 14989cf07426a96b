"""Keys of winches in robot files: the rows of `robots.model.winch_numbers`, with limits; without jax."""

from typing import Any

from pydantic import Field, create_model, model_validator

from cspr_jax.config.keys.limits import NotNegativePerCable, PerCable, one_or_each
from cspr_jax.config.reading import Table
from cspr_jax.config.wording import table_error
from cspr_jax.robots.model.winch_numbers import LINE, LOAD, WINCH_LIMITS, WINCH_NUMBERS, missing_number
from cspr_jax.schema.limits import LIMITS

Signs: Any = one_or_each(float, float)
ROWS = (*WINCH_NUMBERS, *WINCH_LIMITS)
WORDS = {row.name: row.description for row in LIMITS if row.of_winch}


def _fields() -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for row in ROWS:
        kind = Signs if row.name == "direction" else NotNegativePerCable if row.from_zero else PerCable
        default = "" if row.default is None else f" (default {row.default:g})"
        text = f"{WORDS.get(row.name, row.description)}, one number, or one per cable, {row.unit}{default}"
        fields[row.name] = (
            (kind, Field(description=text)) if row.is_required else (kind | None, Field(None, description=text))
        )
    return fields


# A base class whose fields are the rows of `WINCH_NUMBERS` and `WINCH_LIMITS`; Any, since mypy does not know it.
_Numbers: Any = create_model("_Numbers", __base__=Table, **_fields())


class WinchTable(_Numbers):
    """Winches of the cables: drums, gears and motors."""

    @model_validator(mode="after")
    def _are_allowed(self) -> "WinchTable":
        for row in ROWS:
            value = getattr(self, row.name)
            values = value if isinstance(value, list) else [] if value is None else [value]
            if not all(map(row.is_allowed, values)):
                raise table_error(row.name, value, f"{row.allowed}, or one per cable")
        if missing := missing_number([row.name for row in ROWS if getattr(self, row.name) is not None]):
            raise table_error(missing[0], None, f"given beside {missing[1]}")
        return self

    def check_count(self, count: int) -> None:
        """Refuse lists that do not have one number per cable."""
        for row in ROWS:
            value = getattr(self, row.name)
            if isinstance(value, list) and len(value) != count:
                raise table_error(f"winch.{row.name}", value, f"{row.allowed}, or {count}: one per cable")

    @property
    def limits(self) -> dict[str, Any]:
        """Limits of the winches; the line is one where the motor has one."""
        values = {row.name: getattr(self, row.name) for row in WINCH_LIMITS}
        if values[LOAD] is None and getattr(self, LINE) is not None:
            values[LOAD] = 1.0
        return {name: value for name, value in values.items() if value is not None}

    @property
    def has_layers(self) -> bool:
        """Tell whether the drums have layers."""
        return vars(self)["layer_turns"] is not None

    def of_cables(self, cables: list[int]) -> "WinchTable":
        """The winches of some of the cables."""
        return self.model_copy(update={name: [value[i] for i in cables] for name, value in self._lists().items()})

    def first_difference(self, groups: list[list[int]]) -> str | None:
        """First key whose numbers differ between the cables of a group."""
        for name, value in self._lists().items():
            if any(len({value[i] for i in group}) > 1 for group in groups):
                return name
        return None

    def _lists(self) -> dict[str, list[float]]:
        lists = {row.name: getattr(self, row.name) for row in ROWS}
        return {name: value for name, value in lists.items() if isinstance(value, list)}
