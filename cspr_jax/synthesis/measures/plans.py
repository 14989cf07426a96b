"""Plans as measures: fields of the segments of a plan at the robot of a point."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.config.plan import checked_plan
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.numerics.shapes import Int
from cspr_jax.plans.planning import PlannedMotions, plan_of
from cspr_jax.schema.limits import LIMITS
from cspr_jax.synthesis.measures.measure import FEASIBLE, Columns, Measure
from cspr_jax.synthesis.space import Point, RobotSpace, UnsuitableRobotError

_OF_ANSWERS = ("arcs", "duration", "margin", "margin_bound", "limit_margin", "tolerated")
_OF_PEAKS = {row.name: row.peak for row in LIMITS if row.peak} | {
    name: name for name in ("tension_min", "tension_max", "mu_min")
}
_OTHERS = (FEASIBLE, "tension_margin", "natural_frequency_min")
_COUNTS = (FEASIBLE, "arcs")


class PlanMeasure(Measure):
    """Fields of the segments of a plan, by their names in its JSON; a row of `_OF_PEAKS` is a peak."""

    def __init__(self, space: RobotSpace, name: str, path: Path) -> None:
        """Check the keys of the plan."""
        super().__init__(space)
        self._name, self._path = name, path
        self._is_elastic = space.robot_file.full.axial_stiffness is not None
        self._has_winch = space.robot_file.full.winch is not None
        checked_plan(self._spec(space.first), path)

    def _spec(self, point: Point) -> dict[str, Any]:
        robot = self.space.robot_at(point).model_dump(mode="json", exclude_none=True, exclude={"parameter"})
        return self.space.table_at(point, "plans", self._name) | {"robot": robot}

    def check(self, quantity: str) -> None:
        """Refuse what is no field of segments; see `Measure.check`."""
        names = (*_OTHERS, *_OF_ANSWERS, *_OF_PEAKS)
        if quantity not in names:
            hint = did_you_mean(quantity, names)
            raise InputError("quantity", quantity, f"{hint}one of {', '.join(names)}")
        if quantity == "arcs" and not checked_plan(self._spec(self.space.first), self._path).takes_amplitude:
            raise InputError("quantity", quantity, "another one: motions of its families have no arcs")
        if quantity.startswith("motor_") and not self._has_winch:
            raise InputError("quantity", quantity, "another one: the robot has no [winch]")
        if quantity == "natural_frequency_min" and not self._is_elastic:
            raise InputError("quantity", quantity, "another one: the robot has no axial_stiffness")

    def check_at(self, point: Point) -> None:
        """Refuse keys that parameters of the design have moved so that they are none; see `Measure.check_at`."""
        checked_plan(self._spec(point), self._path)

    def slacks(self) -> tuple[str, ...]:
        """Margins of tensions and of limits; see `Measure.slacks`."""
        return ("margin", "limit_margin")

    def jumps(self, quantity: str) -> bool:
        """Tell whether a field is a count; see `Measure.jumps`."""
        return quantity in _COUNTS

    def words(self, point: Point, quantity: str, element: Int[np.ndarray, "2"]) -> str:
        """The segment; see `Measure.words`."""
        del point, quantity
        return f"of the segment to pose[{element[1] + 1}]"

    def _columns(self, point: Point) -> Columns:
        spec = self._spec(point)
        try:
            return _columns_of(plan_of(checked_plan(spec, self._path), self._path))
        except ConfigError as error:
            raise UnsuitableRobotError(str(error)) from error


def _columns_of(plan: PlannedMotions) -> Columns:
    answers, peaks = plan.answers, plan.demands
    columns = {name: np.asarray(getattr(answers, name), float) for name in _OF_ANSWERS}
    columns["arcs"] = np.where(answers.arcs > 0, answers.arcs, np.nan)
    columns |= {name: np.asarray(getattr(peaks, peak), float) for name, peak in _OF_PEAKS.items()}
    lowest = [np.nan if row is None else row.lowest for row in plan.frequencies or [None] * len(answers.arcs)]
    columns |= {"tension_margin": plan.tension_margin, "natural_frequency_min": np.array(lowest)}
    return columns | {FEASIBLE: plan.is_feasible.astype(float)}
