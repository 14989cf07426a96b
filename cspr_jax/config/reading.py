"""TOML to a checked model; a mistake becomes one line that names file, key, value and what is allowed."""

import codecs
import contextlib
import os
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from cspr_jax.config import wording
from cspr_jax.errors import ConfigError
from cspr_jax.errors.suggestions import look_alike

LARGEST_FILE = 1 << 20
# The time that tomllib takes grows with the square of a key's parts.
LONGEST_KEY = 64
MOST_LINES = 1000  # faults of one file
_PART = r"""(?:"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'|[\w-]++)"""
_PLACE = re.compile(r"\(at line (\d+), column (\d+)\)$")
_STRING = re.compile(r"""\"[^"\n]*"|'[^'\n]*'""")
_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),  # begins like the mark of UTF-16
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)
# Which of the first four bytes are zero, where no mark says it.
_ZEROS: dict[tuple[bool, ...], str] = {
    (False, True, False, True): "UTF-16",
    (True, False, True, False): "UTF-16",
    (False, True, True, True): "UTF-32",
    (True, True, True, False): "UTF-32",
}
_LONG_KEY = re.compile(rf"""(?<![\w"'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{LONGEST_KEY - 1}}}""")

Model = TypeVar("Model", bound="Table")


class Table(BaseModel):
    """A TOML table: every key known, types as written, numbers finite, nothing changed afterwards."""

    # Checks of a table are built when one is read: a command reads few of them.
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)


def other_case(path: Path) -> str:
    """Clause for a message about a missing file that names one whose name differs in capitals alone."""
    while path.parent != path and not path.parent.is_dir():
        path = path.parent
    try:
        names = sorted(os.listdir(path.parent))
    except (OSError, ValueError):
        return ""
    alike = [name for name in names if name.casefold() == path.name.casefold() and name != path.name]
    return f": {path.with_name(alike[0])} is there, which differs in capitals" if alike else ""


def read_bytes(path: Path) -> bytes:
    """Content of a file."""
    with opened(path) as file:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise ConfigError(path, f"file of {size} bytes: must be at most {LARGEST_FILE}")
        return file.read()


@contextlib.contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Open a file, and only a file, and turn failures to read it into lines."""
    try:
        if path.exists() and not path.is_file():
            raise ConfigError(path, "is not a file")
        with path.open("rb") as file:
            yield file
    except FileNotFoundError as error:
        raise ConfigError(path, f"cannot be read: {error.strerror or error}{other_case(path)}") from error
    except OSError as error:
        raise ConfigError(path, f"cannot be read: {error.strerror or error}") from error
    except ValueError as error:  # a name with a null byte
        raise ConfigError(path, f"cannot be read: {error}") from error


def read_text(path: Path) -> str:
    """Text of a file."""
    return decoded(read_bytes(path), path)


def decoded(data: bytes, path: Path, *, line: int = 1) -> str:
    """Text of the content of a file."""
    marked = (name for mark, name in _MARKS if data.startswith(mark))
    encoding = next(marked, _ZEROS.get(tuple(byte == 0 for byte in data[:4])))
    if encoding is not None:
        raise ConfigError(path, f"is {encoding} text: save it as UTF-8")
    try:
        text = data.removeprefix(codecs.BOM_UTF8).decode("utf-8")
    except UnicodeDecodeError as error:
        line += error.object.count(b"\n", 0, error.start)
        words = f"byte 0x{error.object[error.start]:02X} in line {line}: save it as UTF-8"
        raise ConfigError(path, f"is not UTF-8 text: {words}") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def look_alike_before(text: str, end: int) -> str:
    """Clause for the message of a parser that stopped at a character that only looks like one of its own."""
    start = text.rfind("\n", 0, end) + 1
    return look_alike(_STRING.sub("", text[start : end + 1])[::-1])


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """Contents of a TOML text."""
    if _LONG_KEY.search(text):
        raise ConfigError(path, f"is not TOML that is read here: a key of {LONGEST_KEY} parts or more")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ConfigError(path, "is not TOML: nested too deeply") from error
    except ValueError as error:
        refuse_long_numbers(text, path)
        raise ConfigError(path, f"is not TOML: {error}{look_alike_before(text, _stop(text, str(error)))}") from error


def refuse_long_numbers(text: str, path: Path) -> None:
    """Refuse whole numbers of more digits than Python reads."""
    longest = sys.get_int_max_str_digits()
    number = re.search(rf"[0-9](?:_?[0-9]){{{longest},}}", text) if longest else None
    if number is not None:
        line, digits = text.count("\n", 0, number.start()) + 1, len(number[0].replace("_", ""))
        raise ConfigError(path, f"line {line}: a number of {digits} digits: must have at most {longest}")


def _stop(text: str, message: str) -> int:
    # Index at which tomllib stopped; it counts lines and columns from 1.
    place = _PLACE.search(message)
    if place is None:
        return len(text.rstrip())
    lines = text.split("\n")[: int(place[1]) - 1]
    return sum(len(line) + 1 for line in lines) + int(place[2]) - 1


def read_toml(path: Path) -> dict[str, Any]:
    """Contents of a TOML file."""
    return parse_toml(read_text(path), path)


def checked(model: type[Model], data: Any, file: object, *, at: str = "") -> Model:
    """Data as a model."""
    try:
        return model.model_validate(data)
    except RecursionError as error:
        raise ConfigError(file, "is nested too deeply") from error
    except ValidationError as error:
        mistakes = sorted(error.errors(include_url=False), key=wording.rank)
        lines = [wording.line(model, one, at) for one in mistakes[:MOST_LINES]]
        raise ConfigError(file, lines[0], others=lines[1:], count=len(mistakes) - 1) from error
