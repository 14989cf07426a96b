"""Identity of a result: the hash of everything that determines its numbers."""

import hashlib
import json
from typing import Any

from cspr_jax.errors import shown

FORMAT_VERSION = 2


def canonical_json(value: Any) -> str:
    """JSON with sorted keys and no spaces: equal values give equal text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest(value: Any) -> str:
    """Hash of a value."""
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()


def identity(settings: dict[str, Any]) -> str:
    """Hash of resolved settings and the version of the file format."""
    return digest({"format": FORMAT_VERSION, **settings})


def differences(current: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """Differences between two sets of settings, one phrase for each key."""
    values, before = _flat(current), _flat(other)
    return [
        f"{key} = {shown(values.get(key))} here, {shown(before.get(key))} there"
        for key in sorted(before.keys() | values.keys())
        if before.get(key) != values.get(key)
    ]


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    if not isinstance(value, dict):
        return {key: value}
    return {k: v for name, inner in value.items() for k, v in _flat(inner, f"{key}.{name}" if key else name).items()}
