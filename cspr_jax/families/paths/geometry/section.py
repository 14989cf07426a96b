"""Sections of paths: curves without corners over the path coordinate s, made of quintic Hermite pieces."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BPoly

from cspr_jax.curves.interpolation import continuous, hermite, interpolated
from cspr_jax.curves.spline import Spline
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Float

# Orientations count as equal if half the angle between them is smaller, rad.
SAME_ORIENTATION = 1e-12
# Largest half angle of a turn on one piece, rad; a quintic deviates from a turn at constant rate by 4e-7 of it.
LARGEST_TURN = 0.5


class Section(NamedTuple):
    """Part of a path without corners, along which a motion need not stop.

    Fields:
        curve: positions and orientations over s, m, in place of time; NumPy leaves. It is continuous with its first
            derivative; the second derivative may jump between pieces.
        speed: (pieces,) largest allowed speed, m/s; inf without one.
        knots: (k,) s of the points of the path, from 0 to its length; each is a knot of the curve.
        feeds: words of G-code, such as "F6000", by the speed that they set, m/s.
    """

    curve: Spline
    speed: np.ndarray
    knots: np.ndarray
    feeds: Mapping[float, str] = MappingProxyType({})


class SectionSettings(NamedTuple):
    """Settings of the motion along a section.

    Fields:
        grid: number of cells of the grid.
        ramp_time: time in which accelerations rise and fall, s; 0 if they may jump.
        start_speed: speed of the mass centre at the start, m/s.
        end_speed: speed of the mass centre at the end, m/s.
    """

    grid: int
    ramp_time: float
    start_speed: float = 0.0
    end_speed: float = 0.0


@dataclasses.dataclass(frozen=True)
class PositionPath:
    """Positions of a section, as nodes of Hermite pieces.

    Fields:
        s: (n,) increasing, from 0; two nodes at the same s where the second derivative jumps.
        position: (n, 3) m.
        first: (n, 3) derivative with respect to s.
        second: (n, 3) second derivative, 1/m.
        speed: (n - 1,) largest speed on each piece, m/s, including empty ones.
        knots: (k,) s of the points of the path, all of them in `s`.
    """

    s: np.ndarray
    position: np.ndarray
    first: np.ndarray
    second: np.ndarray
    speed: np.ndarray
    knots: np.ndarray

    def table(self) -> Float[np.ndarray, "m 6 3"]:
        """Bernstein coefficients of the pieces that are not empty."""
        return hermite(self.s, [self.position, self.first, self.second])

    def refined(self, s: Float[np.ndarray, "k"]) -> "PositionPath":
        """The same path with more nodes."""
        knots, behind = np.unique(self.s), np.searchsorted(self.s, s)
        curve = BPoly(np.moveaxis(self.table(), 1, 0), knots)
        added = {
            name: np.insert(getattr(self, name), behind, curve(s, order), axis=0)
            for order, name in enumerate(("position", "first", "second"))
        }
        speed = np.insert(self.speed, behind - 1, self.speed[behind - 1])
        return dataclasses.replace(self, s=np.insert(self.s, behind, s), speed=speed, **added)


def section_of(path: PositionPath, quaternions: Float[np.ndarray, "k 4"] | None = None) -> Section:
    """Section from positions, and from orientations at their knots.

    Between two knots the orientation turns at a constant rate about one axis; through more knots it is a C2 spline.
    """
    turning = None
    if quaternions is not None:
        units = continuous(quaternions)
        halves = half_angles(units)
        steady = len(units) == 2
        if steady:
            path = path.refined(_between(path.s, LARGEST_TURN * path.s[-1] / max(halves[0], LARGEST_TURN)))
        if halves.max() <= SAME_ORIENTATION:
            turning = np.broadcast_to(units[0], (int((np.diff(path.s) > 0.0).sum()), 6, 4))
        elif steady:
            turning = hermite(path.s, turn(units, path.s / path.s[-1], path.s[-1]))
        else:
            rates = interpolated(path.knots, np.zeros((len(units), 3)), units, ends="natural")
            curve = BPoly(np.moveaxis(np.asarray(rates.quaternion), 1, 0), path.knots)
            turning = hermite(path.s, [curve(path.s, order) for order in range(3)])
    curve = Spline(
        as_float64(np.unique(path.s)), as_float64(path.table()), None if turning is None else as_float64(turning)
    )
    return Section(curve, path.speed[np.diff(path.s) > 0.0], path.knots)


def _between(s: np.ndarray, width: float) -> np.ndarray:
    # Return values of s that divide intervals wider than a given width.
    counts = np.ceil(np.diff(s) / width).astype(int)
    cuts = [np.linspace(a, b, count + 1)[1:-1] for a, b, count in zip(s[:-1], s[1:], counts, strict=True)]
    return np.concatenate(cuts)


def half_angles(units: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n-1"]:
    """Halves of the angles between consecutive orientations."""
    differences, sums = (np.linalg.norm(units[1:] + sign * units[:-1], axis=1) for sign in (-1.0, 1.0))
    return 2.0 * np.arctan2(differences, sums)


def turn(units: Float[np.ndarray, "2 4"], fraction: Float[np.ndarray, "n"], length: float = 1.0) -> list[np.ndarray]:
    """Orientations and their derivatives on a turn at a constant rate from one to another."""
    half = float(half_angles(units)[0])
    across = units[1] - (units[1] @ units[0]) * units[0]
    across /= np.linalg.norm(across) or 1.0
    rate = half / length
    cosine, sine = np.cos(half * fraction)[:, None], np.sin(half * fraction)[:, None]
    value = cosine * units[0] + sine * across
    return [value, rate * (cosine * across - sine * units[0]), -(rate**2) * value]
