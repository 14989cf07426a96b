"""Affine bounds of swings about P0, hypocycloids of standard or variable amplitude, over a block of time."""

from __future__ import annotations

import math
from typing import Any

from jax import Array

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, rotated, stacked
from cspr_jax.numerics.bounds.function_bounds import sincospi
from cspr_jax.numerics.shapes import Float, Num
from cspr_jax.verification.bounds.amplitude_bounds import TimeBounds


def swing_bounds(
    segment: Any, arcs: Num[Array, ""], duration: Float[Array, ""], block: TimeBounds, *, variable: bool = False
) -> tuple[AffineBounds, AffineBounds, AffineBounds]:
    """Bounds of position, velocity and acceleration over one block.

    Formulas are those of `families.platforms.platform_segment` in the precessing frame, which for a standard amplitude
    are the closed form of (2.32) to (2.48).
    """
    span, tau = segment.end_radius - segment.start_radius, block.tau
    r, r1, r2 = (value * span for value in block.values[:3])
    r = r + segment.start_radius
    omega, nu = segment.sense * math.pi * arcs, segment.precession / arcs
    steady = (math.pi * arcs) ** 2 * (1.0 - nu) * (1.0 + nu)
    sine, cosine = sincospi(tau * (segment.sense * arcs))
    lateral, axial = sincospi(tau * (segment.sense * segment.precession))
    if variable:
        r3 = block.values[3] * span
        local_position = (r * cosine - r1 * sine * (1.0 / omega), r * sine * nu)
        w = ((r * steady + r2) * (-1.0 / omega), r1 * (2.0 * nu))
        w1 = (r1 * (2.0 * nu**2 * omega - steady / omega) - r3 * (1.0 / omega), (r * steady + r2 * 3.0) * nu)
        local_velocity = (sine * w[0], sine * w[1])
        second_derivative = tuple(cosine * rate * omega + sine * change for rate, change in zip(w, w1, strict=True))
    else:
        local_position = (r * cosine, r * sine * nu)
        local_velocity = (r1 * cosine - r * sine * (steady / omega), r1 * sine * nu)
        second_derivative = (
            (r2 - r * steady) * cosine - r1 * sine * (2.0 * steady / omega),
            (r2 + r * steady) * sine * nu,
        )
    # Rotate into the axes of the robot.
    position, velocity, acceleration = (
        rotated(segment.plane, stacked([axial * x + lateral * y, axial * y - lateral * x]))
        for x, y in (local_position, local_velocity, second_derivative)
    )
    return position + segment.center, velocity * (1.0 / duration), acceleration * (1.0 / duration**2)
