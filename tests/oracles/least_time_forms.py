"""Least times along paths in closed form or by quadrature, and how they change when all is reversed or scaled.

Along a straight line a point mass has u between bounds of s alone, as p'' = 0. From rest to rest, its least time is
that of the largest u and then the smallest (bang-bang): x = 2 integral of the largest up to where it meets x = 2
integral of the smallest, taken from the end.
"""

import dataclasses
import math

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from . import any_motion_cases, path_rows


def ring_robot(count, radius=1.0, mass=1.0, gravity=9.81, z_axis="down"):
    """Point mass on spools on a level ring at z = 0."""
    return {
        "base_points": any_motion_cases.ring(count, radius),
        "platform_points": None,
        "mass": mass,
        "inertia": None,
        "centre_of_mass": np.zeros(3),
        "gravity": gravity,
        "pattern": "3T",
        "z_axis": z_axis,
        "pulley_radius": None,
        "pulley_axes": None,
        "cable_diameter": 0.001 * radius,
    }


def two_spools(half, mass=1.0, gravity=9.81):
    """Point mass in the plane of x and z on two spools at x = half and x = -half, z down."""
    base = np.array([[half, 0.0, 0.0], [-half, 0.0, 0.0]])
    return {**ring_robot(3, half, mass, gravity), "base_points": base, "pattern": "2T"}


def bang_bang(reach, length):
    """Least time over a length, and where u changes from its largest to its smallest."""
    switch = brentq(lambda s: reach(s)[0] - reach(s)[1], 0.0, length, xtol=1e-15 * length)
    # s = w^2 from the end at rest: the integrand 2 w / sqrt(x) is smooth.
    first = quad(lambda w: 2.0 * w / math.sqrt(reach(w * w)[0]), 0.0, math.sqrt(switch), epsabs=0.0, epsrel=1e-12)
    last = quad(
        lambda w: 2.0 * w / math.sqrt(reach(length - w * w)[1]),
        0.0,
        math.sqrt(length - switch),
        epsabs=0.0,
        epsrel=1e-12,
    )
    return first[0] + last[0], switch


def vertical(robot, low, high, start, end):
    """Least time of a ring robot along its axis from depth to depth, by tensions alike in all cables.

    With n f d / l = m (g - d''), and d l / d d = d / l: d'^2 / 2 = g (d - d_0) - n f (l - l_0) / m.
    """
    radius = np.linalg.norm(robot["base_points"][0])
    n, m, g = len(robot["base_points"]), robot["mass"], robot["gravity"]

    def twice_work(f, a, b):
        return 2.0 * (g * (b - a) - n * f * (math.hypot(radius, b) - math.hypot(radius, a)) / m)

    push, brake = (low, high) if end > start else (high, low)
    sign = math.copysign(1.0, end - start)

    def reach(s):
        depth = start + sign * s
        return twice_work(push, start, depth), -twice_work(brake, depth, end)

    return bang_bang(reach, abs(end - start))


def level(half, depth, start, end, gravity=9.81):
    """Least time of `two_spools` along a level line from x to a larger x, cables that only must not be slack.

    One cable is slack: the mass swings as x'' = g (B - x) / h about one spool's vertical, then -g (B + x) / h.
    """
    switch = (start + end) * (2.0 * half + end - start) / (4.0 * half)
    first, last = math.acos((half - switch) / (half - start)), math.acos((half + switch) / (half + end))
    return (first + last) * math.sqrt(depth / gravity), switch - start


def straight(robot, limits, start, end, pieces=60, order=12):
    """Least time of a point mass along a straight line under limits of tensions alone, by Gauss' quadrature.

    The bounds of u bend where the tightest row changes: pieces that are short keep that error small.
    """
    path = path_rows.line(start, end)
    nodes, weights = np.polynomial.legendre.leggauss(order)
    edges = np.linspace(0.0, path.length, pieces + 1)
    half = 0.5 * np.diff(edges)[:, None]

    def bounds(s):
        found = path_rows.rows(robot, limits, path.at(s.ravel()))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = found.c / found.a
        high = np.where(found.a > 1e-12 * robot["mass"], ratio, math.inf).min(1)
        low = np.where(found.a < -1e-12 * robot["mass"], ratio, -math.inf).max(1)
        return low.reshape(s.shape), high.reshape(s.shape)

    s = edges[:-1, None] + half * (1.0 + nodes)
    low, high = bounds(s)
    if not (low <= high).all():
        return math.inf
    gained = np.concatenate([[0.0], np.cumsum(2.0 * np.sum(high * weights * half, axis=1))])
    needed = np.concatenate([[0.0], np.cumsum(2.0 * np.sum(-low * weights * half, axis=1)[::-1])])[::-1]
    if not ((gained[1:] > 0.0).all() and (needed[:-1] > 0.0).all()):
        return math.inf
    # Within a piece, integrals from its start by a rule of its own part.
    cell = int(np.flatnonzero(gained[1:] >= needed[1:])[0])

    def within(at, is_first, k):
        """x at one place of a piece, by the rule from the piece's start or to its end."""
        a, b = (edges[k], at) if is_first else (at, edges[k + 1])
        inner = a + 0.5 * (b - a) * (1.0 + nodes)
        low_, high_ = bounds(inner)
        part = 2.0 * np.sum((high_ if is_first else -low_) * weights) * 0.5 * (b - a)
        return part + (gained[k] if is_first else needed[k + 1])

    switch = brentq(lambda at: within(at, True, cell) - within(at, False, cell), edges[cell], edges[cell + 1])

    def leg(is_first):
        total = 0.0
        for k in range(cell + 1) if is_first else range(cell, pieces):
            a, b = edges[k], edges[k + 1]
            if k == cell:
                a, b = (a, switch) if is_first else (switch, b)
            # w from the end at rest: s = w^2.
            ends = (a, b) if is_first else (path.length - b, path.length - a)
            w0, w1 = np.sqrt(ends)
            w = w0 + 0.5 * (w1 - w0) * (1.0 + nodes)
            at = w * w if is_first else path.length - w * w
            x = np.array([within(v, is_first, k) for v in at])
            total += 0.5 * (w1 - w0) * np.sum(weights * 2.0 * w / np.sqrt(x))
        return total

    return leg(True) + leg(False)


def trapezoid(length, speed, acceleration):
    """Least time along a straight line under a speed and an acceleration."""
    if length * acceleration <= speed**2:
        return 2.0 * math.sqrt(length / acceleration)
    return length / speed + speed / acceleration


def level_circle(radius, reach, depth, turns=1.0, gravity=9.81):
    """Least time along a level circle about the axis of a ring of ever more spools, of radius `reach`, none slack.

    The cables' pull meets the spools' plane within their ring, for a mass at any angle at (r - h x / (g r), h u / g),
    along the radius and along the circle. With w = h x / (g r) - r the largest u has
    dw / ds = 2 sqrt(R^2 - w^2) / r: w = R sin(2 s / r - asin(r / R)), until w = R; from there it stays.
    A robot of n spools on that ring takes longer, but not as long as the ring of radius R cos(pi / n) within it.
    """
    length, omega = 2.0 * math.pi * radius * turns, math.sqrt(gravity / depth)
    tilt = math.asin(radius / reach)
    climb = min(0.5 * radius * (0.5 * math.pi + tilt), 0.5 * length)

    def x(s):
        # r + R sin(q - tilt) = R (sin tilt + sin(q - tilt)), without cancellation.
        q = 2.0 * s / radius
        return omega**2 * radius * reach * 2.0 * math.sin(0.5 * q) * math.cos(tilt - 0.5 * q)

    time = quad(lambda w: 2.0 * w / math.sqrt(x(w * w)), 0.0, math.sqrt(climb), epsabs=0.0, epsrel=1e-12)[0]
    return 2.0 * time + (length - 2.0 * climb) / math.sqrt(x(climb))


def circle_by_acceleration(radius, acceleration, turns=1.0):
    """Least time along a circle under an acceleration alone: x = r a sin(2 s / r), until x = r a."""
    length = 2.0 * math.pi * radius * turns
    climb = min(0.25 * math.pi * radius, 0.5 * length)

    def x(s):
        return radius * acceleration * math.sin(2.0 * s / radius)

    time = quad(lambda w: 2.0 * w / math.sqrt(x(w * w)), 0.0, math.sqrt(climb), epsabs=0.0, epsrel=1e-12)[0]
    return 2.0 * time + (length - 2.0 * climb) / math.sqrt(x(climb))


LENGTHS = ("base_points", "platform_points", "centre_of_mass", "pulley_radius", "cable_diameter")


@dataclasses.dataclass(frozen=True)
class Scale:
    """Lengths times `size`, masses and tensions times `mass`: accelerations stay, times change by sqrt(size)."""

    size: float
    mass: float

    @property
    def time(self):
        return math.sqrt(self.size)

    def robot(self, robot):
        scaled = {k: robot[k] if robot[k] is None else self.size * np.asarray(robot[k]) for k in LENGTHS}
        inertia = None if robot["inertia"] is None else self.mass * self.size**2 * np.asarray(robot["inertia"])
        return {**robot, **scaled, "mass": self.mass * robot["mass"], "inertia": inertia}

    def limits(self, limits):
        powers = {"tension_min": (0.0, 1.0), "tension_max": (0.0, 1.0), "tension_margin": (0.0, 1.0)}
        powers |= {"cable_speed_max": (0.5, 0.0), "speed_max": (0.5, 0.0)}
        scaled = {}
        for name, value in limits.items():
            length, mass = powers.get(name, (0.0, 0.0))
            scaled[name] = value if value is None else np.asarray(value) * self.size**length * self.mass**mass
        return scaled
