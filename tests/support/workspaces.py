"""The package's robots of those of `support.cable_robots`."""

import numpy as np

from cspr_jax.robots import point_mass
from cspr_jax.robots.platform import platform_robot
from support.cable_robots import GRAVITY

ROUND = np.diag([0.05, 0.05, 0.05])


def made(drawn):
    """The package's robot of a drawn one, z up."""
    name = {"1T": "guided_robot", "2T": "planar_robot", "3T": "point_mass_robot"}
    common = {"mass": drawn.mass, "gravity": GRAVITY, "z_axis": "up", "name": drawn.name}
    if drawn.pattern in name:
        return getattr(point_mass, name[drawn.pattern])(drawn.base, **common)
    more = {"inertia": ROUND, "centre_of_mass": drawn.arm, "pattern": drawn.pattern}
    return platform_robot(drawn.base, drawn.platform, **common, **more)
