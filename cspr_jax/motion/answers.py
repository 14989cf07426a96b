"""Answers about segments of motions: the record that every family returns."""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol, TypeVar

import numpy as np

from cspr_jax.motion.cause import UNITS, Cause
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Bool, Int
from cspr_jax.schema.columns import Columns
from cspr_jax.schema.verdicts import FLAGS, NO_REASON, Verdict

AnyAnswers = TypeVar("AnyAnswers", bound="Answers")
# The only flag that feasible motions may have.
FEWER = FLAGS(Verdict.FEWER_ARCS_UNDECIDED)


class SegmentProof(Protocol):
    """Proof of one motion by bounds of its states; see `verification.proved_answers.MotionProof`."""

    @property
    def verdict(self) -> Verdict:
        """Flags of the criteria that fail; without any, feasible or undecided."""

    @property
    def details(self) -> dict[str, Any]:
        """Intervals of failure, by their names in a plan's JSON."""

    def causes(self, frame: Frame, flags: Verdict) -> tuple[Cause, ...]:
        """Why the motion is not feasible: the criteria of some flags, the worst one first."""


@dataclasses.dataclass(frozen=True)
class Answers(Columns):
    """One answer for each segment.

    Fields:
        arcs: (n,) smallest number of arcs proved feasible; 0: none.
        tried_arcs: (n,) number of arcs to which duration and margins belong: `arcs` if that is not 0, else of the
            candidate that fails a single limit, else of the candidate with the largest margin.
        verdict: (n,) `Verdict` flags; 0 is feasible.
        duration: (n,) s.
        margin: (n,) smallest normalised pseudotension, or depth below the spools over z0.
        margin_bound: (n,) proved lower bound of the margin; NaN where nothing is proved.
        limit_margin: (n,) smallest slack of the limits; inf without limits.
        feasible_at_infinity: (n,) left-hand side of (2.55); positive if enough arcs make the segment feasible.
        tolerated: (n,) largest multiple of the uncertainty that the motion is proved to tolerate; NaN without one.
        not_tolerated: (n,) smallest multiple at which a robot was found that fails.
        margin_unit: unit of both margins.
        proof: (n,) `SegmentProof` of each motion; None: it rests on a faster proof of its family alone.
    """

    arcs: np.ndarray
    tried_arcs: np.ndarray
    verdict: np.ndarray
    duration: np.ndarray
    margin: np.ndarray
    margin_bound: np.ndarray
    limit_margin: np.ndarray
    feasible_at_infinity: np.ndarray
    tolerated: np.ndarray
    not_tolerated: np.ndarray
    margin_unit: str = dataclasses.field(default="1", kw_only=True)
    proof: np.ndarray = dataclasses.field(default_factory=lambda: np.empty(0, object), kw_only=True)

    def __post_init__(self) -> None:
        """Fill in None as the proof of segments that have none."""
        if len(self.proof) != len(self.verdict):
            object.__setattr__(self, "proof", np.full(len(self.verdict), None))

    @property
    def feasible(self) -> np.ndarray:
        """Tell whether each segment is proved feasible, (n,); a smaller number of arcs may still be undecided."""
        return (self.verdict & ~FEWER) == 0

    def rows(self: AnyAnswers, index: Bool[np.ndarray, "m"] | Int[np.ndarray, "m"]) -> AnyAnswers:
        """Some of the answers."""
        return dataclasses.replace(self, **{name: values[index] for name, values in self.arrays().items()})

    def details(self, i: int) -> dict[str, Any]:
        """Details of a segment that only this kind of answers has, by their names in a plan's JSON."""
        details = {} if self.proof[i] is None or not np.isfinite(self.duration[i]) else self.proof[i].details
        return {"margin_unit": self.margin_unit} | details

    def every_section(self) -> list[Any]:
        """Sections of paths that the segments run along."""
        return []

    def causes_of(self, i: int, frame: Frame) -> tuple[Cause, ...]:
        """Why a segment is not feasible, the worst cause first."""
        flags = Verdict(int(self.verdict[i])) & ~NO_REASON
        if self.feasible[i] or not flags:
            return ()
        stands = float(np.fmin(self.tolerated[i], self.not_tolerated[i]))
        if Verdict.UNCERTAINTY in flags or (np.isfinite(stands) and not self.proof[i].verdict):
            flag = Verdict.UNCERTAINTY
            return (Cause(flag.text, needed=1.0, allowed=stands, unit=UNITS[flag]),)
        return self.proof[i].causes(frame, flags)


def joined(parts: list[AnyAnswers]) -> AnyAnswers:
    """Answers of several parts as one record."""
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in parts[0].arrays()
    }
    return dataclasses.replace(parts[0], **columns)


def replaced(
    answers: AnyAnswers, index: Int[np.ndarray, "m"], others: Answers, chosen: Int[np.ndarray, "m"]
) -> AnyAnswers:
    """Answers with some of them replaced by others."""
    columns: dict[str, Any] = {name: np.array(values) for name, values in answers.arrays().items()}
    for name, values in columns.items():
        values[index] = getattr(others, name)[chosen]
    return dataclasses.replace(answers, **columns)
