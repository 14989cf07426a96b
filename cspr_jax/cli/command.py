"""A command as a row, and what commands have in common: JSON, tables, warnings, options, the way to jax."""

import argparse
import contextlib
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from cspr_jax.errors import StoreError, printable
from cspr_jax.runtime import terminal


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
        what: JSON value that it prints.
    """
    parser.add_argument("--json", action="store_true", help=f"print one JSON {what} and nothing else")


def add_device(parser: argparse.ArgumentParser, *, quick: bool = False) -> None:
    """Option of where to compute.

    Args:
        quick: whether it computes little; see `xla.prepare`.
    """
    usual = "cpu" if quick else "a GPU if jax finds one"
    parser.add_argument("--device", choices=("cpu", "gpu"), help=f"where to compute (default: {usual})")


def add_all_errors(parser: argparse.ArgumentParser) -> None:
    """Option for every mistake at once.

    Args:
        parser: of a command that reads a file of keys.
    """
    parser.add_argument("--all-errors", action="store_true", help="print all mistakes in a file, one per line")


def add_output(parser: argparse.ArgumentParser, text: str, **settings: Any) -> None:
    """Option of where the output goes.

    Args:
        text: for `--help`.
        settings: of argparse, such as metavar.
    """
    parser.add_argument("-o", "--output", type=Path, help=text, **settings)


def prepare_jax(options: argparse.Namespace, *, quick: bool = False) -> None:
    """Set up jax as the options want it; from here on it says when it compiles.

    Args:
        quick: whether little is computed; see `xla.prepare`.

    Raises:
        ConfigError: no such device, or settings of jax that cannot be used.
        ResourceError: its threads could not be started.
    """
    from cspr_jax.runtime import surroundings, xla

    surroundings.check_threads_of_jax()
    if getattr(options, "scheduler", None) is None:  # its workers have settings of their own
        xla.prepare(options.device, warn, quick=quick)
    xla.check_device(options.device)
    xla.tell_compiling()


@contextlib.contextmanager
def printing() -> Iterator[None]:
    """Name standard output where it takes nothing more.

    Yields:
        nothing; it is written to inside.

    Raises:
        StoreError: it is full.
        BrokenPipeError: its reader has gone.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise StoreError(f"standard output: {error.strerror or error}") from error


def write(text: str) -> None:
    """Write to standard output.

    Args:
        text: of ours, with its line breaks.

    Raises:
        StoreError: it is full.
    """
    with printing():
        sys.stdout.write(text)


def print_json(value: Any) -> None:
    """Print one JSON value on one line.

    Args:
        value: of numbers, words, lists and dictionaries.
    """
    write(json.dumps(value, allow_nan=False) + "\n")


def print_table(renderable: Any) -> None:
    """Print a table of rich."""
    with printing():
        terminal.print_table(renderable, sys.stdout)


def print_line(text: object) -> None:
    """Print a line for people.

    Args:
        text: the line; a name in it may be anybody's.
    """
    write(f"{printable(text)}\n")


def print_path(path: Path | str) -> None:
    """Print the path of a file, for people or for a program that opens it."""
    write(f"{printable(path) if sys.stdout.isatty() else path}\n")


def warn(line: object) -> None:
    """Say something on standard error; where that takes nothing more, there is nobody to be told."""
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(f"cspr: {printable(line)}\n")
