"""TOML to a checked model; a mistake becomes one line that names file, key, value and what is allowed."""

import difflib
import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from cspr_jax.errors import ConfigError, shown

LARGEST_FILE = 1 << 20
# The time that tomllib takes grows with the square of a key's parts.
LONGEST_KEY = 64
_PART = r"""(?:"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'|[\w-]++)"""
_LONG_KEY = re.compile(rf"""(?<![\w"'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{LONGEST_KEY - 1}}}""")
# Names of the variants of a union; they are part of pydantic's location of an error, not of the user's key.
VARIANT = "~"

Model = TypeVar("Model", bound="Table")


class Table(BaseModel):
    """A TOML table: every key known, types as written, numbers finite, nothing changed afterwards."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def read_text(path: Path) -> str:
    """Text of a file.

    Args:
        path: the file.

    Returns:
        its text.

    Raises:
        ConfigError: the file cannot be read, is larger than 1 MB, or is not UTF-8.
    """
    try:
        if path.exists() and not path.is_file():
            raise ConfigError(path, "is not a file")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise ConfigError(path, f"file of {size} bytes: must be at most {LARGEST_FILE}")
        return path.read_text("utf-8")
    except OSError as error:
        raise ConfigError(path, f"cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(path, f"is not UTF-8 text: {error.reason} at byte {error.start}") from error
    except ValueError as error:
        raise ConfigError(path, f"cannot be read: {error}") from error


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """Contents of a TOML text.

    Args:
        text: the text.
        path: named in errors.

    Returns:
        its tables.

    Raises:
        ConfigError: it is not TOML.
    """
    if _LONG_KEY.search(text):
        raise ConfigError(path, f"is not TOML that is read here: a key of {LONGEST_KEY} parts or more")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ConfigError(path, "is not TOML: nested too deeply") from error
    except ValueError as error:
        raise ConfigError(path, f"is not TOML: {error}") from error


def read_toml(path: Path) -> dict[str, Any]:
    """Contents of a TOML file.

    Args:
        path: the file.

    Returns:
        its tables.

    Raises:
        ConfigError: the file cannot be read, is larger than 1 MB, or is not TOML.
    """
    return parse_toml(read_text(path), path)


def checked(model: type[Model], data: Any, file: object, *, at: str = "") -> Model:
    """Data as a model.

    Args:
        model: what it must be.
        data: parsed TOML.
        file: named in errors.
        at: key under which the data stands, for errors.

    Returns:
        the model.

    Raises:
        ConfigError: the first mistake, and how many more there are.
    """
    try:
        return model.model_validate(data)
    except RecursionError as error:
        raise ConfigError(file, "is nested too deeply") from error
    except ValidationError as error:
        found = error.errors(include_url=False)
        # A misspelt key explains a missing one: show it first.
        found.sort(key=lambda e: e["type"] != "extra_forbidden")
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise ConfigError(file, _line(model, found[0], at) + more) from error


def _line(model: type[BaseModel], error: ErrorDetails, at: str) -> str:
    # The last part of an unknown or missing key is the user's own, whatever it looks like.
    own = error["loc"][-1:] if error["type"] in ("extra_forbidden", "missing") else ()
    parts = [part for part in error["loc"][: len(error["loc"]) - len(own)] if not str(part).startswith(VARIANT)]
    parts += own
    key = _key([*([at] if at else []), *parts]) or "the file"
    if error["type"] == "extra_forbidden":
        return f"unknown key {key} = {shown(error['input'])}: {_suggestion(model, parts)}"
    if error["type"] == "missing":
        return f"{key} is missing: {_description(model, parts)}"
    return f"{key} = {shown(error['input'])}: must be {_allowed(error)}"


def _allowed(error: ErrorDetails) -> str:
    context = error.get("ctx", {})
    if error["type"] in ("too_short", "too_long"):
        bound = "at least" if error["type"] == "too_short" else "at most"
        return f"a list of {bound} {context.get('min_length', context.get('max_length'))} values"
    message = str(context.get("error", error["msg"]))
    return message.removeprefix("Input should be ").removeprefix("Value error, ").replace("valid list", "list")


def _key(parts: list[Any]) -> str:
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f"{'.' if text else ''}{part}"
    return text


def _suggestion(model: type[BaseModel], parts: list[Any]) -> str:
    allowed = list(_table_at(model, parts[:-1]))
    near = difflib.get_close_matches(str(parts[-1]), allowed, n=1, cutoff=0.6)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"{hint}allowed: {', '.join(sorted(allowed))}"


def _description(model: type[BaseModel], parts: list[Any]) -> str:
    field = _table_at(model, parts[:-1]).get(str(parts[-1]))
    return (field.description if field and field.description else "it is required").rstrip(".")


def _table_at(model: type[BaseModel], parts: list[Any]) -> dict[str, Any]:
    # Fields, by the key a user writes, of the table in which an error lies.
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
