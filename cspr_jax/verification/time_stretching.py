"""Least uniform stretching of time with which a motion is feasible.

Stretching by c divides velocities by c and accelerations by c^2, so that the wrench that cables must supply is affine
in u = 1 / c^2. Weighted means of feasible tensions for two values of u are feasible for values between them: at every
time the feasible u form an interval, and so they do for the full motion. The smallest distance of tensions from their
limits is concave in u, and speeds and accelerations of cables decrease with c: a search along u finds a feasible
stretching if there is one. Not so under limits of torque, power and load of winches: friction that grows with speed,
and products with it, are no lines over u, and at standstill friction acts in either direction. What is found is proved
then, too, but a smaller stretching may exist, or one where none is found.
"""

import functools
import math
import operator
from collections.abc import Callable
from typing import NamedTuple

from cspr_jax.schema.limits import LIMITS
from cspr_jax.verification.proved_answers import TENSIONS, MotionProof

SLOWEST = 1e6  # factor of stretching from which on a motion counts as at rest
CLOSE = 1e-6  # relative error of the least factor
# Steps of the search for a feasible u where rest is not feasible, each of which narrows it by the golden section.
STEPS, GOLDEN = 40, 0.5 * (math.sqrt(5.0) - 1.0)
# Criteria that a motion may meet though rest fails: torques of motors follow tensions.
OF_FORCES = functools.reduce(operator.or_, (row.flag for row in LIMITS if row.of_winch), TENSIONS)


class Stretching(NamedTuple):
    """Result of a search for the least stretching.

    Fields:
        factor: factor of durations that is proved feasible; NaN: none was found.
        proof: proof of the stretched motion; if none was found, of the motion stretched by `SLOWEST`.
        is_static: whether the path is proved feasible at rest at all points, so that some stretching is feasible.
    """

    factor: float
    proof: MotionProof
    is_static: bool


def least_stretching(proved: Callable[[float], MotionProof]) -> Stretching:
    """Find the least stretching that is proved feasible, to a relative error of `CLOSE`."""
    first = proved(1.0)
    if first.is_feasible:
        return Stretching(1.0, first, is_static=False)
    slowest = proved(SLOWEST)
    is_static = slowest.is_feasible
    feasible = _any_feasible(proved, slowest) if not is_static else _doubled(proved)
    if feasible is None:
        return Stretching(math.nan, slowest, is_static)
    high, proof = feasible
    low = max(1.0, 0.5 * high) if is_static else 1.0
    while high - low > CLOSE * high:
        middle = 0.5 * (low + high)
        trial = proved(middle)
        if trial.is_feasible:
            high, proof = middle, trial
        else:
            low = middle
    return Stretching(high, proof, is_static)


def _doubled(proved: Callable[[float], MotionProof]) -> tuple[float, MotionProof] | None:
    factor = 1.0
    while factor < SLOWEST:
        factor *= 2.0
        proof = proved(factor)
        if proof.is_feasible:
            return factor, proof
    return None


def _any_feasible(proved: Callable[[float], MotionProof], slowest: MotionProof) -> tuple[float, MotionProof] | None:
    # Criteria other than tensions that fail at rest fail for all u. Else the worst slack has a single maximum over u.
    if any(
        is_broken and not row.flag & OF_FORCES for row, is_broken in zip(slowest.criteria, slowest.broken, strict=True)
    ):
        return None
    low, high = 0.0, 1.0
    best: dict[float, MotionProof] = {}

    def worst(u: float) -> float:
        proof = best[u] = proved(1.0 / math.sqrt(u))
        return float((proof.proof.high / proof.scales).min())

    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    values = worst(left), worst(right)
    for _ in range(STEPS):
        for u, proof in best.items():
            if proof.is_feasible:
                return 1.0 / math.sqrt(u), proof
        if values[0] < values[1]:
            low, left, right = left, right, left + GOLDEN * (high - left)
            values = values[1], worst(right)
        else:
            high, right, left = right, left, right - GOLDEN * (right - low)
            values = worst(left), values[0]
    return None
