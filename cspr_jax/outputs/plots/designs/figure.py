"""Picture of a design: all robots that were evaluated, the best ones among them, and frames before and after."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cspr_jax.config.robot import RobotFile
from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.designs.report import unit_of
from cspr_jax.outputs.plots.robots.obstacles import draw_bodies
from cspr_jax.outputs.plots.robots.robot_at import hull_of
from cspr_jax.outputs.plots.style.labels import COLOURS
from cspr_jax.outputs.plots.style.scene import set_space
from cspr_jax.synthesis.results import DesignSearch

WIDTH, HEIGHT = 10.0, 4.6  # inches
MAX_FRAMES = 4  # beside that of the robot file
GREY, FAINT = "#9aa1a9", "#ccd1d6"
# Part of the range of numbers of feasible robots that is shown beyond them.
BEYOND = 0.15


def design_figure(search: DesignSearch) -> Figure:
    """Numbers of all robots on the left, the frames of the first and of the best robot on the right."""
    figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    panel = figure.add_subplot(grid[0])
    if search.settings:
        _over_tasks(panel, search)
    elif len(search.evaluator.objectives) == 2:
        _front(panel, search)
    else:
        _against_parameter(panel, search)
    handles = _frames(figure.add_subplot(grid[1], projection="3d"), search)
    figure.legend(handles=handles, loc="outside lower right", ncols=len(handles), fontsize="small")
    objectives = " and ".join(
        f"{'largest' if one.sense > 0 else 'smallest'} {one.name}" for one in search.evaluator.objectives
    )
    figure.suptitle(f"{search.evaluator.space.robot_file.full.name}: {objectives}")
    return figure


def _words(search: DesignSearch, i: int) -> str:
    question = search.questions[i]
    unit = unit_of(search, question)
    return question.name + (f" ({unit})" if unit else "")


def _front(panel: Axes, search: DesignSearch) -> None:
    values = np.array([one.values[:2] for one in search.evaluations])
    met = np.array([one.missed == 0.0 for one in search.evaluations])
    chosen = np.array([robot.values[:2] for robot in search.robots])
    _dots(panel, values[:, 0], values[:, 1], met)
    panel.plot(*chosen.T, "o-", color=COLOURS[1], markersize=5, linewidth=1.0, label="Pareto front")
    for robot, (x, y) in zip(search.robots, chosen, strict=True):
        panel.annotate(robot.name.removeprefix("front_"), (x, y), textcoords="offset points", xytext=(5, 5))
    panel.set(xlabel=_words(search, 0), ylabel=_words(search, 1))
    for axis, column in ((panel.set_xlim, 0), (panel.set_ylim, 1)):
        _zoom(axis, np.append(values[met, column], chosen[:, column]))
    panel.grid(alpha=0.25)
    panel.legend(loc="best", fontsize="small")


def _dots(panel: Axes, across: np.ndarray, up: np.ndarray, met: np.ndarray) -> None:
    # Robots that miss requirements, if there are some, behind those that meet them.
    for mask, colour, label in ((~met, FAINT, "requirements missed"), (met, GREY, "requirements met")):
        if mask.any():
            panel.plot(across[mask], up[mask], ".", color=colour, markersize=4, label=label)


def _zoom(set_limits: Any, values: np.ndarray) -> None:
    finite = values[np.isfinite(values)]
    if len(finite) and np.ptp(finite) > 0.0:
        margin = BEYOND * np.ptp(finite)
        set_limits(finite.min() - margin, finite.max() + margin)


def _against_parameter(panel: Axes, search: DesignSearch) -> None:
    # Values over the parameter that matters most, or over the rank where arrangements alone differ.
    values = np.array([one.values[0] for one in search.evaluations])
    met = np.array([one.missed == 0.0 for one in search.evaluations])
    name = _decisive(search, values)
    if name is None:
        at, best = np.argsort(np.argsort(-search.evaluator.objectives[0].sense * values)), 0.0
        panel.set_xlabel("rank")
    else:
        at, best = search.values_of(name), search.best.parameters[name]
        unit = next(one.unit for one in search.evaluator.space.variables if one.name == name)
        panel.set_xlabel(name + ("" if unit == "1" else f" ({unit})"))
    _dots(panel, at, values, met)
    panel.plot([best], [search.best.values[0]], "o", color=COLOURS[1], markersize=7, label="best")
    panel.set_ylabel(_words(search, 0))
    _zoom(panel.set_ylim, np.append(values[met], search.best.values[0]))
    panel.grid(alpha=0.25)
    panel.legend(loc="best", fontsize="small")


def _decisive(search: DesignSearch, values: Float[np.ndarray, "n"]) -> str | None:
    # Name of the parameter whose ranks go most with those of the values; None without parameters.
    finite, ranks = np.isfinite(values), np.argsort(np.argsort(values))
    names = search.evaluator.space.names
    if not names:
        return None
    strengths = []
    for name in names:
        ranks_of_name = np.argsort(np.argsort(search.values_of(name)[finite]))
        strengths.append(abs(float(np.corrcoef(ranks_of_name, ranks[finite])[0, 1])) if finite.sum() > 2 else 0.0)
    return names[int(np.nan_to_num(strengths).argmax())]


def _frames(panel: Any, search: DesignSearch) -> list[Line2D]:
    first = search.evaluator.space.robot_file.full
    robots = [(setting.name, setting.robot_file) for setting in search.settings]
    robots = robots or [(robot.name, robot.robot_file) for robot in (search.robots[0], search.robots[-1])]
    drawn = {"robot file": first} | dict(robots[:MAX_FRAMES])
    colours = [GREY, *(COLOURS[(k + 1) % len(COLOURS)] for k in range(len(drawn) - 1))]
    widths = [1.0, *(1.6 for _ in colours[1:])]
    shapes = [_draw(panel, *one) for one in zip(drawn.values(), colours, widths, strict=True)]
    is_down = first.z_axis == "down"
    set_space(panel, np.concatenate([*shapes, *_hall(panel, search, is_down=is_down)]), is_down=is_down)
    handles = [Line2D([], [], color=c, label=n.replace("_", " ")) for c, n in zip(colours, drawn, strict=True)]
    return handles


def _hall(panel: Any, search: DesignSearch, *, is_down: bool) -> list[np.ndarray]:
    # The walls of the hall and the bodies in it, drawn; corners of the walls.
    hall = search.design.hall
    if hall is None:
        return []
    draw_bodies(panel, [table.shape() for table in hall.obstacle or ()], is_down=is_down)
    if hall.corners is None:
        return []
    low, high = np.asarray(hall.corners, float)
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    for a, b in itertools.combinations(corners, 2):
        if (a != b).sum() == 1:
            panel.plot(*np.stack([a, b]).T, color=FAINT, linewidth=0.8)
    return [corners]


def _over_tasks(panel: Axes, search: DesignSearch) -> None:
    # Values of the parameters that are set anew, over the tasks: with the fewest changes, and for each task alone.
    tasks = [task for setting in search.settings for task in setting.tasks]
    names = search.design.reconfigure.parameters if search.design.reconfigure else []
    for k, name in enumerate(names):
        values = [setting.parameters[name] for setting in search.settings for _ in setting.tasks]
        panel.step(range(len(tasks)), values, where="mid", color=COLOURS[k % len(COLOURS)], linewidth=1.6, label=name)
        alone = {setting.tasks[0]: setting.parameters[name] for setting in search.alone}
        panel.plot(range(len(tasks)), [alone[task] for task in tasks], "o", color=COLOURS[k % len(COLOURS)], mfc="none")
    panel.plot([], [], "o", color="black", mfc="none", label="each task alone")
    units = {one.unit for one in search.evaluator.space.variables} - {"1"}
    panel.set(xlabel="task", ylabel="value" + (f" ({units.pop()})" if len(units) == 1 else ""))
    panel.set_xticks(range(len(tasks)), tasks)
    panel.margins(0.12)
    panel.grid(alpha=0.25)
    panel.legend(loc="best", fontsize="small")


def _draw(panel: Any, robot_file: RobotFile, colour: str, width: float) -> np.ndarray:
    # The spools with edges of their hull, and the platform below their centroid, with its cables.
    spools = np.asarray(robot_file.base_points, float)
    sign = 1.0 if robot_file.z_axis == "down" else -1.0
    centre = spools.mean(0) + np.array([0.0, 0.0, sign * 0.5 * np.ptp(spools[:, :2], axis=0).max()])
    body = (
        np.zeros_like(spools) if robot_file.platform_points is None else np.asarray(robot_file.platform_points, float)
    )
    attached = centre + body
    for edge in hull_of(spools)[1]:
        panel.plot(*edge.T, color=colour, linewidth=width)
    for edge in hull_of(attached)[1] if robot_file.is_platform else ():
        panel.plot(*edge.T, color=colour, linewidth=width)
    for cable in zip(spools, attached, strict=True):
        panel.plot(*np.array(cable).T, color=colour, linewidth=0.6, linestyle="--")
    panel.plot(*spools.T, "o", color=colour, markersize=4)
    panel.plot(*attached.T, ".", color=colour, markersize=4)
    return np.concatenate([spools, attached])
