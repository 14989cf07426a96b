"""Robots from Python: made of numbers, as a robot file has them."""

from cspr_jax.robots.limits import Limits
from cspr_jax.robots.platform import PlatformRobot, platform_robot
from cspr_jax.robots.point_mass import STANDARD_GRAVITY, Axis, PointMassRobot, planar_robot, point_mass_robot


def point_mass(
    base_points,
    *,
    mass: float,
    gravity: float = STANDARD_GRAVITY,
    z_axis: Axis = "down",
    planar: bool = False,
    name: str = "robot",
    limits: Limits | None = None,
) -> PointMassRobot:
    """A point mass on cables.

    Args:
        base_points: (n_cables, 3) spool points, at least three, or two if planar; m.
        mass: kg, positive.
        gravity: m/s^2, positive.
        z_axis: where z points, "down" or "up".
        planar: whether everything lies in the plane y = 0.
        name: for people.
        limits: limits beyond taut cables; None: none.

    Returns:
        the robot.

    Raises:
        InputError: what a robot file with these numbers would be refused for.
    """
    make = planar_robot if planar else point_mass_robot
    return make(base_points, mass=mass, gravity=gravity, name=name, z_axis=z_axis, limits=limits)


def platform(
    base_points,
    platform_points,
    *,
    mass: float,
    inertia,
    centre_of_mass=None,
    gravity: float = STANDARD_GRAVITY,
    z_axis: Axis = "down",
    name: str = "robot",
    limits: Limits | None = None,
) -> PlatformRobot:
    """A rigid platform on cables.

    Args:
        base_points: (n_cables, 3) spool points, at least six; m.
        platform_points: (n_cables, 3) attachment points in platform axes, cable by cable; m.
        mass: kg, positive.
        inertia: (3, 3) about the mass centre, platform axes, kg m^2.
        centre_of_mass: (3,) in platform axes, m; None: their origin.
        gravity: m/s^2, positive.
        z_axis: where z points, "down" or "up".
        name: for people.
        limits: limits beyond taut cables; None: none.

    Returns:
        the robot.

    Raises:
        InputError: what a robot file with these numbers would be refused for.
    """
    centre = (0.0, 0.0, 0.0) if centre_of_mass is None else centre_of_mass
    more = {"gravity": gravity, "name": name, "z_axis": z_axis, "limits": limits}
    return platform_robot(base_points, platform_points, mass=mass, inertia=inertia, centre_of_mass=centre, **more)
