"""Commands about pictures of results: plot."""

import argparse
import sys

from cspr_jax.cli.command import Command, prepare_jax
from cspr_jax.errors import ConfigError, ExitCode
from cspr_jax.outputs.plots.options import ACCELERATION, add_plot
from cspr_jax.runtime.progress import waiting


def _plot(options: argparse.Namespace) -> int:
    from cspr_jax.api.pictures import plot
    from cspr_jax.outputs.plots import selection

    at = selection.places(options.at)
    results = [selection.result_at(path) for path in options.result]
    if options.quantity == ACCELERATION:  # the one picture that is computed
        prepare_jax(options)
    output = options.output or results[0].with_suffix(".png")
    if not output.suffix:
        raise ConfigError("-o", f"{output}: must end in .png, .pdf, .svg or another picture format")
    names = ("quantity", "lines", "envelope", "solid", "size", "dpi", "font_size")
    with waiting():
        plot(results, at=at, output=output, **{name: getattr(options, name) for name in names})
    sys.stdout.write(f"{output}\n")
    return ExitCode.DONE


COMMANDS = (Command("plot", "draw a result file, or several maps in one picture", add_plot, _plot),)
