"""Choice of the picture of results: its kind, and the part of the data that it shows."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import one_of
from cspr_jax.outputs.plots.maps.comparison import Compared, comparison_figure
from cspr_jax.outputs.plots.maps.conditions import condition_phrases, excluded, is_workspace, shown_first
from cspr_jax.outputs.plots.maps.envelope import AXES, envelope_figure
from cspr_jax.outputs.plots.maps.frequencies import (
    SHOWN,
    frequencies_figure,
    has_frequencies,
    mark_ends,
    turns_in_words,
)
from cspr_jax.outputs.plots.maps.lines import PlottedLine, line_figure, lines_of, names_of, overlaid
from cspr_jax.outputs.plots.maps.ratio import ratio_of
from cspr_jax.outputs.plots.maps.sections import POLAR, PlaneSection, in_order, is_informative, section_figure
from cspr_jax.outputs.plots.maps.solid import SPACE, is_solid, solid_figure
from cspr_jax.outputs.plots.motions.motion_comparison import motion_comparison_figure
from cspr_jax.outputs.plots.motions.motion_pictures import motion_picture
from cspr_jax.outputs.plots.selection import nearest
from cspr_jax.outputs.plots.style.fixed_axes import first_of, notes
from cspr_jax.outputs.plots.style.labels import PANELS, chosen, heading, robot_name, values
from cspr_jax.schema.quantities import RATIO, TILT_TORSION
from cspr_jax.store.reading.result import Result


class MapView(NamedTuple):
    """A part of a map.

    Fields:
        name: name of the quantity.
        data: values of the quantity, one dimension for each of `across`.
        excluded: cells, in the shape of data, that conditions other than that of the quantity exclude.
        across: axes that vary.
        fixed: words for the fixed axes.
        coordinates: coordinates on the fixed axes.
    """

    name: str
    data: np.ndarray
    excluded: np.ndarray
    across: list[str]
    fixed: list[str]
    coordinates: dict[str, float]


def drawn(
    results: list[Result],
    names: list[str],
    *,
    quantity: str | None = None,
    at: dict[str, float] | None = None,
    lines: str | None = None,
    envelope: bool = False,
    solid: bool = False,
    ratio: bool = False,
) -> Figure:
    """The picture of one result, or of several maps as lines or outlines; made inside `style.in_style`."""
    if ratio:
        _refuse("--ratio", {"--solid": solid, "--envelope": envelope})
        return _map_figure(ratio_of(results, names, quantity), RATIO.name, at or {}, lines)
    if solid:
        _refuse("--solid", {"--envelope": envelope, "--quantity": quantity, "--lines": lines})
        return _solid(results, at or {})
    if envelope:
        return _envelope(results, quantity, at or {}, lines)
    if len(results) > 1:
        return _overlay([Path(name) for name in names], results, quantity, at or {}, lines)
    if results[0].is_map:
        return _map_figure(results[0], quantity, at or {}, lines)
    return _motion_figure(results[0], names[0], quantity, at or {}, lines)


def _motion_figure(result: Result, name: str, quantity: str | None, at: dict[str, float], lines: str | None) -> Figure:
    if lines is not None:
        raise InputError("--lines", lines, "absent for a motion")
    return motion_picture(result, name, quantity, at)


def _envelope(results: list[Result], quantity: str | None, at: dict[str, float], lines: str | None) -> Figure:
    result = results[0]
    if len(results) > 1 or not result.is_map or not set(AXES) <= set(result.axes) or "verdict" not in result.data:
        raise InputError("--envelope", "no orientations", 'of one result of map = "orientations" that holds verdicts')
    _refuse("--envelope", {"--quantity": quantity, "--lines": lines})
    elsewhere = {axis: points[0] for axis, points in result.axes.items() if axis not in AXES and len(points) > 1}
    view = _view(result, "verdict", elsewhere | at)
    fixed_axes = zip(elsewhere | at, view.fixed, strict=True)
    view = view._replace(fixed=[words if axis in at else first_of(result, axis) for axis, words in fixed_axes])
    if set(view.across) != set(AXES):
        raise InputError("--at", sorted(at), "no axis of " + ", ".join(AXES))
    return envelope_figure(
        result, view.data.transpose([view.across.index(axis) for axis in AXES]), _constant(result, view, "")
    )


def _refuse(option: str, others: dict[str, str | bool | None]) -> None:
    for key, value in others.items():
        if value:
            raise InputError(key, value, f"absent with {option}")


def _solid(results: list[Result], at: dict[str, float]) -> Figure:
    result = results[0]
    if len(results) > 1 or not is_solid(result):
        allowed = 'of one result of map = "workspace" that holds verdicts over two points or more of each of x, y and z'
        raise InputError("--solid", "no workspace in space", allowed)
    if set(at) & set(SPACE):
        raise InputError("--at", sorted(at), "no axis of " + ", ".join(SPACE))
    index, fixed = _fixed(result, at, SPACE)
    return solid_figure(result, index, notes(result, "", fixed, [*SPACE, *index]))


def _comparison(names: list[str], results: list[Result], at: dict[str, float]) -> Figure:
    compared, constant = [], list[list[str]]()
    for name, result in zip(names, results, strict=True):
        across = [axis for axis in _varying(result, at) if axis not in TILT_TORSION]
        index, fixed = _fixed(result, at, across)
        compared.append(Compared(result, name, across, index))
        constant.append(notes(result, "", fixed, [*across, *index]))
    return comparison_figure(compared, [note for note in constant[0] if all(note in other for other in constant)])


def _varying(result: Result, at: dict[str, float]) -> list[str]:
    return [axis for axis, points in result.axes.items() if len(points) > 1 and axis not in at]


def _fixed(result: Result, at: dict[str, float], across: list[str]) -> tuple[dict[str, int], list[str]]:
    # Point of each axis that is not shown, by default the first, and words about it for the picture.
    chosen_points = {axis: nearest(result, axis, coordinate) for axis, coordinate in at.items()}
    others = {axis: (0, first_of(result, axis)) for axis in result.axes if axis not in across}
    point_of_axis = others | chosen_points
    return {axis: i for axis, (i, _) in point_of_axis.items()}, [words for _, words in point_of_axis.values()]


def _overlay(
    paths: list[Path], results: list[Result], quantity: str | None, at: dict[str, float], lines: str | None
) -> Figure:
    columns: list[tuple[Result, str, PlottedLine]] = []
    constant: list[list[str]] = []
    if lines is not None:
        raise InputError("--lines", lines, "absent where several results are drawn")
    if not any(result.is_map for result in results):
        _refuse("several motions", {"--quantity": quantity, "--at": bool(at)})
        return motion_comparison_figure(results, [str(path) for path in paths])
    if quantity in (None, "verdict") and all(is_workspace(one) and len(_varying(one, at)) > 1 for one in results):
        return _comparison([str(path) for path in paths], results, at)
    for path, result in zip(paths, results, strict=True):
        if not result.is_map:
            raise InputError("results", str(path), "all maps or all motions, where several are drawn")
        view = _view(result, quantity, at)
        if len(view.across) != 1:
            raise InputError("results", f"{path} over {view.across}", "maps over one axis; --at fixes the others")
        columns.append(
            (result, view.across[0], PlottedLine(result.axes[view.across[0]], view.data, excluded=view.excluded))
        )
        constant.append(_constant(result, view))
    stems = [path.stem for path in paths]
    names = names_of(results, stems if len(set(stems)) == len(stems) else [str(path) for path in paths])
    across, drawn = overlaid(names, columns)
    same = [note for note in constant[0] if all(note in other for other in constant)]
    robots = {result.attributes["robot"] for result in results}
    title = heading(results[0], view.name)
    if len(robots) > 1:
        title = title.removeprefix(f"{robot_name(results[0])}: ")
    return line_figure(results[0], view.name, {"": drawn}, across, title, same)


def _map_figure(result: Result, quantity: str | None, at: dict[str, float], lines: str | None) -> Figure:
    view = _view(result, quantity, at)
    if lines is not None:
        return _lines_figure(result, view, lines)
    if quantity is None and has_frequencies(result, view.across):
        ends = {name: _view(result, name, at).data for name in SHOWN}
        return frequencies_figure(
            result, view.across[0], ends, _constant(result, view._replace(name="lowest_frequency"))
        )
    if len(view.across) == 1:
        axis = view.across[0]
        only = {"": [PlottedLine(result.axes[axis], view.data, excluded=view.excluded)]}
        return line_figure(result, view.name, only, axis, heading(result, view.name), _constant(result, view))
    order = in_order(result, view.across)
    view = _panelled(result, view, order)
    data, hatched, panels = view.data, view.excluded, view.across[2] if len(view.across) > 2 else None
    says = _informative_cells(result, at, order) if tuple(view.across[:2]) == POLAR else None
    if not panels:
        data, hatched, says = data[..., None], hatched[..., None], None if says is None else says[..., None]
    section = PlaneSection(view.name, view.across[:2], panels, view.coordinates, _constant(result, view), hatched)
    figure = section_figure(result, section, data, says)
    if view.across[1:] == ["frequency"] and set(SHOWN) <= set(result.data):
        first = at | {"frequency": float(result.axes["frequency"][0])}
        mark_ends(figure, result, view.across[0], {name: _view(result, name, first).data for name in SHOWN})
    return figure


def _constant(result: Result, view: MapView, name: str | None = None) -> list[str]:
    fixed = notes(result, view.name if name is None else name, view.fixed, [*view.across, *view.coordinates])
    return [*condition_phrases(result), *turns_in_words(result, view.name), *fixed]


def _informative_cells(result: Result, at: dict[str, float], order: list[str]) -> np.ndarray:
    # The result is the same for every quantity of a file, so that all its pictures show the same sections.
    names = ["verdict"] if "verdict" in result.data else list(result.data)
    informative = [is_informative(name, _panelled(result, _view(result, name, at), order).data) for name in names]
    return np.any(informative, axis=0)


def _lines_figure(result: Result, view: MapView, by: str) -> Figure:
    if by not in view.across or len(view.across) < 2:
        raise InputError(
            "--lines", by, one_of(by, view.across, f"one of two or more axes that vary: {', '.join(view.across)}")
        )
    along = next(axis for axis in view.across if axis != by)
    order = [along, by, *(axis for axis in view.across if axis not in (along, by))]
    view = _panelled(result, view, order)
    if len(view.across) == 2:
        groups = {"": lines_of(result, view.data, view.excluded, along, by)}
    else:
        points = result.axes[view.across[2]]
        shown = chosen(len(points), PANELS)
        titles = values(result, view.across[2], points[shown])
        parts = [(view.data[:, :, i], view.excluded[:, :, i]) for i in shown]
        groups = {t: lines_of(result, *part, along, by) for t, part in zip(titles, parts, strict=True)}
    return line_figure(result, view.name, groups, along, heading(result, view.name), _constant(result, view))


def _panelled(result: Result, view: MapView, order: list[str]) -> MapView:
    # Keep at most three axes, in this order; fix the others at their first points.
    data, hatched = (x.transpose([view.across.index(axis) for axis in order]) for x in (view.data, view.excluded))
    fixed, coordinates = list(view.fixed), dict(view.coordinates)
    for extra in order[3:]:
        data, hatched = data[:, :, :, 0], hatched[:, :, :, 0]
        coordinates[extra] = float(result.axes[extra][0])
        fixed.append(first_of(result, extra))
    return MapView(view.name, data, hatched, order[:3], fixed, coordinates)


def _view(result: Result, quantity: str | None, at: dict[str, float]) -> MapView:
    name = quantity or shown_first(result)
    if name not in result.data:
        raise InputError("--quantity", name, one_of(name, sorted(result.data)))
    fixed, indices = [], {}
    for axis, coordinate in at.items():
        indices[axis], words = nearest(result, axis, coordinate)
        fixed.append(words)
    across = [axis for axis, points in result.axes.items() if len(points) > 1 and axis not in indices]
    if not across:
        counts = {axis: 1 if axis in indices else len(points) for axis, points in result.axes.items()}
        raise InputError("axes", counts, "one with more than one point")
    part = tuple(slice(None) if axis in across else indices.get(axis, 0) for axis in result.axes)
    coordinates_of_axes = {axis: float(result.axes[axis][i]) for axis, i in indices.items()}
    return MapView(name, result.data[name][part], excluded(result, name)[part], across, fixed, coordinates_of_axes)
