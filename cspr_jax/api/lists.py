"""Lists from Python: robots of the catalogue, quantities of results."""

from typing import Any

from cspr_jax.outputs import listings


def list_robots() -> list[dict[str, Any]]:
    """The robots of the catalogue.

    Returns:
        the keys of each one's file, and "fault": why it cannot hang still, or None.
    """
    return listings.robots()


def list_quantities() -> list[dict[str, Any]]:
    """The quantities that a result or a motion can hold.

    Returns:
        "group", "name", "units", "long_name" and "description" of each.
    """
    return listings.quantities()
