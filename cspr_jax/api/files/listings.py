"""Lists of robots, quantities and examples, and new files to start from, from Python; without jax."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cspr_jax.api.arguments.checks import checked
from cspr_jax.errors import ConfigError, InputError, demand
from cspr_jax.errors.arguments import Names, RobotNames
from cspr_jax.errors.suggestions import one_of
from cspr_jax.outputs import example_files, listings

# Kinds of file for which there is a template.
KINDS = ("robot", "sweep", "plan")


@checked()
def list_robots(names: RobotNames = ()) -> list[dict[str, Any]]:
    """The robots of the catalogue, or the named robots.

    Args:
        names: a catalogue name or the path of a robot file, or several; empty: the whole catalogue.

    Returns:
        for each robot the keys of its file, and "fault": why it cannot rest with every cable taut, or None.

    Raises:
        ConfigError: there is no such robot, or its file has a mistake.
    """
    return listings.robots([names] if isinstance(names, str | Path) else names)


def list_quantities() -> list[dict[str, Any]]:
    """The quantities that a result or a motion can hold.

    Returns:
        "group", "name", "units", "long_name" and "description" of each quantity.
    """
    return listings.quantities()


def list_examples() -> dict[str, str]:
    """The sweep and plan files that come with the program.

    Returns:
        the purpose of each file, by name.

    Raises:
        StoreError: the files cannot be read.
    """
    return example_files.examples()


@checked()
def copy_examples(names: Names, folder: str | Path = ".") -> list[Path]:
    """Copy example files as a start for changes; nothing is overwritten.

    Args:
        names: a name of `list_examples`, or several.
        folder: folder to copy to; it is made if absent.

    Returns:
        paths of the copies.

    Raises:
        ConfigError: there is no such example.
        RefusedError: a file of that name exists.
        StoreError: the files cannot be written.
    """
    return example_files.copy([names] if isinstance(names, str) else list(names), Path(folder))


@checked()
def new_file(
    what: str,
    path: str | Path,
    *,
    like: str = "prototype",
    map: str = "minimum-arcs",
    family: str = "hypocycloid-standard",
) -> Path:
    """Write a file to start from: values of an example, and every other key as a comment that explains it.

    Args:
        what: "robot", "sweep" or "plan".
        path: file to write, .toml; nothing is overwritten.
        like: for a robot: catalogue robot whose values are taken.
        map: for a sweep: kind of map.
        family: for a plan: trajectory family.

    Returns:
        the path.

    Raises:
        ConfigError: there is no such template, or the path does not end in .toml.
        RefusedError: a file of that name exists.
        StoreError: the file cannot be written.
    """
    from cspr_jax.outputs import templates  # loads the schema of files, which lists do not need

    if what not in KINDS:
        raise ConfigError("what", f'"{what}": {demand(one_of(what, KINDS))}')
    try:
        if what == "robot":
            text = templates.robot_template(like)
        else:
            text = templates.sweep_template(map) if what == "sweep" else templates.plan_template(family)
        return templates.write_new(Path(path), text)
    except InputError as error:
        raise ConfigError("new", str(error)) from error
