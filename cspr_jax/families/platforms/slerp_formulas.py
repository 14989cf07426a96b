"""Formulas of oscillating SLERP, with rational numbers: thesis section 3.7.

With theta the angle and n the axis of half the envelope's rotation, q = (cos(beta theta), n sin(beta theta)). Where the
axis does not move, as from or to the reference orientation, theta is affine in the amplitude function.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from cspr_jax.families.platforms.oscillating_slerp import Slerp
from cspr_jax.motion.formulas import Expression, combined, constant, function, rational, rationals

# Axes of the envelope whose sine of the angle between them is smaller are the same.
SAME_AXIS = 1e-12


def rotation_law_formula(betas: Sequence[Fraction], tau: Expression) -> Expression:
    """beta_ff of (3.93) as a function of tau; see `oscillating_slerp.rotation_law`."""
    start, end, fraction, arcs = betas
    h = tau * ((end - start) * fraction) + start * fraction
    cosine, cosine3 = function("cos_pi", tau * arcs), function("cos_pi", tau * (3 * arcs))
    return ((h + 9) * cosine - (h + 1) * cosine3) * Fraction(1, 8)


def orientation_formula(slerp: Slerp, amplitude: Expression, beta: Expression) -> list[Expression]:
    """Quaternion of the orientation, (3.59) to (3.65)."""
    start, across = np.asarray(slerp.start, float), np.asarray(slerp.across, float)
    phi = amplitude * rational(slerp.angle)
    if np.linalg.norm(np.cross(start[1:], across[1:])) < SAME_AXIS:
        axis, (angle, sense) = _fixed_axis(start, across)
        theta = phi * sense + rational(angle)
        return _quaternion(combined([1], [rationals(axis)]), theta, beta)
    cosine, sine = function("cos", phi), function("sin", phi)
    scalar, *vector = combined([cosine, sine], [rationals(start), rationals(across)])
    norm = function("sqrt", sum((x * x for x in vector), constant(0)))
    return _quaternion([x / norm for x in vector], function("acos", scalar), beta)


def _fixed_axis(start: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, tuple[float, int]]:
    # Axis, angle at the start, and whether the angle grows (1), falls (-1) or stays (0) with that of the envelope.
    longer = start[1:] if np.linalg.norm(start[1:]) >= np.linalg.norm(across[1:]) else across[1:]
    norm = float(np.linalg.norm(longer))
    axis = longer / norm if norm > 0.0 else np.array([1.0, 0.0, 0.0])
    sine, cosine = float(start[1:] @ axis), float(start[0])
    rise = float(across[1:] @ axis) * cosine - float(across[0]) * sine
    return axis, (math.atan2(sine, cosine), round(rise))


def _quaternion(axis: list[Expression], theta: Expression, beta: Expression) -> list[Expression]:
    angle = beta * theta
    return [function("cos", angle), *(function("sin", angle) * x for x in axis)]
