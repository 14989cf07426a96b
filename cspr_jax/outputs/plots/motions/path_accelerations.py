"""Acceleration along straight lines over the path, with its feasible range, Boralugoda figure 4.1."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.outputs.plots.motions.motion import doubt
from cspr_jax.outputs.plots.motions.motion_source import robot_and_plan
from cspr_jax.outputs.plots.style.labels import COLOURS, PANELS, chosen, robot_name
from cspr_jax.outputs.plots.style.layout import columns_of, panels
from cspr_jax.store.reading.result import Result

# Bounds beyond this multiple of the largest acceleration of the motion are outside of the picture.
BEYOND = 2.5


class PathSamples(NamedTuple):
    """A line of a plan.

    Fields:
        number: number of the segment, from 1 on.
        length: length of the line, m.
        duration: s.
        s: (n,) fraction of the path at each row.
        rates: (n, 3) s'': smallest feasible value, value of the motion, and largest feasible value, 1/s^2.
    """

    number: int
    length: float
    duration: float
    s: np.ndarray
    rates: np.ndarray


def path_figure(result: Result, file: str) -> Figure:
    """The acceleration along each line of a motion over the path, for at most six lines."""
    robot_file, plan_file = robot_and_plan(result, file, "path_acceleration")
    paths = _paths(result, robot_file, plan_file)
    shown = [paths[k] for k in chosen(len(paths), PANELS)]
    columns = columns_of(len(shown))
    rows = -(-len(shown) // columns)
    figure_size = (6.8, 4.8) if len(shown) == 1 else (3.8 * columns + 0.6, 3.3 * rows + 1.2)
    figure = Figure(figsize=figure_size, layout="constrained")
    axes, bottom, left = panels(figure, len(shown), same=False)
    for panel, path in zip(axes, shown, strict=True):
        _draw(panel, path, plan_file.max_acceleration)
        panel.set_title(f"segment {path.number}: {path.length:.4g} m in {path.duration:.4g} s")
    for panel in bottom:
        panel.set_xlabel("part of the way s")
    for panel in left:
        panel.set_ylabel("acceleration s'' (1/s²)")
    handles = {
        words: artist for panel in axes for artist, words in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3 if len(shown) == 1 else 5)
    figure.suptitle(f"{robot_name(result)}: acceleration along straight lines{doubt(result)}")
    return figure


def _paths(result: Result, robot_file: RobotFile, plan_file: PlanFile) -> list[PathSamples]:
    time, ends = result.axes["t"], _poses(result, robot_file, plan_file)
    starts, waypoints = (result.data.get(f"segment_{name}", np.empty(0)) for name in ("start", "end"))
    if len(ends) != len(starts) + 1:
        raise InputError("--quantity", "path_acceleration", "must be of a plan", problem="the plan has other segments")
    first = [_first_row(time, start) for start in starts] + [len(time)]
    paths = []
    for k, (start, stop) in enumerate(zip(starts, waypoints, strict=True)):
        rows, line = slice(first[k], first[k + 1]), ends[k + 1] - ends[k]
        length = float(np.linalg.norm(line))
        if not length > 0.0 or first[k] == first[k + 1]:
            continue
        s = (result.data["position"][rows] - ends[k]) @ line / length**2
        paths.append(
            PathSamples(k + 1, length, float(stop - start), s, result.data["path_acceleration"][rows] / length)
        )
    if not paths:
        raise InputError("--quantity", "path_acceleration", "must be of a longer one", problem="a motion without rows")
    return paths


def _poses(result: Result, robot_file: RobotFile, plan_file: PlanFile) -> np.ndarray:
    # Positions (n, 3) of the poses as in the file; a rest pose without a position is P0.
    frame, depth = frame_of(robot_file.base_points, robot_file.z_axis), result.attributes.get("z0", np.nan)
    rest = frame.outward(np.array([0.0, 0.0, depth]))
    return np.array([rest if pose.position is None else pose.position for pose in plan_file.pose])


def _first_row(time: np.ndarray, start: float) -> int:
    # There are two rows where segments meet: the first one belongs to the segment before.
    rows = np.searchsorted(time, start + np.array([-1e-12, 1e-12]) * max(abs(start), 1.0), "left")
    return int(rows[0] + (rows[1] - rows[0]) // 2)


def _draw(panel: Axes, path: PathSamples, max_acceleration: float | None) -> None:
    minimum, actual, largest = path.rates.T
    far = BEYOND * (np.abs(actual).max() or 1.0)
    low, high = (np.clip(bound, -2.0 * far, 2.0 * far) for bound in (minimum, largest))
    panel.fill_between(path.s, low, high, color=COLOURS[5], alpha=0.3, linewidth=0.0, label="feasible")
    panel.plot(path.s, low, color=COLOURS[1], linewidth=1.3, linestyle="--", label="least feasible")
    panel.plot(path.s, high, color=COLOURS[0], linewidth=1.3, linestyle="-.", label="largest feasible")
    panel.plot(path.s, actual, color="black", linewidth=1.6, label="of the motion")
    panel.axhline(0.0, color="black", linewidth=0.8)
    rates = np.concatenate([low, actual, high])
    bottom, top = max(1.1 * np.nanmin(rates), -far), min(1.1 * np.nanmax(rates), far)
    for sign in (1.0, -1.0):
        level = np.nan if max_acceleration is None else sign * max_acceleration / path.length
        if bottom < level < top:
            panel.axhline(level, color=COLOURS[3], linewidth=1.2, linestyle=":", label="largest allowed")
    panel.set(xlim=(0.0, 1.0), ylim=(bottom, top))
    panel.grid(alpha=0.3)

    def outward(rate: ArrayLike) -> np.ndarray:
        return np.asarray(rate) * path.length

    def inward(acceleration: ArrayLike) -> np.ndarray:
        return np.asarray(acceleration) / path.length

    panel.secondary_yaxis("right", functions=(outward, inward)).set_ylabel("acceleration (m/s²)")
