"""Where the time of tests goes: `--record FILE` writes a line a test, and the run ends with the sums of each folder."""

import collections
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import jax
import pytest

NAMES = ("test", "seconds", "cpu", "programs", "compiled")
SHOWN = 10  # folders, and single tests


def cpu() -> float:
    """Seconds of this process and of those that it waited for."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def unit() -> float:
    """Seconds of CPU that `import jax` takes: what machines are compared by."""
    seconds = []
    for _ in range(2):
        before = cpu()
        subprocess.run([sys.executable, "-c", "import jax"], check=True)
        seconds.append(cpu() - before)
    return min(seconds)


def folder(test: str) -> str:
    return test.partition("::")[0].rpartition("/")[0].removeprefix("tests/")


class Recorder:
    """Appends a line a test to a file; `programs` counts those made ready, `compiled` those not found on disk."""

    def __init__(self, path: Path, *, is_first: bool) -> None:
        self.path, self.counts = path, collections.Counter()
        jax.monitoring.register_event_duration_secs_listener(self._count)
        jax.monitoring.register_event_listener(self._count)
        if is_first:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("")

    def _count(self, event: str, *_, **__) -> None:
        self.counts[event.rpartition("/")[2]] += 1

    def _spent(self) -> list[float]:
        programs, found = self.counts["backend_compile_duration"], self.counts["cache_hits"]
        return [time.monotonic(), cpu(), programs, programs - found]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        before = self._spent()
        result = yield
        spent = [round(b - a, 3) for a, b in zip(before, self._spent(), strict=True)]
        with self.path.open("a") as file:
            file.write(json.dumps(dict(zip(NAMES, [item.nodeid, *spent], strict=True))) + "\n")
        return result

    def pytest_terminal_summary(self, terminalreporter, config):
        """Sums of each folder, and the longest tests."""
        if hasattr(config, "workerinput"):
            return
        tests = [json.loads(line) for line in self.path.read_text("utf-8").splitlines()]
        total = cpu()  # of the processes of tests too, which have ended
        write, programs = terminalreporter.write_line, sum(line["programs"] for line in tests)
        write(f"{len(tests)} tests, {total:.0f} s of CPU, {total / unit():.0f} times `import jax`")
        write(f"{programs} programs, {sum(line['compiled'] for line in tests)} of them compiled: see {self.path}")
        sums = collections.defaultdict(collections.Counter)
        for line in tests:
            sums[folder(line["test"])].update({name: line[name] for name in ("cpu", "programs")})
        longest = [(line["test"], line) for line in sorted(tests, key=lambda line: -line["cpu"])[:SHOWN]]
        for name, spent in sorted(sums.items(), key=lambda pair: -pair[1]["cpu"])[:SHOWN] + longest:
            write(f"{spent['cpu']:8.1f} s, {spent['programs']:4} programs: {name}")
