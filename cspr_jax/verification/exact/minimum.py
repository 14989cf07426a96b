"""Smallest value of a slack within blocks of time, enclosed by balls: the lowest block is cut until enough is known.

Within a block a component is bounded from below by its value and first derivative in the middle and the smallest second
derivative in the block, by the largest first derivative, and by its range. Near a minimum the first of these errs by
the cube of the block's length only. Attained values bound the smallest one from above.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any, NamedTuple

import flint

from cspr_jax.verification.exact.components import Component
from cspr_jax.verification.exact.series import ORDER, SeriesPiece, ball, number

# Components of a slack on a piece around a time since its start; within a radius of it, if one is given.
Components = Callable[[SeriesPiece, flint.arb, flint.arb | None], list[Component]]
# Blocks shorter than this fraction of the shortest block at the start are not cut.
SHORTEST = Fraction(1, 2**140)


class PiecePart(NamedTuple):
    """Part of a piece.

    Fields:
        piece: piece of the motion.
        start: time since the start of the piece, s.
        end: likewise.
    """

    piece: SeriesPiece
    start: Fraction
    end: Fraction


class Minimum(NamedTuple):
    """Smallest value of a slack within blocks.

    Fields:
        low: lower bound, -inf without one.
        value: ball of an attained value, inf without one: the smallest value is not larger.
        when: time at which it is attained, from the start of the motion, s.
    """

    low: flint.arb
    value: flint.arb
    when: Fraction

    @property
    def high(self) -> flint.arb:
        """Upper bound of the smallest value."""
        return self.value.upper()


def minimum(
    components: Components, blocks: Iterable[PiecePart], is_enough: Callable[[Minimum], bool], largest_count: int
) -> Minimum:
    """Enclose the smallest value until enough is known, or the largest number of blocks is reached."""
    order, heap = itertools.count(), list[tuple[flint.arb, int, PiecePart]]()
    best, when, count = flint.arb("inf"), Fraction(0), 0
    pending = list(blocks)
    shortest = min((block.end - block.start for block in pending), default=Fraction(0)) * SHORTEST
    floor = flint.arb("inf")
    while True:
        for block in pending:
            low, value, time = _bounds(components, block)
            count += 1
            if value.upper() < best.upper():
                best, when = value, time
            if low < best.upper() or not best.is_finite():
                heapq.heappush(heap, (low, next(order), block))
        lowest = heap[0][0] if heap else best.lower()
        lowest = min(lowest, floor)
        answer = Minimum(lowest, best, when)
        if not heap or count >= largest_count or is_enough(answer) or not lowest < floor:
            return answer
        low, _, block = heapq.heappop(heap)
        if block.end - block.start <= shortest:
            floor, pending = low.min(floor), []
            continue
        middle = (block.start + block.end) / 2
        pending = [block._replace(end=middle), block._replace(start=middle)]


def _bounds(components: Components, block: PiecePart) -> tuple[flint.arb, flint.arb, Fraction]:
    # Lower bound of a block, and a value that is attained in it, with its time from the start of the motion.
    middle, radius = (block.start + block.end) / 2, ball((block.end - block.start) / 2)
    centre = ball(middle)
    at_middle, within = components(block.piece, centre, None), components(block.piece, centre, radius)
    low, offset = flint.arb("inf"), Fraction(0)
    for (at, _), (over, applies) in zip(at_middle, within, strict=True):
        if applies is not False:
            bound, shift = lowest(at, over, radius)
            if not bound >= low:
                low, offset = bound, shift
    value, time = attained(at_middle), middle
    if offset:
        moved = attained(components(block.piece, ball(middle + offset), None))
        if moved.upper() < value.upper():
            value, time = moved, middle + offset
    return low, value, block.piece.start + time


def attained(components: list[Component]) -> flint.arb:
    """Value of a slack at one time, from its components there; inf where it is not known."""
    values = [part.value[0] for part in components if part.applies and part.value.prec > 0]
    finite = [value for value in values if value.is_finite()]
    if not finite:
        return flint.arb("inf")
    lowest = finite[0]
    for value in finite[1:]:
        lowest = lowest.min(value)
    return lowest


def lowest(at: Any, over: Any, radius: flint.arb) -> tuple[flint.arb, Fraction]:
    """Lower bound of a component from its series in the middle and over the block, and about where it is lowest."""
    if min(at.prec, over.prec) < ORDER:  # coefficients beyond it read as zero
        return flint.arb("-inf"), Fraction(0)
    value, rate = at[0], at[1]
    bounds = [over[0].lower(), (value - abs(over[1]).upper() * radius).lower()]
    curvature, offset = over[2].lower(), Fraction(0)
    if curvature.is_finite() and rate.is_finite():
        turn = -rate / (2 * curvature) if curvature > 0 else flint.arb("inf")
        if curvature > 0 and not abs(turn) > radius:
            bounds.append((value - rate * rate / (4 * curvature)).lower())
            offset = max(-number(radius), min(number(radius), number(turn)))
        else:
            bounds.append((value - abs(rate) * radius + curvature * radius * radius).lower())
            offset = number(radius) * (-1 if rate > 0 else 1)
    finite = [bound for bound in bounds if bound.is_finite()]
    if not finite:
        return flint.arb("-inf"), offset
    largest = finite[0]
    for bound in finite[1:]:
        largest = largest.max(bound)
    return largest.lower(), offset
