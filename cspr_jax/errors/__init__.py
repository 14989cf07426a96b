"""Errors, and the exit code of each; `suggestions` finds what a user probably meant."""

import datetime
import enum
import itertools
from collections.abc import Sequence


class ExitCode(enum.IntEnum):
    """Exit codes of every command."""

    DONE = 0
    NOT_FEASIBLE = 1
    BAD_INPUT = 2
    REFUSED = 3
    INPUT_OUTPUT = 4
    SELF_CHECK = 5
    INTERNAL = 70
    INTERRUPTED = 130
    TERMINATED = 143


class CsprError(Exception):
    """An error that a user can act on: a line, or several, and an exit code."""

    exit_code = ExitCode.INTERNAL

    def __str__(self) -> str:
        return "\n".join(map(str, self.args))

    def __reduce__(self) -> tuple:
        """Let worker processes pass errors on, whatever arguments their constructors take."""
        return _rebuilt, (type(self), self.args, self.__dict__)


def _rebuilt(kind: type[CsprError], arguments: tuple, state: dict) -> CsprError:
    error = kind.__new__(kind, *arguments)
    error.__dict__.update(state)
    return error


class InputError(CsprError, ValueError):
    """A value that cannot be used; whoever reads a file adds the name of the file.

    Args:
        key: the key or argument, dotted.
        problem: what is wrong, in words, where the value does not show it.
    """

    exit_code = ExitCode.BAD_INPUT

    def __init__(self, key: str, value: object, allowed: str, *, problem: str = "") -> None:
        """Keep the parts, so that a reader of files can add its name."""
        line = f"{key}: {problem}: {allowed}" if problem else f"{key} = {shown(value)}: {demand(allowed)}"
        super().__init__(printable(line))
        self.key, self.value, self.allowed, self.problem = key, value, allowed, problem


class ConfigError(CsprError):
    """A mistake in a file: names the file, the key, the value and what is allowed.

    Args:
        message: the rest of the line.
        others: further mistakes in the file, each the rest of a line of its own; the error's text only counts them.
        count: how many others there are, where not all are given.

    Fields:
        lines: one for each mistake.
    """

    exit_code = ExitCode.BAD_INPUT

    def __init__(self, file: object, message: str, *, others: Sequence[str] = (), count: int = 0) -> None:
        """Join the file's name and the message."""
        count = max(count, len(others))
        more = f" (and {count} more: --all-errors shows them)" if count else ""
        super().__init__(printable(f"{file}: {message}{more}"))
        self.lines = [printable(f"{file}: {text}") for text in (message, *others)]
        if count > len(others):
            self.lines.append(printable(f"{file}: and {count - len(others)} more"))


class RefusedError(CsprError):
    """A run that would mix with, or overwrite, somebody's results."""

    exit_code = ExitCode.REFUSED


class StoreError(CsprError):
    """A file that cannot be read or written."""

    exit_code = ExitCode.INPUT_OUTPUT


class ResourceError(CsprError):
    """Too little memory, or too few threads, processes or workers."""

    exit_code = ExitCode.INPUT_OUTPUT


class SelfCheckError(CsprError):
    """Numbers that contradict each other."""

    exit_code = ExitCode.SELF_CHECK


class StoppedError(CsprError):
    """A run that was asked to stop, and can go on."""

    def __init__(self, message: str, exit_code: ExitCode) -> None:
        """Keep the signal's exit code."""
        super().__init__(message)
        self.exit_code = exit_code


# Levels and items of containers that messages show: a user's may be nested thousands deep.
DEEPEST, LONGEST = 3, 12


def demand(allowed: str) -> str:
    """Phrase what a message demands of a value."""
    return allowed if allowed.startswith(("cannot ", "did you mean ")) else f"must be {allowed}"


def printable(text: object) -> str:
    """Text of any origin (names, paths, records, logs) without characters that break a line or command a terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in str(text))


def shown(value: object) -> str:
    """A value as a message shows it: TOML spelling, at most 60 characters."""
    text = _toml(value, DEEPEST)
    return text if len(text) <= 60 else text[:57] + "..."


def _toml(value: object, depth: int) -> str:
    if value is None or isinstance(value, bool):
        return "(missing)" if value is None else str(value).lower()
    if isinstance(value, dict | list | tuple):
        return _container(value, depth - 1) if depth else "..."
    try:
        return f'"{value}"' if isinstance(value, str) else _plain(value)
    except ValueError:  # Python writes out no integer of more than some thousand digits
        return "a very large integer"


def _plain(value: object) -> str:
    # NumPy breaks long arrays into lines: join them.
    return str(value) if isinstance(value, datetime.date | datetime.time) else " ".join(repr(value).split())


def _container(value: dict | list | tuple, depth: int) -> str:
    rest = ["..."] * (len(value) > LONGEST)
    if isinstance(value, dict):
        pairs = [f"{key} = {_toml(inner, depth)}" for key, inner in itertools.islice(value.items(), LONGEST)]
        return f"{{ {', '.join(pairs + rest)} }}" if pairs else "{}"
    return f"[{', '.join([_toml(inner, depth) for inner in value[:LONGEST]] + rest)}]"
