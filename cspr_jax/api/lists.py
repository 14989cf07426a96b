"""Lists from Python: robots of the catalogue, quantities of results, examples of sweep and plan files."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cspr_jax.outputs import example_files, listings


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


def list_examples() -> dict[str, str]:
    """The sweep and plan files that come with the program.

    Returns:
        for each name what it is for.

    Raises:
        StoreError: they cannot be read.
    """
    return example_files.examples()


def copy_examples(names: str | Iterable[str], folder: str | Path = ".") -> list[Path]:
    """Copy examples, to be changed; nothing is overwritten.

    Args:
        names: one of `list_examples`, or several.
        folder: to copy them to; it is made if absent.

    Returns:
        the copies.

    Raises:
        ConfigError: no such example.
        RefusedError: a file of that name is there.
        StoreError: the folder or the disk refuses.
    """
    return example_files.copy([names] if isinstance(names, str) else list(names), Path(folder))
