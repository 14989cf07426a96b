"""Quantities of poses at rest, in maps of workspaces."""

from cspr_jax.schema.quantity import Quantity

# In place of the row of motions.
POSE_VERDICT = Quantity(
    "verdict",
    "1",
    "verdict of the pose",
    "Bit flags of what keeps the robot from resting there under all conditions; 0: nothing does.",
    "uint32",
    unflagged="inside",
)
POSES = (
    Quantity(
        "wrench_margin",
        "N",
        "margin of the tensions",
        "Largest distance that tensions which supply all wrenches can keep from their finite limits; negative "
        "outside of the workspace, infinite where nothing bounds it, -inf where the cables do not span the wrenches.",
        signed=True,
        better="larger",
    ),
    Quantity(
        "capacity_margin",
        "N",
        "capacity margin",
        "Distance of the wrenches that must be supplied from the faces of all that the cables can supply, moments over "
        "`workspace.capacity_length`; negative outside of the workspace, -inf where the cables do not span the "
        "wrenches.",
        signed=True,
    ),
    Quantity(
        "clearance",
        "m",
        "clearance",
        "Smallest distance of all checked pairs: of cables without a common point, and of cables and platform "
        "from obstacles and of cables from the platform where the sweep has these; less the cables' thickness.",
        signed=True,
        better="larger",
    ),
    Quantity(
        "clearance_cables",
        "m",
        "clearance of the cables from each other",
        "Smallest distance between cables without a common point, less their diameter.",
        signed=True,
    ),
    Quantity(
        "clearance_obstacles",
        "m",
        "clearance of cables and platform from obstacles",
        "Smallest distance of a cable's surface or the platform from an obstacle; of a platform and a box the "
        "largest gap between their shadows on a line, which is never more.",
        signed=True,
    ),
    Quantity(
        "clearance_platform",
        "m",
        "clearance of the cables from the platform",
        "Smallest distance of a cable's surface from the platform; ten diameters of each cable next to its "
        "attachment point, or a hundredth of the platform if that is more, are left out, so that it is at most so "
        "large.",
        signed=True,
    ),
    Quantity(
        "nearest_bodies",
        "1",
        "what is nearest",
        "Which pair `clearance` belongs to: 1: two cables; 2: a cable and an obstacle; 3: a cable and the "
        "platform; 4: the platform and an obstacle; 0: nothing can meet, or not requested.",
        "int16",
        meanings="nearest-bodies",
    ),
    Quantity(
        "floor_margin",
        "m",
        "height above the floor",
        "Height above the floor of the mass centre, or of the joint of a body that turns about one; negative below it.",
        signed=True,
    ),
    Quantity(
        "length_margin",
        "m",
        "margin of the cable lengths",
        "Smallest of the largest lengths less the lengths of the cables.",
        signed=True,
    ),
    Quantity(
        "speed_margin",
        "m s-1",
        "margin of the cable speeds",
        "Smallest of the largest speeds less the greatest speeds of the cables that the velocities asked for need.",
        signed=True,
    ),
    Quantity(
        "cell_side",
        "1",
        "side of the whole cell",
        "1: every position of the cell, the box half-way to the next points, is proved inside; 2: every one is "
        "proved outside; 0: not decided, or not requested.",
        "int16",
        meanings="cell-sides",
    ),
    Quantity(
        "orientation_fraction",
        "1",
        "part of the orientations",
        "Part of a set of orientations, by volume, that is inside the workspace at a place; of one pose 0 or 1.",
        better="larger",
    ),
)
