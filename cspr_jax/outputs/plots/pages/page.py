"""A page in one file: its content, the library of its charts, and the scripts that join the two."""

import html
import json
import re
from importlib.resources import files
from typing import Any

from cspr_jax import __version__
from cspr_jax.errors import InputError

# The page's own parts, in the order in which a browser reads them.
SCRIPTS = ("page.js", "map.js", "motion.js", "solid.js", "start.js")
STYLE, FRAME = "page.css", "page.html"
PLACE = re.compile(r"<!-- (\w+) -->")


def page_of(title: str, content: dict[str, Any]) -> str:
    """A page."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise InputError("plotly", "absent", 'installed: pip install "cspr_jax[report]"') from error
    # Without "<" no text can end the script element, nor open a comment in it that hides its end.
    data = json.dumps(content, allow_nan=False, separators=(",", ":"), sort_keys=True).replace("<", "\\u003c")
    parts = {
        "title": html.escape(title),
        "version": html.escape(__version__),
        "style": _part(STYLE),
        "charts": get_plotlyjs(),
        "content": data,
        "scripts": "\n".join(_part(name) for name in SCRIPTS),
    }
    # One pass replaces all places, so that inserted text is not searched again.
    return PLACE.sub(lambda match: parts[match[1]], _part(FRAME))


def _part(name: str) -> str:
    return (files(__package__) / name).read_text("utf-8")
