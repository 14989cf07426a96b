"""Box in which maps of launches search for a release."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.model.point_mass import PLANAR, PointMassRobot, spool_radius

# Half width and depth of the box over the radius of the spools; it hangs on the vertical through their centroid.
ASIDE, DEEP = 2.0, 4.0

Range = Sequence[float] | None


class ReleaseBox(NamedTuple):
    """Bounds of the position of release, from the centroid of the spools, z down.

    Fields:
        low: (3,) lower bounds, m.
        high: (3,) upper bounds, m.
    """

    low: np.ndarray
    high: np.ndarray


def box_of(robot: PointMassRobot, frame: Frame, releases: Sequence[Range] = (None, None, None)) -> ReleaseBox:
    """Box in which releases are searched for; given ranges replace its default ones."""
    radius = float(spool_radius(robot))
    aside = 0.0 if robot.dof == PLANAR else ASIDE * radius
    corners = frame.outward([[-ASIDE * radius, -aside, 0.0], [ASIDE * radius, aside, DEEP * radius]])
    for i, ends in enumerate(releases):
        if ends is not None:
            corners[:, i] = ends
    inner = np.sort(frame.inward(corners), axis=0)
    if robot.dof == PLANAR and inner[:, 1].any():
        raise InputError("release_y", releases[1], "[0, 0], or absent: a planar robot")
    return ReleaseBox(*inner)
