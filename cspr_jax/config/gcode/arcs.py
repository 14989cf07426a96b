"""Arcs of G-code, whose ends miss the circle because their coordinates are rounded."""

import math
from typing import NamedTuple

# Largest difference of the radii at start and end, over the radius, as in controllers.
RADIUS_TOLERANCE = 0.001
# Positions closer together than this are the same, m.
SAME_PLACE = 1e-9


class PlaneArc(NamedTuple):
    """Arc in its plane.

    Fields:
        centre: [a, b], m.
        angle: angle by which it turns, positive from a to b, rad.
        end: [a, b] of its end on the circle, m: as written, or off by less than the tolerance of radii.
    """

    centre: list[float]
    angle: float
    end: list[float]


class ArcError(ValueError):
    """Numbers that make no arc; arguments are the word, or the error, and what is allowed."""


def missed(half: float) -> float:
    """Largest difference of the radii at start and end that comes from rounding of coordinates by up to `half`."""
    # The radius at the start is off by sqrt(2) halves, from the offset of the centre; the radius at the end by three
    # times as much, since on each axis start, offset and end are rounded.
    return 4.0 * math.sqrt(2.0) * half


def arc_of_radius(start: list[float], end: list[float], radius: float, sign: float, half: float) -> PlaneArc:
    """Arc given by its radius."""
    across, up = end[0] - start[0], end[1] - start[1]
    chord, length = math.hypot(across, up), abs(radius)
    if chord <= SAME_PLACE:
        raise ArcError("R", "must be I or J where an arc ends above or at its start")
    if 0.5 * chord > length + max(missed(half), RADIUS_TOLERANCE * length):
        raise ArcError("R", f"must be at least half of the distance, {0.5 * chord:.6g} m")
    # An arc of at most half a circle that turns to the left has its centre on the left of its chord.
    height = math.sqrt(max(length**2 - 0.25 * chord**2, 0.0)) * (sign if radius > 0.0 else -sign)
    return _about(_beside(start, end, height), start, end, sign)


def arc_about(start: list[float], end: list[float], centre: list[float], sign: float, half: float) -> PlaneArc:
    """Arc given by its centre; an arc that ends where it starts is a full circle."""
    radius, other = math.dist(start, centre), math.dist(end, centre)
    allowed = max(missed(half), RADIUS_TOLERANCE * radius)
    if radius <= SAME_PLACE or not abs(other - radius) <= allowed:
        radii = f"radius {radius:.6g} m at the start, {other:.6g} m at the end"
        raise ArcError(radii, f"must be above 0 and differ by at most {allowed:.3g} m")
    chord = math.dist(start, end)
    if chord <= SAME_PLACE:
        return PlaneArc(centre, sign * 2.0 * math.pi, start)
    # Move the centre so that start and end have one radius; where that takes it too far, move the end instead.
    across, up = end[0] - start[0], end[1] - start[1]
    height = (across * (centre[1] - start[1]) - up * (centre[0] - start[0])) / chord
    moved = _beside(start, end, height)
    if math.dist(moved, centre) <= allowed:
        return _about(moved, start, end, sign)
    scale = radius / other
    return _about(centre, start, [c + scale * (x - c) for c, x in zip(centre, end, strict=True)], sign)


def _beside(start: list[float], end: list[float], height: float) -> list[float]:
    # Position at a height above the middle of a chord; positive heights are to the left of the chord.
    across, up = end[0] - start[0], end[1] - start[1]
    chord = math.hypot(across, up)
    return [0.5 * (start[0] + end[0]) - height * up / chord, 0.5 * (start[1] + end[1]) + height * across / chord]


def _about(centre: list[float], start: list[float], end: list[float], sign: float) -> PlaneArc:
    first = math.atan2(start[1] - centre[1], start[0] - centre[0])
    angle = math.atan2(end[1] - centre[1], end[0] - centre[0]) - first
    return PlaneArc(centre, sign * (sign * angle % (2.0 * math.pi)) or sign * 2.0 * math.pi, end)
