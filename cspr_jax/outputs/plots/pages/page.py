"""A page in one file: its content with packed arrays, the library of charts, and the page's own scripts."""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from importlib.resources import files
from typing import Any

import numpy as np

from cspr_jax import __version__
from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Num

# Typed arrays of browsers, by NumPy's dtypes.
TYPES = {"uint8": "Uint8Array", "uint16": "Uint16Array", "int32": "Int32Array", "float32": "Float32Array"}
# The page's own scripts, in the order in which a browser reads them.
SCRIPTS = ("page.js", "map.js", "motion.js", "solid.js", "charts.js", "start.js")
STYLE, FRAME = "page.css", "page.html"
PLACEHOLDER = re.compile(r"<!-- (\w+) -->")


def page_of(title: str, content: dict[str, Any]) -> str:
    """HTML text of a page."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise InputError("plotly", "absent", 'installed: pip install "cspr_jax[report]"') from error
    # Without "<" no text can end the script element, or open a comment that hides its end.
    data = json.dumps(content, allow_nan=False, separators=(",", ":"), sort_keys=True).replace("<", "\\u003c")
    parts = {
        "title": html.escape(title),
        "version": html.escape(__version__),
        "style": _part(STYLE),
        "charts": get_plotlyjs(),
        "content": data,
        "scripts": "\n".join(_part(name) for name in SCRIPTS),
    }
    # One pass replaces all placeholders, so that inserted text is not searched again.
    return PLACEHOLDER.sub(lambda match: parts[match[1]], _part(FRAME))


def _part(name: str) -> str:
    return (files(__package__) / name).read_text("utf-8")


def packed(values: Num[np.ndarray, "..."]) -> dict[str, Any]:
    """Values compressed for a page."""
    values = np.asarray(values)
    if values.dtype.kind == "f":
        name = "float32"
        values = np.clip(values, -3e38, 3e38, where=np.isfinite(values), out=values.astype(float))
    else:
        low, high = int(values.min(initial=0)), int(values.max(initial=0))
        name = "int32" if low < 0 or high > 65535 else "uint8" if high < 256 else "uint16"
    # Leave out the time of writing, so that equal values give equal texts.
    data = gzip.compress(np.ascontiguousarray(values, np.dtype(name).newbyteorder("<")).tobytes(), 6, mtime=0)
    return {"type": TYPES[name], "data": base64.b64encode(data).decode("ascii")}
