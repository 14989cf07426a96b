"""Numbers of the robot itself as measures: sizes of its frame, numbers of its file, distances in a hall."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cspr_jax.config.design import Hall
from cspr_jax.config.parameters import numbers_in
from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.numerics.shapes import Int
from cspr_jax.robots.model.shapes import point_distances
from cspr_jax.synthesis.measures.measure import Columns, Measure
from cspr_jax.synthesis.space import Point, RobotSpace

CLEARANCE = "clearance"
_EXTENTS = ("extent_x", "extent_y", "extent_z")
# Walls of a hall, in the order of their distances.
_WALLS = tuple(f"the wall at the {end} {axis}" for end in ("smallest", "largest") for axis in "xyz")
_FRAME = (*_EXTENTS, "volume")


class _OfRobot(Measure):
    # A measure that takes no time, always has a value and asks for nothing.
    is_exact = True

    def slacks(self) -> tuple[str, ...]:
        """None."""
        return ()

    def jumps(self, quantity: str) -> bool:
        """No number of a robot file is a count; see `Measure.jumps`."""
        del quantity
        return False

    def _refuse_others(self, quantity: str, names: Sequence[str], shown: int = 20) -> None:
        if quantity not in names:
            listed = ", ".join(names[:shown]) + (", ..." if len(names) > shown else "")
            raise InputError("quantity", quantity, f"{did_you_mean(quantity, names)}one of {listed}")


class FrameMeasure(_OfRobot):
    """Edges, m, and volume, m^3, of the box along the axes of the robot file that holds its spools."""

    def check(self, quantity: str) -> None:
        """Refuse other names; see `Measure.check`."""
        self._refuse_others(quantity, _FRAME)

    def _columns(self, point: Point) -> Columns:
        extents = np.ptp(np.asarray(self.space.robot_at(point).base_points), axis=0)
        return {name: extents[i : i + 1] for i, name in enumerate(_EXTENTS)} | {"volume": extents.prod(keepdims=True)}


class RobotMeasure(_OfRobot):
    """Numbers of the robot file, by their keys, such as "mass" or "base_points[0][2]"."""

    def check(self, quantity: str) -> None:
        """Refuse what is no number of the file; see `Measure.check`."""
        self._refuse_others(quantity, list(dict(numbers_in(self._spec(self.space.first)))))

    def _spec(self, point: Point) -> dict:
        return self.space.robot_at(point).model_dump(exclude_none=True, exclude={"parameter"})

    def _columns(self, point: Point) -> Columns:
        return {key: np.array([value]) for key, value in numbers_in(self._spec(point))}


class ParametersMeasure(_OfRobot):
    """Values of the parameters themselves."""

    def check(self, quantity: str) -> None:
        """Refuse other names than those of variables; see `Measure.check`."""
        self._refuse_others(quantity, self.space.names)

    def _columns(self, point: Point) -> Columns:
        return {name: np.array([value]) for name, value in self.space.parameters(point).items()}


class HallMeasure(_OfRobot):
    """Distance of each spool to the walls of a hall, from inside, and to the bodies in it, m; negative beyond."""

    def __init__(self, space: RobotSpace, hall: Hall) -> None:
        """Take the hall."""
        super().__init__(space)
        self._hall = hall
        self._bodies = [table.shape() for table in hall.obstacle or ()]

    def check(self, quantity: str) -> None:
        """Refuse other names; see `Measure.check`."""
        self._refuse_others(quantity, [CLEARANCE])

    def words(self, point: Point, quantity: str, element: Int[np.ndarray, "2"]) -> str:
        """The spool, and the body or wall; see `Measure.words`."""
        del quantity
        body, spool = divmod(int(element[1]), len(self.space.robot_at(point).base_points))
        name = self._bodies[body].name if body < len(self._bodies) else _WALLS[body - len(self._bodies)]
        return f"of spool {spool} from {name}"

    def _columns(self, point: Point) -> Columns:
        spools = np.asarray(self.space.robot_at(point).base_points, float)
        distances = [point_distances(body, spools) for body in self._bodies]
        if self._hall.corners is not None:
            low, high = np.asarray(self._hall.corners, float)
            distances += list((spools - low).T) + list((high - spools).T)
        return {CLEARANCE: np.concatenate(distances)}
