"""Options of the command line for pictures; without matplotlib, so that `cspr --help` is fast."""

import argparse
import re
from collections.abc import Sequence
from pathlib import Path

# Names that `--quantity` takes for motions.
ACCELERATION = "acceleration"
PATH_ACCELERATION = "path_acceleration"
LANDING = "landing"
PHASE_PLANE = "phase_plane"
TRAJECTORY = "trajectory"
TENSIONS = "tensions"
SUMMARY = "summary"
# Widths of pictures for papers, cm: common ones, and those of publishers.
USUAL = "usual"
WIDTHS = {
    "column": {USUAL: 8.89, "ieee": 8.89, "elsevier": 9.0},
    "page": {USUAL: 17.5, "ieee": 18.1, "elsevier": 19.0},
}
_WIDTH = re.compile(r"[\d.]+[a-z]*", re.ASCII)
_SHORTEST = 5  # smallest number of letters of an abbreviated option


def add_plot(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command that draws results."""
    parser.add_argument("result", type=Path, nargs="+", help="result or run directory, or motion of `cspr plan -o`")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="picture: .png, .pdf, .svg (default: beside the result)"
    )
    parser.add_argument(
        "--quantity",
        help="map: a quantity (default arcs or oscillations; see `cspr quantities`); motion: trajectory, the path in "
        "space; tensions, with their limits; summary, all on one page; acceleration, beside all that are feasible at "
        "a time; path_acceleration, over the path, between its bounds; phase_plane, path speeds over the path and "
        "what binds; or landing, of a sample of throws",
    )
    add_best(parser)
    parser.add_argument("--lines", metavar="AXIS", help="draw a map as lines, one for each point of this axis")
    parser.add_argument("--envelope", action="store_true", help='draw the outlines of a place of map = "orientations"')
    parser.add_argument(
        "--solid",
        action="store_true",
        help='draw the boundary of a map = "workspace" over x, y and z, with the robot in it',
    )
    parser.add_argument(
        "--ratio", action="store_true", help="draw the quantity of one map over that of another over the same cells"
    )
    parser.add_argument(
        "--at",
        action="append",
        default=[],
        metavar="AXIS=VALUE",
        help="fix an axis of a map at the point nearest to VALUE; motion: t=VALUE, s",
    )
    add_motion_plan(parser)
    parser.set_defaults(device=None)
    add_style(parser)


def add_best(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the best point of an axis of a map."""
    parser.add_argument(
        "--best",
        action="append",
        default=[],
        metavar="AXIS",
        help="map: show each cell at its best point of this axis, such as z0: feasible if any is, with the fewest "
        "arcs; --quantity best_AXIS draws that point itself",
    )


def add_motion_plan(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the plan of a motion in CSV."""
    parser.add_argument(
        "--plan", type=Path, metavar="FILE", help="plan file of a motion in CSV, which keeps neither robot nor limits"
    )
    parser.add_argument("--robot", help="or only its robot, whose axes its z is in: a catalogue name, or a robot file")
    parser.add_argument("--z-axis", choices=("up", "down"), help="or only where z points in a motion in CSV")


def add_style(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of every picture, which `style.style_of` reads."""
    parser.add_argument("--size", metavar="WIDTHxHEIGHT", help="size of the picture, cm, such as 16x10")
    presets = parser.add_mutually_exclusive_group()
    for name, widths in WIDTHS.items():
        journals = ", ".join(f"{words} {width:g}" for words, width in widths.items() if words != USUAL)
        presets.add_argument(
            f"--{name}",
            dest="preset",
            type=f"{name} {{}}".format,
            metavar="WIDTH",
            help=f"make it as wide as a {name} of a paper, {widths[USUAL]:g} cm, or WIDTH: {journals}, or as in 8.5cm",
        )
    parser.add_argument("--no-title", dest="title", action="store_false", help="leave out the title")
    parser.add_argument("--dpi", type=float, metavar="N", help="pixels per inch (default 160)")
    parser.add_argument(
        "--font-size", type=float, metavar="PT", help="size of the font, points (default 10; --column 8, --page 9)"
    )


def with_widths(words: Sequence[str]) -> list[str]:
    """Add the default where an option of a width has no value, since the name of a file may follow the option."""
    joined, rest = list[str](), list(words)
    while rest and rest[0] != "--":
        word = rest.pop(0)
        option = next((f"--{name}" for name in WIDTHS if len(word) >= _SHORTEST and f"--{name}".startswith(word)), None)
        if option is not None:
            named = bool(rest) and (any(rest[0] in widths for widths in WIDTHS.values()) or _WIDTH.fullmatch(rest[0]))
            word = f"{option}={rest.pop(0) if named else USUAL}"
        joined.append(word)
    return [*joined, *rest]
