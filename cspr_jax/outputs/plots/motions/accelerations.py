"""Diagram of the feasible accelerations at a time of a motion, Boralugoda figures 2.2, 2.4 and 2.8.

For a planar robot, everything is in one plane. For a spatial one, there are sections through the actual acceleration:
a level one, a vertical one that contains zero and gravity too, and a vertical one normal to the nearest face, which
shows the margin in its true size. The two vertical ones may be the same.
"""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cspr_jax.outputs.plots.motions.acceleration_sets import AccelerationSet, acceleration_set
from cspr_jax.outputs.plots.motions.half_planes import WINDOW, Plane, Polygon, Window, section, window_around
from cspr_jax.outputs.plots.motions.motion import doubt
from cspr_jax.outputs.plots.style.labels import COLOURS, robot_name
from cspr_jax.store.reading.result import Result

X, Y, UP = np.eye(3)
# Level components shorter than this, over gravity or the norm of a normal, have no direction.
LEVEL = 1e-6
# Corners farther away than this multiple of the extent of the rest do not widen the picture.
FAR = 2.0
_INSIDE: dict[str, Any] = {"facecolor": COLOURS[5], "alpha": 0.3, "linewidth": 0.0}
_FACE: dict[str, Any] = {"color": "black", "linewidth": 1.2}
_NEAREST: dict[str, Any] = {"color": COLOURS[1], "linewidth": 2.4, "solid_capstyle": "butt"}
_MARGIN: dict[str, Any] = {"color": COLOURS[1], "linewidth": 1.4, "linestyle": (0, (2, 1))}
_MOTION: dict[str, Any] = {"color": "#8c8c8c", "linewidth": 0.6}
_CABLE: dict[str, Any] = {"color": COLOURS[2], "linewidth": 1.6}
_GRAVITY: dict[str, Any] = {"color": COLOURS[0], "linewidth": 1.6}
_ACTUAL: dict[str, Any] = {"color": "black", "linewidth": 1.6}
_POINT: dict[str, Any] = {"marker": "o", "markersize": 5.0, "color": "black"}
_CORNER: dict[str, Any] = {"marker": "D", "markersize": 5.0, "color": COLOURS[2], "linestyle": "none"}
_NUMBER: dict[str, Any] = {
    "ha": "center",
    "va": "center",
    "color": COLOURS[2],
    "bbox": {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6},
}


class AccelerationView(NamedTuple):
    """A panel.

    Fields:
        title: title of the panel.
        plane: plane of the section.
        labels: labels of its two axes.
        is_level: whether the section is level.
        holds_rest: whether zero and free fall lie in the plane.
        across_face: whether the plane is normal to the nearest face.
    """

    title: str
    plane: Plane
    labels: tuple[str, str]
    is_level: bool = False
    holds_rest: bool = False
    across_face: bool = False


def acceleration_figure(result: Result, file: str, at: dict[str, float]) -> Figure:
    """Diagram of the feasible accelerations at a time of a motion."""
    region = acceleration_set(result, file, at)
    views = _views(region)
    figure_size = (6.6, 6.0) if len(views) == 1 else (4.2 * len(views), 5.8 if doubt(result) else 5.4)
    figure = Figure(figsize=figure_size, layout="constrained")
    legend: dict[str, Artist] = {}
    for panel, view in zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True):
        legend |= _draw(panel, region, view, 1.3 if len(views) == 1 else 1.0)
    figure.legend(legend.values(), legend.keys(), loc="outside lower center", ncols=4)
    where = f"at ({', '.join(f'{number:.4g}' for number in region.position)}) m"
    margin = f"margin {region.margin:.3g} m/s² to the face of {region.names[region.nearest]}"
    axis = f"z axis {result.attributes.get('z_axis', 'down')}"
    title = f"{robot_name(result)}: feasible accelerations"
    figure.suptitle(f"{title}\n{region.words}, {where}, {axis}\n{margin}{doubt(result)}")
    return figure


def _views(region: AccelerationSet) -> list[AccelerationView]:
    upward = "upward acceleration (m/s²)"
    if region.is_planar:
        labels = ("level acceleration, along x (m/s²)", upward)
        return [AccelerationView("", Plane(region.actual, X, UP), labels, holds_rest=True, across_face=True)]
    across = _level(-region.normals[region.nearest], 1.0)
    along = _level(region.actual, -region.falling[2])

    def vertical(title: str, direction: np.ndarray, **others: bool) -> AccelerationView:
        label = f"level acceleration, azimuth {np.degrees(np.arctan2(direction[1], direction[0])):.3g}° (m/s²)"
        return AccelerationView(f"vertical, {title}", Plane(region.actual, direction, UP), (label, upward), **others)

    labels = ("acceleration along x (m/s²)", "acceleration along y (m/s²)")
    height = f"{region.actual[2] if abs(region.actual[2]) > LEVEL * abs(region.falling[2]) else 0.0:.3g}"
    level = AccelerationView(
        f"level, upward acceleration {height} m/s²", Plane(region.actual, X, Y), labels, is_level=True
    )
    # If acceleration or normal has no level component, or both are parallel, one vertical section serves both purposes.
    if along is None or across is None or abs(along @ across) > 1.0 - LEVEL:
        direction = next((direction for direction in (across, along) if direction is not None), X)
        return [level, vertical("across the nearest face", direction, holds_rest=True, across_face=True)]
    return [
        level,
        vertical("along the acceleration", along, holds_rest=True),
        vertical("across the nearest face", across, across_face=True),
    ]


def _level(vector: np.ndarray, scale: float) -> np.ndarray | None:
    # Direction of the level component of a vector; None where this component is negligible relative to a given size.
    part = np.hypot(*vector[:2])
    return np.array([*vector[:2], 0.0]) / part if part > LEVEL * scale else None


def _draw(panel: Axes, region: AccelerationSet, view: AccelerationView, shape: float) -> dict[str, Artist]:
    seen = view.plane.seen
    window, polygon = _cut_out(region, view, shape)
    panel.fill(*polygon.corners.T, **_INSIDE)
    legend: dict[str, Artist] = {"feasible": Patch(**_INSIDE)}
    for k, owner in enumerate(polygon.owners):
        if owner != WINDOW:
            side = polygon.corners[[k, (k + 1) % len(polygon.owners)]]
            panel.plot(*side.T, **(_NEAREST if owner == region.nearest else _FACE), zorder=2.5)
    legend["nearest face"] = Line2D([], [], **_NEAREST)
    if view.across_face:
        panel.plot(*seen(np.stack([region.actual, region.foot])).T, **_MARGIN, zorder=3.5)
    legend["margin"] = Line2D([], [], **_MARGIN)
    legend["acceleration"] = Line2D([], [], **_POINT | {"linewidth": _ACTUAL["linewidth"]})
    if _shows_motion(view):
        panel.plot(*seen(region.motion).T, **_MOTION, zorder=1.5)
        legend["whole motion" + ("" if region.is_planar else ", projected")] = Line2D([], [], **_MOTION)
    if view.holds_rest:
        _arrow(panel, seen(0.0 * X), seen(region.falling), _GRAVITY)
        _arrow(panel, seen(0.0 * X), seen(region.actual), _ACTUAL)
    panel.plot(*seen(region.actual), **_POINT, zorder=4.0)
    legend["gravity"] = Line2D([], [], **_GRAVITY)
    if region.is_planar:
        legend["cables"] = _directions(panel, region, view, window)
    elif view.is_level:
        legend["cables"] = _corners(panel, region, view)
    panel.set(xlim=(window.low[0], window.high[0]), ylim=(window.low[1], window.high[1]), aspect="equal")
    panel.set(xlabel=view.labels[0], ylabel=view.labels[1], title=view.title)
    panel.grid(alpha=0.3)
    return legend


def _cut_out(region: AccelerationSet, view: AccelerationView, shape: float) -> tuple[Window, Polygon]:
    # The window contains the points to be shown, and corners of the section that are not far from them.
    seen = view.plane.seen
    points = [seen(np.stack([region.actual, region.foot]))]
    if not view.is_level:
        points.append(seen(np.stack([0.0 * X, region.falling, region.apex])))
    if _shows_motion(view):
        points.append(seen(region.motion))
    window = window_around(np.concatenate(points), shape=shape)
    wide = window_around(np.stack(window), margin=FAR, shape=shape)
    corners, owners = section(view.plane, region.normals, region.offsets, wide)
    near = corners[(owners != WINDOW) & (np.roll(owners, 1) != WINDOW)]
    window = window_around(np.concatenate([*points, near]), shape=shape)
    return window, section(view.plane, region.normals, region.offsets, window)


def _shows_motion(view: AccelerationView) -> bool:
    # The third section shows only what lies in its plane.
    return view.is_level or view.holds_rest


def _directions(panel: Axes, region: AccelerationSet, view: AccelerationView, window: Window) -> Artist:
    # Draw the directions of the cables of a planar robot.
    length = 0.28 * (window.high - window.low).min()
    start = view.plane.seen(region.apex)
    for number, direction in enumerate(view.plane.seen(region.cables), start=1):
        _arrow(panel, start, start + length * direction, _CABLE)
        panel.annotate(str(number), start + 1.14 * length * direction, **_NUMBER)
    return Line2D([], [], **_CABLE)


def _corners(panel: Axes, region: AccelerationSet, view: AccelerationView) -> Artist:
    # Mark where each cable's line meets a level section while the other cables have their smallest tensions.
    lengths = (region.actual[2] - region.apex[2]) / region.cables[:, 2]
    corners = view.plane.seen(region.apex + lengths[:, None] * region.cables)
    there = (lengths >= 0.0) & (lengths <= region.span)
    middle = corners[there].mean(axis=0) if there.any() else np.zeros(2)
    for number in np.flatnonzero(there):
        panel.plot(*corners[number], **_CORNER, zorder=3.0)
        beyond = corners[number] - middle
        away = 11.0 * beyond / (np.linalg.norm(beyond) or 1.0)
        panel.annotate(str(number + 1), corners[number], away, textcoords="offset points", **_NUMBER)
    return Line2D([], [], **_CORNER)


def _arrow(panel: Axes, start: np.ndarray, end: np.ndarray, style: dict[str, Any]) -> None:
    style = {"arrowstyle": "-|>", "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 10.0} | style
    panel.annotate("", tuple(end), tuple(start), arrowprops=style, zorder=3.0)
