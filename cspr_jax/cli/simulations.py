"""Command that drives a plan by its winches in MuJoCo."""

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
    print_answer,
    warn,
)
from cspr_jax.errors import ExitCode
from cspr_jax.outputs.plots.style.options import add_style
from cspr_jax.runtime.progress import waiting

NUMBERS = {
    "rate": ("HZ", "ticks of the controller a second (default 1000)"),
    "bandwidth": ("RAD/S", "natural frequency of the position loops, rad/s (default 60); 0: set points alone"),
    "delay": ("S", "time from a measurement to the torque that follows from it, s (default 0.001)"),
    "encoder_counts": ("N", "counts of the encoders a turn (default: the robot file's, else 4096); 0: exact angles"),
    "noise": ("RAD", "standard deviation of measured angles, rad (default 0)"),
    "damping_time": ("S", "time constant of the damping of cables, s (default 0.002)"),
    "mass_factor": ("X", "mass and inertia of the effector over those of the plan (default 1)"),
    "friction_factor": ("X", "friction of the winches over that of the set points (default 1)"),
    "stiffness_factor": ("X", "stiffness of the cables over that of the robot file (default 1)"),
}


def _add_simulate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("plan", type=Path, help="plan file (TOML), whose robot has axial_stiffness and [winch]")
    add_parameters(parser)
    add_json(parser)
    add_output(parser, "draw both paths, errors, tensions and torques: .png, .pdf, .svg", metavar="FILE")
    for name, (metavar, text) in NUMBERS.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=float, metavar=metavar, help=text)
    parser.add_argument("--seed", type=int, metavar="N", help="seed of the noise (default 0)")
    parser.add_argument("--anyway", action="store_true", help="drive a plan even if it is not feasible")
    add_style(parser)
    add_all_errors(parser)
    add_device(parser)


def _simulate(options: argparse.Namespace) -> int:
    style = checked_picture(options)
    from cspr_jax.outputs.mujoco.module import need_mujoco

    need_mujoco()
    prepare_jax(options)
    names = [*NUMBERS, "seed"]
    settings = {name: value for name in names if (value := getattr(options, name)) is not None}
    with waiting():
        from cspr_jax.api.files.simulations import simulate
        from cspr_jax.api.plans import plan

        planned = plan(options.plan, parameters_of(options))
        if not (planned.feasible or options.anyway):
            warn(f"{options.plan}: not driven, since a segment is not proved feasible (--anyway drives it)")
            return ExitCode.NOT_FEASIBLE
        simulation = simulate(planned, anyway=True, **settings)
        if options.output is not None:
            simulation.plot(output=options.output, **style)
    print_answer(simulation, as_json=options.json)
    return ExitCode.DONE if planned.feasible else ExitCode.NOT_FEASIBLE


COMMANDS = (Command("simulate", "drive a plan by its winches in MuJoCo, under control", _add_simulate, _simulate),)
