"""The catalogue of robots: its folder and the names of its robots, listed without checking their files."""

import tomllib
from pathlib import Path
from typing import Any

CATALOGUE = Path(__file__).parent.parent / "catalogue"
# Why a robot of the catalogue cannot hang still with every cable taut. `build.robots.error_at_rest` finds it, which
# takes seconds; a test compares the two. Robots that are not listed here can hang still.
REST_ERRORS: dict[str, str] = {}


def catalogue_names() -> list[str]:
    """Names of the robots that come with the package."""
    return sorted(path.stem for path in CATALOGUE.glob("*.toml"))


def catalogue_specs() -> list[dict[str, Any]]:
    """Parsed files of the robots that come with the package."""
    return [tomllib.loads((CATALOGUE / f"{name}.toml").read_text("utf-8")) for name in catalogue_names()]
