"""What stands in a section of a map beside its cells: the spools, P0, and where the motions start."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.transforms import Bbox

from cspr_jax.plots.labels import as_drawn
from cspr_jax.plots.notes import start, starts_at_rest, table
from cspr_jax.results import Result

# Axes of one and the same space: of the targets, or of the start points.
OF_TARGETS, OF_STARTS = ("x", "y", "z", "radius", "azimuth"), ("from_x", "from_y", "from_z")
_EDGE: dict[str, Any] = {"color": "white", "markeredgecolor": "black", "linestyle": "none"}


def mark(panel: Axes, result: Result, name: str, across: list[str], place: dict[str, float]) -> dict[str, Artist]:
    """Draw spools, P0 and start, as far as they belong into a section and fit into its range.

    P0 and the start are marked only where the section contains them, to half a step of the grid. The spools are
    projected onto it.

    Args:
        panel: the section, with its cells.
        result: the map.
        name: of the quantity.
        across: the two axes of the section.
        place: the other axes, and where the section is.

    Returns:
        what to show in the legend, by its words.
    """
    space = next((space for space in (OF_TARGETS, OF_STARTS) if set(across) <= set(space)), None)
    base = np.asarray(result.attributes.get("base_points", 0.0), float)
    if space is None or base.ndim != 2 or base.shape[1] != 3 or not np.isfinite(base).all():
        return {}
    names = [axis.removeprefix("from_") for axis in across]
    place = {axis.removeprefix("from_"): point for axis, point in place.items() if axis in space} | {
        axis: place[axis] for axis in ("z0", "inclination") if axis in place
    }
    limits = panel.get_xlim(), panel.get_ylim()
    found = _spools(panel, result, across, names, base, place.get("azimuth"))
    centre = base.mean(axis=0)
    marks = [("P0", "P", _rest_point(result, name, centre, place))]
    begin = start(result)
    if space is OF_TARGETS and len(begin) == 3:
        marks.append(("start", "o", np.array([begin[axis] for axis in "xyz"], float)))
    for words, symbol, point in marks:
        if point is not None and _contains(result, space, place, point, centre):
            at = _drawn(result, across, names, point[None], centre, place.get("azimuth"))
            if at is not None and _inside(limits, at).any():
                found[words] = panel.plot(*at[0], symbol, markersize=7 if symbol == "P" else 5.5, **_EDGE)[0]
    panel.set(xlim=limits[0], ylim=limits[1])
    return found


def _rest_point(result: Result, name: str, centre: np.ndarray, place: dict[str, float]) -> np.ndarray | None:
    # P0 lies below the centroid of the spools; None where it is not one point.
    down = -1.0 if result.attributes.get("z_axis") == "up" else 1.0
    depth = place.get("z0")
    if depth is None and "z" in place and starts_at_rest(result, name):
        # z0 is chosen for each target: its own depth, or by the inclination.
        given = table(result.settings, "trajectory").get("inclination")
        inclination = place.get("inclination", 0.0 if given is None else given)
        if isinstance(inclination, float) and inclination > -1.0:
            depth = (place["z"] - centre[2]) * down / (1.0 + inclination)
    return None if depth is None else centre + np.array([0.0, 0.0, down * depth])


def _coordinate(name: str, points: np.ndarray, centre: np.ndarray, azimuth: float | None) -> np.ndarray:
    # Of (n, 3) points. A vertical half-plane takes what is projected onto it.
    if name in "xyz":
        return points[:, "xyz".index(name)]
    x, y = (points - centre)[:, :2].T
    if name == "azimuth":
        return np.arctan2(y, x)
    return np.hypot(x, y) if azimuth is None else x * np.cos(azimuth) + y * np.sin(azimuth)


def _drawn(
    result: Result, across: list[str], names: list[str], points: np.ndarray, centre: np.ndarray, azimuth: float | None
) -> np.ndarray | None:
    # (n, 2) in the units of the picture; the azimuth within the turn that the axis shows.
    columns = []
    for axis, name in zip(across, names, strict=True):
        column = _coordinate(name, points, centre, azimuth)
        if name == "azimuth":
            middle = 0.5 * (result.axes[axis].min() + result.axes[axis].max())
            column = middle + (column - middle + np.pi) % (2.0 * np.pi) - np.pi
        columns.append(as_drawn(result, axis, column))
    found = np.stack(columns, axis=1)
    return found if np.isfinite(found).all() else None


def _contains(
    result: Result, space: tuple[str, ...], place: dict[str, float], point: np.ndarray, centre: np.ndarray
) -> bool:
    for axis in space:
        name = axis.removeprefix("from_")
        if name not in place:
            continue
        points = result.axes.get(axis, np.array([place[name]]))
        gaps = points - _coordinate(name, point[None], centre, None)[0]
        if name == "azimuth":
            if np.hypot(*(point - centre)[:2]) < 1e-9:
                continue  # on the vertical about which it turns
            gaps = (gaps + np.pi) % (2.0 * np.pi) - np.pi
        nearest = int(np.argmin(np.abs(gaps)))
        step = np.diff(np.sort(points)).max(initial=2e-6 * max(1.0, abs(points[nearest])))
        if points[nearest] != place[name] or abs(gaps[nearest]) > 0.5 * step:
            return False
    return True


def _spools(
    panel: Axes,
    result: Result,
    across: list[str],
    names: list[str],
    base: np.ndarray,
    azimuth: float | None,
) -> dict[str, Artist]:
    drawn = _drawn(result, across, names, base, base.mean(axis=0), azimuth)
    if drawn is None or ("radius" in names and azimuth is None and "azimuth" not in names):
        return {}
    # Two cables may share a spool; the order is the cables'.
    keys = list(dict.fromkeys(map(tuple, np.round(drawn, 9).tolist())))
    points = np.array(keys)
    size = np.ptp(points, axis=0).max()
    outline = "azimuth" not in names and len(points) > 1 and size > 0.0 and not _crosses(points)
    limits = panel.get_xlim(), panel.get_ylim()
    symbol = "" if outline and set(names) == {"x", "y"} and len(points) > 2 else "s"
    look: dict[str, Any] = {"marker": symbol, "markersize": 4.5, "markeredgecolor": "white", "markerfacecolor": "black"}
    if not outline:
        panel.plot(*points.T, linestyle="none", **look)
        seen = _inside(limits, points).any()
        return {"spools": Line2D([], [], linestyle="none", **look)} if seen else {}
    ring = np.concatenate([points, points[:1]])
    panel.plot(*ring.T, color="white", linewidth=2.4)
    panel.plot(*ring.T, color="black", linewidth=1.0, **look)
    (left, right), (bottom, top) = map(sorted, limits)
    if not Path(ring).intersects_bbox(Bbox([[left, bottom], [right, top]]), filled=False):
        return {}
    if symbol:
        return {"spools": Line2D([], [], color="black", linewidth=1.0, **look)}
    # The same shape in the legend.
    shape = Path((ring - 0.5 * (points.min(axis=0) + points.max(axis=0))) / size, closed=True)
    return {"spools": Line2D([], [], marker=shape, markersize=13, markerfacecolor="none", color="black", linestyle="")}


def _inside(limits: tuple, points: np.ndarray) -> np.ndarray:
    low, high = (np.array([f(pair) for pair in limits]) for f in (min, max))
    return np.all((points >= low) & (points <= high), axis=1)


def _crosses(points: np.ndarray) -> bool:
    # Whether two sides of the closed polygon cross, other than at a common corner.
    ends = np.roll(points, -1, axis=0)

    def side(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
        return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    for i, (a, b) in enumerate(zip(points, ends, strict=True)):
        for c, d in list(zip(points, ends, strict=True))[i + 1 :]:
            if side(a, b, c) * side(a, b, d) < 0.0 and side(c, d, a) * side(c, d, b) < 0.0:
                return True
    return False
