"""The state of a robot on a part of a piece: kinematics, cables, wrench and tensions, each computed when needed."""

from collections import namedtuple
from functools import cached_property
from typing import Any

from flint import arb, arb_mat, arb_series

from cspr_jax.certificate_checker.reading import Fields
from cspr_jax.certificate_checker.series import ORDER, Undefined, angle, apply, cross, dot, plus, run, term, tight

Cable = namedtuple("Cable", "leaving unit free length")  # unit vector from effector to spool; free and whole length


def cable(base: list[Any], point: list[Any], r: Any, axis: list[Any]) -> Cable:
    """Return a cable, over a pulley if r > 0; raises Undefined where it has no length, or may touch the axis."""
    v = plus(point, base, -1)
    if not r > 0:
        length = apply("sqrt", dot(v, v))
        inverse = -apply("inv", length)
        return Cable([arb_series([entry]) for entry in base], [entry * inverse for entry in v], length, length)
    k = [entry / arb(dot(axis, axis)).sqrt() for entry in axis]
    h = dot(v, k)
    side = plus(v, k, -h)
    y = apply("sqrt", dot(side, side))
    x = y - r
    square = x * x + h * h
    free = apply("sqrt", square - r * r)
    cos, sin = ((free * x + h * r) * apply("inv", square * y), (free * h - x * r) * apply("inv", square))
    unit = [-(a * cos + b * sin) for a, b in zip(side, k, strict=True)]
    # The angle of (-x, h) is pi less that of (x, h), and never below that of (r, free), as y > 0: no case to tell.
    wrap = arb.pi() - angle(x, h) - angle(arb_series([r]), free)
    return Cable(plus(point, unit, free), unit, free, free + wrap * r)


class State:
    """A state at all times within a radius of a time, narrower by that at the time itself, `middle`; units are SI."""

    def __init__(self, robot: Fields, piece: Fields, block: Fields, time: Any, radius: Any) -> None:
        self.robot, self.piece, self.block, self.radius = robot, piece, block, radius
        self.middle: State | None = State(robot, piece, block, time, radius * 0) if radius else None
        self.frictions: dict[int, list[int]] = self.middle.frictions if self.middle else {}  # that may count, by cable
        steps = run(piece["program"], time - piece["start"], radius)
        self.position = self._tight("position", [steps[k] for k in piece["position"]])
        self.velocity = [entry.derivative() for entry in self.position]
        self.acceleration = [entry.derivative() for entry in self.velocity]
        self.quaternion = self._tight("quaternion", [steps[k] for k in piece.get("quaternion", [])])
        self.rotation = _rotation(*self.quaternion) if self.quaternion else []
        self.arms = [self.turn(point) for point in self.robot.get("platform_points", [])]
        ends = [plus(self.position, arm) for arm in self.arms]
        self.attachments = ends or [self.position] * len(robot["base_points"])
        self.corners = [plus(self.position, self.turn(corner)) for corner in robot["corners"]]
        self.time = arb_series([arb(time - (block["start"] + block["end"]) / 2, radius), 1])

    def _tight(self, name: str, values: list[Any]) -> list[Any]:
        """Return narrower series, from those that the middle has by that name."""
        if self.middle:
            values = [tight(*pair, self.radius) for pair in zip(getattr(self.middle, name), values, strict=True)]
        return values

    def turn(self, vector: list[Any]) -> list[Any]:
        """Return a vector of platform axes in fixed axes; those of a point mass are the same."""
        return [dot(row, vector) for row in self.rotation] or vector

    @cached_property
    def cables(self) -> list[Cable]:
        """Return the cables."""
        pulleys = self.robot.get("pulleys", dict.fromkeys(["radius", "axes"], [0] * len(self.attachments)))
        ends = zip(self.robot["base_points"], self.attachments, pulleys["radius"], pulleys["axes"], strict=True)
        return [cable(*end) for end in ends]

    def _balanced(self, force: list[Any], moment: list[Any]) -> list[Any]:
        """Return the balanced components of a force and of a moment about the position."""
        lines = [dot(self.turn(axis), moment) for axis in self.robot.get("line_axes", [])]
        return [force[k] for k in self.robot["forces"]] + [moment[k] for k in self.robot["moments"]] + lines

    @cached_property
    def wrench(self) -> list[Any]:
        """Return the balanced components of the wrench that the cables must supply, N and N m."""
        mass = self.robot["mass"]
        force = [entry * mass for entry in plus(self.acceleration, [0, 0, -self.robot["gravity"]])]
        if not self.rotation:
            return self._balanced(force, [])
        rates = [[entry.derivative() for entry in row] for row in self.rotation]
        spin = [dot(rates[k - 1], self.rotation[k - 2]) for k in range(3)]  # the skew part of R' R^T
        inside = [dot(column, spin) for column in zip(*self.rotation, strict=True)]
        arm = self.turn(self.robot.get("joint_arm", [0, 0, 0]))
        momentum = self.turn([dot(row, inside) for row in self.robot["inertia"]])
        momentum = plus(momentum, cross(arm, cross(spin, arm)), mass)
        return self._balanced(force, plus([entry.derivative() for entry in momentum], cross(arm, force)))

    @cached_property
    def columns(self) -> list[Any]:
        """Return the columns of the wrench matrix A, one after the other."""
        pairs = zip(self.arms or self.attachments, self.cables, strict=True)
        columns = [self._balanced(end.unit, cross(arm, end.unit) if self.arms else []) for arm, end in pairs]
        return self._tight("columns", [entry for column in columns for entry in column])

    @cached_property
    def inverse(self) -> tuple[arb_mat, list[arb_mat]]:
        """Return B = A^T (A A^T)^-1 in the middle, rounded: any matrix near it does; and the coefficients of A B."""
        transposed = _coefficients(self.columns, len(self.cables))
        a = transposed[0].mid().transpose()
        b = self.middle.inverse[0] if self.middle else _solve([a * a.transpose()], [a])[0].transpose().mid()
        return b, [entry.transpose() * b for entry in transposed]

    @cached_property
    def tensions(self) -> list[Any]:
        """Return tensions f with A f = W, N: f = g + B z with (A B) z = W - A g, g the witness or zero."""
        (b, products), d = self.inverse, len(self.wrench)
        first, rates = self.block.get("tensions", [[0] * len(self.cables)] * 2)
        guess = plus(first, [self.time * rate for rate in rates])
        right = plus(self.wrench, [dot(self.columns[k::d], guess) for k in range(d)], -1)
        rest = zip(*((b * z).entries() for z in _solve(products, _coefficients(right, d))), strict=True)
        return plus([arb_series(list(entry), ORDER - 2) for entry in rest], guess)

    @cached_property
    def determinant(self) -> Any:
        """Return det A where A is square, from (det M)' = det M trace(M^-1 M') of M = A B."""
        b, products = self.inverse
        rates = _solve(products, [entry * k for k, entry in enumerate(products)][1:])
        logarithm = arb_series([entry.trace() for entry in rates], ORDER - 3).integral()
        return logarithm.exp() * (products[0].det() / b.det())


def _coefficients(entries: list[Any], rows: int) -> list[arb_mat]:
    """Return the coefficients of a matrix of series, given one row after the other."""
    columns = len(entries) // rows
    return [arb_mat(rows, columns, [term(entry, k) for entry in entries]) for k in range(ORDER - 2)]


def _solve(matrix: list[arb_mat], right: list[arb_mat]) -> list[arb_mat]:
    """Solve a linear system of series, given by their coefficients; raises Undefined."""
    solution: list[arb_mat] = []
    for k, entry in enumerate(right):
        for j in range(k):
            entry -= matrix[k - j] * solution[j]
        try:
            solution.append(matrix[0].solve(entry))
        except ZeroDivisionError:
            raise Undefined("the wrench matrix is singular") from None
    return solution


def _rotation(w: Any, *v: Any) -> list[list[Any]]:
    """Return the rotation matrix of a quaternion, of any norm but zero: e + 2 (v x (v x e) + w v x e) / |q|^2 by e."""
    factor, columns = apply("inv", w * w + dot(v, v)) * 2, []
    for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1]):
        side = cross(v, axis)
        columns.append(plus(axis, plus(cross(v, side), side, w), factor))
    return [list(row) for row in zip(*columns, strict=True)]
