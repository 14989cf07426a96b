"""Content of a page about a map: its axes, quantities with their colours, and the reasons of its cells."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, to_hex

from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import one_of
from cspr_jax.numerics.shapes import Int
from cspr_jax.outputs.plots.maps.conditions import condition_phrases, is_margin, shown_first
from cspr_jax.outputs.plots.maps.sections import in_order
from cspr_jax.outputs.plots.pages.page import packed
from cspr_jax.outputs.plots.robots.obstacles import COLOUR, obstacles, outline, section_of
from cspr_jax.outputs.plots.robots.robot_at import spools_of, workspace_of
from cspr_jax.outputs.plots.style.colours import Scale, scale_of
from cspr_jax.outputs.plots.style.fixed_axes import notes
from cspr_jax.outputs.plots.style.labels import WORDS, as_drawn, axis_label, label, unit, value
from cspr_jax.outputs.plots.style.word_ticks import FEASIBLE_COLOUR, REASONS, word_scale, worded
from cspr_jax.schema.map_kinds import MAP_KINDS, quantity_of
from cspr_jax.schema.verdicts import SENTENCES, Verdict, conjunction
from cspr_jax.store.reading.result import Result

# Quantities whose extreme cells the page lists.
EXTREME = ("margin", "duration", "arcs", "oscillations")
# Quantities that come first, and largest number of letters of a page's data; the charts' script has some five million.
FIRST = ("verdict", "duration", "margin")
LARGEST = 14_000_000
SHADES = 32
SPACE, WORKSPACE = ("x", "y", "z"), "workspace"


def order_of(result: Result) -> tuple[list[str], list[np.ndarray]]:
    """Order of the axes in a page, of which the last runs along a row, and order of their points."""
    varying = [axis for axis, points in result.axes.items() if len(np.unique(points)) > 1]
    alone = [axis for axis in result.axes if axis not in varying]
    order = in_order(result, varying)
    # A map over one axis is shown as a line.
    plane = order[:2] if len(order) > 1 else [*order, *alone][:2]
    names = [*(axis for axis in [*alone, *order] if axis not in plane), *reversed(plane)]
    return names, [np.unique(result.axes[axis], return_index=True)[1] for axis in names]


def map_content(result: Result, quantity: str | None = None) -> tuple[dict[str, Any], list[str]]:
    """Content of the page of a map."""
    kind = MAP_KINDS[result.attributes["map"]]
    available = [name for name in dict.fromkeys((*kind.pictured, *FIRST, *result.data)) if name in result.data]
    if quantity is not None and quantity not in available:
        raise InputError("--quantity", quantity, one_of(quantity, sorted(result.data)))
    available = [name for name in available if name == quantity or _is_asked(result, name)] or available[:1]
    first = quantity or shown_first(result)
    first = first if first in available else available[0]
    names, points = order_of(result)
    order = [list(result.axes).index(name) for name in names]
    shape = [len(chosen) for chosen in points]

    def arranged(name: str) -> np.ndarray:
        return result.data[name].transpose(order)[np.ix_(*points)]

    quantities, left, remaining = list[dict[str, Any]](), list[str](), LARGEST
    for name in sorted(available, key=lambda name: name != first):
        content = _quantity(result, name, arranged(name))
        remaining -= len(content["values"]["data"])
        if remaining < 0 and quantities:
            left.append(name)
            continue
        quantities.append(content)
    return {
        "shape": shape,
        "axes": [_axis(result, name, result.axes[name][indices]) for name, indices in zip(names, points, strict=True)],
        "quantities": quantities,
        "reasons": _reasons(arranged("verdict"), quantity_of(kind.name, "verdict").unflagged)
        if "verdict" in result.data
        else None,
        "notes": condition_phrases(result)
        + notes(result, "", [], [name for name, count in zip(names, shape, strict=True) if count > 1]),
        "spools": _spools(result, names[-2:]),
        "obstacles": _obstacles(result, names, points),
        "isDown": names[-2:-1] == ["z"] and result.attributes.get("z_axis", "down") == "down",
        "isEqual": len(names) > 1 and all(result.units[name] == "m" for name in names[-2:]),
    }, left


def _is_asked(result: Result, name: str) -> bool:
    # A quantity that was not requested has no value anywhere; in workspaces some follow from the verdict alone.
    data = result.data[name]
    if data.dtype.kind == "f" and np.isnan(data).all():
        return False
    if result.attributes["map"] != WORKSPACE:
        return True
    if name == "orientation_fraction":
        return workspace_of(result).orientations is not None
    return name != "cell_side" or bool(data.any())


def _spools(result: Result, plane: list[str]) -> dict[str, list[float]] | None:
    # Spools of a workspace's robot, seen along the axis out of the plane.
    if result.attributes["map"] != WORKSPACE or "verdict" not in result.data or not set(plane) <= set(SPACE):
        return None
    base = spools_of(result, {})
    if base is None:
        return None
    up, across = (base[:, SPACE.index(name)].tolist() for name in plane)
    return {"up": up, "across": across}


def _obstacles(result: Result, names: list[str], points: list[np.ndarray]) -> dict[str, Any] | None:
    # Outlines of obstacles, seen along the axis out of the plane, and their sections at each point of that axis.
    plane = names[-2:]
    bodies = obstacles(result) if set(plane) <= set(SPACE) else []
    if not bodies:
        return None
    third = next(axis for axis in SPACE if axis not in plane)
    heights = result.axes[third][points[names.index(third)]] if third in names else []
    return {
        "axis": names.index(third) if third in names else None,
        "colour": COLOUR,
        "bodies": [
            {
                "shadow": _closed(outline(body[:, [SPACE.index(axis) for axis in plane]])),
                "cuts": [_closed(section_of(body, plane, height)) for height in heights],
            }
            for body in bodies
        ],
    }


def _closed(corners: np.ndarray) -> dict[str, list[float]]:
    # Closed line in metres to a tenth of a millimetre, upward coordinates first.
    rounded = np.round(np.concatenate([corners, corners[:1]]), 4)
    return {"up": rounded[:, 0].tolist(), "across": rounded[:, 1].tolist()}


def _axis(result: Result, name: str, points: np.ndarray) -> dict[str, Any]:
    return {
        "label": axis_label(result, name),
        "name": WORDS.get(name, name),
        "unit": unit(result, name),
        "values": [float(f"{x:.9g}") for x in as_drawn(result, name, points)],
        "words": [value(result, name, x, digits=6) for x in points],
    }


def _quantity(result: Result, name: str, data: np.ndarray) -> dict[str, Any]:
    row = quantity_of(result.attributes["map"], name)
    meaning, drawn = worded(result, name, data), as_drawn(result, name, data)
    if meaning is not None:
        drawn, scale = meaning[0], word_scale(*meaning[1:])
    else:
        scale = scale_of(drawn, signed=row.signed)
    return {
        "name": name,
        "label": label(result, name),
        "unit": unit(result, name),
        "description": row.description,
        "isMargin": is_margin(result, name),
        "isCount": drawn.dtype.kind in "iu" and meaning is None,
        "words": None if meaning is None else meaning[1],
        "values": packed(drawn),
        "scale": _scale(scale),
    }


def _scale(scale: Scale) -> dict[str, Any]:
    # Colours for a browser, in steps where matplotlib has steps, of which the first may stand for "none".
    if not isinstance(scale.norm, BoundaryNorm):
        shades = [_hex(scale, part) for part in np.linspace(0.0, 1.0, SHADES).tolist()]
        ends = float(scale.norm.vmin or 0.0), float(scale.norm.vmax or 0.0)
        return {"bounds": ends, "shades": shades, "stepped": False, "ticks": None, "beyond": scale.beyond}
    ticks, texts = scale.ticks or ([], [])
    bounds = np.asarray(scale.norm.boundaries, float).tolist()
    shades = [_hex(scale, i) for i in range(scale.colours.N)]
    if texts[:1] == ["none"]:
        bounds, shades, ticks, texts = bounds[1:], shades[1:], ticks[1:], texts[1:]
    if scale.extend == "max":
        shades.append(_hex(scale, scale.colours.N))
        bounds.append(bounds[-1] + 1.0)
    return {
        "bounds": (bounds[0], bounds[-1]),
        "shades": shades,
        "stepped": True,
        "ticks": {"values": ticks, "texts": texts},
        "beyond": scale.beyond,
    }


def _hex(scale: Scale, position: float) -> str:
    # An integer is the index of a colour, a fraction a position on the scale; values beyond have the last colour.
    red, green, blue, alpha = scale.colours(position)
    return to_hex((red, green, blue, alpha))


def _reasons(verdicts: np.ndarray, unflagged: str) -> dict[str, Any]:
    # Each combination of flags that occurs, with its sentences and the colour of the first reason.
    flags, index = np.unique(conjunction(verdicts.astype(np.int64)), return_inverse=True)
    entries = []
    for code in flags.tolist():
        set_flags = [flag for flag in (*REASONS, *SENTENCES) if code & flag.value]
        word, colour = next((REASONS[flag] for flag in set_flags if flag in REASONS), (unflagged, FEASIBLE_COLOUR))
        entries.append(
            {
                "word": word,
                "colour": colour,
                "isInside": code == 0,
                "text": Verdict(code).text.replace("_", " ").replace("+", ", ") if code else unflagged,
                "sentences": [SENTENCES[flag] for flag in dict.fromkeys(set_flags) if flag in SENTENCES],
            }
        )
    return {"entries": entries, "values": packed(index.reshape(verdicts.shape))}


def informative_cells(
    data: dict[str, np.ndarray], verdict: Int[np.ndarray, "..."], count: int
) -> list[tuple[int, ...]]:
    """Feasible cells that a page suggests.

    First come extremes of margins, durations and counts, and for each count the cell with the smallest margin; then,
    one after the other, the cell farthest from those already chosen, with distances relative to the grid's extent.
    """
    feasible = np.argwhere(verdict == 0)
    if not len(feasible) or count < 1:
        return []
    where = tuple(feasible.T)
    values = {name: data[name][where].astype(float) for name in EXTREME if name in data}
    chosen = list(dict.fromkeys(_extremes(values)))[:count]
    if not chosen:
        chosen = [0]
    points = feasible / np.maximum(np.array(verdict.shape) - 1.0, 1.0)
    gap = np.min([np.square(points - points[i]).sum(1) for i in chosen], axis=0)
    while len(chosen) < min(count, len(feasible)):
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.square(points - points[chosen[-1]]).sum(1))
    return [tuple(int(i) for i in feasible[k]) for k in chosen]


def _extremes(values: dict[str, np.ndarray]) -> list[int]:
    cells = []
    for numbers in values.values():
        if np.isfinite(numbers).any():
            cells += [int(np.nanargmin(numbers)), int(np.nanargmax(numbers))]
    counts = next((values[name] for name in ("arcs", "oscillations") if name in values), None)
    if counts is not None and "margin" in values:
        for number in np.unique(counts):
            minimum = np.where(counts == number, values["margin"], np.inf)
            if np.isfinite(minimum).any():
                cells.append(int(np.argmin(minimum)))
    return cells
