"""Elements of paths: straight lines and arcs, over their travelled length."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float

# Angle of one quintic piece of an arc, rad: it misses the arc by its sixth power over 46080 radii, 8.3e-11.
LARGEST_PIECE = 0.125
# Places that are nearer to each other are one place, m.
SAME_PLACE = 1e-9


class Nodes(NamedTuple):
    """States along an element.

    Fields:
        s: (n,) travelled length, m.
        place: (n, 3) m.
        first: (n, 3) derivative with respect to s, of length 1.
        second: (n, 3) second derivative, 1/m.
    """

    s: np.ndarray
    place: np.ndarray
    first: np.ndarray
    second: np.ndarray


@dataclasses.dataclass(frozen=True)
class Straight:
    """Straight line.

    Fields:
        start: (3,) m.
        end: (3,) m.
        turn: travelled length of one that only turns on the spot, in place of m; rad.
        speed: largest speed, m/s.
        ends_at_rest: whether the motion stops behind it in any case.
    """

    start: np.ndarray
    end: np.ndarray
    turn: float = 0.0
    speed: float = np.inf
    ends_at_rest: bool = False

    @cached_property
    def moves(self) -> bool:
        """Tell whether it has a direction."""
        return bool(np.linalg.norm(self.end - self.start) > SAME_PLACE)

    @cached_property
    def length(self) -> float:
        """Travelled length, m; of one that only turns its angle, rad."""
        return float(np.linalg.norm(self.end - self.start)) if self.moves else self.turn

    def nodes(self, first: float, last: float) -> Nodes:
        """Nodes between two lengths."""
        return self.at(np.array([first, last]))

    def at(self, s: Float[np.ndarray, "n"]) -> Nodes:
        """States at lengths."""
        fraction, step = (s / self.length)[:, None], (self.end - self.start) / self.length
        # Whole lines meet their ends without rounding.
        place = self.start * (1.0 - fraction) + self.end * fraction
        return Nodes(s, place, np.array([step] * len(s)), np.zeros((len(s), 3)))


@dataclasses.dataclass(frozen=True)
class Arc:
    """Arc of a circle, or of a helix.

    Fields:
        centre: (3,) m, in the plane of its start.
        start: (3,) m.
        axis: (3,) unit vector about which it turns.
        angle: by which it turns, by the rule of the right hand, rad; not zero.
        rise: along the axis, from start to end, m.
        speed: largest speed, m/s.
        ends_at_rest: whether the motion stops behind it in any case.
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
        """Place of its end, (3,) m."""
        return self.at(np.array([self.length])).place[0]

    def nodes(self, first: float, last: float) -> Nodes:
        """Nodes between two lengths, near enough to each other for quintic pieces; see `Straight.nodes`."""
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
