"""The command line. Each command imports what it needs when it runs: `cspr --help` answers at once."""

import argparse
import contextlib
import gc
import io
import json
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from cspr_jax import __version__
from cspr_jax.errors import ConfigError, CsprError, ExitCode
from cspr_jax.outputs.plots.options import ACCELERATION, add_plot
from cspr_jax.runtime import compile_cache
from cspr_jax.runtime.progress import progress, waiting
from cspr_jax.sweep.signals import Prompt, prompt_end, stop_signals

EPILOGUE = (
    "exit codes: 0 done; 1 answered, not all feasible; 2 bad input; 3 refused; 4 I/O error or damaged file; "
    "5 numerical self-check failed; 70 internal error; 130, 143 stopped, run it again to go on"
)

# Of a process that is ours: Python's passes over the many objects of jax take a tenth of what a command takes.
FEWER_COLLECTIONS = (200_000, 20, 50)
VERIFIED = ("tiles", "shards", "missing", "cells", "cells_near_zero", "proved", "mixed", "rows", "segments", "feasible")


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


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="cspr", description="Reach of cable-suspended parallel robots in motion.", epilog=EPILOGUE)
    parser.add_argument("--version", action="version", version=f"cspr {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)

    def add(name: str, command: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text, epilog="files: docs/reference.md has every key")
        sub.set_defaults(command=command)
        return sub

    run = add("run", _run, "compute a sweep file into an HDF5 result; its path is the last line printed")
    run.add_argument("sweep", type=Path, help="sweep file (TOML)")
    run.add_argument("-o", "--output", type=Path, metavar="DIR", help="run directory (default results/...)")
    run.add_argument("--workers", type=int, default=1, metavar="N", help="processes on this machine (default 1)")
    run.add_argument("--scheduler", metavar="ADDRESS", help="dask.distributed scheduler, such as tcp://host:8786")
    run.add_argument(
        "--accept-environment-change", action="store_true", help="go on with another version, machine or library"
    )
    run.add_argument("--prune", action="store_true", help="remove the shards once the result is complete")
    for name, command, text in (
        ("status", _status, "say how far a run has come, without touching it"),
        ("verify", _verify, "read again everything of a run, or a result or motion file, and check it"),
        ("volume", _volume, "say how large the workspace of a map is, with the error that its grid leaves"),
    ):
        sub = add(name, command, text)
        what = {"verify": "run directory, result or motion", "volume": "result, or run directory"}
        sub.add_argument("path", type=Path, help=what.get(name, "run directory"))
        sub.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    plan = add("plan", _plan, "plan a sequence of poses")
    plan.add_argument("plan", type=Path, help="plan file (TOML)")
    plan.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    plan.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the motion to FILE.csv or FILE.h5")
    plan.add_argument("--anyway", action="store_true", help="write the best candidate's motion if it is not feasible")
    plan.add_argument("--rate", type=float, metavar="HZ", help="rows a second (default: `samples` rows a segment)")
    add_plot(add("plot", _plot, "draw a result file, or several maps in one picture"))
    table = add("table", _table, "compute a published table again, beside the printed numbers")
    table.add_argument("name", nargs="?", help="such as 2.1")
    table.add_argument("--list", action="store_true", help="list the tables")
    table.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    table.add_argument("--definition", choices=("grid", "scan", "equal-volume", "all"), help="3.3, 3.4: accessible set")
    table.add_argument("--amplitude", choices=("quintic", "effective", "effective-c3", "all"), help="3.3, 3.4")
    table.add_argument("--fine", action="store_true", help="3.3, 3.4: step pi/64 instead of pi/32")
    bench = add("bench", _bench, "measure checks per second beside a NumPy version of the same check")
    bench.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    bench.add_argument(
        "--kernels", type=Path, metavar="DIR", help="beside C++ kernels of this folder, such as benchmarks"
    )
    for sub in (run, plan):
        sub.add_argument("--all-errors", action="store_true", help="print every mistake of a file, one a line")
    for sub in (run, plan, table, bench):
        sub.add_argument("--device", choices=("cpu", "gpu"), help="where to compute (default: a GPU if jax finds one)")
    foreign = add("import", _import, "read a robot of CASPR, cdpyr or WireX as a robot file")
    foreign.add_argument("file", type=Path, help="NAME_cables.xml, beside NAME_bodies.xml, or .json, .yaml, .wcrfx")
    foreign.add_argument("-o", "--output", type=Path, metavar="FILE", help="write FILE.toml (default: print it)")
    foreign.add_argument("--set", metavar="NAME", help="set of cables of a model of CASPR (default: its own choice)")
    _add_listings(add)
    return parser


def _add_listings(add: Callable[..., argparse.ArgumentParser]) -> None:
    robots = add("robots", _robots, "list the catalogue of robots")
    robots.add_argument("--json", action="store_true", help="print one JSON array and nothing else")
    quantities = add("quantities", _quantities, "list the quantities that a result can hold")
    quantities.add_argument("--json", action="store_true", help="print one JSON array and nothing else")
    examples = add("examples", _examples, "list sweep and plan files to start from, or copy them")
    examples.add_argument("name", nargs="*", help="those to copy (default: list them)")
    examples.add_argument("--all", action="store_true", help="copy all of them")
    examples.add_argument("-o", "--output", type=Path, default=Path(), metavar="DIR", help="to this folder (default .)")
    examples.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def _prepare_jax(options: argparse.Namespace) -> None:
    from cspr_jax.runtime import xla

    if getattr(options, "scheduler", None) is None:  # its workers have settings of their own
        xla.prepare(options.device, _warn)
    xla.check_device(options.device)
    xla.tell_compiling()


def _print_json(value: Any) -> None:
    sys.stdout.write(json.dumps(value, allow_nan=False) + "\n")


def _print(renderable: Any) -> None:
    from rich.console import Console

    # A pipe gets lines of a width of their own, so that no column is folded.
    Console(width=None if sys.stdout.isatty() else 140, highlight=False).print(renderable)


def _run(options: argparse.Namespace) -> int:
    from cspr_jax.api import sweeps
    from cspr_jax.sweep import engine

    if options.scheduler is not None and options.device is not None:
        raise ConfigError("--device", f"{options.device}: must be absent beside --scheduler, whose workers choose")
    sweep = sweeps.sweep_given(options.sweep)
    directory = options.output or sweeps.run_directory(sweep)
    choices = engine.Options(options.accept_environment_change, options.prune, tuple(sys.argv))
    with stop_signals(_warn) as stop, progress() as on_tile:
        hooks = engine.Hooks(stop, on_tile, warn=_warn)
        job = sweeps.Job(sweep, directory, choices, hooks, options.workers, options.scheduler)
        path = job.finished()
        if path is None:
            path = job.go(lambda: _prepare_jax(options))
        else:
            sys.stdout.write("already finished; nothing was computed\n")
    sys.stdout.write(f"{path}\n")
    return ExitCode.DONE


def _warn(line: str) -> None:
    sys.stderr.write(f"cspr: {line}\n")


def _hint(lines: list[str]) -> None:
    for line in lines:
        _warn(f"hint: {line}")


def _status(options: argparse.Namespace) -> int:
    from cspr_jax.api.runs import status

    state = status(options.path)
    if options.json:
        _print_json(state)
        return ExitCode.DONE
    last = state["last"] or {}
    sys.stdout.write(
        f"{state['directory']}: {state['sweep']}, identity {state['identity'][:12]}\n"
        f"  {state['shards']} of {state['tiles']} tiles as shards, {state['quarantined']} set aside, "
        f"{state['unfinished']} unfinished\n"
        f"  result: {state['result'] or 'not yet'}\n"
        f"  last: {last.get('event', '-')} at {last.get('time', '-')}\n"
    )
    return ExitCode.DONE


def _verify(options: argparse.Namespace) -> int:
    from cspr_jax.api.runs import verify

    report = verify(options.path)
    if options.json:
        _print_json(report)
    else:
        counts = ", ".join(f"{key} {report[key]}" for key in VERIFIED if key in report)
        sys.stdout.write(f"{report['path']}: {counts}\n")
    again = "run the sweep" if "shards" in report else "run or plan it"
    for fault in report["faults"]:
        sys.stderr.write(f"cspr: {fault}: {again} again to make it anew\n")
    return ExitCode.INPUT_OUTPUT if report["faults"] else ExitCode.DONE


def _volume(options: argparse.Namespace) -> int:
    from cspr_jax.api import volumes
    from cspr_jax.outputs.plots.selection import result_at

    found = volumes.workspace_volume(result_at(options.path))
    sys.stdout.write("" if options.json else "".join(f"{line}\n" for line in found.lines()))
    if options.json:
        _print_json(found.to_dict())
    return ExitCode.DONE


def _plan(options: argparse.Namespace) -> int:
    if options.output is not None and options.output.suffix not in (".csv", ".h5"):
        raise ConfigError("-o", f"{options.output}: must end in .csv or .h5")
    if options.rate is not None and not 0.0 < options.rate < float("inf"):
        raise ConfigError("--rate", f"{options.rate}: must be a number > 0, in Hz")
    if options.anyway and options.output is None:
        raise ConfigError("--anyway", "must be absent without -o")
    from cspr_jax.config.hints import plan_hints, robot_hints

    with waiting():
        _prepare_jax(options)
        from cspr_jax.api import plans

        plan = plans.plan(options.plan)
    feasible = plan.feasible
    for line in plan.warnings:
        _warn(line)
    _hint(robot_hints(plan.spec) + ([] if feasible else plan_hints(plan.keys, plan.spec)))
    if options.json:
        _print_json(plan.to_dict())
    else:
        _print(plan.to_table())
    if options.output is not None and (feasible or options.anyway):
        with waiting():
            plan.save(options.output, options.rate, anyway=True)
        if not feasible:
            _warn(f"{options.output}: is not proved feasible; it says so itself")
    elif options.output is not None:
        _warn(f"{options.output}: not written, since a segment is not proved feasible (--anyway writes it)")
    return ExitCode.DONE if feasible else ExitCode.NOT_FEASIBLE


def _plot(options: argparse.Namespace) -> int:
    from cspr_jax.api.pictures import plot
    from cspr_jax.outputs.plots import selection

    at = selection.places(options.at)
    results = [selection.result_at(path) for path in options.result]
    if options.quantity == ACCELERATION:  # the one picture that is computed
        _prepare_jax(options)
    output = options.output or results[0].with_suffix(".png")
    if not output.suffix:
        raise ConfigError("-o", f"{output}: must end in .png, .pdf, .svg or another picture format")
    names = ("quantity", "lines", "envelope", "solid", "size", "dpi", "font_size")
    with waiting():
        plot(results, at=at, output=output, **{name: getattr(options, name) for name in names})
    sys.stdout.write(f"{output}\n")
    return ExitCode.DONE


def _table(options: argparse.Namespace) -> int:
    with waiting():
        _prepare_jax(options)
        from cspr_jax.api import tables
        from cspr_jax.published.tables import table_for_people, table_object

    if options.list:
        sys.stdout.write("".join(f"{name}  {title}\n" for name, title in tables.table_names().items()))
        return ExitCode.DONE
    choices = {name: getattr(options, name) for name in ("definition", "amplitude", "fine")}
    with waiting():
        cells = tables.table(options.name, **choices)
    if options.json:
        _print_json(table_object(options.name, cells))
    else:
        _print(table_for_people(options.name, cells))
    return ExitCode.DONE


def _import(options: argparse.Namespace) -> int:
    if options.output is not None and options.output.suffix != ".toml":
        raise ConfigError("-o", f"{options.output}: must end in .toml")
    from cspr_jax.api.imports import import_robot

    found = import_robot(options.file, options.set)
    for line in found.warnings:
        _warn(f"{options.file}: {line}")
    if options.output is None:
        sys.stdout.write(found.to_toml())
    else:
        sys.stdout.write(f"{found.save(options.output)}\n")
    return ExitCode.DONE


def _robots(options: argparse.Namespace) -> int:
    from cspr_jax.api import lists
    from cspr_jax.outputs.listings import robots_table

    return _listed(options, lists.list_robots(), robots_table)


def _quantities(options: argparse.Namespace) -> int:
    from cspr_jax.api import lists
    from cspr_jax.outputs.listings import quantities_table

    return _listed(options, lists.list_quantities(), quantities_table)


def _listed(options: argparse.Namespace, listed: Any, table: Callable[[Any], Any]) -> int:
    _print_json(listed) if options.json else _print(table(listed))
    return ExitCode.DONE


def _examples(options: argparse.Namespace) -> int:
    from cspr_jax.api import examples

    known = examples.list_examples()
    names = list(known) if options.all else options.name
    shown = [str(path) for path in examples.copy_examples(names, options.output)] if names else known
    lines = shown if names else [f"{name:<21} {purpose}" for name, purpose in known.items()]
    _print_json(shown) if options.json else sys.stdout.write("".join(f"{line}\n" for line in lines))
    return ExitCode.DONE


def _bench(options: argparse.Namespace) -> int:
    _prepare_jax(options)
    from cspr_jax.api.speed import benchmark
    from cspr_jax.bench import lines

    report = benchmark(options.kernels)
    if options.json:
        _print_json(report)
    else:
        sys.stdout.write("\n".join(lines(report)) + "\n")
    return ExitCode.DONE
