"""The record of a design in its directory: evaluations as lines of a table, which a later process takes up."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from cspr_jax.errors import RefusedError, StoreError, printable
from cspr_jax.schema.identity import digest
from cspr_jax.schema.quantities import ARRANGEMENT
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish, refusal
from cspr_jax.store.folder import RunFolder
from cspr_jax.synthesis.evaluations import Evaluation, Evaluator
from cspr_jax.synthesis.space import Point

TABLE, IDENTITY = "evaluations.csv", "identity.json"
_LAST = ("missed", "slack", "screened", "problem")
LARGEST = 1 << 31


class DesignRecord:
    """The directory of a design; see `opened`."""

    def __init__(self, folder: RunFolder, disk: Disk) -> None:
        """Keep the directory."""
        self.path, self._folder, self._disk = folder.path, folder, disk

    def take_up(self, evaluator: Evaluator, groups: str = "", stopped: Callable[[], bool] = lambda: False) -> int:
        """Give an evaluator what an earlier process found, and keep what it finds; return how many there were.

        Evaluators of several divisions into groups have tables of their own. What a search that is stopped evaluates
        only to close is not kept, so that lines have the order of a search that is not.
        """
        table = self.path / (f"evaluations-{digest(groups)[:12]}.csv" if groups else TABLE)
        count = self._read(table, evaluator) if table.exists() else self._append(table, [header(evaluator)])

        def keep(new: list[Evaluation]) -> None:
            if not stopped():
                self._append(table, [line_of(evaluator, one) for one in new])

        evaluator.on_new = keep
        return count

    def _read(self, table: Path, evaluator: Evaluator) -> int:
        count, complete = 0, _whole_lines(table)
        try:
            lines = list(csv.reader(io.StringIO(complete, newline="")))
        except csv.Error as error:
            raise StoreError(printable(f"{table}: is no table of evaluations ({error}): remove it")) from error
        if not lines:  # the first line was not finished
            publish(self._disk, table, b"")
            return self._append(table, [header(evaluator)])
        if lines[0] != header(evaluator):
            raise RefusedError(printable(f"{table}: is not the table of this design: choose another -o"))
        for number, words in enumerate(lines[1:], start=2):
            try:
                evaluation = evaluation_of(evaluator, words)
            except ValueError as error:
                raise StoreError(
                    printable(f"{table}: line {number}: is no evaluation: remove it, or choose another -o")
                ) from error
            evaluator.known[evaluation.point, evaluation.is_screened] = evaluation
            count += 1
        if len(complete.encode()) < table.stat().st_size:  # the end of a line that was not finished
            publish(self._disk, table, complete.encode())
        return count

    def _append(self, table: Path, rows: list[list[str]]) -> int:
        # Append lines; none of them counts as one of an earlier process.
        text = io.StringIO(newline="")
        csv.writer(text, lineterminator="\n").writerows(rows)
        self._folder.check_held()
        try:
            self._disk.append(table, text.getvalue().encode())
        except OSError as error:
            raise refusal(table, error) from error
        return 0


@contextlib.contextmanager
def opened(directory: Path, identity: str, file: Path) -> Iterator[DesignRecord]:
    """The record of a design in a directory, which is made, and locked while the block runs.

    Raises:
        RefusedError: the directory belongs to another design, or another process writes there.
        StoreError: a file cannot be read or written.
    """
    disk = Disk()
    folder = RunFolder(directory, file.stem, disk)
    _refuse_others(directory, identity)
    folder.make()
    with folder.locked():
        _refuse_others(directory, identity)
        path = directory / IDENTITY
        if not path.exists():
            publish(disk, path, (json.dumps({"schema": 1, "design": str(file), "identity": identity}) + "\n").encode())
        yield DesignRecord(folder, disk)


def _refuse_others(directory: Path, identity: str) -> None:
    path = directory / IDENTITY
    if not path.exists():
        if directory.is_dir() and any(name != "LOCK" for name in os.listdir(directory)):
            raise RefusedError(printable(f"{directory}: has files of others: choose another -o"))
        return
    try:
        recorded = json.loads(path.read_text("utf-8"))["identity"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StoreError(printable(f"{path}: cannot be read: remove the directory, or choose another -o")) from error
    if recorded != identity:
        line = f"{directory}: belongs to another design, or to an older state of this one: choose another -o"
        raise RefusedError(printable(line))


def _whole_lines(path: Path) -> str:
    try:
        if path.stat().st_size > LARGEST:
            raise StoreError(printable(f"{path}: is larger than any table of a design"))
        data = path.read_bytes()
    except OSError as error:
        raise StoreError(printable(f"{path}: cannot be read: {error.strerror or error}")) from error
    try:
        return data[: data.rfind(b"\n") + 1].decode("utf-8")
    except UnicodeDecodeError as error:
        raise StoreError(printable(f"{path}: is not UTF-8 text: remove it, or choose another -o")) from error


def header(evaluator: Evaluator) -> list[str]:
    """Names of the columns of the table: parameters, arrangement, objectives and requirements, what is missed."""
    questions = [f"{question.key} {question.name}" for question in evaluator.questions]
    return [*evaluator.space.names, ARRANGEMENT, *questions, *_LAST]


def line_of(evaluator: Evaluator, one: Evaluation) -> list[str]:
    """A line of the table."""
    numbers = [*map(repr, one.point.values), str(one.point.arrangement), *map(repr, one.values)]
    return [*numbers, repr(one.missed), repr(one.slack), str(int(one.is_screened)), " ".join(one.problem.split())]


def evaluation_of(evaluator: Evaluator, words: list[str]) -> Evaluation:
    """The evaluation of a line.

    Raises:
        ValueError: it is none.
    """
    count, questions = len(evaluator.space.names), len(evaluator.questions)
    if len(words) != count + 1 + questions + len(_LAST):
        raise ValueError("columns")
    point = Point(tuple(map(float, words[:count])), int(words[count]))
    if not all(map(math.isfinite, point.values)):
        raise ValueError("parameters")
    values = tuple(map(float, words[count + 1 : count + 1 + questions]))
    missed, slack, screened, problem = words[count + 1 + questions :]
    return Evaluation(point, values, float(missed), float(slack), problem, screened == "1")
