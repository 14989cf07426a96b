"""The command check, for motions of the user's own."""

import argparse
from pathlib import Path
from typing import Any

from cspr_jax.cli.command import (
    Command,
    add_all_errors,
    add_device,
    add_json,
    add_parameters,
    parameters_of,
    prepare_jax,
    print_json,
    print_line,
    print_table,
    warn,
)
from cspr_jax.cli.plans import (
    add_files,
    add_retime,
    add_without,
    check_files,
    print_last_step,
    retime_settings,
    retimed,
    rows_beside,
    write_files,
)
from cspr_jax.errors import ConfigError, ExitCode
from cspr_jax.runtime.exact_arithmetic import need_exact
from cspr_jax.runtime.progress import waiting


def _add_check(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("motion", type=Path, help="motion: samples (CSV, HDF5), or trajectories of CASPR (XML)")
    parser.add_argument("--robot", required=True, help="a catalogue name, or the path of a robot file")
    parser.add_argument(
        "--limits",
        type=Path,
        metavar="FILE",
        help="limits (TOML), with the keys of [limits] of a plan, [[obstacle]] tables, platform_box or platform_hull",
    )
    parser.add_argument("--trajectory", metavar="ID", help="one of several trajectories that a file of CASPR holds")
    parser.add_argument(
        "--interpolation",
        choices=("cubic", "quintic", "hermite"),
        help="curve through the samples (default: as the file says, else hermite with velocities, cubic without)",
    )
    parser.add_argument(
        "--ends",
        choices=("rest", "natural", "periodic"),
        help="ends of the curve (default: as the file says, else rest)",
    )
    parser.add_argument(
        "--smooth", type=float, metavar="SD", help="take off noise of the positions of this standard deviation, m"
    )
    parser.add_argument(
        "--point",
        choices=("mass-centre", "origin"),
        help="point of a platform whose positions these are (default: as the file says, else its mass centre)",
    )
    parser.add_argument(
        "--digits",
        type=int,
        metavar="N",
        help="find causes, demands and margins to this number of digits, 1 to 15, by exact arithmetic",
    )
    parser.add_argument(
        "--slower",
        action="store_true",
        help="find the least uniform stretching of time that is feasible, and check what it stretches",
    )
    add_without(parser)
    add_parameters(parser)
    add_retime(parser, "run along its path in the least time that all limits allow, and check what comes of it")
    add_json(parser)
    add_files(parser, "400 rows", "write the motion even if it is not feasible")
    add_all_errors(parser)
    add_device(parser)


def _spec(options: argparse.Namespace) -> dict[str, Any]:
    from cspr_jax.config.keys.limits import LimitTable
    from cspr_jax.config.keys.obstacles import ObstacleKeys
    from cspr_jax.config.parameters import with_values
    from cspr_jax.config.reading import checked, read_toml

    if options.smooth is not None and not 0.0 < options.smooth < float("inf"):
        raise ConfigError("--smooth", f"{options.smooth}: must be a number > 0, in m")
    spec = {
        name: getattr(options, name) for name in ("trajectory", "interpolation", "ends", "smooth", "point", "without")
    }
    spec = {name: value for name, value in spec.items() if value is not None} | {"robot": options.robot}
    spec = with_values(spec, parameters_of(options))
    if options.limits is not None:
        limits = read_toml(options.limits)
        around = {name: limits.pop(name) for name in ObstacleKeys.model_fields if name in limits}
        checked(ObstacleKeys, around, options.limits)
        limits = {**limits.pop("limits"), **limits} if isinstance(limits.get("limits"), dict) else limits
        checked(LimitTable, limits, options.limits)
        spec |= {**around, "limits": limits}
    return spec


def _check(options: argparse.Namespace) -> int:
    check_files(options)
    control = None if options.mjcf is None else options.mjcf.with_name(f"{options.mjcf.stem}_control.csv")
    written = {"-o": options.output, "--setpoints": options.setpoints, "--mjcf": options.mjcf}
    written["--certificate"] = options.certificate
    for option, path in (*written.items(), ("--mjcf", control)):
        if path is not None and path.resolve() == options.motion.resolve():
            raise ConfigError(option, f"{path}: must be another name: the motion is there")
    settings = retime_settings(options)
    if options.retime and options.slower:
        raise ConfigError("--retime", "must be absent with --slower")
    if options.digits is not None:
        from cspr_jax.errors.arguments import MOST_DIGITS

        need_exact("--digits")
        if not 1 <= options.digits <= MOST_DIGITS:
            raise ConfigError("--digits", f"{options.digits}: must be a whole number from 1 to {MOST_DIGITS}")
        if options.slower or options.retime:
            raise ConfigError("--digits", "must be absent with --slower and --retime, which give motions of their own")
    spec = _spec(options)
    with waiting():
        prepare_jax(options, quick=True)
        from cspr_jax.api import checks

        outputs = {
            **written,
            "--animate": options.animate,
            "--slower": options.slower,
            "--retime": options.retime,
            "--rate": options.json and options.rate,
            "--digits": options.digits,
        }
        names = [name for name, value in outputs.items() if value]
        check = checks.check_file(options.motion, spec, outputs=names, limits=options.limits, digits=options.digits)
        slower = check.slower() if options.slower and not check.feasible else None
    for line in check.plan.warnings:
        warn(line)
    faster = retimed(check, settings) if options.retime else None
    shown = faster or check if slower is None or slower.check is None else slower.check
    try:
        write_files(shown.plan, options)
    finally:
        _print(options, check, slower, faster, shown)
    return ExitCode.DONE if shown.feasible else ExitCode.NOT_FEASIBLE


def _print(options: argparse.Namespace, check: Any, slower: Any, faster: Any, shown: Any) -> None:
    if options.json:
        others = {"slower": slower, "retimed": faster}
        tables = {name: other.to_dict() for name, other in others.items() if other is not None}
        print_json(check.to_dict() | tables | rows_beside(shown.plan, options))
        return
    for line in check.lines():
        print_line(line)
    print_table(check.to_table())
    if slower is not None:
        for line in slower.lines():
            print_line(line)
        if slower.check is not None:
            print_table(slower.check.to_table())
    if faster is not None:
        for line in faster.lines():
            print_line(line)
        print_table(faster.to_table())
    print_last_step(shown.plan, options)


COMMANDS = (
    Command("check", "check a motion of your own against the limits of a robot, with a proof", _add_check, _check),
)
