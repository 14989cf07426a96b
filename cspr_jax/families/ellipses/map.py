"""Maps of ellipses over centres, radii, inclinations and frequencies."""

import math

import numpy as np

from cspr_jax.config.keys.ellipse import Hertz, SweepEllipse, cell_axes
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError, shown
from cspr_jax.families.ellipses.cells import ellipse_cells
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import formula_hull
from cspr_jax.maps.grid_map import PointMassMap
from cspr_jax.robots.model.point_mass import PLANAR
from cspr_jax.schema.verdicts import Verdict

MAX_CABLES = 250
# Relative error allowed at ends of intervals.
CHECK_ERROR = 1e-9


class EllipseMap(PointMassMap):
    """Turns on an ellipse about each centre; see `GridMap`."""

    any_cables = True
    proves = True

    def __init__(self, robot_file: RobotFile, sweep_file: SweepFile, file: object) -> None:
        """Refuse ellipses without a size or with two, and frequencies without a rule."""
        super().__init__(robot_file, sweep_file, file)
        robot, axes = self._problem.robot, sweep_file.axes
        self._ellipse, self._is_planar = sweep_file.ellipse or SweepEllipse(), robot.dof == PLANAR
        if robot.n_cables > MAX_CABLES:
            at, key = robot_file.placed("base_points", file)
            raise ConfigError(at, f"{key}: must be at most {MAX_CABLES} in this map")
        radii = [name for name in ("half_axes", "radius") if getattr(self._ellipse, name) is not None]
        if axes.circle_radius is not None and (radii or axes.scale is not None):
            other = f"ellipse.{radii[0]}" if radii else "axes.scale"
            raise ConfigError(file, f"{other}: must be absent beside axes.circle_radius")
        if axes.circle_radius is None and not radii:
            raise ConfigError(file, "ellipse.radius is missing: must be there, or half_axes, or axes.circle_radius")
        self._check_plane()
        rule = self._ellipse.frequency
        if axes.frequency is not None and "frequency" in self._ellipse.model_fields_set:
            raise ConfigError(file, f"ellipse.frequency = {_text(rule)}: must be absent beside axes.frequency")
        if axes.frequency is None and rule == "best" and formula_hull(robot) is None:
            allowed = 'a number or "natural", or axes.frequency: no formula for spools in several planes, or pulleys'
            raise ConfigError(file, f'ellipse.frequency = "best": must be {allowed}')

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        centres, rule = self._targets(cells), self._ellipse.frequency
        a, b = cell_axes(self._ellipse, cells, is_planar=self._is_planar)
        if isinstance(rule, Hertz):
            rule = 2.0 * math.pi * rule.hertz
        frequency = np.full(len(centres), rule) if isinstance(rule, float) else rule
        rotated = (np.broadcast_to(self._frame.rotated(axis), centres.shape) for axis in (a, b))
        return ellipse_cells(self._problem, Ellipse(centres, *rotated), cells.get("frequency", frequency)).arrays()

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        feasible, margin, used = answers["verdict"] == 0, answers["margin"], answers["used_frequency"]
        low, high = (
            answers["lowest_frequency"] * (1.0 - CHECK_ERROR),
            answers["highest_frequency"] * (1.0 + CHECK_ERROR),
        )
        natural, tension = answers["natural_frequency"], answers["tension_margin"]
        is_open = feasible | (answers["verdict"] == Verdict.UNDECIDED.value)
        by_formula, by_proof = formula_hull(self._problem.robot) is not None, ~np.isnan(tension)
        return {
            "an interval without the natural frequency": ~np.isnan(low) & ~((natural >= low) & (natural <= high)),
            "a feasible cell without a frequency": feasible & ~(np.isfinite(used) & (used >= 0.0)),
            "a feasible cell with a margin below zero": feasible & by_formula & ~(margin > 0.0),
            "a feasible frequency out of its interval": feasible & by_formula & ~((used >= low) & (used <= high)),
            "an infeasible cell with a margin above zero": ~is_open & ~by_proof & (margin > 0.0),
            "a feasible cell with a tension out of its limits": feasible
            & by_proof
            & ~(tension > -self._missed * self._weight),
        }

    def _check_plane(self) -> None:
        # Ellipses of a planar robot lie in the plane of its motion.
        if not self._is_planar:
            return
        for name in ("tilt", "tilt_azimuth"):
            if getattr(self._keys.axes, name) is not None:
                raise ConfigError(self._file, f"axes.{name}: must be absent for a planar robot")
        if any(axis[1] != 0.0 for axis in self._ellipse.axes(is_planar=True)):
            name = "half_axes" if self._ellipse.half_axes is not None else "normal"
            value = shown(getattr(self._ellipse, name))
            raise ConfigError(self._file, f"ellipse.{name} = {value}: must give an ellipse in y = 0: a planar robot")


def _text(rule: float | str | Hertz) -> str:
    return f"{{ hertz = {rule.hertz:g} }}" if isinstance(rule, Hertz) else shown(rule)
