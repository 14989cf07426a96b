"""Reading of TOML into checked models; each mistake becomes one line with file, key, value and what is allowed."""

import codecs
import contextlib
import json
import os
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from cspr_jax.config import wording
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.suggestions import look_alike

LARGEST_FILE = 1 << 20
# Dotted keys of this number of parts or more are refused: the time that tomllib takes grows with its square.
LONGEST_KEY = 64
LARGEST_LINES = 1000  # largest number of errors of one file that are listed
_PART = r"""(?:"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'|[\w-]++)"""
_LOCATION = re.compile(r"\(at line (\d+), column (\d+)\)$")
_STRING = re.compile(r"""\"[^"\n]*"|'[^'\n]*'""")
_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),  # before UTF-16, whose mark is the beginning of this one
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)
# Encodings without a byte order mark, by which of their first four bytes are zero.
_ZEROS: dict[tuple[bool, ...], str] = {
    (False, True, False, True): "UTF-16",
    (True, False, True, False): "UTF-16",
    (False, True, True, True): "UTF-32",
    (True, True, True, False): "UTF-32",
}
_LONG_KEY = re.compile(rf"""(?<![\w"'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{LONGEST_KEY - 1}}}""")

# Keys that only one kind of file has, and what that kind is.
_DISTINCTIVE_KEYS = {
    "design": ("objective",),
    "sweep": ("map", "axes", "trajectory", "run", "orientations"),
    "plan": ("pose",),
    "robot": ("base_points", "platform_points", "mass", "inertia"),
}
_EXPECTED = {
    "design": "a design file, with [[objective]] tables",
    "sweep": "a sweep file, with map, [axes] and [trajectory]",
    "plan": "a plan file, with [[pose]] tables",
    "robot": "a robot file, with base_points and mass",
}
_USES = {
    "design": "a design is computed by `cspr design`",
    "sweep": "a sweep is computed by `cspr run`",
    "plan": "a plan is computed by `cspr plan`",
    "robot": 'a robot file is named in a plan or sweep, robot = "FILE.toml"',
}
# No file is nested as deeply as this; a value that contains itself is.
DEEPEST = 32

Model = TypeVar("Model", bound="Table")


class Table(BaseModel):
    """A TOML table: unknown keys are refused, types are not converted, numbers finite, and its fields never change."""

    # The checks of a table are built when it is first read, since a command reads few kinds of tables.
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)


def other_case(path: Path) -> str:
    """Clause of a message about a missing file, which names a file that differs only in upper and lower case."""
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
        length = path.stat().st_size
        if length > LARGEST_FILE:
            raise ConfigError(path, f"file of {length} bytes: must be at most {LARGEST_FILE}")
        return file.read()


@contextlib.contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Open a regular file, and turn failures to read it into errors of one line."""
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
    marked = (name for start, name in _BYTE_ORDER_MARKS if data.startswith(start))
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
    """Clause of a parser's message, where it stopped at a character that only looks like one of TOML."""
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
    """Refuse integers of more digits than Python reads."""
    longest = sys.get_int_max_str_digits()
    number = re.search(rf"[0-9](?:_?[0-9]){{{longest},}}", text) if longest else None
    if number is not None:
        line, digits = text.count("\n", 0, number.start()) + 1, len(number[0].replace("_", ""))
        raise ConfigError(path, f"line {line}: a number of {digits} digits: must have at most {longest}")


def _stop(text: str, message: str) -> int:
    # Index at which tomllib stopped; it counts lines and columns from 1.
    location = _LOCATION.search(message)
    if location is None:
        return len(text.rstrip())
    lines = text.split("\n")[: int(location[1]) - 1]
    return sum(len(line) + 1 for line in lines) + int(location[2]) - 1


def read_toml(path: Path) -> dict[str, Any]:
    """Contents of a TOML file."""
    return parse_toml(read_text(path), path)


def checked(model: type[Model], data: Any, file: object, *, at: str = "") -> Model:
    """Check data against a model."""
    try:
        return model.model_validate(data)
    except RecursionError as error:
        raise ConfigError(file, "is nested too deeply") from error
    except ValidationError as error:
        mistakes = sorted(error.errors(include_url=False), key=wording.rank)
        lines = [wording.line(model, one, at) for one in mistakes[:LARGEST_LINES]]
        raise ConfigError(file, lines[0], others=lines[1:], count=len(mistakes) - 1) from error


def refuse_other_kinds(data: dict[str, Any], expected: str, file: object) -> None:
    """Refuse a file of another kind (robot, plan or sweep) in one line, instead of refusing each of its keys."""
    if any(key in data for key in _DISTINCTIVE_KEYS[expected]):
        return
    for kind, distinctive in _DISTINCTIVE_KEYS.items():
        # The trajectory of a plan is a name, that of a sweep a table.
        theirs = [
            key for key in distinctive if key in data and not (key == "trajectory" and isinstance(data[key], str))
        ]
        if theirs:
            names = ", ".join(theirs)
            raise ConfigError(file, f"is a {kind} file (it has {names}): must be {_EXPECTED[expected]}; {_USES[kind]}")


def plain_values(value: Any, depth: int = DEEPEST) -> Any:
    """Convert a value that may contain NumPy's numbers and arrays to the types of parsed TOML."""
    if not depth:
        raise InputError(
            "given", None, f"must be nested at most {DEEPEST} deep", problem="nested too deep, or in itself"
        )
    if isinstance(value, Mapping):
        return {str(key): plain_values(inner, depth - 1) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain_values(inner, depth - 1) for inner in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def json_text(data: dict[str, Any]) -> str:
    """Data as JSON, which is stored where there is no text of a file."""
    return json.dumps(data, default=str)
