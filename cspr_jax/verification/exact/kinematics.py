"""Balance of a robot along a motion in any arithmetic; as series of balls also its cables, tensions and motors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple, cast

import flint
import numpy as np

from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line
from cspr_jax.robots.model.winches import STANDSTILL
from cspr_jax.verification.exact.series import Series, SeriesState, absolute, cross, dot, quotient, root, times

Vector = list[Any]


def balls(array: Any) -> Any:
    """Exact balls of an array of floating-point numbers, as nested lists."""
    return np.vectorize(lambda x: flint.arb(float(x)), otypes=[object])(np.asarray(array, float)).tolist()


class StateBalance:
    """Forces and moments of a robot at a state, in any arithmetic.

    Args:
        robot: in the axes of the kernels.
        state: of its mass centre.
        number: what makes a number of the arithmetic of a floating-point number.
    """

    def __init__(self, robot: AnyRobot, state: SeriesState, number: Callable[[float], Any] = flint.arb) -> None:
        """Hold robot and state."""
        self.robot, self.state, self._number = robot, state, number
        self._row = PATTERNS[robot.pattern]

    def numbers(self, array: Any) -> Any:
        """Numbers of an array in the arithmetic, nested as they are."""
        return np.vectorize(self._number, otypes=[object])(np.asarray(array, float)).tolist()

    @cached_property
    def arms(self) -> list[Vector]:
        """Attachment points from the mass centre, fixed axes, m."""
        if not isinstance(self.robot, PlatformRobot):
            return [[self.state.position[0] * 0] * 3] * self.robot.n_cables
        return [times(self.state.rotation, point) for point in self.numbers(self.robot.platform_points)]

    @cached_property
    def points(self) -> list[Vector]:
        """Attachment points, m."""
        return [[x + y for x, y in zip(self.state.position, arm, strict=True)] for arm in self.arms]

    @cached_property
    def wrench(self) -> Vector:
        """Wrench that the cables must supply."""
        mass, gravity = self._number(float(self.robot.mass)), self._number(float(self.robot.gravity))
        x, y, z = self.state.acceleration
        force = [part * mass for part in (x, y, z - gravity)]
        return self.balanced(force, self._moment(force) if isinstance(self.robot, PlatformRobot) else force)

    def _moment(self, force: Vector) -> Vector:
        # Moment that the cables must supply about the mass centre, or about a joint.
        robot: Any = self.robot
        rotation, velocity, inertia = self.state.rotation, self.state.angular_velocity, self.numbers(robot.inertia)
        centre = robot.centre_of_mass if self._row.is_jointed else None
        if centre is not None:
            arm, mass = self.numbers(centre), self._number(float(robot.mass))
            square = dot(arm, arm)
            inertia = [
                [entry + mass * ((square if i == j else 0) - arm[i] * arm[j]) for j, entry in enumerate(row)]
                for i, row in enumerate(inertia)
            ]
        columns = list(zip(*rotation, strict=True))

        def of_inertia(vector: Vector) -> Vector:
            return times(rotation, times(inertia, times(columns, vector)))

        inertial, spin = of_inertia(self.state.angular_acceleration), cross(velocity, of_inertia(velocity))
        moment = [a + b for a, b in zip(inertial, spin, strict=True)]
        if centre is None:
            return moment
        return [a + b for a, b in zip(moment, cross(times(rotation, self.numbers(centre)), force), strict=True)]

    def balanced(self, force: Vector, moment: Vector) -> Vector:
        """Components of a force and a moment that the cables balance."""
        parts = [force[k] for k in self._row.forces]
        if not self._row.along_line:
            return parts + [moment[k] for k in self._row.moments]
        across = self.numbers(np.asarray(across_line(cast("PlatformRobot", self.robot))).T)
        return parts + [dot(times(self.state.rotation, axis), moment) for axis in across]

    def columns_along(self, directions: Sequence[Vector]) -> list[Vector]:
        """Wrenches of forces along directions at the attachment points, one for each cable."""
        return [
            self.balanced(direction, cross(arm, direction))
            for arm, direction in zip(self.arms, directions, strict=True)
        ]


class CableSeries(NamedTuple):
    """A cable.

    Fields:
        exit: point at which it leaves its spool or pulley, m.
        unit: unit vector along it, from the effector to the exit.
        free: length from the exit to the attachment point, m.
        length: length with what lies on the pulley, m.
    """

    exit: Vector
    unit: Vector
    free: Any
    length: Any


class Kinematics(StateBalance):
    """Cables and wrenches of a robot at a state, as series of balls.

    Args:
        robot: in the axes of the kernels.
        state: of its mass centre.
        directions: directions of contacts, which bounds around the same middle share.
        is_point: whether the state is at a single time.
    """

    def __init__(
        self, robot: AnyRobot, state: SeriesState, directions: dict[int, Any] | None = None, *, is_point: bool = True
    ) -> None:
        """Hold robot and state."""
        super().__init__(robot, state)
        self.is_point, self.directions = is_point, {} if directions is None else directions

    @cached_property
    def cables(self) -> list[CableSeries]:
        """The cables."""
        base = balls(self.robot.base_points)
        if self.robot.pulleys is None:
            return [_straight(*ends) for ends in zip(base, self.points, strict=True)]
        axes, radii = balls(self.robot.pulleys.axes), balls(self.robot.pulleys.radius)
        return [
            _straight(entry, point) if radius == 0 else _over_pulley(entry, axis, radius, point)
            for entry, axis, radius, point in zip(base, axes, radii, self.points, strict=True)
        ]

    @cached_property
    def columns(self) -> list[Vector]:
        """Wrenches of unit tensions, one for each cable: columns of the wrench matrix."""
        return self.columns_along([cable.unit for cable in self.cables])

    @cached_property
    def _solved(self) -> tuple[Vector, Any]:
        # With the inverse in the middle, rounded, the matrix is nearly one, so that balls grow little.
        matrix, count = list(map(list, zip(*self.columns, strict=True))), len(self.wrench)
        centre = flint.arb_mat(count, count, [x[0].mid() for row in matrix for x in row])
        try:
            inverse = centre.inv().mid()
        except ZeroDivisionError:
            return solved(matrix, self.wrench)
        rows = [[inverse[i, j] for j in range(count)] for i in range(count)]
        product = [[dot(row, column) for column in zip(*matrix, strict=True)] for row in rows]
        solution, determinant = solved(product, [dot(row, self.wrench) for row in rows])
        return solution, quotient(determinant, Series([inverse.det()]))

    @property
    def tensions(self) -> Vector:
        """Tensions of as many cables as degrees of freedom, N."""
        return self._solved[0]

    @property
    def determinant(self) -> Any:
        """Determinant of the wrench matrix."""
        return self._solved[1]

    def rate(self, k: int) -> Any:
        """Rate of the length of a cable, m/s."""
        return self.cables[k].length.derivative()

    def motor_torques(self, k: int, speed: Any, acceleration: Any) -> list[tuple[Any, bool | None]]:
        """Torque of a motor on each side of friction, N m, and whether it acts: yes, no, or it is not known."""
        winches: Any = self.robot.winches
        numbers = (
            flint.arb(float(getattr(winches, name)[k]))
            for name in ("drum_radius", "gear_ratio", "motor_inertia", "friction", "viscous_friction", "efficiency")
        )
        radius, gear, inertia, friction, viscous, efficiency = numbers
        load, moved = self.tensions[k] * radius / gear, acceleration * inertia + speed * viscous
        standstill, value = flint.arb(STANDSTILL), speed[0]
        acts = [
            True if value >= -standstill else False if value < -standstill else None,
            True if value <= standstill else False if value > standstill else None,
        ]
        return [(load / efficiency + moved + friction, acts[0]), (load * efficiency + moved - friction, acts[1])]


def solved(matrix: list[Vector], right: Vector) -> tuple[Vector, Any]:
    """Solution of linear equations, and determinant, by elimination; without bounds where it may be singular."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    count, determinant = len(rows), None
    for k in range(count):
        best = max(range(k, count), key=lambda i: abs(float(rows[i][k][0].mid())))
        rows[k], rows[best] = rows[best], rows[k]
        pivot = rows[k][k] if best == k else -rows[k][k]
        determinant = pivot if determinant is None else determinant * pivot
        for i in range(k + 1, count):
            factor = quotient(rows[i][k], rows[k][k])
            rows[i] = [None] * (k + 1) + [
                a - factor * b for a, b in zip(rows[i][k + 1 :], rows[k][k + 1 :], strict=True)
            ]
    solution: Vector = [None] * count
    for k in reversed(range(count)):
        value = rows[k][count]
        for j in range(k + 1, count):
            value = value - rows[k][j] * solution[j]
        solution[k] = quotient(value, rows[k][k])
    return solution, determinant


def _straight(entry: Vector, point: Vector) -> CableSeries:
    ray = [a - b for a, b in zip(entry, point, strict=True)]
    length = root(dot(ray, ray))
    return CableSeries(entry, [quotient(part, length) for part in ray], length, length)


def _over_pulley(entry: Vector, axis: Vector, radius: Any, point: Vector) -> CableSeries:
    # Formulas are those of `robots.model.pulleys`.
    ray = [a - b for a, b in zip(point, entry, strict=True)]
    high = dot(ray, axis)
    aside = [a - high * b for a, b in zip(ray, axis, strict=True)]
    wide = root(dot(aside, aside))
    side = [quotient(part, wide) for part in aside]
    x, square = wide - radius, (wide - radius) * (wide - radius) + high * high
    free = root(square - radius * radius)
    out = radius + quotient(radius * (radius * x - free * high), square)
    up = quotient(radius * (radius * high + free * x), square)
    along, rise = quotient(free * x + radius * high, square), quotient(free * high - radius * x, square)
    leave = [a + out * b + up * c for a, b, c in zip(entry, side, axis, strict=True)]
    unit = [-(along * b + rise * c) for b, c in zip(side, axis, strict=True)]
    wrapped = angle(-x, high) - (free / radius).atan()
    return CableSeries(leave, unit, free, free + radius * _positive(wrapped))


def angle(x: Any, y: Any) -> Any:
    """Angle of a vector in [0, 2 pi[; without bounds where the vector may point along the positive x axis."""
    a, b, pi = x[0], y[0], flint.arb.pi()
    if b > 0:
        return pi / 2 - quotient(x, y).atan()
    if b < 0:
        return 3 * pi / 2 - quotient(x, y).atan()
    if a < 0:
        return pi + quotient(y, x).atan()
    if a > 0 and b >= 0:
        return quotient(y, x).atan()
    return x * flint.arb("nan")


def _positive(x: Any) -> Any:
    # The larger of a number and 0.
    return (x + absolute(x)) / 2
