"""TOML to a checked model; a mistake becomes one line that names file, key, value and what is allowed."""

import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from cspr_jax.config import wording
from cspr_jax.errors import ConfigError

LARGEST_FILE = 1 << 20
# The time that tomllib takes grows with the square of a key's parts.
LONGEST_KEY = 64
MOST_LINES = 1000  # of one file's faults
_PART = r"""(?:"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'|[\w-]++)"""
_LONG_KEY = re.compile(rf"""(?<![\w"'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{LONGEST_KEY - 1}}}""")

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
        ConfigError: the first mistake, and how many more there are; it holds the others.
    """
    try:
        return model.model_validate(data)
    except RecursionError as error:
        raise ConfigError(file, "is nested too deeply") from error
    except ValidationError as error:
        mistakes = sorted(error.errors(include_url=False), key=wording.rank)
        lines = [wording.line(model, one, at) for one in mistakes[:MOST_LINES]]
        raise ConfigError(file, lines[0], others=lines[1:], count=len(mistakes) - 1) from error
