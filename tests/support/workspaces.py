"""The package's robots of those of `support.cable_robots`."""

import numpy as np

from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.model.point_mass import point_mass_robot
from support.cable_robots import GRAVITY

ROUND = np.diag([0.05, 0.05, 0.05])


def made(drawn):
    """The package's robot of a drawn one, z up."""
    common = {"mass": drawn.mass, "gravity": GRAVITY, "z_axis": "up", "name": drawn.name, "pattern": drawn.pattern}
    if not PATTERNS[drawn.pattern].is_body:
        return point_mass_robot(drawn.base, **common)
    return platform_robot(drawn.base, drawn.platform, inertia=ROUND, centre_of_mass=drawn.arm, **common)
