"""A command as a row of a table, and what commands share: JSON, tables, warnings, options, the start of jax."""

import argparse
import contextlib
import json
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from cspr_jax.errors import ConfigError, StoreError, printable
from cspr_jax.runtime import terminal
from cspr_jax.store.files.publishing import check_writable


class Command(NamedTuple):
    """A command.

    Fields:
        name: the word after `cspr`.
        text: what the command does, for `--help`.
        add_arguments: adds its arguments to its parser.
        run: runs the command and returns the exit code.
    """

    name: str
    text: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


def add_json(parser: argparse.ArgumentParser, what: str = "object") -> None:
    """Add the option to print JSON for programs."""
    parser.add_argument("--json", action="store_true", help=f"print one JSON {what} and nothing else")


def add_device(parser: argparse.ArgumentParser, usual: str = "cpu") -> None:
    """Add the option that chooses the device."""
    parser.add_argument("--device", choices=("cpu", "gpu"), help=f"where to compute (default: {usual})")


def add_all_errors(parser: argparse.ArgumentParser) -> None:
    """Add the option to report all mistakes of a file, not only the first."""
    parser.add_argument("--all-errors", action="store_true", help="print all mistakes in a file, one per line")


def add_parameters(parser: argparse.ArgumentParser) -> None:
    """Add the option that sets parameters of the file or of its robot."""
    parser.add_argument(
        "--set",
        dest="parameters",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="value of a parameter of the file or of its robot, [[parameter]]; may be given several times",
    )


def parameters_of(options: argparse.Namespace) -> dict[str, float]:
    """Values of parameters, from the options."""
    values = {}
    for text in options.parameters:
        name, _, number = text.partition("=")
        try:
            values[name] = float(number)
        except ValueError:
            values[name] = math.nan
        if not name or not math.isfinite(values[name]):
            raise ConfigError("--set", f"{text}: must be NAME=VALUE, a parameter and a number")
    return values


def add_output(parser: argparse.ArgumentParser, text: str, **settings: Any) -> None:
    """Add the option that names the file or folder to write."""
    parser.add_argument("-o", "--output", type=Path, help=text, **settings)


def numbers_of(option: str, text: str, counts: tuple[int, ...] = (), *, is_positive: bool = False) -> list[float]:
    """Finite numbers of an option, separated by commas; any number of them without `counts`."""
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = [math.nan]
    is_allowed = all(math.isfinite(value) and (value > 0.0 or not is_positive) for value in values)
    if not is_allowed or (counts and len(values) not in counts):
        many = f"{' or '.join(map(str, counts))} " if counts else ""
        above = " > 0" if is_positive else ""
        raise ConfigError(option, f"{text}: must be {many}finite numbers{above}, separated by commas")
    return values


def check_picture_format(path: Path, option: str = "-o") -> None:
    """Refuse a name of a picture whose ending is no format of pictures."""
    from matplotlib.backend_bases import FigureCanvasBase

    if path.suffix[1:].lower() not in FigureCanvasBase.get_supported_filetypes():
        raise ConfigError(option, f"{path}: must end in .png, .pdf, .svg or another picture format")


def checked_picture(options: argparse.Namespace, name: str = "output") -> dict[str, Any]:
    """Options of style of a picture, -o or another one, refused before slow work where they or the file are wrong."""
    path = getattr(options, name)
    if path is not None:
        check_picture_format(path, "-o" if name == "output" else f"--{name}")
    check_writable(path)
    from cspr_jax.outputs.plots.style.style import style_of  # loads matplotlib

    style = {name: getattr(options, name) for name in ("size", "dpi", "font_size", "preset", "title")}
    style_of(**style)
    return style


def print_answer(answer: Any, *, as_json: bool) -> None:
    """Print an answer as JSON, or its lines."""
    if as_json:
        print_json(answer.to_dict())
        return
    for line in answer.lines():
        print_line(line)


def prepare_jax(options: argparse.Namespace, *, quick: bool = False, prefers_cpu: bool = True) -> None:
    """Set up jax by the options; from now on, compilations are announced."""
    from cspr_jax.runtime import process_environment, xla

    process_environment.check_threads(processes=0)
    if getattr(options, "scheduler", None) is None:  # workers of a scheduler have settings of their own
        xla.prepare(options.device, warn, quick=quick, prefers_cpu=prefers_cpu)
    process_environment.defer_fortran()
    xla.check_device(options.device)
    xla.tell_compiling()


@contextlib.contextmanager
def printing() -> Iterator[None]:
    """Raise an error that names standard output if it cannot be written."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise StoreError(f"standard output: {error.strerror or error}") from error


def write(text: str) -> None:
    """Write to standard output."""
    with printing():
        sys.stdout.write(text)


def print_json(value: Any) -> None:
    """Print one JSON value on one line."""
    write(json.dumps(value, allow_nan=False) + "\n")


def print_table(renderable: Any) -> None:
    """Print a table of rich."""
    with printing():
        terminal.print_table(renderable, sys.stdout)


def print_line(text: object) -> None:
    """Print a line for people."""
    write(f"{printable(text)}\n")


def print_path(path: Path | str) -> None:
    """Print the path of a file, for people or for a program that opens it."""
    write(f"{printable(path) if sys.stdout.isatty() else path}\n")


def warn(line: object) -> None:
    """Write a warning to standard error; ignore a failure to write it."""
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(f"cspr: {printable(line)}\n")
