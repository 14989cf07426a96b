"""Why segments of a plan are not feasible, in numbers: what each needs, and what is allowed."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cspr_jax.arithmetic.frames import Frame
from cspr_jax.motions.answers import Answers
from cspr_jax.motions.motion import Motion
from cspr_jax.motions.needs import Need, needs
from cspr_jax.motions.problem import Problem
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import NO_REASON, Verdict

# Digits that a number has at least, and at most where fewer do not tell it from another one.
DIGITS, MOST_DIGITS = 3, 12
# A criterion with a larger slack, without a unit, is met: numbers would not say why.
MET = 1e-6
# By flag: what the motion does, in words; {cable} is "cable 1", or "cables 1 and 3".
_WORDS = {
    Verdict.SLACK_CABLE: "{cable} has {needed} {unit}{when}, at least {allowed} needed",
    Verdict.ABOVE_SPOOLS: "{missed} {unit} above the plane of the spools{when}",
    Verdict.BELOW_FLOOR: "z = {needed} {unit}{when}, the floor is at {allowed}",
    Verdict.SINGULAR: "the cables cannot carry every wrench{when}",
    Verdict.CABLE_CABLE: "{cable} touch{when}",
    Verdict.CABLE_PLATFORM: "a cable touches the platform{when}",
    Verdict.WRENCH_INFEASIBLE: "the tensions miss their limits by {missed} {unit}{when}",
    Verdict.UNCERTAINTY: "it stands {allowed} of the uncertainty, {needed} needed",
}
UNITS = {row.flag: row.unit for row in LIMITS} | {Verdict.UNCERTAINTY: "1", Verdict.WRENCH_INFEASIBLE: "N"}
_USUAL = "{cable} needs {needed} {unit}{when}, {allowed} allowed"


@dataclasses.dataclass(frozen=True)
class Cause:
    """A criterion that stands between a segment and feasible.

    Fields:
        criterion: name of its flag, as verdicts have it.
        cables: numbers from 0 on: of one cable, of two that touch, or none.
        t: when it is broken by most, since the start of the segment, s; NaN where that is not known.
        needed: what the segment has there, in the axes of the robot file; NaN likewise.
        allowed: the most, or the least, that it may have.
        unit: of both; "" where there are none.
    """

    criterion: str
    cables: tuple[int, ...] = ()
    t: float = math.nan
    needed: float = math.nan
    allowed: float = math.nan
    unit: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The cause as a plan's JSON has it.

        Returns:
            plain values.
        """
        table: dict[str, Any] = {"criterion": self.criterion, "cable": self.cables[0] if self.cables else None}
        if len(self.cables) > 1:
            table["cables"] = list(self.cables)
        return table | {"t": self.t, "needed": self.needed, "allowed": self.allowed, "unit": self.unit or None}

    @property
    def text(self) -> str:
        """The cause in words, such as "cable 1 needs 3.07 m/s at t = 0.75 s, 2.5 allowed"."""
        flag, numbers = Verdict[self.criterion.upper()], " and ".join(str(k + 1) for k in self.cables)
        if not math.isfinite(self.needed) and flag not in (Verdict.SINGULAR, Verdict.CABLE_PLATFORM):
            return flag.text.replace("_", " ")
        needed, allowed = _told_apart(self.needed, self.allowed)
        return _WORDS.get(flag, _USUAL).format(
            cable=f"cable{'s' if len(self.cables) > 1 else ''} {numbers}",
            needed=needed,
            allowed=allowed,
            missed=f"{-self.needed:.{DIGITS}g}",
            unit=self.unit.replace("^2", "²"),
            when=f" at t = {self.t:.2f} s" if math.isfinite(self.t) else "",
        )


def cause_columns(each: Sequence[tuple[Cause, ...]]) -> dict[str, np.ndarray]:
    """The worst cause of each segment, as motion files have it.

    Args:
        each: causes of n segments, the worst one first.

    Returns:
        (n,) by the names of `schema.quantities.SEGMENTS`.
    """
    worst = [segment_causes[0] if segment_causes else Cause("feasible") for segment_causes in each]
    return {
        "segment_cause": np.array([Verdict[cause.criterion.upper()].value for cause in worst]),
        "segment_cause_cable": np.array([cause.cables[0] + 1 if len(cause.cables) == 1 else 0 for cause in worst]),
        "segment_cause_time": np.array([cause.t for cause in worst]),
        "segment_needed": np.array([cause.needed for cause in worst]),
        "segment_allowed": np.array([cause.allowed for cause in worst]),
    }


def cause_text(columns: Mapping[str, np.ndarray], i: int) -> str:
    """The worst cause of a segment in words.

    Args:
        columns: of `cause_columns`, or of a file that may lack them.
        i: number of the segment.

    Returns:
        the words; empty where nothing is known.
    """
    flag = Verdict(int(columns["segment_cause"][i])) if "segment_cause" in columns else Verdict.FEASIBLE
    if flag.name is None or not flag:
        return ""
    t, needed, allowed = (float(columns[f"segment_{name}"][i]) for name in ("cause_time", "needed", "allowed"))
    cable = int(columns["segment_cause_cable"][i])
    return Cause(flag.text, (cable - 1,) if cable else (), t, needed, allowed, UNITS.get(flag, "m")).text


def _told_apart(first: float, second: float) -> tuple[str, str]:
    # Write two numbers with so many digits that they differ.
    for digits in range(DIGITS, MOST_DIGITS + 1):
        texts = tuple(f"{value:.{digits}g}" for value in (first, second))
        if texts[0] != texts[1]:
            break
    return texts[0], texts[1]


def causes(problem: Problem, frame: Frame, answers: Answers, motions: list[Motion], samples: np.ndarray) -> list:
    """Causes of segments of one family.

    Args:
        motions: theirs, from the centroid of the spools, z down.
        samples: (n,) equidistant instants to begin with, at least three.

    Returns:
        for each segment a tuple of its causes, the worst one first; none of a feasible one.
    """
    each = []
    for i, motion in enumerate(motions):
        flags = Verdict(int(answers.verdict[i])) & ~NO_REASON
        is_known = bool(answers.feasible[i]) or not flags
        each.append(() if is_known else _of_segment(problem, frame, flags, answers, i, motion, int(samples[i])))
    return each


def _of_segment(
    problem: Problem, frame: Frame, flags: Verdict, answers: Answers, i: int, motion: Motion, samples: int
) -> tuple[Cause, ...]:
    duration, numbers = float(answers.duration[i]), needs(problem, motion, samples)
    # Tensions grow without bound towards the plane of the spools.
    numbered = flags & ~Verdict.SLACK_CABLE if Verdict.ABOVE_SPOOLS in flags else flags
    rows = [_of_need(need, frame, duration) for need in numbers if need.criterion in numbered and need.slack < MET]
    known = {row.criterion for row in rows}
    others = (flag for flag in flags if flag.text not in known)
    return (*rows, *(_of_flag(flag, problem, answers, i) for flag in others))


def _of_need(need: Need, frame: Frame, duration: float) -> Cause:
    needed, allowed = need.needed, need.allowed
    if need.criterion == Verdict.BELOW_FLOOR:
        needed, allowed = (float(frame.height(depth)) for depth in (needed, allowed))
    # Without a motion the time is known at the start alone.
    t = need.tau * duration if need.tau > 0.0 else 0.0
    return Cause(need.criterion.text, need.cables, t, needed, allowed, need.unit)


def _of_flag(flag: Verdict, problem: Problem, answers: Answers, i: int) -> Cause:
    # Return the cause of a flag that no instant of the motion raises, or that a choice of tensions does.
    if flag == Verdict.UNCERTAINTY:
        stands = np.fmin(answers.tolerated[i], answers.not_tolerated[i])
        return Cause(flag.text, needed=1.0, allowed=float(stands), unit=UNITS[flag])
    refuted = answers.details(i).get("refuted_at", math.nan)
    if flag == Verdict.WRENCH_INFEASIBLE:
        weight = float(problem.robot.mass * problem.robot.gravity) / problem.robot.n_cables
        return Cause(flag.text, (), refuted, float(answers.margin[i]) * weight, 0.0, UNITS[flag])
    return Cause(flag.text, t=refuted) if flag == Verdict.CABLE_PLATFORM else Cause(flag.text)
