"""Commands at the machine: size, the smallest motors; anchors, lines for firmware."""

import argparse
from pathlib import Path

from cspr_jax.cli.command import (
    Command,
    add_all_errors,
    add_device,
    add_json,
    add_output,
    checked_picture,
    prepare_jax,
    print_json,
    print_line,
    print_table,
    warn,
)
from cspr_jax.errors import ConfigError, ExitCode
from cspr_jax.outputs.plots.style.options import add_style
from cspr_jax.runtime.progress import waiting


def _add_size(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "sources",
        nargs="+",
        type=Path,
        metavar="SOURCE",
        help="plans (TOML); finished maps of workspaces, whose poses are held at rest; with --robot motions (CSV)",
    )
    parser.add_argument("--robot", help="motions of files: a catalogue name, or the path of a robot file")
    parser.add_argument(
        "--factor",
        type=float,
        default=1.5,
        metavar="X",
        help="safety factor on torque, speed, power and rms torque (default 1.5)",
    )
    add_json(parser)
    add_output(parser, "draw torque over speed of each motor: .png, .pdf, .svg", metavar="FILE")
    add_style(parser)
    add_all_errors(parser)
    add_device(parser)


def _print_sizes(options: argparse.Namespace) -> int:
    if not 0.0 < options.factor < float("inf"):
        raise ConfigError("--factor", f"{options.factor:g}: must be a number > 0")
    style = checked_picture(options)
    with waiting():
        prepare_jax(options, quick=True)
        from cspr_jax.api.checks import check_file
        from cspr_jax.api.sizing import size

        def source(path: Path):
            is_motion = options.robot is not None and path.suffix != ".toml"
            return check_file(path, {"robot": options.robot}) if is_motion else path

        sizes = size([source(path) for path in options.sources], factor=options.factor)
        if options.output is not None:
            sizes.plot(output=options.output, **style)
    if options.json:
        print_json(sizes.to_dict())
    else:
        print_table(sizes.to_table())
    return ExitCode.DONE


def _add_anchors(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("robot", help="a catalogue name, or the path of a robot file")
    parser.add_argument(
        "--for",
        dest="firmware",
        choices=("hangprinter", "klipper"),
        required=True,
        help="hangprinter: lines M669 and M666 of RepRapFirmware; klipper: sections of its kinematics winch",
    )
    parser.add_argument(
        "--origin",
        type=float,
        nargs=3,
        default=(0.0, 0.0, 0.0),
        metavar=("X", "Y", "Z"),
        help="point at which the machine is homed, in the axes of the robot file, m (default: their origin)",
    )
    add_all_errors(parser)


def _anchors(options: argparse.Namespace) -> int:
    from cspr_jax.api.files.anchors import anchors

    for line in anchors(options.robot, firmware=options.firmware, origin=options.origin):
        print_line(line)
    if options.origin == (0.0, 0.0, 0.0):
        warn("hint: the machine is taken to be homed at the origin of the robot file; --origin names another point")
    return ExitCode.DONE


COMMANDS = (
    Command("size", "find the smallest motors that do plans or hold poses of a workspace", _add_size, _print_sizes),
    Command("anchors", "print anchors and drums as the firmware of a controller reads them", _add_anchors, _anchors),
)
