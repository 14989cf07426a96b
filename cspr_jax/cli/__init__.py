"""The command line. Each command imports what it needs when it runs: `cspr --help` answers at once."""

import argparse
import contextlib
import gc
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from cspr_jax import __version__
from cspr_jax.cli import (
    calibration,
    checks,
    designs,
    listings,
    logs,
    machine,
    pictures,
    plans,
    published,
    simulations,
    stops,
    sweeps,
)
from cspr_jax.cli.command import Command, printing, warn, write
from cspr_jax.errors import ConfigError, CsprError, ExitCode, StoreError, printable
from cspr_jax.outputs.plots.style.options import with_widths
from cspr_jax.runtime import compile_cache, process_environment, terminal
from cspr_jax.sweep.signals import Prompt, prompt_end

EPILOGUE = (
    "exit codes: 0 done; 1 answered, not all feasible; 2 bad input; 3 refused; 4 I/O error or damaged file; "
    "5 numerical self-check failed; 70 internal error; 130, 143 stopped, run the command again to resume"
)

# Environment variable that marks a command which has restarted itself in a new process.
ANEW = "CSPR_BEGUN_ANEW"
# Fewer garbage collections, only in a process of our own: passes over the objects of jax take a tenth of its time.
FEWER_COLLECTIONS = (200_000, 20, 50)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Print one line about the mistake instead of the usage."""
        self.exit(ExitCode.BAD_INPUT, f"{printable(f'{self.prog}: {message} (see {self.prog} --help)')}\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        # Help and version are printed by `write`, which reports an output that cannot be written; argparse does not.
        if file is sys.stdout:
            write(message)
        else:
            super()._print_message(message, file)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    environment = dict(os.environ)
    if arguments is None:
        gc.set_threshold(*FEWER_COLLECTIONS)
        process_environment.configure()
    _mend_streams()
    if sys.platform == "win32":
        sys.stderr.write("cspr: Linux and macOS are supported, Windows is not; its subsystem for Linux will do\n")
        return int(ExitCode.BAD_INPUT)
    try:
        options = _parser().parse_args(with_widths(sys.argv[1:] if arguments is None else arguments))
        process_environment.check_threads()
        process_environment.check_matplotlibrc()
    except SystemExit as end:
        raise SystemExit(_flushed(int(end.code or 0))) from end
    except BrokenPipeError:
        return _flushed(ExitCode.DONE)
    except CsprError as error:
        warn(error)
        return _flushed(error.exit_code)
    with prompt_end(compile_cache.hand_over if arguments is None else None) as prompt:
        code = _answered(options, prompt, environment if arguments is None else None)
    if arguments is None:
        gc.freeze()  # the end of the process frees all memory at once: a last collection takes 0.2 s
    return _flushed(code)


def _answered(options: argparse.Namespace, prompt: Prompt, environment: dict[str, str] | None) -> int:
    try:
        return int(options.command(options))
    except CsprError as error:
        lines = error.lines if isinstance(error, ConfigError) and getattr(options, "all_errors", False) else None
        for line in lines or error.args:
            warn(line)
        return int(error.exit_code)
    except KeyboardInterrupt:
        prompt.tell()
        return int(prompt.code)
    except BrokenPipeError:
        _close_output()  # nobody reads the output any more
        return int(ExitCode.DONE)
    except OSError as error:
        name = f"{error.filename}: " if error.filename else ""
        warn(process_environment.shortage(error) or f"{name}{error.strerror or error}")
        return int(ExitCode.INPUT_OUTPUT)
    except Exception as error:
        return _unexpected(error, environment)


def _unexpected(error: Exception, environment: dict[str, str] | None) -> int:
    lacking = process_environment.shortage(error)
    if lacking is not None:
        warn(lacking)
        return int(ExitCode.INPUT_OUTPUT)
    if environment is not None and ANEW not in environment and compile_cache.set_aside(""):
        warn("kept compiled code, which may be at fault, is removed: the command begins anew")
        with contextlib.suppress(OSError):
            _begin_anew(environment)
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write("".join(f"{printable(line)}\n" for line in traceback.format_exc().splitlines()))
        sys.stderr.write(f"cspr {__version__}: internal error; please report it with the lines above and your file\n")
    return int(ExitCode.INTERNAL)


def _begin_anew(environment: dict[str, str]) -> NoReturn:
    # Start a new process: jax keeps in memory what it has loaded.
    compile_cache.hand_over()
    sys.stderr.flush()
    os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], environment | {ANEW: "1"})


def _mend_streams() -> None:
    # A closed stream would fail at the end of the work, and the next opened file would take over its number.
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            with contextlib.suppress(OSError):
                os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, open(os.devnull, "r" if number == 0 else "w", encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        terminal.encodable(stream)


def _flushed(code: int) -> int:
    # Flush now: at exit, Python would fail too late for a message and an exit code of ours.
    try:
        with printing():
            sys.stdout.flush()
    except BrokenPipeError:
        _close_output()
    except StoreError as error:
        _close_output()
        if code in (ExitCode.DONE, ExitCode.NOT_FEASIBLE):
            warn(error)
            return int(error.exit_code)
    except ValueError:  # the stream is already closed
        return int(code)
    return int(code)


def _close_output() -> None:
    # Close it: otherwise Python tries again at exit to write what is left in the buffer.
    with contextlib.suppress(OSError):
        sys.stdout.close()


def _add_completion(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=("bash", "zsh", "tcsh"), help="your shell")


def _completion(options: argparse.Namespace) -> int:
    try:
        import shtab
    except ImportError as error:
        raise ConfigError("shtab", "is not installed: pip install 'cspr_jax[completion]'") from error
    parser = _parser()
    _complete_files(parser, shtab.FILE)
    write(str(shtab.complete(parser, options.shell)))
    return ExitCode.DONE


def _complete_files(parser: argparse.ArgumentParser, files: dict[str, Any]) -> None:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                _complete_files(inner, files)
        elif action.type is Path:
            action.complete = files  # type: ignore[attr-defined]


# Commands in the order of the help; a new command is a row of one of these modules.
COMMANDS = (
    *(
        *sweeps.COMMANDS,
        *designs.COMMANDS,
        *plans.COMMANDS,
        *simulations.COMMANDS,
        *checks.COMMANDS,
        *stops.COMMANDS,
        *calibration.COMMANDS,
        *machine.COMMANDS,
        *logs.COMMANDS,
        *pictures.COMMANDS,
        *published.COMMANDS,
        *listings.COMMANDS,
    ),
    Command("completion", "print a script with which a shell completes commands", _add_completion, _completion),
)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="cspr", description="Reach of cable-suspended parallel robots in motion.", epilog=EPILOGUE)
    parser.add_argument("--version", action="version", version=f"cspr {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)
    for command in COMMANDS:
        sub = commands.add_parser(
            command.name, help=command.text, description=command.text, epilog="files: docs/reference.md has every key"
        )
        command.add_arguments(sub)
        sub.set_defaults(command=command.run)
    return parser
