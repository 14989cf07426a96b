"""Arrays inside of a page: compressed, and as text."""

from __future__ import annotations

import base64
import gzip
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Int

# Names of the typed arrays of browsers, by NumPy's names.
TYPES = {"uint8": "Uint8Array", "uint16": "Uint16Array", "int32": "Int32Array", "float32": "Float32Array"}


def packed(values: Int[np.ndarray, "..."]) -> dict[str, Any]:
    """Values for a page."""
    values = np.asarray(values)
    if values.dtype.kind == "f":
        name = "float32"
        values = np.clip(values, -3e38, 3e38, where=np.isfinite(values), out=values.astype(float))
    else:
        low, high = int(values.min(initial=0)), int(values.max(initial=0))
        name = "int32" if low < 0 or high > 65535 else "uint8" if high < 256 else "uint16"
    # The time of writing is left out, so that the same values are the same text.
    data = gzip.compress(np.ascontiguousarray(values, np.dtype(name).newbyteorder("<")).tobytes(), 6, mtime=0)
    return {"type": TYPES[name], "data": base64.b64encode(data).decode("ascii")}


def unpacked(array: dict[str, Any]) -> Int[np.ndarray, "n"]:
    """Values of a page, as a browser has them."""
    name = next(name for name, other in TYPES.items() if other == array["type"])
    data = gzip.decompress(base64.b64decode(array["data"]))
    return np.frombuffer(data, np.dtype(name).newbyteorder("<"))
