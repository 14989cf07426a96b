"""Errors of a file, one line each in the words of TOML, without terms of the library that checks it."""

import datetime
import math
from collections.abc import Callable, Collection, Iterable
from typing import Any

from pydantic import BaseModel, PlainValidator
from pydantic_core import ErrorDetails, PydanticCustomError

from cspr_jax.errors import demand, shown
from cspr_jax.errors.suggestions import look_alike, nearest

# First letter of the names of variants of a union, which pydantic's location of an error contains but no key does.
VARIANT = "~"
TABLE_ERROR = "table_error"
LONGEST_NAME = 200
_KINDS = {
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
    "list_type": "a list",
    "float_type": "a number",
    "int_type": "an integer",
    "bool_type": "true or false",
    "string_type": "a string",
    "finite_number": "a finite number",
    "string_too_short": "a string that is not empty",
}
_BOUNDS = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
    "multiple_of": ("multiple_of", "a multiple of"),
}


def table_error(key: str, value: object, allowed: str) -> PydanticCustomError:
    """Error that a validator of a table raises about one key, or about several keys together."""
    text = value if isinstance(value, str) else shown(value)
    return PydanticCustomError(TABLE_ERROR, "{allowed}", {"key": key, "given": text, "allowed": allowed})


def either(names: Iterable[str]) -> str:
    """Names as alternatives."""
    *others, last = (f'"{name}"' for name in names)
    return f"{', '.join(others)} or {last}" if others else last


def name_of(get_names: Callable[[], Collection[str]]) -> PlainValidator:
    """Validator of a key whose values are names in a table, which may grow."""

    def check(value: Any) -> str:
        table = get_names()
        if not (isinstance(value, str) and value in table):
            names = list(table)
            raise PydanticCustomError("literal_error", "{expected}", {"expected": either(names).replace('"', "'")})
        return value

    return PlainValidator(check)


def rank(error: ErrorDetails) -> int:
    """Rank of an error among those of a file: errors that explain others come first."""
    if error["loc"] == ("schema",) and error["type"] != "missing":
        return 0
    return 1 if error["type"] == "extra_forbidden" else 2


def line(model: type[BaseModel], error: ErrorDetails, at: str) -> str:
    """One error as a line."""
    # The last part of an unknown or missing key is the user's word, even if it looks like a name of pydantic.
    last_part = error["loc"][-1:] if error["type"] in ("extra_forbidden", "missing") else ()
    parts = [part for part in error["loc"][: len(error["loc"]) - len(last_part)] if not str(part).startswith(VARIANT)]
    parts += last_part
    if error["type"] == TABLE_ERROR:
        context = error.get("ctx", {})
        parts += [context["key"]] if context["key"] else []
        if context["given"] == shown(None):
            return f"{_key(at, parts)} is missing: {context['allowed']}"
        return f"{_key(at, parts)} = {context['given']}: {demand(context['allowed'])}"
    if error["type"] == "extra_forbidden":
        return f"unknown key {_key(at, parts)} = {shown(error['input'])}: {_suggestion(model, parts)}"
    if error["type"] == "missing":
        return f"{_key(at, parts)} is missing: {_description(model, parts)}"
    question = _question(model, error, parts)
    return f"{_key(at, parts)} = {shown(error['input'])}: {question}must be {_allowed(model, error, parts)}"


def _question(model: type[BaseModel], error: ErrorDetails, parts: list[Any]) -> str:
    # Guess what was meant by a string, or by a number in place of a list.
    value, key = error["input"], str(parts[-1]) if parts else ""
    if not isinstance(value, str):
        is_single = error["loc"][-1:] == ("~values",) and isinstance(value, int | float) and not isinstance(value, bool)
        return f"did you mean [{shown(value)}]? " if is_single else ""
    if error["type"] == "literal_error":
        near = nearest(value, error.get("ctx", {})["expected"].split("'")[1::2])
        return f'did you mean "{near}"? ' if near else ""
    field = _table_at(model, parts[:-1]).get(key)
    tables = _tables_in(field.annotation) if field else []
    if any(
        value == name and inner.annotation is bool for table in tables for name, inner in table.model_fields.items()
    ):
        return f"did you mean {key} = {{ {value} = true }}? "
    is_plain = (error["type"] in ("float_type", "int_type") and _is_number(value)) or (
        error["type"] == "bool_type" and value in ("true", "false")
    )
    odd = look_alike(value).removeprefix(": ") if error["type"] in ("float_type", "int_type") else ""
    return f"did you mean {value}, without quotes? " if is_plain else odd and f"{odd} "


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text[:40]))
    except ValueError:
        return False


def _allowed(model: type[BaseModel], error: ErrorDetails, parts: list[Any]) -> str:
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    explained = _explained(model, error, parts)
    if parts == ["schema"]:
        allowed = "1, the version of the format that this program reads"
    elif kind == "float_type" and isinstance(value, int) and not isinstance(value, bool):
        allowed = "a number that is not as large"
    elif kind in _KINDS:
        is_kind = kind in ("string_too_short", "finite_number")
        allowed = _KINDS[kind] + ("" if is_kind else f", not {_kind_of(value)}") + explained
    elif kind in _BOUNDS:
        bound, words = _BOUNDS[kind]
        allowed = f"{words} {context[bound]:.15g}"
    elif kind in ("too_short", "too_long"):
        words = "at least" if kind == "too_short" else "at most"
        number = context.get("min_length", context.get("max_length"))
        allowed = f"a list of {words} {number} values, not {context['actual_length']}{explained}"
    elif kind == "string_too_long":
        allowed = f"a string of at most {context['max_length']} characters"
    elif kind == "literal_error":
        allowed = context["expected"].replace("'", '"') + explained
    else:
        allowed = str(context.get("error", error["msg"])).removeprefix("Input should be ")
    return allowed


def _kind_of(value: object) -> str:
    names = ((bool, "true or false"), (int, "a number"), (float, "a number"), (str, "a string"), (list, "a list"))
    dates = ((datetime.date, "a date"), (datetime.time, "a time"), (dict, "a table"))
    return next((name for kind, name in names + dates if isinstance(value, kind)), "nothing")


def _explained(model: type[BaseModel], error: ErrorDetails, parts: list[Any]) -> str:
    # Return the description of the key if the error is about its whole value.
    if not parts or isinstance(parts[-1], int):
        return ""
    field = _table_at(model, parts[:-1]).get(str(parts[-1]))
    if field is None:
        return ""
    is_whole = error["type"] != "literal_error" or str(error["loc"][-1]).startswith(VARIANT)
    return f": {field.description.rstrip('.')}" if field.description and is_whole else ""


def _key(at: str, parts: list[Any]) -> str:
    text = at
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f"{'.' if text else ''}{part}"
    return (text if len(text) <= LONGEST_NAME else f"{text[:LONGEST_NAME]}...") or "the file"


def _suggestion(model: type[BaseModel], parts: list[Any]) -> str:
    table = _table_at(model, parts[:-1])
    near = nearest(str(parts[-1]), table) or _elsewhere(model, parts)
    return f"did you mean {near}? " * bool(near) + f"allowed: {', '.join(sorted(table))}"


def _elsewhere(model: type[BaseModel], parts: list[Any]) -> str:
    # Return where in the file an unknown key would be right, if it is only misplaced.
    top, name = _table_at(model, []), str(parts[-1])
    if len(parts) > 1 and name in top:
        return f"{name} above the first [table]"
    for key, field in top.items():
        for inner in _tables_in(field.annotation):
            if name in {f.alias or n for n, f in inner.model_fields.items()} and str(parts[0]) != key:
                return f"{key}.{name}"
    return ""


def _description(model: type[BaseModel], parts: list[Any]) -> str:
    field = _table_at(model, parts[:-1]).get(str(parts[-1]))
    return (field.description if field and field.description else "it is required").rstrip(".")


def _table_at(model: type[BaseModel], parts: list[Any]) -> dict[str, Any]:
    # Return the fields of the table that has the error, by the keys that users write.
    for part in parts:
        field = {f.alias or n: f for n, f in model.model_fields.items()}.get(str(part))
        inner = _tables_in(field.annotation) if field else [model]
        if inner:
            model = inner[0]
    return {f.alias or n: f for n, f in model.model_fields.items()}


def _tables_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for inner in getattr(annotation, "__args__", ()) for table in _tables_in(inner)]
