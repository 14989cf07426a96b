"""A command as a row, and what commands have in common: JSON, tables, warnings, options, the way to jax."""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple


class Command(NamedTuple):
    """A command.

    Fields:
        name: the word after `cspr`.
        text: what it does, for `--help`.
        add_arguments: its arguments, to its parser.
        run: does it; returns the exit code.
    """

    name: str
    text: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


def add_json(parser: argparse.ArgumentParser, what: str = "object") -> None:
    """Option for programs that read the answer.

    Args:
        parser: of a command.
        what: JSON value that it prints.
    """
    parser.add_argument("--json", action="store_true", help=f"print one JSON {what} and nothing else")


def add_device(parser: argparse.ArgumentParser) -> None:
    """Option of where to compute.

    Args:
        parser: of a command.
    """
    parser.add_argument("--device", choices=("cpu", "gpu"), help="where to compute (default: a GPU if jax finds one)")


def add_all_errors(parser: argparse.ArgumentParser) -> None:
    """Option for every mistake at once.

    Args:
        parser: of a command that reads a file of keys.
    """
    parser.add_argument("--all-errors", action="store_true", help="print all mistakes in a file, one per line")


def add_output(parser: argparse.ArgumentParser, text: str, **settings: Any) -> None:
    """Option of where the output goes.

    Args:
        parser: of a command.
        text: for `--help`.
        settings: of argparse, such as metavar.
    """
    parser.add_argument("-o", "--output", type=Path, help=text, **settings)


def prepare_jax(options: argparse.Namespace, *, quick: bool = False) -> None:
    """Set up jax as the options want it; from here on it says when it compiles.

    Args:
        options: of the command.
        quick: whether little is computed; see `xla.prepare`.

    Raises:
        InputError: no such device.
    """
    from cspr_jax.runtime import xla

    if getattr(options, "scheduler", None) is None:  # its workers have settings of their own
        xla.prepare(options.device, warn, quick=quick)
    xla.check_device(options.device)
    xla.tell_compiling()


def print_json(value: Any) -> None:
    """Print one JSON value on one line.

    Args:
        value: of numbers, words, lists and dictionaries.
    """
    sys.stdout.write(json.dumps(value, allow_nan=False) + "\n")


def print_table(renderable: Any) -> None:
    """Print a table of rich.

    Args:
        renderable: the table.
    """
    from rich.console import Console

    # A pipe gets lines of a width of their own, so that no column is folded.
    Console(width=None if sys.stdout.isatty() else 140, highlight=False).print(renderable)


def warn(line: str) -> None:
    """Say something on standard error.

    Args:
        line: what.
    """
    sys.stderr.write(f"cspr: {line}\n")
