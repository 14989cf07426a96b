"""Table of all quantities that result files can contain, with names, units, labels and descriptions."""

import dataclasses
import re
from collections import ChainMap
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.schema.limits import LARGEST_MULTIPLE
from cspr_jax.schema.verdicts import FLAGS, SENTENCES, Verdict

# For some types, narrower ones in which earlier versions stored the same numbers.
EARLIER = {"uint32": ("uint16",)}


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A dataset of a result file, or a coordinate of its axes.

    Fields:
        name: name of the dataset.
        units: units in UDUNITS; "1" for a pure number.
        long_name: a short phrase for labels.
        description: one sentence.
        kind: "float" (of the run's dtype) or the NumPy name of an integer type.
        unflagged: word in pictures for a verdict without flags; empty: it is no verdict.
        signed: whether both signs are equally good, so that zero is in the middle of a picture's colours.
        meanings: row of `schema.meanings.MEANINGS`, if its integers stand for words; empty: they do not.
        contoured: whether sections show lines where it is an integer.
        better: whether smaller or larger numbers are better; empty: neither.
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
        """NumPy names of the types in which files may store it, its own first."""
        return ("float64", "float32") if self.kind == "float" else (self.kind, *EARLIER.get(self.kind, ()))


# Coordinates of the axes of maps.
AXES = {
    q.name: q
    for q in (
        Quantity("x", "m", "x of the target", "Horizontal coordinate of the target."),
        Quantity("y", "m", "y of the target", "Horizontal coordinate of the target."),
        Quantity(
            "radius",
            "m",
            "distance from the central vertical",
            "Distance of the target from the vertical through the centroid.",
        ),
        Quantity(
            "azimuth",
            "rad",
            "azimuth",
            "Direction of the target seen from the vertical through the centroid, from x to y.",
        ),
        Quantity("z", "m", "z of the target", "Vertical coordinate of the target; see z_axis."),
        Quantity("circle_radius", "m", "radius of the circle", "Radius of the circle about the target."),
        Quantity("scale", "1", "scale of the ellipse", "Factor of the half-axes that the sweep gives."),
        Quantity(
            "tilt_azimuth",
            "rad",
            "azimuth phi of the tilt",
            "Angle phi of tilt and torsion, from the direction of the target; in maps of workspaces and ellipses, "
            "from x.",
        ),
        Quantity(
            "tilt",
            "rad",
            "tilt theta",
            "Angle between the platform's normal and the vertical; of ellipses, by which they are turned about the "
            "level line in the direction phi.",
        ),
        Quantity("torsion", "rad", "torsion sigma", "Angle sigma of tilt and torsion, Z_phi X_theta Z_(sigma - phi)."),
        Quantity(
            "z0",
            "m",
            "depth of P0 below the centroid",
            "Depth below the centroid of P0, about which the effector swings.",
        ),
        Quantity(
            "inclination",
            "1",
            "inclination",
            "Depth of the target below the spools less that of P0, over z0: v of thesis (1.31).",
        ),
        Quantity("tau", "1", "normalised time", "Time since the start of the segment over its duration."),
        Quantity("cable", "1", "cable", "Number of a cable, in cable order from 1 on."),
        Quantity("frequency", "rad s-1", "frequency", "Frequency of the turns on the ellipse."),
        Quantity("from_x", "m", "x of the start point", "Horizontal coordinate of the start point."),
        Quantity("from_y", "m", "y of the start point", "Horizontal coordinate of the start point."),
        Quantity("from_z", "m", "z of the start point", "Vertical coordinate of the start point."),
        Quantity(
            "arrangement",
            "1",
            "arrangement of the cables",
            "Which attachment point the cable of each spool has: number of a permutation in lexicographic order; 0: as "
            "in the robot file.",
        ),
    )
}
# Axes that together give an orientation.
TILT_TORSION = ("tilt_azimuth", "tilt", "torsion")
# Axes without a best point: a motion passes all times, and a robot has all cables.
_NO_CHOICES = ("tau", "cable")
# Beginning of the names of axes that are parameters of the robot, and what the names of parameters are.
PARAMETER = "parameter."
# Name of the axis, and of the value among those of parameters, that says which attachment point each cable has.
ARRANGEMENT = "arrangement"
PARAMETER_NAME = r"[A-Za-z][A-Za-z0-9_-]{0,49}"


def best_name(axis: str) -> str:
    """Name of the quantity that holds the best point of an axis."""
    return f"best_{axis}"


# Quantities of maps in which the best point of an axis was chosen for each cell of the other axes; no file has them.
BEST = {
    q.name: q
    for q in (
        Quantity(
            best_name(axis.name),
            axis.units,
            f"best {axis.long_name}",
            f"With `--best {axis.name}`: the best point of this axis, at which the cell's other quantities hold; "
            "NaN where no point is feasible.",
        )
        for axis in AXES.values()
        if axis.name not in _NO_CHOICES
    )
}

# Parts of descriptions: what verdicts rest on, and what the margin is.
HOW = " (proved)"
MARGIN = (
    "Smallest pseudotension over its value at rest in P0 (platforms: that of six equal ones), "
    "or smallest depth below the spools over z0, whichever is less; platforms on more cables: distance that all "
    "tensions can keep from their limits, over the weight per cable."
)
# Margins of maps are as close as `verification.time_proof.CLOSE`.
_BOUNDED = (
    "As its proof bounds it: the smallest itself may be less by 0.2 %, near zero by 0.02 % of what is usual along the "
    "motion."
)
# Units of margins, by the index in motion files.
MARGIN_UNITS = ("1", "N", "m/s^2")
TRAJECTORY = {
    q.name: q
    for q in (
        Quantity("t", "s", "time", "Time since the start of the plan."),
        Quantity("position", "m", "position", "Position of the effector (x, y, z)."),
        Quantity("velocity", "m s-1", "velocity", "Velocity of the effector (x, y, z)."),
        Quantity("acceleration", "m s-2", "acceleration", "Acceleration of the effector (x, y, z)."),
        Quantity(
            "quaternion",
            "1",
            "orientation",
            "Unit quaternion of the platform (w, x, y, z), counted from its reference orientation, unless the plan "
            'says point = "origin".',
        ),
        Quantity("omega", "rad s-1", "angular velocity", "Angular velocity of the platform, fixed axes (x, y, z)."),
        Quantity(
            "omega_dot",
            "rad s-2",
            "angular acceleration",
            "Angular acceleration of the platform, fixed axes (x, y, z).",
        ),
        Quantity("length", "m", "cable length", "Length of each cable, in cable order."),
        Quantity("rate", "m s-1", "cable rate", "Rate of each cable's length; positive pays out."),
        Quantity(
            "tension",
            "N",
            "cable tension",
            "Tension of each cable, in cable order. The plan's rule `tensions` chooses those of redundant cables; "
            "where it finds none within the limits, they are those of least norm.",
        ),
        Quantity(
            "tension_residual",
            "1",
            "residual of the tensions",
            "Redundant cables: |W t - w| / (1 N + |w|), where the tensions give the wrench W t and the motion "
            "requires w; moments are divided by the platform's size.",
        ),
        Quantity(
            "tension_each",
            "N",
            "tension of each of six cables",
            "Platforms that only translate: tension of each of the six cables, in cable order. `tension`, `length` and "
            "`rate` are then those of the three pairs, in the order of each pair's first cable.",
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
            "Acceleration along a straight line: the least that is feasible at that place, that of the motion, and the "
            "largest that is feasible; infinite where nothing bounds it.",
        ),
        Quantity(
            "mass_centre",
            "m",
            "position of the mass centre",
            'Motions with point = "origin": position of the mass centre (x, y, z). `position`, `velocity` and '
            "`acceleration` are then those of the origin of the platform's axes, and `quaternion` turns these axes.",
        ),
        Quantity(
            "binding",
            "1",
            "what binds",
            "Flag of the criterion that is nearest to being broken, or broken by most: tensions over the weight "
            "per cable, lengths over the size of the robot, all else over its limit. Contacts count where they fail.",
            "uint32",
        ),
        Quantity(
            "binding_cable", "1", "cable that binds", "Number of its cable, from 1 on; 0: no single cable.", "int16"
        ),
    )
}
# Quantities of motion files for each segment of the plan; `TRAJECTORY` has those for each row over time.
SEGMENTS = {
    q.name: q
    for q in (
        Quantity("segment", "1", "segment", "Number of a segment, in the order of the plan from 1 on.", "int16"),
        Quantity("segment_start", "s", "start of the segment", "Start of the segment, since the start of the plan."),
        Quantity("segment_end", "s", "end of the segment", "End of the segment, since the start of the plan."),
        Quantity(
            "segment_arcs",
            "1",
            "smallest number of arcs",
            f"Smallest feasible number of arcs, or the plan's own number if feasible{HOW}; 0: none.",
            "int16",
        ),
        Quantity(
            "segment_tried_arcs",
            "1",
            "number of arcs of the motion",
            "`segment_arcs` where that is positive, else the number of arcs of the best candidate.",
            "int16",
        ),
        Quantity("segment_verdict", "1", "verdict", f"Bit flags of the verdict{HOW}; 0: feasible.", "uint32"),
        Quantity("segment_margin", "1", "margin", MARGIN),
        Quantity(
            "segment_margin_unit", "1", "unit of the margin", "Unit of `segment_margin`: 0: 1, 1: N, 2: m/s^2.", "int16"
        ),
        Quantity(
            "segment_tension_margin",
            "N",
            "margin of tensions",
            "Smallest distance of tensions from their limits; of redundant cables the largest that all can keep.",
        ),
        Quantity("segment_cause", "1", "cause", "Verdict flag of the worst cause; 0: no cause.", "uint32"),
        Quantity(
            "segment_cause_cable",
            "1",
            "cable of the cause",
            "Number of the cable, from 1 on; 0: no single cable.",
            "int16",
        ),
        Quantity("segment_cause_time", "s", "time of the cause", "Time since the start of the segment; NaN: unknown."),
        Quantity("segment_needed", "1", "needed", "Value that the motion has at the cause: N, m, m/s or m/s^2."),
        Quantity("segment_allowed", "1", "allowed", "Largest, or smallest, value that is allowed, in the same unit."),
    )
}
# Quantities of motion files for an object that the plan releases, with their dimensions.
FLIGHT = {
    q.name: q
    for q in (
        Quantity("flight_t", "s", "time of the flight", "Time since the start of the plan, from the release on."),
        Quantity("flight_position", "m", "position of the object", "Position of the released object (x, y, z)."),
        Quantity("throw", "1", "throw", "Number of a throw in the sample, from 1 on."),
        Quantity(
            "landing",
            "m",
            "landing",
            "Landing (x, y) of each throw of the sample at the height of the target, relative to the target; NaN where "
            "the object never comes to that height.",
        ),
    )
}
# Quantities of motion files for the intervals in which the motion fails, where these are known.
FAILURES = {
    q.name: q
    for q in (
        Quantity("failure", "1", "interval of failure", "Number of an interval of failure, from 1 on."),
        Quantity(
            "failing",
            "s",
            "time of the failure",
            "Start and end of the interval, since the start of the plan, in which a segment fails that is proved or "
            "refuted over its whole time.",
        ),
        Quantity("criterion_failure", "1", "interval of failure of a criterion", "Number of the interval, from 1 on."),
        Quantity(
            "criterion_failing",
            "s",
            "time of the failure of a criterion",
            "Start and end of an interval in which one criterion fails, since the start of the plan.",
        ),
        Quantity("criterion_flag", "1", "criterion that fails", "Verdict flag of the criterion.", "uint32"),
    )
}
# Quantities of motion files for the nodes of the grids on which least times along paths were computed.
PATHS = {
    q.name: q
    for q in (
        Quantity("path_node", "1", "node of the path", "Number of a node, over all sections of the plan, from 1 on."),
        Quantity("path_coordinate", "m", "path coordinate s", "Coordinate along the paths of the plan."),
        Quantity(
            "path_section",
            "1",
            "section of the path",
            "Number of the section, from stop to stop, from 1 on; where two meet there is a node of each.",
            "int16",
        ),
        Quantity("path_segment", "1", "segment of the node", "Number of the segment behind the node.", "int16"),
        Quantity(
            "path_speed",
            "m s-1",
            "path speed s'",
            "Path speeds: the least and the largest from which the end of the section can be reached on the grid "
            "(NaN: none), that of the motion (NaN: none), and the largest that limits of speeds allow (infinite: any).",
        ),
        Quantity(
            "segment_lower_bound",
            "s",
            "lower bound of the time",
            "Proved lower bound of the time of any motion forward along the segment, from stop to stop; NaN where a "
            "section without a stop runs on through a pose, or has no motion.",
        ),
        Quantity("path_binds", "1", "what binds", f"Bit flag of the limit that binds behind the node{HOW}.", "uint32"),
        Quantity(
            "path_binding_cable",
            "1",
            "cable that binds",
            "Number of its cable, from 1 on; 0: no single cable.",
            "int16",
        ),
    )
}
# Dimensions of quantities that belong neither to rows nor to segments.
OTHER_DIMS = {
    **dict.fromkeys(PATHS, ("path_node",)),
    "path_speed": ("path_node", "speed"),
    "segment_lower_bound": ("segment",),
    "failure": ("failure",),
    "failing": ("failure", "edge"),
    "criterion_failure": ("criterion_failure",),
    "criterion_failing": ("criterion_failure", "edge"),
    "criterion_flag": ("criterion_failure",),
    "flight_t": ("flight_t",),
    "flight_position": ("flight_t", "axis"),
    "throw": ("throw",),
    "landing": ("throw", "level"),
}
# Second dimensions of quantities over time, and names of the parts along them.
ACROSS = {
    **dict.fromkeys(("position", "velocity", "acceleration", "omega", "omega_dot", "mass_centre"), "axis"),
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
    "edge": ("start", "end"),
    "speed": ("least", "largest", "actual", "allowed"),
}
# Maps of poses have this row instead of the verdict of motions.
POSE_VERDICT = Quantity(
    "verdict",
    "1",
    "verdict of the pose",
    "Bit flags of the reasons why the robot cannot rest there under all conditions; 0: it can.",
    "uint32",
    unflagged="inside",
)
# Maps of ellipses have these rows instead of those of motions between poses.
OF_ELLIPSES = (
    Quantity(
        "verdict",
        "1",
        "verdict",
        f"Bit flags of the verdict of turns on the ellipse at `used_frequency`{HOW}; 0: feasible.",
        "uint32",
        unflagged="feasible",
    ),
    Quantity(
        "margin",
        "1",
        "smallest normalised pseudotension",
        "Smallest pseudotension along the ellipse at `used_frequency`, 1 at rest below the centroid of the spools, or "
        "smallest depth below the spools over that of the centre, if that is less; NaN for spools in several planes.",
        better="larger",
    ),
    Quantity("duration", "s", "duration of a turn", "Duration of one turn at `used_frequency`."),
    Quantity(
        "limit_margin",
        "1",
        "smallest slack of the limits",
        "Smallest slack of the limits beside tensions, and of the depth below the spools: lengths over the robot's "
        f"size, speeds and accelerations over what is allowed; NaN where only formulas are used. {_BOUNDED}",
    ),
)
# Maps of lines and paths have these rows instead of those of arcs and of ellipses.
OF_PATHS = (
    Quantity(
        "duration",
        "s",
        "duration",
        "Duration of the motion to the target; NaN where none is feasible, 0 where the target is the start.",
        better="smaller",
    ),
    Quantity(
        "tension_margin",
        "N",
        "smallest distance of a tension from its limits",
        "Smallest along the motion, of redundant cables that of the tensions that keep it largest; negative where they "
        "break a limit; along a slow motion where none is feasible, NaN where no free motion is found. "
        f"{_BOUNDED} Plans tell it to rounding.",
        signed=True,
    ),
    Quantity(
        "clearance",
        "m",
        "clearance of the motion",
        "Smallest distance of cables, and of a platform of known shape, from obstacles and from each other, along the "
        "motion, less the cables' thickness; NaN where something else is in the way of the motion.",
        signed=True,
        better="larger",
    ),
)
# Maps of motions among obstacles have this row instead of the clearance of poses.
MOTION_CLEARANCE = Quantity(
    "clearance",
    "m",
    "clearance of the motion",
    "Smallest distance of cables, and of a platform of known shape, from obstacles and from each other, along the "
    "motion of `tried_arcs`, less the cables' thickness; NaN where that motion is not feasible without them.",
    signed=True,
    better="larger",
)
# Reasons why accessible orientations are not attained, by flags of the best candidate.
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
            f"Smallest feasible number of arcs{HOW}; 0: none.",
            "int16",
            better="smaller",
        ),
        Quantity(
            "verdict", "1", "verdict", f"Bit flags of the verdict{HOW}; 0: feasible.", "uint32", unflagged="feasible"
        ),
        Quantity(
            "duration",
            "s",
            "duration",
            "Duration with `arcs` arcs, or with `tried_arcs` where `arcs` is 0.",
            better="smaller",
        ),
        Quantity("margin", "1", "smallest normalised pseudotension", MARGIN, better="larger"),
        Quantity(
            "margin_bound",
            "1",
            "proved lower bound of the margin",
            "Proved: the margin is no smaller at any time of the segment.",
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
            "`arcs` where that is positive, else the smallest number that one limit alone refuses; "
            "if there is none, the number with the largest margin.",
            "int16",
        ),
        Quantity(
            "limit_margin",
            "1",
            "smallest slack of the limits",
            "Smallest dimensionless slack of the limits; infinite without limits. The formulas of point masses and of "
            "platforms differ (docs/theory.md): only the signs compare.",
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
            "`oscillations` where that is positive, else the smallest number that one limit alone refuses; "
            "if there is none, the number with the largest margin.",
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
            "Oscillations that the envelopes require, (1.48) and (1.94); NaN where no number is enough (|v A| "
            "reaches 1).",
            contoured=True,
        ),
        Quantity(
            "inclination_gain",
            "1",
            "oscillations saved by the inclination",
            "`least_oscillations` of the horizontal transition less that at this inclination.",
        ),
        Quantity(
            "squared_oscillations",
            "1",
            "squared oscillations N at that time",
            "N of (1.44) for the cable, or the largest over the cables; at least A''(1) / (4 pi^2), which may be "
            "negative.",
        ),
        Quantity(
            "lower_envelope",
            "1",
            "lower envelope of the normalised pseudotension",
            "Envelope (1.39) of the cable, or the lowest over the cables, with `least_oscillations` oscillations.",
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
            "Smallest distance between cables that share neither spool nor platform point.",
        ),
        Quantity(
            "refuted_at",
            "s",
            "time of refutation",
            "Instant at which tensions, else limits or contacts, refute the motion of `tried_arcs`; NaN: not refuted.",
        ),
        Quantity("beta_hat", "1", "beta-hat at the target", "Beta-hat at the target, of the motion of the cell."),
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
            "Accessible part of all orientations of the grid; NaN for a scan, which has no grid.",
        ),
        Quantity(
            "accessible_volume",
            "1",
            "accessible part of SO(3)",
            "Accessible part of SO(3), by volume (Haar measure).",
            better="larger",
        ),
        Quantity(
            "accessible_error",
            "1",
            "its error",
            "Difference of `accessible_volume` from its value with twice the step.",
        ),
        Quantity("largest_tilt", "rad", "largest accessible tilt", "Largest tilt of all accessible orientations."),
        Quantity(
            "attainable",
            "1",
            "attainable orientations",
            "Number of orientations that a horizontal transition from rest attains.",
        ),
        Quantity(
            "attainable_fraction",
            "1",
            "attainable part of the accessible orientations",
            "Attainable part of the accessible orientations, by number; NaN if none is accessible.",
            better="larger",
        ),
        Quantity(
            "attainable_volume",
            "1",
            "attainable part of the accessible volume",
            "Attainable part of the accessible volume; NaN if none is accessible.",
        ),
        Quantity(
            "attainable_error",
            "1",
            "its error",
            "Difference of `attainable_fraction` from its value with twice the step.",
        ),
        Quantity(
            "mean_arcs",
            "1",
            "mean smallest number of arcs",
            "Mean of the smallest numbers of arcs to the attainable orientations.",
        ),
        Quantity("undecided_fraction", "1", "undecided part", "Undecided part of the accessible orientations."),
        Quantity(
            "main_reason",
            "1",
            "main reason",
            "Flag of the most frequent reason why accessible orientations are not attained; 0: all are attained.",
            "uint32",
            unflagged="all attained",
        ),
        *(
            Quantity(
                name,
                "1",
                f"refused: {flag.text.replace('_', ' ')}",
                f"Part of the accessible orientations for which {words}",
            )
            for (name, flag), words in zip(REFUSALS.items(), _REFUSED, strict=True)
        ),
        Quantity(
            "acceleration_margin",
            "m s-2",
            "margin of rest",
            "Distance of zero acceleration from the nearest face of the feasible accelerations, within the limits of "
            "the tensions: positive inside the wrench-feasible workspace.",
            signed=True,
            better="larger",
        ),
        Quantity(
            "static_margin",
            "m s-2",
            "margin of rest without limits of tensions",
            "As `acceleration_margin`, without limits of the tensions: positive inside the static workspace.",
            signed=True,
        ),
        Quantity(
            "closure_margin",
            "1",
            "margin of wrench closure",
            "Positive inside the wrench-closure workspace, where the cables can resist every wrench; -1 where they do "
            "not span the wrenches. Never positive for suspended robots.",
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
            "natural_frequency_min",
            "rad s-1",
            "lowest natural frequency",
            "Lowest natural frequency at rest on elastic cables, with the most central tensions where cables are "
            "redundant; 0 where the equilibrium is not stable, NaN where a cable is slack.",
            better="larger",
        ),
        Quantity(
            "capacity_margin",
            "N",
            "capacity margin",
            "Distance of the required wrenches from the faces of the set that the cables can supply, moments divided "
            "by `workspace.capacity_length`; negative outside of the workspace, -inf where the cables do not span the "
            "wrenches.",
            signed=True,
        ),
        Quantity(
            "clearance",
            "m",
            "clearance",
            "Smallest distance of all checked pairs, less the cables' thickness: between cables without a common point "
            "and, where the sweep has them, from cables and platform to obstacles and from cables to the platform.",
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
            "Smallest distance from a cable's surface or the platform to an obstacle; from the platform to a box a "
            "lower bound, the largest gap between their projections on a line.",
            signed=True,
        ),
        Quantity(
            "clearance_platform",
            "m",
            "clearance of the cables from the platform",
            "Smallest distance from a cable's surface to the platform. Ten diameters of each cable next to its "
            "attachment point, or a hundredth of the platform if that is more, are left out: the clearance cannot "
            "exceed this length.",
            signed=True,
        ),
        Quantity(
            "nearest_bodies",
            "1",
            "what is nearest",
            "Pair that `clearance` belongs to. 1: two cables; 2: a cable and an obstacle; 3: a cable and the "
            "platform; 4: the platform and an obstacle; 0: nothing can meet, or not requested.",
            "int16",
            meanings="nearest-bodies",
        ),
        Quantity(
            "worst_cable",
            "1",
            "cable whose loss is the worst",
            "Number, from 1 on, of the cable without which the first margin of the map that is requested (of tensions, "
            "closure, capacity, clearance) is the smallest.",
            "int16",
        ),
        Quantity(
            "floor_margin",
            "m",
            "height above the floor",
            "Height above the floor of the lowest point of the effector: its mass centre or joint, its attachment "
            "points and, with interference-free, its shape; negative below it.",
            signed=True,
        ),
        Quantity(
            "length_margin",
            "m",
            "margin of the cable lengths",
            "Largest length of a cable less its length, the smallest over all cables.",
            signed=True,
        ),
        Quantity(
            "speed_margin",
            "m s-1",
            "margin of the cable speeds",
            "Largest speed of a cable less the speed that the required velocities need, the smallest over all cables.",
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
            "cell_open",
            "1",
            "what leaves the whole cell open",
            "Why `cell_side` is 0. 1: positions on both sides, or on the boundary, were found in the cell; 2 to 7: the "
            "centre is inside, and tensions, closure, clearances, floor, lengths or speeds of cables are not proved to "
            "hold in the whole cell; 8: the centre is outside, which is not proved of the whole cell; 0: the side is "
            "proved, or not requested.",
            "int16",
            meanings="open-conditions",
        ),
        Quantity(
            "orientation_fraction",
            "1",
            "part of the orientations",
            "Part of a set of orientations, by volume, that is inside the workspace at a place; 0 or 1 for one pose.",
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
            "Largest in the best direction; 0 where none is feasible, infinite where nothing bounds it.",
        ),
        Quantity(
            "upward_acceleration",
            "m s-2",
            "largest upward acceleration",
            "Largest upward acceleration; infinite where nothing bounds it, 0 where rest is not feasible.",
        ),
        Quantity(
            "downward_acceleration",
            "m s-2",
            "largest downward acceleration",
            "Largest downward acceleration, free fall without a smallest tension; 0 where rest is not feasible.",
        ),
        Quantity(
            "acceleration_time", "s", "time of acceleration p", "Time that the S-model accelerates, before it brakes."
        ),
        Quantity(
            "least_duration",
            "s",
            "least duration of any motion",
            "Duration of the fastest motion along the line, which accelerates at the bound, then brakes at the bound.",
        ),
        Quantity(
            "lower_bound",
            "s",
            "lower bound of the least time",
            "Proved: no motion along the path, with the same stops, takes less time within the limits; of free motions "
            "none at all. NaN where no bound is known.",
        ),
        Quantity("duration_ratio", "1", "duration over the least one", "Duration of the law over `least_duration`."),
        Quantity(
            "rest_margin",
            "m s-2",
            "margin of rest at both ends",
            "Distance of zero acceleration from the nearest face of the feasible accelerations, at the worse end.",
            signed=True,
        ),
        Quantity(
            "active_up",
            "1",
            "bound that holds back the acceleration",
            "Number of the set of cables that spans the bound, from 1 on, in the order 1 2, 1 3, 1 4, 2 3, 2 4, 3 4 "
            "(four cables); then `max_acceleration`, then the limits of the motion; 0: none.",
            "int16",
            meanings="line-bounds",
        ),
        Quantity(
            "active_down",
            "1",
            "bound that holds back the braking",
            "As `active_up`, while the motion brakes.",
            "int16",
            meanings="line-bounds",
        ),
        Quantity(
            "largest_margin",
            "1",
            "largest margin of the segments tried",
            "Largest margin (smallest slack of taut cables, depth and limits) of all launches to the cell that were "
            "tried; below 0 no feasible launch was found, which is no proof that there is none.",
            signed=True,
            better="larger",
        ),
        Quantity(
            "release_speed",
            "m s-1",
            "least speed at the release",
            "Least release speed of the feasible launches found; NaN where none was found.",
            better="smaller",
        ),
        Quantity(
            "swing_amplitude",
            "m",
            "amplitude of the swing",
            "Largest distance from its centre of the ellipse of the slowest release.",
            better="smaller",
        ),
        Quantity(
            "release_time",
            "s",
            "time of the release",
            "Time after the start of the segment, for the launch of least speed.",
        ),
        Quantity(
            "flight_time",
            "s",
            "time of the flight",
            "Time from the release to the landing, for the launch of least speed.",
        ),
        *(
            Quantity(
                f"release_{name}", "m", f"{name} of the release", "Place of the release, for the launch of least speed."
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
            "Largest rotation over the largest error of a cable length, with independent errors of all cables; NaN for "
            "point masses.",
        ),
        Quantity("used_z0", "m", "depth of P0 below the centroid", "Depth of P0 that the inclination requires."),
        Quantity(
            "used_frequency",
            "rad s-1",
            "frequency of the margin",
            "Frequency at which verdict and margin hold; 0, where slower is always better: the limit of slow turns; "
            "NaN: there is none.",
        ),
        Quantity(
            "lowest_frequency",
            "rad s-1",
            "lowest feasible frequency",
            "Lower end of the frequencies at which all cables stay taut, other limits aside; 0 where every slow turn "
            "is feasible, NaN where no frequency is, or spools in several planes allow no formula.",
        ),
        Quantity(
            "highest_frequency",
            "rad s-1",
            "highest feasible frequency",
            "Upper end, likewise; infinite where nothing bounds it.",
        ),
        Quantity(
            "natural_frequency",
            "rad s-1",
            "natural frequency",
            "Of a pendulum from the plane of the spools to the centre; NaN where the centre is not below the spools.",
        ),
        Quantity(
            "binding_cable",
            "1",
            "cable that gets slack first",
            "Number of the cable whose pseudotension is the smallest of all at its smallest, at `used_frequency`; on "
            "redundant cables that of the two cables that alone keep their tension, in the order 1 2, 1 3, ...; the "
            "last number: the depth below the spools; 0: unknown.",
            "int16",
            meanings="slack-cables",
        ),
        Quantity(
            "tension_margin",
            "N",
            "smallest distance of a tension from its limits",
            "Smallest along a turn, of redundant cables that of the tensions that keep it largest; negative where they "
            f"break a limit; NaN where only formulas are used. {_BOUNDED} Plans tell it to rounding.",
            signed=True,
        ),
        Quantity(
            "tension_margin_bound",
            "N",
            "proved lower bound of the distance of tensions from their limits",
            "Proved: `tension_margin` is no smaller at any time of the motion.",
        ),
    )
}
# Quantity of pictures of the ratio of two maps.
RATIO = Quantity("ratio", "1", "ratio", "A quantity of one map over that of another, as `cspr plot --ratio` shows it.")
EVERY = ChainMap(AXES, QUANTITIES, BEST, {RATIO.name: RATIO}, TRAJECTORY, SEGMENTS, FLIGHT, FAILURES, PATHS)
_OWN = frozenset(QUANTITIES)


def is_axis(name: object) -> bool:
    """Tell whether a name is that of an axis of maps."""
    return isinstance(name, str) and (name in AXES or is_parameter(name))


def is_parameter(name: object) -> bool:
    """Tell whether a name is that of an axis of maps that is a parameter of the robot."""
    return isinstance(name, str) and re.fullmatch(re.escape(PARAMETER) + PARAMETER_NAME, name) is not None


def is_of_robot(name: object) -> bool:
    """Tell whether the cells along an axis are of different robots."""
    return is_parameter(name) or name == ARRANGEMENT


def parameter_values(coordinates: Mapping[str, Any]) -> dict[str, float]:
    """Values of the robot's parameters, by their names, among the coordinates of a cell."""
    return {name.removeprefix(PARAMETER): float(coordinates[name]) for name in coordinates if is_of_robot(name)}


def row_of(name: str, settings: Mapping[str, Any] | None = None) -> Quantity:
    """The row of a quantity or an axis; parameters, and their best values, have units in the settings of a sweep."""
    if name in EVERY:
        return EVERY[name]
    best, _, parameter = name.rpartition(PARAMETER)
    tables = (settings or {}).get("robot", {}).get("parameter") or ()
    unit = next((table["unit"] for table in tables if table["name"] == parameter), "1")
    if best == best_name(""):
        words = f"With `--best {PARAMETER}{parameter}`: the best value; NaN where no value is feasible."
        return Quantity(name, unit, f"best {parameter}", words)
    if best:
        raise KeyError(name)
    return Quantity(name, unit, parameter, f"Value of the parameter {parameter} of the robot file.")


def columns_of(name: str, count: int) -> list[str]:
    """Names of the columns of a motion's quantity in a CSV file."""
    if name not in ACROSS:
        return [name]
    return [f"{name}_{part}" for part in PARTS.get(ACROSS[name], [str(k + 1) for k in range(count)])]


def register(quantity: Quantity) -> None:
    """Add a quantity of maps from outside of the package; adding it again changes nothing."""
    present = EVERY.get(quantity.name, quantity)
    if present != quantity:
        raise InputError("quantity", quantity.name, "a name that no other quantity or axis has")
    QUANTITIES[quantity.name] = quantity


def from_outside() -> list[Quantity]:
    """Quantities from outside of the package, of which other processes must be told."""
    return [quantity for name, quantity in QUANTITIES.items() if name not in _OWN]


def flag_attributes() -> dict[str, object]:
    """The CF attributes that explain `verdict`."""
    masks = np.array([flag.value for flag in SENTENCES], FLAGS)
    return {"flag_masks": masks, "flag_meanings": " ".join(flag.text for flag in SENTENCES)}
