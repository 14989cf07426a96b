"""Files that are given as dictionaries: the content of their TOML, with NumPy's numbers and arrays allowed too."""

import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from cspr_jax.errors import InputError

# Deeper than any of our files is nested; a value that holds itself is deeper still.
DEEPEST = 32


def plain(value: Any, depth: int = DEEPEST) -> Any:
    """A value as parsed TOML has it."""
    if not depth:
        raise InputError("given", None, f"must be nested at most {DEEPEST} deep", fault="nested too deep, or in itself")
    if isinstance(value, Mapping):
        return {str(key): plain(inner, depth - 1) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner, depth - 1) for inner in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def text_of(data: dict[str, Any]) -> str:
    """Return the JSON that is kept in place of a file's text."""
    return json.dumps(data, default=str)
