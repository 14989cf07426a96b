"""The command design: the best robot for what is asked of it."""

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
from cspr_jax.errors import ExitCode, StoppedError
from cspr_jax.outputs.plots.style.options import add_style
from cspr_jax.runtime.progress import waiting
from cspr_jax.sweep.signals import stop_signals


def _add_design(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("design", type=Path, help="design file (TOML)")
    add_output(parser, "directory of the design (default results/NAME); an earlier search there goes on", metavar="DIR")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw the design, too: .png, .pdf, .svg")
    add_style(parser)
    add_json(parser)
    add_all_errors(parser)
    add_device(parser)


def _design(options: argparse.Namespace) -> int:
    from cspr_jax.config.design import read_design

    style = checked_picture(options, "picture")
    read_design(options.design)  # mistakes are told before jax starts
    with stop_signals(warn) as stop:
        with waiting():
            prepare_jax(options)
            from cspr_jax.api.designs import design
        stop.busy, stop.work, stop.results = True, "the robot", "evaluated robots"
        result = design(options.design, options.output, on_progress=warn, stopped=lambda: bool(stop))
        if stop.code is not None:
            line = f"stopped: {result.directory} holds the best robot so far; run it again to go on"
            raise StoppedError(line, stop.code)
    if options.picture is not None:
        result.plot(output=options.picture, **style)
    if options.json:
        print_json(result.to_dict())
    else:
        print_table(result.to_table())
        print_line(result.directory)
    return ExitCode.DONE if result.feasible else ExitCode.NOT_FEASIBLE


COMMANDS = (
    Command("design", "find the best robot, by parameters and arrangements of its cables", _add_design, _design),
)
