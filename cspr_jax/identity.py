"""What a result is: the hash of everything that decides its numbers."""

import hashlib
import json
from typing import Any

FORMAT_VERSION = 1


def canonical_json(value: Any) -> str:
    """JSON with sorted keys and no spaces: equal values give equal text.

    Args:
        value: dictionaries, lists, texts, finite numbers, booleans, None.

    Returns:
        the text.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def identity(settings: dict[str, Any]) -> str:
    """Hash of resolved settings and the version of the file format.

    Args:
        settings: with all defaults filled in.

    Returns:
        64 hexadecimal digits.
    """
    return hashlib.sha256(canonical_json({"format": FORMAT_VERSION, **settings}).encode()).hexdigest()
