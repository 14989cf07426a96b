"""Lists from Python: robots of the catalogue, quantities of results."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cspr_jax.api.argument_checks import checked
from cspr_jax.outputs import listings


@checked
def list_robots(names: str | Iterable[str | Path] = ()) -> list[dict[str, Any]]:
    """The robots of the catalogue, or those that are named.

    Args:
        names: one of the catalogue, or the path of a robot file, or several; none: all of the catalogue.

    Returns:
        the keys of each one's file, and "fault": why it cannot hang still with every cable taut, or None.

    Raises:
        ConfigError: no such robot, or a mistake in its file.
    """
    return listings.robots([names] if isinstance(names, str | Path) else names)


def list_quantities() -> list[dict[str, Any]]:
    """The quantities that a result or a motion can hold.

    Returns:
        "group", "name", "units", "long_name" and "description" of each.
    """
    return listings.quantities()
