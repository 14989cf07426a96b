"""Pictures of results from Python, as `cspr plot` draws them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from matplotlib.figure import Figure

from cspr_jax.api.arguments.checks import ResultOrResults, RobotOrFileOrNone, checked
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.arguments import Coordinates, Names, PictureSize
from cspr_jax.outputs.plots.draw import drawn
from cspr_jax.outputs.plots.motions.motion_source import completed
from cspr_jax.outputs.plots.selection import is_own_motion, result_at
from cspr_jax.outputs.plots.style.style import Style, in_style, laid_out, rendered, style_of
from cspr_jax.runtime.stages import stage
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import check_writable, publish
from cspr_jax.store.reading.result import Result, open_result

if TYPE_CHECKING:
    from cspr_jax.robots.cables import AnyRobot


@checked()
def plot(  # noqa: PLR0913
    results: ResultOrResults,
    *,
    quantity: str | None = None,
    at: Coordinates | None = None,
    best: Names = (),
    lines: str | None = None,
    envelope: bool = False,
    solid: bool = False,
    ratio: bool = False,
    size: PictureSize | None = None,
    dpi: float | None = None,
    font_size: float | None = None,
    preset: str | None = None,
    title: bool = True,
    plan: str | Path | None = None,
    robot: RobotOrFileOrNone = None,
    z_axis: Literal["down", "up"] | None = None,
    output: str | Path | None = None,
) -> Figure:
    """Draw one result, or several in one picture: maps as lines, workspaces as outlines, motions over time.

    Args:
        results: a result of `open_result`, or the path of a result, a run directory or a motion file; or several of
            them.
        quantity: map: a quantity; None: "arcs", or the first available one. Motion: "trajectory", the path in space;
            "tensions", with their limits; "summary", all on one page; "acceleration", with the feasible ones at the
            time `at` (None: that of the smallest margin); "path_acceleration", over the path, of straight lines; or
            "landing", of a sample of throws; None: path and tensions over time.
        at: map: fixed values of axes, within their ranges; the nearest point is taken. Motion: the time "t", s.
        best: map: axes for which each cell shows the best point, such as "z0"; see `Result.best`. The quantity
            "best_z0" is that point.
        lines: axis whose points become lines; None: sections, or a single line.
        envelope: whether to draw all orientations at one position, in three dimensions.
        solid: whether to draw the boundary of a workspace over x, y and z, with its robot, in three dimensions.
        ratio: whether to draw the ratio of the quantity of the first of two maps to that of the second, on equal cells.
        size: width and height, cm, as (16, 10) or "16x10"; None: the usual size of the picture.
        dpi: pixels per inch of a file; None: 160.
        font_size: size of the font, points; None: 10.
        preset: "column", 8.89 cm wide, or "page", 17.5 cm wide, for papers, or "column elsevier", "page ieee", "column
            8.5cm" and the like; the height is adapted. None: no preset.
        title: whether to draw titles; a motion that is not proved feasible is marked in any case.
        plan: plan file of motions in CSV files, which store neither robot nor limits; None: no plan.
        robot: instead of `plan`, the robot of motions in CSV files, as for `check`; None: no robot.
        z_axis: instead of both, the direction of z in such files, "up" or "down"; None: as in robot or plan, else
            guessed.
        output: picture to write; its ending selects the format. None: nothing is written.

    Returns:
        the figure of matplotlib.

    Raises:
        StoreError: a file cannot be read, or the picture cannot be written.
        ConfigError: an unknown quantity or axis, nothing to draw, a size out of range, or an unknown picture format.
    """
    sources = [results] if isinstance(results, str | Path | Result) else list(results)
    if not sources:
        raise ConfigError("results", "[]: must be one result, or more")
    style = style_of(size, dpi, font_size, preset, title=title)
    check_writable(None if output is None else Path(output))
    stage("reading")
    files = [one if isinstance(one, Result) else result_at(Path(one)) for one in sources]
    names = [f"result {i + 1}" if isinstance(one, Result) else str(one) for i, one in enumerate(files)]
    beside = sources_beside(plan, robot, z_axis)
    loaded = [_opened(one, name, beside) for one, name in zip(files, names, strict=True)]

    def draw() -> Figure:
        given_at = None if at is None else dict(at)
        shown = [one.best(*names_of(best)) for one in loaded] if best else loaded
        return drawn(
            shown, names, quantity=quantity, at=given_at, lines=lines, envelope=envelope, solid=solid, ratio=ratio
        )

    return finished(draw, names[0], style, output)


def sources_beside(plan: str | Path | None, robot: AnyRobot | str | Path | None, z_axis: str | None) -> dict[str, Any]:
    """Robot, plan or axes that belong to motions in CSV files."""
    sources = {"--plan": plan, "--robot": robot, "--z-axis": z_axis}
    options = [option for option, value in sources.items() if value is not None]
    if len(options) > 1:
        raise ConfigError(options[1], f"must be absent with {options[0]}, which says it")
    spec = None
    if robot is not None:
        from cspr_jax.api.arguments.check_keys import check_keys

        spec = check_keys(robot, None)
    return {"plan": None if plan is None else Path(plan), "robot": spec, "z_axis": z_axis}


def _opened(source: Path | Result, name: str, beside: dict[str, Any]) -> Result:
    if isinstance(source, Result) or beside["robot"] is None or not is_own_motion(source):
        return completed(source if isinstance(source, Result) else open_result(source), name, **beside)
    from cspr_jax.api.checks import check_file  # only users' own motions need it

    return check_file(source, beside["robot"], outputs=["-o"]).plan.to_result()


def names_of(axes: str | Iterable[str]) -> list[str]:
    """Names of axes as a list; a single name may be given as text."""
    return [axes] if isinstance(axes, str) else list(axes)


def finished(draw: Callable[[], Figure], name: str, style: Style, output: str | Path | None) -> Figure:
    """A picture in the common style, written if `output` is given."""
    picture = None
    stage("drawing")
    try:
        with in_style(style):
            figure = draw()
            laid_out(figure, style)
            if output is not None:
                picture = rendered(figure, Path(output).suffix, style)
    except InputError as error:
        raise ConfigError(name, str(error)) from error
    except ValueError as error:
        raise ConfigError(output or name, str(error).splitlines()[0]) from error
    if picture is not None:
        publish(Disk(), Path(str(output)), picture)
    return figure
