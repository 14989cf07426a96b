"""Commands about sequences of poses: plan."""

import argparse
from pathlib import Path

from cspr_jax.cli.command import (
    Command,
    add_all_errors,
    add_device,
    add_json,
    add_output,
    prepare_jax,
    print_json,
    print_table,
    warn,
)
from cspr_jax.errors import ConfigError, ExitCode
from cspr_jax.runtime.progress import waiting


def _add_plan(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("plan", type=Path, help="plan file (TOML)")
    add_json(parser)
    add_output(parser, "write the motion to FILE.csv or FILE.h5", metavar="FILE")
    parser.add_argument("--anyway", action="store_true", help="write the best candidate's motion if it is not feasible")
    parser.add_argument("--rate", type=float, metavar="HZ", help="rows a second (default: `samples` rows a segment)")
    add_all_errors(parser)
    add_device(parser)


def _plan(options: argparse.Namespace) -> int:
    if options.output is not None and options.output.suffix not in (".csv", ".h5"):
        raise ConfigError("-o", f"{options.output}: must end in .csv or .h5")
    if options.rate is not None and not 0.0 < options.rate < float("inf"):
        raise ConfigError("--rate", f"{options.rate}: must be a number > 0, in Hz")
    if options.anyway and options.output is None:
        raise ConfigError("--anyway", "must be absent without -o")
    from cspr_jax.config.hints import plan_hints, robot_hints

    with waiting():
        prepare_jax(options)
        from cspr_jax.api import plans

        plan = plans.plan(options.plan)
    feasible = plan.feasible
    for line in plan.warnings:
        warn(line)
    _hint(robot_hints(plan.spec) + ([] if feasible else plan_hints(plan.keys, plan.spec)))
    if options.json:
        print_json(plan.to_dict())
    else:
        print_table(plan.to_table())
    if options.output is not None and (feasible or options.anyway):
        with waiting():
            plan.save(options.output, options.rate, anyway=True)
        if not feasible:
            warn(f"{options.output}: is not proved feasible; it says so itself")
    elif options.output is not None:
        warn(f"{options.output}: not written, since a segment is not proved feasible (--anyway writes it)")
    return ExitCode.DONE if feasible else ExitCode.NOT_FEASIBLE


def _hint(lines: list[str]) -> None:
    for line in lines:
        warn(f"hint: {line}")


COMMANDS = (Command("plan", "plan a sequence of poses", _add_plan, _plan),)
