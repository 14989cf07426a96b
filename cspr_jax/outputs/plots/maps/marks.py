"""Marks in a section of a map: the spools, P0, and the start of the motions."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.projections.polar import PolarAxes
from matplotlib.transforms import Bbox

from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.outputs.plots.robots.robot_at import spools_of
from cspr_jax.outputs.plots.style.fixed_axes import start, starts_at_rest, table
from cspr_jax.outputs.plots.style.labels import as_drawn
from cspr_jax.store.reading.result import Result

# Axes of the same space: of the targets, or of the start points.
OF_TARGETS, OF_STARTS = ("x", "y", "z", "radius", "azimuth"), ("from_x", "from_y", "from_z")
_EDGE: dict[str, Any] = {"color": "white", "markeredgecolor": "black", "linestyle": "none"}


class _Section(NamedTuple):
    # Section in which to mark points: its space, axes, their names without "from_", coordinates, and the spools.
    panel: Axes | None
    result: Result
    space: tuple[str, ...]
    across: list[str]
    names: list[str]
    coordinates: dict[str, float]
    base: np.ndarray

    @property
    def centre(self) -> np.ndarray:
        # The centroid of the spools.
        return self.base.mean(axis=0)


def draw_marks(
    panel: Axes, result: Result, name: str, across: list[str], coordinates: dict[str, float]
) -> dict[str, Artist]:
    """Draw spools, P0 and the fixed end of the motions, as far as they lie within the range of a section.

    P0 and the fixed end are marked only in sections that contain them, to half a step of the grid. The spools are
    projected onto the section.
    """
    section = _section(panel, result, across, coordinates)
    if section is None:
        return {}
    limits = panel.get_xlim(), panel.get_ylim()
    artists = _spools(section)
    for words, point in _points(section, name).items():
        if _contains(section, point):
            at = _drawn(section, point[None])
            if _inside(limits, at).any():
                # Both are visible where they coincide, since the plus lies within the circle.
                symbol, marker_size, layer = ("P", 6.0, 2.6) if words == "P0" else ("o", 9.0, 2.5)
                artists[words] = panel.plot(*at[0], symbol, markersize=marker_size, zorder=layer, **_EDGE)[0]
    panel.set(xlim=limits[0], ylim=limits[1])
    return artists


def marked(result: Result, name: str, across: list[str], over: str, coordinates: dict[str, float]) -> list[int]:
    """Find the sections, among many parallel ones, that contain P0 or the fixed end of the motions."""
    section = _section(None, result, across, coordinates)
    if section is None or over not in section.space:
        return []
    points = result.axes[over]
    indices = []
    for point in _points(section, name).values():
        gaps = points - _coordinate(over.removeprefix("from_"), point[None], section.centre, None)[0]
        nearest = int(np.argmin(np.abs(gaps)))
        if _contains(section._replace(coordinates=section.coordinates | {over: float(points[nearest])}), point):
            indices.append(nearest)
    return sorted(set(indices))


def _section(panel: Axes | None, result: Result, across: list[str], coordinates: dict[str, float]) -> _Section | None:
    # None where nothing can be marked in this space.
    space = next((space for space in (OF_TARGETS, OF_STARTS) if set(across) <= set(space)), None)
    base = spools_of(result, coordinates)
    if space is None or base is None or base.ndim != 2 or base.shape[1] != 3 or not np.isfinite(base).all():
        return None
    return _Section(panel, result, space, across, [axis.removeprefix("from_") for axis in across], coordinates, base)


def _points(section: _Section, name: str) -> dict[str, np.ndarray]:
    # P0, and the end that all motions share, by their names in the legend.
    words, end = ("start", start(section.result)) if section.space is OF_TARGETS else ("target", section.coordinates)
    points = {"P0": _rest_point(section, name)}
    if all(axis in end for axis in "xyz"):
        points[words] = np.array([end[axis] for axis in "xyz"], float)
    return {words: point for words, point in points.items() if point is not None}


def _rest_point(section: _Section, name: str) -> np.ndarray | None:
    # P0, which lies below the centroid of the spools; None where it differs within the map.
    coordinates, result = section.coordinates, section.result
    frame, depth = frame_of(section.base, str(result.attributes.get("z_axis", "down"))), coordinates.get("z0")
    if "z0" in result.choices or "inclination" in result.choices:
        return None
    if depth is None and "z" in coordinates and starts_at_rest(result, name):
        # z0 is chosen for each target: the target's depth, or a depth by the inclination.
        setting = table(result.settings, "trajectory").get("inclination")
        inclination = coordinates.get("inclination", 0.0 if setting is None else setting)
        if isinstance(inclination, float) and inclination > -1.0:
            depth = float(frame.depth(coordinates["z"])) / (1.0 + inclination)
    return None if depth is None else frame.outward(np.array([0.0, 0.0, depth]))


def _coordinate(name: str, points: np.ndarray, centre: np.ndarray, azimuth: float | None) -> np.ndarray:
    # A coordinate of (n, 3) points; in a vertical half-plane, the coordinate of their projections.
    if name in "xyz":
        return points[:, "xyz".index(name)]
    x, y = (points - centre)[:, :2].T
    if name == "azimuth":
        return np.arctan2(y, x)
    return np.hypot(x, y) if azimuth is None else x * np.cos(azimuth) + y * np.sin(azimuth)


def _drawn(section: _Section, points: np.ndarray) -> np.ndarray:
    # Points (n, 3) as drawn, (n, 2), in the units of the picture; azimuths are within the revolution of the axis.
    columns = []
    for axis, name in zip(section.across, section.names, strict=True):
        column = _coordinate(name, points, section.centre, section.coordinates.get("azimuth"))
        if name == "azimuth" and isinstance(section.panel, PolarAxes):
            columns.append(column % (2.0 * np.pi))
            continue
        if name == "azimuth":
            shown = section.result.axes[axis]
            middle = 0.5 * (shown.min() + shown.max())
            column = middle + (column - middle + np.pi) % (2.0 * np.pi) - np.pi
        columns.append(as_drawn(section.result, axis, column))
    return np.stack(columns, axis=1)


def _contains(section: _Section, point: np.ndarray) -> bool:
    for axis in section.space:
        name = axis.removeprefix("from_")
        if axis not in section.coordinates:
            continue
        current = section.coordinates[axis]
        points = section.result.axes.get(axis, np.array([current]))
        gaps = points - _coordinate(name, point[None], section.centre, None)[0]
        if name == "azimuth":
            if np.hypot(*(point - section.centre)[:2]) < 1e-9:
                continue  # on the vertical about which the azimuth turns
            gaps = (gaps + np.pi) % (2.0 * np.pi) - np.pi
        nearest = int(np.argmin(np.abs(gaps)))
        ordered = np.unique(points)
        steps = np.diff(ordered)
        # The step of the grid on the side of the point; beyond the last point, the last step.
        side = int(np.searchsorted(ordered, points[nearest])) - (gaps[nearest] > 0.0)
        step = steps[min(max(side, 0), len(steps) - 1)] if len(steps) else 2e-6 * max(1.0, abs(current))
        if points[nearest] != current or abs(gaps[nearest]) > 0.5 * step:
            return False
    return True


def _spools(section: _Section) -> dict[str, Artist]:
    panel, names, base = section.panel, section.names, section.base
    if panel is None:
        return {}
    polar = isinstance(panel, PolarAxes)
    if "radius" in names and "azimuth" not in (*section.coordinates, *names):
        return {}
    # Draw each spool once, in the order of the cables, which may share spools.
    flat = base[:, :2] if polar else _drawn(section, base)
    _, first = np.unique(np.round(flat, 9), axis=0, return_index=True)
    base, flat = base[np.sort(first)], flat[np.sort(first)]
    points = _drawn(section, base)
    limits = panel.get_xlim(), panel.get_ylim()
    outline = len(points) > 1 and (polar or "azimuth" not in names) and not _crosses(flat)
    symbol = "" if outline and (polar or set(names) == {"x", "y"}) and len(points) > 2 else "s"
    style: dict[str, Any] = {
        "marker": symbol,
        "markersize": 4.5,
        "markeredgecolor": "white",
        "markerfacecolor": "black",
    }
    if outline:
        ring = np.concatenate([points, points[:1]])
        panel.plot(*ring.T, color="white", linewidth=2.4)
    else:
        ring = points
    panel.plot(*ring.T, color="black", linewidth=1.0 if outline else 0.0, **style)
    (left, right), (bottom, top) = map(sorted, limits)
    through = outline and not polar and Path(ring).intersects_bbox(Bbox([[left, bottom], [right, top]]), filled=False)
    if not through and not _inside(limits, points).any():
        return {}
    if symbol:
        return {"spools": Line2D([], [], color="black", linewidth=1.0 if outline else 0.0, **style)}
    # Draw the same shape for the legend.
    middle, extent = 0.5 * (flat.min(axis=0) + flat.max(axis=0)), np.ptp(flat, axis=0).max()
    shape = Path(np.concatenate([flat, flat[:1]]) / extent - middle / extent, closed=True)
    return {"spools": Line2D([], [], marker=shape, markersize=13, markerfacecolor="none", color="black", linestyle="")}


def _inside(limits: tuple, points: np.ndarray) -> np.ndarray:
    # Points on an edge count as inside.
    low, high = (np.array([f(pair) for pair in limits]) for f in (min, max))
    slack = 0.01 * (high - low)
    return np.all((points >= low - slack) & (points <= high + slack), axis=1)


def _crosses(points: np.ndarray) -> bool:
    # Tell whether two sides of a closed polygon cross, except at a common corner.
    ends = np.roll(points, -1, axis=0)

    def side(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
        return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    for i, (a, b) in enumerate(zip(points, ends, strict=True)):
        for c, d in list(zip(points, ends, strict=True))[i + 1 :]:
            if side(a, b, c) * side(a, b, d) < 0.0 and side(c, d, a) * side(c, d, b) < 0.0:
                return True
    return False
