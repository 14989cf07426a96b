"""One page about a plan for a paper: the motion in space, tensions, rates of the cables, and a table of segments."""

import textwrap
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.outputs.plots.motions.motion import FAILS, boundaries, doubt, draw_limits, point_words, shade_failing
from cspr_jax.outputs.plots.motions.tensions import draw_tensions, extremes
from cspr_jax.outputs.plots.motions.trajectory import draw_trajectory, legend_of, points_in_space
from cspr_jax.outputs.plots.robots.robot_along import limits_of
from cspr_jax.outputs.plots.style.fitting import legend_above
from cspr_jax.outputs.plots.style.labels import cable_names, line_style, robot_name
from cspr_jax.outputs.plots.style.layout import is_narrow
from cspr_jax.outputs.plots.style.scene import shape_of
from cspr_jax.outputs.plots.style.word_ticks import reasons
from cspr_jax.schema.verdicts import NO_REASON
from cspr_jax.store.reading.result import Result

# Largest number of segments in the table, which shows the first ones of a longer plan.
SEGMENTS = 8
# Inches: height of a line of the table, on a page and in a column; width of the robot, and its smallest and largest
# height.
LINE, NARROW_LINE = 0.28, 0.44
ACROSS = 6.6
LOW = 3.0
HIGH = 6.4
HEADS = ("segment", "arcs", "duration (s)", "margin (N)", "verdict")
# Widths of the table's columns as fractions, and number of letters of a line of the verdict, on a page and in a column.
WIDE, NARROW = ((0.14, 0.1, 0.2, 0.16, 0.4), 36), ((0.18, 0.1, 0.2, 0.18, 0.34), 14)


def summary_figure(result: Result, robot_file: RobotFile, plan_file: PlanFile) -> Figure:
    """The plan on a page."""
    cells = _cells(result)
    lines = sum(_lines(row) for row in cells)
    height = (NARROW_LINE if is_narrow() else LINE) * (lines + 1)
    space_height = float(np.clip(ACROSS * shape_of(points_in_space(result, robot_file, plan_file)), LOW, HIGH))
    figure = Figure(figsize=(7.2, 4.8 + space_height + height), layout="constrained")
    parts = figure.add_gridspec(4, 1, height_ratios=[space_height, 2.0, 1.6, height])
    space = figure.add_subplot(parts[0], projection="3d", computed_zorder=False)
    draw_trajectory(figure, space, result, robot_file, plan_file)
    figure.legend(*legend_of(result, plan_file), loc="outside lower center", ncols=6)
    over_time = figure.add_subplot(parts[1])
    draw_tensions(over_time, result, limits_of(robot_file, plan_file), ("tension", "rate"))
    legend_above(over_time, len(robot_file.base_points) + 5)
    _rates(figure.add_subplot(parts[2], sharex=over_time), result, limits_of(robot_file, plan_file, "speed"))
    if cells:
        _draw_table(figure.add_subplot(parts[3]), cells)
    words = f"{result.axes['t'][-1]:.4g} s{point_words(result.data)}\n{extremes(result)}{doubt(result)}"
    figure.suptitle(f"{robot_name(result)}: {words}")
    return figure


def _draw_table(panel: Axes, cells: list[list[str]]) -> None:
    # Fix the size of letters, which matplotlib would shrink until the narrowest column fits.
    panel.axis("off")
    heads = [head.replace(" (", "\n(") if is_narrow() else head for head in HEADS]
    widths, letters = NARROW if is_narrow() else WIDE
    bbox: Any = (0.0, 0.0, 1.0, 1.0)
    words = [[*row[:-1], "\n".join(textwrap.wrap(row[-1], letters))] for row in cells]
    table = panel.table(words, colLabels=heads, cellLoc="center", edges="horizontal", bbox=bbox, colWidths=widths)
    table.auto_set_font_size(False)
    table.set_fontsize(0.95 * rcParams["font.size"])
    for (row, _), cell in table.get_celld().items():
        cell.set_height(_lines(cells[row - 1]) if row else 1.0 + is_narrow())
        cell.PAD = 0.02


def _lines(row: list[str]) -> int:
    return len(textwrap.wrap(row[-1], (NARROW if is_narrow() else WIDE)[1])) or 1


def _rates(panel: Axes, result: Result, limits: list[tuple[str, float]]) -> None:
    names = cable_names(result.data)
    for k, values in enumerate(result.data["rate"].T):
        panel.plot(result.axes["t"], values, linewidth=1.0, label=names[k], **line_style(k))
    draw_limits(panel, limits, result.data["rate"], "m/s", signed=True)
    panel.axhline(0.0, color="black", linewidth=0.8)
    boundaries(panel, result)
    shade_failing(panel, result.data, "rate", ("tension", "rate"))
    panel.set(xlabel="time (s)", ylabel="cable speed (m/s)")
    # Leave out names of cables, which are above the tensions.
    entries = zip(*panel.get_legend_handles_labels(), strict=True)
    others = {words: handle for handle, words in entries if words not in (*names, FAILS)}
    if others:
        legend_above(panel, 2, list(others.values()), list(others))


def _cells(result: Result) -> list[list[str]]:
    data = result.data
    count = len(data.get("segment_end", ()))
    cells, margins = [], data.get("segment_tension_margin", np.full(count, np.nan))  # earlier versions stored none
    for k in range(min(count, SEGMENTS)):
        arcs, duration = int(data["segment_arcs"][k]), data["segment_end"][k] - data["segment_start"][k]
        margin = f"{margins[k]:.4g}" if np.isfinite(margins[k]) else "none"
        number = f"{k + 1}" if count <= SEGMENTS else f"{k + 1} of {count}"
        # Lines, Bezier segments and splines have no arcs; for a swing that is not feasible no number of arcs was found.
        arcs_text = f"{arcs}" if arcs else "none" if data["segment_tried_arcs"][k] else "-"
        cells.append([number, arcs_text, f"{duration:.4g}", margin, _verdict(data["segment_verdict"][k])])
    return cells


def _verdict(verdict: np.ndarray) -> str:
    # Write the first reason, and the number of others.
    numbers, words, _ = reasons(verdict[None], "feasible")
    others = (int(verdict) & ~NO_REASON.value).bit_count() - 1
    return words[int(numbers[0])] + (f", {others} more" if others > 0 else "")
