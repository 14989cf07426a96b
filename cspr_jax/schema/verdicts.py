"""Verdicts: bit flags, each with a sentence, and the quantities that criteria bound. No jax: files use them too."""

from __future__ import annotations

import enum
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float

# Type of arrays of flags, in memory and in files.
FLAGS = np.uint32


class Verdict(enum.IntFlag):
    """Flags of the reasons why a motion is not feasible, or not proved feasible; 0 is feasible."""

    FEASIBLE = 0
    SLACK_CABLE = 1
    OVER_TENSION = 2
    SINGULAR = 4
    CABLE_CABLE = 8
    CABLE_PLATFORM = 16
    ABOVE_SPOOLS = 32
    BELOW_FLOOR = 64
    CABLE_TOO_LONG = 128
    CABLE_TOO_FAST = 256
    NO_ARCS = 512
    NOT_FINITE = 1024
    UNDECIDED = 2048
    CABLE_OVER_ACCELERATION = 4096
    FEWER_ARCS_UNDECIDED = 8192
    NOT_ACCESSIBLE = 16384
    WRENCH_INFEASIBLE = 32768
    OBSTACLE = 65536
    UNCERTAINTY = 131072
    TOO_FAST = 262144
    OVER_ACCELERATION = 524288
    OVER_FEED = 1048576
    MOTOR_TOO_FAST = 2097152
    MOTOR_OVER_TORQUE = 4194304
    MOTOR_OVER_POWER = 8388608
    MOTOR_OVER_LOAD = 16777216
    MOTOR_OVER_TORQUE_RMS = 33554432

    @property
    def text(self) -> str:
        """Names of the flags, joined by "+"; "feasible" without flags."""
        return "+".join(flag.name.lower() for flag in type(self) if flag & self and flag.name) or "feasible"


# Flags that do not name a criterion that fails.
NO_REASON = Verdict.FEWER_ARCS_UNDECIDED | Verdict.NO_ARCS
# Flags of answers that are not proved, or not proved to have the smallest number of arcs.
NOT_PROVED = FLAGS(Verdict.UNDECIDED.value | Verdict.FEWER_ARCS_UNDECIDED.value)
# Flags that leave a verdict open.
OPEN = Verdict.UNDECIDED | Verdict.NOT_FINITE
SENTENCES = {
    Verdict.SLACK_CABLE: "A cable would have to push, or falls below its smallest tension.",
    Verdict.OVER_TENSION: "A cable exceeds its largest tension.",
    Verdict.SINGULAR: "The cables cannot carry every wrench at the pose, or at some pose on the way.",
    Verdict.CABLE_CABLE: "Two cables touch.",
    Verdict.CABLE_PLATFORM: "A cable touches the platform.",
    Verdict.ABOVE_SPOOLS: "The effector is on or above the plane of the spools.",
    Verdict.BELOW_FLOOR: "The effector is below the floor, or goes through it.",
    Verdict.CABLE_TOO_LONG: "A cable exceeds its largest length.",
    Verdict.CABLE_TOO_FAST: "A cable exceeds its largest speed.",
    Verdict.NO_ARCS: "No number of arcs up to the largest is feasible; the other flags say what stands in the way.",
    Verdict.NOT_FINITE: "The numbers overflowed or are undefined.",
    Verdict.UNDECIDED: "The margin is within the stated tolerance of zero: neither proved nor refuted.",
    Verdict.CABLE_OVER_ACCELERATION: "A cable exceeds its largest acceleration.",
    Verdict.FEWER_ARCS_UNDECIDED: "Feasible as stated, but a smaller number of arcs could not be refuted.",
    Verdict.NOT_ACCESSIBLE: "No way leads there from the reference orientation without interference or singularity.",
    Verdict.WRENCH_INFEASIBLE: "Within their limits of tension the cables cannot supply a wrench that they must.",
    Verdict.OBSTACLE: "A cable or the platform touches an obstacle.",
    Verdict.UNCERTAINTY: "Feasible for the robot as it is described, but not for every robot within its uncertainty.",
    Verdict.TOO_FAST: "The mass centre exceeds its largest speed.",
    Verdict.OVER_ACCELERATION: "The mass centre exceeds its largest acceleration.",
    Verdict.OVER_FEED: "The mass centre exceeds the feed, the F of G-code.",
    Verdict.MOTOR_TOO_FAST: "A motor exceeds its largest speed.",
    Verdict.MOTOR_OVER_TORQUE: "A motor exceeds its largest torque.",
    Verdict.MOTOR_OVER_POWER: "A motor exceeds its largest power, driving or braking.",
    Verdict.MOTOR_OVER_LOAD: "A motor exceeds its torque-speed line.",
    Verdict.MOTOR_OVER_TORQUE_RMS: "The root mean square of a motor's torque over the full motion exceeds its limit.",
}


class CriterionRow(NamedTuple):
    """Quantity that a criterion bounds, in JSON and in words.

    Fields:
        key: key in JSON, below `demands`.
        words: words in text, and as `words` in JSON.
        unit: unit; "1" for ratios.
    """

    key: str
    words: str
    unit: str


CRITERIA = {
    Verdict.SLACK_CABLE: CriterionRow("tension_min", "smallest tension", "N"),
    Verdict.OVER_TENSION: CriterionRow("tension_max", "largest tension", "N"),
    Verdict.WRENCH_INFEASIBLE: CriterionRow("tension_margin", "distance of tensions from their limits", "N"),
    Verdict.SINGULAR: CriterionRow("determinant", "determinant", "1"),
    Verdict.ABOVE_SPOOLS: CriterionRow("depth", "depth below the spools", "m"),
    Verdict.BELOW_FLOOR: CriterionRow("floor", "lowest z", "m"),
    Verdict.CABLE_TOO_LONG: CriterionRow("cable_length_max", "largest cable length", "m"),
    Verdict.CABLE_TOO_FAST: CriterionRow("cable_speed_max", "largest cable speed", "m/s"),
    Verdict.CABLE_OVER_ACCELERATION: CriterionRow("cable_acceleration_max", "largest cable acceleration", "m/s^2"),
    Verdict.TOO_FAST: CriterionRow("speed_max", "largest speed of the mass centre", "m/s"),
    Verdict.OVER_ACCELERATION: CriterionRow("acceleration_max", "largest acceleration of the mass centre", "m/s^2"),
    Verdict.OVER_FEED: CriterionRow("feed", "feed", "m/s"),
    Verdict.MOTOR_TOO_FAST: CriterionRow("motor_speed_max", "largest motor speed", "rad/s"),
    Verdict.MOTOR_OVER_TORQUE: CriterionRow("motor_torque_max", "largest motor torque", "N m"),
    Verdict.MOTOR_OVER_POWER: CriterionRow("motor_power_max", "largest motor power", "W"),
    Verdict.MOTOR_OVER_LOAD: CriterionRow("motor_load_max", "largest motor load", "1"),
    Verdict.MOTOR_OVER_TORQUE_RMS: CriterionRow("motor_torque_rms_max", "rms motor torque", "N m"),
    Verdict.CABLE_CABLE: CriterionRow("cable_distance", "distance between cables", "m"),
    Verdict.CABLE_PLATFORM: CriterionRow("platform_distance", "distance of cables from the platform", "m"),
    Verdict.OBSTACLE: CriterionRow("obstacle_distance", "distance from obstacles", "m"),
}


def criterion_words(flag: Verdict, cable: int | None = None, feed: str = "") -> str:
    """Words for the quantity that a criterion bounds."""
    row = CRITERIA.get(flag)
    words = row.words if row is not None else flag.text.replace("_", " ")
    if cable is not None:
        device = "motor" if "motor" in words else "cable"
        return f"{words.replace(f'{device} ', '')} of {device} {cable + 1}"
    return f"{words} {feed}".rstrip()


def conjunction(flags: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Verdict of several conditions that must all be met: if one fails, others that are undecided do not matter."""
    refuted = flags & ~flags.dtype.type(OPEN.value)
    return np.where(refuted != 0, refuted, flags)
