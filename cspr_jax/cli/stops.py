"""The command stops: proved ways to rest from the instants of a plan."""

import argparse
from pathlib import Path

from cspr_jax.cli.command import (
    Command,
    add_all_errors,
    add_device,
    add_json,
    add_output,
    add_parameters,
    checked_picture,
    parameters_of,
    prepare_jax,
    print_json,
    print_table,
    warn,
)
from cspr_jax.errors import ConfigError, ExitCode
from cspr_jax.outputs.plots.style.options import add_style
from cspr_jax.runtime.progress import waiting

LARGEST_INSTANTS = 10_000


def _add_stops(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("plan", type=Path, help="plan file (TOML)")
    parser.add_argument(
        "--instants", type=int, default=50, metavar="N", help="number of equidistant instants of the plan (default 50)"
    )
    parser.add_argument(
        "--without", type=int, nargs="+", metavar="CABLE", help="cables that break at the instant, from 0 on"
    )
    add_parameters(parser)
    add_json(parser)
    add_output(parser, "draw plan and stops: .png, .pdf, .svg", metavar="FILE")
    add_style(parser)
    add_all_errors(parser)
    add_device(parser)


def _print_stops(options: argparse.Namespace) -> int:
    if not 1 <= options.instants <= LARGEST_INSTANTS:
        raise ConfigError("--instants", f"{options.instants}: must be a whole number from 1 to {LARGEST_INSTANTS}")
    style = checked_picture(options)
    with waiting():
        prepare_jax(options, quick=True)
        from cspr_jax.api import plans
        from cspr_jax.api.stops import stops

        plan = plans.plan(options.plan, parameters_of(options))
        for line in plan.warnings:
            warn(line)
        if not plan.feasible:
            warn(f"{options.plan}: not stopped, since a segment is not proved feasible")
            return ExitCode.NOT_FEASIBLE
        answer = stops(plan, instants=options.instants, without=options.without)
        if options.output is not None:
            answer.plot(output=options.output, **style)
    if options.json:
        print_json(answer.to_dict())
    else:
        print_table(answer.to_table())
    return ExitCode.DONE if answer.all_found else ExitCode.NOT_FEASIBLE


COMMANDS = (
    Command("stops", "find proved stops from the instants of a plan, also when cables break", _add_stops, _print_stops),
)
