"""The command line. Each command imports what it needs when it runs: `cspr --help` answers at once."""

import argparse
import contextlib
import gc
import io
import os
import sys
import traceback
from collections.abc import Sequence
from typing import NoReturn

from cspr_jax import __version__
from cspr_jax.cli import listings, pictures, plans, runs, tables
from cspr_jax.cli.command import Command
from cspr_jax.errors import ConfigError, CsprError, ExitCode
from cspr_jax.runtime import compile_cache
from cspr_jax.sweep.signals import Prompt, prompt_end

EPILOGUE = (
    "exit codes: 0 done; 1 answered, not all feasible; 2 bad input; 3 refused; 4 I/O error or damaged file; "
    "5 numerical self-check failed; 70 internal error; 130, 143 stopped, run it again to go on"
)

# Of a process that is ours: Python's passes over the many objects of jax take a tenth of what a command takes.
FEWER_COLLECTIONS = (200_000, 20, 50)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line for a mistake, instead of the usage."""
        self.exit(ExitCode.BAD_INPUT, f"{self.prog}: {message} (see {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: words after `cspr`; None: those of the process.

    Returns:
        the exit code.
    """
    if arguments is None:
        gc.set_threshold(*FEWER_COLLECTIONS)
    _mend_streams()
    if sys.platform == "win32":
        sys.stderr.write("cspr: Linux and macOS are supported, Windows is not; its subsystem for Linux will do\n")
        return int(ExitCode.BAD_INPUT)
    options = _parser().parse_args(arguments)
    with prompt_end(compile_cache.hand_over if arguments is None else None) as prompt:
        return _exit_code(options, prompt)


def _exit_code(options: argparse.Namespace, prompt: Prompt) -> int:
    try:
        return int(options.command(options))
    except CsprError as error:
        every = error.lines if isinstance(error, ConfigError) and getattr(options, "all_errors", False) else None
        sys.stderr.write("".join(f"cspr: {line}\n" for line in every or str(error).splitlines()))
        return int(error.exit_code)
    except KeyboardInterrupt:
        prompt.tell()
        return int(ExitCode.INTERRUPTED)
    except BrokenPipeError:
        # The reader of our output has gone; there is nobody left to tell.
        with contextlib.suppress(OSError):
            sys.stdout.close()
        return int(ExitCode.DONE)
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        sys.stderr.write(f"cspr: {place}{error.strerror or error}\n")
        return int(ExitCode.INPUT_OUTPUT)
    except Exception:
        traceback.print_exc()
        sys.stderr.write(f"cspr {__version__}: internal error; please report it with the lines above and your file\n")
        return int(ExitCode.INTERNAL)


def _mend_streams() -> None:
    # A closed stream would be an error at the end of the work, and its number the next file's.
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            with contextlib.suppress(OSError):
                os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, open(os.devnull, "r" if number == 0 else "w", encoding="utf-8"))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="surrogateescape")  # a path is printed as it is


def _add_completion(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=("bash", "zsh", "tcsh"), help="your shell")


def _completion(options: argparse.Namespace) -> int:
    from cspr_jax.api.completions import completion

    sys.stdout.write(completion(options.shell, _parser()))
    return ExitCode.DONE


# In the order of the help. A new command is a row of one of these modules.
COMMANDS = (
    *(*runs.COMMANDS, *plans.COMMANDS, *pictures.COMMANDS, *tables.COMMANDS, *listings.COMMANDS),
    Command("completion", "print a script for a shell that completes commands", _add_completion, _completion),
)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="cspr", description="Reach of cable-suspended parallel robots in motion.", epilog=EPILOGUE)
    parser.add_argument("--version", action="version", version=f"cspr {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)
    for row in COMMANDS:
        sub = commands.add_parser(
            row.name, help=row.text, description=row.text, epilog="files: docs/reference.md has every key"
        )
        row.add_arguments(sub)
        sub.set_defaults(command=row.run)
    return parser
