"""Quantities of motion files: rows over time, and what there is of each segment."""

from cspr_jax.schema.quantity import Quantity

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
# A motion file holds these quantities for each segment of its plan.
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
# It holds these for an object that the plan releases; the dimensions of each follow.
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
# The second dimension of those over time, and the parts of vectors.
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
