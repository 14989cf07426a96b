"""Words and colours that all pictures share."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cspr_jax.results import Result

PANELS = 6
# Okabe and Ito: told apart by the colour-blind; the dashes help in grey.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)))


def label(result: Result, name: str) -> str:
    """A quantity for an axis or a colour bar.

    Args:
        result: gives its long name and unit.
        name: of the quantity.

    Returns:
        the words, with the unit if it has one.
    """
    return result.labels[name] + _unit(result, name)


def axis_label(result: Result, axis: str) -> str:
    """A coordinate for an axis.

    Args:
        result: gives its unit.
        axis: its name.

    Returns:
        the words, with the unit if it has one.
    """
    return axis + _unit(result, axis)


def _unit(result: Result, name: str) -> str:
    unit = result.units[name]
    return f" ({unit})" if unit not in ("", "1") else ""


def value(result: Result, axis: str, point: float, *, digits: int = 4) -> str:
    """A coordinate with its value.

    Args:
        result: gives its unit.
        axis: its name.
        point: the value.
        digits: significant.

    Returns:
        such as "z0 = 1.7 m".
    """
    unit = result.units[axis]
    return f"{axis} = {point:.{digits}g}" + (f" {unit}" if unit not in ("", "1") else "")


def start(result: Result) -> dict[str, float]:
    """Where all segments of a map start, if it is one place.

    Args:
        result: a map.

    Returns:
        its coordinates; empty if it is none.
    """
    given = result.settings.get("trajectory", {}).get("from") or {}
    moving = any(axis.startswith("from_") for axis in result.axes)
    return {} if moving else dict(zip("xyz", given.get("position") or (), strict=False))


def notes(result: Result, fixed: list[str], used: list[str]) -> str:
    """What a picture of a map keeps constant.

    Args:
        result: the map.
        fixed: what was fixed for the picture.
        used: axes that the picture shows.

    Returns:
        one line.
    """
    place = start(result)
    found = []
    if place:
        found.append(f"from ({', '.join(f'{number:.4g}' for number in place.values())}) m")
    elif not any(axis.startswith("from_") for axis in result.axes):
        found.append("from rest")
    found += fixed
    found += [value(result, a, p[0]) for a, p in result.axes.items() if a not in used and len(p) == 1]
    found.append(f"z axis {result.attributes.get('z_axis', 'down')}")
    return ", ".join(dict.fromkeys(found))


def columns_of(count: int) -> int:
    """How many panels stand side by side.

    Args:
        count: of all panels.

    Returns:
        at most three, in a full rectangle where that is possible.
    """
    return 2 if count == 4 else min(3, count)


def panels(figure: Figure, count: int, *, polar: bool = False) -> tuple[list[Axes], list[Axes], list[Axes]]:
    """Panels with common axes.

    Args:
        figure: where.
        count: how many.
        polar: whether in polar coordinates.

    Returns:
        all of them, those at the bottom, those at the left.
    """
    columns = columns_of(count)
    lines = -(-count // columns)
    kind = {"projection": "polar"} if polar else {}
    grid = figure.subplots(lines, columns, squeeze=False, sharex=not polar, sharey=True, subplot_kw=kind)
    for panel in grid.flat[count:]:
        panel.set_visible(False)
    return list(grid.flat[:count]), list(grid[-1]), list(grid[:, 0])


def chosen(count: int, most: int) -> np.ndarray:
    """Some of many points, evenly.

    Args:
        count: of the points.
        most: how many at most.

    Returns:
        their indices.
    """
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))
