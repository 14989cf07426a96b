"""Axes in space for a robot in motion, and the colours of its cables by tension."""

from __future__ import annotations

import itertools
from typing import Any

import matplotlib
import numpy as np
from matplotlib import rcParams
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator
from matplotlib.transforms import Bbox, TransformedBbox
from mpl_toolkits.mplot3d import proj3d

from cspr_jax.numerics.shapes import Float

ELEVATION, AZIMUTH = 18.0, -62.0  # degrees, direction to the viewer
# Margin around the drawn points, over their extent.
MARGIN = 0.04
MAX_TICKS, MIN_TICKS = 5, 2  # numbers of ticks of an axis
STEPS = 4  # number of steps in which a picture is enlarged to fill its slot
FILLS = "fills its slot"


def colours_of_tension() -> ListedColormap:
    """Colours of cables from the lowest tension to the largest."""
    return ListedColormap(matplotlib.colormaps["plasma"](np.linspace(0.0, 0.88, 256)))


def set_space(panel: Any, points: Float[np.ndarray, "n 3"], *, is_down: bool) -> None:
    """Set axes of true proportions, seen from the side with the vertical upward; `fill_panels` enlarges them later."""
    low, high = points.min(0), points.max(0)
    extents = np.maximum(high - low, 0.1 * (high - low).max())
    middle = 0.5 * (low + high)
    signs = signs_of(is_down=is_down)
    for k, name in enumerate("xyz"):
        half = (0.5 + MARGIN) * signs[k] * extents[k]
        panel.set(**{f"{name}lim": (middle[k] - half, middle[k] + half), f"{name}label": f"{name} (m)"})
        axis = getattr(panel, f"{name}axis")
        # Labels that matplotlib rotates may be upside down.
        axis.set_rotate_label(False)
        axis.label.set_rotation(90.0 if name == "z" else 0.0)
        axis.labelpad = rcParams["font.size"] * (0.4 if name == "z" else 1.8)
        axis.set_in_layout(False)
    panel.set_box_aspect(tuple(extents))
    panel.set_proj_type("ortho")
    panel.view_init(elev=ELEVATION, azim=AZIMUTH)
    # The background of the panel is larger than its slot, and would hide its neighbours.
    panel.patch.set_visible(False)
    panel.set_gid(FILLS)


def across_and_up(*, is_down: bool) -> Float[np.ndarray, "2 3"]:
    """Directions in space that point to the right and upward in the picture."""
    elevation, azimuth = np.radians([ELEVATION, AZIMUTH])
    across = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    up = np.array([-np.sin(elevation) * np.cos(azimuth), -np.sin(elevation) * np.sin(azimuth), np.cos(elevation)])
    return np.stack([across, up]) * signs_of(is_down=is_down)


def towards_eye(*, is_down: bool) -> Float[np.ndarray, "3"]:
    """Direction towards the viewer."""
    elevation, azimuth = np.radians([ELEVATION, AZIMUTH])
    level = np.cos(elevation)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]) * signs_of(is_down=is_down)


def signs_of(*, is_down: bool) -> Float[np.ndarray, "3"]:
    """Signs of the directions in which the axes of a picture in space increase."""
    return np.array([1.0, -1.0, -1.0]) if is_down else np.ones(3)


def shape_of(points: Float[np.ndarray, "n 3"]) -> float:
    """Height of the picture of a box over its width."""
    sizes = np.ptp(points, axis=0)
    right, back, up = np.maximum(sizes, 0.1 * sizes.max())
    elevation, azimuth = np.radians([ELEVATION, AZIMUTH])
    across = abs(right * np.sin(azimuth)) + abs(back * np.cos(azimuth))
    level = abs(right * np.cos(azimuth)) + abs(back * np.sin(azimuth))
    return float((up * np.cos(elevation) + level * np.sin(elevation)) / across)


def fill_panels(figure: Figure) -> None:
    """Make each robot in space as large as its slot allows, with as many ticks as do not overlap."""
    spaces: list[Any] = [panel for panel in figure.axes if panel.get_gid() == FILLS]
    if not spaces:
        return
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for panel in spaces:
        slot = panel.get_position(original=True)
        for count in range(MAX_TICKS, 1, -1):
            for axis in _axes(panel):
                axis.set_major_locator(MaxNLocator(count, prune="both"))
            _fill(figure, panel, slot)
            if not _meet(panel):
                break
        _add_ticks(figure, panel)
        _leave_out(panel)
        if min(len(axis.get_major_locator()()) for axis in _axes(panel)) < MIN_TICKS:
            # An axis needs two numbers to show its scale: begin with many ticks, and remove those that overlap.
            for axis in _axes(panel):
                axis.set_major_locator(MaxNLocator(MAX_TICKS, prune="both"))
            _fill(figure, panel, slot)
            _leave_out(panel)


def _add_ticks(figure: Figure, panel: Any) -> None:
    # Axes with space for more ticks get more.
    for axis in _axes(panel):
        usual = axis.get_major_locator()
        for count in range(2 * MAX_TICKS, MIN_TICKS, -2):
            locator = MaxNLocator(count, steps=[1, 2, 5, 10], prune="both")
            low, high = axis.get_view_interval()
            if len(locator.tick_values(low, high)) <= len(usual()):
                break
            axis.set_major_locator(locator)
            _place_words(figure, panel)
            if not _meet(panel):
                break
            axis.set_major_locator(usual)
    _place_words(figure, panel)


def _fill(figure: Figure, panel: Any, slot: Bbox) -> None:
    # Take a few steps, since letters do not grow with the box.
    width, height = figure.get_size_inches()
    side = max(slot.width * width, slot.height * height)
    space = TransformedBbox(slot, figure.transSubfigure)
    middle, zoom = np.array([0.5 * (slot.x0 + slot.x1), 0.5 * (slot.y0 + slot.y1)]), 1.0
    sizes = tuple(abs(high - low) for low, high in (panel.get_xlim(), panel.get_ylim(), panel.get_zlim()))
    half = 0.5 * side / np.array([width, height])
    for _ in range(STEPS):
        panel.set_position(Bbox([middle - half, middle + half]))
        panel.set_box_aspect(sizes, zoom=zoom)
        _place_words(figure, panel)
        drawn = Bbox.union([*words_in_space(panel), box_in_space(panel)])
        zoom *= float(min(space.width / drawn.width, space.height / drawn.height))
        shift = np.array([space.x0 + space.x1 - drawn.x0 - drawn.x1, space.y0 + space.y1 - drawn.y0 - drawn.y1])
        middle = middle + 0.5 * shift / np.array([figure.bbox.width, figure.bbox.height])


def _place_words(figure: Figure, panel: Any) -> None:
    # Ticks and labels of a panel in space are placed only when it is drawn: draw it without anything else.
    others = [*figure.get_children(), *panel.collections, *panel.lines, *panel.texts]
    others = [artist for artist in others if artist is not panel and not artist.get_animated()]
    for artist in others:
        artist.set_animated(True)
    figure.draw_without_rendering()
    for artist in others:
        artist.set_animated(False)


def _axes(panel: Any) -> tuple[Any, ...]:
    return panel.xaxis, panel.yaxis, panel.zaxis


def box_in_space(panel: Any) -> Bbox:
    """Rectangle in which the corners of a box in space are drawn."""
    low, high = np.array([panel.get_xlim(), panel.get_ylim(), panel.get_zlim()]).T
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    x, y, _ = proj3d.proj_transform(*corners.T, panel.get_proj())
    seen = panel.transData.transform(np.column_stack([x, y]))
    return Bbox([seen.min(0), seen.max(0)])


def words_in_space(panel: Any) -> list[Bbox]:
    """Rectangles in which ticks and labels of axes in space are written."""
    texts = [tick.label1 for axis in _axes(panel) for tick in axis.get_major_ticks() if tick.label1.get_text()]
    texts += [axis.label for axis in _axes(panel)]
    return [text.get_window_extent() for text in texts if text.get_visible() and text.get_text()]


def _leave_out(panel: Any) -> None:
    # Leave out ticks whose numbers overlap others, even if few are left: an axis may be seen nearly from its end.
    boxes = [axis.label.get_window_extent() for axis in _axes(panel)]
    for axis in _axes(panel):
        locations = []
        for tick in axis.get_major_ticks():
            box = tick.label1.get_window_extent()
            if tick.label1.get_text() and not any(box.padded(1.0).overlaps(other) for other in boxes):
                locations.append(tick.get_loc())
                boxes.append(box)
        axis.set_major_locator(FixedLocator(locations))


def _meet(panel: Any) -> bool:
    boxes = [box.padded(1.0) for box in words_in_space(panel)]
    return any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
