"""The command calibrate."""

import argparse
from pathlib import Path

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
)
from cspr_jax.errors import ConfigError, ExitCode
from cspr_jax.runtime.progress import waiting

GROUPS = "spools, attachments, offsets, drums, pulleys, tracker, target"


def _add_calibrate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "measurements",
        type=Path,
        help="table (CSV): length_1, ... or angle_1, ..., then x, y, z, qw, qx, qy, qz of a tracker; gaps are allowed",
    )
    parser.add_argument("--robot", required=True, help="a catalogue name, or the path of a robot file")
    parser.add_argument(
        "--free",
        metavar="LIST",
        help=f"what to estimate, of {GROUPS} (default: spools,attachments,offsets as far as the robot has them)",
    )
    parser.add_argument(
        "--sigma",
        metavar="LIST",
        help="standard deviations of lengths, m, positions, m, and turns, rad (default: 1e-4,1e-4,1e-3 times one "
        "factor, which is estimated)",
    )
    parser.add_argument(
        "--prior",
        type=float,
        metavar="SD",
        help="standard deviation of the nominal numbers, m: keeps the robot near them where measurements tell little "
        "(beside --sigma)",
    )
    parser.add_argument(
        "--loss",
        choices=("squares", "huber", "cauchy"),
        default="cauchy",
        help="robust loss that finds mistakes, which are left out (default: cauchy; squares: none is sought)",
    )
    parser.add_argument(
        "--point",
        choices=("mass-centre", "origin"),
        default="origin",
        help="point of a platform that the tracker follows (default: origin)",
    )
    parser.add_argument(
        "--distances",
        type=Path,
        metavar="FILE",
        help="distances between spools (CSV): first, second, distance, deviation",
    )
    parser.add_argument("--next", type=int, default=0, metavar="N", help="propose N poses to measure next")
    parser.add_argument(
        "--limits", type=Path, metavar="FILE", help="limits of these poses (TOML), as in [limits] of a plan"
    )
    add_output(parser, "write the calibrated robot, FILE.toml", metavar="FILE")
    parser.add_argument("--replace", action="store_true", help="let -o replace a file that is there")
    add_json(parser)
    add_device(parser)


def _calibrate(options: argparse.Namespace) -> int:
    if not 0 <= options.next <= 1000:
        raise ConfigError("--next", f"{options.next}: must be an integer from 0 to 1000")
    sigma = None if options.sigma is None else numbers_of("--sigma", options.sigma, (1, 2, 3), is_positive=True)
    with waiting():
        prepare_jax(options, quick=True)
        from cspr_jax.api import calibration
        from cspr_jax.api.arguments.calibration_arguments import limits_file

        if options.output is not None:
            calibration.check_output(options.output, replace=options.replace)
        result = calibration.calibrate(
            options.robot,
            options.measurements,
            free=[] if options.free is None else [word.strip() for word in options.free.split(",")],
            sigma=sigma,
            prior=options.prior,
            loss=options.loss,
            point=options.point,
            distances=options.distances,
            next=options.next,
            limits=limits_file(options.limits),
        )
    if options.output is not None:
        result.save(options.output, replace=options.replace)
    if options.json:
        print_json(result.to_dict())
    else:
        for line in result.lines():
            print_line(line)
        print_table(result.to_table())
        if options.output is not None:
            print_path(options.output)
    return ExitCode.DONE if result.is_converged else ExitCode.NOT_FEASIBLE


COMMANDS = (
    Command(
        "calibrate",
        "estimate spools, attachment points and offsets of a robot from measurements",
        _add_calibrate,
        _calibrate,
    ),
)
