"""Completion of commands in shells, as `cspr completion` prints it."""

import argparse
from pathlib import Path
from typing import Any

from cspr_jax.errors import ConfigError

SHELLS = ("bash", "zsh", "tcsh")


def completion(shell: str, parser: argparse.ArgumentParser) -> str:
    """Script by which a shell completes commands, options and files.

    Args:
        shell: its name, one of `SHELLS`.

    Returns:
        the script.

    Raises:
        ConfigError: another shell, or shtab is not installed.
    """
    if shell not in SHELLS:
        raise ConfigError("shell", f'"{shell}": must be one of {", ".join(SHELLS)}')
    try:
        import shtab
    except ImportError as error:
        raise ConfigError("shtab", "is not installed: pip install 'cspr_jax[completion]'") from error
    _complete_files(parser, shtab.FILE)
    return str(shtab.complete(parser, shell))


def _complete_files(parser: argparse.ArgumentParser, files: dict[str, Any]) -> None:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                _complete_files(inner, files)
        elif action.type is Path:
            action.complete = files  # type: ignore[attr-defined]
