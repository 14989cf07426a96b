"""Releases: the segment through a release, and bounds of the search for one, in the units of its unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors import InputError, shown
from cspr_jax.families.beziers.sequences import duration_bounds
from cspr_jax.maps.release_box import Range, box_of
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import sincospi
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float


def through(
    start: Float[Array, "3"],
    position: Float[Array, "3"],
    velocity: Float[Array, "3"],
    fraction: Float[Array, ""],
    duration: Float[Array, ""],
) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Control points of the segment that passes a position with a velocity, (29)."""
    sine, c = sincospi(jnp.asarray(fraction, float))
    step = duration * velocity / (jnp.pi * sine)
    middle = (start * (1.0 + c) - 2.0 * position) / (c - 1.0) - step
    end = (start * (1.0 + c) ** 2 - 4.0 * c * position) / (c - 1.0) ** 2 - 2.0 * step * (1.0 + c) / (c - 1.0)
    return middle, end


# A release is searched for between these fractions of the duration of the segment.
EARLIEST, LATEST = 0.01, 0.99


class ReleaseBounds(NamedTuple):
    """Bounds of the unknowns.

    Unknowns are the position of release, m, the logarithms of the time of flight and of the duration, s, and the time
    of release as a fraction of the duration.

    Fields:
        low: (6,) lower bounds.
        high: (6,) upper bounds.
    """

    low: Any
    high: Any


def bounds_of(
    problem: Problem, frame: Frame, releases: Sequence[Range] = (None, None, None), longest: float | None = None
) -> ReleaseBounds:
    """Bounds of the unknowns."""
    box = box_of(problem.robot, frame, releases)
    short, long = duration_bounds(problem, np.zeros((2, 3)))
    if longest is not None and not np.log(longest) > short:
        raise InputError("max_duration", longest, f"above {shown(float(np.exp(short)))} s, for a robot of this size")
    last = long if longest is None else min(np.log(longest), long)
    return ReleaseBounds(np.array([*box.low, short, short, EARLIEST]), np.array([*box.high, long, last, LATEST]))
