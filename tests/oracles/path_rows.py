"""NumPy reference for limits along a path: A u + B x <= C in u = s'' and x = s'^2, from its own mechanics.

A robot and limits are dicts as in `any_motion`; further limits: speed_max and acceleration_max of the mass centre in
space, tension_margin (N, off both ends of the range of tensions). A path is that of the mass centre, polynomial pieces
of s, and pieces of a quaternion (w, x, y, z) that is normalised afterwards. With n = q / |q|,

    n' = q' / |q| - q (q . q') / |q|^3,    omega_s = 2 vec(n' n*),    omega_s' = 2 vec(n'' n*),

for n' n'* is real. The cables are to apply W f = a u + b x + c, about the mass centre, in fixed axes:

    a = (m p', I w),    b = (m p'', I w' + w x I w),    c = (-m g, 0),    w = omega_s.

W f, lo <= f <= hi, is a polytope; each of its facets holds dof - 1 of the columns of W, so that its normal n is normal
to these. Any n gives a row that holds, n . (a u + b x + c) <= sum max(y lo, y hi) with y = W^T n, and all n of such
subsets, with both signs, give all rows. Rows are divided by |y|_1: then C - A u - B x is a margin in N.
"""

import dataclasses
import itertools
import math

import numpy as np

from . import any_motion, sampled_motion

SIDES = 128


@dataclasses.dataclass(frozen=True)
class Place:
    """Path at k places: position and two derivatives in s (k, 3), rotation (k, 3, 3), omega_s, omega_s' (k, 3)."""

    position: np.ndarray
    first: np.ndarray
    second: np.ndarray
    rotation: np.ndarray
    omega: np.ndarray
    alpha: np.ndarray


@dataclasses.dataclass(frozen=True)
class Path:
    """Path of a mass centre, and of a body about it (None: its axes do not turn), 0 <= s <= length."""

    positions: sampled_motion.Spline
    quaternions: sampled_motion.Spline | None = None

    @property
    def length(self):
        return self.positions.knots[-1]

    def at(self, s, within=None):
        """Places; within: what s lies in the pieces that are meant (k,), where derivatives may jump."""
        s = np.atleast_1d(np.asarray(s, float))
        p = [self.positions(s, order, within) for order in range(3)]
        if self.quaternions is None:
            still = np.zeros_like(p[0])
            return Place(*p, np.broadcast_to(np.eye(3), (len(s), 3, 3)), still, still)
        q, q1, q2 = (self.quaternions(s, order, within) for order in range(3))
        r = np.linalg.norm(q, axis=1)[:, None]
        r1 = np.sum(q * q1, axis=1)[:, None] / r
        r2 = (np.sum(q1 * q1 + q * q2, axis=1)[:, None] - r1**2) / r
        n = q / r
        n1 = (q1 - n * r1) / r
        n2 = (q2 - 2.0 * n1 * r1 - n * r2) / r
        turns = [2.0 * sampled_motion.conjugate_product(d, n) for d in (n1, n2)]
        return Place(*p, sampled_motion.rotations(n), *turns)

    def changed(self, change):
        """The path with its splines changed by a function of a spline and of whether it is that of positions."""
        rotated = None if self.quaternions is None else change(self.quaternions, False)
        return Path(change(self.positions, True), rotated)

    def backwards(self):
        """The path from its end to its start."""

        def reverse(spline, _):
            knots, degree = spline.knots, spline.coefficients.shape[1] - 1
            middles = 0.5 * (knots[1:] + knots[:-1])
            # About the end of its piece: a Taylor series, whose odd powers change their signs.
            taylor = [spline(knots[1:], k, middles) * (-1.0) ** k / math.factorial(k) for k in range(degree + 1)]
            return sampled_motion.Spline(knots[-1] - knots[::-1], np.stack(taylor, axis=1)[::-1])

        return self.changed(reverse)

    def scaled(self, factor):
        """The path of a robot that is larger by a factor."""

        def scale(spline, is_position):
            powers = factor ** (float(is_position) - np.arange(spline.coefficients.shape[1]))
            return sampled_motion.Spline(spline.knots * factor, spline.coefficients * powers[:, None])

        return self.changed(scale)

    def nodes(self, count):
        """About `count` cells of even sizes; every knot is a node."""
        knots = self.positions.knots
        parts = np.maximum(np.round(count * np.diff(knots) / self.length).astype(int), 1)
        pieces = zip(knots[:-1], knots[1:], parts, strict=True)
        return np.concatenate([*(np.linspace(a, b, n, endpoint=False) for a, b, n in pieces), knots[-1:]])


def through(points, quaternions=None, interpolation="cubic"):
    """Natural spline through points (n, 3), and quaternions (n, 4), over the length of their polygon."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(steps)])
    signed = None if quaternions is None else sampled_motion.signed(np.array(quaternions, float))
    splines = [v if v is None else sampled_motion.spline(s, v, interpolation, "natural") for v in (points, signed)]
    return Path(*splines)


def line(start, end):
    """Straight line, s its length."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = np.linalg.norm(end - start)
    coefficients = np.stack([start, (end - start) / length])[None]
    return Path(sampled_motion.Spline(np.array([0.0, length]), coefficients))


def circle(centre, radius, turns=1.0, phase=0.0, pieces=96):
    """Level circle, s its arc, as quintic pieces: 1e-12 of the radius off a circle at 96 a turn."""
    count = max(2, round(pieces * turns))
    angle = np.linspace(0.0, 2.0 * math.pi * turns, count + 1)
    out = np.stack([np.cos(angle + phase), np.sin(angle + phase), 0.0 * angle], axis=1)
    ahead = np.stack([-out[:, 1], out[:, 0], 0.0 * angle], axis=1)
    jets = np.stack([np.asarray(centre) + radius * out, ahead, -out / radius], axis=1)
    return Path(sampled_motion.hermite(radius * angle, jets))


@dataclasses.dataclass(frozen=True)
class Balance:
    """Wrench matrices (k, dof, n) and wrenches a u + b x + c, each (k, dof), moments over the robot's size: N."""

    matrix: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray


def attachments(robot, place):
    """Arms from the mass centre to attachments, (k, n, 3), in fixed axes."""
    base = np.asarray(robot["base_points"], float)
    points = robot["platform_points"]
    body = np.zeros_like(base) if points is None else np.asarray(points, float) - robot["centre_of_mass"]
    return np.einsum("kij,nj->kni", place.rotation, body)


def balance(robot, place):
    """Balance of the cables at places."""
    arms, base = attachments(robot, place), np.asarray(robot["base_points"], float)
    pull = base - place.position[:, None] - arms
    pull /= np.linalg.norm(pull, axis=2)[..., None]
    mass, still = robot["mass"], np.zeros_like(place.first)
    turns = [still, still]
    size = 1.0
    if robot["platform_points"] is not None:
        inertia = np.asarray(robot["inertia"], float)
        # In the axes of the body, and back.
        w, w1 = (np.einsum("kji,kj->ki", place.rotation, v) for v in (place.omega, place.alpha))
        spin = w @ inertia.T
        turns = [spin, w1 @ inertia.T + np.cross(w, spin)]
        turns = [np.einsum("kij,kj->ki", place.rotation, v) for v in turns]
        size = np.linalg.norm(arms[0], axis=1).max()
    weight = np.broadcast_to(-mass * any_motion.gravity(robot), still.shape)
    forces = (mass * place.first, mass * place.second, weight)
    keep = any_motion.ROWS[robot["pattern"]]
    columns = np.concatenate([pull, np.cross(arms, pull) / size], axis=2)[:, :, keep]
    wrenches = [np.concatenate([f, m / size], axis=1)[:, keep] for f, m in zip(forces, (*turns, still), strict=True)]
    return Balance(np.swapaxes(columns, 1, 2), *wrenches)


def lengths(robot, place):
    """Lengths of the cables and their two derivatives in s, (k, n)."""
    arms = attachments(robot, place)
    d = place.position[:, None] + arms - np.asarray(robot["base_points"], float)
    w, w1 = place.omega[:, None], place.alpha[:, None]
    turning = np.cross(w, arms)
    d1 = place.first[:, None] + turning
    d2 = place.second[:, None] + np.cross(w1, arms) + np.cross(w, turning)
    length = np.linalg.norm(d, axis=2)
    rate = np.sum(d * d1, axis=2) / length
    return length, rate, (np.sum(d1 * d1 + d * d2, axis=2) - rate**2) / length


def normals(matrix):
    """Unit vectors (k, subsets, dof) normal to dof - 1 columns of wrench matrices (k, dof, n)."""
    dof, n = matrix.shape[1:]
    subsets = np.array(list(itertools.combinations(range(n), dof - 1)))
    columns = np.moveaxis(matrix[:, :, subsets], 1, 3)
    return np.linalg.svd(columns)[2][..., -1, :]


def tension_range(robot, limits):
    """Least and largest tension of each cable, inside the margin, two arrays (n,)."""
    low, high = any_motion.tension_limits(robot, limits)
    margin = limits.get("tension_margin") or 0.0
    return low + margin, high - margin


def tension_rows(robot, limits, place, directions=None):
    """Rows A, B, C, (k, rows), N, of the tensions alone."""
    low, high = tension_range(robot, limits)
    found = balance(robot, place)
    normal = normals(found.matrix) if directions is None else directions
    normal = np.concatenate([normal, -normal], axis=1)
    y = normal @ found.matrix
    size = np.abs(y).sum(2) if directions is None else np.ones(y.shape[:2])
    # The cables of the subset have none; what rounding leaves must not meet an infinite tension.
    y[np.abs(y) < 1e-12 * size[..., None]] = 0.0
    with np.errstate(invalid="ignore"):
        most = np.where(y > 0.0, y * high, np.where(y < 0.0, y * low, 0.0)).sum(2)
    a, b, c = (np.einsum("ksd,kd->ks", normal, v) for v in (found.a, found.b, found.c))
    size = np.where(size > 0.0, size, 1.0)
    return a / size, b / size, (most - c) / size


@dataclasses.dataclass(frozen=True)
class Rows:
    """A u + B x <= C at k places, (k, rows) each, and the name of the limit of each row."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    names: tuple


def kinematic_rows(robot, limits, place, sides=SIDES, outer=True):
    """Rows, by the names of their limits, of all limits but those of tensions.

    The acceleration in space is in a circle, in the plane of p' and p'': here in a regular polygon of 2 `sides` sides
    about it (outer: longer by 1 / cos(pi / (2 sides)) at most) or in it.
    """
    made = {}
    _, rate, second_derivative = lengths(robot, place)
    zero = np.zeros_like(rate)
    n = rate.shape[1]
    if limits.get("cable_speed_max") is not None:
        made["cable_speed_max"] = zero, rate**2, np.broadcast_to(limits["cable_speed_max"], n) ** 2 + zero
    if limits.get("cable_acceleration_max") is not None:
        most = np.broadcast_to(limits["cable_acceleration_max"], n) + zero
        both = (np.concatenate([v, -v], axis=1) for v in (rate, second_derivative))
        made["cable_acceleration_max"] = *both, np.concatenate([most, most], axis=1)
    ahead = np.linalg.norm(place.first, axis=1)[:, None]
    if limits.get("speed_max") is not None:
        made["speed_max"] = 0.0 * ahead, ahead**2, limits["speed_max"] ** 2 + 0.0 * ahead
    if limits.get("acceleration_max") is not None:
        along = np.sum(place.first * place.second, axis=1)[:, None] / ahead
        across = np.linalg.norm(place.second - along * place.first / ahead, axis=1)[:, None]
        # x is not negative: the sides of the other half lie beyond the two ends.
        angle = math.pi * np.arange(sides + 1) / sides
        cos, sin = np.cos(angle), np.sin(angle)
        most = limits["acceleration_max"] * (1.0 if outer else math.cos(0.5 * math.pi / sides))
        made["acceleration_max"] = cos * ahead, cos * along + sin * across, most + 0.0 * ahead * cos
    return made


def rows(robot, limits, place, sides=SIDES, outer=True):
    """All rows at places; rows without an end are left out."""
    made = kinematic_rows(robot, limits, place, sides, outer)
    low, high = tension_range(robot, limits)
    if (low > -np.inf).any() or np.isfinite(high).any():
        made = {"tension": tension_rows(robot, limits, place), **made}
    names = tuple(name for name, part in made.items() for _ in range(part[0].shape[1]))
    if not made:
        return Rows(*(np.zeros((len(place.position), 0)) for _ in range(3)), ())
    return Rows(*(np.concatenate([part[k] for part in made.values()], axis=1) for k in range(3)), names)


def slack(rows_, u, x):
    """C - A u - B x of each row, (k, rows)."""
    return rows_.c - rows_.a * np.asarray(u)[:, None] - rows_.b * np.asarray(x)[:, None]
