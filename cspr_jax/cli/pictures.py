"""Commands for pictures and pages of results: plot, report."""

import argparse
from pathlib import Path

from cspr_jax.cli.command import (
    Command,
    add_all_errors,
    add_device,
    add_output,
    check_picture_format,
    prepare_jax,
    print_path,
    warn,
)
from cspr_jax.errors import ExitCode
from cspr_jax.outputs.plots.style.options import ACCELERATION, add_best, add_motion_plan, add_plot
from cspr_jax.runtime.progress import waiting


def _plot(options: argparse.Namespace) -> int:
    from cspr_jax.api.files.pictures import plot
    from cspr_jax.outputs.plots import selection

    at = selection.coordinates_of(options.at)
    results = [selection.result_at(path) for path in options.result]
    if options.quantity == ACCELERATION or options.robot is not None:  # only these pictures compute something
        prepare_jax(options, quick=options.quantity != ACCELERATION)
    output = options.output or results[0].with_suffix(".png")
    check_picture_format(output)
    names = (
        "quantity",
        "best",
        "lines",
        "envelope",
        "solid",
        "ratio",
        "size",
        "dpi",
        "font_size",
        "preset",
        "title",
        "plan",
        "robot",
        "z_axis",
    )
    with waiting():
        plot(results, at=at, output=output, **{name: getattr(options, name) for name in names})
    print_path(output)
    return ExitCode.DONE


def _add_report(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("result", type=Path, help="result or run directory, motion of `cspr plan -o`, or plan file")
    add_output(parser, "page: .html (default: beside the result)", metavar="FILE")
    parser.add_argument("--quantity", help="map: quantity that the page shows first")
    add_best(parser)
    parser.add_argument(
        "--trajectories",
        type=int,
        default=50,
        metavar="K",
        help="map: include the motions of the K most informative cells (default 50)",
    )
    parser.add_argument(
        "--cell",
        action="append",
        default=[],
        metavar="AXIS=VALUE,...",
        help="map: also include the motion of this cell",
    )
    add_motion_plan(parser)
    add_all_errors(parser)
    add_device(parser)


def _report(options: argparse.Namespace) -> int:
    from cspr_jax.outputs.plots import selection

    cells = [selection.coordinates_of(words.split(","), "--cell") for words in options.cell]
    source = options.result if options.result.suffix == ".toml" else selection.result_at(options.result)
    output = options.output or source.with_suffix(".html")
    with waiting():
        prepare_jax(options, quick=True)
        from cspr_jax.api.files.reports import report

        choices = {
            name: getattr(options, name) for name in ("trajectories", "quantity", "best", "plan", "robot", "z_axis")
        }
        warnings = report(source, output, cells=cells, **choices)
    for line in warnings:
        warn(line)
    print_path(output)
    return ExitCode.DONE


COMMANDS = (
    Command("plot", "draw a result, or several in one picture", add_plot, _plot),
    Command("report", "write a page to explore a result or a plan in a browser", _add_report, _report),
)
