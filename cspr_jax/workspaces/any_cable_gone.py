"""Maps of what is left of a workspace when any one cable is gone: the workspaces without each cable in turn, in common.

Each robot without a cable has kernels' axes of its own, so each gets a whole map; their answers meet in the axes of the
grid.
"""

from collections.abc import Callable

import numpy as np

from cspr_jax.config.missing_cables import ANY_ONE, without_cables
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError
from cspr_jax.maps.grid_map import GridMap
from cspr_jax.schema.tiles import Grid
from cspr_jax.schema.verdicts import conjunction
from cspr_jax.workspaces.map import FREQUENCY, MARGINS, WorkspaceMap

INSIDE, OUTSIDE = 1, 2  # sides of proved cells, as in `schema.meanings.CELL_SIDES`


class AnyCableGone(GridMap):
    """The map of a robot that has lost any one of its cables; see `GridMap`."""

    def __init__(
        self,
        make: Callable[[RobotFile, SweepFile, object], WorkspaceMap],
        robot_file: RobotFile,
        spec: SweepFile,
        file: object,
    ) -> None:
        """Make the map of the robot without each cable."""
        robots = []
        for i in range(len(robot_file.base_points)):
            try:
                robots.append(without_cables(robot_file, [i], file))
            except ConfigError as error:
                words = str(error).replace(f"without = [{i}]", f'without = "{ANY_ONE}": without cable {i + 1}', 1)
                raise ConfigError(file, words.removeprefix(f"{file}: ")) from error
        self._maps = [make(robot, spec, file) for robot in robots]

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile: the smallest margins, and the cable whose loss is the worst."""
        each = [one.with_orientations(cells) for one in self._maps]
        inside = np.logical_and.reduce([answers.pop("inside") for answers in each])
        columns = {name: np.stack([answers[name] for answers in each]) for name in each[0]}
        count = columns["verdict"].shape[1]
        answers = {name: np.fmin.reduce(columns[name]) for name in MARGINS}
        # NaN where a cable is slack without one.
        answers[FREQUENCY] = np.minimum.reduce(columns[FREQUENCY])
        # An orientation is inside if it is so whichever cable is gone.
        answers["orientation_fraction"] = self._maps[0].fraction(inside)
        answers["verdict"] = conjunction(np.bitwise_or.reduce(columns["verdict"]))
        margins = columns[self._maps[0].first_margin]
        worst = np.where(np.isnan(margins), np.inf, margins).argmin(0)
        answers["worst_cable"] = (worst + 1).astype(np.int16)
        nearest = np.where(np.isnan(columns["clearance"]), np.inf, columns["clearance"]).argmin(0)
        answers["nearest_bodies"] = columns["nearest_bodies"][nearest, np.arange(count)]
        return answers | _sides(columns["cell_side"], columns["cell_open"])

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse what the map of one cable gone refuses; see `GridMap.refuse_hopeless`."""
        self._maps[0].refuse_hopeless(grid)

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        return self._maps[0].contradictions(answers)


def _sides(sides: np.ndarray, reasons: np.ndarray) -> dict[str, np.ndarray]:
    # A cell is inside if it is so without each cable, and outside if it is so without one.
    side = np.where((sides == INSIDE).all(0), INSIDE, np.where((sides == OUTSIDE).any(0), OUTSIDE, 0))
    first_open = (sides == 0).argmax(0)
    reason = np.where(side == 0, reasons[first_open, np.arange(sides.shape[1])], 0)
    return {"cell_side": side.astype(np.int16), "cell_open": reason.astype(np.int16)}
