"""Section of a path: a curve without corners over the path coordinate, and how fast each piece may be run along."""

from typing import NamedTuple

import numpy as np

from cspr_jax.curves.spline import Spline


class Section(NamedTuple):
    """Section of a path.

    Fields:
        curve: NumPy leaves; its time is the path coordinate s, about the length that is run through, m.
        speed: (m,) largest speed of the mass centre on each of its m pieces, m/s, inf for none.
        marks: (k,) values of s at which it passes its points.
    """

    curve: Spline
    speed: np.ndarray
    marks: np.ndarray


class Settings(NamedTuple):
    grid: int
    ramp_time: float
    start_speed: float = 0.0
    end_speed: float = 0.0
