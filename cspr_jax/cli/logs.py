"""Commands for measured cable lengths: locate, log."""

import argparse
from pathlib import Path
from typing import Any

from cspr_jax.cli.command import (
    Command,
    add_device,
    add_json,
    add_output,
    numbers_of,
    prepare_jax,
    print_json,
    print_line,
    print_path,
    print_table,
    warn,
)
from cspr_jax.errors import ConfigError, ExitCode
from cspr_jax.runtime.progress import waiting
from cspr_jax.store.files.publishing import check_writable


def _add_locate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("robot", help="a catalogue name, or the path of a robot file")
    parser.add_argument(
        "file", type=Path, nargs="?", help="CSV with columns length_1, length_2, ... (m) or angle_1, ... (rad)"
    )
    parser.add_argument("--lengths", metavar="L1,L2,...", help="lengths of the cables, m, in place of a file")
    parser.add_argument("--angles", metavar="A1,A2,...", help="angles of the motors, rad, in place of a file")
    parser.add_argument(
        "--start", metavar="X,Y,Z[,QW,QX,QY,QZ]", help="pose from which the search starts; see docs/machine.md"
    )
    parser.add_argument("--all", action="store_true", help="all solutions, not only the one that is meant")
    parser.add_argument(
        "--slack", action="store_true", help="let cables be slack: the poses of equilibrium with these lengths"
    )
    add_json(parser)
    add_output(parser, "write the poses to FILE.csv", metavar="FILE")
    add_device(parser)


def _locate(options: argparse.Namespace) -> int:
    sources = {"--lengths": options.lengths, "--angles": options.angles, "a file": options.file}
    named = [name for name, value in sources.items() if value is not None]
    if len(named) != 1:
        words = "given" if len(named) > 1 else "missing"
        raise ConfigError(" and ".join(named) or "--lengths", f"{words}: one of a file, --lengths and --angles")
    if options.output is not None and options.output.suffix != ".csv":
        raise ConfigError("-o", f"{options.output}: must end in .csv")
    check_writable(options.output)
    start = None if options.start is None else numbers_of("--start", options.start, (3, 7))
    word = "--lengths" if options.angles is None else "--angles"
    numbers = None if options.file is not None else numbers_of(word, options.lengths or options.angles or "")
    with waiting():
        prepare_jax(options, quick=True)
        from cspr_jax.api.files.locating import located

        poses = located(
            options.robot,
            options.file if numbers is None else numbers,
            start=start,
            angles=options.angles is not None,
            all_solutions=options.all,
            slack=options.slack,
        )
    if options.output is not None:
        poses.save(options.output)
    if options.json:
        print_json(poses.to_dict())
    else:
        for line in poses.lines():
            print_line(line)
        print_table(poses.to_table())
    return ExitCode.DONE if poses.is_found.all() else ExitCode.NOT_FEASIBLE


def _add_log(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", type=Path, help="log (CSV): t, and length_1, ... or angle_1, ..., and tension_1, ...")
    parser.add_argument("--plan", type=Path, required=True, help="plan file (TOML) that the machine has played")
    parser.add_argument(
        "--tolerance", type=float, metavar="M", help="largest position error allowed after the delay, m (exit code 1)"
    )
    parser.add_argument("--max-delay", type=float, metavar="S", help="largest delay that is looked for, s (default 2)")
    add_json(parser)
    add_output(parser, "write a page with charts: FILE.html", metavar="FILE")
    add_device(parser)


def _log(options: argparse.Namespace) -> int:
    if options.output is not None and options.output.suffix != ".html":
        raise ConfigError("-o", f"{options.output}: must end in .html")
    for name in ("tolerance", "max_delay"):
        value = getattr(options, name)
        if value is not None and not 0.0 < value < float("inf"):
            unit = "m" if name == "tolerance" else "s"
            raise ConfigError(f"--{name.replace('_', '-')}", f"{value}: must be a number > 0, in {unit}")
    check_writable(options.output)
    settings = {} if options.max_delay is None else {"max_delay": options.max_delay}
    with waiting():
        prepare_jax(options, quick=True)
        from cspr_jax.api.files.logs import compare_log

        compared = compare_log(options.log, options.plan, tolerance=options.tolerance, **settings)
        if options.output is not None:
            compared.page(options.output)
    for line in compared.warnings:
        warn(line)
    _print(options, compared)
    return ExitCode.DONE if compared.within_tolerance else ExitCode.NOT_FEASIBLE


def _print(options: argparse.Namespace, compared: Any) -> None:
    if options.json:
        print_json(compared.to_dict())
        return
    for line in compared.lines():
        print_line(line)
    print_table(compared.to_table())
    if options.output is not None:
        print_path(options.output)


COMMANDS = (
    Command("locate", "find poses from lengths of the cables, or from angles of the motors", _add_locate, _locate),
    Command("log", "compare a recorded log of a machine with the plan that it played", _add_log, _log),
)
