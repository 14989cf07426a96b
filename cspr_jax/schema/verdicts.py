"""Verdicts: bit flags, each with a sentence. No jax here: files and tables use them too."""

import enum

import numpy as np

# Arrays of flags have this type, in memory and in files.
FLAGS = np.uint32


class Verdict(enum.IntFlag):
    """Flags of the reasons why a trajectory is not, or not certainly, feasible; 0 is feasible."""

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

    @property
    def text(self) -> str:
        """The flags' names joined by "+"; "feasible" without any."""
        return "+".join(flag.name.lower() for flag in type(self) if flag & self and flag.name) or "feasible"


# Flags that do not name the criterion that is broken.
NO_REASON = Verdict.FEWER_ARCS_UNDECIDED | Verdict.NO_ARCS
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
}


def conjunction(flags: np.ndarray) -> np.ndarray:
    """Verdict of several conditions that must all be met: a broken one decides, whatever the others leave open.

    Args:
        flags: (...) flags of all conditions together.

    Returns:
        (...) the flags, without those that leave a verdict open where any other is set.
    """
    refuted = flags & ~flags.dtype.type(OPEN.value)
    return np.where(refuted != 0, refuted, flags)
