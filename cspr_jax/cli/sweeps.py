"""Commands for sweeps and their runs: run, merge, status, verify, volume."""

import argparse
import datetime
import sys
from pathlib import Path
from typing import Any

from cspr_jax.cli.command import (
    Command,
    add_all_errors,
    add_device,
    add_json,
    add_output,
    add_parameters,
    parameters_of,
    prepare_jax,
    print_json,
    print_line,
    print_path,
    warn,
)
from cspr_jax.errors import ConfigError, ExitCode
from cspr_jax.runtime import process_environment
from cspr_jax.runtime.progress import progress
from cspr_jax.sweep.signals import stop_signals

VERIFIED = ("tiles", "shards", "missing", "cells", "cells_near_zero", "proved", "mixed", "rows", "segments", "feasible")


def _add_run(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("sweep", type=Path, help="sweep file (TOML)")
    add_parameters(parser)
    add_output(parser, "run directory (default results/...)", metavar="DIR")
    parser.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="number of processes on this machine (default 1; for maps of platforms' poses one per core, at most 8)",
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="address of a dask.distributed scheduler, such as tcp://host:8786"
    )
    parser.add_argument(
        "--accept-environment-change",
        action="store_true",
        help="resume although version, machine or libraries have changed",
    )
    parser.add_argument(
        "--prune", action="store_true", help="remove the files of finished tiles once the result is complete"
    )
    parser.add_argument(
        "--tiles",
        type=_tiles,
        metavar="FIRST:END",
        help="compute only these tiles, such as 0:8: jobs with a directory each, which cspr merge joins",
    )
    add_all_errors(parser)
    add_device(parser, usual="a GPU if jax finds one, for large maps by formulas; cpu for others")


def _tiles(text: str) -> tuple[int, int]:
    first, _, end = text.partition(":")
    try:
        return int(first), int(end)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text}: must be FIRST:END, such as 0:8") from error


def _run(options: argparse.Namespace) -> int:
    from cspr_jax.api import sweeps
    from cspr_jax.sweep import engine

    if options.scheduler is not None and options.device is not None:
        raise ConfigError("--device", f"{options.device}: cannot be combined with --scheduler, whose workers choose")
    sweep = sweeps.checked_sweep(options.sweep, parameters_of(options))
    if options.scheduler is not None:
        process_environment.quiet_scheduler()
    directory = options.output or sweeps.run_directory(sweep)
    choices = engine.Options(options.accept_environment_change, options.prune, tuple(sys.argv), options.tiles)
    with stop_signals(warn) as stop, progress() as on_tile:
        hooks = engine.Hooks(stop, on_tile, warn=warn)
        job = sweeps.Job(sweep, directory, choices, hooks, options.workers, options.scheduler)
        path = job.finished()
        if path is None:
            path = job.go(lambda: prepare_jax(options, prefers_cpu=sweep.prefers_cpu))
        else:
            print_line("already finished; nothing was computed")
    print_path(path)
    return ExitCode.DONE


def _add_merge(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("paths", type=Path, nargs="+", metavar="PATH", help="run directory, or result")
    add_output(parser, "run directory of the joined map", metavar="DIR", required=True)
    parser.add_argument(
        "--accept-environment-change",
        action="store_true",
        help="join although versions, machines or libraries differ",
    )


def _merge(options: argparse.Namespace) -> int:
    from cspr_jax.api import sweeps
    from cspr_jax.sweep import engine

    choices = engine.Options(options.accept_environment_change, command=tuple(sys.argv))
    with stop_signals(warn) as stop, progress() as on_tile:
        hooks = engine.Hooks(stop, on_tile, warn=warn)
        path = sweeps.merged(options.paths, options.output, choices, hooks)
    print_path(path)
    return ExitCode.DONE


def _add_status(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", type=Path, help="run directory")
    add_json(parser)


def _status(options: argparse.Namespace) -> int:
    from cspr_jax.api.sweeps import status

    state = status(options.path)
    if options.json:
        print_json(state)
        return ExitCode.DONE
    last, fraction = state["last"] or {}, 100.0 * state["cells_done"] / state["cells"]
    cells = f"{state['cells_done']:,} of {state['cells']:,} cells, {state['shards']} of {state['tiles']} tiles"
    for line in (
        f"{state['directory']}: {state['sweep']}, identity {state['identity'][:12]}",
        f"  {state['state_text']}",
        f"  {fraction:.0f} % done: {cells}",
        *_details(state),
        f"  result: {state['result'] or 'not yet'}",
        f"  last: {last.get('event', '-')} at {last.get('time', '-')}",
    ):
        print_line(line)
    return ExitCode.DONE


def _details(state: dict[str, Any]) -> list[str]:
    # Return lines that apply only to some runs.
    lines = list[str]()
    if state["cells_per_second"] is not None and state["result"] is None:
        left = datetime.timedelta(seconds=round(state["seconds_left"]))
        lines.append(f"{state['cells_per_second']:,.3g} cells/s; at this rate {left} left")
    if state["quarantined"]:
        lines.append(f"damaged files moved to quarantine/: {state['quarantined']}")
    if state["unfinished"]:
        lines.append(f"half-written files, which the next run removes: {state['unfinished']}")
    return [f"  {line}" for line in lines]


def _add_verify(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", type=Path, help="run directory, result, motion, or certificate (.json)")
    add_json(parser)


def _verify_certificate(options: argparse.Namespace) -> int:
    from cspr_jax.api.certificates import verify_certificate

    finding = verify_certificate(options.path)
    if options.json:
        print_json(finding.to_dict())
    elif finding.holds:
        print_line(f"{options.path}: the proof holds: {finding.message}")
    else:
        warn(f"{options.path}: the proof does not hold: {finding.message}")
    return ExitCode.DONE if finding.holds else ExitCode.SELF_CHECK


def _verify(options: argparse.Namespace) -> int:
    if options.path.suffix == ".json":
        return _verify_certificate(options)
    from cspr_jax.api.sweeps import verify

    report = verify(options.path)
    if options.json:
        print_json(report)
    else:
        counts = ", ".join(f"{key} {report[key]}" for key in VERIFIED if key in report)
        if counts:  # a file that cannot be read has no counts
            print_line(f"{report['path']}: {counts}")
    again = "run the sweep" if "shards" in report else "run or plan it"
    for error in report["faults"]:
        warn(f"{error}: {again} again to make it anew")
    unreadable = report.get("unreadable", [])
    for line in unreadable:
        warn(line)
    return ExitCode.INPUT_OUTPUT if report["faults"] or unreadable else ExitCode.DONE


def _add_volume(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", type=Path, help="result, or run directory")
    add_json(parser)


def _volume(options: argparse.Namespace) -> int:
    from cspr_jax.api.sweeps import workspace_volume
    from cspr_jax.outputs.plots.selection import result_at

    volume = workspace_volume(result_at(options.path))
    if options.json:
        print_json(volume.to_dict())
    else:
        for line in volume.lines():
            print_line(line)
    return ExitCode.DONE


COMMANDS = (
    Command("run", "compute a sweep file into an HDF5 result, whose path is the last line printed", _add_run, _run),
    Command("merge", "join maps: tiles of one map computed apart, or maps that differ in one axis", _add_merge, _merge),
    Command("status", "say how far a run has come, without changing it", _add_status, _status),
    Command("verify", "check all files of a run, a result or motion file, or a certificate", _add_verify, _verify),
    Command(
        "volume",
        "print the volume of a map's workspace, and the error due to the grid",
        _add_volume,
        _volume,
    ),
)
