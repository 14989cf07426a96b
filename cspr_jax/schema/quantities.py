"""The one table of everything that a result file can hold: it gives names, units, labels and docs."""

import dataclasses
from collections import ChainMap
from typing import Literal

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.schema.limits import LARGEST_MULTIPLE
from cspr_jax.schema.verdicts import FLAGS, SENTENCES, Verdict

# Narrower types, by the type of today, in which earlier versions stored the same numbers.
EARLIER = {"uint32": ("uint16",)}


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A dataset of a result file, or a coordinate of its axes.

    Fields:
        name: of the dataset.
        units: as in UDUNITS; "1" for a pure number.
        long_name: a short phrase for labels.
        description: one sentence.
        kind: "float" (of the run's dtype) or the NumPy name of an integer type.
        unflagged: word of pictures where no flag of a verdict is set; empty: it is no verdict.
        signed: whether either sign is as good as the other, so that zero is in the middle of a picture's colours.
        meanings: row of `schema.meanings.MEANINGS`, if its whole numbers stand for words; empty: they do not.
        contoured: whether sections of it show where it is a whole number.
        better: which of two cells' numbers is better; empty: neither.
    """

    name: str
    units: str
    long_name: str
    description: str
    kind: Literal["float", "uint32", "uint16", "int16"] = "float"
    unflagged: str = ""
    signed: bool = False
    meanings: str = ""
    contoured: bool = False
    better: Literal["", "smaller", "larger"] = ""

    @property
    def readable(self) -> tuple[str, ...]:
        """NumPy names of the types in which files hold it, its own first."""
        return ("float64", "float32") if self.kind == "float" else (self.kind, *EARLIER.get(self.kind, ()))


# Coordinates of the axes of maps.
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
# Axes that give an orientation together.
TILT_TORSION = ("tilt_azimuth", "tilt", "torsion")
# Axes without a best point: a motion passes all of its instants, and a robot has all of its cables.
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

# These texts say what verdicts rest on, and what the margin is.
HOW = ", proved, but sampled for platforms on more than six cables"
MARGIN = (
    "Smallest pseudotension over its value at rest in P0 (platforms: that of six equal ones), "
    "or depth below the spools over z0; platforms on more cables: how far all tensions can keep from their limits, "
    "divided by the weight per cable."
)
TRAJECTORY = {
    q.name: q
    for q in (
        Quantity("t", "s", "time", "Time since the start of the plan."),
        Quantity("position", "m", "position", "Position of the effector (x, y, z)."),
        Quantity("velocity", "m s-1", "velocity", "Velocity of the effector (x, y, z)."),
        Quantity("acceleration", "m s-2", "acceleration", "Acceleration of the effector (x, y, z)."),
        Quantity("quaternion", "1", "orientation", "Unit quaternion of the platform (w, x, y, z)."),
        Quantity("omega", "rad s-1", "angular velocity", "Angular velocity of the platform, fixed axes (x, y, z)."),
        Quantity("omega_dot", "rad s-2", "angular acceleration", "Its derivative in time, fixed axes (x, y, z)."),
        Quantity("length", "m", "cable length", "Length of each cable, in cable order."),
        Quantity("rate", "m s-1", "cable rate", "Rate of each cable's length; positive pays out."),
        Quantity(
            "tension",
            "N",
            "cable tension",
            "Tension of each cable, in cable order; of redundant cables those of the rule of the plan, `tensions`; "
            "where it finds none within their limits, those of least norm.",
        ),
        Quantity(
            "tension_residual",
            "1",
            "residual of the tensions",
            "Of redundant cables: |W t - w| / (1 N + |w|), with W t the wrench that the tensions give and w the one "
            "that the motion requires; moments divided by the platform's size.",
        ),
        Quantity(
            "tension_each",
            "N",
            "tension of each of six cables",
            "Of a platform that only translates, in cable order: the shares of `tension`, which is then, as `length` "
            "and `rate`, that of each pair with its winch, in the order of the first cable of each.",
        ),
        Quantity(
            "tension_couple",
            "N",
            "tension couple",
            "Joint pull of two neighbouring cables seen along the line of their spools, Boralugoda (30) to (33).",
        ),
        Quantity(
            "path_acceleration",
            "m s-2",
            "acceleration along the line",
            "Along a straight line: the least feasible one at that place, that of the motion, and the largest feasible "
            "one; infinite where nothing bounds it.",
        ),
    )
}
# A motion file holds these for each segment of its plan, and `TRAJECTORY` for each of its rows over time.
SEGMENTS = {
    q.name: q
    for q in (
        Quantity("segment", "1", "segment", "Number of a segment, in the order of the plan from 1 on.", "int16"),
        Quantity("segment_start", "s", "start of the segment", "Time since the start of the plan."),
        Quantity("segment_end", "s", "end of the segment", "Time since the start of the plan."),
        Quantity(
            "segment_arcs",
            "1",
            "smallest number of arcs",
            f"Smallest number of feasible arcs, or the plan's own if feasible{HOW}; 0: none.",
            "int16",
        ),
        Quantity(
            "segment_tried_arcs",
            "1",
            "number of arcs of the motion",
            "Equal to `segment_arcs` where it is positive, else that of the motion that comes nearest.",
            "int16",
        ),
        Quantity("segment_verdict", "1", "verdict", f"Bit flags{HOW}; 0 is feasible.", "uint32"),
        Quantity("segment_margin", "1", "margin", MARGIN),
        Quantity("segment_cause", "1", "cause", "Flag of the worst of what stands in the way; 0: nothing.", "uint32"),
        Quantity(
            "segment_cause_cable", "1", "cable of the cause", "In cable order from 1 on; 0: no single cable.", "int16"
        ),
        Quantity(
            "segment_cause_time", "s", "time of the cause", "Since the start of the segment; NaN where it is not known."
        ),
        Quantity("segment_needed", "1", "needed", "What the segment has there: N, m, m/s or m/s^2, by its cause."),
        Quantity("segment_allowed", "1", "allowed", "The most, or the least, that is allowed, in the same unit."),
    )
}
# A motion file holds these for an object that the plan releases; the dimensions of each follow.
FLIGHT = {
    q.name: q
    for q in (
        Quantity("flight_t", "s", "time of the flight", "Time since the start of the plan, from the release on."),
        Quantity("flight_position", "m", "position of the object", "Position of the released object (x, y, z)."),
        Quantity("throw", "1", "throw", "Number of a throw of the sample of errors, from 1 on."),
        Quantity(
            "landing",
            "m",
            "landing",
            "Place (x, y) at the height of the target of each throw of the sample, over that of the target; NaN where "
            "the object never comes there.",
        ),
    )
}
FLIGHT_DIMS = {
    "flight_t": ("flight_t",),
    "flight_position": ("flight_t", "axis"),
    "throw": ("throw",),
    "landing": ("throw", "level"),
}
# Second dimensions of the quantities over time, and the parts along them.
ACROSS = {
    **dict.fromkeys(("position", "velocity", "acceleration", "omega", "omega_dot"), "axis"),
    "quaternion": "component",
    **dict.fromkeys(("length", "rate", "tension"), "cable"),
    "tension_each": "each",
    "tension_couple": "couple",
    "path_acceleration": "bound",
}
PARTS = {
    "each": tuple("123456"),
    "axis": tuple("xyz"),
    "level": tuple("xy"),
    "component": tuple("wxyz"),
    "couple": ("12", "23", "34", "41"),
    "bound": ("least", "actual", "largest"),
}
# Maps of poses have this row in place of the verdict of motions.
POSE_VERDICT = Quantity(
    "verdict",
    "1",
    "verdict of the pose",
    "Bit flags of what keeps the robot from resting there under all conditions; 0: nothing does.",
    "uint32",
    unflagged="inside",
)
# Why accessible orientations are not attained, by the best candidate's flags.
REFUSALS = {
    "refused_slack": Verdict.SLACK_CABLE,
    "refused_singular": Verdict.SINGULAR,
    "refused_cable_cable": Verdict.CABLE_CABLE,
    "refused_cable_platform": Verdict.CABLE_PLATFORM,
}
_REFUSED = (
    "a cable would have to push on the best motion.",
    "the best motion passes a singularity.",
    "two cables touch on the best motion.",
    "a cable touches the platform on the best motion.",
)

QUANTITIES = {
    q.name: q
    for q in (
        Quantity(
            "arcs",
            "1",
            "smallest number of arcs",
            f"Smallest number of feasible arcs{HOW}; 0: none.",
            "int16",
            better="smaller",
        ),
        Quantity("verdict", "1", "verdict", f"Bit flags{HOW}; 0 is feasible.", "uint32", unflagged="feasible"),
        Quantity(
            "duration",
            "s",
            "duration",
            "Duration with `arcs` arcs, or with `tried_arcs` where arcs is 0.",
            better="smaller",
        ),
        Quantity("margin", "1", "smallest normalised pseudotension", MARGIN, better="larger"),
        Quantity(
            "margin_bound",
            "1",
            "proved lower bound of the margin",
            "No instant of the segment has a smaller margin: proved; absent on more than six cables.",
        ),
        Quantity(
            "feasible_at_infinity",
            "1",
            "feasibility at infinity",
            "Left-hand side of thesis (2.55): positive means that enough arcs make the segment feasible.",
        ),
        Quantity(
            "tried_arcs",
            "1",
            "number of arcs of the motion",
            "Equal to `arcs` where it is positive, else the smallest number that a single limit refuses; "
            "if there is none, that with the largest margin.",
            "int16",
        ),
        Quantity(
            "limit_margin",
            "1",
            "smallest slack of the limits",
            "Smallest dimensionless slack of the limits given; infinite where none is. Point masses and platforms have "
            "formulas of their own (docs/theory.md), equal in sign alone.",
        ),
        Quantity(
            "tolerated",
            "1",
            "tolerated multiple of the uncertainty",
            "Largest multiple of `limits.uncertainty` found within which the motion of `tried_arcs` is proved feasible "
            f"for every robot; at most {LARGEST_MULTIPLE:g}, 0 where nothing is proved; NaN where the motion is not "
            "feasible as planned.",
        ),
        Quantity(
            "not_tolerated",
            "1",
            "multiple of the uncertainty not tolerated",
            "Smallest multiple of `limits.uncertainty` found within which the motion of `tried_arcs` is refuted for "
            "some robot; infinite where none was found; NaN where the motion is not feasible as planned.",
        ),
        Quantity(
            "oscillations",
            "1",
            "smallest number of oscillations",
            "Smallest number of oscillations proved feasible from the pseudotensions themselves; 0: none.",
            "int16",
            better="smaller",
        ),
        Quantity(
            "tried_oscillations",
            "1",
            "number of oscillations of the motion",
            "Equal to `oscillations` where it is positive, else the smallest number that a single limit refuses, or, "
            "where there is none, that with the largest margin.",
            "int16",
        ),
        Quantity(
            "envelope_oscillations",
            "1",
            "number of oscillations that the envelopes allow",
            "Smallest integer that keeps the envelopes (1.39) positive: sufficient, not necessary; 0: none.",
            "int16",
        ),
        Quantity(
            "least_oscillations",
            "1",
            "number of oscillations n, a real number",
            "Number that the envelopes require, (1.48) and (1.94); NaN where no number will do (|v A| reaches 1).",
            contoured=True,
        ),
        Quantity(
            "inclination_gain",
            "1",
            "oscillations saved by the inclination",
            "Real number of oscillations of the horizontal transition less that at this inclination.",
        ),
        Quantity(
            "squared_oscillations",
            "1",
            "squared oscillations N of the instant",
            "N of (1.44) of the cable, or the largest over the cables; at least A''(1) / (4 pi^2), so maybe negative.",
        ),
        Quantity(
            "lower_envelope",
            "1",
            "lower envelope of the normalised pseudotension",
            "(1.39) of the cable, or the lowest over the cables, with the real number `least_oscillations`.",
            better="larger",
        ),
        Quantity("used_inclination", "1", "inclination v", "Inclination of the transition, v of (1.31).", signed=True),
        Quantity(
            "det_margin",
            "1",
            "smallest determinant",
            "Smallest determinant of the structure matrix (cables and platform of unit size) over that at rest in P0.",
        ),
        Quantity(
            "cable_distance",
            "m",
            "smallest distance between cables",
            "Between cables that share neither spool nor platform point.",
        ),
        Quantity(
            "refuted_at",
            "s",
            "time of refutation",
            "Of the motion of `tried_arcs`, by its tensions, else by limits or contacts; NaN where it is not refuted.",
        ),
        Quantity("beta_hat", "1", "beta-hat at the target", "Of the motion that the other quantities belong to."),
        Quantity(
            "accessible",
            "1",
            "accessible orientations",
            "Number of orientations joined to the reference one without interference or singularity.",
        ),
        Quantity(
            "accessible_points",
            "1",
            "accessible part of the grid points",
            "Of all orientations of the grid; NaN for a scan, which has no grid.",
        ),
        Quantity("accessible_volume", "1", "accessible part of SO(3)", "By volume (Haar measure).", better="larger"),
        Quantity(
            "accessible_error", "1", "its error", "Difference of the accessible volume from that with twice the step."
        ),
        Quantity("largest_tilt", "rad", "largest accessible tilt", "Over all accessible orientations."),
        Quantity(
            "attainable", "1", "attainable orientations", "Number that a horizontal transition from rest attains."
        ),
        Quantity(
            "attainable_fraction",
            "1",
            "attainable part of the accessible orientations",
            "By number; NaN for none.",
            better="larger",
        ),
        Quantity("attainable_volume", "1", "attainable part of the accessible volume", "By volume; NaN for none."),
        Quantity(
            "attainable_error", "1", "its error", "Difference of the attainable fraction from that with twice the step."
        ),
        Quantity("mean_arcs", "1", "mean smallest number of arcs", "Over the attainable orientations."),
        Quantity("undecided_fraction", "1", "undecided part", "Of the accessible orientations."),
        Quantity(
            "main_reason",
            "1",
            "main reason",
            "Why most of the accessible orientations that are not attained are not: a verdict's flag; 0: all are.",
            "uint32",
            unflagged="all attained",
        ),
        *(
            Quantity(
                name, "1", f"refused: {flag.text.replace('_', ' ')}", f"Part of the accessible orientations: {words}"
            )
            for (name, flag), words in zip(REFUSALS.items(), _REFUSED, strict=True)
        ),
        Quantity(
            "acceleration_margin",
            "m s-2",
            "margin of rest",
            "Distance of rest from the nearest face of the feasible accelerations: positive inside the wrench-feasible "
            "workspace, that is with the limits of the tensions.",
            signed=True,
            better="larger",
        ),
        Quantity(
            "static_margin",
            "m s-2",
            "margin of rest without limits of tensions",
            "As `acceleration_margin` without limits of the tensions: positive inside the static workspace.",
            signed=True,
        ),
        Quantity(
            "closure_margin",
            "1",
            "margin of wrench closure",
            "Positive inside the wrench-closure workspace, where the cables can resist every force; -1 where they do "
            "not even span the space. Never positive of suspended robots.",
            signed=True,
            better="larger",
        ),
        Quantity(
            "wrench_margin",
            "N",
            "margin of the tensions",
            "Largest distance that tensions which supply all wrenches can keep from their finite limits; negative "
            "outside of the workspace, infinite where nothing bounds it, -inf where the cables do not span the "
            "wrenches.",
            signed=True,
            better="larger",
        ),
        Quantity(
            "capacity_margin",
            "N",
            "capacity margin",
            "Distance of the wrenches that must be supplied from the faces of all that the cables can supply, moments "
            "over `workspace.capacity_length`; negative outside of the workspace, -inf where the cables do not span "
            "the wrenches.",
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
            "Height above the floor of the mass centre, or of the joint of a body that turns about one; negative "
            "below it.",
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
        Quantity(
            "level_acceleration",
            "m s-2",
            "level acceleration in every direction",
            "Largest size of a level acceleration that is feasible in every direction; 0 where rest is not feasible.",
        ),
        Quantity(
            "level_acceleration_max",
            "m s-2",
            "largest level acceleration",
            "In the best direction; 0 where no level acceleration is feasible, infinite where nothing bounds it.",
        ),
        Quantity(
            "upward_acceleration",
            "m s-2",
            "largest upward acceleration",
            "Infinite where nothing bounds it, 0 where rest is not feasible.",
        ),
        Quantity(
            "downward_acceleration",
            "m s-2",
            "largest downward acceleration",
            "Of free fall, where no smallest tension is given; 0 where rest is not feasible.",
        ),
        Quantity(
            "acceleration_time", "s", "time of acceleration p", "Part of the duration of the S-model before it brakes."
        ),
        Quantity(
            "least_duration",
            "s",
            "least duration of any motion",
            "Of all motions along the line: it accelerates at the bound, then brakes at it. No law is faster.",
        ),
        Quantity("duration_ratio", "1", "duration over the least one", "Of the law, over that of any motion."),
        Quantity(
            "rest_margin",
            "m s-2",
            "margin of rest at both ends",
            "Distance of rest from the nearest face of the feasible accelerations, at the worse of both ends.",
            signed=True,
        ),
        Quantity(
            "active_up",
            "1",
            "bound that holds back the acceleration",
            "Number of the choice of cables that spans it, from 1 on, in the order of their numbers: of four cables "
            "1 2, 1 3, 1 4, 2 3, 2 4, 3 4; the next number: the largest acceleration; 0: none.",
            "int16",
            meanings="line-bounds",
        ),
        Quantity(
            "active_down",
            "1",
            "bound that holds back the braking",
            "As `active_up`, while it brakes.",
            "int16",
            meanings="line-bounds",
        ),
        Quantity(
            "largest_margin",
            "1",
            "largest margin of the segments tried",
            "Largest margin (smallest slack of taut cables, depth and limits) that a launch to the cell was found to "
            "have; below 0 no launch was found, which is no proof that there is none.",
            signed=True,
            better="larger",
        ),
        Quantity(
            "release_speed",
            "m s-1",
            "least speed at the release",
            "Of the feasible launches found; NaN where none was.",
            better="smaller",
        ),
        Quantity(
            "release_time", "s", "time of the release", "After the start of the segment, of the launch of least speed."
        ),
        Quantity("flight_time", "s", "time of the flight", "From the release to the landing, at the least speed."),
        *(
            Quantity(
                f"release_{name}", "m", f"{name} of the release", "Place of the release of the launch of least speed."
            )
            for name in "xyz"
        ),
        Quantity(
            "sigma_p",
            "m m-1",
            "sensitivity of the position",
            "Largest displacement over the largest error of a cable length, Machines 11 (2), 2023, 224, (7); at "
            "least 1, infinite where the cables do not hold the effector.",
            better="smaller",
        ),
        Quantity(
            "sigma_r",
            "rad m-1",
            "sensitivity of the orientation",
            "Largest turn over the largest error of a cable length, errors of all cables independent; NaN for point "
            "masses.",
        ),
        Quantity("used_z0", "m", "depth of P0 below the centroid", "Depth of P0 that the inclination requires."),
    )
}
EVERY = ChainMap(AXES, QUANTITIES, BEST, TRAJECTORY, SEGMENTS, FLIGHT)
_OWN = frozenset(QUANTITIES)


def columns_of(name: str, count: int) -> list[str]:
    """Columns of a quantity of a motion in a CSV file.

    Args:
        name: of the quantity, a row of `TRAJECTORY`.
        count: of its numbers at an instant.

    Returns:
        their heads.
    """
    if name not in ACROSS:
        return [name]
    return [f"{name}_{part}" for part in PARTS.get(ACROSS[name], [str(k + 1) for k in range(count)])]


def register(quantity: Quantity) -> None:
    """Add a quantity that maps can give, from outside of the package; a second time changes nothing.

    Raises:
        InputError: another quantity, or a coordinate, has that name.
    """
    tables = (AXES, QUANTITIES, BEST, TRAJECTORY, SEGMENTS, FLIGHT)
    known = next((table[quantity.name] for table in tables if quantity.name in table), quantity)
    if known != quantity:
        raise InputError("quantity", quantity.name, "a name that no other quantity or axis has")
    QUANTITIES[quantity.name] = quantity


def from_outside() -> list[Quantity]:
    """Quantities from outside of the package, which another process does not know.

    Returns:
        their rows.
    """
    return [quantity for name, quantity in QUANTITIES.items() if name not in _OWN]


def flag_attributes() -> dict[str, object]:
    """The CF attributes that explain `verdict`.

    Returns:
        flag_masks and flag_meanings.
    """
    masks = np.array([flag.value for flag in SENTENCES], FLAGS)
    return {"flag_masks": masks, "flag_meanings": " ".join(flag.text for flag in SENTENCES)}
