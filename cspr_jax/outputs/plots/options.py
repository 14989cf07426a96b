"""Options of the command line for pictures; no matplotlib here, for `cspr --help` is to answer at once."""

import argparse
from pathlib import Path

# Names that `--quantity` takes for motions.
ACCELERATION, PATH_ACCELERATION, LANDING = "acceleration", "path_acceleration", "landing"
PHASE_PLANE = "phase_plane"
TRAJECTORY, TENSIONS, SUMMARY = "trajectory", "tensions", "summary"


def add_plot(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command that draws results."""
    parser.add_argument("result", type=Path, nargs="+", help="result or run directory, or motion of `cspr plan -o`")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="picture: .png, .pdf, .svg (default: beside the result)"
    )
    parser.add_argument(
        "--quantity",
        help="map: a quantity (default arcs or oscillations; see `cspr quantities`); motion: trajectory, the path in "
        "space; tensions, with their limits; summary, all on one page; acceleration, beside all that are feasible at "
        "an instant; path_acceleration, over the path, between its bounds; phase_plane, path speeds over the path and "
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
    add_look(parser)


def add_best(parser: argparse.ArgumentParser) -> None:
    """The argument for the best point of an axis of a map.

    Args:
        parser: of a command that shows maps.
    """
    parser.add_argument(
        "--best",
        action="append",
        default=[],
        metavar="AXIS",
        help="map: show each cell at its best point of this axis, such as z0: feasible if any is, with the fewest "
        "arcs; --quantity best_AXIS draws that point itself",
    )


def add_motion_plan(parser: argparse.ArgumentParser) -> None:
    """The argument of commands that read motions in CSV."""
    parser.add_argument(
        "--plan", type=Path, metavar="FILE", help="plan file of a motion in CSV, which keeps neither robot nor limits"
    )
    parser.add_argument("--robot", help="or only its robot, whose axes its z is in: a catalogue name, or a robot file")
    parser.add_argument("--z-axis", choices=("up", "down"), help="or only where z points in a motion in CSV")


def add_look(parser: argparse.ArgumentParser) -> None:
    """Arguments of every picture; `style.style_of` reads them.

    Args:
        parser: of a command that draws.
    """
    parser.add_argument("--size", metavar="WIDTHxHEIGHT", help="size of the picture, cm, such as 16x10")
    presets = parser.add_mutually_exclusive_group()
    for name, words in (("column", "8.5 cm wide"), ("page", "17.5 cm wide")):
        presets.add_argument(
            f"--{name}",
            dest="preset",
            action="store_const",
            const=name,
            help=f"make it {words}, for a {name} of a paper",
        )
    parser.add_argument("--no-title", dest="title", action="store_false", help="leave out the title")
    parser.add_argument("--dpi", type=float, metavar="N", help="pixels per inch (default 160)")
    parser.add_argument(
        "--font-size", type=float, metavar="PT", help="size of the font, points (default 10; --column 8, --page 9)"
    )
