"""Examples of sweep and plan files from Python: listed, and copied to be changed."""

from collections.abc import Iterable
from pathlib import Path

from cspr_jax.api.argument_checks import checked
from cspr_jax.outputs import example_files


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
