"""Why segments of a plan are not feasible, in numbers: what each needs, and what is allowed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cspr_jax.motion.answers import Answers
from cspr_jax.motion.cause import UNITS, Cause
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.schema.verdicts import NO_REASON, Verdict
from cspr_jax.verification.needs import Need, needs

if TYPE_CHECKING:
    from jaxtyping import Int

# A criterion with a larger slack, without a unit, is met: numbers would not say why.
MET = 1e-6


def cause_columns(each: Sequence[tuple[Cause, ...]]) -> dict[str, np.ndarray]:
    """The worst cause of each segment, as motion files have it."""

    def is_usual(cause: Cause) -> bool:
        return cause.unit == UNITS.get(Verdict[cause.criterion.upper()], cause.unit)

    worst = [segment_causes[0] if segment_causes else Cause("feasible") for segment_causes in each]
    return {
        "segment_cause": np.array([Verdict[cause.criterion.upper()].value for cause in worst]),
        "segment_cause_cable": np.array([cause.cables[0] + 1 if len(cause.cables) == 1 else 0 for cause in worst]),
        "segment_cause_time": np.array([cause.t for cause in worst]),
        # The flag alone says what the unit is: numbers in another one stay out.
        "segment_needed": np.array([cause.needed if is_usual(cause) else np.nan for cause in worst]),
        "segment_allowed": np.array([cause.allowed if is_usual(cause) else np.nan for cause in worst]),
    }


def cause_text(columns: Mapping[str, np.ndarray], i: int) -> str:
    """The worst cause of a segment in words."""
    flag = Verdict(int(columns["segment_cause"][i])) if "segment_cause" in columns else Verdict.FEASIBLE
    if flag.name is None or not flag:
        return ""
    t, needed, allowed = (float(columns[f"segment_{name}"][i]) for name in ("cause_time", "needed", "allowed"))
    cable = int(columns["segment_cause_cable"][i])
    return Cause(flag.text, (cable - 1,) if cable else (), t, needed, allowed, UNITS.get(flag, "m")).text


def causes(
    problem: Problem, frame: Frame, answers: Answers, motions: list[Motion], samples: Int[np.ndarray, "n"]
) -> list:
    """Causes of segments of one family."""
    each = []
    for i, motion in enumerate(motions):
        flags = Verdict(int(answers.verdict[i])) & ~NO_REASON
        known = () if bool(answers.feasible[i]) or not flags else answers.proved_causes(i, frame)
        each.append(_of_segment(problem, frame, flags, answers, i, motion, int(samples[i])) if known is None else known)
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
    return (*rows, *(_of_flag(flag, problem, frame, answers, i, motion) for flag in others))


def _of_need(need: Need, frame: Frame, duration: float) -> Cause:
    needed, allowed = need.needed, need.allowed
    if need.criterion == Verdict.BELOW_FLOOR:
        needed, allowed = (float(frame.height(depth)) for depth in (needed, allowed))
    # Without a motion the time is known at the start alone.
    t = need.tau * duration if need.tau > 0.0 else 0.0
    return Cause(need.criterion.text, need.cables, t, needed, allowed, need.unit)


def _of_flag(flag: Verdict, problem: Problem, frame: Frame, answers: Answers, i: int, motion: Motion) -> Cause:
    # Return the cause of a flag that no instant of the motion raises, or that a choice of tensions does.
    if flag == Verdict.UNCERTAINTY:
        stands = np.fmin(answers.tolerated[i], answers.not_tolerated[i])
        return Cause(flag.text, needed=1.0, allowed=float(stands), unit=UNITS[flag])
    refuted = answers.details(i).get("refuted_at", math.nan)
    if flag == Verdict.WRENCH_INFEASIBLE and not math.isfinite(refuted) and math.isfinite(answers.duration[i]):
        from cspr_jax.verification.attained import attained
        from cspr_jax.verification.proved_answers import cause_of, sampled_proof

        return cause_of(attained(problem, motion, sampled_proof(problem, motion)), 0, frame)
    if flag == Verdict.WRENCH_INFEASIBLE:
        weight = float(problem.robot.mass * problem.robot.gravity) / problem.robot.n_cables
        return Cause(flag.text, (), refuted, float(answers.margin[i]) * weight, 0.0, UNITS[flag])
    # Tensions and limits refute a motion before contacts do.
    is_alone = Verdict(int(answers.verdict[i])) & ~NO_REASON == Verdict.CABLE_PLATFORM
    return Cause(flag.text, t=refuted) if is_alone else Cause(flag.text)
