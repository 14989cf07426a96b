"""Films of a motion: the robot in space with its cables coloured by tension, and its tensions over time."""

import hashlib
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, HTMLWriter
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Patch

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError
from cspr_jax.outputs.plots.films.gif import GifWriter
from cspr_jax.outputs.plots.films.moving_figure import MovingFigure
from cspr_jax.outputs.plots.motions.ends import draw_ends, entries_of_ends, segment_rows
from cspr_jax.outputs.plots.motions.motion import draw_limits, shade_failing
from cspr_jax.outputs.plots.motions.trajectory import add_tension_bar, name_spools
from cspr_jax.outputs.plots.robots.obstacles import AREA, draw_bodies, points_of
from cspr_jax.outputs.plots.robots.robot_along import Moving, limits_of, moving
from cspr_jax.outputs.plots.style.fitting import fit, legend_above
from cspr_jax.outputs.plots.style.labels import COLOURS, cable_names, line_style
from cspr_jax.outputs.plots.style.scene import colours_of_tension, fill_panels, set_space, shape_of
from cspr_jax.runtime.stages import stage
from cspr_jax.schema.quantities import FAILURES

ENDINGS = (".gif", ".mp4", ".html")
RANDOM = re.compile(rb"_anim_img([0-9a-f]{32})")
# Pictures per second: a film has the first of these rates with which its pictures are not too many, else the last one.
# The delays of a GIF are multiples of a hundredth of a second.
RATES = (20, 10, 5, 2, 1)
LARGEST_COUNT, OF_PAGES = 600, 150  # largest numbers of pictures of a film, and of a page, which stores each in full
FIGURE_SIZE, DPI = (10.0, 7.2), 90
# Height over width below which the robot is drawn above its tensions instead of beside them.
WIDE = 0.85
# MB; browsers hardly open larger pages.
LARGEST = 100.0
TIME_COLOUR = "#D55E00"
# White box behind the clock, so that no lines cross its digits.
BEHIND = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}


def film(
    ending: str,
    title: str,
    columns: Mapping[str, np.ndarray],
    robot_file: RobotFile,
    plan_file: PlanFile,
    speed: float = 1.0,
) -> bytes:
    """A film of a motion."""
    if ending not in ENDINGS:
        raise InputError("--animate", ending or "no ending", f"a file that ends in {', '.join(ENDINGS)}")
    if not 0.0 < speed < np.inf:
        raise InputError("--speed", speed, "a number > 0")
    time = np.asarray(columns["t"], float)
    seconds = float(time[-1] - time[0]) / speed
    maximum = OF_PAGES if ending == ".html" else LARGEST_COUNT
    rate = next((rate for rate in RATES if seconds * rate <= maximum), RATES[-1])
    # The last picture shows the end, less than the time of a picture too late.
    count = int(np.ceil(seconds * rate - 1e-9)) + 1
    times = np.minimum(time[0] + np.arange(count) * speed / rate, time[-1])
    rows = np.clip(np.searchsorted(time, times - 1e-9), 0, len(time) - 1)
    writer = _writer(ending, rate)
    stage("film")
    picture = _Picture(title, columns, robot_file, plan_file, rows)
    with tempfile.TemporaryDirectory() as folder, matplotlib.rc_context(rc=_settings(ending)):
        path = Path(folder) / f"film{ending}"
        with writer.saving(picture.figure, str(path), DPI):
            for number in range(count):
                picture.show(number)
                writer.grab_frame()
        return _named_by_content(path.read_bytes()) if ending == ".html" else path.read_bytes()


def _named_by_content(page: bytes) -> bytes:
    # matplotlib names parts of a page at random: the same film must have the same bytes, two films different names.
    match = RANDOM.search(page)
    if match is None:
        return page
    content = hashlib.sha256(page.replace(match[1], b"")).hexdigest()[: len(match[1])]
    return page.replace(match[1], content.encode())


def _settings(ending: str) -> Any:
    settings = {"animation.embed_limit": LARGEST, "savefig.bbox": "standard"}
    if ending == ".mp4":
        settings["animation.ffmpeg_path"] = _encoder()
    return settings


def _encoder() -> str:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise InputError("imageio-ffmpeg", "absent", 'installed: pip install "cspr_jax[film]"') from error
    return str(imageio_ffmpeg.get_ffmpeg_exe())


def _writer(ending: str, rate: int) -> AbstractMovieWriter:
    if ending == ".gif":
        return GifWriter(fps=rate)
    if ending == ".html":
        return HTMLWriter(fps=rate, embed_frames=True, default_mode="loop")
    _encoder()
    # Every player knows this codec and this pixel format.
    return FFMpegWriter(fps=rate, codec="libx264", extra_args=["-pix_fmt", "yuv420p"])


class _Picture:
    # The figure, whose moving artists are updated for each row.

    def __init__(
        self,
        title: str,
        columns: Mapping[str, np.ndarray],
        robot_file: RobotFile,
        plan_file: PlanFile,
        rows: np.ndarray,
    ) -> None:
        all_rows = np.arange(len(columns["t"]))
        self.robot, self._path = (
            moving(columns, robot_file, rows, plan_file),
            moving(columns, robot_file, all_rows).position,
        )
        self._bodies, self._failing = plan_file.bodies, {name: columns[name] for name in FAILURES if name in columns}
        self._flight_time, self._flight = columns.get("flight_t", np.empty(0)), columns.get("flight_position")
        self._columns = columns
        self._rows, self._time = rows, np.asarray(columns["t"], float)
        self.tension = np.asarray(columns["tension"], float)
        self._names = cable_names(columns)
        finite = self.tension[np.isfinite(self.tension)]
        self._largest = float(finite.max(initial=0.0)) or 1.0
        self._norm = Normalize(0.0, self._largest)
        self._colours = colours_of_tension()
        self.figure = MovingFigure(figsize=FIGURE_SIZE, layout="constrained")
        points = self._drawn_points()
        # A wide robot gets the full width, a high one the full height.
        if shape_of(points) < WIDE:
            grid = self.figure.add_gridspec(2, 1, height_ratios=[1.0, 0.36])
        else:
            grid = self.figure.add_gridspec(1, 2, width_ratios=[1.0, 0.8])
        self._space: Any = self.figure.add_subplot(grid[0], projection="3d", computed_zorder=False)
        self._draw_space(points, is_down=robot_file.z_axis == "down")
        self._draw_tensions(self.figure.add_subplot(grid[1]), limits_of(robot_file, plan_file))
        self.figure.suptitle(title)
        # Lay the figure out once, since its axes do not move.
        self.show(0)
        fit(self.figure)
        fill_panels(self.figure)
        of_cables = [*self.cables, *self._edges, self._mass]
        self.figure.draw_background([self._flown, self.object, self._behind, *of_cables, self._mark, self._clock], DPI)

    def _drawn_points(self) -> np.ndarray:
        of_robot = [self.robot.cable_points.reshape(-1, 3), self.robot.corners.reshape(-1, 3)]
        flight = np.empty((0, 3)) if self._flight is None else self._flight
        return np.concatenate([*of_robot, self._path, flight, *map(points_of, self._bodies)])

    def _draw_space(self, points: np.ndarray, *, is_down: bool) -> None:
        space, robot = self._space, self.robot
        set_space(space, points, is_down=is_down)
        draw_bodies(space, self._bodies, is_down=is_down)
        space.plot(*self._path.T, color="0.7", linewidth=0.8)
        name_spools(space, robot.base)
        ends = segment_rows(self._columns, self._time)
        draw_ends(space, self._path, ends)
        # The released object, and its path since the release.
        self._flown = space.plot([], [], [], color=COLOURS[2], linewidth=1.4, linestyle="--")[0]
        self.object = space.plot([], [], [], linestyle="", marker="o", markersize=6, color=COLOURS[2])[0]
        if self._flight is not None:
            self._flown.set_label("flight")
        handles, words = space.get_legend_handles_labels()
        entries = entries_of_ends(ends) | dict(zip(words, handles, strict=True))
        if self._bodies:
            entries["obstacles"] = Patch(**AREA)
        self.figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=len(entries))
        self._behind = space.plot([], [], [], color="black", linewidth=1.1)[0]
        space.plot(*robot.base.T, linestyle="", marker="s", markersize=5, color="0.35", label="spools, by cable")
        self.cables = [space.plot([], [], [], linewidth=2.0)[0] for _ in robot.base]
        self._edges = [space.plot([], [], [], color="black", linewidth=2.0)[0] for _ in range(self._edge_count)]
        self._mass = space.plot([], [], [], linestyle="", marker="o", markersize=6, color="black")[0]
        self._mass.set_visible(not self._edge_count)
        add_tension_bar(self.figure, space, ScalarMappable(self._norm, self._colours))

    @property
    def _edge_count(self) -> int:
        return self.robot.corners.shape[1] // 2

    def _draw_tensions(self, panel: Any, limits: list[tuple[str, float]]) -> None:
        for k, values in enumerate(self.tension.T):
            panel.plot(self._time, values, linewidth=1.2, label=self._names[k], **line_style(k))
        draw_limits(panel, limits, self.tension, "N")
        shade_failing(panel, self._failing, "tension")
        self._mark = panel.axvline(self._time[0], color=TIME_COLOUR, linewidth=1.8)
        panel.set(xlabel="time (s)", ylabel="tension (N)")
        panel.margins(x=0.01)
        panel.set_ylim(bottom=min(0.0, float(np.nanmin(self.tension))))
        legend_above(panel, len(panel.get_legend_handles_labels()[0]))
        self._clock = panel.annotate("", (0.99, 0.98), xycoords="axes fraction", ha="right", va="top", bbox=BEHIND)

    def show(self, number: int) -> None:
        """Move everything to a row."""
        row = self._rows[number]
        robot: Moving = self.robot
        for k, cable in enumerate(self.cables):
            cable.set_data_3d(*robot.cable_points[number, k].T)
            cable.set_color(self._colours(self._norm(self.tension[row, k])))
        for k, edge in enumerate(self._edges):
            edge.set_data_3d(*robot.corners[number, 2 * k : 2 * k + 2].T)
        self._mass.set_data_3d(*robot.position[number][:, None])
        self._behind.set_data_3d(*self._path[: row + 1].T)
        time = float(self._time[row])
        if self._flight is not None and time >= self._flight_time[0]:
            position = [np.interp(time, self._flight_time, values) for values in self._flight.T]
            behind = self._flight[self._flight_time < time]
            self._flown.set_data_3d(*np.vstack([behind, position]).T)
            self.object.set_data_3d(*np.transpose([position]))
        self._mark.set_xdata([time, time])
        self._clock.set_text(f"t = {time:.2f} s")
