"""Commands that start files and list what there is: new, import, robots, quantities, examples."""

import argparse
from pathlib import Path

from cspr_jax.cli.command import Command, add_json, add_output, print_json, print_path, print_table, warn, write
from cspr_jax.errors import ConfigError, ExitCode


def _add_import(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file", type=Path, help="NAME_cables.xml (with NAME_bodies.xml beside it), .json, .yaml or .wcrfx"
    )
    add_output(parser, "write FILE.toml (default: print it)", metavar="FILE")
    parser.add_argument("--set", metavar="NAME", help="CASPR: set of cables (default: the one that the file names)")


def _import(options: argparse.Namespace) -> int:
    if options.output is not None and options.output.suffix != ".toml":
        raise ConfigError("-o", f"{options.output}: must end in .toml")
    from cspr_jax.api.files.imports import import_robot

    robot = import_robot(options.file, options.set)
    for line in robot.warnings:
        warn(f"{options.file}: {line}")
    if options.output is None:
        write(robot.to_toml())
    else:
        print_path(robot.save(options.output))
    return ExitCode.DONE


def _add_list(parser: argparse.ArgumentParser) -> None:
    add_json(parser, "array")


def _add_robots(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="describe these robots, by catalogue name or robot file (default: list)",
    )
    add_json(parser, "array")


def _robots(options: argparse.Namespace) -> int:
    from cspr_jax.outputs.listings import catalogue_table, robot_details

    if not options.names and not options.json:  # answer without slow imports
        print_table(catalogue_table())
        return ExitCode.DONE
    from cspr_jax.api.files.listings import list_robots

    robots = list_robots(options.names)
    if options.json:
        print_json(robots)
    else:
        for robot in robots:
            print_table(robot_details(robot))
    return ExitCode.DONE


def _quantities(options: argparse.Namespace) -> int:
    from cspr_jax.api.files.listings import list_quantities
    from cspr_jax.outputs.listings import quantities_table

    quantities = list_quantities()
    print_json(quantities) if options.json else print_table(quantities_table(quantities))
    return ExitCode.DONE


def _add_examples(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", nargs="*", help="examples to copy (default: list them)")
    parser.add_argument("--all", action="store_true", help="copy all examples")
    add_output(parser, "folder to copy to (default .)", default=Path(), metavar="DIR")
    add_json(parser)


def _examples(options: argparse.Namespace) -> int:
    from cspr_jax.api.files.listings import copy_examples, list_examples

    examples = list_examples()
    names = list(examples) if options.all else options.name
    shown = [str(path) for path in copy_examples(names, options.output)] if names else examples
    lines = shown if names else [f"{name:<21} {purpose}" for name, purpose in examples.items()]
    if options.json:
        print_json(shown)
    else:
        for line in lines:
            print_path(line)
    return ExitCode.DONE


def _add_new(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", choices=("robot", "sweep", "plan"), help="kind of file")
    parser.add_argument("path", type=Path, help="file to write, .toml; nothing is overwritten")
    parser.add_argument(
        "--like",
        default="prototype",
        metavar="ROBOT",
        help="robot: catalogue robot whose values to take (`cspr robots`)",
    )
    parser.add_argument("--map", default="minimum-arcs", metavar="KIND", help="sweep: kind of map")
    parser.add_argument("--family", default="hypocycloid-standard", metavar="NAME", help="plan: trajectory family")


def _new(options: argparse.Namespace) -> int:
    from cspr_jax.api.files.listings import new_file

    print_path(new_file(options.what, options.path, like=options.like, map=options.map, family=options.family))
    return ExitCode.DONE


COMMANDS = (
    Command("new", "write a robot, sweep or plan file to start from, with every key explained", _add_new, _new),
    Command("import", "convert a robot of CASPR, cdpyr or WireX into a robot file", _add_import, _import),
    Command("robots", "list the robots of the catalogue, or describe robots in full", _add_robots, _robots),
    Command("quantities", "list the quantities that a result can hold", _add_list, _quantities),
    Command("examples", "list sweep and plan files to start from, or copy them", _add_examples, _examples),
)
