"""Options of the command line for pictures; no matplotlib here, for `cspr --help` is to answer at once."""

import argparse

# Quantities of motions that have a picture of their own.
ACCELERATION, PATH_ACCELERATION, LANDING = "acceleration", "path_acceleration", "landing"


def add_style(parser: argparse.ArgumentParser) -> None:
    """Options of size, resolution and letters; `style.style_of` reads them.

    Args:
        parser: of a command that draws.
    """
    parser.add_argument("--size", metavar="WIDTHxHEIGHT", help="of the picture, cm, such as 16x10")
    parser.add_argument("--dpi", type=float, metavar="N", help="pixels an inch (default 160)")
    parser.add_argument("--font-size", type=float, metavar="PT", help="points (default 10)")
