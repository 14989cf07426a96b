"""Clearances as series of balls, by directions: bodies are apart by what any direction separates them.

A body is a convex hull of points with a radius. Every direction gives a lower bound of the distance of two bodies. That
of the nearest points in the middle of a block turns so that all points which touch the separating planes move alike to
first order, and errs by the square of the block's length only. Two points of the bodies bound the distance from above.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple, cast

import flint
import numpy as np

from cspr_jax.motion.formulas import rationals
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.contacts.contact_bodies import Bodies, Shape, bodies_of, contact_pairs, has_sectors
from cspr_jax.verification.exact.components import Component
from cspr_jax.verification.exact.kinematics import Kinematics, balls
from cspr_jax.verification.exact.series import cross, dot, quotient, root, times

Points = Callable[[Kinematics], list[list[Any]]]
INWARD = 1e-13  # a direction leans this much out of a sector, so that rounding leaves it polar


class SeparatingDirection(NamedTuple):
    """Direction that separates two bodies around a time, and what is nearest then.

    Fields:
        middle: the time, s.
        axis: (3) direction at that time, of any length.
        rate: (3) its derivative.
        weights: of the differences between points of the bodies; of a sector followed by coefficients of its vectors.
    """

    middle: flint.arb
    axis: list[flint.arb]
    rate: list[flint.arb]
    weights: np.ndarray

    def along(self, time: Any) -> list[Any]:
        """The direction at times, as series."""
        away = time - self.middle
        return [x + away * y for x, y in zip(self.axis, self.rate, strict=True)]


class BodyPair(NamedTuple):
    """Two bodies that must not touch.

    Fields:
        first: points of the first body at a state, in the axes of the platform or in fixed ones.
        second: points of the second body.
        radius: sum of both radii, m.
        in_platform_axes: whether the points are in the axes of the platform.
        sector: vectors that span the sector of a platform over which the second body, a point, must not lie; None: no
            sector.
        normal: normal of a sector that is the full plane; None: it is not.
    """

    first: Points
    second: Points
    radius: float
    in_platform_axes: bool
    sector: np.ndarray | None = None
    normal: np.ndarray | None = None

    def differences(self, at: Kinematics) -> list[list[Any]]:
        """Vectors from every point of the first body to every point of the second one."""
        zero = at.state.position[0] * 0
        points = itertools.product(self.first(at), self.second(at))
        return [[zero + y - x for x, y in zip(p, q, strict=True)] for p, q in points]

    def direction(self, at: Kinematics) -> SeparatingDirection:
        """Direction that separates the bodies best at a time."""
        series = self.differences(at)
        rows, rates = (np.array([[float(x[order].mid()) for x in row] for row in series]) for order in (0, 1))
        axis, weights = separating(rows, self.sector)
        if self.normal is not None:
            axis = self.normal * (1.0 if self.normal @ rows[0] >= 0.0 else -1.0)
        if self.sector is not None or not np.isfinite(rows).all():
            return SeparatingDirection(at.state.time[0], balls(axis), balls(np.zeros(3)), weights)
        touching = np.flatnonzero(weights)
        nearest = _nearest([series[k] for k in touching]) or balls(axis)
        rate = _turning(np.array([float(x) for x in nearest]), rows[touching], rates[touching])
        return SeparatingDirection(at.state.time[0], nearest, balls(rate), weights)

    def between(self, at: Kinematics, weights: Float[np.ndarray, "k"]) -> list[Any]:
        """Vector between two points of the bodies, from weights."""
        rows, factors = self.differences(at), balls(weights)
        # Dividing by the sum of the weights, 1 but for rounding, makes these points of the bodies.
        total = sum(factors[: len(rows)], flint.arb(0))
        rows += [] if self.sector is None else balls(-self.sector)
        return [quotient(dot(factors, column), total) for column in zip(*rows, strict=True)]


def contact_bodies(robot: AnyRobot, scene: Scene) -> list[BodyPair]:
    """Pairs of bodies, in the order of the criteria of contacts."""
    bodies = bodies_of(robot, scene)
    pairs = []
    for kind, cable, other in contact_pairs(robot, scene):
        if kind == "cables":
            radius = float(bodies.radii[cable] + bodies.radii[other])
            pairs.append(BodyPair(_cable(cable), _cable(other), radius, False))
        elif kind == "obstacle":
            points, radius = obstacle_points(bodies, other)
            pairs.append(BodyPair(_cable(cable), _fixed(balls(points)), radius + float(bodies.radii[cable]), False))
        elif kind == "platform-obstacle":
            points, radius = obstacle_points(bodies, other)
            pairs.append(BodyPair(_corners(bodies), _inward_points(balls(points)), radius, True))
        elif has_sectors(robot, scene):
            sector = np.array(sector_vectors(bodies, cable), float)
            normal = None if np.asarray(bodies.sectors[0])[cable].any() else np.asarray(bodies.sectors[1])
            pairs.append(BodyPair(_corner(bodies, cable), _exit(cable), 0.0, True, sector, normal))
        else:
            pairs.append(BodyPair(_corners(bodies), _shortened(bodies, cable), float(bodies.radii[cable]), True))
    return pairs


def contact_functions(robot: AnyRobot, scene: Scene) -> list[Callable[[Kinematics], list[Component]]]:
    """Slacks of contacts: lower bounds by a direction, and at single times an upper bound by two points."""
    return [partial(_components, k, pair) for k, pair in enumerate(contact_bodies(robot, scene))]


def _components(k: int, pair: BodyPair, at: Kinematics) -> list[Component]:
    if k not in at.directions:
        at.directions[k] = pair.direction(at)
    direction: SeparatingDirection = at.directions[k]
    between = pair.between(at, direction.weights)
    square = dot(between, between)
    distance = Component(root(square) - flint.arb(pair.radius), at.is_point and bool(square[0] > 0))
    return [*direction_components(at, pair, direction.along(at.state.time)), distance]


def direction_components(at: Kinematics, pair: BodyPair, direction: Sequence[Any]) -> list[Component]:
    """Components of the clearance of two bodies along a direction, which bound it from below."""
    zero = at.state.position[0] * 0
    axis, radius = [zero + x for x in direction], flint.arb(pair.radius)
    length = root(dot(axis, axis))
    return [Component(quotient(dot(axis, row), length) - radius, None) for row in pair.differences(at)]


def _nearest(rows: list[list[Any]]) -> list[flint.arb] | None:
    # The point of the plane through some points that is nearest to the origin; None where they span none.
    count = len(rows)
    points = flint.arb_mat([[x[0].mid() for x in row] for row in rows])
    products = (points * points.transpose()).tolist()
    matrix = [[*row, flint.arb(1)] for row in products] + [[flint.arb(1)] * count + [flint.arb(0)]]
    try:
        weights = flint.arb_mat(matrix).solve(flint.arb_mat([[flint.arb(int(k == count))] for k in range(count + 1)]))
    except ZeroDivisionError:
        return None
    factors = flint.arb_mat([[weights[k, 0].mid() for k in range(count)]])
    return [x.mid() for x in (factors * points).entries()]


def _turning(axis: np.ndarray, rows: Float[np.ndarray, "m 3"], rates: Float[np.ndarray, "m 3"]) -> np.ndarray:
    # Derivative of a direction along which differences that are equally long now change alike.
    matrix = np.vstack([np.column_stack([rows, -np.ones(len(rows))]), np.append(axis, 0.0)])
    scale = np.append(np.full(3, 1.0 / (np.abs(rows).max() or 1.0)), 1.0)
    return (np.linalg.lstsq(matrix * scale, np.append(-rates @ axis, 0.0), rcond=None)[0] * scale)[:3]


def separating(
    differences: Float[np.ndarray, "m 3"], sector: Float[np.ndarray, "n 3"] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Direction along which two bodies are farthest apart, and weights of the differences at their nearest points."""
    from scipy.optimize import nnls  # few checks need it

    if not np.isfinite(differences).all():  # no direction is better than another
        weights = np.full(len(differences), 1.0 / len(differences))
        return np.array([0.0, 0.0, 1.0]), np.append(weights, np.zeros(0 if sector is None else len(sector)))
    if sector is not None:
        fractions = nnls(sector.T, differences[0])[0]
        direction = differences[0] - sector.T @ fractions
        lean = INWARD * np.linalg.norm(direction) * (sector / np.linalg.norm(sector, axis=1)[:, None]).sum(0)
        return direction - lean, np.append(1.0, fractions)
    scale = float(np.abs(differences).max())
    rows = np.vstack([differences.T / scale, np.ones(len(differences))])
    weights = nnls(rows, np.array([0.0, 0.0, 0.0, 1.0]))[0]
    nearest = rows @ weights - np.array([0.0, 0.0, 0.0, 1.0])
    direction = -nearest[:3] / nearest[3] if nearest[3] else np.array([0.0, 0.0, 1.0])
    return (direction if direction.any() else np.array([0.0, 0.0, 1.0])), weights / weights.sum()


def _cable(k: int) -> Points:
    return lambda at: [at.cables[k].exit, at.points[k]]


def _fixed(points: list[list[Any]]) -> Points:
    return lambda _: points


def _inward(at: Kinematics, point: list[Any]) -> list[Any]:
    # A point in the axes of the platform, from the mass centre.
    columns = list(zip(*at.state.rotation, strict=True))
    return times(columns, [x - y for x, y in zip(point, at.state.position, strict=True)])


def _inward_points(points: list[list[Any]]) -> Points:
    return lambda at: [_inward(at, point) for point in points]


def _exit(k: int) -> Points:
    return lambda at: [_inward(at, at.cables[k].exit)]


def _shortened(bodies: Bodies, k: int) -> Points:
    # A cable in the axes of the platform without the part next to the platform that may touch it.
    leave, attached = flint.arb(float(bodies.leave)), balls(bodies.points[k])

    def points(at: Kinematics) -> list[list[Any]]:
        cable = at.cables[k]
        columns = list(zip(*at.state.rotation, strict=True))
        away = times(columns, cable.unit)
        # Nothing is said of a cable that may be no longer than the part that is left out.
        part = leave if cable.free[0] > leave else flint.arb("nan")
        start = [x + part * y for x, y in zip(attached, away, strict=True)]
        return [start, [x + cable.free * y for x, y in zip(attached, away, strict=True)]]

    return points


def _corners(bodies: Bodies) -> Points:
    return _fixed(balls(cast("Shape", bodies.body).corners))


def _corner(bodies: Bodies, k: int) -> Points:
    return _fixed([balls(bodies.points[k])])


def obstacle_points(bodies: Bodies, k: int) -> tuple[np.ndarray, float]:
    """Points (m, 3) whose convex hull, widened by a radius, an obstacle is, and that radius, m."""
    number = int(np.asarray(bodies.order)[k])
    if number < len(bodies.rods):
        axis = np.asarray(bodies.rods[number])
        return (axis[:1] if (axis[0] == axis[1]).all() else axis), float(bodies.rod_radii[number])
    return np.asarray(cast("Shape", bodies.boxes).corners[number - len(bodies.rods)]), 0.0


def sector_vectors(bodies: Bodies, k: int) -> list[list[Fraction]]:
    """Vectors that span the sector of a corner; that of a point inside the platform is the full plane, exactly."""
    sides, normal = bodies.sectors
    if np.asarray(sides[k]).any():
        return rationals(sides[k])
    up = rationals(normal)
    level = [Fraction(int(i == np.abs(normal).argmin())) for i in range(3)]
    along = cross(up, level)
    across = cross(up, along)
    return [along, [-x for x in along], across, [-x for x in across]]
