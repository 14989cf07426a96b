"""Words and colours that all pictures share: names, units, numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.plots.style.fitting import shortened
from cspr_jax.schema.quantities import ARRANGEMENT, PARAMETER
from cspr_jax.store.reading.result import Result

# Words for axes whose names in files are not words.
WORDS = {
    "tilt_azimuth": "azimuth of the tilt",
    "circle_radius": "radius of the circle",
    "scale": "scale of the ellipse",
    "tau": "normalised time",
    "inclination": "inclination v",
    "from_x": "x of the start",
    "from_y": "y of the start",
    "from_z": "z of the start",
}
LONGEST_LABEL = 80
PANELS = 6
# Colours of Okabe and Ito, which colour-blind readers can distinguish; dashes help in greyscale.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
# Units as pictures show them.
WRITTEN = {
    **{"m s-1": "m/s", "m s-2": "m/s²", "rad s-1": "rad/s", "rad s-2": "rad/s²"},
    **{"m m-1": "m/m", "rad m-1": "rad/m"},
}
STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)))


def line_style(number: int) -> dict[str, Any]:
    """Colour and style of one line of many."""
    style = STYLES[(number + number // len(COLOURS)) % len(STYLES)]
    return {"color": COLOURS[number % len(COLOURS)], "linestyle": style}


def cable_names(columns: Mapping[str, np.ndarray]) -> list[str]:
    """Names of the columns of a motion's tensions."""
    word = "pair" if "tension_each" in columns else "cable"
    return [f"{word} {k + 1}" for k in range(columns["tension"].shape[1])]


def robot_name(result: Result) -> str:
    """The name of the robot in a title."""
    return shortened(result.attributes["robot"])


def heading(result: Result, name: str) -> str:
    """The first line of a title."""
    return f"{robot_name(result)}: {shortened(result.labels[name], LONGEST_LABEL)}"


def label(result: Result, name: str) -> str:
    """The label of a quantity on an axis or a colour bar."""
    return shortened(result.labels[name], LONGEST_LABEL) + _in_brackets(result, name)


def axis_label(result: Result, axis: str) -> str:
    """The label of an axis."""
    return _name(axis) + _in_brackets(result, axis)


def _name(axis: str) -> str:
    return WORDS.get(axis, shortened(axis.removeprefix(PARAMETER)))


def _in_brackets(result: Result, name: str) -> str:
    symbol = unit(result, name)
    return f" ({symbol})" if symbol else ""


def unit(result: Result, name: str) -> str:
    """The unit of a quantity in pictures."""
    units = result.units[name]
    symbol = "°" if is_angle(result, name) else WRITTEN.get(units, shortened(units))
    return "" if symbol == "1" else symbol


def is_angle(result: Result, name: str) -> bool:
    """Tell whether an axis or a quantity is an angle, in radians in the file and in degrees in pictures."""
    return result.units.get(name) == "rad"


def as_drawn(result: Result, name: str, values: np.ndarray) -> np.ndarray:
    """Values in the unit of the picture."""
    return np.degrees(values) if is_angle(result, name) else values


def principal_angle(degrees: float) -> float:
    """An angle without whole revolutions."""
    return degrees if abs(degrees) <= 180.0 + 1e-9 else (degrees + 180.0) % 360.0 - 180.0


def value(result: Result, axis: str, point: float, *, digits: int = 4) -> str:
    """The name and value of a coordinate, in words."""
    drawn = float(as_drawn(result, axis, np.asarray(point, float)))
    symbol = unit(result, axis)
    if is_angle(result, axis):
        drawn = principal_angle(drawn)
    # A point of a range across zero may differ from zero by rounding.
    drawn = 0.0 if abs(drawn) <= 1e-12 else drawn
    name = _name(axis)
    if axis == "cable":
        return f"{name} {drawn:g}"
    if axis == ARRANGEMENT:
        return f"{name} = {drawn:.0f}"
    return f"{name} = {drawn:.{digits}g}" + (f" {symbol}" if symbol not in ("", "°") else symbol)


def values(result: Result, axis: str, points: Float[np.ndarray, "n"]) -> list[str]:
    """Names and values of coordinates, with the fewest digits, at least three, that tell them apart."""
    texts: list[str] = []
    for digits in range(3, 17):
        texts = [value(result, axis, point, digits=digits) for point in points]
        if len(set(texts)) == len(set(points.tolist())):
            break
    return texts


def chosen(count: int, maximum: int) -> np.ndarray:
    """Indices of evenly chosen points, at most a given number."""
    return np.unique(np.linspace(0, count - 1, min(maximum, count)).round().astype(int))
