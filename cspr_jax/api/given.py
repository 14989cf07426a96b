"""Files that are given as dictionaries: what their TOML would hold, with NumPy's numbers and arrays taken too."""

import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """A value as parsed TOML has it.

    Args:
        value: mappings, sequences, arrays, numbers, paths, and whatever else TOML knows.

    Returns:
        dictionaries, lists and Python's own numbers in their place; anything else as it is, for the schema to refuse.
    """
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def text_of(data: dict[str, Any]) -> str:
    """What is kept in place of a file's text.

    Args:
        data: as `plain` gives it.

    Returns:
        JSON.
    """
    return json.dumps(data, default=str)
