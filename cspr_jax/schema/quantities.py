"""The one table of everything that a result file can hold: it gives names, units, labels and docs."""

from collections import ChainMap

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.schema.axes import AXES, BEST
from cspr_jax.schema.limits import LARGEST_MULTIPLE
from cspr_jax.schema.motion_quantities import FLIGHT, HOW, MARGIN, SEGMENTS, TRAJECTORY
from cspr_jax.schema.pose_quantities import POSES
from cspr_jax.schema.quantity import Quantity
from cspr_jax.schema.verdicts import FLAGS, SENTENCES, Verdict

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
        *POSES,
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
