"""Designs from Python: the best robot for what is asked of it, as by `cspr design`."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.files.pictured import Pictured
from cspr_jax.config.design import checked_design
from cspr_jax.config.reading import plain_values, read_toml
from cspr_jax.errors.arguments import File
from cspr_jax.outputs.designs.files import designed_text, write_design
from cspr_jax.outputs.designs.report import design_lines, design_object, design_table
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish
from cspr_jax.synthesis.results import DesignedRobot, DesignSearch, Setting
from cspr_jax.synthesis.run import run_design
from cspr_jax.synthesis.search import Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Errors and files name this where there is no file; paths are then relative to the current folder.
NAME = Path("design")
PAGE = "design.html"


@dataclasses.dataclass(frozen=True)
class Design(Pictured):
    """The robots that a design found.

    Fields:
        robot: name of the robot of the design file.
        directory: directory of its files.
        robots: the best robot, or those of the Pareto front, from the best by the first objective on: each with
            `parameters`, `arrangement`, `values`, `is_feasible`, `proofs`, `sensitivities` and `robot_file`.
    """

    robot: str
    directory: Path
    robots: tuple[DesignedRobot, ...]
    _search: DesignSearch

    @property
    def best(self) -> DesignedRobot:
        """The best robot by the first objective."""
        return self.robots[0]

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Settings with the fewest changes between tasks, and their robots; none without [reconfigure]."""
        return self._search.settings

    @property
    def alone(self) -> tuple[Setting, ...]:
        """The best setting for each task alone."""
        return self._search.alone

    @property
    def feasible(self) -> bool:
        """Tell whether the robots meet all requirements, with the proofs that are asked for."""
        return all(robot.is_feasible for robot in self.robots)

    def to_dict(self) -> dict[str, Any]:
        """The design as plain values, for JSON.

        Returns:
            what `cspr design --json` prints.
        """
        return design_object(self._search)

    def lines(self) -> list[str]:
        """The best robot in words: its numbers, proofs, and what holds its parameters."""
        return design_lines(self._search)

    def to_table(self) -> Any:
        """The robots as the table that `cspr design` prints.

        Returns:
            a table of the package rich.
        """
        return design_table(self._search)

    def to_toml(self, index: int = 0) -> str:
        """A robot as the text of a robot file."""
        return designed_text(self._search, self.robots[index])

    def _figure(self) -> Figure:
        from cspr_jax.outputs.plots.designs.figure import design_figure  # loads matplotlib

        return design_figure(self._search)


@checked()
def design(
    source: File,
    directory: str | Path | None = None,
    *,
    on_progress: Callable[[str], None] | None = None,
    stopped: Callable[[], bool] | None = None,
) -> Design:
    """Find the best robot among those that parameters and arrangements of the cables give.

    Args:
        source: path of a design file, or its content as a dictionary (parsed TOML). Paths in a dictionary are relative
            to the current folder.
        directory: where robots, evaluations, numbers and a page are written, and from where an earlier search goes
            on; None: results/<name of the file>.
        on_progress: called with a line at each stage.
        stopped: asked between evaluations whether to end with the best robot so far.

    Returns:
        the best robot, or of two objectives the Pareto front.

    Raises:
        ConfigError: a mistake in the design, its robot, maps or plans.
        RefusedError: the directory belongs to another design, or another process writes there.
        StoreError: a file cannot be written.
    """
    path = NAME if isinstance(source, Mapping) else Path(source)
    data = plain_values(source) if isinstance(source, Mapping) else read_toml(path)
    design_file, content = checked_design(data, path)
    folder = Path("results") / path.stem if directory is None else Path(directory)
    progress = Progress(on_progress or (lambda line: None), stopped or (lambda: False))
    search = run_design(design_file, content, path, folder, progress, lambda one: _write(one, folder))
    return Design(search.evaluator.space.robot_file.full.name, folder, search.robots, search)


def _write(search: DesignSearch, folder: Path) -> None:
    from cspr_jax.api.files.pictures import finished  # loads matplotlib
    from cspr_jax.outputs.plots.designs.figure import design_figure
    from cspr_jax.outputs.plots.designs.page import design_page
    from cspr_jax.outputs.plots.style.style import Style, in_style, rendered

    write_design(search, folder)
    figure = finished(lambda: design_figure(search), search.file.name, Style(), None)
    with in_style(Style()):
        picture = rendered(figure, ".svg", Style()).decode("utf-8")
    publish(Disk(), folder / PAGE, design_page(search, picture).encode("utf-8"))
