"""Appearance and sizes of all pictures; files have the same bytes for the same data."""

import io
import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import matplotlib.style
from matplotlib.figure import Figure
from matplotlib.text import Text

from cspr_jax.errors import ConfigError, InputError, demand, shown
from cspr_jax.errors.suggestions import one_of
from cspr_jax.outputs.plots.style.fitting import fit, share_of_panels, thin_ticks
from cspr_jax.outputs.plots.style.layout import INCH, NARROW
from cspr_jax.outputs.plots.style.options import USUAL, WIDTHS
from cspr_jax.outputs.plots.style.scene import fill_panels

# Settings on top of matplotlib's own defaults, so that a user's matplotlibrc changes nothing. Text stays text: TrueType
# in PDF, text in SVG, and dollar signs are no mathematics. Sizes of letters are relative to font.size.
RC_PARAMS = {
    "text.parse_math": False,
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "cspr",
    "figure.titlesize": "medium",
    "axes.titlesize": "medium",
    "axes.titlepad": 5.0,
    "legend.fontsize": "medium",
    "legend.frameon": False,
    "figure.constrained_layout.h_pad": 0.07,
    "figure.constrained_layout.w_pad": 0.07,
    "figure.constrained_layout.hspace": 0.04,
    "figure.constrained_layout.wspace": 0.03,
}
# No dates and versions in the files.
METADATA: dict[str, dict] = {".png": {"Software": None}, ".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
SIDES = (4.0, 120.0)
DPIS = (30.0, 1200.0)
FONT_SIZES = (4.0, 40.0)
# Font sizes of pictures for papers, points; the heights of such pictures follow from their content.
PRESETS = {"column": 8.0, "page": 9.0}
UNITS = {"cm": 1.0, "mm": 0.1, "in": INCH}
MIN_FRACTION = 0.5  # smallest fraction of the height that panels take; where they take less, the picture gets higher
HIGHER, TRIES = 1.2, 6  # factor by which it gets higher, and largest number of times
# In a picture of given size letters of the default size shrink instead, by a factor down to a number of points.
SMALLER, MIN_LETTERS = 0.92, 5.0
# Pictures are held in memory at several bytes a pixel.
LARGEST_PIXELS = 1e8


class Style(NamedTuple):
    """Choices of the user.

    Fields:
        size: width and height, cm; None: chosen by the picture.
        dpi: pixels per inch, in PNG and for coloured cells in PDF and SVG.
        font_size: points.
        width: width of a picture whose height follows, cm; None: chosen by the picture.
        has_title: whether titles are drawn; a line about a missing proof is always drawn.
        is_free: whether letters may be smaller than `font_size`.
    """

    size: tuple[float, float] | None = None
    dpi: float = 160.0
    font_size: float = 10.0
    width: float | None = None
    has_title: bool = True
    is_free: bool = True


def style_of(
    size: str | tuple[float, float] | None,
    dpi: float | None,
    font_size: float | None,
    preset: str | None = None,
    *,
    title: bool = True,
) -> Style:
    """The style that options specify."""
    name, _, of_width = (preset or "").partition(" ")
    if preset is not None and name not in PRESETS:
        raise ConfigError("preset", f"{shown(preset)}: {demand(one_of(preset, PRESETS))}, or absent")
    if preset is not None and size is not None:
        raise ConfigError("--size", f"{size}: cannot be combined with --{name}")
    width, letters = (_width(name, of_width or USUAL), PRESETS[name]) if name else (None, Style().font_size)
    default = Style(font_size=letters)
    return Style(
        None if size is None else _sides(size if isinstance(size, str) else "x".join(f"{side:g}" for side in size)),
        default.dpi if dpi is None else _bounded("--dpi", dpi, DPIS),
        default.font_size if font_size is None else _bounded("--font-size", font_size, FONT_SIZES),
        width,
        title,
        font_size is None,
    )


def _width(preset: str, text: str) -> float:
    widths, (low, high) = WIDTHS[preset], SIDES
    match = re.fullmatch(r"(\d{1,6}(?:\.\d{0,6})?)(cm|mm|in)", text, re.ASCII)
    width = widths.get(text) or (float(match[1]) * UNITS[match[2]] if match else 0.0)
    if not low <= width <= high:
        names = ", ".join(name for name in widths if name != USUAL)
        allowed = f"must be absent, {names}, or a width from {low:g}cm to {high:g}cm, as in 8.5cm, 85mm or 3.5in"
        raise ConfigError(f"--{preset}", f"{shown(text)}: {allowed}")
    return width


def _sides(text: str) -> tuple[float, float]:
    number = r"(\d{1,6}(?:\.\d{0,6})?)"
    match = re.fullmatch(f"{number}x{number}", text, re.ASCII)
    sides = tuple(float(side) for side in match.groups()) if match else ()
    if len(sides) != 2 or not all(SIDES[0] <= side <= SIDES[1] for side in sides):
        low, high = SIDES
        raise ConfigError("--size", f"{shown(text)}: must be WIDTHxHEIGHT in cm, {low:g} to {high:g} each, as in 16x10")
    return sides[0], sides[1]


def _bounded(key: str, value: float, bounds: tuple[float, float]) -> float:
    low, high = bounds
    if not low <= value <= high:
        raise ConfigError(key, f"{value:g}: must be a number from {low:g} to {high:g}")
    return value


@contextmanager
def in_style(style: Style) -> Iterator[None]:
    """Draw figures in this style, independently of the user's settings of matplotlib."""
    params = RC_PARAMS | {"font.size": style.font_size}
    width = style.size[0] if style.size is not None else style.width
    if width is not None:
        params["figure.figsize"] = (width / INCH, width / INCH)
    with matplotlib.style.context(["default", params]):
        yield


def laid_out(figure: Figure, style: Style) -> None:
    """Set the size of a picture and break its texts into lines."""
    width, height = (float(side) for side in figure.get_size_inches())
    if style.size is not None:
        width, height = style.size[0] / INCH, style.size[1] / INCH
    elif style.width is not None:
        # Panels get narrower but letters hardly smaller: scale heights by the geometric mean of both.
        part = style.width / INCH / width
        is_rigid = any(panel.get_aspect() != "auto" and panel.get_adjustable() == "box" for panel in figure.axes)
        is_rigid &= all(panel.name != "3d" for panel in figure.axes) or figure.get_layout_engine() is None
        letters = part if is_rigid else style.font_size / Style().font_size
        width, height = style.width / INCH, height * min(1.0, math.sqrt(part * letters))
    figure.set_size_inches(width, height)
    maximum = math.floor(math.sqrt(LARGEST_PIXELS / (width * height)))
    if style.dpi > maximum:
        raise InputError("--dpi", style.dpi, f"at most {maximum} for {width * INCH:.3g}x{height * INCH:.3g} cm")
    with _no_missing_letters():
        fit(figure, has_title=style.has_title, lines=1 if width * INCH < NARROW else None)
        _enlarge_panels(figure, style)
        thin_ticks(figure)
        fill_panels(figure)


def _enlarge_panels(figure: Figure, style: Style) -> None:
    # Only narrow pictures, or those whose width is given, can leave panels too little height.
    if figure.get_layout_engine() is None or (style.width is None and figure.get_figwidth() * INCH >= NARROW):
        return
    letters, before = style.font_size, -1.0
    for _ in range(TRIES):
        with warnings.catch_warnings(record=True) as caught:
            warnings.filterwarnings("always", "constrained_layout not applied")
            figure.draw_without_rendering()
        # Layout engines leave panels without space unchanged.
        fraction = 0.0 if caught else share_of_panels(figure)
        if fraction >= MIN_FRACTION:
            return
        if style.size is None and 0.0 < fraction <= before:  # panels of fixed shape do not grow
            figure.set_figheight(figure.get_figheight() / HIGHER)
            return
        before = fraction
        if style.size is None:
            figure.set_figheight(HIGHER * figure.get_figheight())
        elif style.is_free and letters * SMALLER >= MIN_LETTERS:
            letters *= SMALLER
            for text in figure.findobj(Text):
                text.set_fontsize(SMALLER * float(text.get_fontsize()))
            for axis in (axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)):
                for words in axis.get_ticklabels()[:1]:
                    axis.set_tick_params(labelsize=SMALLER * float(words.get_fontsize()))
    # Pictures without space for their panels are refused when they are written.


def rendered(figure: Figure, ending: str, style: Style) -> bytes:
    """The content of a picture's file."""
    content, ending = io.BytesIO(), ending.lower()
    with _no_missing_letters():
        warnings.filterwarnings("error", "constrained_layout not applied")
        try:
            figure.savefig(content, format=ending[1:], dpi=style.dpi, metadata=METADATA.get(ending))
        except UserWarning as warning:
            width, height = figure.get_size_inches()
            dimensions = f"{width * INCH:.3g}x{height * INCH:.3g}"
            raise InputError(
                "--size", dimensions, "larger, or --font-size smaller: the texts leave no room"
            ) from warning
    return content.getvalue()


@contextmanager
def _no_missing_letters() -> Iterator[None]:
    # Letters that the font lacks are drawn as boxes.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        yield
