"""A robot file as TOML text."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from cspr_jax.errors import printable

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def robot_text(spec: Mapping[str, Any], cable_names: Sequence[str] = ()) -> str:
    """Text of a robot file, with the names of its cables in comments."""
    lines = []
    if any(cable_names):
        lines.append("# cables: " + ", ".join(printable(name) for name in cable_names))
    return "\n".join([*lines, *_lines(spec)]) + "\n"


def _lines(spec: Mapping[str, Any]) -> list[str]:
    # Tables and lists of tables come last, since all keys after them would belong to them.
    lines = [f"{key} = {value_text(value)}" for key, value in spec.items() if not _tables_of(value)]
    for key, value in spec.items():
        head = f"[[{key}]]" if isinstance(value, list) else f"[{key}]"
        for table in _tables_of(value):
            lines += ["", head, *(f"{inner} = {value_text(item)}" for inner, item in table.items())]
    return lines


def _tables_of(value: Any) -> list[dict[str, Any]]:
    if isinstance(value, dict):
        return [value]
    return value if isinstance(value, list) and value and all(isinstance(one, dict) for one in value) else []


def value_text(value: Any) -> str:
    """A value as TOML text."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key_text(key)} = {value_text(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list) and value and isinstance(value[0], list):
        return "[\n" + "".join(f"    {value_text(row)},\n" for row in value) + "]"
    if isinstance(value, list):
        return f"[{', '.join(map(value_text, value))}]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    return "inf" if math.isinf(value) else repr(value)


def _key_text(key: str) -> str:
    return key if _BARE.fullmatch(key) else value_text(key)
