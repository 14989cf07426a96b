"""Elements of paths over their travelled length: straight lines and arcs, of plans and of G-code."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cspr_jax.config.gcode.reading import Move
from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float

# Largest angle of a quintic piece, rad: it deviates from an arc of radius r by angle^6 r / 46080, 8.3e-11 r.
LARGEST_PIECE = 0.125
# Positions closer than this count as the same, m.
SAME_PLACE = 1e-9


class Nodes(NamedTuple):
    """States along an element.

    Fields:
        s: (n,) travelled length, m.
        position: (n, 3) m.
        first: (n, 3) derivative with respect to s, of length 1.
        second: (n, 3) second derivative, 1/m.
    """

    s: np.ndarray
    position: np.ndarray
    first: np.ndarray
    second: np.ndarray


@dataclasses.dataclass(frozen=True)
class Straight:
    """Straight line.

    Fields:
        start: (3,) m.
        end: (3,) m.
        turn: angle, rad, if a platform only turns at one position; it then serves as the length.
        speed: largest speed on the line, m/s.
        ends_at_rest: whether the motion stops at its end in any case.
    """

    start: np.ndarray
    end: np.ndarray
    turn: float = 0.0
    speed: float = np.inf
    ends_at_rest: bool = False

    @cached_property
    def moves(self) -> bool:
        """Tell whether the line has a direction."""
        return bool(np.linalg.norm(self.end - self.start) > SAME_PLACE)

    @cached_property
    def length(self) -> float:
        """Travelled length, m; the angle, rad, where a platform only turns."""
        return float(np.linalg.norm(self.end - self.start)) if self.moves else self.turn

    def nodes(self, first: float, last: float) -> Nodes:
        """Nodes between two travelled lengths."""
        return self.at(np.array([first, last]))

    def at(self, s: Float[np.ndarray, "n"]) -> Nodes:
        """States at travelled lengths."""
        fraction, step = (s / self.length)[:, None], (self.end - self.start) / self.length
        # This form gives the ends of the line without rounding.
        position = self.start * (1.0 - fraction) + self.end * fraction
        return Nodes(s, position, np.array([step] * len(s)), np.zeros((len(s), 3)))


@dataclasses.dataclass(frozen=True)
class Arc:
    """Arc of a circle, or of a helix.

    Fields:
        centre: (3,) centre in the plane of the start, m.
        start: (3,) m.
        axis: (3,) unit vector of the axis of rotation.
        angle: angle of rotation about the axis, by the right-hand rule, rad; not zero.
        rise: displacement along the axis from start to end, m.
        speed: largest speed on the arc, m/s.
        ends_at_rest: whether the motion stops at its end in any case.
    """

    centre: np.ndarray
    start: np.ndarray
    axis: np.ndarray
    angle: float
    rise: float = 0.0
    speed: float = np.inf
    moves: bool = True
    ends_at_rest: bool = False

    @cached_property
    def length(self) -> float:
        """Travelled length, m."""
        return float(np.hypot(self.angle * np.linalg.norm(self.start - self.centre), self.rise))

    @property
    def end(self) -> np.ndarray:
        """Position of the end, (3,) m."""
        return self.at(np.array([self.length])).position[0]

    def nodes(self, first: float, last: float) -> Nodes:
        """Nodes between two lengths, close enough to each other for quintic pieces; see `Straight.nodes`."""
        count = max(int(np.ceil(abs(self.angle) * (last - first) / self.length / LARGEST_PIECE)), 1)
        return self.at(np.linspace(first, last, count + 1))

    def at(self, s: np.ndarray) -> Nodes:
        """States at lengths; see `Straight.at`."""
        rate, radius = self.angle / self.length, self.start - self.centre
        cosine, sine = np.cos(rate * s)[:, None], np.sin(rate * s)[:, None]
        along = np.cross(self.axis, radius)
        outward = cosine * radius + sine * along
        forward = rate * (cosine * along - sine * radius)
        climb = self.axis * (self.rise / self.length)
        return Nodes(s, self.centre + outward + s[:, None] * climb, forward + climb, -(rate**2) * outward)


Element = Straight | Arc


# The start of an arc may be off the plane of its centre by this fraction of its radius, due to rounding.
BESIDE = 1e-6


def arc_of(
    centre: Float[np.ndarray, "3"], start: Float[np.ndarray, "3"], normal: Float[np.ndarray, "3"], angle: float
) -> Arc:
    """Arc of a circle."""
    axis = normal / np.linalg.norm(normal)
    radius = start - centre
    height = float(radius @ axis)
    distance = float(np.linalg.norm(radius - height * axis))
    if distance == 0.0 or abs(height) > BESIDE * distance:
        allowed = "in a plane with the start, normal to `normal`, and apart from it"
        raise InputError("centre", centre.tolist(), allowed)
    return Arc(centre + height * axis, start, axis, angle)


def elements_of(moves: Sequence[Move]) -> list[Element]:
    """Lines, arcs and helices of moves; where the program pauses, an element ends with a stop."""
    elements: list[Element] = []
    for move in moves:
        start, end = np.array(move.start), np.array(move.end)
        if move.centre is None:
            elements.append(Straight(start, end, speed=move.speed, ends_at_rest=move.ends_at_rest))
        else:
            centre, axis = np.roll([*move.centre, move.start[move.normal]], move.normal + 1), np.eye(3)[move.normal]
            rise = float((end - start)[move.normal])
            elements.append(Arc(centre, start, axis, move.angle, rise, move.speed, ends_at_rest=move.ends_at_rest))
    return elements
