"""New files from Python: robots, sweeps and plans to begin with, as `cspr new` writes them."""

from pathlib import Path

from cspr_jax.api.argument_checks import checked
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.outputs import templates

# There is a template for each of these kinds of file.
KINDS = ("robot", "sweep", "plan")


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
