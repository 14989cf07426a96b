"""Coordinates of the axes of maps, and the best point of each."""

from cspr_jax.schema.quantity import Quantity

AXES = {
    q.name: q
    for q in (
        Quantity("x", "m", "x of the target", "Horizontal coordinate of the target."),
        Quantity("y", "m", "y of the target", "Horizontal coordinate of the target."),
        Quantity("radius", "m", "distance from the central vertical", "From the vertical through the centroid."),
        Quantity("azimuth", "rad", "azimuth", "Direction of the target from the central vertical, from x to y."),
        Quantity("z", "m", "z of the target", "Vertical coordinate of the target; see z_axis."),
        Quantity(
            "tilt_azimuth",
            "rad",
            "azimuth phi of the tilt",
            "From the direction of the target, in workspaces from x; tilt and torsion.",
        ),
        Quantity("tilt", "rad", "tilt theta", "Angle between the platform's normal and the vertical."),
        Quantity("torsion", "rad", "torsion sigma", "Of tilt and torsion, Z_phi X_theta Z_(sigma - phi)."),
        Quantity("z0", "m", "depth of P0 below the centroid", "The point P0 about which the effector swings."),
        Quantity(
            "inclination",
            "1",
            "inclination",
            "How much deeper below the spools the target is than P0, over z0: v of thesis (1.31).",
        ),
        Quantity("tau", "1", "normalised time", "Time since the start of the segment over its duration."),
        Quantity("cable", "1", "cable", "Number of a cable, in cable order from 1 on."),
        Quantity("from_x", "m", "x of the start point", "Horizontal coordinate of the start point."),
        Quantity("from_y", "m", "y of the start point", "Horizontal coordinate of the start point."),
        Quantity("from_z", "m", "z of the start point", "Vertical coordinate of the start point."),
    )
}
# Axes that say an orientation together.
TILT_TORSION = ("tilt_azimuth", "tilt", "torsion")
# No choices: a motion passes all of its instants, and a robot has all of its cables.
_NO_CHOICES = ("tau", "cable")


def best_name(axis: str) -> str:
    """The quantity that says which point of an axis is the best one.

    Returns:
        its name.
    """
    return f"best_{axis}"


# A map holds these too once the best point of an axis is chosen for each cell of the other axes; no file has them.
BEST = {
    q.name: q
    for q in (
        Quantity(
            best_name(axis.name),
            axis.units,
            f"best {axis.long_name}",
            f"With `--best {axis.name}`: the point of this axis that the other quantities of the cell belong to; NaN "
            "where none will do.",
        )
        for axis in AXES.values()
        if axis.name not in _NO_CHOICES
    )
}
