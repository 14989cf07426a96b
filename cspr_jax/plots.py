"""Pictures of result files: sections of maps, motions over time."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.figure import Figure

from cspr_jax.errors import ConfigError, InputError, StoreError
from cspr_jax.results import Result, open_result

PANELS = 6
NONE_COLOUR = "#d0d0d0"
# Okabe and Ito: told apart by the colour-blind.
CABLE_COLOURS = ("#0072B2", "#D55E00", "#009E73")
CABLE_STYLES = ("-", "--", "-.")


def plot(path: Path, output: Path, *, quantity: str | None = None, at: dict[str, float] | None = None) -> None:
    """Draw a result file.

    Args:
        path: result of `cspr run`, or motion of `cspr plan -o`.
        output: picture to write; its ending is the format.
        quantity: which one of a map; None: "arcs", or the first there is.
        at: fixed values of axes, the nearest point is taken.

    Raises:
        StoreError: the file cannot be read, or the picture cannot be written.
        ConfigError: no such quantity or axis, nothing to draw, or an unknown picture format.
    """
    result = open_result(path)
    try:
        figure = _map_figure(result, quantity, at or {}) if result.is_map else _motion_figure(result)
        figure.savefig(output, dpi=160, metadata={"Software": None} if output.suffix == ".png" else None)
    except InputError as error:
        raise ConfigError(path, str(error)) from error
    except ValueError as error:
        raise ConfigError(output, str(error).splitlines()[0]) from error
    except OSError as error:
        raise StoreError(f"{output}: cannot be written: {error.strerror or error}") from error


def _map_figure(result: Result, quantity: str | None, at: dict[str, float]) -> Figure:
    first = [name for name in ("arcs", "oscillations") if name in result.data]
    name = quantity or (first[0] if first else next(iter(result.data)))
    if name not in result.data:
        raise InputError("--quantity", name, "one of " + ", ".join(sorted(result.data)))
    data, axes, notes = _fix(result, result.data[name], at)
    across = [axis for axis, points in axes.items() if len(points) > 1]
    if not across:
        raise InputError("axes", {axis: len(points) for axis, points in axes.items()}, "one with more than one point")
    if len(across) == 1:
        return _line_figure(result, name, data.reshape(-1), across[0], axes[across[0]], notes)
    panels = across[2] if len(across) > 2 else None
    for extra in [axis for axis in axes if axis not in (*across[:2], panels)]:
        data = np.take(data, [0], axis=list(axes).index(extra))
        notes.append(f"{extra} = {axes[extra][0]:.4g} {result.units[extra]}")
    order = [list(axes).index(axis) for axis in (across[0], across[1], *([panels] if panels else []))]
    rest = [i for i in range(data.ndim) if i not in order]
    data = data.transpose(*order, *rest).reshape(*(data.shape[i] for i in order))
    return _sections(result, name, data if panels else data[..., None], across[:2], panels, notes)


def _fix(result: Result, data: np.ndarray, at: dict[str, float]) -> tuple[np.ndarray, dict[str, np.ndarray], list[str]]:
    axes, notes = dict(result.axes), []
    for axis, value in at.items():
        if axis not in axes:
            raise InputError("--at", axis, "one of " + ", ".join(axes))
        i = int(np.argmin(np.abs(axes[axis] - value)))
        data = np.take(data, [i], axis=list(axes).index(axis))
        axes[axis] = axes[axis][i : i + 1]
        notes.append(f"{axis} = {axes[axis][0]:.4g} {result.units[axis]}")
    return data, axes, notes


def _sections(
    result: Result, name: str, data: np.ndarray, across: list[str], panels: str | None, notes: list[str]
) -> Figure:
    count = data.shape[2]
    shown = np.unique(np.linspace(0, count - 1, min(PANELS, count)).round().astype(int))
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    size = (3.1 * columns + 1.3, 3.2 * lines + 0.8) if len(shown) > 1 else (7.0, 5.6)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    colours, norm = _colours(data[:, :, shown])
    for panel in grid.flat[len(shown) :]:
        panel.set_visible(False)
    for panel, i in zip(grid.flat, shown, strict=False):
        image = _section(panel, result, data[:, :, i], across, colours, norm)
        if name == "least_oscillations":
            _loci(panel, result, data[:, :, i], across)
        if panels is not None:
            panel.set_title(f"{panels} = {result.axes[panels][i]:.3g} {result.units[panels]}", fontsize=10)
    for panel in grid[-1]:
        panel.set_xlabel(f"{across[0]} ({result.units[across[0]]})")
    for panel in grid[:, 0]:
        panel.set_ylabel(f"{across[1]} ({result.units[across[1]]})")
    bar = figure.colorbar(image, ax=grid, shrink=0.9, label=_label(result, name))
    if data.dtype.kind == "i":
        _count_ticks(bar, int(data[:, :, shown].max()))
    handles, labels = grid[0, 0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower left", ncols=len(handles), fontsize=9, frameon=False)
    notes = [*_start_note(result), *notes, *_constants(result, across, panels)]
    notes.append(f"z axis {result.attributes.get('z_axis', 'down')}")
    text = ", ".join(dict.fromkeys(notes))
    figure.suptitle(f"{result.attributes['robot']}: {result.labels[name]}\n{text}", fontsize=11)
    return figure


def _start(result: Result) -> dict[str, float]:
    # Where all segments start, if it is one place.
    start = result.settings.get("trajectory", {}).get("from") or {}
    moving = any(axis.startswith("from_") for axis in result.axes)
    return {} if moving else dict(zip("xyz", start.get("position") or (), strict=False))


def _start_note(result: Result) -> list[str]:
    start = _start(result)
    if start:
        return [f"from ({', '.join(f'{value:.4g}' for value in start.values())}) m"]
    return [] if any(axis.startswith("from_") for axis in result.axes) else ["from rest"]


def _constants(result: Result, across: list[str], panels: str | None) -> list[str]:
    used = (*across, panels)
    return [f"{a} = {p[0]:.4g} {result.units[a]}" for a, p in result.axes.items() if a not in used and len(p) == 1]


def _section(panel: Axes, result: Result, values: np.ndarray, across: list[str], colours, norm):
    x, y = (_edges(result.axes[axis]) for axis in across)
    image = panel.pcolormesh(x, y, values.T, cmap=colours, norm=norm, rasterized=True)
    if all(result.units[axis] == "m" for axis in across):
        panel.set_aspect("equal")
    if across[1] == "z" and result.attributes.get("z_axis", "down") == "down":
        panel.yaxis.set_inverted(True)
    if across == ["x", "y"] and "base_points" in result.attributes:
        base = np.asarray(result.attributes["base_points"])
        panel.fill(base[:, 0], base[:, 1], fill=False, edgecolor="white", linewidth=2.4)
        panel.fill(base[:, 0], base[:, 1], fill=False, edgecolor="black", linewidth=1.0, label="spools")
    start = _start(result)
    if all(axis in start for axis in across):
        panel.plot(
            *(start[axis] for axis in across), "o", color="white", markeredgecolor="black", markersize=5, label="start"
        )
    return image


def _loci(panel: Axes, result: Result, values: np.ndarray, across: list[str]) -> None:
    # Where a whole number of oscillations is just too few: the hexagons of thesis Fig. 1.6 on horizontal transitions.
    x, y = (result.axes[axis] for axis in across)
    levels = np.arange(1.0, np.nanmax(values, initial=1.0))
    if min(values.shape) > 1 and len(levels):
        lines = panel.contour(x, y, values.T, levels=levels, colors="white", linewidths=0.8)
        panel.clabel(lines, fmt="%d", fontsize=8)


def _edges(points: np.ndarray) -> np.ndarray:
    middles = 0.5 * (points[1:] + points[:-1])
    return np.concatenate([[1.5 * points[0] - 0.5 * points[1]], middles, [1.5 * points[-1] - 0.5 * points[-2]]])


def _colours(data: np.ndarray):
    if data.dtype.kind == "i":
        most = max(int(data.max()), 1)
        colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, most))
        return ListedColormap([NONE_COLOUR, *colours]), BoundaryNorm(np.arange(-0.5, most + 1), most + 1)
    finite = data[np.isfinite(data)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    return matplotlib.colormaps["cividis"], Normalize(low, high if high > low else low + 1.0)


def _count_ticks(bar, most: int) -> None:
    step = -(-max(most, 1) // 12)
    ticks = [0, *range(step, most + 1, step)]
    bar.set_ticks(ticks, labels=["none", *(str(tick) for tick in ticks[1:])])
    bar.ax.minorticks_off()


def _label(result: Result, name: str) -> str:
    unit = result.units[name]
    return result.labels[name] + (f" ({unit})" if unit not in ("", "1") else "")


def _line_figure(
    result: Result, name: str, values: np.ndarray, axis: str, points: np.ndarray, notes: list[str]
) -> Figure:
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    panel = figure.subplots()
    panel.plot(points, values, ".-", color=CABLE_COLOURS[0], drawstyle="steps-mid" if name == "arcs" else "default")
    panel.set_xlabel(f"{axis} ({result.units[axis]})")
    panel.set_ylabel(_label(result, name))
    panel.grid(alpha=0.3)
    notes = [*notes, *_constants(result, [axis], None)]
    panel.set_title(f"{result.attributes['robot']}: {', '.join(dict.fromkeys(notes))}", fontsize=10)
    return figure


def _motion_figure(result: Result) -> Figure:
    time, position, tension = result.axes["t"], result.data["position"], result.data["tension"]
    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    top, side, below = figure.subplot_mosaic([["xy", "xz"], ["tension", "tension"]], height_ratios=[1.2, 1.0]).values()
    for panel, j in ((top, 1), (side, 2)):
        panel.plot(position[:, 0], position[:, j], color="black", linewidth=0.9)
        panel.set_xlabel("x (m)")
        panel.set_ylabel(f"{'xyz'[j]} (m)")
        panel.set_aspect("equal", adjustable="datalim")
        panel.grid(alpha=0.3)
    if result.attributes.get("z_axis", "down") == "down":
        side.invert_yaxis()
    for k, (colour, style) in enumerate(zip(CABLE_COLOURS, CABLE_STYLES, strict=True)):
        below.plot(time, tension[:, k], style, color=colour, linewidth=1.0, label=f"cable {k + 1}")
    below.axhline(0.0, color="black", linewidth=0.8)
    below.set_xlabel("time (s)")
    below.set_ylabel("tension (N)")
    below.legend(ncols=3, loc="upper right", framealpha=0.9)
    below.margins(x=0.01)
    z_axis, z0 = result.attributes.get("z_axis", "down"), float(result.attributes["z0"])
    figure.suptitle(f"{result.attributes['robot']}: z0 = {z0:.4g} m, z axis {z_axis}", fontsize=11)
    return figure
