"""Bounds within which a release is looked for, in the units of the unknowns."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.errors import InputError, shown
from cspr_jax.families.beziers.sequences import duration_bounds
from cspr_jax.maps.release_box import Range, box_of
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.linear.frames import Frame

# Parts of the duration of the segment between which a release is looked for.
EARLIEST, LATEST = 0.01, 0.99


class ReleaseBounds(NamedTuple):
    """Bounds of the unknowns: place of the release, m, logarithms of the flight's time and of the duration, s, share.

    Fields:
        low: (6,) smallest values.
        high: (6,) largest values.
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
