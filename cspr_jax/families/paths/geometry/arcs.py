"""Arcs of a plan, and moves of G-code, as elements of paths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cspr_jax.config.gcode.reading import Move
from cspr_jax.errors import InputError
from cspr_jax.families.paths.geometry.elements import Arc, Element, Straight

if TYPE_CHECKING:
    from jaxtyping import Float

# Part of its radius by which an arc may begin beside the plane of its centre: rounding.
BESIDE = 1e-6


def arc_of(
    centre: Float[np.ndarray, "3"], start: Float[np.ndarray, "3"], normal: Float[np.ndarray, "3"], angle: float
) -> Arc:
    """Arc of a circle."""
    axis = normal / np.linalg.norm(normal)
    radius = start - centre
    height = float(radius @ axis)
    size = float(np.linalg.norm(radius - height * axis))
    if size == 0.0 or abs(height) > BESIDE * size:
        allowed = "in a plane with the start, normal to `normal`, and apart from it"
        raise InputError("centre", centre.tolist(), allowed)
    return Arc(centre + height * axis, start, axis, angle)


def elements_of(moves: Sequence[Move]) -> list[Element]:
    """Lines, arcs and helices of moves, each with a stop behind it where the program pauses."""
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
