"""A page in one file: its content, the library of its charts, and what joins the two."""

import html
import json
from importlib.resources import files
from typing import Any

from cspr_jax import __version__
from cspr_jax.errors import InputError

# The page's own parts, in the order in which a browser reads them.
SCRIPTS = ("page.js", "map.js", "motion.js", "start.js")
STYLE, FRAME = "page.css", "page.html"


def page_of(title: str, content: dict[str, Any]) -> str:
    """A page.

    Args:
        title: of the window and the page.
        content: "map" of `maps.map_content` or None, "motions" of `motions.motion_content`, "cells" by which a click
            on the map finds these.

    Returns:
        HTML that needs nothing else.

    Raises:
        InputError: plotly is not installed.
    """
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise InputError("plotly", "absent", 'installed: pip install "cspr_jax[report]"') from error
    # Within a script element only these letters could end it.
    data = json.dumps(content, allow_nan=False, separators=(",", ":"), sort_keys=True).replace("</", "<\\/")
    parts = {
        "title": html.escape(title),
        "version": html.escape(__version__),
        "style": _part(STYLE),
        "charts": get_plotlyjs(),
        "content": data,
        "scripts": "\n".join(_part(name) for name in SCRIPTS),
    }
    text = _part(FRAME)
    for name, part in parts.items():
        text = text.replace(f"<!-- {name} -->", part, 1)
    return text


def _part(name: str) -> str:
    return (files(__package__) / name).read_text("utf-8")
