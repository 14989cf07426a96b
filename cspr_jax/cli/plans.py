"""Commands for sequences of poses: plan, and replay, which plays a plan in MuJoCo."""

import argparse
import math
from pathlib import Path
from typing import Any

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
    print_answer,
    print_json,
    print_line,
    print_table,
    warn,
)
from cspr_jax.errors import ConfigError, ExitCode
from cspr_jax.outputs.plots.style.options import add_style
from cspr_jax.runtime.exact_arithmetic import need_exact
from cspr_jax.runtime.progress import waiting
from cspr_jax.schema.setpoints import LARGEST_RATE, SETPOINT_FORMATS, USUAL_RATE
from cspr_jax.store.files.publishing import check_writable

ENDINGS = (".csv", ".h5", ".json")
SAME_TICK = 1e-6  # fraction of a step by which the last row may be off the grid of the others
_STEP = "longest step of MuJoCo, s (default 0.0005)"


def _add_plan(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("plan", type=Path, help="plan file (TOML)")
    add_parameters(parser)
    add_json(parser)
    add_retime(parser, "run along the paths of the plan in the least time that all limits allow")
    add_files(parser, "`samples` rows per segment", "write the best candidate's motion even if it is not feasible")
    add_all_errors(parser)
    add_device(parser)


def add_retime(parser: argparse.ArgumentParser, does: str) -> None:
    """Add the options of retiming."""
    parser.add_argument("--retime", action="store_true", help=does)
    parser.add_argument(
        "--ramp-time",
        type=float,
        metavar="S",
        help="--retime: time in which accelerations rise and fall, s (default 0.1); 0: they jump",
    )
    parser.add_argument(
        "--grid",
        type=int,
        metavar="N",
        help="--retime: cells of each part of the path without a stop (default 500)",
    )


def retime_settings(options: argparse.Namespace) -> dict[str, Any]:
    """Settings of retiming, from the options."""
    from cspr_jax.schema.limits import LARGEST_GRID

    settings = {name: getattr(options, name) for name in ("ramp_time", "grid")}
    settings = {name: value for name, value in settings.items() if value is not None}
    for name in () if options.retime else settings:
        raise ConfigError(f"--{name.replace('_', '-')}", "must be absent without --retime")
    if not 0.0 <= settings.get("ramp_time", 0.0) < float("inf"):
        raise ConfigError("--ramp-time", f"{options.ramp_time}: must be a number >= 0, in s")
    if not 2 <= settings.get("grid", 2) <= LARGEST_GRID:
        raise ConfigError("--grid", f"{options.grid}: must be a whole number from 2 to {LARGEST_GRID}")
    return settings


def add_files(parser: argparse.ArgumentParser, usual_rows: str, anyway: str) -> None:
    """Add the options for files of a motion: rows, a model for MuJoCo, a film."""
    add_output(parser, "write the motion to FILE.csv, FILE.h5 or FILE.json", metavar="FILE")
    parser.add_argument("--anyway", action="store_true", help=anyway)
    parser.add_argument(
        "--rate",
        type=float,
        metavar="HZ",
        help=f"rows of -o per second (default: {usual_rows}), and set points per second (default: {USUAL_RATE:g}); "
        "without -o and --setpoints, --json has the rows",
    )
    parser.add_argument(
        "--setpoints",
        type=Path,
        metavar="FILE",
        help="write set points for the motors of a feasible motion: .csv, .yaml and .json (ROS 2), .txt (counts)",
    )
    parser.add_argument(
        "--mjcf",
        type=Path,
        metavar="FILE.xml",
        help="write a model for MuJoCo, and beside it FILE_control.csv, the tensions that move it along the plan",
    )
    parser.add_argument("--step", type=float, metavar="S", help=f"--mjcf: {_STEP}")
    parser.add_argument(
        "--elastic",
        action="store_true",
        help="--mjcf: cables are springs, by axial_stiffness of the robot; FILE_control.csv has unstretched lengths",
    )
    parser.add_argument(
        "--certificate",
        type=Path,
        metavar="FILE.json",
        help="write what is proved, feasible or not, so that `cspr verify` or a checker of your own can check it",
    )
    parser.add_argument("--animate", type=Path, metavar="FILE", help="write a film: .gif, .mp4 or .html")
    parser.add_argument(
        "--speed", type=float, metavar="X", help="--animate: playback speed relative to real time (default 1)"
    )


def add_without(parser: argparse.ArgumentParser) -> None:
    """Add the option --without."""
    parser.add_argument(
        "--without",
        type=int,
        nargs="+",
        metavar="CABLE",
        help="cables that are gone, from 0 on: those of the robot file",
    )


def check_files(options: argparse.Namespace) -> None:
    """Refuse impossible options for files before slow work starts."""
    if options.output is not None and options.output.suffix not in ENDINGS:
        raise ConfigError("-o", f"{options.output}: must end in .csv or .h5 or .json")
    if options.rate is not None and options.output is options.setpoints is None and not options.json:
        raise ConfigError("--rate", "must be absent without -o, --setpoints or --json")
    _check_setpoints(options)
    if options.rate is not None and not 0.0 < options.rate < float("inf"):
        raise ConfigError("--rate", f"{options.rate}: must be a number > 0, in Hz")
    if options.mjcf is not None and options.mjcf.suffix != ".xml":
        raise ConfigError("--mjcf", f"{options.mjcf}: must end in .xml")
    if options.mjcf is not None and options.output == options.mjcf.with_name(f"{options.mjcf.stem}_control.csv"):
        raise ConfigError("-o", f"{options.output}: must be another name: --mjcf writes the control file there")
    if options.animate is not None and options.animate.suffix not in (".gif", ".mp4", ".html"):
        raise ConfigError("--animate", f"{options.animate}: must end in .gif, .mp4 or .html")
    if options.speed is not None and options.animate is None:
        raise ConfigError("--speed", "must be absent without --animate")
    if options.speed is not None and not 0.0 < options.speed < float("inf"):
        raise ConfigError("--speed", f"{options.speed}: must be a number > 0")
    if options.step is not None and options.mjcf is None:
        raise ConfigError("--step", "must be absent without --mjcf")
    if options.elastic and options.mjcf is None:
        raise ConfigError("--elastic", "must be absent without --mjcf")
    _check_step(options)
    _check_certificate(options)
    has_rows = options.json and options.rate is not None and options.setpoints is None
    if options.anyway and not has_rows and options.output is options.mjcf is options.animate is None:
        raise ConfigError("--anyway", "must be absent without -o, --mjcf or --animate")
    for path in (options.output, options.mjcf, options.animate, options.setpoints, options.certificate):
        check_writable(path)


def _check_setpoints(options: argparse.Namespace) -> None:
    path = options.setpoints
    if path is None:
        return
    if path.suffix not in SETPOINT_FORMATS:
        raise ConfigError("--setpoints", f"{path}: must end in {' or '.join(SETPOINT_FORMATS)}")
    if options.rate is not None and not 0.0 < options.rate <= LARGEST_RATE:
        raise ConfigError("--rate", f"{options.rate:g}: must be a number > 0, at most {LARGEST_RATE:g}, in Hz")
    if path in (options.output, options.mjcf and options.mjcf.with_name(f"{options.mjcf.stem}_control.csv")):
        raise ConfigError("--setpoints", f"{path}: must be another name: another file of the motion is written there")


def _check_certificate(options: argparse.Namespace) -> None:
    path = options.certificate
    if path is None:
        return
    need_exact("--certificate")
    if path.suffix != ".json":
        raise ConfigError("--certificate", f"{path}: must end in .json")
    if path in (options.output, options.setpoints):
        raise ConfigError("--certificate", f"{path}: must be another name: another file of the motion is written there")


def _check_step(options: argparse.Namespace) -> None:
    if options.step is not None and not 0.0 < options.step < float("inf"):
        raise ConfigError("--step", f"{options.step}: must be a number > 0, in s")


def _planned(options: argparse.Namespace) -> Any:
    from cspr_jax.config.hints import plan_hints, robot_hints

    parameters = parameters_of(options)
    with waiting():
        prepare_jax(options, quick=True)
        from cspr_jax.api import plans

        plan = plans.plan(options.plan, parameters)
    hints = robot_hints(plan.robot_file) + ([] if plan.feasible else plan_hints(plan.keys, plan.robot_file))
    for line in [*plan.warnings, *(f"hint: {line}" for line in hints)]:
        warn(line)
    return plan


def _plan(options: argparse.Namespace) -> int:
    check_files(options)
    settings = retime_settings(options)
    plan = _planned(options)
    if options.retime:
        plan = retimed(plan, settings)
    # Write files first: they took long, and printing a table may fail.
    try:
        write_files(plan, options)
    finally:
        if options.json:
            print_json(plan.to_dict() | rows_beside(plan, options))
        else:
            print_table(plan.to_table())
            print_last_step(plan, options)
    return ExitCode.DONE if plan.feasible else ExitCode.NOT_FEASIBLE


def retimed(plan: Any, settings: dict[str, Any]) -> Any:
    """Retime a plan or a check; warnings are shown."""
    from cspr_jax.api.retiming import retime

    before = getattr(plan, "plan", plan).warnings
    with waiting():
        plan = retime(plan, **settings)
    for line in getattr(plan, "plan", plan).warnings:
        if line not in before:
            warn(line)
    return plan


def rows_beside(plan: Any, options: argparse.Namespace) -> dict[str, Any]:
    """The rows that --rate asks for without -o; if the motion is not feasible, only with --anyway."""
    if options.rate is None:
        return {}
    step = last_step(plan, options.rate)
    of_step = {"last_step": step if math.isfinite(step) else None}
    if options.output is not None or options.setpoints is not None:
        return of_step
    if not (plan.feasible or options.anyway):
        warn("rows: left out, since a segment is not proved feasible (--anyway gives them)")
        return of_step | {"rows": None}
    return plan.rows_to_dict(options.rate) | of_step


def write_files(plan: Any, options: argparse.Namespace) -> None:
    """Write the files that options name; if the motion is not feasible, all but its certificate only with --anyway."""
    if options.certificate is not None:
        with waiting():
            plan.save_certificate(options.certificate)
    of_mjcf = {"elastic": options.elastic} | ({} if options.step is None else {"step": options.step})
    if options.setpoints is not None and plan.feasible:
        with waiting():
            plan.save_setpoints(options.setpoints, options.rate or USUAL_RATE)
    elif options.setpoints is not None:
        warn(f"{options.setpoints}: not written, since a segment is not proved feasible")
    for path, save in (
        (options.output, lambda path: plan.save(path, options.rate, anyway=True)),
        (options.mjcf, lambda path: plan.save_mjcf(path, anyway=True, **of_mjcf)),
        (options.animate, lambda path: plan.animate(path, options.speed or 1.0, anyway=True)),
    ):
        if path is None:
            continue
        if plan.feasible or options.anyway:
            with waiting():
                save(path)
            if not plan.feasible:
                warn(f"{path}: not proved feasible; the file says so")
        else:
            warn(f"{path}: not written, since a segment is not proved feasible (--anyway writes it)")


def last_step(plan: Any, rate: float | None) -> float:
    """Time between the last two rows; the last row is the end of the motion, on the grid of the others or off it."""
    length = float(plan.answers.duration.sum())
    if rate is None or not math.isfinite(length):
        return math.nan
    steps = math.ceil(length * rate - SAME_TICK) - 1
    return length - max(steps, 0) / rate


def print_last_step(plan: Any, options: argparse.Namespace) -> None:
    """Warn if the last row of a written file is off the grid of the others."""
    step, is_written = last_step(plan, options.rate), plan.feasible or options.anyway
    if options.output is not None and is_written and step * (options.rate or 0.0) < 1.0 - SAME_TICK:
        end = float(plan.answers.duration.sum())
        print_line(f"{options.output}: the last row is the end, t = {end:.9g} s, {step:.6g} s after the one before it")


def _add_replay(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("plan", type=Path, help="plan file (TOML)")
    add_parameters(parser)
    add_json(parser)
    add_output(parser, "draw both paths and the deviations: .png, .pdf, .svg", metavar="FILE")
    parser.add_argument(
        "--anyway", action="store_true", help="play the best candidate's motion even if it is not feasible"
    )
    parser.add_argument("--step", type=float, metavar="S", help=_STEP)
    parser.add_argument(
        "--elastic",
        action="store_true",
        help="play it on elastic cables (axial_stiffness) by drums that set lengths, with and without compensation of "
        "the stretch, and say how far off the plan it comes",
    )
    add_style(parser)
    add_all_errors(parser)
    add_device(parser)


def _replay(options: argparse.Namespace) -> int:
    if options.output is not None and options.elastic:
        raise ConfigError("-o", "must be absent with --elastic, which has no picture")
    _check_step(options)
    style = checked_picture(options)
    from cspr_jax.outputs.mujoco.module import need_mujoco

    need_mujoco()
    plan = _planned(options)
    if not (plan.feasible or options.anyway):
        warn(f"{options.plan}: not played, since a segment is not proved feasible (--anyway plays it)")
        return ExitCode.NOT_FEASIBLE
    with waiting():
        from cspr_jax.api.files.replays import replay, replay_elastic

        of_step = {} if options.step is None else {"step": options.step}
        if options.elastic:
            played: Any = replay_elastic(plan, anyway=True, **of_step)
        else:
            played = replay(plan, anyway=True, **of_step)
        if options.output is not None:
            played.plot(output=options.output, **style)
    print_answer(played, as_json=options.json)
    return ExitCode.DONE if plan.feasible else ExitCode.NOT_FEASIBLE


COMMANDS = (
    Command("plan", "plan motions through a sequence of poses", _add_plan, _plan),
    Command(
        "replay",
        "play a plan in MuJoCo, and say how far path and tensions deviate from the planned ones",
        _add_replay,
        _replay,
    ),
)
