"""Corners of paths: consecutive elements are joined from stop to stop; corners are blended or are stops.

A blend is a quintic from a point on one element to a point on the next, with the position, direction and curvature of
the elements at these points. Between straight lines, its ends are at the distance d from the corner, and its middle at
the distance 3/8 d sin(angle / 2).
"""

import itertools
from collections.abc import Sequence
from typing import Literal

import numpy as np

from cspr_jax.families.paths.geometry.elements import Element, Nodes
from cspr_jax.families.paths.geometry.section import PositionPath

SAME_DIRECTION = 1e-9  # rad; directions that differ by less form no corner
ROUNDED_DIRECTION = 1e-3  # rad; corners below this are due to rounding, and blended even if others are stops
ROUNDED = 1e-6  # m; tolerance of blends at such corners
# Corners sharper than this, rad, are not blended: a motion along the blend would almost stop.
TURNING_BACK = 2.9
# Largest fraction of an element that a blend replaces.
MAX_FRACTION = 0.49

Corners = Literal["every", "stop", "blend"]


def position_paths_of(
    elements: Sequence[Element], corners: Corners = "stop", tolerance: float = 0.0
) -> list[PositionPath]:
    """Paths from stop to stop through consecutive elements; knots are at the ends of elements."""
    lengths = _blend_lengths(elements, corners, tolerance)
    splits = [0, *(np.flatnonzero(np.isnan(lengths)) + 1).tolist(), len(elements)]
    return [
        _position_path(elements[first:end], np.array([0.0, *lengths[first : end - 1], 0.0]))
        for first, end in itertools.pairwise(splits)
    ]


def _blend_lengths(elements: Sequence[Element], corners: Corners, tolerance: float) -> np.ndarray:
    # Return the lengths that blends cut off the elements at corners: 0 if the direction is continuous, NaN at stops.
    if corners == "every":
        return np.full(len(elements) - 1, np.nan)
    element_lengths = np.array([element.length for element in elements])
    directions = np.array([element.at(np.array([0.0, element.length])).first for element in elements])
    one, other = directions[:-1, 1], directions[1:, 0]
    angles = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.sum(one * other, axis=1))
    turns, is_rounded = angles > SAME_DIRECTION, angles <= ROUNDED_DIRECTION
    moves = np.array([element.moves for element in elements])
    ends_at_rest = np.array([element.ends_at_rest for element in elements])[:-1]
    is_stop = ends_at_rest | ~moves[:-1] | ~moves[1:] | (~is_rounded & ((corners == "stop") | (angles > TURNING_BACK)))
    allowed = np.where(is_rounded, max(tolerance, ROUNDED) if corners == "blend" else ROUNDED, tolerance)
    sines = np.sin(0.5 * np.where(turns, angles, 1.0))
    largest = MAX_FRACTION * np.minimum(element_lengths[:-1], element_lengths[1:])
    lengths = np.where(turns, np.minimum((1.0 - 1e-12) * allowed / (0.375 * sines), largest), 0.0)
    lengths[is_stop] = np.nan
    open_corners = np.flatnonzero(lengths > 0.0)
    while len(open_corners):
        ends = [elements[i].at(element_lengths[i] - lengths[[i]]) for i in open_corners.tolist()]
        starts = [elements[i + 1].at(lengths[[i]]) for i in open_corners.tolist()]
        offsets = _middles(ends, starts, lengths[open_corners]).position - np.array(
            [elements[i + 1].start for i in open_corners.tolist()]
        )
        missed = np.linalg.norm(offsets, axis=1) / allowed[open_corners]
        open_corners, missed = open_corners[missed > 1.0], missed[missed > 1.0]
        lengths[open_corners] *= np.maximum(0.5, 0.99 / missed)
    return lengths


def _middles(before: Sequence[Nodes], after: Sequence[Nodes], lengths: np.ndarray) -> Nodes:
    # Return the middles of blends from the last node of one element to the first node of the next; a blend is twice as
    # long as the length cut off.
    _, position, first, second = (np.array([column[-1] for column in columns]) for columns in zip(*before, strict=True))
    _, *ends = (np.array([column[0] for column in columns]) for columns in zip(*after, strict=True))
    length = lengths[:, None]
    return Nodes(
        lengths,
        0.5 * (position + ends[0]) + 0.3125 * length * (first - ends[1]) + 0.0625 * length**2 * (second + ends[2]),
        0.9375 * (ends[0] - position) / length - 0.4375 * (first + ends[1]) - 0.0625 * length * (second - ends[2]),
        0.75 * (ends[1] - first) / length - 0.25 * (second + ends[2]),
    )


def _position_path(elements: Sequence[Element], lengths: np.ndarray) -> PositionPath:
    # Join elements, with blends that replace these lengths at their ends; the first and the last length are 0.
    lines = [
        element.nodes(before, element.length - after)
        for element, (before, after) in zip(elements, itertools.pairwise(lengths.tolist()), strict=True)
    ]
    blended = np.flatnonzero(lengths)
    middles = dict[int, Nodes]()
    if len(blended):
        blends = _middles([lines[i - 1] for i in blended], [lines[i] for i in blended], lengths[blended])
        middles = {i: Nodes(*(column[[k]] for column in blends)) for k, i in enumerate(blended.tolist())}
    parts, speeds, knots, s = list[Nodes](), list[np.ndarray](), list[float](), 0.0
    for i, (element, line, length) in enumerate(zip(elements, lines, lengths.tolist(), strict=False)):
        slowest = min(element.speed, elements[i - 1].speed)
        knots.append(s + length)
        if length:
            parts.append(middles[i]._replace(s=np.array([s + length])))
        if i:
            speeds.append(np.full(2 if length else 1, slowest))
        parts.append(line._replace(s=line.s - length + (s + 2.0 * length)))
        speeds.append(np.full(len(line.s) - 1, element.speed))
        s = float(parts[-1].s[-1])
    joined = Nodes(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    twice = np.flatnonzero(joined.s[1:] == joined.s[:-1])
    for values in (joined.position, joined.first) if len(twice) else ():
        # Ends of elements differ by rounding: take their mean.
        values[twice] = values[twice + 1] = 0.5 * (values[twice] + values[twice + 1])
    return PositionPath(
        joined.s, joined.position, joined.first, joined.second, np.concatenate(speeds), np.array([*knots, s])
    )
