"""Files to start from, and what there is, from Python: robots, quantities, examples and new files; without jax."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cspr_jax.api.argument_checks import checked
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.outputs import example_files, listings

# There is a template for each of these kinds of file.
KINDS = ("robot", "sweep", "plan")


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


def list_examples() -> dict[str, str]:
    """The sweep and plan files that come with the program.

    Returns:
        for each name what it is for.

    Raises:
        StoreError: they cannot be read.
    """
    return example_files.examples()


@checked
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


@checked
def new_file(
    what: str,
    path: str | Path,
    *,
    like: str = "prototype",
    map: str = "minimum-arcs",
    family: str = "hypocycloid-standard",
) -> Path:
    """Write a file to begin with: an example's values, and every other key as a comment that says what it means.

    Args:
        what: "robot", "sweep" or "plan".
        path: the file, .toml; nothing is overwritten.
        like: of a robot: the one of the catalogue whose values it has.
        map: of a sweep: its kind of map.
        family: of a plan: its trajectory family.

    Returns:
        the path.

    Raises:
        ConfigError: no such template, or another ending.
        RefusedError: a file of that name is there.
        StoreError: the folder or the disk refuses.
    """
    from cspr_jax.outputs import templates  # with the schema of files, which lists do not need

    if what not in KINDS:
        raise ConfigError("what", f'"{what}": must be one of {", ".join(KINDS)}')
    try:
        if what == "robot":
            text = templates.robot_template(like)
        else:
            text = templates.sweep_template(map) if what == "sweep" else templates.plan_template(family)
        return templates.write_new(Path(path), text)
    except InputError as error:
        raise ConfigError("new", str(error)) from error
