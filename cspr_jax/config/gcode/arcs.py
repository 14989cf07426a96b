"""Arcs of G-code, whose rounded numbers miss their circles."""

import math
from typing import NamedTuple

# Largest difference of the radii at start and end, over the radius, as in controllers.
RADIUS_TOLERANCE = 0.001
# Positions that are nearer to each other are the same, m.
SAME_PLACE = 1e-9


class PlaneArc(NamedTuple):
    """Arc in its plane.

    Fields:
        centre: [a, b], m.
        angle: by which it turns, positive from a to b, rad.
        end: [a, b] on its circle, m: as written, or nearer to it than radii may differ.
    """

    centre: list[float]
    angle: float
    end: list[float]


class ArcError(ValueError):
    """Numbers that make no arc: the word or error, and what is allowed."""


def missed(half: float) -> float:
    """Largest difference of the radii at start and end that comes from rounding of coordinates by up to `half`."""
    # sqrt(2) halves at the start, from both coordinates of the centre; three times as much at the end.
    return 4.0 * math.sqrt(2.0) * half


def arc_of_radius(start: list[float], end: list[float], radius: float, sign: float, half: float) -> PlaneArc:
    """Arc of a radius."""
    across, up = end[0] - start[0], end[1] - start[1]
    chord, length = math.hypot(across, up), abs(radius)
    if chord <= SAME_PLACE:
        raise ArcError("R", "must be I or J where an arc ends above or at its start")
    if 0.5 * chord > length + max(missed(half), RADIUS_TOLERANCE * length):
        raise ArcError("R", f"must be at least half of the distance, {0.5 * chord:.6g} m")
    # The centre of the shorter arc to the left is on the left.
    height = math.sqrt(max(length**2 - 0.25 * chord**2, 0.0)) * (sign if radius > 0.0 else -sign)
    return _about(_beside(start, end, height), start, end, sign)


def arc_about(start: list[float], end: list[float], centre: list[float], sign: float, half: float) -> PlaneArc:
    """Arc about a centre; one that ends where it starts is a full circle."""
    radius, other = math.dist(start, centre), math.dist(end, centre)
    allowed = max(missed(half), RADIUS_TOLERANCE * radius)
    if radius <= SAME_PLACE or not abs(other - radius) <= allowed:
        radii = f"radius {radius:.6g} m at the start, {other:.6g} m at the end"
        raise ArcError(radii, f"must be above 0 and differ by at most {allowed:.3g} m")
    chord = math.dist(start, end)
    if chord <= SAME_PLACE:
        return PlaneArc(centre, sign * 2.0 * math.pi, start)
    # The centre that is as far from the end as from the start; where it is far away, the end moves instead.
    across, up = end[0] - start[0], end[1] - start[1]
    height = (across * (centre[1] - start[1]) - up * (centre[0] - start[0])) / chord
    moved = _beside(start, end, height)
    if math.dist(moved, centre) <= allowed:
        return _about(moved, start, end, sign)
    scale = radius / other
    return _about(centre, start, [c + scale * (x - c) for c, x in zip(centre, end, strict=True)], sign)


def _beside(start: list[float], end: list[float], height: float) -> list[float]:
    # Position beside the middle of a chord, to its left where the height is above 0.
    across, up = end[0] - start[0], end[1] - start[1]
    chord = math.hypot(across, up)
    return [0.5 * (start[0] + end[0]) - height * up / chord, 0.5 * (start[1] + end[1]) + height * across / chord]


def _about(centre: list[float], start: list[float], end: list[float], sign: float) -> PlaneArc:
    first = math.atan2(start[1] - centre[1], start[0] - centre[0])
    angle = math.atan2(end[1] - centre[1], end[0] - centre[0]) - first
    return PlaneArc(centre, sign * (sign * angle % (2.0 * math.pi)) or sign * 2.0 * math.pi, end)
