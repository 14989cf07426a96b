"""Pages to explore results and plans in a browser, from Python, as by `cspr report`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from cspr_jax.api import plans
from cspr_jax.api.arguments.checks import RobotOrFileOrNone, checked
from cspr_jax.api.checks import check_file
from cspr_jax.api.files.pictures import names_of, sources_beside
from cspr_jax.api.plans import Plan
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.arguments import AnyInteger, CellCoordinates, Kind, Names
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs import motion_files
from cspr_jax.outputs.paths import path_columns
from cspr_jax.outputs.plots.motions.motion_source import completed, keeps_plan, robot_and_plan
from cspr_jax.outputs.plots.pages.maps import informative_cells, map_content, order_of
from cspr_jax.outputs.plots.pages.motions import MAX_ROWS, motion_content
from cspr_jax.outputs.plots.pages.page import page_of
from cspr_jax.outputs.plots.pages.solids import solids_content
from cspr_jax.outputs.plots.selection import is_own_motion, nearest, result_at
from cspr_jax.outputs.plots.style.fitting import shortened
from cspr_jax.outputs.plots.style.labels import heading, robot_name, value
from cspr_jax.plans.cell_plan import cell_plan
from cspr_jax.runtime.stages import stage
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import check_writable, publish
from cspr_jax.store.reading.result import Result, open_result

ResultOrPlan = Annotated[
    str | Path | Result | Plan, Kind("a result, a plan, or the path of one", (str, os.PathLike), ("to_xarray",))
]
USUAL, MAX_TRAJECTORIES = 50, 500  # number of motions of cells, by default and at most
RATE = 60.0  # rows per second for the motion of a plan
STEP = 100  # the number of rows is rounded up to a multiple of this


@checked()
def report(
    given: ResultOrPlan,
    output: str | Path,
    *,
    trajectories: AnyInteger = USUAL,
    cells: CellCoordinates = (),
    quantity: str | None = None,
    best: Names = (),
    plan: str | Path | None = None,
    robot: RobotOrFileOrNone = None,
    z_axis: Literal["down", "up"] | None = None,
) -> list[str]:
    """Write a page to explore a map or a plan in a browser: one file that needs no network.

    For a map the page shows sections with sliders over the other axes, the values of each cell, and the motions of
    chosen cells; for a plan its motion.

    Args:
        given: path of a result of `cspr run`, of its run directory, of a motion of `cspr plan -o` or of a plan file; or
            a loaded result or plan.
        output: page to write, .html.
        trajectories: map: number of cells whose motions are included in addition to `cells`: the most informative ones.
        cells: map: further cells whose motions are included, by coordinates for each axis; the nearest point is taken.
            Axes without a coordinate are at their first point.
        quantity: map: quantity to show first; None: the main quantity of its kind of map.
        best: map: axes for which each cell shows the best point, such as "z0", as in `plot`.
        plan: plan file of a motion in a CSV file, which stores neither robot nor limits; None: no plan.
        robot: instead of `plan`, the robot of a motion in a CSV file, as for `check`; None: no robot.
        z_axis: instead of both, the direction of z in the file, "up" or "down"; None: as in robot or plan, else
            guessed.

    Returns:
        warnings, one line each.

    Raises:
        ConfigError: a mistake in a file or an argument, or plotly is not installed.
        StoreError: a file cannot be read, or the page cannot be written.
    """
    output = Path(output)
    if output.suffix != ".html":
        raise ConfigError("-o", f"{output}: must end in .html")
    check_writable(output)
    if not 0 <= trajectories <= MAX_TRAJECTORIES:
        raise ConfigError("--trajectories", f"{trajectories}: must be an integer from 0 to {MAX_TRAJECTORIES}")
    try:
        beside = sources_beside(plan, robot, z_axis)
        loaded = _loaded(given, beside["robot"])
        if isinstance(loaded, Result):
            loaded = completed(loaded, str(given), **beside)
        elif not _is_own(given, beside["robot"]) and any(value is not None for value in beside.values()):
            option = next(name for name, value in beside.items() if value is not None)
            raise InputError(f"--{option.replace('_', '-')}", "given", "absent but with a motion in CSV")
        if isinstance(loaded, Result) and loaded.is_map:
            shown = loaded.best(*names_of(best))
            title, content, warnings = _of_map(shown, trajectories, cells, quantity)
        elif cells or best or quantity is not None:
            raise InputError(
                "--cell" if cells else "--best" if best else "--quantity", "given", "absent but with a map"
            )
        else:
            title, content, warnings = _of_motion(loaded, str(given))
        page = page_of(title, content)
    except InputError as error:
        raise ConfigError(given if isinstance(given, str | Path) else "report", str(error)) from error
    publish(Disk(), output, page.encode())
    return warnings


def _is_own(source: str | Path | Result | Plan, spec: dict[str, Any] | None) -> bool:
    # Tell whether the page is for a user's own motion, with its robot.
    if spec is None or isinstance(source, Result | Plan) or Path(source).suffix == ".toml":
        return False
    return is_own_motion(Path(source))


def _loaded(source: str | Path | Result | Plan, spec: dict[str, Any] | None) -> Result | Plan:
    if isinstance(source, Result | Plan):
        return source
    path = Path(source)
    if spec is not None and _is_own(source, spec):
        return check_file(path, spec, outputs=["-o"]).plan
    if path.suffix == ".toml":
        return plans.plan(path)
    stage("reading")
    return open_result(result_at(path))


def _of_motion(motion: Result | Plan, name: str) -> tuple[str, dict[str, Any], list[str]]:
    if isinstance(motion, Plan):
        robot, content, feasible = shortened(motion.robot_file.name), _planned(motion, "motion"), motion.feasible
    else:
        robot_file, spec = robot_and_plan(motion, name, "report") if keeps_plan(motion) else (None, None)
        robot, columns = robot_name(motion), motion.axes | motion.data
        content = motion_content(
            "motion", columns, motion.data, robot_file, spec, motion.attributes.get("z_axis", "down")
        )
        feasible = bool(motion.attributes.get("feasible", 1))
    doubt = "" if feasible else "not proved feasible"
    page: dict[str, Any] = {
        "title": f"Motion of {robot}",
        "notes": doubt,
        "map": None,
        "motions": [content],
        "cells": {},
    }
    return page["title"], page, ["not proved feasible; the page says so"] if doubt else []


def _planned(planned: Plan, title: str) -> dict[str, Any]:
    with double_precision():
        length = float(np.sum(planned.answers.duration))
        # Give motions of similar length the same number of rows, so that they share compiled code.
        rate = STEP * np.ceil(min(RATE * length, MAX_ROWS) / STEP) / length
        columns = motion_files.rows(planned, rate=float(rate))
        columns |= planned.outcome_columns | motion_files.failures(planned) | path_columns(planned)
        return motion_content(title, columns, motion_files.segments(planned), planned.robot_file, planned.keys)


def _of_map(
    result: Result, count: int, cells: Sequence[Mapping[str, float]], quantity: str | None
) -> tuple[str, dict[str, Any], list[str]]:
    content, left = map_content(result, quantity)
    indices = [
        tuple(nearest(result, axis, chosen)[0] for axis, chosen in _cell_axes(result, cell).items()) for cell in cells
    ]
    warnings = [f"left out, for a page of all would be too large: {', '.join(left)}"] if left else []
    if MAP_KINDS[result.attributes["map"]].planned and "verdict" in result.data:
        indices += informative_cells(result.data, result.data["verdict"], count)
    elif cells:
        raise InputError("--cell", "given", f'absent with map = "{result.attributes["map"]}", whose cells do not move')
    names, points = order_of(result)
    motions, motion_of_cell = list[dict[str, Any]](), dict[str, int]()
    for index in dict.fromkeys(indices):
        planned = _cell(result, index)
        if planned is None:
            warnings.append(f"{_words(result, index)}: no motion, its numbers are not finite")
            continue
        coordinates = dict(zip(result.axes, index, strict=True))
        # If an axis has the same point twice, the page shows the first.
        same = [_rank(result.axes[name], chosen, coordinates[name]) for name, chosen in zip(names, points, strict=True)]
        motion_of_cell[str(int(np.ravel_multi_index(same, content["shape"])))] = len(motions)
        motions.append(planned)
    first = next(iter(motion_of_cell), None)
    content["first"] = _first(content["shape"], first)
    title = heading(result, quantity or content["quantities"][0]["name"])
    page = {
        "title": title,
        "map": content,
        "solid": solids_content(result, names, points),
        "motions": motions,
        "cells": motion_of_cell,
        "shown": motion_of_cell.get(first or "", 0),
    }
    return title, page, warnings


def _first(shape: list[int], flat: str | None) -> list[int]:
    if flat is None:
        return [0] * (len(shape) - 2) + [count // 2 for count in shape[-2:]]
    return [int(i) for i in np.unravel_index(int(flat), shape)]


def _rank(points: np.ndarray, chosen: np.ndarray, cell: int) -> int:
    return int(np.searchsorted(points[chosen], points[cell]))


def _cell_axes(result: Result, cell: Mapping[str, float]) -> dict[str, float]:
    for axis, coordinate in cell.items():
        nearest(result, axis, coordinate, "--cell")  # refuses unknown axes
    return {axis: float(cell.get(axis, points[0])) for axis, points in result.axes.items()}


def _words(result: Result, index: tuple[int, ...]) -> str:
    points = result.axes | {axis: choice.points for axis, choice in result.choices.items()}
    cell = result.coordinates(index)
    return ", ".join(value(result, axis, cell[axis]) for axis, coordinates in points.items() if len(coordinates) > 1)


def _cell(result: Result, index: tuple[int, ...]) -> dict[str, Any] | None:
    cell = result.coordinates(index)
    values = {name: data[index] for name, data in result.data.items()}
    spec = cell_plan(result.settings, cell, values)
    if spec is None:
        return None
    stage("motions of cells")
    planned = plans.plan(spec)
    if not np.isfinite(planned.answers.duration).all():
        return None
    return _planned(planned, _words(result, index))
