"""Corners of paths: elements one behind another, in tracks from stop to stop, blended at corners or not.

A blend is a quintic from a place on one element to a place on the next one, with the place, direction and curvature
that the elements have there. Between straight lines it ends the distance d from the corner, and passes it at the
distance 3/8 d sin(angle / 2).
"""

import itertools
from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy.interpolate import BPoly

from cspr_jax.curves.interpolation import hermite
from cspr_jax.paths.elements import Element, Nodes
from cspr_jax.paths.section import Track

# Directions that differ by less go on, rad; below the second, rounded numbers are to blame, and corners are blended.
SAME_DIRECTION, ROUNDED_DIRECTION = 1e-9, 1e-3
# Distance within which such corners are blended, m.
ROUNDED = 1e-6
# Sharper corners turn back, so that a blend would almost stand still there, rad.
TURNING_BACK = 2.9
# Part of an element that a blend takes at most.
LARGEST_SHARE = 0.49

Corners = Literal["every", "stop", "blend"]


def tracks_of(elements: Sequence[Element], corners: Corners = "stop", tolerance: float = 0.0) -> list[Track]:
    """Tracks from stop to stop; the points of each are the ends of its elements.

    Args:
        elements: each begins where the one before ends.
        corners: "every": stops wherever two elements meet; "stop": at corners; "blend": where corners turn back alone.
        tolerance: largest distance of a blend from its corner, m.

    Returns:
        the tracks.
    """
    cuts = _cuts(elements, corners, tolerance)
    stops = [i + 1 for i, cut in enumerate(cuts) if cut is None]
    tracks = []
    for first, last in zip([0, *stops], [*stops, len(elements)], strict=True):
        tracks.append(_track(elements[first:last], [0.0, *(cut or 0.0 for cut in cuts[first : last - 1]), 0.0]))
    return tracks


def _cuts(elements: Sequence[Element], corners: Corners, tolerance: float) -> list[float | None]:
    # Lengths that blends take off both elements; 0 where the direction goes on, None where the motion stops.
    directions = np.array([element.directions for element in elements])
    one, other = directions[:-1, 1], directions[1:, 0]
    angles = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.sum(one * other, axis=1)).tolist()
    return [
        None
        if corners == "every" or before.ends_at_rest or not (before.moves and after.moves)
        else _cut(before, after, angle, corners, tolerance)
        for (before, after), angle in zip(itertools.pairwise(elements), angles, strict=True)
    ]


def _cut(before: Element, after: Element, angle: float, corners: Corners, tolerance: float) -> float | None:
    if angle <= SAME_DIRECTION:
        return 0.0
    if angle <= ROUNDED_DIRECTION:
        tolerance = max(tolerance, ROUNDED) if corners == "blend" else ROUNDED
    elif corners == "stop" or angle > TURNING_BACK:
        return None
    corner = after.nodes(0.0, after.length).place[0]
    length = min(
        (1.0 - 1e-12) * tolerance / (0.375 * np.sin(0.5 * angle)), LARGEST_SHARE * min(before.length, after.length)
    )
    while (distance := float(np.linalg.norm(_blend(before, after, length)(length) - corner))) > tolerance:
        length *= max(0.5, 0.99 * tolerance / distance)
    return length


def _blend(before: Element, after: Element, length: float) -> BPoly:
    # Hermite piece over twice the length that it takes off each element.
    one = before.nodes(0.0, before.length - length)
    other = after.nodes(length, after.length)
    ends = [np.stack([getattr(one, name)[-1], getattr(other, name)[0]]) for name in ("place", "first", "second")]
    s = np.array([0.0, 2.0 * length])
    return BPoly(np.moveaxis(hermite(s, ends), 1, 0), s)


def _track(elements: Sequence[Element], cuts: Sequence[float]) -> Track:
    # Join elements, of which the cuts, one more than elements, are taken off at both ends.
    parts, speeds, marks, s = list[Nodes](), list[np.ndarray](), [0.0], 0.0
    for i, (element, before, after) in enumerate(zip(elements, cuts, cuts[1:], strict=False)):
        nodes = element.nodes(before, element.length - after)
        nodes = nodes._replace(s=nodes.s - before + s)
        parts.append(nodes)
        speeds.append(np.full(len(nodes.s) - 1, element.speed))
        s = float(nodes.s[-1])
        if i + 1 < len(elements):
            following = elements[i + 1]
            middle, speed = s + after, min(element.speed, following.speed)
            if after:
                values = _blend(element, following, after)
                parts.append(Nodes(np.array([middle]), *(values([after], order) for order in range(3))))
            speeds.append(np.full(2 if after else 1, speed))
            s = s + 2.0 * after
        else:
            middle = s
        marks.append(middle)
    joined = Nodes(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    twice = np.flatnonzero(joined.s[1:] == joined.s[:-1])
    for values in (joined.place, joined.first) if len(twice) else ():
        # Elements miss each other by rounding.
        values[twice] = values[twice + 1] = 0.5 * (values[twice] + values[twice + 1])
    return Track(joined.s, joined.place, joined.first, joined.second, np.concatenate(speeds), np.array(marks))
