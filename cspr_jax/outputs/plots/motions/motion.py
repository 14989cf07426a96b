"""A motion over time: its path and the tensions of the cables."""

from __future__ import annotations

import functools
import operator
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cspr_jax.numerics.bounds.intervals import united
from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.plots.motions.ends import draw_ends, entries_of_ends, segment_rows
from cspr_jax.outputs.plots.motions.motion_source import keeps_plan, robot_and_plan
from cspr_jax.outputs.plots.robots.obstacles import draw_shadows
from cspr_jax.outputs.plots.robots.robot_along import limits_of
from cspr_jax.outputs.plots.style.fitting import DOUBT, legend_above
from cspr_jax.outputs.plots.style.labels import COLOURS, cable_names, line_style, robot_name
from cspr_jax.outputs.plots.style.layout import is_narrow
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.quantities import PARTS
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.reading.result import Result

# Flags of the criteria whose failures the chart of each quantity shows; the chart of the path, or of the tensions,
# shows all others.
SHOWN = {"tension": Verdict.WRENCH_INFEASIBLE | Verdict.UNCERTAINTY, "velocity": Verdict.OVER_FEED}
for _limit in LIMITS:
    if _limit.chart:
        SHOWN[_limit.chart] = SHOWN.get(_limit.chart, Verdict.FEASIBLE) | _limit.flag
# Largest number of segments whose boundaries are drawn: more lines would hide the rest.
BOUNDARIES = 200
# Path and spools lie in one plane if their extent along y is at most this fraction of that along x: typed numbers are
# rounded.
ONE_PLANE = 1e-9
# Limits beyond this multiple of the largest value are named in the legend, but not drawn.
FAR = 3.0
FAILS = "fails"
FLIGHT = ("flight", "release", "landing")
FAILING: dict[str, Any] = {"facecolor": (0.8, 0.1, 0.1, 0.14), "edgecolor": (0.8, 0.1, 0.1, 0.3), "linewidth": 0.6}
LIMIT: dict[str, Any] = {"color": "black", "linewidth": 0.9, "linestyle": "--"}


def motion_figure(result: Result) -> Figure:
    """Path and tensions of a motion."""
    time, position, tension = result.axes["t"], result.data["position"], result.data["tension"]
    # The spools and the path of a planar robot lie in one vertical plane y = constant. Old files lack the spools.
    points = np.vstack([position, result.attributes.get("base_points", np.empty((0, 3)))])
    is_planar = np.ptp(points[:, 1]) <= ONE_PLANE * np.ptp(points[:, 0])
    # A file without P0 contains straight lines, whose accelerations are shown.
    z0 = result.attributes.get("z0")
    more = [
        name
        for name, is_shown in (
            ("velocity", "flight_position" in result.data),
            ("acceleration", z0 is None and "acceleration" in result.data),
            ("bounds", "path_acceleration" in result.data),
            ("couple", "tension_couple" in result.data),
        )
        if is_shown
    ]
    layout: Any = [["xz", "xz"] if is_planar else ["xy", "xz"], ["tension", "tension"], *([name] * 2 for name in more)]
    heights = [1.2, 1.0, *[0.8] * len(more)]
    if "quaternion" in result.data:
        layout.insert(1, ["orientation", "orientation"])
        heights.insert(1, 0.8)
    figure = Figure(figsize=(10.0, 2.8 * sum(heights)), layout="constrained")
    drawn = figure.subplot_mosaic(layout, height_ratios=heights)
    if "quaternion" in result.data:
        _orientation(drawn["orientation"], time, result.data["quaternion"])
    for name, j in (("xy", 1), ("xz", 2)):
        if name in drawn:
            _path(drawn[name], position, j)
            draw_ends(drawn[name], position, segment_rows(result.data, time), (0, j))
            if "flight_position" in result.data:
                _flight(drawn[name], result.data["flight_position"], j)
    if result.attributes.get("z_axis", "down") == "down":
        drawn["xz"].invert_yaxis()
    _tensions(drawn["tension"], time, tension, cable_names(result.data), result.attributes.get("mass"))
    if keeps_plan(result):
        _draw_all_limits(drawn, result)
    if "couple" in drawn:
        _lines(drawn["couple"], time, result.data["tension_couple"], [f"couple {name}" for name in PARTS["couple"]])
        drawn["couple"].set_ylabel("tension couple (N)")
    if "bounds" in drawn:
        _bounds(drawn["bounds"], time, result.data["path_acceleration"])
    if "velocity" in drawn:
        _lines(drawn["velocity"], time, result.data["velocity"], ["x", "y", "z"])
        drawn["velocity"].set_ylabel("velocity (m/s)")
    if "acceleration" in drawn:
        acceleration = result.data["acceleration"]
        sizes = np.linalg.norm(acceleration, axis=1)
        _lines(drawn["acceleration"], time, np.c_[acceleration, sizes], ["x", "y", "z", "size"])
        drawn["acceleration"].set_ylabel("acceleration (m/s²)")
    charts = [name for name in ("orientation", "tension", *more) if name in drawn]
    for name in charts:
        _mark_intervals(drawn[name], result, name, charts)
    _name_ends(figure, drawn["xz"], segment_rows(result.data, time))
    words = "" if z0 is None else f"z0 = {float(z0):.4g} m, "
    axis = result.attributes.get("z_axis", "not known, see --robot")
    figure.suptitle(f"{robot_name(result)}: {words}z axis {axis}{point_words(result.data)}{doubt(result)}")
    return figure


def _name_ends(figure: Figure, panel: Axes, rows: np.ndarray) -> None:
    entries = zip(*reversed(panel.get_legend_handles_labels()), strict=True)
    ends = entries_of_ends(rows) | {name: artist for name, artist in entries if name in FLIGHT}
    figure.legend(list(ends.values()), list(ends), loc="outside lower center", ncols=len(ends))


def point_words(columns: Mapping[str, Any]) -> str:
    """Words for the point of a platform whose positions are shown, unless it is the mass centre."""
    return ", positions of the origin of the platform's axes" if "mass_centre" in columns else ""


SHORT = {"smallest allowed": "at least", "largest allowed": "at most"}


def draw_limits(
    panel: Axes, limits: list[tuple[str, float]], values: np.ndarray, unit: str, *, signed: bool = False
) -> None:
    """Draw limits over time as lines with names in the legend; limits far above all values are only named."""
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    beyond = []
    for words, value in limits:
        if value > FAR * largest:
            beyond.append(f"{value:.4g}")
            continue
        panel.axhline(value, label=f"{SHORT[words]} {value:.4g} {unit}", **LIMIT)
        if signed:
            panel.axhline(-value, **LIMIT)
    if beyond:
        each = f"{beyond[0]}{' .. ' + beyond[-1] if len(beyond) > 1 else ''}"
        panel.plot([], [], label=f"at most {each} {unit} (above)", **LIMIT)


def _draw_all_limits(drawn: Mapping[str, Axes], result: Result) -> None:
    tension = result.data["tension"]
    robot_file, plan_file = robot_and_plan(result, "plan", "tension")
    draw_limits(drawn["tension"], limits_of(robot_file, plan_file), tension, "N")
    legend_above(drawn["tension"], len(tension.T) + 2)
    if "tension_residual" in result.data:
        # Name the rule that chooses the tensions of redundant cables.
        drawn["tension"].set_ylabel(f"tension (N)\n{plan_file.tension_rule}")
    for _, level in limits_of(robot_file, plan_file, "depth"):
        drawn["xz"].axhline(level, **LIMIT)
    for name in [name for name in ("xy", "xz") if plan_file.obstacle and name in drawn]:
        draw_shadows(drawn[name], plan_file.bodies, (0, "xyz".index(name[1])))
        legend_above(drawn[name], 3)


def boundaries(panel: Axes, result: Result) -> None:
    """Draw lines where segments of a motion meet, which files of earlier versions do not tell."""
    for time in result.data.get("segment_end", np.empty(0))[:-1][:BOUNDARIES]:
        panel.axvline(time, color="black", linewidth=0.8, alpha=0.35)


def _mark_intervals(panel: Axes, result: Result, chart: str, charts: Sequence[str]) -> None:
    boundaries(panel, result)
    shade_failing(panel, result.data, chart, charts)
    if chart == "tension" and len(failing_in(result.data, chart, charts)):
        legend_above(panel, len(panel.lines) + 1)


def shade_failing(panel: Axes, columns: Mapping[str, Any], chart: str, charts: Sequence[str] = ("tension",)) -> None:
    """Shade the intervals of time in which a motion fails, where they are known."""
    intervals = failing_in(columns, chart, charts)
    if len(intervals):
        # Areas extend over the full height of a panel; their edges show intervals of length zero.
        areas = [[(start, 0.0), (start, 1.0), (end, 1.0), (end, 0.0)] for start, end in intervals]
        style: dict[str, Any] = {"transform": panel.get_xaxis_transform(), "zorder": 0.5, "label": FAILS}
        panel.add_collection(PolyCollection(areas, **style, **FAILING), autolim=False)


def doubt(result: Result) -> str:
    """A line of text that says which segments of a motion are not proved feasible."""
    if result.attributes.get("feasible", 1):
        return ""
    none = result.data.get("segment_arcs", np.empty(0)) == 0
    if not len(none):
        return f"\n{DOUBT}"
    wrong = np.flatnonzero(none & (result.data.get("segment_verdict", none) != 0)) + 1
    listed = ", ".join(str(number) for number in wrong[:6]) + (", ..." if len(wrong) > 6 else "")
    return f"\n{DOUBT}: segment{'s' if len(wrong) > 1 else ''} {listed}"


def _path(panel: Axes, position: np.ndarray, j: int) -> None:
    panel.plot(position[:, 0], position[:, j], color="black", linewidth=0.9)
    panel.set_xlabel("x (m)")
    panel.set_ylabel(f"{'xyz'[j]} (m)")
    panel.set_aspect("equal", adjustable="datalim")
    if is_narrow():
        panel.xaxis.set_major_locator(MaxNLocator(3))
    panel.grid(alpha=0.3)


def _flight(panel: Axes, position: np.ndarray, j: int) -> None:
    # Draw the flight of a released object.
    panel.plot(position[:, 0], position[:, j], color=COLOURS[1], linewidth=1.2, linestyle="--", label="flight")
    for row, marker, name in ((0, "o", "release"), (-1, "x", "landing")):
        point = position[row, 0], position[row, j]
        panel.plot(*point, linestyle="", marker=marker, markersize=6, color=COLOURS[1], label=name)


def _orientation(panel: Axes, time: np.ndarray, quaternion: np.ndarray) -> None:
    _lines(panel, time, quaternion, list("wxyz"), axis=False)
    panel.set_ylabel("quaternion")


def _lines(panel: Axes, time: np.ndarray, values: np.ndarray, names: list[str], *, axis: bool = True) -> None:
    for k, name in enumerate(names):
        panel.plot(time, values[:, k], linewidth=1.2, label=name, **line_style(k))
    if axis:
        panel.axhline(0.0, color="black", linewidth=0.8)
    panel.set_xlabel("time (s)")
    legend_above(panel, len(names))
    panel.margins(x=0.01)


def _bounds(panel: Axes, time: np.ndarray, values: np.ndarray) -> None:
    # Shade the feasible range between the bounds; do not extend the picture for bounds far beyond the motion.
    largest = np.abs(values[:, 1]).max()
    low, high = (np.clip(np.nan_to_num(values[:, k], nan=0.0), -10.0 * largest, 10.0 * largest) for k in (0, 2))
    panel.fill_between(time, low, high, color=COLOURS[5], alpha=0.3, linewidth=0.0, label="feasible")
    panel.plot(time, values[:, 1], color="black", linewidth=1.2, label="along the line")
    panel.axhline(0.0, color="black", linewidth=0.8)
    panel.set_ylim(-1.8 * largest, 1.8 * largest)
    panel.set_xlabel("time (s)")
    panel.set_ylabel("acceleration\nalong the line (m/s²)")
    legend_above(panel, 2)
    panel.margins(x=0.01)


def _tensions(panel: Axes, time: np.ndarray, tension: np.ndarray, names: list[str], mass: object) -> None:
    _lines(panel, time, tension, names)
    panel.set_ylabel("tension (N)")
    if isinstance(mass, float) and mass > 0.0:
        second = panel.secondary_yaxis(
            "right", functions=(lambda f: np.asarray(f) / mass, lambda a: np.asarray(a) * mass)
        )
        second.set_ylabel("tension per mass (N/kg)")


def failing_in(columns: Mapping[str, Any], chart: str, charts: Sequence[str]) -> Float[np.ndarray, "m 2"]:
    """Intervals in which criteria fail whose failures belong to one of several charts."""
    if "criterion_failing" not in columns:
        return np.reshape(columns.get("failing", ()), (-1, 2))
    shown = SHOWN.get(chart, Verdict.FEASIBLE)
    if chart == ("path" if "path" in charts else "tension"):
        others = [SHOWN[name] for name in charts if name in SHOWN and name != chart]
        shown = ~functools.reduce(operator.or_, others, Verdict.FEASIBLE)
    chosen = (np.asarray(columns["criterion_flag"]) & shown.value) != 0
    return united(np.asarray(columns["criterion_failing"])[chosen])
