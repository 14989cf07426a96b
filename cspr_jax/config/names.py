"""Keys whose values are names of rows of a table, which may grow."""

from collections.abc import Callable, Iterable
from typing import Any

from pydantic import PlainValidator
from pydantic_core import PydanticCustomError

from cspr_jax.config.wording import either


def name_of(rows: Callable[[], Iterable[str]]) -> PlainValidator:
    """Validator of a key that names a row.

    Returns:
        the validator; its error is that of a Literal of the names.
    """

    def check(value: Any) -> str:
        names = list(rows())
        if value not in names:
            raise PydanticCustomError("literal_error", "{expected}", {"expected": either(names).replace('"', "'")})
        return value

    return PlainValidator(check)
